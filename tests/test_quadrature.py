"""Exact nodes against analytic integrals over triangles, and samples against the uniform law."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest

from experiments.objects.shapes import box, join, mug
from symrefine.errors import DegenerateShapeError
from symrefine.moments.quadrature import mesh_nodes, repeated, sample_surface, triangle_areas_and_normals, triangle_rule
from symrefine.shape import Shape

# Two triangles of areas 1 and 3 in different planes, and a degenerate one between them.
TWO = Shape(
    points=[[0, 0, 0], [2, 0, 0], [0, 1, 0], [5, 0, 0], [5, 2, 0], [5, 0, 3]],
    faces=[[0, 1, 2], [0, 1, 1], [3, 4, 5]],
    measure="surface",
)
FLAT = Shape(points=[[0, 0, 0], [1, 1, 1], [2, 2, 2]], faces=[[0, 1, 2]], measure="surface")


def dirichlet(a, b, c):
    """Mean of u^a v^b w^c over a triangle in barycentric coordinates."""
    return 2 * factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 2)


@pytest.mark.parametrize("degree", range(13))
def test_triangle_rule_is_exact_to_its_degree(degree):
    bary, weights = triangle_rule(degree)
    assert weights.sum() == pytest.approx(1.0, abs=1e-15)
    assert weights.min() > 0
    assert bary.min() > 0
    np.testing.assert_allclose(bary.sum(axis=1), 1.0, atol=1e-15)
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            for c in range(degree + 1 - a - b):
                found = weights @ (bary[:, 0] ** a * bary[:, 1] ** b * bary[:, 2] ** c)
                # Sums of at most 49 positive terms below 1, with nodes good to a few roundings.
                assert found == pytest.approx(dirichlet(a, b, c), rel=1e-13)


def test_areas_and_normals_follow_the_right_hand_rule():
    areas, normals = triangle_areas_and_normals(TWO.points, TWO.faces)
    np.testing.assert_allclose(areas, [1, 0, 3], atol=1e-15)
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 0], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(triangle_areas_and_normals(TWO.points, TWO.faces[:, ::-1])[1], -normals, atol=0)


def test_mesh_nodes_integrate_over_the_surface():
    shape = join([box((3, -2, 1), (2, 4, 6))])
    nodes, weights = mesh_nodes(shape, 4)
    x = nodes + shape.points[0] - [3, -2, 1]
    assert weights.sum() == pytest.approx(2 * (8 + 24 + 12))
    # int x^2 y^2 over the faces x = +-1, y = +-2, z = +-3 of the box.
    i2 = {1: 2 / 3, 2: 16 / 3, 3: 18.0}
    exact = 2 * (1 * i2[2] * 6 + 4 * i2[1] * 6 + i2[1] * i2[2])
    assert weights @ (x[:, 0] ** 2 * x[:, 1] ** 2) == pytest.approx(exact, rel=1e-13)
    np.testing.assert_allclose(weights @ x, 0.0, atol=1e-12)


def test_mesh_nodes_of_a_solid_carry_three_times_its_volume():
    parts = box((3, -2, 1), (2, 4, 6))
    shape = Shape(points=parts[0], faces=parts[1], measure="solid")
    assert mesh_nodes(shape, 1)[1].sum() == pytest.approx(3 * 48, rel=1e-13)


@pytest.mark.parametrize("use", [lambda s: mesh_nodes(s, 2), lambda s: sample_surface(s, 9, np.random.default_rng(0))])
def test_a_mesh_without_area_is_degenerate(use):
    with pytest.raises(DegenerateShapeError, match="no area"):
        use(FLAT)


# Samples


def test_samples_lie_on_their_faces_with_their_normals():
    shape = mug()
    points, normals, face = sample_surface(shape, 3000, np.random.default_rng(1))
    corners = shape.points[shape.faces[face]]
    np.testing.assert_allclose(normals, triangle_areas_and_normals(shape.points, shape.faces)[1][face], atol=0)
    np.testing.assert_allclose(np.einsum("ij,ij->i", points - corners[:, 0], normals), 0.0, atol=1e-14)
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    inside = np.einsum("nij,nj->ni", np.linalg.pinv(edges), points - corners[:, 0])
    assert inside.min() > -1e-9
    assert inside.sum(axis=1).max() < 1 + 1e-9


@pytest.mark.parametrize("count", [1, 7, 1000])
def test_every_face_gets_its_share_to_within_two(count):
    areas = triangle_areas_and_normals(TWO.points, TWO.faces)[0]
    points, normals, face = sample_surface(TWO, count, np.random.default_rng(2))
    assert points.shape == normals.shape == (count, 3)
    hits = np.bincount(face, minlength=3)
    assert hits[1] == 0
    # One draw in each strip: only the strips that straddle two faces are left to chance.
    assert np.abs(hits - count * areas / areas.sum()).max() <= 2


def test_samples_are_uniform_within_a_triangle():
    shape = Shape(points=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]], measure="surface")
    count = 20000
    points = sample_surface(shape, count, np.random.default_rng(3))[0]
    u, v = points[:, 0], points[:, 1]
    for found, exact in ((u, 1 / 3), (v, 1 / 3), (u * u, 1 / 6), (v * v, 1 / 6), (u * v, 1 / 12), (u**3, 1 / 10)):
        # Five standard errors.
        assert found.mean() == pytest.approx(exact, abs=5 * found.std() / np.sqrt(count))


def test_samples_depend_on_the_seed_and_on_nothing_else():
    shape = mug()
    first, again, other = (sample_surface(shape, 500, np.random.default_rng(s)) for s in (4, 4, 5))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.abs(first[0] - other[0]).max() > 0.01


def drawn_again(shape, rng):
    """Some of its faces twice or three times, from either side, with corners of their own."""
    some = rng.choice(len(shape.faces), len(shape.faces), replace=True)
    corners = shape.points[shape.faces[some]][:, rng.permutation(3)]
    points = np.concatenate([shape.points, corners.reshape(-1, 3)])
    faces = np.concatenate([shape.faces, len(shape.points) + np.arange(3 * len(some)).reshape(-1, 3)])
    return Shape(points=points, faces=faces), some


@pytest.mark.parametrize("seed", range(3))
def test_a_face_drawn_again_is_the_same_surface(seed):
    shape, rng = mug(), np.random.default_rng(seed)
    again, _ = drawn_again(shape, rng)
    first = np.arange(len(again.faces)) >= len(shape.faces)
    assert np.array_equal(repeated(again), first)
    assert not repeated(shape).any()
    drawn = [sample_surface(s, 500, np.random.default_rng(1)) for s in (again, shape)]
    assert all(np.array_equal(got, right) for got, right in zip(*drawn, strict=True))
    (nodes, weights), (_, once) = mesh_nodes(again, 4), mesh_nodes(shape, 4)
    assert weights.sum() == pytest.approx(once.sum(), rel=1e-12)
    assert nodes.shape == (len(weights), 3)


def test_faces_of_different_labels_in_one_place_both_count():
    shape, rng = mug(), np.random.default_rng(4)
    again, some = drawn_again(shape, rng)
    labels = np.arange(len(shape.faces)) % 2
    same, other = (np.concatenate([labels, own]) for own in (labels[some], 2 + labels[some]))
    assert repeated(replace(again, labels=same)).sum() == len(some)
    assert repeated(replace(again, labels=other)).sum() == len(some) - len(np.unique(some))


def test_a_zero_of_either_sign_is_one_place():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, -0.0, 0], [1, -0.0, 0], [0, 1, -0.0]])
    assert repeated(Shape(points=points, faces=np.arange(6).reshape(2, 3))).tolist() == [False, True]
