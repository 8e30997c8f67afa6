"""By how much a surface misses its image under an operation.

Flat and round parts map onto themselves under wrong operations too, so the mean separates nothing; the tail does. The
distance is taken between denoised surfaces: each local plane, moved, against the discs of the local planes around it.
What noise alone shows is the same of two halves of a cloud, each with local planes of its own, against one another.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import reduce

import numpy as np

from symrefine.geometry import Array, Isometry, images, rows
from symrefine.moments.moments import BLOCK
from symrefine.rounding import TOLERANCE as TOLERANCE
from symrefine.samples import COUNT
from symrefine.shape import Index
from symrefine.surface.skin import Body, LocalPlanes

# An operation holds at tolerance t (2 % by default) if the mean miss stays below the first of these multiples of t, and
# if no larger shares of the surface miss by more than the others: a detail of 3 % by 1.15 t, one of 0.6 % by 1.85 t.
# Calibrated on the 52 catalogued meshes: every false element exceeds at least one of them (a propeller's blades the
# first two, a mailbox's flag the last) and every true one but a posed ant stays below.
LIMITS = (0.22, 0.75, 1.15, 1.6, 1.85)
SHARES = (0.05, 0.03, 0.01, 0.006)
# A smaller detail, and what it may miss by: a little more than the 2.2 to which the limits go on from 5 to 0.6 %. Of
# 4,000 points so few are hardly a sample: among noise they would be taken for a detail in one of seven draws, so that
# they count beyond all of it.
SPECK, SPECK_LIMIT = 0.003, 2.5
# The same for atoms, of mean, 95th percentile and the farthest of a hundred: noise moves every one of them, and every
# one counts.
ATOM_LIMITS = (0.9, 1.3, 1.6)
# Standard deviations by which what samples show of noise may be off: with one, true elements need 0.4 of the tolerance
# at 1 % noise; three hide details of 2 % of the surface at 8,000 points.
SURE = 2.0
# Standard deviations that all but a thousandth of a Gaussian in space lie within, or lengths of the last step that a
# fit is off by at most.
RIM = 4.0
# Discs around a point that are looked at: at edges the nearest centre need not be that of the nearest disc.
DISCS = 4


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """Distribution of the distance between a surface and its image, in fractions of the bounding-box diagonal."""

    mean: float
    p95: float
    p99: float
    max: float

    @classmethod
    def of(cls, distances: Array) -> "Deviation":
        """The distribution of distances [N], in fractions of the diagonal; NaN where nobody looked.

        Of several, [K, N], the largest of each statistic.
        """
        rows = np.atleast_2d(distances)
        if np.isnan(rows).any():
            seen = [row[np.isfinite(row)] for row in rows]
            return reduce(cls.at_least, [cls.of(row if row.size else np.zeros(1)) for row in seen])
        p95, p99 = np.quantile(rows, [0.95, 0.99], axis=1).max(axis=1).tolist()
        return cls(mean=float(rows.mean(axis=1).max()), p95=p95, p99=p99, max=float(rows.max()))

    def at_least(self, other: "Deviation") -> "Deviation":
        """The larger of the two in every statistic."""
        return Deviation(**{f.name: max(getattr(self, f.name), getattr(other, f.name)) for f in fields(Deviation)})


NO_MISS = Deviation(mean=0.0, p95=0.0, p99=0.0, max=0.0)


def needs(
    misses: Array, noise: Array, tests: int = 1, redundancy: float = 1.0, noise_redundancy: float | None = None
) -> Array:
    """The smallest tolerances [...], fractions of the diagonal, at which misses [..., N] still count as symmetric.

    What noise alone explains is taken away, with what samples leave uncertain: from the mean in squares, as noise and
    miss add up; from the share of the surface that misses by more than some distance, the share of noise that does.
    Shares are of what was seen, but count only from the least share of all points on (of the farthest, a speck), and
    the mean is without so many of the farthest of what was not seen: beside that, where rays are rough, some points
    always seem to miss, which are many of the few that some operations leave to be seen.

    Args:
        misses: distances, fractions of the diagonal; NaN where nobody looked.
        noise: [M] misses that noise alone shows, in ascending order; none if empty.
        tests: of how many operations the worst counts: the more, the farther off one of them is by chance.
        redundancy: how many misses are as good as one, as points take part in so many planes.
        noise_redundancy: the same of the noise, if it is another.
    """
    farthest = -np.sort(-misses, axis=-1)  # what is unseen stands last
    total, count = misses.shape[-1], np.maximum(np.isfinite(misses).sum(axis=-1, keepdims=True), 1)
    farthest = np.nan_to_num(farthest)
    mean, beyond = farthest.sum(axis=-1) / count[..., 0], np.arange(1, total + 1) / count
    if (unseen := total - count).any():
        beside = (_exceeded(SHARES[-1], total, tests) * unseen).astype(int)
        mean = mean - (farthest * (np.arange(total) < beside)).sum(axis=-1) / count[..., 0]
    if noise.size:
        again = (redundancy if noise_redundancy is None else noise_redundancy) / noise.size
        sampled = np.sqrt((SURE**2 + 2.0 * np.log(tests)) * (redundancy / count + again))
        chance = 1.0 - np.searchsorted(noise, farthest, side="right") / noise.size
        beyond = beyond - chance - sampled * np.sqrt(chance * (1.0 - chance))
        mean = np.sqrt(np.maximum(mean**2 - (noise.mean() + sampled[..., 0] * noise.std()) ** 2, 0.0))
    found = [mean / LIMITS[0]]
    clear, few = (noise[-1], _beyond_all(count, noise.size, tests)) if noise.size else (0.0, 0.0)
    details = [(share, limit, 0.0, 0.0) for share, limit in zip(SHARES, LIMITS[1:], strict=True)]
    for share, limit, least, by_chance in (*details, (SPECK, SPECK_LIMIT, clear, few)):
        told = beyond > np.maximum(_exceeded(share, count, tests), np.maximum(redundancy - 1.0, by_chance) / count)
        told &= beyond * count > _exceeded(min(share, SHARES[-1]), total, tests) * total
        found.append((farthest * (told & (farthest > least))).max(axis=-1) / limit)
    return np.asarray(reduce(np.maximum, found))


def _exceeded(share: float, count: Index | int, tests: int) -> Array:
    """The share of so many points that the worst of some tests shows by chance of what is such a share."""
    return np.asarray(share + np.sqrt(2.0 * np.log(tests) * share * (1.0 - share) / count))


def _beyond_all(count: Index | int, noise: int, tests: int) -> Array:
    """Of so many points how many lie beyond all of so much noise by chance, as rarely as `SURE` says in all tests."""
    return np.asarray(math.log(math.erfc(SURE / math.sqrt(2.0)) / tests) / np.log(count / (count + noise)))


def needs_of_atoms(misses: Array, tests: int = 1) -> Array:
    """The same [...] of points that stand for themselves: mean, 95th percentile and maximum have limits.

    The farthest of more misses is farther by chance: where there are many, of all tests together, it may be as far as
    Gaussian noise puts it of which the 95th percentile is at its limit.
    """
    from scipy.special import gammaincinv

    ordinary, farthest = np.sqrt(gammaincinv(1.5, [0.95, 1.0 - 1.0 / (tests * misses.shape[-1])]))
    mean, most, last = ATOM_LIMITS
    limits = (mean, most, max(last, most * float(farthest / ordinary)))
    statistics = (misses.mean(axis=-1), np.quantile(misses, 0.95, axis=-1), misses.max(axis=-1))
    return np.asarray(reduce(np.maximum, [v / limit for v, limit in zip(statistics, limits, strict=True)]))


def miss_distances(
    cloud: LocalPlanes,
    motions: Sequence[Isometry],
    *,
    stride: int = 1,
    bound: float = np.inf,
    discs: int = DISCS,
) -> Array:
    """Distances [K, M / stride] of every `stride`-th local plane, moved by each of K operations, to the surface.

    Those beyond `bound` count as `bound`, which is quicker; `discs` as of `disc_distances`.
    """
    sources, classes = cloud.points[::stride], cloud.classes(slice(None, None, stride))
    every = None if classes is None else np.tile(classes, len(motions))
    away = disc_distances(cloud, images(motions, sources), every, bound=bound, discs=discs)
    return away.reshape(len(motions), len(sources))


def disc_distances(
    cloud: LocalPlanes,
    queries: Array,
    classes: Index | None = None,
    *,
    skip_self: bool = False,
    bound: float = np.inf,
    discs: int = DISCS,
) -> Array:
    """Distance [Q] from points to the nearest of the discs that the local planes of their class around them span.

    Args:
        queries: [Q, 3].
        classes: [Q] where the cloud has classes.
        skip_self: the queries are points of the cloud, which are not compared with their own discs.
        bound: queries without a disc so near are not looked at any closer; all distances end there.
        discs: how many are looked at around each; one is twice as quick, and at edges may not be the nearest.
    """
    skip = int(skip_self)
    count = min((1 if cloud.isolated else discs) + skip, len(cloud.points))
    away, near = cloud.around(queries, classes, count - skip, skip=skip, bound=bound)
    rows = [slice(first, first + BLOCK) for first in range(0, len(queries), BLOCK)]
    apart = [_to_discs(cloud, queries[r], away[r], near[r], None if classes is None else classes[r]) for r in rows]
    return np.minimum(np.concatenate(apart) if apart else np.zeros(0), bound)


def _to_discs(cloud: LocalPlanes, queries: Array, away: Array, near: Index, classes: Index | None) -> Array:
    """Distance [Q] to the nearest of the discs `near` [Q, k], whose centres are so far `away` [Q, k], if any."""
    seen = np.isfinite(away)
    if not (all_seen := bool(seen.all())):
        away, near = np.where(seen, away, 0.0), np.where(seen, near, 0)
    across = np.einsum("ni,nki->nk", queries, rows(cloud.normals, near))
    across -= cloud.offsets[near]
    across *= across
    along = np.sqrt(np.maximum(away * away - across, 0.0))
    # Inside a disc only the distance across counts; from twice its reach on, the whole distance to its centre does.
    beyond = np.minimum(2.0 * np.maximum(along - cloud.reach[near], 0.0), along)
    distance = np.sqrt(across + beyond * beyond)
    if cloud.labels is not None and classes is not None:
        distance = np.where(cloud.labels[near] == classes[:, None], distance, np.inf)
        distance[~np.isfinite(distance).any(axis=1)] = 0.0  # the only one of its class has no other to be compared with
    return np.asarray((distance if all_seen else np.where(seen, distance, np.inf)).min(axis=1))


def spread_distance(one: Array, other: Array) -> float:
    """Distance (Bures, Wasserstein-2 of Gaussians) between two covariances [3, 3]."""
    values, vectors = np.linalg.eigh(one)
    root = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ vectors.T
    common = np.sqrt(np.clip(np.linalg.eigvalsh(root @ other @ root), 0.0, None)).sum()
    return float(np.sqrt(max(np.trace(one) + np.trace(other) - 2.0 * common, 0.0)))


def noise_distances(
    count: int,
    planes: Callable[[Index], LocalPlanes],
    rng: np.random.Generator,
) -> Array:
    """Distances [M] by which noise alone puts the surface of a cloud off its image, as its halves tell, falling.

    An object with an exact symmetry differs from its image by no more: both are made of points of their own. Those of a
    half have neighbourhoods as wide, so that edges and bends are blurred alike, and half as many points in each, whose
    means are off by as much more. In a volume all is spacing. A small cloud is halved until there are enough. No more
    of them are independent than it has points: every so-many-th is told, from the largest on.

    Args:
        count: points of the cloud.
        planes: the surface that half of them make, given their indices; see `Skin.half`.
    """
    across = []
    for _ in range(-(-COUNT // count)):
        one, other = (planes(half) for half in halves(count, rng))
        for here, there in ((one, other), (other, one)):
            some = slice(None, None, max(1, len(there.points) // COUNT))
            away = disc_distances(here, there.points[some], there.classes(some))
            across.append(away * of_the_whole(there.flatness[some], one.body))
    every = np.sort(np.concatenate(across))
    return every[:: -max(1, len(every) // count)]


def of_the_whole(flatness: Array, body: Body) -> Array:
    """Factors [M] by which noise puts planes of such flatness off in the whole of a cloud, over that in its halves.

    Means of twice as many points are off by 1 / sqrt(2) as much. But what is as thick as wide has no plane that more
    points tell better: which way it lies is chance. (Thicker than wide it is only across normals that were given.) In a
    volume points stand 1 / cbrt(2) as far apart.
    """
    if body == "volume":
        return np.full(len(flatness), 0.5 ** (1.0 / 3.0))
    return np.sqrt(0.5 * (1.0 + np.minimum(flatness, 1.0) ** 2))


def halves(count: int, rng: np.random.Generator) -> tuple[Index, Index]:
    """The indices of two random halves of so many points, ascending."""
    order = rng.permutation(count)
    return np.sort(order[::2]), np.sort(order[1::2])
