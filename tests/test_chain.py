"""Chains of groups: one inside the next, needs ascending, exact elements first; more tolerance, more group."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.objects import household
from experiments.objects.boundary import instance
from experiments.objects.parts import hull
from experiments.objects.shapes import box, join, revolve, sample
from experiments.studies import groups
from experiments.studies.boundary import Case, look
from symrefine.decide.chain import _best, chain, excluding
from symrefine.decide.explore import _holding, _with, explore
from symrefine.decide.hypotheses import NOTHING, Hypothesis, fitted, single
from symrefine.decide.joins import _told_apart, better_parts
from symrefine.decide.looks import by_chance
from symrefine.decide.pool import Pool
from symrefine.decide.posterior import ALIKE, Link, decide, lenience
from symrefine.detection.measure import gather, measure
from symrefine.detection.story import detect
from symrefine.fit.placed import Placed, joined
from symrefine.geometry import frame_with_z, line_angle_rad, random_orthogonal, rotation
from symrefine.groups import is_subgroup, point_group
from symrefine.propose.candidates import proposals
from symrefine.rounding import START_ERROR
from symrefine.samples import FOLLOWED
from symrefine.shape import Shape
from symrefine.surface.misses import LIMITS

# What `detect` asks for at most, and what it takes a molecule for.
LIMIT, TOLERANCE = 0.03, 0.02
TOLERANCES = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08)
GROUPS = "Cs C2 C3 C4 C2v C3v C2h C3h S4 D2 D3 D2h D3h D2d D3d T Td O Oh".split()


def molecule(name, noise, seed):
    """Orbits of two random points under a group in a random pose, each atom displaced by a fraction of the size."""
    rng = np.random.default_rng(seed)
    group = point_group(name, random_orthogonal(rng))
    points = np.einsum("kij,pj->kpi", group.operations(), rng.standard_normal((3, 3))).reshape(-1, 3)
    return points + noise * np.linalg.norm(points, axis=1).max() * rng.standard_normal(points.shape), group


def linked(points, limit, reach):
    evidence, surface = gather(measure(Shape(points=points)), np.random.default_rng(0))
    pool = explore(surface, evidence, limit)
    return chain(surface, pool, reach), pool, surface


def check_chain(links, limit):
    """What every chain obeys."""
    assert links[0] is NOTHING
    needs = [h.need for h in links]
    assert needs == sorted(needs)
    # Only the last may be beyond the limit.
    assert all(n <= limit for n in needs[:-1])
    for below, above in pairwise(links):
        assert above.holds(below.placed)
        assert above.group.order > below.group.order
        assert above.elements


@settings(max_examples=4, deadline=None)
@given(st.sampled_from(GROUPS), st.sampled_from([0.0, 0.003, 0.01, 0.03]), st.integers(0, 10**6))
def test_groups_lie_one_inside_the_next_and_needs_ascend(name, noise, seed):
    points, _ = molecule(name, noise, seed)
    links, pool, _ = linked(points, TOLERANCE, LIMIT)
    check_chain(links, LIMIT)
    assert pool.largest.need <= TOLERANCE


@settings(max_examples=4, deadline=None)
@given(st.sampled_from(GROUPS), st.integers(0, 10**6))
def test_an_exact_group_is_the_whole_chain_and_needs_nothing(name, seed):
    points, group = molecule(name, 0.0, seed)
    links, pool, _ = linked(points, TOLERANCE, TOLERANCE)
    check_chain(links, TOLERANCE)
    exact = [h for h in links if h.need < 1e-6]
    assert exact[-1].group.name == name
    assert is_subgroup(group, exact[-1].group, 1e-3)
    assert pool.largest.holds(exact[-1].placed)


@settings(max_examples=3, deadline=None)
@given(st.sampled_from(GROUPS[:12]), st.floats(0.0, 0.02), st.integers(0, 10**6))
def test_the_group_grows_with_the_tolerance(name, noise, seed):
    """Of one table: the group at a larger tolerance holds the one at a smaller."""
    points, _ = molecule(name, noise, seed)
    links, _, _ = linked(points, TOLERANCE, 1.5 * max(TOLERANCES))
    check_chain(links, 1.5 * max(TOLERANCES))
    chosen = [decide([Link(need=h.need) for h in links[1:]], t).index for t in TOLERANCES]
    assert chosen == sorted(chosen)
    for below, above in pairwise(chosen):
        assert links[above].holds(links[below].placed)


def bent_to(sub, bent):
    """Atoms of D3d displaced by up to a length in a way that keeps a subgroup exactly."""
    rng = np.random.default_rng(3)
    whole = point_group("D3d")
    directions = [*(u for u, _ in whole.rotation_axes()), *whole.mirrors()]
    turns = point_group("C12").operations()
    placements = (point_group(sub, t @ frame_with_z(u)) for u in directions for t in turns)
    subgroup = next(g for g in placements if is_subgroup(g, whole, 1e-6))
    points = np.einsum("kij,pj->kpi", whole.operations(), rng.standard_normal((3, 3))).reshape(-1, 3)
    shift = rng.standard_normal(points.shape)
    # The mean of the shifts over the subgroup: every operation takes each atom to one, and its shift along.
    moved = np.zeros_like(points)
    for g in subgroup.operations():
        partner = np.linalg.norm((points @ g.T)[:, None] - points, axis=2).argmin(axis=1)
        moved[partner] += shift @ g.T
    return (points + bent * moved / np.abs(moved).max()) @ random_orthogonal(rng).T


@pytest.mark.parametrize("sub", ["C3v", "D3", "C2h", "Ci", "Cs"])
def test_what_is_exact_comes_first_and_stays(sub):
    """The chain passes through the subgroup that is exact to the group that needs some tolerance."""
    links, _, _ = linked(bent_to(sub, 0.05), TOLERANCE, LIMIT)
    check_chain(links, LIMIT)
    exact = [h for h in links if h.need < 1e-6]
    assert exact[-1].group.name == sub
    assert links[-1].group.name == "D3d"
    assert links[-1].need > 0.003


@pytest.mark.parametrize("sub", ["C3v", "Ci"])
def test_how_far_the_chain_reaches_changes_nothing_below(sub):
    """The exact group is told whether larger tolerances are asked for besides, or not."""
    points = bent_to(sub, 0.02)
    links, pool, surface = linked(points, TOLERANCE, LIMIT)
    further = chain(surface, pool, 0.12)
    assert links[1].group.name == sub
    assert further[1].group.name == sub


def test_a_larger_group_that_holds_poorly_replaces_no_exact_one():
    """A ring of 100 atoms is nearly one of revolution: at any tolerance its own group stays in the chain."""
    angle = 2.0 * np.pi * np.arange(100) / 100
    atoms = (
        np.column_stack([np.cos(angle), np.sin(angle), np.zeros(100)]) @ random_orthogonal(np.random.default_rng(2)).T
    )
    for limit in (0.0005, 0.005, 0.01, 0.02):
        links, _, _ = linked(atoms, limit, 1.5 * limit)
        check_chain(links, 1.5 * limit)
        assert links[1].group.name == "D100h"
        assert links[1].need < 1e-6


def test_the_exact_mirror_of_a_group_that_nearly_holds_is_found():
    """Three legs, one of them too far out: its mirror stays exact, off the centroid, while the three nearly hold."""
    rng = np.random.default_rng(3)
    legs = [(np.cos(a), np.sin(a)) for a in 2.0 * np.pi * np.arange(3) / 3]
    parts = [box((0.9 * x, 0.9 * y, 0.0), (0.1, 0.1, 0.6)) for x, y in legs[1:]]
    parts.append(box((0.98, 0.0, 0.0), (0.1, 0.1, 0.6)))
    turn = random_orthogonal(rng)
    points = sample(join([*parts, box((0.0, 0.0, 0.35), (0.8, 0.8, 0.1))]), 8000, 0.0, rng) @ turn.T
    links, _, _ = linked(points, TOLERANCE, LIMIT)
    assert links[1].group.name == "Cs"
    assert abs(links[1].group.frame[2] @ turn[:, 1]) > 0.999


# Pools made by hand

ORIGIN = np.zeros(3)


def atoms():
    points = np.einsum("kij,pj->kpi", point_group("C6v").operations(), [[1.0, 0.3, 0.2], [0.4, 0.9, -0.7]])
    return Shape(points=points.reshape(-1, 3))


@cache
def ring():
    """Atoms of C6v, and a surface of theirs."""
    return gather(measure(atoms()), np.random.default_rng(0))


def of(name):
    return fitted(ring()[1], Placed(group=point_group(name), center=ORIGIN))


def needing(found, need, turns=None):
    """A group as if it and its elements needed so much, those that are no planes other than that if told."""
    each = [need if turns is None or e.operations.kind == "plane" else turns for e in found.elements]
    elements = tuple(replace(e, need=own) for e, own in zip(found.elements, each, strict=True))
    return replace(found, need=need, elements=elements)


def test_of_nothing_the_chain_is_nothing():
    assert chain(ring()[1], Pool(), LIMIT) == (NOTHING,)


def test_parts_of_one_need_are_joined_at_once():
    links = chain(ring()[1], Pool(small=(of("C2"), of("C3"))), LIMIT)
    assert [h.group.name for h in links] == ["C1", "C6"]
    assert links[1].need < 1e-9


def test_the_largest_group_brings_its_exact_elements():
    links = chain(ring()[1], Pool(largest=needing(of("C6v"), 0.025, turns=0.0), limit=LIMIT), LIMIT)
    assert [h.group.name for h in links][:2] == ["C1", "C6"]
    assert links[1].need < 1e-9


def test_a_group_that_is_not_the_largest_brings_its_better_elements_as_well():
    """Turns of a fat screw hold, and its mirrors nearly: it was C1, and sure, as all were joined to what is round."""
    links = chain(ring()[1], Pool(small=(needing(of("C2v"), 0.02, turns=0.01),), limit=LIMIT), LIMIT)
    assert [h.group.name for h in links] == ["C1", "C2", "C2v"]
    assert links[-1].need == 0.02


def test_what_needs_more_together_than_the_best_alone_comes_after_it():
    """Needs are the same within one factor: not each of the parts within it, and then all of them once more."""
    whole = needing(of("C2v"), 0.019)
    mirror = next(single(e).placed for e in whole.elements if e.operations.kind == "plane")
    parts = (needing(of("C2"), 0.010), needing(fitted(ring()[1], mirror), 0.014), whole)
    links = chain(ring()[1], Pool(small=parts), LIMIT)
    assert [(h.group.name, h.need) for h in links] == [("C1", 0.0), ("C2", 0.010), ("C2v", 0.019)]


def test_groups_are_joined_in_the_order_of_what_they_need():
    parts = [needing(of(name), need) for name, need in (("C3", 0.001), ("C2", 0.01), ("C2v", 0.02))]
    links = chain(ring()[1], Pool(small=tuple(parts[::-1])), LIMIT)
    assert [h.group.name for h in links] == ["C1", "C3", "C6", "C6v"]
    assert [h.need for h in links] == sorted(h.need for h in links)


def test_of_mirrors_that_need_as_much_each_may_be_meant():
    """As of those that a hole leaves possible, one by what is there and one by what may be missing."""
    one, other = (
        replace(of("Cs"), placed=Placed(group=point_group("Cs", rotation([1, 0, 0], a)), center=ORIGIN))
        for a in (0.0, np.pi / 3)
    )
    one = replace(one, need=0.011)
    for need, rivals in ((0.013, 1), (0.025, 0)):
        best = _best([replace(other, need=need), one], 0.001, 0.001)
        assert best.placed is one.placed
        assert best.share == pytest.approx(1.0 / (1.0 + rivals))


def test_a_lone_mirror_rivals_what_asks_for_as_much_belief():
    """Belief in what nobody saw of it takes more of what it is forgiven, as it is forgiven more, and no more doubt."""
    frame, more = rotation([1, 0, 0], np.pi / 3), lenience("Cs")
    assert more > ALIKE
    mirror = replace(of("Cs"), placed=Placed(group=point_group("Cs", frame), center=ORIGIN), need=0.01 * more)
    turn = replace(of("C2"), need=0.01, believed=0.01)
    for believed, rivals in ((0.01 * more, 1), (0.0, 0)):
        assert len(_best([turn, replace(mirror, believed=believed)], 0.001, 0.001).rivals) == rivals


def test_of_mirrors_that_need_nothing_the_one_is_told_that_most_speaks_for():
    """The diagonal of a seat, most of which nobody saw, missed by a little less in what was seen than the true one."""

    def mirror(angle, mean, supported):
        placed = Placed(group=point_group("Cs", rotation([1, 0, 0], angle)), center=ORIGIN)
        (element,) = of("Cs").elements
        coverage = replace(element.coverage, supported=supported, unseen=1.0 - supported)
        element = replace(element, deviation=replace(element.deviation, mean=mean), coverage=coverage)
        return replace(of("Cs"), placed=placed, need=0.0, elements=(element,))

    diagonal, true = mirror(0.0, 0.00036, 0.26), mirror(np.pi / 4, 0.00039, 0.76)
    assert _best([diagonal, true], 0.008, 0.008).placed is true.placed
    assert _best([diagonal, mirror(np.pi / 4, 0.00039, 0.26)], 0.008, 0.008).placed is diagonal.placed


def test_of_two_that_need_as_little_each_may_be_off():
    """Of what is round but for a label noise leaves any mirror near its own, which was a rival: C1, at .5."""
    for tilt, rivals in ((1.5, 0), (2.5, 1)):
        frame = rotation([1, 0, 0], tilt * START_ERROR)
        aside = replace(of("Cs"), placed=Placed(group=point_group("Cs", frame), center=ORIGIN), need=0.0)
        across = replace(of("C3h"), need=0.0)
        best = _best([aside, across], 0.001, 0.001)
        assert (best.group.name, len(best.rivals)) == ("C3h", rivals)
    # But a turn by a third is none by elevenths, however far axes may be off.
    many = Placed(group=point_group("C11"), center=ORIGIN)
    assert len(_best([replace(of("C3"), need=0.0), replace(of("C6"), placed=many, need=0.0)], 0.001, 0.001).rivals) == 1


def test_a_mirror_shows_its_image_where_all_was_seen_and_itself_anywhere():
    turned = [Placed(group=point_group("Cs", rotation([1, 0, 0], a)), center=ORIGIN) for a in (0.0, 0.7, -0.7)]
    largest, seen, image = turned
    pool = Pool(largest=replace(of("Cs"), placed=largest), looked=((seen, 0.05),))
    assert pool.shows(image, 0.05)
    assert not pool.shows(image, 0.05, whole=False)
    assert pool.shows(seen, 0.05, whole=False)


def test_what_seems_beyond_the_limit_is_denied_once_fits_of_what_seemed_no_worse_came_to_nothing():
    pool = Pool(limit=LIMIT, vain=(1.1 * LIMIT,) * FOLLOWED)
    assert pool.denies(1.1 * LIMIT)
    assert not pool.denies(1.05 * LIMIT)
    assert not replace(pool, vain=pool.vain[1:]).denies(1.1 * LIMIT)
    assert not replace(pool, vain=(0.5 * LIMIT,) * FOLLOWED).denies(LIMIT)


def test_what_needs_more_than_the_limit_is_left_out():
    parts = (replace(of("C3"), need=0.001), replace(of("C2"), need=2 * LIMIT))
    links = chain(ring()[1], Pool(small=parts), LIMIT)
    assert [h.group.name for h in links] == ["C1", "C3"]


def test_in_noise_as_thick_as_the_tolerance_what_is_doubted_hides_no_part_that_holds():
    """What two parts make needs less than three quarters of what noise does, for which it is doubted all the same."""
    whole = replace(of("C6v"), need=0.7 * TOLERANCE)
    whole = replace(whole, elements=tuple(replace(e, need=whole.need) for e in whole.elements))
    noisy = replace(ring()[1], noise=np.full(100, LIMITS[0] * TOLERANCE), tolerance=TOLERANCE)
    links = chain(noisy, Pool(largest=whole, small=(of("C6"), of("C3v"))), LIMIT)
    assert [h.group.name for h in links] == ["C1", "C6", "C6v"]
    assert decide([Link(need=h.need) for h in links[1:]], TOLERANCE, noisy.floor).index == 1


def test_a_group_that_fails_is_told_with_what_it_needs():
    """C5 is no group of the ring: joined with C3 nothing is exact, and the chain says by how much."""
    links = chain(ring()[1], Pool(small=(of("C3"), of("C12"))), LIMIT)
    assert links[1].group.name == "C3"
    assert all(h.need > LIMIT for h in links[2:])
    assert len(links) <= 3


def test_groups_that_generate_none_do_not_stop_the_chain():
    """Axes of order 3 at an angle that no group has, one of them nearly exact as it claims: each is tried alone."""
    frame = rotation([1, 0, 0], np.radians(30.0))
    tilted = replace(of("C3"), placed=Placed(group=point_group("C3", frame), center=ORIGIN), need=0.001)
    links = chain(ring()[1], Pool(small=(of("C3"), tilted, of("C2"))), LIMIT)
    exact = [h.group.name for h in links if h.need < 0.001]
    assert exact[-1] == "C6"
    assert set(exact) <= {"C1", "C2", "C3", "C6"}


def test_of_groups_that_hold_and_exclude_one_another_none_is_sure():
    """A kettle showed one view a mirror and turns of order 4, which together make C4v, which it has not."""
    tilted = Placed(group=point_group("C2", rotation([1, 0, 0], np.radians(30.0))), center=ORIGIN)
    turned = Placed(group=point_group("C6", rotation([1, 0, 0], np.radians(30.0))), center=ORIGIN)
    whole, inside, found = of("C6"), of("C2"), detect(atoms()).examined
    for others, named, share in (
        ([inside], 1.0, 1.0),
        ([replace(inside, placed=tilted)], 0.5, 1.0),
        ([replace(whole, placed=turned)], 1.0, 0.5),
        ([replace(inside, placed=tilted), replace(whole, placed=turned)], 1.0, 0.5),
    ):
        best = _best([*others, whole], TOLERANCE, TOLERANCE)
        assert best.group.name == "C6"
        assert (best.named, best.share) == (named, share)
        assert replace(found, links=(NOTHING, best)).decided(TOLERANCE).inside[1] == pytest.approx(named, abs=1e-3)
    # What needs more than noise, and more than the best, is no rival of it.
    assert _best([replace(inside, placed=tilted, need=0.1 * TOLERANCE), whole], TOLERANCE, 0.0).named == 1.0


@pytest.mark.parametrize(("need", "kept"), [(0.5 * LIMIT, 1), (2.0 * LIMIT, 2)])
def test_what_a_larger_group_may_hold_as_well_excludes_nothing(need, kept):
    """Of one view of a cube two of its groups hold beside one another, and all of it nearly does."""
    tilted, turned = (
        Placed(group=point_group(name, rotation([1, 0, 0], np.radians(30.0))), center=ORIGIN) for name in ("C2", "C6")
    )
    ball = Hypothesis(placed=Placed(group=point_group("Kh"), center=ORIGIN), elements=(), need=need)
    _, link, _ = excluding((NOTHING, replace(of("C6"), rivals=(tilted, turned)), ball), LIMIT)
    assert [r.group.name for r in link.rivals] == ["C2", "C6"][2 - kept :]


def test_which_groups_exclude_one_another_is_a_matter_of_the_tolerance():
    """Whichever was asked for: the staircase reads the same table."""
    tilted = Placed(group=point_group("C2", rotation([1, 0, 0], np.radians(30.0))), center=ORIGIN)
    ball = Hypothesis(placed=Placed(group=point_group("Kh"), center=ORIGIN), elements=(), need=ALIKE * TOLERANCE)
    links = (NOTHING, replace(of("C6"), rivals=(tilted,)), ball)
    found = replace(detect(atoms()).examined, links=links)
    assert found.decided(0.9 * TOLERANCE).inside[1] == pytest.approx(0.5, abs=1e-3)
    assert found.decided(TOLERANCE).inside[1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", ["Cinfv", "Dinfh"])
def test_a_round_group_shows_what_was_seen_across_its_axis_all_around_it(name):
    """Of what stands across, one place tells of all; of what is inside, each place may hold better than the others."""
    frame = random_orthogonal(np.random.default_rng(5), 3, 1)
    largest = Hypothesis(
        placed=Placed(group=point_group(name, frame), center=ORIGIN), elements=NOTHING.elements, need=0
    )

    def turned(group, angle, tilt=np.pi / 2):
        across = rotation(frame[2], angle) @ rotation(frame[0], tilt) @ frame[2]
        return Placed(group=point_group(group, frame_with_z(across)), center=ORIGIN)

    tilt = 1.0
    pool = Pool(largest=largest, looked=((turned("C3", 0.3, tilt), 0.03), (turned("Cs", 0.3), 0.03)))
    assert pool.shows(turned("C3", 2.0, tilt), 0.03)
    assert not pool.shows(turned("C3", 2.0, tilt), 0.01)
    assert not pool.shows(turned("C3", 2.0, 0.7), 0.03)
    assert not pool.shows(turned("C5", 2.0, tilt), 0.03)
    assert not pool.shows(turned("Cs", 2.0), 0.03)
    # There it tells of itself, and of what noise leaves no better at a glance.
    assert pool.shows(turned("Cs", 0.31), 0.03)
    assert not pool.shows(turned("Cs", 0.35), 0.03)
    assert not pool.shows(turned("Cs", 0.31), 0.015)
    assert replace(pool, nothing=0.02).shows(turned("Cs", 0.31), 0.015)


def test_a_start_that_looks_no_better_is_not_looked_at_where_a_look_has_been():
    def mirror(angle):
        return Placed(group=point_group("Cs", frame_with_z([np.cos(angle), np.sin(angle), 0.0])), center=ORIGIN)

    pool = Pool(looks=((0.02, mirror(0.0)),))
    assert pool.shows(mirror(0.02), 0.02)
    assert not pool.shows(mirror(0.02), 0.019)
    assert not pool.shows(mirror(2.1 * START_ERROR), 0.02)
    assert not pool.shows(Placed(group=mirror(0.02).group, center=np.array([0.2, 0.0, 0.0])), 0.02)


def test_what_an_exact_group_carries_to_a_start_is_known_as_far_as_samples_tell():
    """Of what keeps all that was seen an image needs as much; a mirror half a turn of it away is of another kind."""

    def mirror(turns):
        across = rotation([0, 0, 1], 2.0 * np.pi / 60.0 * turns) @ [1.0, 0.0, 0.0]
        return Placed(group=point_group("Cs", frame_with_z(across)), center=ORIGIN)

    placed = Placed(group=point_group("C60"), center=ORIGIN)
    element = of("C3").elements[0]
    hidden = replace(element, coverage=replace(element.coverage, unseen=0.01))
    exact = Pool(largest=Hypothesis(placed=placed, elements=(element,), need=0.0), looks=((0.02, mirror(0.0)),))
    parted = replace(exact, largest=replace(exact.largest, elements=(hidden,)))
    assert exact.shows(mirror(4.2), 0.015, whole=False)
    assert not exact.shows(mirror(4.2), 0.01, whole=False)
    assert not exact.shows(mirror(4.3), 0.02, whole=False)
    assert not parted.shows(mirror(4.0), 0.02, whole=False)
    assert not replace(exact, largest=replace(exact.largest, need=0.001)).shows(mirror(4.2), 0.015)


def test_beside_what_is_exact_only_what_goes_with_it_is_wanted():
    frame = random_orthogonal(np.random.default_rng(6), 3, 1)

    def pool(name, need=0.0, unseen=0.0):
        placed, element = Placed(group=point_group(name, frame), center=ORIGIN), of("C3").elements[0]
        element = replace(element, coverage=replace(element.coverage, unseen=unseen))
        return Pool(largest=Hypothesis(placed=placed, elements=(element,), need=need))

    def start(name, tilt):
        axis = rotation(frame[0], tilt) @ frame[2]
        return Placed(group=point_group(name, frame_with_z(axis)), center=ORIGIN)

    across, oblique, nearly = np.pi / 2, 1.0, np.pi / 2 - 0.5 * START_ERROR
    goes = [("Cs", across), ("Cs", nearly), ("C2", across), ("Cs", 0.0), ("C38", 0.0), ("S6", 0.0), ("Cinfv", 0.0)]
    for name, tilt in (*goes, ("Kh", oblique)):
        assert pool("C19").wants(start(name, tilt), START_ERROR)
    along = [(name, 0.0) for name in ("C14", "S14", "Oh")]
    for name, tilt in (*along, ("Cs", oblique), ("C2", oblique), ("C3", across), ("Cinfv", across)):
        assert not pool("C19").wants(start(name, tilt), START_ERROR)
        assert pool("C19", need=0.01).wants(start(name, tilt), START_ERROR)
        assert pool("C19", unseen=0.01).wants(start(name, tilt), START_ERROR)
        assert pool("C5", unseen=0.01).wants(start(name, tilt), START_ERROR)
    for name, tilt in (("Cs", oblique), ("C2", oblique), ("S14", 0.0), ("Oh", 0.0), ("C3", 1.38)):
        assert pool("C5").wants(start(name, tilt), START_ERROR)
    for name, tilt in (("C2", 0.8), ("C7", 0.5), ("C14", 0.0), ("C3", across), ("Cinfv", across), ("C4", oblique)):
        assert not pool("C5").wants(start(name, tilt), START_ERROR)
    assert not pool("C19").wants(start("Cs", nearly - START_ERROR), START_ERROR)
    assert pool("C19").wants(start("Cs", nearly - START_ERROR), 2.0 * START_ERROR)
    assert not pool("Oh").wants(start("C5", oblique), START_ERROR)
    assert pool("Oh").wants(start("Kh", oblique), START_ERROR)


def test_what_noise_hides_the_needs_of_tells_of_nothing_but_itself_once_something_larger_was_found():
    """It may stand off as well, and so do its images: a tab's mirror was 4.6 degrees off where a fit at one counted."""
    frame = random_orthogonal(np.random.default_rng(8), 3, 1)
    element = of("C3").elements[0]

    def across(azimuth):
        axis = rotation(frame[2], azimuth) @ frame[0]
        return Placed(group=point_group("Cs", frame_with_z(axis)), center=ORIGIN)

    turns, mirrored = (
        Hypothesis(placed=Placed(group=point_group(name, frame), center=ORIGIN), elements=(element,), need=need)
        for name, need in (("C23", 0.0), ("C23v", 0.01))
    )
    fitted_mirror = Hypothesis(placed=across(0.01), elements=(element,), need=0.01)
    pool = Pool(largest=mirrored, small=(turns, fitted_mirror), nothing=0.005)
    image, oblique = across(0.01 + 2.0 * np.pi / 23 * 7), frame_with_z(frame[2] + frame[0])
    assert pool.exact is NOTHING
    assert pool.met(across(0.01))
    assert not pool.met(image)
    assert not pool.shows(image, 0.01, whole=False)
    assert pool.wants(Placed(group=point_group("C3", oblique), center=ORIGIN), START_ERROR)
    largest = replace(pool, largest=turns, small=(fitted_mirror,))
    assert largest.exact is turns
    assert largest.shows(image, 0.01, whole=False)
    assert not largest.wants(Placed(group=point_group("C3", oblique), center=ORIGIN), START_ERROR)


