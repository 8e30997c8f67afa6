"""A point group placed in space: its operations and elements in the coordinates of the object.

`frame` F has determinant +1 and maps object coordinates to the standard placement (`groups.standard`): its rows are the
standard x, y and z axes written in object coordinates, as in `geometry.frame_with_z`. An operation G of the standard
group acts on the object as `F' G F`.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z, numbers, orthogonal_factor, read_only, unit
from symrefine.groups.names import Symbol, parse
from symrefine.groups.orthogonal import (
    about_z,
    angle_of_overlap,
    angles_about_z,
    chord_angles,
    determinants,
    nearest_operations,
    nearest_orthogonal,
    nearest_rotation,
    overlaps,
    overlaps_about_z,
)
from symrefine.groups.standard import Elements, OrderedAxis, standard_elements, standard_operations
from symrefine.rounding import SINGLE

_POINT_SET = {"C": "Cv", "Cv": "Cv", "Ch": "Dh", "D": "Dh", "Dh": "Dh", "K": "Kh", "Kh": "Kh"}


@dataclass(frozen=True, kw_only=True, eq=False)
class PointGroup:
    """Point group `name` (canonical Schoenflies symbol) placed by the rotation `frame` [3, 3] (rows: its x, y, z).

    Equal are groups of the same name and frame, number for number. Frames that differ may place the same operations:
    `symrefine.groups.is_subgroup` both ways tells that, within a tolerance.
    """

    name: str
    frame: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", parse(str(self.name)).name)
        frame = numbers(self.frame, f"components of the frame of {self.name}")
        nearest = nearest_rotation(frame)
        if nearest is None:
            raise InputError(f"the frame of {self.name} must be a rotation matrix [3, 3], determinant +1")
        object.__setattr__(self, "frame", read_only(nearest))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PointGroup):
            return NotImplemented
        return self.name == other.name and np.array_equal(self.frame, other.frame)

    def __hash__(self) -> int:
        return hash((self.name, *self.frame.flat))  # by its numbers, as -0.0 is 0.0

    @property
    def symbol(self) -> Symbol:
        """Family and fold of the name."""
        return parse(self.name)

    @property
    def is_finite(self) -> bool:
        """Whether the group has no axis of infinite order."""
        return not math.isinf(self.symbol.fold) and self.symbol.family not in ("K", "Kh")

    @property
    def is_polar(self) -> bool:
        """Whether it leaves more than the centre where it is: the points of a plane, of an axis, or all."""
        return self.symbol.family in ("C", "Cv") or self.name == "Cs"

    @property
    def order(self) -> float:
        """Number of operations: an int, or `math.inf`."""
        return len(standard_operations(self.symbol)) if self.is_finite else math.inf

    @property
    def has_inversion(self) -> bool:
        """Whether -1 is an operation."""
        return self._elements().inversion

    @property
    def is_chiral(self) -> bool:
        """Whether every operation is a rotation, so that the object differs from its mirror image."""
        return self.proper_subgroup().name == self.name

    def operations(self) -> Array:
        """All operations [order, 3, 3], rotations first, the identity leading.

        Raises:  InputError: the group is continuous; `sampled` gives a finite subgroup.
        """
        if not self.is_finite:
            raise InputError(f"{self.name} has infinitely many operations: take those of group.sampled(fold)")
        return np.asarray(self.frame.T @ standard_operations(self.symbol) @ self.frame)

    def bringing(self, direction: Array, goal: Array) -> Array:
        """Operations [k, 3, 3] among which those are that bring one direction [3] nearest to another; all if finite.

        Either end of a direction will do. About a continuous axis a turn to the azimuth of the goal, after what each
        connected part of the group does; of all of space, one of the turns from one to the other.
        """
        if self.is_finite:
            return self.operations()
        if self.symbol.family in ("K", "Kh"):
            return (frame_with_z(goal).T @ frame_with_z(direction))[None]
        parts = standard_operations(Symbol(family=self.symbol.family, fold=2))
        every = np.concatenate([parts, parts])
        ends = every @ (self.frame @ direction) * np.repeat([1.0, -1.0], len(parts))[:, None]
        x, y, _ = self.frame @ goal
        turns = about_z(1.0, 1.0, np.arctan2(y, x) - np.arctan2(ends[:, 1], ends[:, 0]))
        return np.asarray(self.frame.T @ turns @ every @ self.frame)

    def mirrors(self) -> Array:
        """Unit normals [m, 3] of the mirror planes; a continuous family is represented by one member."""
        return np.asarray(self._elements().mirrors @ self.frame)

    def lone_mirrors(self) -> Array:
        """Unit normals [m, 3] of the mirror planes that no operation carries onto another one."""
        normals, operations = self.mirrors(), self.sampled(3).operations()
        cosines = np.abs(np.einsum("mi,kij,mj->km", normals, operations, normals))
        return normals[(cosines > 1.0 - SINGLE).all(axis=0)]

    def rotation_axes(self) -> list[OrderedAxis]:
        """(direction, highest order) of every rotation axis, by falling order; `math.inf` for a continuous axis.

        The perpendicular two-fold axes of Dinf and Dinfh are represented by one, the axes of K and Kh by x, y, z.
        """
        return _turned(self._elements().axes, self.frame)

    def improper_axes(self) -> list[OrderedAxis]:
        """(direction, k) of every rotoreflection axis S_k, k >= 3 (S1 is a mirror, S2 the inversion).

        On an n-fold axis, k = n if a mirror lies across it (Cnh, Dnh, Oh's S4), else k = 2n (S2n, Dnd, Td, Oh's S6).
        """
        return _turned(self._elements().improper, self.frame)

    def continuous_axes(self) -> Array:
        """Directions [0 | 1 | 3, 3] about which any angle is an operation (x, y, z for K and Kh)."""
        directions = [u for u, order in self.rotation_axes() if math.isinf(order)]
        return np.array(directions).reshape(-1, 3)

    def proper_subgroup(self) -> "PointGroup":
        """The rotations among the operations, in the same frame."""
        name = Symbol(family=self.symbol.family[0].replace("S", "C"), fold=self.symbol.fold).name
        return PointGroup(name=name, frame=self.frame)

    def carried(self, matrix: Array) -> "PointGroup":
        """The group of what an orthogonal map [3, 3] carries its object to.

        R G R' is (-R) G (-R)', so that one of R and -R, the rotation, turns the frame.
        """
        return PointGroup(name=self.name, frame=self.frame @ matrix.T * np.sign(np.linalg.det(matrix)))

    def for_point_set(self) -> "PointGroup":
        """The group that a set of points (or a mesh, or a density) has if it has this one.

        A set invariant under all turns about z consists of circles: it has every mirror through z too. So Cinf means
        Cinfv, Cinfh and Dinf mean Dinfh, K means Kh; finite groups stay as they are.
        """
        if self.is_finite:
            return self
        name = Symbol(family=_POINT_SET[self.symbol.family], fold=self.symbol.fold).name
        return PointGroup(name=name, frame=self.frame)

    def sampled(self, fold: int) -> "PointGroup":
        """A finite subgroup: Cinf.. and Dinf.. with `fold` in place of inf, I and Ih for K and Kh; itself if it is."""
        return PointGroup(name=_sampled(self.symbol, fold).name, frame=self.frame)

    def distance_rad(self, operations: ArrayLike) -> Array:
        """Angle [k] between each orthogonal matrix [k, 3, 3] and the nearest operation of the group."""
        return _away_rad(self, nearest_orthogonal(operations))

    def nearest(self, matrices: Array) -> Array:
        """The operation [k, 3, 3] nearest to each orthogonal matrix [k, 3, 3], exactly; any one of several."""
        turned = self.frame @ matrices @ self.frame.T
        if self.is_finite:
            operations = standard_operations(self.symbol)
            found = operations[nearest_operations(turned, operations, np.eye(3))[0]]
        else:
            parts = np.array(list(self._closest_continuous(turned)))
            best = np.argmin([chord_angles(turned, near) for near in parts], axis=0)
            found = parts[best, np.arange(len(turned))]
        return np.asarray(self.frame.T @ found @ self.frame)

    def equivalent(self, directions: ArrayLike) -> Array:
        """Orbit [j, 3] of one direction [3] or several [m, 3]: all distinct images, merged within 1e-6."""
        images = np.einsum("kij,mj->mki", self.operations(), np.atleast_2d(unit(directions))).reshape(-1, 3)
        keep: list[Array] = []
        for image in images:
            if not keep or np.min(np.linalg.norm(np.array(keep) - image, axis=1)) > SINGLE:
                keep.append(image)
        return np.array(keep)

    def _elements(self) -> Elements:
        return standard_elements(self.symbol) if self.is_finite else _continuous_elements(self.symbol.family)

    def _closest_continuous(self, turned: Array) -> Iterable[Array]:
        """The nearest operation to each given one, once for every connected part of the continuous group."""
        family = self.symbol.family
        if family == "Kh":
            return [turned]
        if family == "K":
            return [orthogonal_factor(turned, proper=True)]
        return [about_z(end, det, angles_about_z(turned, det)) for end, det in _connected_parts(family)]


def point_group(name: str, frame: ArrayLike | None = None) -> PointGroup:
    """The point group of any Schoenflies symbol or alias, placed by `frame` (default: the standard placement).

    Args:
        name: `C4v`, `d24h`, `S8`, `Ih`, `Cinfv`, `C∞v`, ...; an alias (`C1h`) is read as the canonical group (`Cs`).
        frame: rotation [3, 3]; rows are the x, y and z axes of the group. Of one whose last row is a direction the main
            axis points there; `symrefine.geometry.frame_with_z(direction)` makes one.

    Raises:
        InputError: no such group, or the frame is no rotation.
    """
    placed: Any = np.eye(3) if frame is None else frame
    return PointGroup(name=name, frame=placed)


def is_subgroup(a: PointGroup, b: PointGroup, tolerance_rad: float = SINGLE) -> bool:
    """Whether every operation of `a` is, within `tolerance_rad`, an operation of `b`, both where they stand."""
    if a.order > b.order:
        return False
    members = standard_operations(_sampled(a.symbol, 7))
    if tolerance_rad < SINGLE:  # the trace tells an angle to the square root of what rounding leaves
        return bool(_away_rad(b, a.frame.T @ members @ a.frame).max() <= tolerance_rad)
    turn = b.frame @ a.frame.T
    return angle_of_overlap(_overlap(b, turn @ members @ turn.T)) <= tolerance_rad


def _away_rad(group: PointGroup, matrices: Array) -> Array:
    """Angle [k] between each orthogonal matrix [k, 3, 3] and the nearest operation of a group."""
    if group.is_finite:
        return nearest_operations(matrices, standard_operations(group.symbol), group.frame)[1]
    return chord_angles(matrices, group.nearest(matrices))


def _overlap(group: PointGroup, turned: Array) -> float:
    """The least trace of `A' G` for operations A [k, 3, 3] in the standard placement and the G nearest to each."""
    family = group.symbol.family
    if group.is_finite:
        return float(overlaps(turned, standard_operations(group.symbol)).min())
    if family in ("K", "Kh"):
        return 3.0 if family == "Kh" or (determinants(turned) > 0.0).all() else 1.0
    parts = [overlaps_about_z(turned, end, det) for end, det in _connected_parts(family)]
    return float(np.max(parts, axis=0).min())


def _sampled(symbol: Symbol, fold: int) -> Symbol:
    """The finite group that stands for a continuous one; a finite one for itself."""
    if symbol.family in ("K", "Kh"):
        return Symbol(family=symbol.family.replace("K", "I"), fold=symbol.fold)
    return replace(symbol, fold=fold) if math.isinf(symbol.fold) else symbol


def _turned(axes: Iterable[OrderedAxis], frame: Array) -> list[OrderedAxis]:
    return [(u @ frame, order) for u, order in axes]


@cache
def _connected_parts(family: str) -> tuple[tuple[int, int], ...]:
    """What those of a continuous group do to its axis (sign of z) and to the plane across (determinant there)."""
    members = standard_operations(Symbol(family=family, fold=2))  # each finite member has them, too
    signs = zip(members, determinants(members), strict=True)
    return tuple(sorted({(round(m[2, 2]), round(det * m[2, 2])) for m, det in signs}))


def _continuous_elements(family: str) -> Elements:
    """Elements of a continuous group in the standard placement, one member standing for each continuous family."""
    # Those of the member of fold 1, which has one of each, and the endless axes.
    one = standard_elements(Symbol(family=family.replace("K", "C"), fold=1))
    endless = tuple((u, math.inf) for u in np.eye(3)[0 if family in ("K", "Kh") else 2 :])
    across = family in ("Ch", "Dh", "Kh")
    return Elements(
        mirrors=one.mirrors, axes=(*endless, *one.axes), improper=endless if across else (), inversion=across
    )
