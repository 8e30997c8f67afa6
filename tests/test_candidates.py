"""What is proposed: the true elements are among it, in every pose; atoms are counted; neighbours share the centre."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from experiments.objects.boundary import instance
from experiments.objects.constructions import gear, rotor
from experiments.objects.parts import assembled
from experiments.objects.shapes import bottle, box, join, sample, table
from symrefine.fit.placed import Placed, elements, joined
from symrefine.geometry import line_angle_rad, random_orthogonal, rotation, unit
from symrefine.groups import is_subgroup, point_group
from symrefine.moments.moments import central_moments
from symrefine.ntuples.contract import ntuples
from symrefine.ntuples.rank import fixed_subspace
from symrefine.propose.candidates import (
    Evidence,
    about,
    apart,
    beside,
    beside_details,
    fine,
    placed,
    prime_axes,
    proposals,
    turned_over,
)
from symrefine.rounding import START_ERROR

# Half of what order 8 resolves: a start may be off by so much.
NEAR_RAD = np.radians(5.5)
# The group of each, the names that have to be proposed where they are, and how many axes of these names it has.
OBJECTS = {
    "table": (table, "C4v", {"C4v": 1}, 4),
    "cube": (lambda: join([box((0, 0, 0), (1, 1, 1))]), "Oh", {"C4v": 3, "C3v": 4}, 9),
    "brick": (lambda: join([box((0, 0, 0), (1, 0.7, 0.4))]), "D2h", {"C2v": 3}, 3),
    "gear": (lambda: assembled(gear(13)), "D13h", {"C13v": 1, "C13": 1}, 1),
    "rotor": (lambda: assembled(rotor(19, [(0.0, 1, 0.0)])), "C19h", {"C19": 1}, 1),
    "bottle": (bottle, "Cinfv", {"Cinfv": 1}, 1),
}


def evidence_of(points, *, atoms=False):
    moments = central_moments(points, np.ones(len(points)), 8, parts=0 if atoms else 16)
    return Evidence(
        moments=moments,
        tuples=fixed_subspace(ntuples(moments)),
        points=(points - moments.center) / moments.scale,
        weights=np.full(len(points), 1.0 / len(points)),
        atoms=atoms,
    )


@cache
def seen(name, seed):
    """Evidence of a noisy sample in a random pose, and its true group where it stands."""
    build, group, _, _ = OBJECTS[name]
    rng = np.random.default_rng(seed)
    turn = random_orthogonal(rng)
    points = sample(build(), 3000, 0.002, rng)
    return evidence_of(points @ turn.T + 3.0), point_group(group, turn.T)


@cache
def proposed(name, seed):
    evidence = seen(name, seed)[0]
    elsewhere = [about(evidence, axis.group.frame[2]) for axis in prime_axes(evidence)]
    return [*proposals(evidence), *(p for found in elsewhere for p in found)]


def distinct(directions):
    return len(apart(directions, np.radians(20.0)))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", OBJECTS)
def test_the_true_elements_are_proposed(name, seed):
    truth = seen(name, seed)[1]
    right = [p.group for p in proposed(name, seed) if is_subgroup(p.group, truth, 2 * NEAR_RAD)]
    for wanted, axes in OBJECTS[name][2].items():
        assert distinct([g.frame[2] for g in right if g.name == wanted]) == axes


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", OBJECTS)
def test_the_true_mirrors_are_proposed(name, seed):
    """All that the spectrum resolves; of the many mirrors through an axis those of the fold stand together."""
    truth = seen(name, seed)[1]
    mirrors = [p.group.frame[2] for p in proposed(name, seed) if p.group.name == "Cs"]
    found = [n for n in truth.mirrors() if min(line_angle_rad(n, m) for m in mirrors) < NEAR_RAD]
    if name == "bottle":
        axis = truth.frame[2]
        found = [m for m in mirrors if abs(line_angle_rad(m, axis) - np.pi / 2) < NEAR_RAD][:1]
    assert len(found) >= OBJECTS[name][3]


@pytest.mark.parametrize("name", OBJECTS)
def test_proposals_stand_about_the_centroid_and_start_with_the_likeliest_axes(name):
    assert all(not p.center.any() for p in proposed(name, 0))
    found = proposals(seen(name, 0)[0])
    names = [p.group.name for p in found]
    assert names.index("Ci") < names.index("Cs")
    first = [p.group.frame[2] for p in found[: names.index("Ci")] if p.group.name == "C2"]
    assert names.count("Cinfv") == len(first)
    principal = np.linalg.eigh(seen(name, 0)[0].moments.covariance)[1].T
    likeliest = [seen(name, 0)[0].tuples.directions[0], *principal]
    assert line_angle_rad(first[0], likeliest[0]) < 1e-9
    assert all(min(line_angle_rad(d, u) for u in first) <= START_ERROR + 1e-12 for d in likeliest)


@pytest.mark.parametrize("name", OBJECTS)
def test_what_stands_about_an_axis_turns_with_the_object(name):
    """Covariance, det +1: the same groups at the same places, wherever the frames across the axis start from."""
    build, group, _, _ = OBJECTS[name]
    points = sample(build(), 3000, 0.002, np.random.default_rng(2))
    axis = point_group(group).frame[2] if name != "cube" else unit([1.0, 1.0, 1.0])
    first = about(evidence_of(points), axis)
    for seed in range(3):
        turn = random_orthogonal(np.random.default_rng(seed))
        again = about(evidence_of(points @ turn.T), turn @ axis)
        assert [p.group.name for p in again] == [p.group.name for p in first]
        for a, b in zip(first, again, strict=True):
            expected = point_group(a.group.name, a.group.frame @ turn.T)
            assert is_subgroup(b.group, expected, 2e-3)
            assert is_subgroup(expected, b.group, 2e-3)


def test_directions_apart_keep_the_first_of_each():
    rng = np.random.default_rng(3)
    directions = unit(rng.standard_normal((60, 3)))
    kept = apart([*directions, *(-directions)])
    assert len(kept) <= 60
    assert np.array_equal(kept[0], directions[0])
    for i, a in enumerate(kept):
        assert all(line_angle_rad(a, b) >= START_ERROR - 1e-12 for b in kept[:i])
    assert all(min(line_angle_rad(d, k) for k in kept) <= START_ERROR for d in directions)
    assert apart(kept)[-1] is kept[-1]


# Atoms are counted


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 19), st.integers(1, 4), st.integers(0, 2), st.integers(0, 10**6))
def test_every_turn_that_atoms_have_is_among_those_that_their_number_allows(fold, orbits, on_axis, seed):
    rng = np.random.default_rng(seed)
    turn = random_orthogonal(rng)
    heights = rng.standard_normal(orbits)
    radii, phases = rng.uniform(0.8, 1.4, orbits), rng.uniform(0, 2 * np.pi, orbits)
    angle = (phases[:, None] + 2 * np.pi * np.arange(fold) / fold).ravel()
    ring = np.column_stack([np.repeat(radii, fold) * np.cos(angle), np.repeat(radii, fold) * np.sin(angle)])
    atoms = np.column_stack([ring, np.repeat(heights, fold)])
    atoms = np.concatenate([atoms, np.column_stack([np.zeros((on_axis, 2)), 2 + np.arange(on_axis)])]) @ turn.T
    symbols = [p.group.symbol for p in about(evidence_of(atoms, atoms=True), turn[:, 2])]
    turns, mirrors = ({s.fold for s in symbols if s.family == family} for family in ("C", "Cv"))
    assert fold in turns
    # Of those that neither the spectrum nor habit (C2, C3) asks for, every one moves atoms in orbits of its order.
    assert all((fold * orbits) % n == 0 for n in turns - mirrors - {2, 3})


# Neighbours

GROUPS = (
    "C1 Cs Ci C2 C3 C4 C13 C2v C3v C4v C3h C4h S4 S6 D2 D3 D4 D2h D3h D2d D3d T Td Th O Oh I Ih Cinfv Dinfh Kh".split()
)
CENTER = np.array([0.2, -0.1, 0.4])


def neighbours(name):
    known = Placed(group=point_group(name, random_orthogonal(np.random.default_rng(4))), center=CENTER)
    return known, beside(known)


@pytest.mark.parametrize("name", GROUPS)
def test_neighbours_stand_about_the_same_centre(name):
    _, found = neighbours(name)
    for p in found:
        np.testing.assert_array_equal(p.center, CENTER)


@pytest.mark.parametrize("name", [g for g in GROUPS if g not in ("I", "Ih", "Oh")])
def test_neighbours_and_the_group_generate_a_larger_one_that_holds_both(name):
    known, found = neighbours(name)
    for p in found:
        both = joined([known, p])
        if both is None:
            continue
        assert is_subgroup(known.group, both.group, 1e-6)
        assert is_subgroup(p.group, both.group, 1e-6)
        assert both.group.order >= known.group.order


@pytest.mark.parametrize(
    ("name", "supergroups"),
    {
        "C1": {"Ci"},
        "Cs": {"C2h"},
        "C3": {"C6", "C9", "C3h", "S6", "Cinfv"},
        "C4": {"C8", "C12", "C4h", "S8", "Cinfv"},
        "C4v": {"C8v", "D4h", "D4d", "Cinfv"},
        "C3h": {"C6h", "Dinfh"},
        "S4": {"C4h", "S12"},
        "D3": {"D6", "D3h", "D3d", "Dinfh"},
        "D2": {"T", "D4", "D2h", "D2d"},
        "D2h": {"Th", "D4h", "Dinfh"},
        "D2d": {"D4h"},
        "T": {"Th"},
        "O": {"Oh"},
        "I": {"Ih"},
        "Cinfv": {"Dinfh", "Kh"},
        "Dinfh": {"Kh"},
    }.items(),
)
def test_neighbours_lead_to_the_groups_above(name, supergroups):
    known, found = neighbours(name)
    made = [joined([known, p]) for p in found]
    assert supergroups <= {p.group.name for p in made if p is not None}


def test_nothing_is_beside_a_sphere():
    assert neighbours("Kh")[1] == []


def test_what_is_placed_is_about_the_centroid_unless_told():
    frame = random_orthogonal(np.random.default_rng(5))
    assert not placed("C3", frame).center.any()
    found = placed("Cinfv", frame, CENTER)
    np.testing.assert_array_equal(found.center, CENTER)
    np.testing.assert_allclose(found.group.frame, frame, atol=1e-12)
    assert math.isinf(found.group.symbol.fold)


@pytest.mark.parametrize("fold", [3, 11, 48])
def test_turns_are_turned_over_at_the_phases_that_their_fold_allows(fold):
    """The half turns across the axis of points with Dn, whose phase only they tell."""
    rng = np.random.default_rng(fold)
    some = rng.normal(size=(40, 3)) + [3.0, 0.0, 0.4]
    turn = random_orthogonal(rng)
    whole = point_group(f"D{fold}").operations()
    points = np.concatenate([some @ m.T for m in whole]) @ turn.T
    evidence = Evidence(
        moments=central_moments(points, np.ones(len(points)), 8),
        tuples=fixed_subspace(ntuples(central_moments(points, np.ones(len(points)), 8))),
        points=points,
        weights=np.full(len(points), 1.0 / len(points)),
    )
    known = placed(f"C{fold}", rotation([0.0, 0.0, 1.0], 1.0) @ turn.T)  # its phase is not known
    best = min(
        np.linalg.norm((points @ m.T)[:, None, :] - points[None, :200], axis=2).min(axis=0).max()
        for start in turned_over(evidence, known)
        for m in start.group.operations()[fold : fold + 1]
    )
    assert best < 1e-4 * np.linalg.norm(points, axis=1).max()
    assert turned_over(evidence, placed(f"D{fold}", turn.T)) == []


@pytest.mark.parametrize("count", [1, 2, 3])
def test_details_of_what_is_round_tell_the_mirrors_through_its_axis(count):
    """Clumps at its side, alike and evenly apart, about an axis that passes beside the centroid."""
    rng = np.random.default_rng(count)
    frame, center = random_orthogonal(rng, det=1), rng.normal(size=3)
    azimuths = 0.3 + 2 * np.pi * np.arange(count) / count
    middles = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.full(count, 0.4)]) @ frame
    details = (middles[:, None] + 0.1 * rng.normal(size=(count, 200, 3))).reshape(-1, 3) + center
    found = beside_details(placed("Cinfv", frame, center), details)
    assert [p.group.name for p in found] == ["Cs", *[f"C{count}v"] * (count > 1)]
    for p in found:
        np.testing.assert_array_equal(p.center, center)
        for operation in p.group.operations():
            assert cKDTree(middles).query(middles @ operation.T)[0].max() < 0.15


@pytest.mark.parametrize("name", ["spined1", "knobbed2", "studded3"])
def test_what_is_finer_than_moments_resolve_is_proposed(name):
    """Of spines all over a ball the moments see nothing; what they see they tell better."""
    made, rng = instance("spread", name, seed=5), np.random.default_rng(4)
    turn = random_orthogonal(rng)
    told = [p.group for p in fine(evidence_of(sample(made.shape, 20000, 0.0, rng) @ turn.T))]
    for element in elements(made.truth.group):
        axis = turn @ element.direction
        alike = [g for g in told if g.name == f"C{element.order}"]
        assert min(line_angle_rad(axis, g.frame[2]) for g in alike) < START_ERROR
    assert not any(fine(seen(other, 0)[0]) for other in ("table", "brick", "bottle"))
