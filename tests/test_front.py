"""Objects in, answers out: whatever people hold gives one answer, which prints, becomes JSON and saves itself."""

import copy
import json
import pickle
import re
from dataclasses import FrozenInstanceError, is_dataclass, replace
from importlib import import_module
from importlib.resources import files
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import symrefine
from symrefine.detection.result import NearMiss
from symrefine.errors import InputError
from symrefine.load import Frames
from symrefine.load.open3d import open3d
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation

mpl.use("Agg")
jsonschema = pytest.importorskip("jsonschema")
CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TRIANGLES = np.array([[a, b, c] for s in SIDES for a, b, c in (s[:3], [s[0], *s[2:]])])
RNG = np.random.default_rng(0)


def on_box(count: int = 3000) -> np.ndarray:
    """Points on the faces of a box of sides 1, 2, 3."""
    side = RNG.choice(3, count, p=np.array([6.0, 3.0, 2.0]) / 11.0)
    points = RNG.random((count, 3))
    points[np.arange(count), side] = RNG.integers(0, 2, count)
    return points * [1.0, 2.0, 3.0]


POINTS = on_box()


def schema(name: str) -> dict:
    return json.loads(files("symrefine").joinpath("schema", f"{name}.schema.json").read_text(encoding="utf-8"))


def of_trimesh():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(CORNERS, TRIANGLES, process=False)
    return [mesh, trimesh.PointCloud(POINTS), trimesh.Scene([mesh]), trimesh.Scene([trimesh.PointCloud(POINTS)])]


def of_open3d():
    o3d = open3d()
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(CORNERS), o3d.utility.Vector3iVector(TRIANGLES))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    return [mesh, cloud, o3d.t.geometry.TriangleMesh.from_legacy(mesh), o3d.t.geometry.PointCloud.from_legacy(cloud)]


def of_pyvista():
    pyvista = pytest.importorskip("pyvista")
    return [pyvista.PolyData.from_regular_faces(CORNERS, SIDES), pyvista.PolyData(POINTS)]


def of_torch():
    torch = pytest.importorskip("torch")
    return [torch.tensor(POINTS, requires_grad=True), (torch.tensor(CORNERS), torch.tensor(TRIANGLES))]


def plain():
    return [
        POINTS,
        POINTS.tolist(),
        (CORNERS, TRIANGLES),
        (CORNERS.tolist(), SIDES),
        symrefine.Shape(CORNERS, TRIANGLES),
    ]


@pytest.mark.parametrize("held", [plain, of_trimesh, of_open3d, of_pyvista, of_torch])
def test_whatever_people_hold_is_the_same_box(held):
    for given in held():
        found = symrefine.detect(given)
        assert (found.point_group, len(found.planes)) == ("D2h", 3)
        np.testing.assert_allclose(found.center, [0.5, 1.0, 1.5], atol=0.02)


def molecule(case: str):
    places = np.array([[0.0, 0.0, 0.12], [0.0, 0.76, -0.47], [0.0, -0.76, -0.47]])
    if case == "ase":
        return pytest.importorskip("ase").Atoms("OHH", positions=places)
    return pytest.importorskip("pymatgen.core").Molecule(["O", "H", "H"], places)


@pytest.mark.parametrize("case", ["ase", "pymatgen"])
def test_elements_of_molecules_are_labels(case):
    found = symrefine.detect(molecule(case))
    assert found.point_group == "C2v"
    assert sorted(found.shape.labels.tolist()) == [1, 1, 8]


def test_a_crystal_is_no_molecule():
    ase = pytest.importorskip("ase")
    with pytest.raises(InputError, match="periodic"):
        symrefine.detect(ase.Atoms("NaCl", positions=[[0, 0, 0], [2, 0, 0]], cell=[4, 4, 4], pbc=True))


def test_a_path_is_read_like_the_object_in_it(tmp_path):
    path = tmp_path / "box.npy"
    np.save(path, POINTS)
    by_path, by_array = symrefine.detect(path), symrefine.detect(POINTS)
    assert {**by_path.to_dict(), "source": 0, "timings": 0} == {**by_array.to_dict(), "source": 0, "timings": 0}


def test_one_of_several_frames_is_chosen_by_its_number(tmp_path):
    path = tmp_path / "two.xyz"
    path.write_text("3\nwater\nO 0 0 0\nH 0.76 0.59 0\nH -0.76 0.59 0\n2\n\nH 0 0 0\nH 0 0 0.74\n")
    assert [symrefine.detect(path, frame=k).point_group for k in (0, 1)] == ["C2v", "Dinfh"]
    assert symrefine.detect(path, frame=1).to_dict()["options"]["frame"] == 1
    with pytest.raises(InputError, match="frame is 2; the file has 2 "):
        symrefine.detect(path, frame=2)
    with pytest.raises(InputError, match="it chooses one of the objects in a file; give its path"):
        symrefine.detect(POINTS, frame=0)


