"""Orthogonal maps between two objects in n-space from all their moments, for the dimensions without harmonics.

Gauss-Newton over so(n): under the generator of the plane (i, j), `dx_i = -x_j, dx_j = x_i`, a moment changes by
`d m_p = -p_i m_(p - e_i + e_j) + p_j m_(p - e_j + e_i)` (method.md, section 2), so a Jacobian is a matter of look-up.
Starts are the Procrustes solution of the n-tuples and the principal frames, and in the plane a ring of angles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, product
from math import factorial, prod

import numpy as np

from symrefine.align.procrustes import Procrustes
from symrefine.geometry import Array
from symrefine.moments.moments import Moments, exponents, transformed
from symrefine.ntuples.contract import NTuples
from symrefine.shape import Index

# Variance of a moment that no sample takes away, in whitened units; widths of axes are bounded from below by the other.
FLOOR, THIN = 1e-8, 1e-6
# Angles tried in the plane, for each determinant; up to this dimension all signs of the principal axes are.
ANGLES, ALL_SIGNS = 24, 5
# Steps for every start, and for those whose cost is then in sight of the best.
FIRST_STEPS, LAST_STEPS, IN_SIGHT = 5, 30, 30.0
SETTLED = 1e-12
# Two matrices nearer than this (Frobenius norm) are one.
SAME = 0.02
# A fit explains the pair as well as the best if its cost is below this many times the best, or within this much per
# moment of it: errors of moments are correlated, so costs scatter by that.
RIVAL, PER_MOMENT = 5.0, 2.0
# A turn known to no better than this (radians) is not determined, nor one whose information is mostly noise: where the
# moments of the two, with their independent errors, share less than this part of it.
UNKNOWN_RAD, SHARED = 0.3, 0.75
ROUNDING = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MomentFit:
    """Every matrix that explains the pair as well as the best.

    Attributes:
        matrices: [k, n, n], rotations first.
        free: orthonormal directions [j, n] of the target within which any rotation is as good; j = 0 or j >= 2.
        exact: whether the moments agree to rounding.
        sigma_rad: standard deviation of the rotation, all planes together; `inf` if some are undetermined.
        misfit: cost per moment; far above 1 if the moments differ by more than sampling explains.
    """

    matrices: Array
    free: Array
    exact: bool
    sigma_rad: float
    misfit: float


@lru_cache(maxsize=16)
def _generators(dim: int, order: int) -> list[tuple[Index, Index, Index, Index]]:
    """For each plane i < j: p_i, the place of p - e_i + e_j, p_j, the place of p - e_j + e_i; for every p in turn."""
    table = exponents(dim, order)
    place = {tuple(p): k for k, p in enumerate(table.tolist())}

    def moved(down: int, up: int) -> Index:
        step = np.eye(dim, dtype=np.int64)[up] - np.eye(dim, dtype=np.int64)[down]
        return np.array([place.get(tuple(p), 0) for p in (table + step).tolist()])

    return [(table[:, i], moved(i, j), table[:, j], moved(j, i)) for i, j in combinations(range(dim), 2)]


@lru_cache(maxsize=16)
def _multiplicity(dim: int, order: int) -> Array:
    """How often each moment stands in its symmetric tensor."""
    table = exponents(dim, order).tolist()
    return np.array([factorial(sum(p)) / prod(factorial(k) for k in p) for p in table])


class _Problem:
    """The moments of both sides in their own principal axes, widest last, weighted by the inverse variance of both.

    There the widths of the object say how large each moment of a degree is, so that thin axes are not drowned.
    """

    def __init__(self, source: Moments, target: Moments) -> None:
        self.axes = tuple(np.linalg.eigh(m.covariance)[1] for m in (source, target))
        self.source, self.target = (transformed(m, a.T) for m, a in zip((source, target), self.axes, strict=True))
        table = exponents(source.dim, source.order)
        widths = np.maximum(np.diag(self.source.covariance) + np.diag(self.target.covariance), THIN) / 2.0
        size = np.prod(widths**table, axis=1)
        self.replicated = source
        self.target_spread = _spread(target, self.axes[1].T)
        spreads = _spread(source, self.axes[0].T), self.target_spread
        noise = sum(_relative_variance(s, size, source.dim, source.order) for s in spreads)
        self.root = np.sqrt(_multiplicity(source.dim, source.order) / (size * (noise + FLOOR)))
        self.planes = _generators(source.dim, source.order)

    @property
    def size(self) -> int:
        """Number of moments compared."""
        return len(self.root) - 1 - self.source.dim

    def linearised(self, matrix: Array) -> tuple[Array, Array]:
        """Weighted residuals [K] at a matrix, and their Jacobian [n(n-1)/2, K] in small turns of the target's axes."""
        here = transformed(self.source, matrix).values
        return self.root * (here - self.target.values), self.turned(here)

    def turned(self, values: Array) -> Array:
        """Weighted derivatives [n(n-1)/2, K] of moments [K] under small turns."""
        rows = [self.root * (pj * values[to_i] - pi * values[to_j]) for pi, to_j, pj, to_i in self.planes]
        return np.array(rows).reshape(len(rows), len(values))

    def covariance(self, fit: "_Fit") -> Array:
        """Covariance of the fitted turn: of the misfit, and by the jackknife, one step for every replicate."""
        inverse = np.linalg.pinv(fit.hessian, rcond=1e-12, hermitian=True)
        jacobian = self.linearised(fit.matrix)[1]
        total = fit.cost / self.size * inverse
        for spread in (_spread(self.replicated, fit.matrix @ self.axes[0].T), self.target_spread):
            steps = (spread * self.root) @ jacobian.T @ inverse
            total += _inflation(spread) * steps.T @ steps
        return total

    def mismatch(self, matrix: Array) -> float:
        """Largest difference of any moment."""
        return float(np.abs(transformed(self.source, matrix).values - self.target.values).max())


