"""One part of many out of place: which points it is, which operations keep it, and when nothing is to blame."""

from functools import cache

import numpy as np
import pytest

from experiments.objects.shapes import join, revolve, sample
from symrefine.gather import gather, measure
from symrefine.geometry import Isometry, random_orthogonal, rotation
from symrefine.groups import PointGroup
from symrefine.lone import keeps, lone_part
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE, make_judge

LEGS = 8
# A turn for the pose; legs stand on a circle of radius 0.33 about the third column.
MATRIX = random_orthogonal(np.random.default_rng(1))
CENTER = np.array([3.0, -1.0, 2.0])


def stool(out):
    """Eight legs under a round seat, the first of them farther out."""
    parts = [revolve([(0, 0.5), (0.4, 0.5), (0.4, 0.56), (0, 0.56)], 96)]
    for j in range(LEGS):
        points, faces = revolve([(0, 0), (0.035, 0), (0.035, 0.5), (0, 0.5)], 24)
        points = points + [0.33 + (out if j == 0 else 0.0), 0, 0]
        parts.append((points @ rotation([0, 0, 1], 2 * np.pi * j / LEGS).T, faces))
    made = join(parts)
    return Shape(points=made.points @ MATRIX.T + CENTER, faces=made.faces, measure="surface")


@cache
def evidence(out=0.05):
    return gather(measure(stool(out)), TOLERANCE, np.random.default_rng(0))


def center(e):
    """The axis of the stool at the height of the centroid, normalised units."""
    return (CENTER + 0.35 * MATRIX[:, 2] - e.moments.center) / e.moments.scale


def group(name="C8v"):
    return PointGroup(name=name, frame=MATRIX.T)


def back(e, index):
    """Local planes in the frame of the stool as it is made."""
    return (e.judge.cloud.points[index] * e.moments.scale + e.moments.center - CENTER) @ MATRIX


@pytest.mark.parametrize("out", [0.05, 0.3])
def test_the_part_is_the_leg_that_stands_astray(out):
    """However far out, and however far that puts the centroid from the axis."""
    e = evidence(out)
    part = lone_part(e, group(), center(e))
    points = back(e, part)
    assert len(part) > 20
    # All of them on the leg; they cover most of its height.
    assert np.hypot(points[:, 0] - 0.33 - out, points[:, 1]).max() < 0.05
    assert np.ptp(points[:, 2]) > 0.3


@pytest.mark.parametrize("out", [0.0, 0.002, 0.02])
def test_nothing_is_to_blame_where_all_hold(out):
    e = evidence(out)
    assert len(lone_part(e, group(), center(e))) == 0


def test_few_operations_cannot_tell_a_part_from_its_counterpart():
    e = evidence()
    for name in ("Cs", "C2", "C3", "Cinfv", "Kh"):
        assert len(lone_part(e, group(name), center(e))) == 0


def test_points_that_stand_for_themselves_have_no_parts():
    points = np.random.default_rng(2).standard_normal((60, 3))
    e = gather(measure(Shape(points=points)), TOLERANCE, np.random.default_rng(0))
    assert len(lone_part(e, PointGroup(name="Oh"), np.zeros(3))) == 0


@pytest.mark.parametrize(("count", "noise"), [(1000, 0.018), (3000, 0.015)])
def test_what_noise_scatters_is_no_part(count, noise):
    """A sample whose points scatter by as much as a detail may: single planes stand astray all over, no part does."""
    points = sample(stool(0.0), count, noise, np.random.default_rng(3))
    e = gather(measure(Shape(points=points)), TOLERANCE, np.random.default_rng(0))
    assert not e.judge.cloud.isolated
    assert e.judge.floor.p97 > TOLERANCE
    assert len(lone_part(e, group(), center(e))) == 0


def test_only_the_operations_that_leave_the_part_in_place_keep_it():
    e = evidence()
    part = lone_part(e, group(), center(e))
    for matrix in group().operations():
        image = matrix @ MATRIX[:, 0]
        stays = float(image @ MATRIX[:, 0]) > 1 - 1e-9
        assert keeps(e, [Isometry.about(center(e), matrix)], part) == stays


def test_several_operations_keep_a_part_only_together():
    e = evidence()
    part = lone_part(e, group(), center(e))
    same = Isometry.about(center(e), np.eye(3))
    away = Isometry.about(center(e), rotation(MATRIX[:, 2], 2 * np.pi / LEGS))
    assert keeps(e, [same, same], part)
    assert not keeps(e, [same, away], part)
    assert not keeps(e, [away, same], part)
    assert keeps(e, [away], part[:0])  # no part, nothing to keep


def test_a_part_is_where_the_surface_is_of_its_own_class_only():
    """Two parallel sheets of different classes: a shift onto the other one keeps the place, not the class."""
    side = np.linspace(-1, 1, 30)
    x, y = (a.ravel() for a in np.meshgrid(side, side))
    flat = np.column_stack([x, y, np.zeros_like(x)])
    sheets = Shape(points=np.concatenate([flat, flat + [0, 0, 0.5]]), labels=np.repeat([0, 1], len(flat)))
    e = gather(measure(sheets), TOLERANCE, np.random.default_rng(0))
    lower = np.flatnonzero(e.judge.cloud.points[:, 2] < 0)
    lift = Isometry(matrix=np.eye(3), shift=np.array([0, 0, 0.5 / e.moments.scale]))
    assert not keeps(e, [lift], lower)
    plain = gather(measure(Shape(points=sheets.points)), TOLERANCE, np.random.default_rng(0))
    assert keeps(plain, [lift], np.flatnonzero(plain.judge.cloud.points[:, 2] < 0))


def test_the_size_of_the_object_does_not_matter_to_what_is_kept():
    """Misses are fractions of the diagonal: a part may move by some of the tolerance, not by four times that."""
    e = evidence()
    part = lone_part(e, group(), center(e))
    judge = make_judge(e.judge.cloud, e.judge.diagonal, TOLERANCE)
    away = judge.tolerance * judge.diagonal * MATRIX[:, 0]
    kept = [keeps(e, [Isometry(matrix=np.eye(3), shift=share * away)], part) for share in (0.0, 0.6, 4.0)]
    assert kept == [True, True, False]
