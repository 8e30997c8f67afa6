"""What the decision looks at: the outlines of a picture, or the points themselves, for each level of weight."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from symrefine.geometry import Array, Isometry, corners
from symrefine.plane.raster import Raster, between, coarser, outlines, raster_of
from symrefine.samples import COUNT
from symrefine.shape import FEW, Index, Shape, kinds_of_mass
from symrefine.surface.misses import LIMITS, SHARES, Deviation, disc_distances, miss_distances, noise_distances
from symrefine.surface.neighbourhoods import NEIGHBOURS
from symrefine.surface.skin import LocalPlanes, drawn, isolated_points, local_planes, make_skin
from symrefine.surface.surface import Surface

# Levels, as fractions of the weight that only one cell in twenty exceeds. Halfway to the next a level may move, by so
# many steps, to where it matters least: at the very tone of an area grain alone draws the outline.
LEVELS = (0.5, 0.25, 0.75)
STEPS = 10
# An outline is as long as another one up to this factor.
LONGER = 1.2
# Side of a picture in cells.
OUTLINED = 1500
# What noise may be, over what was measured: as it was, twice as large, or none. True operations of exact drawings miss
# by about as much as was measured in the median, and by less than 2.8 times that in 9 of 10 small pictures.
NOISES = (1.0, 2.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outlines:
    """The outlines of an object in normalised units; the worst of them counts.

    Attributes:
        surfaces: one for each level of weight; a single one where all points weigh the same.
        sampled: whether the points are random samples, whose noise counts, or the object itself.
        pixel_noise: what pixels add to a moment, as a fraction of its bound: the outline cuts some of them at random.
    """

    surfaces: tuple[Surface, ...]
    sampled: bool
    pixel_noise: float

    def judged(self, motions: Sequence[Isometry]) -> tuple[Deviation, tuple[float, ...]]:
        """The miss of several operations together, and what it needs, whatever the noise (see `NOISES`)."""
        found = [s.misses(motions) for s in self.surfaces]
        worst = reduce(Deviation.at_least, map(Deviation.of, found))
        pairs = list(zip(self.surfaces, found, strict=True))
        return worst, tuple(max(_needed(s, misses, n) for s, misses in pairs) for n in NOISES)

    def need(self, motions: Sequence[Isometry]) -> float:
        """The smallest tolerance, a fraction of the diagonal, at which operations hold."""
        return max(s.need(motions) for s in self.surfaces)

    def glances(self, motions: Sequence[Isometry], sources: int) -> Array:
        """Mean miss [M] of each operation, as about `sources` points of each outline tell."""
        each = [miss_distances(s.cloud, motions, stride=s.stride(sources)).mean(axis=1) for s in self.surfaces]
        return np.asarray(np.sum(each, axis=0))

    @property
    def diagonal(self) -> float:
        """Diagonal of the smallest box around the object, RMS radii."""
        return self.surfaces[0].diagonal

    @property
    def floor(self) -> float:
        """The smallest tolerance at which noise alone would still count as symmetric."""
        return max(s.floor for s in self.surfaces)


def _needed(surface: Surface, misses: Array, factor: float) -> float:
    """The smallest tolerance at which operations hold that miss so [K, N], if noise were so many times as large.

    Its scale is uncertain, and what pixels do is no random draw: noise and miss add up in squares, limit by limit.
    """
    if surface.cloud.isolated or not surface.noise.size:
        return float(surface.needed(misses, []).max())
    beyond = np.square(_limited(misses)) - np.square(factor * _limited(surface.noise))
    return float((np.sqrt(np.maximum(beyond, 0.0)) / LIMITS).max())


def _limited(misses: Array) -> Array:
    """What has limits of misses [..., N]: the mean, and what a share of the outline misses by at least, [..., 5]."""
    return np.stack([misses.mean(axis=-1), *np.quantile(misses, 1.0 - np.array(SHARES), axis=-1)], axis=-1)


def make_outlines(shape: Shape, center: Array, scale: float, rng: np.random.Generator) -> Outlines:
    """Outlines of a shape in the plane, normalised with `center` and `scale`."""
    points, weights = shape.points, shape.weights
    raster = None if shape.isolated else raster_of(points, weights)
    if raster is None:
        return _of_points((points - center) / scale, weights, rng, few=shape.atoms)
    raster = replace(raster, origin=(raster.origin - center) / scale, step=raster.step / scale)
    return _of_raster(raster, len(points), rng)


def _of_raster(raster: Raster, pixels: int, rng: np.random.Generator) -> Outlines:
    fine = coarser(raster, OUTLINED)
    by = fine.pitch / raster.pitch
    levels = _telling(fine)
    lines, aside = outlines(fine, levels), outlines(between(fine), levels)
    diagonal = smallest_diagonal(np.concatenate(lines))
    # Straight along a row of full and empty pixels, the edge is anywhere between their middles.
    sharp = 0.5 * fine.pitch / diagonal if len(np.unique(fine.values)) <= 2 else 0.0
    return Outlines(
        surfaces=tuple(_seen(a, b, diagonal, sharp, rng) for a, b in zip(lines, aside, strict=True)),
        sampled=False,
        # The part of a pixel that the outline cuts off is uniform, with a variance of 1/12.
        pixel_noise=math.sqrt(by * len(lines[0]) / 12.0) / pixels,
    )


def _seen(line: Array, aside: Array, diagonal: float, least: float, rng: np.random.Generator) -> Surface:
    """The outline [M, 2] of a picture; its noise is how far off pixels half a step aside would have put it.

    Of the share of the outline that counts first, corners, at least by `least`.
    """
    cloud = local_planes(line, COUNT, rng)
    across = disc_distances(cloud, local_planes(aside, COUNT, rng).points) if _tells(aside) else np.zeros(len(line))
    noise = np.sort(across / diagonal)
    corners = noise[int((1.0 - SHARES[0] - SHARES[-1]) * len(noise)) :]
    np.maximum(corners, least, out=corners)
    return Surface(cloud=cloud, diagonal=diagonal, noise=noise)


def _telling(raster: Raster) -> Array:
    """The levels whose outlines tell apart: one, if the weights between the levels are only the soft edge."""
    top = _top(raster.values)
    lengths_at = _lengths_at(raster.values / top)
    levels = _beside_tones(lengths_at) * top
    found = outlines(raster, levels)
    between_levels = (raster.values >= levels[1]) & (raster.values < levels[2])
    is_edge = np.count_nonzero(between_levels) <= LONGER * len(found[0]) and not _has_tones(raster, levels)
    kept = levels[[_tells(p) for p in found]]
    kept = levels[:1] if is_edge or not len(kept) else kept
    return np.concatenate([kept, _above(raster, top, lengths_at)])


def _top(values: Array) -> float:
    """The weight that only one cell in twenty exceeds, of those in no soft edge: what lies between tones is none."""
    from scipy.ndimage import maximum_filter, minimum_filter

    even = (values > 0) & (maximum_filter(values, size=3) <= LONGER * minimum_filter(values, size=3))
    return float(np.quantile(values[even if even.any() else values > 0], 0.95))


def _has_tones(raster: Raster, levels: Array) -> bool:
    """Whether cells between the levels lie within the object, more of them than count: beside a soft edge it ends."""
    from scipy.ndimage import minimum_filter

    body = raster.values >= levels[1]
    # The edge itself is a cell wide, and what it cuts may be either.
    inner = minimum_filter(body, size=5, mode="constant", cval=0)
    return bool(np.count_nonzero(inner & (raster.values < levels[2])) > SHARES[-1] * np.count_nonzero(body))


def _above(raster: Raster, top: float, lengths_at: Callable[[Array], Index]) -> Array:
    """The lowest level [0 or 1] above all the rest at which details stand out, by as much as the levels are apart.

    Grain stands out as well, but its outline hangs on where the level is; that of a small detail does by as much more
    as its soft edge is wide.
    """
    step = LEVELS[0] - LEVELS[1]
    levels = np.arange(1.0 + step, float(raster.values.max()) / top, step)
    lengths = lengths_at(levels[:, None] + np.linspace(-0.5, 0.5, STEPS + 1) * step)
    steady = levels[lengths.max(axis=1) <= LONGER**2 * lengths.min(axis=1)] * top
    lines = outlines(raster, steady[:1])
    return steady[:1] if lines and _tells(lines[0]) else np.zeros(0)


def _lengths_at(values: Array) -> Callable[[Array], Index]:
    """What tells how many neighbouring cells [...] levels [...] part; the cells are put in order once."""
    pairs = [(values[1:], values[:-1]), (values[:, 1:], values[:, :-1])]
    low, high = (np.sort(np.concatenate([by(a, b).ravel() for a, b in pairs])) for by in (np.minimum, np.maximum))
    return lambda levels: np.searchsorted(low, levels) - np.searchsorted(high, levels)


def _beside_tones(lengths_at: Callable[[Array], Index]) -> Array:
    """The levels, each where the length of its outline hangs least on it unless it hardly does where it was."""
    steps = np.arange(-STEPS, STEPS + 1)
    steps = steps[np.argsort(np.abs(steps), kind="stable")]
    near = (steps[:, None] + np.arange(-STEPS // 2, STEPS // 2 + 1)) * 0.5 * (LEVELS[0] - LEVELS[1]) / STEPS
    lengths = np.maximum(lengths_at(np.array(LEVELS)[:, None, None] + near), 1)
    varies = lengths.max(axis=2) / lengths.min(axis=2)
    moved = np.array(LEVELS) + near[varies.argmin(axis=1), STEPS // 2]
    return np.where(varies[:, 0] <= LONGER, LEVELS, moved)


def _tells(line: Array) -> bool:
    """Whether an outline [M, 2] is more than one neighbourhood, a detail that says nothing by itself."""
    return len(line) > NEIGHBOURS[0]


def _of_points(points: Array, weights: Array | None, rng: np.random.Generator, *, few: bool) -> Outlines:
    masses = np.ones(len(points)) if weights is None else weights
    kept = masses > 0
    points, masses = points[kept], masses[kept]
    diagonal = smallest_diagonal(points)
    if few:
        kinds = kinds_of_mass(masses)
        parts = [points[kinds == k] for k in range(kinds.max() + 1)]
        # A single point counts twice, so that it has a neighbour.
        clouds = [isolated_points(p if len(p) > 1 else np.repeat(p, 2, axis=0)) for p in parts]
        surfaces = [Surface(cloud=cloud, diagonal=diagonal) for cloud in clouds]
    else:
        surfaces = [_sampled(p, diagonal, rng) for p in _levels(points, masses) if len(p) > FEW]
    return Outlines(surfaces=tuple(surfaces), sampled=not few, pixel_noise=0.0)


def _sampled(points: Array, diagonal: float, rng: np.random.Generator) -> Surface:
    whole = make_skin(points, rng)

    def half(some: Index) -> LocalPlanes:
        return whole.half(some).local_planes(drawn(len(some), COUNT, rng))

    noise = noise_distances(len(points), half, rng)
    cloud = whole.local_planes(drawn(len(points), COUNT, rng))
    return Surface(cloud=cloud, diagonal=diagonal, noise=noise / diagonal)


def _levels(points: Array, weights: Array) -> list[Array]:
    """All points, then those that weigh at least each level, where that leaves some out."""
    heavy = weights / np.quantile(weights, 0.95)
    by_count = {int(c.sum()): points[c] for c in (heavy >= level for level in (0.0, *sorted(LEVELS)))}
    return [some for count, some in by_count.items() if count]


def smallest_diagonal(points: Array) -> float:
    """Diagonal of the smallest box around points [N, 2] over all orientations, to half a percent."""
    angles = np.radians(np.arange(0.0, 180.0, 0.5))
    width = np.ptp(corners(points) @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
    return float(np.hypot(width, np.roll(width, 180)).min())
