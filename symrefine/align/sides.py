"""What is known of the sides of an alignment, each alone and together: moments, the span of the points, sizes."""

import numpy as np

from symrefine.align.alignment import OK
from symrefine.align.moment_fit import ROUNDING
from symrefine.align.pair import Side, shares
from symrefine.detection.masses import class_moments
from symrefine.detection.measure import SAMPLES
from symrefine.geometry import Array
from symrefine.moments.moments import Moments, central_moments, deviations, tensor_index
from symrefine.moments.quadrature import mesh_nodes
from symrefine.rounding import SINGLE
from symrefine.shape import Shape
from symrefine.surface.skin import drawn

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
        weights=shares(shape, shape.masses),
    )


def thinned(source: Shape, target: Shape, seed: int) -> tuple[Shape, Shape]:
    """Some of the points of large clouds in 3-space: a polish on the points makes up for what moments lose by that.

    All of those that may be the same points in another pose, which their spreads tell, and of flat sets.
    """
    if source.dim != 3 or not any(_is_large(s) for s in (source, target)):
        return source, target
    spreads = [_spread(s) for s in (source, target) if s.faces is None]
    alike = len(spreads) == 2 and np.abs(spreads[0] - spreads[1]).max() < ROUNDING
    if (alike and len(source.points) == len(target.points)) or min((s[0] for s in spreads), default=0.0) <= SINGLE**2:
        return source, target
    return _some(source, seed), _some(target, seed)


def _spread(cloud: Shape) -> Array:
    """Variances [n] of the points along their principal axes, ascending, as shares of all."""
    local, masses = cloud.points - cloud.points[0], cloud.masses
    local -= masses @ local / masses.sum()
    values = np.linalg.eigvalsh((local * masses[:, None]).T @ local)
    return np.asarray(values / max(float(values.sum()), 1e-300))


def _some(shape: Shape, seed: int) -> Shape:
    """Of a large cloud as many points as a surface is known by; others, and meshes, as they are."""
    if not _is_large(shape):
        return shape
    return shape.chosen(drawn(len(shape.points), SAMPLES, np.random.default_rng(seed)))


def _is_large(shape: Shape) -> bool:
    """Whether it is a cloud without weights, of more points than a surface is known by."""
    return shape.faces is None and shape.weights is None and len(shape.points) > SAMPLES


def rank_of(moments: Moments) -> int:
    """Dimension of the subspace that the points spread in."""
    return int((np.linalg.eigvalsh(moments.covariance) > SINGLE**2).sum())


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
    return unlike_sizes(target.moments.scale / source.moments.scale) if differ_in_size(source, target) else OK


def unlike_sizes(ratio: float) -> str:
    """The status where objects agree at one size only."""
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
