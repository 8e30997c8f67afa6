"""How orthogonal maps act on moments: under x -> R x the numbers of an object turn by a linear D(R).

Two actions in one form: harmonic moments of 3-space, where D falls into small blocks (`harmonics`), and plain moments
in any dimension. Small turns are counted alike in both: one for every plane (i, j) with `dx_i = -x_j, dx_j = x_i`,
about x, y and z in 3-space.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any, Protocol

import numpy as np

from symrefine.geometry import Array, read_only
from symrefine.moments.harmonics import generators, turn
from symrefine.moments.moments import deviations, exponents, turned_values
from symrefine.shape import Index

# Variance of a moment that no sample takes away: two files of one model differ by as much.
FLOOR = 1e-8

# Degree l of each row of harmonic coefficients, in their order along a flat array: rows of 2l+1, m = -l..l in each.
Rows = tuple[int, ...]


class Action(Protocol):
    """A linear action of O(n) on C numbers of an object."""

    def turned(self, matrices: Array, values: Array) -> Array:
        """D(R) v [K, P, C] of numbers [P, C] under orthogonal matrices [K, n, n]."""
        ...

    def tangents(self, values: Array) -> Array:
        """Derivatives [K, A, C] of numbers [K, C] by the A small turns."""
        ...


def planes(dim: int) -> list[tuple[int, int]]:
    """Planes (i, j) of the small turns, in which i turns towards j: about x, y and z in 3-space."""
    return [(1, 2), (2, 0), (0, 1)] if dim == 3 else list(combinations(range(dim), 2))


def skew(turns: Array, dim: int) -> Array:
    """Skew matrices [K, n, n] of small turns [K, n(n-1)/2]."""
    out = np.zeros((len(turns), dim, dim))
    for k, (i, j) in enumerate(planes(dim)):
        out[:, i, j], out[:, j, i] = -turns[:, k], turns[:, k]
    return out


def turned_by(matrices: Array, turns: Array) -> Array:
    """Matrices [K, n, n] after small turns [K, n(n-1)/2] (Cayley: orthogonal for a turn of any size)."""
    half, one = 0.5 * skew(turns, matrices.shape[1]), np.eye(matrices.shape[1])
    return np.linalg.solve(one - half, (one + half) @ matrices)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Monomials:
    """Moments of `exponents(dim, order)`: `d m_p = -p_i m_(p - e_i + e_j) + p_j m_(p - e_j + e_i)` (method.md, 2)."""

    dim: int
    order: int

    def turned(self, matrices: Array, values: Array) -> Array:
        return turned_values(values, matrices, self.order)

    def tangents(self, values: Array) -> Array:
        table = _neighbours(self.dim, self.order)
        turned = [pj * values[:, to_i] - pi * values[:, to_j] for pi, to_j, pj, to_i in table]
        return np.array(turned).reshape(len(table), *values.shape).transpose(1, 0, 2)


@lru_cache(maxsize=16)
def _neighbours(dim: int, order: int) -> list[tuple[Index, Index, Index, Index]]:
    """For each plane: p_i, the place of p - e_i + e_j, p_j, the place of p - e_j + e_i; for every p in turn."""
    table = exponents(dim, order)
    place = {tuple(p): k for k, p in enumerate(table.tolist())}

    def moved(down: int, up: int) -> Index:
        step = np.eye(dim, dtype=np.int64)[up] - np.eye(dim, dtype=np.int64)[down]
        return np.array([place.get(tuple(p), 0) for p in (table + step).tolist()])

    return [(table[:, i], moved(i, j), table[:, j], moved(j, i)) for i, j in planes(dim)]


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
        turns = _layout(self.rows).generators @ values.T
        return np.asarray(turns.T.reshape(len(values), 3, -1))


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

    `tip` [C, C] is D of the quarter turn about x, transposed, between which R_y(b) is R_z(b); `generators` [3C, C] are
    the three of them on top of one another, of two entries a row at most.
    """

    m: Index
    l: Index
    partner: Index
    sign: Array
    tip: Array
    generators: Any


@lru_cache(maxsize=32)
def _layout(rows: Rows) -> _Layout:
    from scipy.linalg import block_diag
    from scipy.sparse import csr_array

    stacked = np.concatenate([block_diag(*(generators(l)[k] for l in rows)) for k in range(3)])
    m = np.concatenate([np.arange(-l, l + 1) for l in rows])
    return _Layout(
        m=np.abs(m),
        l=np.repeat(rows, [2 * l + 1 for l in rows]),
        partner=np.arange(len(m)) - 2 * m,
        sign=-np.sign(m).astype(np.float64),
        tip=read_only(block_diag(*(turn(l, 0, np.array(np.pi / 2)).T for l in rows))),
        generators=csr_array(stacked),
    )


def _spin(c: Array, phase: tuple[Array, Array], layout: _Layout) -> Array:
    """D of turns about z by K angles, given as cos and sin of m times each [K, degree + 1], on c [P or K, P, C]."""
    cosine, sine = (values[:, None, layout.m] for values in phase)
    return np.asarray(cosine * c + (layout.sign * sine) * c[..., layout.partner])


def euler_zyz(rotations: Array) -> tuple[Array, Array, Array]:
    """Angles (a, b, c) [K] with R = R_z(a) R_y(b) R_z(c), accurate where b vanishes too."""
    r = rotations
    a = np.arctan2(r[:, 1, 2], r[:, 0, 2])
    b = np.arctan2(np.hypot(r[:, 0, 2], r[:, 1, 2]), r[:, 2, 2])
    # The second row of R_z(-a) R is (sin c, cos c, 0) whatever b is.
    row = np.cos(a)[:, None] * r[:, 1, :2] - np.sin(a)[:, None] * r[:, 0, :2]
    return a, b, np.arctan2(row[:, 0], row[:, 1])