def _spread(moments: Moments, matrix: Array) -> Array:
    """Jackknife replicates [B, K] less their mean, turned by a matrix [n, n]."""
    if not len(moments.replicates):
        return moments.replicates
    empty = np.zeros((0, len(moments.values)))
    turned = [transformed(replace(moments, values=r, replicates=empty), matrix).values for r in moments.replicates]
    return turned - np.mean(turned, axis=0)


def _relative_variance(spread: Array, size: Array, dim: int, order: int) -> Array:
    """Jackknife variance [K] of moments over their size squared, averaged over each degree; zero where exact."""
    if not len(spread):
        return np.zeros(len(size))
    relative = _inflation(spread) * np.sum(spread**2, axis=0) / size
    degree, multiplicity = exponents(dim, order).sum(axis=1), _multiplicity(dim, order)
    means = [np.average(relative[degree == d], weights=multiplicity[degree == d]) for d in range(order + 1)]
    return np.array(means)[degree]


def _inflation(spread: Array) -> float:
    """What the delete-a-group jackknife multiplies sums over its replicates by."""
    return (len(spread) - 1) / max(len(spread), 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fit:
    matrix: Array
    cost: float
    hessian: Array


def moment_fit(
    source: Moments, target: Moments, tuples: tuple[NTuples, NTuples], closed: Procrustes, *, reflections: bool = True
) -> MomentFit:
    """Refine the Procrustes solution, and whatever else could be one, on all moments.

    Args:
        source: normalised moments with their replicates.
        target: the same of the other object, to the same order.
        tuples: n-tuples of both.
        closed: Procrustes solution of the n-tuples.
        reflections: whether determinant -1 is an answer.
    """
    problem = _Problem(source, target)
    a, b = problem.axes
    starts = [s for s in _starts(problem, tuples, closed) if reflections or np.linalg.det(b @ s @ a.T) > 0.0]
    coarse = _distinct(sorted((_descend(problem, s, FIRST_STEPS) for s in starts), key=lambda f: f.cost))
    near = [f for f in coarse if f.cost <= IN_SIGHT * (coarse[0].cost + problem.size)]
    fits = _distinct(sorted((_descend(problem, f.matrix, LAST_STEPS) for f in near), key=lambda f: f.cost))
    best = fits[0]
    exact = [f for f in fits if problem.mismatch(f.matrix) < ROUNDING]
    good = exact or [f for f in fits if f.cost <= max(RIVAL * best.cost, best.cost + PER_MOMENT * problem.size)]
    sigma, free = _observed(problem, exact[0] if exact else best, exact=bool(exact))
    matrices = [b @ f.matrix @ a.T for f in good]
    return MomentFit(
        matrices=np.stack(_one_for_each_part(sorted(matrices, key=lambda m: -np.sign(np.linalg.det(m))), free @ b.T)),
        free=free @ b.T,
        exact=bool(exact),
        sigma_rad=np.inf if len(free) else sigma,
        misfit=best.cost / problem.size,
    )


def _observed(problem: _Problem, fit: _Fit, *, exact: bool) -> tuple[float, Array]:
    """Standard deviation of the rotation, and orthonormal directions [j, n] that undetermined turns move."""
    if not len(fit.hessian):
        return 0.0, np.zeros((0, problem.source.dim))
    values, vectors = np.linalg.eigh(fit.hessian)
    sigma = np.sqrt(max(1.0, fit.cost / problem.size) / np.maximum(values, 1e-300))
    here, there = (problem.turned(m) for m in (transformed(problem.source, fit.matrix).values, problem.target.values))
    shared = np.einsum("aq,ak,bk,bq->q", vectors, here, there, vectors) / np.maximum(values, 1e-300)
    lost = values < 1e-12 * values[-1] if exact else (sigma > UNKNOWN_RAD) | (shared < SHARED)
    moved = [_skew(turn, problem.source.dim) for turn in vectors[:, lost].T]
    if not moved:
        return float(np.sqrt(np.trace(problem.covariance(fit)))), np.zeros((0, len(fit.matrix)))
    u, s, _ = np.linalg.svd(np.concatenate(moved, axis=1))
    return np.inf, u[:, : int((s > 0.3 * s[0]).sum())].T


def _one_for_each_part(matrices: Sequence[Array], free: Array) -> list[Array]:
    """Matrices that differ by more than a map within the free directions, one of either determinant."""
    across = np.eye(free.shape[1]) - free.T @ free
    kept: list[Array] = []
    for m in matrices:
        same = [np.linalg.norm(across @ (m - k)) < SAME and np.linalg.det(m) * np.linalg.det(k) > 0.0 for k in kept]
        if not any(same):
            kept.append(m)
    return kept


def _starts(problem: _Problem, tuples: tuple[NTuples, NTuples], closed: Procrustes) -> list[Array]:
    """In principal axes: Procrustes with both determinants; axes signed as the tuples have it, or any way; a ring."""
    dim, (a, b) = problem.source.dim, problem.axes
    agreement = np.sign(np.sum((tuples[0].vectors @ a) * (tuples[1].vectors @ b), axis=0))
    starts = [b.T @ closed.matrix @ a, b.T @ closed.flipped @ a, np.diag(np.where(agreement == 0.0, 1.0, agreement))]
    if dim == 2:
        angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        turns = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]).transpose(2, 0, 1)
        starts += [*turns, *(turns @ np.diag([1.0, -1.0]))]
    elif closed.rank < dim - 1 and dim <= ALL_SIGNS:
        starts += [np.diag(signs) for signs in product([1.0, -1.0], repeat=dim)]
    return starts


