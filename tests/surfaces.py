"""Surfaces that tests are made of."""

from collections.abc import Callable
from typing import Any

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes, drawn, make_skin


def local_planes(
    points: Array,
    count: int,
    rng: np.random.Generator,
    *,
    labels: Index | None = None,
    weights: Array | None = None,
    **given: Any,
) -> LocalPlanes:
    """Local planes at `count` of the points [N, 3], each drawn as often as its weight [N] says; `given` the skin."""
    pick = drawn(len(points), count, rng, weights)
    return make_skin(points, rng, **given).local_planes(pick, labels)


def half_of(points: Array, count: int, rng: np.random.Generator, **given: Any) -> Callable[[Index], LocalPlanes]:
    """What half of the points [N, 3] show of the surface of all, at `count` of them; `given` the skin."""
    whole = make_skin(points, rng, **given)
    return lambda some: whole.half(some).local_planes(drawn(len(some), count, rng))


def distance_to_mesh(points: Array, corners: Array) -> Array:
    """How far points [N, 3] are from the nearest of triangles [F, 3, 3], which may have no area; one by one."""
    nearest = np.full(len(points), np.inf)
    for triangle in corners:
        sides, local = np.roll(triangle, -1, axis=0) - triangle, points[:, None] - triangle
        along = np.einsum("nki,ki->nk", local, sides) / np.maximum((sides**2).sum(axis=1), 1e-300)
        off = np.linalg.norm(local - np.clip(along, 0.0, 1.0)[..., None] * sides, axis=2).min(axis=1)
        normal = np.cross(sides[0], sides[1])
        within = (np.einsum("nki,ki->nk", local, np.cross(normal, sides)) >= 0.0).all(axis=1)
        area = float(np.linalg.norm(normal))
        if area > 1e-9 * float((sides**2).sum()):
            off = np.where(within, np.abs(local[:, 0] @ normal) / area, off)
        nearest = np.minimum(nearest, off)
    return nearest
