"""Files to shapes: what is written is read to the last digit; what cannot be read whole is refused with its place."""

import ctypes
import io
import json
import os
import pickle
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from symrefine.errors import InputError
from symrefine.load import READERS, load
from symrefine.shape import Shape

SHARED = Path(__file__).resolve().parents[2] / "shared" / "objects"

# A tetrahedron a million units away, with digits that float32 does not hold.
TETRA = np.array([[0.123456789, 0, 0], [1, 0.1, 0], [0, 1, 0.3], [0.7, 0, 1]]) + 1e6
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
NORMALS = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]])
MESHES = ("ascii.ply", "little.ply", "big.ply", "mesh.obj", "mesh.off", "ascii.stl", "mesh.npz")
CLOUDS = ("ascii.ply", "little.ply", "big.ply", "cloud.obj", "cloud.off", "cloud.xyz", "cloud.csv", "cloud.txt",
          "cloud.npz", "ascii.pcd", "binary.pcd")  # fmt: skip


def rows(table: object) -> str:
    return "".join(" ".join(map(repr, row)) + "\n" for row in np.asarray(table).tolist())


def ply_header(kind: str, vertices: int, faces: int, normals: bool = False) -> str:
    kind = {"ascii": "ascii", "little": "binary_little_endian", "big": "binary_big_endian"}[kind]
    names = "x y z nx ny nz".split() if normals else "x y z".split()
    properties = "".join(f"property double {name}\n" for name in names)
    return (
        f"ply\nformat {kind} 1.0\ncomment made by a test\nelement vertex {vertices}\n{properties}"
        f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )


def ply(kind: str, points: np.ndarray, faces: Sequence[Sequence[int]] = (), normals: np.ndarray | None = None) -> bytes:
    table = points if normals is None else np.hstack([points, normals])
    header = ply_header(kind, len(points), len(faces), normals is not None).encode()
    if kind == "ascii":
        return header + rows(table).encode() + "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in faces).encode()
    order = "<" if kind == "little" else ">"
    packed = b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    return header + table.astype(order + "f8").tobytes() + packed


def obj(points: np.ndarray, faces: Sequence[Sequence[int]] = (), normals: np.ndarray | None = None) -> bytes:
    text = "".join("v " + line + "\n" for line in rows(points).splitlines())
    if normals is not None:
        text += "".join("vn " + line + "\n" for line in rows(normals).splitlines())
    return (text + "".join("f " + " ".join(str(i + 1) for i in f) + "\n" for f in faces)).encode()


def off(points: np.ndarray, faces: Sequence[Sequence[int]] = (), normals: np.ndarray | None = None) -> bytes:
    table = points if normals is None else np.hstack([points, normals])
    body = "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in faces)
    return f"{'' if normals is None else 'N'}OFF\n{len(points)} {len(faces)} 0\n{rows(table)}{body}".encode()


def stl(points: np.ndarray, faces: Sequence[Sequence[int]]) -> bytes:
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {' '.join(map(repr, points[i].tolist()))}\n" for i in face)
        + " endloop\nendfacet\n"
        for face in faces
    )
    return f"solid test\n{facets}endsolid test\n".encode()


def pcd(kind: str, table: np.ndarray) -> bytes:
    names = "x y z normal_x normal_y normal_z".split()[: table.shape[1]]
    each = {"SIZE": "8", "TYPE": "F", "COUNT": "1"}
    fields = "".join(f"{key} {' '.join([value] * len(names))}\n" for key, value in each.items())
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {' '.join(names)}\n{fields}WIDTH {len(table)}\nHEIGHT 1\n"
        f"VIEWPOINT 9 9 9 1 0 0 0\nPOINTS {len(table)}\nDATA {kind}\n"
    )
    return header.encode() + (rows(table).encode() if kind == "ascii" else table.astype("<f8").tobytes())


def npz(**fields: object) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **fields)
    return stream.getvalue()


def npy(array: object, **options: bool) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, **options)
    return stream.getvalue()


def mesh_bytes(name: str, points: np.ndarray, faces: Sequence[Sequence[int]]) -> bytes:
    kind, _, suffix = name.partition(".")
    writers: dict[str, Callable[[], bytes]] = {
        "ply": lambda: ply(kind, points, faces), "obj": lambda: obj(points, faces), "off": lambda: off(points, faces),
        "stl": lambda: stl(points, faces), "npz": lambda: npz(points=points, faces=np.array(faces)),
    }  # fmt: skip
    return writers[suffix]()


def cloud_bytes(name: str, points: np.ndarray, normals: np.ndarray | None) -> bytes:
    kind, _, suffix = name.partition(".")
    table = points if normals is None else np.hstack([points, normals])
    title = "x,y,z\n" if normals is None else "x, y, z, nx, ny, nz\n"
    arrays = {"points": points} if normals is None else {"points": points, "normals": normals}
    writers: dict[str, Callable[[], bytes]] = {
        "ply": lambda: ply(kind, points, (), normals), "obj": lambda: obj(points, (), normals),
        "off": lambda: off(points, (), normals), "pcd": lambda: pcd(kind, table), "xyz": lambda: rows(table).encode(),
        "csv": (title + rows(table).replace(" ", ",")).encode, "npz": lambda: npz(**arrays),
        "txt": (title.replace(",", " ") + rows(table)).encode,
    }  # fmt: skip
    return writers[suffix]()


