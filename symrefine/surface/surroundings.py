"""What is around the points of a cloud, or around some of them that stand for all."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, Mask
from symrefine.shape import Index
from symrefine.surface.neighbourhoods import planes_of, renumbered, thickness_of
from symrefine.surface.tree import Tree

# Points that are asked first, and neighbours that tell of the surroundings of a point. To 3,000 points the legs of a
# spider are no surface.
ASKED, AROUND = 5000, 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """Points with what is around each of them, itself left out.

    Attributes:
        points: [N, 3].
        tree: kd-tree over them.
        away: [N, AROUND] distances of the neighbours, nearest first.
        near: [N, AROUND] indices of the neighbours.
    """

    points: Array
    tree: Tree
    away: Array
    near: Index

    @classmethod
    def of(cls, points: Array) -> "Surroundings":
        """The surroundings of points [N, 3]; N > AROUND."""
        tree = Tree(points)
        away, near = tree.query(points, AROUND, skip=1, scattered=True)
        return cls(points=points, tree=tree, away=away, near=near)

    def without(self, some: Mask) -> "Surroundings":
        """The surroundings of all but some [N] of the points; asked anew only where one of them was around."""
        kept = np.flatnonzero(~some)
        points, place = self.points[kept], np.cumsum(~some) - 1
        tree, away, near = Tree(points), self.away[kept], place[self.near[kept]]
        changed = some[self.near[kept]].any(axis=1)
        away[changed], near[changed] = tree.query(points[changed], AROUND, skip=1)
        return Surroundings(points=points, tree=tree, away=away, near=near)

    @property
    def reach(self) -> Array:
        """Distance [N] of the neighbour in the middle."""
        return np.asarray(self.away[:, AROUND // 2 - 1])

    @cached_property
    def thickness(self) -> Array:
        """Thickness over length [N] of what is around each point."""
        return thickness_of(planes_of(self.points, self.near)[2])


def around_some(points: Array, rng: np.random.Generator) -> Surroundings:
    """The surroundings of some of points [N, 3]."""
    return Surroundings.of(points[some_of(points, rng)])


def some_of(points: Array, rng: np.random.Generator) -> Index:
    """Indices of some of points [N, 3] at random, and of the farthest, lest a few strays are missed."""
    away = ((points - np.median(points, axis=0)) ** 2).sum(axis=1)
    asked_or_far = np.concatenate([rng.permutation(len(points))[:ASKED], np.argpartition(away, -1 - AROUND)[-AROUND:]])
    return renumbered(asked_or_far, len(points))[0]
