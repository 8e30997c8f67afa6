"""The group that permutes a set of points, found from where its operations may carry two of them.

An operation leaves the centroid in place. So it carries a point onto one that is as far from there, and a second point
onto one that is as far and under the same angle; the two images and the determinant tell it. Two points whose distances
few others share leave few operations to ask. Where all are as far, on a sphere, they are told by their neighbours.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array, Mask, unit
from symrefine.groups import PointGroup
from symrefine.groups.identify import identify
from symrefine.groups.names import MAX_FOLD
from symrefine.shape import Index
from symrefine.surface.tree import APART, Tree, with_class

# Anchors are at least so far out, and so far off the line through the other, as a fraction of the farthest point: what
# rounding moves them by turns an operation by twenty times as much at most.
LEVER = 0.05
# Pairs of points that are compared, or images that are looked up, and pairs whose operations are asked, at most.
LARGEST, CANDIDATES = 5_000_000, 20_000
# Neighbours whose distances tell points apart: those that a vertex has in most triangulations.
AROUND = 6
# Points that operations are asked of in turn: most fail at once.
PROBES = (4, 40, 400)


def stays(points: Array, within: float) -> bool:
    """Whether points [N, 3] about their centroid are seen at once to be carried onto one another by nothing.

    No operation moves a point that is alone in its distance from there, and where these are in no plane with it none
    moves anything. Points that are told twice leave that open, as they draw the centroid.
    """
    radii = np.linalg.norm(points, axis=1)
    order = np.argsort(radii)
    gaps = np.diff(radii[order], prepend=-np.inf, append=np.inf)
    if gaps.min() == 0.0:
        return False
    alone = points[order[np.minimum(gaps[:-1], gaps[1:]) > 2.0 * within]]
    squares = np.linalg.eigvalsh(alone.T @ alone)
    return bool(squares[0] > LEVER**2 * squares[-1])


def permuting_groups(points: Array, labels: Index | None, within: float) -> Iterator[PointGroup | None]:
    """The finite group about the centroid whose operations carry points onto points of the same label.

    Args:
        points: [N, 3] distinct, about their centroid.
        labels: [N] small numbers, or None.
        within: by how much a point may be out of place.

    Yields:
        What some hundreds of the points tell, and then all: C1 if nothing else does; None where that cannot be told.
        Nothing where none of them can tell: where points lie on a line, where too many operations would have to be
        asked. None for folds beyond `MAX_FOLD`, and where some points are mapped by what makes no group.
    """
    tree = Tree(with_class(points, labels))
    radii = np.linalg.norm(points, axis=1)
    distant, reach = LEVER * radii.max(), 2.0 * within
    traits = radii[None] if labels is None else (radii + APART * labels)[None]
    kinds = _Kinds.of(traits, [reach])
    first, second = _anchors(points, kinds, distant)
    if kinds.alike[first] * kinds.alike[second] > CANDIDATES:
        # On a sphere all are alike but for what is around them, which moves by as much as both ends do.
        around = tree.query(tree.points, AROUND, skip=1)[0].T
        kinds = _Kinds.of(np.concatenate([traits, around]), [reach, *AROUND * [2.0 * reach]])
        first, second = _anchors(points, kinds, distant)
    aside = np.linalg.norm(np.cross(points, unit(points[first])), axis=1)
    if aside[second] < distant:
        return
    goals = [points[kinds.like(k)] for k in (first, second)]
    if len(goals[0]) * len(goals[1]) > LARGEST:
        return
    cosines = goals[0] @ goals[1].T - points[first] @ points[second]
    rows, columns = np.nonzero(np.abs(cosines) <= reach * (radii[first] + radii[second]))
    if len(rows) > CANDIDATES:
        return
    here, there = _frames(points[[first]], points[[second]]), _frames(goals[0][rows], goals[1][columns])
    proper = np.swapaxes(there, 1, 2) @ here
    mirror = np.eye(3) - 2.0 * np.outer(here[0, 2], here[0, 2])
    operations = np.concatenate([proper, proper @ mirror])
    miss = reach * (1.0 + radii.max() / radii[first] + radii.max() / aside[second])
    for part in (PROBES, (len(points),)):
        for probes in part:
            if len(operations) * probes > LARGEST:
                return
            some = np.arange(0, len(points), max(1, len(points) // probes))
            moved = points[some] @ np.swapaxes(operations, 1, 2)
            classes = None if labels is None else np.broadcast_to(labels[some], moved.shape[:2])
            operations = operations[(tree.nearest(with_class(moved, classes))[0] <= miss).all(axis=1)]
        yield _identified(operations)


def _identified(operations: Array) -> PointGroup | None:
    """The group of operations [K, 3, 3]; None where they are none, or too many."""
    if len(operations) > 4 * MAX_FOLD:
        return None
    try:
        return identify(operations)
    except InputError:  # of what others break, or of points nearly as near one another as rounding
        return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Kinds:
    """What operations leave of each point: `traits` [T, N], each to its `reach` [T]; `alike` [N] share the rarest."""

    traits: Array
    reach: Array
    alike: Index

    @classmethod
    def of(cls, traits: Array, reach: Sequence[float]) -> "_Kinds":
        alike = np.empty(traits.shape, dtype=np.intp)
        for own, within, found in zip(traits, reach, alike, strict=True):
            # Numbers in order are looked up ten times as fast.
            order = np.argsort(own)
            ascending = own[order]
            found[order] = np.searchsorted(ascending, ascending + within, side="right")
            found[order] -= np.searchsorted(ascending, ascending - within)
        return cls(traits=traits, reach=np.array(reach), alike=alike.min(axis=0))

    def rarest(self, allowed: Mask) -> int:
        """The point allowed of which there are the fewest."""
        return int(np.flatnonzero(allowed)[np.argmin(self.alike[allowed])])

    def like(self, point: int) -> Mask:
        """Which points [N] one may be carried to."""
        return np.asarray((np.abs(self.traits - self.traits[:, [point]]) <= self.reach[:, None]).all(axis=0))


def _anchors(points: Array, kinds: _Kinds, distant: float) -> tuple[int, int]:
    """The rarest point so far out, and the rarest so far off the line through it; the farthest off if none is."""
    first = kinds.rarest(np.linalg.norm(points, axis=1) >= distant)
    aside = np.linalg.norm(np.cross(points, unit(points[first])), axis=1)
    return first, kinds.rarest(aside >= min(distant, float(aside.max())))


def _frames(first: Array, second: Array) -> Array:
    """Right-handed frames [K, 3, 3], rows: along the first points [K, 3], and the normal of both last."""
    x, z = unit(first), unit(np.cross(first, second))
    return np.stack([x, np.cross(z, x), z], axis=1)
