"""What was found and what was turned down, as rows of a table."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.detection.result import Detection
from symrefine.picture.palette import AXIS, MISS, Colour, plane_colour
from symrefine.picture.words import direction, kind_name, order_name
from symrefine.surface.misses import Deviation

# Axes this close together are one line with two names.
SAME_LINE_RAD = math.radians(1.0)


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


# What there is to say of an element: "plane", "axis", "improper" or "inversion"; its direction; its order.
Said = tuple[str, Sequence[float], float]


def said_of(planes: Iterable[Sequence[float]], turns: Iterable[tuple[Sequence[float], float, bool]]) -> list[Said]:
    """Mirrors with their normals, and turns with direction, order and whether they are improper."""
    mirrors: list[Said] = [("plane", normal, 1.0) for normal in planes]
    return mirrors + [("improper" if improper else "axis", u, order) for u, order, improper in turns]


def kept(element: Said, textured: Iterable[Said]) -> str:
    """What a texture keeps of an element, of all that it keeps: all, a part of an axis, or nothing, which is empty."""
    kind, along, order = element
    for other, beside, least in textured:
        if other == kind and abs(np.dot(along, beside)) > np.cos(SAME_LINE_RAD):
            return "kept" if least == order else f"as {order_name(least, kind == 'improper')}"
    return ""


def near_miss_rows(detection: Detection) -> list[Row]:
    """Candidates turned down, best first."""
    rows = []
    for k, m in enumerate(detection.near_misses, start=1):
        order = f" {order_name(m.order, m.kind == 'improper')}" if m.kind in ("axis", "improper") else ""
        kind = kind_name(m.kind, m.order) + order
        rows.append(Row(str(k), MISS, kind, direction(m.direction), m.residual, m.excess))
    return rows