@pytest.mark.parametrize("name", ["Ci", "D2", "O"])
@pytest.mark.parametrize("whole", [True, False])
def test_a_group_shows_itself_whichever_of_its_axes_comes_first(name, whole):
    frame = random_orthogonal(np.random.default_rng(11), 3, 1)
    known, again = (Placed(group=point_group(name, f), center=ORIGIN) for f in (frame, np.roll(frame, 1, axis=0)))
    pool = Pool(looked=((known, 0.03),))
    assert pool.shows(again, 0.03, whole=whole)
    assert not pool.shows(replace(again, group=point_group("C2", again.group.frame)), 0.03, whole=whole)


def test_what_needs_but_belief_shows_its_elements():
    """Of what was seen nothing denies it: a look at one of them would end where it stands."""
    frame = random_orthogonal(np.random.default_rng(3), det=1)
    whole, turn = (Placed(group=point_group(name, frame), center=ORIGIN) for name in ("C4v", "C3"))
    mirror = Placed(group=point_group("Cs", frame_with_z(frame[0])), center=ORIGIN)
    for believed, shown in ((0.009, True), (0.008, False)):
        known = Hypothesis(placed=whole, elements=NOTHING.elements, need=math.hypot(0.009, 0.001), believed=believed)
        pool = Pool(small=(known,), nothing=0.0011)
        assert [pool.has_as_seen(p) for p in (whole, mirror, turn)] == [shown, shown, False]
        assert not pool.has(mirror)


