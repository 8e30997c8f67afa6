"""`derive` against the paper's system solved by brute force, the printed n-tuples, characters, and the law itself."""

import json
import math
import re
from collections import Counter
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal
from symrefine.ntuples import notation
from symrefine.ntuples.derive import derive, monomial_count
from symrefine.ntuples.notation import NTupleBasis, to_json, to_latex, to_python, to_text
from symrefine.ntuples.nullspace import null_space

# (dim, orders, rotations only, rotations and a reflection): method.md, section 2; the last line is not there.
DIMENSIONS = [
    (3, (2, 3), 3, 3), (3, (2, 5), 3, 3), (3, (4, 3), 4, 4), (3, (3,), 1, 1), (3, (2, 2, 3), 7, 7),
    (3, (3, 3, 3), 5, 5), (2, (2, 3), 6, 3), (2, (2, 5), 6, 3), (2, (4, 3), 8, 4), (2, (4, 5), 10, 5),
    (4, (2, 3), 3, 3), (4, (3,), 1, 1),
    (3, (2, 4), 1, 0), (2, (2, 4), 0, 0), (3, (1,), 1, 1), (4, (2, 5), 3, 3),
]  # fmt: skip


# --- the paper's system, brute force ----------------------------------------------------------------------------------


def exponents(dim, order):
    return [e for e in product(range(order + 1), repeat=dim) if sum(e) == order]


def monomials(dim, orders):
    """All products, each a sorted tuple of exponents."""
    parts = [combinations_with_replacement(exponents(dim, p), k) for p, k in Counter(orders).items()]
    return [tuple(sorted(e for part in parts for e in part)) for parts in product(*parts)]


def turned(monomial, i, j):
    """d/dt of the monomial under dx_i = -x_j, dx_j = x_i, from eq. dmp1ppnsimp: p_a l_ab m_(p - e_a + e_b)."""
    terms = Counter()
    for k, e in enumerate(monomial):
        for a, b, speed in ((i, j, -1), (j, i, 1)):
            if e[a]:
                target = list(e)
                target[a] -= 1
                target[b] += 1
                terms[tuple(sorted((*monomial[:k], tuple(target), *monomial[k + 1 :])))] += speed * e[a]
    return terms


def paper_system(dim, orders, *, reflection, sign=1):
    """Rows of eq. exampletriplecalculation6; `sign` -1 gives the conditions with the sign as printed."""
    words = monomials(dim, orders)
    number = {w: k for k, w in enumerate(words)}
    rows = []
    for i, j in combinations(range(dim), 2):
        interaction = np.zeros((len(words), len(words)))
        for w, k in number.items():
            for target, c in turned(w, i, j).items():
                interaction[k, number[target]] += c
        speed = np.zeros((dim, dim))
        speed[i, j], speed[j, i] = -1, 1
        # alpha_a' L v = sum_b speed_ab alpha_b' v for every v
        rows.append(np.kron(np.eye(dim), interaction.T) - sign * np.kron(speed, np.eye(len(words))))
    if reflection:
        flips = [(-1) ** sum(e[k] for e in w) for k in range(dim) for w in words]
        wanted = [-1 if a == k else 1 for k in range(dim) for a in range(dim) for _ in words]
        diagonal = np.repeat(np.array(flips).reshape(dim, 1, -1), dim, axis=1).ravel() - np.array(wanted)
        rows += list(diagonal.reshape(dim, 1, -1) * np.eye(dim * len(words)))
    return words, np.vstack(rows)


def nullity(matrix):
    return matrix.shape[1] - np.linalg.matrix_rank(matrix.T @ matrix, tol=1e-6)


def as_vectors(basis, words):
    """Coefficients [k, n N] of the n-tuples in the order of `words`."""
    number = {w: k for k, w in enumerate(words)}
    rows = np.zeros((len(basis), basis.dim, len(words)))
    for row, ntuple in zip(rows, basis.tuples, strict=True):
        for values, component in zip(row, ntuple, strict=True):
            for c, monomial in component:
                values[number[tuple(sorted(monomial))]] += c
    return rows.reshape(len(basis), basis.dim * len(words))