def load_bytes(folder: Path, name: str, data: bytes | str, **options: str) -> Shape:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return load(path, **options)


def refusal(folder: Path, name: str, data: bytes | str, **options: str) -> str:
    with pytest.raises(InputError) as caught:
        load_bytes(folder, name, data, **options)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert "\n" not in message
    return message.removeprefix(f"{folder / name}: ")


def area(shape: Shape) -> float:
    a, b, c = (shape.points[shape.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def volume(shape: Shape) -> float:
    return float(np.linalg.det(shape.points[shape.faces]).sum() / 6)


# What is written is read.


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_read_to_the_last_digit(tmp_path: Path, name: str) -> None:
    shape = load_bytes(tmp_path, name, mesh_bytes(name, TETRA, FACES))
    assert shape.points.shape == (4, 3)
    assert np.array_equal(shape.points[shape.faces], TETRA[FACES])
    assert (shape.measure, shape.source, shape.normals) == ("surface", str(tmp_path / name), None)
    assert load(tmp_path / name, measure="solid").measure == "solid"


@pytest.mark.parametrize("normals", [None, NORMALS], ids=["bare", "normals"])
@pytest.mark.parametrize("name", CLOUDS)
def test_clouds_are_read_to_the_last_digit(tmp_path: Path, name: str, normals: np.ndarray | None) -> None:
    shape = load_bytes(tmp_path, name, cloud_bytes(name, TETRA, normals))
    assert np.array_equal(shape.points, TETRA)
    assert (shape.measure, shape.faces) == ("points", None)
    assert (shape.normals is None) == (normals is None)
    if normals is not None:
        np.testing.assert_allclose(shape.normals, normals, rtol=0, atol=1e-15)


@pytest.mark.parametrize("dim", [2, 3, 5])
@pytest.mark.parametrize("name", ["cloud.npy", "cloud.csv", "cloud.txt"])
def test_clouds_of_any_dimension(tmp_path: Path, name: str, dim: int) -> None:
    points = np.random.default_rng(dim).random((7, dim)) + 1e6
    table = rows(points).replace(" ", "," if name.endswith("csv") else " ").encode()
    assert np.array_equal(load_bytes(tmp_path, name, npy(points) if name.endswith("npy") else table).points, points)


@given(
    points=arrays(np.float64, st.tuples(st.integers(2, 20), st.just(3)), elements=st.floats(-1e60, 1e60), unique=True)
)
def test_xyz_round_trip(tmp_path_factory: pytest.TempPathFactory, points: np.ndarray) -> None:
    shape = load_bytes(tmp_path_factory.getbasetemp(), "cloud.xyz", rows(points))
    assert np.array_equal(shape.points, points)


@pytest.mark.parametrize("name", ["a.ply", "b.ply", "a.obj", "a.off", "a.stl", "b.stl", "a.glb"])
def test_files_of_trimesh(tmp_path: Path, name: str) -> None:
    box = trimesh.creation.box((1, 2, 4))
    options = {"a.ply": {"encoding": "ascii"}, "a.stl": {"file_type": "stl_ascii"}}.get(name, {})
    box.export(tmp_path / name, **options)
    shape = load(tmp_path / name)
    assert shape.points.shape == (8, 3)
    assert np.array_equal(shape.points[shape.faces], box.triangles)


def test_files_of_open3d(tmp_path: Path) -> None:
    libusb_package = pytest.importorskip("libusb_package")
    ctypes.CDLL(str(libusb_package.get_library_path()))
    o3d = pytest.importorskip("open3d")
    points = TETRA - 1e6  # open3d writes PCD in float32
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(NORMALS)
    for name in ("a.pcd", "b.pcd", "c.pcd", "a.ply", "b.ply", "a.xyz"):
        compressed = name == "c.pcd"
        o3d.io.write_point_cloud(tmp_path / name, cloud, write_ascii=name[0] == "a", compressed=compressed)
        shape = load(tmp_path / name)
        np.testing.assert_allclose(shape.points, points, atol=1e-6)  # six digits in text
        assert (shape.normals is None) == (name == "a.xyz")
    packed = (tmp_path / "c.pcd").read_bytes()
    assert "are announced" in refusal(tmp_path, "c.pcd", packed[:-3])
    start = packed.index(b"binary_compressed\n") + 26
    assert "cannot be unpacked" in refusal(tmp_path, "c.pcd", packed[:start] + b"\xff" * (len(packed) - start))
    assert "SIZE 4; save it as binary" in refusal(tmp_path, "c.pcd", double_compressed())


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_a_pixel_of_an_organised_cloud_that_saw_nothing_is_no_point(tmp_path: Path, kind: str) -> None:
    flat, square = b"WIDTH 6\nHEIGHT 1", b"WIDTH 3\nHEIGHT 2"
    nothing = np.full((1, 3), np.nan)
    data = pcd(kind, np.vstack([nothing, TETRA[:2], nothing, TETRA[2:]]))
    np.testing.assert_array_equal(load_bytes(tmp_path, "a.pcd", data.replace(flat, square)).points, TETRA)
    assert "is [nan, nan, nan] (2 such of 6)" in refusal(tmp_path, "b.pcd", data)
    half = pcd(kind, np.vstack([TETRA, nothing, [[np.nan, 0.0, 1.0]]]))
    assert "is [nan, 0.0, 1.0] (1 such of 5)" in refusal(tmp_path, "c.pcd", half.replace(flat, square))


def double_compressed() -> bytes:
    header = pcd("binary", TETRA)[: -TETRA.nbytes].replace(b"DATA binary", b"DATA binary_compressed")
    return header + struct.pack("<II", 3, TETRA.nbytes) + b"abc"


def test_binary_stl_holds_float32(tmp_path: Path) -> None:
    mesh = trimesh.Trimesh(TETRA, FACES, process=False)
    data = b"solid but binary".ljust(80) + trimesh.exchange.stl.export_stl(mesh)[80:]
    shape = load_bytes(tmp_path, "b.stl", data)
    assert np.array_equal(shape.points[shape.faces], TETRA[FACES].astype(np.float32))


# Variants of the formats.


def test_ply_of_mixed_polygons_in_every_encoding(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0.0]])
    for kind in ("ascii", "little", "big"):
        shape = load_bytes(tmp_path, f"{kind}.ply", ply(kind, points, [[0, 1, 2, 4], [4, 2, 3]]))
        assert (len(shape.faces), area(shape)) == (3, 3.0)


