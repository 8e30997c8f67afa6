"""Closest points of a surface, given as triangles or as a cloud of local planes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, dots
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Index, Shape
from symrefine.surface.skin import local_planes
from symrefine.surface.tree import Tree

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
    points, normals, tree = shape.points, planes.normals, Tree(shape.points)
    # A plane fitted across an edge cuts it: there points stay where they are.
    usual = max(FLAT, USUAL * float(np.median(planes.flatness)))
    trust = np.clip(2.0 - planes.flatness / usual, 0.0, 1.0)

    def closest(queries: Array) -> Array:
        near = tree.nearest(queries)[1]
        across = dots(queries - points[near], normals[near])
        return np.asarray(queries - (trust[near] * across)[:, None] * normals[near])

    return closest


def _closest_on_mesh(shape: Shape, rng: np.random.Generator) -> Closest:
    assert shape.faces is not None
    triangles = _Triangles.of(shape.points[shape.faces])
    samples, _, owners = sample_surface(shape, SAMPLES, rng)
    # Triangles too small for a sample have their centre.
    owners = np.concatenate([owners, np.arange(len(shape.faces))])
    tree = Tree(np.concatenate([samples, triangles.corners.mean(axis=1)]))

    def closest(queries: Array) -> Array:
        near = owners[tree.query(queries, min(ASKED, len(owners)))[1]]
        return queries - triangles.away(queries, near)

    return closest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Triangles:
    """Triangles with what tells the closest point of each.

    Attributes:
        corners: [F, 3, 3].
        edges: [F, 3, 3] from each corner to the next.
        inverse: [F, 3] of their squared lengths, 0 of those without length.
        normals: [F, 3] unit, NaN of triangles without area, which are their edges.
        inward: [F, 3, 3] across each edge, in the plane, to the side where the triangle is.
    """

    corners: Array
    edges: Array
    inverse: Array
    normals: Array
    inward: Array

    @classmethod
    def of(cls, corners: Array) -> "_Triangles":
        edges = np.roll(corners, -1, axis=1) - corners
        square, normals = dots(edges, edges), np.cross(edges[:, 0], edges[:, 1])
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, size, out=np.full_like(normals, np.nan), where=size > 0.0)
        return cls(
            corners=corners,
            edges=edges,
            inverse=np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0),
            normals=normals,
            inward=np.cross(normals[:, None], edges),
        )

    def away(self, queries: Array, near: Index) -> Array:
        """From the closest point of any of triangles `near` [M, k] to each of queries [M, 3]."""
        rows = np.arange(len(queries))
        there = queries[:, None, None] - self.corners[near]
        edges = self.edges[near]
        share = np.clip(dots(there, edges) * self.inverse[near], 0.0, 1.0)
        beside = there - share[..., None] * edges
        far = dots(beside, beside)
        nearest = far.argmin(axis=2)
        height = dots(there[:, :, 0], self.normals[near])
        above = np.asarray((dots(there, self.inward[near]) >= 0.0).all(axis=2))
        best = np.where(above, height**2, far.min(axis=2)).argmin(axis=1)
        straight = height[rows, best, None] * self.normals[near[rows, best]]
        return np.where(above[rows, best, None], straight, beside[rows, best, nearest[rows, best]])
