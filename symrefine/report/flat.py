"""The page of an object in the plane: its mirror lines and turns over a drawing in which they can be chosen."""

import base64
import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from symrefine.geometry import Array, Isometry, Plane, toward_positive
from symrefine.picture.flat import FlatScene, Stroke, flat_scene, placed_cells, shares
from symrefine.picture.palette import AXIS, MISS, plane_colour
from symrefine.picture.words import (
    DOUBLETS,
    coordinates,
    count,
    detected_lines,
    direction,
    length,
    order_name,
    percent,
    planar_headline,
    sentence,
    turned_down,
    turns_name,
)
from symrefine.plane.detection import PlanarDetection
from symrefine.plane.raster import Raster
from symrefine.report.charts import decision_chart
from symrefine.report.listing import Group, Heads, Row, listing, stage
from symrefine.report.markup import Page, facts, head, homogeneous_rows, plain, rounded, section, table
from symrefine.report.space import reproduce
from symrefine.shape import Shape
from symrefine.surface.misses import LIMITS, Deviation

# Half the side of the drawing in its own units.
HALF = 500.0


def page(detection: PlanarDetection, shape: Shape) -> Page:
    """What the page says of an object in the plane, and its drawing."""
    d, scene = detection, flat_scene(detection, shape)
    return Page(
        title=f"{plain(d.point_group)} · {plain(shape.source)}",
        sections=(
            _head(d, shape),
            stage(_drawing(d, scene), _HINT, _list(d)),
            _facts(d, shape),
            _decision(d),
            _doublets(d),
            reproduce(d, shape),
        ),
        data={"kind": "plane", "elements": _drawn(d, scene)},
    )


_HINT = (
    "Choose a line or the centre, here or in the list, to see the object and its image laid over each other: where "
    "only one of them is, they miss."
)


def _head(d: PlanarDetection, shape: Shape) -> str:
    if d.undetermined:
        return head(f"Symmetry of {shape.source}", "Undetermined", "", sentence(d.undetermined))
    misses = [found.residual.p95 for found in d.lines] + ([] if d.rotation is None else [d.rotation.residual.p95])
    summary = f"Nothing holds at a tolerance of {percent(d.tolerance)} of the diagonal."
    if misses:
        each = "it" if len(misses) == 1 else "each of them"
        summary = (
            f"Under {each}, 95 % of the outline meets itself within {percent(max(*misses, 1e-4))} of the diagonal, "
            f"where the tolerance of {percent(d.tolerance)} allows {percent(LIMITS[1] * d.tolerance)}."
        )
    return head(f"Symmetry of {shape.source}", "", detected_lines(d), summary, group=d.point_group)


def _drawing(d: PlanarDetection, scene: FlatScene) -> str:
    """The object in grey, its lines and centre, near misses hidden until they are chosen."""
    scale = HALF / scene.radius
    strokes = [*((k, s, "") for k, s in enumerate(scene.lines))]
    first = len(scene.lines) + (d.rotation is not None)
    near = "" if scene.lines or d.rotation is not None else " first"
    strokes += [(first + k, s, f" missed{near if k == 0 else ''}") for k, s in enumerate(scene.missed) if s is not None]
    lines = "".join(_line(k, s, name, scale) for k, s, name in strokes)
    if d.rotation is not None:
        lines += (
            f'<g class="element turn" data-element="{len(scene.lines)}"><circle r="9"/>'
            f'<text x="20" y="34">{order_name(d.rotation.order)}</text></g>'
        )
    box = f"{-HALF:g} {-HALF:g} {2 * HALF:g} {2 * HALF:g}"
    title = plain(f"The object with what was found. {planar_headline(d)}")
    return (
        f'<svg class="drawing" id="drawing" viewBox="{box}" role="img" aria-label="{title}"><defs>'
        f'<g id="thing">{_thing(scene, scale)}</g></defs>'
        f'<g transform="scale(1 -1)"><use href="#thing" class="object"/><use href="#thing" class="image" id="image" '
        f'visibility="hidden"/></g>{lines}</svg>'
    )


