"""The judge: distances to discs, the floor of an exact symmetry, true elements against false ones that nearly fit."""

import numpy as np
import pytest

from experiments.objects.shapes import bottle, box, join, mug, sample, stool, table
from symrefine.geometry import Isometry, Plane, householder, random_orthogonal, rotation, tight_diagonal
from symrefine.moments.moments import shape_moments
from symrefine.moments.quadrature import sample_surface
from symrefine.surface.misses import (
    LIMITS,
    TOLERANCE,
    Deviation,
    confidence,
    disc_distances,
    make_judge,
    miss_distances,
    split_floor,
    spread_distance,
)
from symrefine.surface.skin import isolated_points, local_planes

Z = np.array([0.0, 0, 1])


def judge_of(shape, noise=0.0, *, count=8000, planes=3000, tolerance=TOLERANCE, seed=0):
    """A judge of a sample about the shape's true centroid, turned by nothing."""
    rng = np.random.default_rng(seed)
    moments = shape_moments(shape, 2)
    points = (sample(shape, count, noise, rng) - moments.center) / moments.scale
    cloud = local_planes(points, planes, rng)
    return make_judge(cloud, tight_diagonal(cloud.points), tolerance)


def sheet(count=900, seed=1):
    """A flat square grid in z = 0 with exact normals, spacing 1/15."""
    side = int(np.sqrt(count))
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(side * side)])
    normals = np.broadcast_to(Z, points.shape)
    return local_planes(points, len(points), np.random.default_rng(seed), normals=normals, exact=True)


def about(matrix):
    return Isometry.about(np.zeros(3), matrix)


def mirror(angle):
    """Reflection across the plane through the z axis at an angle from the x axis."""
    return about(householder([-np.sin(angle), np.cos(angle), 0]))


# Distances


@pytest.mark.parametrize("height", [0.0, 1e-7, 0.01, -0.03])
def test_above_a_flat_surface_the_distance_is_the_height(height):
    rng = np.random.default_rng(2)
    queries = np.column_stack([rng.uniform(-0.9, 0.9, (200, 2)), np.full(200, height)])
    np.testing.assert_allclose(disc_distances(sheet(), queries), abs(height), atol=1e-12)


def test_beside_a_surface_the_distance_grows_to_that_of_its_nearest_point():
    cloud = sheet()
    beside = np.array([[1.0 + d, 0.0, 0.0] for d in (0.0, 0.2, 0.5, 2.0)])
    found = disc_distances(cloud, beside)
    nearest = np.linalg.norm(beside[:, None] - cloud.points, axis=2).min(axis=1)
    assert np.all(np.diff(found) > 0)
    np.testing.assert_allclose(found[2:], nearest[2:], rtol=1e-9)
    assert np.all(found <= nearest + 1e-12)


def test_distances_never_exceed_that_of_the_nearest_centre():
    judge, rng = judge_of(mug()), np.random.default_rng(3)
    queries = rng.uniform(-2, 2, (500, 3))
    nearest = judge.cloud.tree.query(queries)[0]
    found = disc_distances(judge.cloud, queries)
    assert found.min() >= 0
    assert np.all(found <= nearest + 1e-9)


def test_a_point_is_not_compared_with_its_own_disc():
    cloud = sheet()
    lifted = cloud.points.copy()
    lifted[450, 2] = 0.3
    bumpy = local_planes(lifted, len(lifted), np.random.default_rng(4), normals=cloud.normals, exact=True)
    with_self, without = (disc_distances(bumpy, bumpy.points, skip_self=s)[450] for s in (False, True))
    assert with_self == pytest.approx(0.0, abs=1e-12)
    assert without == pytest.approx(0.3, rel=0.05)


@pytest.mark.parametrize("det", [1, -1])
def test_distances_do_not_depend_on_the_pose(det):
    rng = np.random.default_rng(5)
    points, normals, _ = sample_surface(mug(), 1500, rng)
    matrix, queries = random_orthogonal(rng, 3, det), points + 0.02 * rng.standard_normal(points.shape)
    clouds = [
        local_planes(points @ r.T, 1500, np.random.default_rng(0), normals=normals @ r.T, exact=True)
        for r in (np.eye(3), matrix)
    ]
    once, turned = (disc_distances(c, queries @ r.T) for c, r in zip(clouds, (np.eye(3), matrix), strict=True))
    np.testing.assert_allclose(turned, once, atol=1e-9)


def test_stride_takes_every_so_manieth_point():
    judge = judge_of(table())
    every, third = (miss_distances(judge.cloud, mirror(0.2), stride=s) for s in (1, 3))
    np.testing.assert_array_equal(third, every[::3])


# Deviations


