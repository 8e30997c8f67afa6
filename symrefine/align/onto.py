"""Maps that carry few points onto points, one by one: where points stand for themselves, their distances say it all.

A map leaves the centroid in place. So it carries a point onto one that is as far from there, and every further point
onto one that has its distances from those before as well; as many points as there are dimensions tell the map. Anchors
whose distances few others share leave few maps to ask.
"""

import numpy as np

from symrefine.align.kinds import set_apart
from symrefine.fit.anchors import LARGEST, LEVER, PROBES
from symrefine.fit.refine import MAX_OUTER
from symrefine.geometry import Array, orthogonal_factor
from symrefine.shape import Index
from symrefine.surface.tree import Tree


def maps_onto(
    source: Array, target: Array, labels: tuple[Index | None, Index | None], within: float, *, crowded: bool = True
) -> tuple[Array, Array] | None:
    """All orthogonal maps of points onto as many others of their labels, each onto one of its own.

    Args:
        source: [N, n] about the centroid, spanning all dimensions.
        target: [N, n] likewise.
        labels: [N] of both, with one meaning, or None.
        within: by how much the image of a point may miss.
        crowded: whether points may come to lie nearer to others than to their own.

    Returns:
        Matrices [K, n, n] and the misses [K, N] of the points; None where too many maps would have to be asked.
    """
    known = _anchored(source, target, labels, within) if len(source) ** 2 <= LARGEST else None
    if known is None:
        return None
    maps, lever = known
    size = 4.0 * float(np.abs(target).max())
    tree = Tree(set_apart(target, labels[1], size))

    def counterparts(maps: Array, some: Index) -> tuple[Array, Index]:
        """Distances and indices [K, S] of the nearest point of its label to each image of some points."""
        own = None if labels[0] is None else labels[0][some]
        return tree.nearest(set_apart(source[some] @ np.swapaxes(maps, 1, 2), own, size))

    slack = within * (1.0 + lever)
    for probes in (*PROBES, len(source)):
        some = np.arange(0, len(source), max(1, len(source) // probes))
        if len(maps) * source[some].size > LARGEST:
            return None
        maps = maps[(counterparts(maps, some)[0] <= slack).all(axis=1)]
    every = np.arange(len(source))
    near: Index = np.zeros((len(maps), 0), dtype=np.int64)
    for _ in range(MAX_OUTER):
        before, near = near, counterparts(maps, every)[1]
        if np.array_equal(before, near):
            break
        maps = orthogonal_factor(np.einsum("kni,nj->kij", target[near], source))
    # Where noise brings points to the place of others, the nearest are not one for each.
    single = (np.sort(near, axis=1) == every).all(axis=1)
    if not crowded:
        near, single = near[single], single[single]
    shared = np.flatnonzero(~single)
    if len(shared) * len(source) ** 2 > LARGEST:
        return None
    for k in shared:
        near[k] = _one_each(set_apart(source @ maps[k].T, labels[0], size), tree.points)
    near = np.unique(near, axis=0)
    maps = orthogonal_factor(np.einsum("kni,nj->kij", target[near], source))
    moved = set_apart(source @ np.swapaxes(maps, 1, 2), labels[0], size)
    misses = np.linalg.norm(moved - tree.points[near], axis=2)
    good = misses.max(axis=1) <= within
    return maps[good], misses[good]


def _one_each(moved: Array, target: Array) -> Index:
    """Which of points [N, .] each of as many has for its own, the squares of all distances being least."""
    from scipy.optimize import linear_sum_assignment

    apart = np.linalg.norm(moved[:, None] - target, axis=2)
    return np.asarray(linear_sum_assignment(apart**2)[1])


def _anchored(
    source: Array, target: Array, labels: tuple[Index | None, Index | None], within: float
) -> tuple[Array, float] | None:
    """Maps [K, n, n] that a few points allow, and by how much more others may be off than these; None of too many."""
    radii, there = np.linalg.norm(source, axis=1), np.linalg.norm(target, axis=1)
    alike = np.abs(radii[:, None] - there) <= within
    if labels[0] is not None and labels[1] is not None:
        alike &= labels[0][:, None] == labels[1]
    far, basis, lever = radii.max(), np.zeros((0, source.shape[1])), 0.0
    anchors, images = list[int](), np.zeros((1, 0), dtype=np.int64)
    for _ in range(source.shape[1]):
        off = source - source @ basis.T @ basis
        aside = np.linalg.norm(off, axis=1)
        # The rarest; of these the farthest out.
        allowed = np.flatnonzero(aside >= min(LEVER * far, aside.max()))
        anchor = int(allowed[np.lexsort((-aside[allowed], alike[allowed].sum(axis=1)))[0]])
        goals = np.flatnonzero(alike[anchor])
        if len(images) * len(goals) * source.shape[1] > LARGEST:
            return None
        fits = np.ones((len(images), len(goals)), dtype=bool)
        for k, known in enumerate(anchors):
            apart = np.linalg.norm(target[images[:, k], None] - target[goals], axis=2)
            fits &= np.abs(apart - np.linalg.norm(source[anchor] - source[known])) <= 2.0 * within
        rows, columns = np.nonzero(fits)
        images = np.column_stack([images[rows], goals[columns]])
        basis = np.vstack([basis, off[anchor] / aside[anchor]])
        anchors.append(anchor)
        lever += far / float(aside[anchor])
    return orthogonal_factor(np.einsum("kai,aj->kij", target[images], source[anchors])), lever
