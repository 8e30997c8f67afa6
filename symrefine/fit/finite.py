"""Which finite group is made exact: a fold in place of a continuous axis."""

import math

import numpy as np

from symrefine.fit.anchors import PROBES
from symrefine.geometry import Array, rotation
from symrefine.groups import MAX_FOLD, TURNS, PointGroup
from symrefine.rounding import SINGLE
from symrefine.shape import Index
from symrefine.surface.tree import Tree

# How near folds that are tried on the rings of a lathed mesh must come, in spacings; a larger fold is taken although it
# misses by more, up to ALIKE times more, or LAX times where that is next to nothing.
NEAR, ALIKE, LAX, CLEAN = 0.25, 1.3, 3.0, 0.2


def finite_group(group: PointGroup, points: Array, turns: int = TURNS) -> PointGroup:
    """The group itself, or a finite part of a continuous one: the fold of the rings, else so many turns; Ih of a ball.

    Args:
        points: [N, 3] distinct points relative to the centre.
        turns: that stand for a continuous axis where the points themselves show no fold.
    """
    if group.is_finite:
        return group
    if group.symbol.family in ("K", "Kh"):
        return group.sampled(1)
    fold = _ring_fold(points, group.frame[2])
    if fold:
        group = PointGroup(name=group.name, frame=_on_rings(points, group.frame, fold))
    return group.sampled(fold or turns)


def _ring_fold(points: Array, axis: Array) -> int:
    """Largest k for which turns by 2 pi / k about the axis map points on other points; 0 if there is none."""
    off = points[np.linalg.norm(np.cross(points, axis), axis=1) > SINGLE * np.abs(points).max()]
    if len(off) < 3:
        return 0
    tree = Tree(off)
    near = NEAR * float(np.median(tree.query(off, 1, skip=1)[0]))
    folds = np.arange(3, min(MAX_FOLD, len(off)) + 1)
    # A few probes turn nearly all down: by other folds rings miss by half a spacing.
    for probes in PROBES[1:]:
        index = np.arange(0, len(off), max(1, len(off) // probes))
        misses = _misses(off, tree, axis, folds, index)
        folds, misses = folds[misses < near], misses[misses < near]
        if not folds.size:
            return 0
    best = float(misses.min())
    limit = max(ALIKE * best, min(CLEAN * near, LAX * best)) + SINGLE * float(np.abs(points).max())
    return int(folds[misses <= limit].max())


def _misses(points: Array, tree: Tree, axis: Array, folds: Index, index: Index) -> Array:
    """Median distances [F] from some points, turned by each fold, to others; infinite where most meet themselves."""
    # One step tells a fold from few, many steps tell it from the next one.
    many = [next(m for m in range(round(0.382 * k), 0, -1) if math.gcd(m, k) == 1) for k in folds.tolist()]
    angles = 2.0 * np.pi * np.stack([np.ones(len(folds)), many]) / folds
    along = np.outer(points[index] @ axis, axis)
    across, aside = points[index] - along, np.cross(axis, points[index])
    moved = along + np.cos(angles)[..., None, None] * across + np.sin(angles)[..., None, None] * aside
    distance, rows = tree.nearest(moved)
    stays = (rows == index).mean(axis=2) >= 0.5
    return np.asarray(np.where(stays, np.inf, np.median(distance, axis=2)).max(axis=0))


def _on_rings(points: Array, frame: Array, fold: int) -> Array:
    """The frame turned about z so that mirrors of a k-fold group, pi / k apart, go through the points or between."""
    x, y, _ = (points @ frame.T).T
    phase = np.angle(np.hypot(x, y) @ np.exp(2j * fold * np.arctan2(y, x))) / (2.0 * fold)
    return np.asarray(rotation([0.0, 0.0, 1.0], -float(phase)) @ frame)
