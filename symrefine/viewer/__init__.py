"""Recordings for the rerun viewer: written, opened, and shown where one works."""

import sys
import tempfile
from pathlib import Path

from symrefine.align.alignment import Alignment
from symrefine.detection.result import Detection
from symrefine.picture.pair import Pair
from symrefine.shape import Shape
from symrefine.viewer.opening import open_recording, serve_recording
from symrefine.viewer.pair import recorded_pair
from symrefine.viewer.recording import Recording, recorded

__all__ = ["open_recording", "record", "record_pair", "serve_recording", "show", "show_pair"]


def record(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write the recording of a detection and the shape that `detect` was given, as `Recording.write` does.

    Raises:
        InputError: the file cannot be written.
    """
    recorded(detection, shape).write(Path(path))


def record_pair(found: Alignment, pair: Pair, path: Path | str) -> None:
    """Write the recording of an alignment, as `Recording.write` does.

    Raises:
        InputError: the file cannot be written.
    """
    recorded_pair(found, pair).write(Path(path))


def show(detection: Detection, shape: Shape) -> None:
    """Show the recording of a detection: inline in a notebook, else in a window of its own.

    Raises:
        SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
    """
    _show("detection", recorded(detection, shape))


def show_pair(found: Alignment, pair: Pair) -> None:
    """Show the recording of an alignment: inline in a notebook, else in a window of its own.

    Raises:
        SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
    """
    _show("alignment", recorded_pair(found, pair))


def _show(name: str, recording: Recording) -> None:
    shell = sys.modules.get("IPython")
    if shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None:
        recording.embed()
        return
    # The viewer reads the file after this returns; the system clears its folder of temporary files.
    path = Path(tempfile.mkdtemp(prefix="symrefine-")) / f"{name}.rrd"
    recording.write(path)
    open_recording(path)
