"""Contractions against the exact null space, the law v(RX) = R v(X), the bound |v| <= 1 and the noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f as f_distribution

from experiments.objects.shapes import asymmetric, box, join
from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal
from symrefine.moments.moments import Moments, central_moments, exponents, raw_moments, shape_moments
from symrefine.moments.quadrature import sample_surface
from symrefine.ntuples.contract import PAPER_ORDERS, NTuples, ntuples
from symrefine.ntuples.derive import derive

SEEDS = st.integers(0, 2**32 - 1)
# method.md, section 2: dimension, orders, number of n-tuples with reflection.
TABLE = [
    (3, (2, 3), 3), (3, (2, 5), 3), (3, (4, 3), 4), (3, (3,), 1), (2, (2, 3), 3), (2, (2, 5), 3), (2, (4, 3), 4),
    (2, (4, 5), 5), (4, (2, 3), 3), (4, (3,), 1),
]  # fmt: skip
MORE = [(3, (4, 5), 5), (3, (5,), 1), (3, (7,), 1), (2, (6, 3), 4), (3, (2, 7), 3), (5, (2, 3), 3), (3, (6, 1), 2)]


def cloud(seed, dim, count=25):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, dim)) ** 2 * rng.choice([-1, 1], dim), rng.random(count)


def radial(points, weights, degree):
    """The bound each factor is divided by, from its definition."""
    w, r = weights / weights.sum(), np.linalg.norm(points, axis=1)
    low, high = degree - degree % 2, degree + degree % 2
    return w @ r**low if low == high else np.sqrt((w @ r**low) * (w @ r**high))


def about_origin(points, weights, order):
    """Moments that are not central, so that those of order 1 have something to say too."""
    values = raw_moments(points, weights / weights.sum(), order)
    none = np.empty((0, len(values)))
    return Moments(dim=points.shape[1], order=order, values=values, replicates=none, center=np.zeros(3), scale=1.0)


def both(dim, orders, samples):
    """Null space and contractions as functions of the moments: one row each, evaluated on many random sets."""
    basis, order = derive(dim, orders), max(orders) + max(orders) % 2
    exact, closed = [], []
    for seed in range(samples):
        points, weights = cloud(seed, dim)
        moments = about_origin(points, weights, order)
        bound = np.prod([radial(points, weights, p) for p in orders])
        named = {tuple(e): v for e, v in zip(exponents(dim, order).tolist(), moments.values, strict=True)}
        exact.append(basis.evaluate(named) / bound)
        closed.append(ntuples(moments, [orders]).vectors)
    return np.concatenate(exact, axis=1), np.concatenate(closed, axis=1)


def rank(rows):
    """Number of independent rows, each scaled to length 1: exact dependence leaves 1e-15, the least true one 1e-6."""
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return int((np.linalg.svd(rows, compute_uv=False) > 1e-9).sum())


def check_span(dim, orders):
    exact, closed = both(dim, orders, samples=40)
    assert len(closed) == len(exact) == rank(exact) == rank(closed) == rank(np.concatenate([exact, closed]))


@pytest.mark.parametrize(("dim", "orders", "count"), TABLE + MORE)
def test_contractions_span_the_exact_null_space(dim, orders, count):
    check_span(dim, orders)
    assert len(derive(dim, orders)) == count


@settings(max_examples=8)
@given(st.integers(2, 4), st.integers(1, 3), st.integers(0, 3))
def test_contractions_span_the_null_space_of_any_orders(dim, half_even, half_odd):
    even, odd = 2 * half_even, 2 * half_odd + 1
    if dim == 4:
        even, odd = min(even, 4), min(odd, 3)
    check_span(dim, (even, odd))


@given(SEEDS, st.sampled_from([2, 3, 4]), st.sampled_from([1, -1]))
def test_tuples_turn_with_the_object(seed, dim, det):
    rng = np.random.default_rng(seed)
    matrix = random_orthogonal(rng, dim, det)
    points, weights = cloud(seed, dim)
    once = ntuples(central_moments(points, weights, 6))
    other = ntuples(central_moments(3e3 * points @ matrix.T + 100, weights, 6))
    np.testing.assert_allclose(other.vectors, once.vectors @ matrix.T, atol=1e-9)
    assert np.linalg.norm(once.vectors) > 1e-3


def test_replicates_turn_with_the_object():
    matrix = random_orthogonal(np.random.default_rng(1), 3, -1)
    points, weights = cloud(2, 3, 400)
    once = ntuples(central_moments(points, weights, 6, parts=8))
    other = ntuples(central_moments(points @ matrix.T, weights, 6, parts=8))
    assert once.replicates.shape == (8, *once.vectors.shape)
    np.testing.assert_allclose(other.replicates, once.replicates @ matrix.T, atol=1e-9)
    np.testing.assert_allclose(other.noise, once.noise, rtol=1e-6)


DRAW = np.random.default_rng(3)
EXTREME = {
    "one point far from a heavy one": ([[0.0, 0, 0], [1, 0, 0]], [1.0, 1e-6]),
    "two alike": ([[0.0, 0, 0], [1, 0, 0]], [1.0, 1.0]),
    "heavy tails": (DRAW.standard_normal((50, 3)) ** 5, DRAW.random(50)),
    "outlier": (np.concatenate([0.01 * DRAW.standard_normal((50, 3)), [[9.0, 2, 1]]]), np.ones(51)),
    "one-sided": (np.abs(DRAW.standard_normal((30, 3))), DRAW.random(30)),
    "rod": (np.abs(DRAW.standard_normal((30, 3))) * [10, 0.01, 1], DRAW.random(30)),
}


@pytest.mark.parametrize(("points", "weights"), EXTREME.values(), ids=EXTREME)
@pytest.mark.parametrize("order", [5, 6, 7, 8])
def test_no_tuple_is_longer_than_one(points, weights, order):
    highest = (order - 1 + order % 2,)
    found = ntuples(central_moments(np.array(points), np.array(weights), order), (*PAPER_ORDERS, highest))
    assert np.linalg.norm(found.vectors, axis=1).max() <= 1 + 1e-12


def test_tuples_vanish_where_the_group_fixes_no_vector():
    found = ntuples(shape_moments(join([box((1, 2, 3), (1, 0.7, 0.4))]), 8))
    np.testing.assert_allclose(found.vectors, 0.0, atol=1e-12)
    np.testing.assert_array_equal(found.noise, 0.0)


@pytest.mark.parametrize("shape", [join([box((0, 0, 0), (1, 0.7, 0.4))]), asymmetric()], ids=["box", "asymmetric"])
def test_noise_is_the_spread_over_independent_samples(shape):
    rng = np.random.default_rng(4)
    dense = sample_surface(shape, 200_000, rng)[0]
    ones = np.ones(2000)
    several = [
        ntuples(central_moments(dense[rng.integers(0, len(dense), 2000)], ones, 6, parts=16)) for _ in range(150)
    ]
    spread = np.sqrt(np.var([t.vectors for t in several], axis=0).mean(axis=1))
    promised = np.sqrt(np.mean([t.noise**2 for t in several], axis=0))
    # 150 samples give the spread to 6 %; the delete-a-group jackknife is known to promise some per cent too much.
    np.testing.assert_allclose(promised, spread, rtol=0.15)


def skewed(rng, count, dim):
    """Independent points of a body with nothing symmetric about it."""
    points = rng.random((count, dim)) ** np.linspace(1.5, 4.0, dim) * np.linspace(1.0, 2.0, dim)
    return points @ (np.eye(dim) + 0.4 * np.triu(np.ones((dim, dim)), 1))


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_covariance_is_that_of_independent_samples(dim):
    rng = np.random.default_rng(dim)
    count, orders = 1500, ((3,), (2, 3), (4, 3))
    several = [
        ntuples(central_moments(skewed(rng, count, dim), np.ones(count), 4, parts=16), orders) for _ in range(200)
    ]
    drawn = np.stack([t.vectors for t in several])
    true = np.einsum("sti,stj->tij", drawn - drawn.mean(axis=0), drawn - drawn.mean(axis=0)) / (len(drawn) - 1)
    promised = np.mean([t.covariance for t in several], axis=0)
    # In the axes in which the true covariance is I. 200 samples scatter its eigenvalues by sqrt(n / 200) and more; the
    # jackknife is known to promise some per cent too much.
    for mine, theirs in zip(promised, true, strict=True):
        root = np.linalg.inv(np.linalg.cholesky(theirs))
        np.testing.assert_allclose(np.linalg.eigvalsh(root @ mine @ root.T), 1.0, atol=0.45)
    size = np.trace(promised, axis1=1, axis2=2) / np.trace(true, axis1=1, axis2=2)
    np.testing.assert_allclose(size, 1.0, atol=0.25)
    correlated = np.mean([t.joint_covariance for t in several], axis=0)
    centred = (drawn - drawn.mean(axis=0)).reshape(len(drawn), -1)
    scale = np.sqrt(np.diag(correlated))
    true_joint = centred.T @ centred / (len(drawn) - 1)
    np.testing.assert_allclose(correlated / np.outer(scale, scale), true_joint / np.outer(scale, scale), atol=0.3)


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_covariance_turns_with_the_object_and_holds_the_noise(dim):
    rng = np.random.default_rng(10 + dim)
    points, matrix = skewed(rng, 500, dim), random_orthogonal(rng, dim, -1)
    once, turned = (ntuples(central_moments(p, np.ones(500), 6, parts=8)) for p in (points, points @ matrix.T))
    np.testing.assert_allclose(turned.covariance, matrix @ once.covariance @ matrix.T, rtol=1e-7, atol=1e-15)
    np.testing.assert_allclose(np.trace(once.covariance, axis1=1, axis2=2) / dim, once.noise**2)
    blocks = once.joint_covariance.reshape(len(once.labels), dim, len(once.labels), dim)
    np.testing.assert_allclose(np.einsum("titj->tij", blocks), once.covariance, atol=1e-18)


def test_exact_moments_have_no_covariance():
    found = ntuples(shape_moments(asymmetric(), 6))
    np.testing.assert_array_equal(found.covariance, np.zeros((17, 3, 3)))
    np.testing.assert_array_equal(found.joint_covariance, np.zeros((51, 51)))
    with pytest.raises(InputError, match="0 replicates; whitening 3 components takes at least 4"):
        found.whitened()


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_whitened_tuples_of_a_symmetric_body_follow_hotelling(dim):
    # All tuples of a box vanish; 32 parts, so that the threshold is near that of chi-squared.
    rng, parts = np.random.default_rng(20 + dim), 32
    statistic = []
    for _ in range(150):
        cloud = rng.uniform(-1, 1, (800, dim)) * np.linspace(1.0, 2.0, dim)
        found = ntuples(central_moments(cloud, np.ones(800), 4, parts=parts), ((3,), (2, 3)))
        length = np.einsum("ti,ti->t", found.whitened(), found.whitened())
        direct = np.einsum("ti,tij,tj->t", found.vectors, np.linalg.inv(found.covariance), found.vectors)
        np.testing.assert_allclose(length, direct, rtol=1e-6)
        statistic.append(length * (parts - dim) / (dim * (parts - 1)))
    beyond = np.mean(np.array(statistic) > f_distribution.ppf(0.95, dim, parts - dim), axis=0)
    assert (beyond < 0.13).all()
    assert (beyond > 0.005).all()


def test_what_all_replicates_share_is_no_noise():
    """The jackknife's bias moves the mean of the replicates from the whole; their spread alone is the noise."""
    rng = np.random.default_rng(10)
    vectors, spread = rng.standard_normal((4, 3)), 0.01 * rng.standard_normal((12, 4, 3))
    once, biased = (NTuples(vectors=vectors, replicates=vectors + b + spread, labels=tuple("abcd")) for b in (0.0, 0.5))
    np.testing.assert_allclose(biased.covariance, once.covariance, atol=1e-12)
    np.testing.assert_allclose(biased.noise, once.noise, atol=1e-12)
    np.testing.assert_allclose(biased.joint_covariance, once.joint_covariance, atol=1e-12)
    # The blocks along the diagonal of the joint covariance are those of the tuples.
    blocks = once.joint_covariance.reshape(4, 3, 4, 3)[range(4), :, range(4)]
    np.testing.assert_allclose(blocks, once.covariance, atol=1e-12)


