"""How a cloud was sampled: which points belong to no surface, and how much surface each of the others stands for.

Of a mesh, how much surface an area stands for.

A few thousand of the points tell whether there is anything to be done at all; only then all of them are asked. What is
decided here depends on the surroundings of a point alone, so that it breaks no symmetry.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Mask, hull_volume
from symrefine.rounding import START_ERROR
from symrefine.samples import LOOK
from symrefine.shape import Index, Shape
from symrefine.surface.clumps import clumps, filled
from symrefine.surface.misses import SHARES
from symrefine.surface.neighbourhoods import FLAT, WIDEST, fills_volume, planes_of, thickness_of
from symrefine.surface.surroundings import AROUND, Surroundings, around_some, some_of
from symrefine.surface.tree import Tree

# A stray has its neighbours so many times as far away as half of the points have theirs: what 8 neighbours vary by on
# an even surface ends at 1.8, and a density that falls by 6:1 to one side reaches it.
FAR = 2.5
# A round that finds fewer strays than this share is the last: what remains lies within the spacing of the surface.
LAST = 0.001
# How far neighbours thin out like those of a surface, on the way there from points strewn in a box: sparse parts of
# most bodies with spokes, legs and thin walls by 0.2 to 0.9, strays by less than 0, as the body is near them.
ALONG = 0.25
# Density over the least up to which weights make up for it: there neighbourhoods are one step of sizes narrower.
DENSER = 2.0


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
        solid: whether some of the points show no surface at any width, so that all may fill a volume.
    """

    kept: Index
    even: Index
    strays: Index
    clumps: tuple[Index, ...] = ()
    blobs: tuple[Index, ...] = ()
    shares: Array | None = None
    solid: bool = False

    @classmethod
    def as_given(cls, count: int) -> "Sampling":
        """So many points that are all kept as they are."""
        every = np.arange(count)
        return cls(kept=every, even=every, strays=every[:0])


def sampling(
    points: Array,
    rng: np.random.Generator,
    *,
    outliers: bool,
    groups: bool = True,
    apart: bool = True,
    foreign: Sequence[Index] = (),
    native: Index | None = None,
) -> Sampling:
    """How points [N, 3] were sampled; with `outliers` those that belong to no surface are set apart.

    With `apart` clumps apart from the body are as well, and those groups that are known to be `foreign`, indices of
    each; if none are, it is told what may be. Without `groups` nobody looks for any. Of points that fill a volume only
    strays are set apart. Those that are known to be of the surface, `native`, are no strays however far from others.
    """
    size = len(points)
    kept: Index = np.arange(size)
    taken: list[Index] = []
    if len(points) <= AROUND or points.std() == 0.0:
        return Sampling.as_given(size)
    sure = np.zeros(size, dtype=bool)
    if native is not None:
        sure[native] = True
    some = some_of(points, rng)
    spread = points[some].std()
    points = (points - points[some].mean(axis=0)) / spread
    around = Surroundings.of(points[some])
    solid = _is_solid(around, points)
    if outliers and _alone(around).any() and (not solid or _stand_off(around)):
        kept = _without_strays(points, sure)
        around = around_some(points[kept], rng)
    groups = groups and not solid  # nothing tells one volume from another
    if outliers and groups and apart and (found := clumps(points[kept], around)):
        taken += [kept[c] for c in found]
        kept = _without(kept, taken, size)
        around = around_some(points[kept], rng)
    lone = [kept[b] for b in filled(points[kept], around, rng)] if outliers and groups and not foreign else []
    if foreign:
        taken += [np.intersect1d(group, kept, assume_unique=True) for group in foreign]
        kept = _without(kept, taken, size)
        # The rim of what fills a volume is alone once that is gone.
        kept = kept[_without_strays(points[kept], sure[kept])]
        around = around_some(points[kept], rng)
    strays = _without(np.arange(size), [kept, *taken], size)
    # Where strays or a clump were set apart, what is left far apart are others, or its rim.
    uneven = _is_uneven(around, points[kept], patchy=size - len(kept) <= SHARES[-1] * size)
    even, shares = _evened(points[kept], rng) if uneven else (slice(None), None)
    return Sampling(
        kept=kept,
        even=kept[even],
        shares=shares,
        strays=strays,
        clumps=tuple(taken),
        blobs=tuple(lone),
        solid=solid,
    )


