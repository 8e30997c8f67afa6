"""Pictures and pages: what was found, for people."""

from pathlib import Path

from symrefine.files import whole
from symrefine.picture.draw import Found, picture_png
from symrefine.report.page import html_page
from symrefine.shape import Shape

__all__ = ["draw", "write_html"]


def draw(detection: Found, shape: Shape, path: Path | str) -> None:
    """Write a PNG of the shape with what was found: planes and axes in space, lines in the plane, hyperplanes beyond.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        draft.write_bytes(picture_png(detection, shape))


def write_html(detection: Found, shape: Shape, path: Path | str) -> None:
    """Write one HTML page that needs nothing else: a model to turn, what was found, and how well it holds.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        draft.write_text(html_page(detection, shape), encoding="utf-8", newline="")
