"""Pictures and pages: what was found, for people."""

from pathlib import Path

from symrefine.detect import Detection
from symrefine.picture.draw import picture_png
from symrefine.picture.files import write_whole
from symrefine.report.page import html_page
from symrefine.shape import Shape

__all__ = ["draw", "write_html"]


def draw(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write a PNG of the shape with the planes and axes that were found.

    Raises:
        InputError: the file cannot be written.
    """
    write_whole(Path(path), picture_png(detection, shape))


def write_html(detection: Detection, shape: Shape, path: Path | str) -> None:
    """Write one HTML page, pictures included, that tells what was found and how well it holds.

    Raises:
        InputError: the file cannot be written.
    """
    page = html_page(detection, shape, picture_png(detection, shape, title=False))
    write_whole(Path(path), page.encode("utf-8"))
