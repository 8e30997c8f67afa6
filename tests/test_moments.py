"""Moments against brute force and closed forms: centring, units, meshes, solids, and the noise of their replicates."""

from itertools import product
from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.objects.shapes import asymmetric, box, join, mug, sample
from symrefine.errors import DegenerateShapeError
from symrefine.geometry import random_orthogonal
from symrefine.moments.moments import (
    BLOCK,
    central_moments,
    exponents,
    monomials,
    raw_moments,
    raw_moments_of_parts,
    recentred,
    shape_moments,
    tensor_index,
    transformed,
)
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.shape import Shape

SEEDS = st.integers(0, 2**32 - 1)


def brute(points, weights, order):
    return np.array([weights @ np.prod(points**e, axis=1) for e in exponents(points.shape[1], order)])


def cloud(seed, count, dim):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, dim)) * rng.uniform(0.3, 2, dim) + rng.uniform(-1, 1, dim), rng.random(count)


def degrees(dim, order):
    return exponents(dim, order).sum(axis=1)


def undone(moments):
    """Central moments of unit mass in input units."""
    return moments.values * moments.scale ** degrees(moments.dim, moments.order)


def centred(raw, dim, order):
    """Central moments of unit mass from raw ones, term by term: an oracle that shares no code."""
    table = [tuple(e) for e in exponents(dim, order).tolist()]
    m = dict(zip(table, raw / raw[0], strict=True))
    mean = [m[tuple(int(i == j) for i in range(dim))] for j in range(dim)]
    found = []
    for e in table:
        terms = product(*(range(p + 1) for p in e))
        found.append(
            sum(
                m[k] * np.prod([comb(p, q) * (-c) ** (p - q) for p, q, c in zip(e, k, mean, strict=True)])
                for k in terms
            )
        )
    return np.array(found), np.array(mean)


@pytest.mark.parametrize(("dim", "order"), [(2, 0), (2, 9), (3, 8), (4, 4), (5, 3)])
def test_exponents_are_all_of_them_by_degree_then_the_first_coordinate(dim, order):
    table = exponents(dim, order)
    assert len({tuple(e) for e in table}) == len(table) == comb(order + dim, dim)
    keys = [(sum(e), [-p for p in e]) for e in table.tolist()]
    assert keys == sorted(keys)


@pytest.mark.parametrize("dim", [2, 3, 4])
def test_tensor_entries_are_the_moments_of_their_index(dim):
    points, weights = cloud(1, 30, dim)
    raw = raw_moments(points, weights, 4)
    for degree, letters in ((1, "a"), (2, "ab"), (3, "abc"), (4, "abcd")):
        outer = np.einsum("n," + ",".join(f"n{c}" for c in letters) + f"->{letters}", weights, *[points] * degree)
        np.testing.assert_allclose(raw[tensor_index(dim, degree, 4)], outer, atol=1e-11)


@pytest.mark.parametrize(("dim", "order"), [(2, 9), (3, 9), (4, 5), (5, 4)])
@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 7])
def test_raw_moments_are_the_sum_over_points(dim, order, count):
    points, weights = cloud(count, count, dim)
    exact = brute(points, weights, order)
    # Relative to the sum of absolute terms: N roundings in the worst case, far fewer in blocked sums.
    bound = brute(np.abs(points), weights, order)
    assert (np.abs(raw_moments(points, weights, order) - exact) / bound).max() < 1e-13


@pytest.mark.parametrize("dim", [1, 2, 3, 5])
def test_monomials_are_rows_of_powers(dim):
    points, weights = cloud(2, 11, dim)
    expected = np.prod(points[None] ** exponents(dim, 5)[:, None], axis=2)
    np.testing.assert_allclose(monomials(points, 5), expected, rtol=1e-14)
    np.testing.assert_allclose(monomials(points, 5, times=weights), weights * expected, rtol=1e-13)


