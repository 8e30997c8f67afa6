"""A detection as a rerun recording: the shape, what was found, and every iteration of the refinement.

Positions are relative to the centre of the detection, in input units: single precision loses nothing, however far from
the origin the object lies. The parent of all of them is scaled by a power of ten, so that objects of any size are seen.
"""

import hashlib
import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from symrefine.detection.result import Detection
from symrefine.errors import InputError, SymrefineError
from symrefine.files import whole
from symrefine.geometry import Array
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.picture.palette import CONTRADICTED, INFERRED, OBJECT, OUTLIER, Colour
from symrefine.picture.scene import Scene, make_scene
from symrefine.shape import Index, Shape
from symrefine.viewer.layout import blueprint
from symrefine.viewer.marks import AXIS, bright, pixels
from symrefine.viewer.opening import open_recording
from symrefine.viewer.story import POINT, log_story
from symrefine.viewer.text import markdown

RAY: Colour = (70, 90, 80)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """What a viewer shows: a stream of rerun, how it looks when it opens, and what logs all that it holds."""

    stream: Any
    layout: Any
    log: Callable[[Any], None]

    def write(self, path: Path) -> None:
        """Write it (`.rrd` by custom), whole or not at all. Equal input gives equal content (`rerun rrd compare`).

        Raises:
            InputError: the file cannot be written.
        """
        with whole(path) as draft, _errors_of_the_system():
            self.stream.save(draft, default_blueprint=self.layout)
            try:
                self.log(self.stream)
                self.stream.flush()
            finally:
                self.stream.disconnect()
            if not draft.exists():
                raise InputError(f"{path}: rerun wrote nothing; is the environment variable RERUN set to off?")

    def show(self, name: str) -> None:
        """Show it: inline in a notebook, else in a window of its own, as a file of that name.

        Raises:
            SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
        """
        shell = sys.modules.get("IPython")
        if shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None:
            self.embed()
            return
        # The viewer reads the file after this returns; the system clears its folder of temporary files.
        path = Path(tempfile.mkdtemp(prefix="symrefine-")) / f"{name}.rrd"
        self.write(path)
        open_recording(path)

    def embed(self) -> None:
        """Show it in the notebook that runs this.

        Raises:
            SymrefineError: the notebook's half of rerun is not installed.
        """
        if find_spec("rerun_notebook") is None:
            raise SymrefineError('a notebook shows recordings by another package: pip install "symrefine[notebook]"')
        self.log(self.stream)
        self.stream.flush()
        self.stream.notebook_show(blueprint=self.layout)


def recorded(detection: Detection, shape: Shape) -> Recording:
    """The recording of a detection and the shape that `detect` was given."""
    scene = make_scene(detection, shape)
    return Recording(
        stream=new_stream(shape.source, _identity(detection, shape)),
        layout=blueprint(detection, scene, display_scale(scene.stage.diagonal)),
        log=lambda stream: _log(stream, detection, shape, scene),
    )


def new_stream(name: str, identity: str) -> Any:
    """A recording of an object of some name, named itself by its content, with no times of its own."""
    # The viewer keeps one layout for each application, so each object is one; rerun allows few characters there.
    application = "symrefine-" + re.sub(r"[^A-Za-z0-9]+", "-", Path(name).stem)[:60].strip("-")
    # Left to itself rerun parts the content where some time has passed, elsewhere in each run.
    at_the_end = rr.ChunkBatcherConfig.NEVER()
    stream = rr.RecordingStream(application, recording_id=identity, send_properties=False, batcher_config=at_the_end)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


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
    report = rr.TextDocument(markdown(detection, shape), media_type=rr.MediaType.MARKDOWN)
    stream.log("report", report, static=True)
    log_story(stream, detection, shape, scene)


def display_scale(diagonal: float) -> float:
    """The power of ten that makes a diagonal a number from 1 to 10."""
    return float(10.0 ** -math.floor(math.log10(diagonal)))


def _identity(detection: Detection, shape: Shape) -> str:
    """A name for the content: the viewer merges recordings of one name."""
    digest = hashlib.sha256(shape.points.tobytes())
    digest.update(repr((shape.source, detection.point_group, detection.tolerance, detection.center.tolist())).encode())
    return digest.hexdigest()[:32]


def _log_shape(stream: Any, detection: Detection, shape: Shape, scene: Scene) -> None:
    stream.log("object", rr.Transform3D(scale=display_scale(scene.stage.diagonal)), static=True)
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
            "contradicted": (scan.seen[scan.contradicted], bright(CONTRADICTED)),
            "inferred": (scan.inferred, bright(INFERRED)),
            "cameras": (np.unique(scan.rays[:, 0], axis=0), AXIS),
        }
        if len(scan.rays):
            rays = rr.LineStrips3D(list(scan.rays), colors=[RAY], radii=[pixels(0.4)])
            stream.log("object/cameras/free_space", rays, static=True)
    for name, (some, colour) in parts.items():
        if len(some):
            seen = rr.Points3D(some, colors=[colour], radii=[POINT * scene.stage.diagonal])
            stream.log(f"object/{name}", seen, static=True)
