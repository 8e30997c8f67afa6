"""What was found and what was turned down, as rows of a table."""

from dataclasses import dataclass

from symrefine.detection.result import Detection, FoundAxis, FoundPlane
from symrefine.picture.scene import AXIS, MISS, Colour, plane_colour
from symrefine.picture.words import direction, kind_name, order_name
from symrefine.surface.misses import Deviation


@dataclass(frozen=True, slots=True, kw_only=True)
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
        _row(str(k + 1), plane_colour(k), kind_name("plane"), direction(p.plane.normal), p)
        for k, p in enumerate(detection.planes)
    ]
    for a in detection.axes:
        kind = kind_name("improper" if a.improper else "axis", a.order)
        rows.append(_row(order_name(a.order, a.improper), AXIS, kind, direction(a.axis.direction), a))
    miss, sure = detection.inversion_residual, detection.inversion_confidence
    if miss is None or sure is None:
        return rows
    about = "about the centre"
    return [*rows, Row(name="i", colour=AXIS, kind=kind_name("inversion"), vector=about, residual=miss, score=sure)]


def _row(name: str, colour: Colour, kind: str, vector: str, found: FoundPlane | FoundAxis) -> Row:
    return Row(name=name, colour=colour, kind=kind, vector=vector, residual=found.residual, score=found.confidence)


def near_miss_rows(detection: Detection) -> list[Row]:
    """Candidates turned down, best first."""
    rows = []
    for k, m in enumerate(detection.near_misses, start=1):
        order = f" {order_name(m.order, m.kind == 'improper')}" if m.kind in ("axis", "improper") else ""
        kind, where = kind_name(m.kind, m.order) + order, direction(m.direction)
        rows.append(Row(name=str(k), colour=MISS, kind=kind, vector=where, residual=m.residual, score=m.excess))
    return rows
