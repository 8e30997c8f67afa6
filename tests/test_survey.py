"""What is known of a shape before any symmetry: counted on shapes of which it is known."""

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from symrefine.cli import invoke
from symrefine.geometry import Array, random_orthogonal
from symrefine.shape import Index, Shape
from symrefine.survey import doubts, survey

CORNERS = np.array([[x, y, z] for x in (0, 3) for y in (0, 2) for z in (0, 1)], dtype=float)
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def mesh(points: Array, faces: Index) -> Shape:
    return Shape(points=points, faces=faces, measure="surface", source="part.ply")


def sphere(count: int, seed: int = 0) -> Array:
    points = np.random.default_rng(seed).standard_normal((count, 3))
    return np.asarray(points / np.linalg.norm(points, axis=1)[:, None])


def test_a_box_is_closed_and_one() -> None:
    found = survey(mesh(CORNERS, SIDES))
    assert found.mesh is not None
    assert (found.kind, found.points, found.mesh.faces, found.mesh.parts) == ("mesh", 8, 12, 1)
    assert (found.mesh.closed, found.mesh.solid) == (True, True)
    assert found.mesh.area == pytest.approx(2 * (3 * 2 + 3 * 1 + 2 * 1))
    assert (found.low.tolist(), found.high.tolist()) == ([0, 0, 0], [3, 2, 1])
    assert found.diagonal == pytest.approx(np.sqrt(14), rel=0.03)
    assert not list(doubts(found))


@pytest.mark.parametrize("repeats", [False, True])
def test_what_is_wrong_with_a_mesh_is_counted(repeats: bool) -> None:
    def seen(faces: Index, points: Array = CORNERS) -> list[int]:
        # A vertex for each corner of each face makes no difference.
        shape = mesh(points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)) if repeats else None
        found = survey(shape or mesh(points, faces)).mesh
        assert found is not None
        return [found.open_edges, found.crowded_edges, found.turned_edges, found.parts, int(found.solid)]

    assert seen(SIDES) == [0, 0, 0, 1, 1]
    assert seen(SIDES[1:]) == [3, 0, 0, 1, 0]
    turned = SIDES.copy()
    turned[0] = turned[0, ::-1]
    assert seen(turned) == [0, 0, 3, 1, 0]
    fin = np.vstack([SIDES, [[0, 1, 7]]])
    assert seen(fin) == [1, 2, 0, 1, 0], "one of its sides is a diagonal inside the box"
    two = np.vstack([SIDES, SIDES + 8])
    assert seen(two, np.vstack([CORNERS, CORNERS + 10])) == [0, 0, 0, 2, 1]


def test_what_was_found_does_not_depend_on_the_pose() -> None:
    rng = np.random.default_rng(5)
    points = np.vstack([sphere(3000) * [1, 2, 3], [[40, 0, 0]]])
    moved = points @ random_orthogonal(rng, det=-1).T * 7 + [1, 2, 3]
    a, b = (survey(Shape(points=p)) for p in (points, moved))
    assert a.cloud == b.cloud
    assert a.diagonal is not None
    assert b.diagonal == pytest.approx(7 * a.diagonal, rel=0.03)
    np.testing.assert_allclose(b.spread, 7 * a.spread, rtol=1e-9)


@pytest.mark.slow
def test_how_a_cloud_was_sampled() -> None:
    one = sphere(6000)
    found = survey(Shape(points=one)).cloud
    assert found is not None
    assert (found.strays, found.clumps, found.parts, found.even, found.volume) == (0, (), 1, True, False)
    two = survey(Shape(points=np.vstack([one, sphere(6000, 1) + [5, 0, 0]]))).cloud
    assert two is not None
    assert (two.parts, two.clumps) == (2, ())
    stray = survey(Shape(points=np.vstack([one, [[9, 0, 0]]]))).cloud
    assert stray is not None
    assert (stray.strays, stray.parts) == (1, 1)
    ball = one * np.random.default_rng(2).random((6000, 1)) ** (1 / 3)
    full = survey(Shape(points=ball)).cloud
    assert full is not None
    assert full.volume
    many = sphere(30_000)
    chance = np.random.default_rng(3).random(len(many)) < 10.0 ** (many[:, 2] - 1)
    uneven = survey(Shape(points=many[chance])).cloud
    assert uneven is not None
    assert not uneven.even


