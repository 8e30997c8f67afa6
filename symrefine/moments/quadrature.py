"""Exact nodes on triangles, and even samples of a surface: how a mesh becomes weighted points."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array, Mask
from symrefine.shape import Index, Shape


def triangle_areas_and_normals(vertices: Array, faces: Index) -> tuple[Array, Array]:
    """Areas [F] and unit normals [F, 3] of triangles; a degenerate triangle has area and normal zero."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    double_area = np.linalg.norm(cross, axis=1)
    normals = np.divide(cross, double_area[:, None], out=np.zeros_like(cross), where=double_area[:, None] > 0)
    return 0.5 * double_area, normals


def repeated(shape: Shape) -> Mask:
    """Which faces [F] of a mesh are there once more before them, in any order of their corners, with the same label.

    Corners are the same where all bits of their coordinates are. Faces are told apart by sums of 64 bits of each
    corner: of a million faces two that differ are taken for one with a chance of 3e-8.
    """
    assert shape.faces is not None
    bits = np.ascontiguousarray(shape.points + 0.0).view(np.uint64)  # of -0.0 those of 0.0
    corner = np.zeros(len(bits), dtype=np.uint64)
    for column in bits.T:
        corner = _mixed(corner ^ column)
    key = _mixed(corner)[shape.faces].sum(axis=1, dtype=np.uint64)
    if shape.labels is not None:
        key = _mixed(key ^ shape.labels.astype(np.uint64))
    order = np.argsort(key, kind="stable")
    again = np.zeros(len(key), dtype=bool)
    again[order[1:]] = key[order[1:]] == key[order[:-1]]
    return again


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Words whose every bit depends on all bits of those given: the finaliser of splitmix64 (Steele et al. 2014)."""
    words = words + np.uint64(0x9E3779B97F4A7C15)
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def _triangles(shape: Shape) -> tuple[Index, Array, Array]:
    """Triangles of a mesh that has an area, with their areas and normals.

    A face that is there twice, as where both sides of a sheet are drawn, is the same surface: it weighs what one does.
    Of a solid all count, as faces of either side cancel.
    """
    assert shape.faces is not None
    areas, normals = triangle_areas_and_normals(shape.points, shape.faces)
    if shape.measure == "surface":
        areas = np.where(repeated(shape), 0.0, areas)
    if areas.sum() <= 0:
        raise DegenerateShapeError(f"{shape.source}: the mesh has no area; every triangle is degenerate")
    return shape.faces, areas, normals


@lru_cache(maxsize=16)
def triangle_rule(degree: int) -> tuple[Array, Array]:
    """Barycentric nodes [Q, 3] and weights [Q] (sum 1) exact for polynomials of `degree` on a triangle.

    Gauss-Legendre in both directions of a square that is collapsed into the triangle (Duffy): any degree, positive
    weights, nodes inside.
    """
    # What the square is collapsed by, 1 - s with its thin end at s = +1, is one degree more.
    s, ws = np.polynomial.legendre.leggauss((degree + 1) // 2 + 1)
    t, wt = np.polynomial.legendre.leggauss(degree // 2 + 1)
    u, v = np.meshgrid(0.5 * (1.0 + s), 0.5 * (1.0 + t), indexing="ij")
    weights = np.outer((1.0 - s) * ws, wt)
    nodes = np.stack([u, (1.0 - u) * (1.0 - v), (1.0 - u) * v], axis=-1)
    return nodes.reshape(-1, 3), (weights / weights.sum()).ravel()


def mesh_nodes(shape: Shape, degree: int) -> tuple[Array, Array]:
    """Weighted nodes whose discrete moments to `degree` are those of the mesh's surface, or carry those of its solid.

    For a solid, `int_V f dV = 1/(p+3) * int f (x.n) dA` for homogeneous f of degree p (method.md, section 1): the
    signed weights here hold `(x.n) dA`, where x.n is constant on a triangle, nodes are relative to the first vertex,
    and the division is the caller's.

    Returns: nodes [F*Q, 3] relative to the first vertex and weights [F*Q].
    Raises:  DegenerateShapeError: the mesh has no area.
    """
    faces, areas, normals = _triangles(shape)
    bary, weights = triangle_rule(degree)
    corners = (shape.points - shape.points[0])[faces]
    nodes = bary @ corners
    if shape.measure == "solid":
        areas = areas * np.einsum("fd,fd->f", corners[:, 0], normals)
    return nodes.reshape(-1, 3), np.multiply.outer(areas, weights).ravel()


def sample_surface(shape: Shape, count: int, rng: np.random.Generator) -> tuple[Array, Array, Index]:
    """`count` stratified samples of the surface with their face normals.

    One uniform draw in each of `count` equal strips of the cumulated area: unbiased like independent samples, but with
    less noise.

    Returns: points [count, 3], unit normals [count, 3], face index [count].
    """
    faces, areas, normals = _triangles(shape)
    cumulative = np.cumsum(areas) / areas.sum()
    position = (np.arange(count) + rng.random(count)) / count
    face = np.minimum(np.searchsorted(cumulative, position), len(areas) - 1)
    r1, r2 = np.sqrt(rng.random(count)), rng.random(count)
    bary = np.stack([1.0 - r1, r1 * (1.0 - r2), r1 * r2], axis=1)
    points = np.einsum("ik,ikd->id", bary, shape.points[faces[face]])
    return points, normals[face], face.astype(np.int64)
