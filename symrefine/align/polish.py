"""Polish on the points: two surfaces without correspondences, point to plane.

`e = (s R x + t - y).n` for a point x of the source and the plane (y, n) of the target that it meets: linear in
phi = (s R, t, 1), as the residual of a symmetry is; here the unknowns are a small rotation, a shift and, if asked for,
the scale. Everything is in units of the target: RMS radius 1 about its centre.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symrefine.align.contact import Contact, meet
from symrefine.align.moment_fit import LONGEST
from symrefine.fit.matching import SCALE_FLOOR, each_coordinate, geman_mcclure, robust_scale, worth
from symrefine.fit.refine import MAX_OUTER, SETTLED, SHORT, WITHIN_NOISE
from symrefine.fit.residual import SIZE, design_rows, gram, turn_frame
from symrefine.geometry import Array, Isometry, cross_matrix
from symrefine.samples import GLANCE
from symrefine.surface.misses import RIM
from symrefine.surface.skin import LocalPlanes, Patches, Skin

# One in so many of the planes of the source moves until the motion changes by less than the spacing.
COARSE = 4
# What small turns about the three axes add to a vector.
TURNS = np.stack([cross_matrix(axis) for axis in np.eye(3)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Similarity(Isometry):
    """Map x -> scale * matrix x + shift with an orthogonal matrix of determinant +1 or -1."""

    scale: float = 1.0

    @classmethod
    def of(cls, motion: Isometry) -> "Similarity":
        """A map that keeps lengths."""
        return cls(matrix=motion.matrix, shift=motion.shift)

    def apply(self, points: Array) -> Array:
        """Images [N, n] of points [N, n]."""
        return self.scale * (points @ self.matrix.T) + self.shift

    @property
    def inverse(self) -> "Similarity":
        """The way back."""
        back = self.matrix.T
        return Similarity(matrix=back, shift=-(back @ self.shift) / self.scale, scale=1.0 / self.scale)

    def after(self, first: "Similarity") -> "Similarity":
        """Another map, and then this one."""
        shift = self.scale * (self.matrix @ first.shift) + self.shift
        return Similarity(matrix=self.matrix @ first.matrix, shift=shift, scale=self.scale * first.scale)

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
        scale_sigma: standard deviation of the scale, relative; 0 where it was no unknown.
        steps: outer iterations.
        converged: whether the last step was negligible.
        contact: where the source met the target before the last step: with all of its planes if that was negligible.
        given_up: whether it was not worthwhile to go on.
    """

    motion: Similarity
    covariance: Array
    scale_sigma: float
    steps: int
    converged: bool
    contact: Contact
    given_up: bool


def polish(
    source: Patches,
    target: Skin | LocalPlanes,
    start: Similarity,
    *,
    error: float,
    known: Array,
    scale: bool = False,
    worthwhile: Callable[[Similarity], bool] | None = None,
) -> Polished:
    """Alternate matching and Gauss-Newton on the matched planes until the step is negligible.

    A plane stands for its surroundings, so as long as the motion changes by less than the spacing of the points the
    planes are kept, and a new robust scale costs no search.

    Args:
        source: what moves, in the source's own axes but in units of the target.
        target: what it is to meet.
        error: how far the start may be off, radians and RMS radii; sets the first gate and the first robust scale.
        known: [6, 6], or [7, 7] with the scale, information (inverse covariance) that the start carries; zeros if none.
            Under noise the moments know some motions better than the points do; without noise the points know all of
            them better.
        scale: whether the scale is an unknown too.
        worthwhile: asked of a map that is not settled when most are, whether to go on.
    """
    prior: Array = np.zeros((7, 7) if scale else (6, 6))
    prior[: len(known), : len(known)] = known
    x, reach = np.zeros(len(prior)), error
    covariance: Array = np.linalg.pinv(prior, rcond=1e-12, hermitian=True)
    few = COARSE if len(source.points) > COARSE * GLANCE else 1
    for index in range(1, MAX_OUTER + 1):
        contact = meet(source, target, start.moved(x), reach, stride=few)
        met = _Met.of(contact, target, source.redundancy)
        if len(met.worth) == 0 or target.spacing == 0.0:  # of points in one place nothing tells how near is near
            return _ended(start.moved(x), covariance, contact, index - 1, converged=False)
        before, settled = x, False
        for _ in range(MAX_OUTER):
            phi = _phi(start, x)
            squares = met.squares(phi)
            scale_now = robust_scale(np.sqrt(squares), target.spacing, reach)
            step, inverse, sigmas = _step(*_normal_equations(met, phi, squares, scale_now, prior, x))
            x, covariance, length = x + step, inverse, float(np.linalg.norm(step))
            settled = scale_now > reach and (length < SETTLED or sigmas < WITHIN_NOISE)
            reach = min(reach, RIM * length)
            if settled:
                break
        moved = float(np.linalg.norm(x - before))
        if settled and few == 1 and moved < SCALE_FLOOR * target.spacing:
            return _ended(start.moved(x), covariance, contact, index, converged=True)
        if index == SHORT and worthwhile is not None and not worthwhile(start.moved(x)):
            return _ended(start.moved(x), covariance, contact, index, converged=False, given_up=True)
        if settled and moved < target.spacing:
            few = 1
    return _ended(start.moved(x), covariance, contact, MAX_OUTER, converged=False)


