"""Models of printers and designers: what is built stands in its place, and damage is told."""

import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh

from experiments.objects.cylinder_step import STEP
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.load import apart, load, step
from symrefine.shape import Shape

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/3dmodel.model"/></Relationships>'
)
TETRA = np.array([[0.123456789, 0, 0], [1, 0.1, 0], [0, 1, 0.3], [0.7, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def mesh_xml() -> str:
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in TETRA.tolist())
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in FACES.tolist())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def model(objects: str, items: str, attributes: str = "") -> str:
    return (
        f'<?xml version="1.0"?><model xmlns="{CORE}" xmlns:p="{PRODUCTION}" unit="millimeter" {attributes}><resources>'
        f"{objects}</resources><build>{items}</build></model>"
    )


SIMPLE = model(f'<object id="1">{mesh_xml()}</object>', '<item objectid="1"/>')


def packed(**parts: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr({"rels": "_rels/.rels", "root": "3D/3dmodel.model"}.get(name, f"3D/{name}.model"), text)
    return stream.getvalue()


def loaded(folder: Path, data: bytes, name: str = "a.3mf") -> Shape:
    (folder / name).write_bytes(data)
    return load(folder / name)


def refusal(folder: Path, data: bytes, name: str = "a.3mf") -> str:
    with pytest.raises(InputError) as caught:
        loaded(folder, data, name)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert "\n" not in message
    return message


def test_3mf_to_the_last_digit(tmp_path: Path) -> None:
    shape = loaded(tmp_path, packed(rels=RELS, root=SIMPLE))
    assert np.array_equal(shape.points[shape.faces], TETRA[FACES])


def test_3mf_of_trimesh(tmp_path: Path) -> None:
    pytest.importorskip("lxml")
    pytest.importorskip("networkx")
    box = trimesh.creation.box((1, 2, 4))
    mirror = np.diag([-1.0, 1, 1, 1])
    mirror[0, 3] = 10.0
    scene = trimesh.Scene()
    scene.add_geometry(box, geom_name="box")
    scene.graph.update(frame_to="mirrored", matrix=mirror, geometry="box")
    shape = loaded(tmp_path, scene.export(file_type="3mf"))
    assert (shape.points.shape, shape.faces.shape) == ((16, 3), (24, 3))
    assert np.ptp(shape.points, axis=0).tolist() == [11, 2, 4]
    assert np.linalg.det(shape.points[shape.faces]).sum() / 6 == pytest.approx(16.0)  # 0, if one were inside out


def test_3mf_of_components_in_several_parts(tmp_path: Path) -> None:
    shift = "1 0 0 0 1 0 0 0 1 {} 0 0"
    two = f'<object id="7">{mesh_xml()}</object>'
    pair = "".join(f'<component objectid="7" p:path="/3D/other.model" transform="{shift.format(x)}"/>' for x in (0, 5))
    turn = "0 1 0 -1 0 0 0 0 1 0 0 9"  # a quarter about z: rows are the images of the axes
    root = model(f'<object id="1"><components>{pair}</components></object>', f'<item objectid="1" transform="{turn}"/>',
                 'requiredextensions="p"')  # fmt: skip
    shape = loaded(tmp_path, packed(rels=RELS, root=root, other=model(two, "")))
    x, y, z = np.concatenate([TETRA, TETRA + [5, 0, 0]]).T
    assert np.array_equal(shape.points, np.column_stack([-y, x, z + 9]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace('x="1.0"', 'x="one"'), "object '1': vertex 1: x y z are 'one 0.1 0.0'; expected three"),
        (lambda t: t.replace('x="1.0"', 'x="1.0 7"'), "object '1': vertex 1: x y z are '1.0 7 0.1 0.0'"),
        (lambda t: t.replace('x="1.0" ', ""), "object '1': vertex 1: x y z are ' 0.1 0.0'"),
        (lambda t: t.replace('x="1.0"', 'x="nan"'), "point 1 is [nan, nan, nan] (1 such of 4)"),
        (lambda t: t.replace('v1="1"', 'v1="4"'), "object '1': triangle 3: corners are '4 2 3'; expected three of 4"),
        (lambda t: t.replace('v1="1"', 'v1="-1"'), "object '1': triangle 3: corners are '-1 2 3'"),
        (lambda t: t.replace('objectid="1"', 'objectid="2"'), "has no object '2', which is to be built"),
        (lambda t: t.replace("<item", "<thing"), "builds nothing: its <build> has no <item>"),
        (lambda t: t.replace("/2015/02", "/2099/01"), "expected {http://schemas"),
        (lambda t: t[:-30], "3D/3dmodel.model': not valid XML: "),
        (lambda t: t.replace("<item", '<item transform="1 2"'), "transform '1 2'; expected 12 numbers"),
        (lambda t: t.replace("unit=", 'requiredextensions="b" xmlns:b="http://x/beamlattice" unit='), "requires 'http://x"),
        (lambda t: t.replace(mesh_xml(), ""), "builds no triangles"),
        (lambda t: t.replace(mesh_xml(), '<components><component objectid="1"/></components>'), "more than 100 deep"),
    ],
)  # fmt: skip
def test_3mf_that_is_refused(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    assert message in refusal(tmp_path, packed(rels=RELS, root=change(SIMPLE)))


def test_archives_that_are_none(tmp_path: Path) -> None:
    assert "not a whole .3mf archive" in refusal(tmp_path, b"garbage")
    whole = packed(rels=RELS, root=SIMPLE)
    assert "not a whole .3mf archive" in refusal(tmp_path, whole[:-30])
    assert "has no part '_rels/.rels'; not a 3MF archive" in refusal(tmp_path, packed(root=SIMPLE))
    assert "names 0 models; expected one" in refusal(tmp_path, packed(rels=RELS.replace("3dmodel", "x"), root=SIMPLE))


def test_few_bytes_cannot_ask_for_too_many_triangles(tmp_path: Path) -> None:
    ten = "".join('<component objectid="{0}"/>' for _ in range(10))
    levels = "".join(f'<object id="{k}"><components>{ten.format(k - 1)}</components></object>' for k in range(2, 40))
    root = model(f'<object id="1">{mesh_xml()}</object>{levels}', '<item objectid="39"/>')
    assert "builds 5.11e+38 triangles and parts; at most 16,777,216" in refusal(tmp_path, packed(rels=RELS, root=root))


def test_damage_never_shows_as_a_foreign_error(tmp_path: Path) -> None:
    sound = packed(rels=RELS, root=SIMPLE)
    rng = np.random.default_rng(0)
    for _ in range(200):
        data = bytearray(sound)
        data[rng.integers(len(data))] = rng.integers(256)
        with suppress(InputError):
            loaded(tmp_path, bytes(data))
        text = bytearray(SIMPLE.encode())
        text[rng.integers(len(text))] = rng.integers(32, 127)
        with suppress(InputError):
            loaded(tmp_path, packed(rels=RELS, root=text.decode()))


# STEP: a cylinder of radius 20 and height 50, in millimetres.


@pytest.fixture
def opencascade() -> None:
    """OpenCASCADE is no part of the development tools: it is large."""
    pytest.importorskip("cascadio")


@pytest.mark.usefixtures("opencascade")
@pytest.mark.parametrize("name", ["a.step", "a.STP"])
def test_step_in_metres(tmp_path: Path, name: str) -> None:
    shape = loaded(tmp_path, STEP.encode(), name)
    assert np.ptp(shape.points, axis=0) == pytest.approx([0.04, 0.04, 0.05], rel=1e-3)
    a, b, c = (shape.points[shape.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(2 * np.pi * 0.02 * (0.02 + 0.05), rel=5e-3)
    assert detect(shape).point_group == "Dinfh"
    inches = STEP.replace(".MILLI.", ".CENTI.")
    assert np.ptp(loaded(tmp_path, inches.encode(), name).points, axis=0)[2] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.usefixtures("opencascade")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (STEP, STEP[:500], 'damaged, as OpenCASCADE says: "ERR StepFile : Undefined Parsing: Line 16'),
        (STEP, STEP[:-60], "damaged, as OpenCASCADE says: 'ERR StepFile"),
        ("#36=", "#99=", "damaged, as OpenCASCADE says: 'ERR StepReaderData : Unresolved Reference"),
        ("(#57,#64,#74)", "()", "no points; a shape needs at least two distinct points"),
        ("ISO-10303-21;", "ISO", "not a STEP file: begins with b'ISO"),
    ],
)
def test_step_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in refusal(tmp_path, STEP.replace(old, new, 1).encode(), "a.step")


@pytest.mark.usefixtures("opencascade")
def test_a_step_file_that_never_ends_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "LONGEST_S", 5.0)
    message = refusal(tmp_path, STEP.replace("(20.,0.,0.)", "(nan,0.,0.)").encode(), "a.step")
    assert "cannot be made into triangles within 5 s" in message or "as OpenCASCADE says" in message


def test_without_opencascade_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step, "find_spec", lambda _: None)
    assert "cascadio is needed to read it and is not installed: pip install 'symrefine[cad]'" in refusal(
        tmp_path, STEP.encode(), "a.step"
    )
