"""Refinement on the points: from three degrees off to the truth, a covariance that means what it says, no jumps."""

from dataclasses import FrozenInstanceError
from itertools import pairwise

import numpy as np
import pytest

from experiments.objects.shapes import box, join, mug, sample, stool, table
from experiments.studies.methods import single_plane
from symrefine.fit.refine import LONGEST, SETTLED, WITHIN_NOISE, Framed, _remaining, mirror_bundle, refine
from symrefine.geometry import (
    Plane,
    householder,
    line_angle_rad,
    random_orthogonal,
    rotation,
    rotoreflection,
)
from symrefine.moments.moments import shape_moments
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape
from symrefine.surface.skin import isolated_points
from tests.surfaces import local_planes

BOX = join([box((0, 0, 0), (1, 0.7, 0.4))])
ORIGIN = np.zeros(3)


def mirrors_of_table(frame, center=ORIGIN):
    return mirror_bundle(4, frame, center)


def mirrors_of_stool(frame, center=ORIGIN):
    return mirror_bundle(5, frame, center)


def mirrors_of_box(frame, center=ORIGIN):
    return Framed(standard=np.stack([householder(n) for n in np.eye(3)]), frame=frame, center=center)


def plane_of_mug(frame, center=ORIGIN):
    return single_plane(Plane(normal=frame[1], offset=float(frame[1] @ center)))


CASES = {
    "table": (table(), mirrors_of_table),
    "stool": (stool(5), mirrors_of_stool),
    "box": (BOX, mirrors_of_box),
    "mug": (mug(), plane_of_mug),
}