def _ended(
    motion: Similarity, covariance: Array, contact: Contact, steps: int, *, converged: bool, given_up: bool = False
) -> Polished:
    """What is told of a map, given the covariance [6 or 7, ...] of all that was unknown."""
    return Polished(
        motion=motion,
        covariance=covariance[:6, :6],
        scale_sigma=float(np.sqrt(np.diag(covariance)[6:].sum())),
        steps=steps,
        converged=converged,
        contact=contact,
        given_up=given_up,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Met:
    """Equations [E, 13] of the pairs that a motion brought together, `each` to a pair, and what pairs count for [P]."""

    rows: Array
    worth: Array
    each: int
    redundancy: float

    @classmethod
    def of(cls, contact: Contact, target: Skin | LocalPlanes, redundancy: float) -> "_Met":
        """Those of the pairs that count, given how many planes of the source each of its points takes part in."""
        own, met = contact.source.chosen(contact.kept), contact.target.chosen(contact.kept)
        if target.isolated:
            rows = design_rows(*each_coordinate(own.points, met.points))
            return cls(rows=rows, worth=np.ones(len(own.points)), each=3, redundancy=1.0)
        rows = design_rows(own.points, met.points, met.normals)
        shared = target.redundancy if isinstance(target, LocalPlanes) else target.shared_by(len(rows))
        return cls(rows=rows, worth=worth(own.flatness, met.flatness), each=1, redundancy=max(redundancy, shared))

    def squares(self, phi: Array) -> Array:
        """Squared distances [P] that the pairs are left with under phi [13]."""
        squares = (self.rows @ phi) ** 2
        return squares if self.each == 1 else np.asarray(squares.reshape(-1, self.each).sum(axis=1))


def _phi(start: Similarity, x: Array) -> Array:
    """phi [13] of a map that is moved by x [6 or 7], as `Similarity.moved` has it."""
    stretch = start.scale * (float(np.exp(x[6])) if len(x) > 6 else 1.0)
    phi = np.ones(SIZE)
    phi[:9] = (stretch * turn_frame(start.matrix, x[:3])).ravel()
    phi[9:12] = start.shift + x[3:6]
    return phi


def _normal_equations(
    met: _Met, phi: Array, squares: Array, scale: float, prior: Array, x: Array
) -> tuple[Array, Array]:
    """Gradient and Gauss-Newton matrix at x of the robust cost over the pairs, and of the prior.

    In units of the variance that the present squares [P] of the pairs show. Least squares with these weights lies above
    the robust cost and touches it here, so that a step which lowers the one lowers the other.
    """
    weights = met.worth * geman_mcclure(squares, scale)
    variance = met.redundancy * float(weights @ squares) / (met.each * float(weights.sum()))
    variance = max(variance, float(np.finfo(float).eps))
    every = weights if met.each == 1 else np.repeat(weights, met.each)
    g, jacobian = gram(met.rows, every), _jacobian(phi, len(x))
    gradient = jacobian.T @ (g @ phi) / variance + prior @ x
    return gradient, jacobian.T @ g @ jacobian / variance + prior


def _jacobian(phi: Array, size: int) -> Array:
    """Derivatives [13, size] of phi by rotation, shift and log scale."""
    matrix = phi[:9].reshape(3, 3)
    jacobian: Array = np.zeros((SIZE, 7))
    jacobian[:9, :3] = (TURNS @ matrix).reshape(3, 9).T
    jacobian[9:12, 3:6] = np.eye(3)
    jacobian[:9, 6] = matrix.ravel()
    return jacobian[:, :size]


def _step(gradient: Array, hessian: Array) -> tuple[Array, Array, float]:
    """The Gauss-Newton step over what is observable, the covariance, zero elsewhere, and the step over that.

    Motions uncertain by more than the longest step of a fit are left alone: gliding along a cylinder is an example.
    """
    values, vectors = np.linalg.eigh(hessian)
    seen = values > max(1e-9 * values[-1], LONGEST**-2)
    values, basis = values[seen], vectors[:, seen]
    along = basis.T @ gradient / values
    sigmas = float(np.sqrt(along @ (values * along) / max(1, len(along))))
    return -(basis @ along), (basis / values) @ basis.T, sigmas
