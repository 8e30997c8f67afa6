"""n-tuples in closed form: contractions of two moment tensors that leave one index free.

For factors of orders p and p' the whole solution space of the paper's linear system (eq. exampletriplecalculation6) is
spanned by: trace T_p and T_p' down to ranks l and l' with |l - l'| = 1, contract the common indices (method.md,
section 2). `derive` finds the same space exactly; the tests compare the two.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array, ReadOnly, read_only
from symrefine.moments.moments import Moments, deviations, exponents, occurrences
from symrefine.shape import Index

# The 3-D orders of the paper's experiments: 17 triplets from moments to order 5.
PAPER_ORDERS: tuple[tuple[int, ...], ...] = ((3,), (5,), (2, 3), (2, 5), (4, 3), (4, 5))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NTuples(ReadOnly):
    """Vectors that turn with the object, v(R X) = R v(X), scaled to be comparable across orders and objects.

    Attributes:
        vectors: [T, n] tuples, each divided by a bound of it, so |v| <= 1: radial moments of the even orders around
            each factor's, or where the moments end at an odd order, what they themselves say (`_Program.bounds`).
        replicates: [B, T, n] jackknife replicates, each divided by a bound of its own; B = 0 where the moments are
            exact.
        labels: [T] orders and ranks each tuple was made from.
    """

    vectors: Array
    replicates: Array
    labels: tuple[str, ...]

    @property
    def noise(self) -> Array:
        """Standard deviation [T] of each tuple's components from the sampling of the points (jackknife)."""
        return np.asarray(np.sqrt((deviations(self.replicates) ** 2).sum(axis=0).mean(axis=-1)))

    def noise_along(self, directions: Array, weights: Array) -> Array:
        """Standard deviation [K] of the weighted n-tuples, all together, along directions [K, n]; weights [T].

        That of the singular values where the directions are the singular ones.
        """
        along = np.einsum("btn,kn->btk", deviations(self.replicates) * weights[:, None], directions)
        return np.asarray(np.sqrt((along**2).sum(axis=(0, 1))))

    @property
    def covariance(self) -> Array:
        """Covariance [T, n, n] of each tuple's components from the sampling of the points; zero for exact moments.

        By the jackknife, `(B - 1) / B sum_b (v_b - v)(v_b - v)'`: entries scatter by `sqrt(2 / (B - 1))` of their size
        (a third for B = 16), and with B <= n it is singular. It turns with the object: R C R'.
        """
        spread = deviations(self.replicates)
        return np.asarray(np.einsum("bti,btj->tij", spread, spread))

    @property
    def joint_covariance(self) -> Array:
        """Covariance [T n, T n] of all components of all tuples, which share their points and so their errors.

        Of rank B - 1 at most.
        """
        flat = deviations(self.replicates).reshape(len(self.replicates), self.vectors.size)
        return flat.T @ flat

    def whitened(self) -> Array:
        """Tuples [T, n] in standard deviations: each multiplied by the inverse root of its covariance.

        For B > n; then `|row|^2 (B - n) / (n (B - 1))` is distributed as F(n, B - n) where the true tuple vanishes
        (Hotelling), so a threshold on it decides whether a tuple says anything.

        Raises:
            InputError: too few replicates; exact moments have none.
        """
        parts, dim = len(self.replicates), self.vectors.shape[-1]
        if parts <= dim:
            raise InputError(f"{parts} replicates; whitening {dim} components takes at least {dim + 1}")
        values, axes = np.linalg.eigh(self.covariance)
        root = np.sqrt(np.maximum(values, np.finfo(float).tiny))
        return np.asarray(np.einsum("tij,tj,tkj,tk->ti", axes, 1.0 / root, axes, self.vectors))


def ntuples(moments: Moments, orders: Sequence[Sequence[int]] = PAPER_ORDERS) -> NTuples:
    """All n-tuples of one or two factors with the given orders.

    Args:
        moments: normalised central moments to at least the highest order named.
        orders: e.g. `((3,), (2, 3), (4, 5))`.

    Raises:
        InputError: an order the moments do not reach, or more than two factors.
    """
    _check(orders, moments.order)
    program = _program(moments.dim, moments.order, tuple(tuple(term) for term in orders))
    stacked = np.concatenate([moments.values[None], moments.replicates])
    entries = stacked @ program.traces
    products = program.factors * entries[:, program.left] * entries[:, program.right]
    vectors = np.add.reduceat(products, program.starts, axis=1).reshape(len(stacked), -1, moments.dim)
    bounds = program.bounds(entries)[:, program.degrees].prod(axis=2)[:, :, None]
    # A part that does not spread has no vectors: all its points coincide.
    vectors = np.divide(vectors, bounds, out=np.zeros_like(vectors), where=bounds > 0.0)
    return NTuples(vectors=vectors[0], replicates=vectors[1:], labels=program.labels)


