"""From a few noisy operations to the whole group.

Multiplying noisy matrices until nothing new appears adds their errors up along every word. The finite groups of O(3)
are all known, so the closure is found as the smallest one that, suitably placed, contains every generator within the
tolerance: around a common axis by whole steps (`axial`), otherwise by trying the seven polyhedral groups.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups.axial import axial_operations
from symrefine.groups.identify import POLYHEDRAL, has_alike, identify, polyhedral_start
from symrefine.groups.names import parse
from symrefine.groups.orthogonal import Index, nearest_orthogonal, register
from symrefine.groups.point_group import PointGroup
from symrefine.groups.standard import standard_operations


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
