"""Shapes with a texture: the group that colours keep, from arrays and from files; what is missing is refused."""

import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from PIL import Image
from rich.table import Table

import symrefine
from experiments.objects.shapes import join, revolve
from symrefine.cli import invoke
from symrefine.cli.tables import detection_lines
from symrefine.decide.subgroups import subgroup_chain
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.detection.textured import with_texture
from symrefine.errors import InputError
from symrefine.export.records import detection_record
from symrefine.geometry import Array, random_orthogonal
from symrefine.groups import is_subgroup, point_group
from symrefine.load import image as pictures
from symrefine.load import load, paint
from symrefine.report.page import html_page
from symrefine.shape import Shape
from symrefine.texture import Texture, corner_weights

Colour = Callable[[Array], Array]
CUBE, BOX = (1.0, 1.0, 1.0), (1.0, 0.7, 0.4)
SLOW = pytest.mark.slow


def plain(places: Array) -> Array:
    """One colour everywhere."""
    return np.broadcast_to(np.array([200.0, 120.0, 40.0]), places.shape).copy()


def dot(center: tuple[float, float, float], radius: float) -> Colour:
    """A blue dot."""

    def colour(places: Array) -> Array:
        found = plain(places)
        found[np.linalg.norm(places - np.array(center), axis=-1) < radius] = (20, 20, 200)
        return found

    return colour


def quarters(places: Array) -> Array:
    """Dark where x and y have different signs."""
    found = plain(places)
    found[(places[..., 0] > 0) ^ (places[..., 1] > 0)] = (20, 40, 60)
    return found


def shade(places: Array) -> Array:
    """A light from one side: colours differ by less than what counts."""
    return plain(places) + 20.0 * places[..., :1]


def sides(size: tuple[float, ...], colour: Colour, pixels: int = 64) -> tuple[list[Array], list[Array]]:
    """Corners [4, 3] of each side of a box, at (0, 0), (1, 0), (1, 1), (0, 1) of its image, and these images."""
    half = np.array(size) / 2
    along = (np.arange(pixels) + 0.5) / pixels
    corners, images = [], []
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        for sign in (-1.0, 1.0):
            u, v = np.meshgrid(along, along[::-1])
            places = np.zeros((pixels, pixels, 3))
            places[..., axis] = sign * half[axis]
            places[..., a], places[..., b] = (2 * u - 1) * half[a], (2 * v - 1) * half[b]
            quad = np.zeros((4, 3))
            quad[:, axis] = sign * half[axis]
            quad[:, a], quad[:, b] = half[a] * np.array([-1, 1, 1, -1]), half[b] * np.array([-1, -1, 1, 1])
            corners.append(quad)
            images.append(colour(places))
    return corners, images


def jpeg(image: Array, quality: int = 25) -> Array:
    """What compression leaves of an image with some grain."""
    grain = np.random.default_rng(5).normal(scale=6.0, size=image.shape)
    packed = BytesIO()
    Image.fromarray(np.clip(image + grain, 0, 255).astype(np.uint8)).save(packed, format="JPEG", quality=quality)
    return np.asarray(Image.open(packed).convert("RGB"), dtype=float)


def box(size: tuple[float, ...], colour: Colour, seed: int = 0, spoil: Callable[[Array], Array] = np.asarray) -> Shape:
    """A painted box in a random pose, in a random unit."""
    corners, images = sides(size, colour)
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    pairs = [[0, 1, 2], [0, 2, 3]]
    texture = Texture(
        images=tuple(np.clip(spoil(image), 0, 255).astype(np.uint8) for image in images),
        uv=np.concatenate([uv[pairs] for _ in corners]),
        image=np.repeat(np.arange(6), 2),
        plain=np.zeros((12, 3)),
    )
    faces = np.concatenate([np.array(pairs) + 4 * k for k in range(6)])
    return turned(Shape(np.concatenate(corners), faces, texture=texture), seed)


