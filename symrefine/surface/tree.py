"""Nearest neighbours: the kd-tree that all of detection asks, about twice as quick as scipy's."""

import math
from functools import cached_property
from typing import Any

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.threads import one_thread

# Points in a leaf: of 6 to 32 the quickest for 1 to 12 neighbours. Of more neighbours than so many scipy's tree is
# quicker, which keeps them in a heap and not in a row.
LEAF, ROW = 24, 128


class Tree:
    """A kd-tree over points [N, d]."""

    def __init__(self, points: Array) -> None:
        from pykdtree.kdtree import KDTree

        self.points = np.ascontiguousarray(points, dtype=np.float64)
        with one_thread():
            self._tree: Any = KDTree(self.points, leafsize=LEAF) if len(self.points) else None

    def query(self, queries: Array, count: int, *, skip: int = 0, bound: float = math.inf) -> tuple[Array, Index]:
        """Distances and indices, both [Q, count], of the points nearest to queries [Q, d], nearest first.

        Args:
            queries: [Q, d]; those near one another stand best together.
            count: neighbours that are told.
            skip: how many nearer ones are left out: 1 for queries that are points of the tree.
            bound: neighbours so far away, and those that there are not, are told with an infinite distance and index N.
        """
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
        """Distance and index, both [Q], of the point nearest to each query; see `query`."""
        away, near = self.query(queries, 1, bound=bound)
        return away[:, 0], near[:, 0]


def side_by_side(points: Array) -> Index:
    """Order [N] of points [N, d] in which neighbours stand together."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points, leafsize=LEAF, balanced_tree=False, compact_nodes=False).indices)


def pairs_within(points: Array, radius: float) -> Index:
    """All pairs [P, 2], i < j, of points [N, d] that are no farther apart than a radius."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points, leafsize=LEAF).query_pairs(radius, output_type="ndarray"))