WRONG = {
    "an object": (object(), "array: is of type object; expected a path"),
    "several paths": (["a.ply", "b.ply"], "array: holds several objects; give one of them at a time"),
    "several arrays": ([POINTS, POINTS[::-1]], "array: holds several objects"),
    "frames": (Frames("models", 2, lambda _: Shape(POINTS)), "array: holds several objects"),
    "an empty list": ([], "array: is an empty list; expected a path"),
    "an empty name": ("", "the name of the file is empty"),
    "nothing": (None, "is of type NoneType"),
    "a masked array": (np.ma.masked_array(POINTS), "masked array"),
    "a mesh of masked points": ((np.ma.masked_array(CORNERS), TRIANGLES), "masked array"),
    "faces out of range": ((CORNERS, TRIANGLES + 1), "refers to vertex 8; there are 8 vertices"),
    "a corner that is no number": ((CORNERS, [[0, 1, 3.9], [0, 3, 2], [4, 6, 7, 5]]), "a corner of a face is 3.9"),
    "vertices in the plane": ((CORNERS[:, :2], TRIANGLES), "vertices have 2 coordinates"),
    "points beyond numbers": (POINTS * 1e200, "coordinates must be finite and at most"),
    "whether, not where": (POINTS > 1.0, "they are of type bool"),
    "numbers too large": ([[10**400, 0, 0], [1, 1, 1]], "they are of type object"),
    "a path of nothing": ("a\0b.ply", "is no name of a file"),
    "a path too long": ("a" * 5000 + ".ply", "is no name of a file"),
    "no faces": ((CORNERS, np.zeros((0, 3), int)), r"faces have shape \(0, 3\)"),
    "faces of numbers": ((CORNERS, TRIANGLES * 1.0), "of float64; expected whole numbers"),
    "a file that is not there": ("nowhere.ply", "nowhere.ply: no such file"),
    "points that are not finite": ((CORNERS * np.nan, TRIANGLES), "point 0 is"),
}


@pytest.mark.parametrize(("given", "message"), WRONG.values(), ids=WRONG)
def test_what_is_no_object_is_refused_in_one_line(given, message):
    with pytest.raises(InputError, match=message) as caught:
        symrefine.detect(given)
    assert "\n" not in str(caught.value)


def test_pictures_and_tables_are_no_points_by_chance():
    image = pytest.importorskip("PIL.Image").fromarray(np.zeros((20, 3), np.uint8))
    with pytest.raises(InputError, match="is a picture; save it"):
        symrefine.detect(image)
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(POINTS, columns=["x", "y", "z"])
    assert symrefine.detect(table).point_group == "D2h"
    with pytest.raises(InputError, match="has the columns x y z label; give those of the coordinates"):
        symrefine.detect(table.assign(label=1))


ANSWERS = {
    "a cloud": lambda: symrefine.detect(POINTS),
    "a mesh": lambda: symrefine.detect((CORNERS, TRIANGLES)),
    "a map": lambda: symrefine.align(POINTS, POINTS[::-1] + 1.0),
    "a map of a part": lambda: symrefine.align(POINTS, POINTS[POINTS[:, 0] < np.median(POINTS[:, 0])]),
    "a map in the plane": lambda: symrefine.align(POINTS[:, :2], POINTS[::-1, :2]),
    "an exact shape": lambda: symrefine.symmetrize((CORNERS, TRIANGLES)),
}


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda answer: pickle.loads(pickle.dumps(answer))])
@pytest.mark.parametrize("make", ANSWERS.values(), ids=ANSWERS)
def test_answers_come_back_from_other_processes(make, copied):
    answer = make()
    again = copied(answer)
    assert {**again.to_dict(), "timings": 0} == {**answer.to_dict(), "timings": 0}
    assert type(again) is type(answer)


