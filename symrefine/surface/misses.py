"""The judge: by how much a cloud misses an operation, and whether that is more than sampling and tolerance allow.

Flat and round parts map onto themselves under wrong operations too, so the mean separates nothing; the tail does. The
distance is taken between denoised surfaces: each local plane, moved, against the discs of the local planes around it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import reduce

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes

# An operation holds at tolerance t if mean, 95th, 97th, 99th and 99.4th percentile of the miss stay below these
# multiples of t = 2 % by default: a detail of 3 % of the surface may miss by 1.15 t, one of 0.6 % by any distance. On
# the 52 catalogued meshes every false element passes at least one of them (a propeller's blades the first two, a
# mailbox's flag the last) and every true one but a posed ant stays below; the closest is a camera.
LIMITS = (0.22, 0.75, 1.15, 1.6, 1.85)
# The same for atoms, of mean, 95th percentile and the farthest: noise moves every one of them, and every one counts.
ATOM_LIMITS = (0.9, 1.3, 1.6)
TOLERANCE = 0.02
DISCS = 4
# Of the confidence: the miss over its limit at which half of the groups were meant, and how fast they become fewer.
EVEN, STEEPNESS = 0.62, 8
# Miss of a cloud against itself over that of its halves, whose points stand sqrt(2) times as far apart.
HALF_SPACING = 0.75
# Local planes that the cloud is compared with itself at.
OWN = 1300


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Distribution of the distance between a surface and its image, in fractions of the bounding-box diagonal."""

    mean: float
    p80: float
    p95: float
    p97: float
    p99: float
    p994: float
    max: float

    def at_least(self, other: "Deviation") -> "Deviation":
        """The larger of the two in every statistic."""
        return Deviation(**{f.name: max(getattr(self, f.name), getattr(other, f.name)) for f in fields(Deviation)})

    def scaled(self, factor: float) -> "Deviation":
        """Each statistic so many times as large."""
        return Deviation(**{f.name: factor * getattr(self, f.name) for f in fields(Deviation)})

    @property
    def limited(self) -> tuple[float, ...]:
        """The statistics that have limits."""
        return self.mean, self.p95, self.p97, self.p99, self.p994

    def over_limits(self, tolerance: float, floor: "Deviation") -> tuple[float, ...]:
        """Each statistic beyond `floor`, which is what the cloud shows against itself, over its limit; 0 at least.

        Noise and miss add up in squares.
        """
        own = (self.mean, self.p95, self.p97, self.p99, self.p994)
        base = (floor.mean, floor.p95, floor.p97, floor.p99, floor.p994)
        return tuple(
            max(value**2 - b**2, 0.0) ** 0.5 / (limit * tolerance)
            for value, limit, b in zip(own, LIMITS, base, strict=True)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A miss weighed against the tolerance.

    Attributes:
        deviation: the miss.
        excess: the largest of its statistics over its limit; the operation holds if this is <= 1.
        bulk: the same from mean and 95th percentile alone: how well the object as a whole, but for details, agrees.
        detail: the same from all but the farthest percentile: with the details, but for specks.
        core: 80th percentile of the miss over the tolerance: how well most of it agrees.
        shifted: how far parts stand out of place, over the limit for that; `excess` and `detail` count it in.
    """

    deviation: Deviation
    excess: float
    bulk: float
    detail: float
    core: float
    shifted: float = 0.0

    def with_shifted(self, shifted: float) -> "Verdict":
        """The same where parts stand out of place."""
        return replace(self, excess=max(self.excess, shifted), detail=max(self.detail, shifted), shifted=shifted)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judge:
    """A cloud of local planes and the diagonal its misses are measured by."""

    cloud: LocalPlanes
    diagonal: float
    tolerance: float
    floor: Deviation

    def __call__(self, motions: Iterable[Isometry], *, stride: int = 1) -> Verdict:
        """Verdict on one or several operations together (the worst of each statistic)."""
        motions = tuple(motions)
        found = [summary(miss_distances(self.cloud, m, stride=stride) / self.diagonal) for m in motions]
        worst = reduce(Deviation.at_least, found)
        ratios = worst.over_limits(self.tolerance, self.floor)
        if self.cloud.body == "atoms":
            own = (worst.mean, worst.p95, worst.max)
            ratios = tuple(value / (limit * self.tolerance) for value, limit in zip(own, ATOM_LIMITS, strict=True))
        if self.cloud.body == "volume":
            # Of a volume the nearest points tell the outline only; how the mass spreads tells the rest.
            spread = max(spread_distance(self.cloud.points, m) for m in motions) / self.diagonal
            ratios = (max(ratios[0], spread / (LIMITS[0] * self.tolerance)), *ratios[1:])
        core = max(worst.p80**2 - self.floor.p80**2, 0.0) ** 0.5 / self.tolerance
        return Verdict(
            deviation=worst, excess=max(ratios), bulk=max(ratios[:2]), detail=max(ratios[: len(LIMITS) - 1]), core=core
        )

    def beyond(self, verdict: Verdict, floor: Deviation) -> float:
        """What would be left of an excess if the cloud showed this `floor` against itself."""
        if self.cloud.body != "surface":
            return verdict.excess
        return min(verdict.excess, max(verdict.shifted, *verdict.deviation.over_limits(self.tolerance, floor)))


def make_judge(cloud: LocalPlanes, diagonal: float, tolerance: float, floor: Deviation | None = None) -> Judge:
    """A judge that knows what the cloud shows against itself, unless it is told that `floor`."""
    if floor is not None:
        return Judge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=floor)
    if cloud.body == "atoms":
        return Judge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=summary(np.zeros(1)))
    some = slice(None, None, max(1, len(cloud.points) // OWN))
    own = disc_distances(cloud, cloud.points[some], cloud.classes(some), skip_self=True) / diagonal
    return Judge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=summary(own))


def split_floor(one: LocalPlanes, other: LocalPlanes, diagonal: float) -> Deviation:
    """What a cloud shows against itself, from two halves of it with planes of their own.

    Where the same points take part in the planes of neighbours, as in a sparse or noisy cloud, comparing these planes
    says less than independent points would show; halves say more than the whole would, by their wider spacing.
    """
    across = [disc_distances(a, b.points, b.labels) for a, b in ((one, other), (other, one))]
    return summary(HALF_SPACING * np.concatenate(across) / diagonal)


def miss_distances(cloud: LocalPlanes, motion: Isometry, *, stride: int = 1) -> Array:
    """Distance of every `stride`-th local plane, moved, to the surface [M / stride]."""
    return disc_distances(cloud, motion.apply(cloud.points[::stride]), cloud.classes(slice(None, None, stride)))


def disc_distances(
    cloud: LocalPlanes, queries: Array, classes: Index | None = None, *, skip_self: bool = False
) -> Array:
    """Distance [Q] from points to the nearest of the discs that the local planes of their class around them span.

    Args:
        queries: [Q, 3].
        classes: [Q] where the cloud has classes.
        skip_self: the queries are points of the cloud, which are not compared with their own discs.
    """
    skip = int(skip_self)
    count = min(DISCS + skip, len(cloud.points))
    _, near = cloud.nearest(queries, classes, k=count)
    near = near[:, skip:]
    delta = queries[:, None] - cloud.points[near]
    across = np.abs(np.einsum("nki,nki->nk", delta, cloud.normals[near]))
    along = np.sqrt(np.maximum(np.einsum("nki,nki->nk", delta, delta) - across**2, 0.0))
    # Inside a disc only the distance across counts; from twice its reach on, the whole distance to its centre does.
    beyond = np.minimum(2.0 * np.maximum(along - cloud.reach[near], 0.0), along)
    distance = np.hypot(across, beyond)
    if cloud.labels is not None and classes is not None:
        distance = np.where(cloud.labels[near] == classes[:, None], distance, np.inf)
        distance[~np.isfinite(distance).any(axis=1)] = 0.0  # the only one of its class has no other to be compared with
    return distance.min(axis=1)


def spread_distance(points: Array, motion: Isometry) -> float:
    """Distance (Bures, Wasserstein-2 of Gaussians) between the covariance of points [M, 3] and of their images."""
    own = np.cov(points.T)
    moved = motion.matrix @ own @ motion.matrix.T
    values, vectors = np.linalg.eigh(own)
    root = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ vectors.T
    common = np.sqrt(np.clip(np.linalg.eigvalsh(root @ moved @ root), 0.0, None)).sum()
    return float(np.sqrt(max(2.0 * (np.trace(own) - common), 0.0)))


def summary(distances: Array) -> Deviation:
    """Statistics of distances [M]."""
    p80, p95, p97, p99, p994 = (float(q) for q in np.quantile(distances, [0.8, 0.95, 0.97, 0.99, 0.994]))
    mean, largest = float(distances.mean()), float(distances.max())
    return Deviation(mean=mean, p80=p80, p95=p95, p97=p97, p99=p99, p994=p994, max=largest)


def confidence(excess: float) -> float:
    """How likely a group was meant, from the largest miss over its limit among its elements.

    A logistic curve in the logarithm of the miss, 95 % at 0.43 and 50 % at 0.62, fitted to half of the objects of
    `experiments.studies.reliability` (a third of them broken in a detail) and checked on the other half.
    """
    return float(1.0 / (1.0 + (excess / EVEN) ** STEEPNESS))
