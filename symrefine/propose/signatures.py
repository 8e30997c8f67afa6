"""What the surroundings of a local plane look like from it, whichever way they are turned or mirrored.

The histograms of FPFH (Rusu, Blodow, Beetz, 2009) in small, without what a reflection or the sign of a normal changes:
of the neighbours, by how far away they are, how high they stand over the plane, how much their normals turn away from
its own, and how far these lean towards it. "High" is the side to which the surface bends.
"""

import numpy as np

from symrefine.geometry import Array, column_dots
from symrefine.shape import Index
from symrefine.surface.skin import Planes
from symrefine.surface.tree import pairs_within

# Shells of about equal area that neighbours are told apart by, and bins of each histogram.
SHELLS, BINS = 3, 6


def signatures(cloud: Planes, radius: float, every: int = 1) -> Array:
    """Histograms [M, SHELLS * 3 * BINS] of the neighbours within a radius of each local plane.

    One in `every` so many of the local planes counts as a neighbour.
    """
    count, points, normals = len(cloud.points), cloud.points.T.copy(), cloud.normals.T.copy()
    one, other = pairs_within(cloud.points, radius).T.copy()
    told = np.arange(count) % every == 0
    if every > 1:
        either = np.flatnonzero(told[one] | told[other])
        one, other = one[either], other[either]
    toward = points.take(other, axis=1) - points.take(one, axis=1)
    near, far = normals.take(one, axis=1), normals.take(other, axis=1)
    squares = column_dots(toward, toward)
    # Of either end: how high the other stands over its plane.
    ends = np.concatenate([column_dots(toward, near), -column_dots(toward, far)])
    slopes = ends / np.tile(np.maximum(np.sqrt(squares), 1e-300), 2)
    shell = np.tile(np.minimum(squares * (SHELLS / radius**2), SHELLS - 1).astype(np.int64), 2)
    owner, leaning, turned = np.concatenate([one, other]), np.roll(slopes, len(one)), np.tile(column_dots(near, far), 2)
    if every > 1:
        some = np.flatnonzero(told[np.concatenate([other, one])])
        owner, ends, slopes, leaning, turned, shell = (v[some] for v in (owner, ends, slopes, leaning, turned, shell))
    bent = np.where(np.bincount(owner, ends, count) < 0.0, -1.0, 1.0)
    height = 0.5 + 0.5 * bent.take(owner) * slopes
    shell += owner * SHELLS
    found = np.stack([_histograms(shell, v, count * SHELLS) for v in (height, np.abs(turned), np.abs(leaning))], axis=1)
    found /= np.maximum(np.bincount(shell, minlength=count * SHELLS), 1)[:, None, None]
    return np.asarray(found.reshape(count, -1))


def _histograms(owner: Index, values: Array, count: int) -> Array:
    """How many [count, BINS] of the values [K] in 0 .. 1 each owner [K] has in each bin.

    A value counts in the two bins that it lies between.
    """
    place = values * (BINS - 1)
    low = np.minimum(place.astype(np.int64), BINS - 2)
    place -= low
    low += owner * BINS
    here, next_ = np.bincount(low, minlength=count * BINS), np.bincount(low, place, count * BINS)
    found = np.asarray(here - next_, dtype=np.float64).reshape(count, BINS)
    found[:, 1:] += next_.reshape(count, BINS)[:, :-1]
    return found


def own_matches(looks: Array, points: Array, apart: float, classes: Index | None = None) -> tuple[Index, Index]:
    """Indices of the signatures [N, F], and of those nearest to each that stand farther from it than `apart`.

    Of points [N, 3] of some classes [N]; those come first that are least like a plane.
    """
    squares = square_distances(looks, looks)
    middle = points - points.mean(axis=0)
    squares[square_distances(middle, middle) < apart**2] = np.inf
    if classes is not None:
        squares[classes[:, None] != classes] = np.inf
    nearest = squares.argmin(axis=1)
    matched = np.flatnonzero(np.isfinite(squares[np.arange(len(looks)), nearest]))
    first = least_flat_first(looks, matched)
    return first, nearest[first]


def square_distances(one: Array, other: Array) -> "np.ndarray[tuple[int, int], np.dtype[np.float32]]":
    """|a - b|^2 [N, M] of rows [N, F] and [M, F] as one product, in single precision, which is fine enough."""
    a, b = one.astype(np.float32), other.astype(np.float32)
    a_squares, b_squares = ((v * v).sum(axis=1, keepdims=True) for v in (a, b))
    a_ones, b_ones = (np.ones_like(v) for v in (a_squares, b_squares))
    return np.hstack([a, a_squares, a_ones]) @ np.hstack([-2.0 * b, b_ones, b_squares]).T


def least_flat_first(looks: Array, some: Index) -> Index:
    """Some of the signatures [N, F], those first whose neighbours' normals turn away from their own most."""
    turned = looks.reshape(len(looks), SHELLS, 3, BINS)[some, :, 1, -1].mean(axis=1)
    return some[np.argsort(turned, kind="stable")]