def placed(shape, seed, count, noise=0.0, exact=False, planes=None):
    """Local planes of a sample in a random pose about the centroid, RMS radius 1, and the true frame."""
    rng = np.random.default_rng(seed)
    moments, turn = shape_moments(shape, 2), random_orthogonal(rng)
    if exact:
        points, normals, _ = sample_surface(shape, count, rng)
    else:
        points, normals = sample(shape, count, noise, rng), None
    points = (points - moments.center) / moments.scale @ turn.T
    turned = None if normals is None else normals @ turn.T
    planes = local_planes(points, planes or count // 2, rng, normals=turned, exact=exact)
    return planes, turn.T, rng


def tilted(frame, degrees, rng):
    return rotation(rng.standard_normal(3), np.radians(degrees)) @ frame


def worst_deg(state, truth):
    return max(np.degrees(line_angle_rad(a.normal, b.normal)) for a, b in zip(state.planes, truth.planes, strict=True))


def run(name, seed, *, count=6000, noise=0.0, off_deg=3.0, off=0.02, exact=False, **options):
    shape, operations = CASES[name]
    cloud, frame, rng = placed(shape, seed, count, noise, exact)
    start = operations(tilted(frame, off_deg, rng), off * rng.standard_normal(3))
    return tuple(refine(cloud, start, **options)), operations(frame)


# Operations and where they stand


def test_a_bundle_has_its_mirrors_at_even_angles_from_the_first_row():
    frame = random_orthogonal(np.random.default_rng(1))
    center = np.array([0.3, -0.2, 1.0])
    for fold in (1, 2, 3, 8):
        bundle = mirror_bundle(fold, frame, center)
        assert len(bundle.planes) == fold
        for k, (plane, motion) in enumerate(zip(bundle.planes, bundle.motions, strict=True)):
            angle = np.pi * k / fold
            for point in (center, center + frame[2], center + np.cos(angle) * frame[0] + np.sin(angle) * frame[1]):
                assert plane.signed_distance(point) == pytest.approx(0.0, abs=1e-13)
            x = np.random.default_rng(k).standard_normal((4, 3))
            np.testing.assert_allclose(motion.apply(x), plane.reflect(x), atol=1e-13)


def test_only_mirrors_are_listed_as_planes():
    standard = np.stack([rotation([0, 0, 1], 1.0), -np.eye(3), rotoreflection([0, 0, 1], 2.0), householder([1, 0, 0])])
    state = Framed(standard=standard, frame=np.eye(3), center=[1, 2, 3])
    assert len(state.motions) == 4
    assert len(state.planes) == 1
    np.testing.assert_allclose(np.abs(state.planes[0].normal), [1, 0, 0], atol=1e-15)
    assert abs(state.planes[0].offset) == pytest.approx(1.0)


def test_a_single_plane_stands_where_it_was():
    plane = Plane(normal=[1, -2, 0.5], offset=0.7)
    (found,) = single_plane(plane).planes
    sign = np.sign(found.normal @ plane.normal)
    np.testing.assert_allclose(sign * found.normal, plane.normal, atol=1e-14)
    assert sign * found.offset == pytest.approx(plane.offset)


# Convergence

# Degrees, worst plane: three times the median of ten poses. The mug's handle is all that tells its plane, and its walls
# are thin: fewer points than 20,000 leave it a degree.
LIMITS = {
    ("table", 0.0): 0.06, ("table", 0.01): 0.4, ("stool", 0.0): 0.06, ("stool", 0.01): 0.6,
    ("box", 0.0): 0.02, ("box", 0.01): 0.3, ("mug", 0.0): 0.1, ("mug", 0.01): 1.5,
}  # fmt: skip


@pytest.mark.parametrize(("name", "noise"), LIMITS)
def test_three_degrees_off_ends_at_the_truth(name, noise):
    for seed in (1, 2):
        history, truth = run(name, seed, noise=noise, count=20000 if name == "mug" else 6000)
        assert worst_deg(history[0].state, truth) > 1.0
        assert worst_deg(history[-1].state, truth) < LIMITS[name, noise]
        assert history[-1].converged
        for plane in history[-1].state.planes:
            # The true centre is the centroid: planes pass it to within what an angle of the same error would move.
            assert abs(plane.offset) < 2 * np.radians(LIMITS[name, noise])


@pytest.mark.parametrize("name", CASES)
def test_exact_normals_leave_no_more_than_the_discretisation(name):
    history, truth = run(name, 3, exact=True)
    # Points of the surface itself, planes exact: flat parts match exactly wherever the samples fall.
    assert worst_deg(history[-1].state, truth) < 0.05


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_clean_data_does_not_jump_away(name, exact):
    # method.md, section 4: the robust scale of exact residuals collapses and the solution jumps (0.03 -> 18 degrees).
    for off_deg in (0.0, 0.03):
        history, truth = run(name, 4, exact=exact, off_deg=off_deg, off=0.0)
        limit = 0.06 if name in ("table", "box") or exact else 0.5
        assert max(worst_deg(i.state, truth) for i in history[1:]) < limit


def test_turns_and_rotoreflections_share_a_frame_too():
    gear = join([box((0.5, 0.1, 0), (0.5, 0.2, 0.3))])
    parts = [rotation([0, 0, 1], k * 2 * np.pi / 3) for k in range(3)]
    points = np.concatenate([gear.points @ r.T for r in parts])
    faces = np.concatenate([gear.faces + 8 * k for k in range(3)])
    shape = type(gear)(points=points, faces=faces, measure="surface")
    cloud, frame, rng = placed(shape, 5, 6000)
    standard = np.stack([rotation([0, 0, 1], 2 * np.pi / 3), rotoreflection([0, 0, 1], 2 * np.pi / 3)])
    start = Framed(standard=standard, frame=tilted(frame, 3, rng), center=0.03 * rng.standard_normal(3))
    last = tuple(refine(cloud, start))[-1]
    assert np.degrees(line_angle_rad(last.state.frame[2], frame[2])) < 0.1
    assert np.abs(last.state.center).max() < 0.005


def test_atoms_are_fitted_exactly():
    rng = np.random.default_rng(6)
    atoms = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    turn = random_orthogonal(rng)
    start = single_plane(Plane(normal=turn @ [1, 1, 0.08], offset=0.03))
    last = tuple(refine(isolated_points(atoms @ turn.T), start, start_error_rad=0.2))[-1]
    (plane,) = last.state.planes
    assert line_angle_rad(plane.normal, turn @ [1, 1, 0]) < 1e-4
    assert abs(plane.offset) < 1e-4


# What each iterate says


def test_iterates_count_from_the_start_and_cannot_be_changed():
    shape, operations = CASES["table"]
    cloud, frame, rng = placed(shape, 7, 4000, 0.005)
    start = operations(tilted(frame, 3, rng))
    history = tuple(refine(cloud, start))
    assert [i.index for i in history] == list(range(len(history)))
    first = history[0]
    assert first.state is start
    assert (first.inliers, first.converged, first.pairs) == (0, False, ())
    assert [i.converged for i in history[:-1]] == [False] * (len(history) - 1)
    for i in history[1:]:
        assert len(i.pairs) == 4
        assert i.inliers == sum(len(p.sources) for p in i.pairs) > 1000
        assert i.cost > 0
        assert i.step > 0
    with pytest.raises(FrozenInstanceError):
        first.index = 5
    for array in (history[1].theta_rad, history[1].covariance, history[1].state.frame, history[1].state.center):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    # Each state was kept, not overwritten by the next.
    assert all(np.abs(a.state.frame - b.state.frame).max() > 0 for a, b in pairwise(history))


def test_refinement_is_a_function_of_its_arguments():
    first, _ = run("table", 8, noise=0.01)
    again, _ = run("table", 8, noise=0.01)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.state.frame, b.state.frame)
        np.testing.assert_array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("limit", [0, 1, 2])