def _descend(problem: _Problem, start: Array, steps: int) -> _Fit:
    """Damped Gauss-Newton."""
    matrix, damping, dim = start, 0.0, len(start)
    r, j = problem.linearised(matrix)
    for _ in range(steps if len(j) else 0):
        hessian = j @ j.T
        ridge = (damping + 1e-12) * np.trace(hessian) + 1e-300
        step = -np.linalg.solve(hessian + ridge * np.eye(len(hessian)), j @ r)
        half = 0.5 * _skew(step, dim)
        trial = np.linalg.solve(np.eye(dim) - half, np.eye(dim) + half) @ matrix  # Cayley: orthogonal for any step
        r_new, j_new = problem.linearised(trial)
        if r_new @ r_new <= r @ r:
            matrix, r, j, damping = trial, r_new, j_new, damping / 10.0
        else:
            damping = max(10.0 * damping, 1e-3)
        if np.linalg.norm(step) < SETTLED:
            break
    u, _, vt = np.linalg.svd(matrix)
    return _Fit(matrix=u @ vt, cost=float(r @ r), hessian=j @ j.T)


def _skew(turn: Array, dim: int) -> Array:
    """The matrix of a small turn [n(n-1)/2]."""
    skew = np.zeros((dim, dim))
    for angle, (i, j) in zip(turn, combinations(range(dim), 2), strict=True):
        skew[i, j], skew[j, i] = -angle, angle
    return skew


def _distinct(fits: Sequence[_Fit]) -> list[_Fit]:
    kept: list[_Fit] = []
    for f in fits:
        if all(np.linalg.norm(f.matrix - k.matrix) > SAME for k in kept):
            kept.append(f)
    return kept
