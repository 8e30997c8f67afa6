"""n-tuples derived exactly: the null space of the paper's linear system, for any dimension and vector of moments.

The generator of rotations J_ij (dx_i = -x_j, dx_j = +x_i) acts on a moment as

    J_ij m_p = -p_i m_(p - e_i + e_j) + p_j m_(p - e_j + e_i)                                 (eq. dmp1ppnsimp3D)

and on a product of moments as a derivation: that is the interaction matrix L_v of the paper. An n-tuple
f = (f_1, .., f_n) of polynomials in moments has to turn like a point,

    J_ij f_i = -f_j,    J_ij f_j = f_i,    J_ij f_k = 0,                                                      (*)

which is eq. exampletriplecalculation6 with the signs of the paper's own eq. A3D (as printed it has the zero solution
only), and has to follow reflections: f(Px) = P f(x) if it is polar. Most of the n N unknowns of (*) are redundant:

- reflecting x_k flips the sign of f_k alone, so f_1 is odd in x_1 and even in every other coordinate;
- exchanging two coordinates exchanges two components, so f_1 is symmetric in x_2..x_n, and f_j is f_1 with x_1 and x_j
  exchanged;
- that leaves J_12 f_1 + f_2 = 0 and, if n > 2, J_23 f_1 = 0 of (*): exchanges of coordinates give all the others.

Rotations alone leave f(Px) = -P f(x) possible too (axial n-tuples): f_1 is then even in x_1, odd in the others and
antisymmetric in them. Their solutions are the sum of both kinds, because f -> P f(P x) maps solutions to solutions, is
the same map for every reflection P, and has square 1. Unknowns are orbits of monomials: 9 for (2,3) in 3-D instead of
180, 319 for (8,9) instead of 7,425.
"""

import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from operator import index

from symrefine.errors import InputError
from symrefine.moments.moments import exponents_of
from symrefine.ntuples.notation import Component, Exponents, Kind, NTuple, NTupleBasis, primitive, shortened
from symrefine.ntuples.nullspace import Row, null_space

# Listing 200,000 monomials takes a second or two; dense elimination of 2,500 unknowns some seconds and about 150 MB.
MONOMIAL_LIMIT, UNKNOWN_LIMIT = 200_000, 2_500

# A monomial as the ascending numbers of its moments: products commute, so the sorted tuple is its only name.
Word = tuple[int, ...]
Orbit = dict[Word, int]


def derive(dim: int, orders: Sequence[int], *, reflection: bool = True) -> NTupleBasis:
    """Exact basis of the n-tuples that are linear in the products of moments of the given orders.

    Solves eq. exampletriplecalculation6 (sign corrected) with the reflection condition of the paper's section
    "Reflection transformation and symmetry", which holds by itself in odd dimensions at odd total order.

    Args:
        dim: n >= 2.
        orders: order of each factor, e.g. (2, 3) for v^(1,1)_(2,3), (2, 2, 3) for v^(2,1)_(2,3), (3,) for v^1_3.
        reflection: False drops the reflection condition and admits axial n-tuples as well.

    Returns:
        The basis; empty, and its `note` says why, where there are none.

    Raises:
        InputError: dim < 2, no orders, orders < 1, or more than MONOMIAL_LIMIT monomials or UNKNOWN_LIMIT unknowns.
    """
    space = MomentSpace(*checked(dim, orders))
    laws = [polar_law(space)] + ([] if reflection else [axial_law(space)])
    found = [(law.kind, ntuple) for law in laws for ntuple in solve(space, law)]
    return NTupleBasis(
        dim=space.dim,
        orders=space.orders,
        tuples=tuple(ntuple for _, ntuple in found),
        kinds=tuple(kind for kind, _ in found),
        note="" if found else _why_none(space, reflection),
    )


def checked(dim: int, orders: Sequence[int]) -> tuple[int, tuple[int, ...]]:
    """The dimension and the ascending orders, or an InputError that says what would be right."""
    try:
        n, ascending = index(dim), tuple(sorted(index(p) for p in orders))
    except TypeError:
        raise InputError(f"dim {dim!r}, orders {orders!r}: expected an integer and integers such as (2, 3)") from None
    if n < 2:
        raise InputError(f"dim {n}: n-tuples need a space of dimension 2 or more")
    if not ascending or ascending[0] < 1:
        raise InputError(f"orders {ascending}: expected one or more moment orders >= 1, such as (2, 3)")
    count = monomial_count(n, ascending)
    if count > MONOMIAL_LIMIT:
        raise InputError(_too_large(n, ascending, f"the limit is {MONOMIAL_LIMIT:,} monomials"))
    return n, ascending