def test_no_more_outer_iterations_than_there_may_be(limit, monkeypatch):
    monkeypatch.setattr("symrefine.fit.refine.MAX_OUTER", limit)
    history, _ = run("stool", 9, noise=0.01)
    assert len(history) == limit + 1
    assert not history[-1].converged


@pytest.mark.parametrize("name", ["table", "box", "mug"])
def test_refinement_turns_with_the_cloud(name):
    shape, operations = CASES[name]
    rng = np.random.default_rng(10)
    points, normals, _ = sample_surface(shape, 2000, rng)
    points -= points.mean(axis=0)
    turn, frame = random_orthogonal(rng), tilted(np.eye(3), 2, rng)
    several = []
    for r in (np.eye(3), turn):
        cloud = local_planes(points @ r.T, 2000, np.random.default_rng(0), normals=normals @ r.T, exact=True)
        several.append(tuple(refine(cloud, operations(frame @ r.T)))[-1].state)
    # A lone plane's frame may stand anyhow about its normal, and when a step counts as small goes by its components.
    atol = 2e-4 if name == "mug" else 1e-7
    for a, b in zip(several[0].planes, several[1].planes, strict=True):
        assert line_angle_rad(turn @ a.normal, b.normal) < atol
        assert abs(a.offset) == pytest.approx(abs(b.offset), abs=atol)


@pytest.mark.parametrize("off_deg", [-2.0, 1.0, 3.0])
def test_theta_of_each_plane_is_the_turn_it_asks_for(off_deg):
    shape, operations = CASES["table"]
    cloud, frame, _ = placed(shape, 11, 6000, exact=True)
    start = operations((rotation(frame[2], np.radians(off_deg)) @ frame.T).T)
    history = tuple(refine(cloud, start))
    assert history[1].theta_rad.shape == (4,)
    # The first matches already ask for most of the way back; those of the last nothing any more.
    np.testing.assert_allclose(np.degrees(history[1].theta_rad), -off_deg, atol=0.4 * abs(off_deg))
    np.testing.assert_allclose(np.degrees(history[-1].theta_rad), 0.0, atol=0.05)


# How far a step goes, and when it was the last


@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5, 0.65])
def test_shrinking_steps_are_extrapolated_to_their_sum(ratio):
    """Steps x, q x, q^2 x, ... of which the second was found: what is left is q x / (1 - q)."""
    x = np.array([0.01, -0.02, 0.03, 0.0, 0.01, 0.02])
    assert _remaining(ratio * x, x) == pytest.approx(1.0 / (1.0 - ratio))
    assert _remaining(ratio * x, 100.0 * ratio * x) < 1.02


def test_steps_are_taken_as_they_are_where_they_turn_or_do_not_shrink():
    x, across = np.array([1.0, 0, 0, 0, 0, 0]), np.array([0.0, 1, 0, 0, 0, 0])
    assert _remaining(x, np.zeros(6)) == _remaining(np.zeros(6), x) == 1.0  # the first one, and none
    for other in (across, -0.5 * x, 0.4 * across + 0.3 * x):
        assert _remaining(other, x) == 1.0
    for ratio in (0.96, 1.0, 3.0):
        assert _remaining(ratio * x, x) == 1.0
    assert _remaining(0.9 * x, x) == pytest.approx(1.0 / (1.0 - LONGEST))


def test_the_last_step_is_small_or_within_the_noise():
    """A refinement goes on until a step is negligible beside what the noise leaves uncertain, and no longer."""
    steps = []
    for seed in range(4):
        history, _ = run("table", seed, noise=0.01, count=4000)
        uncertain = np.sqrt(np.diag(history[-1].covariance)).max()
        assert history[-1].step <= max(SETTLED, WITHIN_NOISE * uncertain) / (1.0 - LONGEST)
        steps.append(history[-1].step)
    # Noise ends most of them long before the step is as small as exact points would take.
    assert np.median(steps) > SETTLED


def test_under_noise_steps_that_shrink_evenly_are_not_taken_one_by_one():
    """Two per cent of noise let each step cover a half of the way or less: by themselves they would be eight or so."""
    shape, operations = CASES["table"]
    taken = []
    for seed in range(4):
        cloud, frame, rng = placed(shape, seed, 4000, 0.02)
        history = tuple(refine(cloud, operations(tilted(frame, 3, rng))))
        assert history[-1].converged
        taken.append(len(history) - 1)
    assert np.mean(taken) < 6.7


