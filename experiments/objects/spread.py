"""Balls with many like details spread evenly over them, as spines are on an urchin and seeds in a head of flowers.

The details stand on one to five spirals at the golden angle, so that a few half turns carry them onto one another and
nothing else does: to moments, which are coarser than they are, it is a ball. Where they stand closer on one side than
on the other (`lopsided`) the half turns are none.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.instances import Build, Instance, as_built
from experiments.objects.lathe import Rng
from experiments.objects.parts import Part, ball, cylinder
from symrefine.geometry import Array, frame_with_z
from symrefine.groups.standard import GOLDEN

RADIUS = 3.0
# How many details each of so many spirals has: at least, and fewer than.
DETAILS = {1: (47, 70), 2: (25, 36), 3: (18, 26), 5: (11, 16)}
ANGLE = 2.0 * math.pi * (2.0 - GOLDEN)


def directions(spirals: int, each: int, lopsided: float) -> Array:
    """Unit directions [spirals * each, 3]; D_n or C2 but for what is lopsided, which is C_n or C1."""
    index = np.arange(each) + 0.5
    z = 1.0 - 2.0 * index / each
    z = z + lopsided * (1.0 - z * z)
    azimuth = np.add.outer(2.0 * math.pi * np.arange(spirals), ANGLE * index).ravel() / spirals
    z = np.tile(z, spirals)
    return np.stack([np.sqrt(1.0 - z * z) * np.cos(azimuth), np.sqrt(1.0 - z * z) * np.sin(azimuth), z], axis=1)


def spined(rng: Rng, room: float) -> Part:
    """A thin rod that stands up."""
    return cylinder(room * rng.uniform(0.3, 0.4), RADIUS - 0.2, RADIUS + rng.uniform(0.9, 1.5))


def knobbed(rng: Rng, room: float) -> Part:
    """Half a ball."""
    return ball(room * rng.uniform(0.65, 0.75)).moved((0.0, 0.0, RADIUS))


def studded(rng: Rng, room: float) -> Part:
    """A wide and low cylinder."""
    return cylinder(room * rng.uniform(0.55, 0.65), RADIUS - 0.2, RADIUS + rng.uniform(0.5, 0.7))


def spread(detail: Callable[[Rng, float], Part], spirals: int, lopsided: float, rng: Rng) -> Instance:
    """A ball with a detail in many places."""
    each = int(rng.integers(*DETAILS[spirals]))
    room = RADIUS * math.sqrt(math.pi / (spirals * each))  # half of what is between two of them
    one = detail(rng, room)
    places = directions(spirals, each, lopsided)
    return as_built([ball(RADIUS), *(one.turned(frame_with_z(u).T) for u in places)])


SPREAD: dict[str, Build] = {
    f"{detail.__name__}{spirals}{word}": partial(spread, detail, spirals, lopsided)
    for detail in (spined, knobbed, studded)
    for spirals in DETAILS
    for word, lopsided in (("", 0.0), (" lopsided", 0.2))
}