def monomial_count(dim: int, orders: Iterable[int]) -> int:
    """Length of v^(kk'..)_(pp'..); products of k among M = C(n+p-1, p) moments of order p are C(M+k-1, k) multisets."""
    return math.prod(math.comb(math.comb(dim + p - 1, p) + k - 1, k) for p, k in Counter(orders).items())


def _too_large(dim: int, orders: tuple[int, ...], limit: str) -> str:
    count = monomial_count(dim, orders)
    number = f"{count:,}" if count < 10**15 else "more than 10^15"
    factors = f"{len(orders)} factors of order up to {orders[-1]}"
    return f"{factors} in {dim}-D make {number} monomials; {limit}: use lower orders or fewer factors"


def _why_none(space: "MomentSpace", reflection: bool) -> str:
    degree = sum(space.orders)
    if degree % 2 == 0 and (reflection or space.dim % 2 == 0):
        return (
            f"no n-tuples: the total order {degree} is even, so x -> -x leaves every product of moments as it is, "
            "while it must turn an n-tuple round"
        )
    return f"no n-tuples: only the zero solution for orders {space.orders} in {space.dim}-D"


# --- moments, monomials and what moves them ---------------------------------------------------------------------------


class MomentSpace:
    """The moments of the given orders, numbered as the paper lists them, and the maps of their products.

    Attributes:
        moments: exponents of the moments, by order, then m_200, m_110, m_101, m_020, ..
    """

    def __init__(self, dim: int, orders: tuple[int, ...]) -> None:
        self.dim, self.orders = dim, orders
        self.moments = [e for p in sorted(set(orders)) for e in exponents_of(dim, p)]
        self._number = {e: k for k, e in enumerate(self.moments)}
        self._moves: dict[tuple[int, int], list[tuple[int, int]]] = {}

    def words(self) -> Iterator[Word]:
        """The monomials of v^(kk'..)_(pp'..)."""
        powers = sorted(Counter(self.orders).items())
        letters = [[k for k, e in enumerate(self.moments) if sum(e) == p] for p, _ in powers]
        factors = [combinations_with_replacement(s, k) for s, (_, k) in zip(letters, powers, strict=True)]
        for factor in product(*factors):
            yield tuple(letter for part in factor for letter in part)

    def totals(self, word: Word) -> Exponents:
        """Exponent of each coordinate in the whole product."""
        return tuple(map(sum, zip(*(self.moments[k] for k in word), strict=True)))

    def exchange(self, word: Word, i: int, j: int) -> Word:
        """The monomial with coordinates i and j exchanged."""
        return tuple(sorted(self._number[_exchanged(self.moments[k], i, j)] for k in word))

    def flow(self, word: Word, i: int, j: int) -> Iterator[tuple[int, Word]]:
        """Terms of the derivative of the monomial along dx_i = x_j: d m_p = p_i m_(p - e_i + e_j) in each factor."""
        moves = self._moves.setdefault((i, j), []) or self._fill(i, j)
        for position, letter in enumerate(word):
            power, target = moves[letter]
            if power:
                yield power, tuple(sorted((*word[:position], target, *word[position + 1 :])))

    def turn(self, word: Word, i: int, j: int) -> Iterator[tuple[int, Word]]:
        """Terms of J_ij of the monomial, the rotation dx_i = -x_j, dx_j = +x_i (eq. dmp1ppnsimp3D)."""
        yield from ((-c, target) for c, target in self.flow(word, i, j))
        yield from self.flow(word, j, i)

    def _fill(self, i: int, j: int) -> list[tuple[int, int]]:
        moves = self._moves[i, j]
        for e in self.moments:
            target = [p + (k == j) - (k == i) for k, p in enumerate(e)]
            moves.append((e[i], self._number[tuple(target)] if e[i] else 0))
        return moves


def _exchanged(exponents: Exponents, i: int, j: int) -> Exponents:
    e = list(exponents)
    e[i], e[j] = e[j], e[i]
    return tuple(e)


