"""Meshes whose vertices a group maps onto one another: told so, in any pose and unit, and the same by every way out."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import symrefine
from experiments.objects.boundary import instance
from experiments.objects.group_shapes import DESIGNS
from experiments.objects.group_shapes import shape as mesh_of
from experiments.objects.parts import placed_group
from experiments.objects.shapes import bottle, box, join, mug, sample, table
from experiments.studies import boundary
from symrefine.cli.tables import record_lines
from symrefine.export.bop import decided
from symrefine.fit.anchors import stays
from symrefine.fit.vertices import NEAR, ROUNDED, exact_symmetry, on_vertices
from symrefine.geometry import random_orthogonal, rotation
from symrefine.groups import PointGroup
from symrefine.shape import Shape
from symrefine.symmetrize import exact_place

# Tessellated as symmetrically as they are built: the shafts of others have 48 sides, whatever the number of blades.
EXACT = (
    *("chair", "skew_box", "fan2", "fan8", "stool8", "gear12", "rotor3", "swirl4", "propeller3", "crossed4"),
    *("caltrop", "snub_balls", "cube", "bossed_cube"),
)
WITH_FACES = ("fan8", "caltrop", "cube", "chair")
BROKEN = ("fan5", "wheel7", "crossed5")


def posed(name, seed=0, scale=1.0, away=0.0):
    """A mesh in a pose, vertices and faces in another order, and its group as far off as samples leave it."""
    mesh, (group, center) = mesh_of(name), placed_group(DESIGNS[name].parts())
    rng = np.random.default_rng(seed)
    turn, order = random_orthogonal(rng), rng.permutation(len(mesh.points))
    there = away * rng.standard_normal(3)
    faces = rng.permutation(np.argsort(order)[mesh.faces])
    shape = Shape(scale * (mesh.points[order] @ turn.T + there), faces)
    off = rotation([0.3, -0.5, 0.8], 2e-4)
    near = PointGroup(name=group.name, frame=group.frame @ turn.T @ off)
    truth = PointGroup(name=group.name, frame=group.frame @ turn.T)
    return shape, near, scale * (turn @ center + there + 1e-4 * mesh.diagonal), truth


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "snub_balls" else n for n in EXACT])
@pytest.mark.parametrize(
    ("scale", "away"),
    [pytest.param(1.0, 0.0, marks=pytest.mark.slow), (1e-3, 3.0), pytest.param(1e4, 100.0, marks=pytest.mark.slow)],
)
def test_vertices_know_the_place_of_their_group_to_rounding(name, scale, away):
    shape, near, center, truth = posed(name, len(name), scale, away)
    found = on_vertices(shape, near, center)
    rounding = 1e-14 * (1.0 + away)
    assert found is not None
    assert found.miss < rounding
    assert found.group.distance_rad(truth.operations()).max() < 1e3 * rounding
    moved = np.einsum("kij,nj->kni", found.finite.operations(), shape.points - found.center) + found.center
    nearest = np.linalg.norm(moved[-1][:, None] - shape.points, axis=2).min(axis=1)
    assert nearest.max() < 10.0 * rounding * shape.diagonal


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize(("scale", "away"), [(1.0, 0.0), (1e-3, 3.0), (1e4, 100.0)])
def test_vertices_know_their_group_with_nothing_else_known(name, scale, away):
    shape, near, center, _ = posed(name, len(name), scale, away)
    found, given = exact_symmetry(shape, shape.diagonal)[0], on_vertices(shape, near, center)
    assert found.group.name == near.name
    assert found.faces == given.faces
    assert found.group.distance_rad(given.group.operations()).max() < 1e-11 * (1.0 + away)
    # About the same point, but for what a polar group leaves free along its axis.
    moved = np.einsum("kij,j->ki", given.group.operations(), found.center - given.center)
    assert np.ptp(moved, axis=0).max() < 1e-11 * (1.0 + away) * shape.diagonal


@pytest.mark.parametrize("name", BROKEN)
def test_a_tessellation_that_breaks_the_symmetry_is_not_exact(name):
    shape, near, center, _ = posed(name)
    assert on_vertices(shape, near, center) is None
    assert exact_symmetry(shape, shape.diagonal)[0].group.name != near.name


@pytest.mark.parametrize("name", EXACT)
def test_faces_are_exact_however_they_are_cut(name):
    """A square that is cut along a diagonal maps its corners onto its corners, and itself onto itself."""
    shape, near, center, _ = posed(name)
    found = on_vertices(shape, near, center)
    assert found is not None
    assert found.faces
    turned_round = Shape(shape.points, shape.faces[:, ::-1])
    assert on_vertices(turned_round, near, center).faces == found.faces


@pytest.mark.parametrize("name", WITH_FACES)
def test_doubled_faces_are_the_same_surface(name):
    shape, near, center, _ = posed(name)
    twice = Shape(shape.points, np.concatenate([shape.faces, shape.faces]))
    assert on_vertices(twice, near, center).faces
    one_twice = Shape(shape.points, np.concatenate([shape.faces, shape.faces[[5]]]))
    assert on_vertices(one_twice, near, center).faces
    split = Shape(
        np.concatenate([shape.points, shape.points]), np.concatenate([shape.faces, shape.faces + len(shape.points)])
    )
    assert on_vertices(split, near, center).faces
    corners = shape.points[shape.faces]
    sizes = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    less = Shape(shape.points, np.delete(shape.faces, sizes.argmax(), axis=0))
    assert not on_vertices(less, near, center).faces


def test_a_face_that_is_cut_where_it_bends_misses_by_that():
    """A lid out of its plane by less than rounding of coordinates, and cut along one diagonal of two."""
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.7, 0.7) for z in (-0.4, 0.4)])
    faces = ConvexHull(box).simplices
    lid = np.flatnonzero(box[:, 2] > 0.0)
    for bend in (0.0, 1e-6):
        bent = box.copy()
        bent[lid, 2] += bend * np.sign(bent[lid, 0] * bent[lid, 1])  # two corners up, two down
        found = exact_symmetry(Shape(bent, faces), 2.6)[0]
        assert found.faces
        assert bend <= found.miss <= 2.0 * bend + 1e-15


@pytest.mark.parametrize("tolerance", [1e-4, 0.02])
def test_what_faces_leave_of_the_group_of_vertices_is_proven(tolerance):
    """A box without its lid, or with one side of another colour, has the corners of a whole one."""
    rng, turn = np.random.default_rng(3), rotation([0.4, 1.0, -0.2], 0.8)
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.7, 0.7) for z in (-0.4, 0.4)])
    faces = rng.permutation(ConvexHull(box).simplices)
    lid = (box[faces][:, :, 2] > 0.0).all(axis=1)
    points = 25.0 * box @ turn.T + 3.0
    for shape in (Shape(points, faces[~lid]), Shape(points, faces, labels=lid.astype(int))):
        found = symrefine.detect(shape, tolerance=tolerance)
        assert (found.point_group, found.exact.faces, found.confidence > 0.95) == ("C2v", True, True)
        assert np.abs(found.axes[0].axis.direction @ turn[:, 2]) == pytest.approx(1.0, abs=1e-12)
    assert symrefine.detect(Shape(points, faces), tolerance=tolerance).point_group == "D2h"


@pytest.mark.parametrize(("sides", "digits"), [(24, 4), (96, 4), (12, 3)])
def test_faces_that_are_cut_into_thin_triangles_are_exact_by_rounded_coordinates(sides, digits):
    """A plate of 100 mm with a round hole: most of its triangles are as thin as the sides of the hole are short."""
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    rim = 10.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners = np.array([[50.0, 30.0], [-50.0, 30.0], [-50.0, -30.0], [50.0, -30.0]])
    flat = np.concatenate([rim, corners])
    low, high = (np.column_stack([flat, np.full(len(flat), z)]) for z in (-4.0, 4.0))
    fan = [(k, (k + 1) % sides, sides + int(4 * k / sides)) for k in range(sides)]
    quarter = [(sides // 4 * (k + 1) % sides, sides + k, sides + (k + 1) % 4) for k in range(4)]
    top = np.array([*fan, *quarter])
    walls = [(i, j) for ring in (range(sides), range(sides, sides + 4)) for i, j in pairwise([*ring, ring[0]])]
    count = len(flat)
    sides_of = [t for i, j in walls for t in ((i, j, count + i), (j, count + j, count + i))]
    points = np.round(np.concatenate([low, high]) @ rotation([0.3, 0.2, 1.0], 0.7).T, digits)
    found = symrefine.detect(Shape(points, np.array([*top, *(top + count), *sides_of])), tolerance=1e-4)
    assert (found.point_group, found.exact.faces) == ("D2h", True)


def test_labels_of_faces_count():
    shape, near, center, _ = posed("cube")
    alike = Shape(shape.points, shape.faces, labels=np.full(len(shape.faces), 7))
    assert on_vertices(alike, near, center).faces
    one_other = Shape(shape.points, shape.faces, labels=(np.arange(len(shape.faces)) == 3).astype(int))
    assert not on_vertices(one_other, near, center).faces


def test_parts_that_touch_share_vertices_but_for_rounding():
    shape, near, center, _ = posed("caltrop")
    rng, size = np.random.default_rng(0), shape.diagonal
    apart = shape.points[shape.faces].reshape(-1, 3) + 1e-15 * size * rng.standard_normal((3 * len(shape.faces), 3))
    found = on_vertices(Shape(apart, np.arange(len(apart)).reshape(-1, 3)), near, center)
    assert found is not None
    assert found.miss < 1e-13
    assert found.faces


@pytest.mark.parametrize("name", ["chair", "fan8", "caltrop"])
def test_noise_of_vertices_is_told_or_too_much(name):
    shape, near, center, _ = posed(name)
    size, rng = shape.diagonal, np.random.default_rng(1)
    one = np.unique(shape.points, axis=0, return_inverse=True)[1].ravel()  # parts that touch share places
    for noise in (1e-7, 1e-3):
        noisy = Shape(shape.points + noise * size * rng.standard_normal(shape.points.shape)[one], shape.faces)
        found = on_vertices(noisy, near, center)
        if noise < ROUNDED:
            assert noise < found.miss < 20.0 * noise
        else:
            assert found is None
    place = exact_place(shape, near, center)
    bent = shape.points.copy()
    bent[5] += 0.2 * NEAR * size
    moved = Shape(bent, shape.faces)
    assert on_vertices(moved, near, center) is None
    # What exports may still place by its vertices.
    assert np.linalg.norm(exact_place(moved, near, center)[1] - place[1]) < NEAR * size


def test_what_has_no_group_or_all_of_space_is_not_looked_at():
    assert on_vertices(table(), PointGroup(name="C1"), np.zeros(3)) is None
    assert on_vertices(table(), PointGroup(name="Kh"), np.zeros(3)) is None


def test_a_lathed_mesh_has_the_fold_of_its_rings():
    shape = bottle()
    tilted = PointGroup(name="Cinfv", frame=rotation([1.0, 0.4, 0.0], 1e-4))
    found = on_vertices(shape, tilted, shape.points.mean(axis=0) + 1e-4)
    assert found is not None
    assert found.group.name == "Cinfv"
    assert found.finite.is_finite
    assert found.miss < 1e-13
    np.testing.assert_allclose(np.abs(found.group.frame[2]), [0.0, 0.0, 1.0], atol=1e-13)


@pytest.mark.parametrize("name", ["chair", "fan8", "caltrop"])
def test_report_nearest_shape_and_export_agree_to_the_last_digit(name):
    shape, _, _, truth = posed(name, 3, 40.0, 2.0)
    found = symrefine.detect(shape)
    assert found.point_group == DESIGNS[name].group
    assert found.exact is not None
    assert found.exact.miss < 1e-13
    size = found.diagonal
    made = symrefine.symmetrize(shape, found)
    assert made.largest < 1e-13
    group, center = decided(found, shape)
    for other, there in ((made.group, made.center), (group, center)):
        np.testing.assert_allclose(other.operations(), found.group.operations(), atol=1e-12)
        np.testing.assert_allclose(there, found.center, atol=1e-12 * size)
    assert found.group.distance_rad(truth.operations()).max() < 1e-11
    for plane in found.planes:
        moved = plane.plane.reflect(shape.points)
        assert np.linalg.norm(moved[:, None] - shape.points, axis=2).min(axis=1).max() < 1e-12 * size
    for turn in found.axes:
        matrix = rotation(turn.axis.direction, 2.0 * np.pi / turn.order)
        if not turn.improper:
            moved = (shape.points - turn.axis.point) @ matrix.T + turn.axis.point
            assert np.linalg.norm(moved[:, None] - shape.points, axis=2).min(axis=1).max() < 1e-12 * size


def cells_of_a_cube(count):
    """A cube each of whose sides is cut into so many squares either way, and these into two triangles."""
    grid = np.arange(count + 1)
    across, along = (k.ravel() for k in np.meshgrid(grid, grid, indexing="ij"))
    corner = np.flatnonzero((across < count) & (along < count))
    side = np.concatenate([corner[:, None] + [0, 1, count + 2], corner[:, None] + [0, count + 2, count + 1]])
    sides = [(axis, end) for axis in range(3) for end in (0, count)]
    points = [np.insert(np.column_stack([across, along]), axis, end, axis=1) for axis, end in sides]
    faces = [side + k * len(across) for k in range(len(sides))]
    return np.concatenate(points) / count, np.concatenate(faces)


@pytest.mark.parametrize("missing", [[0], [0, 36], [0, 1, 36]])
def test_a_hole_leaves_the_group_of_all_vertices_exact(missing):
    """Corners of a square one prove a mirror: less than what the surface seems to have, and all vertices do."""
    points, faces = cells_of_a_cube(6)
    shape = Shape(points, np.delete(faces, missing, axis=0))
    found = symrefine.detect(shape)
    assert (found.point_group, found.exact.faces) == ("Oh", False)
    assert found.exact.miss < 1e-13


def test_what_of_a_group_is_exact_is_told_where_the_rest_holds_within_the_tolerance():
    turn = random_orthogonal(np.random.default_rng(1))
    cuboid = join([box((0, 0, 0), (1.0, 1.0, 1.003))])
    shape = Shape(cuboid.points @ turn.T + 3.0, cuboid.faces)
    found = symrefine.detect(shape)
    assert (found.point_group, found.exact.point_group, found.exact.faces) == ("Oh", "D4h", True)
    assert found.exact.miss < 1e-14
    made = symrefine.symmetrize(shape, found=found)  # all of the group, not what is exact anyway
    assert symrefine.detect(made.shape).exact.point_group == "Oh"


def test_the_centre_is_that_of_the_surface_where_vertices_crowd_at_one_end():
    """A group with one axis leaves free where on it the centre is: next to the centroid."""
    mesh, (group, _) = mesh_of("fan8"), placed_group(DESIGNS["fan8"].parts())
    heights = mesh.points[mesh.faces].mean(axis=1) @ group.frame[2]
    far = heights > np.median(heights)
    corners = mesh.points[mesh.faces[far]]
    finer = [np.stack([corners.mean(axis=1), corners[:, k], corners[:, k - 2]], axis=1) for k in range(3)]
    whole = np.concatenate([mesh.points[mesh.faces[~far]], *finer]).reshape(-1, 3)
    dense = symrefine.detect(Shape(whole, np.arange(len(whole)).reshape(-1, 3)))
    plain = symrefine.detect(mesh)
    assert group.is_polar
    assert dense.point_group == plain.point_group
    assert dense.exact is not None
    np.testing.assert_allclose(dense.center, plain.center, atol=1e-9 * mesh.diagonal)


def icosphere(rounds):
    """An icosahedron [F, 3, 3] whose triangles are cut into four, over and over, their corners moved onto a sphere."""
    phi = 0.5 * (1.0 + np.sqrt(5.0))
    corners = np.array([[0.0, a, b * phi] for a in (-1, 1) for b in (-1, 1)])
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    hull = ConvexHull(corners)
    faces = corners[hull.simplices]
    for _ in range(rounds):
        middles = 0.5 * (faces + np.roll(faces, -1, axis=1))
        inner = [np.stack([faces[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
        faces = np.concatenate([middles, *inner])
    points = (faces / np.linalg.norm(faces, axis=2, keepdims=True)).reshape(-1, 3)
    return Shape(points @ rotation([1.0, 2.0, 0.5], 0.7).T, np.arange(len(points)).reshape(-1, 3))


@pytest.mark.parametrize(("rounds", "name"), [(0, "Ih"), (1, "Ih"), (3, "Kh")])
def test_an_exact_icosahedral_mesh_may_stand_for_a_ball(rounds, name):
    found = symrefine.detect(icosphere(rounds))
    assert (found.point_group, found.exact is not None) == (name, name == "Ih")
    assert found.staircase[0].point_group == name


@pytest.mark.parametrize(("tip", "name"), [(0.01, "C48v"), (0.0, "D48h")])
def test_vertices_of_a_polar_group_do_not_place_the_centre_of_what_is_round(tip, name):
    """One cap of a cylinder has a tip in its middle, the other none: they have C48v, the surface nearly Dinfh."""
    angles = 2.0 * np.pi * np.arange(48) / 48
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(48)], axis=1)
    points = np.concatenate([ring, ring + [0.0, 0.0, 3.0], [[0.0, 0.0, 3.0 + tip]]])
    here, there = np.arange(48), np.roll(np.arange(48), -1)
    sides = np.concatenate([np.stack([here, there, here + 48], 1), np.stack([there, there + 48, here + 48], 1)])
    fan = np.stack([np.zeros(46, dtype=int), here[1:-1], here[2:]], 1)
    cap = np.stack([here + 48, there + 48, np.full(48, 96)], 1)
    shape = Shape(points, np.concatenate([sides, fan, cap]))
    found = symrefine.detect(shape)
    assert exact_symmetry(shape, shape.diagonal)[0].group.name == name
    assert (found.point_group, found.exact is None) == ("Dinfh", name == "C48v")
    assert found.center[2] == pytest.approx(1.5, abs=0.01)


def test_the_record_and_the_table_say_how_exact():
    found = symrefine.detect(table())
    record = found.to_dict()
    assert record["exact"]["miss"] < 1e-14
    assert record["exact"] | {"miss": 0.0} == {"miss": 0.0, "faces": True, "point_group": "C4v"}
    told = "\n".join(line for line in record_lines(record) if isinstance(line, str))
    assert "of the diagonal: C4v maps vertices onto vertices, faces onto faces" in told


@pytest.mark.parametrize("tolerance", [3e-5, 1e-3])
@pytest.mark.parametrize("name", ["skew_box", "gear12", "rotor3", "snub_balls"])
def test_what_is_exact_holds_at_any_tolerance(name, tolerance):
    """Far below what samples of a mesh tell, too."""
    shape, _, _, truth = posed(name, 5, 30.0, 2.0)
    found = symrefine.detect(shape, tolerance=tolerance)
    assert found.undetermined == ""
    assert (found.point_group, found.confidence > 0.95, found.tolerance) == (truth.name, True, tolerance)
    assert found.group.distance_rad(truth.operations()).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("name", ["skew_box", "gear12", "rotor3"])
def test_what_is_broken_by_more_than_a_small_tolerance_is_not_told_there(name):
    shape, _, _, _ = posed(name, 6)
    bent = shape.points.copy()
    bent[np.linalg.norm(bent - bent[5], axis=1) < 1e-9] += 3e-4 * shape.diagonal
    found = symrefine.detect(Shape(bent, shape.faces), tolerance=1e-4)
    assert found.point_group == "undetermined"
    assert "tell nothing below" in found.undetermined
    assert symrefine.detect(Shape(bent, shape.faces)).point_group == DESIGNS[name].group


@pytest.mark.parametrize("name", ["cube", "caltrop"])
def test_what_may_hold_for_all_that_samples_tell_is_no_answer(name):
    """A cube that is longer one way, by less than samples tell and more than rounding."""
    shape, _, center, truth = posed(name, 7)
    up = truth.frame[2]
    longer = shape.points + 8e-5 * ((shape.points - center) @ up)[:, None] * up
    found = symrefine.detect(Shape(longer, shape.faces), tolerance=2e-5)
    proven = {"cube": "D4h", "caltrop": "D2d"}[name]
    assert found.point_group == "undetermined"
    assert f"its vertices prove {proven}, and {truth.name} may hold as well" in found.undetermined


@pytest.mark.slow
def test_what_is_turned_has_the_fold_of_its_sides_where_that_matters():
    """Forty sides are out of round by 0.3 % of the radius; 180 by less than samples tell at any tolerance."""
    angles = 2.0 * np.pi * np.arange(40) / 40
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate([np.column_stack([ring, np.full(40, z)]) for z in (-0.8, 0.8)])
    shape = Shape(points, ConvexHull(points).simplices)
    names = [symrefine.detect(shape, tolerance=t).point_group for t in (1e-4, 1e-3, 2e-2)]
    assert names == ["D40h", "D40h", "Dinfh"]
    found = symrefine.detect(bottle(), tolerance=1e-4)
    assert "prove C180v, and Cinfv may hold as well" in found.undetermined


def tube(fold, rows):
    """Atoms [N, 3] of a tube: rings of them, every other one turned by half a step."""
    steps = np.arange(fold) + 0.5 * (np.arange(rows)[:, None] % 2)
    angles = 2.0 * np.pi * steps.ravel() / fold
    heights = np.repeat(0.2 * np.arange(rows), fold)
    points = np.stack([np.cos(angles), np.sin(angles), heights], axis=1)
    return 7.0 * points @ rotation([1.0, -2.0, 0.6], 1.1).T + 3.0


@pytest.mark.slow
@pytest.mark.parametrize("digits", [15, 5])
def test_points_that_map_onto_one_another_have_their_group_at_any_tolerance(digits):
    """More atoms than stand for themselves, so far apart that no surface is known of them."""
    points = np.round(tube(17, 20), digits)
    found = symrefine.detect(points, tolerance=1e-4)
    assert (found.point_group, found.undetermined, found.exact.faces) == ("D17d", "", None)
    assert found.exact.miss < 10.0**-digits
    assert "D17d maps points onto points" in "\n".join(map(str, record_lines(found.to_dict())))
    elements = np.arange(len(points)) < 17  # those of the first ring
    marked = symrefine.detect(points, labels=elements.astype(int), tolerance=1e-4)
    assert marked.point_group == "C17v"
    moved = points.copy()
    moved[3] += 0.01
    assert symrefine.detect(moved, tolerance=1e-4).point_group == "undetermined"


def test_points_of_a_surface_are_exact_where_they_map_onto_one_another():
    """Half of a noisy mug with its image: no sample says so to better than its noise, and each point does."""
    assert symrefine.detect(tube(40, 40), tolerance=0.01).exact.point_group == "D40d"
    points = sample(mug(), 6000, 0.002, np.random.default_rng(3))
    half = points[points[:, 1] > 0.0]
    turn, shift = rotation([1.0, 2.0, -0.4], 0.7), np.array([3.0, -1.0, 8.0])
    exact = 2.0 * np.concatenate([half, half * [1.0, -1.0, 1.0]]) @ turn.T + shift
    found = symrefine.detect(exact)
    assert (found.point_group, found.exact.point_group, found.exact.faces) == ("Cs", "Cs", None)
    plane = found.planes[0].plane
    np.testing.assert_allclose(np.abs(plane.normal @ turn), [0.0, 1.0, 0.0], atol=1e-12)
    assert plane.offset == pytest.approx(plane.normal @ shift, abs=1e-11)
    made = symrefine.symmetrize(points)
    assert symrefine.detect(made.shape).exact.miss < 1e-12


def test_points_that_stand_alone_in_their_distance_stay_where_they_are():
    """What is seen at once to map nothing has no operation; what maps something, or may, is not seen so."""
    rng = np.random.default_rng(4)
    half = rng.normal(size=(2000, 3))
    known = {
        "strewn": (half, True),
        "mirrored": (np.concatenate([half, half * [1.0, 1.0, -1.0]]), False),
        "flat": (half * [1.0, 1.0, 0.0], False),
        "told twice": (np.concatenate([half, half[:1]]), False),
    }
    for name, (points, told) in known.items():
        about = points - points.mean(axis=0)
        assert stays(about, ROUNDED) is told, name


@pytest.mark.parametrize(
    ("keep", "group"),
    [
        (lambda g: np.abs(g).max(axis=1) < 14, "Oh"),
        pytest.param(lambda g: ((g**2).sum(axis=1) < 150) & (g[:, 2] > 0), "C4v", marks=pytest.mark.slow),
    ],
    ids=["cube", "half ball"],
)
def test_voxels_have_the_group_of_their_grid(keep, group):
    """Neighbourhoods of a grid look the same in few directions, so that a full cube of 21,952 was C1, at .93."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(28.0) - 13.5], indexing="ij"), axis=-1).reshape(-1, 3)
    voxels = grid[keep(grid)] @ rotation([0.3, 1.0, 0.2], 0.5).T
    found = symrefine.detect(voxels)
    assert (found.point_group, found.exact.point_group) == (group, group)