@pytest.mark.parametrize(("dim", "orders", "rotations", "reflections"), DIMENSIONS)
def test_dimensions_of_the_solution_space(dim, orders, rotations, reflections):
    assert len(derive(dim, orders)) == reflections
    free = derive(dim, orders, reflection=False)
    assert len(free) == rotations
    assert Counter(free.kinds) == +Counter(polar=reflections, axial=rotations - reflections)


BRUTE_FORCE = [
    (2, (2, 3)), (2, (3,)), (2, (4, 3)), (2, (2, 2, 3)), (2, (3, 3, 3)), (2, (1, 1, 3)), (3, (2, 3)), (3, (3,)),
    (3, (5,)), (3, (1, 1, 1)), (3, (2, 4)), (3, (1, 1)), (3, (2, 2, 2)), (4, (3,)), (4, (1, 2)),
]  # fmt: skip


@pytest.mark.parametrize("reflection", [True, False])
@pytest.mark.parametrize(("dim", "orders"), BRUTE_FORCE)
def test_equals_the_null_space_of_the_full_system(dim, orders, reflection):
    words, system = paper_system(dim, orders, reflection=reflection)
    vectors = as_vectors(derive(dim, orders, reflection=reflection), words)
    assert not np.any(system @ vectors.T)  # exact: small integers in float64
    assert len(vectors) == nullity(system)
    assert np.linalg.matrix_rank(vectors) == len(vectors) if len(vectors) else True


def test_conditions_as_printed_have_the_zero_solution_only():
    _, printed = paper_system(3, (2, 3), reflection=False, sign=-1)
    _, corrected = paper_system(3, (2, 3), reflection=False)
    assert nullity(printed) == 0
    assert nullity(corrected) == 3


# --- what the paper prints --------------------------------------------------------------------------------------------

P_3D = [
    ["003 101+012 110+021 101+030 110+101 201+102 200+110 210+120 200+200 300",
     "003 011+011 021+012 020+020 030+011 201+102 110+020 210+110 120+110 300",
     "002 003+002 021+011 012+011 030+002 201+101 102+011 210+101 120+101 300"],
    ["002 120-2 011 111+020 102+002 300-2 101 201+102 200+020 300-2 110 210+120 200",
     "002 030-2 011 021+012 020+002 210+012 200-2 101 111+020 210+030 200-2 110 120",
     "002 021+003 020-2 011 012+002 201+003 200-2 101 102+020 201+021 200-2 110 111"],
    ["002 102+2 011 111+020 120+2 101 201+2 110 210+200 300",
     "002 012+2 011 021+020 030+2 101 111+2 110 120+200 210",
     "002 003+2 011 012+020 021+2 101 102+2 110 111+200 201"],
]  # fmt: skip
P2D23V1 = [
    ["03 11-02 12-02 30+11 21", "11 12-03 20+11 30-20 21"],
    ["2 03 11-2 02 12-02 30+12 20", "02 21-03 20+2 11 30-2 20 21"],
    ["3 02 12-2 03 11+2 02 30+20 30", "02 03+2 03 20-2 11 30+3 20 21"],
]


def printed_basis(tuples, dim):
    """The paper's list as a basis: "2 03 11" is 2 m03 m11, a number of fewer than `dim` digits is a coefficient."""

    def term(text):
        tokens = text.split()
        c = int(tokens.pop(0)) if len(tokens[0].lstrip("-")) < dim else -1 if tokens[0].startswith("-") else 1
        return c, tuple(tuple(map(int, t.lstrip("-"))) for t in tokens)

    components = [[tuple(term(t) for t in c.replace("-", "+-").split("+")) for c in t] for t in tuples]
    return NTupleBasis(dim=dim, orders=(2, 3), tuples=tuple(map(tuple, components)), kinds=("polar",) * len(components))


def exact_rank(matrix):
    rows, rank = [[Fraction(int(c)) for c in row] for row in matrix], 0
    for column in range(len(rows[0])):
        pivot = next((r for r in rows[rank:] if r[column]), None)
        if pivot is None:
            continue
        rows.remove(pivot)
        rows = [[a - r[column] / pivot[column] * b for a, b in zip(r, pivot, strict=True)] for r in rows[rank:]]
        rows, rank = [pivot] * (rank + 1) + rows, rank + 1
    return rank


