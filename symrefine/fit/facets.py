"""Facets of a mesh: triangles that lie in one plane and share edges count as one, however they were cut.

Two triangulations of a box are the same box. What a facet covers, and how often, is told by the edges around it, all in
one sense: no two sums of triangles of a plane have the same boundary. Nor does a boundary change where an edge is cut
in two: vertices that it passes straight through are none of its corners.
"""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from symrefine.fit.triangles import Triangles
from symrefine.geometry import Array, Mask, dots
from symrefine.shape import Index
from symrefine.surface.neighbourhoods import connected_parts, renumbered
from symrefine.surface.ordered import ordered


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Facets:
    """Triangles put together where they lie in one plane, each facet by the edges around it.

    Attributes:
        edges: [E, 2] of points, from one to the other: in one sense all around a facet.
        often: [E] how often the edge is there.
        of: [E] which facet it is of.
        labels: [K] integers, of each facet.
        bend: the farthest that a corner of a facet of several triangles is out of its plane, and what was left out of
            an edge off that.
    """

    edges: Index
    often: Index
    of: Index
    labels: Index
    bend: float

    @classmethod
    def single(cls, faces: Index, labels: Index) -> "Facets":
        """Every triangle [F, 3] by itself."""
        return cls._around(faces, labels, cast(Index, np.arange(len(faces))), 0.0)

    @classmethod
    def flat(cls, triangles: Triangles, within: float) -> "Facets":
        """Triangles put together where corners are out of the plane by no more than `within`; those of the same label.

        Each is by itself where no two are.
        """
        faces, labels = triangles.faces, triangles.labels
        of = connected_parts(*triangles.pairs(within), len(faces))
        rows = np.flatnonzero((np.bincount(of) > 1)[of])
        if not len(rows):
            return cls.single(faces, labels)
        of = renumbered(of[rows], len(faces))[1]
        normals, off = triangles.planes(rows, of)
        # What bends little by little is no facet: each of its triangles is one.
        bent = np.zeros(normals.shape[1], dtype=bool)
        bent[of[off > within]] = True
        if bent.all():
            return cls.single(faces, labels)
        whole = ~bent[of]
        rows, of = rows[whole], (np.cumsum(~bent) - 1)[of[whole]]
        against = np.einsum("if,if->f", triangles.across[:, rows], normals[:, ~bent][:, of]) < 0.0
        own = np.where(against[:, None], faces[rows, ::-1], faces[rows])
        found = _summed(cls._around(own, labels[rows], of, float(off[whole].max())))
        alone = np.ones(len(faces), dtype=bool)
        alone[rows] = False
        if not alone.any():
            return found
        others = cls.single(faces[alone], labels[alone])
        kinds = np.concatenate([found.labels, others.labels])
        return _joined(replace(found, labels=kinds), replace(others, of=others.of + len(found.labels)))

    @classmethod
    def _around(cls, faces: Index, labels: Index, of: Index, bend: float) -> "Facets":
        """The edges of triangles [F, 3], each of a facet [F].

        Of a triangle with one corner twice its one edge: it stands for itself.
        """
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        real = ends[..., 0] != ends[..., 1]
        real[:, 2] &= real[:, :2].all(axis=1)
        kinds = np.empty(int(of.max()) + 1, dtype=np.int64)
        kinds[of] = labels
        edges, of = (
            (ends.reshape(-1, 2), np.repeat(of, 3)) if real.all() else (ends[real], np.repeat(of, real.sum(axis=1)))
        )
        return cls(edges=edges, often=np.ones(len(edges), dtype=np.int64), of=of, labels=kinds, bend=bend)

    @property
    def corners(self) -> Index:
        """The points that edges end in, ascending."""
        return np.flatnonzero(np.bincount(self.edges.ravel()))

    def straight(self, points: Array, within: float) -> "Facets":
        """The same with edges that go straight on put together, where no point is off the line by more than `within`.

        What is no wider than that, so that nothing is left around it, stays as it is.
        """
        several = (np.bincount(self.of) > 3)[self.of]  # edges: of three none can go
        if not several.any():
            return self
        found, left = _only(self, several), within - self.bend
        while left > 0.0:
            longer = _longer(found, points, left)
            if len(longer.edges) == len(found.edges):
                break
            found, left = longer, within - longer.bend
        return _joined(found, _only(self, ~several))

    def prints(self, images: Index) -> Index:
        """A number for each facet, ascending, where every corner went to its image [N]: that of one facet is its own.

        What is there twice is there. Every corner draws two numbers and every label one, of 64 bits, so that others are
        the same once in 1e19 times. An edge has one sign in one sense, and the other in the other.
        """
        rng, kinds = np.random.default_rng(0), _numbered(self.labels)
        one, two = rng.integers(2**64, size=(2, len(images)), dtype=np.uint64)
        of_kind = rng.integers(2**64, size=int(kinds.max()) + 1, dtype=np.uint64)
        here, there = images[self.edges].T
        told = np.zeros(len(self.labels), dtype=np.uint64)
        np.add.at(told, self.of, self.often.astype(np.uint64) * (one[here] * two[there] - one[there] * two[here]))
        told = np.minimum(told, np.negative(told))  # seen from either side
        # What `unique` tells apart by a table takes ten times as long.
        told = np.sort(told ^ of_kind[kinds])
        return cast(Index, told[np.append(True, told[1:] != told[:-1])])