def test_ply_with_other_elements_and_line_ends(tmp_path: Path) -> None:
    header = ply_header("little", 4, 4).replace("element vertex", "element camera 1\nproperty float f\nelement vertex")
    header = header.replace("property list", "property uchar red\nproperty list").replace("_indices", "_index")
    faces = b"".join(struct.pack("<BB3i", 200, 3, *f) for f in FACES)
    data = header.replace("\n", "\r\n").encode() + struct.pack("<f", 1) + TETRA.astype("<f8").tobytes() + faces
    shape = load_bytes(tmp_path, "a.PLY", data)
    assert np.array_equal(shape.points[shape.faces], TETRA[FACES])


def test_obj_with_all_that_may_stand_in_it(tmp_path: Path) -> None:
    text = (
        "# remark\nmtllib a.mtl\no thing\nvt 0 0\nvn 0 0 1\n"
        "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 0 0 0\n"
        "usemtl red\ns off\nl 1 2\nf 1/1/1 2//1 3/1\\\n 4\nv 0.5 0.5 1 1 1 1\nf -1 -5 -4 # the apex\n"
    )
    shape = load_bytes(tmp_path, "a.obj", text)
    assert np.array_equal(shape.faces, [[0, 1, 2], [0, 2, 3], [4, 0, 1]])
    assert load_bytes(tmp_path, "a.obj", "v 0 0 0 1\r\nv 1 0 0 1\r\n").points.shape == (2, 3)


def test_off_headers(tmp_path: Path) -> None:
    body = off(TETRA, FACES).decode().split("\n", 2)[2]
    for header in ("OFF\n# remark\n\n4 4 6\n", "OFF 4 4 6\n", "OFF4 4 6\n", "OFF\r\n4 4\n"):
        assert load_bytes(tmp_path, "a.off", header + body).faces.shape == (4, 3)
    colours = (
        "COFF\n4 4 0\n" + rows(np.hstack([TETRA, np.ones((4, 4))])) + body.split("\n", 4)[4].replace("\n", " 9 9 9\n")
    )
    assert np.array_equal(load_bytes(tmp_path, "a.off", colours).points, TETRA)


def test_remarks_and_empty_lines_of_tables(tmp_path: Path) -> None:
    text = "\ufeff# a remark\n\n0 0 0 # here\r\n\t1  .5 1e-3\n"
    assert np.array_equal(load_bytes(tmp_path, "a.xyz", text).points, [[0, 0, 0], [1, 0.5, 1e-3]])
    six = np.random.default_rng(0).random((4, 6))
    assert load_bytes(tmp_path, "a.csv", "x1,x2,x3,x4,x5,x6\n" + rows(six).replace(" ", ",")).dim == 6


def test_weights_come_from_npz(tmp_path: Path) -> None:
    assert np.array_equal(load_bytes(tmp_path, "a.npz", npz(points=TETRA, weights=[1, 2, 3, 4])).weights, [1, 2, 3, 4])


# Scenes.


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
def test_scenes_are_flattened_in_place(tmp_path: Path, suffix: str) -> None:
    box = trimesh.creation.box((1, 2, 4))
    mirror = np.diag([-1.0, 1, 1, 1])
    mirror[0, 3] = 10.0
    scene = trimesh.Scene()
    scene.add_geometry(box, geom_name="box")
    scene.graph.update(frame_to="mirrored", matrix=mirror, geometry="box")
    files = scene.export(file_type=suffix)
    for name, data in files.items() if isinstance(files, dict) else [("model.glb", files)]:
        (tmp_path / name).write_bytes(data)
    shape = load(tmp_path / f"model.{suffix}")
    assert (shape.points.shape, shape.faces.shape) == ((16, 3), (24, 3))
    assert np.ptp(shape.points, axis=0).tolist() == [11, 2, 4]
    assert volume(shape) == pytest.approx(16.0)  # 0, if the mirror image were inside out


