"""Shapes made exactly symmetric: by pairs of points, by copies of a sector, on a surface."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import symrefine
from symrefine.cli import invoke
from symrefine.detection.story import detect
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.export.models import model_bytes
from symrefine.fit.action import generators
from symrefine.geometry import Array, random_orthogonal, rotation
from symrefine.groups import PointGroup, is_subgroup, point_group
from symrefine.load import load
from symrefine.moments.quadrature import sample_surface
from symrefine.picture.words import percent
from symrefine.shape import Shape
from symrefine.symmetrize import Symmetrized, exact_place, placed_subgroup, symmetrize
from symrefine.symmetrize.counterparts import act
from symrefine.symmetrize.surface import closest_on

APPLE = Path(__file__).resolve().parents[2] / "shared" / "objects" / "apple.ply"

GROUPS = ["Cs", "Ci", "C2", "C4v", "C5", "C3h", "S4", "D3", "D6h", "D3d", "Td", "Oh", "I", "Ih"]


class Thing:
    """Orbits of a few points, some of them on elements of the group, somewhere, in some unit, with noise."""

    def __init__(self, name: str, noise_rel: float = 0.0, seed: int = 0) -> None:
        self.rng = np.random.default_rng([seed, *name.encode()])
        self.group = point_group(name, random_orthogonal(self.rng))
        seeds = self.rng.uniform(-1.0, 1.0, (3, 3))
        local = np.einsum("kij,mj->kmi", self.group.operations(), seeds).reshape(-1, 3)
        special = np.vstack([self.group.frame, np.zeros((1, 3))])
        local = np.vstack([local, self.group.equivalent(special[:3]) * 0.7])
        self.scale = 10.0 ** self.rng.uniform(-3.0, 3.0)
        self.center = self.scale * self.rng.uniform(-30.0, 30.0, 3)
        size = float(np.linalg.norm(np.ptp(local, axis=0)))
        self.noise = noise_rel * size
        self.exact = self.center + self.scale * local
        self.points = self.exact + self.scale * self.noise * self.rng.standard_normal(local.shape)
        self.size = self.scale * size

    def misplaced(self, angle_rad: float, shift_rel: float) -> tuple[PointGroup, Array]:
        turn = rotation(self.rng.standard_normal(3), angle_rad)
        center = self.center + shift_rel * self.size * self.rng.standard_normal(3) / 2.0
        return PointGroup(name=self.group.name, frame=self.group.frame @ turn), center


def miss(made: Symmetrized) -> float:
    """Largest distance of an image under any operation to the nearest point, as a fraction of the size."""
    points = made.shape.points - made.center
    tree = cKDTree(points)
    worst = max(tree.query(points @ g.T)[0].max() for g in made.group.operations())
    return float(worst / np.linalg.norm(np.ptp(points, axis=0)))


def table(sides: int = 4, cut: int = 0) -> Shape:
    """A tapered prism with a fine triangulation, symmetric or (cut = 1) with other triangles in every sector."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    rings = [
        np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)]) for r, z in ((1, 0), (0.6, 1.2))
    ]
    middles = np.mean([np.roll(ring, -step, axis=0) for ring in rings for step in (0, 1)], axis=0)
    points = np.vstack([*rings, middles, [[0, 0, 0], [0, 0, 1.2]]])
    faces = []
    for k in range(sides):
        n, middle = (k + 1) % sides, 2 * sides + k
        around = [k, n, sides + n, sides + k, k]
        faces += [[a, b, middle] for a, b in pairwise(around)]
        faces += [[n, k, 3 * sides], [sides + k, sides + n, 3 * sides + 1]]
    mesh = Shape(points=points, faces=np.array(faces), measure="surface")
    for level in range(2):
        mesh = halved(mesh, np.random.default_rng(level) if cut else None)
    return mesh


def halved(mesh: Shape, rng: np.random.Generator | None) -> Shape:
    """Every triangle in four, edges divided in the middle or at random."""
    assert mesh.faces is not None
    points, middle, faces = [*mesh.points], dict[tuple[int, int], int](), []
    for face in mesh.faces.tolist():
        new = []
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(points)
                share = 0.5 if rng is None else rng.uniform(0.3, 0.7)
                points.append(share * points[key[0]] + (1.0 - share) * points[key[1]])
            new.append(middle[key])
        (a, b, c), (d, e, f) = face, new
        faces += [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
    return replace(mesh, points=np.array(points), faces=np.array(faces))


def somewhere(shape: Shape, seed: int) -> Shape:
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-3.0, 3.0)
    return replace(shape, points=scale * (shape.points @ random_orthogonal(rng).T + rng.uniform(-9, 9, 3)))


