"""What sensors do to a cloud: strays, clumps, a floor, uneven density, patches, holes, cuts, and views from a camera.

Every damage takes a mesh and a strength and returns the points that are left, in the units of the mesh, with what is
known of each. Strengths are shares of the points, ratios of densities, or numbers of cameras.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects.shapes import sample
from symrefine.geometry import Array, tight_diagonal, unit
from symrefine.load.open3d import open3d
from symrefine.shape import Index, Shape

Rng = np.random.Generator
# Before the damage.
POINTS, NOISE_REL = 20000, 0.003
# Strays lie in the bounding box, so many times as large; a clump is so large, in diagonals.
BOX, CLUMP_REL = 1.5, 0.04
# Of a surface that is seen badly here and there.
PATCHES = 6
# A camera stands so many diagonals away; rays of a view that meet the object, about.
AWAY, RAYS = 2.0, 10000
# Noise of the depth and its steps, in diagonals; the share of pixels at edges that fly between front and back.
DEPTH_NOISE_REL, DEPTH_STEP_REL, FLYING = 0.0025, 0.002, 0.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Damaged:
    """What is left of an object: points [N, 3], which of them are strays [N], and where they were seen from [N, 3]."""

    points: Array
    strays: Index
    viewpoint: Array | None = None


def _whole(mesh: Shape, rng: Rng, count: int = POINTS) -> Array:
    return sample(mesh, count, NOISE_REL, rng)


def _left(points: Array, strays: Array | None = None) -> Damaged:
    added = np.empty((0, 3)) if strays is None else strays
    return Damaged(
        points=np.concatenate([points, added]),
        strays=np.concatenate([np.zeros(len(points), dtype=np.int64), np.ones(len(added), dtype=np.int64)]),
    )


def clean(mesh: Shape, _strength: float, rng: Rng) -> Damaged:
    """Nothing but noise."""
    return _left(_whole(mesh, rng))


def outliers(mesh: Shape, share: float, rng: Rng) -> Damaged:
    """A share of the points anywhere in a box around the object."""
    return _scattered(_whole(mesh, rng, round((1.0 - share) * POINTS)), share, rng)


def _scattered(points: Array, share: float, rng: Rng) -> Damaged:
    low, high = points.min(axis=0), points.max(axis=0)
    box = 0.5 * (low + high) + BOX * (rng.random((round(share * POINTS), 3)) - 0.5) * (high - low)
    return _left(points, box)


def clump(mesh: Shape, share: float, rng: Rng) -> Damaged:
    """A share of the points in one small cloud in that box."""
    points = _whole(mesh, rng, round((1.0 - share) * POINTS))
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high) + BOX * (rng.random(3) - 0.5) * (high - low)
    size = CLUMP_REL * np.linalg.norm(high - low)
    return _left(points, middle + size * rng.normal(size=(round(share * POINTS), 3)))


def ground(mesh: Shape, size: float, rng: Rng) -> Damaged:
    """The floor it stands on, as dense as the object, with edges so many times as long as those of its box."""
    points = _whole(mesh, rng)
    low, high = points.min(axis=0), points.max(axis=0)
    area = size**2 * float(np.prod((high - low)[:2]))
    count = round(area * POINTS / _area(mesh))
    floor = 0.5 * (low + high) + size * (rng.random((count, 3)) - 0.5) * (high - low)
    floor[:, 2] = mesh.points[:, 2].min() + rng.normal(scale=NOISE_REL * mesh.diagonal, size=count)
    return _left(points, floor)


def _area(mesh: Shape) -> float:
    assert mesh.faces is not None
    a, b, c = np.moveaxis(mesh.points[mesh.faces], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def uneven(mesh: Shape, ratio: float, rng: Rng) -> Damaged:
    """A density that falls off along some direction, from one end to the other by a ratio."""
    points = _whole(mesh, rng, 8 * POINTS)
    return _left(_thinned(points, ratio, rng))


def _thinned(points: Array, ratio: float, rng: Rng) -> Array:
    along = points @ unit(rng.normal(size=3))
    chance = ratio ** -((along - along.min()) / np.ptp(along))
    return _drawn(points, chance, rng)


def _drawn(points: Array, chance: Array, rng: Rng) -> Array:
    """As many of points [N, 3] as a cloud has, or all, each as likely as its chance [N] says."""
    return points[rng.choice(len(points), min(POINTS, len(points)), replace=False, p=chance / chance.sum())]


def dense(mesh: Shape, ratio: float, rng: Rng) -> Damaged:
    """A tenth of the surface, around some point, so many times as dense as the rest."""
    points = _whole(mesh, rng, 10 * POINTS)
    away = np.linalg.norm(points - points[rng.integers(len(points))], axis=1)
    chance = np.where(away < np.quantile(away, 0.1), ratio, 1.0)
    return _left(_drawn(points, chance, rng))


def patchy(mesh: Shape, ratio: float, rng: Rng) -> Damaged:
    """A fifth of the surface, in patches, so many times less dense than the rest: where it is dark, or shines."""
    points = _whole(mesh, rng, 10 * POINTS)
    away, _ = cKDTree(points[rng.choice(len(points), PATCHES, replace=False)]).query(points)
    chance = np.where(away < np.quantile(away, 0.2), 1.0 / ratio, 1.0)
    return _left(_drawn(points, chance, rng))


def hole(mesh: Shape, share: float, rng: Rng) -> Damaged:
    """A share of the points gone, those around some point of the surface."""
    points = _whole(mesh, rng)
    return _left(_without_ball(points, share, rng))


def _without_ball(points: Array, share: float, rng: Rng) -> Array:
    away = np.linalg.norm(points - points[rng.integers(len(points))], axis=1)
    return points[away > np.quantile(away, share)]


def cut(mesh: Shape, share: float, rng: Rng) -> Damaged:
    """A share of the points cut off by a plane."""
    return _left(cut_off(_whole(mesh, rng), unit(rng.normal(size=3)), share))


def cut_off(points: Array, direction: Array, share: float) -> Array:
    """Points [N, 3] but for the share of them that lies least far along a direction [3]."""
    along = points @ direction
    return points[along > np.quantile(along, share)]


def mild(mesh: Shape, strength: float, rng: Rng) -> Damaged:
    """Strays, uneven density and a hole at once: shares of `strength`, a ratio of 3."""
    points = _without_ball(_whole(mesh, rng, 4 * POINTS), strength, rng)
    return _scattered(_thinned(points, 3.0, rng)[: round((1.0 - strength) * POINTS)], strength, rng)


def tabletop(mesh: Shape, count: float, rng: Rng) -> Damaged:
    """What one or more cameras see from above of an object on a table, and of the table, as long as twice its box."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    corners = 0.5 * (low + high) + np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (high - low).max()
    corners[:, 2] = low[2]
    assert mesh.faces is not None
    faces = np.concatenate([mesh.faces, len(mesh.points) + np.array([[0, 1, 2], [0, 2, 3]])])
    both = Shape(points=np.concatenate([mesh.points, corners]), faces=faces)
    around, up = rng.random() + np.arange(round(count)) / count, rng.uniform(0.35, 0.95)
    level = np.sqrt(1.0 - up**2)
    seen = [view(both, np.array([level * np.cos(a), level * np.sin(a), up]), rng) for a in 2.0 * np.pi * around]
    made = _together(seen)
    return replace(made, strays=(made.points[:, 2] < low[2] + 1e-4 * mesh.diagonal).astype(np.int64))


