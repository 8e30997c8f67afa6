"""Alignment: exact on the same points, close on other samples, honest about what cannot be known."""

import itertools
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from experiments.objects import damage
from experiments.objects.built_symmetry import specimen
from experiments.objects.household import camera, prism
from experiments.objects.shapes import asymmetric, bottle, box, join, mug, revolve, sample, table
from experiments.studies import partial_alignment
from symrefine.align import pair as sides_of
from symrefine.align import story
from symrefine.align.alignment import Verdict
from symrefine.align.contact import met_by
from symrefine.align.judge import Judge, Met
from symrefine.align.landscape import grid_rotations, harmonic_pair, hills, landscape, least_misfit
from symrefine.align.moment_fit import as_good, best_fits, covariance, exact, fit, misfit
from symrefine.align.pair import Evidence
from symrefine.align.partial import _first, _weighed
from symrefine.align.polish import Polished, Similarity, polish
from symrefine.align.procrustes import procrustes
from symrefine.align.rivals import Choice, choose, polished
from symrefine.align.shown import Shown
from symrefine.align.sides import side_of
from symrefine.align.span import monomial_pair, span_fit
from symrefine.align.story import Alignment, _percent, align
from symrefine.clock import Clock
from symrefine.decide.maps import Merit, said_by_both, score
from symrefine.decide.maps import as_good as as_well
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.fit.refine import SHORT
from symrefine.geometry import Array, householder, line_angle_rad, random_orthogonal, rotation, unit
from symrefine.groups import point_group
from symrefine.groups.orthogonal import chord_angles
from symrefine.moments.moments import PARTS, central_moments
from symrefine.ntuples.contract import ntuples
from symrefine.propose.maps import consensus, pair_invariants
from symrefine.propose.signatures import signatures
from symrefine.shape import Shape
from symrefine.surface.skin import Planes, make_skin
from symrefine.surface.tree import Tree

DETERMINANTS = (1, -1)
SEEDS = st.integers(0, 2**32 - 1)


def rng_of(*seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def skewed(count: int, dim: int, seed: int) -> Array:
    """Points with nothing symmetric about them: each coordinate has its own width and skewness, and they mix."""
    rng = rng_of(seed, dim)
    points = rng.random((count, dim)) ** np.linspace(1.5, 4.0, dim) * np.linspace(1.0, 2.0, dim)
    return points @ (np.eye(dim) + 0.4 * np.triu(np.ones((dim, dim)), 1))


def angle_deg(found: Array, truth: Array) -> float:
    """Angle between orthogonal matrices, 180 where the determinants differ."""
    return float(np.degrees(chord_angles(found, truth)))


def turned(shape: Shape, matrix: Array, shift: Array, scale: float = 1.0) -> Shape:
    return Shape(points=scale * shape.points @ matrix.T + shift, faces=shape.faces, measure=shape.measure)


def explains(result: Alignment, source: Array, target: Array, tolerance: float) -> None:
    assert np.abs(result.apply(source) - target).max() <= tolerance


# --- the same points --------------------------------------------------------------------------------------------------


@settings(max_examples=12, deadline=None)
@given(seed=SEEDS, det=st.sampled_from(DETERMINANTS), size=st.floats(1e-6, 1e6))
def test_same_points_are_recovered_to_rounding(seed: int, det: int, size: float) -> None:
    points = size * skewed(400, 3, 1)
    matrix, shift = random_orthogonal(rng_of(seed), det=det), size * rng_of(seed, 1).uniform(-5, 5, 3)
    found = align(points, points @ matrix.T + shift)
    assert found.exact
    assert found.determinant == det
    assert found.scale == 1.0
    # Moments of order 8 add up some 400 products of 8 factors: a few hundred roundings.
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-13)
    explains(found, points, points @ matrix.T + shift, 1e-12 * size)
    assert found.rms < 1e-12
    assert found.status == "ok"


@pytest.mark.parametrize("det", DETERMINANTS)
@pytest.mark.parametrize("factor", [1e-3, 1.0, 25.4])
def test_scale_is_recovered_when_asked_for(det: int, factor: float) -> None:
    points, matrix = skewed(300, 3, 2), random_orthogonal(rng_of(3), det=det)
    target = factor * points @ matrix.T + 7.0
    found = align(points, target, scale=True)
    assert found.scale == pytest.approx(factor, rel=1e-12)
    explains(found, points, target, 1e-11 * (1.0 + factor))
    np.testing.assert_allclose(found.transform[:3, :3], factor * matrix, atol=1e-12 * factor)


@pytest.mark.parametrize("polish", [True, False])
@pytest.mark.parametrize("noise_rel", [0.0, 0.005])
def test_the_scale_is_as_sure_as_it_says(polish: bool, noise_rel: float) -> None:
    for seed in range(4):
        rng = rng_of(70, seed)
        source, target = (sample(asymmetric(), 4000, noise_rel, rng) for _ in range(2))
        found = align(source, 3.0 * target @ random_orthogonal(rng, det=-1).T, scale=True, polish=polish)
        assert abs(found.scale - 3.0) < 3.0 * found.scale_sigma < 0.15


def test_without_a_scale_there_is_no_doubt_of_it() -> None:
    rng = rng_of(71)
    source, target = (sample(asymmetric(), 3000, 0.0, rng) for _ in range(2))
    assert align(source, target).scale_sigma == 0.0
    assert align(source, 2.0 * source, scale=True).scale_sigma == 0.0


@pytest.mark.parametrize(("fraction", "told"), [(0.0314, "3.1 %"), (0.99, "99 %"), (0.9999, "100 %"), (12.3, "1230 %")])
def test_how_far_objects_differ_is_told_without_powers_of_ten(fraction: float, told: str) -> None:
    assert _percent(fraction) == told


def test_unlike_sizes_are_named_when_scale_is_not_asked_for() -> None:
    points, matrix = skewed(300, 3, 2), random_orthogonal(rng_of(3), det=-1)
    found = align(points, 3.0 * points @ matrix.T)
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-12)
    assert not found.exact
    assert found.status == "the target is 3 times as large as the source: ask for the scale"
    assert found.is_misfit


@pytest.mark.parametrize("det", DETERMINANTS)
def test_far_from_the_origin(det: int) -> None:
    # Coordinates of 1e6 carry 1e-10; the matrix can be no better than that over the size of the object.
    points, matrix = skewed(400, 3, 4), random_orthogonal(rng_of(5), det=det)
    near, far = points + 1e6, points @ matrix.T - 1e6
    found = align(near, far)
    assert found.exact
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-8)
    explains(found, near, far, 1e-8 * 2e6)


@pytest.mark.parametrize("det", DETERMINANTS)
def test_order_of_the_points_does_not_matter(det: int) -> None:
    points, matrix = skewed(400, 3, 6), random_orthogonal(rng_of(7), det=det)
    found = align(points, rng_of(8).permutation(points @ matrix.T))
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-13)


@pytest.mark.parametrize("det", DETERMINANTS)
def test_a_mesh_and_its_finer_copy_are_the_same(det: int) -> None:
    mesh, matrix = asymmetric(), random_orthogonal(rng_of(9), det=det)
    corners = mesh.points[mesh.faces]
    middle = corners.mean(axis=1)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    fine = np.concatenate([np.stack(t, axis=1) for t in ((a, b, middle), (b, c, middle), (c, a, middle))])
    finer = Shape(points=fine.reshape(-1, 3), faces=np.arange(3 * len(fine)).reshape(-1, 3), measure="surface")
    found = align(mesh, turned(finer, matrix, np.array([1.0, 2.0, 3.0])))
    assert found.exact
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-12)


@pytest.mark.parametrize("dim", [2, 4, 5, 8])
@pytest.mark.parametrize("det", DETERMINANTS)
def test_other_dimensions_are_exact_too(dim: int, det: int) -> None:
    points, matrix = skewed(300, dim, 10), random_orthogonal(rng_of(11, dim), dim, det)
    found = align(points, points @ matrix.T + 3.0)
    assert found.exact
    assert found.observable == "full"
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-12)
    explains(found, points, points @ matrix.T + 3.0, 1e-11)


# --- other samples of the same object ---------------------------------------------------------------------------------


@pytest.mark.parametrize("det", DETERMINANTS)
@pytest.mark.parametrize("counts", [(10000, 10000), (10000, 2500), (2000, 8000)])
def test_independent_samples(det: int, counts: tuple[int, int]) -> None:
    rng = rng_of(12, *counts)
    matrix, shift = random_orthogonal(rng, det=det), rng.uniform(-5, 5, 3)
    source, target = (sample(asymmetric(), n, 0.0, rng) for n in counts)
    found = align(source, target @ matrix.T + shift)
    assert angle_deg(found.matrix, matrix) < 0.3
    assert np.abs(found.apply([[0.0, 0.0, 0.0]]) - shift).max() < 0.005 * asymmetric().diagonal
    assert not found.exact
    assert 0.0 < np.degrees(found.sigma_rad) < 0.3
    assert found.rms < 0.005


@pytest.mark.parametrize("det", DETERMINANTS)
def test_the_moments_alone(det: int) -> None:
    rng = rng_of(13)
    matrix = random_orthogonal(rng, det=det)
    source, target = (sample(asymmetric(), 10000, 0.0, rng) for _ in range(2))
    found = align(source, target @ matrix.T, polish=False)
    assert angle_deg(found.matrix, matrix) < 1.5
    assert np.radians(angle_deg(found.matrix, matrix)) < 4.0 * found.sigma_rad


