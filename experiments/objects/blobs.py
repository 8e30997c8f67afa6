"""Objects without any symmetry: dented balls, heaps of boxes, bent rods."""

from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects.instances import Build, Instance, of_parts
from experiments.objects.parts import Part, block, hull, lofted
from experiments.objects.shapes import sample
from symrefine.geometry import Array, cross_matrix, householder, random_orthogonal, unit
from symrefine.shape import Shape

Rng = np.random.Generator
VERTICES, BUMPS = 1600, 9
# A blob is one that the best of so many mirrors and half turns misses by so much of the diagonal, asked of some of so
# many points of its surface.
APART_REL, AXES, PLACES, ASKED = 0.03, 300, 6000, 200


def blob(rng: Rng) -> Instance:
    """A ball with smooth bumps and hollows, longer one way than another: the first that no operation nearly fits."""
    while True:
        made = _bumpy(rng)
        if nearest_miss(made.shape) > APART_REL * made.diagonal:
            return made


def nearest_miss(shape: Shape) -> float:
    """95th percentile of the miss of a surface, the least of mirrors and half turns all around."""
    points = sample(shape, PLACES, 0.0, np.random.default_rng(0))
    points = points - points.mean(axis=0)
    tree = cKDTree(points)
    images = (sign * householder(n) for n in _around(AXES) for sign in (1.0, -1.0))
    return min(float(np.quantile(tree.query(points[:ASKED] @ g.T)[0], 0.95)) for g in images)


def _around(count: int) -> Array:
    """Directions [count, 3] that cover the sphere evenly."""
    index = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * index / count, np.pi * (1.0 + np.sqrt(5.0)) * index
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)


def _bumpy(rng: Rng) -> Instance:
    directions = _around(VERTICES)
    bumps = unit(rng.normal(size=(BUMPS, 3)))
    widths, heights = rng.uniform(0.4, 0.8, BUMPS), rng.uniform(0.6, 1.2, BUMPS) * rng.choice([-1.0, 1.0], BUMPS)
    radius = np.exp((heights * np.exp((directions @ bumps.T - 1.0) / widths**2)).sum(axis=1))
    ball = hull(directions)
    stretched = radius[:, None] * directions * rng.uniform(0.6, 1.4, 3)
    shape = Shape(points=stretched, faces=ball.faces, measure="surface")
    truth = of_parts([ball], "C1").truth
    return Instance(shape=shape, truth=truth, diagonal=shape.diagonal)


def heap(boxes: int, rng: Rng) -> Instance:
    """Boxes of different sizes, each turned at random, one leaning on the next."""
    parts: list[Part] = []
    place = np.zeros(3)
    for _ in range(boxes):
        parts.append(block((0, 0, 0), rng.uniform(0.2, 1.0, 3)).turned(random_orthogonal(rng), place))
        place = place + rng.uniform(0.3, 0.6) * unit(rng.normal(size=3))
    return of_parts(parts, "C1")


def bent(rods: int, rng: Rng) -> Instance:
    """Rods bent in space, thinner at one end, all from one place."""
    return of_parts([_rod(rng) for _ in range(rods)], "C1")


def _rod(rng: Rng) -> Part:
    """A rod along a cubic Bezier curve with steps in all three directions, its sections carried along untwisted."""
    steps = (random_orthogonal(rng) + rng.normal(scale=0.15, size=(3, 3))) * rng.uniform(0.6, 1.0, (3, 1))
    controls = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    t = np.linspace(0.0, 1.0, 25)[:, None]
    weights = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    path = weights @ controls
    ahead = unit(np.gradient(path, axis=0))
    thick = np.linspace(rng.uniform(0.1, 0.2), rng.uniform(0.04, 0.1), len(t))
    side = unit(np.cross(ahead[0], unit(rng.normal(size=3))))
    angle = 2 * np.pi * np.arange(16) / 16
    rings: list[Array] = []
    for point, along, radius in zip(path, ahead, thick, strict=True):
        side = unit(side - (side @ along) * along)
        up = cross_matrix(along) @ side
        rings.append(point + radius * (np.outer(np.cos(angle), side) + np.outer(np.sin(angle), up)))
    return lofted(np.array(rings))


BLOBS: dict[str, Build] = {
    **{f"blob{n}": blob for n in range(8)},
    **{f"heap{n}": partial(heap, n) for n in range(3, 9)},
    **{f"bent{n}": partial(bent, n) for n in range(1, 5)},
}
