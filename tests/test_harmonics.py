"""Solid harmonics: addition theorem, Laplace, orthogonality, and D_l(Q) f(x) = f(Q x) in three regimes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.special import lpmv

from symrefine.geometry import random_orthogonal, rotation, unit
from symrefine.moments.harmonics import (
    directional_moments,
    generators,
    harmonic_moments,
    solid_harmonic,
    to_polar_axis,
    turn,
)
from symrefine.moments.moments import central_moments, transformed

SEEDS = st.integers(0, 2**32 - 1)
DEGREES = range(9)
ANGLES = (0.7, -2.5, 1e-7, 0.0, np.pi / 2, np.pi)
# Polynomials of degree l with coefficients up to (2l)!/(2^l l!^2): some l^2 roundings.
EPS = 1e-12


def points_of(seed, count=40):
    return np.random.default_rng(seed).standard_normal((count, 3))


def evaluate(l, points):
    """R_lm at points [N, 3], shape [N, 2l+1], from the polynomials."""
    harmonics = [solid_harmonic(l, m).items() for m in range(-l, l + 1)]
    return np.stack([sum(v * np.prod(points ** np.array(e), axis=1) for e, v in terms) for terms in harmonics], axis=1)


def legendre(l, m, points):
    """R_lm from associated Legendre functions: an oracle that shares no code."""
    r = np.linalg.norm(points, axis=1)
    phi, k = np.arctan2(points[:, 1], points[:, 0]), abs(m)
    factor = np.sqrt((2 if k else 1) / np.prod([float(j) for j in range(l - k + 1, l + k + 1)]))
    # scipy's lpmv carries the Condon-Shortley sign (-1)^m, which R_lm does not have.
    return (-1) ** k * factor * r**l * lpmv(k, l, points[:, 2] / r) * (np.cos(k * phi) if m >= 0 else np.sin(k * phi))


@pytest.mark.parametrize("l", DEGREES)
def test_harmonics_are_those_of_the_textbook(l):
    x = points_of(l)
    expected = np.stack([legendre(l, m, x) for m in range(-l, l + 1)], axis=1)
    scale = np.linalg.norm(x, axis=1, keepdims=True) ** l
    np.testing.assert_allclose(evaluate(l, x) / scale, expected / scale, atol=EPS)


@pytest.mark.parametrize("l", DEGREES)
def test_squares_sum_to_the_power_of_the_radius(l):
    x = points_of(l + 20)
    np.testing.assert_allclose((evaluate(l, x) ** 2).sum(axis=1), np.sum(x * x, axis=1) ** l, rtol=EPS)


def test_the_first_degree_is_y_z_x():
    x = points_of(3)
    np.testing.assert_allclose(evaluate(1, x), x[:, [1, 2, 0]], atol=1e-15)


@pytest.mark.parametrize("l", DEGREES)
def test_harmonics_satisfy_laplace(l):
    for m in range(-l, l + 1):
        laplacian = {}
        for e, value in solid_harmonic(l, m).items():
            assert sum(e) == l
            for axis in range(3):
                if e[axis] > 1:
                    lower = tuple(p - 2 * (k == axis) for k, p in enumerate(e))
                    laplacian[lower] = laplacian.get(lower, 0.0) + value * e[axis] * (e[axis] - 1)
        assert all(abs(v) < 1e-10 for v in laplacian.values())


def test_harmonics_are_orthogonal_on_the_sphere():
    z, weights = np.polynomial.legendre.leggauss(9)
    phi = 2 * np.pi * np.arange(17) / 17
    rho = np.sqrt(1 - z * z)
    nodes = np.stack([np.outer(rho, np.cos(phi)), np.outer(rho, np.sin(phi)), np.outer(z, 0 * phi + 1)], axis=-1)
    values = np.concatenate([evaluate(l, nodes.reshape(-1, 3)) for l in DEGREES], axis=1)
    mean = values.T @ (np.repeat(weights, 17)[:, None] * values) / 34
    # The rule is exact to degree 16 = 8 + 8, over z and over phi.
    expected = np.concatenate([np.full(2 * l + 1, 1 / (2 * l + 1)) for l in DEGREES])
    np.testing.assert_allclose(mean, np.diag(expected), atol=EPS)


def test_directional_moments_weigh_harmonics_by_radial_powers():
    """Up to twice the degree of the polynomials, by the oracle; a point at the centre has no direction."""
    x, weights = np.vstack([points_of(5), np.zeros(3)]), np.random.default_rng(6).uniform(0.5, 2.0, 41)
    found = directional_moments(x, weights, 16)
    assert list(found) == list(range(1, 17))
    radii = np.linalg.norm(x[:-1], axis=1)
    for l, c in found.items():
        on_sphere = np.stack([legendre(l, m, x[:-1] / radii[:, None]) for m in range(-l, l + 1)], axis=1)
        np.testing.assert_allclose(c, (weights[:-1] * radii ** np.arange(3)[:, None]) @ on_sphere, atol=1e-10)


# How they turn


@pytest.mark.parametrize("l", range(1, 9))
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_turn_represents_the_rotation_about_a_coordinate_axis(l, axis):
    x = unit(points_of(l))
    for angle in ANGLES:
        moved = x @ rotation(np.eye(3)[axis], angle).T
        np.testing.assert_allclose(evaluate(l, moved), evaluate(l, x) @ turn(l, axis, np.array(angle)).T, atol=EPS)


@given(SEEDS, st.integers(1, 8))
def test_exponential_of_the_generators_is_a_representation(seed, l):
    rng = np.random.default_rng(seed)
    w, v = rng.uniform(-3, 3, (2, 3))
    x = unit(rng.standard_normal((10, 3)))
    a, b = (rotation(u, np.linalg.norm(u)) for u in (w, v))
    da, db = (expm(np.tensordot(u, generators(l), axes=1)) for u in (w, v))
    np.testing.assert_allclose(evaluate(l, x @ a.T), evaluate(l, x) @ da.T, atol=10 * EPS)
    np.testing.assert_allclose(evaluate(l, x @ (a @ b).T), evaluate(l, x) @ (da @ db).T, atol=10 * EPS)
    np.testing.assert_allclose(da @ da.T, np.eye(2 * l + 1), atol=10 * EPS)


@pytest.mark.parametrize("l", range(1, 9))
def test_generators_against_finite_differences_and_so3(l):
    J = generators(l)
    np.testing.assert_allclose(J, -J.transpose(0, 2, 1), atol=EPS)
    h, x = 1e-5, unit(points_of(l + 1))
    for axis in range(3):
        ahead, behind = (evaluate(l, x @ rotation(np.eye(3)[axis], s * h).T) for s in (1, -1))
        # Central differences: l^3 h^2 / 6 truncation and 1e-16 / h rounding.
        np.testing.assert_allclose((ahead - behind) / (2 * h), evaluate(l, x) @ J[axis].T, atol=2e-8)
        j, k = (axis + 1) % 3, (axis + 2) % 3
        np.testing.assert_allclose(J[axis] @ J[j] - J[j] @ J[axis], J[k], atol=1e-11)
    np.testing.assert_allclose(sum(j @ j for j in J), -l * (l + 1) * np.eye(2 * l + 1), atol=1e-10)


DIRECTIONS = np.array(
    [[0.6, 0.0, 0.8], [-0.3, 0.5, -0.7], [1e-7, -1e-7, 1], [1e-7, 0, -1], [0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0]]
)


@pytest.mark.parametrize("l", range(1, 9))
def test_to_polar_axis_turns_a_direction_into_the_pole(l):
    n = unit(DIRECTIONS)
    D = to_polar_axis(l, n)
    turned = np.einsum("nij,nj->ni", D, evaluate(l, n))
    pole = np.zeros(2 * l + 1)
    pole[l] = 1.0  # R_l0 = 1 at the pole, every other harmonic vanishes there
    np.testing.assert_allclose(turned, np.broadcast_to(pole, turned.shape), atol=EPS)
    np.testing.assert_allclose(D @ D.transpose(0, 2, 1), np.broadcast_to(np.eye(2 * l + 1), D.shape), atol=EPS)


# Moments


def noisy_moments(seed=1, count=300):
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * [1, 0.7, 0.4] + 0.1 * rng.standard_normal((count, 1)) ** 2
    weights = rng.random(count)
    return points, weights, central_moments(points, weights, 8, parts=4)


def test_harmonic_moments_are_the_sums_over_points():
    points, weights, moments = noisy_moments()
    x = (points - moments.center) / moments.scale
    w, r = weights / weights.sum(), np.linalg.norm(x, axis=1)
    found = harmonic_moments(moments)
    assert sorted(found) == list(range(1, 9))

    def radial(p):
        low, high = p - p % 2, min(p + p % 2, 8)
        return np.sqrt((w @ r**low) * (w @ r**high))

    for l, c in found.items():
        assert c.shape == (5, (8 - l) // 2 + 1, 2 * l + 1)
        for row, p in enumerate(range(l, 9, 2)):
            expected = (w * r ** (p - l)) @ evaluate(l, x) / radial(p)
            np.testing.assert_allclose(c[0, row], expected, atol=1e-11)


def test_harmonic_moments_of_replicates_are_linear_in_them():
    _, _, moments = noisy_moments()
    once = harmonic_moments(moments)
    swapped = type(moments)(
        dim=3,
        order=8,
        values=moments.values,
        replicates=moments.replicates[::-1],
        center=moments.center,
        scale=moments.scale,
    )
    for l, c in harmonic_moments(swapped).items():
        np.testing.assert_allclose(c[1:], once[l][:0:-1], atol=1e-14)
    doubled = type(moments)(
        dim=3, order=8, values=moments.values, replicates=2 * moments.replicates, center=moments.center, scale=1.0
    )
    for l, c in harmonic_moments(doubled).items():
        np.testing.assert_allclose(c[1:], 2 * once[l][1:], atol=1e-13)


@given(SEEDS)
def test_harmonic_moments_turn_by_the_representation(seed):
    rng = np.random.default_rng(seed)
    _, _, moments = noisy_moments()
    axis, angle = int(rng.integers(3)), float(rng.uniform(-3, 3))
    once = harmonic_moments(moments)
    moved = harmonic_moments(transformed(moments, rotation(np.eye(3)[axis], angle)))
    for l, c in moved.items():
        np.testing.assert_allclose(c[0], once[l][0] @ turn(l, axis, np.array(angle)).T, atol=1e-10)


@pytest.mark.parametrize("det", [1, -1])
def test_energy_of_each_degree_and_order_is_invariant(det):
    _, _, moments = noisy_moments()
    once = harmonic_moments(moments)
    moved = harmonic_moments(transformed(moments, random_orthogonal(np.random.default_rng(2), 3, det)))
    for l, c in moved.items():
        np.testing.assert_allclose((c[0] ** 2).sum(axis=1), (once[l][0] ** 2).sum(axis=1), rtol=1e-9, atol=1e-14)


def test_inversion_flips_odd_degrees_only():
    _, _, moments = noisy_moments()
    once, moved = harmonic_moments(moments), harmonic_moments(transformed(moments, -np.eye(3)))
    for l, c in moved.items():
        np.testing.assert_allclose(c[0], (-1) ** l * once[l][0], atol=1e-13)