def _is_solid(around: Surroundings, points: Array) -> bool:
    """Whether points [N, 3] fill a volume, as some of them say: to few points small parts are solid, too."""
    if not fills_volume(around.points, around.tree):
        return False
    return len(around.points) == len(points) or fills_volume(points, Tree(points))


def _without(indices: Index, parts: Sequence[Index], size: int) -> Index:
    """Those of indices below `size` that are in none of some parts."""
    left = np.ones(size, dtype=bool)
    left[np.concatenate(parts)] = False
    return indices[left[indices]]


def _without_strays(points: Array, sure: Mask) -> Index:
    """Indices, ascending, of points [N, 3] but for those on no surface: far from others, in no plane with them.

    Sparse parts of a surface are flat, more so than dense ones; strays near a surface are not in its plane. Each round
    sees clearer, as strays among strays look less alone. Those that are `sure` [N] to be of the surface stay.
    """
    kept, around = np.arange(len(points)), Surroundings.of(points)
    while True:
        alone = _alone(around) & ~sure[kept]
        kept = kept[~alone]
        if alone.sum() <= LAST * len(points) or len(kept) <= AROUND:
            return kept
        around = around.without(alone)


def _alone(around: Surroundings) -> Mask:
    """Which of some points are far from the others and in no plane with them."""
    points, reach = around.points, around.reach
    # Points that are repeated have no spacing to be far by.
    sparse = np.flatnonzero(reach > FAR * np.median(reach)) if np.median(reach) > 0.0 else np.empty(0, dtype=np.int64)
    found = np.zeros(len(points), dtype=bool)
    if sparse.size:
        loose = _in_no_plane(points[sparse], points, around.near[sparse], around.away[sparse])
        # Or in the plane of others by chance, most of which are at home elsewhere: a body far away is seen as a speck,
        # FAR times as dense as any that a surface thins out from.
        loose |= reach[sparse] > FAR**2 * np.median(reach[around.near[sparse]], axis=1)
        # As random points are among themselves, or far from what is dense around: parts that are sampled sparsely are
        # in planes, most of them, or thin.
        if 2 * loose.sum() <= len(loose) or not _scattered(points[sparse[loose]], around.tree):
            loose &= reach[sparse] > FAR * reach[around.near[sparse]].min(axis=1)
        found[sparse] = loose
    return found


def _stand_off(around: Surroundings) -> bool:
    """Whether fewer of some points lie half way to where strays begin than beyond: what is fuzzy thins out there."""
    usual = np.median(around.reach)
    return bool(2 * (around.reach > FAR * usual).sum() > (around.reach > FAR**0.5 * usual).sum())