ASKED = {
    "a text for no": (lambda: symrefine.align(POINTS, POINTS, allow_reflection="no"), "allow_reflection is 'no'"),
    "a factor": (lambda: symrefine.align(POINTS, POINTS, scale=2.0), "scale is 2.0; expected True or False"),
    "a count": (lambda: symrefine.align(POINTS, POINTS, polish=2), "polish is 2; expected True or False"),
    "one tolerance": (lambda: symrefine.detect(POINTS, ladder=0.1), "ladder is 0.1; expected several tolerances"),
    "a text for no operations": (
        lambda: symrefine.detect(POINTS).operations(improper="no"),
        "improper is 'no'; expected True or False",
    ),
    "half a turn": (lambda: symrefine.detect(POINTS).operations(steps=2.5), "steps is 2.5; expected a whole number"),
    "a text for no picture": (lambda: symrefine.load("x.png", invert="no"), "invert is 'no'; expected True or False"),
    "a text for no images": (lambda: symrefine.load("x.obj", texture="no"), "texture is 'no'; expected True or False"),
    "labels for their name": (
        lambda: symrefine.load("x.ply", labels=[1, 2]),
        "labels: is of type list; expected",
    ),
    "a camera in words": (lambda: symrefine.load_depth("x.png", "wide"), "intrinsics are not numbers"),
    "a camera matrix": (lambda: symrefine.load_depth("x.png", np.eye(3)), r"expected fx, fy, cx, cy in pixels"),
    "a scale in words": (lambda: symrefine.load_depth("x.png", (1, 1, 0, 0), depth_scale="mm"), "depth_scale is 'mm'"),
    "a letter": (lambda: symrefine.export(POINTS, "bop", "x.json", number="a"), "number is 'a'; expected a whole"),
    "turns for bop": (lambda: symrefine.export(POINTS, "bop", "x.json", steps=3), "steps does not apply to 'bop'"),
    "a transform for npz": (
        lambda: symrefine.export(POINTS, "npz", "x.npz", transform="t.json"),
        "transform does not apply to 'npz'; it is for 'canonical'",
    ),
    "points in words": (lambda: symrefine.align(POINTS, POINTS).apply("here"), "points are not numbers"),
    "points of the plane": (
        lambda: symrefine.align(POINTS, POINTS).apply(POINTS[:, :2]),
        r"points have shape \(\d+, 2\); expected \[N, 3\]",
    ),
}


@pytest.mark.parametrize(("ask", "message"), ASKED.values(), ids=ASKED)
def test_options_are_never_misread(ask, message):
    with pytest.raises(InputError, match=message):
        ask()


def test_what_was_made_does_not_take_the_place_of_what_it_was_made_from(tmp_path):
    path = tmp_path / "box.off"
    corners, sides = ("\n".join(" ".join(map(str, row)) for row in rows) for rows in (CORNERS, TRIANGLES))
    threes = "\n".join(f"3 {row}" for row in sides.splitlines())
    path.write_text(text := f"OFF\n{len(CORNERS)} {len(TRIANGLES)} 0\n{corners}\n{threes}\n")
    made = symrefine.symmetrize(path)
    (tmp_path / "link.off").symlink_to(path)
    for name in ("box.off", "link.off"):
        with pytest.raises(InputError, match="is the input itself; name another file"):
            made.save(tmp_path / name)
    assert path.read_text() == text
    made.save(tmp_path / "exact.off")


def test_an_answer_undetermined_at_its_tolerance_tells_others_truly():
    fine, plain = (symrefine.detect(POINTS, tolerance=t, ladder=(0.02, 0.04)) for t in (0.0005, 0.02))
    assert fine.undetermined
    assert [s.point_group for s in fine.staircase] == [s.point_group for s in plain.staircase] == ["D2h", "D2h"]
    assert not fine.alternatives


def test_operations_cannot_be_written_to(found):
    operations = found["detection"].operations()
    with pytest.raises(ValueError, match="read-only"):
        operations[0] = 0.0
    assert operations[0].determinants == 1.0


def test_what_an_object_brings_is_not_given_twice():
    with pytest.raises(InputError, match="normals: belong to the Shape"):
        symrefine.detect(symrefine.Shape(POINTS), normals=POINTS + 1.0)
    with pytest.raises(InputError, match="weights is for clouds"):
        symrefine.detect((CORNERS, TRIANGLES), weights=np.ones(8))
    with pytest.raises(InputError, match=r"^ase Atoms: brings its own labels"):
        symrefine.detect(molecule("ase"), labels=[1, 2, 3])


def test_a_mesh_of_a_file_takes_what_a_mesh_of_arrays_takes(tmp_path):
    path = tmp_path / "box.off"
    rows = [" ".join(map(str, row)) for row in (*CORNERS.tolist(), *([3, *t] for t in TRIANGLES.tolist()))]
    path.write_text("\n".join(["OFF", "8 12 0", *rows, ""]))
    for given in (path, (CORNERS, TRIANGLES)):
        with pytest.raises(InputError, match="weights is for clouds"):
            symrefine.detect(given, weights=np.ones(8))


