"""Very many points by a sample of them and the moments of all: one pass, however many there are.

What is seen of a surface no longer depends on how many points there are once noise is averaged over a neighbourhood;
only moments go on growing sharper.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symrefine.clock import passed
from symrefine.detection.masses import ORDER, masses
from symrefine.detection.measure import Measured
from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array
from symrefine.moments.moments import PARTS, Moments
from symrefine.moments.running import running_moments
from symrefine.shape import Index, Shape
from symrefine.stream import Stream
from symrefine.surface.sampling import strays_beside
from symrefine.surface.surroundings import Surroundings
from symrefine.threads import one_thread

# Points of a cloud from which on a sample stands for its surface, and points of that: with 1 % noise planes are then
# known to 0.07 degrees instead of 0.05, at a tenth of the cost for a million points.
MANY, SAMPLE = 100_000, 50_000
# What a sample has not seen is rarer than one point in ten thousand. Within so many times the box of the sample such
# points add next to nothing to moments of order 8; beyond it they may be all that these tell.
BEYOND = 1.5


@dataclass(frozen=True, kw_only=True)
class Sample:
    """How many points, drawn at random, stand for the surface of a cloud, and of how many."""

    points: int
    of: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Sketch:
    """A cloud of very many points in 3-space.

    Attributes:
        sample: one point at random of each of `SAMPLE` runs of equal length, with all that is known of it.
        picked: [S] indices of these among all, ascending.
        moments: of all points, to order 8; None where some are known to be no part of the object.
        low, high: [3] the box of all points.
        count: of all points.
        whole: all points, where they are in memory.
    """

    sample: Shape
    picked: Index
    moments: Moments | None
    low: Array
    high: Array
    count: int
    whole: Shape | None = None

    @property
    def seen(self) -> bool:
        """Whether the sample saw how far the points reach, so that moments of all of them can be trusted."""
        low, high = self.sample.points.min(axis=0), self.sample.points.max(axis=0)
        beyond = (BEYOND - 1.0) / 2.0 * (high - low).max()
        return bool((self.low >= low - beyond).all() and (self.high <= high + beyond).all())


def is_large(shape: Shape) -> bool:
    """Whether a sample is to stand for the surface of a shape."""
    return shape.faces is None and shape.dim == 3 and len(shape.points) > MANY and not shape.atoms


def sampled(shape: Shape, seed: int = 0) -> Shape:
    """The sample that stands for a cloud, without the moments of all of it."""
    return shape.chosen(_picked(len(shape.points), np.random.default_rng(seed)))


@one_thread()
def sketched(given: Shape | Stream, seed: int = 0) -> Sketch:
    """Sample and moments of a cloud, in one pass over its chunks.

    Args:
        given: a stream, or a cloud of more points than `SAMPLE`.
        seed: of the sample.

    Raises:
        InputError: what `Stream` refuses while it is read.
        DegenerateShapeError: the points do not spread.
    """
    stream, weights = (given, None) if isinstance(given, Stream) else (Stream.of(given.points), masses(given))
    picked = _picked(stream.count, np.random.default_rng(seed))
    drawn: list[Array] = []
    low, high = np.full(3, np.inf), np.full(3, -np.inf)

    def chunks() -> Iterator[tuple[Array, Array]]:
        done = 0
        for points in stream:
            # Column by column: numpy goes through rows of three one at a time.
            np.minimum(low, [column.min() for column in points.T], out=low)
            np.maximum(high, [column.max() for column in points.T], out=high)
            some = picked[slice(*np.searchsorted(picked, [done, done + len(points)]))] - done
            drawn.append(points[some])
            yield points, np.ones(len(points)) if weights is None else weights[done : done + len(points)]
            done += len(points)
            passed(done, stream.count)

    try:
        moments = running_moments(chunks(), ORDER, parts=PARTS)
    except DegenerateShapeError as error:
        raise DegenerateShapeError(f"{given.source}: {error}") from None
    if isinstance(given, Stream):
        sample, whole = Shape(np.concatenate(drawn), source=given.source, unit=given.unit), None
    else:
        sample, whole = given.chosen(picked), given
    return Sketch(sample=sample, picked=picked, moments=moments, low=low, high=high, count=stream.count, whole=whole)


def _picked(count: int, rng: np.random.Generator) -> Index:
    """One index at random of each of `SAMPLE` runs of equal length, or all: even where a file orders its points."""
    if count <= SAMPLE:
        return np.arange(count)
    ends = np.arange(SAMPLE + 1) * count // SAMPLE
    return ends[:-1] + (rng.random(SAMPLE) * np.diff(ends)).astype(np.int64)


def set_apart(measured: Measured, sketch: Sketch | None, *, outliers: bool) -> tuple[Index, float]:
    """Indices of the points that are no part of the object, ascending, and their share of all.

    What was found in a sample is looked for among all points that are in memory; of a stream they are of the sample.
    """
    groups = measured.apart
    some = np.sort(np.concatenate(groups))
    if sketch is None:
        return some, len(some) / (len(some) + measured.count)
    if sketch.whole is None:
        return some, len(some) / len(sketch.picked)
    if not outliers or (not some.size and sketch.seen):
        return sketch.picked[some], len(some) / len(sketch.picked)
    every = _like(sketch, sketch.whole.points, some, np.concatenate([groups[0][:0], *groups[1:]]))
    return every, len(every) / sketch.count


def _like(sketch: Sketch, points: Array, out: Index, clumps: Index) -> Index:
    """Indices of all points that are out as some of the sample are: in a clump, or far from what is left of it."""
    kept = np.delete(np.arange(len(sketch.picked)), out)
    around = Surroundings.of(sketch.sample.points[np.union1d(kept, clumps)])
    in_clump = np.isin(np.union1d(kept, clumps), clumps)
    found, done = [], 0
    for chunk in Stream.of(points):
        far = in_clump[around.tree.nearest(chunk)[1]] if clumps.size else np.zeros(len(chunk), dtype=bool)
        far |= strays_beside(chunk, around)
        found.append(done + np.flatnonzero(far))
        done += len(chunk)
    every = np.concatenate(found)
    return np.union1d(every[~np.isin(every, sketch.picked[kept])], sketch.picked[out])
