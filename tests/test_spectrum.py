"""The directional spectrum against explicit reflections and turns of the moments, its minima at the true mirrors."""

import numpy as np
import pytest

from experiments.objects.shapes import asymmetric, box, join, mug, revolve, stool, table
from symrefine.geometry import frame_with_z, householder, random_orthogonal, rotation
from symrefine.groups import point_group
from symrefine.moments.harmonics import harmonic_moments
from symrefine.moments.moments import shape_moments, transformed
from symrefine.propose.spectrum import DIRECTIONS, Spectrum, half_sphere, local_minima, mirror_candidates, whitened
from symrefine.shape import Shape

ORDER = 8
BOX, CUBE = join([box((0, 0, 0), (1, 0.7, 0.4))]), join([box((0, 0, 0), (1, 1, 1))])
# Mirror normals of each shape as it is made.
MIRRORS = {
    "box": (BOX, np.eye(3)),
    "cube": (CUBE, point_group("Oh").mirrors()),
    "table": (table(), point_group("C4v").mirrors()),
    "stool3": (stool(3), point_group("C3v").mirrors()),
    "stool5": (stool(5), point_group("C5v").mirrors()),
    "mug": (mug(), np.array([[0.0, 1, 0]])),
}


def moved(shape, matrix, shift=0.0):
    return Shape(points=shape.points @ matrix.T + shift, faces=shape.faces, measure=shape.measure)


def onto(source, target):
    """A rotation that turns one direction into another."""
    return frame_with_z(target).T @ frame_with_z(source)


def candidates(moments):
    return mirror_candidates(Spectrum.of_moments(whitened(moments)), Spectrum.of_moments(moments))


def coefficients(moments):
    return np.concatenate([c[0].ravel() for _, c in sorted(harmonic_moments(moments).items())])


def test_half_sphere_is_even():
    n = half_sphere()
    assert n.shape == (DIRECTIONS, 3)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)
    assert n[:, 2].min() > 0
    closeness = np.abs(n @ n.T)
    np.fill_diagonal(closeness, 0)
    nearest = np.degrees(np.arccos(closeness.max(axis=1)))
    # 1,500 directions on 2 pi steradians: 3.7 degrees apart.
    assert nearest.min() > 2.0
    assert nearest.max() < 4.5
    np.testing.assert_allclose(n.mean(axis=0), [0, 0, 0.5], atol=2e-3)


@pytest.mark.parametrize("direction", [0, 17, 700, DIRECTIONS - 1])
def test_mirror_miss_is_the_energy_that_the_reflection_flips(direction):
    moments = shape_moments(asymmetric(), ORDER)
    c = coefficients(moments)
    image = coefficients(transformed(moments, householder(half_sphere()[direction])))
    expected = np.sum(((c - image) / 2) ** 2) / np.sum(c**2)
    assert Spectrum.of_moments(moments).mirror_misses()[direction] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("fold", [2, 3, 5, 7])
@pytest.mark.parametrize("direction", [3, 900])
def test_axis_miss_is_the_energy_that_the_turns_do_not_keep(fold, direction):
    moments = shape_moments(asymmetric(), ORDER)
    u, c = half_sphere()[direction], coefficients(moments)
    turned = [coefficients(transformed(moments, rotation(u, 2 * np.pi * k / fold))) for k in range(fold)]
    expected = np.sum((c - np.mean(turned, axis=0)) ** 2) / np.sum(c**2)
    assert Spectrum.of_moments(moments).axis_misses(fold)[direction] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("shape", "normals"), MIRRORS.values(), ids=MIRRORS)
def test_a_true_mirror_misses_by_nothing(shape, normals):
    for i, normal in zip((5, 333, 1200), normals, strict=False):
        moments = shape_moments(moved(shape, onto(normal, half_sphere()[i]), 3.0), ORDER)
        for m in (moments, whitened(moments)):
            misses = Spectrum.of_moments(m).mirror_misses()
            # Squares of rounding errors of 1e-12 at most; the mug's handle is symmetric but for the diagonals of the
            # bent quads it is made of, 1e-8 of its moments.
            assert misses[i] < (1e-15 if shape is MIRRORS["mug"][0] else 1e-20)
            assert misses.min() >= 0.999 * misses[i] or misses.min() < 1e-20
            assert misses.min() >= 0
            assert misses.max() <= 1


@pytest.mark.parametrize("fold", range(2, 8))
def test_a_true_axis_misses_by_nothing_and_other_folds_do_not_hold(fold):
    pyramid = join([revolve([(0, 0), (1, 0), (0, 1.3)], fold)]) if fold > 2 else join([box((0, 0, 0), (1, 0.7, 0.4))])
    i = 432
    moments = shape_moments(moved(pyramid, onto([0, 0, 1], half_sphere()[i])), ORDER)
    spectrum = Spectrum.of_moments(moments)
    for order in range(2, 8):
        miss = spectrum.axis_misses(order)[i]
        assert miss < 1e-20 if fold % order == 0 else miss > 1e-6


