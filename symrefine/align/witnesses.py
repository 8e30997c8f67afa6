"""What either of two objects says of a map between them, place by place: it meets the other, it contradicts, or nobody
looked there.

Surfaces are asked by their local planes, as the search for a partial overlap asks them; atoms, solids and points of
another number of coordinates than three by the nearest point of the other.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from symrefine.align.contact import distances
from symrefine.align.judge import Judge
from symrefine.align.kinds import nearest_both_ways, with_one_set_of_classes
from symrefine.align.pair import Side, few
from symrefine.align.shown import MOST_PLANES, Shown
from symrefine.detection.measure import SAMPLES
from symrefine.geometry import Array, Isometry
from symrefine.moments.moments import shape_moments
from symrefine.shape import Index, Shape
from symrefine.surface.tree import Tree

Misses = tuple[Array, Array]


class Witnesses(Protocol):
    """Two objects that can be asked about maps from one to the other, at places of their own."""

    @property
    def far(self) -> float:
        """Miss from which on a place meets nothing, a fraction of the diagonal."""

    def misses(self, matrix: Array, translation: Array) -> Misses:
        """By how much the places of source [N] and target [M] miss the other object, fractions of the diagonal.

        NaN where nobody looked. The map is `target ~ scale * matrix @ source + translation`.
        """

    def nearest(self, side: int, points: Array) -> tuple[Array, Index]:
        """The place that is nearest to points [K, n] of the source (0) or the target (1), and how far away it is."""


def witnesses(source: Shape, target: Shape, *, scale: float = 1.0, tolerance: float) -> Witnesses:
    """The two objects, ready to be asked about any map of this scale, in the units of the input."""
    source, target = with_one_set_of_classes(source, target)
    if source.dim == 3 and not few(source, target) and {source.measure, target.measure} != {"solid", "points"}:
        sides = [Side(shape=s, moments=shape_moments(s, 2, parts=0), weights=np.zeros(0)) for s in (source, target)]
        unit = sides[1].moments.scale
        if (judge := Judge.of(sides, (unit / scale, unit), tolerance, seed=0, planes=MOST_PLANES)) is not None:
            centers = sides[0].moments.center, sides[1].moments.center
            return _Surfaces(judge=judge, centers=centers, unit=unit, scale=scale)
    points, labels = [], []
    for shape in (source, target):
        some = slice(None, None, max(1, -(-len(shape.points) // SAMPLES)))
        points.append(shape.points[some])
        labels.append(None if shape.labels is None else shape.labels[some])
    size = target.diagonal
    return _Points(*points, labels=(labels[0], labels[1]), scale=scale, far=tolerance, diagonal=size)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Surfaces:
    """Local planes of both, each about its own centre, in units of the target."""

    judge: Judge
    centers: tuple[Array, Array]
    unit: float
    scale: float

    @property
    def far(self) -> float:
        return self.judge.far

    def misses(self, matrix: Array, translation: Array) -> Misses:
        shift = (self.scale * (matrix @ self.centers[0]) + translation - self.centers[1]) / self.unit
        motion = Isometry(matrix=matrix, shift=shift)
        back = Isometry(matrix=matrix.T, shift=-matrix.T @ shift)
        source, target = self.judge.source, self.judge.target
        return self._asked(source, target, motion), self._asked(target, source, back)

    def _asked(self, here: Shown, there: Shown, motion: Isometry) -> Array:
        moved, classes, diagonal = motion.apply(here.cloud.points), here.cloud.labels, self.judge.diagonal
        # Where a wall is too thin for the local planes its points still tell that there is something.
        beside = distances(there.skin, moved, classes) / diagonal
        found = np.minimum(self.judge.misses(there, moved, classes), beside)
        return np.where(here.unseen(there, moved, found > self.far, self.far * diagonal), np.nan, found)

    def nearest(self, side: int, points: Array) -> tuple[Array, Index]:
        unit = (self.unit / self.scale, self.unit)[side]
        shown = (self.judge.source, self.judge.target)[side]
        away, owner = Tree(shown.cloud.points).nearest((points - self.centers[side]) / unit)
        return unit * away, owner


@dataclass(frozen=True, slots=True)
class _Points:
    """Points of both, in the units of the input."""

    source: Array
    target: Array
    labels: tuple[Index | None, Index | None] = field(kw_only=True)
    scale: float = field(kw_only=True)
    far: float = field(kw_only=True)
    diagonal: float = field(kw_only=True)

    def misses(self, matrix: Array, translation: Array) -> Misses:
        moved = self.scale * (self.source @ matrix.T) + translation
        return nearest_both_ways(moved, self.target, self.labels, self.diagonal)

    def nearest(self, side: int, points: Array) -> tuple[Array, Index]:
        from scipy.spatial import cKDTree

        away, owner = cKDTree((self.source, self.target)[side]).query(points)
        return np.asarray(away), np.asarray(owner)