def test_a_cloud_without_symmetry_is_not_exactly_without():
    """With a point that is told twice nothing shows at once that none is mapped."""
    points = np.random.default_rng(0).random((300, 3))
    points = np.concatenate([points, points[:1]])
    assert exact_symmetry(Shape(points), 1.7)[0].group.name == "C1"
    found = symrefine.detect(points, isolated=True)
    assert (found.point_group, found.exact) == ("C1", None)


def test_of_voxels_that_some_are_missing_of_nothing_is_sure_that_is_not_there():
    """Of 21,909 voxels 20,000 were looked at: what had no counterpart among them was two percent off, and C1 sure."""
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*3 * [np.arange(28.0) - 13.5], indexing="ij"), axis=-1).reshape(-1, 3)
    found = symrefine.detect(grid[rng.random(len(grid)) > 0.002] @ rotation([0.3, 1.0, 0.2], 0.5).T)
    assert found.exact is None
    told = {a.point_group: a.probability for a in found.alternatives} | {found.point_group: found.confidence}
    assert told["Oh"] > 0.4


def test_noisy_meshes_and_clouds_are_not_exact():
    mesh, rng = table(), np.random.default_rng(0)
    noisy = Shape(mesh.points + 1e-3 * mesh.diagonal * rng.standard_normal(mesh.points.shape), mesh.faces)
    assert symrefine.detect(noisy).exact is None
    assert symrefine.detect(sample(mesh, 3000, 0.0, rng)).exact is None


@pytest.mark.parametrize(("family", "name"), [("rotors", "impeller30"), ("rotors", "helical48")])
def test_an_exact_mesh_has_its_group_though_samples_doubt_it(family, name):
    """At a tolerance that is hardly above what samples of so many blades miss one another by."""
    case = boundary.Case(family=family, name=name, view=1, seed=22)
    made = instance(family, name, case.seed)
    mesh, _ = boundary.look(case, made)
    found = symrefine.detect(mesh, tolerance=0.004)
    assert found.point_group == made.truth.group.name
    assert found.exact is not None
