"""Thin-walled open vessels, with handles at the rim: where a rim ends nothing is missing, whatever adjoins it.

To a sample a wall of a hundredth of the diagonal is one sheet, its rim an open border like that of a hole.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.objects.instances import Build, Instance, of_parts
from experiments.objects.lathe import Profile, Rng
from experiments.objects.parts import Part, block, spun
from symrefine.geometry import rotation

SEGMENTS = 120


def pan(rng: Rng) -> Profile:
    """Flat and flared."""
    foot, height = rng.uniform(0.42, 0.5), rng.uniform(0.2, 0.35)
    return [(0, 0), (foot, 0), (0.6, height)]


def bowl(rng: Rng) -> Profile:
    """Part of a ball, up to half of it."""
    t = np.linspace(0.0, rng.uniform(0.8, 1.5), 14)
    return [(0.6 * float(np.sin(a)), 0.6 * float(1.0 - np.cos(a))) for a in t]


def bucket(rng: Rng) -> Profile:
    """Deep, and hardly wider above."""
    foot, height = rng.uniform(0.3, 0.4), rng.uniform(0.6, 0.9)
    return [(0, 0), (foot, 0), (0.45, height)]


def funnel(rng: Rng) -> Profile:
    """Open at both ends."""
    spout, neck = rng.uniform(0.06, 0.1), rng.uniform(0.2, 0.35)
    return [(0.8 * spout, 0), (spout, neck), (0.5, neck + rng.uniform(0.3, 0.5))]


def walled(profile: Profile, wall: float) -> Part:
    """A vessel from its outside, upwards: the inside lies a wall nearer to the axis, and to the rim."""
    outer = np.array(profile, dtype=float)
    along = np.gradient(outer, axis=0)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    inner = outer + wall * inwards
    inner[outer[:, 0] == 0.0, 0] = 0.0
    ends = [outer[0]] if outer[0, 0] > 0.0 else []
    return spun([*outer, *inner[::-1], *ends], SEGMENTS)


def _grip(profile: Profile, size: tuple[float, float, float], azimuth_deg: float) -> Part:
    """A block outwards from the rim."""
    radius, height = profile[-1]
    grip = block((radius - 0.02 + 0.5 * size[0], 0, height - 0.5 * size[2]), size)
    return grip.turned(rotation([0, 0, 1], np.radians(azimuth_deg)))


# By what is at the rim: the azimuth of each grip with its length over that of a handle, and the group.
RIMS: dict[str, tuple[tuple[tuple[float, float], ...], str]] = {
    "plain": ((), "Cinfv"),
    "handle": (((0, 1),), "Cs"),
    "ears": (((0, 0.5), (180, 0.5)), "C2v"),
    "three": (((0, 0.5), (120, 0.5), (240, 0.5)), "C3v"),
    "pair": (((55, 0.7), (-55, 0.7)), "Cs"),
    "odd": (((0, 1), (110, 0.5)), "C1"),
}


def vessel(profile: Callable[[Rng], Profile], rim: str, rng: Rng) -> Instance:
    """A vessel with so many handles at its rim."""
    outline, (grips, group) = profile(rng), RIMS[rim]
    wall, length, width = rng.uniform(0.015, 0.035), rng.uniform(0.5, 0.8), rng.uniform(0.1, 0.2)
    parts = [_grip(outline, (share * length, width, 0.06), azimuth) for azimuth, share in grips]
    return of_parts([walled(outline, wall), *parts], group)


VESSELS: dict[str, Build] = {
    f"{body.__name__} {rim}": partial(vessel, body, rim) for body in (pan, bowl, bucket, funnel) for rim in RIMS
}
