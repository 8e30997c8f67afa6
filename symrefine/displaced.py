"""Parts out of place: what misses an operation, but meets the surface exactly once it is moved by a little.

The distance to the nearest surface understates how far a part stands from its counterpart: along its own faces it sees
nothing, and what it sees of the rest may lie between. A detail that is simply different on the two sides, a button or a
screw, meets nothing wherever it is moved; a part that is only shifted does, and how far it had to be moved is its miss.
"""

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.shape import Index
from symrefine.surface.misses import Judge, disc_distances, miss_distances
from symrefine.surface.skin import LocalPlanes

# A point is astray from this miss on (tolerances, and the floor in squares).
ASTRAY = 0.5
# Points astray belong together if they stand as near as this (spacings), and are a part from this number and share of
# the surface on: a smaller patch meets something wherever it is moved.
LINK = 3.0
PART, PART_SHARE = 8, 0.002
# Farthest that a part is moved in all and at once (tolerances), and in how many steps.
REACH = 3.0
STEP = 1.0
STEPS = 12
# A moved part meets the surface if four fifths of it miss by less than this (tolerances, and the floor).
MET = 0.2
# Normals that agree (cosine).
AGREE = 0.7
# Ridge: what no normal sees is not moved.
RIDGE = 1e-3


def displacement(judge: Judge, motion: Isometry, share: float) -> float:
    """How far the parts out of place stand from where an operation puts their counterparts, in tolerances.

    The largest distance that parts holding at least `share` of the surface have to be moved to meet it; 0 if those that
    meet it once they are moved hold less.
    """
    cloud, unit = judge.cloud, judge.tolerance * judge.diagonal
    if cloud.body == "atoms":
        return 0.0
    miss = miss_distances(cloud, motion)
    astray = np.flatnonzero(miss > np.hypot(ASTRAY * unit, judge.floor.p97 * judge.diagonal))
    moved = motion.apply(cloud.points[astray])
    part = _parts(moved, LINK * cloud.spacing, max(PART, int(PART_SHARE * len(cloud.points))))
    if not len(part) or part.max() < 0:
        return 0.0
    astray, moved, part = astray[part >= 0], moved[part >= 0], part[part >= 0]
    classes = cloud.classes(astray)
    shift = _shifts(cloud, moved, motion.turn(cloud.normals[astray]), classes, part, unit)
    left = disc_distances(cloud, moved + shift[part], classes)
    met = np.hypot(MET * unit, judge.floor.p95 * judge.diagonal)
    sizes = np.bincount(part)
    meets = np.bincount(part, weights=left < met) >= 0.8 * sizes
    far = np.linalg.norm(shift, axis=1) / unit
    order = np.argsort(-far)
    order = order[meets[order] & (far[order] <= REACH)]
    enough = np.flatnonzero(np.cumsum(sizes[order]) >= share * len(cloud.points))
    return float(far[order[enough[0]]]) if len(enough) else 0.0


def _parts(points: Array, link: float, least: int) -> Index:
    """Number of the part [N] that each point belongs to, -1 for points in no part of at least so many."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(points) < least:
        return np.full(len(points), -1)
    i, j = cKDTree(points).query_pairs(link, output_type="ndarray").T
    _, label = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(len(points), len(points))))
    large = np.bincount(label) >= least
    number = np.where(large, np.cumsum(large) - 1, -1)
    return np.asarray(number[label])


def _shifts(
    cloud: LocalPlanes, points: Array, normals: Array, classes: Index | None, part: Index, unit: float
) -> Array:
    """Translation [P, 3] of each part onto what is near it, all parts at once: point to plane, in a volume to point."""
    count = int(part.max()) + 1
    shift = np.zeros((count, 3))
    for _ in range(STEPS):
        at = points + shift[part]
        distance, near = cloud.nearest(at, classes, distance_upper_bound=REACH * unit)
        use = np.flatnonzero(np.isfinite(distance))
        near, gap = near[use], at[use] - cloud.points[near[use]]
        if cloud.isolated:
            seen = np.tile(np.eye(3), (len(use), 1, 1))
        else:
            towards = cloud.normals[near]
            agree = np.abs(np.einsum("ij,ij->i", normals[use], towards)) > AGREE
            seen = np.einsum("ni,nj->nij", towards, towards) * agree[:, None, None]
        matrix, vector = np.zeros((count, 3, 3)), np.zeros((count, 3))
        np.add.at(matrix, part[use], seen)
        np.add.at(vector, part[use], np.einsum("nij,nj->ni", seen, gap))
        ridge = RIDGE * np.maximum(np.trace(matrix, axis1=1, axis2=2), 1.0)
        step = np.linalg.solve(matrix + ridge[:, None, None] * np.eye(3), vector[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        shift -= step * np.minimum(1.0, STEP * unit / np.maximum(length, 1e-300))
    return shift
