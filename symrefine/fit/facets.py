"""Facets of a mesh: triangles that lie in one plane and share edges count as one, however they were cut.

Two triangulations of a box are the same box. What a facet covers, and how often, is told by the edges around it, all in
one sense: no two sums of triangles of a plane have the same boundary. Nor does a boundary change where an edge is cut
in two: vertices that it passes straight through are none of its corners.
"""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from symrefine.fit.distinct import connected
from symrefine.geometry import Array, Mask, dots
from symrefine.shape import Index


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
    def flat(cls, points: Array, faces: Index, labels: Index, within: float) -> "Facets":
        """Triangles [F, 3] of points [N, 3] put together where corners are out of the plane by no more than `within`.

        Only those of the same label [F].
        """
        corners = points[faces]
        near, far = _pairs(corners, faces, labels, within)
        if not len(near):
            return cls.single(faces, labels)
        of = connected(len(faces), near, far)
        normals, off = _planes(corners, of)
        # What bends little by little is no facet: each of its triangles is one.
        bent = np.zeros(len(normals), dtype=bool)
        bent[of[off > within]] = True
        alone = bent[of]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        against = ~alone & (dots(across, normals[of]) < 0.0)
        of = np.unique(np.where(alone, len(bent) + np.arange(len(faces)), of), return_inverse=True)[1].ravel()
        faces = np.where(against[:, None], faces[:, ::-1], faces)
        return cls._around(faces, labels, cast(Index, of), float(off[~alone].max(initial=0.0)))

    @classmethod
    def _around(cls, faces: Index, labels: Index, of: Index, bend: float) -> "Facets":
        """What is left of the edges of triangles [F, 3] where those that a facet [F] has both ways are gone.

        Of a triangle with one corner twice its one edge: it stands for itself.
        """
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        real = ends[..., 0] != ends[..., 1]
        real[:, 2] &= real[:, :2].all(axis=1)
        kinds = np.empty(int(of.max()) + 1, dtype=np.int64)
        kinds[of] = labels
        edges, of = ends[real], np.repeat(of, real.sum(axis=1))
        every = cls(edges=edges, often=np.ones(len(edges), dtype=np.int64), of=of, labels=kinds, bend=bend)
        return _summed(every) if len(kinds) < len(faces) else every

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

    def of_these(self, points: Index) -> "Facets":
        """The same with points numbered as they come among these, ascending."""
        return replace(self, edges=np.searchsorted(points, self.edges))

    def prints(self, images: Index) -> Index:
        """A number for each facet, ascending, where every corner went to its image [N]: that of one facet is its own.

        What is there twice is there. Every corner draws two numbers and every label one, of 64 bits, so that others are
        the same once in 1e19 times. An edge has one sign in one sense, and the other in the other.
        """
        rng, kinds = np.random.default_rng(0), np.unique(self.labels, return_inverse=True)[1].ravel()
        one, two = rng.integers(2**64, size=(2, len(images)), dtype=np.uint64)
        of_kind = rng.integers(2**64, size=int(kinds.max()) + 1, dtype=np.uint64)
        here, there = images[self.edges].T
        told = np.zeros(len(self.labels), dtype=np.uint64)
        np.add.at(told, self.of, self.often.astype(np.uint64) * (one[here] * two[there] - one[there] * two[here]))
        told = np.minimum(told, np.negative(told))  # seen from either side
        return cast(Index, np.unique(told ^ of_kind[kinds]))


def _longer(facets: Facets, points: Array, within: float) -> Facets:
    """The same with each run of edges that go straight on as one edge, if no point of it is off that."""
    into, out = _passing(facets, points, within)
    run = connected(len(facets.edges), into, out)
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
    made = _joined(made, _only(facets, ~np.isin(facets.of, made.of)))
    return replace(made, bend=facets.bend + float(worst[whole].max(initial=0.0)))