# --- the linear system ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """What the first component of an n-tuple obeys; the others follow by exchanging coordinates.

    Attributes:
        admits: which total exponents the monomials of f_1 may have.
        sign: f under the exchange of two coordinates is `sign` times the exchanged f.
        conditions: the terms (equation, coefficient) that a monomial of f_1 contributes; every equation sums to zero.
    """

    kind: Kind
    sign: int
    admits: Callable[[Exponents], bool]
    conditions: Callable[[Word], Iterator[tuple[Hashable, int]]]


def polar_law(space: MomentSpace) -> Law:
    """x(RX) = R x(X): f_1 odd in x_1, even in the others."""
    wanted = tuple(int(k == 0) for k in range(space.dim))
    return _turning_law(space, "polar", 1, wanted)


def axial_law(space: MomentSpace) -> Law:
    """x(RX) = det(R) R x(X): f_1 even in x_1, odd in the others."""
    wanted = tuple(int(k != 0) for k in range(space.dim))
    return _turning_law(space, "axial", -1, wanted)


def _turning_law(space: MomentSpace, kind: Kind, sign: int, parities: Exponents) -> Law:
    def admits(totals: Exponents) -> bool:
        return all(t % 2 == p for t, p in zip(totals, parities, strict=True))

    def conditions(word: Word) -> Iterator[tuple[Hashable, int]]:
        yield ("J12 f1 + f2", space.exchange(word, 0, 1)), sign
        for c, target in space.turn(word, 0, 1):
            yield ("J12 f1 + f2", target), c
        for c, target in space.turn(word, 1, 2) if space.dim > 2 else ():
            yield ("J23 f1", target), c

    return Law(kind=kind, sign=sign, admits=admits, conditions=conditions)


def solve(space: MomentSpace, law: Law) -> list[NTuple]:
    """Basis of the n-tuples that obey the law, shortest first.

    Raises:
        InputError: more than UNKNOWN_LIMIT unknowns.
    """
    orbits = _orbits(space, law)
    if len(orbits) > UNKNOWN_LIMIT:
        limit = f"symmetry leaves {len(orbits):,} unknowns, the limit is {UNKNOWN_LIMIT:,}"
        raise InputError(_too_large(space.dim, space.orders, limit))
    rows = _rows(orbits, law)
    vectors = shortened(null_space(rows, len(orbits)), [len(orbit) for orbit in orbits])
    firsts = [_expanded(vector, orbits) for vector in vectors]
    return [_all_components(space, first, law.sign) for first in sorted(firsts, key=_length_first)]


def _orbits(space: MomentSpace, law: Law) -> list[Orbit]:
    """Sums of monomials that f_1 can hold: (anti)symmetric in the coordinates 2..n."""
    seen: set[Word] = set()
    orbits = []
    for word in space.words():
        if word not in seen and law.admits(space.totals(word)):
            orbit, vanishes = _orbit(space, word, law.sign)
            seen.update(orbit)
            orbits += [] if vanishes else [orbit]
    return orbits


def _orbit(space: MomentSpace, word: Word, sign: int) -> tuple[Orbit, bool]:
    """The monomials that exchanges of neighbours among x_2..x_n lead to, and whether their signs contradict."""
    orbit, queue, vanishes = {word: 1}, [word], False
    for member in queue:
        for i in range(1, space.dim - 1):
            image = space.exchange(member, i, i + 1)
            if image not in orbit:
                orbit[image] = sign * orbit[member]
                queue.append(image)
            vanishes |= orbit[image] != sign * orbit[member]
    return orbit, vanishes


def _rows(orbits: list[Orbit], law: Law) -> list[Row]:
    """The equations, each once: symmetry repeats many of them up to sign."""
    rows: dict[Hashable, Row] = {}
    for column, orbit in enumerate(orbits):
        for word, sign in orbit.items():
            for equation, c in law.conditions(word):
                row = rows.setdefault(equation, {})
                row[column] = row.get(column, 0) + sign * c
    ascending = [sorted((k, c) for k, c in row.items() if c) for row in rows.values()]
    distinct = {tuple(zip([k for k, _ in row], primitive([c for _, c in row]), strict=True)) for row in ascending}
    return [dict(row) for row in sorted(distinct) if row]


def _expanded(vector: list[int], orbits: list[Orbit]) -> list[tuple[int, Word]]:
    terms = [(word, c * sign) for c, orbit in zip(vector, orbits, strict=True) if c for word, sign in orbit.items()]
    return [(c, word) for word, c in sorted(terms)]


def _length_first(first: list[tuple[int, Word]]) -> tuple[int, int, list[tuple[int, Word]]]:
    return len(first), sum(abs(c) for c, _ in first), first


def _all_components(space: MomentSpace, first: list[tuple[int, Word]], sign: int) -> NTuple:
    """f_j is f_1 with x_1 and x_j exchanged, up to the sign that a reflection brings."""
    turned = [[(sign * c, space.exchange(word, 0, j)) for c, word in first] for j in range(1, space.dim)]
    return tuple(_component(space, terms) for terms in [first, *turned])


def _component(space: MomentSpace, terms: list[tuple[int, Word]]) -> Component:
    ordered = sorted((word, c) for c, word in terms)
    return tuple((c, tuple(space.moments[k] for k in word)) for word, c in ordered)
