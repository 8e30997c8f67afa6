"""Where a group may stand as well: the motions of its frame that pairs of local planes tell least of."""

import numpy as np

from symrefine.fit.matching import match
from symrefine.fit.refine import Framed, pair_gram
from symrefine.fit.residual import SIZE, design_rows, frame_model, gram
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array
from symrefine.surface.skin import LocalPlanes


def freest(cloud: LocalPlanes, state: Framed, *, turns: bool = True, stride: int = 1) -> Array:
    """Motions [p, 6] of a frame (rotation about and shift along its axes), the least told ones first.

    Those that change no operation are not among them, as a turn about the normal of a lone mirror; without `turns` no
    turn is. What the pairs of each changes is weighed against how far images move, which is 1 in the mean square over
    all operations.
    """
    first = 0 if turns else 3
    points = cloud.points[::stride]
    every, none, ones = np.ones(len(points)) / len(points), np.zeros_like(points), np.ones((len(points), 1))
    moves = sum((gram(design_rows(points, none, ones * axis), every) for axis in np.eye(3)), np.zeros((SIZE, SIZE)))
    grams = np.stack([pair_gram(cloud, p) for p in match(cloud, state.motions, 0.0, stride=stride)])
    told, moved = (
        frame_model(g, state.standard, state.frame, state.center, np.zeros(6)).hessian[first:, first:]
        for g in (grams, np.broadcast_to(moves / len(grams), grams.shape))
    )
    lengths, ways = np.linalg.eigh(moved)
    some = lengths > ROUNDED * lengths[-1]
    ways = ways[:, some] / np.sqrt(lengths[some])
    found = (ways @ np.linalg.eigh(ways.T @ told @ ways)[1]).T
    return np.pad(found, ((0, 0), (first, 0)))