# --- points that correspond -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GROUPS)
def test_what_is_symmetric_stays_where_it_is(name: str) -> None:
    thing = Thing(name)
    group, center = thing.misplaced(0.01, 0.003)
    made = symmetrize(Shape(points=thing.exact), group, center)
    assert made.method == "vertices"
    assert made.largest < 1e-11
    assert np.abs(made.shape.points - thing.exact).max() < 1e-11 * thing.size
    assert made.group.distance_rad(thing.group.operations()).max() < 1e-9
    assert miss(made) < 1e-13


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("seed", [0, 1])
def test_noise_is_averaged_over_orbits(name: str, seed: int) -> None:
    thing = Thing(name, noise_rel=0.003, seed=seed)
    group, center = thing.misplaced(0.005, 0.002)
    made = symmetrize(Shape(points=thing.points), group, center)
    assert made.method == "vertices"
    assert made.paired == 1.0
    assert len(made.shape.points) == len(thing.points)
    assert miss(made) < 1e-13
    assert made.residual < 1e-13
    moved = np.linalg.norm(made.shape.points - thing.points, axis=1) / made.diagonal
    assert made.largest == pytest.approx(moved.max(), rel=1e-9)
    assert made.rms == pytest.approx(math.sqrt(np.mean(moved**2)), rel=1e-9)
    # Three independent errors of 0.3 % a point, of which an orbit's mean takes some away; never more than all of them.
    assert 0.0005 < made.rms < 0.003 * math.sqrt(3.0) * 1.2
    assert made.largest < 0.02


def test_the_result_is_the_nearest_one() -> None:
    """Any other symmetric set of the same pairs, about any other place, is further away."""
    thing = Thing("D3", noise_rel=0.01, seed=3)
    made = symmetrize(Shape(points=thing.points), thing.group, thing.center)
    own = made.rms
    rng = np.random.default_rng(0)
    for _ in range(20):
        turn, shift = rotation(rng.standard_normal(3), 0.003), 0.002 * thing.size * rng.standard_normal(3)
        other = (made.shape.points - made.center) @ turn.T * (1.0 + 0.002 * rng.standard_normal()) + made.center + shift
        assert math.sqrt(np.mean(np.sum((other - thing.points) ** 2, axis=1))) / made.diagonal > own


def test_a_second_time_nothing_moves() -> None:
    thing = Thing("Td", noise_rel=0.004)
    once = symmetrize(Shape(points=thing.points), thing.group, thing.center)
    twice = symmetrize(once.shape, once.group, once.center)
    assert twice.largest < 1e-13


def test_pairs_nearer_to_a_mirror_than_the_noise_stay_pairs() -> None:
    rng = np.random.default_rng(0)
    seeds = np.array([[1.0, 0.02, 0.1], [0.3, 0.9, -0.4], [0.7, 0.0, 0.8]])
    group = point_group("C4v")
    local = np.einsum("kij,mj->kmi", group.operations(), seeds).reshape(-1, 3)
    local = np.unique(np.round(local, 12), axis=0)
    for _ in range(10):
        points = local + 0.02 * rng.standard_normal(local.shape)
        made = symmetrize(Shape(points=points), group, np.zeros(3))
        assert made.method == "vertices"
        assert miss(made) < 1e-13
        assert len(np.unique(np.round(made.shape.points, 9), axis=0)) == len(local) == 20


def test_labels_are_not_exchanged() -> None:
    """A square of two kinds of atoms: what is near but of another kind is no counterpart."""
    points = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1.02, 0, 0.05], [-1.02, 0, 0.05]])
    labels = np.array([0, 1, 0, 1, 2, 2])
    made = symmetrize(Shape(points=points, labels=labels), point_group("C2v"), np.zeros(3))
    assert miss(made) < 1e-13
    np.testing.assert_array_equal(made.shape.labels, labels)
    with pytest.raises(DegenerateShapeError, match="no counterpart"):
        symmetrize(Shape(points=points, labels=labels), point_group("C4v"), np.zeros(3))


