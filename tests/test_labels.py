"""Labels from files: colours, classes and elements break the symmetries that do not keep them, in any pose."""

import io
import json
import struct
from collections.abc import Iterable
from contextlib import suppress
from itertools import permutations, product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from experiments.objects.molecule_sets import MOLECULES, molecule
from symrefine.cli import invoke
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.load import load
from symrefine.shape import Shape
from symrefine.texture import COLOUR_TOLERANCE, colour_classes

RED, GREEN, BLUE, YELLOW, WHITE, BLACK = (
    (200, 30, 30), (30, 160, 40), (20, 40, 190), (230, 220, 50), (240, 240, 240), (15, 15, 15)
)  # fmt: skip
# Colours of the faces +x, -x, +y, -y, +z, -z of a cube, and the group that is left.
CUBES = {
    "six colours": ((RED, GREEN, BLUE, YELLOW, WHITE, BLACK), "C1"),
    "opposite alike": ((RED, RED, GREEN, GREEN, BLUE, BLUE), "D2h"),
    "a lid": ((RED, RED, RED, RED, RED, BLUE), "C4v"),
    "lid and floor": ((RED, RED, RED, RED, BLUE, BLUE), "D4h"),
    "two beside one another": ((BLUE, RED, BLUE, RED, RED, RED), "C2v"),
    "three about a corner": ((BLUE, RED, BLUE, RED, BLUE, RED), "C3v"),
    "all alike": ((RED,) * 6, "Oh"),
}
ATOMS = {"water": "C2v", "CH2Cl2": "C2v", "CCl4": "Td", "ethane": "D3d", "one D": "C3v", "CO2": "Dinfh", "OCS": "Cinfv"}
TETRA = np.array([[0.1, 0, 0], [1, 0.1, 0], [0, 1, 0.3], [0.7, 0, 1]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def pose(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Orthogonal matrix, shift and scale."""
    rng = np.random.default_rng(seed)
    matrix = Rotation.random(random_state=rng).as_matrix() * rng.choice([-1.0, 1.0])
    return matrix, rng.normal(size=3) * 10, float(10.0 ** rng.uniform(-2, 3))


def posed(points: np.ndarray, seed: int) -> np.ndarray:
    matrix, shift, scale = pose(seed)
    return scale * (points @ matrix.T + shift)


def cube(cells: int) -> tuple[np.ndarray, list[list[int]], np.ndarray]:
    """Vertices of a cube whose faces share none, its quadrilaterals, and the face 0 to 5 of each vertex."""
    line = np.linspace(-1, 1, cells + 1)
    grid = np.array(list(product(line, line)))
    corner = [i * (cells + 1) + j for i in range(cells) for j in range(cells)]
    points, quads = [], []
    for axis, sign in product(range(3), (1.0, -1.0)):
        first = len(points) * len(grid)
        points.append(np.insert(grid, axis, sign, axis=1))
        quads += [[first + k, first + k + cells + 1, first + k + cells + 2, first + k + 1] for k in corner]
    return np.concatenate(points), quads, np.repeat(np.arange(6), len(grid))


def ply(
    path: Path,
    points: np.ndarray,
    faces: Iterable[list[int]] = (),
    *,
    of_points: dict[str, np.ndarray] | None = None,
    of_faces: dict[str, np.ndarray] | None = None,
    kind: str = "uchar",
) -> Path:
    """A text PLY with further properties of one kind."""
    of_points, of_faces, faces = of_points or {}, of_faces or {}, list(faces)
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property double {c}" for c in "xyz")]
    header += [f"property {kind} {name}" for name in of_points]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"] if faces else []
    header += [f"property {kind} {name}" for name in of_faces]
    rows = [" ".join([*map(repr, p), *(str(v[k]) for v in of_points.values())]) for k, p in enumerate(points.tolist())]
    rows += [" ".join(map(str, [len(f), *f, *(v[k] for v in of_faces.values())])) for k, f in enumerate(faces)]
    path.write_text("\n".join([*header, "end_header", *rows]) + "\n")
    return path


def rgb(colours: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(("red", "green", "blue"), np.asarray(colours).T, strict=True))


def group_of_colours(colours: tuple[tuple[int, ...], ...]) -> int:
    """How many of the 48 operations of the cube take each face to one of its colour."""
    normals = [sign * np.eye(3)[axis] for axis, sign in product(range(3), (1, -1))]
    place = {tuple(n.astype(int)): colour for n, colour in zip(normals, colours, strict=True)}
    operations = [np.eye(3)[list(p)] * s for p in permutations(range(3)) for s in product((1, -1), repeat=3)]
    return sum(
        all(place[tuple((m @ n).astype(int))] == place[tuple(n.astype(int))] for n in normals) for m in operations
    )


def xyz(symbols: Iterable[str], positions: np.ndarray, remark: str = "a molecule") -> str:
    atoms = list(zip(symbols, positions.tolist(), strict=True))
    return "\n".join([str(len(atoms)), remark, *(f"{s}  {x!r} {y!r} {z!r}" for s, (x, y, z) in atoms)]) + "\n"


def atoms_of(name: str) -> tuple[list[str], np.ndarray]:
    """Elements and positions, in angstroms."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    if name == "water":
        half = np.radians(104.52 / 2)
        return ["O", "H", "H"], 0.9572 * np.array([[0, 0, 0], [np.sin(half), np.cos(half), 0],
                                                  [-np.sin(half), np.cos(half), 0]])  # fmt: skip
    if name in ("CO2", "OCS"):
        ends = ("O", "O") if name == "CO2" else ("O", "S")
        return ["C", *ends], np.array([[0, 0, 0], [0, 0, 1.16], [0, 0, -1.16]])
    if name == "ethane":
        angle = np.radians([0, 120, 240])
        upper = np.column_stack([1.02 * np.cos(angle), 1.02 * np.sin(angle), np.full(3, 1.16)])
        return ["C", "C"] + ["H"] * 6, np.vstack([[0, 0, 0.77], [0, 0, -0.77], upper, -upper])
    ligands, length = {
        "CH2Cl2": (["H", "H", "Cl", "Cl"], [1.77] * 4),
        "CCl4": (["Cl"] * 4, [1.77] * 4),
        "one D": (["D", "H", "H", "H"], [1.09] * 4),
    }[name]
    # The same places for all, so that only the elements tell them apart.
    return ["C", *ligands], np.vstack([np.zeros(3), corners * np.array(length)[:, None]])


def run(capsys: pytest.CaptureFixture[str], *args: object) -> tuple[int, str, str]:
    status = invoke([str(a) for a in args])
    out, err = capsys.readouterr()
    return status, out, err


def refusal(path: Path, **options: str) -> str:
    with pytest.raises(InputError) as caught:
        load(path, **options)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


# Textured cubes.


@pytest.mark.parametrize("name", CUBES)
def test_colours_of_faces_break_the_symmetry_of_a_cube(tmp_path: Path, name: str) -> None:
    colours, expected = CUBES[name]
    points, quads, face = cube(1)
    path = ply(tmp_path / "cube.ply", posed(points, 5), quads, of_faces=rgb(np.array(colours)[face[::4]]))
    found = detect(load(path, labels="color"))
    assert found.point_group == expected
    assert len(found.group.operations()) == group_of_colours(colours)


@pytest.mark.parametrize("name", ["six colours", "opposite alike", "a lid"])
def test_noisy_textures_of_scans(tmp_path: Path, name: str) -> None:
    """Each vertex its own shade, as a camera sees it; six classes at most are left."""
    colours, expected = CUBES[name]
    points, quads, face = cube(12)
    rng = np.random.default_rng(1)
    shades = np.clip(np.rint(np.array(colours)[face] + rng.normal(0, 12, (len(points), 3))), 0, 255).astype(int)
    assert len(np.unique(shades, axis=0)) > 0.9 * len(shades)
    shape = load(ply(tmp_path / "cube.ply", posed(points, 6), quads, of_points=rgb(shades)), labels="color")
    assert len(np.unique(shape.labels)) == len(set(colours))
    assert detect(shape).point_group == expected


def test_colours_are_ignored_unless_asked_for(tmp_path: Path) -> None:
    points, quads, face = cube(1)
    colours = np.array(CUBES["six colours"][0])[face[::4]]
    shape = load(ply(tmp_path / "cube.ply", points, quads, of_faces=rgb(colours)))
    assert shape.labels is None
    assert detect(shape).point_group == "Oh"


def test_two_halves_of_a_ball(tmp_path: Path) -> None:
    """A cloud: half red, half blue is a surface of revolution; its quarters in turn keep less."""
    rng = np.random.default_rng(2)
    ball = rng.normal(size=(8000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    for name, red, expected in (
        ("half", ball[:, 2] > 0, "Cinfv"),
        ("quarters", (ball[:, 2] > 0) == (ball[:, 0] > 0), "D2h"),
    ):
        colours = np.where(red[:, None], RED, BLUE)
        shape = load(ply(tmp_path / f"{name}.ply", posed(ball, 3), of_points=rgb(colours)), labels="color")
        assert detect(shape).point_group == expected


# Molecules.


@pytest.mark.parametrize("name", ATOMS)
def test_elements_of_molecules_are_labels(tmp_path: Path, name: str) -> None:
    symbols, positions = atoms_of(name)
    path = tmp_path / "molecule.xyz"
    path.write_text(xyz(symbols, posed(positions, 7) / pose(7)[2]))
    assert detect(load(path)).point_group == ATOMS[name]


@pytest.mark.parametrize("name", ["SF6", "C60", "tetrafluoro-COT", "CHFClBr", "B12H12"])
def test_molecules_by_symbols_and_by_numbers(tmp_path: Path, name: str) -> None:
    given = molecule(name)
    words = {"a": given.symbols, "b": [str(z) for z in given.numbers], "c": [s.upper() for s in given.symbols]}
    shapes = []
    for stem, names in words.items():
        path = tmp_path / f"{stem}.xyz"
        path.write_text(xyz(names, given.positions, remark="" if stem == "b" else "# 3 atoms, it says"))
        shapes.append(load(path))
    assert all(s.labels.tolist() == given.numbers and np.array_equal(s.points, given.positions) for s in shapes)
    assert detect(shapes[0]).point_group == MOLECULES[name][0]


def test_plain_xyz_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "cloud.xyz"
    path.write_text("0 0 0\n1 0 0\n0 1 0\n")
    assert load(path).labels is None


WATER = "3\nwater\nO 0 0 0\nH 0.76 0.59 0\nH -0.76 0.59 0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WATER.replace("3", "4", 1), "line 1 declares 4 atoms; 3 follow from line 3 on"),
        (WATER.replace("3", "2", 1), "line 5: 'H -0.76 0.59 0' behind the 2 atoms that line 1 declares"),
        (WATER + "O 0 0 0\n", "line 6: 'O 0 0 0' behind the 3 atoms that line 1 declares; expected nothing"),
        (WATER.replace("O", "Ox"), "line 3: 'Ox' is no element; expected a symbol (H, He, ... Og, D, T) or an atomic"),
        (WATER.replace("O", "0"), "line 3: '0' is no element"),
        (WATER.replace("O", "119"), "line 3: '119' is no element"),
        (WATER.replace("O", "H1"), "line 3: 'H1' is no element"),
        (WATER.replace("-0.76 0.59 0", "-0.76 0.59 0 0.4"), "line 5 has 5 columns; expected an element and x y z"),
        (WATER.replace("0.76 0.59 0\n", "0.76 0.59\n", 1), "line 4 has 3 columns; expected an element and x y z"),
        (WATER.replace("-0.76", "-o.76"), "line 5, column 2: '-o.76' is not a number; expected an element"),
        (WATER.replace("\nH", "\n\nH", 1), "line 4 is empty; expected an element and x y z"),
        ("\n" + WATER, "line 2: 3; the number of atoms must be line 1, a remark line 2"),
        ("0\n\n", "no points; a shape needs at least two distinct points"),
        (WATER.replace("0.76", "nan"), "point 1 (line 4) is [nan, 0.59, 0.0]"),
    ],
)
def test_molecules_that_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "molecule.xyz"
    path.write_text(text)
    assert message in refusal(path)


# Where labels come from.


@pytest.mark.parametrize("name", ["label", "material_index"])
def test_properties_of_faces_and_vertices(tmp_path: Path, name: str) -> None:
    of_faces = load(ply(tmp_path / "f.ply", TETRA, FACES, of_faces={name: np.array([4, 4, 9, 4])}), labels=name)
    assert of_faces.labels.tolist() == [4, 4, 9, 4]
    cloud = load(ply(tmp_path / "c.ply", TETRA, of_points={name: np.array([1, 1, 2, 3])}), labels=name)
    assert cloud.labels.tolist() == [1, 1, 2, 3]
    # Of a mesh: two corners decide, or the first where all three differ.
    of_points = load(
        ply(tmp_path / "v.ply", TETRA, FACES, of_points={name: np.array([1, 2, 2, 3])}, kind="int"), labels=name
    )
    assert of_points.labels.tolist() == [2, 1, 1, 2]
    both = ply(tmp_path / "b.ply", TETRA, FACES, of_points={name: np.arange(4)}, of_faces={name: np.arange(4) + 10})
    assert load(both, labels=name).labels.tolist() == [10, 11, 12, 13]


def test_labels_follow_the_triangles_of_polygons_and_lose_flat_ones(tmp_path: Path) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 2]])
    faces = [[0, 1, 2, 3], [0, 1, 1], [0, 1, 4]]
    shape = load(ply(tmp_path / "a.ply", square, faces, of_faces={"class": np.array([5, 6, 7])}), labels="class")
    assert shape.labels.tolist() == [5, 5, 7]


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_labels(tmp_path: Path, order: str) -> None:
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    header = f"ply\nformat {kind} 1.0\nelement vertex 4\n" + "".join(f"property float {c}\n" for c in "xyz")
    header += "property ushort label\nproperty float quality\nelement face 4\nproperty list uchar int vertex_indices\n"
    body = b"".join(struct.pack(f"{order}3fHf", *p, k + 300, 0.5) for k, p in enumerate(TETRA))
    body += b"".join(struct.pack(f"{order}B3i", 3, *f) for f in FACES)
    path = tmp_path / "a.ply"
    path.write_bytes((header + "end_header\n").encode() + body)
    assert load(path, labels="label").labels.tolist() == [300, 300, 300, 301]
    assert "quality of point 0 is 0.5; labels are whole numbers" in refusal(path, labels="quality")
    assert "no labels 'class'; the file offers label, quality" in refusal(path, labels="class")