@pytest.mark.parametrize("det", DETERMINANTS)
def test_mesh_against_cloud_and_cloud_against_mesh(det: int) -> None:
    rng = rng_of(14)
    matrix, mesh = random_orthogonal(rng, det=det), asymmetric()
    cloud = sample(mesh, 6000, 0.0, rng)
    assert angle_deg(align(mesh, cloud @ matrix.T).matrix, matrix) < 0.3
    assert angle_deg(align(cloud, turned(mesh, matrix, np.zeros(3))).matrix, matrix) < 0.3


@pytest.mark.parametrize("det", DETERMINANTS)
@pytest.mark.parametrize(("noise_rel", "limit_deg"), [(0.005, 0.5), (0.02, 2.0)])
def test_noise_on_both_sides(det: int, noise_rel: float, limit_deg: float) -> None:
    rng = rng_of(15)
    matrix = random_orthogonal(rng, det=det)
    source, target = (sample(asymmetric(), 10000, noise_rel, rng) for _ in range(2))
    found = align(source, target @ matrix.T)
    assert angle_deg(found.matrix, matrix) < limit_deg
    # The paper reports 1e-2 under noise.
    assert np.mean((found.matrix - matrix) ** 2) < 1e-3


@pytest.mark.parametrize("det", DETERMINANTS)
def test_uneven_density(det: int) -> None:
    # Four times as many points at one end of either cloud, and not at the same end.
    rng = rng_of(16)
    matrix = random_orthogonal(rng, det=det)

    def uneven(direction: Array) -> Array:
        points = sample(asymmetric(), 30000, 0.0, rng)
        height = points @ direction
        height = (height - height.min()) / np.ptp(height)
        return points[rng.random(len(points)) < (1.0 + 3.0 * height) / 4.0][:10000]

    found = align(uneven(np.array([1.0, 0.0, 0.0])), uneven(np.array([-0.6, 0.8, 0.0])) @ matrix.T)
    assert angle_deg(found.matrix, matrix) < 0.5


def test_equivariance() -> None:
    # align(gX, hY) = h align(X, Y) g^-1: the points picked at random are the same ones, so this holds to rounding.
    rng = rng_of(17)
    source, target = sample(asymmetric(), 4000, 0.002, rng), sample(asymmetric(), 4000, 0.002, rng)
    plain = align(source, target)
    g, h = random_orthogonal(rng, det=-1), random_orthogonal(rng, det=1)
    both = align(source @ g.T + 5.0, target @ h.T - 3.0)
    assert angle_deg(both.matrix, h @ plain.matrix @ g.T) < 1e-3
    moved = (plain.apply(source) @ h.T) - 3.0
    np.testing.assert_allclose(both.apply(source @ g.T + 5.0), moved, atol=1e-4)


def test_there_and_back() -> None:
    rng = rng_of(18)
    source = sample(asymmetric(), 6000, 0.0, rng)
    target = sample(asymmetric(), 6000, 0.0, rng) @ random_orthogonal(rng, det=-1).T + 2.0
    there, back = align(source, target), align(target, source)
    assert angle_deg(there.matrix @ back.matrix, np.eye(3)) < 0.2
    assert np.abs(back.apply(there.apply(source)) - source).max() < 0.005 * asymmetric().diagonal


def test_a_rotation_is_given_if_no_reflection_is_allowed() -> None:
    rng = rng_of(19)
    source = sample(asymmetric(), 4000, 0.0, rng)
    mirrored = align(source, sample(asymmetric(), 4000, 0.0, rng) @ householder([1, 2, 3]), allow_reflection=False)
    assert mirrored.determinant == 1
    assert "the objects differ by" in mirrored.status
    assert mirrored.is_misfit
    turn = rotation([1, 1, 0], 2.0)
    turned_only = align(source, sample(asymmetric(), 4000, 0.0, rng) @ turn.T, allow_reflection=False)
    assert angle_deg(turned_only.matrix, turn) < 0.3
    assert turned_only.status == "ok"
    assert not turned_only.is_misfit


@pytest.mark.parametrize("det", DETERMINANTS)
def test_molecules_are_points_that_stand_for_themselves(det: int) -> None:
    rng = rng_of(20)
    atoms, matrix = rng.normal(size=(24, 3)), random_orthogonal(rng, det=det)
    found = align(atoms, rng.permutation(atoms + rng.normal(scale=0.02, size=atoms.shape)) @ matrix.T)
    assert found.determinant == det
    assert angle_deg(found.matrix, matrix) < 2.0
    assert found.observable == "full"


# --- symmetric objects ------------------------------------------------------------------------------------------------

SYMMETRIC: list[tuple[Callable[[], Shape], str, int]] = [
    (mug, "Cs", 2),
    (table, "C4v", 8),
    (lambda: join([box((0, 0, 0), (1.0, 1.6, 2.7))]), "D2h", 8),
]


@pytest.mark.parametrize(("make", "group", "order"), SYMMETRIC, ids=["mug", "table", "box"])
@pytest.mark.parametrize("det", DETERMINANTS)
def test_the_coset_of_a_symmetric_object(make: Callable[[], Shape], group: str, order: int, det: int) -> None:
    rng = rng_of(21, order)
    mesh, matrix = make(), random_orthogonal(rng, det=det)
    source, target = (sample(mesh, 10000, 0.0, rng) for _ in range(2))
    found = align(source, target @ matrix.T + 4.0)
    assert found.determinant == 1
    assert (found.coset.symmetry, len(found.equivalents)) == (group, order)
    assert found.observable == f"up to the {order} operations of {group}, and the determinant is free"
    assert found.determinant_confidence == 0.5
    np.testing.assert_allclose(found.equivalents[0], found.matrix, atol=1e-12)
    np.testing.assert_allclose(found.equivalent_transforms[0], found.transform, atol=1e-12)
    assert min(angle_deg(m, matrix) for m in found.equivalents) < 0.6
    assert np.sign(np.linalg.det(found.equivalents)).sum() == 0
    surface = cKDTree(sample(mesh, 40000, 0.0, rng) @ matrix.T + 4.0)
    for transform in found.equivalent_transforms:
        distance, _ = surface.query(source[::10] @ transform[:3, :3].T + transform[:3, 3])
        assert np.quantile(distance, 0.99) < 0.015 * mesh.diagonal


def test_without_reflections_the_coset_has_rotations_only() -> None:
    rng = rng_of(22)
    source, target = (sample(table(), 6000, 0.0, rng) for _ in range(2))
    found = align(source, target, allow_reflection=False)
    assert len(found.equivalents) == 4
    assert (np.linalg.det(found.equivalents) > 0).all()


def test_a_body_of_revolution_leaves_one_turn_free() -> None:
    rng = rng_of(23)
    matrix = random_orthogonal(rng)
    source, target = (sample(bottle(), 8000, 0.0, rng) for _ in range(2))
    found = align(source, target @ matrix.T)
    axis = matrix[:, 2]
    assert found.coset.symmetry == "Cinfv"
    assert abs(found.free_axis[0] @ axis) > np.cos(np.radians(0.5))
    assert (found.matrix[:, 2] @ axis) > np.cos(np.radians(0.5))
    assert "up to any turn about" in found.observable


def test_exact_points_of_a_symmetric_object_keep_their_determinant() -> None:
    # A sample of a mirror-symmetric mug is not itself mirror symmetric; the moments tell to rounding.
    points = sample(mug(), 3000, 0.0, rng_of(24))
    for det in DETERMINANTS:
        matrix = random_orthogonal(rng_of(25), det=det)
        found = align(points, points @ matrix.T)
        assert found.exact
        np.testing.assert_allclose(found.matrix, matrix, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, pytest.param(0.1, marks=pytest.mark.slow)])