@pytest.mark.parametrize("dim", [2, 3, 5])
def test_whitening_takes_more_replicates_than_components(dim):
    rng = np.random.default_rng(11)
    for parts in (0, 1, dim):
        few = NTuples(vectors=np.ones((2, dim)), replicates=rng.standard_normal((parts, 2, dim)), labels=("a", "b"))
        with pytest.raises(
            InputError, match=f"{parts} replicates; whitening {dim} components takes at least {dim + 1}"
        ):
            few.whitened()
    enough = NTuples(vectors=np.ones((2, dim)), replicates=rng.standard_normal((dim + 1, 2, dim)), labels=("a", "b"))
    assert np.isfinite(enough.whitened()).all()


def test_labels_name_each_tuple_once():
    found = ntuples(shape_moments(asymmetric(), 6), PAPER_ORDERS)
    assert len(set(found.labels)) == len(found.labels) == len(found.vectors) == 17
    assert {label.count(",") for label in found.labels} == {0, 1}


@pytest.mark.parametrize("orders", [((2, 2),), ((2,),), ((2, 2, 3),), ((),), ((-1, 2),), ((0, 3),), ((9,),), ((2, 9),)])
def test_orders_that_cannot_be_are_refused(orders):
    moments = shape_moments(asymmetric(), 8)
    with pytest.raises(InputError, match="orders") as caught:
        ntuples(moments, orders)
    assert "\n" not in str(caught.value)
