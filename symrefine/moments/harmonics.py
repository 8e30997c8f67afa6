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
from symrefine.moments.moments import Moments, exponents, monomials

Polynomial = dict[tuple[int, int, int], float]
X, Y, Z = ({e: 1.0} for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
R_SQUARED: Polynomial = {(2, 0, 0): 1.0, (0, 2, 0): 1.0, (0, 0, 2): 1.0}


def _add(*terms: tuple[float, Polynomial]) -> Polynomial:
    total: dict[tuple[int, int, int], float] = defaultdict(float)
    for factor, polynomial in terms:
        for e, value in polynomial.items():
            total[e] += factor * value
    return dict(total)


def _times(a: Polynomial, b: Polynomial) -> Polynomial:
    total: dict[tuple[int, int, int], float] = defaultdict(float)
    for (i, j, k), u in a.items():
        for (l, m, n), v in b.items():
            total[i + l, j + m, k + n] += u * v
    return dict(total)


def _power(a: Polynomial, n: int) -> Polynomial:
    return _times(_power(a, n - 1), a) if n else {(0, 0, 0): 1.0}


def _azimuthal(m: int) -> Polynomial:
    """Re or Im of (x + i y)^|m|, the sine part for negative m."""
    real: Polynomial = {(0, 0, 0): 1.0}
    imaginary: Polynomial = {}
    for _ in range(abs(m)):
        real, imaginary = (
            _add((1.0, _times(real, X)), (-1.0, _times(imaginary, Y))),
            _add((1.0, _times(real, Y)), (1.0, _times(imaginary, X))),
        )
    return imaginary if m < 0 else real


def solid_harmonic(l: int, m: int) -> Polynomial:
    """The real solid harmonic R_lm as a homogeneous polynomial of degree l."""
    k = abs(m)
    terms = []
    for j in range((l - k) // 2 + 1):
        value = (-1) ** j * comb(l, j) * comb(2 * l - 2 * j, l) * factorial(l - 2 * j) / factorial(l - 2 * j - k)
        terms.append((value / 2**l, _times(_power(R_SQUARED, j), _power(Z, l - 2 * j - k))))
    scale = sqrt((2.0 if k else 1.0) * factorial(l - k) / factorial(l + k))
    return _add((scale, _times(_add(*terms), _azimuthal(m))))


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
                polynomial = _times(polynomial, R_SQUARED)
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
    """Skew matrices J_x, J_y, J_z [3, 2l+1, 2l+1] with D_l(exp[w]_x) = exp(w.J)."""
    position = {tuple(e): i for i, e in enumerate(exponents(3, l).tolist())}
    harmonics = [solid_harmonic(l, m) for m in range(-l, l + 1)]
    basis = np.zeros((2 * l + 1, len(position)))
    for row, polynomial in enumerate(harmonics):
        for e, value in polynomial.items():
            basis[row, position[e]] = value
    turned = np.zeros((3, *basis.shape))
    for axis in range(3):
        # d/dt f(exp(t [e_axis]) x) = (df/dx_k) x_j - (df/dx_j) x_k ... with (axis, j, k) cyclic.
        j, k = (axis + 1) % 3, (axis + 2) % 3
        for row, polynomial in enumerate(harmonics):
            for e, value in polynomial.items():
                for up, down, sign in ((j, k, 1.0), (k, j, -1.0)):
                    if e[down]:
                        moved = list(e)
                        moved[down] -= 1
                        moved[up] += 1
                        turned[axis, row, position[tuple(moved)]] += sign * e[down] * value
    return np.stack([np.linalg.lstsq(basis.T, t.T, rcond=None)[0].T for t in turned])


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
