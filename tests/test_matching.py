"""Local planes against the surfaces they stand for, and correspondences against brute force."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from experiments.objects.shapes import bottle, box, join, mug, sample, table
from symrefine.fit.matching import ROBUST, match, pair_equations
from symrefine.fit.residual import design_rows, gram
from symrefine.geometry import Isometry, Plane, random_orthogonal, rotation, unit
from symrefine.moments.quadrature import sample_surface
from symrefine.surface.neighbourhoods import (
    CELLS,
    Neighbourhoods,
    choose_neighbours,
    fills_volume,
    fit_planes,
    smallest_eigenvectors,
)
from symrefine.surface.skin import isolated_points
from symrefine.surface.tree import Tree, morton_order
from tests.surfaces import local_planes

BOX = join([box((0, 0, 0), (1, 0.7, 0.4))])


def matched(cloud, motion, *more, **options):
    """The pairs under one operation."""
    return match(cloud, [motion], *more, **options)[0]


def normalised(points):
    centred = points - points.mean(axis=0)
    return centred / np.sqrt((centred**2).sum(axis=1).mean())


def cloud_of(shape, count, noise, seed):
    return normalised(sample(shape, count, noise, np.random.default_rng(seed)))


def exact_planes(shape, count, seed):
    """Samples of a mesh with their exact normals, in normalised units."""
    rng = np.random.default_rng(seed)
    points, normals, _ = sample_surface(shape, count, rng)
    return local_planes(normalised(points), count, rng, normals=normals, exact=True)


def mirror(normal, offset=0.0):
    return Isometry.reflection(Plane(normal=np.array(normal, dtype=float), offset=offset))


# Local planes


@pytest.mark.parametrize("size", [CELLS, 4 * CELLS])
def test_planes_of_neighbourhoods_are_those_of_their_points(size):
    """Of points themselves exactly; of cells, about as many points about as near."""
    rng = np.random.default_rng(2)
    flat = rng.uniform(-1, 1, (8000, 3)) * [1.0, 1.0, 0.0]
    points = flat + 0.02 * rng.standard_normal(flat.shape)
    queries = points[np.abs(points[:, :2]).max(axis=1) < 0.7][:200]
    tree = Tree(points)
    sums = Neighbourhoods.of(points, tree, size).around(queries)
    mean, normals, values = fit_planes(sums)
    near = points[tree.query(queries, size)[1]]
    own = near.mean(axis=1)
    if size == CELLS:
        np.testing.assert_allclose(mean, own, atol=1e-12)
        expected = np.linalg.eigvalsh(np.stack([np.cov(p.T, bias=True) for p in near]))
        np.testing.assert_allclose(values, expected, atol=1e-12)
    assert sums[:, 0].mean() == pytest.approx(size, rel=0.05)
    assert np.abs(mean[:, 2]).max() < 5 * 0.02 / np.sqrt(size) + 0.02 / 4
    assert np.degrees(np.arccos(np.abs(normals[:, 2]).min())) < 15.0
    assert np.sqrt(values[:, 0]).mean() == pytest.approx(0.02, rel=0.1)
    given = fit_planes(sums, np.tile([1.0, 0.0, 0.0], (len(sums), 1)))
    np.testing.assert_allclose(given[2][:, 0], sums[:, 4] / sums[:, 0] - mean[:, 0] ** 2, atol=1e-12)


@pytest.mark.parametrize(
    "widths",
    [(0.3, 0.7, 1.0), (1e-9, 0.8, 1.0), (0.0, 1.0, 1.0), (1e-3, 1e-3, 1.0), (0.0, 0.0, 1.0), (1.0,) * 3, (0.0,) * 3],
    ids=["general", "flat", "plane", "wire", "line", "ball", "point"],
)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_smallest_eigenvectors(widths, scale):
    """Against `eigh`, in general and where values are the same; vectors that are not unique have to be some of them."""
    rng = np.random.default_rng(1)
    frames = np.stack([np.eye(3), *(random_orthogonal(rng) for _ in range(50))])
    matrices = scale**2 * np.einsum("nai,a,naj->nij", frames, np.square(widths), frames)
    values, vectors = smallest_eigenvectors(matrices)
    largest = max(float(np.square(scale * np.array(widths)).max()), 1e-300)
    np.testing.assert_allclose(values, np.clip(np.linalg.eigvalsh(matrices), 0.0, None), atol=1e-8 * largest)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-12)
    rest = np.einsum("nij,nj->ni", matrices, vectors) - values[:, :1] * vectors
    assert np.abs(rest).max() <= 1e-8 * largest
    if widths[0] < 0.9 * widths[1]:  # one value that stands alone is known to rounding
        np.testing.assert_allclose(values[:, 0], (scale * widths[0]) ** 2, atol=1e-14 * largest)
        assert np.abs(np.abs(np.einsum("ni,ni->n", vectors, frames[:, 0])) - 1.0).max() < 1e-12


def test_planes_of_a_noisy_sheet_lie_in_it():
    rng = np.random.default_rng(2)
    sigma, turn = 0.01, random_orthogonal(rng)
    flat = np.column_stack([rng.uniform(-1, 1, (6000, 2)), sigma * rng.standard_normal(6000)])
    found = local_planes(flat @ turn.T, 1500, rng)
    z = found.points @ turn[:, 2]
    inner = np.abs(found.points @ turn[:, :2]).max(axis=1) < 0.9
    # Of k neighbours' noise a plane keeps 3/k; at least 12 neighbours.
    assert z[inner].std() < 0.6 * sigma
    assert np.median(found.thickness[inner]) == pytest.approx(sigma, rel=0.2)
    assert np.degrees(np.arccos(np.abs(found.normals[inner] @ turn[:, 2]))).mean() < 6
    assert np.median(found.flatness[inner]) < 0.3


def test_normals_of_a_sphere_are_radial():
    rng = np.random.default_rng(3)
    found = local_planes(unit(rng.standard_normal((5000, 3))), 1000, rng)
    assert np.abs(np.einsum("ij,ij->i", found.normals, unit(found.points))).min() > 0.98
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-12)


def test_reach_and_spacing_are_neighbour_distances():
    points = cloud_of(table(), 2000, 0.0, 4)
    found = local_planes(points, 500, np.random.default_rng(4))
    between = np.sort(np.linalg.norm(found.points[:, None] - found.points, axis=2), axis=1)
    np.testing.assert_allclose(found.reach, between[:, 5], atol=1e-12)
    assert found.spacing == pytest.approx(np.median(between[:, 1]))
    assert len(found.points) == 500
    assert found.redundancy >= 1.0


def test_exact_points_and_normals_are_taken_as_they_are():
    rng = np.random.default_rng(5)
    points, normals, _ = sample_surface(BOX, 800, rng)
    found = local_planes(points, 800, rng, normals=normals, exact=True)
    np.testing.assert_array_equal(found.points, points)
    np.testing.assert_array_equal(found.normals, normals)
    assert found.thickness.max() == found.flatness.max() == 0.0
    assert found.redundancy == 1.0


@pytest.mark.parametrize("shape", [table(), bottle()], ids=["table", "bottle"])
def test_neighbourhoods_grow_with_the_noise(shape):
    sizes = []
    for noise in (0.0, 0.005, 0.02):
        points = cloud_of(shape, 8000, noise, 6)
        sizes.append(choose_neighbours(points, Tree(points), np.random.default_rng(6)))
    assert sizes[0] == 12
    assert sizes[1] >= 24
    assert sizes[2] >= 48


def test_neighbourhoods_do_not_depend_on_the_pose():
    points = cloud_of(table(), 8000, 0.005, 7)
    turned = points @ random_orthogonal(np.random.default_rng(7), 3, -1).T
    a, b = (choose_neighbours(p, Tree(p), np.random.default_rng(8)) for p in (points, turned))
    assert a == b


@pytest.mark.parametrize("det", [1, -1])
def test_local_planes_move_with_the_points(det):
    points, matrix = cloud_of(mug(), 3000, 0.002, 9), random_orthogonal(np.random.default_rng(9), 3, det)
    once, turned = (local_planes(p, 800, np.random.default_rng(10)) for p in (points, points @ matrix.T))
    np.testing.assert_allclose(turned.points, once.points @ matrix.T, atol=1e-9)
    np.testing.assert_allclose(turned.thickness, once.thickness, atol=1e-9)
    agreement = np.abs(np.einsum("ij,ij->i", turned.normals, once.normals @ matrix.T))
    assert np.quantile(agreement, 0.01) > 1 - 1e-9  # a blob's normal is anybody's guess


@pytest.mark.parametrize("count", range(2, 16))
def test_a_handful_of_points_may_stand_for_themselves(count):
    points = np.random.default_rng(count).standard_normal((count, 3))
    check_handful(isolated_points(points), count)


@pytest.mark.parametrize("count", [2, 3])
def test_local_planes_of_two_or_three_points_are_no_error(count):
    points = np.random.default_rng(count).standard_normal((count, 3))
    check_handful(local_planes(points, 4000, np.random.default_rng(0)), count)


@pytest.mark.parametrize("count", range(4, 16))
def test_local_planes_of_a_handful_of_points_are_no_error(count):
    points = np.random.default_rng(count).standard_normal((count, 3))
    check_handful(local_planes(points, 4000, np.random.default_rng(0)), count)


def check_handful(found, count):
    assert len(found.points) == count
    assert np.isfinite(found.points).all()
    assert np.isfinite(matched(found, mirror([0, 0, 1]), 0.1).weights).all()


# The sign of normals


@pytest.mark.parametrize("exact", [True, False])
def test_signs_of_normals_do_not_matter(exact):
    rng = np.random.default_rng(11)
    points, normals, _ = sample_surface(mug(), 3000, rng)
    points = normalised(points)
    flipped = normals * rng.choice([-1.0, 1.0], (3000, 1))
    a, b = (local_planes(points, 1000, np.random.default_rng(12), normals=n, exact=exact) for n in (normals, flipped))
    np.testing.assert_allclose(a.points, b.points, atol=1e-15)
    np.testing.assert_allclose(a.thickness, b.thickness, atol=1e-15)
    motion = mirror([0.02, 1, 0.01], 0.01)
    p, q = (matched(c, motion, 0.05) for c in (a, b))
    np.testing.assert_array_equal(p.sources, q.sources)
    np.testing.assert_array_equal(p.targets, q.targets)
    np.testing.assert_allclose(p.weights, q.weights, atol=1e-14)
    first, second = (
        gram(design_rows(c.points[m.sources], c.points[m.targets], c.normals[m.targets]), m.weights)
        for c, m in ((a, p), (b, q))
    )
    np.testing.assert_allclose(first, second, atol=1e-10)


# Correspondences


def brute_force(cloud, motion, uncertainty):
    """Pairs by the rules of the docstring, one point at a time."""
    found = []
    for i, (x, n) in enumerate(zip(cloud.points, cloud.normals, strict=True)):
        image = motion.apply(x[None])[0]
        distances = np.linalg.norm(cloud.points - image, axis=1)
        j = int(distances.argmin())
        near = distances[j] < 3 * (cloud.spacing + uncertainty)
        moves = np.linalg.norm(image - x) > cloud.spacing
        if near and moves and abs(motion.turn(n[None])[0] @ cloud.normals[j]) > np.sqrt(0.5):
            found.append((i, j))
    return found


@pytest.mark.parametrize(
    "motion", [mirror([0, 1, 0.05], 0.02), mirror([1, 1, 0]), mirror([1, 0, 0], 0.9)], ids=["true", "wrong", "far"]
)
def test_pairs_are_those_of_brute_force(motion):
    cloud = local_planes(cloud_of(mug(), 3000, 0.003, 13), 500, np.random.default_rng(13))
    for uncertainty in (0.0, 0.1):
        pairs = matched(cloud, motion, uncertainty)
        assert list(zip(pairs.sources.tolist(), pairs.targets.tolist(), strict=True)) == brute_force(
            cloud, motion, uncertainty
        )


def test_points_that_hardly_move_are_left_out():
    cloud = exact_planes(BOX, 1500, 14)
    assert matched(cloud, mirror([0, 0, 1]), 0.1).sources.size > 1000
    assert matched(cloud, Isometry.about(np.zeros(3), np.eye(3)), 0.1).sources.size == 0
    pairs = matched(cloud, mirror([0, 0, 1]), 0.0)
    assert np.abs(2 * cloud.points[pairs.sources, 2]).min() > cloud.spacing
    assert (
        np.mean(pairs.sources == pairs.targets) < 0.02
    )  # a few in sparse spots move further and still meet none nearer


def test_pairs_too_far_apart_or_with_other_normals_are_left_out():
    cloud = exact_planes(BOX, 1500, 15)
    gone = matched(cloud, mirror([0, 0, 1], 10.0), 0.1)
    assert gone.sources.size == gone.targets.size == gone.weights.size == 0
    quarter = Isometry.about(np.zeros(3), rotation([1, 0, 0], np.pi / 4))
    pairs = matched(cloud, quarter, 0.5)
    cosine = np.einsum("ij,ij->i", quarter.turn(cloud.normals[pairs.sources]), cloud.normals[pairs.targets])
    assert pairs.sources.size
    assert np.abs(cosine).min() > np.sqrt(0.5)


def test_stride_takes_every_so_manieth_source():
    cloud = exact_planes(mug(), 1200, 16)
    every, third = (matched(cloud, mirror([0, 1, 0.02]), 0.1, stride=s) for s in (1, 3))
    kept = every.sources % 3 == 0
    np.testing.assert_array_equal(third.sources, every.sources[kept])
    np.testing.assert_array_equal(third.targets, every.targets[kept])


def test_order_of_the_points_does_not_matter():
    points = cloud_of(mug(), 900, 0.002, 17)
    shuffle = np.random.default_rng(17).permutation(900)
    found = []
    for order in (np.arange(900), shuffle):
        cloud = local_planes(points[order], 900, np.random.default_rng(18))
        # The neighbourhood's size is chosen from a random few; here both choices agree.
        pairs = matched(cloud, mirror([0.1, 1, 0]), 0.05)
        ends = np.column_stack([cloud.points[pairs.sources], cloud.points[pairs.targets], pairs.weights])
        found.append(ends[np.lexsort(ends.T)])
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def test_weights_follow_the_residual_and_stay_finite_where_it_is_zero():
    # A sheet onto itself, half a turn about its normal: every residual is zero, a robust scale of its own would be too.
    rng = np.random.default_rng(19)
    flat = np.column_stack([rng.uniform(-1, 1, (800, 2)), np.zeros(800)])
    normals = np.broadcast_to([0.0, 0, 1], (800, 3))
    sheet = local_planes(flat, 800, rng, normals=normals, exact=True)
    half_turn = Isometry.about(np.zeros(3), rotation([0, 0, 1], np.pi))
    np.testing.assert_allclose(matched(sheet, half_turn, 0.0).weights, 1.0)

    lifted = flat.copy()
    lifted[:40, 2] = 0.05
    outliers = local_planes(lifted, 800, rng, normals=normals, exact=True)
    for uncertainty, light in ((0.0, True), (1.0, False)):
        pairs = matched(outliers, half_turn, uncertainty)
        error = np.abs(outliers.points[pairs.sources, 2] - outliers.points[pairs.targets, 2])
        assert pairs.weights[error == 0].min() == 1.0
        assert (pairs.weights[error > 0].max() < 0.1) == light
        assert pairs.weights.min() > 0


def test_rough_neighbourhoods_count_less():
    rng = np.random.default_rng(20)
    flat = np.column_stack([rng.uniform(-1, 1, (2000, 2)), np.zeros(2000)])
    blob = 0.15 * rng.standard_normal((400, 3)) + [0, 0, 1]
    cloud = local_planes(np.concatenate([flat, blob]), 2400, rng)
    # With so large an uncertainty no residual is too large: only the flatness of the neighbourhoods is left.
    pairs = matched(cloud, mirror([1, 0, 0]), 10.0)
    high = cloud.points[pairs.sources, 2] > 0.5
    assert pairs.weights[high].mean() < 0.7 * pairs.weights[~high].mean()
    flatness = np.exp(-(cloud.flatness[pairs.sources] ** 2) - cloud.flatness[pairs.targets] ** 2)
    np.testing.assert_allclose(pairs.weights, flatness, rtol=0.05)


# Points that stand for themselves


def test_isolated_points_pair_with_their_images_in_three_equations():
    atoms = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    cloud = isolated_points(atoms)
    motion = mirror([1, 1, 0])
    pairs = matched(cloud, motion, 0.1)
    np.testing.assert_allclose(motion.apply(atoms[pairs.sources]), atoms[pairs.targets], atol=1e-14)
    assert sorted(pairs.sources.tolist()) == [0, 1, 2, 3]  # those on the plane stay, and count
    np.testing.assert_allclose(pairs.weights, 1.0)
    uneven = replace(pairs, weights=np.arange(1.0, 5.0))
    sources, targets, directions, weights = pair_equations(cloud, uneven)
    assert len(sources) == len(targets) == len(directions) == len(weights) == 12
    np.testing.assert_array_equal(weights.reshape(4, 3), np.outer([1, 2, 3, 4], [1, 1, 1]))
    off = Isometry.about(np.array([0.1, 0.2, 0.3]), motion.matrix)
    by_equation = np.einsum("ij,ij->i", off.apply(sources) - targets, directions).reshape(4, 3)
    np.testing.assert_allclose(by_equation, off.apply(atoms[pairs.sources]) - atoms[pairs.targets], atol=1e-14)


def test_equations_of_local_planes_are_one_for_each_pair():
    cloud = exact_planes(mug(), 600, 21)
    pairs = matched(cloud, mirror([0, 1, 0]), 0.1)
    sources, targets, directions, weights = pair_equations(cloud, pairs)
    np.testing.assert_array_equal(sources, cloud.points[pairs.sources])
    np.testing.assert_array_equal(targets, cloud.points[pairs.targets])
    np.testing.assert_array_equal(directions, cloud.normals[pairs.targets])
    np.testing.assert_array_equal(weights, pairs.weights)


# What a neighbourhood says


def sheet(rng, count, sigma=0.0):
    return np.column_stack([rng.uniform(-1, 1, (count, 2)), sigma * rng.standard_normal(count)])


def test_the_smallest_neighbourhood_that_looks_like_a_plane_is_large_enough():
    """Larger ones would look flatter still, under noise of a tenth of the spacing."""
    rng = np.random.default_rng(22)
    points = sheet(rng, 6000, 0.0025)
    assert choose_neighbours(points, Tree(points), rng) == 12


def test_given_normals_say_across_what_the_thickness_is():
    rng = np.random.default_rng(23)
    points, tilt = sheet(rng, 4000), np.radians(30.0)
    normals = np.broadcast_to([np.sin(tilt), 0, np.cos(tilt)], points.shape)
    flat, tilted = (
        local_planes(points, 400, rng, normals=n) for n in (np.broadcast_to([0.0, 0, 1], points.shape), normals)
    )
    assert flat.thickness.max() < 1e-9
    # Neighbours spread alike along both sides of a sheet: across a plane tilted by t, by sin t of that.
    width = tilted.thickness / tilted.flatness
    assert np.median(tilted.thickness / width) == pytest.approx(np.sin(tilt), rel=0.2)


def test_points_are_chosen_in_proportion_to_their_weights():
    rng = np.random.default_rng(24)
    points = sheet(rng, 8000)
    weights = np.where(points[:, 0] > 0, 4.0, 1.0)
    even, uneven = (local_planes(points, 1000, rng, weights=w) for w in (None, weights))
    assert np.mean(even.points[:, 0] > 0) == pytest.approx(0.5, abs=0.06)
    assert np.mean(uneven.points[:, 0] > 0) == pytest.approx(0.8, abs=0.06)


BODIES = {
    "noisy sheet": (lambda rng: sheet(rng, 6000, 0.02), False),
    "noisy sphere": (lambda rng: unit(rng.standard_normal((6000, 3))) + 0.03 * rng.standard_normal((6000, 3)), False),
    "thick sheet": (lambda rng: sheet(rng, 6000, 0.07), False),
    "clean sphere": (lambda rng: unit(rng.standard_normal((6000, 3))), False),
    "cloud": (lambda rng: rng.standard_normal((6000, 3)), True),
    "cube": (lambda rng: rng.random((6000, 3)), True),
}


@pytest.mark.parametrize(("make", "filled"), BODIES.values(), ids=BODIES)
def test_points_of_a_volume_are_told_from_those_of_a_surface(make, filled):
    """Under noise of a spacing and more only wide neighbourhoods tell."""
    for seed in (1, 2):
        points = normalised(make(np.random.default_rng(seed)))
        assert fills_volume(points, Tree(points)) == filled


# Classes and weights


@pytest.mark.parametrize("isolated", [True, False])
def test_points_meet_points_of_their_own_class_only(isolated):
    rng = np.random.default_rng(25)
    points, labels = sheet(rng, 600), rng.integers(0, 3, 600)
    normals = np.broadcast_to([0.0, 0, 1], points.shape)
    if isolated:
        cloud = isolated_points(points, labels)
    else:
        cloud = local_planes(points, 600, rng, normals=normals, labels=labels, exact=True)
    motion = mirror([1, 0, 0])
    pairs = matched(cloud, motion, 0.1)
    assert pairs.sources.size > 500
    np.testing.assert_array_equal(cloud.labels[pairs.targets], cloud.labels[pairs.sources])
    # Each meets the nearest of its class, nearer ones of others or not.
    images = motion.apply(cloud.points[pairs.sources])
    between = np.linalg.norm(images[:, None] - cloud.points, axis=2)
    between[cloud.labels[pairs.sources][:, None] != cloud.labels] = np.inf
    np.testing.assert_array_equal(pairs.targets, between.argmin(axis=1))


def test_a_residual_at_the_scale_counts_a_quarter():
    """Geman-McClure: (s^2 / (s^2 + e^2))^2 with s = ROBUST * median |e|; the unit of the residuals does not matter."""
    half = 12.0 * np.stack(np.meshgrid([4, 5, 6, 7, 8], [0, 1, 2, 3], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    # Images one apart from their counterparts, but for two of the upper layer: at the scale, and at twice that.
    misses = np.ones(40)
    misses[[1, 3]] = ROBUST, 2.0 * ROBUST
    for size in (0.9, 1.1):
        other = half * [-1, 1, 1] + size * misses[:, None] * [0, 0, 1]
        pairs = matched(isolated_points(np.concatenate([half, other])), mirror([1, 0, 0]), 0.0)
        np.testing.assert_array_equal(pairs.targets[:40], np.arange(40) + 40)
        np.testing.assert_allclose(pairs.weights[[1, 3]], [0.25, 0.04], rtol=1e-9)
        np.testing.assert_allclose(pairs.weights[5], (1 / (1 + ROBUST**-2)) ** 2, rtol=1e-9)


def test_the_robust_scale_is_three_standard_deviations_of_gaussian_noise():
    assert ROBUST * norm.ppf(0.75) == pytest.approx(3.0, rel=0.02)


def test_cells_of_points_that_coincide_are_counted_once():
    """Of a cloud where each point stands three times, some cells are empty; no point is lost or counted twice."""
    points = np.repeat(np.random.default_rng(3).standard_normal((700, 3)), 3, axis=0)
    found = Neighbourhoods.of(points, Tree(points), 4 * CELLS)
    assert len(found.sums) == len(points) // 4
    np.testing.assert_allclose(found.sums.sum(axis=0)[:4], [len(points), *points.sum(axis=0)], atol=1e-9)
    assert (found.sums[:, 0] == 0).any()


# Nearest neighbours


@pytest.mark.parametrize("dim", [1, 3, 4])
@pytest.mark.parametrize("count", [3, 400])
def test_neighbours_are_those_of_brute_force(dim, count):
    rng = np.random.default_rng(5)
    points, queries = rng.standard_normal((count, dim)), rng.standard_normal((60, dim))
    away = np.sort(np.linalg.norm(queries[:, None] - points, axis=2), axis=1)
    distance, near = Tree(points).query(queries, 2, skip=1)
    np.testing.assert_allclose(distance, away[:, 1:3])
    np.testing.assert_allclose(np.linalg.norm(queries[:, None] - points[near], axis=2), distance)
    if count > 3:
        many = Tree(points).query(queries, 200)[0]
        np.testing.assert_allclose(many, away[:, :200])
        np.testing.assert_allclose(many[:, 1:3], distance)
    first, index = Tree(points).nearest(queries)
    np.testing.assert_allclose(first, away[:, 0])
    np.testing.assert_allclose(np.linalg.norm(queries - points[index], axis=1), first)


def test_neighbours_that_there_are_not_are_infinitely_far():
    points = np.random.default_rng(6).standard_normal((5, 3))
    distance, near = Tree(points).query(points[:2], 4, skip=3)
    assert np.isfinite(distance[:, :2]).all()
    assert np.isinf(distance[:, 2:]).all()
    assert (near[:, 2:] == len(points)).all()
    distance, near = Tree(points).query(points, 2, bound=1e-9)
    assert (distance[:, 0] == 0.0).all()
    assert np.isinf(distance[:, 1]).all()
    np.testing.assert_array_equal(near, [[k, len(points)] for k in range(5)])
    assert Tree(points).nearest(np.empty((0, 3)))[0].shape == (0,)
    assert np.isinf(Tree(np.empty((0, 3))).nearest(points)[0]).all()


@pytest.mark.parametrize("dim", [1, 2, 3, 6])
def test_queries_that_are_put_in_order_are_answered_as_they_stand(dim):
    points, queries = np.random.default_rng(8).standard_normal((2, 900, dim))
    tree = Tree(points)
    for options in ({}, {"skip": 1}, {"bound": 0.3}):
        for one, other in zip(*(tree.query(queries, 5, scattered=s, **options) for s in (True, False)), strict=True):
            np.testing.assert_array_equal(one, other)
    assert tree.query(queries[:0], 5, scattered=True)[0].shape == (0, 5)


def test_points_along_a_morton_curve_are_near_one_another():
    points = np.random.default_rng(7).random((4000, 3))
    order = morton_order(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(4000))
    steps = [np.linalg.norm(np.diff(points[o], axis=0), axis=1).mean() for o in (order, slice(None))]
    assert steps[0] < 0.3 * steps[1]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_processes_forked_afterwards_find_neighbours_too():
    """GNU's OpenMP would hang there, had it made threads before."""
    script = """
import multiprocessing, numpy as np
from symrefine.surface.tree import Tree
points = np.random.default_rng(0).random((20000, 3))
def total(_): return float(Tree(points).query(points, 4)[0].sum())
with multiprocessing.get_context("fork").Pool(2) as pool:
    assert set(pool.map_async(total, [total(0), 1, 2]).get(30)) == {total(0)}
"""
    environment = {k: v for k, v in os.environ.items() if k != "OMP_NUM_THREADS"} | {"PYTHONWARNINGS": "ignore"}
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60, env=environment)


def test_several_operations_are_matched_as_each_alone():
    rng = np.random.default_rng(8)
    cloud = local_planes(rng.normal(size=(900, 3)), 900, rng)
    motions = [mirror([0, 0, 1]), mirror([0.2, 1, 0]), Isometry.about(np.zeros(3), -np.eye(3))]
    for pairs, motion in zip(match(cloud, motions, 0.1, stride=2), motions, strict=True):
        alone = matched(cloud, motion, 0.1, stride=2)
        assert pairs.sources.size
        np.testing.assert_array_equal(pairs.sources, alone.sources)
        np.testing.assert_array_equal(pairs.targets, alone.targets)
        np.testing.assert_array_equal(pairs.weights, alone.weights)