def test_weights_and_normals_are_averaged_too() -> None:
    thing = Thing("C4v", noise_rel=0.001)
    rng = np.random.default_rng(0)
    count = len(thing.points)
    weights = 1.0 + 0.1 * rng.standard_normal(count)
    radial = thing.points - thing.center
    normals = radial * np.where(rng.uniform(size=count) < 0.5, -1.0, 1.0)[:, None]
    shape = Shape(points=thing.points, weights=weights, normals=normals)
    made = symmetrize(shape, thing.group, thing.center).shape
    assert made.weights is not None
    assert made.normals is not None
    assert shape.normals is not None
    assert made.weights.sum() == pytest.approx(weights.sum())
    assert np.sum(made.normals * shape.normals, axis=1).min() > 0.9
    g = thing.group.operations()[1]
    tree = cKDTree(made.points)
    image = tree.query((made.points - thing.center) @ g.T + thing.center)[1]
    np.testing.assert_allclose(made.weights[image], made.weights, rtol=1e-12)
    along = np.abs(np.sum(made.normals[image] * (made.normals @ g.T), axis=1))
    np.testing.assert_allclose(along, 1.0, atol=1e-3)  # the group was fitted anew, by less than that


def test_points_that_coincide_stay_together() -> None:
    thing = Thing("C4v", noise_rel=0.002)
    points = np.vstack([thing.points, thing.points[:7]])
    made = symmetrize(Shape(points=points), thing.group, thing.center)
    assert made.method == "vertices"
    np.testing.assert_array_equal(made.shape.points[:7], made.shape.points[len(thing.points) :])


# --- clouds of a surface ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("sides", "name", "noise_rel"), [(4, "C4v", 0.0), (3, "C3v", 0.004), (5, "Cs", 0.002)])
def test_a_cloud_becomes_a_union_of_orbits(sides: int, name: str, noise_rel: float) -> None:
    rng = np.random.default_rng(sides)
    mesh = somewhere(table(sides), sides)
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    points, _, _ = sample_surface(mesh, 3000, rng)
    cloud = Shape(points=points + noise_rel * size * rng.standard_normal(points.shape))
    full = detect(mesh).group
    center = detect(mesh).center
    made = symmetrize(cloud, placed_subgroup(full, name), center)
    assert (made.method, made.group.name) == ("orbits", name)
    assert made.residual < 1e-13
    assert miss(made) < 1e-13
    assert len(made.shape.points) == pytest.approx(3000, rel=0.15)
    assert made.rms < max(1.5 * noise_rel, 5e-4)
    # What it covers is the surface: no part is missing, nothing stands off.
    on_mesh = closest_on(mesh, rng)(made.shape.points)
    off = np.linalg.norm(on_mesh - made.shape.points, axis=1) / size
    assert np.sqrt(np.mean(off**2)) < max(noise_rel, 1e-3)
    gaps = cKDTree(made.shape.points).query(points)[0] / size
    assert np.quantile(gaps, 0.99) < 0.03


def test_a_cloud_is_found_to_be_what_it_was_made() -> None:
    rng = np.random.default_rng(1)
    points, _, _ = sample_surface(somewhere(table(4), 5), 4000, rng)
    found = detect(points)
    assert found.point_group == "C4v"
    made = symmetrize(Shape(points=points), found.group, found.center)
    again = detect(made.shape)
    assert again.point_group == "C4v"
    assert again.group.distance_rad(made.group.operations()).max() < 2e-3


def test_a_continuous_axis_becomes_one_of_finite_order() -> None:
    rng = np.random.default_rng(2)
    angle, height = rng.uniform(0, 2 * math.pi, 4000), rng.uniform(-1, 1, 4000)
    cone = np.column_stack([np.cos(angle) * (1.5 + height), np.sin(angle) * (1.5 + height), 2.0 * height])
    turn = random_orthogonal(rng)
    made = symmetrize(Shape(points=cone @ turn.T + 3.0), point_group("Cinfv", turn.T), np.full(3, 3.0))
    assert made.group.name == "C64v"
    assert miss(made) < 1e-13
    local = (made.shape.points - made.center) @ made.group.frame.T
    np.testing.assert_allclose(np.hypot(local[:, 0], local[:, 1]), 1.5 + 0.5 * local[:, 2], atol=0.03)


# --- meshes -----------------------------------------------------------------------------------------------------------


