"""The stage, where the object is shown, and beside it the list of what was found: a line for each kind that opens."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from symrefine.picture.palette import Colour
from symrefine.picture.words import exceeds, percent
from symrefine.report.markup import code, copy_button, plain, prose
from symrefine.surface.misses import Deviation

# Groups of up to so many rows are open from the start, if those above them are.
OPEN = 5
# Size of the picture that stands in for the model, in pixels.
WIDTH, HEIGHT = 1200, 900
# What a bar holds, in limits.
FULL = 1.25
_SHOW_ALL = '<button type="button" id="clear">Show all</button>'


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the list.

    Attributes:
        index: of the element in the page's data, which its buttons name.
        name: in the picture, with its colour.
        kind: in words, where the group does not say it.
        vector: normal or direction; `place` says where it stands.
        misses: mean, 95 %, 99 % and largest.
        share: of what is allowed at 95 %.
        score: confidence, or by how many times a near miss exceeds the limit.
        copies: whether there is a matrix to copy.
    """

    index: int
    name: str
    colour: Colour
    kind: str
    vector: str
    place: str
    misses: Deviation
    share: float
    score: float
    copies: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Rows of one kind, under a title in words; `missed` says that they were turned down."""

    title: str
    rows: Sequence[Row]
    missed: bool


def stage(
    still: str, hint: str, listed: str, *, way: str = "from the object to its image", actions: str = _SHOW_ALL
) -> str:
    """The object, a card for what is chosen, and the list.

    The canvas and the card stay hidden until the script has something to show in them, the still picture until then.

    Args:
        still: the picture, as HTML.
        hint: what can be done, as plain text.
        listed: the list, as HTML.
        way: what the slider goes through, as plain text.
        actions: buttons beside the one that copies the matrix, as HTML.
    """
    return (
        '<div class="stage"><div class="show"><div class="viewer" id="viewer">'
        f"{still}"
        '<canvas id="model" hidden tabindex="0" role="application" aria-label="Model of the object. Drag or use the '
        'arrow keys to turn it, plus and minus to come closer, Escape to choose nothing."></canvas>'
        '<div id="labels" aria-hidden="true"></div>'
        '<div id="tools" hidden><button type="button" id="reset">Reset view</button></div></div>'
        f'<p class="hint needs-script" hidden>{prose(hint)}</p>'
        '<div class="card" id="card" hidden><h2 id="chosen" aria-live="polite"></h2><p id="told"></p>'
        f'<label for="morph">{plain(way)}</label>'
        '<input id="morph" type="range" min="0" max="1" step="0.01" value="1">'
        '<div class="legend"><i></i><span id="least"></span><span id="most"></span></div>'
        f'<p class="actions"><button type="button" id="copy">Copy matrix</button>{actions}</p></div></div>'
        f'<div class="list">{listed}</div></div>'
    )


def still(png: bytes, alt: str) -> str:
    """A picture of the object, for where no model can turn."""
    data = base64.b64encode(png).decode("ascii")
    return (
        f'<img class="still" width="{WIDTH}" height="{HEIGHT}" src="data:image/png;base64,{data}" alt="{plain(alt)}">'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Heads:
    """What the columns are of: what `vector` is, which `body` misses itself, and the size of its matrices."""

    vector: str
    body: str
    matrix: str


def listing(groups: Sequence[Group], heads: Heads, nothing: str) -> str:
    """All groups, each a line that opens, and once what the columns mean; `nothing` where there are none."""
    if not groups:
        return f'<p class="quiet">{plain(nothing)}</p>'
    told = (
        f"Each element takes the {heads.body} to an image of itself; the figures say by how much that misses it, in % "
        "of the diagonal: on average, for the best 95 % and 99 %, and at worst. The bar shows the 95 % against what is "
        "allowed, the mark on it."
    )
    short = [len(group.rows) <= OPEN for group in groups]
    parts = "".join(_group(group, heads, opened=all(short[: k + 1])) for k, group in enumerate(groups))
    title = "What came close" if all(group.missed for group in groups) else "What was found"
    return f'<h2>{title}</h2>{parts}<p class="quiet">{prose(told)}</p>'


def _group(group: Group, heads: Heads, *, opened: bool) -> str:
    worst = max(row.misses.p95 for row in group.rows)
    title = group.title[:1].upper() + group.title[1:]
    said = "refined and turned down" if group.missed else f"95 % within {percent(max(worst, 1e-4))}"
    score = "× limit" if group.missed else "conf."
    named = ("", heads.vector, "mean", "95 %", "99 %", "max", score, heads.matrix)
    columns = "".join(f'<th scope="col">{plain(h)}</th>' for h in named)
    body = "".join(_row(row) for row in group.rows)
    kind, shown = (" near" if group.missed else ""), (" open" if opened else "")
    return (
        f'<details class="group{kind}"{shown}><summary><b>{plain(title)}</b> <span>{said}</span></summary>'
        f'<div class="wide" tabindex="0" role="region" aria-label="{plain(title)}">'
        f"<table><thead><tr>{columns}</tr></thead><tbody>{body}</tbody></table></div></details>"
    )


def _row(row: Row) -> str:
    m = row.misses
    place = " · ".join(plain(part) for part in (row.kind, row.place) if part)
    vector = f"{code(row.vector)}<br>" if row.vector else ""
    cells = (
        chooser(row.index, row.name, row.colour),
        f"{vector}<small>{place}</small>",
        f"{100 * m.mean:.2f}",
        f"{100 * m.p95:.2f}<br>{_bar(row.share)}",
        *(f"{100 * v:.2f}" for v in (m.p99, m.max)),
        exceeds(row.score),
        copy_button(row.index, row.name) if row.copies else "",
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def chooser(index: int, name: str, colour: Colour) -> str:
    """A button that chooses an element; without the script nothing but its name."""
    r, g, b = colour
    return (
        f'<button type="button" class="swatch" style="--tint:rgb({r} {g} {b})" data-choose="{index}" '
        f'aria-pressed="false">{plain(name)}</button>'
    )


def _bar(share: float) -> str:
    """A bar of up to 1.25 times what is allowed, with a mark there."""
    width = 100.0 / FULL * min(max(share, 0.01), FULL)
    return f'<span class="bar" title="{100 * share:.0f} % of what is allowed"><i style="width:{width:.1f}%"></i></span>'
