"""The group that permutes points, found from nothing but the points."""

from itertools import islice

import numpy as np
import pytest

from symrefine.fit.anchors import permuting_groups
from symrefine.fit.vertices import exact_symmetry
from symrefine.geometry import random_orthogonal, unit
from symrefine.groups import PointGroup, point_group
from symrefine.shape import Shape

WITHIN = 1e-5
NAMES = (
    *("Cs", "Ci", "C2", "C7", "C2v", "C5v", "C3h", "S4", "S10", "D2", "D9", "D2d", "D5d", "D2h", "D7h"),
    *("T", "Td", "Th", "O", "Oh", "I", "Ih", "C60", "D48h"),
)


def permuting_group(points, labels, within, *, every=False):
    """What some hundreds of the points tell, or all of them; None where they cannot."""
    return next(islice(permuting_groups(points, labels, within), int(every), None), None)


def orbits(group, rng, count=3):
    """Points [N, 3] of generic orbits about the origin, in random order, and of which orbit each is [N]."""
    seeds = unit(rng.standard_normal((count, 3))) * rng.uniform(0.5, 1.0, (count, 1))
    points = np.concatenate([group.operations() @ seed for seed in seeds])
    order = rng.permutation(len(points))
    return points[order], np.repeat(np.arange(count), len(points) // count)[order]


def posed(name, seed):
    rng = np.random.default_rng(seed)
    group = PointGroup(name=name, frame=random_orthogonal(rng))
    return group, *orbits(group, rng), rng


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [0, 1])
def test_generic_orbits_have_their_group_and_place_it(name, seed):
    group, points, _, _ = posed(name, seed)
    found = permuting_group(points, None, WITHIN)
    assert found.name == name
    if name not in ("C1", "Ci"):
        assert found.distance_rad(group.operations()).max() < 1e-9


@pytest.mark.parametrize("name", ["D9", "Oh", "C60"])
def test_rounded_coordinates_have_it_too_but_not_noisy_ones(name):
    _, points, _, rng = posed(name, 4)
    assert permuting_group(np.round(points, 6), None, WITHIN).name == name
    noisy = points + 1e-3 * rng.standard_normal(points.shape)
    assert permuting_group(noisy - noisy.mean(axis=0), None, WITHIN).name == "C1"


def test_one_point_out_of_place_leaves_the_operations_that_leave_it():
    """A corner of a cube that stands out a little: three of its nine mirrors pass through it."""
    rng = np.random.default_rng(5)
    group = PointGroup(name="Oh", frame=random_orthogonal(rng))
    points, _ = orbits(group, rng)
    corner = group.frame.T @ np.array([0.3, 0.3, 0.3])
    with_corners = np.concatenate([points, [1.1 * corner], [-corner]])
    found = permuting_group(with_corners - with_corners.mean(axis=0), None, WITHIN)
    assert found.name == "C3v"
    np.testing.assert_allclose(np.abs(found.frame[2] @ unit(corner)), 1.0, atol=1e-9)


def test_points_that_are_gone_are_missed_though_some_hundreds_do_not_know():
    """Two opposite ones of 24, on a mirror, among 1,950 others: few of those asked first are carried to either."""
    rng = np.random.default_rng(6)
    group = PointGroup(name="Oh", frame=random_orthogonal(rng))
    points, _ = orbits(group, rng, count=40)
    on_mirror = np.unique(np.round(group.operations() @ (group.frame.T @ [0.4, 0.4, 0.7]), 12), axis=0)
    tips = np.unique(np.round(group.operations() @ (1.2 * group.frame[2]), 12), axis=0)
    left = on_mirror[np.linalg.norm(np.cross(on_mirror, on_mirror[0]), axis=1) > 0.1]
    assert (len(on_mirror), len(left), len(tips)) == (24, 22, 6)
    whole, broken = (np.concatenate([tips, points, some]) for some in (on_mirror, left))
    assert exact_symmetry(Shape(whole), 2.0)[0].group.name == "Oh"
    assert exact_symmetry(Shape(broken), 2.0)[0].group.name == "C2h"


def test_labels_tell_points_apart():
    _, points, _, _ = posed("D4h", 6)
    assert permuting_group(points, np.zeros(len(points), dtype=int), WITHIN).name == "D4h"
    above = (points @ posed("D4h", 6)[0].frame[2] > 0).astype(int)
    assert permuting_group(points, above, WITHIN).name == "C4v"


def test_what_has_none_is_c1_and_what_cannot_be_told_is_none():
    rng = np.random.default_rng(0)
    cloud = rng.standard_normal((500, 3))
    assert permuting_group(cloud - cloud.mean(axis=0), None, WITHIN).name == "C1"
    line = np.outer(np.linspace(-1.0, 1.0, 9), [1.0, 2.0, 3.0])
    assert permuting_group(line, None, WITHIN) is None
    angles = 2.0 * np.pi * np.arange(6000) / 6000
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6000)], axis=1)
    assert permuting_group(ring, None, WITHIN) is None  # of so many folds


@pytest.mark.parametrize("count", [30, 4000])
@pytest.mark.parametrize("name", ["C1", "Ci", "C3v", "D5d", "Td", "Ih"])
def test_points_that_are_all_as_far_from_the_centre_have_their_group(name, count):
    """As on a sphere, where distances from the centre tell nothing."""
    rng = np.random.default_rng(count)
    group = PointGroup(name=name, frame=random_orthogonal(rng))
    seeds = unit(rng.standard_normal((max(2, count // group.order), 3)))
    points = rng.permutation(np.concatenate([seeds @ g.T for g in group.operations()]))
    found = permuting_group(points - points.mean(axis=0), None, WITHIN)
    assert found.name == name
    turned = unit(points @ random_orthogonal(rng).T)
    assert permuting_group(turned - turned.mean(axis=0), None, WITHIN, every=True).name == name
    one_off = turned.copy()
    one_off[7] = unit(one_off[7] + 0.01 * rng.standard_normal(3))
    broken = permuting_group(one_off - one_off.mean(axis=0), None, WITHIN, every=True)
    assert broken.order < group.order or name == "C1"


@pytest.mark.parametrize(("sides", "rings"), [(12, 6), (64, 32), (180, 90)])
def test_a_ball_of_rings_has_the_fold_of_its_sides(sides, rings):
    height, angle = np.pi * np.arange(1, rings) / rings, 2.0 * np.pi * np.arange(sides) / sides
    height, angle = (a.ravel() for a in np.meshgrid(height, angle))
    ball = np.stack([np.sin(height) * np.cos(angle), np.sin(height) * np.sin(angle), np.cos(height)], axis=1)
    ball = np.concatenate([ball, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]]) @ random_orthogonal(np.random.default_rng(1)).T
    assert permuting_group(ball, None, WITHIN).name == f"D{sides}h"
    cap = ball[ball @ ball[-2] > -0.49]
    assert permuting_group(cap - cap.mean(axis=0), None, WITHIN).name == f"C{sides}v"


def test_a_mirror_image_is_told_from_a_turn():
    """Points in a plane have the mirror that leaves all of them; chiral ones no mirror at all."""
    angles = np.linspace(0.0, 2.0 * np.pi, 7, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(7)], axis=1)
    assert permuting_group(ring, None, WITHIN).name == point_group("D7h").name
    twisted = np.concatenate(
        [ring + [0, 0, 0.5], 0.8 * ring @ [[0.9, 0.1, 0], [-0.1, 0.9, 0], [0, 0, 1]] - [0, 0, 0.5]]
    )
    assert permuting_group(twisted - twisted.mean(axis=0), None, WITHIN).name == "C7"
