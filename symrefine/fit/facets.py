"""Facets of a mesh: triangles that lie in one plane and share edges count as one, however they were cut.

Two triangulations of a box are the same box. What a facet covers is told by the edges around it, those of an odd number
of its triangles: in a plane no two areas have the same boundary.
"""

from typing import cast

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index


def facets(points: Array, faces: Index, labels: Index, within: float) -> Index:
    """Which facet each of triangles [F, 3] is of [F]; those of different labels [F] are of different ones.

    Args:
        points: [N, 3] corners.
        faces: [F, 3] corners of each triangle.
        labels: [F] integers.
        within: by how much the corners of a facet may be out of its plane.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    _, edge = _edges(faces, len(points))
    order = np.argsort(edge, kind="stable")
    _, first, uses = np.unique(edge[order], return_index=True, return_counts=True)
    pairs = order[first[uses == 2][:, None] + [0, 1]]  # an edge of three triangles or more is where facets meet
    near, far = pairs.T // 3
    corners = points[faces]
    normals, planes = _planes(corners)
    tip = corners[far, (pairs[:, 1] % 3 + 2) % 3]
    own, other = corners[near, (pairs[:, 0] % 3 + 2) % 3], corners[near, pairs[:, 0] % 3]
    flat = np.abs(np.einsum("ki,ki->k", tip, normals[near]) - planes[near]) <= within
    flat &= np.abs(np.einsum("ki,ki->k", own, normals[far]) - planes[far]) <= within
    # Folded over, two triangles of a plane lie on each other.
    along = corners[near, (pairs[:, 0] % 3 + 1) % 3] - other
    aside = np.cross(normals[near], along)
    flat &= np.einsum("ki,ki->k", tip - other, aside) * np.einsum("ki,ki->k", own - other, aside) < 0.0
    flat &= labels[near] == labels[far]
    graph = coo_array((np.ones(int(flat.sum())), (near[flat], far[flat])), shape=(count, count))
    facet = cast(Index, connected_components(graph, directed=False)[1].astype(np.intp))
    return _apart_unless_flat(corners, normals, planes, facet, within)


def prints(faces: Index, labels: Index, facet: Index, points: int) -> Index:
    """A number for each facet, ascending: the same for the same edges around it, of triangles of the same label.

    Every corner draws two numbers and every label one, of 64 bits, so that others are the same once in 1e19 times.

    Args:
        faces: [F, 3] corners of each triangle, of so many `points`.
        labels: [F] integers, the same wherever prints are compared.
        facet: [F] which facet each is of.
    """
    rng, kinds = np.random.default_rng(0), np.unique(labels, return_inverse=True)[1].ravel()
    one, two = rng.integers(2**64, size=(2, points), dtype=np.uint64)
    of_kind = rng.integers(2**64, size=int(kinds.max()) + 1, dtype=np.uint64)
    (low, high), edge = _edges(faces, points)
    owner = np.repeat(facet, 3)
    order = np.lexsort([edge, owner])
    new = np.append(True, (np.diff(edge[order]) != 0) | (np.diff(owner[order]) != 0))
    first = np.flatnonzero(new)
    odd = first[np.diff([*first, len(order)]) % 2 == 1]
    rim = order[odd]
    kept = np.zeros(int(facet.max()) + 1, dtype=np.uint64)
    np.add.at(kept, owner[rim], one[low[rim]] * two[high[rim]])
    kept[facet] ^= of_kind[kinds]
    return cast(Index, np.sort(kept))


def _edges(faces: Index, points: int) -> tuple[tuple[Index, Index], Index]:
    """The lower and the higher corner of every edge [3 F] of triangles, and a number for the two of them."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    low, high = ends.min(axis=1), ends.max(axis=1)
    return (low, high), low * points + high


def _planes(corners: Array) -> tuple[Array, Array]:
    """Unit normals [F, 3] of triangles, 0 of those without area, and how far from the origin their planes are [F]."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0.0)
    return normals, np.einsum("ki,ki->k", corners.mean(axis=1), normals)


def _apart_unless_flat(corners: Array, normals: Array, planes: Array, facet: Index, within: float) -> Index:
    """Facets, but for those that bend little by little: of these each triangle is one."""
    size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    order = np.lexsort([size, facet])
    last = np.append(np.flatnonzero(np.diff(facet[order])), len(order) - 1)
    largest = order[last][facet]
    off = np.abs(np.einsum("kji,ki->kj", corners, normals[largest]) - planes[largest, None]).max(axis=1)
    bent = np.zeros(int(facet.max()) + 1, dtype=bool)
    bent[facet[off > within]] = True
    alone = bent[facet]
    return cast(Index, np.where(alone, len(bent) + np.arange(len(facet)), facet))
