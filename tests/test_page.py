"""Pages: whole, safe whatever a file is called, small, the same for the same input; their data say what was found."""

import base64
import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial import cKDTree

import symrefine
from experiments.objects.damage import cut
from experiments.objects.molecule_sets import molecule
from experiments.objects.shapes import asymmetric, bottle, box, join, mug, sample, table
from symrefine.cli import invoke
from symrefine.detection.result import Detection, NearMiss
from symrefine.detection.story import LADDER, detect
from symrefine.geometry import Array, rotation
from symrefine.ndim import detect_nd
from symrefine.picture import words
from symrefine.picture.draw import Found
from symrefine.picture.palette import OBJECT, PALETTE
from symrefine.picture.rows import found_rows
from symrefine.picture.scene import make_scene
from symrefine.picture.surface import make_surface
from symrefine.plane import detect_planar
from symrefine.report import model
from symrefine.report.charts import bar_chart, decision_chart, line_chart
from symrefine.report.markup import island, plain, schoenflies
from symrefine.report.mesh import simplified, subdivided
from symrefine.report.page import html_page
from symrefine.shape import Shape
from symrefine.texture import Texture

Case = tuple[Detection, Shape]
Pages = Callable[[Case], str]
VOID = {"meta", "img", "br", "line", "rect", "input", "circle", "use", "image", "path"}
LARGEST = 3_000_000


def examined(shape: Shape) -> Case:
    return detect(shape, ladder=LADDER), shape


@pytest.fixture(scope="module")
def cloud() -> Case:
    turn = rotation([1, 2, 0], 0.3)
    return examined(Shape(points=sample(table(), 4000, 0.005, np.random.default_rng(3)) @ turn.T + 1e6))


@pytest.fixture(scope="module")
def mesh() -> Case:
    return examined(table())


@pytest.fixture(scope="module")
def shapeless() -> Case:
    return examined(asymmetric())


@pytest.fixture(scope="module")
def revolved() -> Case:
    return examined(bottle())


@pytest.fixture(scope="module")
def scan() -> Case:
    found = examined(Shape(points=cut(table(), 0.2, np.random.default_rng(6)).points))
    assert found[0].at_least
    return found


@pytest.fixture(scope="module")
def atoms() -> Case:
    made = molecule("ammonia")
    return examined(Shape(points=made.positions, labels=np.array(made.numbers), source="ammonia.xyz"))


@pytest.fixture(params=["cloud", "mesh", "shapeless", "revolved", "scan", "atoms"])
def any_case(request: pytest.FixtureRequest) -> Case:
    case: Case = request.getfixturevalue(request.param)
    return case


@pytest.fixture(scope="module")
def others() -> list[tuple[Found, Shape]]:
    """What lies in the plane, as points and as pixels, and beyond space."""
    corners = Shape.of([[1.0, 0.2], [0.3, 0.9], [-1.0, 0.2], [-0.3, 0.9], [0.0, -1.0]])
    y, x = np.mgrid[0:60, 0:60]
    ring = np.hypot(x - 30, y - 30) < 20 + 4 * np.cos(3 * np.arctan2(y - 30, x - 30))
    pixels = Shape.of(np.column_stack([x[ring], y[ring]]).astype(float))
    rows = np.random.default_rng(1).normal(size=(12, 5))
    points = Shape.of(np.concatenate([rows, rows * [-1, 1, 1, 1, 1]]))
    return [(detect_planar(corners), corners), (detect_planar(pixels), pixels), (detect_nd(points), points)]


@pytest.fixture(scope="module")
def pages() -> Pages:
    """Pages that are made once."""
    made: dict[int, str] = {}

    def page(case: Case) -> str:
        if id(case) not in made:
            made[id(case)] = html_page(*case)
        return made[id(case)]

    return page