def _longer(facets: Facets, points: Array, within: float) -> Facets:
    """The same with each run of edges that go straight on as one edge, if no point of it is off that."""
    into, out = _passing(facets, points, within)
    if not len(into):
        return facets
    run = connected_parts(into, out, len(facets.edges))
    # A run starts where none goes on into it; what goes round and round has no such end.
    starts, ends = np.ones((2, len(run)), dtype=bool)
    starts[out] = ends[into] = False
    head, last = np.full((2, int(run.max()) + 1), -1)
    head[run[starts]], last[run[ends]] = np.flatnonzero(starts), facets.edges[ends, 1]
    first = facets.edges[head, 0]
    off, worst = _off_line(points, facets.edges[into, 1], first[run[into]], last[run[into]]), np.zeros(len(head))
    np.maximum.at(worst, run[into], off)
    whole = (worst <= within) & (head >= 0) & (first != last)
    new = replace(_only(facets, head[whole]), edges=np.column_stack([first, last])[whole])
    made = _summed(_joined(_only(facets, ~whole[run]), new))
    # What is no wider than that has both its sides on one line.
    gone = np.ones(len(facets.labels), dtype=bool)
    gone[made.of] = False
    made = _joined(made, _only(facets, gone[facets.of]))
    return replace(made, bend=facets.bend + float(worst[whole].max(initial=0.0)))


def _passing(facets: Facets, points: Array, within: float) -> tuple[Index, Index]:
    """Edges that go straight on into others, and those: where a facet has one into a point and one out of it."""
    count = len(facets.edges)
    from_, to = (facets.of * len(points) + facets.edges[:, side] for side in (0, 1))
    order, first = ordered([np.concatenate([to, from_])])
    first = first[np.diff(np.append(first, len(order))) == 2]
    into, out = order[first], order[first + 1] - count
    both = (into < count) & (out >= 0)
    into, out = into[both], out[both]
    before, at, after = facets.edges[into, 0], facets.edges[into, 1], facets.edges[out, 1]
    on = dots(points[at] - points[before], points[after] - points[at]) > 0.0
    on &= _off_line(points, at, before, after) <= within
    return into[on], out[on]


def _only(facets: Facets, rows: Index | Mask) -> Facets:
    """Some of the edges."""
    return replace(facets, edges=facets.edges[rows], often=facets.often[rows], of=facets.of[rows])


def _joined(one: Facets, other: Facets) -> Facets:
    """The edges of two, of facets that are numbered alike."""
    edges = np.concatenate([one.edges, other.edges])
    often, of = np.concatenate([one.often, other.often]), np.concatenate([one.of, other.of])
    return replace(one, edges=edges, often=often, of=of)


def _summed(facets: Facets) -> Facets:
    """The same with every edge of a facet once, and none that it has as often one way as the other."""
    one, other = facets.edges.T
    low, high = np.minimum(one, other), np.maximum(one, other)
    order, first = ordered([facets.of, low, high])
    often = np.add.reduceat(np.where(one == low, facets.often, -facets.often)[order], first)
    rows, often = order[first[often != 0]], often[often != 0]
    low, high = low[rows], high[rows]
    edges = np.column_stack([np.where(often > 0, low, high), np.where(often > 0, high, low)])
    return replace(facets, edges=edges, often=np.abs(often), of=facets.of[rows])


def _numbered(labels: Index) -> Index:
    """Labels [K] by their number among those that there are, ascending."""
    if (labels == labels[0]).all():
        return np.zeros_like(labels)
    return cast(Index, np.unique(labels, return_inverse=True)[1].ravel())


def _off_line(points: Array, at: Index, first: Index, last: Index) -> Array:
    """How far points [N, 3], those with indices [K], are off the lines through others."""
    along = points[last] - points[first]
    length = np.linalg.norm(along, axis=1)
    across = np.linalg.norm(np.cross(points[at] - points[first], along), axis=1)
    return np.asarray(np.divide(across, length, where=length > 0.0, out=np.full(len(at), np.inf)))
