"""Damped Gauss-Newton on small dense problems, one or many side by side; it knows nothing of symmetry."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from symrefine.geometry import Array, ReadOnly
from symrefine.shape import Index


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearisation:
    """Cost `r'r`, gradient `J'r` [n] and Gauss-Newton matrix `J'J` [n, n] at one point; or of K, [K] in front."""

    cost: Any
    gradient: Array
    hessian: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(ReadOnly):
    """Where the iteration stopped, with the evidence: `steps` accepted steps, and whether it converged.

    Of K problems side by side all have [K] in front.
    """

    x: Array
    cost: Any
    hessian: Array
    steps: Any
    converged: Any


def minimise(
    linearise: Callable[[Array], Linearisation],
    start: Array,
    *,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = math.inf,
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

    def alone(x: Array, _: Index) -> Linearisation:
        here = linearise(x[0])
        return Linearisation(cost=np.array([here.cost]), gradient=here.gradient[None], hessian=here.hessian[None])

    found = minimise_all(
        alone,
        start[None],
        move=lambda x, step: move(x[0], step[0])[None],
        max_steps=max_steps,
        tolerance=tolerance,
        longest=longest,
    )
    return Solution(
        x=found.x[0],
        cost=float(found.cost[0]),
        hessian=found.hessian[0],
        steps=int(found.steps[0]),
        converged=bool(found.converged[0]),
    )


def minimise_all(
    linearise: Callable[[Array, Index], Linearisation],
    starts: Array,
    *,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = math.inf,
    least: float = 0.0,
) -> Solution:
    """`minimise` from K starts [K, ...] at once; each ends where it would alone, or sooner with `least`.

    Args:
        linearise: at x [A, ...] of those [A] of the starts that have not converged.
        starts: [K, ...].
        move: x [K, ...] after steps [K, n].
        max_steps: evaluations after the first.
        tolerance: a start has converged once its step is shorter than this.
        longest: steps are cut to this length.
        least: it has as well once a step that it took was promised to lower the cost by less than this share.
    """
    x, first = np.array(starts, dtype=np.float64), linearise(starts, np.arange(len(starts)))
    costs, gradients, hessians = first.cost.copy(), first.gradient.copy(), first.hessian.copy()
    damping, steps = np.zeros(len(x)), np.zeros(len(x), dtype=np.intp)
    converged = np.trace(hessians, axis1=1, axis2=2) <= 0.0
    for _ in range(max_steps):
        active = np.flatnonzero(~converged)
        if not active.size:
            break
        step = _steps(gradients[active], hessians[active], damping[active])
        length, gain = np.linalg.norm(step, axis=1), -np.einsum("ki,ki->k", gradients[active], step)
        step *= np.minimum(1.0, longest / np.maximum(length, 1e-300))[:, None]
        trial, worth = move(x[active], step), gain >= least * costs[active]
        there = linearise(trial, active)
        better = there.cost <= costs[active]
        taken = active[better]
        x[taken], costs[taken] = trial[better], there.cost[better]
        gradients[taken], hessians[taken] = there.gradient[better], there.hessian[better]
        steps[taken] += 1
        damping[active] = np.where(better, damping[active] / 10, np.maximum(10 * damping[active], 1e-4))
        converged[active] = (
            (length < tolerance) | (better & ~worth) | (np.trace(hessians[active], axis1=1, axis2=2) <= 0.0)
        )
    return Solution(x=x, cost=costs, hessian=hessians, steps=steps, converged=converged)


def _steps(gradients: Array, hessians: Array, damping: Array) -> Array:
    """Damped Gauss-Newton steps [K, n], by shares [K] of the largest curvature."""
    scale = np.diagonal(hessians, axis1=1, axis2=2).max(axis=1)
    added = scale * np.maximum(damping, 1e-12)
    damped = hessians + added[:, None, None] * np.eye(gradients.shape[-1])
    return np.asarray(-np.linalg.solve(damped, gradients[..., None])[..., 0])
