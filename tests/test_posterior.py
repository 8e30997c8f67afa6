"""How sure the groups of a chain are: laws of probability, of order, and of what a tolerance forgives."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from symrefine.decide.posterior import LEAST, Link, certain, decide, meant
from symrefine.groups import PointGroup, point_group

NEED = st.floats(0.0, 0.5)
TOLERANCE = st.floats(1e-3, 0.2)


def chain_of(members, lone):
    """Each group lies in the next, so it needs no more; a lone mirror can only be the first."""
    ordered = sorted(members)
    return [Link(need=n, lone_mirror=lone and i == 0, broken=broken) for i, (n, broken) in enumerate(ordered)]


CHAIN = st.builds(chain_of, st.lists(st.tuples(NEED, st.floats(0.0, 1.0)), max_size=6), st.booleans())


def known_links(groups, needs):
    """The links of groups in space, each inside the next, all of which was seen."""
    every = zip(groups, needs, [*needs, math.inf][1:], strict=True)
    return [Link.of(group, need, beyond, believed=0.0, placed=1.0) for group, need, beyond in every]


@given(CHAIN, TOLERANCE)
def test_the_groups_of_a_chain_share_one_probability(links, tolerance):
    found = decide(links, tolerance)
    assert len(found.probabilities) == len(found.inside) == len(links) + 1
    assert math.fsum(found.probabilities) == pytest.approx(1.0)
    assert min(found.probabilities) >= 0.0


@given(CHAIN, TOLERANCE)
def test_a_larger_group_is_never_surer_to_be_inside(links, tolerance):
    found = decide(links, tolerance)
    assert found.inside[0] == 1.0
    assert list(found.inside) == sorted(found.inside, reverse=True)
    beyond = math.fsum(found.probabilities[found.index :])
    assert beyond == pytest.approx(found.inside[found.index])


@given(CHAIN, TOLERANCE)
def test_the_decision_is_the_likeliest_group(links, tolerance):
    found = decide(links, tolerance)
    assert found.probabilities[found.index] == max(found.probabilities)


@given(CHAIN, TOLERANCE, st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).map(sorted))
def test_the_less_was_seen_the_less_sure_is_every_group(links, tolerance, unclosed):
    more, less = (decide(links, tolerance, unclosed=u) for u in unclosed)
    assert all(b <= a for a, b in zip(more.inside, less.inside, strict=True))
    assert decide(links, tolerance) == decide(links, tolerance, unclosed=0.0)


@given(TOLERANCE, st.floats(0.1, 1.0))
def test_what_nobody_saw_breaks_two_mirrors_rather_than_one_and_one_rather_than_what_is_repeated(tolerance, unclosed):
    groups = [PointGroup(name=name) for name in ("C2v", "Cs", "C4v")]
    two, one, many = (decide(known_links([g], [0.0]), tolerance, unclosed=unclosed).inside[1] for g in groups)
    assert two < one < many < 1.0
    # A mirror of a larger group is as sure as that.
    both = decide(known_links([groups[0], groups[2]], [0.0, 0.0]), tolerance, unclosed=unclosed)
    assert both.inside == (1.0, many, many)


@given(TOLERANCE)
def test_without_links_there_is_no_symmetry_for_certain(tolerance):
    found = decide([], tolerance)
    assert (found.index, found.probabilities, found.inside) == (0, (1.0,), (1.0,))


@given(st.lists(st.just(Link(need=0.0)), min_size=1, max_size=5), TOLERANCE)
def test_what_needs_nothing_is_certain(links, tolerance):
    found = decide(links, tolerance)
    assert found.index == len(links)
    assert found.probabilities[-1] == 1.0


@given(NEED, NEED, st.booleans(), TOLERANCE, TOLERANCE)
def test_more_need_is_less_meant_and_more_tolerance_more(a, b, lone, s, t):
    few, much = (Link(need=n, lone_mirror=lone) for n in sorted((a, b)))
    strict, loose = sorted((s, t))
    assert meant(few, strict) >= meant(much, strict)
    assert meant(much, loose) >= meant(much, strict)
    assert 0.0 <= meant(much, strict) <= 1.0


@given(NEED, st.floats(0.0, 1.0), TOLERANCE, st.floats(0.0, 1.0), st.booleans())
def test_noise_blurs_what_was_measured_and_not_what_is_believed(need, share, tolerance, noise, lone):
    partly, measured = (Link(need=need, believed=b * need, lone_mirror=lone) for b in (share, 0.0))
    assert meant(partly, tolerance) == pytest.approx(meant(measured, tolerance))
    assert meant(partly, tolerance, noise * tolerance) >= meant(measured, tolerance, noise * tolerance) - 1e-12


@given(NEED, TOLERANCE)
def test_a_lone_mirror_is_forgiven_no_less(need, tolerance):
    assert meant(Link(need=need, lone_mirror=True), tolerance) >= meant(Link(need=need), tolerance)


@given(st.lists(NEED, max_size=6).map(sorted), st.sampled_from(["Cs", "C2"]))
def test_a_mirror_is_lone_where_it_comes_first_and_nothing_like_it_follows(needs, first):
    groups = [PointGroup(name=n) for n in (first, "C2v", "C4v", "D4h", "Oh", "Kh")][: len(needs)]
    links = known_links(groups, needs)
    assert [link.need for link in links] == needs
    assert not any(link.lone_mirror for link in links[1:])
    assert all(link.lone_mirror <= (first == "Cs") for link in links[:1])
    assert [link.lone_mirror for link in known_links(groups[:1], needs[:1])] == [first == "Cs"] * len(needs[:1])


@given(st.floats(1e-3, 0.1), TOLERANCE)
def test_one_of_several_mirrors_is_forgiven_no_more_than_the_rest(need, tolerance):
    groups = [PointGroup(name="Cs"), PointGroup(name="C4v")]
    lone, other = (decide(known_links(groups, [need, k * need]), tolerance) for k in (10.0, 1.5))
    assert other.inside[1] <= lone.inside[1]
    assert other.inside[1] == meant(Link(need=need), tolerance)


@pytest.mark.parametrize("lone", [False, True])
def test_a_quarter_of_the_tolerance_is_forgiven_and_four_times_it_is_not(lone):
    """Whatever the constants: otherwise the tolerance would not mean what it says."""
    assert meant(Link(need=0.005, lone_mirror=lone), 0.02) > 0.5 > meant(Link(need=0.08, lone_mirror=lone), 0.02)


@given(CHAIN, TOLERANCE, NEED, st.sampled_from([0.25, 3.0]))
def test_only_needs_over_tolerances_count(links, tolerance, noise, unit):
    found = decide(links, tolerance, noise)
    scaled = [replace(link, need=unit * link.need) for link in links]
    again = decide(scaled, unit * tolerance, unit * noise)
    assert again.probabilities == pytest.approx(found.probabilities, abs=1e-9)


@given(CHAIN, TOLERANCE, TOLERANCE)
def test_a_larger_tolerance_makes_every_group_likelier_inside(links, s, t):
    strict, loose = (decide(links, x) for x in sorted((s, t)))
    assert all(b >= a for a, b in zip(strict.inside, loose.inside, strict=True))


@given(CHAIN, TOLERANCE, TOLERANCE)
def test_a_larger_tolerance_never_decides_for_a_smaller_group(links, s, t):
    strict, loose = (decide(links, x).index for x in sorted((s, t)))
    assert strict <= loose


@given(CHAIN, NEED, TOLERANCE)
def test_a_group_that_needs_too_much_changes_nothing_below_it(links, need, tolerance):
    """A further link takes its probability from the last group alone."""
    last = Link(need=max([need, *(link.need for link in links)]))
    without, along = decide(links, tolerance), decide([*links, last], tolerance)
    assert along.probabilities[: len(links)] == without.probabilities[:-1]
    assert along.inside[:-1] == without.inside


@given(CHAIN, st.tuples(NEED, NEED).map(sorted), TOLERANCE)
def test_more_noise_makes_no_group_that_holds_surer(links, noise, tolerance):
    """Of what is likelier true than not; what is not, noise may have made look worse than it is."""
    quiet, loud = (decide(links, tolerance, n) for n in noise)
    assert all(b <= max(a, 0.5) + 1e-12 for a, b in zip(quiet.inside[1:], loud.inside[1:], strict=True))
    assert decide(links, tolerance) == decide(links, tolerance, 0.0)


@given(st.lists(st.builds(Link, need=NEED, lone_mirror=st.booleans()), max_size=6), TOLERANCE)
def test_what_is_inside_a_group_is_at_least_as_sure_in_whatever_order_needs_come(links, tolerance):
    """A fit of the larger group may have come out better than that of the smaller."""
    found = decide(links, tolerance)
    assert all(b <= a for a, b in pairwise(found.inside))
    assert min(found.probabilities) >= 0.0


@given(NEED, st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).map(sorted), TOLERANCE)
def test_a_group_that_may_as_well_stand_elsewhere_is_less_surely_meant(need, placed, tolerance):
    loose, firm = (meant(Link(need=need, placed=p), tolerance) for p in placed)
    assert loose <= firm <= meant(Link(need=need), tolerance)
    assert meant(Link(need=need, placed=0.0), tolerance) == 0.0


@given(TOLERANCE, NEED)
def test_where_a_group_stands_is_known_as_well_as_where_a_larger_one_does(tolerance, need):
    mirror, turns = Link(need=need, placed=0.0), Link(need=need)
    assert decide([mirror, turns], tolerance).inside[1] == decide([turns], tolerance).inside[1]
    assert decide([mirror], tolerance).inside[1] == 0.0


@given(st.floats(1e-4, 0.2), st.booleans())
def test_what_is_certain_leaves_no_doubt_worth_telling(tolerance, lone):
    need = certain(tolerance)
    assert 0.0 < need < tolerance
    assert 1.0 - meant(Link(need=need, lone_mirror=lone), tolerance) <= LEAST


@given(st.floats(1e-4, 0.2), st.floats(0.0, 1.2))
def test_what_is_certain_leaves_little_more_doubt_than_noise_does(tolerance, noise):
    """Where noise is as large as the tolerance, half of what noise needs was taken for exact, and denied."""
    need = certain(tolerance, noise)
    alone, with_need = (meant(Link(need=n), tolerance, noise * tolerance) for n in (0.0, need))
    assert need <= certain(tolerance)
    assert alone - with_need < 0.25


@pytest.mark.parametrize(
    ("name", "like"), [("Cinfv", "Cs"), ("Dinfh", "C2v"), ("D5h", "Cs"), ("D2h", "C2v"), ("Kh", "Cs"), ("Oh", "C5v")]
)
def test_what_nobody_saw_breaks_as_many_as_stand_alone_and_roundness_is_one(name, like):
    one, other = (Link.of(point_group(n), 0.0, 1.0, believed=0.0, placed=1.0).broken for n in (name, like))
    assert one == other
