"""Clouds that break arithmetic: one point far off, one enormous weight, all points on a line.

Nothing need be found there; but nothing may be invented and nothing may break.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects import constructions as made
from experiments.objects.blobs import blob
from experiments.objects.built_symmetry import Truth
from experiments.objects.instances import Build, Instance, centred
from experiments.objects.parts import Part, assembled, placed_group
from experiments.objects.shapes import sample
from symrefine.geometry import Array, frame_with_z, unit
from symrefine.groups import PointGroup
from symrefine.shape import Index, Shape

Rng = np.random.Generator
POINTS = 3000
# In a line: a generic direction, so that no coordinate is constant.
ALONG = unit([1.0, 0.3, -0.7])


def _base(build: Callable[[], list[Part]] | None, rng: Rng) -> tuple[Array, Truth, float]:
    """A cloud about its centre, its symmetry and its diagonal; without parts a blob."""
    if build is None:
        found = blob(rng)
        return sample(found.shape, POINTS, 0.0, rng), found.truth, found.diagonal
    group, center = placed_group(build())
    shape = assembled(build())
    return sample(shape, POINTS, 0.0, rng) - center, Truth(group=group, center=np.zeros(3)), shape.diagonal


def stray(build: Callable[[], list[Part]] | None, radii: float, rng: Rng) -> Instance:
    """One point that many radii away in any direction."""
    points, truth, diagonal = _base(build, rng)
    away = radii * np.linalg.norm(points, axis=1).max() * unit(rng.normal(size=3))
    shape = Shape(points=np.concatenate([points, away[None]])[rng.permutation(len(points) + 1)])
    return Instance(shape=shape, truth=truth, subgroups=True, diagonal=diagonal)


def heavy(build: Callable[[], list[Part]] | None, weight: float, rng: Rng) -> Instance:
    """One of the points weighs that many times what the others weigh."""
    points, truth, diagonal = _base(build, rng)
    weights = np.ones(len(points))
    weights[rng.integers(len(points))] = weight
    return Instance(shape=Shape(points=points, weights=weights), truth=truth, subgroups=True, diagonal=diagonal)


def line(count: int, copies: int, rng: Rng) -> Instance:
    """Points on a line at random places, each as many times."""
    places = np.repeat(rng.uniform(-1.0, 1.0, count), copies)
    return Instance(
        shape=Shape(points=np.outer(places, ALONG)),
        truth=centred("Cinfv"),
        undecidable=True,
        diagonal=float(np.ptp(places)),
    )


def chain(count: int, rng: Rng) -> Instance:
    """A linear molecule of labelled atoms with both ends alike: Dinfh."""
    half = np.cumsum(rng.uniform(1.0, 1.6, count // 2))
    kinds = rng.choice([1, 6, 7, 8], len(half))
    return _molecule(np.concatenate([-half[::-1], half]), np.concatenate([kinds[::-1], kinds]), "Dinfh")


def end(count: int, rng: Rng) -> Instance:
    """A linear molecule of labelled atoms with different ends: Cinfv."""
    kinds = rng.choice([6, 7], count)
    kinds[[0, -1]] = 1, 9
    return _molecule(np.cumsum(rng.uniform(1.0, 1.6, count)), kinds, "Cinfv")


def _molecule(places: Array, kinds: Index, name: str) -> Instance:
    group = PointGroup(name=name, frame=frame_with_z(ALONG))
    truth = Truth(group=group, center=0.5 * (places[0] + places[-1]) * ALONG)
    return Instance(
        shape=Shape(points=np.outer(places, ALONG), labels=kinds), truth=truth, diagonal=float(np.ptp(places))
    )


BASES: dict[str, Callable[[], list[Part]] | None] = {
    "table": made.table,
    "bracket": made.bracket,
    "starfish": made.starfish,
    "blob": None,
}
FAR: dict[str, Build] = {
    **{
        f"{base} stray{radii:g}": partial(stray, build, radii)
        for base, build in BASES.items()
        for radii in (10, 100, 1e4)
    },
    **{f"{base} heavy{w:.0e}": partial(heavy, build, w) for base, build in BASES.items() for w in (1e3, 1e6, 1e12)},
    **{
        f"line{n}x{c}": partial(line, n, c)
        for n, c in ((3, 1), (25, 1), (25, 8), (250, 1), (300, 1), (900, 3), (5000, 1))
    },
    **{f"chain{n}": partial(chain, n) for n in (2, 8, 60, 250)},
    **{f"end{n}": partial(end, n) for n in (3, 31, 249)},
}
