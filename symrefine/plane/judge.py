"""The judge of the plane: by how much an outline misses its image, and whether noise, pixels and tolerance allow that.

As in space the tail decides: straight and round parts map onto themselves under wrong operations too. The outline of a
picture is known all along, so that a stretch of it that misses counts by its length, however long the rest is.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.surface.misses import disc_distances
from symrefine.surface.skin import LocalPlanes

# An operation holds at tolerance t if mean, 95th, 99th percentile and `detail` of the miss stay below these multiples.
LIMITS = (0.28, 1.0, 1.4, 1.4)
# What may miss by more than `detail`: this share of the outline, and no stretch longer than this part of the diagonal.
SHARE, STRETCH = 0.005, 0.02
# What an outline known from pixels may miss its image by, in pixels: the same statistics, and the most.
PIXEL = (0.25, 0.75, 0.75, 0.75, 0.75)
# Of the confidence: the miss over its limit at which half of the elements were meant, and how fast they become fewer.
# `python -m experiments.studies.planar_reliability --fit`: pictures of half of 24 drawings, a third of them with a part
# moved by 1 to 5 % of the diagonal, seeds 0 and 1 together; checked on the other half. 95 % at 0.177.
EVEN, STEEPNESS = 0.40, 3.6
# Points that an outline is compared with itself at.
OWN = 1300


@dataclass(frozen=True, slots=True, kw_only=True)
class LineDeviation:
    """Distribution of the distance between an outline and its image, in fractions of the bounding-box diagonal.

    `detail` is the 99.5th percentile, or a higher one in long outlines, which only a short stretch exceeds.
    """

    mean: float
    p95: float
    p99: float
    detail: float
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
    """Local lines of an outline, the diagonal its misses are measured by, and what it shows against itself.

    `share` of the outline may miss by more than the limit of `detail`.
    """

    cloud: LocalPlanes
    diagonal: float
    tolerance: float
    floor: LineDeviation
    share: float

    def __call__(self, motions: Iterable[Isometry], *, stride: int = 1) -> LineVerdict:
        """Verdict on one or several operations together (the worst of each statistic)."""
        points = self.cloud.points[::stride]
        found = [_summary(disc_distances(self.cloud, m.apply(points)) / self.diagonal, self.share) for m in motions]
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


_NAMES = ("mean", "p95", "p99", "detail", "max")


def line_judge(
    cloud: LocalPlanes, diagonal: float, tolerance: float, *, pixel: float = 0.0, crossings: int = 0
) -> LineJudge:
    """A judge that knows what the outline shows against itself.

    Args:
        pixel: side of a pixel, RMS radii, where the outline is that of a picture.
        crossings: edges between pixels that the whole outline of a picture cuts; 0 for other points.
    """
    # A line cuts 4/pi edges for each side of a pixel, in the mean over its directions.
    length = 0.25 * math.pi * crossings * pixel / diagonal
    share = min(SHARE, STRETCH / length) if length > 0.0 else SHARE
    own: Sequence[float] = (0.0,) * len(_NAMES)
    if not cloud.isolated:
        some = cloud.points[:: max(1, len(cloud.points) // OWN)]
        own = astuple(_summary(disc_distances(cloud, some, skip_self=True) / diagonal, share))
    floor = {name: o + pixel / diagonal * p for name, o, p in zip(_NAMES, own, PIXEL, strict=True)}
    return LineJudge(cloud=cloud, diagonal=diagonal, tolerance=tolerance, floor=LineDeviation(**floor), share=share)


def _summary(distances: Array, share: float) -> LineDeviation:
    p95, p99, detail = (float(q) for q in np.quantile(distances, [0.95, 0.99, 1.0 - share]))
    return LineDeviation(mean=float(distances.mean()), p95=p95, p99=p99, detail=detail, max=float(distances.max()))


def confidence(excess: float) -> float:
    """How likely a line or turn was meant, from its miss over the limit: a logistic curve in the logarithm of the miss.

    A drawing with one part moved by a percent of the diagonal is not meant so, although the tolerance lets it pass.
    """
    return float(1.0 / (1.0 + (excess / EVEN) ** STEEPNESS))
