"""What noise alone shows: two halves of a cloud, each with local planes of its own, against one another."""

from collections.abc import Callable

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.misses import disc_distances
from symrefine.surface.skin import LocalPlanes

# Spacing in the halves of a volume over that of the whole.
HALVES_OF_VOLUME = 2.0 ** (1.0 / 3.0)
# Points of each half that are asked.
ASKED = 4000


def noise_distances(count: int, planes: Callable[[Index], LocalPlanes], rng: np.random.Generator) -> Array:
    """Distances [M] between the surfaces that two halves of a cloud make.

    An object with an exact symmetry differs from its image by no more: both are made of points of their own, closer to
    one another than those of halves. In a volume all is spacing, which is put right.

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
    return np.concatenate(across) / (HALVES_OF_VOLUME if one.body == "volume" else 1.0)
