"""What was found and what was turned down, as rows of a table."""

from dataclasses import dataclass

from symrefine.detection.result import Detection
from symrefine.picture.palette import AXIS, MISS, Colour, plane_colour
from symrefine.picture.words import direction, kind_name, order_name
from symrefine.surface.misses import Deviation


@dataclass(frozen=True, slots=True)
class Row:
    """An element: its name and colour in the picture, its kind, its normal or direction, and what it misses by.

    `score` is the confidence of what was found, and by how many times a near miss exceeds the limit.
    """

    name: str
    colour: Colour
    kind: str
    vector: str
    residual: Deviation
    score: float


def found_rows(detection: Detection) -> list[Row]:
    """Planes, then axes, then the inversion."""
    rows = [
        Row(str(k + 1), plane_colour(k), kind_name("plane"), direction(p.plane.normal), p.residual, p.confidence)
        for k, p in enumerate(detection.planes)
    ]
    for a in detection.axes:
        kind = kind_name("improper" if a.improper else "axis", a.order)
        name = order_name(a.order, a.improper)
        rows.append(Row(name, AXIS, kind, direction(a.axis.direction), a.residual, a.confidence))
    miss, sure = detection.inversion_residual, detection.inversion_confidence
    if miss is None or sure is None:
        return rows
    return [*rows, Row("i", AXIS, kind_name("inversion"), "about the centre", miss, sure)]


def near_miss_rows(detection: Detection) -> list[Row]:
    """Candidates turned down, best first."""
    rows = []
    for k, m in enumerate(detection.near_misses, start=1):
        order = f" {order_name(m.order, m.kind == 'improper')}" if m.kind in ("axis", "improper") else ""
        kind = kind_name(m.kind, m.order) + order
        rows.append(Row(str(k), MISS, kind, direction(m.direction), m.residual, m.excess))
    return rows
