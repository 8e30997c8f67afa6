"""From verified mirrors and axes, incomplete and a little off, to the point group they generate."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import DegenerateShapeError, InputError
from symrefine.geometry import Array, frame_with_z, rotation, rotoreflection, unit
from symrefine.groups.closure import close
from symrefine.groups.names import MAX_FOLD, Symbol
from symrefine.groups.orthogonal import axes_and_angles, fit_frame, half_turns, nearest_operations
from symrefine.groups.point_group import PointGroup
from symrefine.groups.standard import standard_operations
from symrefine.rounding import SINGLE

# By how much directions of elements that somebody found may be off: several times what a fit leaves at 1 % noise, and
# less than half of the 3.6 degrees that mirrors of fifty folds stand apart.
DIRECTION_ERROR_RAD = math.radians(1.5)
GivenAxis = tuple[ArrayLike, float | Literal["inf"]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """One row per element: direction [k, 3], order of C_n or S_k (mirror: S_1, inversion: S_2), determinant."""

    directions: Array
    orders: Array
    dets: Array

    def operations(self) -> Array:
        """Generators [k, 3, 3]; a continuous axis is represented by a turn of one radian."""
        angles = np.where(np.isinf(self.orders), 1.0, 2.0 * np.pi / self.orders)
        turn = [rotation if det > 0.0 else rotoreflection for det in self.dets]
        return np.array([f(u, a) for f, u, a in zip(turn, self.directions, angles, strict=True)])


def from_elements(
    *,
    mirrors: ArrayLike | Sequence[ArrayLike] = (),
    axes: Sequence[GivenAxis] = (),
    improper: Sequence[GivenAxis] = (),
    inversion: bool = False,
    tolerance_rad: float = DIRECTION_ERROR_RAD,
) -> PointGroup:
    """The point group that symmetry elements found by a detector generate, its frame fitted to all their directions.

    The elements may be incomplete (two mirrors at 45 degrees give C4v, a three-fold and a four-fold axis O) and each
    direction a little off; orders are taken as exact. An axis of order "inf" gives Cinf, with mirrors through it Cinfv,
    with a mirror across it or the inversion Cinfh, with a perpendicular two-fold axis Dinf, with two of these Dinfh;
    two such axes, further apart than twice the tolerance, give Kh. `PointGroup.for_point_set` adds the mirrors that any
    shape with a continuous axis has.

    Args:
        mirrors: normals [m, 3].
        axes: (direction, order n of C_n); the order may be "inf" or `math.inf`.
        improper: (direction, order k of S_k).
        inversion: whether x -> -x is a symmetry.
        tolerance_rad: largest error of a direction.
    Raises:
        InputError: malformed elements.
        DegenerateShapeError: the elements generate no point group within the tolerance; names the worst one.
    """
    found = _gather(np.asarray(mirrors, dtype=np.float64).reshape(-1, 3), axes, improper, inversion)
    if len(found.orders) == 0:
        return PointGroup(name="C1")
    if np.isinf(found.orders).any():
        return _continuous(found, tolerance_rad)
    # A direction off by d turns a mirror or half turn by 2 d.
    closure = close(found.operations(), 2.0 * tolerance_rad, orders=found.orders.astype(int).tolist())
    if not closure.finite:
        raise DegenerateShapeError(closure.message)
    return _refined(closure.group, found, tolerance_rad)


def _gather(mirrors: Array, axes: Sequence[GivenAxis], improper: Sequence[GivenAxis], inversion: bool) -> _Found:
    rows: list[tuple[ArrayLike, float, float]] = [(normal, 1, -1.0) for normal in mirrors]
    rows += [(u, _order(n), 1.0) for u, n in axes] + [(u, _order(k), -1.0) for u, k in improper]
    rows += [([0.0, 0.0, 1.0], 2, -1.0)] if inversion else []
    directions = np.array([np.asarray(u, dtype=np.float64) for u, _, _ in rows]).reshape(-1, 3)
    lengths = np.linalg.norm(directions, axis=1)
    if not np.all((lengths > 0.0) & np.isfinite(lengths)):
        raise InputError("normals and axis directions must be finite and not zero")
    orders, dets = np.array([n for _, n, _ in rows]), np.array([det for _, _, det in rows])
    return _Found(directions=unit(directions), orders=orders, dets=dets)


def _order(order: float | Literal["inf"]) -> float:
    value = float(order)
    if not (math.isinf(value) or (value == int(value) and 1 <= value <= MAX_FOLD)):
        raise InputError(f'the order of an axis must be a whole number from 1 to {MAX_FOLD} or "inf"; it is {order!r}')
    return value


def _refined(group: PointGroup, found: _Found, tolerance_rad: float) -> PointGroup:
    """Fit the frame to directions, all of the same weight, instead of operations (a C36 hardly turns anything)."""
    operations, standard = found.operations(), standard_operations(group.symbol)
    targets = axes_and_angles(standard)[0][nearest_operations(operations, standard, group.frame)[0]]
    axial = axes_and_angles(operations)[1] > SINGLE
    if not axial.any():
        return group
    frame = fit_frame(half_turns(found.directions[axial]), half_turns(targets[axial]), group.frame)
    sines = np.linalg.norm(np.cross(found.directions @ frame.T, targets), axis=1) * axial
    _check(found, np.arcsin(np.minimum(sines, 1.0)), tolerance_rad, group.name)
    return PointGroup(name=group.name, frame=frame)


def _continuous(found: _Found, tolerance_rad: float) -> PointGroup:
    """Cinf ... Dinfh from what the other elements do to the continuous axis and across it; Kh from two such axes."""
    endless = np.isinf(found.orders)
    if np.abs(found.directions[endless] @ found.directions[endless][0]).min() < np.cos(2.0 * tolerance_rad):
        return PointGroup(name="Kh")
    z = _revolution_axis(found)
    images = found.operations() @ z
    moved = np.arcsin(np.minimum(np.linalg.norm(np.cross(images, z), axis=1), 1.0))
    _check(found, 0.5 * moved, tolerance_rad, "a group with one axis of revolution")
    upright, improper = images @ z > 0.0, found.dets < 0.0
    kinds = np.any(upright & improper), np.any(~upright & improper), np.any(~upright & ~improper)
    family = "Dh" if sum(kinds) > 1 else "C" if not any(kinds) else ("Cv", "Ch", "D")[int(np.argmax(kinds))]
    return PointGroup(name=Symbol(family=family, fold=math.inf).name, frame=frame_with_z(z))


def _revolution_axis(found: _Found) -> Array:
    """Direction nearest to all elements along it and farthest from all across it, in the sense of least squares."""
    u = found.directions
    first = u[np.isinf(found.orders)][0]
    along = np.where(np.abs(u @ first) > np.sqrt(0.5), 1.0, -1.0)
    along[(found.orders == 2) & (found.dets < 0.0)] = 0.0  # the inversion has no direction
    return np.asarray(np.linalg.eigh((u * along[:, None]).T @ u)[1][:, -1])


def _check(found: _Found, errors_rad: Array, tolerance_rad: float, name: str) -> None:
    """Name the element that fits worst, if it is too far off."""
    i = int(np.argmax(errors_rad))
    if errors_rad[i] > tolerance_rad:
        kind = "mirror" if found.orders[i] == 1 else f"{'C' if found.dets[i] > 0 else 'S'}{found.orders[i]:g} axis"
        where = ", ".join(f"{x:.3f}" for x in found.directions[i])
        raise DegenerateShapeError(
            f"the elements do not generate {name} within {np.degrees(tolerance_rad):.2g} degrees: "
            f"the {kind} along ({where}) is off by {np.degrees(errors_rad[i]):.2g} degrees"
        )