def test_a_mesh_keeps_its_vertices_and_faces() -> None:
    mesh = somewhere(table(4), 1)
    rng = np.random.default_rng(0)
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    noisy = replace(mesh, points=mesh.points + 0.002 * size * rng.standard_normal(mesh.points.shape))
    found = detect(noisy)
    made = symmetrize(noisy, found.group, found.center)
    assert (made.method, made.group.name, made.paired) == ("vertices", "C4v", 1.0)
    np.testing.assert_array_equal(made.shape.faces, mesh.faces)
    assert miss(made) < 1e-13
    assert 0.0005 < made.rms < 0.002 * size / made.diagonal * math.sqrt(3.0)


def test_a_mesh_without_pairs_of_vertices_moves_onto_the_symmetric_surface() -> None:
    """One leg of the surface is 1 % too long; the triangles are others in every sector."""
    mesh = table(4, cut=1)
    bent = mesh.points + np.where(mesh.points[:, :1] > 0.3, [[0.025, 0.0, 0.0]], 0.0) * mesh.points[:, :1]
    shape = somewhere(replace(mesh, points=bent), 3)
    found = detect(shape)
    assert found.point_group == "C4v"
    made = symmetrize(shape, found.group, found.center)
    assert made.method == "surface"
    np.testing.assert_array_equal(made.shape.faces, mesh.faces)

    def worst(surface: Shape) -> float:
        closest = closest_on(surface, np.random.default_rng(0))
        images = [(surface.points - made.center) @ g.T + made.center for g in made.group.operations()]
        return max(float(np.linalg.norm(closest(p) - p, axis=1).max()) for p in images) / made.diagonal

    before, after = worst(shape), worst(made.shape)
    assert before > 0.005
    assert after < 0.5 * before
    assert made.residual == pytest.approx(after, rel=0.5)


def test_the_rings_of_a_lathed_mesh_give_the_fold() -> None:
    shape = somewhere(lathe(24), 6)
    found = detect(shape)
    assert found.point_group == "Cinfv"
    made = symmetrize(shape, found.group, found.center)
    assert (made.group.name, made.method) == ("C24v", "vertices")
    assert made.largest < 1e-12
    assert miss(made) < 1e-13


def test_what_is_made_exact_is_what_was_told_to_be() -> None:
    mesh = lathe(48)
    points, faces = mesh.points, mesh.faces
    for _ in range(2):
        points, faces = trimesh.remesh.subdivide(points, faces)
    shape = somewhere(replace(mesh, points=points, faces=faces), 6)
    # Midpoints of the diagonals that quads were cut along have no mirrors, but lie within faces that do.
    shape = replace(shape, points=shape.points.astype(np.float32).astype(float))
    found = symrefine.detect(shape)
    assert found.exact is not None
    made = symrefine.symmetrize(shape, found)
    assert made.group.name == found.exact.point_group == "C48v"
    assert made.residual < 1e-13


@pytest.mark.skipif(not APPLE.is_file(), reason="no shared meshes beside the repository")
def test_the_fold_of_vertices_is_taken_as_it_was_told() -> None:
    # Of the rings of an apple nearly all have 36 vertices, one has 12.
    found = symrefine.detect(APPLE)
    assert found.exact is not None
    assert symrefine.symmetrize(APPLE, found).group.name == found.exact.point_group == "C12v"


def lathe(count: int) -> Shape:
    angle = 2.0 * math.pi * np.arange(count) / count
    rings = [(1.0, 0.0), (0.7, 0.6), (0.8, 1.1), (0.4, 1.9)]
    points = np.vstack([np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(count, z)]) for r, z in rings])
    points = np.vstack([points, [0, 0, 0], [0, 0, 1.9]])
    faces = []
    for k in range(count):
        n = (k + 1) % count
        for j in range(len(rings) - 1):
            a, b, c, d = (j * count + k, j * count + n, (j + 1) * count + k, (j + 1) * count + n)
            faces += [[a, b, c], [b, d, c]]
        last = (len(rings) - 1) * count
        faces += [[n, k, len(points) - 2], [last + k, last + n, len(points) - 1]]
    return Shape(points=points, faces=np.array(faces), measure="surface")


# --- places -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GROUPS)
def test_exact_points_know_the_place_of_their_group_exactly(name: str) -> None:
    thing = Thing(name)
    group, center = exact_place(Shape(points=thing.exact), *thing.misplaced(2e-4, 1e-4))
    assert group.name == name
    assert group.distance_rad(thing.group.operations()).max() < 1e-9
    moved = np.einsum("kij,nj->kni", thing.group.operations(), thing.exact - center) + center
    assert cKDTree(thing.exact).query(moved.reshape(-1, 3))[0].max() < 1e-9 * thing.size


