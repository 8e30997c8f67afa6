"""`derive_affine` against the paper's doublet, random linear maps, contractions and characters of GL(n)."""

import math
from collections import Counter
from itertools import combinations_with_replacement, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symrefine.errors import InputError
from symrefine.ntuples.affine import derive_affine
from symrefine.ntuples.notation import law, to_json, to_text
from tests.ntuples.test_derive import from_json

CASES = [
    (2, (1,)), (2, (2, 3)), (2, (3, 4)), (2, (4, 5)), (2, (2, 2, 3)), (2, (2, 3, 4)), (2, (2, 2, 5)), (3, (2, 2, 3)),
    (3, (4, 4, 5)), (3, (3, 3, 3, 4)), (3, (2, 2, 2, 3, 4)), (3, (2, 2, 3, 4, 5)), (4, (2, 2, 2, 3)),
]  # fmt: skip


def moments_of(points, weights, wanted):
    return {e: float(weights @ np.prod(points ** np.array(e), axis=1)) for e in wanted}


def linear_map(rng, dim, det_sign):
    """Singular values in [0.6, 1.7]: far from orthogonal, well conditioned."""
    u, _, v = np.linalg.svd(rng.standard_normal((dim, dim)))
    a = u @ np.diag(rng.uniform(0.6, 1.7, dim)) @ v
    a[0] *= det_sign * np.sign(np.linalg.det(a))
    return a


@pytest.mark.parametrize("det_sign", [1, -1])
@pytest.mark.parametrize(("dim", "orders"), CASES)
def test_equivariance_under_linear_maps(dim, orders, det_sign):
    rng = np.random.default_rng(dim)
    basis = derive_affine(dim, orders)
    assert len(basis) > 0
    points, weights = rng.uniform(-1, 1, (25, dim)), rng.uniform(0.1, 1, 25)
    a = linear_map(rng, dim, det_sign)
    x = basis.evaluate(moments_of(points, weights, basis.moments))
    y = basis.evaluate(moments_of(points @ a.T, weights, basis.moments))
    expected = np.linalg.det(a) ** basis.det_power * x @ a.T
    # Terms are up to 1e5 times their sum for high powers of the determinant; 1e-9 still leaves rounding room.
    np.testing.assert_allclose(y, expected, atol=1e-9 * np.abs(expected).max())


def test_contains_the_doublet_of_the_paper():
    """Conclusion: (m02 m30 - 2 m11 m21 + m12 m20, m02 m21 + m03 m20 - 2 m11 m12), divided by m00^4 for a density."""
    basis = derive_affine(2, (2, 3))
    printed = (
        {(1, ((0, 2), (3, 0))), (-2, ((1, 1), (2, 1))), (1, ((2, 0), (1, 2)))},
        {(1, ((0, 2), (2, 1))), (1, ((2, 0), (0, 3))), (-2, ((1, 1), (1, 2)))},
    )
    assert [set(component) for component in basis.tuples[0]] == list(printed)
    assert (len(basis), basis.det_power, basis.mass_power) == (1, 2, 4)
    assert "x / m_00^4 takes A alone" in to_text(basis)


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_skewness_vector_in_any_dimension(dim):
    """cof(T_2) : T_3 is the only affine n-tuple of n-1 second and one third order moments."""
    basis = derive_affine(dim, (2,) * (dim - 1) + (3,))
    rng = np.random.default_rng(dim)
    x = rng.standard_normal((40, dim))
    t2, t3 = x.T @ x, np.einsum("ni,nj,nk->ijk", x, x, x)
    expected = np.einsum("kl,klj->j", np.linalg.det(t2) * np.linalg.inv(t2), t3)
    value = basis.evaluate(moments_of(x, np.ones(40), basis.moments))
    assert (len(basis), basis.det_power) == (1, 2)
    np.testing.assert_allclose(value[0], expected, rtol=1e-9)


