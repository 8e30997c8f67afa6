"""Pictures: the painter is exact where it can be checked, everything is in view, words say what the group is."""

import math
import os
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from experiments.objects.damage import cut
from experiments.objects.molecule_sets import molecule
from experiments.objects.shapes import asymmetric, bottle, box, join, mug, sample, table
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.files import whole
from symrefine.geometry import Array, Plane, rotation
from symrefine.groups import point_group
from symrefine.ndim import detect_nd
from symrefine.picture import words
from symrefine.picture.atoms import balls
from symrefine.picture.camera import Camera, look_at
from symrefine.picture.canvas import Canvas
from symrefine.picture.draw import Found, picture_png
from symrefine.picture.measures import rms_series, theta_series_deg, turn_series_deg
from symrefine.picture.painter import paint
from symrefine.picture.raster import Raster
from symrefine.picture.scene import Scene, make_scene, make_stage
from symrefine.picture.space import place_labels
from symrefine.picture.surface import Surface, make_surface
from symrefine.plane import detect_planar
from symrefine.shape import Shape

Case = tuple[Detection, Shape]


@pytest.fixture(scope="module")
def cloud() -> Case:
    shape = Shape(points=sample(table(), 4000, 0.005, np.random.default_rng(3)) @ rotation([1, 2, 0], 0.3).T + 1e6)
    return detect(shape), shape


@pytest.fixture(scope="module")
def mesh() -> Case:
    return detect(table()), table()


@pytest.fixture(scope="module")
def shapeless() -> Case:
    return detect(asymmetric()), asymmetric()


@pytest.fixture(scope="module")
def revolved() -> Case:
    return detect(bottle()), bottle()


@pytest.fixture(params=["cloud", "mesh", "shapeless", "revolved"])
def any_case(request: pytest.FixtureRequest) -> Case:
    case: Case = request.getfixturevalue(request.param)
    return case


def pixels(png: bytes) -> Array:
    from matplotlib.image import imread

    return np.asarray(imread(BytesIO(png)), dtype=float)[:, :, :3]


# Words


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("C1", "no symmetry"),
        ("C4v", "four mirror planes through a four-fold axis"),
        ("C8", "an eight-fold axis, no mirror plane"),
        ("C18v", "18 mirror planes through an 18-fold axis"),
        ("S8", "an eight-fold rotoreflection axis, no mirror plane"),
        ("D3d", "three mirror planes through a three-fold axis, three two-fold axes between them"),
        ("Cinfv", "surface of revolution"),
    ],
)
def test_meaning(name: str, text: str) -> None:
    assert words.meaning(point_group(name)) == text


def test_every_group_has_a_meaning() -> None:
    axial = [
        f"{a}{n}{b}"
        for a, b in (("C", ""), ("C", "v"), ("C", "h"), ("D", ""), ("D", "h"), ("D", "d"))
        for n in range(2, 21)
    ]
    others = ["C1", "Cs", "Ci", "S4", "S6", "T", "Td", "Th", "O", "Oh", "I", "Ih", "K", "Kh"]
    continuous = ["Cinf", "Cinfv", "Cinfh", "Dinf", "Dinfh"]
    meanings = {name: words.meaning(point_group(name)) for name in axial + others + continuous}
    assert all(text and "{" not in text for text in meanings.values())


def test_numbers_are_short_and_honest() -> None:
    assert words.percent(0.00751) == "0.75 %"
    assert words.percent(1e-16) == "less than 0.01 %"
    assert [words.percent(x) for x in (0.0, 0.994, 0.996, 1.0)] == ["0 %", "99 %", "99.6 %", "100 %"]
    assert words.coordinates([1e6 + 0.25, -1e-9, 3.0], 1.0) == "(1000000.2500, 0.0000, 3.0000)"
    assert words.direction(np.array([1e-9, -0.6, 0.8])) == words.direction(np.array([-1e-9, 0.6, -0.8]))


def test_headline_says_undetermined(shapeless: Case) -> None:
    unclear = replace(shapeless[0], undetermined="too few points")
    assert words.headline(unclear) == "Undetermined: too few points"
    assert words.fit(unclear) == ""


# Raster


