"""How a cloud was sampled: which points belong to no surface, and how much surface each of the others stands for.

A few thousand of the points tell whether there is anything to be done at all; only then all of them are asked. What is
decided here depends on the surroundings of a point alone, so that it breaks no symmetry.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, Mask
from symrefine.shape import Index
from symrefine.surface.misses import SHARES
from symrefine.surface.neighbourhoods import (
    FLAT,
    WIDEST,
    blobness,
    choose_neighbours,
    connected_parts,
    fills_volume,
    planes_of,
    thickness_of,
)
from symrefine.surface.tree import Tree

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
# that of a fall-off of 3:1. Objects with thin parts at one end have it too; that does them no harm.
UNEVEN = 0.1
# Density over the least up to which weights make up for it: there neighbourhoods are one step of sizes narrower.
DENSER = 2.0
# Share of the points beyond which they are too lonely to say how dense a surface was sampled.
LONELY = 0.99
# A clump holds at most this share of the points, so many that it counts, and has no counterpart: none of half its size.
CLUMP, COUNTERPART = 0.1, 0.5
# Neighbourhoods as thick as this, over that of points at random in a ball, fill a volume: the finest details of objects
# reach 0.87 where noise leaves them visible at all.
FILLED = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampling:
    """Which points of a cloud make the object.

    Attributes:
        kept: indices, ascending.
        even: those of them that sample the surface at about the same density: all where they do.
        shares: [len(even)] surface that each of these stands for; None where they are an even sample.
        strays: indices of those far from all others.
        clumps: indices of each group of points that was set apart from the body, with no counterpart.
        blobs: of each group of those kept that touches the body, fills a volume and has no counterpart.
    """

    kept: Index
    even: Index
    strays: Index
    clumps: tuple[Index, ...] = ()
    blobs: tuple[Index, ...] = ()
    shares: Array | None = None


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
        away, near = tree.query(points, AROUND, skip=1)
        return cls(points=points, tree=tree, away=away, near=near)

    @property
    def reach(self) -> Array:
        """Distance [N] of the neighbour in the middle."""
        return np.asarray(self.away[:, AROUND // 2 - 1])

    @cached_property
    def planes(self) -> tuple[Array, Array, Array]:
        """Means, normals and variances (across first), all [N, 3], of the neighbours."""
        return planes_of(self.points, self.near)

    @property
    def thickness(self) -> Array:
        """Thickness over length [N] of what is around each point."""
        return thickness_of(self.planes[2])


def sampling(
    points: Array,
    rng: np.random.Generator,
    *,
    outliers: bool,
    groups: bool = True,
    apart: bool = True,
    blobs: bool = False,
) -> Sampling:
    """How points [N, 3] were sampled; with `outliers` those that belong to no surface are set apart.

    With `apart` clumps apart from the body are as well, and with `blobs` those that touch it; without `groups` nobody
    looks for either. Of points that fill a volume none is set apart, and all are kept.
    """
    kept: Index = np.arange(len(points))
    taken: list[Index] = []
    lone: list[Index] = []
    if len(points) <= AROUND or points.std() == 0.0:
        return Sampling(kept=kept, even=kept, strays=kept[:0])
    some = _some(points, rng)
    spread = points[some].std()
    points = (points - points[some].mean(axis=0)) / spread
    around = Surroundings.of(points[some])
    if fills_volume(around.points, around.tree, np.random.default_rng(0)):
        return Sampling(kept=kept, even=kept, strays=kept[:0])
    if outliers and _alone(around).any():
        kept = _without_strays(points)
        around = _around(points[kept], rng)
    strays = np.setdiff1d(np.arange(len(points)), kept)
    if outliers and groups and apart and (found := clumps(points[kept], around)):
        taken += [kept[c] for c in found]
        kept = np.setdiff1d(kept, np.concatenate(taken))
        around = _around(points[kept], rng)
    if outliers and groups:
        lone = [kept[b] for b in filled(points[kept], around, rng)]
    if blobs and lone:
        taken += lone
        kept = np.setdiff1d(kept, np.concatenate(lone))
        around = _around(points[kept], rng)
    even, shares = _evened(points[kept], rng) if _is_uneven(around) else (slice(None), None)
    return Sampling(
        kept=kept,
        even=kept[even],
        shares=shares,
        strays=strays,
        clumps=tuple(taken),
        blobs=() if blobs else tuple(lone),
    )


def _around(points: Array, rng: np.random.Generator) -> Surroundings:
    """The surroundings of some of points [N, 3]."""
    return Surroundings.of(points[_some(points, rng)])


def _some(points: Array, rng: np.random.Generator) -> Index:
    """Indices of points [N, 3] at random, and of the farthest, lest a few strays are missed."""
    away = ((points - np.median(points, axis=0)) ** 2).sum(axis=1)
    return np.union1d(rng.permutation(len(points))[:ASKED], np.argpartition(away, -1 - AROUND)[-AROUND:])


def _without_strays(points: Array) -> Index:
    """Indices, ascending, of points [N, 3] but for those on no surface: far from others, in no plane with them.

    Sparse parts of a surface are flat, more so than dense ones; strays near a surface are not in its plane. Each round
    sees clearer, as strays among strays look less alone.
    """
    kept = np.arange(len(points))
    while len(kept) > AROUND:
        alone = _alone(Surroundings.of(points[kept]))
        kept = kept[~alone]
        if alone.sum() <= LAST * len(points):
            break
    return kept


def _alone(around: Surroundings) -> Mask:
    """Which of some points are far from the others and in no plane with them."""
    points, reach = around.points, around.reach
    # Points that are repeated have no spacing to be far by.
    sparse = np.flatnonzero(reach > FAR * np.median(reach)) if np.median(reach) > 0.0 else np.empty(0, dtype=np.int64)
    found = np.zeros(len(points), dtype=bool)
    if sparse.size:
        mean, normals, _ = (p[sparse] for p in around.planes)
        across = np.abs(np.einsum("ni,ni->n", normals, points[sparse] - mean))
        loose = (around.thickness[sparse] > FLAT) | (across > FLAT * around.away[sparse, -1])
        # As random points are among themselves, or far from what is dense around: thin parts, sampled sparsely, are not
        if not _scattered(points[sparse[loose]], np.ptp(points, axis=0)):
            loose &= reach[sparse] > FAR * reach[around.near[sparse]].min(axis=1)
        found[sparse] = loose
    return found


def strays_beside(points: Array, around: Surroundings) -> Mask:
    """Which of further points [N, 3] are far from a surface that some are known of, and in no plane with them."""
    far = FAR * np.median(around.reach)
    found = np.asarray(around.tree.query(points, 1, skip=AROUND // 2 - 1)[0][:, 0] > far)
    if not found.any():
        return found
    away, near = around.tree.query(points[found], AROUND)
    mean, normals, variances = planes_of(around.points, near)
    across = np.abs(np.einsum("ni,ni->n", normals, points[found] - mean))
    found[found] = (thickness_of(variances) > FLAT) | (across > FLAT * away[:, -1])
    return found


def _scattered(points: Array, box: Array) -> bool:
    """Whether most of points [N, 3] lie no closer together than random ones in a box of these sides [3] would."""
    neighbours = AROUND // 2
    if len(points) <= neighbours:
        return False
    away = Tree(points).query(points, 1, skip=neighbours)[0]
    return bool(4.0 / 3.0 * np.pi * np.median(away) ** 3 * len(points) > CROWDED * np.prod(box))


def clumps(points: Array, around: Surroundings) -> list[Index]:
    """Indices, ascending, of each group of points [N, 3] apart from the body that is small and has no counterpart.

    Points hang together if each is among the nearest of the other, whatever the density: a few between two dense parts
    join nothing. `around` tells of some of the points.
    """
    apart = [m for m in _lone(_parts(around)) if _gap(around, m)] if np.median(around.reach) > 0.0 else []
    return _members(points, around, apart)


def count_parts(points: Array, rng: np.random.Generator) -> int:
    """How many parts points [N, 3] have, strays left out, that hang together and are so large that they count."""
    if len(points) <= AROUND:
        return 1
    sizes = np.bincount(_parts(_around(points, rng)))
    return max(int((sizes > max(SHARES[-1] * sizes.sum(), AROUND)).sum()), 1)


def _parts(around: Surroundings) -> Index:
    """Number of the part that each of some points belongs to: they hang together if each is near the other."""
    count = len(around.points)
    one, other = np.repeat(np.arange(count), AROUND), around.near.ravel()
    mutual = (around.near[other] == one[:, None]).any(axis=1)
    return connected_parts(one[mutual], other[mutual], count)


def filled(points: Array, around: Surroundings, rng: np.random.Generator) -> list[Index]:
    """Indices, ascending, of each small group of points [N, 3] with no counterpart that fills a volume by the body.

    Neighbourhoods there look like points at random in a ball: among some of the points, and among all in neighbourhoods
    so large that noise does not make the surface look so too. `around` tells of some of the points.
    """
    thick = blobness(around.planes[2], AROUND)[around.near].mean(axis=1)
    within = thick > FILLED
    one, other = np.repeat(np.arange(len(within)), AROUND), around.near.ravel()
    inside = within[one] & within[other]
    part = np.where(within, connected_parts(one[inside], other[inside], len(within)), -1)
    small = [part == k for k in np.flatnonzero(_small(np.bincount(part + 1)[1:], len(part)))]
    if not small:
        return []
    tree = Tree(points)
    size = 2 * choose_neighbours(points, tree, rng)
    enough = 2 * size * len(part) / len(points)  # fewer tell nothing of neighbourhoods so large
    for m in small:
        if m.sum() < enough or np.median(_blobness(points, tree, around.points[m], size)) < FILLED:
            part[m] = -1
    return _members(points, around, [_grown(m, around) for m in _lone(part)])


def _blobness(points: Array, tree: Tree, queries: Array, size: int) -> Array:
    """`blobness` [Q] of what is around queries [Q, 3] among points [N, 3]."""
    return blobness(planes_of(points, tree.query(queries, size)[1])[2], size)


def _small(sizes: Index, count: int) -> Mask:
    """Which parts of so many points are too small to be the body, and large enough to be seen."""
    return np.asarray((sizes <= CLUMP * count) & (sizes > SHARES[-1] * count))


def _lone(part: Index) -> list[Mask]:
    """Small parts, given the number of each point's part, that none other is about as large as; -1 is no part."""
    sizes = np.bincount(part + 1)[1:]
    small = np.flatnonzero(_small(sizes, len(part)))
    own = sizes[small, None]
    alike = (sizes >= COUNTERPART * own) & (sizes <= own / COUNTERPART)
    return [part == k for k in small[alike.sum(axis=1) == 1]]


