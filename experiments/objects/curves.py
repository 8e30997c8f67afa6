"""Points on curves that have no thickness: rims, outlines, wire frames and paths, drawn exactly and sampled at random.

All planes along a flat curve are one plane, and the points of a sample are not those of its mirror image. Curves with
no symmetry but, if they are flat, that of their plane are among them.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.built_symmetry import Truth
from experiments.objects.instances import Build, Instance
from experiments.objects.lathe import Rng
from symrefine.geometry import Array
from symrefine.groups import PointGroup
from symrefine.shape import Shape

# Points of a sample, and corners of the polygon that stands for a curve.
POINTS, CORNERS = (500, 2000), 6000
TURN = 2.0 * math.pi
Curve = Callable[[Array, Rng], Array]


def ellipse(t: Array, rng: Rng) -> Array:
    """D2h about z."""
    return _flat(np.cos(TURN * t), rng.uniform(0.5, 0.75) * np.sin(TURN * t))


def circle(t: Array, _: Rng) -> Array:
    """Dinfh about z."""
    return _flat(np.cos(TURN * t), np.sin(TURN * t))


def polygon(corners: int, t: Array, _: Rng) -> Array:
    """D_nh about z."""
    angles = TURN / corners * np.arange(corners + 1)
    at = np.linspace(0.0, 1.0, corners + 1)
    return _flat(np.interp(t, at, np.cos(angles)), np.interp(t, at, np.sin(angles)))


def crown(waves: int, t: Array, rng: Rng) -> Array:
    """D_nd about z: a rim that goes up and down."""
    return np.column_stack([circle(t, rng)[:, :2], rng.uniform(0.2, 0.4) * np.sin(waves * TURN * t)])


def trefoil(t: Array, _: Rng) -> Array:
    """D3 about z."""
    a = TURN * t
    return np.stack([np.sin(a) + 2.0 * np.sin(2.0 * a), np.cos(a) - 2.0 * np.cos(2.0 * a), -np.sin(3.0 * a)], axis=1)


def sigmoid(t: Array, rng: Rng) -> Array:
    """C2h about z: two arcs, one either way, that meet in the middle."""
    a = rng.uniform(1.1, 1.5) * math.pi * np.abs(2.0 * t - 1.0)
    return np.sign(t - 0.5)[:, None] * _flat(np.cos(a) - 1.0, np.sin(a))


def arch(t: Array, rng: Rng) -> Array:
    """C2v about x: a part of a circle."""
    a = rng.uniform(0.35, 0.6) * TURN * (t - 0.5)
    return _flat(np.cos(a), np.sin(a))


def helix(turns: tuple[float, float], height: tuple[float, float], t: Array, rng: Rng) -> Array:
    """C2 about x: between so many turns, and so high."""
    a = rng.uniform(*turns) * TURN * (t - 0.5)
    return np.column_stack([np.cos(a), np.sin(a), rng.uniform(*height) * (t - 0.5)])


def spiral(t: Array, rng: Rng) -> Array:
    """Cs: flat, and nothing else."""
    a = rng.uniform(1.2, 1.8) * TURN * t
    return (0.2 + t)[:, None] * _flat(np.cos(a), np.sin(a))


def cable(t: Array, rng: Rng) -> Array:
    """C1: a closed curve of random waves."""
    waves, size = np.arange(1, 4), 1.0 / np.arange(1, 4)[:, None] ** 1.5
    cosine, sine = (rng.normal(size=(3, 3)) * size for _ in range(2))
    return np.asarray(np.cos(TURN * np.outer(t, waves)) @ cosine + np.sin(TURN * np.outer(t, waves)) @ sine)


def _flat(x: Array, y: Array) -> Array:
    return np.stack([x, y, np.zeros_like(x)], axis=1)


def drawn(shape: Curve, name: str, frame: Array, count: int, rng: Rng) -> Instance:
    """So many points at random places along a curve."""
    path = shape(np.linspace(0.0, 1.0, CORNERS + 1), rng)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    places = rng.uniform(0.0, length[-1], count)
    points = np.stack([np.interp(places, length, coordinate) for coordinate in path.T], axis=1)
    truth = Truth(group=PointGroup(name=name, frame=frame), center=np.zeros(3))
    return Instance(shape=Shape(points=points), truth=truth, diagonal=Shape(points=path).diagonal)


# Rows of frames: of what has its axis along z and a half turn across it along x or y, and of what has it along x.
ABOUT_Z, ABOUT_Z_OVER_Y = np.eye(3), np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
ABOUT_X = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
DRAWN: dict[str, tuple[Curve, str, Array]] = {
    "circle": (circle, "Dinfh", ABOUT_Z),
    "ellipse": (ellipse, "D2h", ABOUT_Z),
    "triangle": (partial(polygon, 3), "D3h", ABOUT_Z),
    "square": (partial(polygon, 4), "D4h", ABOUT_Z),
    "crown": (partial(crown, 5), "D5d", ABOUT_Z),
    "trefoil": (trefoil, "D3", ABOUT_Z_OVER_Y),
    "sigmoid": (sigmoid, "C2h", ABOUT_Z),
    "arch": (arch, "C2v", ABOUT_X),
    "helix": (partial(helix, (1.2, 2.2), (2.0, 3.0)), "C2", ABOUT_X),
    "spiral": (spiral, "Cs", ABOUT_Z),
    "cable": (cable, "C1", ABOUT_Z),
}
CURVES: dict[str, Build] = {
    f"{name} {count}": partial(drawn, *of, count) for name, of in DRAWN.items() for count in POINTS
}
