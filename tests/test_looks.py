"""Looks at candidates of open surfaces: what is left out, as it could change nothing, and what is asked together."""

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest

from experiments.objects import damage
from experiments.objects.shapes import box, join, mug, sample, table
from symrefine.decide import explore, looks
from symrefine.decide.hypotheses import Hypothesis
from symrefine.decide.looks import ASIDE, glances, looked_at, start_error
from symrefine.detection.measure import gather, measure
from symrefine.fit.placed import Placed
from symrefine.fit.refine import SHORT, refine
from symrefine.geometry import Axis, Isometry, frame_with_z, random_orthogonal
from symrefine.groups import PointGroup
from symrefine.propose.candidates import START_ERROR
from symrefine.samples import LOOK
from symrefine.shape import Shape
from symrefine.surface.clumps import Clump
from symrefine.surface.misses import SURE
from symrefine.surface.openings import Openings
from symrefine.surface.surface import Surface

MADE = {
    "hole": lambda rng: damage.hole(table(), 0.15, rng),
    "cut": lambda rng: damage.cut(table(), 0.2, rng),
    "mug": lambda rng: damage.hole(mug(), 0.1, rng),
    "view": lambda rng: damage.view(table(), np.array([0.5, 0.3, 0.8]), rng),
}


@cache
def surface_of(kind):
    """A surface that is open, and the centre of the whole in its coordinates."""
    made = MADE[kind](np.random.default_rng(4))
    measured = measure(Shape(points=made.points, viewpoint=made.viewpoint))
    surface = gather(measured, np.random.default_rng(0))[1]
    assert surface.is_open
    return surface, -measured.moments.center / measured.moments.scale


def mirrors(center, count, seed=0):
    """Mirrors through a place near the centre: two of a table, and any."""
    rng = np.random.default_rng(seed)
    normals = [np.eye(3)[0], np.eye(3)[1], *rng.normal(size=(count - 2, 3))]
    return [
        Placed(group=PointGroup(name="Cs", frame=frame_with_z(n)), center=center + 0.05 * rng.normal(size=3))
        for n in normals
    ]


@pytest.mark.parametrize("kind", MADE)
def test_what_nobody_saw_of_many_operations_is_what_nobody_saw_of_each(kind):
    surface, center = surface_of(kind)
    rng = np.random.default_rng(1)
    motions = [Isometry.about(center, random_orthogonal(rng, det=det)) for det in (1, -1, 1, -1, 1)]
    misses = surface.misses(motions)
    seen = surface.seen(misses, motions)
    assert np.isnan(seen).any()
    for k, motion in enumerate(motions):
        np.testing.assert_array_equal(seen[k], surface.seen(misses[k : k + 1], [motion])[0])


@pytest.mark.parametrize("kind", MADE)
@pytest.mark.parametrize("useful", [0.03, np.inf])
def test_a_group_is_slid_to_where_asking_everywhere_would_put_it(kind, useful):
    surface, center = surface_of(kind)
    steps = start_error(surface) / ASIDE * np.arange(-ASIDE, ASIDE + 1.0)
    for placed in mirrors(center, 8):
        way = placed.group.frame[2]
        told = looks._valley(surface, placed, way, steps, useful)
        tried = [Placed(group=placed.group, center=placed.center + s * way) for s in steps]
        every = np.array(glances(surface, tried))
        if every.min() <= useful:
            ends = [looks._lowest(steps, needs, surface.tolerance) for needs in (told, every)]
            assert abs(ends[0] - ends[1]) < steps[1] - steps[0]
        else:
            assert told.min() > useful


def test_what_no_slide_mends_is_asked_for_in_few_places(monkeypatch):
    surface, center = surface_of("mug")
    asked = []
    as_missed = Surface.misses
    monkeypatch.setattr(Surface, "misses", lambda *args, **options: asked.append(1) or as_missed(*args, **options))
    frame = frame_with_z(np.array([0.6, 0.0, 0.8]))
    steps = start_error(surface) / ASIDE * np.arange(-ASIDE, ASIDE + 1.0)
    hopeless = Placed(group=PointGroup(name="Cs", frame=frame), center=center)
    assert looks._valley(surface, hopeless, frame[2], steps, 0.03).min() > 0.03
    assert len(asked) < len(steps) // 2


