"""Objects that nobody designed: a few random parts with all their images under a group, around a core or around none.

Nothing was ever chosen on them, and parts that are many and small, that meet and run through each other, are what
designed objects lack. Which symmetry one has its marks tell: a part may lie in a mirror by chance.
"""

import numpy as np

from experiments.objects.parts import Part, ball, block, cylinder, orbit, rod
from symrefine.geometry import random_orthogonal
from symrefine.groups import point_group

GROUPS = (
    "C1 Cs Ci C2 C3 C4 C5 C6 C2v C3v C4v C5v C6v C8v C2h C3h C4h C6h D2 D3 D4 D6 D2h D3h D4h D5h D6h D2d D3d D4d "
    "S4 S6 T Td Th O Oh I Ih"
).split()
POLYHEDRAL = ("T", "Td", "Th", "O", "Oh", "I", "Ih")


def names(seed: int) -> list[str]:
    """The tangles of a seed, one of each group."""
    return [f"{group}-{seed}" for group in GROUPS]


def parts(name: str) -> list[Part]:
    """The parts of one."""
    group, seed = name.rsplit("-", 1)
    rng = np.random.default_rng([int(seed), GROUPS.index(group)])
    order = len(point_group(group).operations())
    # One part of a small group would have more symmetry than that.
    count = int(rng.integers(1, 4) if order > 3 else rng.integers(2, 5))
    made = [_core(group, rng)] if rng.random() < 0.75 else []
    for _ in range(count):
        size = rng.uniform(0.5, 1.8) / (1.0 + 0.12 * min(order, 24) ** 0.8)
        own, away = _random(rng, size), rng.normal(size=3)
        place = away * rng.uniform(0.7, 1.2) / np.linalg.norm(away)
        made += orbit(own.turned(random_orthogonal(rng, det=1), place), group)
    return made


def _core(group: str, rng: np.random.Generator) -> Part:
    """What all symmetries of a group leave as it is."""
    if group in POLYHEDRAL or rng.random() < 1.0 / 3.0:
        return ball(0.5)
    return cylinder(0.3, -0.4, 0.4)


def _random(rng: np.random.Generator, size: float) -> Part:
    a, b, c = size * rng.uniform(0.5, 1.5, 3)
    kind = int(rng.integers(4))
    if kind == 0:
        return block((0, 0, 0), (a, b, c))
    if kind == 1:
        return rod((0, 0, -0.7 * a), (0, 0, 0.7 * a), 0.4 * b)
    if kind == 2:
        return rod((0, 0, -0.6 * a), (0, 0, 0.6 * a), 0.5 * b, 0.0)
    return ball(0.5 * a)
