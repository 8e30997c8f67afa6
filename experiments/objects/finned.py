"""Bodies with many thin parts side by side at one place: fins, pins, plates on a rod, a lattice.

To neighbourhoods that reach from one of them to the next they look as thick as a ball, like points that belong to
something else. Without them the body would have a larger group.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.instances import Build, Instance, as_built
from experiments.objects.lathe import Rng
from experiments.objects.parts import Part, block, cylinder

Place = tuple[float, float, float]


def disc(rng: Rng) -> tuple[Part, Place]:
    """A flat cylinder, and a place towards its rim."""
    high = rng.uniform(0.8, 1.4)
    return cylinder(5.0, -0.5 * high, 0.5 * high), (rng.uniform(2.8, 3.4), 0.0, 0.5 * high)


def plate(rng: Rng) -> tuple[Part, Place]:
    """A thin board, and a place in one corner."""
    high = rng.uniform(0.3, 0.6)
    return block((0, 0, 0), (10, 7, high)), (rng.uniform(2.6, 3.4), rng.uniform(1.2, 1.9), 0.5 * high)


def case(rng: Rng) -> tuple[Part, Place]:
    """A box, and a place at one end."""
    high = rng.uniform(2.5, 3.5)
    return block((0, 0, 0), (10, 6, high)), (rng.uniform(2.6, 3.6), 0.0, 0.5 * high)


def motor(rng: Rng) -> tuple[Part, Place]:
    """An upright cylinder, and a place beside the middle of its end."""
    high = rng.uniform(5.0, 7.0)
    return cylinder(3.0, -0.5 * high, 0.5 * high), (rng.uniform(1.0, 1.5), 0.0, 0.5 * high)


def fins(rng: Rng, at: Place) -> list[Part]:
    """Upright plates side by side."""
    count, high, (x, y, z) = int(rng.integers(6, 10)), rng.uniform(1.4, 2.2), at
    return [block((x + u, y, z + 0.5 * high), (0.12, 1.9, high)) for u in np.linspace(-0.95, 0.95, count)]


def pins(rng: Rng, at: Place) -> list[Part]:
    """Upright rods in a square, all of them thin."""
    count, high, (x, y, z) = int(rng.integers(5, 8)), rng.uniform(1.4, 2.0), at
    places = np.linspace(-0.85, 0.85, count)
    return [block((x + u, y + v, z + 0.5 * high), (0.14, 0.14, high)) for u in places for v in places]


def spool(rng: Rng, at: Place) -> list[Part]:
    """Thin discs above one another on a rod."""
    count, wide, (x, y, z) = int(rng.integers(6, 10)), rng.uniform(0.8, 1.1), at
    discs = [cylinder(wide, 0.2 * k + 0.1, 0.2 * k + 0.2) for k in range(count)]
    return [part.moved((x, y, z)) for part in (cylinder(0.3, 0.0, 0.2 * count), *discs)]


def lattice(rng: Rng, at: Place) -> list[Part]:
    """Thin rods along all three edges of a cube."""
    wide, (x, y, z) = rng.uniform(1.5, 2.0), at
    low, places = np.array([x, y, z + 0.5 * wide]), wide * np.linspace(-0.5, 0.5, 4)
    rods = []
    for along in range(3):
        size = np.full(3, 0.12)
        size[along] = wide
        rods += [block(low + np.insert([u, v], along, 0.0), size) for u in places for v in places]
    return rods


def finned(make: Callable[[Rng], tuple[Part, Place]], dense: Callable[[Rng, Place], list[Part]], rng: Rng) -> Instance:
    """A body with thin parts at its place."""
    body, at = make(rng)
    return as_built([body, *dense(rng, at)])


FINNED: dict[str, Build] = {
    f"{make.__name__} {dense.__name__}": partial(finned, make, dense)
    for make in (disc, plate, case, motor)
    for dense in (fins, pins, spool, lattice)
}