def square(raster: Raster, left: float, right: float, depth: float) -> None:
    corners = np.array([[left, left], [right, left], [right, right], [left, right]])
    raster.triangles(corners, np.full(4, depth), np.array([[0, 1, 2], [0, 2, 3]]))


def test_triangles_cover_each_pixel_once_and_leave_no_gap() -> None:
    raster = Raster(20, 20, 0.5, 5.0)
    square(raster, 2.2, 17.6, 2.0)
    seen = np.isfinite(raster.depth())
    inside = (np.arange(20) + 0.5 > 2.2) & (np.arange(20) + 0.5 < 17.6)
    assert np.array_equal(seen, np.outer(inside, inside))
    assert np.allclose(raster.depth()[seen], 2.0, atol=1e-6)


def test_the_nearest_wins_in_any_order() -> None:
    for order in ((1.0, 3.0), (3.0, 1.0)):
        raster = Raster(10, 10, 0.5, 5.0)
        for depth in order:
            square(raster, 0.0, 10.0, depth)
        assert np.allclose(raster.depth(), 1.0, atol=1e-6)


def test_depth_of_a_slanted_triangle_is_that_of_the_plane_in_space() -> None:
    camera = Camera(eye=np.array([0, 0, 4.0]), target=np.zeros(3), up=np.array([0, 1.0, 0]), fov_rad=0.6)
    corners = np.array([[-1, -1, 0], [1, -1, 1.0], [0, 1, -1.0]])
    xy, depth = camera.project(corners, 60, 60)
    raster = Raster(60, 60, 1.0, 8.0)
    raster.triangles(xy, depth, np.array([[0, 1, 2]]))
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    y, x = np.nonzero(np.isfinite(raster.depth()))
    focal = camera.focal(60)
    rays = np.stack([(x + 0.5 - 30) / focal, (30 - y - 0.5) / focal, -np.ones(len(x))], axis=1)
    exact = (corners[0] - camera.eye) @ normal / (rays @ normal)
    assert np.allclose(raster.depth()[y, x], exact, rtol=1e-6)


def test_triangles_behind_the_eye_and_without_area_are_left_out() -> None:
    raster = Raster(10, 10, 0.5, 5.0)
    xy = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [4.0, 4.0]])
    raster.triangles(xy, np.array([-1.0, 1.0, 1.0, 1.0]), np.array([[0, 1, 2], [3, 3, 3]]))
    assert not np.isfinite(raster.depth()).any()


def test_discs_are_round_and_stay_within_the_picture() -> None:
    raster = Raster(40, 40, 0.5, 5.0)
    raster.discs(np.array([[20.0, 20.0], [0.0, 39.9]]), np.ones(2), np.array([9.0, 5.0]), np.arange(2))
    first = np.isfinite(raster.depth()) & (raster.numbers() == 0)
    assert first.sum() == pytest.approx(81 * np.pi, rel=0.03)
    assert np.isfinite(raster.depth())[39, 0]


# Scene and camera


def test_planes_are_cut_to_the_shape_and_hold_the_axis(any_case: Case) -> None:
    detection, shape = any_case
    scene = make_scene(detection, shape)
    assert len(scene.planes) == len(detection.planes)
    for quad, found in zip(scene.planes, detection.planes, strict=True):
        assert np.abs(found.plane.signed_distance(quad.corners + detection.center)).max() < 1e-6 * detection.diagonal
        assert np.linalg.norm(quad.corners, axis=1).max() < 1.2 * detection.diagonal
        assert np.ptp(quad.corners @ quad.corners.T) > 0


def test_scene_turns_with_the_object(mesh: Case) -> None:
    detection, shape = mesh
    turn = rotation([0, 0, 1], 0.4)
    turned = Shape(points=shape.points @ turn.T, faces=shape.faces, measure="surface")
    found = detect(turned)
    heights = [
        np.ptp(make_stage(d, s).points @ make_stage(d, s).frame[2]) for d, s in ((detection, shape), (found, turned))
    ]
    assert heights[0] == pytest.approx(heights[1], rel=1e-3)


