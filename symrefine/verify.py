"""The judge: by how much a cloud misses an operation, and whether that is more than sampling and tolerance allow.

Flat and round parts map onto themselves under wrong operations too, so the mean separates nothing; the tail does. The
distance is taken between denoised surfaces: each local plane, moved, against the discs of the local planes around it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.matching import LocalPlanes

# An operation holds at tolerance t if mean, 95th, 99th and 99.5th percentile of the miss stay below these multiples of
# t = 2 % by default. On the 52 catalogued meshes every false element passes at least one of them (a propeller's blades
# the first two, a mailbox's flag the last) and every true one stays below; the closest are a posed ant and a camera.
LIMITS = (0.28, 1.0, 1.4, 1.75)
TOLERANCE = 0.02
DISCS = 4
# Local planes that the cloud is compared with itself at.
OWN = 1300


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Distribution of the distance between a surface and its image, in fractions of the bounding-box diagonal."""

    mean: float
    p95: float
    p99: float
    p995: float
    max: float

    def over_limits(self, tolerance: float, floor: "Deviation") -> tuple[float, ...]:
        """Each statistic over its limit, which is raised by `floor`: what the cloud shows against itself."""
        own = (self.mean, self.p95, self.p99, self.p995)
        base = (floor.mean, floor.p95, floor.p99, floor.p995)
        return tuple(value / (limit * tolerance + b) for value, limit, b in zip(own, LIMITS, base, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A miss weighed against the tolerance.

    Attributes:
        deviation: the miss.
        excess: the largest of its statistics over its limit; the operation holds if this is <= 1.
        bulk: the same from mean and 95th percentile alone: how well the object as a whole, but for details, agrees.
    """

    deviation: Deviation
    excess: float
    bulk: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judge:
    """A cloud of local planes and the diagonal its misses are measured by."""

    cloud: LocalPlanes
    diagonal: float
    tolerance: float
    floor: Deviation

    def __call__(self, motions: Iterable[Isometry], *, stride: int = 1) -> Verdict:
        """Verdict on one or several operations together (the worst of each statistic)."""
        found = [_summary(miss_distances(self.cloud, m, stride=stride) / self.diagonal) for m in motions]
        worst = Deviation(**{f.name: max(getattr(d, f.name) for d in found) for f in fields(Deviation)})
        ratios = worst.over_limits(self.tolerance, self.floor)
        if self.cloud.isolated:
            # Every point counts: one atom out of place breaks the symmetry.
            ratios = (*ratios, worst.max / (LIMITS[-1] * self.tolerance))
        return Verdict(deviation=worst, excess=max(ratios), bulk=max(ratios[:2]))


def make_judge(cloud: LocalPlanes, diagonal: float, tolerance: float) -> Judge:
    """A judge that knows what the cloud shows against itself."""
    if cloud.isolated:
        return Judge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=_summary(np.zeros(1)))
    own = disc_distances(cloud, cloud.points[:: max(1, len(cloud.points) // OWN)], skip_self=True) / diagonal
    return Judge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=_summary(own))


def miss_distances(cloud: LocalPlanes, motion: Isometry, *, stride: int = 1) -> Array:
    """Distance of every `stride`-th local plane, moved, to the surface [M / stride]."""
    return disc_distances(cloud, motion.apply(cloud.points[::stride]))


def disc_distances(cloud: LocalPlanes, queries: Array, *, skip_self: bool = False) -> Array:
    """Distance [Q] from points to the nearest of the discs that the local planes around them span."""
    skip = int(skip_self)
    count = min(DISCS + skip, len(cloud.points))
    _, near = cloud.tree.query(queries, k=count)
    near = near[:, skip:]
    delta = queries[:, None] - cloud.points[near]
    across = np.abs(np.einsum("nki,nki->nk", delta, cloud.normals[near]))
    along = np.sqrt(np.maximum(np.einsum("nki,nki->nk", delta, delta) - across**2, 0.0))
    # Inside a disc only the distance across counts; from twice its reach on, the whole distance to its centre does.
    beyond = np.minimum(2.0 * np.maximum(along - cloud.reach[near], 0.0), along)
    return np.hypot(across, beyond).min(axis=1)


def _summary(distances: Array) -> Deviation:
    p95, p99, p995 = (float(q) for q in np.quantile(distances, [0.95, 0.99, 0.995]))
    return Deviation(mean=float(distances.mean()), p95=p95, p99=p99, p995=p995, max=float(distances.max()))


def confidence(excess: float) -> float:
    """How sure the decision "holds" is, from the miss over its limit: 0.5 at the limit, towards 1 well below it."""
    return float(1.0 / (1.0 + excess**4))
