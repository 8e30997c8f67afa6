"""Polish on the points: two surfaces without correspondences, point to plane, and a judgement of how well they meet.

`e = (s R x + t - y).n` for a local plane x of the source and the local plane (y, n) of the target that it meets: linear
in phi = (s R, t, 1), so the Gram matrix of `residual` serves, as it does for symmetries; here the unknowns are a small
rotation, a shift and, if asked for, the scale. Everything is in units of the target: RMS radius 1 about its centre.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, cross_matrix, read_only, rotation, tight_diagonal
from symrefine.matching import ROBUST, SCALE_FLOOR, WORTH, LocalPlanes
from symrefine.residual import SIZE, design_rows, gram
from symrefine.verify import LIMITS, disc_distances

MAX_OUTER = 12
# A step below this (radians, RMS radii) ends the polish, and so does one within this share of its standard deviation.
SETTLED = 2e-5
WITHIN_NOISE = 0.1
# Motions uncertain by more than this (radians, RMS radii) are left alone: gliding along a cylinder is an example.
UNOBSERVABLE = 0.1
# Variance of a residual that no sample takes away, RMS radii squared: with exact data the estimate collapses.
LEAST_VARIANCE = 1e-18
# Cosine of the largest angle between the normals of a pair.
AGREE = np.sqrt(0.5)
# Pairs below which there is nothing to polish.
FEWEST_PAIRS = 12
# Queries that settle what a surface shows against itself.
FLOOR_QUERIES = 400


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Similarity:
    """Map x -> scale * matrix x + shift with an orthogonal matrix of determinant +1 or -1."""

    matrix: Array
    shift: Array
    scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", read_only(self.matrix))
        object.__setattr__(self, "shift", read_only(self.shift))

    def apply(self, points: Array) -> Array:
        """Images [N, n] of points [N, n]."""
        return self.scale * (points @ self.matrix.T) + self.shift

    def moved(self, step: Array) -> "Similarity":
        """This map, turned about the origin and shifted by step [6], its scale times exp(step[6]) if there is one."""
        angle = float(np.linalg.norm(step[:3]))
        matrix = rotation(step[:3], angle) @ self.matrix if angle > 0.0 else self.matrix
        stretch = float(np.exp(step[6])) if len(step) > 6 else 1.0
        return Similarity(matrix=matrix, shift=self.shift + step[3:6], scale=self.scale * stretch)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """Local planes of both objects; the source in its own axes about its own centre, but in units of the target."""

    source: LocalPlanes
    target: LocalPlanes
    tolerance: float

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the smallest box around the target."""
        return tight_diagonal(self.target.points)

    @cached_property
    def floor(self) -> Array:
        """Miss [5] that sampling alone explains: each surface against itself, and what only one of the two blurs.

        Local planes merge the two faces of a thin sheet, or follow each, as the density of the points has it.
        """
        both = (self.source, self.target)
        if self.target.isolated:
            return np.zeros(5)
        own = [disc_distances(s, s.points[:: _stride(s, FLOOR_QUERIES)], skip_self=True) for s in both]
        blurred = abs(float(self.source.thickness.mean() - self.target.thickness.mean()))
        return (np.sum([_statistics(d) for d in own], axis=0) + blurred) / self.diagonal

    def misses(self, motion: Similarity, *, queries: int = 10**9) -> Array:
        """Distances from the moved source to the target, fractions of the diagonal."""
        points = self.source.points[:: _stride(self.source, queries)]
        return disc_distances(self.target, motion.apply(points)) / self.diagonal

    def excess(self, motion: Similarity, *, queries: int = 10**9) -> float:
        """Largest of mean, 95th, 99th and 99.5th percentile of the miss over its limit; <= 1 if the surfaces agree.

        Of isolated points every one counts.
        """
        own = _statistics(self.misses(motion, queries=queries))
        limits = np.array([*LIMITS, LIMITS[-1] if self.target.isolated else np.inf])
        return float(np.max(own / (limits * self.tolerance + self.floor)))


def _statistics(distances: Array) -> Array:
    return np.array([distances.mean(), *np.quantile(distances, [0.95, 0.99, 0.995, 1.0])])