def _line(index: int, stroke: Stroke, name: str, scale: float) -> str:
    (x0, y0), (x1, y1) = (scale * stroke.ends * [1.0, -1.0]).tolist()
    out = stroke.ends[1] - stroke.ends[0]
    tx, ty = (scale * stroke.ends[1] * [1.0, -1.0] + 24.0 * out / np.linalg.norm(out) * [1.0, -1.0]).tolist()
    ends = f'x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"'
    r, g, b = stroke.colour
    return (
        f'<g class="element{name}" data-element="{index}" style="--tint:rgb({r} {g} {b})">'
        f'<line class="reach" {ends}/><line {ends}/>'
        f'<text x="{tx:.1f}" y="{ty + 8.0:.1f}" text-anchor="middle">{plain(stroke.name)}</text></g>'
    )


def _thing(scene: FlatScene, scale: float) -> str:
    """The object in the colour of the text: pixels as a mask, or points; y points up."""
    if scene.raster is None:
        width = float(np.clip(400.0 / math.sqrt(len(scene.points)), 3.0, 22.0))
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in (scale * scene.points).tolist())
        return f'<path d="{path}" fill="none" stroke="currentColor" stroke-linecap="round" stroke-width="{width:.1f}"/>'
    (a, c, e), (b, d, f) = (scale * placed_cells(scene.raster, scene.center)).tolist()
    height, width = scene.raster.values.shape
    # Cells are centred at whole numbers.
    placed = f"matrix({a:.6g} {b:.6g} {c:.6g} {d:.6g} {e - 0.5 * (a + c):.6g} {f - 0.5 * (b + d):.6g})"
    size = f'width="{width}" height="{height}"'
    return (
        f'<g transform="{placed}"><mask id="mask" maskUnits="userSpaceOnUse" x="0" y="0" {size}>'
        f'<image {size} preserveAspectRatio="none" href="data:image/png;base64,{_mask(scene.raster)}"/></mask>'
        f'<rect {size} fill="currentColor" mask="url(#mask)"/></g>'
    )


def _mask(raster: Raster) -> str:
    """White where the object is; the first row is the lowest, as the drawing points up."""
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(np.round(255 * shares(raster)).astype(np.uint8)).save(data, format="PNG")
    return base64.b64encode(data.getvalue()).decode("ascii")


def _drawn(d: PlanarDetection, scene: FlatScene) -> list[dict[str, Any]]:
    """The elements as the script moves and copies them."""
    scale = HALF / scene.radius
    lines = [_moved(d, scale, f"Mirror line {k}", f.line, f.residual, "") for k, f in enumerate(d.lines, start=1)]
    turns = []
    if d.rotation is not None:
        name = turns_name(d.rotation.order).capitalize()
        turns = [_moved(d, scale, name, d.rotation.order, d.rotation.residual, "")]
    near = [
        _moved(
            d,
            scale,
            f"Near miss {k}: {'mirror line' if m.line is not None else turns_name(m.order)}",
            m.order if m.line is None else m.line,
            m.residual,
            turned_down(m.excess, d.tolerance, d.point_group),
            m.center,
        )
        for k, m in enumerate(d.near_misses, start=1)
    ]
    return [*lines, *turns, *near]


