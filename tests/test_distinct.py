"""Points that files write once for every face: one, wherever the walls of a grid are."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from symrefine.fit.distinct import Distinct
from symrefine.fit.vertices import exact_symmetry
from symrefine.geometry import random_orthogonal
from symrefine.rounding import SINGLE
from symrefine.shape import Shape


@pytest.mark.parametrize("seed", range(3))
def test_copies_of_a_point_are_one_wherever_they_are(seed):
    """Four thousand points, each written eight times but for rounding: many copies have a wall between them."""
    rng = np.random.default_rng(seed)
    points, order = rng.uniform(-0.5, 0.5, (4000, 3)), rng.permutation(32_000)
    copies = np.repeat(points, 8, axis=0) + 0.1 * SINGLE * rng.uniform(-1.0, 1.0, (32_000, 3))
    found = Distinct.of(Shape(25.0 * copies[order] + 3.0), np.full(3, 3.0), 25.0, weld=SINGLE)
    assert len(found.points) == len(points)
    of = np.repeat(np.arange(4000), 8)[order]
    assert len(np.unique(np.column_stack([of, found.back]), axis=0)) == len(points)
    assert np.abs(found.points[found.back] - copies[order]).max() < SINGLE
    assert np.array_equal(found.back[found.rows], np.arange(4000))


def test_labels_of_a_cloud_tell_apart_what_touches():
    points = np.array([[0.0, 0.0, 0.0], [1e-7, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0 + 1e-7, 0.0, 0.0]])
    found = Distinct.of(Shape(points, labels=np.array([0, 0, 1, 2])), np.zeros(3), 1.0, weld=SINGLE)
    assert sorted(found.labels.tolist()) == [0, 1, 2]


def test_what_is_apart_stays_apart():
    rng = np.random.default_rng(0)
    points = np.repeat(rng.uniform(size=(500, 3)), 2, axis=0)
    points[::2, 0] += 3.0 * SINGLE
    assert len(Distinct.of(Shape(points), np.zeros(3), 1.0, weld=SINGLE).points) == 1000


def test_a_box_whose_corners_are_written_for_every_face_has_its_group_in_any_pose():
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.7, 0.7) for z in (-0.4, 0.4)])
    faces = ConvexHull(box).simplices
    for seed in range(60):
        rng = np.random.default_rng(seed)
        posed = box @ random_orthogonal(rng).T + rng.standard_normal(3)
        apart = posed[faces].reshape(-1, 3) + 2e-7 * rng.uniform(-1.0, 1.0, (36, 3))
        found = exact_symmetry(Shape(apart, np.arange(36).reshape(-1, 3)), 2.6)[0]
        assert (found.group.name, found.faces) == ("D2h", True)
