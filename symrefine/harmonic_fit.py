"""Orthogonal maps between two objects from all their harmonic moments: candidates over O(3), and Gauss-Newton on it.

Under x -> R x the harmonic moments of degree l turn by the orthogonal D_l(R) (`harmonics`), det R = -1 included with
D_l(-R) = (-1)^l D_l(R). What R explains the pair is the least squares problem

    cost(R) = sum_(l,p) w_lp |D_l(R) a_lp - b_lp|^2 = const - 2 sum_l tr(D_l(R) K_l),   K_l = sum_p w_lp a_lp b_lp',

with weights from the sampling noise of both sides. The second form is linear in D_l, so a table of D_l over an even
grid of rotations gives the whole landscape, both determinants at once, in one matrix product.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symrefine.geometry import Array, read_only, rotation
from symrefine.harmonics import generators, harmonic_moments, turn
from symrefine.moments import Moments
from symrefine.spectrum import whitened

# Rotations of the grid: 11 degrees to the nearest one at worst, against a peak of 30 degrees across at degree 6.
GRID = 6000
GRID_DEGREE = 6
# Candidates nearer than this are the same hill.
APART_RAD = 0.35
# Variance below which a coefficient is taken as known, in units of its bound: the tolerance of a model, not of rounding.
FLOOR = 1e-8
# Longest step of the Gauss-Newton, radians.
STEP = 0.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicPair:
    """Coefficients of both objects that D_l(R) should map onto each other.

    Attributes:
        source: {l: [P, 2l+1]}.
        target: {l: [P, 2l+1]}.
        weights: {l: [P]} inverse variances of the difference of the two.
    """

    source: dict[int, Array]
    target: dict[int, Array]
    weights: dict[int, Array]


def harmonic_pair(source: Moments, target: Moments) -> HarmonicPair:
    """All harmonic moments of both objects, weighted by the jackknife variances of both sides."""
    a, b = harmonic_moments(source), harmonic_moments(target)
    return HarmonicPair(
        source={l: c[0] for l, c in a.items()},
        target={l: c[0] for l, c in b.items()},
        weights={l: 1.0 / (_variance(a[l]) + _variance(b[l]) + FLOOR) for l in a},
    )


def _variance(c: Array) -> Array:
    """Sampling variance [P] of a component of each coefficient [1 + B, P, 2l+1]; zero where the moments are exact."""
    parts = len(c) - 1
    if parts == 0:
        return np.zeros(c.shape[1])
    return np.asarray((parts - 1) * c[1:].var(axis=0).mean(axis=1))


def _spin(c: Array, angle_rad: Array) -> Array:
    """D_l(R_z(angle)) c for coefficients [K, ..., 2l+1] and one angle [K] each: m and -m mix, nothing else does."""
    l = c.shape[-1] // 2
    phase = np.multiply.outer(angle_rad, np.arange(1, l + 1))
    phase = phase.reshape(phase.shape[:1] + (1,) * (c.ndim - 2) + phase.shape[1:])
    cosine, sine = np.cos(phase), np.sin(phase)
    up, down = c[..., l + 1 :], c[..., :l][..., ::-1]
    out = np.empty(np.broadcast_shapes(c.shape, (len(angle_rad), *c.shape[1:])))
    out[..., l] = c[..., l]
    out[..., l + 1 :] = cosine * up - sine * down
    out[..., :l] = (sine * up + cosine * down)[..., ::-1]
    return out


@lru_cache(maxsize=32)
def _tip(l: int) -> Array:
    """D_l of the quarter turn about x, which takes R_y(b) to R_z(b)."""
    return read_only(turn(l, 0, np.array(np.pi / 2)))


def euler_zyz(rotations: Array) -> tuple[Array, Array, Array]:
    """Angles (a, b, c) [K] with R = R_z(a) R_y(b) R_z(c), accurate at the poles of b too."""
    r = rotations
    a = np.arctan2(r[:, 1, 2], r[:, 0, 2])
    b = np.arctan2(np.hypot(r[:, 0, 2], r[:, 1, 2]), r[:, 2, 2])
    # What is left after R_z(-a): its second row is (sin c, cos c, 0) whatever b is.
    c = np.arctan2(
        np.cos(a) * r[:, 1, 0] - np.sin(a) * r[:, 0, 0], np.cos(a) * r[:, 1, 1] - np.sin(a) * r[:, 0, 1]
    )
    return a, b, c


def turned(l: int, matrices: Array, c: Array) -> Array:
    """D_l(R) c [K, P, 2l+1] for orthogonal matrices [K, 3, 3] of either determinant and coefficients [P, 2l+1]."""
    sign = np.sign(np.linalg.det(matrices))
    first, second, third = euler_zyz(matrices * sign[:, None, None])
    spun = _spin(np.broadcast_to(c, (len(matrices), *c.shape)), third) @ _tip(l).T
    out = _spin(_spin(spun, second) @ _tip(l), first)
    return np.asarray(out * (sign**l)[:, None, None])


@lru_cache(maxsize=1)
def grid_rotations() -> Array:
    """Even rotations [GRID, 3, 3] (super-Fibonacci spirals, Alexa 2022)."""
    i = np.arange(GRID) + 0.5
    t = i / GRID
    alpha = 2.0 * np.pi * i / np.sqrt(2.0)
    beta = 2.0 * np.pi * i / 1.533751168755204288118041
    low, high = np.sqrt(t), np.sqrt(1.0 - t)
    x, y, z, w = low * np.sin(alpha), low * np.cos(alpha), high * np.sin(beta), high * np.cos(beta)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return read_only(np.moveaxis(np.array(rows), 2, 0))


@lru_cache(maxsize=8)
def _grid_table(l: int) -> Array:
    """D_l over the grid, [GRID, (2l+1)^2], single precision: it only ranks."""
    columns = turned(l, grid_rotations(), np.eye(2 * l + 1))  # row j holds D_l e_j
    return np.ascontiguousarray(np.swapaxes(columns, 1, 2).reshape(GRID, -1), dtype=np.float32)  # type: ignore[return-value]


def landscape(source: Moments, target: Moments) -> tuple[Array, Array]:
    """Score of every rotation R of the grid, and of -R: the correlation of the two objects, [GRID] each.

    The objects are whitened first, so that what lies around a long axis counts as much as the axis; the covariance
    joins as one more set of l = 2. Each row counts by its share of what is known, bounded by its noise.
    """
    rows = _grid_rows(source, target)
    even, odd = np.zeros(GRID, dtype=np.float32), np.zeros(GRID, dtype=np.float32)
    for l, (a, b, w) in rows.items():
        kernel = np.einsum("p,pi,pj->ij", w, b, a).ravel().astype(np.float32)
        (odd if l % 2 else even)[:] += _grid_table(l) @ kernel
    return even + odd, even - odd


def _grid_rows(source: Moments, target: Moments) -> dict[int, tuple[Array, Array, Array]]:
    pair = harmonic_pair(source, target)
    white_a, white_b = harmonic_moments(whitened(source)), harmonic_moments(whitened(target))
    rows = {}
    for l in range(1, min(GRID_DEGREE, source.order) + 1):
        a, b, w = white_a[l][0], white_b[l][0], pair.weights[l]
        if l == 2:
            a, b, w = np.concatenate([a[1:], pair.source[2][:1]]), np.concatenate([b[1:], pair.target[2][:1]]), w[[*range(1, len(w)), 0]]
        strength = np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
        rows[l] = (a, b, 1.0 / (strength + (2 * l + 1) / w + 1e-3))
    return rows


def grid_candidates(source: Moments, target: Moments, *, count: int, det: int) -> Array:
    """The `count` best hills of the landscape, as matrices [count, 3, 3] of determinant `det`."""
    scores = landscape(source, target)[0 if det > 0 else 1].copy()
    rotations = grid_rotations()
    flat = rotations.reshape(GRID, 9)
    near = 1.0 + 2.0 * np.cos(APART_RAD)
    chosen = []
    for _ in range(count):
        best = int(np.argmax(scores))
        if not np.isfinite(scores[best]):
            break
        chosen.append(det * rotations[best])
        scores[flat @ flat[best] > near] = -np.inf
    return np.array(chosen).reshape(-1, 3, 3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicFit:
    """Matrices [K, 3, 3] after Gauss-Newton, their costs [K], and the Gauss-Newton matrices [K, 3, 3] in target axes."""

    matrices: Array
    costs: Array
    hessians: Array


def fit(pair: HarmonicPair, starts: Array, *, steps: int = 10) -> HarmonicFit:
    """Gauss-Newton on O(3) over all harmonic moments from each start [K, 3, 3]; the determinants stay.

    A small rotation w of the target's axes changes D_l(R) a by (w.J) D_l(R) a with the generators J, so the Jacobian
    costs no more than the residual.
    """
    matrices = np.array(starts, dtype=np.float64)
    costs, gradients, hessians = _linearised(pair, matrices)
    for _ in range(steps):
        ridge = 1e-12 * np.trace(hessians, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-300 * np.eye(3)
        step = -np.linalg.solve(hessians + ridge, gradients[:, :, None])[:, :, 0]
        length = np.linalg.norm(step, axis=1)
        step *= np.minimum(1.0, STEP / np.maximum(length, 1e-300))[:, None]
        trial = np.stack([rotation(w, float(np.linalg.norm(w))) @ m if w.any() else m for w, m in zip(step, matrices, strict=True)])
        costs_new, gradients_new, hessians_new = _linearised(pair, trial)
        better = costs_new <= costs
        matrices = np.where(better[:, None, None], trial, matrices)
        gradients = np.where(better[:, None], gradients_new, 0.25 * gradients)
        hessians = np.where(better[:, None, None], hessians_new, hessians)
        costs = np.where(better, costs_new, costs)
        if length.max() < 1e-13:
            break
    return HarmonicFit(matrices=_orthonormal(matrices), costs=costs, hessians=hessians)


def _linearised(pair: HarmonicPair, matrices: Array) -> tuple[Array, Array, Array]:
    costs, gradients, hessians = 0.0, 0.0, 0.0
    for l, a in pair.source.items():
        here = turned(l, matrices, a)
        root = np.sqrt(pair.weights[l])[:, None]
        residual = ((here - pair.target[l]) * root).reshape(len(matrices), -1)
        jacobian = np.stack([((here @ j.T) * root).reshape(len(matrices), -1) for j in generators(l)], axis=1)
        costs = costs + np.einsum("ki,ki->k", residual, residual)
        gradients = gradients + np.einsum("kai,ki->ka", jacobian, residual)
        hessians = hessians + jacobian @ np.swapaxes(jacobian, 1, 2)
    return costs, gradients, hessians  # type: ignore[return-value]


def _orthonormal(matrices: Array) -> Array:
    u, _, vt = np.linalg.svd(matrices)
    return np.asarray(u @ vt)