@pytest.mark.parametrize(
    ("shape", "part"),
    [
        (Shape(points=np.vstack([sphere(3000), [[9, 0, 0]]])), "1 points lie far from all others"),
        (Shape(points=sphere(1000)), "are few"),
        (Shape(points=CORNERS), "stand for themselves"),
        (Shape(points=np.vstack([CORNERS, CORNERS[:3]])), "3 points stand where others do"),
        (Shape(points=CORNERS * [1, 1, 0] + [[0, 0, 4]]), "all points lie in a plane"),
        (Shape(points=np.outer(np.arange(9.0), [1, 2, 3])), "all points lie on a line"),
        (Shape(points=CORNERS + 1e6), "numbers of 32 bits are"),
        (mesh(CORNERS, SIDES[1:]), "3 edges have one face"),
        (mesh(CORNERS, SIDES[1:]), "--measure solid is refused"),
    ],
)
def test_what_may_go_wrong_is_told(shape: Shape, part: str) -> None:
    assert [part in doubt for doubt in doubts(survey(shape))].count(True) == 1


def test_beyond_space_points_are_points() -> None:
    found = survey(Shape(points=np.eye(4)))
    assert (found.kind, found.diagonal, found.mesh, found.cloud) == ("points", None, None, None)
    assert survey(Shape(points=sphere(900)[:, :2])).kind == "points"


def test_labels_weights_normals_and_cameras_are_told() -> None:
    points = sphere(900)
    shape = Shape(points=points, normals=points, labels=np.arange(900) % 3, weights=1.0 + (np.arange(900) > 4))
    found = survey(replace(shape, viewpoint=np.array([0.0, 0.0, 9.0])))
    assert (found.normals, found.weighted, found.classes) == (True, True, (300, 300, 300))
    assert found.viewpoints.tolist() == [[0, 0, 9]]


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Stdout of a command line beside an .off and two .xyz."""
    monkeypatch.chdir(tmp_path)
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in SIDES)
    Path("box.off").write_text(f"OFF\n8 12 0\n{''.join(f'{x} {y} {z}' + chr(10) for x, y, z in CORNERS / 10)}{faces}")
    Path("water.xyz").write_text("3\n\nO 0 0 0.117\nH 0 0.757 -0.469\nH 0 -0.757 -0.469\n")
    np.savetxt("ball.xyz", 1e6 * sphere(900))

    def call(*argv: str) -> str:
        assert invoke(argv) == 0
        out, err = capsys.readouterr()
        assert err == ""
        return out

    return call


def test_info_says_it_in_words_and_as_json(run: Callable[..., str]) -> None:
    out = run("info", "box.off")
    for part in (
        "a mesh in 3 dimensions, 8 points and 12 triangles",
        "box      0.3 x 0.2 x 0.1",
        "closed",
        "unit     m",
    ):
        assert part in out
    record = json.loads(run("info", "box.off", "--json", "-"))
    assert (record["schema"], record["source"], record["kind"]) == ("symrefine.info/1", "box.off", "mesh")
    assert record["mesh"]["closed"] is True
    assert record["mesh"]["area"] == pytest.approx(0.22)
    assert "wrote a.json" in run("info", "box.off", "--json", "a.json")
    assert json.loads(Path("a.json").read_text()) == record


def test_what_info_writes_obeys_its_schema(run: Callable[..., str]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    text = files("symrefine").joinpath("schema", "info.schema.json").read_text(encoding="utf-8")
    rule = jsonschema.Draft202012Validator(json.loads(text))
    np.savetxt("four.csv", np.random.default_rng(0).random((40, 4)), delimiter=",")
    np.savetxt("flat.csv", np.random.default_rng(0).random((40, 2)), delimiter=",")
    for name in ("box.off", "water.xyz", "ball.xyz", "four.csv", "flat.csv"):
        record = json.loads(run("info", name, "--json", "-"))
        rule.validate(record)
        assert not any(rule.is_valid({key: record[key] for key in record if key != left_out}) for left_out in record)


def test_a_unit_is_said_or_guessed_with_why(run: Callable[..., str]) -> None:
    told = {
        name: json.loads(run("info", name, "--json", "-"))["units"] for name in ("box.off", "water.xyz", "ball.xyz")
    }
    assert {name: units["unit"] for name, units in told.items()} == {"box.off": "m", "water.xyz": "A", "ball.xyz": None}
    assert "a guess" in told["box.off"]["why"]
    assert "format says so" in told["water.xyz"]["why"]


def test_a_picture_is_one(run: Callable[..., str]) -> None:
    grey = np.full((30, 40), 255, dtype=np.uint8)
    grey[10:20, 5:30] = 0
    Image.fromarray(grey).save("bar.png")
    record = json.loads(run("info", "bar.png", "--json", "-"))
    assert (record["kind"], record["dimension"], record["points"]) == ("picture", 2, 250)
    assert "a picture in 2 dimensions, 250 points" in run("info", "bar.png")


def test_a_molecule_has_classes(run: Callable[..., str]) -> None:
    assert "classes  2, of 2, 1" in run("info", "water.xyz")
