"""A detection as a rerun recording: the shape, what was found, and every iteration of the refinement.

Positions are relative to the centre of the detection, in input units: single precision loses nothing, however far from
the origin the object lies. The parent of all of them is scaled by a power of ten, so that objects of any size are seen.
"""

import hashlib
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from symrefine.detection.result import Detection
from symrefine.errors import InputError
from symrefine.files import whole
from symrefine.fit.refine import Iterate
from symrefine.geometry import Array, Plane
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.picture.measures import series, theta_series_deg, turn_series_deg
from symrefine.picture.palette import AXIS as DARK
from symrefine.picture.palette import CONTRADICTED, INFERRED, MISS, OBJECT, OUTLIER, Colour, plane_colour
from symrefine.picture.scene import Line, Quad, Scene, make_scene
from symrefine.shape import Index, Shape
from symrefine.viewer.layout import SERIES, blueprint
from symrefine.viewer.text import iteration_line, markdown, report_lines

TIMELINE = "iteration"
# Correspondences drawn for each iteration, over all operations.
PAIRS = 300
# Colours for a dark background.
PAIR: Colour = (255, 150, 60)
TUPLE: Colour = (240, 228, 66)
AXIS: Colour = (245, 247, 250)
OPACITY, MISS_OPACITY = 60, 40
MATCHED: Colour = (110, 120, 138)
RAY: Colour = (70, 90, 80)
# Radius of a point and length of the longest n-tuple, in diagonals.
POINT, ARROW = 0.0035, 0.42