def test_the_gate_narrows_with_the_steps():
    """No pair is farther apart than the spacing and what the last step may still move a point by, thrice."""
    # Points all over the place: some stand as far from where they should as the gate lets them.
    shape, operations = CASES["table"]
    rng, moments = np.random.default_rng(14), shape_moments(shape, 2)
    points = (sample(shape, 6000, 0.01, rng) - moments.center) / moments.scale
    cloud = local_planes(np.concatenate([points, rng.uniform(-1.5, 1.5, (300, 3))]), 3000, rng)
    history = tuple(refine(cloud, operations(tilted(np.eye(3), 3, rng)), start_error_rad=0.2))
    assert len(history) > 3
    widest = []
    for before, now in pairwise(history):
        reach = 3.0 * (cloud.spacing + min(0.2, 4.0 * before.step))
        for motion, pairs in zip(before.state.motions, now.pairs, strict=True):
            moved = motion.apply(cloud.points[pairs.sources])
            apart = np.linalg.norm(moved - cloud.points[pairs.targets], axis=1)
            assert apart.max() < reach * (1 + 1e-9)
        widest.append(reach)
    assert widest[-1] < 0.5 * widest[0]


def test_the_cost_is_a_mean_over_the_pairs():
    """Fewer sources or more make no difference but chance."""
    shape, operations = CASES["table"]
    cloud, frame, rng = placed(shape, 15, 8000, 0.01)
    start = operations(tilted(frame, 1, rng))
    costs = [tuple(refine(cloud, start, stride=s))[-1].cost for s in (1, 4)]
    assert costs[1] == pytest.approx(costs[0], rel=0.2)
    # Two noisy planes apart: of the order of the square of their thickness, which neighbours share.
    assert 0.02 < costs[0] / np.median(cloud.thickness) ** 2 < 4


def test_along_an_open_pipe_nothing_moves():
    sides = Shape(BOX.points, BOX.faces[[k for k, f in enumerate(BOX.faces) if np.ptp(BOX.points[f, 2]) > 0]])
    cloud, frame, rng = placed(sides, 3, 6000, exact=True)
    off = 0.01 * rng.standard_normal(3)
    start = Framed(standard=-np.eye(3)[None], frame=frame, center=off)
    *_, last = refine(cloud, start)
    moved = frame @ last.state.center
    assert moved[2] == pytest.approx(frame[2] @ off, abs=1e-6)
    assert np.abs(moved[:2]).max() < 2e-3


# The covariance


def test_covariance_is_zero_where_nothing_can_be_seen():
    history, _ = run("mug", 12, noise=0.01)
    variance = np.diag(history[-1].covariance)
    # A lone plane, its normal on the third axis: no turn about it, no shift along it within.
    np.testing.assert_allclose(variance[[2, 3, 4]], 0.0, atol=1e-12)
    assert variance[[0, 1, 5]].min() > 0
    along, _ = run("table", 12, noise=0.01)
    assert np.diag(along[-1].covariance)[5] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(along[-1].covariance, along[-1].covariance.T, atol=1e-15)


@pytest.mark.parametrize("name", ["table", "box"])
def test_covariance_falls_with_the_number_of_points(name):
    shape, operations = CASES[name]
    variances = []
    for count in (4000, 16000):
        several = []
        for seed in range(3):
            # As many local planes from more points: they share fewer of them.
            cloud, frame, rng = placed(shape, seed, count, 0.005, planes=1000)
            last = tuple(refine(cloud, operations(tilted(frame, 1, rng))))[-1]
            several.append(np.diag(last.covariance)[:3])
        variances.append(np.mean(several, axis=0).max())
    assert 2 < variances[0] / variances[1] < 12


@pytest.mark.parametrize("name", ["table", "box"])
def test_covariance_is_that_of_the_errors(name):
    shape, operations = CASES[name]
    found, promised = [], []
    for seed in range(12):
        cloud, frame, rng = placed(shape, seed, 6000, 0.01, planes=1500)
        last = tuple(refine(cloud, operations(tilted(frame, 1, rng))))[-1]
        # Small rotation from the true frame to the found one, in the frame's coordinates.
        skew = last.state.frame @ frame.T
        found.append([skew[1, 2] - skew[2, 1], skew[2, 0] - skew[0, 2], skew[0, 1] - skew[1, 0]])
        promised.append(np.diag(last.covariance)[:3])
    measured = np.sqrt(np.mean(np.square(found), axis=0)) / 2
    # Twelve poses give a deviation to 20 %; neighbouring planes share points, which the factor `redundancy` allows for
    # only roughly. An order of magnitude is what a wrong scale or a lost weight would cost.
    ratio = measured / np.sqrt(np.mean(promised, axis=0))
    assert ratio.min() > 0.25
    assert ratio.max() < 4
