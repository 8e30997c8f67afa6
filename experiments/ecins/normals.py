"""Oriented normals for points that come without: fitted to neighbours, signs carried along a spanning tree."""

from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.shape import Index, Shape
from symrefine.surface.neighbourhoods import smallest_eigenvectors

# Keeps edges between parallel normals in the sparse graph, where a weight of 0 is no edge.
LEAST_WEIGHT = 1e-6
# Signs go to the nearest few only: wider edges jump to other sheets.
NEAREST = 8


def estimated_normals(points: Array, neighbours: int = 30) -> Array:
    """Unit normals [N, 3] of points [N, 3]: smallest principal axis of the neighbourhood, consistently oriented.

    Signs follow Hoppe et al., "Surface Reconstruction from Unorganized Points" (1992): from one point to the next along
    the minimum spanning tree of the neighbour graph with weights 1 - |n_i.n_j|, so that signs are carried where the
    surface is flat. Each connected part as a whole looks outwards: the flux of the position through a closed surface is
    three times its volume. Where parts meet at right angles whole legs may come out with the wrong sign, as with any
    such propagation.

    Args:
        neighbours: size of a neighbourhood, the point included.

    Raises:
        InputError: not 3-space, or fewer points than a neighbourhood.
    """
    from scipy.spatial import cKDTree

    cloud = Shape(points=points).points
    if cloud.shape[1] != 3:
        raise InputError(f"points have {cloud.shape[1]} coordinates; normals are estimated in 3-space")
    if not 3 <= neighbours <= len(cloud):
        raise InputError(f"neighbours is {neighbours}; expected 3 to {len(cloud)}, the number of points")
    _, near = cKDTree(cloud).query(cloud, k=neighbours)
    spread = cloud[near] - cloud[near].mean(axis=1, keepdims=True)
    _, normals = smallest_eigenvectors(spread.transpose(0, 2, 1) @ spread)
    return normals * _signs(cloud, normals, near[:, : NEAREST + 1])[:, None]


def _signs(points: Array, normals: Array, near: Index) -> Array:
    """Signs [N] that make the normals agree along the spanning tree of each connected part."""
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    tree = _spanning_tree(normals, near)
    parts, part = connected_components(tree, directed=False)
    signs = np.ones(len(points))
    for i in range(parts):
        members = np.flatnonzero(part == i)
        order, parent = breadth_first_order(tree, members[0], directed=False)
        agreement = np.einsum("ij,ij->i", normals[order[1:]], normals[parent[order[1:]]])
        for child, sign in zip(order[1:].tolist(), np.where(agreement < 0, -1.0, 1.0).tolist(), strict=True):
            signs[child] = sign * signs[parent[child]]
        outwards = np.einsum("ij,ij->i", points[members] - points[members].mean(axis=0), normals[members])
        if outwards @ signs[members] < 0:
            signs[members] *= -1.0
    return signs


def _spanning_tree(normals: Array, near: Index) -> Any:
    """Minimum spanning forest of the neighbour graph [N, k] by how much normals differ, as a sparse matrix."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    count, k = near.shape
    start, end = np.repeat(np.arange(count), k), near.ravel()
    distinct = start != end
    # Each edge once, from the lower index to the higher: the sparse format adds up what comes twice.
    edges = np.unique(np.sort(np.column_stack([start, end])[distinct], axis=1), axis=0)
    agreement = np.abs(np.einsum("ij,ij->i", normals[edges[:, 0]], normals[edges[:, 1]]))
    weights = LEAST_WEIGHT + np.clip(1.0 - agreement, 0.0, None)
    return minimum_spanning_tree(coo_array((weights, (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr())