class Checker(HTMLParser):
    """Collects text and scripts, and fails on tags that do not match and on anything fetched from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.scripts: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                assert (value or "").startswith(("data:", "#")), (tag, name, value)
            if name == "id":
                self.ids.append(value or "")
            assert not name.startswith("on"), (tag, name)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        (self.scripts if self.open and self.open[-1] in ("script", "style") else self.text).append(data)


def checked(page: str) -> Checker:
    checker = Checker()
    checker.feed(page)
    checker.close()
    assert not checker.open
    assert len(set(checker.ids)) == len(checker.ids)
    assert "@import" not in page
    return checker


def text_of(page: str) -> str:
    return " ".join(" ".join(checked(page).text).split())


def data_of(page: str) -> dict[str, Any]:
    start = page.index('id="data">') + len('id="data">')
    data: dict[str, Any] = json.loads(page[start : page.index("</script>", start)])
    return data


# Words


@pytest.mark.slow
def test_page_is_whole_and_names_the_group(any_case: Case, pages: Pages) -> None:
    detection, _ = any_case
    text = text_of(pages(any_case))
    assert words.symbol(detection.point_group) in text
    assert words.meaning(detection.group) in text
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
    text = text_of(html_page(detection, shape))
    assert "The inversion" in text
    assert "about the centre" in text
    assert "Under it, 95 % of the points meet their images" in text


MORE = "more than objects mostly do that are meant to have it."


@pytest.mark.parametrize(
    ("excesses", "group", "said"),
    [
        ([1.2, 3.0], "Cs", []),
        ([0.31, 3.0], "Cs", [f"Those below 1 exclude what was found, or miss by {MORE}"]),
        ([0.31, 3.0], "C1", [f"Those below 1 miss by {MORE}"]),
        ([3.0, math.inf], "Cs", ["Of what is `unseen` nothing tells that was seen: all would have to be believed."]),
        ([0.0, 0.31], "Cs", ["One of 0.00 holds as well as what was found: the two exclude one another."]),
    ],
)
def test_near_misses_are_told_together(excesses: list[float], group: str, said: list[str]) -> None:
    first, *others = words.all_turned_down(excesses, group)
    assert first.endswith("they miss by `x limit` times what the tolerance allows.")
    assert others == said


def test_where_several_places_are_as_likely_the_group_is_told_to_be_surer_than_where() -> None:
    assert words.elsewhere("Cs", 0.99, [0.99]) == ""
    assert words.elsewhere("C1", 0.99, []) == ""
    assert words.elsewhere("Cs", 0.99, [0.33]).startswith("That it is Cs is surer than where")


@pytest.mark.slow
def test_a_near_miss_that_holds_is_told_to_be_excluded() -> None:
    assert words.turned_down(math.inf, 0.02, "Cs") == "It was turned down: nothing that was seen tells of it."
    assert words.turned_down(1.25, 0.02, "Cs") == "It was turned down: 1.25 times what a tolerance of 2 % allows."
    assert words.turned_down(0.004, 0.02, "C1").startswith("It was turned down: 0.00 times")
    assert words.turned_down(0.31, 0.02, "Cs").endswith("allows; it excludes what was found, or misses by " + MORE)
    found = detect(table())
    excess = {"residual": found.planes[0].residual, "kind": "plane", "direction": np.eye(3)[0], "point": found.center}
    miss = NearMiss(**excess, order=1.0, excess=0.0)
    page = html_page(replace(found, near_misses=(miss,)), table())
    assert data_of(page)["elements"][-1]["told"].endswith(words.turned_down(0.0, 0.02, "C4v"))
    assert words.turned_down(0.0, 0.02, "C4v").startswith("It holds as well as what was found")


@pytest.mark.slow
def test_a_cube_is_three_lines_that_open() -> None:
    cube = join([box((0, 0, 0), (1, 1, 1))])
    page = html_page(detect(cube), cube)
    assert page.count("<summary>") == 3
    text = text_of(page)
    for title in ("Nine mirror planes", "13 axes: 3 of order 4, 4 of order 3, 6 of order 2", "and the inversion"):
        assert title in text


@pytest.mark.slow
def test_a_kind_is_open_only_if_those_above_it_are(any_case: Case, pages: Pages) -> None:
    opened = ["open" in tag for tag in re.findall("<details[^>]*>", pages(any_case))]
    assert opened == sorted(opened, reverse=True)


@pytest.mark.parametrize("name", ["C4v", "Oh", "K", "Ci", "S6", "D12d", "Cinfv", "O(2)", "SO(2)"])
def test_a_symbol_reads_as_it_is_written(name: str) -> None:
    assert re.sub("<[^>]*>", "", schoenflies(name)) == words.symbol(name)
    assert ("<sub>" in schoenflies(name)) == (len(name) > 1 and "(" not in name)


def test_the_call_in_python_gives_the_result_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savetxt("it's one.csv", [[1.0, 0.3, 0.0], [0.2, 1.0, 0.0], [0.0, 0.4, 1.0], [1.0, 0.3, -0.1]])
    found = symrefine.detect("it's one.csv", tolerance=0.03)
    found.save("page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    call = unescape(page.partition("# or in Python: ")[2].partition("</pre>")[0])
    again = eval(call, {"symrefine": symrefine})
    assert (again.options, again.point_group) == (found.options, found.point_group)


ASKED = {
    "labels": ("detect a.csv --labels kind", "labels='kind')"),
    "weights and a tolerance": ("detect b.csv --weights mass --tolerance 0.03", "detect(shape, tolerance=0.03)"),
    "a frame": ("detect a.xyz --frame 1", "frame=1)"),
    "a camera": ("detect a.npy --viewpoint=5,5,5 --outliers none", "viewpoint=(5.0, 5.0, 5.0))"),
    "a grey value": ("detect a.png --threshold 0.4", "threshold=0.4)"),
    "frames of two files": ("align a.xyz a.xyz --source-frame 1 --target-frame 0", "target = symrefine.load("),
    "labels of two files": ("align a.csv a.csv --labels kind", "source = symrefine.load("),
    "no reflection": ("align a.npy a.npy --rotations-only", "allow_reflection=False"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("line", "part"), ASKED.values(), ids=ASKED)
def test_the_lines_in_python_give_the_result_again(
    line: str, part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With options that the function itself has not: what is read with them is a shape."""
    monkeypatch.chdir(tmp_path)
    corners = np.array([[x, y, z] for x in (-3, 3) for y in (-2, 2) for z in (-1, 1)], dtype=float)
    for name, column in (("a", "kind"), ("b", "mass")):
        rows = [f"{x},{y},{z},{1 + (z > 0)}" for x, y, z in corners]
        Path(f"{name}.csv").write_text("\n".join([f"x,y,z,{column}", *rows]))
    water = ["3", "water", "O 0 0 0.117", "H 0 0.757 -0.469", "H 0 -0.757 -0.469"]
    Path("a.xyz").write_text("\n".join([*water, *water[:4], "H 0 -0.9 -0.469"]))
    np.save("a.npy", on_sides(corners))
    grey = [[[255, 90, 0][(x > 20) + (x > y + 14)] for x in range(40)] for y in range(40)]
    Image.fromarray(np.array(grey, dtype=np.uint8)).save("a.png")
    assert invoke([*line.split(), "--report", "x.html", "--json", "x.json"]) == 0
    told = unescape(Path("x.html").read_text(encoding="utf-8").partition("# or in Python:")[2].partition("</pre>")[0])
    assert part in told
    *before, last = told.strip().split("\n")
    variables: dict[str, Any] = {"symrefine": symrefine}
    for read in before:
        exec(read, variables)
    again, record = eval(last, variables).to_dict(), json.loads(Path("x.json").read_text())
    for name in set(record) - {"options", "timings", "status"}:
        assert again[name] == record[name], name


