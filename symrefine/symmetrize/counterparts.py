"""How a finite group permutes points that nearly have it: nearest points as counterparts, and what they leave without.

These are pairs closer to a mirror than the noise, and the like. Orbit by orbit: a point either takes part in an orbit
of full length or lies on an element of the group, by the noise beside it; for each of these cases the places of the
orbit are given to points one to one, and the case that moves the points least wins, longer orbits before shorter ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from symrefine.fit.action import generators, mean_back
from symrefine.geometry import Array, Mask
from symrefine.shape import Index
from symrefine.surface.tree import Tree, with_class

# More points, or larger groups, than this are left alone: it costs their product for each orbit.
LARGEST, LARGEST_GROUP = 1500, 240
# A longer orbit is taken although a shorter one moves the points less, by up to this factor.
PREFERENCE = 2.0


# Rows [K] at the place of each g of what stands at the identity, and how far points move [K].
_Orbit = tuple[Index, Array]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Action:
    """Counterparts `images` [K, N] of points under operations [K, 3, 3], and where they are an action of the group.

    `closed` [N] marks the points on whose orbits g h has the counterpart that g has of that of h: there each operation
    permutes the points. `miss` [N] is the largest distance of an image to its counterpart.
    """

    images: Index
    closed: Mask
    miss: Array

    def mean(self, points: Array, operations: Array) -> Array:
        """Means [N, 3] over the group of g^-1 (counterpart of g p)."""
        return mean_back((points[image] for image in self.images), operations)


def act(points: Array, operations: Array, labels: Index | None, reach: float) -> Action:
    """The nearest point of the same label as counterpart of each image, up to `reach`."""
    tree = Tree(with_class(points, labels))
    images, miss = np.empty((len(operations), len(points)), dtype=np.intp), np.zeros(len(points))
    for k, g in enumerate(operations):
        distance, images[k] = tree.nearest(with_class(points @ g.T, labels))
        miss = np.maximum(miss, distance)
    closed = miss <= reach
    for h, table in generators(operations):
        closed &= (images[table] == images[:, images[h]]).all(axis=0)
    # Only the points all of whose orbit is closed.
    while ((whole := closed & closed[images].all(axis=0)) != closed).any():
        closed = whole
    return Action(images=images, closed=closed, miss=miss)


def with_leftovers(points: Array, operations: Array, action: Action, labels: Index | None, reach: float) -> Action:
    """The action, with the orbits added that can be found among the points without one."""
    free = np.flatnonzero(~action.closed)
    if not 0 < len(free) <= LARGEST or len(operations) > LARGEST_GROUP:
        return action
    images, closed, miss = action.images.copy(), action.closed.copy(), action.miss.copy()
    products = (operations[:, None] @ operations[None]).reshape(-1, 9)
    table = Tree(operations.reshape(-1, 9)).nearest(products)[1].reshape(len(operations), -1)  # of g h
    while len(free):
        members = free[:1]
        if orbit := _orbit(points, operations, table, free, labels, reach):
            owners, moved = orbit
            members = np.unique(owners)
            closed[members] = True
            for k, owner in enumerate(owners):
                images[:, owner] = owners[table[:, k]]
            miss[members] = moved.max()
        free = np.setdiff1d(free, members)
    return Action(images=images, closed=closed, miss=miss)


def _orbit(
    points: Array, operations: Array, table: Index, free: Index, labels: Index | None, reach: float
) -> _Orbit | None:
    """The orbit of the first free point among the free ones."""
    same = free if labels is None else free[labels[free] == labels[free[0]]]
    found: _Orbit | None = None
    for stabilizer in _stabilizers(points[free[0]], operations, table, reach):
        orbit = _with_stabilizer(points, operations, table, same, stabilizer)
        if orbit and orbit[1].max() <= reach and (not found or _rms(orbit[1]) * PREFERENCE < _rms(found[1])):
            found = orbit
    return found


def _stabilizers(point: Array, operations: Array, table: Index, reach: float) -> Iterator[Index]:
    """Subgroups of the operations that move the point least, the trivial one first."""
    moved = np.linalg.norm(operations @ point - point, axis=1)
    order = np.argsort(moved, kind="stable")
    for count in range(1, int((moved <= 2.0 * reach).sum()) + 1):
        part = order[:count]
        if len(operations) % count == 0 and np.isin(table[np.ix_(part, part)], part).all():
            yield part


def _with_stabilizer(points: Array, operations: Array, table: Index, same: Index, stabilizer: Index) -> _Orbit | None:
    """The orbit of the first point as if it lay where the stabilizer leaves it, its places given to points."""
    first = (operations[stabilizer] @ points[same[0]]).mean(axis=0)
    coset = table[:, stabilizer].min(axis=1)
    heads, which = np.unique(coset, return_inverse=True)
    if len(heads) > len(same):
        return None
    cost = cdist(operations[heads] @ first, points[same]) ** 2
    cost[coset[0] == heads, 0] = -1.0  # the identity's place is the first point's own
    _, columns = linear_sum_assignment(cost)
    owners = same[columns][which.reshape(-1)]
    mean = np.einsum("kji,kj->i", operations, points[owners]) / len(operations)
    return owners, np.linalg.norm(operations @ mean - points[owners], axis=1)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