# What is explored


def test_exploring_ends_with_a_group_whose_neighbours_fail():
    evidence, surface = ring()
    pool = explore(surface, evidence, TOLERANCE)
    assert pool.largest.group.name == "C6v"
    assert pool.largest.need < 1e-6
    for h in pool.small:
        assert h.need > TOLERANCE or pool.largest.holds(h.placed)
    for placed, needs in (*pool.looked, *pool.hopeless):
        assert needs > TOLERANCE
        assert not is_subgroup(placed.group, point_group("C6v"), 0.5 * START_ERROR)


def test_of_what_has_no_symmetry_the_nearest_misses_are_looked_at_and_told():
    points, _ = molecule("C2", 0.04, 4)
    links, pool, _ = linked(points, 0.005, 0.005)
    assert links == (NOTHING,)
    assert pool.looked
    assert not pool.small
    needs = sorted(need for _, need in pool.looked)
    assert needs[0] > 0.005
    told = detect(points, tolerance=0.005).near_misses
    assert told
    assert told[0].excess == pytest.approx(needs[0] / 0.005, rel=0.5)


def test_where_nothing_comes_near_the_tolerance_what_a_larger_one_makes_of_it_is_fitted():
    """A look at a hull of twelve random points says 5.0 times the tolerance of its best mirror, a fit 4.2."""
    part = hull(np.random.default_rng(0).normal(size=(12, 3)))
    alone, told = (detect(Shape(part.vertices, part.faces), ladder=ladder) for ladder in ((), (0.02, 0.08)))
    assert alone.point_group == told.point_group == "C1"
    assert [step.point_group for step in told.staircase] == ["C1", "Cs"]


