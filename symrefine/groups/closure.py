"""From a few noisy operations to the whole group.

Multiplying noisy matrices until nothing new appears adds their errors up along every word. The finite groups of O(3)
are all known, so the closure is found as the smallest one that, suitably placed, contains every generator within the
tolerance: around a common axis by whole steps (`axial`), otherwise by trying the seven polyhedral groups.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups.axial import axial_operations
from symrefine.groups.identify import POLYHEDRAL, has_alike, identify, polyhedral_start
from symrefine.groups.names import TURNS, parse
from symrefine.groups.orthogonal import Index, nearest_orthogonal, register
from symrefine.groups.point_group import PointGroup
from symrefine.groups.standard import standard_operations

# Groups of points that no other one but that of a ball contains.
MAXIMAL = ("Oh", "Ih")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Closure:
    """Outcome of `close`: the `group`, fitted to the generators (C1 unless `finite`), and how well it fits.

    `error_rad` is the largest angle between a generator and its operation in the group (inf unless `finite`);
    `message` says in a sentence what was found, or why nothing was.
    """

    finite: bool
    group: PointGroup
    error_rad: float
    message: str


def close(
    generators: ArrayLike,
    tolerance_rad: float,
    *,
    orders: Sequence[int] | None = None,
) -> Closure:
    """The smallest finite group that contains every generator up to `tolerance_rad`.

    Cn, Cnv, Cnh, Sn, Dn, Dnh are tried up to n = `CLOSED_FOLD`, Dnd up to half of it, unless `orders` ask for more.

    Args:
        generators: [k, 3, 3] orthogonal up to noise, determinant +1 or -1 each.
        tolerance_rad: largest error of a generator, as an angle of rotation (a mirror whose normal is off by d is off
            by 2 d). The larger it is, the less can be told about many-fold axes from few generators.
        orders: exact order of each generator where known, 0 where not: the order 24 of a turn by 15.2 degrees is
            knowledge, not something the angle tells.
    Raises:
        InputError: no generators of shape [k, 3, 3], a tolerance outside (0, 0.2], or `orders` of another length.
    """
    given = nearest_orthogonal(generators)
    if not 0.0 < tolerance_rad <= 0.2:
        raise InputError(f"tolerance_rad must lie in (0, 0.2]; it is {tolerance_rad:g}")
    known = np.zeros(len(given), dtype=np.intp) if orders is None else np.array(orders, dtype=np.intp)
    if len(given) == 0 or len(known) != len(given):
        raise InputError(f"one order per generator, one generator at least: {len(known)} orders for {len(given)}")
    tried = []
    for group in _candidates(given, tolerance_rad, known):
        tried.append(_fitted(given, group))
        if tried[-1].error_rad <= tolerance_rad:
            return tried[-1]
    return _not_finite(tried, tolerance_rad)


def may_be_in_one(known: PointGroup, other: PointGroup, error_rad: float) -> bool:
    """Whether some point group may hold a group where it stands and another one, which may stand so far off.

    The main axes of two that are not polyhedral tell: where they cross they do as in a cube or an icosahedron, or one
    of them is an axis of half turns, or a mirror, across. What turns by more folds than axes there keeps its axis under
    all operations of the other.
    """
    if {"Kh", "Ci", "C1"} & {known.name, other.name}:
        return True
    least = math.cos(2.0 * error_rad)  # what is off by an angle takes an axis to where it is off by twice as much
    for one, another in ((known, other), (other, known)):
        if one.symbol.fold > _most_crossed():
            members, axis = another.sampled(TURNS).operations(), one.frame[2]
            if np.abs(members @ axis @ axis).min() < least:
                return False
    apart, folds = abs(float(known.frame[2] @ other.frame[2])), (known.symbol.fold, other.symbol.fold)
    if apart >= math.cos(error_rad):
        # Of turns too many to be told apart what is round has all, which is asked for by itself.
        return math.inf in folds or math.lcm(*(max(int(f), 1) for f in folds)) <= max(*folds, TURNS)
    across = apart <= math.sin(error_rad) and min(folds) <= 2
    if across or min(folds) == 0 or max(folds) <= 2 or max(folds) > _most_crossed():
        return True  # two mirrors or half turns make a turn by any angle
    crossings = _crossings(int(folds[0]), int(folds[1]))
    return bool(np.abs(math.acos(apart) - crossings).min(initial=math.inf) <= error_rad)


@cache
def _most_crossed() -> float:
    """The most folds of an axis that crosses others than those of half turns: those of an icosahedron."""
    return max(fold for _, fold in PointGroup(name=MAXIMAL[-1]).rotation_axes())


@cache
def _crossings(one: int, other: int) -> Array:
    """Angles [A] up to a right one at which axes of so many folds cross in a cube or an icosahedron; 1 is a mirror."""
    found = []
    for whole in (PointGroup(name=name) for name in MAXIMAL):
        turns = whole.rotation_axes()
        a, b = (
            whole.mirrors() if fold == 1 else np.array([u for u, most in turns if most % fold == 0]).reshape(-1, 3)
            for fold in (one, other)
        )
        found.append(np.arccos(np.clip(np.abs(a @ b.T), 0.0, 1.0)).ravel())
    return np.unique(np.concatenate(found).round(6))


def _candidates(generators: Array, tolerance_rad: float, orders: Index) -> Iterator[PointGroup]:
    """Roughly placed groups that may contain the generators, axial ones first, then polyhedral ones by order."""
    for operations in axial_operations(generators, tolerance_rad, orders):
        yield identify(operations)
    for name in POLYHEDRAL:  # the first that fits is what they generate
        if has_alike(generators, parse(name), tolerance_rad):
            yield PointGroup(name=name, frame=polyhedral_start(generators, parse(name), 3.0 * tolerance_rad))


def _fitted(generators: Array, group: PointGroup) -> Closure:
    frame, errors = register(generators, standard_operations(group.symbol), group.frame)
    worst = float(errors.max())
    message = f"{group.name} contains every generator within {np.degrees(worst):.2g} degrees"
    return Closure(finite=True, group=PointGroup(name=group.name, frame=frame), error_rad=worst, message=message)


def _not_finite(tried: Sequence[Closure], tolerance_rad: float) -> Closure:
    message = f"no finite group contains every generator within {np.degrees(tolerance_rad):.2g} degrees: "
    if tried:
        best = min(tried, key=lambda closure: closure.error_rad)
        message += f"the closest, {best.group.name}, is {np.degrees(best.error_rad):.2g} degrees off; "
        message += "drop the weakest generator"
    else:
        message += "neither whole steps about a common axis nor a polyhedral group explain their angles"
    return Closure(finite=False, group=PointGroup(name="C1"), error_rad=np.inf, message=message)