@pytest.mark.parametrize(("dim", "printed"), [(3, P_3D), (2, P2D23V1)])
def test_printed_tuples_span_the_derived_space(dim, printed):
    words = monomials(dim, (2, 3))
    ours, theirs = as_vectors(derive(dim, (2, 3)), words), as_vectors(printed_basis(printed, dim), words)
    assert exact_rank(ours) == exact_rank(theirs) == exact_rank(np.vstack([ours, theirs])) == 3


# --- characters: an independent count ---------------------------------------------------------------------------------


def weights(dim, orders):
    """Multiplicities of the weights of the products under the rotation of one plane (2-D and 3-D)."""
    letters = {p: [(a - b) for a, b, *_ in exponents(dim, p)] for p in set(orders)}
    total = Counter({0: 1})
    for p, k in Counter(orders).items():
        power = Counter(map(sum, combinations_with_replacement(letters[p], k)))
        total = convolved(total, power)
    return total


def convolved(left, right):
    out = Counter()
    for (a, m), (b, n) in product(left.items(), right.items()):
        out[a + b] += m * n
    return out


@settings(max_examples=40)
@given(st.sampled_from([2, 3]), st.lists(st.integers(1, 5), min_size=1, max_size=3))
def test_dimension_equals_multiplicity_of_the_vector_representation(dim, orders):
    """SO(3): vectors = weights 1 less weights 2. O(2): weights 1 (as many polar as axial ones)."""
    count = weights(dim, orders)
    basis = derive(dim, orders, reflection=False)
    if dim == 3:
        assert len(basis) == count[1] - count[2]
        assert set(basis.kinds) <= {"polar" if sum(orders) % 2 else "axial"}
    else:
        assert Counter(basis.kinds) == +Counter(polar=count[1], axial=count[1])


@pytest.mark.parametrize(("dim", "orders"), [(3, (8, 9)), (4, (2, 5)), (4, (4, 5)), (5, (2, 3)), (6, (3, 4))])
def test_two_factors_give_one_tuple_for_each_pair_of_neighbouring_ranks(dim, orders):
    """Closed form: trace to ranks l = p, p-2, .. and l' = p', p'-2, .. with |l - l'| = 1, contract what is common."""
    ranks = [range(p, -1, -2) for p in orders]
    basis = derive(dim, orders)
    assert len(basis) == sum(abs(a - b) == 1 for a, b in product(*ranks))
    check_equivariance(basis, np.random.default_rng(dim), dets=(-1,))


# --- the law itself ---------------------------------------------------------------------------------------------------


def moments_of(points, weights_, wanted):
    return {e: float(weights_ @ np.prod(points ** np.array(e), axis=1)) for e in wanted}


def check_equivariance(basis, rng, dets=(1, -1)):
    # Points in the unit ball and weights of sum 1 keep every moment below 1; 1e-9 of the largest tuple is far above
    # the rounding of some thousand terms and far below any wrong coefficient, which is an integer.
    points = rng.uniform(-1, 1, (30, basis.dim)) / math.sqrt(basis.dim)
    mass = rng.dirichlet(np.ones(30))
    x = basis.evaluate(moments_of(points, mass, basis.moments))
    for det in dets:
        turn = random_orthogonal(rng, basis.dim, det)
        y = basis.evaluate(moments_of(points @ turn.T, mass, basis.moments))
        signs = np.array([det if kind == "axial" else 1 for kind in basis.kinds])
        np.testing.assert_allclose(y, signs[:, None] * x @ turn.T, atol=1e-9 * np.abs(x).max())


@pytest.mark.parametrize(
    ("dim", "orders"),
    [(2, (4, 5)), (2, (2, 2, 3)), (3, (2, 3)), (3, (2, 2, 3)), (3, (3, 3, 3)), (3, (4, 5)), (3, (2, 2, 2, 3)),
     (3, (2, 2, 4)), (3, (2, 3, 5)), (4, (2, 3, 4)), (4, (2, 5)), (5, (2, 3)), (7, (1, 2))],
)  # fmt: skip
def test_equivariance_under_rotations_and_reflections(dim, orders):
    check_equivariance(derive(dim, orders, reflection=False), np.random.default_rng(7))


def test_four_dimensions_have_axial_tuples_of_three_factors():
    """A Levi-Civita symbol leaves one index free and needs three different vectors: (2, 3, 4) has them."""
    assert set(derive(4, (2, 3, 4), reflection=False).kinds) == {"polar", "axial"}


