"""The denoised surface as a judge: by how much an operation misses it, and what noise alone would show."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.surface.misses import (
    LIMITS,
    Deviation,
    limited,
    miss_distances,
    needs,
    needs_of_atoms,
    spread_distance,
)
from symrefine.surface.skin import LocalPlanes

# Standard deviation over mean of the distance to the nearest of random points in a volume (Weibull, shape 3).
NEAREST_SPREAD = 0.363
NOTHING = Deviation(mean=0.0, p95=0.0, p97=0.0, p99=0.0, p994=0.0, max=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """Local planes in normalised units, the diagonal their misses are measured by, and what noise alone would show."""

    cloud: LocalPlanes
    diagonal: float
    noise: Deviation = NOTHING

    def with_noise(self, factor: float) -> "Surface":
        """The same surface, if noise were so many times as large."""
        return replace(self, noise=self.noise.scaled(factor))

    def stride(self, sources: int) -> int:
        """Stride that leaves about `sources` local planes."""
        return max(1, len(self.cloud.points) // sources)

    def deviation(self, motions: Sequence[Isometry], *, sources: int = 10**9) -> Deviation:
        """The miss of one or several operations together: the worst of each statistic."""
        found = miss_distances(self.cloud, motions, stride=self.stride(sources)) / self.diagonal
        return reduce(Deviation.at_least, (Deviation.of(d) for d in found))

    def need(self, motions: Sequence[Isometry], *, sources: int = 10**9) -> float:
        """The smallest tolerance at which operations hold (see `needed`)."""
        return float(self.needs(motions, sources=sources).max())

    def needs(self, motions: Sequence[Isometry], *, sources: int, bound: float = math.inf) -> Array:
        """The smallest tolerances [K] at which each of K operations holds, by some of the local planes.

        Args:
            motions: the operations.
            sources: local planes that are moved.
            bound: distances end here, a fraction of the diagonal, which is quicker.
        """
        stride = self.stride(sources)
        found = miss_distances(self.cloud, motions, stride=stride, bound=bound * self.diagonal) / self.diagonal
        if self.cloud.body == "atoms":
            return needs_of_atoms(found.mean(axis=-1), np.quantile(found, 0.95, axis=-1), found.max(axis=-1))
        spreads = [self.spread([m]) / LIMITS[0] for m in motions]
        return np.maximum(needs(limited(found), self.noise), spreads)

    def spread(self, motions: Sequence[Isometry]) -> float:
        """By how much the mass of a volume spreads otherwise, of which the nearest points tell the outline only."""
        if self.cloud.body != "volume":
            return 0.0
        own = np.cov(self.cloud.points.T)
        return max(spread_distance(own, m) for m in motions) / self.diagonal

    def needed(self, deviation: Deviation, spread: float = 0.0) -> float:
        """The smallest tolerance, a fraction of the diagonal, at which a miss still counts as symmetric."""
        if self.cloud.body == "atoms":
            return deviation.need_of_atoms
        return max(deviation.need(self.noise), spread / LIMITS[0])

    @property
    def floor(self) -> float:
        """The smallest tolerance at which what noise alone shows would count as symmetric.

        Of a volume the noise is the distance to the nearest point, which is known; only how it spreads is not.
        """
        share = NEAREST_SPREAD if self.cloud.body == "volume" else 1.0
        return share * self.noise.need(NOTHING)
