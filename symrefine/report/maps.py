"""The page of an alignment: both objects before and after, what each place of either says, and the equivalent maps."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from symrefine.align.alignment import Alignment
from symrefine.geometry import Array
from symrefine.picture.camera import FOV_RAD, look_at
from symrefine.picture.pair import MOST_WAYS, Pair, Shares, Side, Way
from symrefine.picture.pair_png import pair_png
from symrefine.picture.pair_words import answer, headline, named, summary
from symrefine.picture.palette import OUTLIER, plane_colour, shade
from symrefine.picture.words import coordinates, percent
from symrefine.report.listing import HEIGHT, WIDTH, chooser, stage, still
from symrefine.report.markup import Page, copy_button, facts, head, plain, prose, rounded, section
from symrefine.report.model import DEEPEST, MOST_MISSES, heat, outline, packed
from symrefine.report.space import again

_BUTTONS = "".join(
    f'<button type="button" data-share="{share}" aria-pressed="{pressed}">{name}</button>'
    for share, name, pressed in ((0, "Before", "false"), (1, "After", "true"))
)
# Options of the command line that Python has under other names, or not at all.
_IN_PYTHON = ("tolerance", "units", "scale", "seed")
_SAID = ("source_frame", "target_frame", "measure", "labels", "rotations_only", *_IN_PYTHON)


def page(found: Alignment, pair: Pair, options: Mapping[str, Any]) -> Page:
    """What the page says of an alignment, and the two objects that turn."""
    source, target = pair.sides
    title, beside = answer(found, pair)
    listed = _list(found, pair) + _facts(found, pair)
    alt = f"Both objects before and after. {headline(found, pair)}"
    picture = still(pair_png(pair, "", width=WIDTH, height=HEIGHT), alt)
    return Page(
        title=f"{plain(title)} · {plain(source.name)} onto {plain(target.name)}",
        sections=(
            head(f"{source.name} onto {target.name}", title, beside, summary(found, pair)),
            stage(picture, _hint(found, pair), listed, way="from before to after", actions=_BUTTONS),
            _matrix(found, pair),
            _reproduce(pair, options),
        ),
        data=_data(pair),
        turns=True,
    )


def _hint(found: Alignment, pair: Pair) -> str:
    told = (
        "Before, the source stands beside the target as it came; after, it is laid on it. Blue: the source, grey: the "
        "target, where they meet. Amber to red: one of them contradicts, as somebody looked there and saw nothing. "
        "Green: nobody looked there. Strays are left out."
    )
    more = (
        " Choose another map in the list: it does equally well." if len(pair.ways) > 1 and not found.is_misfit else ""
    )
    return told + more


def _list(found: Alignment, pair: Pair) -> str:
    """A row for each map that is shown."""
    rows = "".join(_row(k, way, pair) for k, way in enumerate(pair.ways))
    title, more = "The map", ""
    if found.is_misfit:
        title = "The closest that was found, and no answer"
    elif len(pair.ways) > 1:
        title = f"{pair.equivalents} maps that do equally well"
    if pair.equivalents > len(pair.ways):
        more = f"{MOST_WAYS} of them are shown, all of them stand in the JSON. "
    if found.observable != "full" and not found.is_misfit:
        more += f"Determined {found.observable}. "
    more += (
        "The bars show what shares of the places that are drawn of source and target meet the other (blue), contradict "
        "(red), and nobody looked for (green)."
    )
    heads = "".join(f'<th scope="col">{h}</th>' for h in ("", "what it does", "source", "target", "4 × 4"))
    return (
        f'<h2>{plain(title)}</h2><div class="wide" tabindex="0" role="region" aria-label="{plain(title)}">'
        f'<table class="maps"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'
        f'<p class="quiet">{prose(more)}</p>'
    )


def _row(index: int, way: Way, pair: Pair) -> str:
    what, by = named(way)
    cells = (
        chooser(index, str(index + 1), plane_colour(index)),
        f"{plain(what)}<br><small>{plain(by or f'det {way.determinant:+d}')}</small>",
        *(_bar(shares) for shares in pair.shares(index)),
        copy_button(index, f"map {index + 1}"),
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _bar(shares: Shares) -> str:
    """Three shares side by side, and the first in figures."""
    parts = (("met", shares.met), ("against", shares.contradicted), ("nobody", shares.unseen))
    inner = "".join(f'<i class="{name}" style="width:{100 * share:.1f}%"></i>' for name, share in parts)
    return f'<span class="shares" title="{plain(str(shares))}">{inner}</span><br>{plain(percent(shares.met))}'


def _facts(found: Alignment, pair: Pair) -> str:
    way, diagonal = pair.ways[0], pair.diagonal
    hand = f"{way.determinant:+d}, {found.determinant_confidence:.3f}"
    sigma = math.degrees(found.sigma_rad)
    known = "moments equal to rounding" if found.exact else f"{sigma:.2g}°" if math.isfinite(sigma) else "unknown"
    pairs = [
        ("Status", "ok" if found.status == "ok" else answer(found, pair)[0].lower()),
        ("Confidence", f"{found.confidence:.3f}"),
        ("Determinant", hand),
        ("Translation", coordinates(found.translation, diagonal)),
        ("Scale", f"{found.scale:.6g}"),
        ("RMS distance", percent(found.rms)),
        ("Rotation known to", known),
    ]
    drawn = zip(("Source", "Target"), pair.sides, pair.shares(0), strict=True)
    return facts([*pairs, *((f"{name} as drawn: {side.name}", str(shares)) for name, side, shares in drawn)])


def _matrix(found: Alignment, pair: Pair) -> str:
    """The homogeneous matrix to read and to copy."""
    rows = "\n".join(" ".join(f"{x + 0.0:14.9g}" for x in row) for row in pair.ways[0].transform)
    told = "Takes homogeneous points of the source, as columns, to the target" + (
        ": the closest map that was found, and no answer." if found.is_misfit else "."
    )
    return section("Matrix", told, f'<pre class="matrix">{rows}</pre><p>{copy_button(0, "the map")}</p>')


def _reproduce(pair: Pair, options: Mapping[str, Any]) -> str:
    given = {name: v for name in _SAID if (v := options.get(name)) is not None and v is not False}  # a frame may be 0
    asked = {name: v for name, v in given.items() if (name, v) != ("seed", 0)}
    python = {name: asked[name] for name in _IN_PYTHON if name in asked}
    python |= {"allow_reflection": False} if asked.get("rotations_only") else {}
    return again("align", {"source": pair.source.name, "target": pair.target.name}, asked, python)


def _data(pair: Pair) -> dict[str, Any]:
    """What the script draws: the target, the source, and the maps; relative to the target's centre, in diagonals."""
    scene = pair.stage(pair.ways[0].matrix, pair.ways[0].shift)
    camera = look_at(scene, aspect=1.4, fov_rad=FOV_RAD)
    beside = pair.beside(-camera.frame[0])
    target, source = (_body(pair, side) for side in reversed(pair.sides))
    view = (camera.eye - camera.target) / np.linalg.norm(camera.eye - camera.target)
    return {
        "kind": "space",
        "object": {**target, "frame": np.eye(3).tolist(), "view": np.round(view, 6).tolist()},
        "moving": source,
        "legend": ["they meet", f"one contradicts, by {100 * DEEPEST * pair.tolerance:.2g} % and more"],
        "elements": [_element(k, way, pair, beside) for k, way in enumerate(pair.ways)],
    }


