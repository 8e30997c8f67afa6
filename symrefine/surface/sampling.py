"""How a cloud was sampled: which of its points belong to no surface, and how much surface each other one stands for.

A few thousand of the points tell whether there is anything to be done at all; only then all of them are asked. What is
decided here depends on the surroundings of a point alone, so that it breaks no symmetry.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.neighbourhoods import FLAT, connected_parts, fills_volume, fit_planes, kd_tree, sums_of

# Points that are asked first, and neighbours that tell of the surroundings of a point.
ASKED, AROUND = 5000, 16
# A stray has its neighbours so many times as far away as half of the points have theirs: what 8 neighbours vary by on
# an even surface ends at 1.8, and a density that falls by 6:1 to one side reaches it.
FAR = 2.5
# The ball to the eighth neighbour of a point that is spread at random over a volume should hold eight, near a surface
# half of that; of thin parts that are sampled sparsely it should hold a tenth of one.
CROWDED = 1.0
# A round that finds fewer strays than this share is the last: what remains lies within the spacing of the surface.
LAST = 0.001
# Standard deviation of the logarithm of the density along some direction from which on points are no even sample: half
# that of a fall-off of 3:1. Objects with thin parts at one end have it too; their weights do no harm.
UNEVEN = 0.1
# A clump apart from the body holds at most this share of the points, and has no counterpart: none of half its size.
CLUMP, COUNTERPART = 0.1, 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampling:
    """Which points of a cloud make the object, and how much of its surface each of them stands for.

    Attributes:
        kept: [K] indices, ascending.
        strays: indices of those far from all others.
        clumps: indices of each group of points apart from the body, with no counterpart.
        shares: [K] surface that each of the kept stands for; None where they are an even sample.
    """

    kept: Index
    strays: Index
    clumps: tuple[Index, ...] = ()
    shares: Array | None = None


def sampling(points: Array, rng: np.random.Generator, *, outliers: bool, apart: bool = True) -> Sampling:
    """How points [N, 3] were sampled; with `outliers` those that belong to no surface are set apart.

    With `apart` too, clumps apart from the body are as well.

    Of points that fill a volume none is set apart, and all count alike.
    """
    every, none = np.arange(len(points)), np.empty(0, dtype=np.int64)
    some = points[rng.permutation(len(points))[:ASKED]]
    spread = some.std()
    some = (some - some.mean(axis=0)) / spread if spread > 0.0 else some
    if spread == 0.0 or fills_volume(some, kd_tree(some), np.random.default_rng(0)):
        return Sampling(kept=every, strays=none)
    away = strays(points, rng) if outliers else none
    body = np.setdiff1d(every, away)
    groups = tuple(body[c] for c in clumps(points[body], rng)) if outliers and apart else ()
    kept = np.setdiff1d(body, np.concatenate([none, *groups]))
    return Sampling(kept=kept, strays=away, clumps=groups, shares=shares(points[kept], rng))


def strays(points: Array, rng: np.random.Generator) -> Index:
    """Indices, ascending, of points [N, 3] that lie on no surface: far from others, and in no plane with them.

    Sparse parts of a surface are flat, more so than dense ones; strays near a surface are not in its plane. Each round
    sees clearer, as strays among strays look less alone.
    """
    away = ((points - np.median(points, axis=0)) ** 2).sum(axis=1)
    some = np.union1d(
        rng.permutation(len(points))[:ASKED], np.argsort(away)[-AROUND:]
    )  # lest a few far ones are missed
    if not _alone(points[some]).any():
        return np.empty(0, dtype=np.int64)
    kept = np.arange(len(points))
    while len(kept) > AROUND:
        alone = _alone(points[kept])
        kept = kept[~alone]
        if alone.sum() <= LAST * len(points):
            break
    return np.setdiff1d(np.arange(len(points)), kept)


def _alone(points: Array) -> NDArray[np.bool_]:
    """Which of points [N, 3] are far from the others and in no plane with them."""
    away, near = kd_tree(points).query(points, k=[*range(2, AROUND + 2)])
    reach = away[:, AROUND // 2 - 1]
    # Points that are repeated have no spacing to be far by.
    sparse = np.flatnonzero(reach > FAR * np.median(reach)) if np.median(reach) > 0.0 else np.empty(0, dtype=np.int64)
    found = np.zeros(len(points), dtype=bool)
    if sparse.size:
        sums = sums_of(points[near[sparse].ravel()]).reshape(len(sparse), AROUND, -1).sum(axis=1)
        mean, normals, variances = fit_planes(sums)
        across = np.abs(np.einsum("ni,ni->n", normals, points[sparse] - mean))
        thick = np.sqrt(variances[:, 0] / np.maximum(variances[:, 2], 1e-300))
        loose = (thick > FLAT) | (across > FLAT * away[sparse, -1])
        # As random points are among themselves, or far from what is dense around: thin parts, sampled sparsely, are not
        if not _scattered(points[sparse[loose]], np.ptp(points, axis=0)):
            loose &= reach[sparse] > FAR * reach[near[sparse]].min(axis=1)
        found[sparse] = loose
    return found


def _scattered(points: Array, box: Array) -> bool:
    """Whether most of points [N, 3] lie no closer together than random ones in a box of these sides [3] would."""
    neighbours = AROUND // 2
    if len(points) <= neighbours:
        return False
    away = kd_tree(points).query(points, k=[neighbours + 1])[0]
    return bool(4.0 / 3.0 * np.pi * np.median(away) ** 3 * len(points) > CROWDED * np.prod(box))


def clumps(points: Array, rng: np.random.Generator) -> list[Index]:
    """Indices, ascending, of each group of points [N, 3] apart from the body that is small and has no counterpart.

    Points belong together if one is among the nearest of the other, whatever the density.
    """
    some = rng.permutation(len(points))[:ASKED]
    tree = kd_tree(points[some])
    away, near = tree.query(points[some], k=[*range(2, AROUND // 2 + 2)])
    part = connected_parts(np.repeat(np.arange(len(some)), near.shape[1]), near.ravel(), len(some))
    sizes = np.bincount(part)
    if len(sizes) == 1 or np.median(away[:, -1]) == 0.0:
        return []
    alike = (sizes >= COUNTERPART * sizes[:, None]) & (sizes <= sizes[:, None] / COUNTERPART)
    small = np.flatnonzero((sizes <= CLUMP * len(some)) & (alike.sum(axis=1) == 1))
    apart = [k for k in small if _gap(points[some], part == k, away[:, -1])]
    owner = part[tree.query(points)[1]] if apart else part
    return [np.flatnonzero(owner == k) for k in apart]


def _gap(points: Array, some: NDArray[np.bool_], reach: Array) -> bool:
    """Whether some of the points [N, 3] stand farther from all others than from their own neighbours."""
    between = kd_tree(points[~some]).query(points[some])[0]
    return bool(between.min() > np.median(reach[some]))


def shares(points: Array, rng: np.random.Generator) -> Array | None:
    """How much surface each of points [N, 3] stands for, from the distance of its neighbours; None where all are even.

    What counts is how the density falls off along some direction: that is what a scanner does, and what shifts moments.
    """
    some = points[rng.permutation(len(points))[:ASKED]]
    place = np.column_stack([np.ones(len(some)), some - some.mean(axis=0)])
    area = _area(some)
    if not area.all():
        return None  # points are repeated
    trend = place @ np.linalg.lstsq(place, np.log(area), rcond=None)[0]
    return _area(points) if trend.std() > UNEVEN else None


def _area(points: Array) -> Array:
    away, _ = kd_tree(points).query(points, k=[AROUND + 1])
    return np.asarray(np.minimum(away, np.quantile(away, 0.99))[:, 0] ** 2)  # lest a few lonely ones weigh all