def on_sides(corners: Array) -> Array:
    """Points on the faces of a box."""
    points = trimesh.convex.convex_hull(corners).sample(2000, seed=0)
    return np.asarray(points)


def test_page_of_what_is_undetermined(shapeless: Case) -> None:
    unclear = replace(shapeless[0], undetermined="12 points are too few", point_group="undetermined", near_misses=())
    text = text_of(html_page(unclear, shapeless[1]))
    assert "Undetermined" in text
    assert "12 points are too few." in text


def test_the_limit_is_named_once(mesh: Case, pages: Pages) -> None:
    text = text_of(pages(mesh))
    assert text.count("1.5 %") == 1
    assert "One iteration" not in text


def test_pages_of_all_kinds_are_whole(others: list[tuple[Found, Shape]]) -> None:
    lines, pixels, beyond = (text_of(html_page(*case)) for case in others)
    assert "one mirror line" in lines
    assert "three mirror lines, turns of order 3" in pixels
    assert "hyperplane of symmetry in 5 dimensions" in beyond


def test_projections_say_of_how_many_hyperplanes_they_are(others: list[tuple[Found, Shape]]) -> None:
    simplex = Shape.of(np.eye(5))
    assert "Projections: the best 6 of 11 hyperplanes" in text_of(html_page(detect_nd(simplex), simplex))
    assert "Projections Each" in text_of(html_page(*others[2]))


# Safety and size


HOSTILE = "</script><script>alert(1)</script><b>a & b's\u202egpj.\x07\x85\u2028.ply"


