"""What noise alone shows: two halves of a cloud, each with local planes of its own, against one another."""

from collections.abc import Callable

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.misses import disc_distances
from symrefine.surface.skin import LocalPlanes

# Of halves over the whole: noise of local planes is the same in both, but halves stand sqrt(2) times as far apart, and
# what is made of spacing grows with it; the geometric mean of the two.
HALVES = 2.0**0.25


def noise_distances(
    points: Array, labels: Index | None, planes: Callable[[Array, Index | None], LocalPlanes], rng: np.random.Generator
) -> Array:
    """Distances [M] between the surfaces that two halves of a cloud [N, 3] make, scaled to that of the whole.

    An object with an exact symmetry differs from its image by as much: both are made of points of their own.

    Args:
        labels: [N] classes, or None.
        planes: what makes a surface of points and classes.
    """
    order = rng.permutation(len(points))
    one, other = (
        planes(points[half], None if labels is None else labels[half])
        for half in (np.sort(order[::2]), np.sort(order[1::2]))
    )
    across = [disc_distances(a, b.points, b.labels) for a, b in ((one, other), (other, one))]
    return np.concatenate(across) / HALVES
