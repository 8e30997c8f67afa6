"""Points on bent rods: the curves of `curves` with a little thickness, and springs, some of which are bent aside.

Where points are sparse neighbourhoods are as wide as a rod is thick, so that planes along it lie one way or another by
chance, and only the ends of a spring tell where along its own screw its half turn stands.
"""

from functools import partial

import numpy as np

from experiments.objects.built_symmetry import Truth
from experiments.objects.curves import ABOUT_X, ABOUT_Z, CORNERS, DRAWN, Curve, helix
from experiments.objects.instances import Build, Instance
from experiments.objects.lathe import Rng
from symrefine.geometry import Array, unit
from symrefine.groups import PointGroup
from symrefine.shape import Shape

# Points of a sample.
POINTS = (800, 2000, 6000)
# Radius of a rod, over the length of the diagonal of the curve.
THICK = (0.015, 0.03)
# How far the end of a bent spring lies aside, likewise: four times the usual tolerance.
ASIDE = 0.08


def spring(t: Array, rng: Rng) -> Array:
    """C2 about x: a helix of some turns."""
    return helix((2.5, 6.0), (2.0, 4.0), t, rng)


def bent(t: Array, rng: Rng) -> Array:
    """C1: a spring of which the last sixth leans aside more and more."""
    path = spring(t, rng)
    size = float(np.linalg.norm(np.ptp(path, axis=0)))
    path[:, 0] += ASIDE * size * np.clip((t - 5.0 / 6.0) * 6.0, 0.0, None) ** 0.5
    return path


def along(shape: Curve, name: str, frame: Array, count: int, rng: Rng) -> Instance:
    """So many points on a rod at random places along a curve, any side out."""
    path = shape(np.linspace(0.0, 1.0, CORNERS + 1), rng)
    diagonal, steps = Shape(points=path).diagonal, np.diff(path, axis=0)
    radius, lengths = rng.uniform(*THICK) * diagonal, np.linalg.norm(steps, axis=1)
    which = rng.choice(CORNERS, count, p=lengths / lengths.sum())
    forward = steps[which]
    out = unit(np.cross(forward, rng.normal(size=(count, 3))))
    points = path[which] + rng.random((count, 1)) * forward + radius * out
    truth = Truth(group=PointGroup(name=name, frame=frame), center=np.zeros(3))
    return Instance(shape=Shape(points=points), truth=truth, diagonal=diagonal)


BENT: dict[str, tuple[Curve, str, Array]] = {
    **DRAWN,
    "spring": (spring, "C2", ABOUT_X),
    "spring bent": (bent, "C1", ABOUT_Z),
}
RODS: dict[str, Build] = {
    f"{name} {count}": partial(along, *of, count) for name, of in BENT.items() for count in POINTS
}