def _stride(surface: LocalPlanes, count: int) -> int:
    return max(1, len(surface.points) // count)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polished:
    """Where the polish stopped.

    Attributes:
        motion: the map.
        covariance: [6, 6] of the rotation vector (target axes, radians) and the shift (RMS radii).
        steps: outer iterations.
        converged: whether the last step was negligible.
    """

    motion: Similarity
    covariance: Array
    steps: int
    converged: bool


def polish(
    surfaces: Surfaces,
    start: Similarity,
    *,
    error: float,
    known: Array,
    scale: bool = False,
    queries: int = 10**9,
    outer: int = MAX_OUTER,
) -> Polished:
    """Alternate matching and one Gauss-Newton step on the Gram matrix until the step is negligible.

    Args:
        error: how far the start may be off, radians and RMS radii; sets the first gate and the first robust scale.
        known: [6, 6] information (inverse covariance) that the start carries; zeros if none. Under noise the moments
            know some motions better than the points do; without noise the points know all of them better.
        scale: whether the scale is an unknown too.
        queries: source planes used.
        outer: iterations at most.
    """
    stride, size = _stride(surfaces.source, queries), 7 if scale else 6
    prior: Array = np.zeros((size, size))
    prior[:6, :6] = known
    motion, offset, reach = start, np.zeros(size), error
    covariance: Array = np.linalg.pinv(known, rcond=1e-12, hermitian=True)
    for index in range(1, outer + 1):
        rows, weights = _matched(surfaces, motion, reach, stride)
        if len(rows) < FEWEST_PAIRS:
            return Polished(motion=motion, covariance=covariance, steps=index - 1, converged=False)
        information, gradient = _normal_equations(rows, weights, motion, surfaces.source.redundancy, size)
        inverse = _inverse(information + prior)
        step = -inverse @ (gradient + prior @ offset)
        motion, offset, covariance = motion.moved(step), offset + step, inverse[:6, :6]
        largest = float(np.abs(step).max())
        within = np.all(np.abs(step) <= WITHIN_NOISE * np.sqrt(np.diag(inverse)))
        if largest < SETTLED or within:
            return Polished(motion=motion, covariance=covariance, steps=index, converged=True)
        reach = min(reach, 4.0 * largest)
    return Polished(motion=motion, covariance=covariance, steps=outer, converged=False)


def _matched(surfaces: Surfaces, motion: Similarity, reach: float, stride: int) -> tuple[Array, Array]:
    """Design rows [P, 13] and weights [P] of the pairs that the motion brings together (compare `matching.match`)."""
    source, target = surfaces.source, surfaces.target
    points, normals = source.points[::stride], source.normals[::stride]
    moved = motion.apply(points)
    distance, near = target.tree.query(moved, distance_upper_bound=3.0 * (target.spacing + reach))
    found = np.flatnonzero(np.isfinite(distance))
    met = near[found]
    if target.isolated:
        return _isolated_rows(points[found], target.points[met], _robust(distance[found], target, reach))
    facing = np.abs(np.einsum("ij,ij->i", normals[found] @ motion.matrix.T, target.normals[met])) > AGREE
    found, met = found[facing], met[facing]
    if len(found) == 0:
        return np.empty((0, SIZE)), np.empty(0)
    error = np.einsum("ij,ij->i", moved[found] - target.points[met], target.normals[met])
    flat = np.exp(-((source.flatness[::stride][found] / WORTH) ** 2) - (target.flatness[met] / WORTH) ** 2)
    return design_rows(points[found], target.points[met], target.normals[met]), flat * _robust(error, target, reach)


def _robust(error: Array, target: LocalPlanes, reach: float) -> Array:
    """Geman-McClure weights [P] at a scale from the residuals, bounded from below (method.md, section 4)."""
    middle = float(np.median(np.abs(error))) if len(error) else 0.0
    scale2 = max(ROBUST * middle, SCALE_FLOOR * target.spacing, reach) ** 2
    return (scale2 / (scale2 + error**2)) ** 2


def _isolated_rows(sources: Array, targets: Array, weights: Array) -> tuple[Array, Array]:
    """Three equations for each pair of points that stand for themselves."""
    directions = np.tile(np.eye(3), (len(sources), 1))
    return design_rows(np.repeat(sources, 3, axis=0), np.repeat(targets, 3, axis=0), directions), np.repeat(weights, 3)


def _normal_equations(
    rows: Array, weights: Array, motion: Similarity, redundancy: float, size: int
) -> tuple[Array, Array]:
    """Information matrix [size, size] and gradient over (rotation, shift[, log scale]), in units of the variance."""
    g = gram(rows, weights)
    matrix = motion.scale * motion.matrix
    phi = np.concatenate([matrix.ravel(), motion.shift, [1.0]])
    jacobian: Array = np.zeros((SIZE, 7))
    for k, axis in enumerate(np.eye(3)):
        jacobian[:9, k] = (cross_matrix(axis) @ matrix).ravel()
        jacobian[9 + k, 3 + k] = 1.0
    jacobian[:9, 6] = matrix.ravel()
    jacobian = jacobian[:, :size]
    variance = max(redundancy * float(phi @ g @ phi) / float(weights.sum()), LEAST_VARIANCE)
    return jacobian.T @ g @ jacobian / variance, jacobian.T @ g @ phi / variance


def _inverse(information: Array) -> Array:
    """Inverse on the span of what is observable, zero elsewhere."""
    values, vectors = np.linalg.eigh(information)
    seen = values > max(1e-9 * values[-1], UNOBSERVABLE**-2)
    return (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