def test_an_exact_symmetry_misses_by_nothing():
    rng = np.random.default_rng(6)
    half, normals, _ = sample_surface(mug(), 1500, rng)
    flip = np.array([1.0, -1, 1])
    points, normals = np.concatenate([half, half * flip]), np.concatenate([normals, normals * flip])
    cloud = local_planes(points, 3000, rng, normals=normals, exact=True)
    judge = make_judge(cloud, tight_diagonal(points), TOLERANCE)
    verdict = judge([mirror(0.0)])
    assert verdict.deviation.max < 1e-9
    assert verdict.excess < 1e-6
    wrong = judge([mirror(np.pi / 3)])
    assert wrong.deviation.p994 > 0.02


def test_statistics_are_ordered_and_fractions_of_the_diagonal():
    judge = judge_of(table())
    found = judge([mirror(0.1)]).deviation
    assert 0 < found.mean < found.p95 <= found.p97 <= found.p99 <= found.p994 <= found.max < 1
    distances = miss_distances(judge.cloud, mirror(0.1)) / judge.diagonal
    assert found.mean == pytest.approx(distances.mean())
    assert found.max == pytest.approx(distances.max())
    for name, level in (("p80", 0.8), ("p95", 0.95), ("p97", 0.97), ("p99", 0.99), ("p994", 0.994)):
        assert getattr(found, name) == pytest.approx(np.quantile(distances, level))


def test_several_operations_are_as_bad_as_the_worst_of_them():
    judge = judge_of(table())
    good, bad = mirror(0.0), mirror(0.3)
    alone, together = judge([bad]), judge(iter([good, bad, good]))
    assert together == alone
    assert judge([good]).excess < 0.5 * alone.excess


def test_a_larger_tolerance_forgives_in_proportion():
    strict, loose = (judge_of(table(), tolerance=t)([mirror(0.1)]) for t in (0.01, 0.02))
    assert strict.deviation == loose.deviation
    # Exactly twice but for the floor and the rule for rough objects, both of which only forgive.
    assert loose.excess < strict.excess <= 2 * loose.excess * (1 + 1e-9)
    assert strict.bulk <= strict.excess


def test_what_the_cloud_shows_against_itself_raises_the_limits():
    miss = Deviation(mean=0.01, p80=0.01, p95=0.02, p97=0.02, p99=0.03, p994=0.03, max=0.05)
    nothing = Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
    own = Deviation(mean=0.005, p80=0.01, p95=0.01, p97=0.015, p99=0.02, p994=0.02, max=0.03)
    without, raised = miss.over_limits(0.02, nothing), miss.over_limits(0.02, own)
    assert len(without) == len(raised)
    assert all(b < a for a, b in zip(without, raised, strict=True))
    assert all(r == 0 for r in nothing.over_limits(0.02, own))


def test_noise_and_miss_add_up_in_squares():
    """A miss m under noise s shows as the root of m^2 + s^2; what is over the limits is m alone."""
    names, rng = ("mean", "p80", "p95", "p97", "p99", "p994", "max"), np.random.default_rng(8)
    miss, noise = rng.uniform(0.001, 0.05, (2, 7))
    shown = Deviation(**dict(zip(names, np.hypot(miss, noise), strict=True)))
    floor = Deviation(**dict(zip(names, noise, strict=True)))
    expected = miss[[0, 2, 3, 4, 5]] / (0.02 * np.array(LIMITS))
    np.testing.assert_allclose(shown.over_limits(0.02, floor), expected, rtol=1e-9)


def lifted(share, height):
    """A judge of an exact sheet of which a share stands higher, by a fraction of the diagonal, and the shift up."""
    flat = sheet(10000)
    raised = flat.points.copy()
    diagonal = tight_diagonal(raised)
    some = np.random.default_rng(9).permutation(len(raised))[: round(share * len(raised))]
    raised[some, 2] += height * diagonal
    cloud = local_planes(raised, len(raised), np.random.default_rng(0), normals=flat.normals, exact=True)
    nothing = Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
    return make_judge(cloud, diagonal, TOLERANCE, nothing)


@pytest.mark.parametrize(
    ("share", "bulk", "detail", "excess"),
    [(0.08, True, True, True), (0.04, False, True, True), (0.02, False, True, True), (0.008, False, False, True)]
    + [(0.003, False, False, False)],
)
def test_what_stands_out_shows_in_bulk_detail_or_specks_by_its_share(share, bulk, detail, excess):
    """Isolated points of a sheet that the mirror of the sheet turns to its other side, 4.5 % of the diagonal away."""
    judge = lifted(share, 0.045)
    found = judge([about(householder(Z))])
    assert (found.bulk > 1.0, found.detail > 1.0, found.excess > 1.0) == (bulk, detail, excess)
    assert found.bulk <= found.detail <= found.excess
    assert found.core < 0.01


