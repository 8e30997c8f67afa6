"""Recordings for the rerun viewer: written, and opened."""

from symrefine.viewer.opening import open_recording
from symrefine.viewer.recording import record

__all__ = ["open_recording", "record"]