def turned(shape: Shape, seed: int) -> Shape:
    rng = np.random.default_rng(seed)
    pose, scale = random_orthogonal(rng, det=1 - 2 * (seed % 2)), float(rng.choice([0.01, 1.0, 1000.0]))
    return replace(shape, points=scale * (shape.points @ pose.T + rng.normal(size=3)))


CASES = {
    "cube, plain": (CUBE, plain, "Oh", "Oh"),
    "cube, a dot on a side": (CUBE, dot((0, 0, 0.5), 0.25), "Oh", "C4v"),
    "cube, a dot at a corner": (CUBE, dot((0.5, 0.5, 0.5), 0.4), "Oh", "C3v"),
    "cube, quarters": (CUBE, quarters, "Oh", "D2h"),
    "cube, a light": (CUBE, shade, "Oh", "Oh"),
    "box, plain": (BOX, plain, "D2h", "D2h"),
    "box, a dot on a side": (BOX, dot((0, 0, 0.2), 0.15), "D2h", "C2v"),
    "box, a dot off the middle": (BOX, dot((0.25, 0.0, 0.2), 0.1), "D2h", "Cs"),
    "box, a dot anywhere": (BOX, dot((0.25, 0.18, 0.2), 0.14), "D2h", "C1"),
    "box, quarters": (BOX, quarters, "D2h", "C2h"),
}
SEVERAL = ("cube, a dot on a side", "box, plain", "box, a dot anywhere", "box, quarters")


def both(shape: Shape) -> tuple[Detection, Detection]:
    """What is found in a shape, and with its texture."""
    found = with_texture(detect(shape), shape)
    assert found.textured is not None
    return found, found.textured


@pytest.mark.parametrize("spoil", [np.asarray, jpeg])
@pytest.mark.parametrize("case", [c if c in SEVERAL else pytest.param(c, marks=SLOW) for c in CASES])
def test_colours_keep_a_part_of_the_group(case: str, spoil: Callable[[Array], Array]) -> None:
    size, colour, shape_group, group = CASES[case]
    found, kept = both(box(size, colour, seed=len(case), spoil=spoil))
    assert (found.point_group, kept.point_group) == (shape_group, group)
    assert kept.confidence > 0.9
    assert is_subgroup(kept.group, found.group, np.radians(2.0))
    assert len(kept.planes) == len(kept.group.mirrors())


def test_what_is_painted_turns_with_the_object() -> None:
    """Operations of the texture, applied to the painted object, give the painted object."""
    shape = box(CUBE, dot((0, 0, 0.5), 0.25), seed=3)
    _, kept = both(shape)
    assert shape.texture is not None
    assert shape.faces is not None
    rng = np.random.default_rng(0)
    face = rng.integers(12, size=4000)
    corners = shape.points[shape.faces]
    places = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), size=4000), corners[face])
    here = shape.texture.colours(face, corner_weights(places, corners[face]))
    for matrix in kept.group.operations():
        moved = (places - kept.center) @ matrix.T + kept.center
        feet = np.stack([np.abs(np.einsum("d,nd->n", n, moved) - o) for n, o in _planes(corners)], axis=1)
        there = feet.argmin(axis=1)
        seen = shape.texture.colours(there, corner_weights(moved, corners[there]))
        again = shape.texture.colours(there ^ 1, corner_weights(moved, corners[there ^ 1]))
        off = np.minimum(np.linalg.norm(seen - here, axis=1), np.linalg.norm(again - here, axis=1))
        assert (off > 64).mean() < 0.01


def _planes(corners: Array) -> list[tuple[Array, float]]:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return [(n, float(n @ c[0])) for n, c in zip(normals, corners, strict=True)]


