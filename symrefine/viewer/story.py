"""The recording as it can be scrubbed: what moments say, what is proposed, every iteration, what was found.

Steps of the timeline "story": the object alone, its n-tuples, the candidates that were given up, one step for each
iterate with its planes, its correspondences and what it misses by, and the result.
"""

import math
from typing import Any

import numpy as np
import rerun as rr

from symrefine.detection.result import Detection
from symrefine.fit.refine import Iterate
from symrefine.geometry import Plane
from symrefine.picture.measures import series, theta_series_deg, turn_series_deg
from symrefine.picture.palette import MISS, OBJECT, Colour, plane_colour
from symrefine.picture.scene import Quad, Scene
from symrefine.picture.words import TUPLES, count
from symrefine.shape import Shape
from symrefine.viewer.layout import SERIES, STORY
from symrefine.viewer.marks import MISS_OPACITY, OPACITY, bright, log_line, log_quad, pixels
from symrefine.viewer.text import iteration_line, report_lines

TIMELINE = "iteration"
# Steps of the story before the first iterate.
BARE, MOMENTS, PROPOSED = range(3)
# Correspondences drawn for each iteration, over all operations; operations whose misses are shown.
PAIRS, SHOWN = 300, 12
PAIR: Colour = (255, 150, 60)
TUPLE: Colour = (240, 228, 66)
MATCHED: Colour = (110, 120, 138)
# What misses by the tolerance, or more.
HOT: Colour = (255, 70, 40)
# Radius of a point and length of the longest n-tuple, in diagonals.
POINT, ARROW = 0.0035, 0.42


def log_story(stream: Any, detection: Detection, shape: Shape, scene: Scene) -> None:
    """Log what changes along the story, and the series of the refinement."""
    go_to(stream, BARE)
    say(stream, "the object")
    go_to(stream, MOMENTS)
    _log_tuples(stream, detection, scene)
    say(stream, f"n-tuples {TUPLES[detection.tuples.kind]}")
    go_to(stream, PROPOSED)
    _log_candidates(stream, detection, scene)
    say(stream, f"{count(len(detection.candidates), 'candidate')} proposed beside, and given up at a glance")
    last = detection.history[-1].index if detection.history else 0
    if detection.history:
        _log_refinement(stream, detection, scene)
    go_to(stream, PROPOSED + 2 + last, last)
    stream.log("object/candidates", rr.Clear(recursive=True))
    _log_found(stream, scene)
    for line in report_lines(detection, shape):
        say(stream, line)
    stream.reset_time()
    _log_series(stream, detection)


def _log_refinement(stream: Any, detection: Detection, scene: Scene) -> None:
    """The points that are matched, every iterate, and that what belongs to iterates ends with them."""
    matched = detection.scale * detection.points + (detection.origin - scene.stage.center)
    points = rr.Points3D(matched, colors=[MATCHED], radii=[0.6 * POINT * scene.stage.diagonal])
    stream.log("object/refinement/points", points, static=True)
    for before, now in zip((None, *detection.history), detection.history, strict=False):
        go_to(stream, PROPOSED + 1 + now.index, now.index)
        stream.log("object/candidates", rr.Clear(recursive=True))
        _log_iterate(stream, detection, scene, before, now)
    go_to(stream, PROPOSED + 2 + now.index, now.index)
    stream.log("object/refinement", rr.Clear(recursive=True))


def go_to(stream: Any, step: int, iteration: int | None = None) -> None:
    """What is logged from here on belongs to this step of the story, and to this iteration."""
    stream.reset_time()
    stream.set_time(STORY, sequence=step)
    if iteration is not None:
        stream.set_time(TIMELINE, sequence=iteration)


def say(stream: Any, line: str) -> None:
    """A line of the log."""
    stream.log("log", rr.TextLog(line, level="INFO"))


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
        proposed = rr.LineStrips3D(lines, colors=colours, radii=[pixels(0.8)])
        stream.log("object/candidates", proposed)


def _log_found(stream: Any, scene: Scene) -> None:
    """Planes, axes and near misses."""
    for number, quad in enumerate(scene.planes, start=1):
        log_quad(stream, f"object/planes/{number}", quad, OPACITY)
    named = scene.main_axes if scene.crowded else scene.axes
    for number, line in enumerate(scene.axes, start=1):
        log_line(stream, f"object/axes/{number}", line, named=line in named)
    for quad in scene.missed_planes:
        log_quad(stream, f"object/near_misses/{quad.name.split()[-1]}", quad, MISS_OPACITY)
    for line in scene.missed_axes:
        log_line(stream, f"object/near_misses/{line.name.split(',')[0].split()[-1]}", line)


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
    stream.log("object/ntuples", arrows)


def _log_iterate(stream: Any, detection: Detection, scene: Scene, before: Iterate | None, now: Iterate) -> None:
    """The planes of an iterate, what its operations miss by, and the correspondences that led to it."""
    for number, quad in enumerate(_moving(detection, scene, now), start=1):
        log_quad(stream, f"object/refinement/planes/{number}", quad, OPACITY)
    _log_misses(stream, detection, scene, now)
    if before is not None:
        _log_pairs(stream, detection, scene, before, now)
    say(stream, iteration_line(now, detection))


def _log_misses(stream: Any, detection: Detection, scene: Scene, now: Iterate) -> None:
    """The surface, the hotter the more the worst of the operations misses it by."""
    motions = now.state.motions
    some = motions[:: max(1, -(-len(motions) // SHOWN))]
    worst = detection.surface.misses(some).max(axis=0) / detection.tolerance
    warm = np.minimum(worst, 1.0)[:, None] * (np.array(HOT) - OBJECT) + OBJECT
    places = detection.scale * detection.surface.cloud.points + (detection.origin - scene.stage.center)
    points = rr.Points3D(places, colors=warm.round().astype(np.uint8), radii=[1.2 * POINT * scene.stage.diagonal])
    stream.log("object/refinement/misses", points)


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
    lines = rr.LineStrips3D(list(drawn), colors=[PAIR], radii=[pixels(1.5)])
    stream.log("object/refinement/pairs", lines)
    heads = rr.Points3D(drawn[:, 0], colors=[PAIR], radii=[pixels(2.2)])
    stream.log("object/refinement/pairs/sources", heads)


def _log_series(stream: Any, detection: Detection) -> None:
    history = detection.history
    for name, (title, colour) in SERIES.items():
        if values := turn_series_deg(history) if name == "turn_deg" else series(history, name):
            _send(stream, f"series/{name}", title, colour, values)
    for k, column in enumerate(theta_series_deg(history)):
        _send(stream, f"series/theta_deg/{k + 1}", f"theta {k + 1} [deg]", bright(plane_colour(k)), column)


def _send(stream: Any, entity: str, title: str, colour: Colour, values: list[float]) -> None:
    stream.log(entity, rr.SeriesLines(names=[title], colors=[colour], widths=[2.0]), static=True)
    if len(values) == 1:  # no line to be seen
        stream.log(entity, rr.SeriesPoints(names=[title], colors=[colour], marker_sizes=[4.0]), static=True)
    iterations = np.arange(1, len(values) + 1)
    times = [rr.TimeColumn(TIMELINE, sequence=iterations), rr.TimeColumn(STORY, sequence=PROPOSED + 1 + iterations)]
    stream.send_columns(entity, indexes=times, columns=rr.Scalars.columns(scalars=values))