def _body(pair: Pair, side: Side) -> dict[str, Any]:
    """A side as the page carries it, with what each of its places misses under each map."""
    surface, most = side.surface(), MOST_MISSES // (2 * len(pair.ways))
    if surface.faces is None:
        stray = pair.misses(side.index, surface.points)[0] < 0.0
        colours = np.where(stray[:, None], shade(OUTLIER), surface.colours)
        surface = replace(surface, colours=colours)
    parts = packed(surface, side.scene(pair.diagonal), most)
    misses = np.maximum(pair.misses(side.index, parts.pop("places")), 0.0)
    return {**parts, "outline": outline(side.outline / pair.diagonal), **heat(misses, pair.tolerance)}


def _element(index: int, way: Way, pair: Pair, beside: Array) -> dict[str, Any]:
    what, by = named(way)
    source, target = pair.shares(index)
    return {
        "title": f"{index + 1}: {what} {by}".rstrip(),
        "label": "",
        "kind": "axis" if way.determinant > 0 else "improper",
        "missed": False,
        "shown": False,
        "colour": list(plane_colour(index)),
        "axis": rounded(way.axis),
        "point": [0.0, 0.0, 0.0],
        "angle": rounded(way.angle_rad),
        "travel": [np.round(v / pair.diagonal, 6).tolist() for v in (beside, way.shift)],
        "corners": None,
        "ends": None,
        "mark": [],
        "told": f"Of the source {source}; of the target {target}.",
        "matrix": rounded(way.transform, pair.diagonal),
    }
