"""Levenberg-Marquardt as MINPACK's `lmdif` does it, in a few lines, and the same to the last bit in every run.

More, "The Levenberg-Marquardt Algorithm: Implementation and Theory" (1978): forward differences; a step is the best one
within a scaled region of trust, its damping found by Newton's iteration on the length of the step. The compiled MINPACK
gives steps whose last bits depend on where its arrays lie in memory, and the unknowns without effect that the baseline
has magnify that to other counts of evaluations. Here the scaled Jacobian is taken apart by singular values instead of
QR; the steps are MINPACK's but for rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from symrefine.geometry import Array

# MINPACK's constants: how well the length of a step has to fit the region, corrections of the damping for that,
LENGTH_FIT = 0.1
MOST_CORRECTIONS = 10
# and shares of the predicted decrease: a step is undone below the first, the region shrinks up to the second and grows
# from the third on.
ACCEPTED, POOR, GOOD = 1e-4, 0.25, 0.75
TINY = float(np.finfo(np.float64).tiny)
EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slope:
    """The linearised problem with scaled unknowns, taken apart.

    Attributes:
        values: [r] singular values of the scaled Jacobian, without those that are rounding.
        right: [r, n] right singular vectors as rows.
        residual: [r] the residual along the left ones.
        full: whether r = n.
    """

    values: Array
    right: Array
    residual: Array
    full: bool

    def step(self, damping: float) -> Array:
        """Scaled step along the singular vectors [r], its sign reversed."""
        return self.values * self.residual / (self.values**2 + damping)

    def correction(self, step: Array, radius: float, damping: float) -> float:
        """Newton's change of the damping towards a step of length `radius`."""
        length = _length(step)
        direction = step / length
        return (length - radius) / radius / float((direction**2 / (self.values**2 + damping)).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What a step promised and what it gave, as shares of the sum of squares before it.

    Attributes:
        linear: decrease by the linearised residual alone.
        damped: damping times the squared length of the step.
        gain: decrease found; -1 if the residual grew tenfold.
    """

    linear: float
    damped: float
    gain: float

    @property
    def predicted(self) -> float:
        """Decrease that the linearised problem promised."""
        return self.linear + 2.0 * self.damped

    @property
    def ratio(self) -> float:
        """Decrease found over promised."""
        return self.gain / self.predicted if self.predicted > 0.0 else 0.0

    def region(self, radius: float, length: float, damping: float) -> tuple[float, float]:
        """Radius of trust and damping after this step of the given length."""
        if self.ratio <= POOR:
            slope = self.linear + self.damped
            share = 0.5 if self.gain >= 0.0 else max(0.1, 0.5 * slope / (slope - 0.5 * self.gain))
            share = 0.1 if self.gain == -1.0 else share
            return share * min(radius, length / LENGTH_FIT), damping / share
        if damping == 0.0 or self.ratio >= GOOD:
            return 2.0 * length, 0.5 * damping
        return radius, damping


def least_squares(
    residuals: Callable[[Array], Array], start: Array, *, tolerance: float, max_evaluations: int, step_bound: float
) -> tuple[Array, int]:
    """A minimum of the sum of squares near `start` [n], and how often a residual was evaluated.

    Args:
        residuals: of rows of unknowns [k, n], as rows [k, m]; to the last bit the same for one row as for several, or
            else unknowns without effect seem to have one.
        tolerance: relative: of the sum of squares, of the unknowns (MINPACK's `ftol`, `xtol`), of the differences.
        max_evaluations: once reached no further step is tried.
        step_bound: the first radius of trust, in scaled lengths of `start`.
    """
    x, f = start, residuals(start[None])[0]
    evaluations, scale, radius, damping = 1, np.zeros_like(start), -1.0, 0.0
    while True:
        jacobian = _jacobian(residuals, x, f, tolerance)
        evaluations += len(x)
        scale = np.maximum(scale, np.sqrt((jacobian**2).sum(axis=0)))
        scale[scale == 0.0] = 1.0
        if not np.any(jacobian.T @ f):
            return x, evaluations
        first = radius < 0.0
        if first:
            radius = step_bound * _length(scale * x) or step_bound
        slope, trial = _slope(jacobian / scale, f), None
        while trial is None or trial.ratio < ACCEPTED:
            damping, step = damped_step(slope, radius, damping)
            length = _length(step)
            radius = min(radius, length) if first else radius
            moved = x - (step @ slope.right) / scale
            tried = residuals(moved[None])[0]
            evaluations += 1
            trial = _trial(slope, step, damping, float(f @ f), float(tried @ tried))
            radius, damping = trial.region(radius, length, damping)
            if trial.ratio >= ACCEPTED:
                x, f = moved, tried
            if _done(trial, radius, _length(scale * x), tolerance) or evaluations >= max_evaluations:
                return x, evaluations


def _done(trial: Trial, radius: float, length: float, tolerance: float) -> bool:
    still = abs(trial.gain) <= tolerance and trial.predicted <= tolerance and trial.ratio <= 2.0
    return still or radius <= tolerance * length


def _jacobian(residuals: Callable[[Array], Array], x: Array, f: Array, tolerance: float) -> Array:
    """Forward differences [m, n]."""
    h = tolerance * np.abs(x)
    h[h == 0.0] = tolerance
    return (residuals(x + np.diag(h)) - f).T / h


def _slope(scaled: Array, f: Array) -> Slope:
    left, values, right = np.linalg.svd(scaled, full_matrices=False)
    kept = values > EPS * max(scaled.shape) * values[0]
    return Slope(values=values[kept], right=right[kept], residual=f @ left[:, kept], full=bool(kept.all()))


def _trial(slope: Slope, step: Array, damping: float, before: float, after: float) -> Trial:
    linear = slope.values * step
    return Trial(
        linear=float(linear @ linear) / before,
        damped=damping * float(step @ step) / before,
        gain=1.0 - after / before if 0.01 * after < before else -1.0,
    )


def damped_step(slope: Slope, radius: float, damping: float) -> tuple[float, Array]:
    """Damping, from the last one, with which a step is as long as the radius to a tenth, and that step (`lmpar`).

    Where the undamped step is no longer than that it is taken, with damping 0.
    """
    step = slope.step(0.0)
    excess = _length(step) - radius
    if excess <= LENGTH_FIT * radius:
        return 0.0, step
    steepest = _length(slope.values * slope.residual)
    low = slope.correction(step, radius, 0.0) if slope.full else 0.0
    high = steepest / radius or TINY / min(radius, 0.1)
    damping = min(max(damping, low), high) or steepest / _length(step)
    for k in range(MOST_CORRECTIONS):
        damping = damping or max(TINY, 0.001 * high)
        step = slope.step(damping)
        last, excess = excess, _length(step) - radius
        fits = abs(excess) <= LENGTH_FIT * radius or (low == 0.0 and excess <= last < 0.0)
        if fits or k == MOST_CORRECTIONS - 1:
            break
        low, high = (max(low, damping), high) if excess > 0.0 else (low, min(high, damping))
        damping = max(low, damping + slope.correction(step, radius, damping))
    return damping, step


def _length(vector: Array) -> float:
    return sqrt(vector @ vector)
