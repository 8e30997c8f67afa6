"""By how much what lies around each point lies elsewhere in the image: whole parts out of place, where noise is thick.

Local planes tell where a surface is. Where noise is as thick as the parts of an object it has no planes, and a part
that is out of place lies inside what noise makes of its image. But all of the part is out of place the same way, and
the middle of what a window holds tells that to a fraction of the noise. So the middles of the same window in the cloud
and in its image are compared, along directions in which the window is not filled: along a sheet, or inside a solid, it
sees no end of them, and the middle is a matter of chance. What nobody saw is missing in the middle, so windows that
reach that far tell nothing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Isometry, Mask, ReadOnly, images, rows
from symrefine.samples import GLANCE
from symrefine.surface.floor import Floor
from symrefine.surface.neighbourhoods import NEIGHBOURS, in_cells
from symrefine.surface.tree import Tree

# Cells that a window is put together from, and how far they reach, in standard deviations of its weights.
CELLS, REACH = 32, 2.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Windows(ReadOnly):
    """Gaussian windows on points, which are taken together in cells.

    Attributes:
        middles: [C, 3] of the cells.
        counts: [C] points of each.
        width: standard deviation of the weights.
        tree: kd-tree over the middles.
    """

    middles: Array
    counts: Array
    width: float
    tree: Tree

    @classmethod
    def of(cls, points: Array, width: float, count: int, rng: np.random.Generator) -> "Windows":
        """Windows on points [N, 3], which are taken together in `count` cells."""
        sums = in_cells(np.column_stack([np.ones(len(points)), points]), points, count, rng)[1]
        sums = sums[sums[:, 0] > 0]
        middles = sums[:, 1:] / sums[:, :1]
        return cls(middles=middles, counts=sums[:, 0], width=width, tree=Tree(middles))

    def seen(self, queries: Array) -> tuple[Array, Array]:
        """What windows at queries [Q, 3] hold: cells from there [Q, CELLS, 3], their weights [Q, CELLS] (sum 1)."""
        away, near = self.tree.query(queries, min(CELLS, len(self.counts)))
        weights = self.counts[near] * np.exp(-0.5 * ((away - away[:, :1]) * (away + away[:, :1])) / self.width**2)
        return rows(self.middles, near) - queries[:, None], weights / weights.sum(axis=1, keepdims=True)

    def offsets(self, queries: Array) -> Array:
        """Where the middle of each window lies, seen from where it is centred [Q, 3]."""
        cells, weights = self.seen(queries)
        return np.asarray((weights[:, None] @ cells)[:, 0])

    def spreads(self, queries: Array) -> tuple[Array, Array]:
        """The same, and the covariance of what each window holds over its width squared [Q, 3, 3]."""
        cells, weights = self.seen(queries)
        middle = weights[:, None] @ cells
        apart = cells - middle
        spread = (apart * weights[..., None]).transpose(0, 2, 1) @ apart
        return np.asarray(middle[:, 0]), np.asarray(spread / self.width**2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift(ReadOnly):
    """How far windows of a cloud lie from where its images have them.

    Attributes:
        windows: on the cloud.
        sources: [S, 3] where windows stand.
        offsets: [S, 3] of their middles.
        gains: [S, 3, 3] what makes a displacement of the difference of two offsets.
        noise: [S / 2] displacements that noise alone shows.
    """

    windows: Windows
    sources: Array
    offsets: Array
    gains: Array
    noise: Array

    @classmethod
    def of(cls, points: Array, tree: Tree, count: int, rng: np.random.Generator) -> "Drift":
        """Windows at `count` of the points [N, 3], as wide as the widest neighbourhoods that planes are fitted to.

        `tree` is the kd-tree over the points.
        """
        sources = points[np.sort(rng.choice(len(points), min(count, len(points)), replace=False))]
        some = sources[:: max(1, len(sources) // GLANCE)]
        # A disc of radius R holds as many points as a window on it of width R / 2 counts for.
        width = 0.5 * float(np.median(tree.query(some, min(NEIGHBOURS[-1], len(points)))[0][:, -1]))
        cells = _cells(points, width, rng)
        windows, again = (Windows.of(points, width, cells, rng) for _ in range(2))
        offsets, spread = windows.spreads(sources)
        order, asked = rng.permutation(len(points)), slice(None, None, 2)
        one, other = (Windows.of(points[order[k::2]], width, cells, rng).spreads(sources[asked]) for k in range(2))
        # Halves have half of the points to a window, so that its middle is off by chance as much more; what it is to
        # take points together they show as it is.
        chance = other[0] - one[0] + again.offsets(sources[asked]) - offsets[asked]
        noise = np.linalg.norm(_applied(_gains(one[1]), chance), axis=1) / math.sqrt(2.0)
        return cls(windows=windows, sources=sources, offsets=offsets, gains=_gains(spread), noise=np.sort(noise))

    def misses(self, motions: Sequence[Isometry], sources: int) -> Array:
        """How far `sources` windows of each of K images lie from those of the cloud [K, .]."""
        some = self._some(sources)
        points, offsets, gains = self.sources[some], self.offsets[some], self.gains[some]
        there = self.windows.offsets(images(motions, points)).reshape(len(motions), -1, 3)
        # Back where the image came from, the gains are those of the cloud itself.
        back = [_applied(gains, t @ m.matrix - offsets) for t, m in zip(there, motions, strict=True)]
        return np.linalg.norm(np.stack(back), axis=2)

    def reach(self, motions: Sequence[Isometry], sources: int, unseen: Sequence[tuple[Array, Array]]) -> Mask:
        """Which of these windows reach what nobody saw, here or there [K, .]: what is missing moves a middle as well.

        `unseen` is, of each operation, what it and what its inverse takes to where nobody looked, [., 3] each.
        """
        points, reach = self.sources[self._some(sources)], REACH * self.windows.width

        def near(queries: Array, places: Array) -> Mask:
            return np.isfinite(Tree(places).nearest(queries, bound=reach)[0])

        each = zip(motions, unseen, strict=True)
        return np.stack([near(points, here) | near(m.apply(points), there) for m, (here, there) in each])

    def cut(self, motions: Sequence[Isometry], sources: int, floor: Floor) -> Mask:
        """Which of these windows reach a floor that was set apart, here or there [K, .], and all that was in it."""
        points, reach = self.sources[self._some(sources)], REACH * self.windows.width
        here = floor.above(points) < reach
        return np.stack([here | (floor.above(m.apply(points)) < reach) for m in motions])

    def _some(self, sources: int) -> slice:
        return slice(None, None, max(1, len(self.sources) // sources))

    def redundancy(self, count: int) -> float:
        """How many of `count` windows are as good as one, as they overlap."""
        # Of the cells that a window reaches in a sheet, so many count as if they had all of its weight.
        alone = CELLS * (2.0 / REACH) ** 2
        return max(1.0, count * alone / len(self.windows.counts))


def _cells(points: Array, width: float, rng: np.random.Generator) -> int:
    """Into how many cells points [N, 3] go such that `CELLS` of them fill a window."""
    some, count = points[rng.permutation(len(points))], len(points)
    while count > CELLS:
        reach = float(np.median(Tree(some[:count]).query(some[:GLANCE], CELLS)[0][:, -1])) / (REACH * width)
        if reach >= 1.0:
            break
        # In a sheet the reach grows with the root of what a cell holds.
        count = max(CELLS, min(int(0.9 * count), int(count * reach**2)))
    return count


def _gains(spread: Array) -> Array:
    """What makes a displacement of an offset [Q, 3, 3], from the covariances of windows over their width squared.

    An offset shows a part of a displacement: all of it across what is thin, nothing along a sheet. Four steps of
    Landweber's iteration undo that, and leave untold what windows hardly tell. After so many what noise alone shows
    needs about as much as it does of local planes: six parts in ten of the tolerance at 1 % noise.
    """
    values, axes = np.linalg.eigh(spread)
    shown = np.clip(1.0 - values, 1e-3, 1.0)
    return np.asarray((axes * ((1.0 - (1.0 - shown**2) ** 4) / shown)[:, None]) @ axes.transpose(0, 2, 1))


def _applied(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])