def test_the_moments_of_parts_are_those_of_each_alone():
    """Of parts that share a block, fill some, and are empty."""
    ends = [0, 10, 10, 700, 700 + BLOCK // 2, 2000 + 3 * BLOCK, 2001 + 3 * BLOCK]
    points, weights = cloud(6, ends[-1], 3)
    found = raw_moments_of_parts(points, weights, 6, ends)
    for moments, start, end in zip(found, ends[:-1], ends[1:], strict=True):
        alone = raw_moments(points[start:end], weights[start:end], 6)
        bound = brute(np.abs(points[start:end]), weights[start:end], 6) + 1e-300
        assert (np.abs(moments - alone) / bound).max() < 1e-13


# Centre and unit


@given(SEEDS, st.integers(2, 4))
def test_central_moments_have_unit_mass_no_mean_and_unit_spread(seed, dim):
    points, weights = cloud(seed, 40, dim)
    found = central_moments(points, weights, 3)
    assert found.values[0] == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(found.values[1 : dim + 1], 0.0, atol=1e-14)
    assert np.trace(found.covariance) == pytest.approx(1.0, abs=1e-13)
    expected, mean = centred(brute(points, weights, 3), dim, 3)
    np.testing.assert_allclose(found.center, mean, atol=1e-13)
    np.testing.assert_allclose(undone(found), expected, atol=1e-12)


def test_a_shift_of_a_million_costs_nothing_but_the_digits_of_the_input():
    points, weights = cloud(3, 5000, 3)
    points = np.round(points * 2**20) / 2**20  # so that the shifted coordinates are exact
    near, far = (central_moments(points + shift, weights, 8, parts=4) for shift in (0.0, 2.0**20))
    # The centre is known to 1e-10 (one rounding at 2^20), which enters moments of order 8 (up to 300 here) eightfold.
    np.testing.assert_allclose(far.values, near.values, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(far.replicates, near.replicates, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(far.center - 2.0**20, near.center, atol=1e-9)
    assert far.scale == pytest.approx(near.scale, rel=1e-12)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
@pytest.mark.parametrize("measure", ["points", "surface", "solid"])
def test_units_and_mass_change_nothing_but_centre_and_scale(measure, unit):
    mesh = asymmetric()
    faces = None if measure == "points" else mesh.faces
    weights = np.arange(1.0, len(mesh.points) + 1) if faces is None else None
    once = shape_moments(Shape(points=mesh.points, faces=faces, measure=measure, weights=weights), 8)
    heavier = None if weights is None else 7 * weights
    other = shape_moments(Shape(points=unit * mesh.points, faces=faces, measure=measure, weights=heavier), 8)
    np.testing.assert_allclose(other.values, once.values, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(other.center, unit * once.center, rtol=1e-10, atol=1e-12 * unit)
    assert other.scale == pytest.approx(unit * once.scale, rel=1e-12)


@given(SEEDS, st.integers(2, 4))
def test_recentred_is_the_binomial_theorem(seed, dim):
    points, weights = cloud(seed, 20, dim)
    raw = raw_moments(points, weights / weights.sum(), 4)
    expected, mean = centred(raw, dim, 4)
    np.testing.assert_allclose(recentred(raw, dim, 4), expected, atol=1e-10)
    np.testing.assert_allclose(brute(points - mean, weights / weights.sum(), 4), expected, atol=1e-10)


@pytest.mark.parametrize("dim", [2, 3, 4])
@pytest.mark.parametrize("kind", ["rotation", "reflection", "any"])
def test_transformed_moments_are_those_of_the_transformed_points(dim, kind):
    rng = np.random.default_rng(dim)
    points, weights = cloud(4, 50, dim)
    det = {"rotation": 1, "reflection": -1}.get(kind)
    matrix = rng.standard_normal((dim, dim)) if det is None else random_orthogonal(rng, dim, det)
    moments = central_moments(points, weights, 5, parts=3)
    local = (points - moments.center) / moments.scale
    expected = brute(local @ matrix.T, weights / weights.sum(), 5)
    np.testing.assert_allclose(transformed(moments, matrix).values, expected, rtol=1e-10, atol=1e-12)


def test_weights_count_as_repeated_points():
    points, _ = cloud(5, 60, 3)
    times = np.random.default_rng(5).integers(0, 4, 60)
    weighted = shape_moments(Shape.of(points, weights=times), 6)
    repeated = shape_moments(Shape.of(np.repeat(points, times, axis=0)), 6)
    np.testing.assert_allclose(weighted.values, repeated.values, atol=1e-11)


def test_weights_that_leave_one_point_are_degenerate():
    with pytest.raises(DegenerateShapeError, match="two distinct points"):
        shape_moments(Shape.of([[0, 0, 0], [1, 1, 1]], weights=[1, 0]), 3)


# Replicates


def test_replicates_leave_out_one_part_each_about_their_own_mean():
    points, weights = cloud(6, 999, 3)
    found = central_moments(points, weights, 4, parts=5)
    plain = central_moments(points, weights, 4)
    np.testing.assert_allclose(found.values, plain.values, atol=1e-12)
    assert plain.replicates.shape == (0, len(plain.values))
    assert found.replicates.shape == (5, len(plain.values))
    np.testing.assert_allclose(found.replicates[:, 0], 1.0, atol=1e-13)
    np.testing.assert_allclose(found.replicates[:, 1:4], 0.0, atol=1e-13)
    # Every point is left out once: second moments about the common mean average to the whole, to first order.
    np.testing.assert_allclose(found.replicates[:, :10].mean(axis=0), found.values[:10], atol=3e-3)


def test_replicates_have_the_covariance_of_a_bootstrap():
    rng = np.random.default_rng(7)
    points, weights = cloud(8, 4096, 3)
    parts, order = 256, 3
    found = central_moments(points, weights, order, parts=parts)
    spread = found.replicates - found.replicates.mean(axis=0)
    jackknife = (parts - 1) / parts * spread.T @ spread
    local = (points - found.center) / found.scale
    draws = [rng.integers(0, len(points), len(points)) for _ in range(400)]
    bootstrap = np.cov([recentred_raw(local[d], weights[d], order) for d in draws], rowvar=False)
    # 2 (variance) / 256 parts and 400 draws: entries of both are good to about a tenth of the diagonal.
    scale = np.sqrt(np.maximum(np.diag(bootstrap), 1e-12))
    assert np.abs((jackknife - bootstrap) / np.outer(scale, scale))[4:, 4:].max() < 0.4
    np.testing.assert_allclose(np.diag(jackknife)[4:], np.diag(bootstrap)[4:], rtol=0.35)
    ratio = np.diag(jackknife)[4:] / np.diag(bootstrap)[4:]
    assert ratio.mean() == pytest.approx(1.0, abs=0.1)


def recentred_raw(points, weights, order):
    raw = raw_moments(points, weights, order)
    return recentred(raw / raw[0], 3, order)


def test_replicates_do_not_depend_on_the_order_the_file_lists_its_points_in():
    # Sorted points: parts cut from the file in blocks would differ wildly from one another.
    points, _ = cloud(9, 4000, 3)
    ones = np.ones(len(points))
    sorted_, shuffled = (
        central_moments(p, ones, 2, parts=16).replicates for p in (points[np.argsort(points[:, 0])], points)
    )
    # Deviations of 16 replicates are good to a fifth each; blocks would have twelve times the spread along x.
    assert (sorted_[:, 4:].std(axis=0) / shuffled[:, 4:].std(axis=0)).max() < 4


def test_replicates_do_not_depend_on_a_rhythm_in_the_file():
    """Rows of as many points as there are parts: dealt in the order of the file each part would be one column."""
    rng = np.random.default_rng(10)
    rows = np.stack(np.meshgrid(np.arange(250), np.linspace(-1, 1, 16), indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.column_stack([rows[:, 1], rng.standard_normal((4000, 2))])
    order = rng.permutation(4000)
    in_rows, anyhow = (central_moments(p, np.ones(4000), 2, parts=16).replicates for p in (points, points[order]))
    ratio = in_rows[:, 4:].std(axis=0) / anyhow[:, 4:].std(axis=0)
    assert ratio.max() < 4


# Meshes


def subdivided(shape):
    """Every triangle cut in four at points that are not the midpoints."""
    a, b, c = (shape.points[shape.faces[:, i]] for i in range(3))
    ab, bc, ca = 0.3 * a + 0.7 * b, 0.6 * b + 0.4 * c, 0.5 * c + 0.5 * a
    corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    points = np.concatenate([np.stack(t, axis=1) for t in corners]).reshape(-1, 3)
    return Shape(points=points, faces=np.arange(len(points)).reshape(-1, 3), measure=shape.measure)


def as_solid(shape):
    return Shape(points=shape.points, faces=shape.faces, measure="solid")


@pytest.mark.parametrize("shape", [asymmetric(), mug(), as_solid(asymmetric())], ids=["boxes", "mug", "solid"])
def test_mesh_moments_do_not_depend_on_the_tessellation(shape):
    once, cut = shape_moments(shape, 8), shape_moments(subdivided(shape), 8)
    # Quadrature exact at every order; what is left is rounding, amplified by moments of order 8 up to some tens.
    np.testing.assert_allclose(cut.values, once.values, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(cut.center, once.center, atol=1e-12)
    assert cut.scale == pytest.approx(once.scale, rel=1e-12)
    assert once.replicates.shape[0] == 0


def powers(half, exponent):
    """int x^p over [-half, half]."""
    return 0.0 if exponent % 2 else 2 * half ** (exponent + 1) / (exponent + 1)


def box_moment(half, e, measure):
    if measure == "solid":
        return np.prod([powers(h, p) for h, p in zip(half, e, strict=True)])
    total = 0.0
    for axis in range(3):
        others = [powers(half[k], e[k]) for k in range(3) if k != axis]
        total += 0.0 if e[axis] % 2 else 2 * half[axis] ** e[axis] * np.prod(others)
    return total


@pytest.mark.parametrize("measure", ["surface", "solid"])
@pytest.mark.parametrize("flip", [False, True], ids=["outwards", "inwards"])
def test_moments_of_a_box_in_closed_form(measure, flip):
    size, center = np.array([2.0, 3.0, 0.5]), np.array([100.0, -7.0, 0.25])
    points, faces = box(center, size)
    found = shape_moments(Shape(points=points, faces=faces[:, ::-1] if flip else faces, measure=measure), 8)
    exact = np.array([box_moment(size / 2, e, measure) for e in exponents(3, 8)])
    np.testing.assert_allclose(undone(found), exact / exact[0], rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(found.center, center, atol=1e-12)


@pytest.mark.parametrize("flip", [False, True], ids=["outwards", "inwards"])
def test_solid_moments_of_a_tetrahedron_in_closed_form(flip):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    raw = np.array([np.prod([factorial(p) for p in e]) / factorial(sum(e) + 3) for e in exponents(3, 7).tolist()])
    exact, mean = centred(raw, 3, 7)
    found = shape_moments(Shape(points=points + 5, faces=faces[:, ::-1] if flip else faces, measure="solid"), 7)
    np.testing.assert_allclose(found.center - 5, mean, atol=1e-14)
    np.testing.assert_allclose(undone(found), exact, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("shape", [asymmetric(), as_solid(asymmetric())], ids=["surface", "solid"])
@pytest.mark.parametrize("det", [1, -1])
def test_mesh_moments_turn_with_the_mesh(shape, det):
    matrix = random_orthogonal(np.random.default_rng(10), 3, det)
    moved = Shape(points=shape.points @ matrix.T + 3, faces=shape.faces, measure=shape.measure)
    once, turned = shape_moments(shape, 8), shape_moments(moved, 8)
    np.testing.assert_allclose(turned.values, transformed(once, matrix).values, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(turned.center, matrix @ once.center + 3, atol=1e-12)


def test_samples_of_a_mesh_have_its_moments():
    shape, count = mug(), 20000
    found = central_moments(sample(shape, count, 0.0, np.random.default_rng(11)), np.ones(count), 4, parts=16)
    exact = shape_moments(shape, 4)
    sigma = np.sqrt(15 / 16 * ((found.replicates - found.replicates.mean(axis=0)) ** 2).sum(axis=0))
    assert (np.abs(found.values - exact.values)[4:] < 5 * sigma[4:] + 1e-3).all()


@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 1]], [[0, 1, 2]]], ids=["two sides", "one side"])
def test_a_solid_without_volume_is_degenerate(faces):
    with pytest.raises(DegenerateShapeError, match=r"no volume.*surface measure"):
        shape_moments(Shape(points=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=faces, measure="solid"), 3)


BOX = box((0, 0, 0), (1, 2, 3))
TURNED = BOX[1].copy()
TURNED[[8, 10]] = TURNED[[8, 10], ::-1]
DAMAGED = {
    "open": BOX[1][1:],
    "one face turned round": np.concatenate([BOX[1][:1, ::-1], BOX[1][1:]]),
    "a tube": BOX[1][:8],
    "a face turned round at either end": TURNED,
}


@pytest.mark.parametrize("faces", DAMAGED.values(), ids=DAMAGED)
def test_a_solid_must_be_closed_and_consistently_oriented(faces):
    with pytest.raises(DegenerateShapeError):
        shape_moments(Shape(points=BOX[0], faces=faces, measure="solid"), 3)


def test_a_hole_in_every_face_is_seen_though_area_vectors_and_their_moments_agree():
    # With the middle of all six faces gone the rest has sum n dA = 0 and int x n' dA proportional to I.
    whole = cube_with_holes(holes=False)
    shape_moments(whole, 3)
    holed = cube_with_holes(holes=True)
    areas, normals = triangle_areas_and_normals(holed.points, holed.faces)
    vectors = areas[:, None] * normals
    first = holed.points[holed.faces].mean(axis=1).T @ vectors
    np.testing.assert_allclose(vectors.sum(axis=0), 0, atol=1e-14)
    np.testing.assert_allclose(first, first[0, 0] * np.eye(3), atol=1e-14)
    with pytest.raises(DegenerateShapeError, match="not a closed"):
        shape_moments(holed, 3)


def cube_with_holes(*, holes):
    """Each face of a cube in a 3 x 3 grid, with the middle squares or without."""
    points, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for i, j in np.ndindex(3, 3):
                if holes and (i, j) == (1, 1):
                    continue
                square = np.array([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]) / 1.5 - 1.0
                corner = np.insert(square, axis, side, axis=1)
                outward = (side > 0) == (axis != 1)
                start = len(points)
                points += list(corner if outward else corner[::-1])
                faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    return Shape(points=np.array(points), faces=np.array(faces), measure="solid")


@pytest.mark.parametrize("single", [False, True], ids=["double", "single precision"])
def test_triangles_may_meet_without_sharing_vertices(single):
    # One face of a box cut where the others know nothing of it, the whole turned and far out.
    points, faces = BOX
    a, b, c = faces[0]
    points = np.concatenate([points, [(points[a] + 2 * points[b]) / 3]])
    cut = np.concatenate([faces[1:], [[a, len(points) - 1, c], [len(points) - 1, b, c]]])
    posed = points @ random_orthogonal(np.random.default_rng(0)).T + 7.0
    posed = posed.astype(np.float32).astype(float) if single else posed
    found = shape_moments(Shape(points=posed, faces=cut, measure="solid"), 2)
    exact = shape_moments(Shape(points=BOX[0], faces=faces, measure="solid"), 2)
    assert found.scale == pytest.approx(exact.scale, rel=1e-6)


def test_moments_are_read_only():
    found = shape_moments(join([box((0, 0, 0), (1, 2, 3))]), 2)
    for array in (found.values, found.replicates, found.center):
        assert not array.flags.writeable
