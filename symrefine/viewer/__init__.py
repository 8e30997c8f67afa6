"""Recordings for the rerun viewer: written, opened, and shown where one works."""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from symrefine.align.alignment import Alignment
from symrefine.detection.result import Detection
from symrefine.picture.pair import Pair
from symrefine.shape import Shape
from symrefine.viewer.opening import open_recording, serve_recording
from symrefine.viewer.pair import record_pair, show_pair_inline
from symrefine.viewer.recording import record, show_inline

__all__ = ["open_recording", "record", "record_pair", "serve_recording", "show", "show_pair"]


def show(detection: Detection, shape: Shape) -> None:
    """Show the recording of a detection: inline in a notebook, else in a window of its own.

    Raises:
        SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
    """
    _shown("detection", lambda: show_inline(detection, shape), lambda path: record(detection, shape, path))


def show_pair(found: Alignment, pair: Pair) -> None:
    """Show the recording of an alignment: inline in a notebook, else in a window of its own.

    Raises:
        SymrefineError: the viewer does not start, or a notebook lacks its half of rerun.
    """
    _shown("alignment", lambda: show_pair_inline(found, pair), lambda path: record_pair(found, pair, path))


def _shown(name: str, inline: Callable[[], None], write: Callable[[Path], None]) -> None:
    shell = sys.modules.get("IPython")
    if shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None:
        inline()
        return
    # The viewer reads the file after this returns; the system clears its folder of temporary files.
    path = Path(tempfile.mkdtemp(prefix="symrefine-")) / f"{name}.rrd"
    write(path)
    open_recording(path)
