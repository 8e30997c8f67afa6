"""Orthogonal maps between two objects in n-space from all their moment tensors, for the dimensions without harmonics.

`T_p(R X) = R . T_p(X)`, R acting on every index. Gauss-Newton over so(n), whose generators act on one index at a time;
starts are the Procrustes solution of the n-tuples, and where those vanish a grid of angles (n = 2) or the principal
frames of the covariance.
"""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from symrefine.geometry import Array
from symrefine.moments import Moments, tensor_index
from symrefine.procrustes import Procrustes

# Variance of a component that no sample takes away.
FLOOR = 1e-10
# Angles tried in the plane for each determinant, and how many of all are refined.
ANGLES, CLIMBED = 45, 24
# Principal frames are tried up to this dimension.
FRAMES_UP_TO = 5
STEPS = 20
SETTLED = 1e-12
# Two matrices nearer than this (Frobenius norm) are one.
SAME = 0.02
# A fit explains the pair as well as the best if its cost is below this many times the best, or below this much per
# component: errors of moments are correlated, so costs scatter by that.
RIVAL = 3.0
PER_COMPONENT = 1.0
# A turn known to no better than this (radians) is not determined.
UNKNOWN_RAD = 0.3
ROUNDING = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TensorFit:
    """Every matrix that explains the pair as well as the best.

    Attributes:
        matrices: [k, n, n], rotations first.
        free: orthonormal directions [j, n] of the target within which any orthogonal map is as good; j = 0 or j >= 2.
        exact: whether the moments agree to rounding.
        sigma_rad: standard deviation of the rotation, all planes together; `inf` if some are undetermined.
        misfit: cost per component; far above 1 if the moments differ by more than sampling explains.
    """

    matrices: Array
    free: Array
    exact: bool
    sigma_rad: float
    misfit: float


class _Tensors:
    """Tensors of both sides, degree by degree, each with the inverse variance of its components."""

    def __init__(self, source: Moments, target: Moments) -> None:
        self.dim = source.dim
        self.degrees = range(2, source.order + 1)
        self.source = {p: source.tensor(p) for p in self.degrees}
        self.target = {p: target.tensor(p) for p in self.degrees}
        self.weights = {p: 1.0 / (_variance(source, p) + _variance(target, p) + FLOOR) for p in self.degrees}
        self.generators = [_generator(self.dim, i, j) for i, j in combinations(range(self.dim), 2)]

    @property
    def size(self) -> int:
        """Number of components compared."""
        return sum(t.size for t in self.source.values())

    def residuals(self, matrix: Array) -> tuple[Array, Array]:
        """Weighted residuals [M] at a matrix, and their Jacobian [n(n-1)/2, M] in a small turn of the target's axes."""
        residuals, jacobians = [], []
        for p in self.degrees:
            root = np.sqrt(self.weights[p])
            here = _turned(self.source[p], matrix)
            residuals.append(root * (here - self.target[p]).ravel())
            acted = [_acted(here, g).ravel() for g in self.generators]
            jacobians.append(root * np.array(acted).reshape(len(acted), -1))
        return np.concatenate(residuals), np.concatenate(jacobians, axis=1)

    def mismatch(self, matrix: Array) -> float:
        """Largest difference of any component."""
        return max(float(np.abs(_turned(self.source[p], matrix) - self.target[p]).max()) for p in self.degrees)


def _variance(moments: Moments, degree: int) -> float:
    """Jackknife variance of a component of T_degree, over the mean of its components."""
    parts = len(moments.replicates)
    if parts == 0:
        return 0.0
    values = moments.replicates[:, tensor_index(moments.dim, degree, moments.order).ravel()]
    return float((parts - 1) * values.var(axis=0).mean())


def _generator(dim: int, i: int, j: int) -> Array:
    g = np.zeros((dim, dim))
    g[i, j], g[j, i] = -1.0, 1.0
    return g


def _turned(tensor: Array, matrix: Array) -> Array:
    """R acting on every index: contract the first, append the new one, once round."""
    for _ in range(tensor.ndim):
        tensor = np.tensordot(tensor, matrix, axes=([0], [1]))
    return tensor


def _acted(tensor: Array, generator: Array) -> Array:
    """Derivative of a symmetric tensor under a generator: it acts on one index at a time."""
    once = np.tensordot(generator, tensor, axes=([1], [0]))
    return np.asarray(sum(np.moveaxis(once, 0, k) for k in range(tensor.ndim)))


