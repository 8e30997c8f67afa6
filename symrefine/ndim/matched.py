"""Mirrors of points that stand for themselves: each must be taken to a point.

A mirror takes every point that is not in it to another one at the same distance from the centre, and the difference of
the two is its normal. So the differences of all pairs name all mirrors, but for one that holds all points.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.fit.refine import MAX_OUTER
from symrefine.geometry import Array, ReadOnly
from symrefine.moments.moments import BLOCK
from symrefine.ndim.roots import MOST
from symrefine.shape import SAME_MASS

# Points that candidates are tried on, far ones, as these tell most.
FIRST = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points(ReadOnly):
    """Points [N, n] about the centre with masses [N], and the diameter that misses are measured by."""

    points: Array
    masses: Array
    diameter: float

    @property
    def foreign(self) -> Array:
        """[N, N] infinite between points that are no images of each other, else 0."""
        a, b = self.masses[:, None], self.masses[None, :]
        return np.where(np.abs(a - b) > SAME_MASS * np.maximum(a, b), np.inf, 0.0)

    @property
    def free(self) -> Array:
        """[k, n] basis of the directions that hardly any point spreads in; two or more leave the mirrors free there."""
        across = np.linalg.eigh(self.points.T @ self.points)[1].T
        reach = np.abs(across @ self.points.T).max(axis=1)
        # What rounding leaves, not what the tolerance forgives.
        return across[reach <= 1e-9 * self.diameter]

    def miss(self, normal: Array) -> float:
        """Largest distance from a reflected point to the nearest one of its mass, over the diameter."""
        return float(self._nearest(normal)[0].max()) / self.diameter

    def _nearest(self, normal: Array) -> tuple[Array, Array]:
        image = self.points - 2.0 * np.outer(self.points @ normal, normal)
        apart = np.linalg.norm(image[:, None] - self.points, axis=2) + self.foreign
        nearest = apart.argmin(axis=1)
        return np.take_along_axis(apart, nearest[:, None], axis=1)[:, 0], nearest

    def refined(self, normal: Array) -> Array:
        """The normal of least squares, each image matched with its nearest point in turn.

        `sum |R x - y|^2 = const + 4 n.(sum y x^T) n` with `R = 1 - 2 n n^T`: the eigenvector of the least eigenvalue.
        """
        before: Array | None = None
        for _ in range(MAX_OUTER):
            _, nearest = self._nearest(normal)
            if before is not None and np.array_equal(before, nearest):
                break
            before = nearest
            products = self.points[nearest].T @ self.points
            normal = np.linalg.eigh(products + products.T)[1][:, 0]
        return normal

    def candidates(self, tolerance: float, same: float) -> tuple[list[Array], bool]:
        """Normals worth refining, best first, and whether they are all there are.

        Args:
            tolerance: as a fraction of the diameter.
            same: angle within which two candidates are one [rad].
        """
        # Both points of a pair may be off by the tolerance, and so may the centre.
        apart = 4.0 * tolerance
        normals = self._differences(apart)
        misses = self._misses(normals, np.argsort(-np.linalg.norm(self.points, axis=1), kind="stable")[:FIRST])
        best = np.argsort(misses, kind="stable")[: int(np.count_nonzero(misses <= apart))]
        return distinct(normals[best], same, MOST)

    def _differences(self, apart_rel: float) -> Array:
        """Unit differences [M, n] of all pairs about equally far from the centre."""
        radius = np.linalg.norm(self.points, axis=1)
        alike = np.abs(radius[:, None] - radius) <= apart_rel * self.diameter
        i, j = np.nonzero(np.triu(alike & np.isfinite(self.foreign), 1))
        apart = self.points[i] - self.points[j]
        length = np.linalg.norm(apart, axis=1)
        told = length > 1e-9 * self.diameter
        return np.asarray(apart[told] / length[told, None])

    def _misses(self, normals: Array, some: NDArray[np.int64]) -> Array:
        """`miss` [M] of each normal as some of the points tell it: |R x - y|^2 = |x - y|^2 + 4 (n.x)(n.y)."""
        squares = np.sum((self.points[some, None] - self.points) ** 2, axis=2) + self.foreign[some]
        step = max(1, BLOCK // len(some))
        found = [np.zeros(0)]
        for start in range(0, len(normals), step):
            along = normals[start : start + step] @ self.points.T
            apart = squares + 4.0 * along[:, some, None] * along[:, None, :]
            found.append(np.sqrt(np.maximum(apart.min(axis=2).max(axis=1), 0.0)))
        return np.concatenate(found) / self.diameter


def distinct(normals: Iterable[Array], same: float, most: int) -> tuple[list[Array], bool]:
    """The first of each bundle of normals within an angle [rad], and whether there were no more than `most`."""
    kept: list[Array] = []
    for normal in normals:
        if kept and float(np.abs(np.array(kept) @ normal).max()) > math.cos(same):
            continue
        if len(kept) == most:
            return kept, False
        kept.append(normal)
    return kept, True
