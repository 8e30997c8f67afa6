"""The whole landscape of O(3) from harmonic moments: which maps of an even grid take one object nearest to another.

The correlation `sum_l tr(D_l(R) K_l')`, `K_l = sum_p b_lp a_lp'`, is linear in D_l, so a table of D_l over the grid
gives it for every rotation R and every -R in one matrix product, D_l(-R) being (-1)^l D_l(R).
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from symrefine.align.moment_fit import LONGEST, MomentPair
from symrefine.geometry import Array, read_only
from symrefine.moments.harmonics import FLOOR, Harmonics, flattened, harmonic_moments, row_variance
from symrefine.moments.moments import Moments, deviations, exponents
from symrefine.propose.spectrum import whitened

# Rotations of the grid: 11 degrees to the nearest one at worst, against hills 30 degrees wide at degree 6.
GRID, GRID_DEGREE = 6000, 6


def harmonic_pair(source: Moments, target: Moments) -> MomentPair:
    """All harmonic moments of both objects, weighted by the jackknife variances of both sides."""
    (a, rows), (b, _) = (flattened(harmonic_moments(m)) for m in (source, target))
    variance = row_variance(a[1:], rows) + row_variance(b[1:], rows) + FLOOR
    return MomentPair(source=a, target=b, weights=1.0 / variance, action=Harmonics(rows=rows))


def least_misfit(pair: MomentPair) -> float:
    """Cost per number of a harmonic pair below which no orthogonal map comes: that of the lengths which all keep."""
    assert isinstance(pair.action, Harmonics)
    starts = np.cumsum([0, *(2 * l + 1 for l in pair.action.rows[:-1])])
    source, target = (np.sqrt(np.add.reduceat(v[0] ** 2, starts)) for v in (pair.source, pair.target))
    return float(pair.weights[starts] @ (source - target) ** 2) / pair.size


@lru_cache(maxsize=1)
def grid_rotations() -> Array:
    """Even rotations [GRID, 3, 3] (super-Fibonacci spirals; Alexa 2022)."""
    i = np.arange(GRID) + 0.5
    low, high = np.sqrt(i / GRID), np.sqrt(1.0 - i / GRID)
    alpha, beta = 2.0 * np.pi * i / np.sqrt(2.0), 2.0 * np.pi * i / 1.533751168755204288118041
    x, y, z, w = low * np.sin(alpha), low * np.cos(alpha), high * np.sin(beta), high * np.cos(beta)
    half = [
        [-y * y - z * z, x * y - z * w, x * z + y * w],
        [x * y + z * w, -x * x - z * z, y * z - x * w],
        [x * z - y * w, y * z + x * w, -x * x - y * y],
    ]
    return read_only(np.eye(3) + 2.0 * np.array(half).transpose(2, 0, 1))


@lru_cache(maxsize=GRID_DEGREE)
def _grid_table(l: int) -> "np.ndarray[tuple[int, int], np.dtype[np.float32]]":
    """D_l over the grid, [GRID, (2l+1)^2], transposed and in single precision: it only ranks."""
    turned = Harmonics(rows=(l,)).turned(grid_rotations(), np.eye(2 * l + 1))
    return turned.reshape(GRID, -1).astype(np.float32)


def _up_to(moments: Moments, order: int) -> Moments:
    """The moments of the lower orders; replicates are left behind."""
    count = len(exponents(moments.dim, order))
    return replace(moments, order=order, values=moments.values[:count], replicates=np.empty((0, count)))


def landscape(source: Moments, target: Moments) -> tuple[Array, Array]:
    """Correlation of the two objects under every rotation R of the grid, and under -R: [GRID] each.

    The objects are whitened first (`spectrum.whitened`): every orthogonal map between them maps their whitened forms as
    well, and what lies around a long axis counts as much as the axis. The covariance joins as one more row of l = 2.
    """
    plain = [harmonic_moments(m) for m in (source, target)]
    white = [harmonic_moments(whitened(_up_to(m, min(GRID_DEGREE, m.order)))) for m in (source, target)]
    even, odd = np.zeros(GRID), np.zeros(GRID)
    for l in range(1, min(GRID_DEGREE, source.order) + 1):
        a, b = (w[l][0] for w in white)
        count = len(a)
        if l == 2:  # whitening has emptied the first row
            a[0], b[0] = (p[l][0, 0] for p in plain)
        noise = sum((deviations(p[l][1:, :count]) ** 2).sum(axis=(0, 2)) for p in plain)
        strength = np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
        kernel = (a / (strength + noise + np.sqrt(FLOOR))[:, None]).T @ b
        (odd if l % 2 else even)[:] += _grid_table(l) @ kernel.ravel().astype(np.float32)
    return even + odd, even - odd


def hills(scores: Array, det: int, *, count: int) -> Array:
    """The `count` highest hills of one of the two landscapes, as matrices [count, 3, 3] of determinant `det`.

    Maxima within one step of the fit are the same hill.
    """
    rest = scores.copy()
    flat = grid_rotations().reshape(GRID, 9)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(np.argmax(rest)))
        rest[flat @ flat[chosen[-1]] > 1.0 + 2.0 * np.cos(LONGEST)] = -np.inf
    return np.asarray(det * grid_rotations()[chosen])
