"""Pictures and pages: what was found, for people."""

from pathlib import Path

from symrefine.detection.result import Detection
from symrefine.files import whole
from symrefine.picture.draw import picture_png
from symrefine.report.page import html_page
from symrefine.shape import Shape

__all__ = ["draw", "write_html"]


def draw(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write a PNG of the shape with the planes and axes that were found.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        draft.write_bytes(picture_png(detection, shape))


def write_html(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write one HTML page, pictures included, that tells what was found and how well it holds.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        page = html_page(detection, shape, picture_png(detection, shape, title=False))
        draft.write_text(page, encoding="utf-8", newline="")
