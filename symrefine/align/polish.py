"""Polish on the points: two surfaces without correspondences, point to plane.

`e = (s R x + t - y).n` for a point x of the source and the plane (y, n) of the target that it meets: linear in
phi = (s R, t, 1), as the residual of a symmetry is; here the unknowns are a small rotation, a shift and, if asked for,
the scale. Everything is in units of the target: RMS radius 1 about its centre.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from symrefine.align.moment_fit import LONGEST
from symrefine.fit.gauss_newton import Linearisation, minimise
from symrefine.fit.matching import SCALE_FLOOR, each_coordinate, geman_mcclure, meet, robust_scale, worth
from symrefine.fit.refine import MAX_OUTER, SETTLED, WITHIN_NOISE
from symrefine.fit.residual import SIZE, design_rows, gram, turn_frame
from symrefine.geometry import Array, Isometry, cross_matrix
from symrefine.surface.skin import LocalPlanes, Skin


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Similarity(Isometry):
    """Map x -> scale * matrix x + shift with an orthogonal matrix of determinant +1 or -1."""

    scale: float = 1.0

    def apply(self, points: Array) -> Array:
        """Images [N, n] of points [N, n]."""
        return self.scale * (points @ self.matrix.T) + self.shift

    @property
    def inverse(self) -> "Similarity":
        """The way back."""
        back = self.matrix.T
        return Similarity(matrix=back, shift=-(back @ self.shift) / self.scale, scale=1.0 / self.scale)

    def moved(self, x: Array) -> "Similarity":
        """This map, turned about the origin and shifted by x [6], its scale times exp(x[6]) if there is one."""
        stretch = float(np.exp(x[6])) if len(x) > 6 else 1.0
        matrix = turn_frame(self.matrix, x[:3])
        return Similarity(matrix=matrix, shift=self.shift + x[3:6], scale=self.scale * stretch)


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
    source: LocalPlanes,
    target: Skin | LocalPlanes,
    start: Similarity,
    *,
    error: float,
    known: Array,
    scale: bool = False,
) -> Polished:
    """Alternate matching and Gauss-Newton on the matched planes until the step is negligible.

    A plane stands for its surroundings, so as long as the motion changes by less than the spacing of the points the
    planes are kept, and a new robust scale costs no search.

    Args:
        source: what moves, in the source's own axes but in units of the target.
        target: what it is to meet.
        error: how far the start may be off, radians and RMS radii; sets the first gate and the first robust scale.
        known: [6, 6] information (inverse covariance) that the start carries; zeros if none. Under noise the moments
            know some motions better than the points do; without noise the points know all of them better.
        scale: whether the scale is an unknown too.
    """
    prior: Array = np.zeros((7, 7))
    prior[:6, :6] = known
    prior = prior if scale else prior[:6, :6]
    x, reach = np.zeros(len(prior)), error
    covariance: Array = np.linalg.pinv(known, rcond=1e-12, hermitian=True)
    for index in range(1, MAX_OUTER + 1):
        met = _met(source, target, start.moved(x), reach)
        if len(met.worth) == 0:
            return Polished(motion=start.moved(x), covariance=covariance, steps=index - 1, converged=False)
        before, settled = x, False
        for _ in range(MAX_OUTER):
            errors = met.errors(start.moved(x))
            scale_now = robust_scale(errors, target.spacing, reach)
            step, inverse, sigmas = _step(_model(met, start, errors, prior, scale_now), x, scale_now)
            x, covariance, length = x + step, inverse[:6, :6], float(np.linalg.norm(step))
            settled = scale_now > reach and (length < SETTLED or sigmas < WITHIN_NOISE)
            reach = min(reach, 4.0 * length)
            if settled:
                break
        if settled and float(np.linalg.norm(x - before)) < SCALE_FLOOR * target.spacing:
            return Polished(motion=start.moved(x), covariance=covariance, steps=index, converged=True)
    return Polished(motion=start.moved(x), covariance=covariance, steps=MAX_OUTER, converged=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Met:
    """Equations [E, 13] of the pairs that a motion brought together, `each` to a pair, and what pairs count for [P]."""

    rows: Array
    worth: Array
    each: int
    redundancy: float

    def errors(self, motion: Similarity) -> Array:
        """Distances [P] that the pairs are left with."""
        return np.asarray(np.linalg.norm((self.rows @ _phi(motion)).reshape(-1, self.each), axis=1))


def _phi(motion: Similarity) -> Array:
    return np.concatenate([(motion.scale * motion.matrix).ravel(), motion.shift, [1.0]])


def _met(source: LocalPlanes, target: Skin | LocalPlanes, motion: Similarity, reach: float) -> _Met:
    own, met = meet(source, target, motion, reach)
    if target.isolated:
        rows = design_rows(*each_coordinate(own.points, met.points))
        return _Met(rows=rows, worth=np.ones(len(own.points)), each=3, redundancy=1.0)
    rows = design_rows(own.points, met.points, met.normals)
    redundancy = max(source.redundancy, target.shared_by(len(rows)))
    return _Met(rows=rows, worth=worth(own.flatness, met.flatness), each=1, redundancy=redundancy)


def _model(met: _Met, start: Similarity, errors: Array, prior: Array, scale: float) -> Callable[[Array], Linearisation]:
    """Robust cost over the pairs, in units of the variance that their present errors [P] show, and of the prior."""
    first = errors**2
    weights = met.worth * geman_mcclure(first, scale)
    squares = float(weights @ first) / (met.each * float(weights.sum()))
    variance = max(met.redundancy * squares, float(np.finfo(float).eps))

    def linearise(x: Array) -> Linearisation:
        motion = start.moved(x)
        phi, error2 = _phi(motion), met.errors(motion) ** 2
        weights = np.repeat(met.worth * geman_mcclure(error2, scale), met.each)
        g, jacobian = gram(met.rows, weights), _jacobian(motion, len(x))
        cost = float(met.worth @ (scale**2 * error2 / (scale**2 + error2)))
        return Linearisation(
            cost=cost / variance + float(x @ prior @ x),
            gradient=jacobian.T @ g @ phi / variance + prior @ x,
            hessian=jacobian.T @ g @ jacobian / variance + prior,
        )

    return linearise


def _jacobian(motion: Similarity, size: int) -> Array:
    """Derivatives [13, size] of phi by rotation, shift and log scale."""
    matrix = motion.scale * motion.matrix
    jacobian: Array = np.zeros((SIZE, 7))
    for k, axis in enumerate(np.eye(3)):
        jacobian[:9, k] = (cross_matrix(axis) @ matrix).ravel()
        jacobian[9 + k, 3 + k] = 1.0
    jacobian[:9, 6] = matrix.ravel()
    return jacobian[:, :size]


def _step(linearise: Callable[[Array], Linearisation], at: Array, scale: float) -> tuple[Array, Array, float]:
    """Gauss-Newton over what is observable: the way from x, the covariance, zero elsewhere, and the way over that.

    It ends with a step below the robust scale: a smaller scale is due then. Motions uncertain by more than the longest
    step of a fit are left alone: gliding along a cylinder is an example.
    """
    here = linearise(at)
    values, vectors = np.linalg.eigh(here.hessian)
    basis = vectors[:, values > max(1e-9 * values[-1], LONGEST**-2)]

    def within(y: Array) -> Linearisation:
        full = linearise(at + basis @ y) if y.any() else here
        return replace(full, gradient=basis.T @ full.gradient, hessian=basis.T @ full.hessian @ basis)

    found = minimise(within, np.zeros(basis.shape[1]), tolerance=scale)
    sigmas = float(np.sqrt(found.x @ found.hessian @ found.x / max(1, len(found.x))))
    return basis @ found.x, basis @ np.linalg.inv(found.hessian) @ basis.T, sigmas