def test_what_asks_to_believe_in_as_much_as_was_seen_is_not_slid(monkeypatch):
    """A mirror through the border carries all to where nobody looked: that nothing contradicts it says little."""
    surface, center = surface_of("cut")
    border = surface.cloud.points[surface.openings.line].mean(axis=0)
    through = Placed(group=PointGroup(name="Cs", frame=frame_with_z(border - center)), center=border)
    as_told = looks._told
    asked = as_told(surface, through, LOOK)[1]
    assert asked > surface.tolerance
    monkeypatch.setattr(looks, "seems", lambda *_: 0.0)
    monkeypatch.setattr(looks, "_told", lambda *args: (0.0, as_told(*args)[1], 0.0))
    monkeypatch.setattr(looks, "refine", lambda *args, **options: islice(refine(*args, **options), 1))
    monkeypatch.setattr(looks, "slid", lambda *_: pytest.fail("it is not worth a search"))
    look = looked_at(surface, through, np.inf, useful=0.5 * surface.tolerance)
    assert look.needs == as_told(surface, look.placed, LOOK)[1] > 0.5 * surface.tolerance


def test_what_is_missed_by_more_than_it_may_be_off_ends_early(monkeypatch):
    """Misses end where hardly any candidate is worth more, so that a handle on one side needs little less than fits."""
    surface, center = surface_of("mug")
    across = Placed(group=PointGroup(name="Cs", frame=frame_with_z(np.eye(3)[0])), center=center)
    steps: list[int] = []
    monkeypatch.setattr(looks, "refine", lambda *args, **given: (steps.append(1) or i for i in refine(*args, **given)))
    looked_at(surface, across, np.inf, follow=1.5 * surface.tolerance)
    assert len(steps) == SHORT + 1
    assert looked_at(surface, across, np.inf).needs > 1.5 * surface.tolerance
    assert len(steps) > 2 * (SHORT + 1)


@pytest.mark.parametrize("follow", [0.0, 0.02, 0.03, 0.05, 0.2])
@pytest.mark.parametrize("angle", [0.3, 0.8, 1.4])
def test_what_is_not_worth_to_follow_needs_more_than_that_wherever_it_is_followed_to(angle, follow, monkeypatch):
    """Mirrors through the axis of a mug but beside its handle: a bound ends the fit on a whole surface, too."""
    measured = measure(Shape(points=sample(mug(), 20000, 0.0, np.random.default_rng(4))))
    surface = gather(measured, np.random.default_rng(0))[1]
    assert not surface.is_open
    frame = frame_with_z([np.cos(angle), np.sin(angle), 0.0])
    beside = Placed(group=PointGroup(name="Cs", frame=frame), center=np.zeros(3))
    steps: list[int] = []
    monkeypatch.setattr(looks, "refine", lambda *args, **given: (steps.append(1) or i for i in refine(*args, **given)))
    told = looked_at(surface, beside, np.inf, follow=follow).needs
    ended = len(steps) == SHORT + 1
    assert (told > follow and looked_at(surface, beside, np.inf).needs > follow) if ended else follow > 0.0
    assert ended or follow > surface.tolerance


@pytest.mark.parametrize("evident", [False, True])
def test_a_border_of_hardly_a_hole_hides_nothing_of_a_group_that_no_hole_leaves(evident, monkeypatch):
    """A hole leaves what keeps its place: of a brick a mirror or two, never all three."""
    brick = sample(join([box((0, 0, 0), (1.0, 0.7, 0.4))]), 8000, 0.0, np.random.default_rng(6))
    evidence, surface = gather(measure(Shape(points=brick)), np.random.default_rng(0))
    line = np.linalg.norm(surface.cloud.points - surface.cloud.points[0], axis=1) < 0.2
    surface = replace(surface, openings=Openings(line=line, border=line, evident=evident))
    asked = []
    of_part = explore._of_part
    monkeypatch.setattr(explore, "_of_part", lambda *args: asked.append(1) or of_part(*args))
    pool = explore.explore(surface, evidence, surface.tolerance)
    assert (pool.largest.group.name, pool.at_least, bool(asked)) == ("D2h", evident, evident)


