"""Pictures and pages: what was found, for people."""

from pathlib import Path

from symrefine.files import whole
from symrefine.picture.draw import Found, picture_png
from symrefine.shape import Shape

__all__ = ["draw"]


def draw(detection: Found, shape: Shape, path: Path | str) -> None:
    """Write a PNG of the shape with what was found: planes and axes in space, lines in the plane, hyperplanes beyond.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        draft.write_bytes(picture_png(detection, shape))
