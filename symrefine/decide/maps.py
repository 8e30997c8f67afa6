"""How sure a map between two surfaces is that share a part only: what it lays on one another, and what its rivals do.

A local plane speaks for a map where it comes to lie on the other surface within what sampling alone explains, a little
against it where it misses by more, and more where it meets nothing though somebody looked there. What nobody looked at
says nothing. So a mirror image of a nearly symmetric object loses, even where it covers more than the true map does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Mask

# Quantile of what sampling alone misses by up to which a local plane is well met, and what it costs that others meet
# nothing, where meeting less well costs one. Chosen on 252 pairs of ten objects, where 1 to 3 all do about as well; see
# `experiments.studies.partial_alignment`.
WELL, NOTHING = 0.9, 3.0
# Of four logistic curves over logarithms: where half of the maps are right, and how fast they become more, by the lead
# over the best rival, by the share that is well met, by what part of all that is met is met less well, of true maps a
# tenth by definition of "well", of thin leaves a quarter, and by what meets nothing over what is met: of 214 true maps
# of parts 0.03 at most but for four. Chosen such that none of these pairs is wrong and sure.
LEAD, SHARE, UNLIKE, DENIED = (0.1, 4.0), (0.28, 14.0), (0.35, -12.0), (0.06, -6.0)
# Maps that lag by so little that the best would be less sure than this do as well as it.
SURE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Merit:
    """Shares of the local planes of one surface: well met, met less well, met by nothing where somebody looked."""

    well: float
    less: float
    nothing: float

    @classmethod
    def of(cls, misses: Array, unseen: Mask, near: float, far: float) -> "Merit":
        """From the misses [N] of a map, where nobody looked [N], and the misses up to which they meet well, or at all.

        The first is that of `well_met`.
        """
        well, met = ~unseen & (misses <= near), ~unseen & (misses <= far)
        shares = (well & met).mean(), (met & ~well).mean(), (~met & ~unseen).mean()
        return cls(well=float(shares[0]), less=float(shares[1]), nothing=float(shares[2]))

    @property
    def score(self) -> float:
        """The more the better."""
        return self.well - self.less - NOTHING * self.nothing

    def sigma(self, count: int) -> float:
        """Standard deviation of the score as so many local planes, drawn at random, would tell it."""
        squares = self.well + self.less + NOTHING**2 * self.nothing
        return float(np.sqrt(max(squares - self.score**2, 0.0) / count))

    @property
    def fits(self) -> float:
        """Probability that so much of a surface does not meet so well by chance."""
        met = max(self.well + self.less, 1e-300)
        return _rising(self.well, *SHARE) * _rising(self.less / met, *UNLIKE) * _rising(self.nothing / met, *DENIED)


def well_met(noise: Array) -> float:
    """The miss up to which what meets does so as well as noise alone, that misses by [M], lets it."""
    return float(np.quantile(noise, WELL))


def score(sides: Sequence[Merit]) -> float:
    """Of a map that two surfaces judge: that of the one which fits better, as the other may be cluttered."""
    return max(side.score for side in sides)


def said_by_both(sides: Sequence[Merit]) -> float:
    """What orders maps that may all be right: clutter denies each of them alike, a side without any only wrong ones."""
    return sum(side.score for side in sides)


def fits(sides: Sequence[Merit]) -> float:
    """Probability that two surfaces do not meet so by chance."""
    return max(side.fits for side in sides)


def ahead(best: float, rivals: Sequence[float]) -> float:
    """Probability that a map of the best score is right, and none of its rivals instead."""
    return _rising(best - max(rivals, default=-np.inf), *LEAD)


def as_good(best: float, rival: float) -> bool:
    """Whether a rival may as well be right."""
    return ahead(best, [rival]) < SURE


def _rising(value: float, middle: float, steepness: float) -> float:
    """Logistic curve over the logarithm of a value, one half at the middle."""
    with np.errstate(divide="ignore", over="ignore"):
        return float(1.0 / (1.0 + np.float64(max(value, 0.0) / middle) ** -steepness))