@pytest.mark.slow
def test_a_chain_ends_where_directions_part_what_together_makes_the_same_group_again():
    """A cloud of 48 blades, of which directions tell C48v and D48h apart though both together are D48h."""
    made = instance("rotors", "impeller48", 21)
    shape, _ = look(Case(family="rotors", name="impeller48", view=2, seed=21), made)
    evidence, surface = gather(measure(shape), np.random.default_rng(0))
    links = chain(surface, explore(surface, evidence, 0.02), 0.05)
    names = [link.group.name for link in links]
    assert len(set(names)) == len(names)


@pytest.mark.slow
def test_an_exact_group_stays_where_a_larger_one_that_it_is_no_part_of_is_found_first():
    """A ring of 100 atoms, which is D10h exactly and D100h nearly, at a tolerance between those."""
    made = instance("tolerances", "ring100 to D10h", 21)
    shape, _ = look(Case(family="tolerances", name="ring100 to D10h", seed=21), made)
    assert [detect(shape, tolerance=t).point_group for t in (0.001, 0.0025)] == ["D10h", "D10h"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "noise_rel"), [("spool", 0.0), ("cone", 0.01)])
def test_of_many_mirrors_that_noise_hides_the_truest_is_told(name, noise_rel):
    """A body of revolution with one detail out of place: mirrors near the true one need next to nothing as well."""
    case = groups.Case(shape=name, sibling=True, noise_rel=noise_rel, seed=35)
    shape, turn = groups.posed(case)
    found = detect(shape)
    true = groups.true_group(name, True).mirrors()[0] @ turn.T
    assert found.point_group == "Cs"
    assert line_angle_rad(found.planes[0].plane.normal, true) < np.radians(2.0)


