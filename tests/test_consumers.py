"""Exports read back by the rules of those who read them, in the order in which those do it."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML
from scipy.spatial import cKDTree

import symrefine
from symrefine.cli import invoke
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.export.bop import bop_entry
from symrefine.export.canonical import canonical_pose
from symrefine.export.models import check_suffix, model_bytes, moved
from symrefine.export.packages import canonical_package, consumer_package, npz_package
from symrefine.geometry import Array, random_orthogonal, rotation
from symrefine.groups import PointGroup, is_subgroup, point_group
from symrefine.groups.standard import standard_operations
from symrefine.load import load
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape

FINITE = ["C1", "Cs", "Ci", "C2", "C3", "C5", "C6v", "C3h", "S4", "S6", "D2", "D3", "D6h", "D24h", "D3d", "D2d"]
FINITE += ["T", "Td", "Th", "O", "Oh", "I", "Ih"]
ROUND = ["Cinfv", "Dinfh"]
Reader = Callable[[Path], Array]


@pytest.fixture(scope="module")
def some() -> Detection:
    return detect(Shape(points=np.random.default_rng(0).standard_normal((12, 3))))


class Thing:
    """An object with a group exactly, somewhere, in some unit: surfaces of revolution consist of rings of points."""

    def __init__(self, name: str, seed: int = 0) -> None:
        rng = np.random.default_rng([seed, *name.encode()])
        self.group = point_group(name, random_orthogonal(rng))
        finite = self.group if self.group.is_finite else self.group.sampled(36)
        self.scale = 10.0 ** rng.uniform(-2.0, 3.0)
        self.center = self.scale * rng.uniform(-5.0, 5.0, 3)
        seeds = rng.uniform(0.1, 1.0, (5, 3)) * [1.0, 0.8, 0.6]
        local = np.einsum("kij,mj->kmi", finite.operations(), seeds @ self.group.frame).reshape(-1, 3)
        self.shape = Shape(points=self.center + self.scale * local, source=name)

    def found(self, some: Detection) -> Detection:
        return replace(some, group=self.group, point_group=self.group.name, center=self.center, undetermined="")


# --- the rules of the readers -----------------------------------------------------------------------------------------


def motion(matrix: Array, shift: Any = (0.0, 0.0, 0.0)) -> Array:
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = matrix, shift
    return full


def euler(x: float, y: float, z: float) -> Array:
    """Turns about the fixed axes x, then y, then z ("sxyz")."""
    return rotation([0, 0, 1], z) @ rotation([0, 1, 0], y) @ rotation([1, 0, 0], x)


def read_by_bop(entry: dict[str, Any], max_sym_disc_step: float) -> Array:
    """Millimetres; every discrete one, identity first, is followed by every turn about every axis through its point."""
    discrete = [np.eye(4), *(np.reshape(m, (4, 4)) for m in entry.get("symmetries_discrete", []))]
    steps = math.ceil(math.pi / max_sym_disc_step)
    turns = []
    for axis in entry.get("symmetries_continuous", []):
        for k in range(steps):
            turn, point = rotation(axis["axis"], 2.0 * math.pi * k / steps), np.array(axis["offset"])
            turns.append(motion(turn, point - turn @ point))
    return np.array([t @ d for d in discrete for t in turns] if turns else discrete)


def read_by_foundationpose(entry: dict[str, Any]) -> Array:
    """Metres; discrete ones, then the first axis by its first positive component, its offset as a translation."""
    found = [np.eye(4)]
    metres = np.array([[1, 1, 1, 0.001]] * 3 + [[1, 1, 1, 1]])
    found += [given * metres for given in np.array(entry.get("symmetries_discrete", [])).reshape(-1, 4, 4)]
    for axis in entry.get("symmetries_continuous", [])[:1]:
        where = next(k for k, a in enumerate(axis["axis"]) if a > 0)
        turns = [np.eye(3)[where] * angle for angle in np.deg2rad(np.arange(0, 360, 5))]
        found += [motion(euler(*turn), axis["offset"]) for turn in turns]
    return np.array(found)


def read_by_megapose(entry: dict[str, Any], calls: int = 2) -> Array:
    """Metres; axes through the origin with components of sum 1 only; each call scales the translations once more."""
    discrete = np.array(entry.get("symmetries_discrete", [])).reshape(-1, 4, 4)
    for _ in range(calls):
        discrete[:, :3, 3] *= 0.001
    turns = []
    for axis in entry.get("symmetries_continuous", []):
        assert np.allclose(axis["offset"], 0)
        assert np.array(axis["axis"]).sum() == 1
        turns += [motion(euler(*(np.array(axis["axis"]) * 2.0 * math.pi * k / 64))) for k in range(64)]
    every = [np.eye(4), *discrete]
    return np.array([t @ d for d in every for t in turns] if turns else every)


def read_by_dope(entry: dict[str, Any]) -> Array:
    """As BOP with 64 turns; translations end up in the last row, so there must be none."""
    found = read_by_bop(entry, math.pi / 64)
    assert np.abs(found[:, :3, 3]).max() == 0.0
    return found


def read_by_isaac(text: str) -> Array:
    """Names axis_angle or axis_full (30 degrees); all products Rz Ry Rx of what is listed for each axis, and 0."""
    listed: dict[str, list[float]] = {"x": [0.0], "y": [0.0], "z": [0.0]}
    for name in YAML(typ="safe", pure=True).load(text)["/**"]["ros__parameters"].get("symmetry_axes", []):
        axis, angle = name.split("_")
        listed[axis] += list(range(0, 360, 30)) if angle == "full" else [float(np.float32(angle))]
    angles = {axis: np.deg2rad(values) for axis, values in listed.items()}
    return np.array([motion(euler(x, y, z)) for x in angles["x"] for y in angles["y"] for z in angles["z"]])


def entry_in(path: Path, number: int = 1) -> dict[str, Any]:
    entry: dict[str, Any] = json.loads(path.read_text())[str(number)]
    return entry


READERS: dict[str, Reader] = {
    "foundationpose": lambda folder: read_by_foundationpose(entry_in(folder / "models_info.json")),
    "megapose": lambda folder: read_by_megapose(entry_in(folder / "models_info.json")),
    "dope": lambda folder: read_by_dope(json.loads((folder / "model_info.json").read_text())),
    "isaac": lambda folder: read_by_isaac((folder / "symmetry_axes.yaml").read_text()),
}
MODELS = {"foundationpose": "obj_000001.ply", "megapose": "obj_000001.ply", "dope": "model.obj", "isaac": "model.obj"}


def distinct(motions: Array) -> int:
    return len(np.unique(np.round(motions[:, :3, :3].reshape(-1, 9), 5) + 0.0, axis=0))


def misses(points: Array, motions: Array) -> float:
    """Largest distance of a moved point to the points, over their size."""
    tree, size = cKDTree(points), np.linalg.norm(np.ptp(points, axis=0))
    return max(tree.query(points @ m[:3, :3].T + m[:3, 3])[0].max() for m in motions) / size


def ring_misses(points: Array, motions: Array) -> float:
    """The same for a surface of revolution about z, which its radii and heights describe."""

    def profile(p: Array) -> Array:
        return np.column_stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]])

    tree, size = cKDTree(profile(points)), np.linalg.norm(np.ptp(points, axis=0))
    return max(tree.query(profile(points @ m[:3, :3].T + m[:3, 3]))[0].max() for m in motions) / size


# --- every group, every reader ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FINITE)
def test_each_reader_gets_the_rotations_that_leave_the_model_unchanged(
    some: Detection, tmp_path: Path, name: str
) -> None:
    thing = Thing(name)
    order = int(thing.group.proper_subgroup().order)
    expected = {"isaac": {"T": 4, "Td": 4, "Th": 4, "I": 10, "Ih": 10}.get(name, order)}
    for consumer, read in READERS.items():
        (tmp_path / consumer).mkdir()
        package = consumer_package(
            consumer, tmp_path / consumer, thing.found(some), thing.shape, number=1, scale=1000.0 / thing.scale
        )
        for path, content in package.files.items():
            path.write_bytes(content)
        motions = read(tmp_path / consumer)
        model = load(tmp_path / consumer / MODELS[consumer]).points
        # All of these models are about 1 m large, in metres or in millimetres.
        model = model / (1000.0 if consumer in ("foundationpose", "megapose") else 1.0)
        assert 0.5 < np.linalg.norm(np.ptp(model, axis=0)) < 4.0
        assert distinct(motions) == expected.get(consumer, order)
        assert misses(model, motions) < 1e-7
        left_out = [note for note in package.notes if "rotations left out" in note]
        assert bool(left_out) is (distinct(motions) < order)
        assert any("determinant -1" in note for note in package.notes) is not thing.group.is_chiral


@pytest.mark.parametrize("name", ROUND)
def test_each_reader_turns_a_surface_of_revolution(some: Detection, tmp_path: Path, name: str) -> None:
    thing = Thing(name)
    for consumer, steps in {"foundationpose": 72, "megapose": 64, "dope": 64, "isaac": 12}.items():
        (tmp_path / consumer).mkdir()
        package = consumer_package(consumer, tmp_path / consumer, thing.found(some), thing.shape, number=1, scale=1.0)
        for path, content in package.files.items():
            path.write_bytes(content)
        motions = READERS[consumer](tmp_path / consumer)
        assert distinct(motions) == steps * (2 if name == "Dinfh" else 1)
        model = load(tmp_path / consumer / MODELS[consumer]).points
        model = model / (1000.0 if consumer in ("foundationpose", "megapose") else 1.0)
        assert ring_misses(model, motions) < 1e-7


def test_a_sphere_is_told_to_be_more_than_any_of_them_reads(some: Detection, tmp_path: Path) -> None:
    thing = Thing("Kh")
    for consumer, read in READERS.items():
        (tmp_path / consumer).mkdir()
        package = consumer_package(consumer, tmp_path / consumer, thing.found(some), thing.shape, number=1, scale=1.0)
        for path, content in package.files.items():
            path.write_bytes(content)
        assert any("sphere" in note for note in package.notes)
        assert distinct(read(tmp_path / consumer)) > 60


@pytest.mark.parametrize("name", [*FINITE, *ROUND])
def test_bop_reads_the_same_in_the_frame_of_the_file(some: Detection, name: str) -> None:
    thing = Thing(name, seed=1)
    scale = 7.0 / thing.scale
    motions = read_by_bop(bop_entry(thing.found(some), thing.shape, scale=scale), 0.05)
    points = scale * thing.shape.points
    if thing.group.is_finite:
        assert distinct(motions) == len(motions) == thing.group.proper_subgroup().order
        assert misses(points, motions) < 1e-9
        return
    assert distinct(motions) == len(motions) == 63 * (2 if name == "Dinfh" else 1)
    turned = (points - scale * thing.center) @ thing.group.frame.T
    frame = motion(thing.group.frame, -thing.group.frame @ thing.center * scale)
    assert ring_misses(turned, frame @ motions @ np.linalg.inv(frame)) < 1e-9


@pytest.mark.parametrize("name", ["C2", "C6v", "S4", "D2", "D3", "D6h", "T", "O", "I", "Cinfv", "Dinfh"])
def test_dope_chooses_one_pose_of_all_that_look_the_same(some: Detection, tmp_path: Path, name: str) -> None:
    """Its rule: the first pair of axes as parallel as can be, among equals the second one."""
    thing, rng = Thing(name), np.random.default_rng(7)
    package = consumer_package("dope", tmp_path, thing.found(some), thing.shape, number=1, scale=1.0)
    info = json.loads(package.files[tmp_path / "model_info.json"])
    turns = read_by_dope(info)[:, :3, :3]

    def chosen(pose: Array) -> Array:
        poses = pose @ turns
        for pair in info["align_axes"]:
            along = poses @ np.array(pair["object"]) @ np.array(pair["camera"])
            poses = poses[along >= along.max() - 1e-6]
        return poses

    for _ in range(10):
        pose = random_orthogonal(rng)
        best = chosen(pose)
        assert len(best) == 1
        for same in turns[:: max(1, len(turns) // 6)]:
            np.testing.assert_allclose(chosen(pose @ same), best, atol=1e-6)


@pytest.mark.parametrize("name", ["C5", "C6v", "S6", "D3d", "Oh", "Ih"])
@pytest.mark.parametrize("improper", [False, True])
def test_matrices_hold_every_operation_in_the_frame_of_the_file(
    some: Detection, tmp_path: Path, name: str, improper: bool
) -> None:
    thing = Thing(name)
    out = tmp_path / "s.npz"
    package = npz_package(out, thing.found(some), thing.shape, improper=improper, steps=72)
    out.write_bytes(package.files[out])
    with np.load(out) as archive:
        motions, determinant = archive["symmetry_tfs"], archive["determinant"]
        assert str(archive["point_group"]) == name
    group = thing.group if improper else thing.group.proper_subgroup()
    assert len(motions) == distinct(motions) == group.order
    np.testing.assert_allclose(np.linalg.det(motions[:, :3, :3]), determinant, atol=1e-9)
    assert (determinant > 0).sum() == thing.group.proper_subgroup().order
    np.testing.assert_allclose(motions[0], np.eye(4), atol=1e-12 * np.abs(thing.center).max())
    assert misses(thing.shape.points, motions) < 1e-9
    assert npz_package(out, thing.found(some), thing.shape, improper=improper, steps=72).files == package.files


def test_a_continuous_axis_is_given_by_as_many_turns_as_asked_for(some: Detection, tmp_path: Path) -> None:
    thing = Thing("Dinfh")
    package = npz_package(tmp_path / "s.npz", thing.found(some), thing.shape, improper=False, steps=18)
    (tmp_path / "s.npz").write_bytes(package.files[tmp_path / "s.npz"])
    with np.load(tmp_path / "s.npz") as archive:
        assert archive["symmetry_tfs"].shape == (36, 4, 4)
    assert any("18 turns" in note for note in package.notes)


# --- canonical poses --------------------------------------------------------------------------------------------------


def equal_placements(group: PointGroup) -> list[PointGroup]:
    """The same group with other frames: z upside down, x on another mirror, the cube axes exchanged."""
    fold = max(1, int(group.symbol.fold)) if group.is_finite else 1
    about_z = [rotation([0, 0, 1], math.pi * k / fold) for k in range(2 * fold)] + [rotation([0, 0, 1], 0.7)]
    turns = [
        *about_z,
        *(rotation([1, 0, 0], math.pi) @ t for t in about_z),
        *standard_operations(point_group("O").symbol),
    ]
    every = [PointGroup(name=group.name, frame=t @ group.frame) for t in turns]
    return [other for other in every if is_subgroup(other, group) and is_subgroup(group, other)]


@pytest.mark.parametrize("name", [n for n in FINITE if n not in ("C1", "Ci")])
def test_a_canonical_pose_does_not_depend_on_the_pose_or_the_frame(name: str) -> None:
    thing = Thing(name)
    rng = np.random.default_rng(2)
    reference = canonical_pose(thing.group, thing.center, thing.shape)
    points = reference.apply(thing.shape.points)
    size = np.linalg.norm(np.ptp(points, axis=0))
    placements = equal_placements(thing.group)
    assert len(placements) > 1
    for other in placements:
        turn, shift = random_orthogonal(rng), size * rng.uniform(-3, 3, 3)
        moved_shape = Shape(points=thing.shape.points @ turn.T + shift)
        group = PointGroup(name=name, frame=other.frame @ turn.T)
        pose = canonical_pose(group, turn @ thing.center + shift, moved_shape)
        assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
        assert cKDTree(points).query(pose.apply(moved_shape.points))[0].max() < 1e-6 * size


@pytest.mark.parametrize("name", [*FINITE, *ROUND])
def test_a_canonical_model_has_its_group_in_standard_placement(name: str) -> None:
    thing = Thing(name, seed=3)
    pose = canonical_pose(thing.group, thing.center, thing.shape)
    points = pose.apply(thing.shape.points)
    if name in ROUND:
        ring = [motion(rotation([0, 0, 1], a)) for a in (0.3, 1.7)]
        assert ring_misses(points, np.array(ring)) < 1e-9
    else:
        # Icosahedral groups stand on a five-fold axis, with a two-fold one on x.
        up = {"I": "D5", "Ih": "D5d"}.get(name, name)
        found = standard_operations(point_group(up).symbol)
        if name == "Ih":  # D5d has its two-fold axes on x as D5 has
            found = found[np.linalg.det(found) > 0]
        assert misses(points, np.array([motion(g) for g in found])) < 1e-9
        np.testing.assert_allclose(pose.group.distance_rad(found), 0.0, atol=1e-6)
    box = 0.5 * (points.min(axis=0) + points.max(axis=0))
    free = {"C1": [0, 1, 2], "Cs": [0, 1], "C2": [2], "C3": [2], "C5": [2], "C6v": [2], "Cinfv": [2]}.get(name, [])
    assert np.abs(box[free]).max(initial=0.0) < 1e-9 * np.linalg.norm(np.ptp(points, axis=0))


def test_a_cup_stands_the_same_way_up_however_it_was_given() -> None:
    rng = np.random.default_rng(1)
    angle, height = rng.uniform(0, 2 * math.pi, 4000), rng.uniform(0, 1, 4000)
    cup = np.column_stack([np.cos(angle) * (0.3 + height), np.sin(angle) * (0.3 + height), 2.0 * height])
    tops = []
    for sign in (1.0, -1.0):
        frame = np.diag([1.0, sign, sign])
        points = canonical_pose(point_group("Cinfv", frame), np.zeros(3), Shape(points=cup)).apply(cup)
        tops.append(np.hypot(*points[points[:, 2] > 0.9, :2].T).mean())
    assert tops[0] == pytest.approx(tops[1])


# --- files ------------------------------------------------------------------------------------------------------------

PLY = """ply
format {kind} 1.0
comment painted
element vertex 4
property float x
property float y
property float z
property uchar red
property float nx
property float ny
property float nz
element face 1
property list uchar int vertex_indices
property float quality
end_header
"""
ROWS = [
    (0.0, 0.0, 0.0, 7, 0, 0, 1),
    (2.0, 0.0, 0.0, 8, 0, 0, 1),
    (2.0, 1.3, 0.0, 9, 0, 0, 1),
    (0.0, 1.0, 0.0, 10, 0, 0, 1),
]
OBJ = "# a square\r\nmtllib paint.mtl\r\nv 0 0 0 0.5 0.25 1\r\nv 2 0 0 1 1 1\r\nv 2 1 0 1 1 1\r\n"
OBJ += "v 0 1 0 1 1 1\r\nvt 0 1\r\nvn 0 0 1\r\n"
OBJ += "usemtl red\r\nf 1/1/1 2/1/1 3/1/1 4/1/1\r\n"
MATRIX = motion(2.0 * rotation([1.0, 2.0, 3.0], 0.8), [5.0, -1.0, 2.0])


def square(kind: str) -> bytes:
    head = PLY.format(kind=kind).encode()
    if kind == "ascii":
        return head + b"".join(" ".join(map(str, row)).encode() + b"\n" for row in ROWS) + b"4 0 1 2 3 0.5\n"
    order = "<" if "little" in kind else ">"
    rows = np.array(
        ROWS, dtype=[(n, order + "f4") if n != "c" else (n, "u1") for n in ("x", "y", "z", "c", "a", "b", "d")]
    )
    face = np.array([(4, [0, 1, 2, 3], 0.5)], dtype=[("n", "u1"), ("v", order + "i4", 4), ("q", order + "f4")])
    return head + rows.tobytes() + face.tobytes()


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_only_the_coordinates_of_a_ply_file_change(tmp_path: Path, kind: str) -> None:
    data = square(kind)
    changed = moved(data, ".ply", MATRIX)
    assert changed is not None
    before, after = tmp_path / "a.ply", tmp_path / "b.ply"
    before.write_bytes(data)
    after.write_bytes(changed)
    expected = load(before).points @ MATRIX[:3, :3].T + MATRIX[:3, 3]
    np.testing.assert_allclose(load(after).points, expected, rtol=1e-6)
    np.testing.assert_array_equal(load(after).faces, load(before).faces)
    back = moved(changed, ".ply", np.linalg.inv(MATRIX))
    assert back is not None
    assert back.split(b"end_header")[0] == data.split(b"end_header")[0]
    if kind == "ascii":
        words = [line.split() for line in changed.decode().splitlines()[15:19]]
        assert [w[3] for w in words] == ["7", "8", "9", "10"]
        normal = np.array(words[0][4:], dtype=float)
        np.testing.assert_allclose(normal, MATRIX[:3, 2] / 2.0, rtol=1e-6)
        assert changed.endswith(b"4 0 1 2 3 0.5\n")


def test_only_the_coordinates_of_an_obj_file_change(tmp_path: Path) -> None:
    changed = moved(OBJ.encode(), ".obj", MATRIX)
    assert changed is not None
    before, after = OBJ.splitlines(), changed.decode().splitlines()
    same = [k for k, line in enumerate(before) if line.split()[0] not in ("v", "vn")]
    assert [before[k] for k in same] == [after[k] for k in same]
    assert after[2].endswith("0.5 0.25 1")
    np.testing.assert_allclose(np.array(after[7].split()[1:], dtype=float), MATRIX[:3, 2] / 2.0)
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "b.obj").write_bytes(changed)
    expected = load(tmp_path / "a.obj").points @ MATRIX[:3, :3].T + MATRIX[:3, 3]
    np.testing.assert_allclose(load(tmp_path / "b.obj").points, expected, atol=1e-14)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".npz", ".stl"])
def test_a_mesh_is_written_whole(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    mesh = Shape(
        points=rng.standard_normal((5, 3)), faces=np.array([[0, 1, 2], [2, 1, 4], [0, 3, 4]]), measure="surface"
    )
    path = tmp_path / f"m{suffix}"
    path.write_bytes(model_bytes(path.suffix, mesh))
    again = load(path)
    np.testing.assert_array_equal(again.points[again.faces], mesh.points[mesh.faces])
    if suffix != ".stl":  # which has the corners of each triangle
        np.testing.assert_array_equal(again.points, mesh.points)


@pytest.mark.parametrize("suffix", [".csv", ".txt", ".npy", ".pcd", ".off"])
def test_bare_points_are_written_whole(tmp_path: Path, suffix: str) -> None:
    cloud = Shape(points=np.random.default_rng(0).standard_normal((9, 3)))
    path = tmp_path / f"m{suffix}"
    path.write_bytes(model_bytes(suffix, cloud))
    np.testing.assert_array_equal(load(path).points, cloud.points)


def test_atoms_keep_their_elements(tmp_path: Path) -> None:
    path, out = tmp_path / "a.xyz", tmp_path / "b.xyz"
    path.write_text(
        "4\nammonia, one hydrogen heavy\nN 0 0 0.1\nH 0.94 0 -0.28\nH -0.47 0.81 -0.27\nD -0.47 -0.81 -0.27\n"
    )
    assert invoke(["symmetrize", str(path), "-o", str(out), "--tolerance", "0.1A"]) == 0
    assert [line.split()[0] for line in out.read_text().splitlines() if line] == ["4", "N", "H", "H", "D"]
    assert load(out).labels.tolist() == load(path).labels.tolist()


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".xyz", ".npz", ".csv", ".pcd"])
def test_a_cloud_keeps_its_normals(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    cloud = Shape(points=rng.standard_normal((9, 3)), normals=rng.standard_normal((9, 3)))
    path = tmp_path / f"m{suffix}"
    path.write_bytes(model_bytes(path.suffix, cloud))
    again = load(path)
    np.testing.assert_array_equal(again.points, cloud.points)
    assert again.normals is not None
    np.testing.assert_allclose(again.normals, cloud.normals, atol=1e-15)


def test_what_a_format_cannot_hold_is_refused() -> None:
    rng = np.random.default_rng(0)
    points = rng.standard_normal((5, 3))
    mesh = Shape(points=points, faces=np.array([[0, 1, 2]]), measure="surface")
    for name, shape, word in [
        ("a.glb", mesh, "cannot write .glb; known are"),
        ("a.xyz", mesh, "holds no faces; write a mesh as"),
        ("a.pcd", mesh, "holds no faces"),
        ("a.stl", Shape(points=points), "holds nothing but faces; write a cloud as"),
        ("a.txt", Shape(points=points, normals=points), "holds no normals"),
        ("a.ply", Shape(points=points, weights=np.arange(5.0)), "holds no weights"),
        ("a.npy", Shape(points=points, normals=points), "holds no normals"),
    ]:
        with pytest.raises(InputError, match=word):
            check_suffix(Path(name), shape)


def test_what_was_undecided_or_is_c1_is_refused(some: Detection, tmp_path: Path) -> None:
    thing = Thing("C1")
    out = tmp_path / "a.ply"
    with pytest.raises(InputError, match="C1"):
        canonical_package(out, thing.found(some), thing.shape, transform=tmp_path / "a.json")
    doubtful = replace(thing.found(some), undetermined="too few points")
    for write in (
        lambda: canonical_package(out, doubtful, thing.shape, transform=tmp_path / "a.json"),
        lambda: npz_package(out, doubtful, thing.shape, improper=False, steps=8),
        lambda: consumer_package("isaac", tmp_path, doubtful, thing.shape, number=1, scale=1.0),
    ):
        with pytest.raises(InputError, match="too few points"):
            write()


# --- from the file to the reader, by the command ----------------------------------------------------------------------


def prism(sides: int, top: float = 1.0) -> Shape:
    """A prism, or a truncated pyramid if `top` is not 1, as a mesh."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([ring, np.zeros(sides)]), np.column_stack([top * ring, np.full(sides, 1.5)])])
    points = np.vstack([points, [0, 0, 0], [0, 0, 1.5]])
    faces = []
    for k in range(sides):
        n = (k + 1) % sides
        faces += [
            [k, n, sides + k],
            [n, sides + n, sides + k],
            [n, k, 2 * sides],
            [sides + k, sides + n, 2 * sides + 1],
        ]
    return Shape(points=points, faces=np.array(faces), measure="surface")


