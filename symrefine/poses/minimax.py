"""The operation for which the largest distance of a vertex is least.

`min over S of max over x of |a(x) - b(S x)|`, in space or in the image of a camera. Asked for a few vertices only, the
minimum is a lower bound; at the operation that it is reached by, the largest distance of all vertices is an upper
bound. The vertex that makes it joins the few, until both bounds meet: after a handful of rounds, each of which looks
at all vertices for one operation only.
"""

import numpy as np

from symrefine.geometry import Array, batches
from symrefine.poses.choices import Choices, image
from symrefine.poses.symmetry import Symmetry
from symrefine.rounding import DOUBLE


def least_largest(symmetry: Symmetry, a: Array, b: Array, vertices: Array, camera: Array | None = None) -> Array:
    """The least largest distances [...] of vertices [V, 3] in poses a and b [..., 4, 4], in space or in pixels."""
    shape, a, b = a.shape[:-2], a.reshape(-1, 4, 4), b.reshape(-1, 4, 4)
    choices = Choices(symmetry, camera)
    found = np.empty(len(a))
    for batch in batches(len(a), 12 * max(len(vertices), choices.count)):
        found[batch] = _bounded(choices, a[batch], symmetry.toward(b[batch], a[batch, :3, :3]), vertices)
    return found.reshape(shape)


def least_depth(poses: Array, vertices: Array) -> float:
    """The smallest depth of vertices [V, 3] in poses [..., 4, 4]; infinity without poses."""
    forward = poses[..., 2, :].reshape(-1, 4)
    rows = (forward[batch] for batch in batches(len(forward), len(vertices)))
    return min((float((r[:, :3] @ vertices.T + r[:, 3:]).min()) for r in rows), default=np.inf)


def _bounded(choices: Choices, a: Array, b: Array, vertices: Array) -> Array:
    """The same for a batch [n], the poses b being turned nearest to a already."""
    seen = image(a, vertices, choices.camera)
    rounding = DOUBLE * np.abs(seen).max(axis=(1, 2), initial=0.0)
    least = np.full(len(a), np.inf)
    few = np.empty((len(a), 0), dtype=np.intp)
    low: Array = np.zeros(len(a))
    chosen, left = b, np.arange(len(a))
    while len(left):
        misses = np.linalg.norm(seen[left] - image(chosen, vertices, choices.camera), axis=-1)
        worst, high = misses.argmax(axis=1), misses.max(axis=1)
        least[left] = np.minimum(least[left], high)
        unmet = (least[left] > low + rounding[left]) & ~(few == worst[:, None]).any(axis=1)
        left, few = left[unmet], np.concatenate([few, worst[:, None]], axis=1)[unmet]
        if not choices.count:
            break
        low, chosen = choices.best(a[left], b[left], vertices[few])
    return least
