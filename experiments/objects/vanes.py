"""Thin blades, fins and walls around something, all alike or one of them shorter than the others.

They are about as thick as the neighbourhoods of a sample, so that where one ends looks like a border beyond which
nobody looked, and the others tell what might have been there.
"""

from collections.abc import Callable
from functools import partial

from experiments.objects.instances import Build, Instance, as_built
from experiments.objects.lathe import Rng
from experiments.objects.parts import Part, block, cylinder, hull, ring_of, spun
from symrefine.geometry import rotation

# What they stand around, and one of them by how long it is of the full length.
Vanes = tuple[list[Part], Callable[[float], Part], int]


def propeller(rng: Rng) -> Vanes:
    """Three pitched blades on a hub."""
    pitch, wide = rotation([1, 0, 0], rng.uniform(0.4, 0.9)), rng.uniform(0.25, 0.35)
    return [cylinder(0.2, -0.2, 0.2)], lambda n: block((0.5 * n + 0.15, 0, 0), (n, wide, 0.035)).turned(pitch), 3


def radiator(rng: Rng) -> Vanes:
    """Eight fins along a tube."""
    long = rng.uniform(1.5, 2.2)
    return [cylinder(0.3, -0.5 * long, 0.5 * long)], lambda n: block((0.28 + 0.25 * n, 0, 0), (0.5 * n, 0.04, long)), 8


def rocket(rng: Rng) -> Vanes:
    """A body with a nose and four swept fins."""
    reach = rng.uniform(0.4, 0.6)
    body = spun([(0, -1.1), (0.22, -1.1), (0.25, 0.6), (0.15, 1.1), (0, 1.35)])

    def fin(n: float) -> Part:
        outline = [(0.2, -1.0), (0.2 + reach * n, -1.0 - 0.2 * n), (0.2 + reach * n, -0.4 - 0.5 * n), (0.2, -0.4)]
        return hull([(x, y, z) for x, z in outline for y in (-0.02, 0.02)])

    return [body], fin, 4


def tray(rng: Rng) -> Vanes:
    """A square board with a wall along each side."""
    high = rng.uniform(0.4, 0.7)
    board = block((0, 0, 0), (2, 2, 0.04))
    return [board], lambda n: block((1, 0, 0.5 * high * n), (0.04, 2, high * n)), 4


def paddles(rng: Rng) -> Vanes:
    """A wheel with six paddles between two thin discs."""
    wide = rng.uniform(0.4, 0.6)
    discs = [cylinder(0.5, z - 0.015, z + 0.015) for z in (-0.5 * wide, 0.5 * wide)]
    return discs, lambda n: block((0.3 + 0.35 * n, 0, 0), (0.7 * n, 0.03, wide)), 6


def mill(rng: Rng) -> Vanes:
    """A tower with four sails before it, each in the plane that they turn in."""
    long = rng.uniform(0.8, 1.1)
    return [cylinder(0.2, -1.3, -0.1)], lambda n: block((0.12 + 0.5 * long * n, 0.1, 0), (long * n, 0.3, 0.03)), 4


def turnstile(rng: Rng) -> Vanes:
    """Three boards around a post."""
    high = rng.uniform(1.0, 1.4)
    return [cylinder(0.1, -0.8, 0.8)], lambda n: block((0.05 + 0.4 * n, 0, 0), (0.8 * n, 0.03, high)), 3


def crown(rng: Rng) -> Vanes:
    """Five boards that stand around a disc."""
    wide, high = rng.uniform(0.3, 0.45), rng.uniform(0.7, 0.9)
    return [cylinder(0.7, -0.05, 0.0)], lambda n: block((0.6, 0, 0.5 * high * n), (0.03, wide, high * n)), 5


def vane(make: Callable[[Rng], Vanes], state: str, rng: Rng) -> Instance:
    """Vanes around something, the first one shorter by a fifth to two thirds if it is so."""
    body, one, count = make(rng)
    length = rng.uniform(1 / 3, 0.8) if state == "short" else 1.0
    return as_built([*body, one(length), *ring_of(one(1.0), count)[1:]])


VANES: dict[str, Build] = {
    f"{make.__name__} {state}": partial(vane, make, state)
    for make in (propeller, radiator, rocket, tray, paddles, mill, turnstile, crown)
    for state in ("whole", "short")
}
