"""By how much a surface misses its image under an operation.

Flat and round parts map onto themselves under wrong operations too, so the mean separates nothing; the tail does. The
distance is taken between denoised surfaces: each local plane, moved, against the discs of the local planes around it.
"""

from dataclasses import dataclass, fields

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes

# An operation holds at tolerance t if mean, 95th, 97th, 99th and 99.4th percentile of the miss stay below these
# multiples of t = 2 % by default: a detail of 3 % of the surface may miss by 1.15 t, one of 0.6 % by any distance.
# Calibrated on the 52 catalogued meshes: every false element exceeds at least one of them (a propeller's blades the
# first two, a mailbox's flag the last) and every true one but a posed ant stays below.
LIMITS = (0.22, 0.75, 1.15, 1.6, 1.85)
# The same for atoms, of mean, 95th percentile and the farthest: noise moves every one of them, and every one counts.
ATOM_LIMITS = (0.9, 1.3, 1.6)
TOLERANCE = 0.02
# Discs around a point that are looked at: at edges the nearest centre need not be that of the nearest disc.
DISCS = 4


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

    @classmethod
    def of(cls, distances: Array) -> "Deviation":
        """The distribution of distances [N], in fractions of the diagonal."""
        p80, p95, p97, p99, p994 = (float(q) for q in np.quantile(distances, [0.8, 0.95, 0.97, 0.99, 0.994]))
        mean, largest = float(distances.mean()), float(distances.max())
        return cls(mean=mean, p80=p80, p95=p95, p97=p97, p99=p99, p994=p994, max=largest)

    def at_least(self, other: "Deviation") -> "Deviation":
        """The larger of the two in every statistic."""
        return Deviation(**{f.name: max(getattr(self, f.name), getattr(other, f.name)) for f in fields(Deviation)})

    def need(self, noise: "Deviation") -> float:
        """The smallest tolerance, a fraction of the diagonal, at which a miss still counts as symmetric.

        Each statistic may reach its own multiple of the tolerance beyond what noise alone shows; noise and miss add up
        in squares.
        """
        own, base = np.array(self.limited), np.array(noise.limited)
        return float(np.max(np.sqrt(np.maximum(own**2 - base**2, 0.0)) / np.array(LIMITS)))

    @property
    def need_of_atoms(self) -> float:
        """The same of points that stand for themselves."""
        return max(v / limit for v, limit in zip((self.mean, self.p95, self.max), ATOM_LIMITS, strict=True))

    @property
    def limited(self) -> tuple[float, ...]:
        """The statistics that have limits."""
        return self.mean, self.p95, self.p97, self.p99, self.p994


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