# --- the form of the answer -------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(st.integers(2, 4), st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_components_are_primitive_integers_and_the_order_of_factors_does_not_matter(dim, orders):
    basis = derive(dim, orders)
    assert basis == derive(dim, orders[::-1])
    assert bool(basis.note) == (len(basis) == 0)
    for ntuple in basis.tuples:
        assert len(ntuple) == dim
        assert math.gcd(*(c for component in ntuple for c, _ in component)) == 1
        assert ntuple[0][0][0] > 0
        for component in ntuple:
            assert all(tuple(sum(e) for e in monomial) == tuple(sorted(orders)) for _, monomial in component)
            assert len({monomial for _, monomial in component}) == len(component)


def test_basis_is_the_readable_one():
    """T_2 : T_3, T_2 tr T_3 and tr T_2 tr T_3 and nothing longer."""
    assert [len(ntuple[0]) for ntuple in derive(3, (2, 3)).tuples] == [6, 9, 9]
    assert to_text(derive(3, (3,))) == (
        "1 triplet of v^(1)_(3) in 3-D: 1 polar\n"
        "polar: x(RX) = R x(X) for every orthogonal R, det R = +1 and -1\n\n"
        "x_v1 (polar)\n  [1] m300 + m120 + m102\n  [2] m210 + m030 + m012\n  [3] m201 + m021 + m003\n"
    )


def test_even_order_is_explained():
    basis = derive(3, (2, 4))
    assert len(basis) == 0
    assert "total order 6 is even" in to_text(basis)
    assert from_json(to_json(basis)) == basis


@pytest.mark.parametrize(
    ("dim", "orders", "message"),
    [(1, (3,), "dim 1"), (3, (), "one or more"), (3, (0, 3), ">= 1"), (3, (-2, 3), ">= 1"), (3, 5, "expected"),
     (3, "23", "expected"), (3, (2.5,), "expected"),
     (3, (9, 9, 9, 9), "424,270 monomials; the limit is 200,000 monomials"),
     (2, (3, 4, 5, 6, 7), "6,720 monomials; symmetry leaves 3,360 unknowns, the limit is 2,500"),
     (10**7, (2, 3), "more than 10"), (2, (9,) * 100_000, "more than 10")],
)  # fmt: skip
def test_bad_input_is_one_clear_line(dim, orders, message):
    with pytest.raises(InputError, match=message) as error:
        derive(dim, orders)
    assert "\n" not in str(error.value)