def strays_beside(points: Array, around: Surroundings) -> Mask:
    """Which of further points [N, 3] are far from a surface that some are known of, and in no plane with them."""
    far = FAR * np.median(around.reach)
    found = np.asarray(around.tree.query(points, 1, skip=AROUND // 2 - 1)[0][:, 0] > far)
    if not found.any():
        return found
    away, near = around.tree.query(points[found], AROUND)
    found[found] = _in_no_plane(points[found], around.points, near, away)
    return found


def _in_no_plane(points: Array, others: Array, near: Index, away: Array) -> Mask:
    """Which of points [N, 3] lie in no plane with those near them [N, k] among others, which are so far away [N, k]."""
    mean, normals, variances = planes_of(others, near)
    across = np.abs(np.einsum("ni,ni->n", normals, points - mean))
    return np.asarray((thickness_of(variances) > FLAT) | (across > FLAT * away[:, -1]))


def _scattered(points: Array, body: Tree) -> bool:
    """Whether most of points [N, 3] lie as random ones do in the hull of the body that they are points of.

    No closer together, and not as along a surface: the distance to the k-th neighbour grows as the third root of k in a
    volume, and as the second along a surface, however near another lies.
    """
    neighbours = AROUND // 2
    if len(points) <= neighbours:
        return False
    away = Tree(points).query(points, 1, skip=neighbours)[0]
    # The ball to the eighth neighbour should then hold eight; of thin parts that are sampled sparsely a tenth of one.
    if 4.0 / 3.0 * np.pi * np.median(away) ** 3 * len(points) <= hull_volume(body.points):
        return False
    few, many = AROUND, len(points) // neighbours
    if many < 2 * few:
        return True  # so few tell no growth
    # Where a box ends it grows faster as well, as random points in it tell.
    centred = points - points.mean(axis=0)
    along = centred @ np.linalg.eigh(centred.T @ centred)[1]
    peers = np.random.default_rng(0).uniform(along.min(axis=0), along.max(axis=0), along.shape)

    def growth(of: Array, among: Tree) -> float:
        asked = of[:: -(-len(of) // LOOK)]
        least, most = (np.median(among.query(asked, 1, skip=k)[0]) for k in (few, many))
        return math.log(most / least) if least > 0.0 else math.inf

    strewn, spread = growth(peers, Tree(peers)), 0.5 * math.log(many / few)
    return growth(points, body) < strewn + ALONG * (spread - strewn)


def _is_uneven(around: Surroundings, points: Array, *, patchy: bool) -> bool:
    """Whether the density of points [N, 3] puts starts off by falling off to one side, or is much less in patches.

    As a scanner's does, and where a surface is dark; nobody looks for patches unless they may be `patchy`. Flat
    neighbourhoods must show it as well: on thin parts it is a matter of shape how far away others are. Where those of
    some of the points, which `around` tells of, are wide enough for that everywhere, all are asked.
    """
    if not around.away[:, -1].all():
        return False  # points are repeated
    flat = around.thickness < FLAT
    told = [np.ones_like(flat), flat] if flat.sum() > AROUND else [np.ones_like(flat)]
    evenness = _evenness(around)
    aside = all(_drawn_aside(around.points[some], evenness[some]) for some in told)
    if not aside and not (patchy and all(_is_patchy(around, some) for some in told)):
        return False
    if np.median(around.away[:, -1]) <= WIDEST:
        return True
    return len(around.points) < len(points) and _is_uneven(Surroundings.of(points), points, patchy=patchy)


def _is_patchy(around: Surroundings, some: Mask) -> bool:
    """Whether points are as far apart as strays would be, beside one another, and stand for more than details do.

    Of `some` [N] of the points. What they miss is as far off as they are apart, and as dense parts are carried there,
    it is many more that miss. What is far from all others is no patch.
    """
    far = around.reach > FAR * np.median(around.reach[some])
    area = around.reach**2
    return bool(area[some & far & far[around.near].any(axis=1)].sum() > SHARES[-1] * area[some].sum())


def face_densities(mesh: Shape, samples: Array, face: Index) -> Array | None:
    """How much surface an area of each face stands for [F], up to a factor; None where that makes no odds.

    Where one side is rougher than the other, or has an inner wall, it has more area, which draws the centroid to it.
    Samples of the mesh tell it as points of a cloud do. Faces that none lies on take what the nearest tells.

    Args:
        mesh: whose areas are masses.
        samples: [N, 3] even samples of its area.
        face: [N] which faces they lie on.
    """
    assert mesh.faces is not None
    some = around_some(samples, np.random.default_rng(0))
    if not _drawn_aside(some.points, _evenness(some)):
        return None
    told = _evenness(Surroundings.of(samples))
    held = np.bincount(face, minlength=len(mesh.faces))
    density = np.bincount(face, told, len(mesh.faces)) / np.maximum(held, 1)
    middles = mesh.points[mesh.faces[held == 0]].mean(axis=1)
    density[held == 0] = told[Tree(samples).nearest(middles)[1]]
    return np.asarray(density / density.mean())


def _drawn_aside(points: Array, evenness: Array) -> bool:
    """Whether the centroid of points [N, 3] moves by more than starts may be off once each stands for as much [N]."""
    if not evenness.any():
        return False  # all are one place
    apart = points - points.mean(axis=0)
    moved = np.linalg.norm((evenness / evenness.mean() - 1.0) @ apart) / len(points)
    return bool(moved > START_ERROR * math.sqrt((apart**2).sum() / len(points)))


def _evened(points: Array, rng: np.random.Generator) -> tuple[Index, Array]:
    """Indices, ascending, of points [N, 3] drawn such that none lie much closer than the sparsest do, and their shares.

    Weights alone would even out moments. But a dense part is known more finely than its image in a sparse one, and what
    the two miss one another by is no noise that halves of the cloud would show.
    """
    area = _evenness(Surroundings.of(points))
    chance = np.minimum(DENSER * area / np.quantile(area, 1.0 - SHARES[2]), 1.0)
    even = np.flatnonzero(rng.random(len(points)) < chance)
    return even, (area / chance)[even]


def _evenness(around: Surroundings) -> Array:
    """How much surface [N] the points around each stand for in the mean, up to a factor."""
    away = around.away[:, -1]
    area = np.minimum(away, np.quantile(away, 1.0 - SHARES[2])) ** 2
    return np.asarray(area[around.near].mean(axis=1))