def can(colour: Colour, seed: int) -> Shape:
    """A can of triangles of one colour each."""
    profile = [(0.0, -0.6), *((0.4, z) for z in np.linspace(-0.6, 0.6, 25)), (0.0, 0.6)]
    made = join([revolve(profile, 48)])
    assert made.faces is not None
    count = len(made.faces)
    colours = colour(made.points[made.faces].mean(axis=1))
    none = np.full(count, -1)
    texture = Texture(images=(), uv=np.zeros((count, 3, 2)), image=none, plain=colours)
    return turned(replace(made, texture=texture), seed)


def band(places: Array) -> Array:
    found = plain(places)
    found[np.abs(places[:, 2] - 0.3) < 0.1] = (20, 20, 40)
    return found


def labels(count: int) -> Colour:
    def colour(places: Array) -> Array:
        found, phase = plain(places), np.arctan2(places[:, 1], places[:, 0])
        on = (np.cos(count * phase) > 0.0) & (np.hypot(places[:, 0], places[:, 1]) > 0.3) & (np.abs(places[:, 2]) < 0.3)
        found[on] = (240, 240, 240)
        return found

    return colour


@SLOW
@pytest.mark.parametrize(
    ("colour", "group"), [(plain, "Dinfh"), (band, "Cinfv"), (labels(1), "C2v"), (labels(2), "D2h"), (labels(3), "D3h")]
)
def test_of_what_is_round_colours_keep_turns_and_mirrors(colour: Colour, group: str) -> None:
    found, kept = both(can(colour, seed=2))
    assert (found.point_group, kept.point_group) == ("Dinfh", group)
    shape = can(colour, seed=2)
    told = html_page(found, shape)
    lines = list(detection_lines(detection_record(found, shape, options={"tolerance": 0.02})))
    rows = [str(column.header) for line in lines if isinstance(line, Table) for column in line.columns]
    if group == "D2h":  # its mirrors through the axis are some of endless ones
        assert "with its texture: normal" in rows
        assert "as C2" in told
        assert "mirror plane (" in told


def test_the_chain_of_subgroups_obeys_the_needs() -> None:
    whole = point_group("D4h")
    needs = np.full(16, 0.05)
    kept = point_group("C2v").distance_rad
    needs[kept(whole.operations()) < 1e-6] = 0.001
    chain = subgroup_chain(whole, needs)
    assert ("C2v", 0.001) in [(g.name, need) for g, need in chain]
    assert chain[-1][0].name == "D4h"
    assert all(a[1] <= b[1] and is_subgroup(a[0], b[0]) for a, b in pairwise(chain))
    assert [g.name for g, _ in subgroup_chain(whole, np.zeros(16))] == ["D4h"]


# --- files


def write_obj(folder: Path, size: tuple[float, ...], colour: Colour) -> Path:
    corners, images = sides(size, colour)
    lines = ["mtllib the look.mtl", *(f"v {x!r} {y!r} {z!r}" for quad in corners for x, y, z in quad.tolist())]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    look = []
    for k, image in enumerate(images):
        Image.fromarray(image.astype(np.uint8)).save(folder / f"side {k}.png")
        look += [f"newmtl m{k}", "Ns 10", "Kd 1 1 1", f"map_Kd side {k}.png"]
        lines += [f"usemtl m{k}", "f " + " ".join(f"{4 * k + c + 1}/{c - 4}" for c in range(4))]
    (folder / "the look.mtl").write_text("\n".join(look) + "\n")
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    return folder / "box.obj"


def write_ply(folder: Path, size: tuple[float, ...], colour: Colour) -> Path:
    """One image for all sides, beside one another; coordinates of vertices."""
    corners, images = sides(size, colour)
    Image.fromarray(np.concatenate(images, axis=1).astype(np.uint8)).save(folder / "atlas.png")
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    head = "ply\nformat ascii 1.0\ncomment TextureFile atlas.png\nelement vertex 24\n"
    head += "".join(f"property double {name}\n" for name in ("x", "y", "z", "s", "t"))
    head += "element face 6\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [
        " ".join(map(repr, [*place.tolist(), float((k + u) / 6), float(v)]))
        for k, quad in enumerate(corners)
        for place, (u, v) in zip(quad, uv, strict=True)
    ]
    rows += [f"4 {4 * k} {4 * k + 1} {4 * k + 2} {4 * k + 3}" for k in range(6)]
    (folder / "box.ply").write_text(head + "\n".join(rows) + "\n")
    return folder / "box.ply"