@pytest.mark.parametrize("aspect", [0.6, 1.0, 2.5])
def test_everything_is_in_view(any_case: Case, aspect: float) -> None:
    scene = make_scene(*any_case)
    camera = look_at(scene, aspect=aspect, fov_rad=0.5)
    width, height = int(400 * aspect), 400
    outline = np.concatenate([scene.stage.points, *(q.corners for q in scene.planes), *(a.ends for a in scene.axes)])
    xy, depth = camera.project(outline, width, height)
    assert depth.min() > 0
    assert xy.min() > 0
    assert np.all(xy.max(axis=0) < [width, height])
    assert max(np.ptp(xy[:, 0]) / width, np.ptp(xy[:, 1]) / height) > 0.75


def test_no_plane_is_seen_on_edge(cloud: Case) -> None:
    scene = make_scene(*cloud)
    camera = look_at(scene, aspect=1.3, fov_rad=0.5)
    assert min(abs(q.normal @ camera.frame[2]) for q in scene.planes) > 0.2


def test_planes_that_crowd_the_picture_leave_their_traces() -> None:
    cube = join([box((0, 0, 0), (1, 1, 1))])
    detection = detect(cube)
    assert detection.point_group == "Oh"
    scene = make_scene(detection, cube)
    assert scene.crowded
    assert {a.name for a in scene.main_axes} == {"C4 S4"}
    assert coloured(pixels(picture_png(detection, cube, width=300, height=300, title=False))) > 200


# Pictures


def coloured(picture: Array) -> int:
    """Pixels that are far from grey."""
    return int((np.ptp(picture, axis=2) > 0.25).sum())


def test_picture_shows_the_shape_and_its_planes(any_case: Case) -> None:
    detection, _ = any_case
    picture = pixels(picture_png(*any_case, width=400, height=300))
    assert picture.shape == (300, 400, 3)
    assert 0.05 < (picture.min(axis=2) < 0.97).mean() < 0.8
    assert np.allclose(picture[-3:, :3], 1.0)
    assert (coloured(picture) > 50) == bool(detection.planes)


def test_planes_that_cross_are_each_in_front_on_one_side() -> None:
    """Two sheets, seen so that each hides the other on one side of their common line."""
    stage_points = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
    scene, surface = crossing(stage_points)
    camera = Camera(eye=np.array([0, -9.0, 0]), target=np.zeros(3), up=np.array([0, 0, 1.0]), fov_rad=0.35)
    row = paint(scene, surface, camera, 120, 120)[60]
    left, right = row[40], row[80]
    first, second = (np.array(q.colour) / 255 for q in scene.planes)
    sides = [np.linalg.norm(p - first) - np.linalg.norm(p - second) for p in (left, right)]
    assert sides[0] * sides[1] < 0


def crossing(points: Array) -> tuple[Scene, Surface]:
    cube = join([box((0, 0, 0), (2e-3, 2e-3, 2e-3))])
    detection = detect(cube)
    stage = replace(make_stage(detection, cube), points=points, diagonal=2.0, frame=np.eye(3))
    planes = [
        stage.quad(Plane(normal=[1, side, 0], offset=0.0), str(side), colour)
        for side, colour in ((1.0, (0, 0, 255)), (-1.0, (255, 0, 0)))
    ]
    scene = Scene(stage=stage, planes=tuple(planes), axes=(), missed_planes=(), missed_axes=())
    return scene, make_surface(cube, scene)


def test_labels_do_not_overlap_and_name_every_plane(cloud: Case) -> None:
    scene = make_scene(*cloud)
    camera = look_at(scene, aspect=4 / 3, fov_rad=0.45, fill=0.88)
    labels = place_labels(scene, camera, np.ones((900, 1200, 3)))
    assert sorted(label.text for label in labels) == ["1", "2", "3", "4", "C4"]
    for k, a in enumerate(labels):
        assert all(math.hypot(a.x - b.x, a.y - b.y) > 20 for b in labels[:k])


@pytest.mark.parametrize("count", [5, 60, 2000])
def test_thin_clouds_and_flat_ones_are_painted(count: int, shapeless: Case) -> None:
    points = np.random.default_rng(count).uniform(-1, 1, (count, 3)) * [1.0, 1.0, 0.0 if count == 2000 else 1.0]
    pretended = replace(shapeless[0], center=points.mean(axis=0), diagonal=2.8, near_misses=())
    assert (pixels(picture_png(pretended, Shape(points=points), width=200, height=200, title=False)) < 0.9).any()


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0, 80.0])
def test_what_stands_is_upright(tilt_deg: float) -> None:
    """A mug stands as its file says, or, where that cannot be meant, on its largest side."""
    turn = rotation([1, 0, 0], math.radians(tilt_deg))
    tilted = Shape(points=mug().points @ turn.T, faces=mug().faces, measure="surface")
    up = make_stage(detect(tilted), tilted).frame[2]
    assert abs(up @ (turn @ [0.0, 0.0, 1.0])) > math.cos(math.radians(6.0))


