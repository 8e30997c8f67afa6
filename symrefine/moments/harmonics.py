"""Solid harmonics: the moments of 3-space sorted by how they turn.

`c[p,l,m] = int r^(p-l) R_lm dX` is linear in the moments of order p. R_lm are the real solid harmonics in Racah's
normalisation (`sum_m R_lm(x)^2 = |x|^(2l)`), index m = -l..l standing for sin(|m| phi) and cos(m phi).
Under x -> Q x the coefficients of degree l turn by the orthogonal matrix D_l(Q): c' = D_l(Q) c.
"""

from collections import defaultdict
from functools import lru_cache
from math import comb, factorial, sqrt

import numpy as np

from symrefine.geometry import Array
from symrefine.moments.moments import Moments, exponents, exponents_of, monomials, occurrences

Polynomial = dict[tuple[int, int, int], float]


def _times(a: Polynomial, b: Polynomial) -> Polynomial:
    total: dict[tuple[int, int, int], float] = defaultdict(float)
    for (i, j, k), u in a.items():
        for (l, m, n), v in b.items():
            total[i + l, j + m, k + n] += u * v
    return dict(total)


def _radial(power: int) -> Polynomial:
    """(x^2 + y^2 + z^2)^power."""
    return {(2 * i, 2 * j, 2 * k): occurrences((i, j, k)) for i, j, k in exponents_of(3, power)}


def _azimuthal(m: int) -> Polynomial:
    """Re or Im of (x + i y)^|m|, the sine part for negative m."""
    k = abs(m)
    return {(k - j, j, 0): (-1.0) ** (j // 2) * comb(k, j) for j in range(int(m < 0), k + 1, 2)}


def solid_harmonic(l: int, m: int) -> Polynomial:
    """The real solid harmonic R_lm as a homogeneous polynomial of degree l."""
    k = abs(m)
    zonal: dict[tuple[int, int, int], float] = defaultdict(float)
    scale = sqrt((2.0 if k else 1.0) * factorial(l - k) / factorial(l + k)) / 2**l
    for j in range((l - k) // 2 + 1):
        value = (-1) ** j * comb(l, j) * comb(2 * l - 2 * j, l) * factorial(l - 2 * j) / factorial(l - 2 * j - k)
        for (x, y, z), often in _radial(j).items():
            zonal[x, y, z + l - 2 * j - k] += scale * value * often
    return _times(zonal, _azimuthal(m))


@lru_cache(maxsize=4)
def _projection(order: int) -> dict[int, Array]:
    """For each l: the matrices [n_p, 2l+1, K] that take moments to c[p,l,:], p = l, l+2, ... <= order."""
    position = {tuple(e): i for i, e in enumerate(exponents(3, order).tolist())}
    tables: dict[int, Array] = {}
    for l in range(order + 1):
        table = np.zeros(((order - l) // 2 + 1, 2 * l + 1, len(position)))
        for m in range(-l, l + 1):
            polynomial = solid_harmonic(l, m)
            for p in range(len(table)):
                for e, value in polynomial.items():
                    table[p, m + l, position[e]] += value
                polynomial = _times(polynomial, _radial(1))
        tables[l] = table
    return tables


def harmonic_moments(moments: Moments) -> dict[int, Array]:
    """c[p,l,m] as {l: [1 + B, n_p, 2l+1]} for l = 1..order: the whole first, then its jackknife replicates.

    Each order p is divided by a radial moment, so that all orders have a like scale.
    """
    values = np.concatenate([moments.values[None], moments.replicates])
    tables = _projection(moments.order)
    even = [float(moments.values @ tables[0][p, 0]) for p in range(moments.order // 2 + 1)]
    radial = [sqrt(even[p // 2] * even[min((p + 1) // 2, len(even) - 1)]) for p in range(moments.order + 1)]
    result = {}
    for l in range(1, moments.order + 1):
        scale = np.array([radial[p] for p in range(l, moments.order + 1, 2)])
        result[l] = np.einsum("pmk,bk->bpm", tables[l], values) / scale[:, None]
    return result


@lru_cache(maxsize=32)
def generators(l: int) -> Array:
    """Skew matrices J_x, J_y, J_z [3, 2l+1, 2l+1] with D_l(exp[w]_x) = exp(w.J).

    Those of angular momentum, from the ladder |m> -> |m + 1>, between the real combinations of |m> and |-m>.
    """
    m, k = np.arange(-l, l + 1), np.arange(1, l + 1)
    up: Array = np.diag(np.sqrt(l * (l + 1.0) - m[:-1] * m[1:]), -1)
    real = np.zeros((2 * l + 1, 2 * l + 1), complex)
    real[l, l] = 1.0
    real[l + k, l + k], real[l + k, l - k] = (-1.0) ** k * np.sqrt(0.5), np.sqrt(0.5)
    real[l - k, l + k], real[l - k, l - k] = -1j * (-1.0) ** k * np.sqrt(0.5), 1j * np.sqrt(0.5)
    momentum = np.array([0.5 * (up + up.T), -0.5j * (up - up.T), np.diag(m)])
    return np.real(-1j * real.conj() @ momentum @ real.T)


@lru_cache(maxsize=32)
def _spectral(l: int, axis: int) -> tuple[Array, Array, Array]:
    eigenvalues, vectors = np.linalg.eigh(1j * generators(l)[axis])
    return eigenvalues, vectors, vectors.conj().T


def turn(l: int, axis: int, angle_rad: Array) -> Array:
    """D_l of the rotations by `angle_rad` [...] about coordinate axis `axis`, shape [..., 2l+1, 2l+1]."""
    eigenvalues, vectors, adjoint = _spectral(l, axis)
    phases = np.exp(-1j * np.multiply.outer(angle_rad, eigenvalues))
    return np.real((vectors * phases[..., None, :]) @ adjoint)


def to_polar_axis(l: int, directions: Array) -> Array:
    """D_l of the rotations R_y(-theta) R_z(-phi) [N, 2l+1, 2l+1] that turn unit directions [N, 3] into the z axis."""
    theta = np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), directions[..., 2])
    phi = np.arctan2(directions[..., 1], directions[..., 0])
    return turn(l, 1, -theta) @ turn(l, 2, -phi)


def evaluate(l: int, points: Array) -> Array:
    """R_lm at points [N, 3], shape [N, 2l+1]."""
    return (_projection(l)[l][0] @ monomials(points, l)).T
