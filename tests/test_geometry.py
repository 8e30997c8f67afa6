"""Laws of reflections, rotations, planes and the tight box: involution, composition, invariance, three regimes."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.distance import pdist

from symrefine.align.pair import least_diagonal
from symrefine.errors import InputError
from symrefine.geometry import (
    Axis,
    Isometry,
    Plane,
    cross_matrix,
    frame_with_z,
    householder,
    line_angle_rad,
    random_orthogonal,
    read_only,
    rotation,
    rotoreflection,
    rows,
    tight_diagonal,
    unit,
)

SEEDS = st.integers(0, 2**32 - 1)
DIMS = st.integers(2, 5)
# Products of a few orthogonal matrices of size <= 5: some ten roundings of entries <= 1.
EPS = 1e-14
# Uniform, 1e-7 from the singular points, exactly at them.
ANGLES = (0.3, 1.2, 2.9, -1.7, 1e-7, np.pi - 1e-7, 0.0, np.pi / 2, np.pi)
# Generic directions, 1e-7 from a coordinate axis, exactly on one.
DIRECTIONS = np.array(
    [[0.3, -0.5, 0.8], [-1, 1, 1], [1e-7, 0, 1], [0, 1, -1e-7], [0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0]]
)


def vectors(seed, *shape):
    return np.random.default_rng(seed).standard_normal(shape)


@given(SEEDS, DIMS)
def test_a_reflection_is_an_involution_of_determinant_minus_one_that_keeps_its_plane(seed, dim):
    n, x = vectors(seed, 2, dim)
    s = householder(5.0 * n)
    np.testing.assert_allclose(s @ s, np.eye(dim), atol=EPS)
    np.testing.assert_allclose(s, s.T, atol=0)
    assert np.linalg.det(s) == pytest.approx(-1.0, abs=EPS)
    np.testing.assert_allclose(s @ n, -n, atol=10 * EPS)
    within = x - (x @ n) / (n @ n) * n
    np.testing.assert_allclose(s @ within, within, atol=10 * EPS * np.linalg.norm(x))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", DIRECTIONS, ids=str)
def test_two_reflections_make_the_rotation_by_twice_their_angle(axis, angle):
    first, _, u = frame_with_z(axis)
    second = rotation(u, angle) @ first
    np.testing.assert_allclose(householder(second) @ householder(first), rotation(axis, 2 * angle), atol=EPS)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", DIRECTIONS, ids=str)
def test_rotation_is_the_exponential_of_its_generator(axis, angle):
    r = rotation(3.0 * axis, angle)
    np.testing.assert_allclose(r, expm(angle * cross_matrix(unit(axis))), atol=EPS)
    np.testing.assert_allclose(r @ axis, axis, atol=EPS)
    assert np.linalg.det(r) == pytest.approx(1.0, abs=EPS)


def test_rotation_turns_x_towards_y_about_z():
    np.testing.assert_allclose(rotation([0, 0, 1], np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=EPS)
    np.testing.assert_allclose(cross_matrix([0, 0, 1]) @ [1, 0, 0], [0, 1, 0], atol=0)


@given(SEEDS)
def test_cross_matrix_is_the_cross_product(seed):
    u, v = vectors(seed, 2, 3)
    np.testing.assert_allclose(cross_matrix(u) @ v, np.cross(u, v), atol=EPS)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
def test_rotoreflection_has_its_order_and_turns_its_axis_round(order):
    u = unit([1.0, -2.0, 0.5])
    s = rotoreflection(u, 2 * np.pi / order)
    np.testing.assert_allclose(s @ u, -u, atol=EPS)
    assert np.linalg.det(s) == pytest.approx(-1.0, abs=EPS)
    period = order if order % 2 == 0 else 2 * order
    np.testing.assert_allclose(np.linalg.matrix_power(s, period), np.eye(3), atol=10 * EPS)
    across = frame_with_z(u)[0]
    np.testing.assert_allclose(s @ across, rotation(u, 2 * np.pi / order) @ across, atol=EPS)


@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_frame_with_z_is_a_rotation_that_ends_in_the_direction(direction):
    frame = frame_with_z(2.0 * direction)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=EPS)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=EPS)
    np.testing.assert_allclose(frame[2], unit(direction), atol=EPS)


# Planes and axes


@given(SEEDS, DIMS)
def test_a_plane_halves_the_way_to_every_mirror_image(seed, dim):
    rng = np.random.default_rng(seed)
    plane = Plane(normal=rng.standard_normal(dim), offset=float(rng.uniform(-3, 3)))
    x = rng.standard_normal((7, dim))
    image = plane.reflect(x)
    np.testing.assert_allclose(plane.signed_distance((x + image) / 2), 0.0, atol=1e-14)
    np.testing.assert_allclose(plane.signed_distance(image), -plane.signed_distance(x), atol=1e-13)
    np.testing.assert_allclose(plane.reflect(image), x, atol=1e-13)
    np.testing.assert_allclose(image - x, -2 * np.outer(plane.signed_distance(x), plane.normal), atol=1e-13)


@pytest.mark.parametrize("length", [1e-150, 0.5, 2.0, 1e150])
def test_the_length_of_a_normal_does_not_matter(length):
    plane = Plane(normal=[0, 0, length], offset=2 * length)
    assert plane.offset == pytest.approx(2.0)
    np.testing.assert_allclose(plane.reflect(np.array([[0.0, 0.0, 5.0]])), [[0, 0, -1]])


@pytest.mark.parametrize("vector", [[0, 0, 0], [0, np.nan, 1], [np.inf, 0, 0]])
@pytest.mark.parametrize(
    "make",
    [
        lambda v: Plane(normal=v, offset=1.0),
        lambda v: Axis(point=[0, 0, 0], direction=v),
        householder,
        lambda v: rotation(v, 1.0),
        lambda v: rotoreflection(v, 1.0),
        frame_with_z,
    ],
    ids=["plane", "axis", "householder", "rotation", "rotoreflection", "frame"],
)
def test_a_direction_must_point_somewhere(make, vector):
    with pytest.raises(InputError, match="expected a direction"):
        make(vector)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane(normal=[0, 0, 1], offset=np.nan), "offset is nan; expected a finite number"),
        (lambda: Plane(normal=[0, 0, 1], offset=[1, 2]), r"offset is \[1.0, 2.0\]; expected a finite number"),
        (lambda: Plane(normal=[0, 0, 1], offset="far"), "offset are not numbers"),
        (lambda: Plane(normal="up", offset=1), "components of normal are not numbers"),
        (lambda: Plane(normal=np.eye(3), offset=1), r"normal has shape \[3, 3\]; expected \[n\]"),
        (lambda: Axis(point=[0, 0, np.inf], direction=[0, 0, 1]), r"point is \[0.0, 0.0, inf\]; expected 3 finite"),
        (lambda: Axis(point=[0, 0], direction=[0, 0, 1]), r"point is \[0.0, 0.0\]; expected 3 finite numbers"),
        (lambda: Axis(point=None, direction=[0, 0, 1]), "components of point are not numbers"),
    ],
)
def test_planes_and_axes_are_made_of_finite_numbers(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_the_sign_of_a_normal_does_not_matter():
    n, x = unit([1.0, 2.0, -1.0]), vectors(1, 9, 3)
    a, b = Plane(normal=n, offset=0.7), Plane(normal=-n, offset=-0.7)
    np.testing.assert_allclose(a.reflect(x), b.reflect(x), atol=1e-14)


def test_planes_and_axes_hold_private_unit_vectors():
    given_normal, given_point = np.array([0.0, 0.0, 2.0]), np.array([1.0, 2.0, 3.0])
    plane, axis = Plane(normal=given_normal, offset=1), Axis(point=given_point, direction=given_normal)
    given_normal[:], given_point[:] = 7.0, 7.0
    np.testing.assert_array_equal(plane.normal, [0, 0, 1])
    np.testing.assert_array_equal(axis.direction, [0, 0, 1])
    np.testing.assert_array_equal(axis.point, [1, 2, 3])
    for array in (plane.normal, axis.point, axis.direction):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0
    with pytest.raises(FrozenInstanceError):
        plane.offset = 2.0


def test_read_only_copies():
    source = np.arange(3.0)
    copy = read_only(source)
    source[0] = 9.0
    assert copy[0] == 0.0
    assert not copy.flags.writeable
    assert source.flags.writeable


@pytest.mark.parametrize("angle", [0.4, 1.3, 1e-7, 1e-12, np.pi / 2 - 1e-7, 0.0, np.pi / 2])
@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1)])
def test_line_angle_is_exact_for_small_angles_too(angle, signs):
    a, b = np.array([2.0, 0.0, 0.0]), 3.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    # One rounding of components <= 1: the angle keeps 1e-16 absolutely, where arccos would lose 1e-8.
    assert line_angle_rad(signs[0] * a, signs[1] * b) == pytest.approx(angle, abs=4e-16)


def test_line_angle_folds_obtuse_angles():
    assert line_angle_rad([1, 0, 0], [-1, 1, 0]) == pytest.approx(np.pi / 4)


# Isometries


@given(SEEDS, DIMS, st.sampled_from([1, -1]))
def test_isometry_about_a_centre_keeps_it_and_all_distances(seed, dim, det):
    rng = np.random.default_rng(seed)
    matrix, center, x = random_orthogonal(rng, dim, det), rng.uniform(-9, 9, dim), rng.standard_normal((5, dim))
    motion = Isometry.about(center, matrix)
    np.testing.assert_allclose(motion.apply(center[None])[0], center, atol=1e-13)
    np.testing.assert_allclose(motion.apply(center + x) - center, x @ matrix.T, atol=1e-13)
    np.testing.assert_allclose(motion.turn(x), x @ matrix.T, atol=0)


@given(SEEDS, DIMS)
def test_isometry_of_a_plane_is_its_reflection(seed, dim):
    rng = np.random.default_rng(seed)
    plane = Plane(normal=rng.standard_normal(dim), offset=float(rng.uniform(-3, 3)))
    x = rng.standard_normal((6, dim))
    motion = Isometry.reflection(plane)
    np.testing.assert_allclose(motion.apply(x), plane.reflect(x), atol=1e-13)
    np.testing.assert_allclose(motion.turn(plane.normal[None])[0], -plane.normal, atol=1e-14)


@given(SEEDS, DIMS, st.sampled_from([1, -1]))
def test_random_orthogonal_has_the_determinant_asked_for(seed, dim, det):
    q = random_orthogonal(np.random.default_rng(seed), dim, det)
    np.testing.assert_allclose(q @ q.T, np.eye(dim), atol=EPS)
    assert np.linalg.det(q) == pytest.approx(det, abs=1e-13)


@pytest.mark.parametrize("det", [1, -1])
def test_random_orthogonal_is_haar_distributed(det):
    rng = np.random.default_rng(0)
    q = np.array([random_orthogonal(rng, 3, det) for _ in range(3000)])
    # Haar: each entry has mean 0 and variance 1/3, and E tr^2 = 1; five standard deviations over 3,000 draws.
    assert np.abs(q.mean(axis=0)).max() < 5 * np.sqrt(1 / 3 / 3000)
    np.testing.assert_allclose((q**2).mean(axis=0), 1 / 3, atol=5 * 0.3 / np.sqrt(3000))
    assert np.mean(np.trace(q, axis1=1, axis2=2) ** 2) == pytest.approx(1.0, abs=5 * 1.5 / np.sqrt(3000))


# The tight box


def box_points(size, rng, count=4000):
    return rng.uniform(-0.5, 0.5, (count, 3)) * size


SIZES = [(1, 0.7, 0.4), (1, 1, 1), (1, 0.05, 0.05), (1, 1, 0.01), (1, 0.9, 0.3)]


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_tight_diagonal_is_that_of_the_box(size):
    rng = np.random.default_rng(3)
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    points = np.concatenate([corners, box_points(size, rng)])
    for det in (1, -1):
        found = tight_diagonal(points @ random_orthogonal(rng, 3, det).T)
        # No orientation does better: (sum_j |R_ij| a_j)^2 >= sum_j R_ij^2 a_j^2, and these sum to |a|^2 over i.
        assert found >= np.linalg.norm(size) * (1 - 1e-12)
        assert found == pytest.approx(np.linalg.norm(size), rel=0.02)


@pytest.mark.parametrize("size", SIZES[:3], ids=str)
def test_tight_diagonal_moves_with_the_points_and_their_unit(size):
    rng = np.random.default_rng(4)
    points = box_points(size, rng)
    once = tight_diagonal(points)
    turned = [tight_diagonal(1e3 * points @ random_orthogonal(rng, 3, d).T + 1e3) / 1e3 for d in (1, -1, 1, -1)]
    np.testing.assert_allclose(turned, once, rtol=0.02)
    assert tight_diagonal(rng.permutation(points)) == pytest.approx(once, rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_no_box_has_a_diagonal_less_than_the_least(seed, size):
    """Two far points are half of the diameter apart or more, and the diameter is no more than any box's diagonal."""
    rng = np.random.default_rng(seed)
    points = size * rng.standard_normal((40, 3)) * rng.uniform(0.0, 1.0, 3) + size * rng.uniform(-5, 5, 3)
    least, diameter = least_diagonal(points), float(pdist(points).max())
    assert 0.5 * diameter <= least <= diameter * (1.0 + 1e-12)
    assert diameter <= tight_diagonal(points) * (1.0 + 1e-9)