def test_what_only_hides_leaves_a_surface_closed():
    surface, _ = surface_of("hole")
    none = np.zeros(len(surface.cloud.points), dtype=bool)
    ball = Clump.of(0.05 * np.random.default_rng(7).normal(size=(50, 3)))
    hidden = replace(surface, openings=Openings(line=none, border=none, evident=False, clumps=(ball,)))
    assert (surface.is_open, hidden.is_open) == (True, False)
    assert start_error(hidden) == START_ERROR < start_error(surface)
    assert hidden.stride(LOOK) > surface.stride(LOOK)


def test_a_wedge_that_would_tell_no_more_than_the_surface_counts_as_looked_at():
    cloud = sample(table(), 20000, 0.003, np.random.default_rng(8))
    surface = gather(measure(Shape(points=cloud)), np.random.default_rng(0))[1]
    axis = Axis(direction=np.array([0.0, 0.0, 1.0]), point=np.zeros(3))
    assert surface.looked_about(axis, 2)
    assert not surface.wedges
    assert not surface.looked_about(axis, 200)


def test_where_a_group_needs_least_is_looked_for_as_far_as_it_gets_less():
    """A fit that ends far up a valley says that it is off by little: the valley is followed to its ground."""
    points = sample(join([box((0, 0, 0), (1, 2, 3))]), 4000, 0.0, np.random.default_rng(0))
    measured = measure(Shape(points=points))
    surface = gather(measured, np.random.default_rng(0))[1]
    center = -measured.moments.center / measured.moments.scale
    true = Placed(group=PointGroup(name="Cs", frame=frame_with_z(np.eye(3)[0])), center=center)
    sigma, way = 0.01, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    state = true.framed().moved(-32.0 * sigma * way)
    start = next(refine(surface.cloud, state, start_error_rad=START_ERROR))
    ended = replace(start, covariance=np.diag((sigma * way) ** 2))
    found = looks.least_around(surface, true, [ended])  # a Gaussian ends at four
    assert abs(found.group.frame[2] @ true.group.frame[2]) > np.cos(2.0 * sigma)


def test_a_start_may_be_off_by_what_few_samples_tell_and_atoms_are_no_samples():
    points = sample(join([box((0, 0, 0), (1, 2, 3))]), 400, 0.0, np.random.default_rng(0))
    errors = [
        start_error(gather(measure(Shape(points=p, isolated=alone)), np.random.default_rng(0))[1])
        for p, alone in ((points, None), (points[:40], True))
    ]
    assert errors == [SURE / 20.0, START_ERROR]


def test_what_needs_something_alone_is_not_joined_before_it_is_fitted(monkeypatch):
    """A group needs no less than its elements, and a join at once is kept only where it needs nothing."""
    surface, center = surface_of("mug")
    one, other = mirrors(center, 2)
    element = explore.judged(surface, one).elements[0]
    pool = explore.Pool(nothing=0.001, limit=0.03, largest=Hypothesis(placed=one, elements=(element,), need=0.0))
    look = looks.Look(placed=other, history=(), needs=0.01, error_rad=START_ERROR)
    monkeypatch.setattr(explore, "_glanced", lambda *_: [(other, 0.0)])
    monkeypatch.setattr(explore, "looked_at", lambda *_, **__: look)
    monkeypatch.setattr(explore, "fitted", lambda *_, **__: Hypothesis(placed=other, elements=(), need=0.1))
    joined = []
    monkeypatch.setattr(explore, "_joined_at_once", lambda _, pool, start: joined.append(start) or pool)
    explore._tried(surface, pool, [other])
    assert not joined
    explore._tried(surface, replace(pool, nothing=0.01), [other])
    assert joined == [other]
