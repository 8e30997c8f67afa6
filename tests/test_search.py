"""Hypotheses one by one: what a verdict is preferred for, narrow gates, bundles, mirrors and turns of known shapes."""

import math
from dataclasses import replace
from functools import cache
from itertools import combinations, islice

import numpy as np
import pytest

from experiments.objects.shapes import bottle, box, join, mug, sample, stool
from symrefine.fit.refine import single_plane
from symrefine.gather import gather, measure
from symrefine.geometry import Isometry, Plane, line_angle_rad, random_orthogonal, unit
from symrefine.groups import point_group
from symrefine.search import (
    CORE_NOISE,
    Mirror,
    _polished,
    axis_bundle,
    axis_directions,
    closer_core,
    improper_about,
    locked,
    mirrors,
    preferred,
    refined,
    refined_closely,
    refined_if_promising,
    turns_about,
)
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE, Deviation, Verdict

NOTHING = Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
ORIGIN, X, Z = np.zeros(3), np.array([1.0, 0, 0]), np.array([0.0, 0, 1])
BOX, CUBE = join([box((0, 0, 0), (1, 0.7, 0.4))]), join([box((0, 0, 0), (1, 1, 1))])
# Two plates on a block, one of them farther out: most keeps the mirror x = 0, the plates do not.
STRAY = join([box((0, 0, 0), (1, 0.8, 0.8)), box((0.75, 0, 0), (0.1, 0.6, 0.6)), box((-0.81, 0, 0), (0.1, 0.6, 0.6))])
SHAPES = {"stool5": stool(5), "bottle": bottle(), "cube": CUBE, "box": BOX, "mug": mug(), "stray": STRAY}


def evidence_of(shape):
    return gather(measure(shape), TOLERANCE, np.random.default_rng(0))


@cache
def evidence(name):
    return evidence_of(SHAPES[name])


def verdict(excess, core=0.0):
    return Verdict(deviation=NOTHING, excess=excess, bulk=excess, detail=excess, core=core)


def orbit(name, points):
    """Points of exactly the group named, as an object of points that stand for themselves."""
    return Shape(points=np.einsum("kij,pj->kpi", point_group(name).operations(), np.array(points)).reshape(-1, 3))


ATOMS = [(1.0, 0.35, 0.2), (0.3, 0.9, 0.6), (-0.5, 0.4, 1.1)]


# Which of two fits


def test_where_most_agrees_far_better_a_larger_miss_is_preferred():
    """The promise of the fit held to what agrees: the detail out of place then shows its whole miss."""
    held, drawn = verdict(excess=3.0, core=0.1), verdict(excess=0.9, core=0.4)
    assert closer_core(held, drawn)
    assert preferred(held, drawn)
    assert not preferred(drawn, held)


def test_where_most_agrees_alike_the_smaller_miss_is_preferred():
    for a, b in ((0.30, 0.31), (0.31, 0.30), (0.0, 0.9 * CORE_NOISE), (0.9 * CORE_NOISE, 0.0)):
        assert preferred(verdict(0.5, a), verdict(0.6, b))
        assert not preferred(verdict(0.6, a), verdict(0.5, b))


def test_no_two_fits_are_preferred_to_each_other():
    several = [verdict(e, c) for e in (0.1, 0.9, 3.0) for c in (0.0, 0.06, 0.08, 0.3, 0.5)]
    for a in several:
        assert not preferred(a, a)
        assert not any(preferred(a, b) and preferred(b, a) for b in several)


# Close calls


class Counting:
    """A judge of one opinion that counts how often it is asked, and of how much."""

    def __init__(self, excess):
        self.excess, self.strides = excess, []
        self.cloud = evidence("box").judge.cloud

    def __call__(self, _, *, stride=1):
        self.strides.append(stride)
        return verdict(self.excess)


