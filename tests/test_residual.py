"""casadi's cost, gradient and matrix against sums over pairs and finite differences; results are their caller's own."""

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symrefine.fit.residual import (
    SIZE,
    axis_gram,
    coordinates,
    design_rows,
    frame_model,
    gram,
    theta_models,
    turn_frame,
)
from symrefine.geometry import Isometry, Plane, householder, random_orthogonal, rotation, rotoreflection, unit
from symrefine.groups import point_group

SEEDS = st.integers(0, 2**32 - 1)
Z = np.array([0.0, 0, 1])
OPERATIONS = {
    "mirror": householder(Z)[None],
    "mirrors of C4v": point_group("C4v").operations()[4:],
    "turns": np.stack([rotation(Z, 2 * np.pi / 3), rotation([1, 0, 0], np.pi)]),
    "rotoreflections": np.stack([rotoreflection(Z, np.pi / 2), rotoreflection([1, 1, 0], 1.0), -np.eye(3)]),
    "all of D3d": point_group("D3d").operations()[1:],
}


def residual_function():
    """casadi function (x_u, x_l, n_l, m, d) -> e for the plane m.x = d: the definition all else is tested against."""
    x_u, x_l, n_l, m = (ca.SX.sym(name, 3) for name in ("x_u", "x_l", "n_l", "m"))
    d = ca.SX.sym("d")
    mirrored = x_u - 2 * (ca.dot(m, x_u) - d) * m
    return ca.Function("residual", [x_u, x_l, n_l, m, d], [ca.dot(mirrored - x_l, n_l)])


def pairs(rng, count=25):
    x, y = rng.standard_normal((2, count, 3))
    return x, y, unit(rng.standard_normal((count, 3))), rng.random(count)


def placed(seed):
    rng = np.random.default_rng(seed)
    return random_orthogonal(rng), rng.uniform(-2, 2, 3), rng


def motions(standard, frame, center, x):
    """The operations after the motion x of their frame, from the definition."""
    angle = np.linalg.norm(x[:3])
    # turn_frame's chart: a rotation by 2 arctan(|w| / 2) about w, in the frame's own coordinates.
    moved = (rotation(x[:3], 2 * np.arctan(angle / 2)) if angle else np.eye(3)) @ frame
    return [Isometry.about(center + frame.T @ x[3:], moved.T @ s @ moved) for s in standard]


def errors(several, standard, frame, center, x):
    """Weighted residuals of all pairs under all operations."""
    found = []
    for (p, q, n, w), motion in zip(several, motions(standard, frame, center, x), strict=True):
        found.append(np.sqrt(w) * np.einsum("ij,ij->i", motion.apply(p) - q, n))
    return np.concatenate(found)


def jacobian(function, x, h=1e-5):
    steps = h * np.eye(len(x))
    return np.stack([(function(x + s) - function(x - s)) / (2 * h) for s in steps], axis=1)


# The residual and its Gram matrix


@given(SEEDS)
def test_design_rows_give_the_residual_of_the_definition(seed):
    rng = np.random.default_rng(seed)
    x, y, n, _ = pairs(rng, 6)
    plane = Plane(normal=rng.standard_normal(3), offset=float(rng.uniform(-2, 2)))
    by_rows = design_rows(x, y, n) @ coordinates(Isometry.reflection(plane))
    symbolic = residual_function()
    by_casadi = [float(symbolic(a, b, c, plane.normal, plane.offset)) for a, b, c in zip(x, y, n, strict=True)]
    by_points = np.einsum("ij,ij->i", plane.reflect(x) - y, n)
    np.testing.assert_allclose(by_rows, by_points, atol=1e-13)
    np.testing.assert_allclose(by_casadi, by_points, atol=1e-13)


@given(SEEDS, st.sampled_from([1, -1]))
def test_gram_matrix_holds_the_weighted_cost_of_any_isometry(seed, det):
    rng = np.random.default_rng(seed)
    x, y, n, w = pairs(rng)
    motion = Isometry(matrix=random_orthogonal(rng, 3, det), shift=rng.standard_normal(3))
    phi = coordinates(motion)
    expected = w @ np.einsum("ij,ij->i", motion.apply(x) - y, n) ** 2
    assert phi @ gram(design_rows(x, y, n), w) @ phi == pytest.approx(expected, rel=1e-11)


# The frame

