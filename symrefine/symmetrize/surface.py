"""Closest points of a surface, given as triangles or as a cloud of local planes."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from symrefine.geometry import Array
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Index, Shape
from symrefine.surface.skin import local_planes

# Samples that lead to the triangles near a point, and how many of them are asked.
SAMPLES, ASKED = 20000, 8
# Flatness (thickness over width) up to which a neighbourhood is taken for a plane: this, or so many times the median.
FLAT, USUAL = 0.05, 1.5

Closest = Callable[[Array], Array]


def closest_on(shape: Shape, rng: np.random.Generator) -> Closest:
    """The function from points [M, 3] to closest points [M, 3] of a surface in the coordinates of the shape."""
    return _closest_on_mesh(shape, rng) if shape.faces is not None else _closest_on_cloud(shape, rng)


def _closest_on_cloud(shape: Shape, rng: np.random.Generator) -> Closest:
    # Widths of neighbourhoods are judged in RMS radii.
    center = shape.points.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((shape.points - center) ** 2, axis=1))))
    planes = local_planes((shape.points - center) / size, len(shape.points), rng)
    # The normal is that of the neighbours, the place that of the point itself: means of neighbours would merge the two
    # sides of a thin sheet, and smooth more than the symmetry asks for.
    points, normals, tree = shape.points, planes.normals, cKDTree(shape.points)
    # A plane fitted across an edge cuts it: there points stay where they are.
    usual = max(FLAT, USUAL * float(np.median(planes.flatness)))
    trust = np.clip(2.0 - planes.flatness / usual, 0.0, 1.0)

    def closest(queries: Array) -> Array:
        near = tree.query(queries)[1]
        across = np.sum((queries - points[near]) * normals[near], axis=1)
        return np.asarray(queries - (trust[near] * across)[:, None] * normals[near])

    return closest


def _closest_on_mesh(shape: Shape, rng: np.random.Generator) -> Closest:
    assert shape.faces is not None
    corners = shape.points[shape.faces]
    samples, _, owners = sample_surface(shape, SAMPLES, rng)
    # Triangles too small for a sample have their centre.
    owners = np.concatenate([owners, np.arange(len(corners))])
    tree = cKDTree(np.concatenate([samples, corners.mean(axis=1)]))

    def closest(queries: Array) -> Array:
        near = owners[tree.query(queries, k=min(ASKED, len(owners)))[1]].reshape(len(queries), -1)
        feet = _on_triangles(queries, corners, near)
        best = np.argmin(np.linalg.norm(feet - queries[:, None], axis=2), axis=1)
        return np.asarray(feet[np.arange(len(queries)), best])

    return closest


def _on_triangles(queries: Array, corners: Array, near: Index) -> Array:
    """Closest points [M, k, 3] of triangles `near` [M, k] to queries [M, 3]: inside, or on the nearest edge."""
    a, b, c = (corners[near, i] for i in range(3))
    p = np.broadcast_to(queries[:, None], a.shape)
    feet = np.stack([_on_segment(p, a, b), _on_segment(p, b, c), _on_segment(p, c, a)])
    best = np.argmin(np.sum((feet - p) ** 2, axis=-1), axis=0)
    edge = np.take_along_axis(feet, best[None, ..., None], axis=0)[0]
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.sum(normal**2, axis=-1, keepdims=True), 1e-300)
    foot = p - normal * (np.sum((p - a) * normal, axis=-1, keepdims=True) / square)
    sides = [np.sum(np.cross(v - u, foot - u) * normal, axis=-1) for u, v in ((a, b), (b, c), (c, a))]
    inside = np.min(sides, axis=0) >= 0.0
    return np.where(inside[..., None], foot, edge)


def _on_segment(p: Array, u: Array, v: Array) -> Array:
    along = v - u
    square = np.maximum(np.sum(along**2, axis=-1, keepdims=True), 1e-300)
    share = np.clip(np.sum((p - u) * along, axis=-1, keepdims=True) / square, 0.0, 1.0)
    return np.asarray(u + share * along)