@pytest.mark.slow
def test_names_cannot_act(atoms: Case, others: list[tuple[Found, Shape]]) -> None:
    for found, shape in (atoms, *others):
        page = html_page(found, replace(shape, source=HOSTILE))
        assert page.count("<script") == page.count("</script>")
        assert page.count("<script") == html_page(found, shape).count("<script")
        assert "alert(1)</script>" not in page
        assert "<b>a" not in page
        assert not any(c in page for c in "\u202e\x07\x85\u2028")
        assert "b's\\u202egpj" in text_of(page)


def test_the_island_holds_any_text() -> None:
    text = "</script><!-- <script> & \u2028 \u202e"
    written = island({"a": text})
    assert not any(c in written for c in "<>&\u2028\u202e")
    assert json.loads(written) == {"a": text}
    assert plain("\ud800 ü ∞") == "\\ud800 ü ∞"


def test_page_is_small_and_asks_for_nothing(any_case: Case, pages: Pages) -> None:
    page = pages(any_case)
    assert len(page.encode()) < LARGEST
    assert "default-src 'none'" in page


@pytest.mark.slow
def test_large_inputs_make_small_pages() -> None:
    coarse = mug()
    assert coarse.faces is not None
    points, faces, _ = subdivided(coarse.points, coarse.faces, 0.05, 10**6)
    assert len(faces) > 60_000
    page = html_page(detect(coarse), Shape(points=points, faces=faces, measure="surface"))
    assert len(page.encode()) < LARGEST
    assert f"of {len(faces):,} triangles; all of them were used" in text_of(page)


def test_same_input_gives_the_same_page(cloud: Case, pages: Pages, others: list[tuple[Found, Shape]]) -> None:
    assert pages(cloud) == html_page(*examined(cloud[1]))
    for found, shape in others:
        assert html_page(found, shape) == html_page(found, shape)


def test_page_holds_its_picture(shapeless: Case) -> None:
    from matplotlib.image import imread

    page = html_page(*shapeless)
    start = page.index("base64,") + len("base64,")
    picture = np.asarray(imread(BytesIO(base64.b64decode(page[start : page.index('"', start)]))))[:, :, :3]
    assert picture.shape == (900, 1200, 3)
    assert (picture < 0.9).any()


# Data


def unpacked(text: str, kind: str) -> Array:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_matrices_are_operations_that_hold(any_case: Case, pages: Pages) -> None:
    """Each is orthogonal, leaves the centre in place, has the order of its axis, and its determinant."""
    detection, _ = any_case
    elements = data_of(pages(any_case))["elements"]
    assert len(elements) == len(found_rows(detection)) + len(detection.near_misses)
    for e in elements:
        if e["matrix"] is None:
            assert e["order"] is None
            continue
        matrix = np.array(e["matrix"])
        turn, shift = matrix[:3, :3], matrix[:3, 3]
        assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-10)
        assert np.linalg.det(turn) == pytest.approx(1.0 if e["kind"] == "axis" else -1.0)
        assert np.allclose(np.linalg.matrix_power(turn, 2 * e["order"]), np.eye(3), atol=1e-9)
        if not e["missed"]:
            moved = turn @ detection.center + shift
            assert np.allclose(moved, detection.center, atol=1e-6 * detection.diagonal)


def test_signs_are_those_of_the_json_report(mesh: Case, pages: Pages) -> None:
    from symrefine.export.records import detection_record

    record = detection_record(*mesh, options={})
    elements = data_of(pages(mesh))["elements"]
    directions = [p["normal"] for p in record["planes"]] + [a["direction"] for a in record["axes"]]
    assert np.allclose([e["axis"] for e in elements[: len(directions)]], directions)


def test_the_model_is_the_object(mesh: Case, cloud: Case, pages: Pages) -> None:
    for case in (mesh, cloud):
        detection, shape = case
        model = data_of(pages(case))["object"]
        places = unpacked(model["positions"], "<u2").reshape(-1, 3) * model["step"] + model["low"]
        own = (shape.points - detection.center) / detection.diagonal
        assert np.allclose(places.min(axis=0), own.min(axis=0), atol=1e-3)
        assert np.allclose(places.max(axis=0), own.max(axis=0), atol=1e-3)


