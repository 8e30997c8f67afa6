"""How moments turn: against the points themselves, in every regime, and derivatives against differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symrefine.align.moment_fit import planes, skew, turned_by
from symrefine.align.span import Monomials
from symrefine.geometry import Array, orthogonal_factor, random_orthogonal, rotation
from symrefine.moments.harmonics import Harmonics, euler_zyz, flattened, harmonic_moments, row_variance
from symrefine.moments.moments import central_moments
from tests.test_harmonics import evaluate

SEEDS = st.integers(0, 2**32 - 1)


def some_matrices(seed: int, dim: int) -> Array:
    """Both determinants, the identity and its negative, and next to a pole."""
    rng = np.random.default_rng(seed)
    matrices = [random_orthogonal(rng, dim, det) for det in (1, -1)] + [np.eye(dim), -np.eye(dim)]
    if dim == 3:
        matrices += [rotation(rng.normal(size=3), 1e-9) @ np.diag([1.0, -1.0, -1.0])]
    return np.stack(matrices)


@given(seed=SEEDS)
@settings(max_examples=20, deadline=None)
def test_harmonics_turn_as_the_points_do(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(5, 3))
    matrices = some_matrices(seed, 3)
    for l in (1, 2, 6):
        expected = np.stack([evaluate(l, points @ m.T) for m in matrices])
        scale = np.linalg.norm(points, axis=1).max() ** l
        found = Harmonics(rows=(l,)).turned(matrices, evaluate(l, points))
        np.testing.assert_allclose(found, expected, atol=1e-13 * scale)


@pytest.mark.parametrize("dim", [1, 2, 3, 4])
def test_moments_turn_as_the_points_do(dim: int) -> None:
    points = np.random.default_rng(dim).normal(size=(30, dim)) ** 3
    matrices = some_matrices(dim, dim)
    ones = np.ones(30)
    values = central_moments(points, ones, 4).values
    found = Monomials(dim=dim, order=4).turned(matrices, np.stack([values, 2.0 * values]))
    expected = np.stack([central_moments(points @ m.T, ones, 4).values for m in matrices])
    np.testing.assert_allclose(found, np.stack([expected, 2.0 * expected], axis=1), atol=1e-11)


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_tangents_are_the_derivatives_by_small_turns(dim: int) -> None:
    points, step = np.random.default_rng(dim).normal(size=(30, dim)) ** 3, 1e-6
    moments = central_moments(points, np.ones(30), 4)
    cases = [(Monomials(dim=dim, order=4), moments.values[None])]
    if dim == 3:
        values, rows = flattened(harmonic_moments(moments))
        cases.append((Harmonics(rows=rows), values))
    for action, values in cases:
        turns = step * np.eye(len(planes(dim)))
        ahead, behind = (action.turned(turned_by(np.eye(dim)[None], s * turns), values)[:, 0] for s in (1.0, -1.0))
        found = action.tangents(values)[0]
        np.testing.assert_allclose(found, (ahead - behind) / (2.0 * step), atol=1e-7 * np.abs(found).max())


def test_small_turns_are_about_x_y_and_z_in_three_dimensions() -> None:
    for k, axis in enumerate(np.eye(3)):
        turned = turned_by(np.eye(3)[None], 1e-4 * axis[None])[0]
        np.testing.assert_allclose(turned, rotation(axis, 1e-4), atol=1e-12)
        np.testing.assert_allclose(skew(axis[None], 3)[0], (rotation(axis, 1e-7) - np.eye(3)) / 1e-7, atol=1e-6), k


@pytest.mark.parametrize("dim", [1, 2, 3, 5])
def test_turns_of_any_size_leave_a_matrix_orthogonal(dim: int) -> None:
    rng = np.random.default_rng(dim)
    matrices = some_matrices(dim, dim)
    for size in (0.0, 1e-7, 1.0, 50.0):
        turned = turned_by(matrices, size * rng.normal(size=(len(matrices), len(planes(dim)))))
        np.testing.assert_allclose(
            turned @ turned.transpose(0, 2, 1), np.broadcast_to(np.eye(dim), turned.shape), atol=1e-12
        )
        np.testing.assert_allclose(np.linalg.det(turned), np.linalg.det(matrices), atol=1e-9)


def test_euler_angles_give_the_rotation_back_at_the_poles_too() -> None:
    generic = [random_orthogonal(np.random.default_rng([33, k])) for k in range(5)]
    poles = [rotation([0, 0, 1], 0.7), rotation([0, 0, 1], 0.7) @ rotation([0, 1, 0], 1e-9), np.diag([1.0, -1.0, -1.0])]
    for r in generic + poles:
        a, b, c = (float(x[0]) for x in euler_zyz(r[None]))
        again = rotation([0, 0, 1], a) @ rotation([0, 1, 0], b) @ rotation([0, 0, 1], c)
        np.testing.assert_allclose(again, r, atol=1e-15 * 10)


def test_the_variance_of_a_row_is_that_of_its_components() -> None:
    """Jackknife replicates of known spread, two rows of degree 3; exact moments have none."""
    rng = np.random.default_rng(12)
    parts, sigma = 4000, np.array([0.1, 0.01])
    # A replicate leaves out one part of many: it deviates by the root of parts - 1 less than a sample of its own.
    replicates = sigma[:, None] * rng.standard_normal((parts, 2, 7)) / np.sqrt(parts - 1)
    values, rows = flattened({3: replicates})
    assert rows == (3, 3)
    np.testing.assert_allclose(row_variance(values, rows), np.repeat(sigma**2, 7), rtol=0.05)
    np.testing.assert_array_equal(row_variance(values[:0], rows), np.zeros(14))


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_the_orthogonal_factor_is_the_nearest_orthogonal_matrix(dim: int) -> None:
    rng = np.random.default_rng(dim)
    for det in (1, -1):
        given = random_orthogonal(rng, dim, det) @ np.diag(rng.uniform(0.5, 1.5, dim))
        given += 0.1 * rng.normal(size=(dim, dim))
        for proper in (False, True):
            found = orthogonal_factor(given, proper=proper)
            np.testing.assert_allclose(found @ found.T, np.eye(dim), atol=1e-12)
            assert not proper or np.linalg.det(found) > 0
            allowed = (random_orthogonal(rng, dim, d) for _ in range(300) for d in ((1,) if proper else (1, -1)))
            assert np.linalg.norm(found - given) <= min(np.linalg.norm(m - given) for m in allowed)
