"""The chain of subgroups of a group by what each of its operations needs."""

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array
from symrefine.groups import PointGroup
from symrefine.groups.identify import identify

Members = NDArray[np.bool_]


def subgroup_chain(group: PointGroup, needs: Array) -> list[tuple[PointGroup, float]]:
    """Subgroups of a finite group, each inside the next, from the first beyond C1 to the group itself.

    The next one is that which needs least, and of those that need the same the largest.

    Args:
        needs: [order] of the operations, in their order; that of a subgroup is that of its worst operation.
    """
    operations = group.operations()
    table, here = _products(operations), np.arange(len(operations)) == 0
    found: list[tuple[PointGroup, float]] = []
    while not here.all():
        left = np.flatnonzero(~here)
        # One more operation, or all that need no more than some.
        more = [np.arange(len(here)) == k for k in left] + [needs <= level for level in np.unique(needs[left])]
        beyond = [_closed(table, here | members) for members in more]
        here = min(beyond, key=lambda members: (float(needs[members].max()), -int(members.sum())))
        whole = group if here.all() else identify(operations[here])
        found.append((whole, float(needs[here].max())))
    return found


def _products(operations: Array) -> NDArray[np.intp]:
    """[n, n] which operation follows from one after another."""
    flat = operations.reshape(-1, 9)
    return np.stack([((a @ operations).reshape(-1, 9) @ flat.T).argmax(axis=1) for a in operations])


def _closed(table: NDArray[np.intp], members: Members) -> Members:
    """The operations that some generate, the identity among them."""
    while True:
        known = np.flatnonzero(members)
        larger = np.zeros_like(members)
        larger[table[np.ix_(known, known)]] = True
        if larger.sum() == len(known):
            return larger
        members = larger