def density_nodes(simplices, order):
    """Nodes and weights of an exact rule for a unit density on simplices [s, n+1, n] (Duffy map, Gauss-Legendre)."""
    dim = simplices.shape[2]
    t, w = np.polynomial.legendre.leggauss(order // 2 + 1 + dim)
    t, w = (t + 1) / 2, w / 2
    grid, mass = np.array(list(product(t, repeat=dim))), np.array([math.prod(c) for c in product(w, repeat=dim)])
    barycentric, rest = [], np.ones(len(grid))
    for k in range(dim):
        mass = mass * (1 - grid[:, k]) ** (dim - 1 - k)
        barycentric.append(rest * grid[:, k])
        rest = rest * (1 - grid[:, k])
    nodes = np.stack([*barycentric, rest], axis=1) @ simplices
    volumes = np.abs(np.linalg.det(simplices[:, 1:] - simplices[:, :1]))
    return nodes.reshape(-1, dim), np.multiply.outer(volumes, mass).ravel()


@pytest.mark.parametrize("det_sign", [1, -1])
@pytest.mark.parametrize(
    ("dim", "orders"), [(2, (2, 3)), (2, (3, 4)), (2, (2, 2, 3)), (3, (2, 2, 3)), (3, (3, 3, 3, 4))]
)
def test_density_takes_the_map_itself_once_divided_by_the_mass(dim, orders, det_sign):
    basis, rng = derive_affine(dim, orders), np.random.default_rng(5)
    simplices, a = rng.uniform(-1, 1, (4, dim + 1, dim)), linear_map(rng, dim, det_sign)

    def normalised(corners):
        nodes, weights = density_nodes(corners, max(orders))
        return basis.evaluate(moments_of(nodes, weights, basis.moments)) / weights.sum() ** basis.mass_power

    expected = det_sign**basis.det_power * normalised(simplices) @ a.T
    np.testing.assert_allclose(normalised(simplices @ a.T), expected, atol=1e-9 * np.abs(expected).max())


def test_discrete_sets_take_the_map_itself_once_divided_by_the_covariance():
    basis, rng = derive_affine(3, (2, 2, 3)), np.random.default_rng(1)
    x, a = rng.standard_normal((30, 3)), linear_map(rng, 3, -1)

    def normalised(points):
        value = basis.evaluate(moments_of(points, np.ones(30), basis.moments))
        return value / np.linalg.det(points.T @ points) ** (basis.det_power / 2)

    np.testing.assert_allclose(normalised(x @ a.T), normalised(x) @ a.T, rtol=1e-9)


# --- how many there are -----------------------------------------------------------------------------------------------


def character_count(dim, orders):
    """Multiplicity of the highest weight (w+1, w, .., w) by Weyl's alternating sum of weight multiplicities."""
    w, rest = divmod(sum(orders) - 1, dim)
    if rest:
        return 0
    count = Counter({(0,) * dim: 1})
    for p, k in Counter(orders).items():
        letters = [e for e in product(range(p + 1), repeat=dim) if sum(e) == p]
        power = Counter(tuple(map(sum, zip(*c, strict=True))) for c in combinations_with_replacement(letters, k))
        count = convolved(count, power)
    rho = np.arange(dim)[::-1]
    weight = np.full(dim, w) + (np.arange(dim) == 0)
    total = 0
    for order in permutations(range(dim)):
        sign = round(np.linalg.det(np.eye(dim)[list(order)]))
        total += sign * count[tuple((weight + rho - rho[list(order)]).tolist())]
    return total


def convolved(left, right):
    out = Counter()
    for (a, m), (b, n) in product(left.items(), right.items()):
        out[tuple(p + q for p, q in zip(a, b, strict=True))] += m * n
    return out


@settings(max_examples=40)
@given(st.integers(2, 3), st.lists(st.integers(1, 4), min_size=1, max_size=4))
def test_count_equals_the_character_formula(dim, orders):
    assert len(derive_affine(dim, orders)) == character_count(dim, orders)


@pytest.mark.parametrize(
    ("dim", "orders"), [*CASES[:9], (3, (3, 3, 4)), (3, (2, 4, 4)), (4, (3, 3, 3, 4)), (4, (1, 2, 2))]
)
def test_count_of_larger_cases(dim, orders):
    assert len(derive_affine(dim, orders)) == character_count(dim, orders)


@pytest.mark.parametrize(("p", "q"), list(product(range(1, 7), repeat=2)))
def test_transvectants_of_two_factors_in_the_plane(p, q):
    """Clebsch-Gordan: S^p x S^q holds det^k S^(p+q-2k), a vector only if |p - q| = 1."""
    basis = derive_affine(2, (p, q))
    assert len(basis) == (abs(p - q) == 1)
    assert basis.det_power == (min(p, q) if len(basis) else 0)


def test_bases_are_independent():
    basis = derive_affine(3, (2, 2, 2, 3, 4))
    rng = np.random.default_rng(2)
    samples = [moments_of(rng.standard_normal((20, 3)), np.full(20, 0.05), basis.moments) for _ in range(2)]
    values = np.stack([basis.evaluate(m) for m in samples])
    assert len(basis) == 2
    assert np.linalg.matrix_rank(values.transpose(1, 0, 2).reshape(2, -1)) == 2


# --- messages ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dim", "orders", "reason"),
    [(3, (2, 3), "total order of 3 w + 1 such as 4 or 7; it is 5"), (3, (2, 5), "needs 3 or more factors"),
     (3, (3, 3, 4), "only the zero solution")],
)  # fmt: skip
def test_why_there_are_none(dim, orders, reason):
    basis = derive_affine(dim, orders)
    assert len(basis) == 0
    assert reason in basis.note
    assert from_json(to_json(basis)) == basis


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="dim 1"):
        derive_affine(1, (3,))


def test_odd_powers_of_the_determinant_are_said_to_keep_a_sign():
    assert law(derive_affine(2, (3, 4)), "affine").endswith("up to the sign of det A")
