"""Recordings for the rerun viewer: written, opened, and shown where one works."""

from pathlib import Path

from symrefine.detection.result import Detection
from symrefine.shape import Shape
from symrefine.viewer.opening import open_recording, serve_recording
from symrefine.viewer.pair import recorded_pair
from symrefine.viewer.recording import recorded

__all__ = ["open_recording", "record", "recorded", "recorded_pair", "serve_recording"]


def record(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write the recording of a detection and the shape that `detect` was given, as `Recording.write` does.

    Raises:
        InputError: the file cannot be written.
    """
    recorded(detection, shape).write(Path(path))