def test_tight_diagonal_of_a_segment_and_of_a_disc():
    rng = np.random.default_rng(5)
    segment = np.outer(np.linspace(-1, 2, 50), unit([1.0, 2.0, -2.0]))
    assert tight_diagonal(segment) == pytest.approx(3.0, rel=0.02)
    angle = 2 * np.pi * rng.random(2000)
    disc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) @ random_orthogonal(rng).T
    assert tight_diagonal(disc) == pytest.approx(2 * np.sqrt(2), rel=0.02)


def test_tight_diagonal_of_an_irregular_shape_does_not_depend_on_its_pose():
    rng = np.random.default_rng(6)
    corners = np.array([[0.5, 0.1, 0.1], [1.0, 0.25, 0.35], [0.6, 0.5, 0.3], [0.7, 0.2, 0.8]])
    points = np.concatenate([corners @ rotation([0, 0, 1], k * 2 * np.pi / 3).T for k in range(3)])
    found = [tight_diagonal(points @ random_orthogonal(rng, 3, d).T) for d in (1, -1) for _ in range(25)]
    # The search may end in a local minimum; its docstring promises three per cent.
    assert max(found) / min(found) < 1.04


@pytest.mark.parametrize("chosen", [slice(1, None, 2), np.array([[3, 0], [1, 3]]), np.arange(5) % 2 == 0])
def test_rows_are_those_that_an_index_chooses(chosen):
    values = np.random.default_rng(7).normal(size=(5, 3))
    np.testing.assert_array_equal(rows(values, chosen), values[chosen])
