"""What noise alone shows: two halves of a cloud, each with local planes of its own, against one another."""

from collections.abc import Callable

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.misses import disc_distances
from symrefine.surface.skin import LocalPlanes

# Of halves over the whole: noise of local planes is the same in both, but halves stand sqrt(2) times as far apart, and
# what is made of spacing grows with it; the geometric mean of the two. In a volume all is spacing.
HALVES, HALVES_OF_VOLUME = 2.0**0.25, 2.0 ** (1.0 / 3.0)
# Points of each half that are asked.
ASKED = 4000


def noise_distances(count: int, planes: Callable[[Index], LocalPlanes], rng: np.random.Generator) -> Array:
    """Distances [M] between the surfaces that two halves of a cloud make, scaled to that of the whole.

    An object with an exact symmetry differs from its image by as much: both are made of points of their own.

    Args:
        count: points of the cloud.
        planes: the surface that some of them make, given their indices.
    """
    order = rng.permutation(count)
    one, other = (planes(np.sort(order[k::2])) for k in (0, 1))
    across = []
    for here, there in ((one, other), (other, one)):
        some = slice(None, None, max(1, len(there.points) // ASKED))
        across.append(disc_distances(here, there.points[some], there.classes(some)))
    return np.concatenate(across) / (HALVES_OF_VOLUME if one.body == "volume" else HALVES)