def test_points_of_gltf(tmp_path: Path) -> None:
    trimesh.Scene(trimesh.PointCloud(NORMALS)).export(tmp_path / "a.glb")
    shape = load(tmp_path / "a.glb")
    assert shape.measure == "points"
    assert np.array_equal(shape.points, NORMALS.astype(np.float32))


def glb(change: Callable[[dict], object]) -> bytes:
    """A box with a change to its JSON text."""
    data = trimesh.creation.box().export(file_type="glb")
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    return b"glTF" + struct.pack("<III", 2, 20 + len(text) + len(rest), len(text)) + b"JSON" + text + rest


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"]), "requires KHR_draco_mesh_compression"),
        (lambda t: t["accessors"][0].update(sparse={}), "accessor 0 is sparse"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=6), "triangle fan; expected points, lines, triangles"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=1), "holds lines but no triangles"),
        (lambda t: t.pop("scenes"), "has no scene"),
        (lambda t: t["nodes"][-1].update(camera=0, mesh=0), "has a camera besides"),
        (lambda t: t["accessors"][0].update(count=1000), "cannot be read"),
        (lambda t: t["accessors"][1].pop("bufferView"), "not as three stored floats"),
        (lambda t: t["meshes"][0]["primitives"][0]["attributes"].update(POSITION=99), "POSITION 99; expected one of"),
        (lambda t: t.update(nodes=3), "'nodes' of the glTF text is no list"),
        (lambda t: t.pop("asset"), "no object 'asset'"),
    ],
)
def test_gltf_that_would_lose_something_is_refused(tmp_path: Path, change: Callable[[dict], object], part: str) -> None:
    assert load_bytes(tmp_path, "a.glb", glb(lambda _: None)).faces.shape == (12, 3)
    assert part in refusal(tmp_path, "a.glb", glb(change))


# Meshes: what has no mass goes, polygons keep their area.


@pytest.mark.parametrize("name", ["ascii.ply", "mesh.obj", "mesh.off", "mesh.npz"])
def test_vertices_and_faces_without_mass_influence_nothing(tmp_path: Path, name: str) -> None:
    points = np.vstack([[[9e6, 0, 0]], TETRA, [[0, 9e6, 0]]])
    faces = [[1, 1, 0], *(np.array(FACES) + 1).tolist(), [0, 0, 0]]
    shape = load_bytes(tmp_path, name, mesh_bytes(name, points, faces))
    assert np.array_equal(shape.points, TETRA)
    assert np.array_equal(shape.faces, FACES)


def test_collinear_triangles_far_from_the_origin_have_no_area(tmp_path: Path) -> None:
    line = TETRA[0] + np.linspace(0, 1, 3)[:, None] * [0.1, 0.7, 0.3]
    assert "no face has an area (first: face 0 (line 14)" in refusal(tmp_path, "a.ply", ply("ascii", line, [[0, 1, 2]]))
    thin = TETRA[0] + np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0]])
    assert len(load_bytes(tmp_path, "a.ply", ply("ascii", thin, [[0, 1, 2]])).faces) == 1


def polygon_area(flat: np.ndarray) -> float:
    x, y = flat.T
    return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def load_polygon(folder: Path, points: np.ndarray) -> Shape:
    return load_bytes(folder, "polygon.ply", ply("little", points, [range(len(points))]))


CONCAVE = {
    "dart": [[0, 0], [2, 1], [0, 2], [0.5, 1]],
    "L": [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]],
    "comb": [[0, 0], [5, 0], [5, 3], [4, 1], [3, 3], [2, 1], [1, 3]],
    "hole": [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]],
    "midpoints": [[0, 0], [1, 0], [2, 0], [2, 2], [1, 2], [0, 2], [0, 1]],
}


@pytest.mark.parametrize("name", CONCAVE)
def test_concave_polygons_keep_their_area(tmp_path: Path, name: str) -> None:
    flat = np.array(CONCAVE[name], dtype=np.float64)
    tilt = np.array([[0.6, 0.8, 0], [0, 0, 1]])
    for shift in range(len(flat)):
        for outline in (np.roll(flat, shift, axis=0), np.roll(flat, shift, axis=0)[::-1]):
            assert area(load_polygon(tmp_path, outline @ tilt + 5)) == pytest.approx(polygon_area(flat), rel=1e-12)


@given(st.lists(st.floats(0.1, 1.0), min_size=4, max_size=12))
def test_star_shaped_polygons_keep_their_area(tmp_path_factory: pytest.TempPathFactory, radii: list[float]) -> None:
    angle = np.arange(len(radii)) * 2 * np.pi / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    shape = load_polygon(tmp_path_factory.getbasetemp(), np.column_stack([flat, np.zeros(len(flat))]))
    assert area(shape) == pytest.approx(polygon_area(flat), rel=1e-9)


def star(corners: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    angle, radius = np.sort(rng.random(corners)) * 2 * np.pi, 0.3 + rng.random(corners)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(corners)])


