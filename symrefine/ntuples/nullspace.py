"""Exact null space of a sparse integer matrix: modulo primes, joined, reconstructed, and checked in integers."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.ntuples.notation import primitive

# An equation: column -> coefficient.
Row = dict[int, int]
IntArray = NDArray[np.int64]

# Products of two residues below 2^31 fit int64.
_LARGEST_PRIME = 2**31 - 1


def null_space(rows: Sequence[Row], columns: int) -> list[list[int]]:
    """Basis of {x : row . x = 0 for every row}, primitive integer vectors, the first entry that is not 0 positive.

    Modulo a prime the rank can only fall, so the residues give at least as many vectors as there are; each vector is
    checked in integers and each has a free column of its own: they are the whole null space.

    Args:
        rows: column -> coefficient for each equation.
        columns: number of unknowns.
    """
    if columns == 0:
        return []
    best: _Residues | None = None
    for prime in _primes():
        found = _solve_modulo(rows, columns, prime)
        best = found if best is None else best.joined(found)
        vectors = best.reconstructed(columns)
        if vectors is not None and all(_annihilates(rows, vector) for vector in vectors):
            return vectors
    raise AssertionError("the primes below 2^31 exceed every coefficient of a matrix that fits the limits")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Residues:
    """Null space modulo `modulus`: 1 in a free column, 0 in the other free ones, `values[i, k]` in pivot column i."""

    pivots: list[int]
    free: list[int]
    values: list[list[int]]
    modulus: int

    def joined(self, other: "_Residues") -> "_Residues":
        """Both by the Chinese remainder theorem; a prime that saw a lower rank or later pivots was unlucky."""
        if other.pivots != self.pivots:
            return max(self, other, key=lambda r: (len(r.pivots), [-c for c in r.pivots]))
        inverse = pow(self.modulus, -1, other.modulus)
        values = [
            [a + self.modulus * ((b - a) * inverse % other.modulus) for a, b in zip(mine, theirs, strict=True)]
            for mine, theirs in zip(self.values, other.values, strict=True)
        ]
        return _Residues(pivots=self.pivots, free=self.free, values=values, modulus=self.modulus * other.modulus)

    def reconstructed(self, columns: int) -> list[list[int]] | None:
        """Integer vectors with these residues up to a factor, or None if the modulus is too small for them."""
        vectors = []
        for k, free in enumerate(self.free):
            entries = {free: 1} | {c: row[k] for c, row in zip(self.pivots, self.values, strict=True) if row[k]}
            vector = _integers(entries, columns, self.modulus)
            if vector is None:
                return None
            vectors.append(vector)
        return vectors


def _solve_modulo(rows: Sequence[Row], columns: int, prime: int) -> _Residues:
    matrix = np.zeros((len(rows), columns), dtype=np.int64)
    for position, row in enumerate(rows):
        matrix[position, list(row)] = [c % prime for c in row.values()]
    pivots = _echelon(matrix, prime)
    free = [c for c in range(columns) if c not in set(pivots)]
    values = _back_substituted(matrix, pivots, free, prime)
    return _Residues(pivots=pivots, free=free, values=values.tolist(), modulus=prime)


def _echelon(matrix: IntArray, prime: int) -> list[int]:
    """Row echelon form in place, leading entries 1; the pivot columns."""
    pivots: list[int] = []
    for column in range(matrix.shape[1]):
        top = len(pivots)
        candidates = top + np.flatnonzero(matrix[top:, column])
        if candidates.size == 0:
            continue
        # The emptiest row as pivot keeps the others sparse, and only rows with an entry here are touched.
        chosen = candidates[np.argmin(np.count_nonzero(matrix[candidates, column:], axis=1))]
        matrix[[top, chosen]] = matrix[[chosen, top]]
        inverse = pow(int(matrix[top, column]), -1, prime)
        support = column + np.flatnonzero(matrix[top, column:])
        matrix[top, support] = matrix[top, support] * inverse % prime
        below = top + 1 + np.flatnonzero(matrix[top + 1 :, column])
        block = np.ix_(below, support)
        matrix[block] = (matrix[block] - np.outer(matrix[below, column], matrix[top, support])) % prime
        pivots.append(column)
    return pivots


def _back_substituted(matrix: IntArray, pivots: list[int], free: list[int], prime: int) -> IntArray:
    """Values [pivots, free] of the unknowns in the pivot columns when one free unknown is 1, the others 0."""
    values = np.zeros((len(pivots), len(free)), dtype=np.int64)
    for row in reversed(range(len(pivots))):
        later = row + 1 + np.flatnonzero(matrix[row, pivots[row + 1 :]])
        weights = matrix[row, [pivots[k] for k in later]]
        total = (weights[:, None] * values[later] % prime).sum(axis=0) + matrix[row, free]
        values[row] = -total % prime
    return values


def _integers(residues: dict[int, int], columns: int, modulus: int) -> list[int] | None:
    """Primitive integer vector proportional to the residues: clears one common denominator along the way."""
    bound = math.isqrt(modulus // 2)
    common, fractions = 1, {}
    for column, residue in sorted(residues.items()):
        numerator = _symmetric(residue * common, modulus)
        denominator = 1
        if abs(numerator) > bound:
            numerator, denominator = _fraction(residue * common % modulus, modulus, bound)
        if denominator == 0 or common * denominator > bound:
            return None
        common *= denominator
        fractions[column] = (numerator, common)
    vector = [0] * columns
    for column, (numerator, denominator) in fractions.items():
        vector[column] = numerator * (common // denominator)
    return primitive(vector)


def _symmetric(value: int, modulus: int) -> int:
    value %= modulus
    return value - modulus if value > modulus // 2 else value


def _fraction(residue: int, modulus: int, bound: int) -> tuple[int, int]:
    """The fraction a/b = residue with |a|, b <= bound by Euclid's algorithm (Wang 1981); b = 0 if there is none."""
    a, b, x, y = modulus, residue, 0, 1
    while b > bound:
        quotient = a // b
        a, b, x, y = b, a - quotient * b, y, x - quotient * y
    return (0, 0) if abs(y) > bound else (b, y) if y > 0 else (-b, -y)


def _annihilates(rows: Sequence[Row], vector: list[int]) -> bool:
    return all(sum(c * vector[k] for k, c in row.items()) == 0 for row in rows)


def _primes() -> Iterator[int]:
    """Primes downwards from 2^31 - 1."""
    for candidate in range(_LARGEST_PRIME, 2, -2):
        if all(candidate % d for d in range(3, math.isqrt(candidate) + 1, 2)):
            yield candidate
