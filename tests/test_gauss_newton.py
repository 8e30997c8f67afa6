"""The solver against scipy's and against linear algebra: steps, convergence flags, singular and zero matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares, rosen

from symrefine.fit.gauss_newton import Linearisation, Linearisations, minimise, minimise_all

SEEDS = st.integers(0, 2**32 - 1)


def problem(residual, jacobian):
    def linearise(x):
        r, J = np.asarray(residual(x)), np.asarray(jacobian(x))
        return Linearisation(cost=float(r @ r), gradient=J.T @ r, hessian=J.T @ J)

    return linearise


def linear(A, b):
    return problem(lambda x: A @ x - b, lambda _: A)


def rosenbrock(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def rosenbrock_jacobian(x):
    return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


def exponential(x):
    t = np.linspace(0, 2, 30)
    return x[0] * np.exp(-x[1] * t) - (2.5 * np.exp(-1.3 * t) + 0.05 * np.sin(9 * t))


def exponential_jacobian(x):
    t = np.linspace(0, 2, 30)
    return np.stack([np.exp(-x[1] * t), -x[0] * t * np.exp(-x[1] * t)], axis=1)


@given(SEEDS, st.integers(1, 6))
def test_a_linear_problem_takes_one_step(seed, size):
    rng = np.random.default_rng(seed)
    A, b, start = rng.standard_normal((size + 4, size)), rng.standard_normal(size + 4), rng.uniform(-5, 5, size)
    found = minimise(linear(A, b), start)
    exact = np.linalg.lstsq(A, b, rcond=None)[0]
    # A step is damped by 1e-12 of the largest curvature at least; the second step removes what that left.
    np.testing.assert_allclose(found.x, exact, atol=1e-6)
    assert found.converged
    assert found.steps <= 2
    assert found.cost == pytest.approx(np.sum((A @ exact - b) ** 2), rel=1e-9, abs=1e-12)
    np.testing.assert_allclose(found.hessian, A.T @ A, atol=1e-12)
    assert minimise(linear(A, b), start, max_steps=1).steps == 1


@pytest.mark.parametrize(
    ("residual", "jacobian", "start"),
    [
        (rosenbrock, rosenbrock_jacobian, (-1.2, 1.0)),
        (rosenbrock, rosenbrock_jacobian, (4.0, -3.0)),
        (exponential, exponential_jacobian, (1.0, 0.1)),
        (exponential, exponential_jacobian, (5.0, 3.0)),
    ],
    ids=["rosenbrock", "rosenbrock far", "exponential", "exponential far"],
)
def test_nonlinear_problems_end_where_scipy_ends(residual, jacobian, start):
    found = minimise(problem(residual, jacobian), np.array(start), max_steps=200, tolerance=1e-10)
    oracle = least_squares(residual, start, jac=jacobian, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert found.converged
    np.testing.assert_allclose(found.x, oracle.x, atol=1e-6)
    assert found.cost == pytest.approx(2 * oracle.cost, abs=1e-12)


def test_the_cost_never_rises_and_steps_are_counted():
    costs = []
    for limit in range(12):
        found = minimise(problem(rosenbrock, rosenbrock_jacobian), np.array([-1.2, 1.0]), max_steps=limit)
        costs.append(found.cost)
        assert found.steps <= limit
        assert found.cost == pytest.approx(rosen(found.x), rel=1e-12, abs=1e-30)
    assert costs[0] == pytest.approx(24.2)
    assert np.all(np.diff(costs) <= 0)


def test_a_step_that_climbs_is_damped_until_it_descends():
    # r = arctan x: the full step from |x| > 1.39 overshoots further every time.
    found = minimise(problem(np.arctan, lambda x: np.diag(1 / (1 + x * x))), np.array([3.0]), max_steps=60)
    assert found.converged
    assert abs(found.x[0]) < 1e-6
    undamped = minimise(problem(np.arctan, lambda x: np.diag(1 / (1 + x * x))), np.array([3.0]), max_steps=1)
    assert undamped.steps == 0
    np.testing.assert_array_equal(undamped.x, [3.0])
    assert not undamped.converged


@pytest.mark.parametrize("size", [1, 3])
def test_a_residual_that_nothing_changes_is_converged_where_it_starts(size):
    start = np.arange(1.0, size + 1)
    found = minimise(problem(lambda _: np.array([2.0]), lambda _: np.zeros((1, size))), start)
    np.testing.assert_array_equal(found.x, start)
    assert (found.converged, found.steps, found.cost) == (True, 0, 4.0)


def test_directions_that_nothing_observes_stay_where_they_are():
    A = np.array([[1.0, 1, 0], [2, 2, 0], [0, 0, 0]])
    found = minimise(linear(A, np.array([2.0, 4, 0])), np.array([1.0, 0, 7]))
    assert found.converged
    assert found.cost < 1e-12
    assert found.x[2] == 7.0
    np.testing.assert_allclose(found.x[:2], [1.5, 0.5], atol=1e-4)  # the shortest step


def test_too_few_steps_are_reported():
    found = minimise(problem(rosenbrock, rosenbrock_jacobian), np.array([-1.2, 1.0]), max_steps=2)
    assert not found.converged
    none = minimise(problem(rosenbrock, rosenbrock_jacobian), np.array([-1.2, 1.0]), max_steps=0)
    assert (none.steps, none.converged) == (0, False)


def test_the_start_is_not_touched_and_the_solution_is_read_only():
    start = np.array([-1.2, 1.0])
    found = minimise(problem(rosenbrock, rosenbrock_jacobian), start, max_steps=50)
    np.testing.assert_array_equal(start, [-1.2, 1.0])
    for array in (found.x, found.hessian):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


# Many at once


def many(residual, jacobian):
    def linearise(x, _):
        r, J = (np.array([f(row) for row in x]) for f in (residual, jacobian))
        return Linearisations(
            costs=(r**2).sum(axis=1), gradients=np.einsum("kri,kr->ki", J, r), hessians=J.transpose(0, 2, 1) @ J
        )

    return linearise


@pytest.mark.parametrize(
    ("residual", "jacobian"), [(rosenbrock, rosenbrock_jacobian), (exponential, exponential_jacobian)]
)
def test_each_start_ends_where_it_would_alone(residual, jacobian):
    starts = np.array([[-1.2, 1.0], [1.0, 0.1], [0.5, 0.5], [2.0, 1.5]])
    found = minimise_all(many(residual, jacobian), starts, max_steps=40, longest=0.5)
    for k, start in enumerate(starts):
        alone = minimise(problem(residual, jacobian), start, max_steps=40, longest=0.5)
        np.testing.assert_allclose(found.x[k], alone.x, rtol=1e-12)
        assert found.costs[k] == pytest.approx(alone.cost, rel=1e-12)
        assert (found.steps[k], found.converged[k]) == (alone.steps, alone.converged)


def test_a_start_ends_where_its_step_gains_less_than_is_asked_for():
    """The exponential does not fit, so that its cost has a floor: steps of less than a hundredth of it are left out."""
    starts, linearise = np.array([[1.0, 0.1], [0.5, 0.5], [2.0, 1.5]]), many(exponential, exponential_jacobian)
    best, found = (minimise_all(linearise, starts, max_steps=40, least=least) for least in (0.0, 0.01))
    assert found.converged.all()
    assert (found.steps < best.steps).all()
    np.testing.assert_allclose(found.costs, best.costs, rtol=0.02)


def test_no_step_is_longer_than_allowed():
    A, b = np.eye(2), np.array([3.0, 4.0])
    for count in range(1, 5):
        found = minimise(linear(A, b), np.zeros(2), max_steps=count, longest=1.0)
        np.testing.assert_allclose(found.x, count * b / 5.0, rtol=1e-9)
        assert not found.converged


def test_points_that_move_on_a_circle_stay_on_it():
    target = np.array([np.cos(2.0), np.sin(2.0)])

    def turned(x, step):
        c, s = np.cos(step[0]), np.sin(step[0])
        return np.array([[c, -s], [s, c]]) @ x

    def linearise(x):
        r, J = x - target, np.array([[-x[1]], [x[0]]])
        return Linearisation(cost=float(r @ r), gradient=J.T @ r, hessian=J.T @ J)

    found = minimise(linearise, np.array([1.0, 0.0]), move=turned, max_steps=20)
    assert found.converged
    np.testing.assert_allclose(found.x, target, atol=1e-9)
