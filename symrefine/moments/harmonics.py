"""Solid harmonics: the moments of 3-space sorted by how they turn.

`c[p,l,m] = int r^(p-l) R_lm dX` is linear in the moments of order p. R_lm are the real solid harmonics in Racah's
normalisation (`sum_m R_lm(x)^2 = |x|^(2l)`), index m = -l..l standing for sin(|m| phi) and cos(m phi).
Under x -> Q x the coefficients of degree l turn by the orthogonal matrix D_l(Q): c' = D_l(Q) c. So the numbers of an
object turn by a linear D(Q) that falls into small blocks; small turns are counted about x, y and z.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from math import comb, factorial, sqrt

import numpy as np

from symrefine.geometry import Array, read_only
from symrefine.moments.moments import Moments, deviations, exponents, exponents_of, occurrences
from symrefine.shape import Index

# Variance of a moment that no sample takes away: two files of one model differ by as much.
FLOOR = 1e-8

# Degree l of each row of harmonic coefficients, in their order along a flat array: rows of 2l+1, m = -l..l in each.
Rows = tuple[int, ...]

# Coefficient of x^i y^j z^k by (i, j, k).
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


def directional_moments(points: Array, weights: Array, degree: int) -> dict[int, Array]:
    """c[p,l,m] = sum w r^p R_lm(x / r) of points [N, 3], as {l: [3, 2l+1]} for l = 1..degree and p = 0, 1, 2.

    They see details as fine as the degree allows, as far out as near by, where the powers r^l of moments would tell
    of nothing but the farthest points.
    """
    radii = np.linalg.norm(points, axis=1)
    away = radii > 0.0
    radii, (x, y, z) = radii[away], (points[away] / radii[away, None]).T
    radial = weights[away] * radii ** np.arange(3)[:, None]
    result: dict[int, Array] = {l: np.zeros((3, 2 * l + 1)) for l in range(1, degree + 1)}
    around, sectoral = np.ones(len(radii), dtype=complex), np.ones(len(radii))  # (x + i y)^m, and (2m - 1)!!
    for m in range(degree + 1):
        before, zonal = np.zeros_like(z), sectoral
        both = np.concatenate([radial * around.real, radial * around.imag])
        for l in range(m, degree + 1):
            if l > m:  # the recurrence of the associated Legendre functions, over sin^m
                before, zonal = zonal, ((2 * l - 1) * z * zonal - (l + m - 1) * before) / (l - m)
            if l:
                scale = sqrt((2.0 if m else 1.0) * factorial(l - m) / factorial(l + m))
                cosine, sine = (scale * (both @ zonal)).reshape(2, 3)
                result[l][:, l - m], result[l][:, l + m] = sine, cosine  # the one that m = 0 has
        around, sectoral = around * (x + 1j * y), sectoral * (2 * m + 1)
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Harmonics:
    """Flat harmonic coefficients with these rows; D_l(-R) = (-1)^l D_l(R).

    R = det(R) R_z(a) R_y(b) R_z(c): a turn about z mixes m with -m only, and a constant quarter turn takes y to z, so
    D is applied without ever being formed.
    """

    rows: Rows

    def turned(self, matrices: Array, values: Array) -> Array:
        layout, signs = _layout(self.rows), np.sign(np.linalg.det(matrices))
        m = np.arange(max(self.rows) + 1)
        angles = (np.multiply.outer(angle, m) for angle in euler_zyz(matrices * signs[:, None, None]))
        first, second, third = ((np.cos(a), np.sin(a)) for a in angles)
        out = _spin(_spin(_spin(values, third, layout) @ layout.tip, second, layout) @ layout.tip.T, first, layout)
        return np.asarray(out * np.where(layout.l % 2, signs[:, None], 1.0)[:, None])

    def tangents(self, values: Array) -> Array:
        layout = _layout(self.rows)
        one, other = (by * values.take(at, axis=1) for by, at in zip(layout.turned_by, layout.turns, strict=True))
        return np.asarray(one + other)


def flattened(by_degree: dict[int, Array]) -> tuple[Array, Rows]:
    """Coefficients {l: [P, n_l, 2l+1]} side by side [P, C], and their rows."""
    flat = np.concatenate([c.reshape(len(c), c.shape[1] * c.shape[2]) for c in by_degree.values()], axis=1)
    return flat, tuple(l for l, c in by_degree.items() for _ in range(c.shape[1]))


def row_variance(replicates: Array, rows: Rows) -> Array:
    """Sampling variance [C] of a component of each row, from jackknife replicates [B, C]; zero where there are none.

    The mean over a row does not change when the object turns.
    """
    lengths = 2 * np.array(rows) + 1
    sums = np.add.reduceat((deviations(replicates) ** 2).sum(axis=0), np.cumsum(lengths) - lengths)
    return np.repeat(sums / lengths, lengths)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Layout:
    """Flat coefficients: |m| and l of each, where its partner -m stands, and the sign with which a turn mixes it in.

    `tip` [C, C] is D of the quarter turn about x, transposed, between which R_y(b) is R_z(b). Each row of a
    generator has two entries at most: `turned_by` [2, 3, C] of coefficients `turns` [2, 3, C].
    """

    m: Index
    l: Index
    partner: Index
    sign: Array
    tip: Array
    turns: Index
    turned_by: Array


@lru_cache(maxsize=32)
def _layout(rows: Rows) -> _Layout:
    m = np.concatenate([np.arange(-l, l + 1) for l in rows])
    every, tip, end = np.zeros((3, len(m), len(m))), np.zeros((len(m), len(m))), 0
    for l in rows:
        own = slice(end, end := end + 2 * l + 1)
        every[:, own, own], tip[own, own] = generators(l), turn(l, 0, np.array(np.pi / 2)).T
    turns = np.argsort(np.abs(every), axis=2)[..., -2:]
    return _Layout(
        m=np.abs(m),
        l=np.repeat(rows, [2 * l + 1 for l in rows]),
        partner=np.arange(len(m)) - 2 * m,
        sign=-np.sign(m).astype(np.float64),
        tip=read_only(tip),
        turns=np.ascontiguousarray(np.moveaxis(turns, 2, 0)),
        turned_by=read_only(np.moveaxis(np.take_along_axis(every, turns, axis=2), 2, 0)),
    )


def _spin(c: Array, phase: tuple[Array, Array], layout: _Layout) -> Array:
    """D of turns about z by K angles, given as cos and sin of m times each [K, degree + 1], on c [P or K, P, C]."""
    cosine, sine = (values[:, None, layout.m] for values in phase)
    return np.asarray(cosine * c + (layout.sign * sine) * c[..., layout.partner])


def to_polar_axis(l: int, directions: Array) -> Array:
    """D_l of the rotations R_y(-theta) R_z(-phi) [N, 2l+1, 2l+1] that turn unit directions [N, 3] into the z axis."""
    layout, m = _layout((l,)), np.arange(l + 1)
    theta = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
    phi = np.arctan2(directions[:, 1], directions[:, 0])
    about_y, about_z = ((np.cos(a), np.sin(a)) for a in (np.multiply.outer(angle, m) for angle in (theta, phi)))
    # Rows, not columns, are turned here, so the other way round.
    return _spin(_spin(layout.tip, about_y, layout) @ layout.tip.T, about_z, layout)


def euler_zyz(rotations: Array) -> tuple[Array, Array, Array]:
    """Angles (a, b, c) [K] with R = R_z(a) R_y(b) R_z(c), accurate where b vanishes too."""
    r = rotations
    a = np.arctan2(r[:, 1, 2], r[:, 0, 2])
    b = np.arctan2(np.hypot(r[:, 0, 2], r[:, 1, 2]), r[:, 2, 2])
    # The second row of R_z(-a) R is (sin c, cos c, 0) whatever b is.
    row = np.cos(a)[:, None] * r[:, 1, :2] - np.sin(a)[:, None] * r[:, 0, :2]
    return a, b, np.arctan2(row[:, 0], row[:, 1])