def placed(tmp_path: Path, shape: Shape, seed: int, name: str = "part.ply") -> Path:
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-2, 2)
    points = scale * (shape.points @ random_orthogonal(rng).T + rng.uniform(-2, 2, 3))
    path = tmp_path / name
    path.write_bytes(model_bytes(path.suffix, replace(shape, points=points)))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sides", "top", "group", "order"), [(6, 1.0, "D6h", 12), (5, 0.6, "C5v", 5), (96, 1.0, "Dinfh", 0)]
)
@pytest.mark.parametrize("consumer", list(READERS))
def test_the_command_writes_what_the_reader_can_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sides: int, top: float, group: str, order: int, consumer: str
) -> None:
    path, out = placed(tmp_path, prism(sides, top), sides), tmp_path / "out"
    size = float(np.linalg.norm(np.ptp(load(path).points, axis=0)))
    line = ["export", str(path), "--to", consumer, "--out", str(out), "--scale", repr(1000.0 / size)]
    assert invoke(line) == 0
    shown = capsys.readouterr()
    assert f": {group}\n" in shown.out
    assert "determinant -1" in shown.err
    model = load(out / MODELS[consumer])
    np.testing.assert_array_equal(model.faces, load(path).faces)
    motions = READERS[consumer](out)
    points = model.points / (1000.0 if consumer in ("foundationpose", "megapose") else 1.0)
    assert 0.4 < np.linalg.norm(np.ptp(points, axis=0)) < 2.0
    if order:
        assert distinct(motions) == order
        assert misses(points, motions) < 1e-12
    else:
        assert ring_misses(points, motions) < 2e-3  # it has 96 sides