def test_numbers_of_numpy_are_options_too():
    found = symrefine.detect(POINTS[:400], tolerance=np.float32(0.02), seed=np.int64(1))
    assert json.loads(found.to_json())["options"]["seed"] == 1


REFUSED = {
    "a seed below 0": ({"seed": -1}, "seed is -1; expected a whole number from 0"),
    "a seed that is no whole number": ({"seed": 1.5}, "seed is 1.5"),
    "a tolerance that is none": ({"tolerance": 0.3}, "tolerance is 0.3"),
    "another word for outliers": ({"outliers": "some"}, "outliers"),
}


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_options_that_are_none_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        symrefine.detect(POINTS[:400], **options)


@pytest.mark.parametrize("option", [{"outliers": "none"}, {"ladder": (0.01,)}, {"labels": np.zeros(40, int)}])
def test_options_for_space_are_refused_in_the_plane(option):
    with pytest.raises(InputError, match="for objects in space, leave them out"):
        symrefine.detect(RNG.random((40, 2)), **option)


def test_the_group_at_other_tolerances_is_told_as_on_the_command_line(found):
    assert len(symrefine.detect(CORNERS).staircase) > 3
    assert [s.tolerance for s in found["detection"].staircase] == [0.01, 0.04]


def test_what_was_found_is_of_an_object_in_space(found, tmp_path):
    with pytest.raises(InputError, match="found is of type PlanarDetection"):
        symrefine.symmetrize(POINTS, found["detection2d"])
    with pytest.raises(InputError, match="found is of type SubspaceDetection"):
        symrefine.export(POINTS, "npz", tmp_path / "x.npz", found=found["detection_nd"])
    assert not list(tmp_path.iterdir())


OTHERS = {
    "fewer": ((CORNERS[:-1], None), r"it has 8 points, this has 7"),
    "moved": ((CORNERS + [0.0, 0.0, 0.1], TRIANGLES), r"a coordinate of its points differs by 0\.1"),
    "no mesh": ((CORNERS, None), "its triangles are others"),
    "other triangles": ((CORNERS, TRIANGLES[::-1]), "its triangles are others"),
}


@pytest.mark.parametrize(("other", "message"), OTHERS.values(), ids=OTHERS)
def test_what_was_found_in_another_object_is_refused(other, message, tmp_path):
    found = symrefine.detect((CORNERS, TRIANGLES))
    points, faces = other
    shape = symrefine.Shape(points) if faces is None else symrefine.Shape(points, faces)
    for ask in (
        lambda: symrefine.symmetrize(shape, found),
        lambda: symrefine.export(shape, "npz", tmp_path / "x.npz", found=found),
    ):
        with pytest.raises(InputError, match=f"what was found is of another object, .*: {message}; detect in this"):
            ask()
    assert not list(tmp_path.iterdir())


def test_what_was_found_in_the_same_object_is_taken_as_it_is_written():
    found = symrefine.detect((CORNERS, TRIANGLES))
    again = symrefine.symmetrize((CORNERS.astype(np.float32), TRIANGLES), found)
    np.testing.assert_allclose(again.shape.points, CORNERS, atol=1e-6)


EXPORTS = {
    "mirrors for BOP": (("bop", "m.json", {"improper": True}), "improper does not apply to 'bop'"),
    "a number for matrices": (("npz", "x.npz", {"number": 3}), "it is for 'bop', 'foundationpose', 'megapose'"),
    "a number for DOPE": (("dope", "x", {"number": 3}), "number does not apply to 'dope'"),
    "millimetres for matrices": (("npz", "x.npz", {"scale": 1000.0}), "scale does not apply to 'npz'"),
    "a text for millimetres": (("bop", "m.json", {"scale": "1000"}), "scale is '1000'; expected millimetres"),
    "whether, not how many": (("bop", "m.json", {"scale": True}), "scale is True; expected millimetres"),
    "another suffix": (("npz", "x.dat", {}), "expected a name that ends in .npz"),
    "no turns": (("npz", "x.npz", {"steps": 0}), "steps is 0"),
    "more than all": (("npz", "x.npz", {"steps": 10**9}), "steps is 1000000000; expected 1 to 360"),
    "no unit": (("bop", "m.json", {"scale": 1e308}), r"scale is 1e\+308; expected millimetres"),
}


@pytest.mark.parametrize(("asked", "message"), EXPORTS.values(), ids=EXPORTS)
def test_exports_that_make_no_sense_leave_nothing(found, tmp_path, asked, message):
    to, name, options = asked
    with pytest.raises(InputError, match=message):
        symrefine.export(POINTS, to, tmp_path / name, found=found["detection"], **options)
    assert not list(tmp_path.iterdir())