def test_the_model_misses_by_what_its_image_is_away(shapeless: Case, pages: Pages) -> None:
    """Against the distances from the moved vertices to a dense sample of the surface, both up to the deepest colour."""
    detection, shape = shapeless
    data = data_of(pages(shapeless))
    model, elements = data["object"], data["elements"]
    places = unpacked(model["positions"], "<u2").reshape(-1, 3) * model["step"] + model["low"]
    misses = unpacked(model["misses"], "u1").reshape(len(elements), -1) * model["limit"] / model["steps"]
    tree = cKDTree((sample(shape, 200_000, 0.0, np.random.default_rng(0)) - detection.center) / detection.diagonal)
    for own, element in zip(misses, elements, strict=True):
        matrix = np.array(element["matrix"])
        moved = (matrix[:3, :3] @ (places.T * detection.diagonal + detection.center[:, None]) + matrix[:3, 3:]).T
        away, _ = tree.query((moved - detection.center) / detection.diagonal)
        off = np.abs(np.minimum(away, model["limit"]) - own)
        assert off.mean() < 0.002
        assert np.quantile(off, 0.95) < 0.01


@pytest.mark.parametrize("most", [pytest.param(model.MOST_TRIANGLES, marks=pytest.mark.slow), 200])
def test_the_model_shows_the_texture(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A brick, red above its middle and white below it, whether all of its triangles are shown or a few."""
    monkeypatch.setattr(model, "MOST_TRIANGLES", most)
    brick = trimesh.creation.box((1, 1.5, 2)).subdivide().subdivide().subdivide()
    corners = brick.vertices[brick.faces]
    painted = Texture(
        images=(np.repeat(np.array([[[200, 30, 40]], [[250, 250, 250]]], dtype=np.uint8), 64, axis=0),),
        uv=np.stack([0.0 * corners[:, :, 2], 0.5 + 0.49 * corners[:, :, 2]], axis=2),
        image=np.zeros(len(corners), dtype=int),
        plain=np.zeros((len(corners), 3)),
    )
    shape = Shape(points=brick.vertices, faces=brick.faces, texture=painted)
    made = data_of(html_page(detect(shape), shape))["object"]
    assert sorted(made["palette"]) == [[200, 30, 40], [250, 250, 250]]
    heights = unpacked(made["positions"], "<u2").reshape(-1, 3)[:, 2] * made["step"] + made["low"][2]
    middles = heights[unpacked(made["faces"], "<u2").reshape(-1, 3)].mean(axis=1)
    clear = np.abs(middles) > 0.05
    assert clear.sum() > 50
    red = np.array(made["palette"])[unpacked(made["colours"], "u1"), 1] == 30
    assert np.array_equal(red[clear], middles[clear] > 0.0)


@pytest.mark.parametrize("most", [pytest.param(model.MOST_TRIANGLES, marks=pytest.mark.slow), 200])
def test_the_model_shows_the_classes(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A brick of which a class is less than half, whether all of its triangles are shown or a few."""
    monkeypatch.setattr(model, "MOST_TRIANGLES", most)
    brick = trimesh.creation.box((1, 1.5, 2)).subdivide().subdivide().subdivide()
    upper = brick.vertices[brick.faces][:, :, 2].mean(axis=1) > 0.2
    shape = Shape(points=brick.vertices, faces=brick.faces, labels=upper.astype(int))
    found = replace(symrefine.detect(shape), options={"tolerance": 0.02, "labels": "color"})
    assert found.point_group == "C2v"
    page = html_page(found, shape)
    assert "Labels color, 2 classes" in text_of(page)
    made = data_of(page)["object"]
    assert sorted(made["palette"]) == sorted(map(list, (OBJECT, PALETTE[1])))
    heights = unpacked(made["positions"], "<u2").reshape(-1, 3)[:, 2] * made["step"] + made["low"][2]
    middles = heights[unpacked(made["faces"], "<u2").reshape(-1, 3)].mean(axis=1) * found.diagonal
    clear = np.abs(middles + found.center[2] - 0.25) > 0.2
    assert clear.sum() > 50
    tinted = np.array(made["palette"])[unpacked(made["colours"], "u1")] == PALETTE[1]
    assert np.array_equal(tinted.all(axis=1)[clear], middles[clear] + found.center[2] > 0.25)


@pytest.mark.slow
def test_points_of_a_scan_have_the_colours_of_their_classes() -> None:
    points = cut(table(), 0.2, np.random.default_rng(6)).points
    shape = Shape(points=points, labels=(points[:, 2] > np.quantile(points[:, 2], 0.7)).astype(int))
    found = detect(shape)
    for least in (True, False):
        scene = replace(make_scene(replace(found, at_least=least, strewn=False), shape), planes=())
        colours = {tuple(c) for c in np.rint(255.0 * make_surface(shape, scene).colours).astype(int).tolist()}
        assert {PALETTE[1], OBJECT} <= colours


def test_atoms_have_one_miss_each(atoms: Case, pages: Pages) -> None:
    data = data_of(pages(atoms))
    model = data["object"]
    assert unpacked(model["owners"], "<u2").max() + 1 == 4
    assert len(unpacked(model["misses"], "u1")) == 4 * len(data["elements"])


def test_a_scan_tells_what_was_seen(scan: Case, pages: Pages) -> None:
    model = data_of(pages(scan))["object"]
    assert 0 < model["seen"] < model["count"]
    assert (unpacked(model["misses"], "u1") == model["unseen"]).any()
    assert "Green: inferred" in text_of(pages(scan))


# Meshes


def area(points: Array, faces: Array) -> float:
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


@pytest.mark.parametrize("shape", [bottle(), asymmetric(), mug()], ids=["bottle", "asymmetric", "mug"])
def test_subdivided_meshes_are_the_same_surface(shape: Shape) -> None:
    assert shape.faces is not None
    points, faces, owner = subdivided(shape.points, shape.faces, 0.05, 50_000)
    assert len(faces) <= 50_000
    assert area(points, faces) == pytest.approx(area(shape.points, shape.faces))
    for k in np.random.default_rng(0).choice(len(faces), 50):
        a, b, c = shape.points[shape.faces[owner[k]]]
        normal = np.cross(b - a, c - a)
        assert np.abs((points[faces[k]] - a) @ normal).max() <= 1e-9 * max(np.linalg.norm(normal), 1e-12)
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
    assert np.linalg.norm(points[edges[..., 0]] - points[edges[..., 1]], axis=2).max() <= 0.1


def test_subdivision_opens_no_gap() -> None:
    """Of a closed surface every edge has two triangles, before and after."""
    points, faces = box((0, 0, 0), (1.0, 0.3, 0.1))
    _, made, _ = subdivided(points, faces, 0.07, 50_000)
    edges = np.sort(np.concatenate([made[:, [0, 1]], made[:, [1, 2]], made[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1].tolist()) == {2}


def test_few_triangles_are_left_alone() -> None:
    shape = mug()
    assert shape.faces is not None
    points, faces = simplified(shape.points, shape.faces, len(shape.faces))
    assert points is shape.points
    assert faces is shape.faces


# Charts


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
            yield line_chart("a < b", values, first=1, unit="", name="turn", log=log)
    yield line_chart("nothing", [], first=1, unit="", name="turn")
    yield bar_chart(
        "bars", [("s", 0.0, "none", False), ("t", math.inf, "much", True), ("u", 1.0, "&", False)], 2.0, "here"
    )
    steps = [(0.01, "C1"), (0.02, "Cinfv"), (0.04, "undetermined")]
    yield decision_chart("Cinfv", [("Cinfv", 0.8, 0.0), ("Dinfh", 0.2, 0.03)], steps, 0.02)
    yield decision_chart("C1", [("C1", 1.0, 0.0)], [], 0.02)


def test_charts_stay_within_their_frame() -> None:
    for chart in charts():
        checked(chart)
        assert "nan" not in chart
        assert "inf" not in chart
        for part in chart.split('cy="')[1:]:
            assert 0 <= float(part.split('"')[0]) <= 210
        for part in chart.split('style="width:')[1:]:
            assert 0 <= float(part.split("%")[0]) <= 100


def test_the_decision_has_a_row_for_each_group_in_ascending_order() -> None:
    steps = [(0.01, "C1"), (0.02, "C2v"), (0.04, "D4h")]
    chart = decision_chart("C2v", [("C2v", 0.7, 0.0), ("D4h", 0.3, 0.03)], steps, 0.02)
    rows = [
        re.sub("<[^>]*>", "", row.partition(">")[2].partition("</th>")[0]) for row in chart.split('scope="row"')[1:]
    ]
    assert rows == ["C1", "C2v", "D4h"]
    assert chart.count("the answer") == 3
    assert chart.count('class="asked"') == 1
