"""Objects meant symmetric of which a scan shows a small part on one side only, and siblings really out of symmetry.

A dent, a flag, a seam, a screw that is missing: nothing is shifted, a little surface has no counterpart. Beside each
object stands the same with one of its parts 3 % of the diagonal out of place.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from experiments.objects.built_symmetry import Truth
from experiments.objects.group_shapes import MISS_REL
from experiments.objects.instances import Build, Instance, free_place
from experiments.objects.parts import Part, assembled, block, cylinder, ring_of, rod
from experiments.objects.uneven import areas, fine, mesh_of
from symrefine.geometry import Array, frame_with_z, unit
from symrefine.shape import Shape

Rng = np.random.Generator
# Of a dented mesh: how far a vertex has moved for its surface to count as different, and the longest edge (diagonals).
SEEN_REL, EDGE_REL = 0.01, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scanned:
    """What a scan is made of.

    Attributes:
        parts: the object as it was meant.
        screw: a small part on its surface, one of all its images under the group.
        moving: index of the part that the sibling has out of place.
        along: direction of that.
    """

    parts: list[Part]
    screw: Part
    moving: int
    along: tuple[float, float, float]


def _screw(at: tuple[float, float, float], axis: tuple[float, float, float], size: float) -> Part:
    """A screw head that stands half out of the surface."""
    return cylinder(size, -0.5 * size, 0.5 * size, 24).turned(frame_with_z(axis).T, at)


def cabinet(rng: Rng) -> Scanned:
    """A cupboard with two doors, handles and feet: Cs."""
    width, depth, height = rng.uniform(0.9, 1.2), rng.uniform(0.4, 0.6), rng.uniform(1.0, 1.5)
    face, door = -0.5 * depth - 0.02, 0.46 * width
    doors = [block((face, s * 0.25 * width, 0.5 * height), (0.06, door, 0.9 * height)) for s in (-1, 1)]
    handles = [block((face - 0.07, s * 0.06 * width, 0.5 * height), (0.1, 0.03, 0.2)) for s in (-1, 1)]
    feet = [block((x, s * 0.4 * width, -0.06), (0.08, 0.08, 0.12)) for s in (-1, 1) for x in (-0.15, 0.15)]
    body = block((0, 0, 0.5 * height), (depth, width, height))
    screw = _screw((0.5 * depth, 0.4 * width, 0.8 * height), (1, 0, 0), 0.04)
    return Scanned(parts=[body, *doors, *handles, *feet], screw=screw, moving=1, along=(-1, 0, 0))


def bench(rng: Rng) -> Scanned:
    """A seat and a back on two side frames: Cs."""
    long, high = rng.uniform(1.2, 1.8), rng.uniform(0.4, 0.5)
    sides = [block((0, s * 0.42 * long, 0.5 * high), (0.45, 0.08, high)) for s in (-1, 1)]
    seat, back = block((0, 0, high), (0.5, long, 0.06)), block((-0.24, 0, high + 0.3), (0.05, 0.9 * long, 0.4))
    screw = _screw((0.1, 0.3 * long, high + 0.03), (0, 0, 1), 0.035)
    return Scanned(parts=[seat, back, *sides], screw=screw, moving=2, along=(0, 1, 0))


def drone(rng: Rng) -> Scanned:
    """A square body with four arms and motors: C4v."""
    reach, height = rng.uniform(0.8, 1.1), rng.uniform(0.15, 0.25)
    arms = ring_of(block((0.5 * reach, 0, 0), (reach, 0.12, 0.1)), 4)
    motors = ring_of(cylinder(0.16, -0.05, height, 48).moved((reach, 0, 0)), 4)
    body = block((0, 0, -0.02), (0.5, 0.5, 0.26))
    screw = _screw((0.16, 0.0, 0.11), (0, 0, 1), 0.04)
    return Scanned(parts=[body, *arms, *motors], screw=screw, moving=5, along=(0, 1, 0))


def housing(rng: Rng) -> Scanned:
    """A round housing on a flange with six lugs: C6v."""
    radius, height = rng.uniform(0.5, 0.65), rng.uniform(0.6, 0.9)
    lugs = ring_of(block((radius + 0.15, 0, 0.1), (0.4, 0.25, 0.2)), 6)
    screw = _screw((0.7 * radius, 0.0, height), (0, 0, 1), 0.05)
    return Scanned(parts=[cylinder(radius, 0.0, height), *lugs], screw=screw, moving=2, along=(1, 0, 0))


def tripod(rng: Rng) -> Scanned:
    """A round seat on three legs with feet: C3v."""
    spread, height = rng.uniform(0.4, 0.55), rng.uniform(0.7, 0.9)
    legs = ring_of(rod((spread, 0, 0), (0.2, 0, height), 0.05), 3)
    feet = ring_of(block((spread, 0, 0), (0.2, 0.14, 0.08)), 3)
    screw = _screw((0.25, 0.0, height + 0.08), (0, 0, 1), 0.035)
    return Scanned(
        parts=[cylinder(0.42, height - 0.02, height + 0.08), *legs, *feet], screw=screw, moving=1, along=(0, 1, 0)
    )


def valve(rng: Rng) -> Scanned:
    """A pipe with a flange at either end and a branch with a hand wheel: C2v."""
    reach, branch = rng.uniform(0.7, 0.9), rng.uniform(0.5, 0.7)
    flanges = [rod((s * (reach - 0.1), 0, 0), (s * reach, 0, 0), 0.36) for s in (-1, 1)]
    pipes = [rod((-reach, 0, 0), (reach, 0, 0), 0.2), rod((0, 0, 0), (0, 0, branch), 0.15)]
    screw = _screw((reach, 0.0, 0.28), (1, 0, 0), 0.045)
    return Scanned(
        parts=[*pipes, *flanges, cylinder(0.32, branch, branch + 0.08)], screw=screw, moving=3, along=(0, 0, 1)
    )


def rack(rng: Rng) -> Scanned:
    """Three boards between four posts: D2h."""
    width, depth, height = rng.uniform(0.9, 1.1), rng.uniform(0.45, 0.6), rng.uniform(1.2, 1.5)
    boards = [block((0, 0, z * height), (width, depth, 0.05)) for z in (-0.4, 0.0, 0.4)]
    posts = [block((x * width, y * depth, 0), (0.09, 0.09, height)) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    screw = _screw((0.5 * width + 0.045, 0.5 * depth, 0.25 * height), (1, 0, 0), 0.035)
    return Scanned(parts=[*boards, *posts], screw=screw, moving=3, along=(1, 0, 0))


def _with(made: Scanned, shape: Shape, differs: float) -> Instance:
    return Instance(shape=shape, truth=Truth.of_parts(made.parts), differs=differs, diagonal=shape.diagonal)


def _place(made: Scanned, room: float, rng: Rng) -> tuple[Shape, Array, Array]:
    """The object about its centre, and a place for a detail of that size, in diagonals, away from all mirrors."""
    truth, shape = Truth.of_parts(made.parts), assembled(made.parts)
    centred = Shape(points=shape.points - truth.center, faces=shape.faces, measure=shape.measure)
    point, normal = free_place(centred, rng, room * shape.diagonal, truth.group.mirrors())
    return shape, point + truth.center, normal


def _added(made: Scanned, parts: list[Part]) -> Instance:
    """The object with parts that have no counterpart."""
    shape = assembled([*made.parts, *parts])
    own = sum(p.area for p in parts)
    return _with(made, shape, own / (own + sum(p.area for p in made.parts)))


def flag(made: Scanned, rng: Rng) -> Instance:
    """A small plate upright on one side, 0.3 to 0.9 % of the surface."""
    _, point, normal = _place(made, 0.03, rng)
    side = np.sqrt(0.5 * rng.uniform(0.003, 0.009) * sum(p.area for p in made.parts))
    plate = block((0, 0, 0.5 * side), (side, 0.08 * side, side))
    return _added(made, [plate.turned(frame_with_z(normal).T, point)])


def seam(made: Scanned, rng: Rng) -> Instance:
    """A thin rib on one side, as high as 1.2 % of the diagonal and less."""
    shape, point, normal = _place(made, 0.03, rng)
    long, high, wide = np.array([0.1, rng.uniform(0.006, 0.012), 0.006]) * shape.diagonal
    rib = block((0, 0, 0.5 * high), (long, wide, high))
    return _added(made, [rib.turned(frame_with_z(normal).T, point)])


def dent(made: Scanned, rng: Rng) -> Instance:
    """A dent on one side, 2.5 to 4 % of the diagonal deep."""
    shape, point, normal = _place(made, 0.03, rng)
    assert shape.faces is not None
    corners = fine(shape.points[shape.faces], EDGE_REL * shape.diagonal)
    depth, wide = rng.uniform(0.025, 0.04) * shape.diagonal, rng.uniform(0.02, 0.03) * shape.diagonal
    push = depth * np.exp(-0.5 * ((corners - point) ** 2).sum(axis=2) / wide**2)
    dented = mesh_of(corners - push[:, :, None] * normal)
    seen = push.mean(axis=1) > SEEN_REL * shape.diagonal
    area = areas(corners)
    return _with(made, dented, float(area[seen].sum() / area.sum()))


def missing(made: Scanned, rng: Rng) -> Instance:
    """Screws all over, but for one."""
    truth = Truth.of_parts(made.parts)
    screws: list[Part] = []
    for operation in truth.group.operations():
        image = made.screw.turned(operation, truth.center - operation @ truth.center)
        if all(np.abs(image.vertices.mean(axis=0) - s.vertices.mean(axis=0)).max() > 1e-6 for s in screws):
            screws.append(image)
    gone = int(rng.integers(len(screws)))
    shape = assembled([*made.parts, *screws[:gone], *screws[gone + 1 :]])
    return _with(made, shape, made.screw.area / sum(p.area for p in made.parts))


def shifted(made: Scanned, _rng: Rng) -> Instance:
    """One part 3 % of the diagonal out of place."""
    step = MISS_REL * assembled(made.parts).diagonal * unit(made.along)
    parts = [p.moved(step) if i == made.moving else p for i, p in enumerate(made.parts)]
    return _with(replace(made, parts=parts), assembled(parts), 0.0)


def _scan(base: Callable[[Rng], Scanned], way: Callable[[Scanned, Rng], Instance], rng: Rng) -> Instance:
    return way(base(rng), rng)


DEFECTS = (dent, flag, seam, missing)
BASES = (cabinet, bench, drone, housing, tripod, valve, rack)
# Every object with two of the four defects, and shifted.
SCANS: dict[str, Build] = {
    f"{base.__name__} {way.__name__}": partial(_scan, base, way)
    for number, base in enumerate(BASES)
    for way in (DEFECTS[number % 4], DEFECTS[(number + 1 + number // 4) % 4], shifted)
}