def test_what_a_group_holds_but_for_a_few_degrees_makes_no_larger_one(monkeypatch):
    """A mirror found 2 degrees off one of five is that one: joined they are no group of sixty."""
    for module in ("chain", "joins"):  # the ring has no five of its own
        monkeypatch.setattr(f"symrefine.decide.{module}.by_chance", lambda *_: False)
    surface = ring()[1]
    tilt = rotation(np.array([0.0, 0.0, 1.0]), np.radians(2.0))
    whole = of("C2v")
    whole = replace(
        whole,
        placed=Placed(group=point_group("C5v"), center=ORIGIN),
        need=0.02,
        elements=tuple(replace(e, need=0.02) for e in whole.elements),
    )
    lone = replace(of("Cs"), placed=Placed(group=point_group("Cs", mirror_frame() @ tilt), center=ORIGIN), need=0.001)
    links = chain(surface, Pool(largest=whole, small=(lone,)), LIMIT)
    assert [h.group.name for h in links] == ["C1", "Cs", "C5v"]


def mirror_frame():
    """The frame of a mirror of C5v."""
    return frame_with_z(point_group("C5v").mirrors()[0])


@pytest.mark.parametrize("name", ["goblet", "spool"])
@pytest.mark.slow
def test_of_mirrors_that_noise_does_not_tell_apart_none_is_sure(name):
    """A small part on a body of revolution: noise hides which way its mirror faces, not that there is one."""
    case = groups.Case(shape=name, sibling=True, noise_rel=0.01, seed=101)
    found, turn = detect(groups.posed(case)[0]), groups.posed(case)[1]
    truth = groups.true_group(name, True)
    assert found.point_group == "Cs"
    assert all(groups.is_mirror(truth, turn.T @ p.plane.normal) or p.confidence < 0.5 for p in found.planes)


