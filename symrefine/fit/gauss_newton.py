"""Damped Gauss-Newton on a small dense problem; it knows nothing of symmetry."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, read_only


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearisation:
    """Cost `r'r`, gradient `J'r` and Gauss-Newton matrix `J'J` at one point."""

    cost: float
    gradient: Array
    hessian: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Where the iteration stopped, with the evidence: `steps` accepted steps, and whether it converged."""

    x: Array
    cost: float
    hessian: Array
    steps: int
    converged: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", read_only(self.x))
        object.__setattr__(self, "hessian", read_only(self.hessian))


def minimise(
    linearise: Callable[[Array], Linearisation], start: Array, *, max_steps: int = 6, tolerance: float = 1e-6
) -> Solution:
    """Minimise `r(x)'r(x)` from `start` by Gauss-Newton steps, damped (Levenberg) only when a step fails to descend.

    Args:
        linearise: cost, gradient and Gauss-Newton matrix at x [n].
        start: [n].
        max_steps: evaluations after the first.
        tolerance: converged once a step is shorter than this.
    """
    x, here = np.array(start, dtype=np.float64), linearise(start)
    damping, taken = 0.0, 0
    for _ in range(max_steps):
        scale = np.diag(here.hessian).max()
        if scale <= 0.0:
            return Solution(x=x, cost=here.cost, hessian=here.hessian, steps=taken, converged=True)
        matrix = here.hessian + scale * max(damping, 1e-12) * np.eye(x.size)
        step = -np.linalg.solve(matrix, here.gradient)
        trial = linearise(x + step)
        if trial.cost <= here.cost:
            x, here, damping, taken = x + step, trial, damping / 10, taken + 1
        else:
            damping = max(10 * damping, 1e-4)
        if np.linalg.norm(step) < tolerance:
            return Solution(x=x, cost=here.cost, hessian=here.hessian, steps=taken, converged=True)
    return Solution(x=x, cost=here.cost, hessian=here.hessian, steps=taken, converged=False)
