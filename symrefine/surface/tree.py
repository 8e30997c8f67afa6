"""Nearest neighbours: the kd-tree that all of detection asks, about twice as quick as scipy's."""

import math
from functools import cache, cached_property
from typing import Any

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.threads import one_thread

# Points in a leaf: of 6 to 32 the quickest for 1 to 12 neighbours. Of more neighbours than so many scipy's tree is
# quicker, which keeps them in a heap and not in a row.
LEAF, ROW = 24, 128
# Classes stand so far apart along one more coordinate that no query finds a point of another class first: where points
# are told in RMS radii or diagonals, none is a thousand of them away.
APART = 1e3


class Tree:
    """A kd-tree over points [N, d]."""

    def __init__(self, points: Array) -> None:
        from pykdtree.kdtree import KDTree

        self.points = np.ascontiguousarray(points, dtype=np.float64)
        with one_thread():
            self._tree: Any = KDTree(self.points, leafsize=LEAF) if len(self.points) else None

    def __reduce__(self) -> tuple[type["Tree"], tuple[Array]]:
        return Tree, (self.points,)  # the tree itself is memory of C

    def query(
        self, queries: Array, count: int, *, skip: int = 0, bound: float = math.inf, scattered: bool = False
    ) -> tuple[Array, Index]:
        """Distances and indices, both [Q, count], of the points nearest to queries [Q, d], nearest first.

        Args:
            queries: [Q, d]; those near one another stand best together.
            count: neighbours that are told.
            skip: how many nearer ones are left out: 1 for queries that are points of the tree.
            bound: neighbours so far away, and those that there are not, are told with an infinite distance and index N.
            scattered: whether the queries stand in no order, so that it takes less time to put them into one first.
        """
        if scattered:
            order = morton_order(queries)
            sorted_away, sorted_near = self.query(queries[order], count, skip=skip, bound=bound)
            away, near = np.empty_like(sorted_away), np.empty_like(sorted_near)
            away[order], near[order] = sorted_away, sorted_near
            return away, near
        last = skip + count
        if last > ROW:
            away, near = self._heap.query(queries, k=[*range(1 + skip, 1 + last)], distance_upper_bound=bound)
            return np.asarray(away), np.asarray(near)
        if self._tree is None:
            return np.full((len(queries), count), np.inf), np.zeros((len(queries), count), dtype=np.int64)
        with one_thread():
            limit = None if math.isinf(bound) else bound
            away, near = self._tree.query(np.ascontiguousarray(queries), k=last, distance_upper_bound=limit)
        away, near = away.reshape(-1, last)[:, skip:], near.reshape(-1, last)[:, skip:].astype(np.int64)
        if limit is not None or last > len(self.points):
            missing = near >= len(self.points)
            away[missing], near[missing] = np.inf, len(self.points)
        return away, near

    @cached_property
    def _heap(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.points, leafsize=LEAF, balanced_tree=False, compact_nodes=False)

    def nearest(self, queries: Array, *, bound: float = math.inf) -> tuple[Array, Index]:
        """Distance and index, both [...], of the point nearest to each of queries [..., d]; see `query`."""
        away, near = self.query(queries.reshape(-1, queries.shape[-1]), 1, bound=bound)
        return away.reshape(queries.shape[:-1]), near.reshape(queries.shape[:-1])


def with_class(points: Array, classes: Index | None) -> Array:
    """Points [..., d] with the class [...] as one more coordinate where there are classes."""
    return points if classes is None else np.concatenate([points, APART * classes[..., None]], axis=-1)


def morton_order(points: Array) -> Index:
    """Order [N] of points [N, d] along a Morton curve: neighbours stand together, and any stride takes an even part.

    Through as many cells as 15 bits can number, which are sorted faster than anything wider.
    """
    columns = np.ascontiguousarray(points.T)
    if not columns.size:
        return np.zeros(0, dtype=np.int64)
    bits = max(1, 15 // len(columns))
    low = columns.min(axis=1, keepdims=True)
    widest = max(float((columns.max(axis=1, keepdims=True) - low).max()), 1e-300)
    cells = np.minimum((columns - low) * (2**bits / widest), 2**bits - 1).astype(np.int16)
    spread = _spread(bits, len(columns))
    code = np.zeros(len(points), dtype=np.int16)
    for axis, cell in enumerate(cells):
        code |= spread[cell] << axis
    return np.argsort(code, kind="stable")


@cache
def _spread(bits: int, apart: int) -> "np.ndarray[tuple[int], np.dtype[np.int16]]":
    """Numbers of so many bits with their bits set apart, [2^bits]."""
    return np.array([sum((v >> b & 1) << apart * b for b in range(bits)) for v in range(2**bits)], dtype=np.int16)


def pairs_within(points: Array, radius: float) -> Index:
    """All pairs [P, 2], i < j, of points [N, d] that are no farther apart than a radius."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points, leafsize=LEAF).query_pairs(radius, output_type="ndarray"))