def _check(orders: Sequence[Sequence[int]], reach: int) -> None:
    for term in orders:
        if not 1 <= len(term) <= 2 or min(term) < 1 or sum(term) % 2 == 0:
            raise InputError(f"orders {tuple(term)}: expected one or two positive orders with an odd sum")
        if max(term) > reach:
            raise InputError(f"orders {tuple(term)}: the moments reach order {reach} only")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Program:
    """All contractions as tables: a linear map to the entries of the traced tensors, then sums of products of two.

    Of each symmetric tensor only the distinct entries occur, with how often they stand in it.

    Attributes:
        traces: [K, S] from the moments to the entries of T_p traced to rank l, for every (p, l) that is needed.
        left: [M] one entry of each product.
        right: [M] the other one; the mass 1 for a single factor.
        factors: [M] how often it occurs.
        starts: [T n] where the products of each component start.
        labels: [T].
        degrees: [T, 2] rows of `bounds` that each tuple is divided by.
        even: for each degree, the two entries whose geometric mean bounds `int r^degree`, or None.
        ends: for each degree, the entries of its traced tensors and how often they occur, where there is no such bound.
        ratio: for each degree, itself over the even one below.
    """

    traces: Array
    left: Index
    right: Index
    factors: Array
    starts: Index
    labels: tuple[str, ...]
    degrees: Index
    even: tuple[tuple[int, int | None], ...]
    ends: tuple[tuple[tuple[Index, Array], ...], ...]
    ratio: tuple[float, ...]

    def bounds(self, entries: Array) -> Array:
        """For entries [B, S] and each degree: [B, D] at least the norm of T_degree traced to any rank.

        That is at most `int r^degree`, by Cauchy and Schwarz below the geometric mean of the even orders around.
        Without the upper one no bound of the integral is known; then the bound is the largest of those norms, or
        `(int r^low)^(degree/low)`, which is never above the integral (Jensen), if that is larger: objects whose odd
        moments vanish need a scale too.
        """
        columns = []
        for (low, high), ends, ratio in zip(self.even, self.ends, self.ratio, strict=True):
            if high is not None:
                columns.append(np.sqrt(np.maximum(entries[:, low] * entries[:, high], 0.0)))
            else:
                norms = [np.sqrt(entries[:, at] ** 2 @ often) for at, often in ends]
                columns.append(np.max([np.maximum(entries[:, low], 0.0) ** ratio, *norms], axis=0))
        return np.stack(columns, axis=1)


class _Entries:
    """Where the distinct entries of the traced tensors stand, and how each is made of the moments; filled on demand."""

    def __init__(self, dim: int, order: int) -> None:
        table = [tuple(e) for e in exponents(dim, order).tolist()]
        self.dim, self.table = dim, table
        self.of_degree = {d: [e for e in table if sum(e) == d] for d in range(order + 1)}
        self.position = {e: i for i, e in enumerate(table)}
        self.columns: list[Array] = []
        self.places: dict[tuple[int, int], dict[tuple[int, ...], int]] = {}

    def __call__(self, degree: int, rank: int) -> dict[tuple[int, ...], int]:
        """Places of the entries of T_degree traced to `rank`, by their exponents."""
        if (degree, rank) not in self.places:
            self.places[degree, rank] = {}
            for e in self.of_degree[rank]:
                column = np.zeros(len(self.table))
                for k in self.of_degree[(degree - rank) // 2]:
                    column[self.position[tuple(a + 2 * b for a, b in zip(e, k, strict=True))]] += occurrences(k)
                self.places[degree, rank][e] = len(self.columns)
                self.columns.append(column)
        return self.places[degree, rank]

    def radial(self, degree: int) -> int:
        """Place of `int r^degree`, an even degree."""
        return self(degree, 0)[(0,) * self.dim]

    def norms(self, degree: int) -> tuple[tuple[Index, Array], ...]:
        """Places and occurrences of the entries of T_degree traced to each rank."""
        every = [self(degree, rank) for rank in range(1, degree + 1, 2)]
        return tuple((np.array(list(e.values())), np.array([occurrences(k) for k in e], float)) for e in every)


@lru_cache(maxsize=32)
def _program(dim: int, order: int, orders: tuple[tuple[int, ...], ...]) -> _Program:
    """The tables for moments to `order` in n = `dim` dimensions."""
    entries, used = _Entries(dim, order), sorted({p for term in orders for p in (*term, 0)})
    found = [*_contractions(entries, orders)]
    products = [
        [(p, large[tuple(a + b for a, b in zip(e, step, strict=True))], occurrences(e)) for e, p in small.items()]
        for _, small, large, _ in found
        for step in np.eye(dim, dtype=int).tolist()
    ]
    left, right, factors = np.concatenate(products).T
    low = [p - p % 2 for p in used]
    high = [p + p % 2 for p in used]
    return _Program(
        even=tuple(
            (entries.radial(a), entries.radial(b) if b <= order else None) for a, b in zip(low, high, strict=True)
        ),
        ends=tuple(() if b <= order else entries.norms(p) for p, b in zip(used, high, strict=True)),
        ratio=tuple(p / max(a, 1) for p, a in zip(used, low, strict=True)),
        traces=read_only(np.stack(entries.columns, axis=1)),
        left=left,
        right=right,
        factors=factors.astype(np.float64),
        starts=np.cumsum([0, *map(len, products[:-1])]),
        labels=tuple(label for label, *_ in found),
        degrees=np.array([[used.index(p) for p in term] for *_, term in found]),
    )


def _contractions(
    entries: _Entries, orders: Sequence[Sequence[int]]
) -> Iterator[tuple[str, dict[tuple[int, ...], int], dict[tuple[int, ...], int], tuple[int, int]]]:
    """Label, the tensor of lower rank, the one whose free index is left, and the two degrees."""
    for term in orders:
        if len(term) == 1:
            yield f"({term[0]})", entries(0, 0), entries(term[0], 1), (0, term[0])
            continue
        even, odd = sorted(term, key=lambda p: p % 2)
        for low in range(even, -1, -2):
            for high in (low - 1, low + 1):
                if 1 <= high <= odd:
                    small, large = sorted((entries(even, low), entries(odd, high)), key=lambda e: sum(next(iter(e))))
                    yield f"({even}->{low},{odd}->{high})", small, large, (even, odd)
