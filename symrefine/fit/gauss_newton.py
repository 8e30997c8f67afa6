"""Damped Gauss-Newton on small dense problems, one or many side by side; it knows nothing of symmetry."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, ReadOnly
from symrefine.shape import Index


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearisation:
    """Cost `r'r`, gradient `J'r` and Gauss-Newton matrix `J'J` at one point."""

    cost: float
    gradient: Array
    hessian: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearisations:
    """The same at K points: costs [K], gradients [K, n] and matrices [K, n, n]."""

    costs: Array
    gradients: Array
    hessians: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(ReadOnly):
    """Where the iteration stopped, with the evidence: `steps` accepted steps, and whether it converged."""

    x: Array
    cost: float
    hessian: Array
    steps: int
    converged: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """The same for K problems: x [K, ...], costs [K], hessians [K, n, n], accepted steps [K], converged [K]."""

    x: Array
    costs: Array
    hessians: Array
    steps: NDArray[np.intp]
    converged: NDArray[np.bool_]


def minimise(
    linearise: Callable[[Array], Linearisation],
    start: Array,
    *,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = np.inf,
) -> Solution:
    """Minimise `r(x)'r(x)` from `start` by Gauss-Newton steps, damped (Levenberg) only when a step fails to descend.

    Args:
        linearise: cost, gradient [n] and Gauss-Newton matrix [n, n] in small steps from x.
        start: [n], or whatever `move` moves.
        move: x after a step [n].
        max_steps: evaluations after the first.
        tolerance: converged once a step is shorter than this.
        longest: steps are cut to this length.
    """

    def alone(x: Array, _: Index) -> Linearisations:
        here = linearise(x[0])
        return Linearisations(costs=np.array([here.cost]), gradients=here.gradient[None], hessians=here.hessian[None])

    found = minimise_all(
        alone,
        np.array(start, dtype=np.float64)[None],
        move=lambda x, step: move(x[0], step[0])[None],
        max_steps=max_steps,
        tolerance=tolerance,
        longest=longest,
    )
    return Solution(
        x=found.x[0],
        cost=float(found.costs[0]),
        hessian=found.hessians[0],
        steps=int(found.steps[0]),
        converged=bool(found.converged[0]),
    )


def minimise_all(
    linearise: Callable[[Array, Index], Linearisations],
    starts: Array,
    *,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = np.inf,
) -> Solutions:
    """`minimise` from K starts [K, ...] at once; each ends where it would alone.

    Args:
        linearise: at x [A, ...] of those [A] of the starts that have not converged.
        starts: [K, ...].
        move: x [K, ...] after steps [K, n].
        max_steps: evaluations after the first.
        tolerance: a start has converged once its step is shorter than this.
        longest: steps are cut to this length.
    """
    x, first = np.array(starts, dtype=np.float64), linearise(starts, np.arange(len(starts)))
    costs, gradients, hessians = first.costs.copy(), first.gradients.copy(), first.hessians.copy()
    damping, steps = np.zeros(len(x)), np.zeros(len(x), dtype=np.intp)
    converged = np.diagonal(hessians, axis1=1, axis2=2).max(axis=1, initial=0.0) <= 0.0
    for _ in range(max_steps):
        active = np.flatnonzero(~converged)
        if not active.size:
            break
        step = _steps(gradients[active], hessians[active], damping[active])
        length = np.linalg.norm(step, axis=1)
        step *= np.minimum(1.0, longest / np.maximum(length, 1e-300))[:, None]
        trial = move(x[active], step)
        there = linearise(trial, active)
        better = there.costs <= costs[active]
        taken = active[better]
        x[taken], costs[taken] = trial[better], there.costs[better]
        gradients[taken], hessians[taken] = there.gradients[better], there.hessians[better]
        steps[taken] += 1
        damping[active] = np.where(better, damping[active] / 10, np.maximum(10 * damping[active], 1e-4))
        converged[active] = (length < tolerance) | (np.diagonal(hessians[active], axis1=1, axis2=2).max(axis=1) <= 0.0)
    return Solutions(x=x, costs=costs, hessians=hessians, steps=steps, converged=converged)


def _steps(gradients: Array, hessians: Array, damping: Array) -> Array:
    """Damped Gauss-Newton steps [K, n]."""
    scale = np.diagonal(hessians, axis1=1, axis2=2).max(axis=1)
    damped = hessians + (scale * np.maximum(damping, 1e-12))[:, None, None] * np.eye(gradients.shape[1])
    return np.asarray(-np.linalg.solve(damped, gradients[:, :, None])[:, :, 0])
