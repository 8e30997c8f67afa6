"""The judge of the plane: by how much an outline misses its image, and whether noise, pixels and tolerance allow that.

As in space the tail decides: straight and round parts map onto themselves under wrong operations too.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.matching import LocalPlanes
from symrefine.verify import disc_distances

# An operation holds at tolerance t if mean, 95th, 99th and 99.5th percentile of the miss stay below these multiples.
LIMITS = (0.28, 1.0, 1.4, 1.75)
# What an outline known from pixels may miss its image by, in pixels: the same statistics, and the most.
PIXEL = (0.25, 0.75, 0.75, 0.75, 0.75)
# Points that an outline is compared with itself at.
OWN = 1300


@dataclass(frozen=True, slots=True, kw_only=True)
class LineDeviation:
    """Distribution of the distance between an outline and its image, in fractions of the bounding-box diagonal."""

    mean: float
    p95: float
    p99: float
    p995: float
    max: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LineVerdict:
    """A miss weighed against the tolerance.

    Attributes:
        deviation: the miss.
        excess: the largest of its statistics over its limit; the operation holds if this is <= 1.
        bulk: the same from mean and 95th percentile alone: how well the object as a whole, but for details, agrees.
    """

    deviation: LineDeviation
    excess: float
    bulk: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineJudge:
    """Local lines of an outline, the diagonal its misses are measured by, and what it shows against itself."""

    cloud: LocalPlanes
    diagonal: float
    tolerance: float
    floor: LineDeviation

    def __call__(self, motions: Iterable[Isometry], *, stride: int = 1) -> LineVerdict:
        """Verdict on one or several operations together (the worst of each statistic)."""
        points = self.cloud.points[::stride]
        found = [_summary(disc_distances(self.cloud, m.apply(points)) / self.diagonal) for m in motions]
        worst = LineDeviation(**dict(zip(_NAMES, np.max([astuple(d) for d in found], axis=0).tolist(), strict=True)))
        ratios = self._over_limits(worst)
        # Of points that stand for themselves every one counts.
        last = (worst.max / (LIMITS[-1] * self.tolerance),) if self.cloud.isolated else ()
        return LineVerdict(deviation=worst, excess=max(*ratios, *last), bulk=max(ratios[:2]))

    @property
    def haze(self) -> float:
        """Bulk of an operation that misses by no more than the outline misses itself: exact, as far as one can see."""
        return max(self._over_limits(self.floor)[:2])

    def _over_limits(self, deviation: LineDeviation) -> list[float]:
        """Statistics over their limits, which what the outline shows against itself raises in quadrature."""
        pairs = zip(astuple(deviation)[:4], astuple(self.floor)[:4], LIMITS, strict=True)
        return [value / math.hypot(limit * self.tolerance, own) for value, own, limit in pairs]


_NAMES = ("mean", "p95", "p99", "p995", "max")


def line_judge(cloud: LocalPlanes, diagonal: float, tolerance: float, *, pixel: float = 0.0) -> LineJudge:
    """A judge that knows what the outline shows against itself.

    Args:
        pixel: side of a pixel, RMS radii, where the outline is that of a picture.
    """
    own: Sequence[float] = (0.0,) * len(_NAMES)
    if not cloud.isolated:
        some = cloud.points[:: max(1, len(cloud.points) // OWN)]
        own = astuple(_summary(disc_distances(cloud, some, skip_self=True) / diagonal))
    floor = {name: o + pixel / diagonal * p for name, o, p in zip(_NAMES, own, PIXEL, strict=True)}
    return LineJudge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=LineDeviation(**floor))


def _summary(distances: Array) -> LineDeviation:
    p95, p99, p995 = (float(q) for q in np.quantile(distances, [0.95, 0.99, 0.995]))
    return LineDeviation(mean=float(distances.mean()), p95=p95, p99=p99, p995=p995, max=float(distances.max()))