def test_either_hand_of_what_is_its_own_mirror_image_is_sure_and_nothing_is_detected_for_that(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = rng_of(26)
    source, target = (damage.outliers(mug(), share, rng).points for _ in range(2))
    monkeypatch.setattr(sides_of, "detect", None)
    found = align(source, target @ random_orthogonal(rng, det=-1).T)
    assert (found.status, found.confidence > 0.95) == ("ok", True)
    monkeypatch.undo()
    assert found.determinant_confidence <= 0.5, "all maps that do as well are asked for"


def test_a_symmetric_mesh_gets_a_rotation() -> None:
    mesh, matrix = mug(), random_orthogonal(rng_of(26), det=-1)
    found = align(mesh, turned(mesh, matrix, np.ones(3)))
    assert found.determinant == 1
    assert min(angle_deg(m, matrix) for m in found.equivalents) < 0.2


# --- what the points do not span, and other dimensions ----------------------------------------------------------------


def ring(count: int, radius: float = 1.0, turn: float = 0.0) -> Array:
    angles = 2.0 * np.pi * np.arange(count) / count + turn
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def products(one: Array, other: Array) -> Array:
    return np.array([[*p, *q] for p in one for q in other])


POLYTOPES = {
    "a 12-gon": (ring(12), 24),
    "a star": (np.concatenate([ring(9), ring(9, 0.5, np.pi / 9)]), 18),
    "two rings askew": (np.concatenate([ring(12), ring(12, 0.8, 0.1)]), 12),
    "a 24-cell": (np.array([p for p in itertools.product((-1, 0, 1), repeat=4) if np.abs(p).sum() == 2], float), 1152),
    "a tesseract": (np.array(list(itertools.product((-1, 1), repeat=4)), float), 384),
    "a duoprism": (products(ring(5), ring(6)), 120),
}


@pytest.mark.parametrize("det", DETERMINANTS)
@pytest.mark.parametrize(("points", "order"), POLYTOPES.values(), ids=POLYTOPES)
def test_few_points_of_any_dimension_are_carried_onto_one_another_in_all_ways(
    points: Array, order: int, det: int
) -> None:
    """Low moments leave turns of what has high folds open; the points do not."""
    rng = rng_of(61, order)
    matrix = random_orthogonal(rng, points.shape[1], det)
    found = align(points, rng.permutation(points) @ matrix.T + 3.0)
    assert (found.status, found.confidence, found.exact, found.overlap) == ("ok", 1.0, True, (1.0, 1.0))
    assert len(found.equivalents) == order
    assert min(np.abs(m - matrix).max() for m in found.equivalents) < 1e-9
    for m, t in zip(found.coset.matrices, found.coset.translations, strict=True):
        assert cKDTree(points @ matrix.T + 3.0).query(points @ m.T + t)[0].max() < 1e-9


@pytest.mark.parametrize("noise", [1e-4, 3e-3])
@pytest.mark.parametrize("dim", [2, 4])
def test_few_noisy_points_of_any_dimension_agree(dim: int, noise: float) -> None:
    """And what is off by more than noise and tolerance allow does not."""
    rng = rng_of(62, dim)
    points, matrix = rng.standard_normal((60, dim)), random_orthogonal(rng, dim)
    target = rng.permutation(points @ matrix.T + noise * rng.standard_normal(points.shape))
    found = align(points, target)
    assert found.status == "ok"
    assert found.confidence > 0.95
    assert np.abs(found.matrix - matrix).max() < 4.0 * found.sigma_rad < 20.0 * noise
    np.testing.assert_allclose(align(2.0 * points, target, scale=True).scale, 0.5, atol=3.0 * noise)
    target[0] += 0.3 * np.ptp(target)
    assert align(points, target).is_misfit


@pytest.mark.parametrize("dim", [2, 4])
def test_many_points_that_come_nearest_to_their_own_are_told_by_them(dim: int) -> None:
    rng = rng_of(65, dim)
    points, matrix = rng.standard_normal((400, dim)), random_orthogonal(rng, dim)
    target = rng.permutation(points @ matrix.T + 1e-3 * rng.standard_normal(points.shape))
    found = align(points, target)
    assert (found.status, len(found.equivalents)) == ("ok", 1)
    assert np.abs(found.matrix - matrix).max() < 4.0 * found.sigma_rad < 1e-3


def test_what_neither_moments_nor_points_tell_is_open() -> None:
    """The cube of eight dimensions has ten million maps, and moments to the third order know none of its axes."""
    points = np.array(list(itertools.product((-1, 1), repeat=8)), dtype=float)
    found = align(points, points @ random_orthogonal(rng_of(66), 8).T)
    assert found.status.startswith("not determined: moments to order 3 allow maps that carry no point onto another")
    assert found.confidence == 0.0


def test_points_on_a_line_are_not_denied_those_that_noise_put_beside_one() -> None:
    """One side of the line is as good as the other, which no anchor tells."""
    line = np.column_stack([np.arange(6.0) ** 1.3, np.zeros(6)])
    beside = line + 1e-3 * rng_of(67).standard_normal(line.shape)
    for one, other in ((line, beside), (beside, line)):
        found = align(one, other)
        assert not found.is_misfit
        assert found.overlap == (1.0, 1.0)


def test_a_label_leaves_of_a_hexagon_what_keeps_it() -> None:
    points, labels = ring(6), np.array([1, 0, 0, 0, 0, 0])
    turned_, swapped = points @ random_orthogonal(rng_of(63), 2).T, np.array([1, 0, 1, 0, 0, 0])
    found = align(Shape(points=points, labels=labels), Shape(points=turned_, labels=labels))
    assert (found.status, len(found.equivalents)) == ("ok", 2)
    for m in found.equivalents:
        np.testing.assert_allclose(m @ points[0], turned_[0], atol=1e-9)
    assert align(Shape(points=points, labels=labels), Shape(points=turned_, labels=swapped)).is_misfit


def test_planar_molecules_that_were_rounded_agree() -> None:
    """Moments of so few atoms know no noise; the points do."""
    benzene = np.concatenate([ring(6, 1.39), ring(6, 2.48)])
    labels = np.repeat([6, 1], 6)
    rng = rng_of(64)
    flat = np.column_stack([benzene, np.zeros(12)])
    found = align(
        Shape(points=flat, labels=labels),
        Shape(points=np.round(flat @ rotation([0.0, 0.0, 1.0], rng.uniform(0.0, 6.0)).T, 2), labels=labels),
    )
    assert found.status == "ok"
    assert found.confidence > 0.95
    assert len(found.equivalents) == 24


@pytest.mark.parametrize("det", DETERMINANTS)
def test_a_planar_set_leaves_the_reflection_across_it_free(det: int) -> None:
    flat = np.column_stack([skewed(500, 2, 27), np.zeros(500)])
    matrix = random_orthogonal(rng_of(28), det=det)
    found = align(flat, flat @ matrix.T + 1.0)
    assert found.determinant == 1
    assert "the points span 2 of 3 dimensions: the reflection across" in found.observable
    assert min(np.abs(m - matrix).max() for m in found.equivalents) < 1e-12
    explains(found, flat, flat @ matrix.T + 1.0, 1e-12)
    assert len(align(flat, flat @ matrix.T, allow_reflection=False).equivalents) == 1


def test_points_on_a_line_leave_every_map_across_it_free() -> None:
    line = np.multiply.outer(rng_of(29).random(100) ** 2, [1.0, 2.0, 3.0])
    matrix = random_orthogonal(rng_of(30))
    found = align(line, line @ matrix.T)
    assert found.coset.free.shape == (2, 3)
    explains(found, line, line @ matrix.T, 1e-12)
    np.testing.assert_allclose(np.abs(found.free_axis[0] @ matrix @ line[0]), np.linalg.norm(line[0]), rtol=1e-9)


@pytest.mark.slow
def test_a_rectangle_has_four_maps_and_a_disc_has_them_all() -> None:
    rng = rng_of(31)
    matrix = random_orthogonal(rng, 2, -1)
    first, second = (rng.uniform(-1, 1, (4000, 2)) * [2.0, 1.0] for _ in range(2))
    found = align(first, second @ matrix.T)
    assert found.determinant == 1
    assert len(found.equivalents) == 4
    assert min(angle_deg(*(np.pad(m, (0, 1)) for m in (e, matrix))) for e in found.equivalents) < 2.0
    discs = [p[np.linalg.norm(p, axis=1) < 1.0] for p in (rng.uniform(-1, 1, (5000, 2)) for _ in range(2))]
    assert align(*discs).observable == "up to any orthogonal map within 2 of the 2 dimensions"
    assert align(*discs).sigma_rad == np.inf


# --- bad input --------------------------------------------------------------------------------------------------------

GOOD = skewed(50, 3, 32)


@pytest.mark.parametrize(
    ("source", "target", "options", "message"),
    [
        (np.empty((0, 3)), GOOD, {}, "source: no points"),
        (GOOD, np.where(GOOD > 1.0, np.nan, GOOD), {}, "target: .* hold NaN"),
        (GOOD[:, :2], GOOD, {}, "source has 2 coordinates, target has 3"),
        (GOOD.ravel(), GOOD, {}, "expected \\[N, n\\]"),
        (GOOD, GOOD, {"tolerance": 0.5}, "expected a fraction of the diagonal"),
        (np.ones((20, 12)) * np.arange(20)[:, None], np.ones((20, 12)), {}, "all 20 points coincide"),
        (np.eye(12), np.eye(12), {}, "align takes 10 at most"),
    ],
)
def test_bad_input(source: Array, target: Array, options: dict[str, float], message: str) -> None:
    with pytest.raises((InputError, DegenerateShapeError), match=message) as caught:
        align(source, target, **options)
    assert "\n" not in str(caught.value)


def test_all_points_in_one_place() -> None:
    with pytest.raises(DegenerateShapeError, match="target: all 5 points coincide"):
        align(GOOD, np.ones((5, 3)))


def test_measures_do_not_mix() -> None:
    mesh = asymmetric()
    with pytest.raises(InputError, match="give both the same measure"):
        align(mesh, Shape(points=mesh.points, faces=mesh.faces, measure="solid"))


# --- the parts --------------------------------------------------------------------------------------------------------


def test_the_grid_leaves_no_rotation_far_away() -> None:
    grid = grid_rotations().reshape(-1, 9)
    products = grid_rotations() @ grid_rotations().transpose(0, 2, 1)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-12)
    assert (np.linalg.det(grid_rotations()) > 0.0).all()
    anywhere = np.stack([random_orthogonal(rng_of(41, k)) for k in range(300)]).reshape(-1, 9)
    farthest = np.degrees(np.arccos((np.max(anywhere @ grid.T, axis=1).min() - 1.0) / 2.0))
    assert farthest < 12.0