REGIMES = {
    "at zero": np.zeros(6),
    "next to zero": 1e-7 * np.array([1, -2, 0.5, 1, 1, -1]),
    "small": np.array([0.02, 0.01, -0.03, 0.01, 0.0, 0.05]),
    "large": np.array([1.5, -0.7, 2.0, 3.0, -1.0, 0.4]),
}


@pytest.mark.parametrize("x", REGIMES.values(), ids=REGIMES)
@pytest.mark.parametrize("standard", OPERATIONS.values(), ids=OPERATIONS)
def test_frame_model_is_the_sum_over_pairs(standard, x):
    frame, center, rng = placed(1)
    several = [pairs(rng) for _ in standard]
    grams = np.stack([gram(design_rows(p, q, n), w) for p, q, n, w in several])

    def residuals(at):
        return errors(several, standard, frame, center, at)

    found = frame_model(grams, standard, frame, center, x)
    J = jacobian(residuals, x)
    assert found.cost == pytest.approx(np.sum(residuals(x) ** 2), rel=1e-11)
    # Central differences at h = 1e-5 on residuals of size 10: 1e-9 truncation, 1e-10 rounding, summed over 25 k pairs.
    scale = np.abs(J.T @ J).max()
    np.testing.assert_allclose(found.gradient, J.T @ residuals(x), atol=1e-7 * scale)
    np.testing.assert_allclose(found.hessian, J.T @ J, atol=1e-7 * scale)


@pytest.mark.parametrize("w", [(0, 0, 0), (1e-7, 0, -1e-7), (0.1, -0.2, 0.05), (3.0, -1, 7)], ids=str)
def test_turn_frame_is_a_rotation_in_the_frames_own_coordinates(w):
    frame, _, _ = placed(2)
    w = np.array(w, dtype=float)
    angle = np.linalg.norm(w)
    expected = (rotation(w, 2 * np.arctan(angle / 2)) if angle else np.eye(3)) @ frame
    np.testing.assert_allclose(turn_frame(frame, w), expected, atol=1e-14)


def test_results_belong_to_their_caller():
    """The buffers casadi writes to are used again by the next call (seen: every result was the last one)."""
    frame, center, rng = placed(3)
    standard = OPERATIONS["mirrors of C4v"]
    grams = np.stack([gram(design_rows(*(q := pairs(rng))[:3]), q[3]) for _ in standard])
    first = frame_model(grams, standard, frame, center, np.zeros(6))
    kept = (first.cost, first.gradient.copy(), first.hessian.copy())
    second = frame_model(2 * grams, standard, frame, center, np.full(6, 0.3))
    assert first.cost == kept[0] != second.cost
    np.testing.assert_array_equal(first.gradient, kept[1])
    np.testing.assert_array_equal(first.hessian, kept[2])
    assert not np.shares_memory(first.hessian, second.hessian)

    small = [np.diag([1.0, 2, 3]), np.diag([5.0, 1, 1])]
    thetas = theta_models(np.array(small), np.full((2, 1), 0.3))
    assert thetas.hessians[0, 0, 0] != thetas.hessians[1, 0, 0]


def test_arguments_are_not_changed():
    frame, center, rng = placed(4)
    x, standard = np.full(6, 0.1), OPERATIONS["mirror"]
    q = pairs(rng)
    grams = gram(design_rows(*q[:3]), q[3])[None]
    copies = [a.copy() for a in (grams, standard, frame, center, x)]
    frame_model(grams, standard, frame, center, x)
    for before, after in zip(copies, (grams, standard, frame, center, x), strict=True):
        np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("order", ["C", "F", "strided"])
def test_memory_layout_of_the_arguments_does_not_matter(order):
    frame, center, rng = placed(5)
    standard = OPERATIONS["rotoreflections"]
    q = pairs(rng)
    grams = np.repeat(gram(design_rows(*q[:3]), q[3])[None], 3, axis=0)

    def laid_out(a):
        return np.repeat(a, 2, axis=-1)[..., ::2] if order == "strided" else np.array(a, order=order)

    plain = frame_model(grams, standard, frame, center, np.full(6, 0.2))
    other = frame_model(*map(laid_out, (grams, standard, frame, center, np.full(6, 0.2))))
    np.testing.assert_array_equal(plain.gradient, other.gradient)
    np.testing.assert_array_equal(plain.hessian, other.hessian)


