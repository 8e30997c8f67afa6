"""Maps of one surface onto another that local planes which look alike agree upon; see `propose.maps`."""

import numpy as np

from symrefine.geometry import Array
from symrefine.propose.maps import AROUND, PLANES, Proposal, agreed
from symrefine.propose.signatures import least_flat_first, signatures, square_distances
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes


def maps_between(source: LocalPlanes, target: LocalPlanes, diagonal: float) -> list[Proposal]:
    """Maps of either determinant from one surface onto another, best first; `diagonal` is that of the smaller one."""
    # Of a side with more local planes as many as elsewhere tell what surroundings look like.
    every = [max(1, round(len(cloud.points) / PLANES)) for cloud in (source, target)]
    sides = zip((source, target), every, strict=True)
    source_looks, target_looks = (signatures(cloud, AROUND * diagonal, k) for cloud, k in sides)
    classes = None if source.labels is None or target.labels is None else (source.labels, target.labels)
    return agreed(source, target, mutual_matches(source_looks, target_looks, classes), diagonal)


def mutual_matches(source: Array, target: Array, classes: tuple[Index, Index] | None = None) -> tuple[Index, Index]:
    """Indices of the signatures [N, F] and [M, F] that are each nearest to the other, of those of its class.

    Those come first that are least like a plane, which is like any other.
    """
    squares = square_distances(source, target)
    if classes is not None:
        squares[classes[0][:, None] != classes[1]] = np.inf
    nearest = squares.argmin(axis=1)
    least = squares[np.arange(len(source)), nearest]
    # The least of a column is that of its row too where both choose one another; numpy finds it faster than its place.
    mutual = np.flatnonzero((least == squares.min(axis=0)[nearest]) & np.isfinite(least))
    first = least_flat_first(source, mutual)
    return first, nearest[first]
