"""The denoised surface as a judge: by how much an operation misses it, and what noise alone would show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from symrefine.geometry import Isometry
from symrefine.surface.misses import LIMITS, Deviation, miss_distances, spread_distance
from symrefine.surface.skin import LocalPlanes

# Standard deviation over mean of the distance to the nearest of random points in a volume (Weibull, shape 3).
NEAREST_SPREAD = 0.363
NOTHING = Deviation(mean=0.0, p80=0.0, p95=0.0, p97=0.0, p99=0.0, p994=0.0, max=0.0)


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
        stride = self.stride(sources)
        worst = NOTHING
        for motion in motions:
            worst = worst.at_least(Deviation.of(miss_distances(self.cloud, motion, stride=stride) / self.diagonal))
        return worst

    def need(self, motions: Sequence[Isometry], *, sources: int = 10**9) -> float:
        """The smallest tolerance at which operations hold (see `needed`)."""
        return self.needed(self.deviation(motions, sources=sources), self.spread(motions))

    def spread(self, motions: Sequence[Isometry]) -> float:
        """By how much the mass of a volume spreads otherwise, of which the nearest points tell the outline only."""
        if self.cloud.body != "volume":
            return 0.0
        return max(spread_distance(self.cloud.points, m) for m in motions) / self.diagonal

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