def test_materials_and_colours_of_obj(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    vertices = "".join(f"v {x} {y} {z} {r} 0 0\n" for (x, y, z), r in zip(TETRA, (0, 0.02, 0.9, 1), strict=True))
    path.write_text(vertices + "f 1 3 2\nusemtl oak\nf 1 2 4\nusemtl steel\nf 1 4 3\nusemtl oak\nf 2 3 4\n")
    first, second, third, fourth = load(path, labels="material").labels
    assert second == fourth
    assert len({first, second, third}) == 3
    dark, *others = load(path, labels="color").labels
    assert [k == dark for k in others] == [True, False, False]
    assert "no labels 'label'; the file offers color, material" in refusal(path, labels="label")


def test_colours_of_off(tmp_path: Path) -> None:
    path = tmp_path / "a.off"
    vertices = "".join(f"{x} {y} {z}\n" for x, y, z in TETRA)
    faces = "3 0 2 1 255 0 0\n3 0 1 3 250 4 0 255\n3 0 3 2 0 0 255\n3 1 2 3 0 9 255\n"
    path.write_text(f"OFF\n4 4 0\n{vertices}{faces}")
    labels = load(path, labels="color").labels
    assert labels[0] == labels[1] != labels[2] == labels[3]
    path.write_text(f"COFF\n4 0 0\n{vertices.replace(chr(10), ' 0.9 0 0 1' + chr(10))}")
    assert set(load(path, labels="color").labels) == {0}


def test_columns_of_tables(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "Element, x, y, z, nx, ny, nz\n" + "".join(f"{e},{k},{k * k},0,0,0,1\n" for k, e in enumerate("HOHN"))
    )
    shape = load(path, labels="Element")
    assert shape.labels.tolist() == [0, 2, 0, 1]
    assert (shape.dim, shape.normals.tolist()[0]) == (3, [0, 0, 1])
    path = tmp_path / "b.txt"
    path.write_text("x y z red green blue mass\n0 0 0 250 0 0 1\n1 0 0 240 9 0 2\n0 2 0 0 0 250 3.5\n")
    shape = load(path, labels="color", weights="mass")
    assert shape.labels[0] == shape.labels[1] != shape.labels[2]
    assert shape.weights.tolist() == [1, 2, 3.5]
    assert "columns 'x,y,z,red,green,blue'; expected x,y" in refusal(path, weights="mass")
    assert "columns 'x,y,z,red,green,blue,mass'; expected x,y" in refusal(path)
    path.write_text("x y z class\n0 0 0 1\n1 0 0\n")
    assert "line 3 has 3 columns; expected 4 columns as in the first line" in refusal(path, labels="class")
    path.write_text("x,y,z,class\n0,0,0,a\n1,0,0,\n")
    assert "line 3, column 4: is empty" in refusal(path, labels="class")
    path.write_text("class,x,y,z\na,0,0,0\nb,1,o,0\n")
    assert "line 3, column 3: 'o' is not a number" in refusal(path, labels="class")
    path.write_text("x,y,z,class\n0,0,0,1\n1,0,0,1.5\n")
    assert "class of point 1 (line 3) is 1.5; labels are whole numbers" in refusal(path, labels="class")
    path.write_text("0,0,0\n1,0,0\n")
    assert "no labels 'class'; the file offers none" in refusal(path, labels="class")


def npz(path: Path, **arrays: object) -> Path:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    path.write_bytes(stream.getvalue())
    return path


def test_arrays_of_npz(tmp_path: Path) -> None:
    cloud = npz(tmp_path / "a.npz", points=TETRA, kind=["b", "a", "b", "b"], mass=[1.0, 2, 3, 4])
    assert "holds arrays kind, mass, points; expected points, and any of" in refusal(cloud)
    shape = load(cloud, labels="kind", weights="mass")
    assert (shape.labels.tolist(), shape.weights.tolist()) == ([1, 0, 1, 1], [1, 2, 3, 4])
    assert "kind cannot weigh points; expected one number for" in refusal(cloud, labels="mass", weights="kind")
    mesh = npz(tmp_path / "b.npz", points=TETRA, faces=FACES[:3], label=[1, 2, 1], rgb=np.eye(4))
    assert "holds arrays faces, label, points, rgb" in refusal(mesh, labels="label")
    mesh = npz(tmp_path / "b.npz", points=TETRA, faces=FACES[:3], label=[True, False, True])
    assert load(mesh, labels="label").labels.tolist() == [1, 0, 1]
    mesh = npz(tmp_path / "c.npz", points=TETRA, faces=FACES[:3], rgb=np.eye(4))
    assert len(load(mesh, labels="rgb").labels) == 3
    mesh = npz(tmp_path / "d.npz", points=TETRA, faces=FACES[:3], label=[1, 2])
    assert "label is int64 of shape (2,); expected numbers or texts" in refusal(mesh, labels="label")
    weighted = npz(tmp_path / "e.npz", points=TETRA, weights=[1, 1, 2, 2])
    assert load(weighted, weights="weights").weights.tolist() == [1, 1, 2, 2]


def test_fields_of_pcd(tmp_path: Path) -> None:
    header = "VERSION 0.7\nFIELDS x y z label rgb\nSIZE 4 4 4 4 4\nTYPE F F F U F\nCOUNT 1 1 1 1 1\nWIDTH 4\nHEIGHT 1\n"
    header += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA "
    text, binary = tmp_path / "a.pcd", tmp_path / "b.pcd"
    text.write_text(header + "ascii\n" + "".join(f"{x} {y} {z} {k % 2} 0\n" for k, (x, y, z) in enumerate(TETRA)))
    packed = b"".join(struct.pack("<3fIf", *p, k % 2, 0.0) for k, p in enumerate(TETRA))
    binary.write_bytes(f"{header}binary\n".encode() + packed)
    for path in (text, binary):
        assert load(path, labels="label").labels.tolist() == [0, 1, 0, 1]
        assert load(path).labels is None
        assert "no labels 'color'; the file offers label" in refusal(path, labels="color")


def test_colours_of_vertices_of_gltf(tmp_path: Path) -> None:
    """Parts in their places; colours for all parts or none."""
    points, quads, face = cube(1)
    triangles = np.array(quads)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    colours = np.array(CUBES["a lid"][0])[face]
    halves = [trimesh.Trimesh(points, part, vertex_colors=colours, process=False) for part in np.split(triangles, 2)]
    scene = trimesh.Scene(halves)
    scene.apply_transform(np.block([[pose(4)[0], np.zeros((3, 1))], [np.eye(4)[3]]]))
    scene.export(tmp_path / "a.glb")
    shape = load(tmp_path / "a.glb", labels="color")
    assert np.unique(shape.labels, return_counts=True)[1].tolist() == [10, 2]
    assert len(shape.points) == 8
    assert detect(shape).point_group == "C4v"
    trimesh.Scene([halves[0], trimesh.creation.box()]).export(tmp_path / "b.glb")
    assert "no labels 'color'; the file offers none" in refusal(tmp_path / "b.glb", labels="color")
    trimesh.Scene(trimesh.PointCloud(points, colors=colours)).export(tmp_path / "c.glb")
    assert len(set(load(tmp_path / "c.glb", labels="color").labels)) == 2


def test_what_has_no_labels_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.write_text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
                    "endfacet\nendsolid a\n")  # fmt: skip
    assert "no labels 'color'; the file offers none" in refusal(path, labels="color")
    assert "has faces, which weigh what their areas do; weights are for clouds" in refusal(path, weights="mass")
    path = ply(tmp_path / "a.ply", TETRA, of_points={"label": np.arange(4)})
    assert "no weights 'mass'; the file offers label" in refusal(path, weights="mass")
    path = tmp_path / "a.png"
    path.write_bytes(b"x")
    assert "labels and weights apply to meshes, clouds and molecules only" in refusal(path, labels="color")
    path = ply(tmp_path / "b.ply", TETRA, of_points=rgb(np.full((4, 3), np.nan)), kind="float")
    assert "color of point 0 (line 11) is [nan, nan, nan]; labels are finite colours" in refusal(path, labels="color")


