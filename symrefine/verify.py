"""The judge: by how much a cloud misses an operation, and whether that is more than sampling and tolerance allow.

Flat and round parts map onto themselves under wrong operations too, so the mean separates nothing; the tail does. The
distance is taken between denoised surfaces: each local plane, moved, against the discs of the local planes around it.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.matching import LocalPlanes

# An operation holds at tolerance t if mean, 95th and 99th percentile of the miss stay below these multiples of t. On the
# 52 catalogued meshes true elements end at 0.27, 0.94, 1.40 of t = 2 % and false ones start at 0.3, 1.0, 1.3 in at
# least one of the three.
LIMITS = (0.28, 1.0, 1.4)
TOLERANCE = 0.02
DISCS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Distribution of the distance between a surface and its image, in fractions of the bounding-box diagonal."""

    mean: float
    p95: float
    p99: float
    max: float

    def excess(self, tolerance: float, floor: "Deviation | None" = None) -> float:
        """Largest of the three statistics over its limit; <= 1 means the operation holds at `tolerance`.

        Args:
            floor: what the cloud shows against itself: the miss that sampling alone explains.
        """
        own = (self.mean, self.p95, self.p99)
        base = (floor.mean, floor.p95, floor.p99) if floor else (0.0, 0.0, 0.0)
        return max(value / (limit * tolerance + b) for value, limit, b in zip(own, LIMITS, base, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judge:
    """A cloud of local planes and the diagonal its misses are measured by."""

    cloud: LocalPlanes
    diagonal: float
    tolerance: float
    floor: Deviation

    def deviation(self, motions: Iterable[Isometry], *, stride: int = 1) -> Deviation:
        """Miss of one or several operations together (the worst of each statistic)."""
        found = [_summary(miss_distances(self.cloud, m, stride=stride) / self.diagonal) for m in motions]
        return Deviation(
            mean=max(f.mean for f in found),
            p95=max(f.p95 for f in found),
            p99=max(f.p99 for f in found),
            max=max(f.max for f in found),
        )

    def excess(self, deviation: Deviation) -> float:
        """Miss over limit; <= 1 means that the operation holds."""
        return deviation.excess(self.tolerance, self.floor)


def make_judge(cloud: LocalPlanes, diagonal: float, tolerance: float) -> Judge:
    """A judge that knows what the cloud shows against itself."""
    own = disc_distances(cloud, cloud.points, skip_self=True) / diagonal
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
    return np.hypot(across, np.maximum(along - cloud.reach[near], 0.0)).min(axis=1)


def _summary(distances: Array) -> Deviation:
    p95, p99 = np.quantile(distances, [0.95, 0.99])
    return Deviation(mean=float(distances.mean()), p95=float(p95), p99=float(p99), max=float(distances.max()))


def confidence(excess: float) -> float:
    """How sure the decision "holds" is, from the miss over its limit: 0.5 at the limit, towards 1 well below it."""
    return float(1.0 / (1.0 + excess**4))
