"""The group that permutes a set of points, found from where its operations may carry two of them.

An operation leaves the centroid in place. So it carries a point onto one that is as far from there, and a second point
onto one that is as far and under the same angle; the two images and the determinant tell it. Two points whose distances
few others share leave few operations to ask.
"""

import numpy as np

from symrefine.errors import InputError
from symrefine.fit.action import labelled
from symrefine.geometry import Array, unit
from symrefine.groups import PointGroup
from symrefine.groups.identify import identify
from symrefine.groups.names import MAX_FOLD
from symrefine.shape import Index

# Anchors are at least so far out, and so far off the line through the other, as a fraction of the farthest point: what
# rounding moves them by turns an operation by twenty times as much at most.
LEVER = 0.05
# Pairs of points that are compared, or images that are looked up, and pairs whose operations are asked, at most.
LARGEST, CANDIDATES = 5_000_000, 20_000
# Points that operations are asked of in turn: most fail at once.
PROBES = (4, 40, 400)


def permuting_group(points: Array, labels: Index | None, within: float, *, every: bool = False) -> PointGroup | None:
    """The finite group about the centroid whose operations carry points onto points of the same label.

    Args:
        points: [N, 3] distinct, about their centroid.
        labels: [N], or None.
        within: by how much a point may be out of place.
        every: whether all points are asked in the end, and not some hundreds.

    Returns:
        C1 if nothing else does; None where that cannot be told: where points lie on a line, where too many operations
        would have to be asked, for folds beyond `MAX_FOLD`, and where some points are mapped by what makes no group.
    """
    tree, shifted = labelled(points, labels)
    radii = np.linalg.norm(points, axis=1)
    distant, reach = LEVER * radii.max(), 2.0 * within
    own = radii + shifted
    ordered = np.sort(own)
    alike = np.searchsorted(ordered, own + reach, side="right") - np.searchsorted(ordered, own - reach)
    first = _rarest(alike, radii >= distant)
    aside = np.linalg.norm(np.cross(points, unit(points[first])), axis=1)
    if aside.max() < distant:
        return None
    second = _rarest(alike, aside >= distant)
    if alike[first] * alike[second] > LARGEST:
        return None
    goals = [points[np.abs(own - own[k]) <= reach] for k in (first, second)]
    cosines = goals[0] @ goals[1].T - points[first] @ points[second]
    rows, columns = np.nonzero(np.abs(cosines) <= reach * (radii[first] + radii[second]))
    if len(rows) > CANDIDATES:
        return None
    here, there = _frames(points[[first]], points[[second]]), _frames(goals[0][rows], goals[1][columns])
    proper = np.swapaxes(there, 1, 2) @ here
    mirror = np.eye(3) - 2.0 * np.outer(here[0, 2], here[0, 2])
    operations = np.concatenate([proper, proper @ mirror])
    miss = reach * (1.0 + radii.max() / radii[first] + radii.max() / aside[second])
    for probes in (*PROBES, *([len(points)] if every else [])):
        if len(operations) * probes > LARGEST:
            return None
        some = np.arange(0, len(points), max(1, len(points) // probes))
        moved = points[some] @ np.swapaxes(operations, 1, 2)
        goal = np.dstack([moved, np.broadcast_to(shifted[some], moved.shape[:2])])
        operations = operations[(tree.nearest(goal)[0] <= miss).all(axis=1)]
    if len(operations) > 4 * MAX_FOLD:
        return None
    try:
        return identify(operations)
    except InputError:  # of what others break, or of points nearly as near one another as rounding
        return None


def _rarest(alike: Index, allowed: Array) -> int:
    """The point allowed whose distance the fewest share."""
    return int(np.flatnonzero(allowed)[np.argmin(alike[allowed])])


def _frames(first: Array, second: Array) -> Array:
    """Right-handed frames [K, 3, 3], rows: along the first points [K, 3], and the normal of both last."""
    x, z = unit(first), unit(np.cross(first, second))
    return np.stack([x, np.cross(z, x), z], axis=1)