def test_procrustes_comes_with_its_determinant() -> None:
    moments = central_moments(skewed(500, 3, 34), np.ones(500), 5)
    for det in DETERMINANTS:
        matrix = random_orthogonal(rng_of(35), det=det)
        target = central_moments(skewed(500, 3, 34) @ matrix.T, np.ones(500), 5)
        found = procrustes(ntuples(moments), ntuples(target))
        assert found.rank == 3
        np.testing.assert_allclose(found.matrix, matrix, atol=1e-11)
        assert np.linalg.det(found.flipped) == pytest.approx(-det)


def test_the_landscape_peaks_at_the_truth() -> None:
    matrix = random_orthogonal(rng_of(36), det=-1)
    points = skewed(3000, 3, 37)
    source, target = (central_moments(p, np.ones(len(p)), 8) for p in (points, points @ matrix.T))
    pair = harmonic_pair(source, target)
    proper, improper = landscape(source, target)
    assert improper.max() > proper.max()
    best = hills(improper, -1, count=1)
    assert angle_deg(best[0], matrix) < 15.0
    fitted = fit(pair, best)
    np.testing.assert_allclose(fitted.matrices[0], matrix, atol=1e-12)
    assert len(exact(pair, fitted).costs) == 1
    assert np.sqrt(np.trace(covariance(pair, fitted))) < 1e-3


def test_the_moments_prefer_the_right_hand_only_of_chiral_objects() -> None:
    rng = rng_of(38)
    for shape, chiral in ((asymmetric(), True), (mug(), False)):
        pair = harmonic_pair(
            *(central_moments(sample(shape, 10000, 0.0, rng), np.ones(10000), 8, parts=16) for _ in range(2))
        )
        found = best_fits(pair, np.stack([np.eye(3), *(householder(n) for n in np.eye(3))]))
        good = as_good(pair, found)
        assert good[0]
        assert set(found.signs[good]) == ({1.0} if chiral else {1.0, -1.0})


def sheet(count: int, noise: float, rng: np.random.Generator) -> Array:
    """Points of the plane x + y + z = 1."""
    points = rng.uniform(-1, 1, (count, 3))
    points -= (points.sum(axis=1)[:, None] - 1.0) / 3.0
    return points + noise * rng.standard_normal(points.shape)


# With noise: 24 neighbours or more, 0.06 wide, give a normal to 0.01 / (0.03 sqrt(24)) and a plane to 0.01 / sqrt(24);
# twice that.
@pytest.mark.parametrize(("noise", "normal_deg", "offset"), [(0.0, 1e-6, 1e-12), (0.01, 8.0, 0.006)])
def test_planes_are_found_where_they_are_asked_for(noise: float, normal_deg: float, offset: float) -> None:
    rng = rng_of(42)
    surface = make_skin(sheet(20000, noise, rng), rng)
    assert (surface.neighbours > 12) == (noise > 0.0)
    queries = sheet(50, 0.02, rng) * 0.5 + 1.0 / 6.0
    distance, planes = met_by(surface, queries)
    np.testing.assert_allclose(distance, cKDTree(surface.points).query(queries)[0])
    angles = [np.degrees(line_angle_rad(n, [1, 1, 1])) for n in planes.normals]
    assert np.quantile(angles, 0.9) < normal_deg
    assert np.quantile(np.abs(planes.points.sum(axis=1) - 1.0) / np.sqrt(3.0), 0.9) <= offset
    assert (planes.flatness < 0.5).all()
    moved = surface.local_planes(np.arange(0, 20000, 100))
    assert np.sqrt(np.mean((moved.points.sum(axis=1) - 1.0) ** 2) / 3.0) <= max(offset, noise / 2.0)


@pytest.mark.parametrize("det", DETERMINANTS)
@pytest.mark.parametrize("scale", [None, 1.05])
def test_the_polish_comes_back_from_where_the_moments_leave_it(det: int, scale: float | None) -> None:
    rng = rng_of(43)
    body, matrix = sample(asymmetric(), 20000, 0.0, rng), random_orthogonal(rng, det=det)
    body = (body - body.mean(axis=0)) / np.sqrt(((body - body.mean(axis=0)) ** 2).sum(axis=1).mean())
    source = make_skin(body[:10000], rng).local_planes(np.arange(0, 10000, 12))
    target = make_skin((scale or 1.0) * body[10000:] @ matrix.T + [0.01, 0.0, -0.02], rng)
    start = Similarity(matrix=rotation([1, 2, 3], 0.03) @ matrix, shift=np.zeros(3))
    found = polish(source, target, start, error=0.1, known=np.zeros((6, 6)), scale=scale is not None)
    assert found.converged
    assert angle_deg(found.motion.matrix, matrix) < 0.1
    np.testing.assert_allclose(found.motion.shift, [0.01, 0.0, -0.02], atol=2e-3)
    assert found.motion.scale == pytest.approx(scale or 1.0, abs=2e-3)


def test_a_polish_is_given_up_where_it_is_not_worthwhile_and_only_there() -> None:
    rng = rng_of(47)
    body = sample(asymmetric(), 12000, 0.01, rng)
    source, target = make_skin(body[:6000], rng).patches(np.arange(0, 6000, 8)), make_skin(body[6000:], rng)
    asked: list[Similarity] = []

    def ended(angle: float, answer: bool) -> Polished:
        start = Similarity(matrix=rotation([1, 2, 3], angle), shift=np.zeros(3))
        worthwhile = lambda motion: asked.append(motion) or answer  # noqa: E731
        return polish(source, target, start, error=0.5, known=np.zeros((6, 6)), worthwhile=worthwhile)

    near, far = ended(0.05, True), ended(2.0, False)
    assert near.converged
    assert not near.given_up
    assert far.given_up
    assert (far.steps, far.converged) == (SHORT, False)
    np.testing.assert_array_equal(asked[-1].matrix, far.motion.matrix)


def test_moments_in_the_plane_agree_with_procrustes() -> None:
    points, matrix = skewed(400, 2, 39), random_orthogonal(rng_of(40), 2, -1)
    source, target = (central_moments(p, np.ones(400), 5) for p in (points, points @ matrix.T))
    tuples = ntuples(source), ntuples(target)
    closed = procrustes(*tuples)
    np.testing.assert_allclose(closed.matrix, matrix, atol=1e-11)
    np.testing.assert_allclose(span_fit(source, target, tuples).matrices, matrix[None], atol=1e-12)


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_plain_moments_find_the_map_that_harmonic_ones_find(dim: int) -> None:
    # 3-space has both; the metric of plain moments differs, the map that leaves no residual does not.
    points, matrix = skewed(400, dim, 44), random_orthogonal(rng_of(45), dim, -1)
    source, target = (central_moments(p, np.ones(400), 5) for p in (points, points @ matrix.T))
    near = random_orthogonal(rng_of(46), dim)
    near = np.linalg.qr(matrix + 0.05 * near)[0]
    near = near * np.sign(np.sum(near * matrix, axis=0))
    axes = np.linalg.eigh(target.covariance)[1]
    found = axes @ fit(monomial_pair(source, target), (axes.T @ near)[None]).matrices[0]
    np.testing.assert_allclose(found, matrix, atol=1e-11)
    if dim == 3:
        np.testing.assert_allclose(fit(harmonic_pair(source, target), near[None]).matrices[0], matrix, atol=1e-12)


def regular(corners, turn):
    angle = 2 * np.pi * np.arange(corners) / corners + turn
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize(("corners", "count"), [(3, 6), (4, 8), (5, 10)])
def test_in_the_plane_the_turns_of_the_target_do_as_well(corners, count):
    source, target = regular(corners, 0.3), 2.0 + regular(corners, 1.1)
    found = align(source, target)
    assert len(found.equivalents) == count
    for m, t in zip(found.coset.matrices, found.coset.translations, strict=True):
        moved = source @ m.T + t
        assert np.linalg.norm(moved[:, None] - target, axis=2).min(axis=1).max() < 1e-6


def test_points_on_a_line_are_no_pose_of_a_body():
    with pytest.raises(DegenerateShapeError):
        align([[0.0, 0, 0], [1, 0, 0]], np.random.default_rng(0).standard_normal((400, 3)))


def test_noise_that_hides_every_direction_is_said():
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T
    found = align(corners, np.random.default_rng(1).standard_normal((3000, 4)))
    assert found.status.startswith("not determined")
    assert not found.is_misfit


# --- large clouds, and points that belong to no surface ---------------------------------------------------------------


@pytest.mark.parametrize("det", DETERMINANTS)
def test_a_large_cloud_needs_some_of_its_points_only(det: int) -> None:
    rng = rng_of(72)
    matrix = random_orthogonal(rng, det=det)
    source, target = sample(asymmetric(), 150000, 0.0, rng), sample(asymmetric(), 60000, 0.0, rng)
    found = align(source, target @ matrix.T + 1.0)
    assert angle_deg(found.matrix, matrix) < 0.05
    assert found.status == "ok"
    assert min(found.overlap) > 0.98


def test_the_same_points_are_told_however_many() -> None:
    points, matrix = sample(asymmetric(), 50000, 0.0, rng_of(73)), random_orthogonal(rng_of(74), det=-1)
    found = align(points, rng_of(75).permutation(points @ matrix.T))
    assert found.exact
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-12)


@pytest.mark.parametrize("det", DETERMINANTS)
def test_strays_on_both_sides_cost_no_confidence(det: int) -> None:
    rng = rng_of(76)
    matrix = random_orthogonal(rng, det=det)

    def strewn() -> Array:
        points = sample(asymmetric(), 8000, 0.0, rng)
        low, high = points.min(axis=0), points.max(axis=0)
        return np.concatenate([points, 0.5 * (low + high) + 1.5 * (rng.random((3000, 3)) - 0.5) * (high - low)])

    found = align(strewn(), strewn() @ matrix.T)
    assert angle_deg(found.matrix, matrix) < 0.3
    assert found.confidence > 0.95


