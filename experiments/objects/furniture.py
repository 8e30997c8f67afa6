"""Furniture of boards and rods as thin as the neighbourhoods of a sample: whole, one part out of place, or one lacking.

Such parts are one sheet or one line to a sample: open borders run all along them, where nothing is missing.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.instances import Build, Instance, as_built
from experiments.objects.lathe import Rng
from experiments.objects.parts import Part, ball, block, ring_of, rod, spun
from symrefine.geometry import rotation

# What stays, and what is repeated: of these the first is out of place, or lacks.
Parts = tuple[list[Part], list[Part]]


def lamp(rng: Rng) -> Parts:
    """A shade on a rod with three legs."""
    wide, high, reach = rng.uniform(0.25, 0.35), rng.uniform(1.2, 1.4), rng.uniform(0.35, 0.45)
    shades = [spun([(wide - w, high), (0.5 * wide - w, high + 0.35)]) for w in (0.0, 0.01)]
    stand = rod((0, 0, 0.6), (0, 0, high + 0.1), 0.02)
    return [*shades, stand, ball(0.07, (0, 0, high + 0.1))], ring_of(rod((0, 0, 0.75), (reach, 0, 0), 0.02), 3)


def desk(rng: Rng) -> Parts:
    """A board on four legs, one behind, and drawers on either side."""
    long, deep = rng.uniform(1.3, 1.6), rng.uniform(0.6, 0.75)
    legs = [block((x, y, 0.36), (0.05, 0.05, 0.72)) for y in _apart(long - 0.1) for x in _apart(deep - 0.1)]
    boards = [block((0, 0, 0.73), (deep, long, 0.04)), block((0.45 * deep, 0, 0.5), (0.02, long - 0.1, 0.4))]
    drawers = [block((0, y, 0.47), (0.8 * deep, 0.4, 0.5)) for y in _apart(0.57 * long)]
    return [*legs, *boards], drawers


def picnic(rng: Rng) -> Parts:
    """Five boards and two seats on two trestles."""
    long, low = rng.uniform(1.6, 2.0), rng.uniform(0.4, 0.48)
    top = [block((0, y, 0.75), (long, 0.15, 0.04)) for y in np.linspace(-0.35, 0.35, 5)]
    rails = [block((x, 0, low - 0.03), (0.05, 1.5, 0.1)) for x in _apart(0.65 * long)]
    legs = [rod((x, s * 0.25, 0.73), (x, s * 0.6, 0), 0.04) for x in _apart(0.65 * long) for s in (1, -1)]
    return [*top, *rails, *legs], [block((0, y, low), (long, 0.28, 0.04)) for y in _apart(1.5)]


def bed(rng: Rng) -> Parts:
    """A mattress between two boards, on four posts, with two pillows."""
    long, wide = rng.uniform(1.9, 2.1), rng.uniform(1.4, 1.6)
    boards = [block((0.5 * long, 0, 0.3), (0.06, wide, 0.6)), block((-0.5 * long, 0, 0.5), (0.06, wide, 1.0))]
    posts = [block((x, y, 0.1), (0.1, 0.1, 0.25)) for x in _apart(0.9 * long) for y in _apart(0.9 * wide)]
    pillows = [block((-0.37 * long, y, 0.62), (0.4, 0.6, 0.25)) for y in _apart(0.5 * wide)]
    return [block((0, 0, 0.35), (long - 0.05, wide - 0.1, 0.3)), *boards, *posts], pillows


def shelf(rng: Rng) -> Parts:
    """Four blades around a post, on each a board."""
    long, high = rng.uniform(0.35, 0.45), rng.uniform(1.2, 1.5)
    blade = block((0.5 * long, 0.1, 0.5 * high), (long, 0.03, high))
    board = block((0.5 * long, 0.2, rng.uniform(0.4, 0.6) * high), (long, 0.2, 0.03))
    return [block((0, 0, 0.5 * high), (0.08, 0.08, high)), *ring_of(blade, 4)], ring_of(board, 4)


def stool(rng: Rng) -> Parts:
    """A thin seat on six legs with rungs between them."""
    radius, high = rng.uniform(0.25, 0.3), rng.uniform(0.6, 0.8)
    seat = spun([(0, high), (radius, high), (radius, high + 0.02), (0, high + 0.02)])
    rung = rod((radius, 0, 0.3 * high), radius * np.array([0.5, np.sqrt(0.75), 0]) + (0, 0, 0.3 * high), 0.01)
    return [seat, *ring_of(rung, 6)], ring_of(rod((radius, 0, 0), (0.8 * radius, 0, high), 0.018), 6)


def hatstand(rng: Rng) -> Parts:
    """A post with five feet and, above, five hooks."""
    reach = rng.uniform(0.25, 0.35)
    hooks = ring_of(rod((0, 0, 1.6), (0.2, 0, 1.75), 0.015), 5)
    return [rod((0, 0, 0.2), (0, 0, 1.8), 0.02), *hooks], ring_of(rod((0, 0, 0.3), (reach, 0, 0), 0.02), 5)


def trestle(rng: Rng) -> Parts:
    """A beam on four legs."""
    long, apart = rng.uniform(1.0, 1.3), rng.uniform(0.5, 0.7)
    beam = block((0, 0, 0.8), (long, 0.1, 0.1))
    feet = [(x, y, 0.0) for x in _apart(0.9 * long) for y in _apart(apart)]
    return [beam], [rod((0.85 * x, 0.1 * y, 0.8), (x, y, z), 0.03) for x, y, z in feet]


def furnished(make: Callable[[Rng], Parts], state: str, rng: Rng) -> Instance:
    """A piece of furniture; if it is broken, one part stands turned about the middle and is moved as well."""
    body, (first, *others) = make(rng)
    turn = rotation([0, 0, 1], rng.uniform(0.45, 0.6))
    own = {"whole": [first], "broken": [first.turned(turn, (0.0, 0.0, 0.05))], "lacking": []}[state]
    return as_built([*body, *own, *others])


def _apart(distance: float) -> tuple[float, float]:
    return (0.5 * distance, -0.5 * distance)


FURNITURE: dict[str, Build] = {
    f"{make.__name__} {state}": partial(furnished, make, state)
    for make in (lamp, desk, picnic, bed, shelf, stool, hatstand, trestle)
    for state in ("whole", "broken", "lacking")
}
