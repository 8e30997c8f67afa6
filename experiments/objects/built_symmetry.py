"""What symmetry an object was built with, and whether an element stated of it belongs to that.

The objects are the shapes of all point groups, their siblings with one detail out of place, the household objects,
tangles of random parts and, where they are, the catalogued meshes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.objects import group_shapes, household, tangles
from experiments.objects.catalogue import catalogue, catalogued
from experiments.objects.parts import Part, assembled, placed_group
from experiments.objects.poses import Pose
from symrefine.fit.placed import FREE_TURNS
from symrefine.geometry import Array, frame_with_z, householder, rotation, rotoreflection
from symrefine.groups import PointGroup, from_elements
from symrefine.shape import Shape

FAMILIES = ("shape", "sibling", "household", "catalogue")
NEAR_DEG, NEAR_REL = 3.0, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """The symmetry an object was built with: its group in place, and a point that every operation leaves there."""

    group: PointGroup
    center: Array

    @classmethod
    def of_parts(cls, parts: Sequence[Part]) -> "Truth":
        """That of what is put together from parts, as their marks tell it."""
        group, center = placed_group(parts)
        return cls(group=group, center=center)

    def posed(self, pose: Pose) -> "Truth":
        """The same of the object in another pose."""
        frame = self.group.frame @ pose.turn.T
        return Truth(group=PointGroup(name=self.group.name, frame=frame), center=pose.of(self.center))


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """An element in input units, as a plane, an axis or a near miss states it."""

    kind: str
    order: float
    direction: Array
    point: Array


def holds(truth: Truth, claim: Claim, diagonal: float) -> bool:
    """Whether the object has the element, within 3 degrees and 2 % of the diagonal.

    Of an axis of order k that is a turn by 360 / k degrees, so that a divisor of the true order is right too.
    """
    away = claim.point - truth.center
    along = float(np.asarray(away) @ claim.direction)
    # A plane may slide in itself, an axis along itself; a rotoreflection of order 3 or more has a centre.
    offset = {"plane": abs(along), "axis": math.sqrt(max(float(away @ away) - along**2, 0.0))}.get(
        claim.kind, float(np.linalg.norm(away))
    )
    return offset <= NEAR_REL * diagonal and all(_near(truth.group, m, d) for m, d in _operations(claim))


def _operations(claim: Claim) -> list[tuple[Array, float]]:
    """Matrices that stand for an element, and the angle by which each changes when the element tilts by 3 degrees."""
    if claim.kind == "plane":
        return [(householder(claim.direction), 2.0 * NEAR_DEG)]
    if claim.kind == "axis":
        angles = FREE_TURNS if math.isinf(claim.order) else (2.0 * np.pi / claim.order,)
        return [(rotation(claim.direction, a), 2.0 * abs(math.sin(a / 2.0)) * NEAR_DEG) for a in angles]
    angle = 2.0 * np.pi / claim.order
    return [(rotoreflection(claim.direction, angle), 2.0 * abs(math.cos(angle / 2.0)) * NEAR_DEG)]


def _near(group: PointGroup, matrix: Array, within_deg: float) -> bool:
    """Whether an operation of the group, by the same angle where the group is finite, lies so near to a matrix."""
    if not group.is_finite:
        return bool(np.degrees(group.distance_rad(matrix[None])[0]) <= within_deg)
    operations = group.operations()
    same = np.abs(np.trace(operations, axis1=1, axis2=2) - np.trace(matrix)) < 1e-6
    same &= np.linalg.det(operations) * np.linalg.det(matrix) > 0
    apart = np.linalg.norm(operations[same] - matrix, axis=(1, 2)) / math.sqrt(8.0)  # sine of half the angle
    return bool(len(apart)) and bool(2.0 * np.degrees(np.arcsin(min(1.0, apart.min()))) <= within_deg)


def names(family: str) -> list[str]:
    """The objects of a family."""
    if family == "household":
        return list(household.OBJECTS)
    return list(catalogue() if family == "catalogue" else group_shapes.DESIGNS)


def specimen(family: str, name: str) -> tuple[Shape, Truth]:
    """The mesh of an object and its symmetry."""
    if family == "household":
        entry = household.OBJECTS[name]
        return entry.build(), Truth(group=_upright(entry), center=np.zeros(3))
    if family == "catalogue":
        return catalogued(name), _entered(catalogue()[name])
    if family == "tangle":
        made = tangles.parts(name)
        return assembled(made), Truth.of_parts(made)
    sibling = family == "sibling"
    return group_shapes.shape(name, sibling), Truth.of_parts(group_shapes.DESIGNS[name].parts(sibling))


def _upright(entry: household.Object) -> PointGroup:
    """The group of a household object: z is upright, a lone mirror has its own normal."""
    if entry.group == "Cs":
        return PointGroup(name="Cs", frame=frame_with_z(entry.normals[0]))
    return PointGroup(name=entry.group)


def _entered(entry: dict[str, Any]) -> Truth:
    """The group that the elements of an entry generate, and their common point."""
    planes = entry["planes"]
    if entry["point_group"] == "Cs":
        group = PointGroup(name="Cs", frame=frame_with_z(planes[0]["normal"]))
    elif entry["point_group"].endswith(("infv", "infh")):
        group = PointGroup(name=entry["point_group"], frame=frame_with_z(entry["axes"][0]["direction"]))
    else:
        group = from_elements(
            mirrors=[p["normal"] for p in planes],
            axes=[(a["direction"], a["order"]) for a in entry["axes"]],
            tolerance_rad=math.radians(1.0),
        )
    assert group.name == entry["point_group"], (entry["name"], group.name)
    stated = planes or entry["axes"]
    return Truth(group=group, center=np.array(stated[0]["point"] if stated else entry["area_centroid"]))