def write_glb(folder: Path, size: tuple[float, ...], colour: Colour) -> Path:
    trimesh = pytest.importorskip("trimesh")
    corners, images = sides(size, colour)
    scene = trimesh.Scene()
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    for k, (quad, image) in enumerate(zip(corners, images, strict=True)):
        shown = Image.fromarray(image.astype(np.uint8))
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=shown)
        visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        scene.add_geometry(
            trimesh.Trimesh(quad, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False), geom_name=f"{k}"
        )
    (folder / "box.glb").write_bytes(scene.export(file_type="glb"))
    return folder / "box.glb"


WRITERS = {"obj": write_obj, "ply": write_ply, "glb": write_glb}


@pytest.mark.parametrize("kind", WRITERS)
def test_files_show_the_colours_they_were_made_with(kind: str, tmp_path: Path) -> None:
    def ramp(places: Array) -> Array:
        return 127.5 + 100.0 * places

    shape = load(WRITERS[kind](tmp_path, BOX, ramp), texture=True)
    assert shape.texture is not None
    assert shape.faces is not None
    assert load(tmp_path / f"box.{kind}").texture is None
    face = np.repeat(np.arange(12), 50)
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=600)
    places = np.einsum("nk,nkd->nd", weights, shape.points[shape.faces[face]])
    # A pixel is 1 / 64 of a side, and a step in colour as large as that.
    assert np.abs(shape.texture.colours(face, weights) - ramp(places)).max() < 3.0


def table_under(out: str, head: str) -> list[str]:
    """The rows of a table that was printed."""
    lines = out.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(head)) + 1
    return list(itertools.takewhile(str.strip, lines[first:]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k if k == "glb" else pytest.param(k, marks=SLOW) for k in WRITERS])
