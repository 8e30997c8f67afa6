"""A point group placed in space, and the operations that are fitted and judged in its stead."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TypeVar

import numpy as np

from symrefine.errors import DegenerateShapeError
from symrefine.fit.refine import Framed, mirror_bundle
from symrefine.geometry import Array, Isometry, ReadOnly, frame_with_z, householder, rotation, rotoreflection
from symrefine.groups import PointGroup, from_elements
from symrefine.groups.standard import GOLDEN

T = TypeVar("T")
# Turns that no finite fold below 36 shares; a surface of revolution survives them all.
FREE_TURNS = 2.0 * np.pi * np.array([0.0823, 0.1381966, 0.2360680, 0.4270510])
# Fold of what stands for all turns about an axis, evenly; a prime, so that few finite groups have any of its turns.
SAMPLED = 7
# Operations of one kind that are fitted together: more add points, but no knowledge. Of the mirrors through an axis all
# are, each with its own angle.
FITTED = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed(ReadOnly):
    """A point group about a centre [3], normalised units."""

    group: PointGroup
    center: Array

    def framed(self) -> Framed:
        """The operations that are fitted, in the frame of the group: together they leave no unknown of it free."""
        group = PointGroup(name=self.group.name)
        if group.symbol.family == "Cv" and group.is_finite:
            return mirror_bundle(int(group.symbol.fold), self.group.frame, self.center)
        matrices = fitted_matrices(group)
        return Framed(standard=np.stack(matrices), frame=self.group.frame, center=self.center)

    def roughly_framed(self) -> Framed:
        """The same for a look: some of the mirrors through an axis stand for all."""
        whole = self.framed()
        return replace(whole, standard=np.stack(evenly(list(whole.standard), 2 * FITTED)), bundle=False)

    def moved(self, state: Framed) -> "Placed":
        """The same group where a refinement put it."""
        return Placed(group=PointGroup(name=self.group.name, frame=state.frame), center=state.center)

    def motions(self, fold: int = SAMPLED) -> tuple[Isometry, ...]:
        """Its operations but the identity; of a continuous group those of its member of so many folds."""
        return tuple(Isometry.about(self.center, m) for m in self.group.sampled(fold).operations()[1:])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Operations:
    """One element of a group: its kind ("plane", "axis", "improper", "inversion"), and [m, 3, 3] that stand for it."""

    kind: str
    direction: Array
    order: float
    matrices: Array

    def motions(self, center: Array) -> tuple[Isometry, ...]:
        """The operations about a centre."""
        return tuple(Isometry.about(center, m) for m in self.matrices)

    def turned(self, turn: Array) -> "Operations":
        """The element after a rotation [3, 3] of space."""
        return replace(self, direction=turn @ self.direction, matrices=turn @ self.matrices @ turn.T)

    def alone(self, center: Array) -> Placed:
        """The group that the element generates about a centre."""
        number = "inf" if math.isinf(self.order) else f"{self.order:.0f}"
        name = {"plane": "Cs", "inversion": "Ci", "axis": f"C{number}", "improper": f"S{number}"}[self.kind]
        return Placed(group=PointGroup(name=name, frame=frame_with_z(self.direction)).for_point_set(), center=center)


def elements(group: PointGroup, *, powers: int = 0) -> list[Operations]:
    """Every mirror, axis and rotoreflection axis of a group, and the inversion; of a continuous family, a member.

    An axis stands for its smallest turn and a wide one, and for at most so many `powers` of the first, forth and back:
    of a part of a surface these carry other things out of sight.
    """
    return [part.turned(group.frame.T) for part in _standard_elements(group.name, powers)]


@lru_cache(maxsize=512)
def _standard_elements(name: str, powers: int) -> tuple[Operations, ...]:
    """The same in the standard placement: they are asked of every candidate wherever it stands, and made once."""
    group = PointGroup(name=name)
    normals = group.mirrors()
    if name in ("Cinfv", "Kh"):
        normals = normals[:0]
    elif name == "Dinfh":
        normals = group.frame[2:]
    found = [Operations(kind="plane", direction=n, order=1.0, matrices=householder(n)[None]) for n in normals]
    # Of a continuous group the endless axes; of a sphere all three that stand for it.
    for direction, order in (a for a in group.rotation_axes() if group.is_finite or math.isinf(a[1])):
        turns = np.array([rotation(direction, a) for a in _angles(order, powers)])
        found.append(Operations(kind="axis", direction=direction, order=order, matrices=turns))
    for direction, order in group.improper_axes() if group.is_finite else []:
        turn = rotoreflection(direction, wide_angle_rad(int(order)))
        both = np.array([turn, turn.T] if powers else [turn])
        found.append(Operations(kind="improper", direction=direction, order=order, matrices=both))
    if group.has_inversion:
        found.append(Operations(kind="inversion", direction=group.frame[2], order=2.0, matrices=-np.eye(3)[None]))
    return tuple(found)


def _angles(order: float, powers: int) -> tuple[float, ...]:
    """Turns that together stand for an axis: the smallest one moves hardly anything, so that a wide one goes along."""
    if math.isinf(order):
        return tuple(FREE_TURNS)
    fold = int(order)
    turns = dict.fromkeys((_wide(fold), 1, *evenly(range(1, fold), powers)))
    return tuple(2.0 * math.pi * k / fold for k in turns)


def wide_angle_rad(order: int) -> float:
    """Angle of the generator of C_n nearest to the golden section of a full turn, which moves every part far.

    No turn by few steps comes near it. An object that has but a part of the folds looks the same after each of its own
    wedges: of a turn by 137 degrees a five-fold axis leaves 7. So the turn is near the golden section of these, too.
    """
    return 2.0 * math.pi * _wide(order) / order


@cache
def _wide(order: int) -> int:
    """By how many steps it turns."""
    powers = [k for k in range(1, order // 2 + 1) if math.gcd(k, order) == 1]
    folds = [p for p in range(1, order) if order % p == 0]

    def off(steps: int) -> list[float]:
        """How far from the golden section of a wedge of each fold, the worst first."""
        parts = (steps * fold / order % 1.0 for fold in folds)
        return sorted((abs(min(part, 1.0 - part) - 2.0 + GOLDEN) for part in parts), reverse=True)

    return min(powers, key=off)


def fitted_matrices(group: PointGroup) -> list[Array]:
    """Some operations of each kind, spread evenly; of a continuous group, mirrors through its axis."""
    if not group.is_finite:
        return _round_matrices(group)
    parts = elements(group)
    found: list[Array] = []
    for kind in ("plane", "axis", "improper", "inversion"):
        matrices = [p.matrices[0] for p in parts if p.kind == kind]
        found += evenly(matrices, FITTED if kind == "plane" else FITTED // 2)
        if kind == "plane" and found and group.symbol.family not in ("Dh", "Dd", "Ch"):
            break
    return found


def _round_matrices(group: PointGroup) -> list[Array]:
    """Mirrors through the axis and, where the group has them, one across it or turns about the others."""
    matrices = [*mirror_bundle(5, np.eye(3), np.zeros(3)).standard]
    if group.name == "Dinfh":
        matrices.append(householder([0.0, 0.0, 1.0]))
    if group.name == "Kh":
        matrices += [rotation([1.0, 0.0, 0.0], 1.0), rotation([0.0, 1.0, 0.0], 1.7)]
    return matrices


def evenly(items: Sequence[T], most: int) -> list[T]:
    """At most so many of them, spread evenly, the first one in any case."""
    return [items[k * len(items) // most] for k in range(most)] if len(items) > most else list(items)


def common_center(placed: "list[Placed]") -> Array:
    """Point [3] nearest to the centroid that lies on all planes and axes of groups, in the sense of least squares."""
    rows: list[Array] = []
    values: list[float] = []
    for p in placed:
        for part in elements(p.group):
            across = part.direction[None] if part.kind == "plane" else frame_with_z(part.direction)[:2]
            seen = across if part.kind in ("plane", "axis") else np.eye(3)
            rows += list(seen)
            values += list(seen @ p.center)
    if not rows:
        return np.zeros(3)
    # Normals are known to a degree or so: what little they leave their common plane by is no third condition.
    return np.asarray(np.linalg.lstsq(np.array(rows), np.array(values), rcond=0.1)[0])


def joined(parts: Sequence[Placed]) -> Placed | None:
    """The smallest group that holds all of several groups, where it stands; None if there is none."""
    groups = [p.group for p in parts]
    center = common_center(list(parts))
    if any(g.name == "Kh" for g in groups):
        return Placed(group=PointGroup(name="Kh"), center=center)
    try:
        group = from_elements(
            mirrors=[n for g in groups for n in g.mirrors()],
            axes=[a for g in groups for a in g.rotation_axes()],
            improper=[a for g in groups for a in g.improper_axes() if np.isfinite(a[1])],
            inversion=any(g.has_inversion for g in groups),
        )
    except DegenerateShapeError:
        return None
    return Placed(group=group.for_point_set(), center=center)