def views(mesh: Shape, count: float, rng: Rng, *, rough: bool = False) -> Damaged:
    """What one or more cameras see: two look from opposite sides, more from all around."""
    first = unit(rng.normal(size=3))
    across = unit(np.cross(first, rng.normal(size=3)))
    ring = 2.0 * np.pi * np.arange(round(count)) / count
    seen = [view(mesh, np.cos(a) * first + np.sin(a) * across, rng, rough=rough) for a in ring]
    return _together(seen)


def _together(seen: Sequence[Damaged]) -> Damaged:
    """What several cameras see, one after the other."""
    return Damaged(
        points=np.concatenate([s.points for s in seen]),
        strays=np.concatenate([s.strays for s in seen]),
        viewpoint=np.concatenate([np.asarray(s.viewpoint) for s in seen]),
    )


def view(mesh: Shape, direction: Array, rng: Rng, *, rough: bool = False) -> Damaged:
    """What a camera sees that stands in a direction from the object, on a grid of rays."""
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    faces = np.asarray(mesh.faces, dtype=np.uint32)
    scene.add_triangles(np.ascontiguousarray(mesh.points, dtype=np.float32), faces)
    middle = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
    eye = middle + AWAY * mesh.diagonal * direction
    right = unit(np.cross(direction, rng.normal(size=3)))
    up = np.cross(direction, right)
    corners = (mesh.points - eye) @ np.stack([right, up, -direction]).T
    low, high = (corners[:, :2] / corners[:, 2:]).min(axis=0), (corners[:, :2] / corners[:, 2:]).max(axis=0)
    side = 100
    for _ in range(2):  # once to learn which share of the rays meets the object
        pixel = float((high - low).max()) / side
        grid = [np.arange(a - 2 * pixel, b + 3 * pixel, pixel) for a, b in zip(low, high, strict=True)]
        x, y = np.meshgrid(*grid, indexing="ij")
        rays = x[..., None] * right + y[..., None] * up - direction
        cast = np.concatenate([np.broadcast_to(eye, rays.shape), rays], axis=-1).astype(np.float32)
        depth = scene.cast_rays(o3d.core.Tensor(cast))["t_hit"].numpy().astype(np.float64)
        side = round(side * np.sqrt(RAYS / max(1, np.isfinite(depth).sum())))
    hit, flying = np.isfinite(depth), np.zeros(depth.shape, dtype=bool)
    if rough:
        around = np.stack([np.roll(depth, s, axis=a) for a in (0, 1) for s in (-1, 1)])
        depth = np.where(hit, depth, 0.0)
        around = np.where(np.isfinite(around), around, depth)
        far = around[rng.integers(4, size=depth.shape), np.arange(depth.shape[0])[:, None], np.arange(depth.shape[1])]
        flying = hit & (np.abs(far - depth) > 0.02 * mesh.diagonal) & (rng.random(depth.shape) < FLYING)
        mixed = rng.random(depth.shape)
        depth = np.where(flying, mixed * depth + (1.0 - mixed) * far, depth)
        depth = depth + rng.normal(scale=DEPTH_NOISE_REL * mesh.diagonal, size=depth.shape)
        step = DEPTH_STEP_REL * mesh.diagonal
        depth = step * np.round(depth / step)
    points = eye + depth[hit][:, None] * rays[hit]
    return Damaged(
        points=points, strays=flying[hit].astype(np.int64), viewpoint=np.broadcast_to(eye, points.shape).copy()
    )


