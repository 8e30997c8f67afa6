"""Orthogonal maps between two objects from numbers that turn with them: Gauss-Newton on O(n) over all moments at once.

    cost(R) = sum_c w_c (D(R) a - b)_c^2

with D the action of R on the moments and weights from the sampling noise of both sides. A small turn of the target's
axes changes D(R) a by the generators applied to it, so the Jacobian costs no more than the residual.
Small turns are counted alike for all actions: one for every plane (i, j) with `dx_i = -x_j, dx_j = x_i`, about x, y and
z in 3-space.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symrefine.fit.gauss_newton import Linearisations, minimise_all
from symrefine.fit.refine import MAX_OUTER, WITHIN_NOISE
from symrefine.geometry import Array, orthogonal_factor
from symrefine.moments.harmonics import FLOOR
from symrefine.moments.moments import deviations
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.shape import Index

# Longest step (radians): less than half a period of order 8, the finest that moments see. Maps nearer than this
# (Frobenius norm) are one.
LONGEST = 0.3
# Cost per number above which the moments differ: numbers of one object err together, and what all miss by so many
# standard deviations costs its square.
MISFIT = SIGNIFICANT**2
# Moments that agree to this are those of the same points: some hundred roundings. A step of this
# (radians) ends the fit: quadratic convergence then leaves 1e-14.
ROUNDING = 1e-7


class Action(Protocol):
    """A linear action of O(n) on C numbers of an object."""

    def turned(self, matrices: Array, values: Array) -> Array:
        """D(R) v [K, P, C] of numbers [P, C] under orthogonal matrices [K, n, n]."""
        ...

    def tangents(self, values: Array) -> Array:
        """Derivatives [K, A, C] of numbers [K, C] by the A small turns."""
        ...


def planes(dim: int) -> list[tuple[int, int]]:
    """Planes (i, j) of the small turns, in which i turns towards j: about x, y and z in 3-space."""
    return [(1, 2), (2, 0), (0, 1)] if dim == 3 else list(combinations(range(dim), 2))


def skew(turns: Array, dim: int) -> Array:
    """Skew matrices [K, n, n] of small turns [K, n(n-1)/2]."""
    out = np.zeros((len(turns), dim, dim))
    for k, (i, j) in enumerate(planes(dim)):
        out[:, i, j], out[:, j, i] = -turns[:, k], turns[:, k]
    return out


def turned_by(matrices: Array, turns: Array) -> Array:
    """Matrices [K, n, n] after small turns [K, n(n-1)/2] (Cayley: orthogonal for a turn of any size)."""
    half, one = 0.5 * skew(turns, matrices.shape[1]), np.eye(matrices.shape[1])
    return np.linalg.solve(one - half, (one + half) @ matrices)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MomentPair:
    """Numbers of both objects that D(R) should map onto each other.

    Attributes:
        source: [1 + B, C], the whole first, then its jackknife replicates.
        target: [1 + B', C].
        weights: [C] inverse variances of the difference of the two; zero for numbers that say nothing.
        action: of O(n) on the numbers.
    """

    source: Array
    target: Array
    weights: Array
    action: Action

    @property
    def size(self) -> int:
        """Number of numbers compared."""
        return int((self.weights > 0.0).sum())

    def moved(self, matrices: Array) -> Array:
        """D(R) a [K, C] under matrices [K, n, n]."""
        return self.action.turned(matrices, self.source[:1])[:, 0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fits:
    """Orthogonal matrices R [K, n, n] by rising cost [K], their Gauss-Newton matrices [K, A, A], and D(R) a [K, C]."""

    matrices: Array
    costs: Array
    hessians: Array
    moved: Array

    def __getitem__(self, index: slice | NDArray[Any] | Sequence[int]) -> "Fits":
        parts = (self.matrices, self.costs, self.hessians, self.moved)
        matrices, costs, hessians, moved = (part[index] for part in parts)
        return Fits(matrices=matrices, costs=costs, hessians=hessians, moved=moved)

    @property
    def signs(self) -> Array:
        """Determinants [K]."""
        return np.sign(np.linalg.det(self.matrices))


def fit(pair: MomentPair, starts: Array) -> Fits:
    """Gauss-Newton from each start [K, n, n]; the determinants stay.

    A step well within what the numbers misfit by ends it: the wrong determinant misfits so that it converges slowly.
    """
    root = np.sqrt(pair.weights)

    def linearise(matrices: Array, _: Index) -> Linearisations:
        here = pair.moved(matrices)
        r, j = root * (here - pair.target[0]), root * pair.action.tangents(here)
        return Linearisations(
            costs=np.einsum("ki,ki->k", r, r), gradients=(j @ r[:, :, None])[:, :, 0], hessians=j @ j.transpose(0, 2, 1)
        )

    found = minimise_all(
        linearise,
        starts,
        move=turned_by,
        max_steps=MAX_OUTER,
        tolerance=ROUNDING,
        longest=LONGEST,
        least=WITHIN_NOISE**2 * len(planes(starts.shape[1])) / pair.size,
    )
    order, matrices = np.argsort(found.costs, kind="stable"), orthogonal_factor(found.x)
    return Fits(matrices=matrices, costs=found.costs, hessians=found.hessians, moved=pair.moved(matrices))[order]


def best_fits(pair: MomentPair, starts: Array) -> Fits:
    """Distinct maps by rising cost, from starts [K, n, n]."""
    fits = fit(pair, starts)
    kept: list[int] = []
    for i, m in enumerate(fits.matrices):
        if all(np.linalg.norm(m - fits.matrices[k]) > LONGEST for k in kept):
            kept.append(i)
    return fits[kept]


def as_good(pair: MomentPair, fits: Fits) -> NDArray[np.bool_]:
    """Which [K] of the fits sampling noise cannot tell from the first.

    With d = D(R) a - D(R') a the difference of the costs is linear in the residual r = D(R) a - b, namely
    `|d|^2 - 2 d.r`; its noise is that of 2 d.r. Unlike the costs themselves, whose many numbers err together, this
    tells chiral objects (3.6 standard deviations and more on 10,000 points) from mirror-symmetric ones (below 2.5).
    """
    moved = fits.moved
    costs, directions = (moved - pair.target[0]) ** 2 @ pair.weights, pair.weights * (moved[0] - moved)
    variances = np.diag(_jackknife(pair, fits.matrices[:1], directions)) + FLOOR * (directions**2).sum(axis=1)
    unlike = max(1.0, float(costs[0]) / pair.size)
    return np.asarray(costs - costs[0] <= 2.0 * SIGNIFICANT * np.sqrt(unlike * variances))


def exact(pair: MomentPair, fits: Fits) -> Fits:
    """The fits after which every number agrees to rounding."""
    return fits[np.abs(fits.moved - pair.target[0]).max(axis=1) < ROUNDING]


def misfit(pair: MomentPair, fits: Fits) -> float:
    """Cost of the best fit per number; about 1 or below if sampling noise explains it."""
    return float(fits.costs[0]) / pair.size


def covariance(pair: MomentPair, fits: Fits) -> Array:
    """Covariance [A, A] of the best fit's turn (target axes), by the jackknife and from what the numbers misfit.

    The numbers of one object share their points, so their errors are correlated and the inverse of the Gauss-Newton
    matrix is too small by up to a factor of fifty; re-fitting the replicates, by one step, is not.
    """
    matrix, inverse = fits.matrices[:1], np.linalg.pinv(fits.hessians[0], rcond=1e-12, hermitian=True)
    tangents = pair.action.tangents(fits.moved[:1])[0] * pair.weights
    return inverse @ _jackknife(pair, matrix, tangents) @ inverse + max(1.0, misfit(pair, fits)) * inverse


def _jackknife(pair: MomentPair, matrix: Array, directions: Array) -> Array:
    """Jackknife covariance [A, A] of the residual `D(R) a - b` along directions [A, C], at a matrix [1, n, n]."""
    both = pair.action.turned(matrix, pair.source[1:])[0], pair.target[1:]
    along = np.concatenate([deviations(replicates) for replicates in both]) @ directions.T
    return along.T @ along


def unlikely(misfit: float) -> float:
    """What moments differ by, over what sampling explains."""
    return float(np.sqrt(misfit / MISFIT))