@pytest.mark.parametrize("det", [1, pytest.param(-1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", [63, pytest.param(65, marks=pytest.mark.slow)])
def test_a_hand_that_strays_hide_is_not_told_for_sure(det: int, seed: int) -> None:
    # What makes a coffee grinder differ from its mirror image is a crank, which 40 % of strays may hide.
    found = partial_alignment.run(partial_alignment.Case(name="grinder", condition="outliers 40 %", det=det, seed=seed))
    assert found.covered or found.confidence < 0.6


def test_no_map_comes_below_what_lengths_allow() -> None:
    # What no orthogonal map changes, against the best maps of many starts; nothing is left for one object in two poses.
    rng = rng_of(77)
    one, other = (central_moments(skewed(400, 3, s), np.ones(400), 6, parts=8) for s in (78, 79))
    pair = harmonic_pair(one, other)
    found = best_fits(pair, np.concatenate([grid_rotations()[::50], -grid_rotations()[::50]]))
    assert 0.0 < least_misfit(pair) <= misfit(pair, found)
    turned_one = central_moments(skewed(400, 3, 78) @ random_orthogonal(rng, det=-1).T, np.ones(400), 6, parts=8)
    assert least_misfit(harmonic_pair(one, turned_one)) < 1e-12


# --- classes ----------------------------------------------------------------------------------------------------------


def painted(points: Array, matrix: Array, shift: float) -> Shape:
    """A cloud whose classes tell the sides of a box apart, moved."""
    labels = (points[:, 0] > 0.2).astype(int) + 2 * ((points[:, 1] > 0.3) & (points[:, 2] > 0.1))
    return Shape(points=points @ matrix.T + shift, labels=labels)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, 0.9, 1.1, 2.0])
@pytest.mark.parametrize("name", ["airplane", "fan7", "chair"])
def test_objects_that_agree_at_one_size_only_are_told_so(name: str, factor: float) -> None:
    rng = rng_of(94, round(10 * factor))
    body, _ = specimen("shape" if name == "fan7" else "household", name)
    source, target = (sample(body, 10000, 0.0, rng) for _ in range(2))
    found = align(source, factor * target @ random_orthogonal(rng).T + 3.0)
    assert (found.confidence, found.observable != "full") == (0.0, True)
    told = re.fullmatch(r"the target is (\S+) times as large as the source: ask for the scale", found.status)
    assert told is not None, found.status
    assert float(told[1]) == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(
    ("factor", "excess", "told"), [(0.9, 0.0, True), (0.9, 0.9, False), (1.0, 0.0, False)], ids=["", "unsure", "alike"]
)
def test_what_is_not_sure_is_kept_unless_one_size_is_sure_and_another(factor: float, excess: float, told: bool) -> None:
    rng = rng_of(97)
    clouds = (Shape(points=f * sample(asymmetric(), 6000, 0.002, rng)) for f in (1.0, factor))
    source, target = (side_of(cloud, PARTS) for cloud in clouds)
    evidence = Evidence(source=source, target=target, scale=True, tolerance=0.02, seed=0)
    choice = replace(choose(evidence, brief=True), excess=excess)
    kept = replace(align(source.shape, source.shape), _verdict=lambda: Verdict(status="ok", excess=1.0, confidence=0.5))
    answer = story._unless_of_other_size(kept, evidence, True, Clock(), choice)
    assert (answer is not kept) == told
    assert ("ask for the scale" in answer.status) == told


@pytest.mark.parametrize("seed", range(3))
def test_thin_parts_in_noise_leave_the_scale_where_the_moments_have_it(seed: int) -> None:
    rng = rng_of(95, seed)
    body, _ = specimen("shape", "propeller4")
    source, target = (sample(body, 10000, 0.01, rng) for _ in range(2))
    found = align(source, 0.6 * target @ random_orthogonal(rng).T, scale=True)
    assert found.scale == pytest.approx(0.6, rel=0.015)


@pytest.mark.parametrize("det", [1, pytest.param(-1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("parts", [False, True])
def test_classes_choose_between_equivalents(det: int, parts: bool) -> None:
    # Of a box eight maps are as good, of a box without two of its corners several; classes leave one, or two.
    rng, matrix = rng_of(85), random_orthogonal(rng_of(86, det + 1), det=det)
    body = join([box((0.0, 0.0, 0.0), (1.0, 1.6, 2.7))])
    source, target = (sample(body, 10000, 0.0, rng) for _ in range(2))
    if parts:
        source, target = source[source @ [1.0, 0.7, 0.5] < 0.9], target[target @ [0.6, 0.9, -0.4] > -0.8]
    found = align(painted(source, np.eye(3), 0.0), painted(target, matrix, 2.0))
    assert found.status == "ok"
    assert angle_deg(found.matrix, matrix) < 0.5
    plain = align(source, painted(target, matrix, 2.0))
    assert len(found.equivalents) <= 1 + parts < len(plain.equivalents), "classes that only one has tell nothing"


def test_what_has_another_class_does_not_meet() -> None:
    rng = rng_of(87)
    source, target = (sample(asymmetric(), 8000, 0.0, rng) for _ in range(2))
    given = Shape(points=source, labels=np.full(8000, 3))
    same, other = (align(given, Shape(points=target, labels=np.full(8000, k))) for k in (3, 4))
    assert same.status == "ok"
    assert same.overlap[0] > 0.95
    assert other.status != "ok"
    assert other.overlap == (0.0, 0.0)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_faces_meet_faces_of_their_class(factor: float) -> None:
    mesh, matrix = join([box((0.0, 0.0, 0.0), (1.0, 1.6, 2.7))]), random_orthogonal(rng_of(96))
    labels = (mesh.points[mesh.faces].mean(axis=1)[:, 0] > 0.3).astype(int)
    source = replace(mesh, labels=labels)
    found = align(source, replace(source, points=factor * mesh.points @ matrix.T), scale=True)
    assert (found.status, found.exact, found.scale) == ("ok", True, pytest.approx(factor))
    assert found.overlap == (1.0, 1.0)
    assert len(found.equivalents) == 4, "of the eight of the box those that keep one end apart"


def test_atoms_meet_atoms_of_their_element() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.5) for z in (0.0, 2.2)])
    elements = np.array([6, 7, 8, 6, 6, 16, 6, 6])
    matrix = random_orthogonal(rng_of(88), det=-1)
    found = align(Shape(points=corners, labels=elements), Shape(points=corners @ matrix.T, labels=elements))
    assert found.exact
    np.testing.assert_allclose(found.matrix, matrix, atol=1e-6)
    swapped = elements[[1, 0, *range(2, 8)]]
    assert align(Shape(points=corners, labels=elements), Shape(points=corners, labels=swapped)).status != "ok"


def test_colours_and_texts_are_compared_by_what_they_are() -> None:
    rng = rng_of(89)
    points = [sample(asymmetric(), 4000, 0.0, rng) for _ in range(2)]
    top = [(p[:, 2] > 0.0).astype(int) for p in points]

    def shape(k: int, labels: Array, kinds: object) -> Shape:
        return Shape(points=points[k], labels=labels, kinds=kinds, source="ab"[k])

    red, blue, grey = [200.0, 20.0, 20.0], [10.0, 10.0, 220.0], [120.0, 120.0, 120.0]
    source = shape(0, top[0], [red, blue])
    near = [red[0] - 15.0, 30.0, 25.0]
    for labels, kinds, right in (
        (1 - top[1], [blue, near], True),
        (top[1], [blue, near], False),
        (top[1], [red, grey], False),
    ):
        assert (align(source, shape(1, labels, kinds)).status == "ok") is right
    texts = shape(0, top[0], ["top", "foot"])
    assert align(texts, shape(1, 1 - top[1], ["foot", "top"])).status == "ok"
    with pytest.raises(InputError, match="the labels of a are colours, those of b texts"):
        align(source, shape(1, top[1], ["top", "foot"]))
    with pytest.raises(InputError, match="kinds have shape"):
        shape(0, top[0], [red])


# --- objects that share a part only -----------------------------------------------------------------------------------


def cut_pair(det: int, share: float, seed: int) -> tuple[Array, Array, Array]:
    """Source and target cut from opposite sides, such a share of each seen by the other, and the true matrix."""
    rng = rng_of(50, seed)
    kept, along, matrix = 1.0 / (2.0 - share), np.array([0.8, 0.5, -0.3]), random_orthogonal(rng, det=det)
    source, target = (sample(camera(), 12000, 0.0, rng) for _ in range(2))
    source = source[source @ along <= np.quantile(source @ along, kept)]
    target = target[target @ along >= np.quantile(target @ along, 1.0 - kept)]
    return source, target @ matrix.T + 4.0, matrix


@pytest.mark.parametrize("det", DETERMINANTS)
def test_cuts_from_opposite_sides(det: int) -> None:
    source, target, matrix = cut_pair(det, 0.7, 0)
    found = align(source, target)
    assert angle_deg(found.matrix, matrix) < 0.5
    np.testing.assert_allclose(found.apply([[0.0, 0.0, 0.0]]), [[4.0, 4.0, 4.0]], atol=0.01)
    assert found.status == "ok"
    assert found.confidence > 0.9
    assert found.determinant_confidence > 0.9
    np.testing.assert_allclose(found.overlap, 0.7, atol=0.05)
    assert found.rms < 0.005


@pytest.mark.slow
@pytest.mark.parametrize(("det", "factor"), [(1, 0.4), (-1, 3.0)])
def test_the_scale_of_parts(det: int, factor: float) -> None:
    source, target, matrix = cut_pair(det, 0.7, 0)
    found = align(source / factor, target, scale=True)
    assert found.status == "ok"
    assert angle_deg(found.matrix, matrix) < 0.5
    assert found.scale == pytest.approx(factor, rel=0.005)
    assert abs(found.scale - factor) < 4.0 * found.scale_sigma
    np.testing.assert_allclose(found.apply([[0.0, 0.0, 0.0]]), [[4.0, 4.0, 4.0]], atol=0.02)
    assert found.overlap[0] == pytest.approx(0.7, abs=0.05)


def test_a_small_source_does_not_meet_a_part_of_anything() -> None:
    rng = rng_of(57)
    found = align(sample(asymmetric(), 5000, 0.0, rng), sample(table(), 5000, 0.0, rng), scale=True)
    assert found.status != "ok"
    assert found.confidence == 0.0


def test_partial_alignment_turns_with_its_objects() -> None:
    source, target, _ = cut_pair(-1, 0.7, 1)
    plain = align(source, target)
    g, h = random_orthogonal(rng_of(51), det=-1), random_orthogonal(rng_of(52), det=1)
    both = align(source @ g.T + 5.0, target @ h.T - 3.0)
    assert angle_deg(both.matrix, h @ plain.matrix @ g.T) < 0.2
    np.testing.assert_allclose(both.apply(source @ g.T + 5.0), plain.apply(source) @ h.T - 3.0, atol=0.01)


@pytest.mark.parametrize("det", DETERMINANTS)
def test_a_model_in_a_scene(det: int) -> None:
    # Half of the target is a floor that the source knows nothing of, so large that their sizes differ.
    rng = rng_of(53)
    matrix, model = random_orthogonal(rng, det=det), sample(asymmetric(), 8000, 0.0, rng)
    scene = sample(asymmetric(), 6000, 0.0, rng)
    floor = rng.uniform(-1.0, 1.0, (6000, 3)) * [1.5, 1.5, 0.0] + [0.0, 0.0, scene[:, 2].min()]
    found = align(model, np.concatenate([scene, floor]) @ matrix.T + 2.0)
    assert angle_deg(found.matrix, matrix) < 0.5
    assert found.overlap[0] > 0.95 > 0.6 > found.overlap[1]
    assert not found.is_misfit


def test_objects_that_have_nothing_in_common_are_not_aligned() -> None:
    rng = rng_of(54)
    found = align(sample(asymmetric(), 5000, 0.0, rng), sample(table(), 5000, 0.0, rng))
    assert found.confidence == 0.0
    assert found.status != "ok"


@pytest.mark.parametrize("det", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_what_is_seen_of_a_symmetric_object_leaves_its_equivalents(det: int) -> None:
    # A box with a knob that is cut off: four operations carry what is left onto itself, so that four maps are as good.
    rng, matrix = rng_of(80), random_orthogonal(rng_of(81), det=det)
    mesh = join([box((0.0, 0.0, 0.0), (1.0, 1.6, 2.7)), box((0.2, 0.3, 1.5), (0.3, 0.4, 0.5))])
    source, target = (sample(mesh, 12000, 0.0, rng) for _ in range(2))
    source, target = source[source[:, 2] < 0.9], target[target[:, 2] < 0.6]
    found = align(source, target @ matrix.T + 2.0)
    assert found.status == "ok"
    for signs in ([1, 1, 1], [-1, -1, 1], [1, -1, 1], [-1, 1, 1]):
        assert min(angle_deg(m, matrix @ np.diag(signs)) for m in found.equivalents) < 0.3
    assert f"{len(found.equivalents)} maps" in found.observable
    assert "the determinant is free" in found.observable


@pytest.mark.parametrize(("name", "seed"), [("chair", 4), ("bed", 0), ("bed", 3)])
def test_what_carries_a_whole_source_onto_itself_leaves_equivalents_whatever_the_target_shows(name, seed) -> None:
    # All points of the source have their images, so that a map and what it makes of the mirror miss by the same.
    mesh, truth = specimen("household", name)
    normal, rng = truth.group.mirrors()[0], np.random.default_rng(seed)
    half, target = (sample(mesh, count, 0.0, rng) for count in (4000, 9000))
    source = np.concatenate([half, half @ householder(normal).T])
    target = target[target @ normal > np.quantile(target @ normal, 0.3)]
    matrix = random_orthogonal(rng)
    found = align(source, target @ matrix.T + 5.0)
    assert found.status == "ok"
    for wanted in (matrix, matrix @ householder(normal)):
        assert min(angle_deg(m, wanted) for m in found.equivalents) < 0.3
    assert found.determinant_confidence < 0.7


@pytest.mark.parametrize("noisy", [0, 1])
def test_what_is_well_met_is_told_by_the_noisier_side(noisy: int) -> None:
    # A mesh and a scan of it: half of the local planes have next to no noise, and all miss by that of the other half.
    rng = rng_of(91)
    clouds = [sample(asymmetric(), 9000, 0.004 * (k == noisy), rng) for k in (0, 1)]
    sides = [side_of(Shape(points=cloud), 0) for cloud in clouds]
    judge = Judge.of(sides, [s.moments.scale for s in sides], 0.02, 0)
    assert judge is not None
    noises = judge.source.noise, judge.target.noise
    both = np.quantile(np.concatenate(noises), 0.9)
    np.testing.assert_allclose(judge.near * judge.diagonal, np.quantile(noises[noisy], 0.9))
    assert judge.near * judge.diagonal > 1.1 * both


@pytest.mark.parametrize("seed", [4, pytest.param(5, marks=pytest.mark.slow)])
def test_what_is_its_own_mirror_image_tells_no_determinant(seed: int) -> None:
    # Both sides of a thin plate are next to one another, so that its own mirror is no map that is found by itself.
    angle, far = np.arange(9) * np.pi / 4.5, np.array([1.0, 0.55, 0.9, 0.5, 1.0, 0.7, 0.45, 0.85, 0.6])
    plate = join([prism(np.column_stack([far * np.cos(angle), far * np.sin(angle)]), 0.06)])
    rng = np.random.default_rng(seed)
    source, target = (sample(plate, 6000, 0.002, rng) for _ in range(2))
    matrix = random_orthogonal(rng, det=1)
    found = align(source, target[target[:, 0] > -0.45] @ matrix.T + 2.0)
    assert found.status == "ok"
    for wanted in (matrix, matrix @ np.diag([1.0, 1.0, -1.0])):
        assert min(angle_deg(m, wanted) for m in found.equivalents) < 1.0
    assert "the determinant is free" in found.observable
    assert found.determinant_confidence == 0.5


def met(sign: float, well: float, denied: float = 0.0) -> Met:
    """A map of a determinant, well met by so much of both sides; the target denies it by so much."""
    sides = (Merit(well=well, less=0.05, nothing=0.0), Merit(well=well - denied, less=0.05, nothing=denied))
    motion = Similarity(matrix=np.diag([1.0, 1.0, sign]), shift=np.zeros(3))
    return Met(motion=motion, covariance=np.eye(6), sides=sides, overlap=(0.8, 0.8), rms=0.0, sigma=0.02)


@pytest.mark.parametrize(("lead", "det"), [(0.0, 1), (0.02, 1), (0.1, -1)])
def test_a_rotation_comes_first_where_a_reflection_leads_by_what_chance_explains(lead: float, det: int) -> None:
    every = [met(1.0, 0.6), met(-1.0, 0.6 + 0.5 * lead), met(-1.0, 0.5)]
    for maps in (every, every[::-1]):
        assert _first(maps).determinant == det


@pytest.mark.parametrize(("lead", "sure"), [(-0.1, True), (0.03, True), (0.17, False), (0.4, False)])
def test_a_map_of_the_hand_that_is_not_admitted_tells_against_others_where_it_does_better(
    lead: float, sure: bool
) -> None:
    """The mirror image of a desk lay on it as a turn at .97, where nobody asked for the reflection that fits."""
    told = _weighed(met(1.0, 0.6), [met(-1.0, 0.6 + lead)], -1.0, reflections=False, open_=False)
    assert told.confidence > 0.9 if sure else told.confidence < 0.2
    assert told.equals == ()
    assert ("a reflection lays the objects on one another better" in told.status) == (0.1 < lead < 0.2)


@pytest.mark.parametrize(("denied", "equals"), [(0.0, 1), (0.01, 1), (0.2, 0)])
def test_a_map_that_one_side_denies_is_no_equal_of_one_that_both_take(denied: float, equals: int) -> None:
    """As well by the source alone, but a quarter of the target met nothing."""
    told = _weighed(met(1.0, 0.6), [met(1.0, 0.6, denied)], -1.0, reflections=True, open_=False)
    assert len(told.equals) == equals
    assert told.confidence > 0.9


@pytest.mark.parametrize(("name", "seed"), [("propeller5", 0), ("rotor3", 2)])
def test_turns_of_a_whole_source_leave_equivalents_of_a_part(name: str, seed: int) -> None:
    mesh, truth = specimen("shape", name)
    rng = np.random.default_rng(seed)
    source, target = (sample(mesh, count, 0.0, rng) for count in (8000, 9000))
    away = target @ random_orthogonal(rng)[0]
    target = target[away > np.quantile(away, 0.3)]
    matrix = random_orthogonal(rng)
    found = align(source, target @ matrix.T + 5.0)
    assert found.status == "ok"
    for operation in truth.group.operations():
        assert min(angle_deg(m, matrix @ operation) for m in found.equivalents) < 1.0


@pytest.mark.parametrize("view_first", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_all_that_carries_a_whole_object_onto_itself_leaves_equivalents_of_a_view(view_first: bool) -> None:
    """Of 24 maps of a hexagonal prism onto its top and three of its sides the search told 16."""
    prism, rng = join([revolve([(0, -0.3), (1, -0.3), (1, 0.3), (0, 0.3)], 6)]), rng_of(71)
    points = sample(prism, 20000, 0.002, rng)
    side = (np.abs(points[:, 2]) < 0.29) & (points @ [0.5, 0.3, 0.0] > 0.2)
    matrix, shift = rotation([1.0, 2.0, 0.5], 0.8), np.array([3.0, -1.0, 0.5])
    view = points[side | (points[:, 2] > 0.29)] @ matrix.T + shift
    found = align(view, prism) if view_first else align(prism, view)
    for operation in point_group("D6h").operations():
        wanted = operation @ matrix.T if view_first else matrix @ operation
        moved = -wanted @ shift if view_first else shift
        angles = [angle_deg(m, wanted) for m in found.equivalents]
        best = int(np.argmin(angles))
        assert angles[best] < 2.0
        np.testing.assert_allclose(found.coset.translations[best], moved, atol=0.1)
    turns = align(prism, view, allow_reflection=False).equivalents
    assert (np.linalg.det(turns) > 0.0).all()


def test_what_nothing_tells_of_the_hand_is_a_half_and_no_less() -> None:
    rng = rng_of(83)
    side = side_of(Shape(points=rng.random((300, 3))), 0)
    evidence = Evidence(source=side, target=side, scale=False, tolerance=0.02, seed=0)
    still = Similarity(matrix=np.eye(3), shift=np.zeros(3))
    leads = [-0.2, 0.0, 0.25, 1.0]
    told = [
        Choice(
            evidence=evidence, motion=still, covariance=np.eye(3), exact=False, misfit=0.0, excess=0.0, lead=lead
        ).determinant_confidence
        for lead in leads
    ]
    assert told[:2] == [0.5, 0.5]
    assert 0.5 < told[2] < told[3] < 1.0


def test_of_maps_that_may_all_be_right_the_one_that_neither_side_denies_comes_first() -> None:
    # A knob that the source shows, laid where the target shows that there is nothing: but for what the source says of
    # it the map is as good as the true one. Clutter of the target denies both alike.
    def seen(clutter: float, *, denied: float) -> list[Merit]:
        return [Merit(well=0.6, less=0.1, nothing=denied), Merit(well=0.6 + denied / 5.0, less=0.05, nothing=clutter)]

    for clutter in (0.0, 0.3):
        true, wrong = seen(clutter, denied=0.0), seen(clutter, denied=0.02)
        assert as_well(score(true), score(wrong))
        assert as_well(score(wrong), score(true))
        assert said_by_both(true) > said_by_both(wrong)
    assert score(seen(0.0, denied=0.02)) > score(seen(0.0, denied=0.0))


@pytest.mark.slow
def test_a_camera_that_saw_free_space_denies_what_borders_leave_open() -> None:
    # A long box laid on one view of a short one reaches beyond the outline that the view ends with: unseen, unless it
    # is known where the camera stood.
    rng = rng_of(82)
    short, long = (join([box((0.0, 0.0, z), (1.0, 1.6, 1.5 + 2.0 * z))]) for z in (0.0, 0.6))
    made = damage.view(short, np.array([0.7, 0.5, -0.3]), rng)
    eye = np.broadcast_to(made.viewpoint, made.points.shape)
    source = side_of(Shape(points=sample(long, 10000, 0.0, rng)), 0)
    denied = []
    for view in (Shape(points=made.points), Shape(points=made.points, viewpoint=eye)):
        target = side_of(view, 0)
        shown = [Shown.of(side, 1.0, 0) for side in (source, target)]
        judge = Judge(source=shown[0], target=shown[1], diagonal=short.diagonal, tolerance=0.02)
        motion = Similarity(matrix=np.eye(3), shift=source.moments.center - target.moments.center)
        denied.append(judge.side(shown[0], shown[1], motion)[0].nothing)
    assert denied[0] < 0.02
    assert denied[1] > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_no_map_scores_more_than_a_look_says_is_within_reach(seed: int) -> None:
    # Of two parts of one object, the true map and others at random.
    rng = rng_of(86, seed)
    points = [sample(asymmetric(), 8000, 0.0, rng) for _ in range(2)]
    parts = points[0][points[0][:, 0] > -0.2], points[1][points[1][:, 0] < 0.2]
    source, target = (side_of(Shape(points=p), 0) for p in parts)
    shown = [Shown.of(side, 1.0, 0) for side in (source, target)]
    judge = Judge(source=shown[0], target=shown[1], diagonal=asymmetric().diagonal, tolerance=0.02)
    true = Similarity(matrix=np.eye(3), shift=source.moments.center - target.moments.center)
    for motion in [true, *(Similarity(matrix=random_orthogonal(rng), shift=np.zeros(3)) for _ in range(8))]:
        said = [judge.side(*way)[0] for way in ((*shown, motion), (*shown[::-1], motion.inverse))]
        assert score(said) <= judge.within_reach(motion)
    assert judge.within_reach(true) < 1.0


def test_what_is_known_of_a_cleaned_side_is_what_a_look_at_it_says() -> None:
    rng = rng_of(87)
    points = sample(asymmetric(), 9000, 0.0, rng)
    behind = (points[:, 0].max() - points[:, 0]) / np.ptp(points[:, 0])
    points = points[rng.random(len(points)) < 10.0**-behind]
    dirty = np.concatenate([points, 6.0 * (rng.random((40, 3)) - 0.5)])
    side = side_of(Shape(points=dirty), 0).cleaned()
    assert side.known is not None
    seen = side.sampling
    assert len(dirty) > len(side.shape.points) == len(seen.kept)
    assert not len(seen.strays)
    assert seen.shares is not None
    assert len(seen.shares) == len(seen.even) < len(seen.kept)
    # Where the points are sparse each of those that are even stands for itself; where they are dense, a few do for all.
    even, every = side.shape.points[seen.even, 0], side.shape.points[:, 0]
    true = sample(asymmetric(), 9000, 0.0, rng)[:, 0].mean()
    assert even.mean() < every.mean()
    assert abs(np.average(even, weights=seen.shares) - true) < 0.5 * abs(every.mean() - true)


PLACED = pytest.param(55, marks=pytest.mark.xfail(reason="of 24 seeds this one finds a place", strict=False))


@pytest.mark.parametrize("seed", [PLACED, 56, 57, 58])
def test_a_flat_part_in_common_says_that_it_slides_or_is_chance(seed: int) -> None:
    # All that a square plate and a round one share is a piece of a plane.
    rng = rng_of(seed)
    square, disc = (np.column_stack([rng.uniform(-1, 1, (9000, 2)), np.zeros(9000)]) for _ in range(2))
    disc = 1.2 * disc[np.linalg.norm(disc, axis=1) < 1.0]
    first, second = (
        np.concatenate([plate, sample(join([box(at, (0.5, 0.3, size))]), 2500, 0.0, rng)])
        for plate, at, size in ((square, (0.7, 0.6, 0.4), 0.8), (disc, (-0.6, 0.3, -0.3), 0.6))
    )
    found = align(first, second @ random_orthogonal(rng).T)
    assert found.status != "ok"
    assert found.confidence == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [21, 22, 24])
@pytest.mark.parametrize("det", DETERMINANTS)
def test_parts_end_where_no_slide_does_better(det: int, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Half of an object: a polish may end on a ridge, from where the map goes on along it.
    told = []
    as_slid = Judge.uphill
    monkeypatch.setattr(Judge, "uphill", lambda self, met: told.append((met, *as_slid(self, met))) or told[-1][1:])
    pair = partial_alignment.given(
        partial_alignment.Case(name="asymmetric", condition="overlap 50 %", det=det, seed=seed)
    )
    found = align(*pair[:2])
    ((first, best, most),) = told
    assert best.score >= first.score
    assert most <= best.score or found.status != "ok"
    assert angle_deg(found.matrix, pair[2].matrix) < 5.0 or found.status != "ok"


def test_a_map_that_slides_aside_to_a_better_one_is_right() -> None:
    row = partial_alignment.run(partial_alignment.Case(name="asymmetric", condition="overlap 50 %", det=1, seed=22))
    assert row.right
    assert row.status == "ok"


def test_the_same_points_miss_by_nothing_and_the_same_surface_by_little() -> None:
    rng, body = rng_of(60), asymmetric()
    points = sample(body, 4000, 0.002, rng)
    matrix, other = random_orthogonal(rng, det=-1), Shape(points=rng.permutation(points))
    for shape, mate in ((Shape(points=points), other), (body, body)):
        found = align(shape, turned(mate, matrix, np.ones(3)))
        assert found.exact
        assert found.rms < 1e-12
        assert found.overlap == (1.0, 1.0)
    corners = body.points[body.faces]
    middle = corners.mean(axis=1, keepdims=True)
    fans = np.stack([np.stack([corners[:, i], corners[:, (i + 1) % 3], middle[:, 0]], axis=1) for i in range(3)])
    finer = Shape(points=fans.reshape(-1, 3), faces=np.arange(fans.size // 3).reshape(-1, 3))
    for source, target in ((body, finer), (finer, body)):
        found = align(source, turned(target, matrix, np.ones(3)))
        assert found.exact
        assert found.rms < 0.005
        assert min(found.overlap) > 0.97


@pytest.mark.parametrize("factor", [1.05, 0.92])
@pytest.mark.parametrize("is_mesh", [False, True])
def test_a_copy_of_another_size_is_not_sure_to_agree(factor: float, is_mesh: bool) -> None:
    # At one size their moments agree to rounding, and 1.2 times as large may be a matter of sampling.
    rng = rng_of(59)
    body = asymmetric() if is_mesh else Shape(points=sample(asymmetric(), 4000, 0.0, rng))
    found = align(body, turned(body, random_orthogonal(rng), np.ones(3), factor))
    assert not found.exact
    assert found.confidence < 0.5
    assert align(body, turned(body, random_orthogonal(rng), np.ones(3), factor), scale=True).confidence == 1.0


@pytest.mark.parametrize(("noise", "bump"), [(0.0, 0.0), (0.003, 0.0), (0.01, 0.0), (0.0, 0.05), (0.002, 0.1)])
@pytest.mark.parametrize("det", DETERMINANTS)
def test_what_the_polish_met_says_about_the_most_that_the_judge_tells(det: int, noise: float, bump: float) -> None:
    # No noise is forgiven there, so that what is sure by it is sure; a detail of one side is smoothed a little.
    rng = rng_of(57, det + 1)
    source, target = (sample(asymmetric(), 6000, noise, rng) for _ in range(2))
    top = source[:, 2] > np.quantile(source[:, 2], 0.97)
    source[top, 2] += bump * asymmetric().diagonal
    sides = side_of(Shape(points=source), 16), side_of(Shape(points=target @ random_orthogonal(rng, det=det)), 16)
    evidence = Evidence(source=sides[0], target=sides[1], scale=False, tolerance=0.01, seed=0)
    choice = choose(evidence)
    done = polished(evidence, evidence.met, choice.motion, choice.covariance)
    most = evidence.excess_without_noise(done, 0.0)
    assert most >= 0.85 * evidence.excess(done.motion)
    assert evidence.excess_without_noise(done, 1e9) >= most  # told of sizes that are too small, as that is enough
    assert evidence.excess_without_noise(replace(done, converged=False), 0.0) == np.inf


def test_clean_objects_agree_without_a_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = rng_of(58)
    source, target = (sample(asymmetric(), 6000, 0.0, rng) for _ in range(2))
    monkeypatch.setattr(Evidence, "excess", lambda *_: pytest.fail("it is sure without"))
    found = align(source, target)
    assert found.status == "ok"
    assert found.confidence > 0.99


@pytest.mark.parametrize("det", DETERMINANTS)
def test_the_covariance_is_that_of_the_errors(det: int) -> None:
    # Whitened errors of rotation vector and translation, 6 numbers each: their mean square is 1 but for what is shared
    # by neighbouring planes.
    squares = []
    for seed in range(6):
        rng = rng_of(56, seed, det + 1)
        matrix, shift = random_orthogonal(rng, det=det), rng.uniform(-2, 2, 3)
        source, target = (sample(asymmetric(), 5000, 0.005, rng) for _ in range(2))
        found = align(source, target @ matrix.T + shift)
        turn = found.matrix @ matrix.T
        w = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        error = np.concatenate([w, found.translation - shift])
        squares.append(error @ np.linalg.solve(found.covariance, error) / 6.0)
    assert 0.1 < np.mean(squares) < 4.0


@pytest.mark.parametrize("det", DETERMINANTS)
def test_handedness_is_told_by_two_lines(det: int) -> None:
    # Whatever the signs of the normals: a true map keeps all invariants, with the handedness times its determinant.
    rng = rng_of(57)
    points, normals, matrix = rng.normal(size=(20, 3)), unit(rng.normal(size=(20, 3))), random_orthogonal(rng, det=det)
    signs = rng.choice([-1.0, 1.0], (20, 1))
    here, there = pair_invariants(points, normals), pair_invariants(points @ matrix.T + 3.0, signs * normals @ matrix.T)
    for a, b in zip(here[:-1], there[:-1], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-4)  # single precision
    np.testing.assert_allclose(here[-1], det * there[-1], atol=1e-4)
    assert np.abs(here[-1]).max() > 0.1


def planes(points: Array, normals: Array) -> Planes:
    none = np.zeros(len(points))
    return Planes(points=points, normals=normals, thickness=none, flatness=none)


@pytest.mark.parametrize("det", DETERMINANTS)
def test_consensus_finds_a_fifth_of_true_matches(det: int) -> None:
    rng = rng_of(58)
    points, normals = rng.normal(size=(200, 3)), unit(rng.normal(size=(200, 3)))
    matrix = random_orthogonal(rng, det=det)
    target, there = points @ matrix.T + 1.0, normals @ matrix.T
    target[40:], there[40:] = rng.normal(size=(160, 3)), unit(rng.normal(size=(160, 3)))
    best = consensus(planes(points, normals), planes(target, there), 0.05)[0]
    np.testing.assert_allclose(best.matrix, matrix, atol=1e-9)
    np.testing.assert_allclose(best.shift, 1.0, atol=1e-9)
    assert best.support >= 40


@pytest.mark.parametrize("count", [0, 1, 2])
def test_consensus_of_too_few_matches_is_none(count: int) -> None:
    points, normals = np.eye(3)[:count], np.eye(3)[:count]
    assert consensus(planes(points, normals), planes(points, normals), 0.1) == []


def test_each_map_is_told_once_with_all_matches_that_agree_with_it() -> None:
    # Half of the matches are of a rotation, a third of a reflection, the others of nothing.
    rng = rng_of(91)
    points, normals = rng.standard_normal((90, 3)), unit(rng.standard_normal((90, 3)))
    target, there = rng.standard_normal((90, 3)), unit(rng.standard_normal((90, 3)))
    true = [(slice(0, 45), random_orthogonal(rng, det=1)), (slice(45, 75), random_orthogonal(rng, det=-1))]
    for some, matrix in true:
        target[some], there[some] = points[some] @ matrix.T + 0.3, normals[some] @ matrix.T
    within = 0.1
    found = consensus(planes(points, normals), planes(target, there), within)
    for map_, (some, matrix) in zip(found[:2], true, strict=True):
        np.testing.assert_allclose(map_.matrix, matrix, atol=1e-9)
        assert map_.support == some.stop - some.start
    for map_ in found:
        near = np.linalg.norm(points @ map_.matrix.T + map_.shift - target, axis=1) < within
        facing = np.abs(np.einsum("ij,ij->i", normals @ map_.matrix.T, there)) > 0.7
        assert map_.support == (near & facing).sum()
    maps = [np.append(p.matrix.ravel(), p.shift) for p in found]
    assert all(np.linalg.norm(a - b) > within for i, a in enumerate(maps) for b in maps[:i])


def test_signatures_do_not_know_pose_hand_or_signs() -> None:
    rng = rng_of(59)
    cloud = make_skin(sample(asymmetric(), 4000, 0.0, rng), rng).local_planes(np.arange(0, 4000, 8))
    matrix, signs = random_orthogonal(rng, det=-1), rng.choice([-1.0, 1.0], (500, 1))
    points = cloud.points @ matrix.T + 2.0
    turned_ = replace(cloud, points=points, normals=signs * cloud.normals @ matrix.T, tree=Tree(points))
    np.testing.assert_allclose(signatures(turned_, 0.3), signatures(cloud, 0.3), atol=1e-6)


@pytest.mark.parametrize("every", [2, 5])
def test_signatures_count_the_neighbours_that_they_are_told_to(every: int) -> None:
    # Each looks as it does in a cloud of itself and those that count, where all neighbours do.
    rng = rng_of(61)
    cloud = make_skin(sample(asymmetric(), 2000, 0.0, rng), rng).local_planes(np.arange(0, 2000, 8))
    looks, some = signatures(cloud, 0.5, every), np.arange(0, len(cloud.points), every)
    for i in range(0, len(cloud.points), 17):
        own = np.union1d(some, [i])
        alone = signatures(cloud.chosen(own), 0.5)
        np.testing.assert_allclose(looks[i], alone[own.searchsorted(i)], atol=1e-12)


@pytest.mark.parametrize("times", [1, 2, 8])
@pytest.mark.parametrize("count", [400, 3000])
def test_points_that_are_rounded_or_repeated_are_places_all_the_same(count, times):
    """Coarse digits put several points in one place, where the nearest other one is no distance away."""
    rng = np.random.default_rng(count)
    points = np.repeat(sample(specimen("shape", "fan3")[0], count // times, 0.0, rng).round(1), times, axis=0)
    for part, other in ((points, points), (points[: 2 * len(points) // 3], points[len(points) // 3 :])):
        found = align(part, other @ np.diag([1.0, 1.0, -1.0]))
        assert np.isfinite(found.matrix).all()
        assert np.isfinite(found.rms)
        assert 0.0 <= found.confidence <= 1.0