def test_a_report_is_refused_before_the_work(monkeypatch, tmp_path):
    monkeypatch.setattr("symrefine.front.verbs.detect", lambda *_: pytest.fail("detected first"))
    with pytest.raises(InputError, match="expected a name that ends in"):
        symrefine.report(POINTS, tmp_path / "x.txt")


def test_labels_of_faces_break_what_they_tell_apart():
    one_side = np.repeat([1, 0, 0, 0, 0, 0], 2)
    assert symrefine.detect((CORNERS, TRIANGLES), labels=one_side).point_group == "C2v"


def answers():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    square = RNG.random((2000, 2))
    return {
        "detection": symrefine.detect(POINTS, ladder=(0.01, 0.04)),
        "detection of a bottle": symrefine.detect(revolved(), labels=None),
        "detection of nothing": symrefine.detect(RNG.random((40, 3))),
        "detection of classes": symrefine.detect(molecule("ase")),
        "detection of what is undetermined": symrefine.detect(np.outer(np.arange(40.0), [1.0, 2.0, 3.0])),
        "detection2d": symrefine.detect(square),
        "detection2d of nothing": symrefine.detect(RNG.random((40, 2))),
        "detection_nd": symrefine.detect(np.eye(5)),
        "detection_nd of samples": symrefine.detect(RNG.standard_normal((2000, 4))),
        "alignment": symrefine.align(POINTS, on_box() @ turn.T),
        "alignment in the plane": symrefine.align(square, square @ [[0.0, 1.0], [1.0, 0.0]]),
        "symmetrized": symrefine.symmetrize((CORNERS, TRIANGLES)),
        "symmetrized cloud": symrefine.symmetrize(revolved(), tolerance=0.03),
        "completed": symrefine.complete(scan()),
    }


def scan() -> np.ndarray:
    """A box of which a part is missing."""
    return POINTS[POINTS[:, 0] < 0.8]


def revolved() -> np.ndarray:
    angle, height = RNG.random(3000) * 2.0 * np.pi, RNG.random(3000) * 3.0
    return np.stack([(1.0 + 0.3 * height) * np.cos(angle), (1.0 + 0.3 * height) * np.sin(angle), height], axis=1)


@pytest.fixture(scope="module")
def found():
    return answers()


def test_every_record_obeys_its_schema(found):
    for case, answer in found.items():
        record = json.loads(answer.to_json())
        assert record | {"timings": {}} == json.loads(json.dumps(answer.to_dict() | {"timings": {}}))
        jsonschema.Draft202012Validator(schema(case.split()[0])).validate(record)


def test_a_schema_refuses_what_is_no_such_record(found):
    record = found["detection"].to_dict()
    rule = jsonschema.Draft202012Validator(schema("detection"))
    for name in record:
        assert not rule.is_valid({key: value for key, value in record.items() if key != name})
    assert not rule.is_valid(record | {"another": 1})
    assert not rule.is_valid(record | {"confidence": 1.5})
    assert not rule.is_valid(record | {"schema": "symrefine.detection/2"})


def test_schemas_are_schemas():
    for name in (
        "detection", "detection2d", "detection_nd", "alignment", "alignments", "symmetrized", "completed", "info",
    ):  # fmt: skip
        jsonschema.Draft202012Validator.check_schema(schema(name))


def test_an_answer_prints_on_six_lines(found):
    for case, answer in found.items():
        lines = repr(answer).splitlines()
        assert len(lines) == 6, case
        assert all(len(line) <= 160 for line in lines[1:])


def test_operations_map_the_object_onto_itself(found):
    box = found["detection"]
    operations = box.operations()
    assert operations.shape == (8, 4, 4)
    assert sorted(operations.determinants) == [-1.0] * 4 + [1.0] * 4
    assert len(box.operations(improper=False)) == 4
    corners = np.column_stack([CORNERS, np.ones(8)])
    for motion in np.asarray(operations):
        moved = (corners @ motion.T)[:, :3]
        assert np.abs(moved[:, None] - CORNERS).sum(axis=2).min(axis=1).max() < 0.1
    assert found["detection of a bottle"].operations(steps=12).shape == (24, 4, 4)
    assert found["detection_nd"].operations().shape == (12, 6, 6)
    with pytest.raises(InputError, match="no symmetries to export"):
        found["detection of what is undetermined"].operations()


