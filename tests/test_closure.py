"""Generators: where their planes and axes meet, which of them close to a group, and the frame they are refined in."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.objects.shapes import box, join, table
from symrefine.closure import (
    NEAR,
    Generators,
    apart,
    axis_open,
    joint,
    mirror_group,
    mirror_of,
    with_improper,
    with_turns,
)
from symrefine.elements import Element
from symrefine.gather import gather, measure
from symrefine.geometry import Plane, householder, line_angle_rad, random_orthogonal, rotation, unit
from symrefine.groups import PointGroup, point_group
from symrefine.ntuples.rank import TupleClass
from symrefine.search import Mirror, Turn
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE, Deviation, Verdict

NOTHING = Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
POINT = np.array([0.2, -0.1, 0.3])


def verdict(bulk=0.1, core=0.0):
    return Verdict(deviation=NOTHING, bulk=bulk, detail=bulk, excess=bulk, core=core)


def mirror(normal, point=POINT, bulk=0.1, core=0.0):
    normal = unit(normal)
    return Mirror(plane=Plane(normal=normal, offset=float(normal @ point)), verdict=verdict(bulk, core))


def turn(direction, order=2.0, point=POINT, bulk=0.1):
    return Turn(point=np.asarray(point), direction=unit(direction), order=order, verdict=verdict(bulk))


def upright(degrees, bulk=0.1, core=0.0):
    """A mirror through the vertical axis."""
    angle = np.radians(degrees)
    return mirror([-np.sin(angle), np.cos(angle), 0], bulk=bulk, core=core)


# The point they share


def test_nothing_shares_the_centroid():
    np.testing.assert_array_equal(Generators().common_point, np.zeros(3))
    assert not Generators()


@pytest.mark.parametrize("seed", range(4))
def test_planes_and_axes_through_one_point_share_it(seed):
    r = random_orthogonal(np.random.default_rng(seed))
    p = r @ POINT
    three = Generators(mirrors=tuple(mirror(n, p) for n in r))
    crossing = Generators(turns=(turn(r[0], point=p + 3 * r[0]), turn(r[0] + r[1], point=p - r[0] - r[1])))
    both = Generators(mirrors=(mirror(r[2], p),), turns=(turn(r[2], point=p + 5 * r[2]),))
    for held in (three, crossing, both):
        np.testing.assert_allclose(held.common_point, p, atol=1e-12)


def test_what_leaves_a_line_or_plane_free_shares_its_point_nearest_to_the_centroid():
    r = random_orthogonal(np.random.default_rng(5))
    alone = Generators(mirrors=(mirror(r[0], POINT),)).common_point
    np.testing.assert_allclose(alone, r[0] * (r[0] @ POINT), atol=1e-12)
    foot = POINT - r[2] * (r[2] @ POINT)
    np.testing.assert_allclose(Generators(turns=(turn(r[2], point=POINT + 7 * r[2]),)).common_point, foot, atol=1e-12)
    fan = Generators(mirrors=tuple(mirror(rotation(r[2], a) @ r[0], POINT) for a in (0.0, 0.8, 1.9)))
    np.testing.assert_allclose(fan.common_point, foot, atol=1e-12)


def test_small_errors_of_the_normals_are_no_third_condition():
    """Planes through an axis whose normals leave the plane across it by a degree do not place a point along it."""
    rng = np.random.default_rng(6)
    fan = []
    for a in np.arange(4) * np.pi / 4:
        normal = unit([np.cos(a), np.sin(a), np.radians(1.0) * rng.choice([-1, 1])])
        fan.append(Mirror(plane=Plane(normal=normal, offset=0.02 * rng.choice([-1, 1])), verdict=verdict()))
    assert np.abs(Generators(mirrors=tuple(fan)).common_point).max() < 0.05


# The group they generate


def test_the_least_convincing_goes_first():
    held = Generators(mirrors=(upright(0, 0.1), upright(45, 0.7)), turns=(turn([0, 0, 1], 4.0, bulk=0.4),))
    less, dropped = held.without_worst()
    assert (less.mirrors, less.turns, dropped) == (held.mirrors[:1], held.turns, held.mirrors[1:])
    last, dropped = less.without_worst()
    assert (last.mirrors, last.turns, dropped) == (held.mirrors[:1], (), ())


@pytest.mark.parametrize("bulk", [0.2, 0.9])
def test_what_does_not_close_is_left_out_from_the_worst_on(bulk):
    true = [upright(0), upright(45), upright(90)]
    stray = mirror([0.9, 0.2, 0.5], bulk=bulk)
    group, kept = Generators(mirrors=(true[0], stray, *true[1:])).closed()
    assert group.name == "C4v"
    assert kept.mirrors == tuple(true)


def test_directions_a_degree_off_close_all_the_same():
    rng = np.random.default_rng(7)
    matrix = random_orthogonal(rng)
    tilt = [rotation(w, np.radians(0.7)) for w in unit(rng.standard_normal((9, 3)))]
    normals = point_group("Oh").mirrors()
    held = Generators(mirrors=tuple(mirror(t @ matrix @ n) for t, n in zip(tilt, normals, strict=True)))
    group, kept = held.closed()
    assert group.name == "Oh"
    assert len(kept.mirrors) == 9
    for n in normals @ matrix.T:
        assert min(line_angle_rad(n, m) for m in group.mirrors()) < np.radians(1.0)


def test_nothing_closes_to_nothing():
    group, kept = Generators().closed()
    assert group.name == "C1"
    assert not kept


@pytest.mark.parametrize("name", ["Cs", "C5", "C4v", "D3", "D3h", "Td", "Oh", "Ih"])
def test_the_elements_of_a_group_generate_it(name):
    group = PointGroup(name=name, frame=random_orthogonal(np.random.default_rng(8)))
    parts = [("plane", n, 1.0) for n in group.mirrors()] + [("axis", u, k) for u, k in group.rotation_axes()]
    parts += [("improper", u, k) for u, k in group.improper_axes()]
    elements = [Element(kind=k, direction=u, point=POINT, order=o, verdict=verdict()) for k, u, o in parts]
    held = Generators.of(elements)
    again, kept = held.closed()
    assert again.name == name
    assert (len(kept.mirrors), len(kept.turns)) == (len(group.mirrors()), len(group.rotation_axes()))
    if name in ("D3", "D3h", "Td", "Oh", "Ih"):
        np.testing.assert_allclose(held.common_point, POINT, atol=1e-9)


# Directions


def test_a_mirror_is_known_within_a_few_degrees_of_those_of_the_group():
    group = PointGroup(name="C3v", frame=random_orthogonal(np.random.default_rng(9)))
    known, axis = mirror_of(group), group.rotation_axes()[0][0]
    for n in group.mirrors():
        assert known(n)
        assert known(-n)
        assert known(rotation(axis, np.radians(3.0)) @ n)
        assert not known(rotation(axis, np.radians(8.0)) @ n)
    assert not mirror_of(PointGroup(name="C1"))(axis)


def test_directions_near_an_earlier_one_are_left_out_whatever_their_sign():
    u = unit([1.0, 2, 2])
    near, far = rotation([0, 1, -1], np.radians(2.0)) @ u, rotation([0, 1, -1], np.radians(10.0)) @ u
    kept = apart(np.stack([u, -u, near, -near, far]), np.radians(4.0))
    np.testing.assert_array_equal(np.stack(kept), np.stack([u, far]))


# The frame of the joint refinement


@pytest.mark.parametrize("name", ["Cs", "Ci", "C4", "S4", "C6v", "D3", "D2h", "Th", "Td", "O", "Oh", "Ih"])
def test_what_is_refined_together_generates_the_group_about_its_centre(name):
    group = PointGroup(name=name, frame=random_orthogonal(np.random.default_rng(10)))
    state = joint(group, POINT)
    assert 0 < len(state.motions) <= 9
    for motion in state.motions:
        assert min(np.abs(motion.matrix - g).max() for g in group.operations()) < 1e-9
        np.testing.assert_allclose(motion.apply(POINT[None])[0], POINT, atol=1e-12)
    assert len({np.round(m.matrix, 6).tobytes() for m in state.motions}) == len(state.motions)
    if len(group.mirrors()) <= 9:
        for n in group.mirrors():
            assert min(np.abs(householder(n) - m.matrix).max() for m in state.motions) < 1e-9


def test_without_operations_there_is_nothing_to_refine():
    assert joint(PointGroup(name="C1"), POINT) is None


# Mirrors one by one


def grouped(monkeypatch, candidates, kind="vanish", across=()):
    """What comes of candidate mirrors in this order, those across the main axis last, and which were asked for."""
    asked = []

    def offered(_, extra, *, known, count=16):
        beside = [m for m in across if any(line_angle_rad(m.plane.normal, u) < 0.01 for u in extra)]
        for m in candidates if count else beside:
            if not known(m.plane.normal):
                asked.append(m)
                yield m

    monkeypatch.setattr("symrefine.closure.mirrors", offered)
    held, near, group = mirror_group(SimpleNamespace(tuples=SimpleNamespace(kind=kind, directions=np.eye(3))))
    return held, near, group, asked


def offsets(near):
    return sorted(e.verdict.bulk for e in near)


def test_mirrors_that_those_held_imply_are_not_asked_for(monkeypatch):
    fan = [upright(0), upright(45), upright(90), upright(135)]
    held, near, group, asked = grouped(monkeypatch, fan)
    assert group.name == "C4v"
    assert asked == fan[:2]
    assert (held.mirrors, near) == (tuple(fan[:2]), [])


def test_the_mirror_across_the_axis_is_asked_for_where_nothing_proposes_it(monkeypatch):
    across = mirror([0, 0, 1])
    held, _, group, asked = grouped(monkeypatch, [upright(0), upright(36)], across=[across])
    assert (group.name, asked[-1], held.mirrors[-1]) == ("D5h", across, across)
    assert grouped(monkeypatch, [upright(0), upright(36)], "axis", [across])[2].name == "C5v"


def test_mirrors_that_miss_are_near_misses(monkeypatch):
    held, near, group, _ = grouped(monkeypatch, [upright(0, 1.3), upright(45, 0.2), upright(71, 2.0)])
    assert group.name == "Cs"
    assert [m.verdict.bulk for m in held.mirrors] == [0.2]
    assert offsets(near) == [1.3, 2.0]


@pytest.mark.parametrize("order", [1, -1])
def test_a_mirror_drawn_by_a_detail_is_not_held_beside_the_true_one_that_misses(monkeypatch, order):
    # Farther apart than what counts as known, nearer than what counts as another mirror.
    drawn, true = upright(6, 0.9, core=0.5), upright(0, 3.0, core=0.1)
    held, near, group, _ = grouped(monkeypatch, [drawn, true][::order])
    assert not held
    assert group.name == "C1"
    assert offsets(near) == [0.9, 3.0]


def test_a_mirror_far_from_the_one_that_misses_is_held(monkeypatch):
    held, near, group, _ = grouped(monkeypatch, [upright(0, 3.0, core=0.1), upright(60, 0.9, core=0.5)])
    assert [m.verdict.bulk for m in held.mirrors] == [0.9]
    assert (group.name, offsets(near)) == ("Cs", [3.0])


@pytest.mark.parametrize("order", [1, -1])
def test_beside_exact_mirrors_a_much_worse_one_is_a_near_miss(monkeypatch, order):
    candidates = [upright(0, 0.05), upright(70, 0.9)][::order]
    held, near, group, _ = grouped(monkeypatch, candidates)
    assert [m.verdict.bulk for m in held.mirrors] == [0.05]
    assert (group.name, offsets(near)) == ("Cs", [0.9])


@pytest.mark.parametrize(("kind", "asked"), [("vanish", NEAR + 4), ("plane", NEAR + 1)])
def test_where_the_tuples_speak_a_few_near_misses_are_enough(monkeypatch, kind, asked):
    candidates = [upright(0, 0.2), *(upright(a, 2.0) for a in 20 * np.arange(1, NEAR + 4))]
    assert len(grouped(monkeypatch, candidates, kind)[3]) == asked


# Axes beside them


def turned(monkeypatch, held, group, kind="vanish", found=lambda _, __: None):
    """The generators with turns, and the directions that were asked for."""
    asked = []

    def about(_, direction, center):
        asked.append((direction, center))
        return found(direction, center)

    monkeypatch.setattr("symrefine.closure.turns_about", about)
    monkeypatch.setattr("symrefine.closure.axis_directions", lambda _: np.array([[0.0, 0.6, 0.8]]))
    tuples = SimpleNamespace(kind=kind, directions=np.eye(3), significance=np.array([9.0, 0.0, 0.0]))
    return with_turns(SimpleNamespace(tuples=tuples), held, group), asked


@pytest.mark.parametrize("name", ["Oh", "Ih"])
def test_no_finite_group_holds_the_largest(monkeypatch, name):
    held = Generators(mirrors=tuple(mirror(n) for n in point_group(name).mirrors()))
    assert turned(monkeypatch, held, point_group(name)) == (held, [])


def test_several_mirrors_imply_all_but_the_order_of_the_main_axis(monkeypatch):
    frame = random_orthogonal(np.random.default_rng(11))
    group = PointGroup(name="C3v", frame=frame)
    held = Generators(mirrors=tuple(mirror(n) for n in group.mirrors()))
    ((direction, center),) = turned(monkeypatch, held, group)[1]
    assert line_angle_rad(direction, frame[2]) < 1e-9
    np.testing.assert_allclose(center, held.common_point)


def test_three_mirrors_across_each_other_may_be_those_of_a_tetrahedral_group(monkeypatch):
    frame = random_orthogonal(np.random.default_rng(12))
    held = Generators(mirrors=tuple(mirror(n) for n in frame))
    found, asked = turned(
        monkeypatch, held, PointGroup(name="D2h", frame=frame), found=lambda d, c: turn(d, 3.0, c)
    )  # fmt: skip
    diagonals = [frame.T @ unit(s) for s in ([1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1])]
    threefold = [t for t in found.turns if min(line_angle_rad(t.direction, d) for d in diagonals) < 1e-9]
    assert len(asked) == 2
    assert Generators(mirrors=held.mirrors, turns=tuple(threefold)).closed()[0].name == "Th"


@pytest.mark.parametrize("kind", ["plane", "axis", "none"])
def test_beside_one_mirror_no_axis_is_asked_for_where_the_tuples_speak(monkeypatch, kind):
    held = Generators(mirrors=(upright(0),))
    assert turned(monkeypatch, held, PointGroup(name="Cs"), kind) == (held, [])


def test_beside_one_mirror_the_axis_across_it_is_asked_for_where_all_tuples_vanish(monkeypatch):
    held = Generators(mirrors=(upright(0),))
    asked = turned(monkeypatch, held, PointGroup(name="Cs"))[1]
    assert min(line_angle_rad(d, held.mirrors[0].plane.normal) for d, _ in asked) < 1e-9


def test_beside_an_exact_axis_a_much_worse_one_is_not_taken(monkeypatch):
    def found(direction, center):
        return turn(direction, 2.0, center, bulk=0.05 if direction[0] > 0.9 else 0.9)

    turns = turned(monkeypatch, Generators(), PointGroup(name="C1"), found=found)[0].turns
    assert [t.verdict.bulk for t in turns] == [0.05]


# Directions that the n-tuples leave open, and what has no axis


@cache
def evidence(name):
    cube = box((0, 0, 0), (1, 1, 1))
    # A stud near each corner of a cube, that in the first octant out of place; each holds 0.2 % of the surface.
    corners = [np.array([x, y, z]) for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (-0.56, 0.56)]
    studs = [box(c - [0.2 * (c.min() > 0), 0, 0], (0.05, 0.05, 0.12)) for c in corners]
    shapes = {
        "table": table(),
        "box": join([box((0, 0, 0), (3, 2, 1))]),
        "cube": join([cube]),
        "studs": join([cube, *studs]),
    }
    return gather(measure(shapes[name]), TOLERANCE, np.random.default_rng(0))


def test_all_n_tuples_lie_along_the_axis_they_leave_open():
    e = evidence("table")
    assert e.tuples.kind == "axis"
    offered = axis_open(e)
    assert line_angle_rad(offered[0], [0, 0, 1]) < 1e-3
    assert all(line_angle_rad(d, offered[0]) < np.radians(15) + 2 / e.tuples.significance[0] for d in offered)


def test_two_independent_tuples_leave_no_axis_open():
    two = TupleClass(
        kind="plane", singular_values=[0.1, 0.1, 0], significance=[20.0, 15.0, 0.1], directions=np.eye(3)
    )  # fmt: skip
    assert len(axis_open(replace(evidence("cube"), tuples=two))) == 0
    one = replace(two, significance=[20.0, 3.0, 0.1])
    assert line_angle_rad(axis_open(replace(evidence("cube"), tuples=one))[0], [1, 0, 0]) < 1e-12


def test_little_significance_leaves_a_wide_cone_open():
    """A direction known to 2 / significance radians leaves open what lies within that."""
    u = unit([0.4, 0.1, 1.0])  # 22 degrees from an axis of the box
    seen = []
    for significance in (100.0, 3.5):
        tuples = TupleClass(
            kind="axis", singular_values=[0.1, 0, 0], significance=[significance, 0, 0],
            directions=np.stack([u, unit(np.cross(u, [1, 0, 0])), [0, 0, 1]]),
        )  # fmt: skip
        offered = axis_open(replace(evidence("box"), tuples=tuples))
        seen.append(any(line_angle_rad(d, [0, 0, 1]) < 0.01 for d in offered))
    assert seen == [False, True]


@pytest.mark.parametrize(
    ("name", "expected"), [("C1", "Ci"), ("C4", "C4h"), ("D3", "D3d"), ("O", "Oh"), ("C4h", "C4h")]
)
def test_the_inversion_of_a_cube_is_added_to_what_lacks_it(name, expected):
    frame = np.eye(3) if name != "D3" else np.stack([unit([1, -1, 0]), unit([1, 1, -2]), unit([1, 1, 1])])
    e = evidence("cube")
    found = with_improper(e, PointGroup(name=name, frame=frame), [verdict(0.1)], np.zeros(3), np.zeros(0, dtype=int))
    assert found.name == expected


@pytest.mark.parametrize(("name", "expected"), [("C2", "S4"), ("C3", "S6"), ("D2", "D2d"), ("D3", "D3d"), ("C4", "C4")])
def test_the_rotoreflection_of_the_main_axis_is_added(name, expected):
    """Points that have it, asked with the rotations alone."""
    images = np.einsum("kij,pj->kpi", point_group(expected).operations(), [(1.0, 0.35, 0.2), (0.3, 0.9, 0.6)])
    e = gather(measure(Shape(points=images.reshape(-1, 3))), TOLERANCE, np.random.default_rng(0))
    center = -e.moments.center / e.moments.scale
    found = with_improper(e, PointGroup(name=name), [verdict(0.0)], center, np.zeros(0, dtype=int))
    assert found.name == expected


def test_what_misses_far_more_than_the_rest_is_not_added():
    e = evidence("table")
    group, none = PointGroup(name="C4"), np.zeros(0, dtype=int)
    assert with_improper(e, group, [verdict(0.1)], np.zeros(3), none).name == "C4"


def test_improper_elements_keep_the_part_that_others_are_blamed_for():
    e = evidence("studs")
    center = -e.moments.center / e.moments.scale
    points = e.judge.cloud.points * e.moments.scale + e.moments.center
    part = np.flatnonzero((points[:, 2] > 0.505) & (points[:, 0] > 0) & (points[:, 1] > 0))
    assert len(part) > 5
    whole = with_improper(e, PointGroup(name="C1"), [verdict(0.2)], center, part[:0])
    assert whole.name == "Ci"  # the stud is too small to tell
    assert with_improper(e, PointGroup(name="C1"), [verdict(0.2)], center, part).name == "C1"
