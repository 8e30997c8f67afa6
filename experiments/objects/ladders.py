"""Small molecules and a ring of a hundred atoms, to be asked at many tolerances: what is found may only grow.

Some are regular. Of others every atom has moved by a little, alike under a subgroup: that subgroup is exact at every
tolerance, and the rest comes back where the tolerance allows for the displacement.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects import molecule_geometry as made
from experiments.objects.built_symmetry import Truth
from experiments.objects.instances import Build, Instance
from experiments.objects.molecule_sets import NUMBERS, molecule
from experiments.objects.parts import marked_group
from symrefine.geometry import Array
from symrefine.groups import PointGroup, identify, is_subgroup
from symrefine.shape import Index, Shape

Rng = np.random.Generator
TOLERANCES = (0.0001, 0.0002, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.02, 0.04)
# How far atoms are moved, in diagonals.
MOVED = (0.002, 0.01)
# Random choices of generators after which a subgroup counts as not there.
TRIES = 2000


def _atoms(name: str) -> tuple[Array, Index]:
    """Positions [N, 3] and atomic numbers [N]; `ring100` is a ring of a hundred carbon atoms."""
    if name == "ring100":
        return np.array([p for _, p in made.ring("C", 100, made.ring_radius(1.4, 100))]), np.full(100, NUMBERS["C"])
    given = molecule(name)
    return np.array(given.positions), np.array(given.numbers)


def _group(positions: Array, numbers: Index) -> Truth:
    group, center = marked_group(np.column_stack([positions, numbers]))
    return Truth(group=group, center=center)


def regular(name: str, _rng: Rng) -> Instance:
    """A molecule as it is."""
    positions, numbers = _atoms(name)
    return _instance(positions, numbers, _group(positions, numbers))


def distorted(name: str, left: str, rng: Rng) -> Instance:
    """A molecule whose atoms have moved so that the group `left` remains."""
    positions, numbers = _atoms(name)
    whole = _group(positions, numbers)
    kept = subgroup(whole.group, left, rng)
    offset = positions - whole.center
    step = rng.normal(size=positions.shape)
    # The mean over the group of what each operation makes of the displacements is the same under all of them.
    mean = np.zeros_like(step)
    sites = cKDTree(_with(offset, numbers))
    for g in kept.operations():
        mean[sites.query(_with(offset @ g.T, numbers))[1]] += step @ g.T
    size = rng.uniform(*MOVED) * np.linalg.norm(np.ptp(positions, axis=0))
    moved = positions + mean * size / np.linalg.norm(mean, axis=1).max()
    return _instance(moved, numbers, Truth(group=kept, center=whole.center))


def _with(points: Array, numbers: Index) -> Array:
    """Points with the kind of their atom as a coordinate that keeps kinds apart."""
    return np.column_stack([points, 1e3 * numbers])


def subgroup(group: PointGroup, name: str, rng: Rng) -> PointGroup:
    """A subgroup of that name in place: in the frame of the group, or what a few random operations generate."""
    same = PointGroup(name=name, frame=group.frame)
    if is_subgroup(same, group):
        return same
    operations = group.operations()
    for _ in range(TRIES):
        chosen = generated(operations[rng.integers(len(operations), size=rng.integers(1, 4))])
        found = identify(chosen)
        if found.name == name:
            return found
    raise AssertionError(f"{group.name} has no subgroup {name}")


def generated(generators: Sequence[Array] | Array) -> Array:
    """All products [k, 3, 3] of exact operations that generate a finite group."""
    found = [np.eye(3)]
    for operation in found:  # grows while it is gone through
        for g in generators:
            product = g @ operation
            if np.abs(np.array(found) - product).max(axis=(1, 2)).min() > 1e-6:
                found.append(product)
    return np.array(found)


def _instance(positions: Array, numbers: Index, truth: Truth) -> Instance:
    shape = Shape(points=positions, labels=numbers)
    return Instance(shape=shape, truth=truth, diagonal=shape.diagonal)


LADDERS: dict[str, Build] = {
    **{
        name: partial(regular, name)
        for name in ("water", "allene", "benzene", "SF6", "ferrocene, eclipsed", "S8", "ring100")
    },
    **{
        f"{name} to {left}": partial(distorted, name, left)
        for name, lefts in {
            "methane": "D2 C2v D2d",
            "cubane": "D2 D4h C2v",
            "S8": "D4 C2v",
            "benzene": "D2h C2v",
            "SF6": "C4v",
            "adamantane": "D2",
            "ferrocene, eclipsed": "C2v",
            "B12H12": "D2",
            "ring100": "D10h",
        }.items()
        for left in lefts.split()
    },
}
