"""What either of two objects says of a map between them, place by place: it meets the other, it contradicts, or nobody
looked there.

Surfaces are asked by their local planes, as the search for a partial overlap asks them; atoms, solids and points of
another number of coordinates than three by the nearest point of the other.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from symrefine.align.contact import distances
from symrefine.align.kinds import nearest_both_ways, with_one_set_of_classes
from symrefine.align.pair import Side, few
from symrefine.align.shown import MOST_PLANES, Shown
from symrefine.detection.measure import SAMPLES
from symrefine.geometry import Array, Isometry, tight_diagonal
from symrefine.moments.moments import shape_moments
from symrefine.shape import Index, Shape
from symrefine.surface.misses import LIMITS, disc_distances
from symrefine.surface.surface import HOPELESS
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


def witnesses(source: Shape, target: Shape, *, scale: float = 1.0, tolerance: float, seed: int = 0) -> Witnesses:
    """The two objects, ready to be asked about any map of this scale, in the units of the input."""
    source, target = with_one_set_of_classes(source, target)
    if source.dim == 3 and not few(source, target) and {source.measure, target.measure} != {"solid", "points"}:
        sides = [_side(shape) for shape in (source, target)]
        unit = sides[1].moments.scale
        one, other = (Shown.of(s, u, seed, MOST_PLANES) for s, u in zip(sides, (unit / scale, unit), strict=True))
        if one is not None and other is not None:
            finest = min(one.cloud.spacing, other.cloud.spacing)
            shown = one.as_fine_as(finest), other.as_fine_as(finest)
            centers = sides[0].moments.center, sides[1].moments.center
            return _Surfaces(shown=shown, centers=centers, unit=unit, scale=scale, tolerance=tolerance)
    points, labels = [], []
    for shape in (source, target):
        some = slice(None, None, max(1, -(-len(shape.points) // SAMPLES)))
        points.append(shape.points[some])
        labels.append(None if shape.labels is None else shape.labels[some])
    size = target.diagonal
    return _Points(*points, labels=(labels[0], labels[1]), scale=scale, tolerance=tolerance, diagonal=size)


def _side(shape: Shape) -> Side:
    return Side(shape=shape, moments=shape_moments(shape, 2, parts=0), weights=np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Surfaces:
    """Local planes of both, each about its own centre, in units of the target."""

    shown: tuple[Shown, Shown]
    centers: tuple[Array, Array]
    unit: float
    scale: float
    tolerance: float

    @property
    def far(self) -> float:
        return LIMITS[1] * self.tolerance

    def misses(self, matrix: Array, translation: Array) -> Misses:
        shift = (self.scale * (matrix @ self.centers[0]) + translation - self.centers[1]) / self.unit
        motion = Isometry(matrix=matrix, shift=shift)
        back = Isometry(matrix=matrix.T, shift=-matrix.T @ shift)
        source, target = self.shown
        diagonal = min(tight_diagonal(shown.cloud.points) for shown in self.shown)
        return self._asked(source, target, motion, diagonal), self._asked(target, source, back, diagonal)

    def _asked(self, here: Shown, there: Shown, motion: Isometry, diagonal: float) -> Array:
        moved = motion.apply(here.cloud.points)
        classes, bound = here.cloud.labels, HOPELESS * self.far * diagonal
        found = disc_distances(there.cloud, moved, classes, bound=bound) / diagonal
        # Where a wall is too thin for the local planes its points still tell that there is something.
        found = np.minimum(found, distances(there.skin, moved, classes) / diagonal)
        return np.where(here.unseen(there, moved, found > self.far, self.far * diagonal), np.nan, found)

    def nearest(self, side: int, points: Array) -> tuple[Array, Index]:
        unit = (self.unit / self.scale, self.unit)[side]
        away, owner = Tree(self.shown[side].cloud.points).nearest((points - self.centers[side]) / unit)
        return unit * away, owner


@dataclass(frozen=True, slots=True)
class _Points:
    """Points of both, in the units of the input."""

    source: Array
    target: Array
    labels: tuple[Index | None, Index | None] = field(kw_only=True)
    scale: float = field(kw_only=True)
    tolerance: float = field(kw_only=True)
    diagonal: float = field(kw_only=True)

    @property
    def far(self) -> float:
        return self.tolerance

    def misses(self, matrix: Array, translation: Array) -> Misses:
        moved = self.scale * (self.source @ matrix.T) + translation
        return nearest_both_ways(moved, self.target, self.labels, self.diagonal)

    def nearest(self, side: int, points: Array) -> tuple[Array, Index]:
        from scipy.spatial import cKDTree

        away, owner = cKDTree((self.source, self.target)[side]).query(points)
        return np.asarray(away), np.asarray(owner)