def test_a_shape_that_has_the_name_of_a_file_is_written_as_it_is(tmp_path: Path) -> None:
    """What is made of the shape in a file is called after it, and is no longer what stands in there."""
    given, out = load(placed(tmp_path, prism(5, 0.6), 3)), tmp_path / "c.ply"
    assert given.faces is not None
    for shape in (replace(given, points=2.0 * given.points), replace(given, faces=given.faces[::-1])):
        package = symrefine.export(shape, "canonical", out)
        matrix = np.array(json.loads(package.files[tmp_path / "c_transform.json"])["transform"])
        expected = shape.points @ matrix[:3, :3].T + matrix[:3, 3]
        np.testing.assert_allclose(load(out).points, expected, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_array_equal(load(out).faces, shape.faces)


def test_a_model_without_its_floor_is_written_without_it(tmp_path: Path) -> None:
    rng, part = np.random.default_rng(0), sample_surface(prism(5, 0.6), 8000, np.random.default_rng(1))[0]
    floor = np.column_stack([rng.uniform(-3.0, 3.0, (8000, 2)), np.zeros(8000)])
    path = tmp_path / "scan.ply"
    path.write_bytes(model_bytes(".ply", Shape(points=np.concatenate([part[part[:, 2] > 0.02], floor]))))
    line = ["export", str(path), "--to", "megapose", "--out", str(tmp_path / "out"), "--outliers", "floor"]
    assert invoke(line) == 0
    assert np.linalg.norm(load(tmp_path / "out" / "obj_000001.ply").points, axis=1).max() < 2.0


@pytest.mark.parametrize("to", ["bop", "npz", "canonical", "dope"])
def test_a_name_of_nothing_is_refused(tmp_path: Path, to: Any) -> None:
    with pytest.raises(InputError, match="is no name of a file"):
        symrefine.export(prism(5), to, tmp_path / "a\0b")


@pytest.mark.parametrize(("option", "group"), [("labels", "C2v"), ("weights", "C2v"), ("", "D2h")])
def test_what_tells_points_apart_counts_in_an_export(tmp_path: Path, option: str, group: str) -> None:
    path, out = tmp_path / "box.csv", tmp_path / "box.npz"
    box = [(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]
    rows = [f"{x},{y},{z},{2 + x}" if option else f"{x},{y},{z}" for x, y, z in box]
    path.write_text("\n".join(["x,y,z,which" if option else "x,y,z", *rows]))
    words = [f"--{option}", "which"] if option else []
    assert invoke(["export", str(path), "--to", "npz", "--out", str(out), *words]) == 0
    with np.load(out) as archive:
        assert str(archive["point_group"]) == group


def test_where_the_camera_stood_counts_in_an_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, points = tmp_path / "ball.npy", np.random.default_rng(0).standard_normal((4000, 3))
    np.save(path, points / np.linalg.norm(points, axis=1, keepdims=True))
    line = ["export", str(path), "--to", "npz", "--out", str(tmp_path / "ball.npz"), "--viewpoint"]
    assert invoke([*line, "0,0,9"]) == 2
    assert "cannot have been seen from the viewpoint given" in capsys.readouterr().err


@pytest.mark.parametrize(("suffix", "count"), [(".ply", 1), (".stl", 0)])
def test_what_a_file_may_have_had_is_told_where_it_may(tmp_path: Path, suffix: str, count: int) -> None:
    path = placed(tmp_path, prism(3, 0.5), 4, f"part{suffix}")
    for given, told in ((path, count), (replace(load(path), source="mesh"), 0)):
        assert len(symrefine.export(given, "canonical", tmp_path / "c.obj").notes) == told


def test_the_transform_takes_the_file_to_the_canonical_model(tmp_path: Path) -> None:
    path, out = placed(tmp_path, prism(3, 0.5), 4), tmp_path / "c.ply"
    assert invoke(["export", str(path), "--to", "canonical", "--out", str(out)]) == 0
    data = json.loads((tmp_path / "c_transform.json").read_text())
    assert data["point_group"] == "C3v"
    matrix = np.array(data["transform"])
    before, after = load(path), load(out)
    np.testing.assert_array_equal(before.faces, after.faces)
    size = np.linalg.norm(np.ptp(after.points, axis=0))
    np.testing.assert_allclose(before.points @ matrix[:3, :3].T + matrix[:3, 3], after.points, atol=1e-12 * size)
    np.testing.assert_allclose(matrix @ data["inverse"], np.eye(4), atol=1e-9)
    assert misses(after.points, np.array([motion(g) for g in standard_operations(point_group("C3v").symbol)])) < 1e-12
    again = tmp_path / "again.npz"
    assert invoke(["export", str(path), "--to", "canonical", "--out", str(out), "--transform", str(again)]) == 0
    with np.load(again) as archive:
        np.testing.assert_array_equal(archive["transform"], matrix)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--to megapose --out f --improper", "--improper: does not apply"),
        ("--to npz --out f.npz --scale 2", "--scale: does not apply"),
        ("--to npz --out f.json", "ends in .npz"),
        (
            "--to dope --out model.obj",
            "is the name of a model, and dope takes a folder; expected a name without suffix",
        ),
        ("--to canonical --out f.gltf", "cannot write .gltf"),
        ("--to canonical --out f.ply --transform t.txt", "ends in .json or .npz"),
        ("--to canonical --out part.ply", "same file as the input"),
        ("--to isaac --out part.ply", "is a file; expected a folder"),
        ("--to isaac --out a\0b", "is no name of a file"),
        ("--to bop --out info.ply", "--out: info.ply: has the suffix of an object; expected a name such as models_in"),
        ("--to isaac --out no/f", "there is no directory"),
        ("--to bop --out other", "is no models_info.json"),
        ("--to halcon --out f", "--to"),
        ("--to canonical --out f.json", "cannot write .json"),
        ("--to canonical --out f.npz --transform f.npz", "is the same file as that of --out"),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    placed(tmp_path, prism(5), 1)
    (tmp_path / "other").write_text("ply")
    monkeypatch.chdir(tmp_path)
    assert invoke(["export", "part.ply", *line.split()]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other", "part.ply"]


def test_a_model_is_not_written_over_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = placed(tmp_path, prism(5), 1, "obj_000001.ply")
    before = path.read_bytes()
    assert invoke(["export", str(path), "--to", "megapose", "--out", str(tmp_path)]) == 2
    assert "is the input itself" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["obj_000001.ply"]
    assert path.read_bytes() == before


@pytest.mark.slow
def test_what_others_put_into_a_folder_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A model is named by its number, which nobody typed; what export wrote itself, it writes anew."""
    shelf, part = tmp_path / "shelf", placed(tmp_path, prism(5), 1, "obj_000003.ply")
    shelf.mkdir()
    other = placed(shelf, prism(6), 2, "obj_000003.ply")
    before = other.read_bytes()
    line = ["export", str(part), "--to", "foundationpose", "--out"]
    assert invoke([*line, str(shelf)]) == 2
    assert "obj_000003.ply: is there and was not made by export" in capsys.readouterr().err
    assert ([p.name for p in shelf.iterdir()], other.read_bytes()) == ([other.name], before)
    for scale, told in (("1", ""), ("10", "models_info.json: object 3 was there"), ("10", "")):
        assert invoke([*line, str(tmp_path / "new"), "--scale", scale]) == 0
        said = capsys.readouterr().err
        assert told in said
        assert ("was there" in said) == bool(told)
    assert (tmp_path / "new" / "obj_000003.ply").is_file()
    assert sorted(json.loads((tmp_path / "new" / "models_info.json").read_text())) == ["3"]


@pytest.mark.slow
def test_an_entry_that_is_replaced_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    info = tmp_path / "models_info.json"
    one, two = placed(tmp_path, prism(5), 1, "one.ply"), placed(tmp_path, prism(6), 2, "obj_000007.ply")
    assert invoke(["detect", str(one), "--bop", str(info)]) == 0
    assert invoke(["detect", str(two), "--bop", str(info)]) == 0
    assert sorted(json.loads(info.read_text())) == ["1", "7"]
    assert "was there" not in capsys.readouterr().err
    assert invoke(["detect", str(two), "--bop", str(info), "--bop-id", "1"]) == 0
    assert "object 1 was there, of a diameter of" in capsys.readouterr().err


@pytest.mark.slow
def test_a_folder_of_models_becomes_one_models_info(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shelf, out, rows = tmp_path / "models", tmp_path / "models_info.json", tmp_path / "rows.jsonl"
    shelf.mkdir()
    placed(shelf, prism(6), 1, "obj_000001.ply")
    placed(shelf, prism(4, 0.5), 2, "obj_000012.ply")
    out.write_text(json.dumps({"7": {"diameter": 1.0}, "12": {"diameter": 0.0}}))
    line = ["batch", str(shelf), "--bop", str(out), "--bop-scale", "10", "--out", str(rows)]
    assert invoke(["batch", str(shelf), "--out", str(rows)]) == 0  # rows without entries do not stand in the way
    for _ in range(2):
        assert invoke(line) == 0
        assert "2 of 2 objects" in capsys.readouterr().out
        info = json.loads(out.read_text())
        assert sorted(info) == ["1", "12", "7"]
        for number, order in ((1, 12), (12, 4)):
            motions = read_by_bop(info[str(number)], 0.01)
            points = 10.0 * load(shelf / f"obj_{number:06d}.ply").points
            assert distinct(motions) == order
            assert misses(points, motions) < 1e-12
            assert info[str(number)]["diameter"] == pytest.approx(
                max(np.linalg.norm(points - p, axis=1).max() for p in points)
            )
    monkeypatch.chdir(tmp_path)
    placed(shelf, prism(3), 3, "mug.ply")
    assert invoke(["batch", "models", "--bop", "new.json"]) == 2
    assert "obj_000001.ply" in capsys.readouterr().err
    assert not (tmp_path / "new.json").exists()


def test_a_model_that_cannot_be_read_is_left_out_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    placed(tmp_path, prism(6), 1, "obj_000001.ply")
    (tmp_path / "obj_000002.ply").write_bytes(b"ply\n")
    out = tmp_path / "models_info.json"
    assert invoke(["batch", str(tmp_path), "--bop", str(out)]) == 1
    shown = capsys.readouterr()
    assert "1 of 2 objects" in shown.out
    assert "obj_000002.ply" in shown.err
    assert list(json.loads(out.read_text())) == ["1"]
