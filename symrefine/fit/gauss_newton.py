"""Damped Gauss-Newton on small dense problems, one or many side by side; it knows nothing of symmetry."""

import math
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
    first: Linearisation | None = None,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = math.inf,
) -> Solution:
    """Minimise `r(x)'r(x)` from `start` by Gauss-Newton steps, damped (Levenberg) only when a step fails to descend.

    Args:
        linearise: cost, gradient [n] and Gauss-Newton matrix [n, n] in small steps from x.
        start: [n], or whatever `move` moves.
        first: what `linearise` says of the start, if that is known.
        move: x after a step [n].
        max_steps: evaluations after the first.
        tolerance: converged once a step is shorter than this.
        longest: steps are cut to this length.
    """
    x: Array = np.array(start, dtype=np.float64)
    here = first or linearise(start)
    damping: Array = np.zeros(())
    steps, converged = 0, here.hessian.trace() <= 0.0
    for _ in range(max_steps):
        if converged:
            break
        step = _steps(here.gradient, here.hessian, damping)
        length = math.sqrt(step @ step)
        trial = move(x, step if length <= longest else step * (longest / length))
        there = linearise(trial)
        better = there.cost <= here.cost
        if better:
            x, here, steps = trial, there, steps + 1
        damping = _next_damping(damping, better)
        converged = length < tolerance or here.hessian.trace() <= 0.0
    return Solution(x=x, cost=here.cost, hessian=here.hessian, steps=steps, converged=bool(converged))


def minimise_all(
    linearise: Callable[[Array, Index], Linearisations],
    starts: Array,
    *,
    move: Callable[[Array, Array], Array] = np.add,
    max_steps: int = 6,
    tolerance: float = 1e-6,
    longest: float = np.inf,
    least: float = 0.0,
) -> Solutions:
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
    costs, gradients, hessians = first.costs.copy(), first.gradients.copy(), first.hessians.copy()
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
        better = there.costs <= costs[active]
        taken = active[better]
        x[taken], costs[taken] = trial[better], there.costs[better]
        gradients[taken], hessians[taken] = there.gradients[better], there.hessians[better]
        steps[taken] += 1
        damping[active] = _next_damping(damping[active], better)
        converged[active] = (
            (length < tolerance) | (better & ~worth) | (np.trace(hessians[active], axis1=1, axis2=2) <= 0.0)
        )
    return Solutions(x=x, costs=costs, hessians=hessians, steps=steps, converged=converged)


def _next_damping(damping: Array, better: bool | NDArray[np.bool_]) -> Array:
    """Damping [...] after steps, from that before them and whether they descended."""
    return np.where(better, damping / 10, np.maximum(10 * damping, 1e-4))


def _steps(gradients: Array, hessians: Array, damping: Array) -> Array:
    """Damped Gauss-Newton steps [..., n], by shares [...] of the largest curvature."""
    scale = np.diagonal(hessians, axis1=-2, axis2=-1).max(axis=-1)
    added = scale * np.maximum(damping, 1e-12)
    damped = hessians + added[..., None, None] * np.eye(gradients.shape[-1])
    return np.asarray(-np.linalg.solve(damped, gradients[..., None])[..., 0])
