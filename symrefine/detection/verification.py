"""The last word of all points: by how much each of them, moved, misses the surface that a sample stands for.

What the sample is too coarse to see, shows here; so does the noise of single points, which local planes average out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symrefine.clock import Clock, passed
from symrefine.detection.result import Detection, Verified
from symrefine.fit.placed import elements
from symrefine.geometry import Array, Isometry
from symrefine.stream import Stream
from symrefine.surface.misses import LIMITS, Deviation, disc_distances
from symrefine.surface.surface import HOPELESS
from symrefine.threads import one_thread

# Misses end where nothing is told apart any more, and are counted in so many bins up to there: percentiles to 3 % of
# the tolerance.
BINS = 200


@one_thread()
def verified(found: Detection, points: Stream) -> Detection:
    """A detection with the misses of all points.

    Args:
        found: of which every element is tried, by the operation that it consists of or that makes it up; its surface
            knows no labels.
        points: in input units.
    """
    clock = Clock()
    center = (found.center - found.origin) / found.scale
    motions = [Isometry.about(center, e.matrices[0]) for e in elements(found.group)]
    if not motions:
        return found
    sums = [_Tally() for _ in motions]
    bound, own, done = HOPELESS * LIMITS[-1] * found.tolerance * found.surface.diagonal, 0, 0
    with clock("verify"):
        floor = found.floor
        for every in points:
            chunk = every if floor is None else every[~floor.covers(every)]
            local = (chunk - found.origin) / found.scale
            for tally, motion in zip(sums, motions, strict=True):
                away = disc_distances(found.surface.cloud, motion.apply(local), bound=bound)
                tally.add(away / found.surface.diagonal, bound / found.surface.diagonal)
            own, done = own + len(chunk), done + len(every)
            passed(done, points.count)
    return replace(found, verified=_worst(sums, found.tolerance, own), timings=found.timings | clock.seconds)


class _Tally:
    """Misses that are counted and forgotten."""

    def __init__(self) -> None:
        self.sum, self.most, self.bound, self.bins = 0.0, 0.0, 1.0, np.zeros(BINS, dtype=np.int64)

    def add(self, misses: Array, bound: float) -> None:
        """Count misses [n], fractions of the diagonal, that end at `bound`."""
        self.bound, self.sum, self.most = bound, self.sum + float(misses.sum()), max(self.most, float(misses.max()))
        self.bins += np.histogram(misses, bins=BINS, range=(0.0, bound))[0]

    def quantile(self, share: float) -> float:
        """What at least this share of the points misses by no more than: the upper end of a bin."""
        at = int(np.searchsorted(np.cumsum(self.bins), share * self.bins.sum()))
        return min((at + 1) * self.bound / BINS, self.most)

    def deviation(self) -> Deviation:
        """Their distribution."""
        count = max(int(self.bins.sum()), 1)
        return Deviation(mean=self.sum / count, p95=self.quantile(0.95), p99=self.quantile(0.99), max=self.most)

    def beyond(self, limit: float) -> int:
        """How many miss by more than the bin that a limit lies in."""
        return int(self.bins[int(limit / self.bound * BINS) + 1 :].sum())


def _worst(tallies: Sequence[_Tally], tolerance: float, points: int) -> Verified:
    """The largest of every statistic over all elements."""
    worst = tallies[0].deviation()
    for tally in tallies[1:]:
        worst = worst.at_least(tally.deviation())
    beyond = max(tally.beyond(LIMITS[-1] * tolerance) for tally in tallies)
    return Verified(points=points, residual=worst, beyond=beyond)