@pytest.mark.parametrize(("excess", "asked"), [(0.1, 0), (0.7, 1), (1.0, 1), (1.2, 1), (2.0, 0)])
def test_only_close_calls_go_to_the_closer_judge(excess, asked):
    first, closer = Counting(excess), Counting(0.123)
    both = replace(evidence("box"), judge=first, closer=lambda: closer)
    found = both.verdict([Isometry.about(ORIGIN, np.eye(3))], stride=3)
    assert (first.strides, closer.strides) == ([3], [3] * asked)
    assert found.excess == (0.123 if asked else excess)


def test_a_stride_leaves_about_the_sources_asked_for():
    e = evidence("box")
    total = len(e.judge.cloud.points)
    for sources in (1, 100, 400, total, 10 * total):
        left = len(e.judge.cloud.points[:: e.stride(sources)])
        assert min(sources, total) <= left < 2 * sources + 1


# Narrow gates


def in_plates(state, pairs):
    """Which sources of the stray shape stand on its plates, facing along x: there the mirror of the block misses."""
    e = evidence("stray")
    cloud = e.judge.cloud
    away = np.abs(state.planes[0].signed_distance(cloud.points[pairs.sources])) * e.moments.scale > 0.55
    return away & (np.abs(cloud.normals[pairs.sources, 0]) > 0.9)


def test_narrow_gates_keep_a_part_out_of_place_from_pulling():
    e = evidence("stray")
    true = single_plane(Plane(normal=X, offset=float(-e.moments.center[0] / e.moments.scale)))
    shares, moved = [], []
    for history in (refined(e, true, outer=1), refined_closely(e, true, sources=10**6)):
        pairs = history[1].pairs[0]
        far = in_plates(true, pairs)
        assert far.sum() > 100  # they do meet something
        shares.append(pairs.weights[far].sum() / pairs.weights.sum())
        moved.append(abs(history[1].state.planes[0].offset - true.planes[0].offset))
    assert shares[1] < 0.5 * shares[0]
    assert moved[1] < 0.2 * moved[0]


def test_what_misses_by_more_than_most_hardly_counts_in_a_close_fit():
    """Noise has no gap between what agrees and what does not: the weights fall from the median residual on."""
    points = sample(BOX, 8000, 0.01, np.random.default_rng(5))
    e = evidence_of(Shape(points=points))
    start = single_plane(Plane(normal=X, offset=0.0))
    falls = []
    for history in (refined(e, start), refined_closely(e, start, sources=10**6)):
        cloud, pairs, motion = e.judge.cloud, history[-1].pairs[0], history[-2].state.motions[0]
        between = motion.apply(cloud.points[pairs.sources]) - cloud.points[pairs.targets]
        error = np.abs(np.einsum("ij,ij->i", between, cloud.normals[pairs.targets]))
        typical = np.median(error)
        near, far = error < 0.3 * typical, (error > 3.0 * typical) & (error < 5.0 * typical)
        assert far.sum() > 20
        falls.append(pairs.weights[far].mean() / pairs.weights[near].mean())
    assert falls[1] < 0.15 < falls[0]


@pytest.mark.parametrize("off", [0.0, 0.3])
def test_narrow_gates_end_where_they_should(off):
    """A start within the gate, half a spacing, ends at the truth."""
    e = evidence("stray")
    true, spacing = float(-e.moments.center[0] / e.moments.scale), e.judge.cloud.spacing
    history = refined_closely(e, single_plane(Plane(normal=X, offset=true + off * spacing)), sources=10**6)
    assert abs(abs(history[-1].state.planes[0].offset) - abs(true)) < 0.02 * spacing


def test_a_sure_fit_is_not_locked():
    e = evidence("box")
    history = refined(e, single_plane(Plane(normal=X, offset=0.0)), outer=2)
    sure = verdict(0.1, core=1.0)
    assert locked(e, history, sure, 1) == (history, sure)


