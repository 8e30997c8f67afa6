"""Whether what was seen tells that a group holds, and where: what is free to move, and what nothing speaks for."""

import math
from functools import cache, partial
from itertools import combinations

import numpy as np
import pytest

from experiments.objects import damage, household
from experiments.objects.constructions import polygon
from experiments.objects.parts import assembled, extruded
from experiments.objects.shapes import bottle, box, join, mug, revolve, sample, table
from experiments.studies import single_views
from symrefine.decide.hypotheses import fitted, judged
from symrefine.decide.looks import few_motions, looked_at
from symrefine.decide.place import SUPPORTED, _needs, _ways, freest, is_told, least_elsewhere, nowhere, slack
from symrefine.detection.measure import gather, measure
from symrefine.detection.story import detect
from symrefine.fit.placed import FITTED, Placed, elements
from symrefine.fit.refine import Framed
from symrefine.geometry import Isometry, frame_with_z, line_angle_rad, rotation, unit
from symrefine.groups import PointGroup
from symrefine.propose.votes import meeting, revolution
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE
from symrefine.surface.skin import local_planes


def star(teeth):
    """A prism over a star."""
    return assembled([extruded(np.tile([1.0, 0.75], teeth)[:, None] * polygon(2 * teeth), -0.25, 0.25)])


MAKES = {
    "mug": mug,
    "bottle": bottle,
    "table": table,
    "slab": lambda: join([box((0, 0, 0), (1.0, 0.7, 0.02))]),
    "bar": lambda: join([box((0, 0, 0), (1.0, 0.08, 0.008)), box((0.3, 0, 0.008), (0.2, 0.04, 0.03))]),
    **{f"star{n}": partial(star, n) for n in (16, 20, 22)},
    "sheet": lambda: join([box((0, 0, 0), (1.0, 0.7, 1e-4))]),
}
# Of the mug the axis is z, and the handle stands along x.
BESIDE_THE_HANDLE, ABOVE = (0.75, 0.6, 0.3), (0.2, 0.3, 0.93)


@cache
def view(name, direction):
    """What a camera sees of a shape from a direction: the surface, and the centre of the whole in its coordinates."""
    made = damage.view(MAKES[name](), np.array(direction) / np.linalg.norm(direction), np.random.default_rng(3))
    measured = measure(Shape(points=made.points, viewpoint=made.viewpoint))
    center = -measured.moments.center / measured.moments.scale
    return gather(measured, np.random.default_rng(0))[1], center


def mirror(azimuth_deg, center):
    """A mirror through the z axis, its normal at an azimuth."""
    angle = math.radians(azimuth_deg)
    normal = np.array([math.cos(angle), math.sin(angle), 0.0])
    return Placed(group=PointGroup(name="Cs", frame=frame_with_z(normal)), center=center)


@pytest.mark.parametrize("azimuth_deg", [5.0, 10.0, 25.0])
def test_a_mirror_that_carries_the_handle_to_where_nobody_looked_is_not_told(azimuth_deg):
    """Nothing contradicts it, but turned it holds as well, or hardly anything speaks for it."""
    surface, center = view("mug", BESIDE_THE_HANDLE)
    true, false = (fitted(surface, mirror(a, center)) for a in (90.0, azimuth_deg))
    assert max(true.need, false.need) < 0.5 * surface.tolerance
    assert not false.told or false.elsewhere < 0.5 * surface.tolerance
    assert true.told
    assert true.elsewhere > 1.5 * surface.tolerance


def test_one_view_of_a_mug_tells_of_all_mirrors_through_its_axis_that_of_the_handle():
    made = damage.view(mug(), np.array(BESIDE_THE_HANDLE), np.random.default_rng(3))
    found = detect(Shape.of(made.points, viewpoint=made.viewpoint))
    through = [p.plane.normal for p in found.planes if abs(p.plane.normal[2]) < 0.5]
    assert [line_angle_rad(normal, [0.0, 1.0, 0.0]) < 0.02 for normal in through] == [True]
    assert found.at_least


@pytest.mark.parametrize("start_deg", [-6.0, 2.5])
def test_what_was_not_seen_draws_no_mirror_to_where_the_view_is_symmetric(start_deg):
    """What turns its back to the camera was matched with the outline of what was seen, which is a mirror image."""
    surface, center = view("mug", BESIDE_THE_HANDLE)
    look = looked_at(surface, mirror(90.0 + start_deg, center), 1.0)
    assert line_angle_rad(look.placed.group.frame[2], [0.0, 1.0, 0.0]) < math.radians(abs(start_deg))
    assert look.needs < 0.25 * surface.tolerance