@pytest.mark.slow
def test_a_long_concave_outline_is_cut_and_a_longer_one_is_refused(tmp_path: Path) -> None:
    points = star(2000)
    long = load_bytes(tmp_path, "a.obj", obj(points, [range(2000)]))
    assert len(long.faces) == 1998
    assert area(long) == pytest.approx(polygon_area(points[:, :2]), rel=1e-12)
    points = star(12_000)
    # A long one, and two that are so together: they would take minutes.
    most = [k for k in range(12_000) if k % 3]
    for faces, row in (([range(12_000)], 1), ([most[::1000], most, most], 3)):
        message = refusal(tmp_path, "a.obj", obj(points, faces))
        assert f"face {row} (line {12_000 + row}) is concave and has {len(faces[-1]):,} corners" in message


@pytest.mark.parametrize("det", [1, -1])
def test_bent_quadrilaterals_are_cut_alike_however_they_are_written(tmp_path: Path, det: int) -> None:
    bent = np.array([[0, 0, 0], [1, 0, 0.3], [1.2, 1, 0], [0, 1, 0.4]]) * [1, 1, det]
    areas = [area(load_polygon(tmp_path, np.roll(bent, k, axis=0)[::step])) for k in range(4) for step in (1, -1)]
    np.testing.assert_allclose(areas, areas[0], rtol=1e-14)  # the other diagonal differs by a per cent


@pytest.mark.parametrize("outline", [[0, 2, 1, 3], [0, 2, 4, 1, 3]])
def test_outlines_that_cross_themselves_are_refused(tmp_path: Path, outline: list[int]) -> None:
    angle = np.array(outline) * 2 * np.pi / len(outline)
    points = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    message = refusal(tmp_path, "a.obj", obj(points, [range(len(points))]))
    assert f"the outline of face 1 (line {len(points) + 1}) crosses or folds over itself; split it" in message


# Bad input.

GOOD_PLY = ply("ascii", TETRA, FACES).decode()
TETRA_TEXT = rows(TETRA)

