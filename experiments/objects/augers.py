"""Screw conveyors: two to four flights around a shaft, alike, or one with a notch in its rim, or one that ends early.

A flight is a thin wall that ends at its rim all along. Where neighbourhoods are as wide as it is thick, its rim looks
like a border beyond which nobody looked, and so does a notch.
"""

from functools import partial

import numpy as np

from experiments.objects.instances import Build, Instance, of_parts
from experiments.objects.lathe import Rng
from experiments.objects.parts import Part, cylinder, lofted
from symrefine.geometry import Array

# The shaft, the rim, and half of the length of the flights; rings that one is swept from.
SHAFT, RIM, HALF = 0.15, 0.5, 1.0
RINGS = 160
FLIGHTS = (2, 3, 4)
THICK = {"thin": 0.06, "thick": 0.12}
STATES = ("whole", "notched", "short")


def flight(phase_rad: float, turns: float, thick: float, along: Array, rim: Array) -> Part:
    """One flight by the radius of its rim [K] at places [K] along it, from 0 to 1."""
    angle, height = phase_rad + 2.0 * np.pi * turns * (along - 0.5), 2.0 * HALF * (along - 0.5)
    corners = [(0.97 * SHAFT, -1), (rim, -1), (rim, 1), (0.97 * SHAFT, 1)]
    rings = [
        np.stack([r * np.cos(angle), r * np.sin(angle), height + 0.5 * side * thick], axis=1) for r, side in corners
    ]
    return lofted(np.stack(rings, axis=1))


def auger(flights: int, thick: float, state: str, rng: Rng) -> Instance:
    """A shaft with its flights: D_n, or C1 where the first is notched by a third of its width or more, or is short."""
    turns = rng.uniform(0.7, 1.5)
    deep, wide, end = rng.uniform(0.15, 0.25), rng.uniform(0.25, 0.35), rng.uniform(0.6, 0.8)
    every = np.linspace(0.0, 1.0, RINGS)
    along = end * every if state == "short" else every
    rim = np.where((np.abs(along - 0.3) < 0.5 * wide) & (state == "notched"), RIM - deep, RIM)
    first = flight(0.0, turns, thick, along, rim)
    others = [flight(2.0 * np.pi * k / flights, turns, thick, every, np.full(RINGS, RIM)) for k in range(1, flights)]
    name = f"D{flights}" if state == "whole" else "C1"
    return of_parts([cylinder(SHAFT, -1.15 * HALF, 1.15 * HALF), first, *others], name)


AUGERS: dict[str, Build] = {
    f"{thick}{flights} {state}": partial(auger, flights, THICK[thick], state)
    for flights in FLIGHTS
    for thick in THICK
    for state in STATES
}