@pytest.mark.parametrize(("limit", "share"), [(1, 0.08), (2, 0.04), (3, 0.02), (4, 0.008)])
def test_every_limit_decides_alone_about_what_it_is_there_for(limit, share):
    """A share between two percentiles that misses by a little more, or less, than the limit of the upper one."""
    flat = about(householder(Z))
    below, above = (lifted(share, factor * LIMITS[limit] * TOLERANCE)([flat]).excess for factor in (0.95, 1.05))
    assert (below, above) == pytest.approx((0.95, 1.05), rel=1e-2)


@pytest.mark.parametrize("shift", [0.002, 0.006])
def test_where_all_miss_alike_the_mean_decides(shift):
    judge = lifted(0.0, 0.0)
    up = Isometry(matrix=np.eye(3), shift=shift * judge.diagonal * Z)
    found = judge([up])
    assert found.excess == found.bulk == pytest.approx(shift / (LIMITS[0] * TOLERANCE), rel=1e-6)
    assert found.core == pytest.approx(shift / TOLERANCE, rel=1e-6)


def test_the_core_is_beyond_what_the_cloud_shows_against_itself():
    judge = judge_of(table(), 0.01)
    motions = [mirror(0.0)]
    found = judge(motions)
    own = make_judge(judge.cloud, judge.diagonal, TOLERANCE, found.deviation)(motions)
    assert own.core == own.excess == 0.0
    none = make_judge(
        judge.cloud, judge.diagonal, TOLERANCE, Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
    )
    assert none(motions).core == pytest.approx(found.deviation.p80 / TOLERANCE)
    assert 0.0 < found.core < none(motions).core


def test_a_noisy_cloud_misses_itself_and_an_exact_sheet_does_not():
    assert make_judge(sheet(), 3.0, TOLERANCE).floor.max < 1e-12
    quiet, noisy = (judge_of(table(), noise).floor for noise in (0.0, 0.02))
    assert noisy.p95 > 2 * quiet.p95 > 0


@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_halves_of_a_sparse_cloud_say_what_another_sample_would(noise):
    """Another sample as dense as the whole misses it by about what the halves promise."""
    rng = np.random.default_rng(10)
    points, another = (p / np.linalg.norm(p, axis=1, keepdims=True) for p in rng.standard_normal((2, 1600, 3)))
    points, another = (p + noise * rng.standard_normal(p.shape) for p in (points, another))
    halves = [local_planes(p, len(p), rng) for p in (points[::2], points[1::2])]
    whole, other = (local_planes(p, len(p), rng) for p in (points, another))
    promised = split_floor(halves[0], halves[1], 3.0)
    found = disc_distances(whole, other.points) / 3.0
    # Both are estimates: neighbouring planes of one sample share their points, those of two samples do not.
    assert 0.6 < promised.mean / found.mean() < 1.6
    assert 0.6 < promised.p95 / np.quantile(found, 0.95) < 1.6
    swapped = split_floor(halves[1], halves[0], 3.0)
    assert (promised.mean, promised.p99) == pytest.approx((swapped.mean, swapped.p99))


def test_the_spread_of_a_body_tells_turns_that_its_outline_does_not():
    """Covariances with common axes: the distance of the roots, sqrt(2) |a - b| for a quarter turn."""
    rng = np.random.default_rng(11)
    points = rng.standard_normal((4000, 3))
    points -= points.mean(axis=0)
    points = points @ np.linalg.inv(np.linalg.cholesky(np.cov(points.T))).T * [1.0, 0.6, 0.3]
    turn = random_orthogonal(rng)
    for r in (np.eye(3), turn):
        quarter, half = (about(r @ rotation(Z, a) @ r.T) for a in (np.pi / 2, np.pi))
        assert spread_distance(points @ r.T, quarter) == pytest.approx(np.sqrt(2) * 0.4, rel=1e-9)
        assert spread_distance(points @ r.T, half) < 1e-6


def test_of_a_volume_the_spread_counts():
    rng = np.random.default_rng(12)
    points = rng.standard_normal((6000, 3)) * [1.0, 0.8, 0.8]
    cloud = isolated_points(points, body="volume")
    judge = make_judge(cloud, tight_diagonal(points), TOLERANCE)
    verdict = judge([about(rotation(Z, np.pi / 2))])
    expected = np.sqrt(2) * 0.2 / judge.diagonal / (LIMITS[0] * TOLERANCE)
    assert verdict.excess == pytest.approx(expected, rel=0.15)
    assert verdict.bulk == verdict.excess > 2 * judge([about(rotation(Z, np.pi))]).bulk


