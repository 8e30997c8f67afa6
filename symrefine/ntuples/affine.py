"""Affine n-tuples, derived exactly: vectors x of polynomials in moments with x(AX) = det(A)^w A x(X), A any matrix.

The general scheme asked for in the paper's conclusion. The moments of order p are a symmetric tensor T_p, and A acts on
each of its p indices. What is sought among the products of such tensors is det^w times the standard representation of
GL(n). Scaling x_i by s scales f_i by s^(w+1) and the other components by s^w: every monomial of f_1 has the total
exponents (w+1, w, .., w), so the total order is n w + 1, which fixes w. f_1 is the highest-weight vector: the shears

    D_ij (dx_i = x_j),    D_ij m_p = p_i m_(p - e_i + e_j)

that raise its weight must leave nothing, D_21 f_1 = 0 and, if n > 2, D_32 f_1 = 0. Exchanging two coordinates has
determinant -1: so f_1 is symmetric in x_2..x_n for even w and antisymmetric for odd w, which gives D_43 f_1 = 0 and so
on, and f_j = D_1j f_1 is (-1)^w times f_1 with x_1 and x_j exchanged.

What there is (first fundamental theorem for SL(n)): contractions of the tensors with w Levi-Civita symbols that leave
one index free. No symbol can take two indices of one symmetric tensor, so w > 0 needs at least n factors.

- 2-D, two factors: orders (p, p+1) only, one doublet each, w = p; (2, 3) is the doublet of the paper's conclusion.
- n-D, orders (2, .., 2, 3) with n-1 twos: w = 2 and one n-tuple, cof(T_2) : T_3, i.e. sum_kl cof(T_2)_kl (T_3)_klj.
  So the paper's doublet is det(T_2) times the moment of (x' T_2^-1 x) x: with y = T_2^-1/2 x the whitened points,
  T_2^1/2 times the moment of |y|^2 y, the skewness vector of Mori, Rohatgi and Szekely (1993).

A discrete set gives det(A)^w A. A density gives |det A| more for each factor; `mass_power` is the power of m_0..0 that
takes all of it away. For a discrete set, division by det(T_2)^(w/2) does so. Both leave sign(det A)^w.
"""

from collections.abc import Hashable, Iterator, Sequence

from symrefine.ntuples.derive import Law, MomentSpace, Word, checked, solve
from symrefine.ntuples.notation import Exponents, NTupleBasis


def derive_affine(dim: int, orders: Sequence[int]) -> NTupleBasis:
    """Exact basis of the affine n-tuples that are linear in the products of moments of the given orders.

    Args:
        dim: n >= 2.
        orders: order of each factor, e.g. (2, 3) in 2-D or (2, 2, 3) in 3-D.

    Returns:
        The basis with its `det_power` w; empty, and its `note` says why, where there are none.

    Raises:
        InputError: dim < 2, no orders, orders < 1, or more monomials than fit.
    """
    space = MomentSpace(*checked(dim, orders))
    det_power, rest = divmod(sum(space.orders) - 1, space.dim)
    tuples = [] if rest else solve(space, affine_law(space, det_power))
    return NTupleBasis(
        dim=space.dim,
        orders=space.orders,
        tuples=tuple(tuples),
        kinds=tuple("affine" for _ in tuples),
        det_power=det_power if tuples else 0,
        note="" if tuples else _why_none(space, det_power, rest),
    )


def affine_law(space: MomentSpace, det_power: int) -> Law:
    """f_1 is a highest-weight vector of det^w times the standard representation of GL(n)."""
    weight = tuple(det_power + (k == 0) for k in range(space.dim))

    def admits(totals: Exponents) -> bool:
        return totals == weight

    def conditions(word: Word) -> Iterator[tuple[Hashable, int]]:
        for c, target in space.flow(word, 1, 0):
            yield ("D21 f1", target), c
        for c, target in space.flow(word, 2, 1) if space.dim > 2 else ():
            yield ("D32 f1", target), c

    return Law(kind="affine", sign=(-1) ** det_power, admits=admits, conditions=conditions)


def _why_none(space: MomentSpace, det_power: int, rest: int) -> str:
    n, degree = space.dim, sum(space.orders)
    if rest:
        return (
            f"no affine n-tuples: x(AX) = det(A)^w A x(X) needs a total order of {n} w + 1 such as "
            f"{n * det_power + 1} or {n * det_power + n + 1}; it is {degree}"
        )
    if det_power and len(space.orders) < n:
        return (
            f"no affine n-tuples: det(A)^{det_power} needs {n} or more factors, one for each index of a Levi-Civita "
            f"symbol; there are {len(space.orders)}"
        )
    return f"no affine n-tuples: only the zero solution for orders {space.orders} in {n}-D"