def _moved(
    d: PlanarDetection,
    scale: float,
    title: str,
    element: Plane | float,
    residual: Deviation,
    remark: str,
    center: Array | None = None,
) -> dict[str, Any]:
    """A mirror line, or turns of an order about a centre; positions relative to the centre, in units of the drawing."""
    near, far = percent(residual.p95), percent(residual.max)
    told = f"95 % of the outline meet their image within {near}, the worst within {far}."
    if isinstance(element, Plane):
        offset = scale * (element.offset - float(element.normal @ d.center))
        axis, point, angle = element.normal, offset * element.normal, 0.0
        motion = Isometry.reflection(element)
    else:
        middle = d.center if center is None else center
        angle = 1.0 if math.isinf(element) else 2.0 * math.pi / element
        axis, point = np.zeros(2), scale * (middle - d.center)
        c, s = math.cos(angle), math.sin(angle)
        motion = Isometry.about(middle, [[c, -s], [s, c]])
    endless = isinstance(element, float) and math.isinf(element)
    return {
        "title": title,
        "kind": "line" if isinstance(element, Plane) else "turn",
        "told": f"{told} {remark}".rstrip(),
        "axis": rounded(axis),
        "point": np.round(point, 4).tolist(),
        "angle": rounded(angle),
        "matrix": None if endless else homogeneous_rows(motion, d.diagonal),
    }


def _list(d: PlanarDetection) -> str:
    limit = LIMITS[1] * d.tolerance

    def row(index: int, name: str, colour: Any, element: Plane | None, found: Any, score: float, kind: str) -> Row:
        sign = 1.0 if element is None else toward_positive(element.normal)
        return Row(
            index=index,
            name=name,
            colour=colour,
            kind=kind,
            vector="" if element is None else direction(element.normal),
            place="about the centre" if element is None else f"offset {length(sign * element.offset, d.diagonal)}",
            misses=found.residual,
            share=found.residual.p95 / limit,
            score=score,
            copies=element is not None or not math.isinf(found.order),
        )

    lines = [row(k, str(k + 1), plane_colour(k), f.line, f, f.confidence, "") for k, f in enumerate(d.lines)]
    turns = [] if d.rotation is None else [d.rotation]
    turning = [row(len(lines), order_name(t.order), AXIS, None, t, t.confidence, "") for t in turns]
    first = len(lines) + len(turning)
    near = [
        row(first + k, str(k + 1), MISS, m.line, m, m.excess, "mirror line" if m.line else turns_name(m.order))
        for k, m in enumerate(d.near_misses)
    ]
    groups = [
        Group(title=count(len(lines), "mirror line"), rows=lines, missed=False),
        Group(title=turns_name(turns[0].order) if turns else "", rows=turning, missed=False),
        Group(title=count(len(near), "near miss", "near misses"), rows=near, missed=True),
    ]
    return listing(
        [g for g in groups if g.rows], Heads(vector="normal", body="outline", matrix="3 × 3"), "Nothing came close."
    )


def _facts(d: PlanarDetection, shape: Shape) -> str:
    return facts(
        [
            ("Input", f"{len(shape.points):,} points or pixels"),
            ("Centre", coordinates(d.center, d.diagonal)),
            ("Diagonal", f"{d.diagonal:.5g}"),
            ("Tolerance", percent(d.tolerance)),
            ("Confidence", "none" if d.undetermined else f"{d.confidence:.2f}"),
        ]
    )


def _decision(d: PlanarDetection) -> str:
    if not d.alternatives:
        return ""
    told = (
        "How likely each group is to be what the object was meant to have, and the miss of its worst element that "
        "would have to be forgiven."
    )
    own = [] if d.undetermined else [(d.point_group, d.confidence, 0.0)]
    others = [(a.point_group, a.probability, a.forgiven) for a in d.alternatives]
    return section("What else it may be", told, decision_chart(d.point_group, [*own, *others], [], d.tolerance))


def _doublets(d: PlanarDetection) -> str:
    rows: Sequence[Sequence[str]] = [
        (
            plain(str(tuple(v.orders))),
            *(f"{s:.2e}" for s in v.singular_values),
            "they vanish" if v.vanish else "∞" if math.isinf(v.ratio) else f"{v.ratio:.4g}",
        )
        for v in d.doublets.vectors
    ]
    told = f"Vectors made of moments (doublets) turn with the shape. Here they {DOUBLETS[d.doublets.kind]}."
    heads = ("orders", "σ₁", "σ₂", "ratio")
    return section("What the moments said first", told, table(heads, rows, caption="Singular values of the doublets"))
