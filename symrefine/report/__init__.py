"""Pictures and pages: what was found, for people."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symrefine.align.alignment import Alignment
from symrefine.files import whole
from symrefine.picture.draw import Found, picture_png
from symrefine.picture.pair import Pair
from symrefine.report.page import html_page, pair_html
from symrefine.shape import Shape

__all__ = ["draw", "write_html", "write_pair_html"]


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


def write_pair_html(found: Alignment, pair: Pair, options: Mapping[str, Any], path: Path | str) -> None:
    """Write one HTML page that needs nothing else: both objects before and after, and the maps that do equally well.

    Args:
        found: what `align` returned.
        pair: its scene.
        options: it was asked with.
        path: the file.

    Raises:
        InputError: the file cannot be written.
    """
    with whole(Path(path)) as draft:
        draft.write_text(pair_html(found, pair, options), encoding="utf-8", newline="")
