"""What the judge looks at: the outlines of a picture, or the points themselves, for each level of weight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.plane.judge import LineJudge, LineVerdict, line_judge
from symrefine.plane.raster import Raster, coarser, outlines, raster_of
from symrefine.surface.skin import LocalPlanes, isolated_points, local_planes

# Up to so many points stand for themselves; more are samples, or the pixels of a picture.
FEW = 250
# Levels, as fractions of the weight that only one cell in twenty exceeds.
LEVELS = (0.5, 0.25, 0.75)
LOCAL_LINES = 4000
# Points of an outline, or of a level, below which it is a detail that says nothing by itself.
FEWEST = 16
# Standard deviation of the covered part of a pixel that the outline cuts.
CUT = 0.3
# Sides of a picture in cells, for the outlines and for the spectrum.
OUTLINED, COARSE = 1500, 192


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outlines:
    """The outlines of an object in normalised units, each with its judge; a verdict is that of the worst.

    Attributes:
        judges: one for each level of weight; a single one where all points weigh the same.
        cells: [N, 2] points that carry the mass, and `masses` [N], for the angular spectrum.
        sampled: whether the points are random samples, whose noise counts, or the object itself.
        pixel_noise: what pixels add to a moment, as a fraction of its bound: the outline cuts some of them at random.
    """

    judges: tuple[LineJudge, ...]
    cells: Array
    masses: Array
    sampled: bool
    pixel_noise: float

    def __call__(self, motions: Sequence[Isometry], *, sources: int = 10**9) -> LineVerdict:
        """Verdict on several operations together, from about `sources` points of each outline."""
        found = [j(motions, stride=max(1, len(j.cloud.points) // sources)) for j in self.judges]
        return replace(max(found, key=lambda v: v.excess), bulk=max(v.bulk for v in found))

    @property
    def haze(self) -> float:
        """Bulk of an operation that is exact, as far as one can see; see `LineJudge.haze`."""
        return max(j.haze for j in self.judges)

    @property
    def diagonal(self) -> float:
        """Diagonal of the smallest box around the object, RMS radii."""
        return self.judges[0].diagonal


def make_outlines(
    points: Array, weights: Array | None, center: Array, scale: float, tolerance: float, rng: np.random.Generator
) -> Outlines:
    """Outlines of points [N, 2] in input units, normalised with `center` and `scale`."""
    raster = raster_of(points, weights)
    if raster is None:
        return _of_points((points - center) / scale, weights, tolerance, rng)
    raster = replace(raster, origin=(raster.origin - center) / scale, step=raster.step / scale)
    return _of_raster(raster, len(points), tolerance, rng)


def _of_raster(raster: Raster, pixels: int, tolerance: float, rng: np.random.Generator) -> Outlines:
    fine = coarser(raster, OUTLINED)
    by = fine.pitch / raster.pitch
    lines = _telling(fine)
    diagonal = smallest_diagonal(np.concatenate(lines))
    judges = [line_judge(_local_lines(p, rng), diagonal, tolerance, pixel=fine.pitch, crossings=len(p)) for p in lines]
    cells, masses = coarser(raster, COARSE).cells()
    return Outlines(
        judges=tuple(judges),
        cells=cells,
        masses=masses / masses.sum(),
        sampled=False,
        pixel_noise=CUT * math.sqrt(by * len(lines[0])) / pixels,
    )


def _telling(raster: Raster) -> list[Array]:
    """The outlines at the levels that tell apart: one, if the weights between the levels are only the soft edge."""
    top = float(np.quantile(raster.values[raster.values > 0], 0.95))
    levels = top * np.array(LEVELS)
    found = outlines(raster, levels)
    between = np.count_nonzero((raster.values >= levels[1]) & (raster.values < levels[2]))
    if between <= 1.2 * len(found[0]):
        return found[:1]
    return [p for p in found if len(p) >= FEWEST] or found[:1]


def _of_points(points: Array, weights: Array | None, tolerance: float, rng: np.random.Generator) -> Outlines:
    few = len(points) <= FEW
    masses = np.ones(len(points)) if weights is None else weights
    kept = masses > 0
    points, masses = points[kept], masses[kept]
    diagonal = smallest_diagonal(points)
    parts = [p for p in _levels(points, masses) if few or len(p) > FEW]
    clouds = [isolated_points(_two(p)) if few else _local_lines(p, rng) for p in parts]
    return Outlines(
        judges=tuple(line_judge(c, diagonal, tolerance) for c in clouds),
        cells=points,
        masses=masses / masses.sum(),
        sampled=not few,
        pixel_noise=0.0,
    )


def _levels(points: Array, weights: Array) -> list[Array]:
    """All points, then those that weigh at least each level, where that leaves some out."""
    heavy = weights / np.quantile(weights, 0.95)
    chosen = [heavy >= level for level in sorted(LEVELS)]
    sizes = [len(points), *(int(c.sum()) for c in chosen)]
    return [points, *(points[c] for c, n, before in zip(chosen, sizes[1:], sizes[:-1], strict=True) if 0 < n < before)]


def _two(points: Array) -> Array:
    """A single point twice, so that it has a neighbour."""
    return points if len(points) > 1 else np.repeat(points, 2, axis=0)


def _local_lines(points: Array, rng: np.random.Generator) -> LocalPlanes:
    return local_planes(points, LOCAL_LINES, rng)


def smallest_diagonal(points: Array) -> float:
    """Diagonal of the smallest box around points [N, 2] over all orientations, to a ten-thousandth."""
    angles = np.radians(np.arange(0.0, 180.0, 0.5))
    reach = points @ np.stack([np.cos(angles), np.sin(angles)])
    hull = points[np.unique(np.concatenate([reach.argmax(axis=0), reach.argmin(axis=0)]))]
    width = np.ptp(hull @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
    return float(np.hypot(width, np.roll(width, 180)).min())