def upright(name):
    """A group about the z axis."""
    return Placed(group=point_group(name), center=np.zeros(3))


def mirror_at(angle_deg):
    """A mirror through the z axis."""
    angle = np.radians(angle_deg)
    return Placed(group=point_group("Cs", frame_with_z([np.cos(angle), np.sin(angle), 0.0])), center=np.zeros(3))


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        ([mirror_at(0.0), mirror_at(36.0)], "C5v"),
        ([mirror_at(0.0), mirror_at(3.0)], "C60v"),
        # Mirrors that no direction tells apart are one, and with others generate nothing but what is round.
        ([mirror_at(0.0), mirror_at(2.5)], "Cs"),
        ([mirror_at(0.0), mirror_at(36.0), mirror_at(38.5)], "Cinfv"),
        ([mirror_at(0.0), mirror_at(2.5), upright("Cs")], "Dinfh"),
        # A fold that was found as one is one.
        ([upright("C60"), mirror_at(10.0)], "C60v"),
        ([upright("C50v"), upright("Cs")], "D50h"),
    ],
)
def test_what_parts_generate_turns_by_no_less_than_tells_directions_apart(parts, whole, monkeypatch):
    monkeypatch.setattr("symrefine.decide.joins.by_chance", lambda *_: False)
    assert _told_apart(round_but_for_holes(4)[0], joined(parts), parts).group.name == whole