def test_the_place_is_left_where_points_do_not_know_it() -> None:
    thing = Thing("C4v", noise_rel=0.003)
    group, center = thing.misplaced(2e-4, 1e-4)
    assert exact_place(Shape(points=thing.points), group, center) == (group, center)


def test_the_axis_of_a_lathed_mesh_is_that_of_its_rings() -> None:
    turn = random_orthogonal(np.random.default_rng(8))
    shape = replace(lathe(24), points=lathe(24).points @ turn.T + 2.0)
    tilted = PointGroup(name="Cinfv", frame=turn.T @ rotation([1.0, 1.0, 0.0], 1e-4))
    group, center = exact_place(shape, tilted, np.full(3, 2.0) + 1e-4)
    assert group.name == "Cinfv"
    np.testing.assert_allclose(np.abs(group.frame[2] @ turn[:, 2]), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(center - 2.0, turn[:, 2]), 0.0, atol=1e-11)


# --- parts ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("whole", "part"),
    [
        ("Oh", "D3d"),
        ("Oh", "C4v"),
        ("Oh", "Td"),
        ("D6h", "D3d"),
        ("C6v", "Cs"),
        ("Ih", "D5d"),
        ("Cinfv", "C7v"),
        ("Kh", "Oh"),
    ],
)
def test_subgroups_are_found_where_the_group_stands(whole: str, part: str) -> None:
    group = point_group(whole, random_orthogonal(np.random.default_rng(4)))
    found = placed_subgroup(group, part)
    assert found.name == part
    assert is_subgroup(found, group)


@pytest.mark.parametrize(("whole", "part"), [("C4v", "C3"), ("Td", "Oh"), ("Cs", "Ci"), ("D3", "Cs")])
def test_what_is_no_subgroup_is_refused(whole: str, part: str) -> None:
    with pytest.raises(InputError, match=f"{part} is no subgroup of {whole}"):
        placed_subgroup(point_group(whole), part)


@pytest.mark.parametrize("name", ["Cs", "C5", "D6h", "S8", "Td", "Ih"])
def test_generators_generate(name: str) -> None:
    operations = point_group(name).operations()
    reached = np.eye(3)[None]
    found = generators(operations)
    assert len(found) <= 5
    for _ in range(len(operations)):
        new = np.concatenate([reached, *(reached @ operations[h] for h, _ in found)])
        reached = new[np.unique(np.round(new.reshape(-1, 9), 6) + 0.0, axis=0, return_index=True)[1]]
        if len(reached) == len(operations):
            break
    assert len(reached) == len(operations)
    for h, times in found:
        np.testing.assert_allclose(operations @ operations[h], operations[times], atol=1e-9)


def test_points_without_counterparts_are_not_closed() -> None:
    thing = Thing("C4v")
    local = (thing.exact - thing.center) / thing.size
    action = act(np.vstack([local, [[0.31, 0.22, 0.4]]]), thing.group.operations(), None, 0.02)
    assert action.closed[:-1].all()
    assert not action.closed[-1]


# --- the command ------------------------------------------------------------------------------------------------------


def written(path: Path, shape: Shape) -> Path:
    path.write_bytes(model_bytes(path.suffix, shape))
    return path


def test_the_command_writes_the_mesh_and_tells_by_how_much_it_moved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = somewhere(table(4), 8)
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    noise = 0.002 * size * np.random.default_rng(0).standard_normal(mesh.points.shape)
    path, out = written(tmp_path / "a.ply", replace(mesh, points=mesh.points + noise)), tmp_path / "b.obj"
    assert invoke(["symmetrize", str(path), "-o", str(out), "--json", str(tmp_path / "r.json")]) == 0
    shown = capsys.readouterr().out
    assert "a.ply: C4v, made exact" in shown
    assert "RMS" in shown
    record = json.loads((tmp_path / "r.json").read_text())
    assert (record["found"], record["point_group"], record["method"]) == ("C4v", "C4v", "vertices")
    assert 0.0005 < record["rms"] < record["largest"] < 0.02
    group = PointGroup(name="C4v", frame=np.array(record["frame"]))
    points = load(out).points - record["center"]
    distance = max(cKDTree(points).query(points @ g.T)[0].max() for g in group.operations())
    assert distance < 1e-11 * size
    first = out.read_bytes()
    assert invoke(["symmetrize", str(path), "-o", str(out), "--group", "Cs"]) == 0
    assert "a.ply: Cs, made exact" in capsys.readouterr().out
    assert out.read_bytes() != first


