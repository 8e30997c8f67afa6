"""Polish on the points: two surfaces without correspondences, point to plane.

`e = (s R x + t - y).n` for a point x of the source and the plane (y, n) of the target that it meets: linear
in phi = (s R, t, 1), so the Gram matrix of `residual` serves, as it does for symmetries; here the unknowns are a small
rotation, a shift and, if asked for, the scale. Everything is in units of the target: RMS radius 1 about its centre.
"""

from dataclasses import dataclass

import numpy as np

from symrefine.align.skin import Skin, denoised
from symrefine.fit.matching import ROBUST, WORTH
from symrefine.fit.residual import SIZE, design_rows, gram
from symrefine.geometry import Array, cross_matrix, read_only, rotation
from symrefine.surface.skin import LocalPlanes

# Matchings at most, and steps on the planes of each.
MAX_OUTER, INNER = 12, 6
# Motion within which planes once matched are kept, over their width.
STAY = 0.2
# Least robust scale over the width of the planes: with exact data the residuals say nothing.
SCALE_FLOOR = 0.03
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Probes:
    """Denoised points [S, 3] of the source with their normals [S, 3] and what each counts for [S].

    `redundancy` is how many of them each point of the cloud takes part in; >= 1.
    """

    points: Array
    normals: Array
    worth: Array
    redundancy: float


def probes(skin: Skin, count: int, rng: np.random.Generator) -> Probes:
    """`count` points of a skin, each moved onto the plane of its neighbours; all, as they are, if they are isolated."""
    if skin.isolated:
        none = np.zeros_like(skin.points)
        return Probes(points=skin.points, normals=none, worth=np.ones(len(none)), redundancy=1.0)
    points, planes = denoised(skin, count, rng)
    worth, redundancy = _worth(planes.flatness), skin.redundancy(len(points))
    return Probes(points=points, normals=planes.normals, worth=worth, redundancy=redundancy)


def probes_of(planes: LocalPlanes, count: int) -> Probes:
    """About `count` of the local planes of a source, or all."""
    some = slice(None, None, max(1, len(planes.points) // count))
    worth = _worth(planes.flatness[some])
    redundancy = max(1.0, planes.redundancy * len(worth) / len(planes.points))
    return Probes(points=planes.points[some], normals=planes.normals[some], worth=worth, redundancy=redundancy)


def _worth(flatness: Array) -> Array:
    return np.asarray(np.exp(-((flatness / WORTH) ** 2)))


def polish(
    source: Probes,
    target: Skin,
    start: Similarity,
    *,
    error: float,
    known: Array,
    scale: bool = False,
    outer: int = MAX_OUTER,
) -> Polished:
    """Alternate matching and Gauss-Newton on the matched planes until the step is negligible.

    A plane stands for its surroundings, so as long as the motion changes by less than the planes are wide they are
    kept, and a step costs no search.

    Args:
        source: points to move, in the source's own axes but in units of the target.
        target: what they are to meet.
        error: how far the start may be off, radians and RMS radii; sets the first gate and the first robust scale.
        known: [6, 6] information (inverse covariance) that the start carries; zeros if none. Under noise the moments
            know some motions better than the points do; without noise the points know all of them better.
        scale: whether the scale is an unknown too.
        outer: matchings at most.
    """
    size = 7 if scale else 6
    prior: Array = np.zeros((size, size))
    prior[:6, :6] = known
    motion, offset, reach = start, np.zeros(size), error
    covariance: Array = np.linalg.pinv(known, rcond=1e-12, hermitian=True)
    for index in range(1, outer + 1):
        met = _matched(source, target, motion, reach)
        if len(met.rows) < FEWEST_PAIRS:
            return Polished(motion=motion, covariance=covariance, steps=index - 1, converged=False)
        before, settled = offset, False
        for _ in range(INNER):
            information, gradient = _normal_equations(met, motion, SCALE_FLOOR * target.width, reach, size)
            inverse = _inverse(information + prior)
            step = -inverse @ (gradient + prior @ offset)
            motion, offset, covariance = motion.moved(step), offset + step, inverse[:6, :6]
            largest = float(np.abs(step).max())
            reach = min(reach, 4.0 * largest)
            settled = largest < SETTLED or bool(np.all(np.abs(step) <= WITHIN_NOISE * np.sqrt(np.diag(inverse))))
            if settled:
                break
        if settled and float(np.abs(offset - before).max()) < STAY * target.width:
            return Polished(motion=motion, covariance=covariance, steps=index, converged=True)
    return Polished(motion=motion, covariance=covariance, steps=outer, converged=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Met:
    """Equations [E, 13] of the pairs that a motion brought together, `each` to a pair, and what pairs count for [P]."""

    rows: Array
    worth: Array
    each: int
    redundancy: float

    def weights(self, errors: Array, floor: float, reach: float) -> Array:
        """Geman-McClure weights [E] at a scale from the errors [E], bounded from below (method.md, section 4)."""
        if len(errors) == 0:
            return errors
        error2 = (errors**2).reshape(-1, self.each).sum(axis=1)
        middle = len(error2) // 2
        scale2 = max(ROBUST * float(np.sqrt(np.partition(error2, middle)[middle])), floor, reach) ** 2
        return np.repeat(self.worth * (scale2 / (scale2 + error2)) ** 2, self.each)


def _matched(source: Probes, target: Skin, motion: Similarity, reach: float) -> _Met:
    """The pairs that the motion brings together (compare `matching.match`)."""
    moved = motion.apply(source.points)
    planes = target.near(moved)
    met = planes.distance < 3.0 * (target.width + reach)
    if target.isolated:
        points, others = (np.repeat(a[met], 3, axis=0) for a in (source.points, planes.points))
        rows = design_rows(points, others, np.tile(np.eye(3), (int(met.sum()), 1)))
        return _Met(rows=rows, worth=source.worth[met], each=3, redundancy=1.0)
    met &= np.abs(np.einsum("ij,ij->i", source.normals @ motion.matrix.T, planes.normals)) > AGREE
    rows = design_rows(source.points[met], planes.points[met], planes.normals[met])
    worth = (source.worth * _worth(planes.flatness))[met]
    redundancy = max(source.redundancy, target.redundancy(len(worth)))
    return _Met(rows=rows, worth=worth, each=1, redundancy=redundancy)


def _normal_equations(met: _Met, motion: Similarity, floor: float, reach: float, size: int) -> tuple[Array, Array]:
    """Information matrix [size, size] and gradient over (rotation, shift[, log scale]), in units of the variance."""
    matrix = motion.scale * motion.matrix
    phi = np.concatenate([matrix.ravel(), motion.shift, [1.0]])
    weights = met.weights(met.rows @ phi, floor, reach)
    g = gram(met.rows, weights)
    jacobian: Array = np.zeros((SIZE, 7))
    for k, axis in enumerate(np.eye(3)):
        jacobian[:9, k] = (cross_matrix(axis) @ matrix).ravel()
        jacobian[9 + k, 3 + k] = 1.0
    jacobian[:9, 6] = matrix.ravel()
    jacobian = jacobian[:, :size]
    variance = max(met.redundancy * float(phi @ g @ phi) / float(weights.sum()), LEAST_VARIANCE)
    return jacobian.T @ g @ jacobian / variance, jacobian.T @ g @ phi / variance


def _inverse(information: Array) -> Array:
    """Inverse on the span of what is observable, zero elsewhere."""
    values, vectors = np.linalg.eigh(information)
    seen = values > max(1e-9 * values[-1], UNOBSERVABLE**-2)
    return (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