def test_operations_in_the_plane_keep_a_square():
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    operations = symrefine.detect(square).operations()
    assert operations.shape == (8, 3, 3)
    moved = np.column_stack([square, np.ones(4)]) @ np.asarray(operations).transpose(0, 2, 1)
    for image in moved[:, :, :2]:
        assert sorted(map(tuple, np.rint(image).tolist())) == sorted(map(tuple, square.tolist()))


def test_the_canonical_transform_puts_centre_and_axis_in_place(found):
    matrix = found["detection of a bottle"].canonical_transform()
    axis = found["detection of a bottle"].axes[0].axis
    np.testing.assert_allclose(np.abs(matrix[:3, :3] @ axis.direction), [0.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose((matrix[:3, :3] @ axis.point + matrix[:3, 3])[:2], 0.0, atol=1e-9)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)


def test_directions_have_the_sign_that_records_have(found):
    for case in ("detection", "detection of a bottle"):
        answer, record = found[case], found[case].to_dict()
        for plane, told in zip(answer.planes, record["planes"], strict=True):
            np.testing.assert_allclose([*plane.plane.normal, plane.plane.offset], [*told["normal"], told["offset"]])
        for axis, told in zip(answer.axes, record["axes"], strict=True):
            np.testing.assert_allclose(axis.axis.direction, told["direction"], atol=1e-11)


@pytest.mark.slow
def test_an_answer_saves_itself_by_its_suffix(found, tmp_path):
    beginnings = {".json": b"{", ".png": b"\x89PNG", ".html": b"<!doctype html>", ".rrd": b"RRF"}
    for suffix, beginning in beginnings.items():
        found["detection"].save(tmp_path / f"box{suffix}")
        assert (tmp_path / f"box{suffix}").read_bytes()[: len(beginning)].lower() == beginning.lower()
    with pytest.raises(InputError, match=r"ends in \.json, \.png, \.html, \.rrd"):
        found["detection"].save(tmp_path / "box.txt")
    with pytest.raises(InputError, match=r"cannot be written as \.rrd"):
        found["detection_nd"].save(tmp_path / "box.rrd")
    assert sorted(p.suffix for p in tmp_path.iterdir()) == sorted(beginnings)
    for case in ("detection2d", "detection_nd"):
        found[case].save(tmp_path / f"{case}.html")
        assert b'src="data:image/png' in found[case]._repr_html_().encode()


@pytest.mark.slow
def test_a_figure_and_a_card(found):
    axes = found["detection"].plot()
    assert len(axes.images) == 1
    assert found["detection"].plot(axes) is axes
    plt.close(axes.figure)
    card = found["detection"]._repr_html_()
    assert card.count("<tr>") == 1 + 3 + 3
    assert "data:image/png;base64," in card


def test_verbs_take_what_detect_takes_and_what_it_found(tmp_path):
    box = symrefine.detect((CORNERS, TRIANGLES))
    made = symrefine.symmetrize((CORNERS, TRIANGLES), box)
    np.testing.assert_allclose(made.shape.points, CORNERS, atol=1e-9)
    package = symrefine.export((CORNERS, TRIANGLES), "bop", tmp_path / "models_info.json", found=box)
    assert [*package.files] == [tmp_path / "models_info.json"]
    assert len(json.loads((tmp_path / "models_info.json").read_text())["1"]["symmetries_discrete"]) == 3
    assert symrefine.report(box, tmp_path / "box.json") is box
    assert json.loads((tmp_path / "box.json").read_text())["point_group"] == "D2h"
    with pytest.raises(InputError, match="is C1, nothing to make symmetric"):
        symrefine.symmetrize(RNG.random((40, 3)))
    with pytest.raises(InputError, match="to is 'stl'"):
        symrefine.export(POINTS, "stl", tmp_path / "x.stl")
    with pytest.raises(InputError, match="2 coordinates; this is for objects in space"):
        symrefine.export(RNG.random((40, 2)), "bop", tmp_path / "y.json")
    assert not (tmp_path / "y.json").exists()


@pytest.mark.parametrize(
    ("excess", "at_least", "said"),
    [
        (1.44, False, "a mirror plane, misses by 1.4 times what a tolerance of 2 % allows: choose a larger tolerance"),
        (1.44, True, "times what a tolerance of 2 % allows; parts of the surface were not seen: choose"),
        (0.8, False, "2 % allows, more than objects mostly do that are meant to have it: choose"),
        (np.inf, False, "; nothing that was seen tells of any: choose"),
    ],
)
def test_what_has_nothing_to_make_symmetric_tells_by_how_much_the_nearest_misses(excess, at_least, said):
    odd = symrefine.detect(([[0, 0, 0], [7, 0, 0], [1.5, 3, 0], [4, -1, 2]], [[0, 2, 1], [0, 1, 3], [0, 3, 2]]))
    plane = {"kind": "plane", "direction": np.eye(3)[0], "point": np.zeros(3), "order": 1.0}
    miss = NearMiss(**plane, residual=Deviation(mean=0.0, p95=0.006, p99=0.0, max=0.1), excess=excess)
    found = replace(odd, point_group="C1", near_misses=(miss,), at_least=at_least, undetermined="")
    with pytest.raises(InputError, match=re.escape(said)):
        symrefine.symmetrize(odd.shape, found)


def test_completion_takes_a_cloud_and_what_was_found_in_it():
    made = symrefine.detect(scan())
    assert len(symrefine.complete(scan(), made).points) == len(symrefine.complete(scan()).points)
    with pytest.raises(InputError, match=r"completion is for clouds .*; this is a mesh, .*: sample points on it"):
        symrefine.complete((CORNERS, TRIANGLES))


@pytest.mark.slow
def test_what_is_made_tells_draws_and_writes_itself(found, tmp_path):
    exact, full = found["symmetrized"], found["completed"]
    assert repr(exact).splitlines()[0] == "array: D2h, made exact"
    assert repr(full).splitlines()[0].startswith("array: at least C2v, confidence")
    for made, name in ((exact, "a.ply"), (exact, "a.stl"), (full, "b.ply"), (full, "b.npz")):
        made.save(tmp_path / name)
        written = symrefine.load(tmp_path / name)
        points = made.shape.points if made is exact else made.points
        np.testing.assert_array_equal(np.unique(written.points, axis=0), np.unique(points, axis=0))
    for made in (exact, full):
        made.save(tmp_path / "c.json")
        assert (tmp_path / "c.json").read_text() == made.to_json()
        made.save(tmp_path / "c.png")
        assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
        card = made._repr_html_()
        assert "data:image/png;base64," in card
        assert "<table>" not in card
        made.save(tmp_path / "c.html")
        answer = (tmp_path / "c.html").read_text().partition("<h1>")[2].partition("<span>")[0]
        assert re.sub("<[^>]*>|At least", "", answer).strip() == made.detection.point_group
        with pytest.raises(InputError, match=r"c\.rrd: a \w+ cannot be written as \.rrd; expected a name"):
            made.save(tmp_path / "c.rrd")
    with pytest.raises(InputError, match=r"a\.csv: \.csv holds no faces; write a mesh as \.npz, "):
        exact.save(tmp_path / "a.csv")
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "a.ply",
        "a.stl",
        "b.npz",
        "b.ply",
        "c.html",
        "c.json",
        "c.png",
    ]


