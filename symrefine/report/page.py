"""The page: one HTML file that needs nothing else, readable from a headline down to how to reproduce it."""

from collections.abc import Mapping
from importlib.resources import files
from string import Template
from typing import Any

from symrefine.align.alignment import Alignment
from symrefine.ndim.detection import SubspaceDetection
from symrefine.picture.draw import Found
from symrefine.picture.pair import Pair
from symrefine.plane.detection import PlanarDetection
from symrefine.report import flat, maps, projected, space
from symrefine.report.markup import Page, island
from symrefine.shape import Shape


def html_page(found: Found, shape: Shape) -> str:
    """The whole page; equal input gives equal pages."""
    if isinstance(found, PlanarDetection):
        return filled(flat.page(found, shape))
    if isinstance(found, SubspaceDetection):
        return filled(projected.page(found, shape))
    return filled(space.page(found, shape))


def pair_html(found: Alignment, pair: Pair, options: Mapping[str, Any]) -> str:
    """The whole page of an alignment, asked with these options; equal input gives equal pages."""
    return filled(maps.page(found, pair, options))


def filled(page: Page) -> str:
    """The template with the content of a page; only what turns needs the library that turns it."""
    styles = ["page.css", page.style] if page.style else ["page.css"]
    scripts = ["three.js", page.script] if page.turns else [page.script]
    return Template(_asset("page.html")).substitute(
        title=page.title,
        style="".join(map(_asset, styles)),
        body="\n".join(section for section in page.sections if section),
        data=island(page.data),
        scripts="\n".join(f"<script>{_asset(script)}</script>" for script in scripts),
    )


def _asset(name: str) -> str:
    return files("symrefine.report").joinpath("assets", name).read_text(encoding="utf-8")