def test_what_generates_nothing_is_nothing():
    assert _told_apart(round_but_for_holes(4)[0], None, []) is None


@cache
def round_but_for_holes(holes, noise_rel=0.005):
    """The surface of a flange with a few small holes through it, about its axis z."""
    rng = np.random.default_rng(holes)
    points = sample(
        join([revolve([(0.3, 0.0), (1.0, 0.0), (1.0, 0.2), (0.5, 0.2), (0.5, 0.7), (0.3, 0.7)])]), 9000, 0.0, rng
    )
    angles = 2.0 * np.pi * np.arange(holes) / 4
    middles = 0.75 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    apart = np.linalg.norm(points[:, None, :2] - middles, axis=2).min(axis=1)
    wall = 2.0 * np.pi * rng.random((holes, 90))
    walls = middles[:, None] + 0.12 * np.stack([np.cos(wall), np.sin(wall)], axis=2)
    walls = np.column_stack([walls.reshape(-1, 2), 0.2 * rng.random(90 * holes)])
    points = np.concatenate([points[apart > 0.12], walls])
    points += noise_rel * 2.9 * rng.standard_normal(points.shape)
    evidence, surface = gather(measure(Shape(points=points)), np.random.default_rng(0))
    return surface, -evidence.moments.center / evidence.moments.scale, points


@pytest.mark.parametrize(
    ("name", "chance"), [("C4v", False), ("C2v", False), ("C12v", True), ("C30v", True), ("C5", True)]
)
def test_folds_by_which_something_round_is_forgiven_as_much_as_by_any_turn_are_none(name, chance):
    surface, center, _ = round_but_for_holes(4)
    assert by_chance(surface, replace(upright(name), center=center)) == chance


@pytest.mark.parametrize("name", ["C1", "Cs", "Kh", "Oh", "Cinfv", "D2"])
def test_what_has_no_fold_has_none_by_chance(name):
    """Of a cube half a turn misses less than parts of it do; of what has no axis, or turns freely, nothing is asked."""
    rng = np.random.default_rng(5)
    evidence, surface = gather(measure(Shape(points=sample(join([box((0, 0, 0), (1, 1, 1))]), 5000, 0.0, rng))), rng)
    center = -evidence.moments.center / evidence.moments.scale
    assert not by_chance(surface, replace(upright(name), center=center))