def labelled_files(folder: Path) -> list[tuple[Path, str]]:
    """A file of each kind that has labels, and their name."""
    colours, classes = np.array([RED, RED, BLUE, GREEN]), np.array([1, 1, 2, 3])
    rows = "".join(f"{x},{y},{z},{e}\n" for (x, y, z), e in zip(TETRA, "HOHN", strict=True))
    corners = "".join(f"3 {a} {b} {c} 255 0 0\n" for a, b, c in FACES)
    (folder / "a.xyz").write_text(WATER)
    (folder / "a.csv").write_text("x,y,z,kind\n" + rows)
    (folder / "a.off").write_text("OFF\n4 4 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in TETRA) + corners)
    (folder / "a.obj").write_text(
        "".join(f"v {x} {y} {z} 0 0 1\n" for x, y, z in TETRA) + "usemtl oak\nf 1 2 3\nusemtl steel\nf 1 4 3\n"
    )
    ply(folder / "a.ply", TETRA, FACES, of_points=rgb(colours))
    ply(folder / "b.ply", TETRA, FACES, of_faces={"kind": classes}, kind="int")
    npz(folder / "a.npz", points=TETRA, faces=FACES, kind=classes)
    names = "element kind color material color kind kind".split()
    files = ("a.xyz", "a.csv", "a.off", "a.obj", "a.ply", "b.ply", "a.npz")
    return [(folder / file, name) for file, name in zip(files, names, strict=True)]


def test_damage_never_shows_as_a_foreign_error(tmp_path: Path) -> None:
    """Whatever bytes change or vanish: labels for all, or one of our own sentences."""
    rng = np.random.default_rng(1)
    for path, name in labelled_files(tmp_path):
        sound = path.read_bytes()
        assert load(path, labels=name).labels is not None
        for _ in range(80):
            data = bytearray(sound)
            start = int(rng.integers(len(data)))
            if rng.random() < 0.5:
                data[start] = rng.integers(256)
            else:
                data[start : start + int(rng.integers(1, 20))] = rng.choice([b"", b"9" * 30, b"inf", b"-1", b"1e99"])
            path.write_bytes(data)
            with suppress(InputError):
                shape = load(path, labels=name)
                assert len(shape.labels) == len(shape.points if shape.faces is None else shape.faces)


# Colours to classes.


def test_colours_apart_by_more_than_the_limit_are_classes() -> None:
    for distance, classes in ((0.95 * COLOUR_TOLERANCE, 1), (1.05 * COLOUR_TOLERANCE, 2)):
        colours = np.repeat([[50.0, 60, 70], [50, 60, 70 + distance]], [70, 30], axis=0)
        assert len(set(colour_classes(colours, np.ones(100)))) == classes


def test_classes_do_not_depend_on_order_scale_or_type() -> None:
    rng = np.random.default_rng(4)
    colours = np.array([RED, GREEN, BLUE])[rng.integers(3, size=500)] + rng.integers(-15, 16, (500, 3))
    colours = colours.clip(0, 255)
    first = colour_classes(colours, np.ones(500))
    assert len(set(first)) == 3
    order = rng.permutation(500)
    assert np.array_equal(colour_classes(colours[order], np.full(500, 7.0)), first[order])
    for same in (colours / 255.0, colours * 257, colours.astype(np.float32)):
        assert np.array_equal(colour_classes(same, np.ones(500)), first)


def test_rare_colours_make_no_class_and_large_areas_do() -> None:
    """By what they cover, not by how many they are: one wide face of a label among thousands of small ones."""
    colours = np.array([RED] * 2 + [BLUE] * 998)
    assert len(set(colour_classes(colours, np.ones(1000)))) == 1
    wide = np.ones(1000)
    wide[:2] = 200.0
    assert len(set(colour_classes(colours, wide))) == 2
    assert set(colour_classes(colours, np.zeros(1000))) <= {0, 1}


def test_a_gradient_is_cut_into_few_classes() -> None:
    grey = np.repeat(np.linspace(0, 255, 2000)[:, None], 3, axis=1)
    labels = colour_classes(grey, np.ones(2000))
    assert 3 <= len(set(labels)) <= 6
    assert len(np.flatnonzero(np.diff(labels))) == len(set(labels)) - 1


# The command line.


def test_report_of_labels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points, quads, face = cube(1)
    colours = np.array(CUBES["opposite alike"][0])[face[::4]]
    path = ply(tmp_path / "cube.ply", posed(points, 8), quads, of_faces=rgb(colours))
    status, out, _ = run(capsys, "detect", path, "--labels", "color", "--json", "-")
    record = json.loads(out)
    assert status == 0
    assert record["options"]["labels"] == "color"
    assert record["classes"] == {"count": 3, "sizes": [4, 4, 4]}
    assert record["point_group"] == "D2h"
    status, out, _ = run(capsys, "detect", path, "--labels", "color")
    assert (status, "\nlabels: 3 classes\n" in out) == (0, True)
    status, out, _ = run(capsys, "detect", path)
    assert (status, "\nlabels" in out) == (0, False)
    status, out, err = run(capsys, "detect", path, "--labels", "label")
    assert (status, out) == (2, "")
    assert err == f"symrefine: {path}: no labels 'label'; the file offers color\n"


def test_weights_and_elements_in_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    square = "1,1,0,{}\n1,-1,0,{}\n-1,-1,0,{}\n-1,1,0,{}\n"
    path.write_text("x,y,z,mass\n" + square.format(1, 1, 2, 2))
    record = json.loads(run(capsys, "detect", path, "--weights", "mass", "--json", "-")[1])
    assert (record["point_group"], record["options"]["weights"], record["classes"]) == ("C2v", "mass", None)
    path = tmp_path / "water.xyz"
    path.write_text(WATER)
    record = json.loads(run(capsys, "detect", path, "--json", "-")[1])
    assert (record["point_group"], record["classes"]) == ("C2v", {"count": 2, "sizes": [2, 1]})
    assert "labels" not in record["options"]


def test_labels_of_points_in_the_plane_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x,y,class\n0,0,1\n1,0,1\n0,1,2\n")
    status, _, err = run(capsys, "detect", path, "--labels", "class")
    assert status == 2
    assert err.endswith("a.csv: points have 2 coordinates; labels are for objects in space, leave them out\n")


def test_batch_takes_labels_and_keeps_rows_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points, quads, face = cube(1)
    folder, out = tmp_path / "models", tmp_path / "rows.jsonl"
    folder.mkdir()
    lid = np.array(CUBES["a lid"][0])[face[::4]]
    ply(folder / "lid.ply", posed(points, 9), quads, of_faces=rgb(lid))
    ply(folder / "plain.ply", posed(points, 9), quads)
    status, _, _ = run(capsys, "batch", folder, "--out", out, "--labels", "color")
    rows = {row["file"]: row for row in map(json.loads, out.read_text().splitlines())}
    assert status == 1
    assert rows["lid.ply"]["point_group"] == "C4v"
    assert "no labels 'color'; the file offers none" in rows["plain.ply"]["error"]
    assert run(capsys, "batch", folder, "--out", out)[0] == 0
    latest = {row["file"]: row for row in map(json.loads, out.read_text().splitlines())}
    assert {name: row["point_group"] for name, row in latest.items()} == {"lid.ply": "Oh", "plain.ply": "Oh"}


def test_the_result_does_not_hang_on_the_pose() -> None:
    """Labels of a cloud travel with its points."""
    symbols, positions = atoms_of("CH2Cl2")
    labels = np.unique(symbols, return_inverse=True)[1]
    found: list[Detection] = [detect(Shape.of(posed(positions, seed), labels=labels)) for seed in range(5)]
    assert {d.point_group for d in found} == {"C2v"}