@pytest.mark.parametrize("direction", [BESIDE_THE_HANDLE, ABOVE])
def test_a_bottle_seen_once_stands_where_it_stands(direction):
    surface, center = view("bottle", direction)
    axis = Placed(group=PointGroup(name="Cinfv"), center=center)
    assert judged(surface, axis).need < 0.5 * surface.tolerance
    assert least_elsewhere(surface, axis) > 1.5 * surface.tolerance


def test_what_is_narrow_is_turned_farther():
    """Turned about its length by as much as tells of a cube, a flat bar moves by little more than is forgiven."""
    surface, center = view("bar", (0.5, 0.4, 0.7))
    assert judged(surface, mirror(90.0, center)).need < 0.5 * surface.tolerance
    assert least_elsewhere(surface, mirror(90.0, center)) > 1.5 * surface.tolerance


def test_the_place_of_a_mirror_is_as_loose_as_what_was_seen_leaves_it():
    """From above a bottle may end anywhere below; where its axis is both sides of it tell."""
    surface, center = view("bottle", ABOVE)
    lying = Placed(group=PointGroup(name="Cs", frame=frame_with_z(np.array([0.0, 0.0, 1.0]))), center=center)
    loose, tight = slack(surface, lying), slack(surface, mirror(0.0, center))
    for found in (loose, tight):
        np.testing.assert_allclose(found, found.T, atol=1e-12)
        assert np.linalg.eigvalsh(found).min() > -1e-12
    assert math.sqrt(loose[5, 5]) > 0.01 * surface.diagonal
    assert math.sqrt(tight[3, 3]) < 0.003 * surface.diagonal


@pytest.mark.parametrize("fold", [16, 20, 22])
def test_a_group_of_many_folds_is_turned_by_a_part_of_its_wedge(fold):
    """By a whole one, or half of one for mirrors, it is turned into itself; what is round holds anywhere."""
    group = PointGroup(name=f"C{fold}v")
    star, center = view(f"star{fold}", ABOVE)
    assert least_elsewhere(star, Placed(group=group, center=center)) > 2.0 * star.tolerance
    bottle_seen, center = view("bottle", ABOVE)
    assert least_elsewhere(bottle_seen, Placed(group=group, center=center)) < bottle_seen.tolerance


@pytest.mark.parametrize(("name", "group"), [("star16", "C16v"), ("bottle", "C16v"), ("bottle", "Cinfv")])
def test_the_least_elsewhere_is_that_of_all_places_unless_less_is_enough(name, group):
    """One after the other they are asked less and less closely, as what needs more than another does not matter."""
    surface, center = view(name, ABOVE)
    placed = Placed(group=PointGroup(name=group), center=center)
    state, ways = _ways(surface, placed)
    least = least_elsewhere(surface, placed)
    assert least == pytest.approx(_needs(surface, placed, state, np.concatenate([-ways, ways])).min(), rel=1e-9)
    enough = least_elsewhere(surface, placed, nowhere(surface))
    assert least <= enough <= max(least, nowhere(surface))


