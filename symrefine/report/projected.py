"""The page of points in many dimensions: their hyperplanes of symmetry, and projections that see each on edge."""

import math
from collections.abc import Sequence

import numpy as np

from symrefine.geometry import Array, Isometry, toward_positive
from symrefine.ndim.detection import Hyperplane, SubspaceDetection
from symrefine.picture.projections import Projection, projections
from symrefine.picture.words import coordinates, direction, length, sentence, subspace_headline
from symrefine.report.markup import Page, code, copy_button, facts, head, homogeneous_rows, plain, section, table
from symrefine.report.space import reproduce, said_first
from symrefine.shape import Shape

HALF = 200.0


def page(detection: SubspaceDetection, shape: Shape) -> Page:
    """What the page says of points in many dimensions."""
    d = detection
    name, _, means = subspace_headline(d).partition(": ")
    mirrors = [Isometry.reflection(h.plane) for h in (*d.hyperplanes, *d.rejected)]
    matrices = [{"matrix": homogeneous_rows(mirror, d.diameter)} for mirror in mirrors]
    told, about = "Turns are not looked for in so many dimensions.", f"Symmetry of {shape.source}"
    summary = f"There may be more: {d.incomplete}. {told}" if d.incomplete else told
    return Page(
        title=f"{plain(name)} · {plain(shape.source)}",
        sections=(
            head(about, name, "" if d.undetermined else means, sentence(d.undetermined or summary)),
            _views(projections(d, shape), len(d.hyperplanes or d.rejected)),
            _facts(d, shape),
            _hyperplanes("Hyperplanes of symmetry", d.hyperplanes, 0, d.diameter),
            _hyperplanes("Candidates turned down", d.rejected, len(d.hyperplanes), d.diameter),
            _tuples(d),
            reproduce(d, shape),
        ),
        data={"kind": "projected", "elements": matrices},
    )


def _views(shown: Sequence[Projection], of: int) -> str:
    """Projections of the best of so many hyperplanes."""
    if not shown:
        return ""
    radius = 1.12 * max(float(np.abs(p.points).max()) for p in shown)
    told = (
        "Each hyperplane seen on edge: points to the left and to the right of the line are mirror images of each "
        "other. Upwards is the direction within the hyperplane along which the points reach farthest."
    )
    figures = "".join(_view(p, radius) for p in shown)
    title = "Projections" if len(shown) == of else f"Projections: the best {len(shown)} of {of} hyperplanes"
    return section(title, told, f'<div class="views">{figures}</div>')


def _view(projection: Projection, radius: float) -> str:
    scaled: Array = HALF / radius * projection.points * [1.0, -1.0]
    path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in scaled.tolist())
    width = float(np.clip(70.0 / math.sqrt(len(scaled)), 2.0, 8.0))
    r, g, b = projection.colour
    name = plain(projection.name)
    kind = "missed" if projection.missed else "found"
    return (
        f'<figure style="--tint:rgb({r} {g} {b})"><svg viewBox="{-HALF:g} {-HALF:g} {2 * HALF:g} {2 * HALF:g}" '
        f'role="img" aria-label="Points across hyperplane {name}"><path class="dots" d="{path}" '
        f'stroke-width="{width:.1f}"/><line class="{kind}" x1="0" y1="{-0.98 * HALF:g}" x2="0" y2="{0.98 * HALF:g}"/>'
        f"</svg><figcaption>{name}</figcaption></figure>"
    )


def _facts(d: SubspaceDetection, shape: Shape) -> str:
    order = d.reflection_group_order
    return facts(
        [
            ("Input", f"{len(shape.points):,} points in {shape.dim} dimensions"),
            ("Centre", coordinates(d.center, d.diameter)),
            ("Diameter", f"{d.diameter:.5g}"),
            ("Order of the group", "not known" if order is None else f"{order:,}"),
            ("Rank of the n-tuples", str(d.fixed.rank)),
        ]
    )


def _hyperplanes(title: str, listed: Sequence[Hyperplane], first: int, diameter: float) -> str:
    if not listed:
        return ""
    rows = []
    for k, h in enumerate(listed):
        sign = toward_positive(h.plane.normal)
        miss = "" if math.isnan(h.miss) else f"{100 * h.miss:.2f}"
        rows.append(
            (
                str(k + 1),
                code(direction(h.plane.normal)),
                length(sign * h.plane.offset, diameter),
                f"{100 * h.asymmetry:.3g}",
                f"{100 * h.noise:.3g}",
                miss,
                copy_button(first + k, f"{title.lower()} {k + 1}"),
            )
        )
    told = "Asymmetry and noise in % of the moments, the largest miss in % of the diameter."
    heads = ("", "normal", "offset", "asymmetry", "noise", "largest miss", "matrix")
    return section(title, told, f'<div class="hyper">{table(heads, rows, caption=title)}</div>')


def _tuples(d: SubspaceDetection) -> str:
    told = (
        "Vectors made of moments (n-tuples) turn with the points, so each lies in the subspace that all symmetries "
        f"leave in place. Here they span {d.fixed.rank} of {len(d.center)} dimensions, within their noise."
    )
    return said_first(told, d.fixed, [str(k) for k in range(1, len(d.fixed.significance) + 1)])