@pytest.mark.slow
def test_a_tolerance_may_be_a_length():
    long = symrefine.detect(POINTS, tolerance="0.05u")
    assert long.tolerance == pytest.approx(0.05 / long.diagonal, rel=0.02)
    assert long.to_dict()["options"]["tolerance"] == "0.05u"
    told = {"tolerance": "50mm", "units": "m"}
    for given in (told, {"tolerance": 0.05 / long.diagonal}):
        answer = symrefine.detect(POINTS, **given)
        assert answer.tolerance == pytest.approx(long.tolerance, rel=0.02)
        assert answer.to_dict()["options"].items() >= given.items()
        assert symrefine.symmetrize((CORNERS, TRIANGLES), **given).group.name == "D2h"
        assert symrefine.complete(scan(), **given).options.items() >= given.items()
        assert symrefine.align(POINTS, POINTS, **given).options.items() >= given.items()
    assert symrefine.detect(molecule("ase"), tolerance="0.1A").point_group == "C2v"
    with pytest.raises(InputError, match="does not say its unit, which tolerance 5mm needs; give it as units"):
        symrefine.detect(POINTS, tolerance="5mm")
    with pytest.raises(InputError, match="'mm', for a tolerance with a unit"):
        symrefine.detect(POINTS, units="mm")
    with pytest.raises(InputError, match=r"'5 %' is not a length above 0 with its unit"):
        symrefine.detect(POINTS, tolerance="5 %")


def test_an_alignment_says_how_sure_it_is(found):
    answer = found["alignment"]
    assert answer.confidence > 0.9
    assert answer.to_dict()["confidence"] == pytest.approx(answer.confidence)
    unlike = symrefine.align(POINTS, revolved())
    assert unlike.confidence < 0.1
    assert unlike.status != "ok"


