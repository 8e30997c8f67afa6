"""A judgement of how well two surfaces meet: denoised points of one against the discs of the other."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.align.polish import Similarity
from symrefine.geometry import Array, tight_diagonal
from symrefine.surface.misses import disc_distances
from symrefine.surface.skin import LocalPlanes

# Two surfaces agree at tolerance t if mean, 95th, 99th and 99.5th percentile of the miss stay below these multiples of
# t, beyond what sampling explains. Looser than for one surface and its image, as two samplings and densities meet here;
# the bounds by which `rivals` tells maps apart were measured with them.
LIMITS = (0.28, 1.0, 1.4, 1.75)
# Queries that settle what a surface shows against itself.
FLOOR_QUERIES = 400


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """Local planes of both objects; the source in its own axes about its own centre, but in units of the target."""

    source: LocalPlanes
    target: LocalPlanes
    tolerance: float

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the smallest box around the target."""
        return tight_diagonal(self.target.points)

    @cached_property
    def floor(self) -> Array:
        """Miss [5] that sampling alone explains: each surface against itself, and what only one of the two blurs.

        Local planes merge the two faces of a thin sheet, or follow each, as the density of the points has it.
        """
        both = (self.source, self.target)
        if self.target.isolated:
            return np.zeros(5)
        own = [disc_distances(s, s.points[:: _stride(s, FLOOR_QUERIES)], skip_self=True) for s in both]
        blurred = abs(float(self.source.thickness.mean() - self.target.thickness.mean()))
        return (np.sum([_statistics(d) for d in own], axis=0) + blurred) / self.diagonal

    def misses(self, motion: Similarity, *, queries: int = 10**9) -> Array:
        """Distances from the moved source to the target, fractions of the diagonal."""
        points = self.source.points[:: _stride(self.source, queries)]
        return disc_distances(self.target, motion.apply(points)) / self.diagonal

    def excess(self, motion: Similarity, *, queries: int = 10**9) -> float:
        """Largest of mean, 95th, 99th and 99.5th percentile of the miss over its limit; <= 1 if the surfaces agree.

        Of isolated points every one counts.
        """
        own = _statistics(self.misses(motion, queries=queries))
        limits = np.array([*LIMITS, LIMITS[-1] if self.target.isolated else np.inf])
        return float(np.max(own / (limits * self.tolerance + self.floor)))


def _statistics(distances: Array) -> Array:
    return np.array([distances.mean(), *np.quantile(distances, [0.95, 0.99, 0.995, 1.0])])


def _stride(surface: LocalPlanes, count: int) -> int:
    return max(1, len(surface.points) // count)