@pytest.mark.slow
def test_outliers_are_left_out_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shape = somewhere(table(4), 3)
    points, _, _ = sample_surface(shape, 4000, np.random.default_rng(1))
    center, size = points.mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0)))
    strays = center + size * np.array([[3.0, 0.5, 0.2], [0.3, -4.0, 1.0]])
    np.save(tmp_path / "a.npy", np.vstack([points, strays]))
    argv = ["symmetrize", tmp_path / "a.npy", "-o", tmp_path / "b.ply", "--json", tmp_path / "r.json"]
    assert invoke([str(word) for word in [*argv, "--picture", tmp_path / "c.png"]]) == 0
    out, err = capsys.readouterr()
    assert "; 2 outliers left out" in out
    assert "2 points were taken as outliers: they are left out" in err
    assert json.loads((tmp_path / "r.json").read_text())["outliers"] == 2
    assert np.linalg.norm(load(tmp_path / "b.ply").points - center, axis=1).max() < size
    assert invoke(["symmetrize", str(tmp_path / "b.ply"), "-o", str(tmp_path / "d.ply")]) == 0
    assert "left out" not in "".join(capsys.readouterr())


def test_a_continuous_group_is_told_to_become_finite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "a.ply", somewhere(lathe(24), 2))
    assert invoke(["symmetrize", str(path), "-o", str(tmp_path / "b.ply")]) == 0
    out, err = capsys.readouterr()
    assert "C∞v, confidence" in out
    assert "C∞v is continuous, no finite set of points has it: C24v stands for it" in err


def test_a_mesh_whose_triangles_are_not_symmetric_is_not_told_to_be_exact(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "a.ply", somewhere(table(4, cut=1), 5))
    assert invoke(["symmetrize", str(path), "-o", str(tmp_path / "b.ply"), "--json", str(tmp_path / "r.json")]) == 0
    record = json.loads((tmp_path / "r.json").read_text())
    assert (record["method"], record["residual"] > 1e-9) == ("surface", True)
    first = capsys.readouterr().out.splitlines()[0]
    between = percent(record["residual"])
    assert first.endswith(
        f"C4v, vertices moved onto the symmetric surface; the triangles between them miss by {between}"
    )


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("odd.ply -o b.ply", "is C1, nothing to make symmetric"),
        ("a.ply -o b.ply --group D5", "D5 is no subgroup of C4v"),
        ("a.ply -o b.ply --group X", "is not a point group"),
        ("a.ply -o b.glb", "cannot write .glb"),
        ("a.ply -o b.xyz", "holds no faces"),
        ("a.ply -o a.ply", "same file as the input"),
    ],
)
def test_what_cannot_be_made_symmetric_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    written(tmp_path / "a.ply", somewhere(table(4), 1))
    odd = Shape(
        points=[[0, 0, 0], [7, 0, 0], [1.5, 3, 0], [4, -1, 2]],
        faces=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]]),
        measure="surface",
    )
    written(tmp_path / "odd.ply", odd)
    monkeypatch.chdir(tmp_path)
    assert invoke(["symmetrize", *line.split()]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.ply", "odd.ply"]


def test_the_command_keeps_labels_and_leaves_out_what_it_is_told(tmp_path: Path) -> None:
    """A brick of which one half has another colour: the plane between the halves is none of its mirrors."""
    rng = np.random.default_rng(8)
    sides = rng.integers(0, 3, 3000)
    points = rng.uniform(-1.0, 1.0, (3000, 3))
    points[np.arange(3000), sides] = np.sign(points[np.arange(3000), sides])
    points = points * [1.0, 0.7, 0.4]
    table = np.column_stack([points, points[:, 0] > 0.0])
    path, out, told = tmp_path / "brick.csv", tmp_path / "exact.csv", tmp_path / "told.json"
    np.savetxt(path, table, delimiter=",", header="x,y,z,half", comments="", fmt=["%.9g"] * 3 + ["%d"])
    asked = ["symmetrize", str(path), "-o", str(out), "--json", str(told), "--labels", "half"]
    assert invoke(asked) == 0
    record = json.loads(told.read_text())
    assert (record["point_group"], record["options"]["labels"]) == ("C2v", "half")
    assert invoke([*asked, "--outliers", "none"]) == 0
    assert json.loads(told.read_text())["options"]["outliers"] == "none"
    assert invoke([*asked[:-1], "third"]) == 2
