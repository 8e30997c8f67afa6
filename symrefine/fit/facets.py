"""Facets of a mesh: triangles that lie in one plane and share edges count as one, however they were cut.

Two triangulations of a box are the same box. What a facet covers, and how often, is told by the edges around it, all in
one sense: no two sums of triangles of a plane have the same boundary.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from symrefine.fit.distinct import connected
from symrefine.geometry import Array, dots
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
        of = connected(len(faces), *_pairs(corners, faces, labels, within))
        normals, off = _planes(corners, of)
        # What bends little by little is no facet: each of its triangles is one.
        bent = np.zeros(len(normals), dtype=bool)
        bent[of[off > within]] = True
        alone = bent[of]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        against = ~alone & (dots(across, normals[of]) < 0.0)
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


def _pairs(corners: Array, faces: Index, labels: Index, within: float) -> tuple[Index, Index]:
    """Triangles that share an edge, lie in one plane on both sides of it, and have the same label.

    Four corners are in one plane if moving each by no more than `within` brings them there: what they enclose changes
    by as much times the area across from each. A plane through a small triangle would tell little of a large one.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edge = ends.min(axis=1) * (int(faces.max()) + 1) + ends.max(axis=1)
    order = np.argsort(edge, kind="stable")
    _, first, uses = np.unique(edge[order], return_index=True, return_counts=True)
    pairs = order[first[uses == 2][:, None] + [0, 1]]  # an edge of three triangles or more is where facets meet
    (near, far), (side, beyond) = pairs.T // 3, pairs.T % 3
    start, along = corners[near, side], corners[near, (side + 1) % 3] - corners[near, side]
    own, other = corners[near, (side + 2) % 3] - start, corners[far, (beyond + 2) % 3] - start
    sides = ((along, own), (along, other), (own, other), (own - along, other - along))
    areas = sum(np.linalg.norm(np.cross(a, b), axis=1) for a, b in sides)
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