@pytest.mark.parametrize("on_axis", [2, 3, 4])
def test_points_on_an_axis_say_nothing_against_its_fold(on_axis):
    """As of formaldehyde or ketene, off by a thousandth: half of the atoms and more no turn moves."""
    rng = np.random.default_rng(on_axis)
    row = [[0.0, 0.0, 1.25 * k] for k in range(on_axis)]
    atoms = np.array([*row, [0.0, 0.94, -0.56], [0.0, -0.94, -0.56]])
    for _ in range(4):
        points = (atoms + 0.004 * rng.standard_normal(atoms.shape)) @ random_orthogonal(rng).T
        found = detect(Shape(points=points, labels=np.array([*range(on_axis), 9, 9])), ladder=(0.0025, 0.08))
        assert found.point_group == "C2v"
        assert found.confidence > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_something_round_has_no_fold_that_nothing_in_it_has(seed):
    """Noise hides the four holes of a flange from many mirrors, any two of which make some fold."""
    _, _, points = round_but_for_holes(4, 0.01)
    rng = np.random.default_rng(seed)
    found = detect(points @ random_orthogonal(rng).T)
    assert found.point_group in ("C4v", "C2v", "Cinfv")
    assert all(a.point_group in ("C1", "Cs", "C2v", "C4v", "Cinfv", "Dinfh") for a in found.alternatives)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_exact_mirror_of_what_is_nearly_round_is_found(seed):
    """Of a flange with three holes of four, which all turns nearly leave as it is, azimuths tell the mirror."""
    _, _, points = round_but_for_holes(3, 0.0)
    rng = np.random.default_rng(seed)
    found = detect(points @ random_orthogonal(rng).T)
    assert found.point_group == "Cs" or any(a.point_group == "Cs" for a in found.alternatives)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_of_a_group_that_does_not_hold_the_elements_that_do_are_known(seed):
    """Of the twelve mirrors of a crown of teeth the one that five pins within have too."""
    teeth = [box((np.cos(a), np.sin(a), 0.0), (0.3, 0.2, 0.3), a) for a in np.linspace(0.0, 2.0 * np.pi, 13)[:-1]]
    pins = [
        box((0.5 * np.cos(a), 0.5 * np.sin(a), 0.4), (0.2, 0.2, 0.5), a) for a in np.radians([0, 50, -50, 130, -130])
    ]
    rng = np.random.default_rng(seed)
    points = sample(join([*teeth, *pins, box((0, 0, -0.2), (1.7, 1.7, 0.1))]), 10000, 0.0, rng)
    measured = measure(Shape(points=points))
    surface = gather(measured, np.random.default_rng(0))[1]
    group = point_group("C12v")
    placed = Placed(group=group, center=-measured.moments.center * [1, 1, 0] / measured.moments.scale)
    holding = _holding(surface, placed, TOLERANCE)
    off = [np.degrees(line_angle_rad(h.group.frame[2], [0, 1, 0])) for h in holding if h.group.name == "Cs"]
    # Those of the plate below may seem to hold at a glance.
    assert min(off) < 0.1
    assert len(holding) <= 4
    pool = _with(surface, Pool(nothing=1e-6, limit=TOLERANCE), [placed])
    assert pool.largest.group.name == "Cs"
    assert detect(points).point_group == "Cs"


def test_of_a_group_that_nearly_holds_the_elements_that_do_are_kept():
    """One of eight bosses is too near the middle: the mirror through it is proposed by nothing but all eight."""
    at = 2.0 * np.pi * np.arange(8) / 8.0
    radii = np.array([0.58, *[0.75] * 7])
    boss = revolve([(0, -0.3), (0.18, -0.3), (0.18, 0.3), (0, 0.3)], 48)
    bosses = [household.placed(boss, (r * np.cos(a), r * np.sin(a), 0)) for r, a in zip(radii, at, strict=True)]
    disc = revolve([(0, -0.08), (1, -0.08), (1, 0.08), (0, 0.08)])
    rng = np.random.default_rng(3)
    measured = measure(Shape(points=sample(join([disc, *bosses]), 8000, 0.002, rng)))
    surface = gather(measured, np.random.default_rng(0))[1]
    placed = Placed(group=point_group("D8h"), center=-measured.moments.center / measured.moments.scale)
    assert TOLERANCE < fitted(surface, placed).need < 1.5 * TOLERANCE
    pool = _with(surface, Pool(nothing=1e-6, limit=TOLERANCE), [placed])
    assert pool.largest.group.name == "C2v"


@pytest.mark.parametrize("name", ["S4", "S6", "Ci", "C5", "Cs"])
def test_what_generates_all_of_a_group_that_does_not_hold_is_not_asked_again(name):
    cube = sample(join([box((0, 0, 0), (1, 1, 1))]), 3000, 0.0, np.random.default_rng(0))
    surface = gather(measure(Shape(points=cube)), np.random.default_rng(0))[1]
    placed = Placed(group=point_group(name), center=np.zeros(3))
    assert name not in {h.group.name for h in _holding(surface, placed, 1.0)}


def test_the_mirror_that_azimuths_tell_is_proposed(monkeypatch):
    told = np.array([0.48, 0.6, 0.64])
    _, _, points = round_but_for_holes(3, 0.0)
    evidence, _ = gather(measure(Shape(points=points)), np.random.default_rng(0))
    for normal in (None, told):
        monkeypatch.setattr("symrefine.propose.candidates.mirror_through", lambda *_, n=normal: n)
        mirrors = [p.group.frame[2] for p in proposals(evidence) if p.group.name == "Cs"]
        assert any(line_angle_rad(m, told) < 1e-9 for m in mirrors) == (normal is not None)


def test_an_element_is_no_part_of_itself():
    """One that all its points together tell to need more than it does alone was tried again and again."""
    found = of("C2")
    assert len(found.elements) == 1
    assert better_parts(replace(found, need=10.0 * found.need + 1.0)) == []
    whole = of("C2v")
    assert len(better_parts(replace(whole, need=10.0 * whole.need + 1.0))) == 3