def test_only_the_discs_of_its_own_class_count():
    """Two sheets of two classes, a query between: the distance to its own, however near the other is."""
    flat = sheet()
    points = np.concatenate([flat.points, flat.points + [0, 0, 0.5]])
    labels, normals = np.repeat([0, 1], len(flat.points)), np.tile(Z, (2 * len(flat.points), 1))
    cloud = local_planes(points, len(points), np.random.default_rng(0), normals=normals, labels=labels, exact=True)
    queries = np.array([[0.1, 0.2, 0.1]] * 2)
    np.testing.assert_allclose(disc_distances(cloud, queries, np.array([0, 1])), [0.1, 0.4], atol=1e-9)


def test_the_only_point_of_its_class_has_nothing_to_miss():
    flat = sheet()
    points, labels = flat.points.copy(), np.zeros(len(flat.points), dtype=int)
    points[17, 2], labels[17] = 1.0, 1
    cloud = local_planes(points, len(points), np.random.default_rng(0), normals=flat.normals, labels=labels, exact=True)
    found = disc_distances(cloud, points, labels, skip_self=True)
    assert found[17] == 0.0
    assert np.isfinite(found).all()
    assert make_judge(cloud, 3.0, TOLERANCE).floor.max < 1e-9


def test_confidence_falls_with_the_miss():
    excess = np.linspace(0, 5, 50)
    found = [confidence(e) for e in excess]
    assert confidence(0.62) == pytest.approx(0.5)
    assert confidence(0.43) == pytest.approx(0.95, abs=0.01)
    assert confidence(1.0) < 0.05
    assert found[0] == 1.0
    assert np.all(np.diff(found) < 0)
    assert found[-1] > 0


# True and false elements

TRUE = {
    "table": (table(), [mirror(k * np.pi / 4) for k in range(4)] + [about(rotation(Z, np.pi / 2))]),
    "stool": (stool(5), [mirror(k * np.pi / 5) for k in range(5)] + [about(rotation(Z, 2 * np.pi / 5))]),
    "mug": (mug(), [mirror(0.0)]),
    "bottle": (bottle(), [mirror(0.7), about(rotation(Z, 1.0))]),
    "box": (
        join([box((0, 0, 0), (1, 0.7, 0.4))]),
        [about(np.diag(s)) for s in ([-1, 1, 1], [1, -1, -1], [-1, -1, -1])],
    ),
}
FALSE = {
    "table": (table(), [mirror(np.pi / 8), about(rotation(Z, np.pi / 3)), about(householder(Z))]),
    "stool": (stool(5), [mirror(np.pi / 10), about(rotation(Z, np.pi / 5)), about(rotation(Z, np.pi / 2))]),
    # All of them leave the body, nine tenths of the mug, as it is.
    "mug": (mug(), [mirror(np.radians(a)) for a in (20, 45, 90, 135, 160)] + [about(rotation(Z, 1.0))]),
    "bottle": (bottle(), [about(householder(Z)), about(rotation([1, 0, 0], np.pi))]),
    "box": (join([box((0, 0, 0), (1, 0.7, 0.4))]), [mirror(np.pi / 4), about(rotation(Z, np.pi / 2))]),
}


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", TRUE)
def test_true_elements_hold(name, noise):
    shape, motions = TRUE[name]
    judge = judge_of(shape, noise)
    for motion in motions:
        assert judge([motion]).excess < 0.9
    assert judge(motions).excess < 0.9


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", FALSE)
def test_false_elements_do_not(name, noise):
    shape, motions = FALSE[name]
    judge = judge_of(shape, noise)
    for motion in motions:
        assert judge([motion]).excess > 1.2


def test_the_miss_of_a_wrong_plane_grows_with_its_angle():
    judge = judge_of(mug())
    excesses = [judge([mirror(np.radians(a))]).excess for a in (0, 3, 6, 12)]
    assert excesses == sorted(excesses)
    off = [judge([Isometry.reflection(Plane(normal=[0, 1, 0], offset=d))]).excess for d in (0, 0.05, 0.1, 0.2)]
    assert off == sorted(off)


def test_one_atom_out_of_place_breaks_the_symmetry():
    rng = np.random.default_rng(7)
    half = rng.standard_normal((60, 3))
    atoms = np.concatenate([half, half * [1, -1, 1]])
    for moved, holds in ((0.0, True), (2.0, False)):
        atoms[0, 1] += moved
        judge = make_judge(isolated_points(atoms), tight_diagonal(atoms), TOLERANCE)
        assert (judge([mirror(0.0)]).excess <= 1.0) == holds
