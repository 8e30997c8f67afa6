"""Where a group may stand as well: the motions of its frame that pairs of local planes tell least of."""

import numpy as np

from symrefine.fit.matching import match
from symrefine.fit.refine import Framed, pair_gram
from symrefine.fit.residual import SIZE, frame_model
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array
from symrefine.surface.skin import LocalPlanes


def freest(cloud: LocalPlanes, state: Framed, *, stride: int = 1) -> Array:
    """Motions [p, 6] of a frame (rotation about and shift along its axes, of length 1), the least told ones first.

    Those that change no operation are not among them, as a turn about the normal of a lone mirror. What the pairs of
    each changes is weighed against how far the operations change, as the entries of their matrices and shifts do.
    """
    grams = np.stack([pair_gram(cloud, p) for p in match(cloud, state.motions, 0.0, stride=stride)])
    told, changed = (
        frame_model(g, state.standard, state.frame, state.center, np.zeros(6)).hessian
        for g in (grams, np.broadcast_to(np.eye(SIZE), grams.shape))
    )
    lengths, ways = np.linalg.eigh(changed)
    moves = lengths > ROUNDED * lengths[-1]
    ways = ways[:, moves] / np.sqrt(lengths[moves])
    found = (ways @ np.linalg.eigh(ways.T @ told @ ways)[1]).T
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])