@pytest.mark.parametrize("given", ["cup.ply", Path("cup.ply"), POINTS], ids=["text", "path", "array"])
def test_names_of_what_is_in_a_file_are_for_reading_it(given):
    file = "FILE" if given is POINTS else "cup.ply"
    call = f"symrefine.detect(symrefine.load('{file}', labels='color'))"
    with pytest.raises(InputError, match=re.escape("labels is 'color', a name; ")) as refused:
        symrefine.detect(given, labels="color")
    assert str(refused.value).endswith(call)
    with pytest.raises(InputError, match="weights is 'mass', a name"):
        symrefine.detect(given, weights="mass")


def test_an_answer_that_is_no_such_file_is_told_with_its_article(found, tmp_path):
    with pytest.raises(InputError, match=r"x\.stl: an Alignment cannot be written as \.stl"):
        found["alignment"].save(tmp_path / "x.stl")
    with pytest.raises(InputError, match=r"x\.stl: a Detection cannot be written as \.stl"):
        found["detection"].save(tmp_path / "x.stl")


def test_one_object_is_aligned_with_several(tmp_path):
    np.savetxt(tmp_path / "a.xyz", POINTS[::2])
    turned = POINTS[1::2] @ [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    targets = [tmp_path / "a.xyz", turned, (CORNERS, TRIANGLES), symrefine.Shape(POINTS[:900])]
    every = symrefine.align(POINTS, targets)
    assert [answer.target.source for answer in every] == [str(targets[0]), "target 1", "target 2", "array"]
    for answer, target in zip(every, targets, strict=True):
        np.testing.assert_array_equal(answer.matrix, symrefine.align(POINTS, target).matrix)
    with pytest.raises(InputError, match="target 1: "):
        symrefine.align(POINTS, [POINTS, np.zeros((4, 7, 3))])


ONE_OBJECT = {
    "rows": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]],
    "tuples": [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)],
    "rows of numpy": list(CORNERS),
    "a mesh": (CORNERS, TRIANGLES),
}


@pytest.mark.parametrize("target", ONE_OBJECT.values(), ids=ONE_OBJECT)
def test_a_list_of_rows_is_one_object(target):
    assert isinstance(symrefine.align(target, target), symrefine.Alignment)


@pytest.mark.parametrize("empty", [[], ()])
def test_an_empty_list_is_told_by_the_name_of_its_argument(empty):
    told = f"is an empty {type(empty).__name__}; expected a path, points"
    with pytest.raises(InputError, match=f"target: {told}"):
        symrefine.align(POINTS, empty)
    with pytest.raises(InputError, match=f"source: {told}"):
        symrefine.align(empty, POINTS)
    with pytest.raises(InputError, match=f"target 1: {told}"):
        symrefine.align(POINTS, [POINTS, empty])


UNNAMED = {
    "load": lambda _: symrefine.load(""),
    "load_frames": lambda _: symrefine.load_frames(""),
    "load_depth": lambda _: symrefine.load_depth("", (1, 1, 1, 1)),
    "stream": lambda _: symrefine.stream(""),
    "save": lambda found: found.save(""),
    "report": lambda found: symrefine.report(found, ""),
    "export": lambda found: symrefine.export(found.shape, "dope", "", found=found),
}


@pytest.mark.parametrize("use", UNNAMED.values(), ids=UNNAMED)
def test_an_empty_name_is_no_name_of_this_directory(use, found, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="the name of the file is empty; expected a path"):
        use(found["detection"])
    assert not any(tmp_path.iterdir())


API = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
DOCUMENTED = re.findall(r"^::: (\S+)\.(\w+)$", API, re.MULTILINE)
KINDS = [kind for home, name in DOCUMENTED if is_dataclass(kind := getattr(import_module(home), name))]


@pytest.mark.parametrize("kind", KINDS)
def test_what_people_hold_says_that_it_cannot_be_changed(kind):
    held = object.__new__(kind)
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'remark'"):
        held.remark = "mine"
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'remark'"):
        del held.remark


def test_the_front_page_shows_promises_only():
    assert dir(symrefine) == sorted(symrefine.__all__)
    assert not [name for name in dir(symrefine) if name.startswith("_") and name != "__version__"]
    assert all(getattr(symrefine, name) is not None for name in dir(symrefine))


def test_schemas_stand_beside_the_code():
    assert {p.name.split(".")[0] for p in Path(str(files("symrefine"))).glob("schema/*.json")} == {
        "detection", "detection2d", "detection_nd", "alignment", "alignments", "symmetrized", "completed", "info",
        "decisions", "labels",
    }  # fmt: skip


def test_complex_numbers_are_refused_in_one_line() -> None:
    with pytest.raises(symrefine.InputError, match="they are complex"):  # and no warning of numpy's beside it
        symrefine.detect(np.ones((4, 2)) * 1j)
