"""The elements of a group placed in space, each judged: its mirrors, its axes, its rotoreflection axes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Isometry, householder, rotation, rotoreflection
from symrefine.groups import PointGroup
from symrefine.search import Evidence, Mirror
from symrefine.surface.misses import Verdict

# Angles that stand for a continuous axis.
FREE_TURNS = (0.517, 1.234, 2.6833)
# Distances evaluated in all for the final judgement of a group's elements, and at least for each.
JUDGED = 12000
JUDGED_EACH = 450


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Element:
    """One element of the group in normalised units: "plane", "axis" or "improper", and by how much it misses."""

    kind: str
    direction: Array
    point: Array
    order: float
    verdict: Verdict

    @property
    def motions(self) -> tuple[Isometry, ...]:
        """The operation that stands for a discrete element."""
        if self.kind == "plane":
            return (Isometry.about(self.point, householder(self.direction)),)
        turned = rotation if self.kind == "axis" else rotoreflection
        return (Isometry.about(self.point, turned(self.direction, 2.0 * np.pi / self.order)),)


def elements_of(evidence: Evidence, group: PointGroup, center: Array) -> tuple[Element, ...]:
    """Every discrete mirror, every axis and rotoreflection axis of the group about a centre, judged."""
    parts = _parts(group)
    stride = _stride(evidence, parts)
    judged = (_judged(evidence, part, center, stride) for part in parts)
    return tuple(sorted(judged, key=lambda e: (-e.order, e.verdict.excess)))


def inversion_of(evidence: Evidence, group: PointGroup, center: Array) -> Verdict | None:
    """By how much the inversion about a centre misses; None if it is no operation of the group."""
    if not group.has_inversion:
        return None
    return evidence.verdict([Isometry.about(center, -np.eye(3))], stride=_stride(evidence, _parts(group)))


def _stride(evidence: Evidence, parts: Sequence["_Part"]) -> int:
    return evidence.stride(max(JUDGED_EACH, JUDGED // max(1, len(parts))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Part:
    """An element to be judged: what it is, and matrices that stand for it."""

    kind: str
    direction: Array
    order: float
    matrices: tuple[Array, ...]


def _parts(group: PointGroup) -> list[_Part]:
    """Every discrete mirror, every axis and rotoreflection axis of the group."""
    normals = group.mirrors()
    if group.name in ("Cinfv", "Kh"):
        normals = group.frame[:0]
    elif group.name == "Dinfh":
        normals = group.frame[2:]
    parts = [_Part(kind="plane", direction=n, order=1.0, matrices=(householder(n),)) for n in normals]
    for direction, order in _listed_axes(group):
        angles = FREE_TURNS if math.isinf(order) else (2 * np.pi / order,)
        turns = tuple(rotation(direction, float(a)) for a in angles)
        parts.append(_Part(kind="axis", direction=direction, order=order, matrices=turns))
    for direction, order in group.improper_axes() if group.is_finite else []:
        turn = rotoreflection(direction, 2 * np.pi / order)
        parts.append(_Part(kind="improper", direction=direction, order=order, matrices=(turn,)))
    return parts


def _listed_axes(group: PointGroup) -> list[tuple[Array, float]]:
    """Discrete axes, and the continuous one; a sphere or a cylinder's endless family is left to the group's name."""
    if group.is_finite:
        return group.rotation_axes()
    return [(u, k) for u, k in group.rotation_axes() if math.isinf(k)][:1]


def _judged(evidence: Evidence, part: _Part, center: Array, stride: int) -> Element:
    motions = [Isometry.about(center, m) for m in part.matrices]
    verdict = evidence.verdict(motions, stride=stride)
    return Element(kind=part.kind, direction=part.direction, point=center, order=part.order, verdict=verdict)


def mirror_element(m: Mirror) -> Element:
    """A refined candidate mirror as an element."""
    return Element(
        kind="plane",
        direction=m.plane.normal,
        point=m.plane.offset * m.plane.normal,
        order=1.0,
        verdict=m.verdict,
    )