def tensor_fit(source: Moments, target: Moments, closed: Procrustes, *, reflections: bool = True) -> TensorFit:
    """Refine the Procrustes solution, and whatever else could be one, on all moments.

    Args:
        source: normalised moments with their replicates.
        target: the same of the other object, to the same order.
        closed: Procrustes solution of the n-tuples.
        reflections: whether determinant -1 is an answer.
    """
    tensors = _Tensors(source, target)
    starts = [s for s in _starts(tensors, source, target, closed) if reflections or np.linalg.det(s) > 0.0]
    fits = [_descend(tensors, start) for start in starts]
    fits.sort(key=lambda f: f[1])
    exact = [m for m, _, _ in fits if tensors.mismatch(m) < ROUNDING]
    limit = max(RIVAL * fits[0][1], fits[0][1] + PER_COMPONENT * tensors.size)
    good = exact or [m for m, cost, _ in fits if cost <= limit]
    matrices = np.stack(_distinct(sorted(good, key=lambda m: -np.sign(np.linalg.det(m)))))
    hessian = fits[0][2]
    sigma = np.sqrt(max(1.0, fits[0][1] / tensors.size) / np.maximum(np.linalg.eigvalsh(hessian), 1e-300))
    lost = len(sigma) > 0 and bool(sigma.max() > UNKNOWN_RAD)
    return TensorFit(
        matrices=matrices,
        free=_free(closed, source.dim) if lost else np.zeros((0, source.dim)),
        exact=bool(exact),
        sigma_rad=np.inf if lost else float(np.linalg.norm(sigma)),
        misfit=fits[0][1] / tensors.size,
    )


def _free(closed: Procrustes, dim: int) -> Array:
    """Directions that turn freely: the plane itself for n = 2, what the n-tuples leave open elsewhere."""
    return np.eye(2) if dim == 2 else np.asarray(closed.free if len(closed.free) > 1 else closed.target_directions[-2:])


def _starts(tensors: _Tensors, source: Moments, target: Moments, closed: Procrustes) -> list[Array]:
    dim = source.dim
    starts = [closed.matrix, closed.flipped]
    if dim == 2:
        angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        turns = np.moveaxis(np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]), 2, 0)
        starts += [*turns, *(turns @ np.diag([1.0, -1.0]))]
        costs = np.array([float(np.sum(tensors.residuals(s)[0] ** 2)) for s in starts])
        return [starts[i] for i in np.argsort(costs, kind="stable")[:CLIMBED]]
    if closed.rank < dim - 1 and dim <= FRAMES_UP_TO:
        a, b = (np.linalg.eigh(m.covariance)[1] for m in (source, target))
        starts += [b @ np.diag(signs) @ a.T for signs in product([1.0, -1.0], repeat=dim)]
    return starts


def _descend(tensors: _Tensors, start: Array) -> tuple[Array, float, Array]:
    """Matrix, cost and Gauss-Newton matrix where damped Gauss-Newton ends."""
    matrix, damping = start, 0.0
    r, j = tensors.residuals(matrix)
    if not tensors.generators:
        return matrix, float(r @ r), np.zeros((0, 0))
    for _ in range(STEPS):
        hessian = j @ j.T
        ridge = (damping + 1e-12) * np.trace(hessian) + 1e-300
        step = -np.linalg.solve(hessian + ridge * np.eye(len(hessian)), j @ r)
        trial = _cayley(sum(s * g for s, g in zip(step, tensors.generators, strict=True))) @ matrix
        r_new, j_new = tensors.residuals(trial)
        if r_new @ r_new <= r @ r:
            matrix, r, j, damping = trial, r_new, j_new, damping / 10.0
        else:
            damping = max(10.0 * damping, 1e-3)
        if np.linalg.norm(step) < SETTLED:
            break
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt, float(r @ r), j @ j.T


def _cayley(skew: "Array | int") -> Array:
    """Rotation near exp(skew), exact in orthogonality."""
    half = 0.5 * np.asarray(skew)
    eye = np.eye(len(half))
    return np.linalg.solve(eye - half, eye + half)


def _distinct(matrices: list[Array]) -> list[Array]:
    kept: list[Array] = []
    for m in matrices:
        if all(np.linalg.norm(m - k) > SAME for k in kept):
            kept.append(m)
    return kept