def test_a_compromise_goes_on_with_narrow_gates_where_most_then_agrees_far_better():
    """The verdict on the locked state is that of the block alone: almost nothing misses, but for the plates."""
    e = evidence("stray")
    true = float(-e.moments.center[0] / e.moments.scale)
    history = refined(e, single_plane(Plane(normal=X, offset=true + 0.01)), outer=1)
    drawn = verdict(0.9, core=5.0)
    more, held = locked(e, history, drawn, 1)
    assert held.excess > 1.0 > drawn.excess
    assert closer_core(held, drawn)
    assert more[: len(history)] == history
    assert [i.index for i in more] == list(range(len(more)))
    assert len(more) > len(history)
    assert abs(abs(more[-1].state.planes[0].offset) - abs(true)) < 1e-3
    kept, same = locked(e, history, verdict(0.9, core=0.0), 1)
    assert (kept, same.excess) == (history, 0.9)


# Mirrors and bundles about an axis


def test_an_axis_with_mirrors_offers_its_fold():
    found = list(axis_bundle(evidence("stool5"), unit([0.03, 0.02, 1.0])))
    assert [b.fold for b in found] == [5]
    assert found[0].verdict.excess < 0.5
    assert line_angle_rad(found[0].state.frame[2], Z) < np.radians(0.2)
    assert [i.index for i in found[0].history] == list(range(len(found[0].history)))
    for k in range(5):
        normal = [-np.sin(np.pi * k / 5), np.cos(np.pi * k / 5), 0]
        assert min(line_angle_rad(p.normal, normal) for p in found[0].state.planes) < np.radians(0.3)


def test_a_round_axis_offers_revolution_and_then_no_fold():
    found = list(axis_bundle(evidence("bottle"), Z))
    assert [b.fold for b in found] == [math.inf]
    assert found[0].verdict.excess < 0.3


def test_without_mirrors_only_revolution_is_asked():
    assert list(axis_bundle(evidence("stool5"), Z, mirrored=False)) == []


def test_no_axis_offers_nothing_that_holds():
    assert all(b.verdict.excess > 1.0 for b in axis_bundle(evidence("stool5"), unit([0.5, 0.3, 1.0])))


def test_only_promising_states_are_refined():
    e = evidence("box")
    near = refined_if_promising(e, single_plane(Plane(normal=[1, 0.03, 0], offset=0.0)), sources=2000, outer=4)
    assert line_angle_rad(near.planes[0].normal, X) < np.radians(0.1)
    assert refined_if_promising(e, single_plane(Plane(normal=[1, 1, 0], offset=0.0)), sources=2000, outer=4) is None


@pytest.mark.parametrize(("name", "group"), [("cube", "Oh"), ("box", "D2h"), ("stool5", "C5v")])
def test_every_mirror_comes_once(name, group):
    e = evidence(name)
    held = [m for m in mirrors(e, np.zeros((0, 3))) if m.verdict.excess <= 1.0]
    normals = point_group(group).mirrors() if name != "stool5" else [
        [-np.sin(np.pi * k / 5), np.cos(np.pi * k / 5), 0] for k in range(5)
    ]  # fmt: skip
    assert len(held) == len(normals)
    for n in normals:
        assert min(line_angle_rad(m.plane.normal, n) for m in held) < np.radians(0.3)
    assert all(m.iterations > 0 for m in held)


def test_extra_normals_come_first_and_known_ones_never():
    e = evidence("box")
    first = next(mirrors(e, Z[None]))
    assert line_angle_rad(first.plane.normal, Z) < 1e-3
    others = list(mirrors(e, Z[None], known=lambda n: abs(n @ Z) > 0.99))
    assert others
    assert all(abs(m.plane.normal @ Z) < 0.99 for m in others)


def test_no_candidate_comes_twice():
    found = [m.plane.normal for m in islice(mirrors(evidence("mug"), np.zeros((0, 3))), 8)]
    assert len(found) > 2
    assert all(line_angle_rad(a, b) > np.radians(1.5) for a, b in combinations(found, 2))


def test_a_mirror_of_a_shape_in_any_pose():
    """The plane moves with the object, and every candidate is a `Mirror` with the miss of its own plane."""
    matrix = random_orthogonal(np.random.default_rng(1), 3, -1)
    points = sample(mug(), 8000, 0.0, np.random.default_rng(2)) @ matrix.T
    e = evidence_of(Shape(points=points))
    best = min(mirrors(e, np.zeros((0, 3))), key=lambda m: m.verdict.excess)
    assert isinstance(best, Mirror)
    assert best.verdict.excess < 1.0
    assert line_angle_rad(best.plane.normal, matrix[:, 1]) < np.radians(3.0)


