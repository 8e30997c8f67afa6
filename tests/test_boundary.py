"""Objects at the boundary of what can be decided have the symmetry that is stated; answers are judged by it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from experiments.objects import constructions, ladders
from experiments.objects.boundary import FAMILIES, base, instance
from experiments.objects.built_symmetry import Truth
from experiments.objects.instances import centred, of_parts
from experiments.objects.ladders import MOVED, TOLERANCES, generated, subgroup
from experiments.objects.parts import marked_group
from experiments.objects.poses import Pose, posed
from experiments.objects.shapes import sample
from experiments.studies import boundary
from experiments.studies.answers import answer_confidence, fitted, ladder_faults, ladder_outcome, outcome, within
from experiments.studies.boundary import VIEWS, Case, plan, run
from symrefine.detection.measure import measure
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import householder, random_orthogonal, rotation
from symrefine.groups import PointGroup, point_group
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.shape import Shape

# Vertices of exact constructions, in diagonals: rounding only.
EXACT = 1e-9
POLYHEDRA = {
    "rotors": "fan7 propeller12 turbine24 impeller11 ratchet16 helical19",
    "gears": "spur13 bossed9 crown21 knob18",
    "round": "vase16 spool18 ring24 wide_tab lugs label oval_bottle_0.5 oval_drum_2",
    "sparse": " ".join(FAMILIES["sparse"]),
}
DEFECTS = [name for name in FAMILIES["scans"] if not name.endswith("shifted")]


def off(made, operation):
    """Distances of the vertices, moved about the centre, from the nearest of them, in diagonals."""
    points = made.shape.points - made.truth.center
    return cKDTree(points).query(points @ operation.T)[0] / made.diagonal


def some(group, count=8):
    """Operations of a group; of a continuous one those of a mesh with few facets are asked of `also`."""
    operations = group.operations()
    return operations[np.random.default_rng(0).permutation(len(operations))[:count]]


def finite(made):
    """The largest finite group that a mesh has: of a round one that of its facets."""
    return made.truth.group if made.truth.group.is_finite else made.also[0]


def test_families_have_enough_objects_in_both_halves():
    for family, builds in FAMILIES.items():
        halves = {fitted(base(name)) for name in builds}
        assert len(builds) >= 16, family
        assert halves == {True, False}, family


def test_variants_of_an_object_share_its_dimensions_and_its_half():
    dent, shifted = instance("scans", "cabinet dent"), instance("scans", "cabinet shifted")
    assert np.allclose(np.ptp(dent.shape.points, axis=0), np.ptp(shifted.shape.points, axis=0), atol=0.05)
    assert Case(family="scans", name="cabinet dent").half == Case(family="scans", name="cabinet shifted").half


@pytest.mark.parametrize(("family", "name"), [("rotors", "fan7"), ("blobs", "heap3"), ("far", "table stray10")])
def test_a_seed_varies_dimensions_and_nothing_else_does(family, name):
    first, again, other = instance(family, name), instance(family, name), instance(family, name, 1)
    np.testing.assert_array_equal(first.shape.points, again.shape.points)
    assert not math.isclose(first.diagonal, other.diagonal) or not np.allclose(first.shape.points, other.shape.points)


@pytest.mark.parametrize(("family", "name"), [(f, n) for f, names in POLYHEDRA.items() for n in names.split()])
def test_meshes_have_the_stated_group(family, name):
    for seed in (0, 1):
        made = instance(family, name, seed)
        assert max(off(made, g).max() for g in some(finite(made))) < EXACT


@pytest.mark.parametrize("name", POLYHEDRA["rotors"].split())
def test_rotors_have_no_mirror_and_no_smaller_step(name):
    made = instance("rotors", name)
    fold = int(made.truth.group.symbol.fold)
    mirrors = [householder([np.sin(a), np.cos(a), 0]) for a in np.pi / fold * np.arange(2) / 2]
    more = [rotation([0, 0, 1], np.pi / fold), householder([0, 0, 1]), *mirrors]
    if made.truth.group.symbol.family == "C":
        more.append(rotation([1, 0, 0], np.pi))
    assert min(off(made, g).max() for g in more) > 1e-3


@pytest.mark.parametrize("name", POLYHEDRA["gears"].split())
def test_gears_have_no_more_than_is_stated(name):
    made = instance("gears", name)
    more = [rotation([0, 0, 1], np.pi / made.truth.group.symbol.fold)]
    if made.truth.group.symbol.family == "Cv":
        more.append(householder([0, 0, 1]))
    assert min(off(made, g).max() for g in more) > 1e-3


@pytest.mark.parametrize(("family", "name"), [("rotors", "turbine12"), ("rotors", "impeller11"), ("round", "label")])
def test_parts_are_turned_outwards(family, name):
    mesh = instance(family, name).shape
    areas, normals = triangle_areas_and_normals(mesh.points, mesh.faces)
    centers = mesh.points[mesh.faces].mean(axis=1)
    np.testing.assert_allclose(areas @ normals, 0.0, atol=1e-9)
    flux = centers.T @ (areas[:, None] * normals)
    np.testing.assert_allclose(flux, flux[0, 0] * np.eye(3), atol=1e-9)
    assert flux[0, 0] > 0


def test_round_may_be_answered_of_a_small_detail_only():
    also = {name: [g.name for g in instance("round", name).also] for name in FAMILIES["round"]}
    assert also["tab"] == also["dot"] == also["lugs"] == also["label"] == also["screw"] == ["Cinfv"]
    assert also["wide_tab"] == also["wide_lugs"] == []
    assert also["oval_drum_2"] == ["Dinfh"]
    assert also["vase16"] == ["C16v"]


@pytest.mark.parametrize("name", ["table doubled", "chair patched", "stool3 shelled", "cross finer"])
def test_uneven_meshes_are_symmetric_but_for_their_areas(name):
    made = instance("uneven", name)
    points = sample(made.shape, 30000, 0.0, np.random.default_rng(0))
    tree = cKDTree(points)
    for g in some(made.truth.group, 4):
        # Spacing of 30,000 points is 0.5 % of the diagonal; a shell lies 0.3 % deep at most.
        assert np.quantile(tree.query(points[::10] @ g.T)[0], 0.999) < 0.02 * made.diagonal
    if name.endswith("finer"):
        return
    corners = made.shape.points[made.shape.faces]
    areas = triangle_areas_and_normals(made.shape.points, made.shape.faces)[0]
    sides = np.sign(corners.mean(axis=1) @ made.truth.group.mirrors().T) * areas[:, None]
    assert np.abs(sides.sum(axis=0)).max() > 0.0015 * areas.sum()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["table walled", "stool3 walled", "chair rough", "starfish walled"])
def test_more_area_on_one_side_breaks_no_symmetry(name):
    """It draws the centroid to it by more than starts may be off."""
    made = instance("uneven", name)
    assert measure(made.shape).density is not None
    assert detect(made.shape).point_group == made.truth.group.name


@pytest.mark.parametrize("name", DEFECTS[::2])
def test_a_defect_is_as_large_as_is_said(name):
    made = instance("scans", name)
    assert 0.001 < made.differs < 0.02
    points = sample(made.shape, 40000, 0.0, np.random.default_rng(0)) - made.truth.center
    tree = cKDTree(points)
    seen = [np.mean(tree.query(points[::4] @ g.T)[0] > 0.012 * made.diagonal) for g in made.truth.group.operations()]
    assert max(seen) < 2.5 * made.differs + 0.001


@pytest.mark.parametrize("name", [n for n in FAMILIES["scans"] if n.endswith("shifted")])
def test_siblings_have_what_is_left_and_no_more(name):
    made = instance("scans", name)
    whole = instance("scans", next(n for n in DEFECTS if base(n) == base(name)))
    left, meant = made.truth.group, whole.truth.group
    assert left.order < meant.order
    assert max(off(made, g).max() for g in left.operations()) < EXACT
    lost = [g for g in meant.operations() if left.distance_rad(g[None])[0] > 1e-3]
    # Enough of the surface is out of place for it to be no defect.
    points = sample(made.shape, 40000, 0.0, np.random.default_rng(0)) - whole.truth.center
    tree = cKDTree(points)
    assert min(np.mean(tree.query(points[::4] @ g.T)[0] > 0.02 * made.diagonal) for g in lost) > 0.02


@pytest.mark.parametrize("name", ["blob0", "blob4", "heap3", "bent1", "bent2"])
def test_objects_without_symmetry_have_none_nearly(name):
    made = instance("blobs", name)
    points = sample(made.shape, 4000, 0.0, np.random.default_rng(0))
    points = points - points.mean(axis=0)
    tree = cKDTree(points)
    directions = np.random.default_rng(1).normal(size=(300, 3))
    moved = [g for n in directions for g in (householder(n / np.linalg.norm(n)), rotation(n, np.pi))]
    assert min(np.quantile(tree.query(points[::20] @ g.T)[0], 0.95) for g in moved) > 0.02 * made.diagonal


def test_extremes_are_as_extreme_as_is_said():
    stray, heavy = instance("far", "blob stray10000"), instance("far", "table heavy1e+12")
    radii = np.sort(np.linalg.norm(stray.shape.points, axis=1))
    assert radii[-1] == pytest.approx(1e4 * radii[-2])
    assert stray.diagonal < 3 * radii[-2]
    assert heavy.shape.weights.max() == 1e12
    assert (heavy.shape.weights == 1).sum() == len(heavy.shape.points) - 1
    line = instance("far", "line25x8").shape.points
    assert np.linalg.matrix_rank(line) == 1
    assert len(np.unique(line, axis=0)) == 25
    assert len(line) == 200


@pytest.mark.parametrize("name", [n for n in FAMILIES["far"] if n.startswith(("chain", "end"))])
def test_linear_molecules_have_both_ends_alike_or_not(name):
    made = instance("far", name)
    marks = np.column_stack([made.shape.points, made.shape.labels])
    group, center = marked_group(marks)
    assert group.name == made.truth.group.name
    assert made.truth.group.distance_rad(group.sampled(5).operations()).max() < 1e-6
    assert name.startswith("end") or np.allclose(center, made.truth.center)


@pytest.mark.parametrize("name", FAMILIES["tolerances"])
def test_molecules_have_what_is_exact_and_no_more(name):
    made = instance("tolerances", name, 1)
    group, center = marked_group(np.column_stack([made.shape.points, made.shape.labels]))
    assert group.name == made.truth.group.name
    assert made.truth.group.distance_rad(group.operations()).max() < 1e-5
    if " to " in name:
        plain = instance("tolerances", name.split()[0]) if name.split()[0] in FAMILIES["tolerances"] else None
        assert plain is None or MOVED[0] / 3 < np.abs(made.shape.points - plain.shape.points).max() / plain.diagonal
        assert np.linalg.norm(center - made.truth.center) < MOVED[1] * made.diagonal


def test_generators_make_their_group_and_subgroups_are_found(monkeypatch):
    rng = np.random.default_rng(0)
    assert len(generated([rotation([0, 0, 1], 2 * np.pi / 5), householder([1, 0, 0])])) == 10
    cube = point_group("Oh", random_orthogonal(rng))
    for name in ("D3d", "C4v", "Cs", "T"):
        found = subgroup(cube, name, rng)
        assert found.name == name
        assert within(found, cube)
    monkeypatch.setattr(ladders, "TRIES", 20)
    with pytest.raises(AssertionError, match="no subgroup I"):
        subgroup(point_group("D3"), "I", rng)


# Judging


@pytest.fixture(scope="module")
def crate():
    """A box-like mesh of group D2h in a pose, what is known of it, and what was found."""
    made, pose = of_parts(constructions.crate(), "D2h"), Pose.random(np.random.default_rng(4))
    found = detect(posed(made.shape, pose))
    assert found.point_group == "D2h"
    return made, pose, surely(found, 1.0)


def surely(found, confidence):
    """The same detection as sure as is said."""
    return replace(found, confidence=confidence)


def test_an_answer_is_right_with_its_group_in_its_place(crate):
    made, pose, found = crate
    assert answer_confidence(surely(found, 0.7)) == 0.7
    assert outcome(found, made, pose) == "right"
    other = replace(made, truth=centred("D4h"))  # a group that holds the answer: it is too small, and sure
    assert outcome(found, other, pose) == "sure and wrong"
    unsure = surely(found, 0.5)
    assert outcome(unsure, other, pose) == "at least"
    assert outcome(unsure, replace(other, also=(made.truth.group,)), pose) == "right"
    assert outcome(unsure, replace(other, also=(made.truth.group,), also_from=0.03), pose) == "at least"
    assert outcome(unsure, replace(other, subgroups=True), pose) == "right"
    aside = Truth(group=made.truth.group, center=0.1 * made.diagonal * np.ones(3))
    assert outcome(found, replace(made, truth=aside), pose) == "sure and wrong"
    assert outcome(unsure, replace(made, truth=centred("C1")), pose) == "unsure and wrong"
    assert outcome(unsure, replace(made, undecidable=True), pose) == "unsure and wrong"
    doubtful = replace(found, undetermined="too few points")
    assert outcome(doubtful, made, pose) == "undetermined"
    assert outcome(doubtful, replace(made, undecidable=True), pose) == "right"


def test_a_ladder_only_grows_and_keeps_what_is_exact():
    made, pose = instance("tolerances", "benzene"), Pose.random(np.random.default_rng(2))
    shape, truth = posed(made.shape, pose), made.truth.posed(pose)
    found = [detect(shape, tolerance=t) for t in (0.001, 0.02)]
    assert not ladder_faults(found, shape, truth)
    less = replace(found[1], point_group="C2h", group=PointGroup(name="C2h", frame=found[1].group.frame))
    faults = ladder_faults([found[0], less], shape, truth)
    assert [fault for _, fault in faults] == [
        "C2h at 2 % lacks what is exact",
        "C2h at 2 % lacks what D6h has at 0.1 %",
    ]
    more = replace(found[1], point_group="D12h", group=PointGroup(name="D12h", frame=found[1].group.frame))
    assert [fault for _, fault in ladder_faults([found[0], more], shape, truth)] == ["D12h at 2 % does not fit"]
    doubt = replace(found[1], undetermined="too coarse")
    assert ladder_outcome(found, []) == "right"
    assert ladder_outcome([doubt], []) == "undetermined"
    assert ladder_outcome(found, [0.2, 0.99]) == "sure and wrong"
    assert ladder_outcome(found, [0.2]) == "at least"
    assert ladder_outcome(found, [0.93]) == ladder_outcome(found, [math.nan]) == "unsure and wrong"


def test_a_divisor_of_the_order_is_within_a_group_and_another_number_is_not():
    whole = PointGroup(name="D100h")
    assert within(PointGroup(name="D50h"), whole)
    assert within(PointGroup(name="C25v"), whole)
    assert not within(PointGroup(name="D99h"), whole)
    assert within(whole, PointGroup(name="Dinfh"))
    assert not within(PointGroup(name="Dinfh"), whole)


# The study


def test_a_pose_keeps_weights_and_labels_and_turns_normals():
    rng = np.random.default_rng(3)
    pose, points = Pose.random(rng), rng.normal(size=(20, 3))
    shape = Shape(points=points, weights=np.arange(20.0), labels=np.arange(20), normals=points)
    moved = posed(shape, pose)
    np.testing.assert_array_equal(moved.weights, shape.weights)
    np.testing.assert_array_equal(moved.labels, shape.labels)
    np.testing.assert_allclose(moved.normals, shape.normals @ pose.turn.T)


def test_the_plan_has_every_object_and_shows_noise_where_it_leaves_something():
    cases = list(plan(list(FAMILIES), boundary.HALVES, 1, 0))
    assert {(c.family, c.name) for c in cases} == {(f, n) for f, builds in FAMILIES.items() for n in builds}
    noisy = {c.name for c in cases if c.family == "rotors" and VIEWS["rotors"][c.view].noise_rel}
    assert {"fan7", "turbine24"} <= noisy
    assert "fan36" not in noisy
    assert {c.half for c in plan(list(FAMILIES), ["reporting"], 1, 0)} == {"reporting"}
    assert len(cases) > 400


@pytest.mark.parametrize(
    ("case", "message"),
    [
        (Case(family="rocks", name="fan7"), "family"),
        (Case(family="rotors", name="fan8"), "name"),
        (Case(family="rotors", name="fan7", view=9), "view"),
        (Case(family="rotors", name="fan7", seed=-1), "seed"),
    ],
)
def test_cases_that_cannot_be_run_are_refused(case, message):
    with pytest.raises(InputError, match=message):
        run(case)


def test_points_on_a_line_and_a_molecule_are_asked_without_breaking():
    assert run(Case(family="far", name="chain8")).outcome == "right"
    told = run(Case(family="tolerances", name="water"))
    assert told.outcome in boundary.OUTCOMES
    assert told.truth == "C2v"
    assert len(TOLERANCES) > 5


def test_the_study_prints_its_table(capsys):
    with pytest.raises(SystemExit, match="0"):
        boundary.main(["--help"])
    assert "python -m experiments.studies.boundary" in capsys.readouterr().out
    boundary.main(["--families", "uneven", "--every", "8", "--verbose"])
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("uneven calibration") for line in lines)
    assert any(line.startswith("all ") for line in lines)


@pytest.mark.parametrize(("view", "seed"), [(0, 7), (0, 11), (0, 16), (1, 1)])
def test_noise_that_a_small_cloud_tells_over_and_over_is_told_once(view, seed):
    """Halves of 600 points tell 3,000 distances, not as many as independent ones: the farthest are farther than these.

    Taken as so many, a few planes at the rim of a cone that lie beyond all of them were a detail, and it was Cs.
    """
    assert run(Case(family="sparse", name="cone", view=view, seed=seed)).outcome == "right"


@pytest.mark.parametrize(("name", "view"), [("spined1", 1), pytest.param("knobbed1", 3, marks=pytest.mark.slow)])
def test_what_is_finer_than_moments_are_is_found(name, view):
    """Nothing proposed the half turn of an urchin, and C1 was told, at 1.000 and .992."""
    assert run(Case(family="spread", name=name, view=view, seed=5)).outcome == "right"


@pytest.mark.parametrize("name", ["circle 2000", "ellipse 500", "arch 500", "sigmoid 2000", "helix 500", "cable 500"])
def test_a_curve_is_told_from_its_points_alone(name):
    """All planes along a flat one are the same, which said nothing of where in it a mirror stands: C2v, for certain."""
    assert run(Case(family="curves", name=name, seed=1)).outcome == "right"


@pytest.mark.parametrize("name", ["crown 800", "trefoil 800", "helix 2000", "spring bent 2000"])
def test_a_bent_rod_is_told_from_its_points_alone(name):
    """As thick as neighbourhoods are wide: noise was taken for too little, and a crown of 800 undetermined for it."""
    assert run(Case(family="rods", name=name, seed=1)).outcome == "right"
