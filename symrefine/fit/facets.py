"""Facets of a mesh: triangles that lie in one plane and share edges count as one, however they were cut.

Two triangulations of a box are the same box. What a facet covers, and how often, is told by the edges around it, all in
one sense: no two sums of triangles of a plane have the same boundary.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Facets:
    """Triangles put together where they lie in one plane.

    Attributes:
        faces: [F, 3] corners of each triangle, in one sense all over a facet.
        labels: [F] integers, alike all over a facet.
        of: [F] which facet each is of.
        bend: the farthest that a corner of a facet of several triangles is out of its plane.
    """

    faces: Index
    labels: Index
    of: Index
    bend: float

    @classmethod
    def single(cls, faces: Index, labels: Index) -> "Facets":
        """Every triangle [F, 3] by itself."""
        return cls(faces=faces, labels=labels, of=cast(Index, np.arange(len(faces))), bend=0.0)

    @classmethod
    def flat(cls, points: Array, faces: Index, labels: Index, within: float) -> "Facets":
        """Triangles [F, 3] of points [N, 3] put together where corners are out of the plane by no more than `within`.

        Only those of the same label [F].
        """
        corners = points[faces]
        normals, size = _normals(corners)
        of = _connected(len(faces), *_pairs(corners, normals, faces, labels, within))
        order = np.lexsort([size, of])
        largest = order[np.append(np.flatnonzero(np.diff(of[order])), len(order) - 1)][of]
        off = np.einsum("kji,ki->kj", corners - corners[largest, :1], normals[largest])
        off = np.abs(off).max(axis=1)
        # What bends little by little is no facet: each of its triangles is one.
        bent = np.zeros(int(of.max()) + 1, dtype=bool)
        bent[of[off > within]] = True
        alone = bent[of]
        against = ~alone & (np.einsum("ki,ki->k", normals, normals[largest]) < 0.0)
        return cls(
            faces=np.where(against[:, None], faces[:, ::-1], faces),
            labels=labels,
            of=cast(Index, np.where(alone, len(bent) + np.arange(len(faces)), of)),
            bend=float(off[~alone].max(initial=0.0)),
        )

    def prints(self, images: Index) -> Index:
        """A number for each facet, ascending, where every corner went to its image [N]: that of one facet is its own.

        Every corner draws two numbers and every label one, of 64 bits, so that others are the same once in 1e19 times.
        An edge has one sign in one sense, and the other in the other, so that what two triangles share is gone.
        """
        rng, kinds = np.random.default_rng(0), np.unique(self.labels, return_inverse=True)[1].ravel()
        one, two = rng.integers(2**64, size=(2, len(images)), dtype=np.uint64)
        of_kind = rng.integers(2**64, size=int(kinds.max()) + 1, dtype=np.uint64)
        here = images[self.faces]
        there = np.roll(here, -1, axis=1)
        around = (one[here] * two[there] - one[there] * two[here]).sum(axis=1, dtype=np.uint64)
        told = np.zeros(int(self.of.max()) + 1, dtype=np.uint64)
        np.add.at(told, self.of, around)
        told = np.minimum(told, np.negative(told))  # seen from either side
        told[self.of] ^= of_kind[kinds]
        return cast(Index, np.sort(told))


def _pairs(corners: Array, normals: Array, faces: Index, labels: Index, within: float) -> tuple[Index, Index]:
    """Triangles that share an edge, lie in one plane on both sides of it, and have the same label."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edge = ends.min(axis=1) * (int(faces.max()) + 1) + ends.max(axis=1)
    order = np.argsort(edge, kind="stable")
    _, first, uses = np.unique(edge[order], return_index=True, return_counts=True)
    pairs = order[first[uses == 2][:, None] + [0, 1]]  # an edge of three triangles or more is where facets meet
    (near, far), (side, beyond) = pairs.T // 3, pairs.T % 3
    start, end = corners[near, side], corners[near, (side + 1) % 3]
    own, tip = corners[near, (side + 2) % 3] - start, corners[far, (beyond + 2) % 3] - start
    flat = np.abs(np.einsum("ki,ki->k", tip, normals[near])) <= within
    flat &= np.abs(np.einsum("ki,ki->k", own, normals[far])) <= within
    # Folded over, two triangles of a plane lie on each other.
    aside = np.cross(normals[near], end - start)
    flat &= np.einsum("ki,ki->k", tip, aside) * np.einsum("ki,ki->k", own, aside) < 0.0
    flat &= labels[near] == labels[far]
    return near[flat], far[flat]


def _connected(count: int, one: Index, other: Index) -> Index:
    """Which connected part each of so many things is of, where pairs are connected."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    return cast(Index, connected_components(graph, directed=False)[1].astype(np.intp))


def _normals(corners: Array) -> tuple[Array, Array]:
    """Unit normals [F, 3] of triangles, 0 of those without area, and twice their areas [F]."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, size, out=np.zeros_like(normals), where=size > 0.0), size[:, 0]