def test_threads_do_not_disturb_one_another():
    frame, center, rng = placed(6)
    standard = OPERATIONS["turns"]
    work = []
    for _ in range(40):
        q = pairs(rng)
        g = gram(design_rows(*q[:3]), q[3])
        work.append((np.stack([g, g]), rng.uniform(-1, 1, 6)))

    def run(_):
        return [frame_model(g, standard, frame, center, x) for _ in range(10) for g, x in work]

    alone = run(0)
    with ThreadPoolExecutor(4) as pool:
        for result in pool.map(run, range(4)):
            for mine, theirs in zip(alone, result, strict=True):
                assert mine.cost == theirs.cost
                np.testing.assert_array_equal(mine.gradient, theirs.gradient)
                np.testing.assert_array_equal(mine.hessian, theirs.hessian)


# What can be observed

OBSERVABLE = {
    "one mirror": (householder(Z)[None], 3),
    "two mirrors": (point_group("C2v").operations()[2:], 5),
    "mirrors of C4v": (point_group("C4v").operations()[4:], 5),
    "mirrors of D2h": (np.stack([householder(n) for n in np.eye(3)]), 6),
    "mirrors of the cube": (np.stack([householder(n) for n in point_group("Oh").mirrors()]), 6),
    "one turn": (rotation(Z, 2 * np.pi / 3)[None], 4),
    "rotoreflection": (rotoreflection(Z, np.pi / 2)[None], 5),
    "inversion": (-np.eye(3)[None], 3),
    "turns of D3": (point_group("D3").operations()[1:], 6),
}


@pytest.mark.parametrize(("standard", "count"), OBSERVABLE.values(), ids=OBSERVABLE)
def test_the_motions_that_a_fit_can_see_are_those_that_change_an_operation(standard, count):
    frame, center, _ = placed(7)

    def numbers(x):
        return np.concatenate([coordinates(m) for m in motions(standard, frame, 10 * center, x)])

    J = jacobian(numbers, np.zeros(6))
    all_alike = np.stack([np.eye(SIZE)] * len(standard))
    found = frame_model(all_alike, standard, frame, 10 * center, np.zeros(6)).hessian
    np.testing.assert_allclose(found, J.T @ J, atol=1e-6 * np.abs(found).max())
    values = np.linalg.eigvalsh(found)
    assert (values > 0.01).sum() == count
    np.testing.assert_allclose(values[: 6 - count], 0.0, atol=1e-12 * values[-1])


# Planes through an axis


def axis_planes(frame, point, theta):
    normal = -np.sin(theta) * frame[0] + np.cos(theta) * frame[1]
    return Plane(normal=normal, offset=float(normal @ point))


@pytest.mark.parametrize("theta", [0.0, 1e-7, 0.4, -2.0, np.pi / 2, 3.0])
def test_the_theta_model_is_the_cost_of_the_plane_at_that_angle(theta):
    frame, point, rng = placed(8)
    x, y, n, w = pairs(rng)
    big = gram(design_rows(x, y, n), w)
    small = axis_gram(big, frame, point)
    np.testing.assert_allclose(small, small.T, atol=1e-10)

    def residuals(t):
        plane = axis_planes(frame, point, t[0])
        return np.sqrt(w) * np.einsum("ij,ij->i", plane.reflect(x) - y, n)

    at = np.array([theta])
    beside = theta_models(np.stack([np.eye(3), small]), np.array([[0.7], at]))  # planes side by side do not mix
    found, J = [v[1] for v in (beside.costs, beside.gradients, beside.hessians)], jacobian(residuals, at)
    phi = coordinates(Isometry.reflection(axis_planes(frame, point, theta)))
    assert found[0] == pytest.approx(phi @ big @ phi, rel=1e-10)
    assert found[0] == pytest.approx(np.sum(residuals(at) ** 2), rel=1e-10)
    np.testing.assert_allclose(found[1], J.T @ residuals(at), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found[2], J.T @ J, rtol=1e-6, atol=1e-6)


def test_the_axis_gram_does_not_depend_on_the_point_along_the_axis():
    frame, point, rng = placed(9)
    x, y, n, w = pairs(rng)
    big = gram(design_rows(x, y, n), w)
    np.testing.assert_allclose(axis_gram(big, frame, point), axis_gram(big, frame, point + 3 * frame[2]), atol=1e-9)
