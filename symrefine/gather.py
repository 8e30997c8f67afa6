"""What a search may use, gathered from a shape: moments, n-tuples, and a cloud to judge by, in normalised units."""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from symrefine.geometry import Array, tight_diagonal
from symrefine.moments.harmonics import harmonic_moments
from symrefine.moments.moments import Moments, shape_moments
from symrefine.moments.quadrature import mesh_nodes, sample_surface
from symrefine.ntuples.contract import NTuples, ntuples
from symrefine.ntuples.rank import classify
from symrefine.search import Evidence
from symrefine.shape import Index, Shape
from symrefine.surface.misses import Deviation, Judge, make_judge, split_floor
from symrefine.surface.skin import LocalPlanes, fills_volume, isolated_points, local_planes

ORDER = 8
PARTS = 16
SAMPLES = 20000
LOCAL_PLANES = 4000
CLOSER_PLANES = 12000
# Points of a cloud that fills a volume, at most.
VOLUME_POINTS = 20000
# Masses of atoms that differ by more than this fraction are masses of different kinds.
SAME_MASS = 0.01
# Up to so many distinct points stand for themselves (atoms); more are samples of a surface.
FEW = 250


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """A shape with the classes of its points or faces, its moments and its n-tuples."""

    shape: Shape
    classes: Index | None
    moments: Moments
    vectors: NTuples


def measure(shape: Shape) -> Measured:
    """Moments to order 8 and the n-tuples of them."""
    classes = _classes(shape)
    moments = _moments(shape, classes, parts=0 if is_few(shape) or shape.faces is not None else PARTS)
    return Measured(shape=shape, classes=classes, moments=moments, vectors=ntuples(moments))


def gather(measured: Measured, tolerance: float, rng: np.random.Generator) -> Evidence:
    """The evidence at a tolerance: of few points from the points, else from local planes of the surface."""
    return _few_points(measured, tolerance) if is_few(measured.shape) else _surface(measured, tolerance, rng)


def is_few(shape: Shape) -> bool:
    """Whether the points are few enough to stand for themselves."""
    return shape.faces is None and len(shape.points) <= FEW


def part(shape: Shape, some: Index) -> Shape:
    """Some of the points of a cloud."""
    return replace(
        shape,
        points=shape.points[some],
        weights=None if shape.weights is None else shape.weights[some],
        normals=None if shape.normals is None else shape.normals[some],
        labels=None if shape.labels is None else shape.labels[some],
    )


def _classes(shape: Shape) -> Index | None:
    """Classes 0, 1, ... of the points (faces, for a mesh) that must match: labels, and masses where points are few."""
    kinds = [] if shape.labels is None else [shape.labels]
    if is_few(shape) and shape.weights is not None:
        ascending = np.argsort(shape.weights, kind="stable")
        steps = np.diff(shape.weights[ascending]) > SAME_MASS * shape.weights[ascending][1:]
        kinds.append(np.concatenate([[0], np.cumsum(steps)])[np.argsort(ascending, kind="stable")])
    if not kinds:
        return None
    classes = np.unique(np.stack(kinds), axis=1, return_inverse=True)[1].reshape(-1)
    return classes if classes.any() else None