def test_round_objects_miss_no_fold_about_their_axis():
    moments = shape_moments(moved(join([revolve([(0, 0), (1, 0), (0, 2)], 60)]), onto([0, 0, 1], half_sphere()[9])), 8)
    assert max(Spectrum.of_moments(moments).axis_misses(k)[9] for k in (2, 3, 5, 7)) < 1e-20


@pytest.mark.parametrize("det", [1, -1])
@pytest.mark.parametrize(("shape", "normals"), MIRRORS.values(), ids=MIRRORS)
def test_the_first_candidates_are_the_true_mirrors_in_any_pose(shape, normals, det):
    matrix = random_orthogonal(np.random.default_rng(1), 3, det)
    found = candidates(shape_moments(moved(shape, matrix, 2.0), ORDER))
    first = np.array(found[: len(normals)])
    angles = np.degrees(np.arccos(np.clip(np.abs(normals @ matrix.T @ first.T), 0, 1)))
    # A paraboloid through directions 3.7 degrees apart puts the minimum right to a tenth of that.
    assert angles.min(axis=1).max() < 0.5
    assert sorted(angles.argmin(axis=1)) == list(range(len(normals)))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)


def test_candidates_are_apart_and_few():
    found = np.array(candidates(shape_moments(CUBE, ORDER)))
    assert len(found) <= 16
    closeness = np.abs(found @ found.T) - np.eye(len(found))
    assert closeness.max() < np.cos(np.radians(5))


def test_local_minima_of_a_known_field():
    n = np.array([0.36, -0.48, 0.8])
    field = 1.0 - (half_sphere() @ n) ** 2
    found, _ = local_minima(field, count=4)
    # The only minimum; it is quadratic there, so that the vertex is exact up to the fourth order of 4 degrees.
    assert np.degrees(np.arccos(abs(found[0] @ n))) < 0.1
    assert len(found) == 1
    across, _ = local_minima(np.abs(half_sphere() @ n), count=2)
    assert np.abs(across @ n).max() < 0.1


def test_the_deepest_minima_are_kept():
    rough = 0.5 + 0.1 * np.random.default_rng(2).random(DIRECTIONS)
    every, some = (local_minima(rough, count=count)[1] for count in (DIRECTIONS, 7))
    assert len(every) > 50
    assert (np.diff(every) >= 0).all()
    np.testing.assert_array_equal(some, every[:7])
    assert every[0] == rough.min()


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 0, 1]])
def test_the_deepest_minima_are_kept_in_their_order(order):
    """Wells of known depths: with few asked for, those of the least miss."""
    wells = random_orthogonal(np.random.default_rng(4))[order]
    depths = (0.05, 0.02, 0.08)
    field = np.full(DIRECTIONS, 0.11)
    for n, depth in zip(wells, depths, strict=True):
        field -= depth * np.exp(-(1 - (half_sphere() @ n) ** 2) / 0.02)
    for count in (1, 2, 3):
        found, _ = local_minima(field, count=count)
        for n, d in zip(wells[[2, 0, 1]][:count], found, strict=True):
            assert np.degrees(np.arccos(min(1.0, abs(n @ d)))) < 1.0


@pytest.mark.parametrize("size", [(3, 2, 1), (6, 0.5, 0.4), (20, 1, 0.9), (1, 0.8, 0.02)])
def test_the_mirrors_of_long_and_flat_boxes_are_all_among_the_candidates(size):
    """Of a long box the raw moments see little of what lies around its length; they may blur it by a few degrees."""
    matrix = random_orthogonal(np.random.default_rng(5))
    found = candidates(shape_moments(moved(join([box((0, 0, 0), size)]), matrix), ORDER))
    for n in matrix.T:
        assert np.degrees(np.arccos(np.abs(found @ n).max())) < 6.0


# Whitening


def test_whitened_moments_are_isotropic():
    for shape in (BOX, asymmetric(), mug()):
        np.testing.assert_allclose(whitened(shape_moments(shape, 4)).covariance, np.eye(3) / 3, atol=1e-12)


@pytest.mark.parametrize("det", [1, -1])
def test_whitening_commutes_with_turning(det):
    matrix = random_orthogonal(np.random.default_rng(3), 3, det)
    moments = shape_moments(asymmetric(), ORDER)
    first, last = whitened(transformed(moments, matrix)), transformed(whitened(moments), matrix)
    np.testing.assert_allclose(first.values, last.values, atol=1e-9)


def test_whitening_a_plate_stays_finite():
    moments = shape_moments(join([box((0, 0, 0), (1, 0.7, 1e-9))]), ORDER)
    white = whitened(moments)
    assert np.isfinite(white.values).all()
    # The thin direction is stretched by no more than THIN^-1/2.
    assert white.covariance[2, 2] < 1e-9
    np.testing.assert_allclose(white.covariance[:2, :2], np.eye(2) / 3, atol=1e-9)
    assert np.isfinite(Spectrum.of_moments(white).mirror_misses()).all()
