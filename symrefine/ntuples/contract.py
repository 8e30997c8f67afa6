"""n-tuples in closed form: contractions of two moment tensors that leave one index free.

For factors of orders p and p' the whole solution space of the paper's linear system (eq. exampletriplecalculation6) is
spanned by: trace T_p and T_p' down to ranks l and l' with |l - l'| = 1, contract the common indices (method.md,
section 2). `derive` finds the same space exactly; the tests compare the two.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array, read_only
from symrefine.moments import Moments, tensor_index

# The 3-D orders of the paper's experiments: 17 triplets from moments to order 5.
PAPER_ORDERS: tuple[tuple[int, ...], ...] = ((3,), (5,), (2, 3), (2, 5), (4, 3), (4, 5))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NTuples:
    """Vectors that turn with the object, v(R X) = R v(X), scaled to be comparable across orders and objects.

    Attributes:
        vectors: [T, n] tuples, each divided by a bound of it, so |v| <= 1: radial moments of the even orders around
            each factor's, or where the moments end at an odd order, what they themselves say (`_Traces.bound`).
        replicates: [B, T, n] jackknife replicates, each divided by a bound of its own; B = 0 where the moments are
            exact.
        labels: [T] orders and ranks each tuple was made from.
    """

    vectors: Array
    replicates: Array
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vectors", read_only(self.vectors))
        object.__setattr__(self, "replicates", read_only(self.replicates))

    @property
    def noise(self) -> Array:
        """Standard deviation [T] of each tuple's components from the sampling of the points (jackknife)."""
        return np.asarray(np.sqrt((self._deviations() ** 2).sum(axis=0).mean(axis=-1)))

    @property
    def covariance(self) -> Array:
        """Covariance [T, n, n] of each tuple's components from the sampling of the points; zero for exact moments.

        Delete-a-group jackknife (Kott 2001) of B parts: `(B - 1) / B sum_b (v_b - v)(v_b - v)'`. It has B - 1 degrees
        of freedom: entries scatter by `sqrt(2 / (B - 1))` of their size (a third for B = 16), and with B <= n it is
        singular. It turns with the object: R C R'.
        """
        spread = self._deviations()
        return np.asarray(np.einsum("bti,btj->tij", spread, spread))

    @property
    def joint_covariance(self) -> Array:
        """Covariance [T n, T n] of all components of all tuples, which share their points and so their errors.

        Of rank B - 1 at most.
        """
        flat = self._deviations().reshape(len(self.replicates), self.vectors.size)
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

    def _deviations(self) -> Array:
        """Replicates [B, T, n] less their mean, scaled so that their squares add up to variances."""
        parts = len(self.replicates)
        if not parts:
            return self.replicates
        return np.asarray(np.sqrt((parts - 1) / parts) * (self.replicates - self.replicates.mean(axis=0)))


def ntuples(moments: Moments, orders: Sequence[Sequence[int]] = PAPER_ORDERS) -> NTuples:
    """All n-tuples of one or two factors with the given orders.

    Args:
        moments: normalised central moments to at least the highest order named.
        orders: e.g. `((3,), (2, 3), (4, 5))`.

    Raises:
        InputError: an order the moments do not reach, or more than two factors.
    """
    _check(orders, moments.order)
    stacked = np.concatenate([moments.values[None], moments.replicates])
    traced = _Traces(stacked, moments.dim, moments.order)
    vectors, labels = [], []
    for label, vector in _contractions(traced, orders):
        vectors.append(vector)
        labels.append(label)
    whole = np.stack(vectors, axis=1)
    return NTuples(vectors=whole[0], replicates=whole[1:], labels=tuple(labels))


def _check(orders: Sequence[Sequence[int]], reach: int) -> None:
    for term in orders:
        if not 1 <= len(term) <= 2 or min(term) < 1 or sum(term) % 2 == 0:
            raise InputError(f"orders {tuple(term)}: expected one or two positive orders with an odd sum")
        if max(term) > reach:
            raise InputError(f"orders {tuple(term)}: the moments reach order {reach} only")


class _Traces:
    """Moment tensors [B, n^l] of each degree p, traced down to rank l; computed once each."""

    def __init__(self, values: Array, dim: int, order: int) -> None:
        self.values, self.dim, self.order = values, dim, order
        self._known: dict[tuple[int, int], Array] = {}

    def __call__(self, degree: int, rank: int) -> Array:
        """T_degree traced to `rank`, batched over the first index."""
        key = (degree, rank)
        if key not in self._known:
            if rank == degree:
                self._known[key] = self.values[:, tensor_index(self.dim, degree, self.order)]
            else:
                self._known[key] = np.trace(self(degree, rank + 2), axis1=-2, axis2=-1)
        return self._known[key]

    def bound(self, degree: int) -> Array:
        """[B] at least the Frobenius norm of T_degree traced to any rank, which is at most `int r^degree`.

        By Cauchy and Schwarz that integral is below the geometric mean of the even orders around. Without the upper one
        no bound of it is known; then the bound is the largest of those norms, or `(int r^low)^(degree/low)`, which is
        never above the integral (Jensen), if that is larger: objects whose odd moments vanish need a scale too.
        """
        low, high = degree - degree % 2, degree + degree % 2
        if high <= self.order:
            return np.asarray(np.sqrt(self(low, 0) * self(high, 0)))
        batch = len(self.values)
        norms = [np.linalg.norm(self(degree, rank).reshape(batch, -1), axis=1) for rank in range(1, degree + 1, 2)]
        return np.max([self(low, 0) ** (degree / max(low, 1)), *norms], axis=0)


def _contractions(traced: _Traces, orders: Sequence[Sequence[int]]) -> Iterator[tuple[str, Array]]:
    for term in orders:
        if len(term) == 1:
            yield f"({term[0]})", traced(term[0], 1) / traced.bound(term[0])[:, None]
            continue
        even, odd = sorted(term, key=lambda p: p % 2)
        bound = (traced.bound(even) * traced.bound(odd))[:, None]
        for low in range(even, -1, -2):
            for high in (low - 1, low + 1):
                if 1 <= high <= odd:
                    yield f"({even}->{low},{odd}->{high})", _contract(traced(even, low), traced(odd, high)) / bound


def _contract(a: Array, b: Array) -> Array:
    """Contract all indices of the tensor of lower rank with the other: [B, n^l] x [B, n^(l+1)] -> [B, n]."""
    small, large = sorted((a, b), key=lambda t: t.ndim)
    batch, dim = large.shape[0], large.shape[-1]
    return np.einsum("bi,bij->bj", small.reshape(batch, -1), large.reshape(batch, -1, dim))