def _gap(around: Surroundings, some: Mask) -> bool:
    """Whether nine in ten of some points stand farther from all others than from their own neighbours."""
    between = Tree(around.points[~some]).nearest(around.points[some])[0]
    return bool(np.quantile(between, 0.1) > np.median(around.reach[some]))


def _grown(some: Mask, around: Surroundings) -> Mask:
    """Some points with those that most neighbours of are among them: a core with its rim."""
    while (more := some | (some[around.near].mean(axis=1) > 0.5)).sum() > some.sum():
        some = more
    return some


def _members(points: Array, around: Surroundings, groups: list[Mask]) -> list[Index]:
    """Indices of all points [N, 3] that belong to each of some groups, as the nearest of some points do."""
    if not groups:
        return []
    nearest = around.tree.nearest(points)[1]
    return [np.flatnonzero(m[nearest]) for m in groups]


def _is_uneven(around: Surroundings) -> bool:
    """Whether the density falls off along some direction, as that of a scanner does; it is what shifts moments.

    Flat neighbourhoods must show it as well: on thin parts it is a matter of shape how far away others are.
    """
    area = _area(around)
    if not area.all() or np.median(around.away[:, -1]) > WIDEST:
        return False  # points are repeated, or so few that the shape decides how far away their neighbours are
    flat = around.thickness < FLAT
    told = [np.ones_like(flat), flat] if flat.sum() > AROUND else [np.ones_like(flat)]
    return all(_trend(around.points[some], np.log(area[some])) > UNEVEN for some in told)


def _trend(points: Array, values: Array) -> float:
    """Standard deviation of the linear function of points [N, 3] that comes closest to values [N]."""
    place = np.column_stack([np.ones(len(values)), points - points.mean(axis=0)])
    return float((place @ np.linalg.lstsq(place, values, rcond=None)[0]).std())


def _evened(points: Array, rng: np.random.Generator) -> tuple[Index, Array]:
    """Indices, ascending, of points [N, 3] drawn such that none lie much closer than the sparsest do, and their shares.

    Weights alone would even out moments. But a dense part is known more finely than its image in a sparse one, and what
    the two miss one another by is no noise that halves of the cloud would show.
    """
    around = Surroundings.of(points)
    area = _area(around)[around.near].mean(axis=1)
    chance = np.minimum(DENSER * area / np.quantile(area, LONELY), 1.0)
    even = np.flatnonzero(rng.random(len(points)) < chance)
    return even, (area / chance)[even]


def _area(around: Surroundings) -> Array:
    """How much surface [N] each point stands for, up to a factor."""
    away = around.away[:, -1]
    return np.asarray(np.minimum(away, np.quantile(away, LONELY)) ** 2)
