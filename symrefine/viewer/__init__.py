"""Recordings for the rerun viewer: written, opened, and shown where one works."""

import sys
import tempfile
from pathlib import Path

from symrefine.detection.result import Detection
from symrefine.shape import Shape
from symrefine.viewer.opening import open_recording, serve_recording
from symrefine.viewer.recording import record, show_inline

__all__ = ["open_recording", "record", "serve_recording", "show"]


def show(detection: Detection, shape: Shape) -> None:
    """Show the recording of a detection: inline in a notebook, else in a window of its own.

    Raises:
        SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
    """
    shell = sys.modules.get("IPython")
    if shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None:
        show_inline(detection, shape)
        return
    # The viewer reads the file after this returns; the system clears its folder of temporary files.
    path = Path(tempfile.mkdtemp(prefix="symrefine-")) / "detection.rrd"
    record(detection, shape, path)
    open_recording(path)