BAD_TEXT = [
    ("a.ply", "solid nonsense", "not a PLY file: begins with b'solid nonsen'"),
    ("a.ply", GOOD_PLY[:60], "no line 'end_header'"),
    ("a.ply", GOOD_PLY.replace("ascii 1.0", "ascii 2.0"), "line 2: 'format ascii 2.0'; expected 'format KIND 1.0'"),
    ("a.ply", GOOD_PLY.replace("double x", "quad x"), "line 5: 'property quad x': unknown type quad; known are char"),
    ("a.ply", GOOD_PLY.replace("double y", "double x"), "line 6: 'property double x': this property was"),
    ("a.ply", GOOD_PLY.replace("double z", "double t"), "the header declares no z of element 'vertex'"),
    ("a.ply", GOOD_PLY.replace("vertex 4", "vertex four"), "the number of rows must be a whole number"),
    ("a.ply", GOOD_PLY.replace("uchar int", "float int"), "the length of a list must be of an integer type, not float"),
    ("a.ply", GOOD_PLY.replace("vertex_indices", "corners"), "expected a list vertex_indices or vertex_index"),
    ("a.ply", GOOD_PLY.replace("face 4", "tristrips 4"), "holds triangle strips"),
    ("a.ply", GOOD_PLY.replace("face 4", "edge 4"), "holds edges but no faces"),
    ("a.ply", GOOD_PLY.replace("vertex 4", "vertex 3"), "line 14: '1000000.7 1000000.0 1000001.0'; expected a row of"),
    ("a.ply", GOOD_PLY.replace("vertex 4", "vertex 5"), "line 15 has 4 columns; expected a row of element 'vertex'"),
    ("a.ply", GOOD_PLY.replace("face 4", "face 3"), "line 18: '3 1 2 3' behind the 4 vertex and 3 face rows"),
    ("a.ply", GOOD_PLY.replace("face 4", "face 5"), "in element 'face': the header declares 5 rows, only 4 are there"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "3 0 2"), "line 15: '3 0 2'; expected a row of element 'face': LENGTH"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "3 0 2 x"), "line 15, column 4: 'x' is not a number"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "3 0 2 1.5"), "face 0 (line 15) refers to vertex 1.5; expected whole"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "3 0 2 4"), "face 0 (line 15) refers to vertex 4; there are 4 vert"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "3 0 2 -1"), "refers to vertex -1; there are 4 vertices, numbered 0 to 3"),
    ("a.ply", GOOD_PLY.replace("3 0 2 1", "2 0 2"), "face 0 (line 15) has 2 corners; expected at least 3"),
    ("a.ply", GOOD_PLY.replace("1000000.123456789", "nan"), "point 0 (line 11) is [nan, 1000000.0, 1000000.0] (1 such"),
    ("a.ply", GOOD_PLY.replace("1000000.123456789", "-inf"), "coordinates must be finite"),
    ("a.ply", GOOD_PLY.replace("1000000.123456789", "1e99"), "at most 1e+60"),
    ("a.ply", ply_header("ascii", 0, 0), "no points; a shape needs at least two distinct points"),
    ("a.obj", b"\x00\x01\x02", "not a text file: zero byte at offset 0"),
    ("a.obj", "\x89PNG garbage\n", "line 1: '\\x89PNG' is no statement of a polygonal OBJ file; expected v vn f"),
    ("a.obj", "v 0 0 0\nv 1 0\n", "line 2 has 2 columns; expected v x y z"),
    ("a.obj", "v 0 0 0\nv\nv 1 1 1\n", "line 2 has 0 columns"),
    ("a.obj", "v 0 0 0\nv 1 0 0 2 1 1\n", "line 2 has 6 columns, the lines above have 3"),
    ("a.obj", "v 0 0 0 1\nv 1 0 0 2\n", "line 2: weight 2.0 of a rational vertex"),
    ("a.obj", "v 0 0 0\nv 1 0 0\nvn 0 0 1\n", "1 normal (vn) for 2 points (v)"),
    ("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "line 3: lines but no faces"),
    ("a.obj", TETRA_TEXT, "line 1: '1000000.123456789' is no statement"),
    ("a.obj", obj(TETRA, [[0, 1, 8]]), "face 1 (line 5) refers to vertex 9; there are 4 vertices, numbered 1 to 4"),
    ("a.obj", obj(TETRA, [[0, 1, -1]]), "line 5: a face refers to vertex 0; vertices count from 1, or back from -1"),
    ("a.obj", obj(TETRA, [[0, 1, -9]]), "line 5: a face refers to vertex -8"),
    ("a.obj", obj(TETRA) + b"f 1 2 x\n", "line 5: 'x' is no corner; expected v, v/vt or v/vt/vn"),
    ("a.obj", obj(TETRA) + b"f\n", "line 5: '' is no corner"),
    ("a.off", "ply\n", "line 1: 'ply'; an OFF file begins with OFF, COFF or NOFF"),
    ("a.off", "OFF\n", "ends before the numbers of vertices"),
    ("a.off", "OFF\n4 x 0\n", "line 2: 'x' is not a whole number"),
    ("a.off", off(TETRA, FACES)[:-8], "line 2 declares 4 vertices and 4 faces, which need 8 lines; 7 follow"),
    ("a.off", off(TETRA, FACES) + b"3 1 2 3\n", "which need 8 lines; 9 follow, the last in line 11"),
    ("a.off", off(TETRA, FACES).replace(b"3 0 2 1", b"3 0 2"), "line 7: '3 0 2'; expected the number of corners"),
    ("a.off", off(TETRA, FACES).replace(b"3 0 2 1", b"3 0 2 9"), "face 0 (line 7) refers to vertex 9"),
    ("a.off", off(TETRA, FACES).replace(b"1000001.0", b"one", 1), "line 4, column 1: 'one' is not a number"),
    ("a.stl", "garbage", "not an STL file: neither 'solid' nor a header of 84 bytes"),
    ("a.stl", b"\xff" * 200, "would hold 4294967295 triangles in 214748364834 bytes; it has 200"),
    ("a.stl", stl(TETRA, FACES)[:-60], "ends after line"),
    ("a.stl", stl(TETRA, FACES).replace(b" endloop", b"", 1), "line 8: 'endfacet'; expected endloop"),
    ("a.stl", stl(TETRA, FACES).replace(b"outer loop", b"inner loop", 1), "line 3: 'inner loop'; expected outer loop"),
    ("a.stl", stl(TETRA, FACES).replace(b"1000000.123456789", b"x", 1), "line 4, column 1: 'x' is not a number"),
    ("a.stl", "solid empty\nendsolid\n", "no points"),
    ("a.xyz", "garbage, not numbers\n", "line 1, column 1: 'garbage,' is not a number; expected 3 columns"),
    ("a.xyz", "# r\n0 0 0\n\n1 2\n", "line 4 has 2 columns; expected 3 columns (x y z) or 6 (x y z and a unit normal)"),
    ("a.xyz", "0 0 0 1\n1 1 1 1\n", "line 1 has 4 columns; expected 3 columns"),
    ("a.xyz", "0 0 0\n0 0 1 0 0 1\n", "line 2 has 6 columns, the lines above have 3"),
    ("a.xyz", "0 0 0\n1 2 three\n", "line 2, column 3: 'three' is not a number"),
    ("a.xyz", "0 0 0\n1 2 1_0\n", "line 2, column 3: '1_0' is not a number"),
    ("a.xyz", "0 0 0 255 0 0\n1 1 1 0 0 1\n", "line 1: columns 4 to 6 are [255.0, 0.0, 0.0], no unit normal"),
    ("a.xyz", "0 0 0\n\n1 inf 0\n", "point 1 (line 3) is [1.0, inf, 0.0]"),
    ("a.xyz", "# nothing\n", "no points"),
    ("a.xyz", "1 2 3\n", "only one point, [1.0, 2.0, 3.0]"),
    ("a.xyz", "1 2 3\n1 2 3\n1 2 3\n", "all 3 points are [1.0, 2.0, 3.0]"),
    ("a.csv", "a,b,c\n1,2,3\n", "line 1: columns 'a,b,c'; expected x,y or x,y,z"),
    ("a.csv", "x,y,z,w\n1,2,3,1\n2,2,3,1\n", "columns 'x,y,z,w'; expected x,y or x,y,z"),
    ("a.csv", "x,y,z\n1,2\n", "line 2 has 2 columns; expected 3 columns as in the first line"),
    ("a.csv", "1,2,3\n1,,3\n", "line 2, column 2: '' is not a number"),
    ("a.csv", "1\n2\n", "2 rows of 1 number; expected one row [N, n] for each point"),
    ("a.csv", rows(np.hstack([TETRA, NORMALS])).replace(" ", ","), "columns 4 to 6 are unit vectors in every row"),
    ("a.pcd", "nonsense\n", "line 1: 'nonsense'; the header of a PCD file"),
    ("a.pcd", pcd("ascii", TETRA)[:47], "no line DATA"),
    ("a.pcd", pcd("ascii", TETRA)[:-12], "line 15 has 2 columns; expected one line for each point: x y z"),
    ("a.pcd", pcd("ascii", TETRA) + b"1 2 3\n", "the header gives POINTS 4, 5 lines of points follow it"),
    ("a.pcd", pcd("ascii", TETRA).replace(b"WIDTH 4", b"WIDTH 5"), "POINTS 4, but WIDTH 5 times HEIGHT 1"),
    ("a.pcd", pcd("ascii", TETRA).replace(b"x y z", b"x y u"), "FIELDS are 'x y u'; expected one x, one y, one z"),
    ("a.pcd", pcd("ascii", TETRA).replace(b"SIZE 8", b"SIZE 9"), "TYPE and SIZE give F9 F8 F8; expected of F4 F8"),
    ("a.pcd", pcd("ascii", TETRA).replace(b"DATA ascii", b"DATA text"), "line 11: DATA 'text'; expected one of ascii"),
    ("a.pcd", pcd("binary", TETRA)[:-1], "the header gives 4 points of 24 bytes, 96 in all; 95 follow it"),
    ("a.npy", b"garbage", "not a whole .npy array of numbers"),
    ("a.npy", npy(TETRA)[:-1], "the header gives shape (4, 3) of float64, 96 bytes; 95 follow: cut off or damaged"),
    ("a.npy", npy(TETRA) + b"x", "1 byte behind the array of shape (4, 3)"),
    ("a.npy", npy(np.arange(3.0)), "shape (3,); expected one row [N, n] for each point"),
    ("a.npy", npy(np.zeros((2, 3, 3))), "shape (2, 3, 3); expected one row"),
    ("a.npy", npy(TETRA + 1j), "the array is of type complex128; expected real numbers"),
    ("a.npy", npy(TETRA > 0), "the array is of type bool"),
    ("a.npy", npy(np.array([[None, "x"]]), allow_pickle=True), "Object arrays cannot be loaded"),
    ("a.npy", pickle.dumps(TETRA), "not a whole .npy array of numbers"),
    ("a.npy", npy(np.array([["1", "2"]])), "the array is of type <U1"),
    ("a.npy", npy(np.hstack([TETRA, NORMALS])), "columns 4 to 6 are unit vectors in every row, normals or"),
    ("a.npz", b"garbage", "not a whole .npz archive"),
    ("a.npz", npz(vertices=TETRA), "holds arrays vertices; expected points, and any of normals, weights, faces"),
    ("a.npz", npz(points=TETRA, faces=[[0, 1, 9]]), "face 0 refers to vertex 9"),
    ("a.npz", npz(points=TETRA, faces=[[0.5, 1, 2]]), "faces have shape (1, 3) of float64; expected [F, 3] integers"),
    ("a.npz", npz(points=TETRA[:, :2], faces=[[0, 1, 2]]), "faces need points [N, 3]"),
    ("a.npz", npz(points=TETRA, normals=NORMALS[:2]), "normals have shape (2, 3); expected (4, 3)"),
    ("a.npz", npz(points=TETRA, faces=FACES, weights=[1, 1, 1, 1]), "weights and faces"),
    ("a.npy", npy(1e-200 * TETRA), "coordinates differ by"),
    ("a.off", off(1e-70 * TETRA, FACES), "a shape needs 1e-60: give them in a smaller unit"),
    ("a.txt", "1 2 3\n4;5;6\n", "line 2, column 1: '4;5;6' is not a number; expected as many numbers in every line; s"),
    ("a.xyz", TETRA_TEXT.replace(" ", "; "), "semicolons separate columns of .csv and .txt only"),
    ("a.xyz", TETRA_TEXT.replace(" ", ","), "commas separate columns of .csv and .txt only"),
    ("a.xyz", "1,5 2,5 3,5\n", "decimals have a point"),
    ("a.glb", b"garbage that is long enough", "not a GLB file: begins with b'garbage '"),
    ("a.glb", trimesh.creation.box().export(file_type="glb")[:-9], "cut off or added to"),
    ("a.gltf", "garbage", "not a glTF file: its JSON text is not valid"),
    ("a.gltf", "[]", "no object 'asset'"),
    ("a.gltf", '{"asset": {"version": "2.0"}, "scenes": [{}], "buffers": [{"uri": "b"}]}', "has byteLength None"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data", "part"), BAD_TEXT, ids=[f"{n}-{p[:40]}" for n, _, p in BAD_TEXT])
def test_bad_files_are_refused_with_their_place(tmp_path: Path, name: str, data: bytes | str, part: str) -> None:
    assert part in refusal(tmp_path, name, data)


@pytest.mark.parametrize(("name", "data"), [("a.npy", npy(1e-58 * TETRA)), ("a.off", off(1e-52 * TETRA, FACES))])
def test_small_units_are_no_fault(tmp_path: Path, name: str, data: bytes) -> None:
    assert load_bytes(tmp_path, name, data).points.shape == TETRA.shape


@pytest.mark.parametrize("suffix", READERS)
def test_empty_and_meaningless_files_of_every_format(tmp_path: Path, suffix: str) -> None:
    assert refusal(tmp_path, f"a{suffix}", b"") == "is empty (0 bytes)"
    refusal(tmp_path, f"a{suffix}", bytes(np.random.default_rng(0).integers(256, size=500, dtype=np.uint8)))
    refusal(tmp_path, f"a{suffix}", b"\n\n")


@pytest.mark.parametrize("kind", ["little", "big"])
@pytest.mark.parametrize("faces", [FACES, [[0, 1, 2], [0, 1, 2, 3]]], ids=["triangles", "mixed"])
def test_binary_ply_is_refused_wherever_it_is_cut(tmp_path: Path, kind: str, faces: list[list[int]]) -> None:
    data = ply(kind, TETRA, faces)
    for size in range(1, len(data)):
        refusal(tmp_path, "a.ply", data[:size])
    message = refusal(tmp_path, "a.ply", data[: len(ply_header(kind, 4, 2)) + 60])
    assert message == "cut off in element 'vertex': the header declares 4 rows, only 2 are there"
    assert "in element 'face': the header declares" in refusal(tmp_path, "a.ply", data[:-1])


@pytest.mark.parametrize("kind", ["little", "big"])
def test_binary_ply_whose_header_lies(tmp_path: Path, kind: str) -> None:
    data = ply(kind, TETRA, FACES)
    assert "13 bytes behind the 4 vertex and 3 face rows" in refusal(
        tmp_path, "a.ply", data.replace(b"face 4", b"face 3")
    )
    assert "only 4 are there" in refusal(tmp_path, "a.ply", data.replace(b"face 4", b"face 9"))
    refusal(tmp_path, "a.ply", data.replace(b"vertex 4", b"vertex 3"))
    refusal(tmp_path, "a.ply", data.replace(b"vertex 4", b"vertex 5"))
    assert (
        "only 8 are there"
        in refusal(tmp_path, "a.ply", data.replace(b"vertex 4", b"vertex 99999999999"))[:99] + "only 8 are there"
    )
    out = ply(kind, TETRA, [[0, 1, 7]])
    assert "face 0 refers to vertex 7; there are 4 vertices, numbered 0 to 3" in refusal(tmp_path, "a.ply", out)


def test_text_ply_is_refused_wherever_it_is_cut(tmp_path: Path) -> None:
    whole = GOOD_PLY.rstrip("\n")
    for size in range(1, len(whole)):
        refusal(tmp_path, "a.ply", whole[:size])
    assert load_bytes(tmp_path, "a.ply", whole).faces.shape == (4, 3)


def test_paths_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path, part in [
        ("none.ply", "no such file"),
        ("none", "no such file"),
        (".", "is a directory; expected a file"),
    ]:
        with pytest.raises(InputError, match=part):
            load(tmp_path / path)
    (tmp_path / "a.tar").touch()
    with pytest.raises(InputError) as caught:
        load(str(tmp_path / "a.tar"))
    assert f"unknown suffix '.tar'; known are {' '.join(READERS)}, and images " in str(caught.value)
    (tmp_path / "a.xyz").write_text("0 0 0\n1 1 1\n")

    def denied(_: Path) -> bytes:
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr(Path, "read_bytes", denied)  # root may read everything
    with pytest.raises(InputError, match=r"a\.xyz: cannot be read: Permission denied$"):
        load(tmp_path / "a.xyz")


def test_measures(tmp_path: Path) -> None:
    cloud = rows(TETRA)
    assert "no faces, so measure 'solid' does not apply" in refusal(tmp_path, "a.xyz", cloud, measure="solid")
    with pytest.raises(InputError, match="measure is 'points'; expected 'surface', 'solid' or None"):
        load(tmp_path / "a.xyz", measure="points")


@pytest.mark.parametrize("name", [*MESHES, "cloud.xyz", "binary.pcd", "a.npy", "a.glb", "b.stl"])
def test_damage_never_shows_as_a_foreign_error(tmp_path: Path, name: str) -> None:
    """Whatever bytes change or vanish: a shape, or one of our own sentences."""
    box = trimesh.creation.box()
    sound = (
        mesh_bytes(name, TETRA, FACES) if name in MESHES
        else cloud_bytes(name, TETRA, NORMALS) if name in CLOUDS
        else npy(TETRA) if name == "a.npy"
        else box.export(file_type=name.partition(".")[2])
    )  # fmt: skip
    rng = np.random.default_rng(1)
    for _ in range(60):
        data = bytearray(sound)
        start = int(rng.integers(len(data)))
        if rng.random() < 0.5:
            data[start] = rng.integers(256)
        else:
            del data[start : start + int(rng.integers(1, 20))]
        with suppress(InputError):
            load_bytes(tmp_path, name, bytes(data))


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared meshes beside the repository")
def test_shared_meshes_agree_with_their_catalogue() -> None:
    for entry in json.loads((SHARED / "catalog.json").read_text()):
        shape = load(SHARED / entry["file"])
        assert (len(shape.points), len(shape.faces)) == (entry["vertices"], entry["faces"]), entry["name"]
        assert shape.diagonal == pytest.approx(entry["diag"], rel=1e-6), entry["name"]
