"""What was found and what was turned down, as rows of a table."""

import math
from dataclasses import dataclass

from symrefine.detection.result import Detection, FoundAxis
from symrefine.picture.scene import AXIS, MISS, Colour, plane_colour
from symrefine.picture.words import direction, order_name
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
    planes = [
        Row(
            name=str(k + 1),
            colour=plane_colour(k),
            kind="mirror plane",
            vector=direction(p.plane.normal),
            residual=p.residual,
            score=p.confidence,
        )
        for k, p in enumerate(detection.planes)
    ]
    return planes + [_axis_row(a) for a in detection.axes] + _inversion_rows(detection)


def _axis_row(found: FoundAxis) -> Row:
    return Row(
        name=order_name(found.order, found.improper),
        colour=AXIS,
        kind=_kind("improper" if found.improper else "axis", found.order),
        vector=direction(found.axis.direction),
        residual=found.residual,
        score=found.confidence,
    )


def _inversion_rows(detection: Detection) -> list[Row]:
    miss, sure = detection.inversion_residual, detection.inversion_confidence
    if miss is None or sure is None:
        return []
    return [Row(name="i", colour=AXIS, kind="inversion", vector="about the centre", residual=miss, score=sure)]


def near_miss_rows(detection: Detection) -> list[Row]:
    """Candidates turned down, best first."""
    return [
        Row(
            name=str(k),
            colour=MISS,
            kind=_kind(m.kind, m.order)
            + (f" {order_name(m.order, m.kind == 'improper')}" if m.kind in ("axis", "improper") else ""),
            vector=direction(m.direction),
            residual=m.residual,
            score=m.excess,
        )
        for k, m in enumerate(detection.near_misses, start=1)
    ]


def _kind(kind: str, order: float) -> str:
    if kind == "axis" and math.isinf(order):
        return "revolution"
    names = {"plane": "mirror plane", "axis": "rotation", "improper": "rotoreflection", "inversion": "inversion"}
    return names[kind]