def _moments(shape: Shape, classes: Index | None, parts: int) -> Moments:
    """Moments of the shape in which each class has a density of its own, so that they know one class from another."""
    if classes is None:
        return shape_moments(shape, ORDER, parts=parts)
    # Multiples of the golden ratio modulo 1 keep any number of classes apart.
    density = 0.5 + np.modf(0.6180339887498949 * (classes + 1))[0]
    if shape.faces is None:
        own = np.ones(len(shape.points)) if shape.weights is None else shape.weights
        return shape_moments(replace(shape, weights=own * density), ORDER, parts=parts)
    nodes, weights = mesh_nodes(replace(shape, measure="surface"), ORDER)
    heavier = weights * np.repeat(density, len(weights) // len(density))
    return shape_moments(Shape(points=shape.points[0] + nodes, weights=heavier), ORDER)


def _surface(measured: Measured, tolerance: float, rng: np.random.Generator) -> Evidence:
    """Evidence from a cloud of local planes (of points, where they fill a volume)."""
    from scipy.spatial import cKDTree

    shape, moments = measured.shape, measured.moments
    points, normals, weights, labels = _cloud(shape, measured.classes, rng)
    local = (points - moments.center) / moments.scale
    exact = shape.faces is not None
    tree = None if exact else cKDTree(local, balanced_tree=False, compact_nodes=False)
    chance = None if exact or np.ptp(weights) == 0.0 else weights
    planes = partial(
        local_planes, local, rng=rng, normals=normals, labels=labels, weights=chance, exact=exact, tree=tree
    )
    filled = tree is not None and normals is None and fills_volume(local, tree, np.random.default_rng(0))
    cloud = _volume(local, labels, rng) if filled else planes(LOCAL_PLANES)
    diagonal = tight_diagonal(cloud.points)
    floor = None if exact or filled or len(local) > LOCAL_PLANES else _split(local, labels, diagonal, rng)
    judge = make_judge(cloud, diagonal, tolerance, floor)

    @cache
    def closer() -> Judge:
        return make_judge(cloud if filled else planes(CLOSER_PLANES), diagonal, tolerance, floor)

    @cache
    def halves() -> Deviation:
        if exact or filled or floor is not None:
            return judge.floor
        return judge.floor.at_least(_split(local, labels, diagonal, np.random.default_rng(0)))

    return Evidence(
        moments=moments,
        harmonics=harmonic_moments(moments),
        tuples=classify(measured.vectors),
        points=local,
        weights=weights / weights.sum(),
        judge=judge,
        closer=closer,
        halves=halves,
    )


def _split(points: Array, labels: Index | None, diagonal: float, rng: np.random.Generator) -> Deviation:
    """What two halves of a cloud show against one another."""
    order = rng.permutation(len(points))
    halves = [
        local_planes(points[half], LOCAL_PLANES, rng, labels=None if labels is None else labels[half])
        for half in (np.sort(order[::2]), np.sort(order[1::2]))
    ]
    return split_floor(halves[0], halves[1], diagonal)


def _volume(points: Array, labels: Index | None, rng: np.random.Generator) -> LocalPlanes:
    pick = np.sort(rng.choice(len(points), min(VOLUME_POINTS, len(points)), replace=False))
    return isolated_points(points[pick], None if labels is None else labels[pick], body="volume")


def _few_points(measured: Measured, tolerance: float) -> Evidence:
    """Evidence from points that stand for themselves: every direction is searched, whatever the n-tuples say."""
    shape, moments = measured.shape, measured.moments
    local = (shape.points - moments.center) / moments.scale
    judge = make_judge(isolated_points(local, measured.classes), tight_diagonal(local), tolerance)
    weights = np.ones(len(local)) if shape.weights is None else shape.weights
    return Evidence(
        moments=moments,
        harmonics=harmonic_moments(moments),
        tuples=replace(classify(measured.vectors), kind="vanish"),
        points=local,
        weights=weights / weights.sum(),
        judge=judge,
        closer=lambda: judge,
        halves=lambda: judge.floor,
    )


def _cloud(
    shape: Shape, classes: Index | None, rng: np.random.Generator
) -> tuple[Array, Array | None, Array, Index | None]:
    """Points, normals, weights and classes: samples with exact normals for a mesh, else the points themselves."""
    if shape.faces is not None:
        points, normals, face = sample_surface(shape, SAMPLES, rng)
        return points, normals, np.ones(len(points)), None if classes is None else classes[face]
    weights = np.ones(len(shape.points)) if shape.weights is None else shape.weights
    return shape.points, shape.normals, weights, classes
