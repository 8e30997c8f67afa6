"""How well two surfaces meet, by the judge's own limits: denoised points of one against the discs of the other."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, Isometry, tight_diagonal
from symrefine.surface.misses import disc_distances, needs, needs_of_atoms
from symrefine.surface.skin import LocalPlanes


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
        """What sampling alone explains: each surface against itself, and what only one of the two blurs.

        Local planes merge the two faces of a thin sheet, or follow each, as the density of the points has it.
        """
        own = [disc_distances(s, s.points, skip_self=True) for s in (self.source, self.target)]
        blurred = abs(float(self.source.thickness.mean() - self.target.thickness.mean()))
        return np.sort((np.concatenate(own) + blurred) / self.diagonal)

    def misses(self, motion: Isometry) -> Array:
        """Distances from the moved source to the target, fractions of the diagonal."""
        return disc_distances(self.target, motion.apply(self.source.points)) / self.diagonal

    def excess(self, motion: Isometry) -> float:
        """The largest statistic of the miss over its limit; <= 1 if the surfaces agree. Of atoms every one counts."""
        misses = self.misses(motion)
        needed = needs_of_atoms(misses) if self.target.isolated else needs(misses, self.floor)
        return float(needed) / self.tolerance