def _passing(facets: Facets, points: Array, within: float) -> tuple[Index, Index]:
    """Edges that go straight on into others, and those: where a facet has one into a point and one out of it."""
    from_, to = (facets.of * len(points) + facets.edges[:, side] for side in (0, 1))
    (ends, into, arrive), (begins, out, leave) = (
        np.unique(nodes, return_index=True, return_counts=True) for nodes in (to, from_)
    )
    one, other = np.intersect1d(ends[arrive == 1], begins[leave == 1], assume_unique=True, return_indices=True)[1:]
    into, out = into[arrive == 1][one], out[leave == 1][other]
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
    low, high = facets.edges.min(axis=1), facets.edges.max(axis=1)
    order = np.lexsort([high, low, facets.of])
    key = np.column_stack([facets.of, low, high])[order]
    first = np.flatnonzero(np.append(True, (np.diff(key, axis=0) != 0).any(axis=1)))
    signed = np.where(facets.edges[:, 0] == low, facets.often, -facets.often)[order]
    often = np.add.reduceat(signed, first)
    first, often = first[often != 0], often[often != 0]
    edges = np.where(often[:, None] > 0, key[first, 1:], key[first, :0:-1])
    return replace(facets, edges=edges, often=np.abs(often), of=key[first, 0])


def slivers(points: Array, faces: Index, within: float) -> Mask:
    """Which triangles [F, 3] are but a part of an edge of others: no wider than that, and along one.

    Those that close the gap where a corner of one triangle lies on the edge of another.
    """
    corners = points[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    longest = lengths.argmax(axis=1)
    thin = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) <= within * lengths.max(axis=1)
    if not thin.any():
        return thin
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    edge = ends[..., 0] * len(points) + ends[..., 1]
    along, covered = edge[np.arange(len(faces)), longest], ~lengths.any(axis=1)
    while True:  # what lies along an edge of such a one does, too
        more = thin & ~covered & np.isin(along, edge[~thin | covered])
        if not more.any():
            return covered & ~covered.all()  # where there is nothing else they are the shape
        covered |= more


def _pairs(corners: Array, faces: Index, labels: Index, within: float) -> tuple[Index, Index]:
    """Triangles that share an edge, lie in one plane on both sides of it, and have the same label.

    Four corners are in one plane if moving each by no more than `within` brings them there: what they enclose changes
    by as much times the area across from each. A plane through a small triangle would tell little of a large one.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edge = ends.min(axis=1) * (int(faces.max()) + 1) + ends.max(axis=1)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(edge[order]) != 0))
    uses = np.diff(np.append(first, len(edge)))
    pairs = order[first[uses == 2][:, None] + [0, 1]]  # an edge of three triangles or more is where facets meet
    (near, far), (side, beyond) = pairs.T // 3, pairs.T % 3
    start, along = corners[near, side], corners[near, (side + 1) % 3] - corners[near, side]
    own, other = corners[near, (side + 2) % 3] - start, corners[far, (beyond + 2) % 3] - start
    sides = ((along, own), (along, other), (own, other), (own - along, other - along))
    areas = sum(np.sqrt(dots(c := np.cross(a, b), c)) for a, b in sides)
    flat = np.abs(dots(np.cross(along, own), other)) <= within * areas
    # Folded over, two triangles of a plane lie on each other: by as much as the smaller one reaches.
    unit = np.divide(along, length := np.linalg.norm(along, axis=1, keepdims=True), where=length > 0.0, out=0.0 * along)
    own, other = own - dots(own, unit)[:, None] * unit, other - dots(other, unit)[:, None] * unit
    flat &= dots(own, other) <= within * np.sqrt(np.maximum(dots(own, own), dots(other, other)))
    flat &= labels[near] == labels[far]
    return near[flat], far[flat]


def _planes(corners: Array, of: Index) -> tuple[Array, Array]:
    """Unit normals [K, 3] of the planes that facets lie in, and how far off corners of each triangle are [F]."""
    count = int(of.max()) + 1
    uses = 3.0 * np.bincount(of, minlength=count)
    middle = np.zeros((count, 3))
    np.add.at(middle, of, corners.sum(axis=1))
    local = corners - (middle / uses[:, None])[of, None]
    spread = np.zeros((count, 3, 3))
    np.add.at(spread, of, np.einsum("fki,fkj->fij", local, local))
    normals = np.linalg.eigh(spread)[1][:, :, 0]
    return normals, np.abs(np.einsum("fki,fi->fk", local, normals[of])).max(axis=1)


def _off_line(points: Array, at: Index, first: Index, last: Index) -> Array:
    """How far points [N, 3], those with indices [K], are off the lines through others."""
    along = points[last] - points[first]
    length = np.linalg.norm(along, axis=1)
    across = np.linalg.norm(np.cross(points[at] - points[first], along), axis=1)
    return np.asarray(np.divide(across, length, where=length > 0.0, out=np.full(len(at), np.inf)))