def test_moments_alone_put_the_mirror_of_a_mug_where_it_is():
    e = evidence("mug")
    plane = _polished(e, unit([0.08, 1.0, -0.05]))
    assert line_angle_rad(plane.normal, [0, 1, 0]) < np.radians(0.05)
    assert plane.offset == 0.0


def test_coarse_looks_judge_every_candidate_once():
    found = list(mirrors(evidence("box"), np.zeros((0, 3)), thorough=False))
    assert all(m.iterations == 0 for m in found)
    for n in np.eye(3):
        assert min(line_angle_rad(m.plane.normal, n) for m in found) < np.radians(3.0)


# Turns


@pytest.mark.parametrize(
    ("name", "direction", "order"),
    [("stool5", Z, 5), ("cube", Z, 4), ("cube", [1, 1, 1], 3), ("cube", [1, 1, 0], 2), ("box", [0, 1, 0], 2)],
)
def test_the_highest_order_about_an_axis(name, direction, order):
    found = turns_about(evidence(name), unit(direction), ORIGIN)
    assert found.order == order
    assert line_angle_rad(found.direction, direction) < np.radians(0.3)
    assert found.iterations > 0


@pytest.mark.parametrize(("name", "direction"), [("stool5", [0.6, 0.4, 1]), ("box", [1, 1, 0]), ("mug", [0, 0, 1])])
def test_no_turn_where_there_is_no_axis(name, direction):
    assert turns_about(evidence(name), unit(direction), ORIGIN) is None


def test_a_round_axis_shows_no_fold_but_keeps_turns():
    found = turns_about(evidence("bottle"), Z, ORIGIN)
    assert found.verdict.excess < 0.5


@pytest.mark.parametrize("fold", [2, 3, 4, 5, 6, 7])
def test_points_show_every_order_of_their_axis(fold):
    frame = random_orthogonal(np.random.default_rng(fold))
    e = evidence_of(Shape(points=orbit(f"C{fold}", ATOMS).points @ frame.T + 3.0))
    found = turns_about(e, frame[:, 2], ORIGIN)
    assert found.order == fold
    assert found.verdict.excess < 1e-3


@pytest.mark.parametrize(
    ("name", "order", "holds"), [("S4", 4, True), ("C4", 4, False), ("Ci", 2, True), ("S6", 6, True)]
)
def test_rotoreflections_hold_where_they_should_from_a_start_a_little_off(name, order, holds):
    e = evidence_of(orbit(name, ATOMS))
    found = improper_about(e, Z, np.array([0.02, -0.02, 0.02]), order)
    assert (found.excess < 0.05) == holds
    assert (found.excess > 2.0) != holds


# Directions worth trying


def test_axes_of_every_prime_order_are_among_the_directions():
    """Of a dodecahedron's kind of object: no principal axis says anything, the spectrum alone does."""
    matrix = random_orthogonal(np.random.default_rng(3))
    for name, orders in (("T", (2, 3)), ("O", (2, 3)), ("I", (3, 5))):
        group = point_group(name)
        e = evidence_of(Shape(points=orbit(name, [(0.9, 0.35, 0.2)]).points @ matrix.T))
        offered = axis_directions(e)
        for order in orders:
            axes = [matrix @ u for u, k in group.rotation_axes() if k == order]
            best = min(line_angle_rad(u, d) for u in axes for d in offered)
            assert best < np.radians(2.0), (name, order)


def test_principal_axes_are_among_the_directions_where_they_may_be_axes():
    matrix = random_orthogonal(np.random.default_rng(4))
    e = evidence_of(Shape(points=BOX.points @ matrix.T, faces=BOX.faces, measure="surface"))
    offered = axis_directions(e)
    for u in matrix.T:
        assert min(line_angle_rad(u, d) for d in offered) < 1e-9
