"""Pictures and pages: the painter is exact where it can be checked, the page is whole, words say what the group is."""

import base64
import math
import os
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from experiments.objects.shapes import asymmetric, bottle, box, join, sample, table
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.files import whole
from symrefine.geometry import Array, Plane, rotation
from symrefine.groups import point_group
from symrefine.picture import words
from symrefine.picture.camera import Camera, look_at
from symrefine.picture.draw import picture_png
from symrefine.picture.measures import rms_series, theta_series_deg, turn_series_deg
from symrefine.picture.painter import paint
from symrefine.picture.raster import Raster
from symrefine.picture.rows import found_rows
from symrefine.picture.scene import Scene, make_scene, make_stage
from symrefine.picture.space import place_labels
from symrefine.picture.surface import Surface, make_surface
from symrefine.report import draw, write_html
from symrefine.report.charts import bar_chart, line_chart
from symrefine.report.page import html_page
from symrefine.shape import Shape

Case = tuple[Detection, Shape]
VOID = {"meta", "img", "br", "line", "rect"}


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


def test_files_are_written_whole_or_not_at_all(shapeless: Case, tmp_path: Path) -> None:
    draw(*shapeless, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="no directory"):
        draw(*shapeless, tmp_path / "none" / "a.png")
    with pytest.raises(InputError, match="is a directory"):
        draw(*shapeless, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipes_are_written_to_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with whole(tmp_path / "pipe") as place:
        assert place == tmp_path / "pipe"
    assert (tmp_path / "pipe").is_fifo()


# Page


class Checker(HTMLParser):
    """Collects text, and fails on tags that do not match and on anything fetched from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                assert (value or "").startswith("data:"), (tag, name, value)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def text_of(page: str) -> str:
    checker = Checker()
    checker.feed(page)
    checker.close()
    assert not checker.open
    for elsewhere in ("http://", "https://", "url(", "@import", "<script"):
        assert elsewhere not in page
    return " ".join(" ".join(checker.text).split())


def test_page_is_whole_and_names_the_group(any_case: Case) -> None:
    detection, shape = any_case
    text = text_of(html_page(detection, shape, b"\x89PNG"))
    assert words.symbol(detection.point_group) in text
    assert words.meaning(detection.group) in text
    assert text.count("mirror plane ") >= len(detection.planes)
    assert ("How the refinement converged" in text) == (len(detection.history) > 1)
    for found in detection.planes:
        assert words.direction(found.plane.normal) in text
        assert f"{100 * found.residual.p95:.2f}" in text


def test_an_inversion_alone_has_its_row() -> None:
    corners = np.array([[1.0, 0.35, 0.2], [0.3, 0.9, 0.6], [-0.5, 0.4, 1.1]])
    shape = Shape(points=np.concatenate([corners, -corners]))
    detection = detect(shape)
    assert detection.point_group == "Ci"
    assert [row.kind for row in found_rows(detection)] == ["inversion"]
    text = text_of(html_page(detection, shape, b""))
    assert "What was found, and how well it holds" in text
    assert "about the centre" in text
    assert "Under it, 95 % of the surface meets itself" in text


def test_page_of_what_is_undetermined(shapeless: Case) -> None:
    unclear = replace(shapeless[0], undetermined="12 points are too few")
    text = text_of(html_page(unclear, shapeless[1], b""))
    assert "Undetermined" in text
    assert "12 points are too few" in text


def test_page_escapes_names(shapeless: Case) -> None:
    detection, shape = shapeless
    named = replace(shape, source="<b>a & b's.ply")
    page = html_page(detection, named, b"")
    assert "<b>a" not in page
    assert "symrefine detect '<b>a & b'\"'\"'s.ply' --tolerance 0.02" in text_of(page)


def test_same_input_gives_the_same_page(cloud: Case) -> None:
    _, shape = cloud
    once, again = (html_page(d, shape, picture_png(d, shape, width=200, height=150)) for d in (cloud[0], detect(shape)))
    assert once == again


def test_page_holds_its_picture(shapeless: Case, tmp_path: Path) -> None:
    write_html(*shapeless, tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    start = page.index("base64,") + len("base64,")
    picture = pixels(base64.b64decode(page[start : page.index('"', start)]))
    assert picture.shape == (900, 1200, 3)
    assert (picture < 0.9).any()


# Charts and series


def charts() -> Iterator[str]:
    for values in (
        [1.0],
        [0.0, 0.0],
        [3e-4, 1e-9, 0.0],
        [12345.0, 12346.0],
        [math.nan, 2.0],
        list(np.geomspace(1, 1e-7, 40)),
    ):
        for log in (False, True):
            yield line_chart("a < b", values, first=1, unit="", colour="#000", log=log)
    yield line_chart("nothing", [], first=1, unit="", colour="#000")
    yield bar_chart(
        "bars", [("s", 0.0, "none", False), ("t", math.inf, "much", True), ("u", 1.0, "&", False)], 2.0, "here"
    )


def test_charts_stay_within_their_frame() -> None:
    for chart in charts():
        text_of(chart)
        assert "nan" not in chart
        assert "inf" not in chart
        for part in chart.split('cy="')[1:]:
            assert 0 <= float(part.split('"')[0]) <= 210


def test_turns_are_the_angles_between_frames(cloud: Case) -> None:
    start = cloud[0].history[0]
    frames = [rotation([1, 2, 3], math.radians(a)) @ start.state.frame for a in (0.0, 2.0, 2.0 + 1e-6, 179.0)]
    history = [replace(start, state=replace(start.state, frame=f)) for f in frames]
    assert turn_series_deg(history) == pytest.approx([2.0, 1e-6, 177.0 - 1e-6], rel=1e-4)


def test_series_have_one_value_for_each_iteration(any_case: Case) -> None:
    history = any_case[0].history
    assert len(turn_series_deg(history)) == len(rms_series(history)) == max(0, len(history) - 1)
    assert all(len(column) == len(history) - 1 for column in theta_series_deg(history))