def test_what_is_freest_is_a_turn_about_the_axis_of_what_is_round():
    cloud = local_planes(sample(bottle(), 4000, 0.0, np.random.default_rng(0)), 2000, np.random.default_rng(0))
    placed = mirror(25.0, np.zeros(3))
    frame = placed.group.frame
    standard = np.stack([frame @ m.matrix @ frame.T for m in few_motions(placed)])
    state = Framed(standard=standard, frame=frame, center=np.zeros(3))
    ways = freest(cloud, state)
    assert ways.shape == (3, 6)
    assert abs(ways[0][:3] @ frame @ [0.0, 0.0, 1.0]) > 0.99 * np.linalg.norm(ways[0])
    # None of them glides along the plane or turns about its normal.
    assert np.abs(ways[:, [2, 3, 4]]).max() < 1e-6
    # Each moves images by 1, in the mean square and as far as that is linear.
    image = placed.moved(state.moved(1e-4 * ways[0])).framed().motions[0].apply(cloud.points)
    away = image - state.motions[0].apply(cloud.points)
    assert math.sqrt((away**2).sum(axis=1).mean()) == pytest.approx(1e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "shares", "told"),
    [
        ("C2v", {"plane": 0.5, "axis": 0.0}, True),  # two mirrors make the axis
        ("C2v", {"plane": 0.0, "axis": 0.5}, False),
        ("D2h", {"plane": 0.0, "axis": 0.5, "inversion": 0.0}, False),
        ("D2h", {"plane": 0.0, "axis": 0.5, "inversion": 0.5}, True),
        ("Cinfv", {"axis": 0.0}, True),
        ("Dinfh", {"axis": 0.0, "plane": 0.0, "inversion": 0.0}, False),
        ("Dinfh", {"axis": 0.0, "plane": 0.5, "inversion": 0.0}, True),
        ("Td", {"plane": 0.5, "axis": 0.0, "improper": 0.0}, True),
    ],
)
def test_a_group_is_told_by_what_elements_that_were_seen_generate(name, shares, told):
    placed = Placed(group=PointGroup(name=name), center=np.zeros(3))
    assert is_told(placed, [(part, shares[part.kind]) for part in elements(placed.group)]) == told
    assert SUPPORTED <= 0.5


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.slow)])
@pytest.mark.parametrize("direction", [(0.3, 0.2, 0.93), pytest.param((0.7, 0.3, 0.6), marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["slab", pytest.param("sheet", marks=pytest.mark.slow)])
def test_one_side_of_a_slab_tells_nothing_of_the_other(name, direction, seed):
    """Its own plane is no mirror that anybody saw; of the groups that hold with it, its other mirrors are told."""
    made = damage.view(MAKES[name](), np.array(direction), np.random.default_rng(seed))
    found = detect(Shape.of(made.points, viewpoint=made.viewpoint))
    assert found.point_group == "C2v"
    assert found.at_least


@pytest.mark.parametrize("name", ["slab", "sheet"])
def test_the_plane_of_a_slab_moves_what_was_seen_by_no_more_than_is_forgiven(name):
    surface, center = view(name, ABOVE)
    (element,) = judged(surface, Placed(group=PointGroup(name="Cs"), center=center)).elements
    assert element.need < 0.5 * surface.tolerance
    assert element.coverage.unseen > 0.5
    assert element.coverage.supported < SUPPORTED


@pytest.mark.slow
def test_what_no_camera_saw_may_break_one_of_two_mirrors_and_leave_the_other():
    """Which of them is not known: each is as sure as the two together, and half of what one alone is."""
    made = damage.view(MAKES["slab"](), np.array(ABOVE), np.random.default_rng(3))
    found = detect(Shape.of(made.points, viewpoint=made.viewpoint))
    others = {a.point_group: a.probability for a in found.alternatives}
    assert set(others) == {"Cs", "C1"}
    assert others["C1"] < others["Cs"] < found.confidence
    assert [p.confidence for p in found.planes] == pytest.approx([found.confidence + 0.5 * others["Cs"]] * 2)
    assert [a.confidence for a in found.axes] == pytest.approx([found.confidence])


@pytest.mark.slow
def test_of_two_mirrors_that_exclude_one_another_none_is_sure_as_it_was_seen_less():
    """From below a chair without arms may have the mirror of its seat's diagonal, most of which is unseen."""
    family = next(c.family for c in single_views.cases(80, clean=False) if c.name == "chair")
    told = single_views.run(single_views.Case(family=family, name="chair", clean=False, seed=80)).told
    assert all(t.is_true >= 0 or t.confidence < 0.5 for t in told)


def test_a_wall_is_not_met_by_its_other_side():
    """The inner side of a bowl, seen from above, is carried onto its outer side by no operation that holds."""
    made = damage.view(mug(), np.array(ABOVE), np.random.default_rng(4))
    measured = measure(Shape(points=made.points, viewpoint=made.viewpoint))
    surface = gather(measured, np.random.default_rng(0))[1]
    assert surface.viewed
    towards = made.viewpoint[0] - measured.moments.center - measured.moments.scale * surface.cloud.points
    assert (np.einsum("ni,ni->n", towards, surface.cloud.normals) >= 0.0).mean() > 0.99
    through = Isometry.about(-measured.moments.center / measured.moments.scale, rotation([1.0, 0.0, 0.0], math.pi))
    turned = surface.seen(surface.misses([through]), [through])
    assert np.isnan(turned).mean() > 0.5  # upside down it turns its back to the camera
    assert (turned <= surface.far).mean() < 0.02


@pytest.mark.parametrize("order", [8, 30])
def test_an_axis_that_was_seen_in_part_is_judged_by_its_powers(order):
    few, more = (next(e for e in elements(PointGroup(name=f"C{order}"), powers=p) if e.kind == "axis") for p in (0, 8))
    assert len(few.matrices) == 2 < len(more.matrices) <= 10
    step = 2.0 * math.pi / order
    angles = [math.acos(np.clip(0.5 * (np.trace(m) - 1.0), -1.0, 1.0)) / step for m in more.matrices]
    np.testing.assert_allclose(angles, np.round(angles), atol=1e-6)
    apart = [np.linalg.norm(a - b) for a, b in combinations(more.matrices, 2)]
    assert min(apart) > 1e-6


def test_what_one_view_shows_is_judged_by_more_turns_than_what_all_sides_show():
    surface, center = view("bottle", ABOVE)
    whole = gather(
        measure(Shape(points=sample(bottle(), 5000, 0.0, np.random.default_rng(7)))), np.random.default_rng(0)
    )
    turns = Placed(group=PointGroup(name="C12"), center=center)
    seen, closed = (len(judged(s, turns).elements[0].operations.matrices) for s in (surface, whole[1]))
    assert seen > closed == 2


def test_the_axis_of_a_cone_that_is_nearly_a_cylinder_is_a_line_all_the_same():
    """All normals lie nearly across its direction, which is no line; half of it was seen, with some noise."""
    rng = np.random.default_rng(5)
    angle, z, slope = rng.uniform(0.0, math.pi, 3000), rng.uniform(-1.5, 1.5, 3000), 0.05
    points = np.stack([(1.0 + slope * z) * np.cos(angle), (1.0 + slope * z) * np.sin(angle), z], axis=1)
    normals = np.stack([np.cos(angle), np.sin(angle), np.full(3000, -slope)], axis=1)
    normals += rng.normal(scale=0.03, size=normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    direction, through = revolution(points - [0.0, 0.6, 0.0], normals)
    assert line_angle_rad(direction, [0.0, 0.0, 1.0]) < math.radians(2.0)
    assert np.linalg.norm(np.cross(np.array([0.0, -0.6, 0.0]) - through, direction)) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("eye", [(0.0, 0.0, 5.0), (0.4, -0.2, 3.0)])
def test_a_ball_that_one_camera_saw_is_one_turned_as_one_likes(eye):
    """Of its mirrors and axes each holds as well elsewhere; its own group does where it is turned, and not moved."""
    x = np.random.default_rng(6).normal(size=(20000, 3))
    ball = 0.2 * x / np.linalg.norm(x, axis=1)[:, None]
    seen = ball[ball @ np.array(eye) > 0.04]
    found = detect(Shape.of(seen, viewpoint=eye))
    assert (found.point_group, found.confidence > 0.9) == ("Kh", True)
    assert np.linalg.norm(found.center) < 0.002


def test_normals_of_a_part_of_a_ball_meet_in_its_middle_whatever_stands_on_it():
    rng = np.random.default_rng(8)
    across = unit(rng.normal(size=(4000, 3)) + [0.0, 0.0, 2.0])
    middle = np.array([0.3, -0.2, 0.5])
    foot = rng.random((1000, 3)) * [1.0, 1.0, 0.0]
    points, normals = (
        np.concatenate([middle + across, foot]),
        np.concatenate([across, np.tile([0.0, 0.0, 1.0], (1000, 1))]),
    )
    assert np.linalg.norm(meeting(points, normals) - middle) < 1e-9


def test_whole_objects_ask_nothing_of_the_sort():
    surface = gather(
        measure(Shape(points=sample(mug(), 5000, 0.0, np.random.default_rng(6)))), np.random.default_rng(0)
    )[1]
    found = fitted(surface, mirror(90.0, np.zeros(3)))
    assert found.told
    assert found.elsewhere == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mug", "bar", "star16"])
def test_a_larger_tolerance_takes_no_group_away_that_a_smaller_one_tells(name):
    """Though it holds elsewhere as well at that tolerance: it is known to stand where it does at the one asked for."""
    made = damage.view(MAKES[name](), np.array([0.5, 0.4, 0.7]), np.random.default_rng(3))
    found = detect(Shape.of(made.points, viewpoint=made.viewpoint), ladder=(0.02, 0.04, 0.08))
    steps = [found.examined.decided(t).index for t in (0.02, 0.04, 0.08)]
    assert steps == sorted(steps)
    assert steps[0] > 0


@pytest.mark.parametrize("seed", [2, 3, 14])
def test_turns_are_judged_forth_and_back_where_a_part_was_seen(seed):
    """By a third of a turn the spout goes out of sight, back by a third to where a camera saw that nothing is."""
    body = revolve([(0, 0), (0.5, 0), (0.55, 0.2), (0.42, 0.6), (0.2, 0.75), (0, 0.78)])
    kettle = join([body, household.rod((0.4, 0, 0.3), (0.85, 0, 0.65), 0.1, 0.05)])
    made = damage.views(kettle, 1, np.random.default_rng(seed))
    measured = measure(Shape(points=made.points, viewpoint=made.viewpoint))
    surface = gather(measured, np.random.default_rng(0))[1]
    center = -measured.moments.center * [1, 1, 0] / measured.moments.scale
    assert judged(surface, Placed(group=PointGroup(name="C3"), center=center)).need > 2.0 * TOLERANCE


@pytest.mark.parametrize("name", ["C3", "C4", "C7", "S4", "S6", "D3d"])
def test_what_stands_for_an_element_of_a_part_that_was_seen_has_its_inverses(name):
    for part in elements(PointGroup(name=name), powers=FITTED):
        for matrix in part.matrices:
            assert min(np.linalg.norm(matrix.T - other) for other in part.matrices) < 1e-9
