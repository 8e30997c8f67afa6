"""What the baseline works on: points and oriented normals in a unit box, averaged in cells of two sizes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.ecins.settings import Settings
from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.shape import Shape

# The refinement has six unknowns and needs as many pairs.
LEAST_POINTS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clouds:
    """Two resolutions of one object: mean zero, PCA-aligned bounding box of diagonal 1.

    Attributes:
        points, normals: [M, 3] the cloud that partners are looked up in.
        queries, query_normals: [Q, 3] the coarser cloud that looks for partners.
        basis: [3, 3] principal axes as rows, longest first, right-handed.
        tree: kd-tree over `points`.
        center, scale: input coordinates are `center + scale * x`.
    """

    points: Array
    normals: Array
    queries: Array
    query_normals: Array
    basis: Array
    tree: Any
    center: Array
    scale: float


def prepare(points: Array, normals: Array | None, settings: Settings) -> Clouds:
    """The two clouds of points [N, 3] with oriented normals [N, 3] of any length but zero.

    Raises:
        InputError: no normals, zero or NaN ones, not 3-space, or too few points.
        DegenerateShapeError: all points coincide.
    """
    from scipy.spatial import cKDTree

    if normals is None:
        raise InputError("no normals; the baseline needs an oriented one for each point (see estimated_normals)")
    shape = Shape(points=points, normals=normals)
    assert shape.normals is not None
    if shape.dim != 3:
        raise InputError(f"points have {shape.dim} coordinates; the baseline works in 3-space")
    center = shape.points.mean(axis=0)
    centred = shape.points - center
    basis = principal_axes(centred)
    scale = float(np.linalg.norm(np.ptp(centred @ basis.T, axis=0)))
    fine, fine_normals = voxel_means(centred / scale, shape.normals, settings.voxel_rel)
    coarse, coarse_normals = voxel_means(fine, fine_normals, settings.query_voxel_rel)
    if len(coarse) < LEAST_POINTS:
        raise InputError(
            f"{len(shape.points)} points are {len(coarse)} in cells of {settings.query_voxel_rel:g} diagonals; "
            f"the baseline needs at least {LEAST_POINTS}"
        )
    return Clouds(
        points=fine,
        normals=fine_normals,
        queries=coarse,
        query_normals=coarse_normals,
        basis=basis,
        tree=cKDTree(fine),
        center=center,
        scale=scale,
    )


def principal_axes(centred: Array) -> Array:
    """Principal axes [3, 3] of centred points [N, 3] as right-handed rows, largest variance first."""
    _, vectors = np.linalg.eigh(centred.T @ centred)
    first, second = vectors[:, 2], vectors[:, 1]
    return np.stack([first, second, np.cross(first, second)])


def voxel_means(points: Array, normals: Array, cell: float) -> tuple[Array, Array]:
    """Mean points and renormalised mean normals [M, 3] of the occupied cells of a grid; normals that cancel stay 0."""
    keys = np.floor(points / cell).astype(np.int64)
    keys -= keys.min(axis=0)
    extent = keys.max(axis=0) + 1
    flat = np.ravel_multi_index(tuple(keys.T), tuple(extent))
    _, inverse, counts = np.unique(flat, return_inverse=True, return_counts=True)
    means = [
        np.column_stack([np.bincount(inverse, weights=column, minlength=len(counts)) for column in values.T])
        for values in (points, normals)
    ]
    length = np.linalg.norm(means[1], axis=1, keepdims=True)
    unit_normals = np.divide(means[1], length, out=np.zeros_like(means[1]), where=length > 0)
    return means[0] / counts[:, None], unit_normals