Damage = Callable[[Shape, float, Rng], Damaged]
KINDS: dict[str, tuple[Damage, tuple[float, ...]]] = {
    "clean": (clean, (0.0,)),
    "outliers": (outliers, (0.01, 0.02, 0.1, 0.2, 0.4)),
    "clump": (clump, (0.02, 0.05, 0.1)),
    "ground": (ground, (1.5,)),
    "uneven": (uneven, (3.0, 10.0, 100.0)),
    "hole": (hole, (0.05, 0.15, 0.3)),
    "cut": (cut, (0.05, 0.2, 0.4)),
    "views": (views, (1.0, 2.0, 4.0)),
    "rough views": (partial(views, rough=True), (1.0, 2.0)),
    "mild": (mild, (0.05,)),
    "floor": (ground, (1.1, 1.5, 3.0)),
    "tabletop": (tabletop, (1.0, 2.0)),
    "dense": (dense, (10.0, 30.0)),
    "patchy": (patchy, (10.0, 30.0)),
}
# Kinds of which it is told that there is a floor.
FLOORS = ("floor", "tabletop")


def can_show(points: Array, normal: Array, offset: float, *, share: float = 0.15, near_rel: float = 0.02) -> bool:
    """Whether points show a plane: at least a share of them is moved by it and has a counterpart among them."""
    diagonal = tight_diagonal(points)
    height = points @ normal - offset
    moved = points - 2.0 * height[:, None] * normal
    away, _ = cKDTree(points).query(moved, distance_upper_bound=near_rel * diagonal)
    return float(((2.0 * np.abs(height) > near_rel * diagonal) & np.isfinite(away)).mean()) >= share