def test_the_command_tells_both_groups(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = WRITERS[kind](tmp_path, BOX, dot((0, 0, 0.2), 0.15))
    page = tmp_path / "x.html"
    assert invoke(["detect", str(path), "--texture", "--json", str(tmp_path / "x.json"), "--report", str(page)]) == 0
    assert "With its texture</dt><dd>C2v, 1.00" in page.read_text(encoding="utf-8")
    out = capsys.readouterr().out
    assert "with its texture: C2v, confidence" in out
    assert [line.split()[-1] == "kept" for line in table_under(out, "mirror planes")].count(True) == 2
    assert [line.split()[-1] == "kept" for line in table_under(out, "axes")].count(True) == 1
    assert [line.split()[-1] == "kept" for line in table_under(out, "inversion")] == [False]
    assert page.read_text(encoding="utf-8").count("with its texture kept") == 3
    record = json.loads((tmp_path / "x.json").read_text())
    assert (record["point_group"], record["textured"]["point_group"]) == ("D2h", "C2v")
    assert len(record["textured"]["planes"]) == 2
    schema = json.loads(files("symrefine").joinpath("schema", "detection.schema.json").read_text())
    jsonschema.validate(record, schema)
    assert invoke(["detect", str(path), "--labels", "texture", "--json", str(tmp_path / "y.json")]) == 0
    alone = json.loads((tmp_path / "y.json").read_text())
    assert (alone["point_group"], alone["planes"]) == ("C2v", record["textured"]["planes"])
    assert alone["textured"] is None


def test_what_a_line_is_about_stands_apart_from_what_it_says() -> None:
    shape = box(BOX, dot((0, 0, 0.2), 0.15))
    lines = repr(symrefine.detect(shape)).splitlines()
    assert [line for line in lines if line.startswith("  with texture C2v, confidence ")]
    assert {line[14:15] + str(line[15:16] != " ") for line in lines[1:]} == {" True"}, "in one column"


def test_what_is_made_exact_is_what_the_texture_keeps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_obj(tmp_path, (1.0, 1.0, 2.0), quarters)
    found = symrefine.detect(load(path, texture=True))
    for words, group in (([], found.point_group), (["--texture"], found.textured.point_group)):
        assert invoke(["symmetrize", str(path), "-o", str(tmp_path / "exact.ply"), *words]) == 0
        assert capsys.readouterr().out.startswith(f"{path}: {group}, made exact\n")


def test_exports_are_of_the_shape_with_its_texture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_obj(tmp_path, (1.0, 1.0, 2.0), quarters)
    found = symrefine.detect(load(path, texture=True))
    assert found.textured.point_group != found.point_group
    out = tmp_path / "t.npz"
    for words, group in (([], found.point_group), (["--texture"], found.textured.point_group)):
        assert invoke(["export", str(path), "--to", "npz", "--improper", "--out", str(out), *words]) == 0
        assert capsys.readouterr().out.startswith(f"{path}: {group}\n")
        with np.load(out) as written:
            assert str(written["point_group"]) == group
    symrefine.export(found.shape, "npz", tmp_path / "p.npz", found=found.textured, improper=True)
    assert (tmp_path / "p.npz").read_bytes() == out.read_bytes()


def damaged(folder: Path, case: str) -> str:
    path = write_obj(folder, BOX, plain)
    look = (folder / "the look.mtl").read_text()
    lines = path.read_text()
    match case:
        case "no image":
            (folder / "side 3.png").unlink()
            return "side 3.png: no such file"
        case "no materials":
            (folder / "the look.mtl").unlink()
            return "the look.mtl: no such file"
        case "options":
            (folder / "the look.mtl").write_text(look.replace("map_Kd ", "map_Kd -s 2 2 2 "))
            return "line 4: map_Kd '-s 2 2 2 side 0.png'; expected the name of an image and no options"
        case "no texture":
            (folder / "the look.mtl").write_text(look.replace("map_Kd", "map_Ks"))
            return "has no texture: no material of its faces has an image"
        case "unknown material":
            path.write_text(lines.replace("usemtl m2", "usemtl other"))
            return "no material 'other'; there are "
        case "no coordinates":
            path.write_text(lines.replace("f 9/-4 10/-3", "f 9 10"))
            return "face 2 shows an image and has no texture coordinates"
        case "beyond":
            path.write_text(lines.replace("f 9/-4", "f 9/7"))
            return "a corner refers to texture coordinates 7; there are 4 here"
        case "torn image":
            data = (folder / "side 0.png").read_bytes()
            (folder / "side 0.png").write_bytes(data[: len(data) // 2])
            return "side 0.png: not a whole PNG image"
        case _:
            (folder / "the look.mtl").write_text(look.replace("Kd 1 1 1", "Kd 1 2 3"))
            return "line 3: Kd '1 2 3'; expected red green blue, each from 0 to 1"


@pytest.mark.parametrize(
    "case",
    [
        *("no image", "no materials", "options", "no texture", "unknown material", "no coordinates", "beyond"),
        *("torn image", "Kd"),
    ],
)
def test_what_is_missing_is_refused_in_one_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = damaged(tmp_path, case)
    assert invoke(["detect", str(tmp_path / "box.obj"), "--texture"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith(f"symrefine: {tmp_path / 'box.obj'}: ")
    assert said in error
    load(tmp_path / "box.obj")  # the shape is whole


@pytest.mark.parametrize("case", ["no image", "torn image", "cut image", "other coordinates"])
def test_what_gltf_lacks_is_refused(case: str, tmp_path: Path) -> None:
    """trimesh would leave it out without a word."""
    trimesh = pytest.importorskip("trimesh")
    for name, data in trimesh.load_scene(write_glb(tmp_path, BOX, plain)).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / "model.gltf"
    tree = json.loads(path.read_text())
    Image.new("RGB", (8, 8), "red").save(tmp_path / "side.png")
    for image in tree["images"]:
        image.pop("bufferView", None)
        image |= {"uri": "side.png"}
    path.write_text(json.dumps(tree))
    texture = load(path, texture=True).texture
    assert texture is not None
    assert {tuple(pixels.reshape(-1, 3).max(axis=0)) for pixels in texture.images} == {(255, 0, 0)}
    if case == "no image":
        (tmp_path / "side.png").unlink()
        said = "image 0, 'side.png': no such file beside it"
    elif case == "torn image":
        (tmp_path / "side.png").write_bytes((tmp_path / "side.png").read_bytes()[:40])
        said = "an image of its textures cannot be read"
    elif case == "cut image":
        grain = np.random.default_rng(0).integers(255, size=(64, 64, 3), dtype=np.uint8)
        Image.fromarray(grain).save(tmp_path / "side.png")
        data = (tmp_path / "side.png").read_bytes()
        (tmp_path / "side.png").write_bytes(data[: len(data) // 2])
        said = "is damaged"
    else:
        tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1
        path.write_text(json.dumps(tree))
        said = "material 0 places its image by other coordinates"
    with pytest.raises(InputError, match=said):
        load(path, texture=True)
    assert load(path).texture is None


def test_images_are_bounded_before_they_are_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_obj(tmp_path, BOX, plain)
    monkeypatch.setattr(paint, "LARGEST", 5 * 64 * 64)
    with pytest.raises(InputError, match="20,480"):
        load(path, texture=True)
    monkeypatch.setattr(pictures, "LARGEST", 63 * 64)
    with pytest.raises(InputError, match="64 x 64 pixels; at most 4,032 pixels"):
        load(path, texture=True)
    with pytest.raises(InputError, match="64 x 64 pixels; at most 4,032 pixels"):
        load(write_glb(tmp_path, BOX, plain), texture=True)


def test_only_meshes_with_images_have_a_texture(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n")
    with pytest.raises(InputError, match=r"textures are read of meshes only: \.glb \.gltf \.obj \.ply"):
        load(tmp_path / "a.xyz", texture=True)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(InputError, match="has no faces, so no texture"):
        load(tmp_path / "a.obj", texture=True)
    (tmp_path / "a.ply").write_text(write_ply(tmp_path, BOX, plain).read_text().replace("TextureFile", "Author"))
    with pytest.raises(InputError, match="has no texture: the header has no line 'comment TextureFile NAME'"):
        load(tmp_path / "a.ply", texture=True)


@pytest.mark.slow
def test_a_data_set_is_labelled_with_its_textures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Shape and texture side by side for a person, or the texture alone; another image is another object."""
    folder = tmp_path / "models"
    folder.mkdir()
    write_obj(folder, BOX, dot((0, 0, 0.2), 0.15)).rename(folder / "obj_000001.obj")
    told: dict[str, dict[str, list[object]]] = {}
    for name, option in (("both", ["--texture"]), ("alone", ["--labels", "texture"])):
        out = tmp_path / name
        assert invoke(["label", str(folder), "--out", str(out), "--accept", "0.5", *option]) == 0
        told[name] = json.loads((out / "models_info.json").read_text())["1"]
    assert len(told["both"]["symmetries_discrete"]) == 3
    assert len(told["alone"]["symmetries_discrete"]) == 1
    assert "With its texture it is C2v." in (tmp_path / "both" / "review.html").read_text()
    capsys.readouterr()
    Image.new("RGB", (64, 64), (200, 120, 40)).save(folder / "side 5.png")
    again = ["label", str(folder), "--out", str(tmp_path / "alone"), "--accept", "0.5", "--labels", "texture"]
    assert invoke(again) == 0
    assert "D2h" in capsys.readouterr().out


def test_pictures_show_the_texture() -> None:
    from matplotlib.image import imread

    from symrefine.picture.draw import picture_png

    blue = box(CUBE, dot((0, 0, 0), 2.0))
    found = detect(blue)
    shares = []
    for given in (blue, replace(blue, texture=None)):
        pixels = imread(BytesIO(picture_png(found, given, width=300, height=225, title=False)))
        shares.append(float((pixels[..., 2] > 2.0 * pixels[..., 0] + 0.02).mean()))
    assert shares[0] > 0.15
    assert shares[1] < 0.05


def _obj_above(folder: Path) -> Path:
    """An .obj whose image lies in a folder beside its own, as data sets have them."""
    (folder / "models").mkdir()
    (folder / "textures").mkdir()
    path = write_obj(folder / "models", BOX, plain)
    for image in list(path.parent.glob("*.png")):
        image.rename(folder / "textures" / image.name)
    materials = next(path.parent.glob("*.mtl"))
    materials.write_text(materials.read_text().replace("map_Kd ", "map_Kd ../textures/"))
    return path


def test_what_an_address_names_beside_it_is_fetched_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    store = pytest.importorskip("fsspec").filesystem("memory")
    store.store.clear()
    monkeypatch.chdir(tmp_path)
    near = _obj_above(tmp_path)
    for file in (path for path in tmp_path.rglob("*") if path.is_file()):
        store.pipe(f"/set/{file.relative_to(tmp_path).as_posix()}", file.read_bytes())

    def batch(path: object, out: str) -> tuple[dict[str, Any], str]:
        invoke(["batch", str(path), "--texture", "--out", out])
        return json.loads(Path(out).read_text().splitlines()[-1]), capsys.readouterr().out

    here, there = (batch(path, out)[0] for path, out in ((near, "a.jsonl"), ("memory://set/models", "b.jsonl")))
    assert there["error"] is None
    assert there["textured"] == here["textured"]
    assert set(there["beside"]) == set(here["beside"]) != set()
    assert "1 done before" in batch("memory://set/models", "b.jsonl")[1]
    image = next(name for name in store.find("/set/textures"))
    whole = store.cat_file(image)
    store.pipe(image, whole[:40])
    errors = [batch("memory://set/models", out)[0]["error"] for out in ("b.jsonl", "c.jsonl")]
    assert errors[0] == errors[1]
    assert errors[0].startswith("memory:///set/models/")
    assert "symrefine-" not in errors[0]  # the folder of a copy has another name every time
    store.rm(image)
    assert "no such file" in batch("memory://set/models", "b.jsonl")[0]["error"]
    store.pipe(image, whole)
    assert batch("memory://set/models", "b.jsonl")[0]["error"] is None


@pytest.mark.parametrize("kind", ["image", "materials"])
def test_files_beside_a_mesh_are_bounded_before_they_are_read(kind: str, tmp_path: Path) -> None:
    path = write_obj(tmp_path, BOX, plain)
    large = next(tmp_path.glob("*.png" if kind == "image" else "*.mtl"))
    with large.open("r+b") as stream:
        stream.truncate(2**40)  # takes no room on the disk
    with pytest.raises(InputError, match=r"has 1,099,511,627,776 bytes; expected 268,435,456 at most"):
        load(path, texture=True)


def test_the_image_of_a_texture_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_obj(tmp_path, BOX, plain)
    image = next(tmp_path.glob("*.png"))
    before = image.read_bytes()
    assert invoke(["detect", str(path), "--texture", "--picture", str(image)]) == 2
    assert "is the same file as the input" in capsys.readouterr().err
    assert image.read_bytes() == before