def record(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write a recording (`.rrd` by custom) of a detection and the shape that `detect` was given.

    Equal input gives equal content (`rerun rrd compare`).

    Raises:
        InputError: the file cannot be written.
    """
    scene = make_scene(detection, shape)
    with whole(Path(path)) as draft, _errors_of_the_system():
        # The viewer keeps one layout for each application, so each object is one; rerun allows few characters there.
        application = "symrefine-" + re.sub(r"[^A-Za-z0-9]+", "-", Path(shape.source).stem)[:60].strip("-")
        identity = _identity(detection, shape)
        stream = rr.RecordingStream(application, recording_id=identity, send_properties=False)
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(draft, default_blueprint=blueprint(detection, scene, display_scale(scene)))
        try:
            _log(stream, detection, shape, scene)
        finally:
            stream.disconnect()
        if not draft.exists():
            raise InputError(f"{path}: rerun wrote nothing; is the environment variable RERUN set to off?")


@contextmanager
def _errors_of_the_system() -> Iterator[None]:
    """Raise what the system told rerun (no room, say) as an error of the system."""
    try:
        yield
    except RuntimeError as error:
        told = re.search(r"\(os error ([0-9]+)\)", str(error))
        if told is None:
            raise
        raise OSError(int(told[1]), os.strerror(int(told[1]))) from error


def _log(stream: Any, detection: Detection, shape: Shape, scene: Scene) -> None:
    _log_shape(stream, detection, shape, scene)
    _log_candidates(stream, detection, scene)
    _log_found(stream, scene)
    _log_tuples(stream, detection, scene)
    _log_refinement(stream, detection, scene)
    _log_texts(stream, detection, shape)
    stream.flush()


def display_scale(scene: Scene) -> float:
    """The power of ten that makes the diagonal a number from 1 to 10."""
    return float(10.0 ** -math.floor(math.log10(scene.stage.diagonal)))


def _identity(detection: Detection, shape: Shape) -> str:
    """A name for the content: the viewer merges recordings of one name."""
    digest = hashlib.sha256(shape.points.tobytes())
    digest.update(repr((shape.source, detection.point_group, detection.tolerance, detection.center.tolist())).encode())
    return digest.hexdigest()[:32]


def _log_shape(stream: Any, detection: Detection, shape: Shape, scene: Scene) -> None:
    stream.log("object", rr.Transform3D(scale=display_scale(scene)), static=True)
    points = (shape.points - scene.stage.center).astype(np.float32)
    if shape.faces is None:
        _log_cloud(stream, points, detection.outliers, scene)
        return
    corners = points[shape.faces].reshape(-1, 3)
    normals = np.repeat(triangle_areas_and_normals(points, shape.faces)[1], 3, axis=0)
    mesh = rr.Mesh3D(vertex_positions=corners, vertex_normals=normals, albedo_factor=[*OBJECT, 255])
    stream.log("object/mesh", mesh, static=True)


def _log_cloud(stream: Any, points: Array, outliers: Index, scene: Scene) -> None:
    """Points by what is known of them; of an incomplete scan also those that are inferred, and what cameras saw."""
    parts = {"cloud": (np.delete(points, outliers, axis=0), OBJECT), "outliers": (points[outliers], OUTLIER)}
    if scan := scene.scan:
        parts["cloud"] = (scan.seen[~scan.contradicted], OBJECT)
        parts |= {
            "contradicted": (scan.seen[scan.contradicted], _bright(CONTRADICTED)),
            "inferred": (scan.inferred, _bright(INFERRED)),
            "cameras": (np.unique(scan.rays[:, 0], axis=0), AXIS),
        }
        if len(scan.rays):
            rays = rr.LineStrips3D(list(scan.rays), colors=[RAY], radii=[_pixels(0.4)])
            stream.log("object/cameras/free_space", rays, static=True)
    for name, (some, colour) in parts.items():
        if len(some):
            seen = rr.Points3D(some, colors=[colour], radii=[POINT * scene.stage.diagonal])
            stream.log(f"object/{name}", seen, static=True)


def _log_candidates(stream: Any, detection: Detection, scene: Scene) -> None:
    """What was proposed and given up, as lines: of a mirror a piece of its normal; the darker, the worse it looked."""
    size, lines, colours = scene.stage.diagonal, [], []
    for found in detection.candidates:
        foot = found.point - scene.stage.center
        half = 0.5 * size if found.point_group != "Cs" else 0.06 * size
        lines.append([foot - half * found.direction, foot + half * found.direction])
        share = 1.0 / max(found.excess, 1.0)
        colours.append([round(b + share * (t - b)) for b, t in zip(MISS, TUPLE, strict=True)])
    if lines:
        proposed = rr.LineStrips3D(lines, colors=colours, radii=[_pixels(0.8)])
        stream.log("object/candidates", proposed, static=True)


def _log_found(stream: Any, scene: Scene) -> None:
    """Planes, axes and near misses, the same at all times."""
    for number, quad in enumerate(scene.planes, start=1):
        _log_quad(stream, f"object/planes/{number}", quad, OPACITY, static=True)
    named = scene.main_axes if scene.crowded else scene.axes
    for number, line in enumerate(scene.axes, start=1):
        _log_line(stream, f"object/axes/{number}", line, named=line in named)
    for quad in scene.missed_planes:
        _log_quad(stream, f"object/near_misses/{quad.name.split()[-1]}", quad, MISS_OPACITY, static=True)
    for line in scene.missed_axes:
        _log_line(stream, f"object/near_misses/{line.name.split(',')[0].split()[-1]}", line)


def _log_quad(stream: Any, entity: str, quad: Quad, opacity: int, *, static: bool = False) -> None:
    """A translucent sheet, and its edge with a name at a corner."""
    sheet = rr.Mesh3D(
        vertex_positions=quad.corners,
        triangle_indices=[[0, 1, 2], [0, 2, 3]],
        vertex_normals=np.tile(quad.normal, (4, 1)),
        albedo_factor=[*_bright(quad.colour), opacity],
    )
    stream.log(entity, sheet, static=static)
    edge = rr.LineStrips3D([[*quad.corners, quad.corners[0]]], colors=[_bright(quad.colour)], radii=[_pixels(1.2)])
    stream.log(f"{entity}/edge", edge, static=static)
    beside = quad.corners[2] + 0.05 * (quad.corners[2] - quad.corners.mean(axis=0))
    _log_name(stream, f"{entity}/name", beside, quad.name, _bright(quad.colour), static=static)


def _log_name(stream: Any, entity: str, at: Array, name: str, colour: Colour, *, static: bool) -> None:
    point = rr.Points3D([at], labels=[name], show_labels=True, colors=[colour], radii=[_pixels(0.5)])
    stream.log(entity, point, static=static)


def _log_line(stream: Any, entity: str, line: Line, *, named: bool = True) -> None:
    colour = AXIS if line.colour == DARK else line.colour
    strips = [line.ends] + ([line.mark] if len(line.mark) else [])
    stream.log(entity, rr.LineStrips3D(strips, colors=[colour], radii=[_pixels(1.5)]), static=True)
    if named:
        _log_name(stream, f"{entity}/name", line.ends[1], line.name, colour, static=True)


def _bright(colour: Colour) -> Colour:
    """The same hue for a dark background."""
    r, g, b = (min(255, round(0.72 * c + 80)) for c in colour)
    return r, g, b


def _pixels(width: float) -> float:
    """A radius in points of the screen, which rerun writes as a negative number."""
    return -width


def _log_tuples(stream: Any, detection: Detection, scene: Scene) -> None:
    """The n-tuples as arrows from the centre; the longest has the length ARROW, unless all are mere noise."""
    vectors = detection.vectors.vectors
    longest = float(np.linalg.norm(vectors, axis=1).max())
    reach = ARROW if detection.tuples.kind == "vanish" else ARROW / max(longest, 1e-12)
    arrows = rr.Arrows3D(
        vectors=reach * scene.stage.diagonal * vectors,
        origins=np.tile(detection.origin - scene.stage.center, (len(vectors), 1)),
        colors=[TUPLE],
        radii=[0.006 * scene.stage.diagonal],
        labels=list(detection.vectors.labels),
        show_labels=False,
    )
    stream.log("object/ntuples", arrows, static=True)


def _log_refinement(stream: Any, detection: Detection, scene: Scene) -> None:
    """The points that were matched; planes and correspondences at every iteration; the series."""
    if detection.history:
        matched = detection.scale * detection.points + (detection.origin - scene.stage.center)
        points = rr.Points3D(matched, colors=[MATCHED], radii=[0.6 * POINT * scene.stage.diagonal])
        stream.log("object/refinement/points", points, static=True)
    for before, now in zip((None, *detection.history), detection.history, strict=False):
        stream.set_time(TIMELINE, sequence=now.index)
        for number, quad in enumerate(_moving(detection, scene, now), start=1):
            _log_quad(stream, f"object/refinement/planes/{number}", quad, OPACITY)
        if before is not None:
            _log_pairs(stream, detection, scene, before, now)
    stream.reset_time()
    _log_series(stream, detection)


def _moving(detection: Detection, scene: Scene, now: Iterate) -> list[Quad]:
    """The planes of an iterate in input units, named and coloured as the ones they become."""
    final = [q.normal for q in scene.planes]
    quads = []
    for plane in now.state.planes:
        offset = detection.scale * plane.offset + float(plane.normal @ detection.origin)
        here = Plane(normal=plane.normal, offset=offset)
        same = [k for k, n in enumerate(final) if abs(n @ plane.normal) > math.cos(math.radians(3.0))]
        name, colour = (scene.planes[same[0]].name, plane_colour(same[0])) if same else ("", MISS)
        quads.append(scene.stage.quad(here, name, colour))
    return quads


def _log_pairs(stream: Any, detection: Detection, scene: Scene, before: Iterate, now: Iterate) -> None:
    """Lines from moved sources, as they were matched, to their targets: pairs were found before the frame moved."""
    segments = []
    for motion, pairs in zip(before.state.motions, now.pairs, strict=True):
        step = max(1, -(-len(pairs.sources) * len(now.pairs) // PAIRS))
        moved = motion.apply(detection.points[pairs.sources[::step]])
        segments.append(np.stack([moved, detection.points[pairs.targets[::step]]], axis=1))
    drawn = np.concatenate(segments)[:PAIRS] if segments else np.zeros((0, 2, 3))
    drawn = detection.scale * drawn + (detection.origin - scene.stage.center)
    lines = rr.LineStrips3D(list(drawn), colors=[PAIR], radii=[_pixels(1.5)])
    stream.log("object/refinement/pairs", lines)
    heads = rr.Points3D(drawn[:, 0], colors=[PAIR], radii=[_pixels(2.2)])
    stream.log("object/refinement/pairs/sources", heads)


def _log_series(stream: Any, detection: Detection) -> None:
    history = detection.history
    for name, (title, colour) in SERIES.items():
        if values := turn_series_deg(history) if name == "turn_deg" else series(history, name):
            _send(stream, f"series/{name}", title, colour, values)
    for k, column in enumerate(theta_series_deg(history)):
        _send(stream, f"series/theta_deg/{k + 1}", f"theta {k + 1} [deg]", _bright(plane_colour(k)), column)
    for now in history:
        stream.set_time(TIMELINE, sequence=now.index)
        stream.log("log", rr.TextLog(iteration_line(now, detection), level="INFO"))
    stream.reset_time()


def _send(stream: Any, entity: str, title: str, colour: Colour, values: list[float]) -> None:
    stream.log(entity, rr.SeriesLines(names=[title], colors=[colour], widths=[2.0]), static=True)
    if len(values) == 1:  # no line to be seen
        stream.log(entity, rr.SeriesPoints(names=[title], colors=[colour], marker_sizes=[4.0]), static=True)
    times = rr.TimeColumn(TIMELINE, sequence=range(1, len(values) + 1))
    stream.send_columns(entity, indexes=[times], columns=rr.Scalars.columns(scalars=values))


def _log_texts(stream: Any, detection: Detection, shape: Shape) -> None:
    report = markdown(detection, shape)
    stream.log("report", rr.TextDocument(report, media_type=rr.MediaType.MARKDOWN), static=True)
    stream.set_time(TIMELINE, sequence=detection.history[-1].index if detection.history else 0)
    for line in report_lines(detection, shape):
        stream.log("log", rr.TextLog(line, level="INFO"))
    stream.reset_time()
