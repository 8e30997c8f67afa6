"""Polish on the points: two surfaces without correspondences, point to plane, and a judgement of how well they meet.

`e = (s R x + t - y).n` for a local plane x of the source and the local plane (y, n) of the target it meets: linear in
phi = (s R, t, 1), so the Gram matrix of `residual` serves, as it does for symmetries; here the unknowns are a small
rotation, a shift and, if asked for, the scale. Everything is in units of the target: RMS radius 1 about its centre.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, cross_matrix, read_only, rotation
from symrefine.matching import ROBUST, SCALE_FLOOR, WORTH, LocalPlanes
from symrefine.residual import design_rows, gram
from symrefine.verify import LIMITS, disc_distances

MAX_OUTER = 12
# A step below this (radians, RMS radii) ends the polish, and so does one within this share of its standard deviation.
SETTLED = 2e-5
WITHIN_NOISE = 0.1
# A motion uncertain by more than this (radians, RMS radii) is not observable; gliding along a cylinder is the example.
UNOBSERVABLE = 0.1
# Cosine of the largest angle between the normals of a pair.
AGREE = np.sqrt(0.5)
# Queries of a first look.
LOOK = 400


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

    def moved(self, turn: Array, shift: Array, stretch: float) -> "Similarity":
        """This map followed by a small rotation vector about the origin and a shift; the scale grows by exp(stretch)."""
        angle = float(np.linalg.norm(turn))
        matrix = rotation(turn, angle) @ self.matrix if angle > 0.0 else self.matrix
        return Similarity(matrix=matrix, shift=self.shift + shift, scale=self.scale * float(np.exp(stretch)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """Local planes of both objects; the source in its own axes about its own centre, but in units of the target."""

    source: LocalPlanes
    target: LocalPlanes
    diagonal: float
    tolerance: float

    @cached_property
    def floor(self) -> Array:
        """Miss [4] that sampling alone explains: each surface against itself, both together."""
        own = [disc_distances(s, s.points[:: _stride(s, LOOK)], skip_self=True) for s in (self.source, self.target)]
        return np.sum([_statistics(d) for d in own], axis=0) / self.diagonal

    def misses(self, motion: Similarity, *, queries: int = 10**9) -> Array:
        """Distances from the moved source to the target, fractions of the diagonal."""
        points = self.source.points[:: _stride(self.source, queries)]
        return disc_distances(self.target, motion.apply(points)) / self.diagonal

    def excess(self, motion: Similarity, *, queries: int = 10**9) -> float:
        """Largest of mean, 95th, 99th and 99.5th percentile of the miss over its limit; <= 1 if the two surfaces agree."""
        own = _statistics(self.misses(motion, queries=queries))
        return float(np.max(own / (np.asarray(LIMITS) * self.tolerance + self.floor)))


def _statistics(distances: Array) -> Array:
    return np.array([distances.mean(), *np.quantile(distances, [0.95, 0.99, 0.995])])


def _stride(surface: LocalPlanes, count: int) -> int:
    return max(1, len(surface.points) // count)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polished:
    """Where the polish stopped.

    Attributes:
        motion: the map.
        covariance: [6, 6] of the rotation vector (target axes) and the shift; infinite directions are left out.
        rms: weighted root mean square of the residuals, RMS radii.
        steps: outer iterations.
        converged: whether the last step was negligible.
    """

    motion: Similarity
    covariance: Array
    rms: float
    steps: int
    converged: bool


def polish(
    surfaces: Surfaces, start: Similarity, *, error: float, scale: bool = False, queries: int = 10**9, outer: int = MAX_OUTER
) -> Polished:
    """Alternate matching and one Gauss-Newton step on the Gram matrix until the step is negligible.

    Args:
        error: how far the start may be off, radians and RMS radii; sets the first gate and the first robust scale.
        scale: whether the scale is an unknown too.
        queries: source planes used.
        outer: iterations at most.
    """
    motion, reach, index = start, error, 0
    state = Polished(motion=start, covariance=np.zeros((6, 6)), rms=np.inf, steps=0, converged=False)
    for index in range(1, outer + 1):
        rows, weights = _matched(surfaces, motion, reach, _stride(surfaces.source, queries))
        if len(rows) < 12:
            return replace(state, steps=index - 1)
        step, covariance, rms = _gauss_newton_step(rows, weights, motion, surfaces.source.redundancy, scale=scale)
        motion = motion.moved(step[:3], step[3:6], float(step[6]) if scale else 0.0)
        size, noise = np.abs(step[:6]), np.sqrt(np.diag(covariance))
        settled = bool(size.max() < SETTLED or np.all(size <= WITHIN_NOISE * noise))
        state = Polished(motion=motion, covariance=covariance, rms=rms, steps=index, converged=settled)
        reach = min(reach, 4.0 * float(size.max()))
        if settled:
            break
    return state


def _matched(surfaces: Surfaces, motion: Similarity, reach: float, stride: int) -> tuple[Array, Array]:
    """Design rows [P, 13] and weights [P] of the pairs that the motion brings together (see `matching.match`)."""
    source, target = surfaces.source, surfaces.target
    points, normals = source.points[::stride], source.normals[::stride]
    moved = motion.apply(points)
    distance, near = target.tree.query(moved, distance_upper_bound=3.0 * (target.spacing + reach))
    found = np.flatnonzero(np.isfinite(distance))
    met = near[found]
    facing = np.abs(np.einsum("ij,ij->i", normals[found] @ motion.matrix.T, target.normals[met])) > AGREE
    found, met = found[facing], met[facing]
    if len(found) == 0:
        return np.empty((0, 13)), np.empty(0)
    error = np.einsum("ij,ij->i", moved[found] - target.points[met], target.normals[met])
    flat = np.exp(-((source.flatness[::stride][found] / WORTH) ** 2) - (target.flatness[met] / WORTH) ** 2)
    scale2 = max(ROBUST * float(np.median(np.abs(error))), SCALE_FLOOR * target.spacing, reach) ** 2
    weights = flat * (scale2 / (scale2 + error**2)) ** 2
    return design_rows(points[found], target.points[met], target.normals[met]), weights


def _gauss_newton_step(
    rows: Array, weights: Array, motion: Similarity, redundancy: float, *, scale: bool
) -> tuple[Array, Array, float]:
    """One step over (rotation, shift[, log scale]) with its covariance [6, 6], from the Gram matrix of the pairs."""
    g = gram(rows, weights)
    matrix = motion.scale * motion.matrix
    phi = np.concatenate([matrix.ravel(), motion.shift, [1.0]])
    jacobian = np.zeros((13, 6 + scale))
    for k, axis in enumerate(np.eye(3)):
        jacobian[:9, k] = (cross_matrix(axis) @ matrix).ravel()
        jacobian[9 + k, 3 + k] = 1.0
    if scale:
        jacobian[:9, 6] = matrix.ravel()
    hessian, gradient, cost = jacobian.T @ g @ jacobian, jacobian.T @ g @ phi, float(phi @ g @ phi)
    variance = redundancy * max(cost, 0.0) / float(weights.sum())
    values, vectors = np.linalg.eigh(hessian)
    known = (values > 1e-9 * values[-1]) & (variance < UNOBSERVABLE**2 * values)
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T
    return -inverse @ gradient, variance * inverse[:6, :6], float(np.sqrt(max(cost, 0.0) / weights.sum()))
