"""Parts out of place, on bodies where it is known how far."""

import numpy as np
import pytest

from experiments.objects.shapes import box, join, sample
from symrefine.displaced import displacement
from symrefine.geometry import Isometry, Plane, random_orthogonal
from symrefine.surface.misses import make_judge
from symrefine.surface.skin import isolated_points, local_planes

TOLERANCE = 0.02
MIRROR = Isometry.reflection(Plane(normal=[1, 0, 0], offset=0.0))
BODY = box((0, 0, 0), (2.0, 1.0, 0.4))


def knobs(shift=(0.0, 0.0, 0.0), *, size=0.2, other=0.2):
    """A slab with two knobs that mirror one another in x = 0, but for a shift of the right one or its size."""
    right = np.array([0.7, 0.1, 0.3]) + shift
    return join([BODY, box((-0.7, 0.1, 0.3), (other,) * 3), box(tuple(right), (size,) * 3)])


def judge_of(shape, *, noise=0.0, turn=None, count=4000, labels=None):
    points = sample(shape, 20000, noise, np.random.default_rng(1))
    points = points if turn is None else points @ turn.T
    cloud = local_planes(points, count, np.random.default_rng(0), labels=labels)
    return make_judge(cloud, shape.diagonal, TOLERANCE)


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.6, 0.8, 0)])
def test_a_shifted_part_is_as_far_out_of_place_as_it_was_shifted(direction, noise):
    shape = knobs(1.5 * TOLERANCE * knobs().diagonal * np.array(direction))
    assert displacement(judge_of(shape, noise=noise), MIRROR, 0.01) == pytest.approx(1.5, abs=0.25)


def test_nothing_is_out_of_place_where_all_is_symmetric():
    assert displacement(judge_of(knobs()), MIRROR, 0.002) == 0.0
    assert displacement(judge_of(knobs(), noise=0.01), MIRROR, 0.009) == 0.0


def test_a_part_that_is_missing_is_not_out_of_place():
    lone = join([BODY, box((-0.7, 0.1, 0.3), (0.2, 0.2, 0.2))])
    assert displacement(judge_of(lone), MIRROR, 0.009) == 0.0


def test_parts_that_hold_less_than_the_share_are_passed_over():
    shape = knobs((1.5 * TOLERANCE * knobs().diagonal, 0, 0))
    assert displacement(judge_of(shape), MIRROR, 0.2) == 0.0


def test_it_turns_with_the_object():
    turn = random_orthogonal(np.random.default_rng(5))
    shape = knobs((0, 1.5 * TOLERANCE * knobs().diagonal, 0))
    mirror = Isometry.reflection(Plane(normal=turn @ [1, 0, 0], offset=0.0))
    upright, turned = (
        displacement(judge_of(shape), MIRROR, 0.01),
        displacement(judge_of(shape, turn=turn), mirror, 0.01),
    )
    assert turned == pytest.approx(upright, abs=0.05)


def test_a_part_of_a_volume():
    rng = np.random.default_rng(3)
    body = rng.uniform(-1, 1, (9000, 3)) * [1.0, 0.5, 0.3]
    ball = rng.standard_normal((1500, 3))
    ball *= 0.2 * (rng.uniform(size=(1500, 1)) ** (1 / 3)) / np.linalg.norm(ball, axis=1, keepdims=True)
    diagonal = 2.0 * np.linalg.norm([1.0, 0.7, 0.3])
    for shift, low, high in ((0.0, 0.0, 0.0), (2.0 * TOLERANCE * diagonal, 1.2, 2.5)):
        points = np.concatenate([body, ball + [-0.6, 0.6, 0], ball * [-1, 1, 1] + [0.6, 0.6 + shift, 0]])
        judge = make_judge(isolated_points(points, body="volume"), diagonal, TOLERANCE)
        assert low <= displacement(judge, MIRROR, 0.009) <= high


def test_atoms_have_no_parts():
    points = np.random.default_rng(0).standard_normal((60, 3))
    judge = make_judge(isolated_points(points), 5.0, TOLERANCE)
    assert displacement(judge, MIRROR, 0.001) == 0.0