@pytest.mark.parametrize("name", ["water", "benzene"])
def test_molecules_are_balls_and_sticks(name: str) -> None:
    made = molecule(name)
    solid = balls(Shape(points=7.0 * made.positions, labels=np.array(made.numbers), source="a.xyz"))
    assert solid.bonds == {"water": 2, "benzene": 12}[name]
    assert len(np.unique(solid.colours, axis=0)) == 2
    assert not balls(Shape(points=made.positions)).bonds


def test_outliers_have_a_colour_and_do_not_shrink_the_rest(shapeless: Case) -> None:
    points = np.concatenate([sample(table(), 2000, 0.0, np.random.default_rng(0)), [[40.0, 0, 0]]])
    shape = Shape(points=points)
    scene = make_scene(replace(shapeless[0], outliers=np.array([2000]), near_misses=()), shape)
    assert np.linalg.norm(scene.stage.points, axis=1).max() < 2.0
    assert len(np.unique(make_surface(shape, scene).colours, axis=0)) == 2


@pytest.mark.slow
def test_a_picture_of_a_scan_tells_what_its_colours_mean(shapeless: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.concatenate([sample(table(), 2000, 0.0, np.random.default_rng(0)), [[2.0, 0, 0]]])
    strays = replace(shapeless[0], outliers=np.array([2000]), near_misses=(), at_least=False)
    part = Shape(points=cut(table(), 0.2, np.random.default_rng(6)).points)
    written: list[str] = []
    monkeypatch.setattr(Canvas, "name", lambda _, text, *__: written.append(text))
    picture_png(strays, Shape(points=points), width=200, height=200)
    assert "1 outlier, no part of it" in written
    found = detect(part)
    assert found.is_partial
    picture_png(found, part, width=200, height=200)
    assert "inferred, where nobody looked" in written
    written.clear()
    picture_png(found, part, width=200, height=200, title=False)
    picture_png(detect(table()), table(), width=200, height=200)
    assert not any("looked" in text or "outlier" in text for text in written)


def test_pictures_of_the_plane_and_of_many_dimensions() -> None:
    corners = [[1.0, 0.2], [0.3, 0.9], [-1.0, 0.2], [-0.3, 0.9], [0.0, -1.0]]
    rows = np.random.default_rng(1).normal(size=(12, 5))
    rows = np.concatenate([rows, rows * [-1, 1, 1, 1, 1]])
    cases: list[tuple[Found, Shape]] = [
        (detect_planar(np.array(corners)), Shape.of(corners)),
        (detect_nd(rows), Shape.of(rows)),
    ]
    for found, shape in cases:
        picture = pixels(picture_png(found, shape))
        assert picture.shape == (900, 1200, 3)
        assert coloured(picture) > 200
        assert picture_png(found, shape) == picture_png(found, shape)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipes_are_written_to_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with whole(tmp_path / "pipe") as place:
        assert place == tmp_path / "pipe"
    assert (tmp_path / "pipe").is_fifo()


# Series


def test_turns_are_the_angles_between_frames(cloud: Case) -> None:
    start = cloud[0].history[0]
    frames = [rotation([1, 2, 3], math.radians(a)) @ start.state.frame for a in (0.0, 2.0, 2.0 + 1e-6, 179.0)]
    history = [replace(start, state=replace(start.state, frame=f)) for f in frames]
    assert turn_series_deg(history) == pytest.approx([2.0, 1e-6, 177.0 - 1e-6], rel=1e-4)


def test_series_have_one_value_for_each_iteration(any_case: Case) -> None:
    history = any_case[0].history
    assert len(turn_series_deg(history)) == len(rms_series(history)) == max(0, len(history) - 1)
    assert all(len(column) == len(history) - 1 for column in theta_series_deg(history))
