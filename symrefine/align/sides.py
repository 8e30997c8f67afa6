"""What is known of the sides of an alignment, each alone and together: moments, the span of the points, sizes."""

import numpy as np

from symrefine.align.alignment import OK
from symrefine.align.moment_fit import ROUNDING
from symrefine.align.pair import Side, shares
from symrefine.decide.doubts import FLAT
from symrefine.detection.measure import class_moments
from symrefine.geometry import Array
from symrefine.moments.moments import Moments, central_moments, deviations, tensor_index
from symrefine.moments.quadrature import mesh_nodes
from symrefine.shape import Shape

# Highest order of the moments in so many dimensions: some 100 to 500 moments, of n^order components.
ORDERS = {1: 8, 2: 8, 3: 8, 4: 5, 5: 5, 6: 5, 7: 3, 8: 3, 9: 3, 10: 3}
# Radii that differ by more than this factor are no matter of sampling.
RADII = 1.2


def side_of(shape: Shape, parts: int) -> Side:
    """A side with its moments, and replicates of them that leave out one of so many parts.

    Each class of its labels has a density of its own.
    """
    return Side(
        shape=shape,
        moments=class_moments(shape, shape.labels, parts, ORDERS[shape.dim]),
        weights=shares(shape, np.ones(len(shape.points)) if shape.weights is None else shape.weights),
    )


def rank_of(moments: Moments) -> int:
    """Dimension of the subspace that the points spread in."""
    return int((np.linalg.eigvalsh(moments.covariance) > FLAT).sum())


def differ_in_size(source: Side, target: Side) -> bool:
    """Whether the sizes differ by more than sampling explains."""
    return not 1.0 / RADII < target.moments.scale / source.moments.scale < RADII


def size_sigma(*sides: Side) -> float:
    """Standard deviation of the ratio of two sizes, relative to it, from the jackknife of their mean squares."""
    variance = 0.0
    for m in (s.moments for s in sides):
        squares = m.replicates[:, tensor_index(m.dim, 2, m.order).diagonal()].sum(axis=1)
        variance += 0.25 * float((deviations(squares) ** 2).sum())
    return float(np.sqrt(variance))


def same_size(source: Side, target: Side) -> bool:
    """Whether the sizes agree to rounding."""
    return abs(target.moments.scale / source.moments.scale - 1.0) < ROUNDING


def told_sizes(source: Side, target: Side) -> str:
    """The status where sizes agree, or by how much they differ."""
    if not differ_in_size(source, target):
        return OK
    ratio = target.moments.scale / source.moments.scale
    return f"the target is {ratio:.3g} times as large as the source: ask for the scale"


def within(side: Side, basis: Array) -> Moments:
    """Moments of the projection on orthonormal rows [r, n]; those of the side itself if the rows are those of I."""
    if len(basis) == side.shape.dim:
        return side.moments
    if side.shape.faces is None:
        points, weights = side.shape.points - side.moments.center, side.weights
    else:
        nodes, weights = mesh_nodes(side.shape, side.moments.order)
        points = nodes + (side.shape.points[0] - side.moments.center)
    parts = len(side.moments.replicates)
    return central_moments(points @ basis.T, weights, side.moments.order, parts=parts)
