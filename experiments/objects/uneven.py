"""Meshes that are symmetric as sets of points, though one side carries more area or other triangles.

Modelled twice, left over from an editor, tessellated by another program: moments see the areas, a person the surface.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects import constructions as made
from experiments.objects.built_symmetry import Truth
from experiments.objects.instances import Build, Instance
from experiments.objects.parts import Part, assembled, placed_group
from symrefine.geometry import Array, unit
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.shape import Shape

Rng = np.random.Generator
# Longest edge after which triangles are fine enough to choose some of them, in diagonals.
EDGE_REL = 0.08


def mesh_of(corners: Array) -> Shape:
    """A mesh of triangles [F, 3, 3], none of them sharing a vertex."""
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    return Shape(points=corners.reshape(-1, 3), faces=faces, measure="surface")


def quartered(corners: Array) -> Array:
    """Every triangle [F, 3, 3] as four."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    d, e, f = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.concatenate([np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])


def fine(corners: Array, longest: float) -> Array:
    """Triangles [F, 3, 3] halved across their longest edge until none is longer."""
    done: list[Array] = []
    while len(corners):
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        order = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
        long = lengths.max(axis=1) > longest
        done.append(corners[~long])
        halves = [np.stack([a, 0.5 * (a + b), c], axis=1), np.stack([0.5 * (a + b), b, c], axis=1)]
        corners = np.concatenate([half[long] for half in halves])
    return np.concatenate(done)


def areas(corners: Array) -> Array:
    """Area [F] of triangles [F, 3, 3]."""
    shape = mesh_of(corners)
    assert shape.faces is not None
    return triangle_areas_and_normals(shape.points, shape.faces)[0]


Side = Callable[[Array], Array]


def doubled(corners: Array, side: Side, _rng: Rng) -> Array:
    """Every face of one side twice."""
    return np.concatenate([corners, corners[side(corners)]])


def patched(corners: Array, side: Side, rng: Rng) -> Array:
    """Some faces of one side twice, 1 to 5 % of the area."""
    small = fine(corners, EDGE_REL * _diagonal(corners))
    return np.concatenate([small, _some(small, side, rng.uniform(0.01, 0.05), rng)])


def finer(corners: Array, side: Side, _rng: Rng) -> Array:
    """One side in triangles a sixteenth as large."""
    there = side(corners)
    return np.concatenate([corners[~there], quartered(quartered(corners[there]))])


def shelled(corners: Array, side: Side, rng: Rng) -> Array:
    """A second skin below some of one side, 0.2 to 1.1 % of the area, no deeper than 0.3 % of the diagonal."""
    some = _some(fine(corners, EDGE_REL * _diagonal(corners)), side, rng.uniform(0.002, 0.011), rng)
    normals = unit(np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]))
    depth = rng.uniform(0.0, 0.003) * _diagonal(corners)
    return np.concatenate([corners, some - depth * normals[:, None]])


def walled(corners: Array, side: Side, _rng: Rng) -> Array:
    """A second wall below all of one side, 0.3 % of the diagonal deep."""
    there = corners[side(corners)]
    normals = unit(np.cross(there[:, 1] - there[:, 0], there[:, 2] - there[:, 0]))
    return np.concatenate([corners, there - 0.003 * _diagonal(corners) * normals[:, None]])


def rough(corners: Array, side: Side, rng: Rng) -> Array:
    """One side in triangles less than 1 % of the diagonal long, with vertices 0.2 % out of place each way."""
    small = fine(corners, 0.1 * EDGE_REL * _diagonal(corners))
    places, own = np.unique(small.reshape(-1, 3).round(9), axis=0, return_inverse=True)
    moved = places + 0.002 * _diagonal(corners) * rng.normal(size=places.shape)
    return np.where(side(small)[:, None, None], moved[own].reshape(-1, 3, 3), small)


def _diagonal(corners: Array) -> float:
    return float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))


def _some(corners: Array, side: Side, share: float, rng: Rng) -> Array:
    """Triangles of one side, in a row along a random direction, that together carry a share of the whole area."""
    there = corners[side(corners)]
    there = there[np.argsort(there.mean(axis=1) @ unit(rng.normal(size=3)))]
    covered = np.cumsum(areas(there)) <= share * areas(corners).sum()
    covered[0] = True
    return there[covered]


def uneven(build: Callable[[], list[Part]], way: Callable[[Array, Side, Rng], Array], rng: Rng) -> Instance:
    """An object of exact mirrors, with one side of one of them made differently."""
    group, center = placed_group(build())
    normals = group.mirrors()
    normal = normals[rng.integers(len(normals))] * rng.choice([-1.0, 1.0])
    whole = assembled(build())
    assert whole.faces is not None
    corners = whole.points[whole.faces] - center
    corners = way(corners[areas(corners) > 0.0], lambda some: some.mean(axis=1) @ normal > 0.0, rng)
    shape = mesh_of(corners * rng.uniform(0.5, 2.0))
    return Instance(shape=shape, truth=Truth(group=group, center=np.zeros(3)), diagonal=shape.diagonal)


WAYS = (doubled, patched, finer, shelled)
# These carry a seventh to half as much area again, which moves the centroid farther than the moments may be off.
LARGE = (walled, rough)
BASES: dict[str, Callable[[], list[Part]]] = {
    "table": made.table,
    "chair": made.chair,
    "bracket": made.bracket,
    "crate": made.crate,
    "starfish": made.starfish,
    "cross": made.cross,
    "stool3": partial(made.stool, 3),
    "cube": made.bossed_cube,
}
# Every object in two of the four ways, and in one of the large ones.
UNEVEN: dict[str, Build] = {
    f"{base} {way.__name__}": partial(uneven, build, way)
    for number, (base, build) in enumerate(BASES.items())
    for way in (WAYS[number % 2], WAYS[2 + (number // 2) % 2], LARGE[number % 2])
}