@settings(max_examples=20)
@given(st.integers(2, 4), st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_monomial_count(dim, orders):
    assert monomial_count(dim, orders) == len(monomials(dim, orders))


# --- exact null space -------------------------------------------------------------------------------------------------


def sparse(matrix):
    return [{k: int(c) for k, c in enumerate(row) if c} for row in matrix]


@given(st.lists(st.lists(st.integers(-9, 9), min_size=5, max_size=5), min_size=1, max_size=6))
def test_null_space_of_random_matrices(matrix):
    vectors = null_space(sparse(matrix), 5)
    assert len(vectors) == 5 - exact_rank(matrix)
    assert not vectors or exact_rank(vectors) == len(vectors)
    assert not np.any(np.array(matrix) @ np.array(vectors, dtype=int).reshape(-1, 5).T)


def test_null_space_with_entries_beyond_one_prime():
    p, q = 10**30 + 57, 10**20 + 39
    expected = [7 * q, p * q, 3 * p]
    divisor = math.gcd(*expected)
    assert null_space([{0: p, 1: -7}, {1: 3, 2: -q}], 3) == [[c // divisor for c in expected]]


def test_null_space_survives_primes_that_lower_the_rank():
    first, second = 2**31 - 1, 2**31 - 19
    assert null_space([{0: first}], 1) == []
    assert null_space([{0: first * second, 1: 1}], 2) == [[1, -first * second]]
    assert null_space([{0: first, 1: 1}, {1: second}], 2) == []


def test_null_space_without_equations_or_unknowns():
    assert null_space([], 2) == [[1, 0], [0, 1]]
    assert null_space([], 0) == []


# --- renderings -------------------------------------------------------------------------------------------------------

RENDERED = [(2, (2, 3)), (3, (2, 2, 3)), (3, (4, 5)), (2, (2, 11)), (4, (3,)), (3, (2, 4))]


@pytest.fixture(params=RENDERED, ids=str)
def basis(request):
    return derive(*request.param, reflection=False)


def parsed(text):
    """Terms of a sum such as "m20^2 m12 - 2 m11 m21"; exponents of two digits as in m10_0_3."""
    terms = []
    for sign, size, body in re.findall(r"([+-]?)\s*(\d*)\s*((?:m[\d_]+(?:\^\d+)?\s*)+)", text):
        monomial = []
        for digits, power in re.findall(r"m([\d_]+)(?:\^(\d+))?", body):
            monomial += [tuple(map(int, digits.split("_") if "_" in digits else digits))] * int(power or 1)
        terms.append(((-1 if sign == "-" else 1) * int(size or 1), tuple(monomial)))
    return tuple(terms)


def test_text_parses_back(basis):
    blocks = re.split(r"\n  \[\d+\] |\n\nx_v.*", to_text(basis))[1:]
    sums = [parsed(block) for block in blocks if block.strip()]
    assert sums == [component for ntuple in basis.tuples for component in ntuple]
    assert max(map(len, to_text(basis).splitlines())) <= 130


def from_json(text):
    """The basis that `to_json` wrote."""
    data = json.loads(text)

    def component(terms):
        return tuple((int(c), tuple(tuple(e) for e in monomial)) for c, monomial in terms)

    return NTupleBasis(
        dim=data["dim"],
        orders=tuple(data["orders"]),
        tuples=tuple(tuple(component(c) for c in ntuple) for ntuple in data["tuples"]),
        kinds=tuple(data["kinds"]),
        det_power=data["det_power"],
        note=data["note"],
    )


def test_json_parses_back(basis):
    assert from_json(to_json(basis)) == basis
    components = json.loads(to_json(basis))["tuples"]
    assert all(isinstance(c, str) and len(m) == len(basis.orders) for t in components for comp in t for c, m in comp)


def test_latex_parses_back(basis):
    body = to_latex(basis, document=False).replace(r"&\quad", "").replace(",", "_")
    plain = re.sub(r"\^\{(\d+)\}", r"^\1", re.sub(r"m_\{([\d_]+)\}", r"m\1", body))
    sums = [parsed(block) for block in re.split(r"x_\{.*\} &= ", plain)[1:]]
    assert sums == [component for ntuple in basis.tuples for component in ntuple]


def test_latex_is_a_document_whose_lines_are_mathematics(basis):
    text = to_latex(basis)
    assert text.startswith("\\documentclass")
    assert text.endswith("\\end{document}\n")
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") == len(basis)
    parser = MathTextParser("path")
    for line in [line for line in text.splitlines() if "&" in line][:6]:
        parser.parse(f"${line.replace(chr(92) * 2, '').replace('&', '')}$")


def test_python_evaluates_exactly(basis):
    source = to_python(basis, name="vectors")
    scope = {}
    exec(compile(source, "generated", "exec"), scope)
    rng = np.random.default_rng(3)
    moments = {e: Fraction(int(rng.integers(-50, 50)), 7) for e in basis.moments}
    expected = [
        [sum((c * math.prod(moments[e] for e in m) for c, m in component), Fraction(0)) for component in ntuple]
        for ntuple in basis.tuples
    ]
    assert scope["vectors"](moments) == expected
    np.testing.assert_allclose(
        basis.evaluate({e: float(v) for e, v in moments.items()}),
        np.array(expected, dtype=float).reshape(-1, basis.dim),
        rtol=1e-9,
        atol=1e-3,  # cancellation among terms of some 50^2/49 * multinomials
    )


def test_python_of_long_tuples_compiles():
    compile(to_python(derive(3, (6, 7))), "generated", "exec")


def test_title_and_name():
    assert notation.vector_name((2, 2, 3)) == "v^(2,1)_(2,3)"
    assert notation.title(derive(4, (3,))) == "1 4-tuple of v^(1)_(3) in 4-D: 1 polar"
    assert notation.title(derive(2, (2, 3), reflection=False)) == "6 doublets of v^(1,1)_(2,3) in 2-D: 3 polar, 3 axial"
