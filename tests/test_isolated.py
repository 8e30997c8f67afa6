"""Points that stand for themselves: atoms, markers and corners, however many, known or found out."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import symrefine
from experiments.objects.assemblies import ASSEMBLIES, cage, grain, large_molecule, ring
from experiments.objects.parts import marked_group
from experiments.objects.spread import directions
from experiments.studies.molecules import Case
from experiments.studies.molecules import run as asked
from symrefine.cli.sources import manifest
from symrefine.decide.place import told_apart
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.fit.placed import Placed
from symrefine.geometry import Array, frame_with_z, random_orthogonal, rotation
from symrefine.groups import PointGroup, point_group
from symrefine.load.objects import shape_of
from symrefine.shape import FEW, Shape
from symrefine.surface.misses import ATOM_LIMITS, needs_of_atoms
from symrefine.surface.skin import isolated_points
from symrefine.surface.surface import Surface

Run = Callable[..., tuple[int, str, str]]
# Whose group an oracle tells in no time.
SMALL = ["C320", "C319N", "C319N, aside", "tube 12", "tube 17", "ring 100", "ring 300", "salt 7", "salt 7 7 10"]
SMALL += ["grain 6 6 9", "grain 7, one odd", "shells 4"]
LARGE = [name for name in ASSEMBLIES if name not in SMALL]


def strewn(count: int, seed: int = 0) -> Array:
    """Points throughout a ball, the first ones by its rim so that sizes do not differ."""
    rng = np.random.default_rng(seed)
    away = rng.random(count) ** (1.0 / 3.0)
    points = rng.normal(size=(count, 3))
    return points * (away / np.linalg.norm(points, axis=1))[:, None]


def images(group: str, count: int, seed: int = 0) -> Array:
    """About so many points throughout a body with a group, which map onto one another."""
    operations = point_group(group, np.eye(3)).operations()
    own = strewn(count // len(operations), seed) * [1.0, 0.8, 1.3] + 0.05
    return np.einsum("kij,pj->kpi", operations, own).reshape(-1, 3)


def posed(points: Array, seed: int, scale: float = 1.0) -> Array:
    rng = np.random.default_rng(seed)
    return scale * (points @ random_orthogonal(rng).T + rng.uniform(-5, 5, 3))[rng.permutation(len(points))]


# What is said of a shape


def test_points_stand_for_themselves_where_they_are_few_or_atoms_or_it_is_said() -> None:
    many, few = np.random.default_rng(0).random((FEW + 1, 3)), np.random.default_rng(0).random((FEW, 3))
    assert not Shape(many).atoms
    assert Shape(few).atoms
    assert Shape(many, isolated=True).atoms
    assert not Shape(few, isolated=False).atoms
    assert Shape(many, labels=np.ones(FEW + 1, dtype=int), elements=True).atoms
    assert not Shape(many, labels=np.ones(FEW + 1, dtype=int)).atoms


def test_a_mesh_is_no_set_of_points() -> None:
    points, faces = np.eye(3), [[0, 1, 2]]
    assert not Shape(points, faces=np.array(faces)).atoms
    with pytest.raises(InputError, match="isolated is for clouds; a mesh has faces, leave it out"):
        Shape(points, faces=np.array(faces), isolated=True)
    with pytest.raises(InputError, match="isolated is 'yes'; expected True or False"):
        Shape(points, isolated="yes")  # type: ignore[arg-type]


def test_what_is_said_counts_before_what_an_object_says() -> None:
    molecule = Shape(np.random.default_rng(0).random((FEW + 1, 3)), labels=np.ones(FEW + 1, dtype=int), elements=True)
    assert shape_of(molecule.points, isolated=True).atoms
    with pytest.raises(InputError, match="isolated: belong to the Shape"):
        shape_of(molecule, isolated=False)


def test_files_of_molecules_are_atoms_whatever_their_labels_are(tmp_path: Path) -> None:
    places = cage(4)
    rows = "".join(f"C {x} {y} {z}\n" for x, y, z in places.tolist())
    (tmp_path / "cage.xyz").write_text(f"{len(places)}\n\n{rows}")
    np.savetxt(tmp_path / "cage.csv", places, delimiter=",", header="x,y,z", comments="")
    assert symrefine.load(tmp_path / "cage.xyz").atoms
    assert not symrefine.load(tmp_path / "cage.csv").atoms


# Large molecules


@pytest.mark.parametrize("name", SMALL)
def test_large_molecules_have_the_stated_groups(name: str) -> None:
    given = large_molecule(name)
    assert len(given.symbols) > 100
    assert marked_group(np.column_stack([given.positions, given.numbers]))[0].name == ASSEMBLIES[name][0]


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_larger_ones_have_the_stated_groups(name: str) -> None:
    test_large_molecules_have_the_stated_groups(name)


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("name", ["ring 300", "salt 7 7 10", "grain 7, one odd"])
def test_large_molecules_are_told(name: str, noise: float) -> None:
    row = asked(Case(molecule=name, noise_bond=noise, seed=4))
    assert (row["group"], row["sure"]) == (ASSEMBLIES[name][0], True)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("name", ASSEMBLIES)
def test_all_large_molecules_are_told(name: str, noise: float) -> None:
    assert asked(Case(molecule=name, noise_bond=noise, seed=11))["right"]


def test_a_ring_has_a_fold_and_is_not_round() -> None:
    for count in (60, 90):
        found = detect(Shape(posed(ring(count), count), isolated=True))
        assert (found.point_group, found.confidence > 0.95) == (f"C{count}v", True)


def test_what_has_no_name_is_round() -> None:
    """A fold of 500 has none."""
    found = detect(Shape(posed(ring(500), 5), isolated=True))
    assert found.point_group == "Cinfv"


def test_atoms_on_a_line_may_turn_about_it() -> None:
    line = np.outer([-3.0, -1.2, 1.2, 3.0], [0.1, 0.2, 0.9])
    shape = Shape(line + np.random.default_rng(0).normal(size=(4, 3), scale=1e-3), labels=np.array([8, 6, 6, 8]))
    assert detect(replace(shape, elements=True)).point_group == "Dinfh"


def test_twice_the_same_atoms_are_the_same() -> None:
    places = images("D3", 30, 3)
    shaken = places + np.random.default_rng(1).normal(size=places.shape, scale=2e-3)
    one, other = (detect(Shape(points, isolated=True)) for points in (shaken, np.repeat(shaken, 2, axis=0)))
    assert one.point_group == other.point_group == "D3"


# By more than chance


def surface_of(places: Array) -> Surface:
    size = float(np.sqrt((places**2).sum(axis=1).mean()))
    return Surface(cloud=isolated_points(places / size), diagonal=float(np.linalg.norm(np.ptp(places / size, axis=0))))


def test_of_what_stands_densely_a_turn_at_random_tells_nothing() -> None:
    surface = surface_of(grain(9, 9, 9) - grain(9, 9, 9).mean(axis=0))
    true = Placed(group=point_group("C4v", np.eye(3)), center=np.zeros(3))
    turned = Placed(group=point_group("C4v", rotation([0.3, 0.5, 0.8], 0.7)), center=np.zeros(3))
    assert told_apart(surface, true, 1e-4) > 0.99
    need = surface.need(turned.motions(), sources=600)
    assert told_apart(surface, turned, need) < 0.2


def test_a_continuous_group_leaves_each_atom_where_it_is() -> None:
    rounds = Placed(group=PointGroup(name="Cinfv", frame=frame_with_z(np.array([0.0, 0.0, 1.0]))), center=np.zeros(3))
    axis = np.column_stack([np.zeros((5, 2)), [-2.0, -1.0, 0.5, 1.0, 1.5]])
    assert told_apart(surface_of(axis), rounds, 1e-3) == 1.0
    assert told_apart(surface_of(ring(100) - [0, 0, 1]), rounds, 0.01) < 0.05
    assert told_apart(surface_of(ring(700) - [0, 0, 1]), rounds, 0.01) > 0.95


def test_of_a_surface_it_says_nothing() -> None:
    table = surface_of(strewn(300))
    table = replace(table, cloud=replace(table.cloud, body="volume"))
    placed = Placed(group=point_group("C2", np.eye(3)), center=np.zeros(3))
    assert told_apart(table, placed, 0.02) == 1.0


def test_the_farthest_of_many_is_farther_by_chance() -> None:
    """Gaussian noise at the limit of its 95th percentile is at no other limit, however many there are."""
    rng = np.random.default_rng(0)
    for count, tests in ((100, 1), (1000, 1), (1000, 40)):
        noise = np.linalg.norm(rng.normal(size=(200, count, 3)), axis=2)
        needs = needs_of_atoms(noise, tests)
        p95 = np.quantile(noise, 0.95, axis=1) / ATOM_LIMITS[1]
        assert np.mean(needs > 1.15 * p95) < 0.35 / math.sqrt(tests)
    assert needs_of_atoms(np.array([0.0] * 11 + [1.0])) == pytest.approx(1.0 / ATOM_LIMITS[-1])


# Points that nobody said anything of


@pytest.mark.parametrize("group", ["C7v", *(pytest.param(name, marks=pytest.mark.slow) for name in ("D2", "Ci"))])
def test_few_points_that_map_onto_one_another_are_told_wherever_they_are(group: str) -> None:
    """Not by the luck of rounding: in any pose, far away, and in any units."""
    places = images(group, 330, 2)
    for seed, scale in ((0, 1.0), (1, 1e4), (2, 1e-3)):
        found = detect(posed(places + 3.0 * seed, seed, scale))
        assert (found.point_group, found.at_least, found.sparse) == (group, True, True)
        assert found.confidence > 0.95
        assert not found.is_partial


def test_they_need_not_be_exact() -> None:
    places = images("D3d", 320, 1)
    shaken = places + np.random.default_rng(0).normal(size=places.shape, scale=3e-3)
    found = detect(posed(shaken, 3))
    assert (found.point_group, found.sparse) == ("D3d", True)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_points_at_random_are_not_told(seed: int) -> None:
    assert detect(posed(strewn(300 + 100 * seed, seed), seed)).undetermined


def test_nor_are_those_of_which_a_part_has_no_counterpart() -> None:
    rng = np.random.default_rng(4)
    half = rng.uniform(-1, 1, (160, 3))
    other = half * [1, 1, -1]
    other[:48] = rng.uniform(-1, 1, (48, 3))
    assert detect(posed(np.concatenate([half, other]), 4)).undetermined


def test_if_it_is_said_it_is_no_less_than_all() -> None:
    places = posed(images("D2", 330, 2), 1)
    said = detect(Shape(places, isolated=True))
    assert (said.point_group, said.at_least, said.sparse) == ("D2", False, False)
    assert detect(Shape(places, isolated=False)).undetermined


# The plane, and more dimensions


def test_a_lattice_of_markers_is_no_picture() -> None:
    """Nodes of a square grid are pixels, unless it is said that they are none."""
    grid = np.stack(np.meshgrid(np.arange(18.0), np.arange(18.0)), axis=-1).reshape(-1, 2)
    found = symrefine.detect(grid, isolated=True)
    assert found.point_group == "D4"
    assert symrefine.detect(grid[1:], isolated=True).point_group != "D4"


# The command line


@pytest.mark.slow
def test_the_command_says_what_it_was_told(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "nodes.csv"
    places = grain(6, 6, 9) + np.random.default_rng(0).normal(size=(324, 3), scale=1e-3)
    np.savetxt(file, posed(places, 2), delimiter=",", header="x,y,z", comments="")
    status, out, _ = run("detect", file, "--json", "-")
    told = json.loads(out)
    assert (status, told["point_group"], told["at_least"], told["sparse"]) == (0, "D4h", True, True)
    assert "they stand for themselves" in run("detect", file)[1]
    told = json.loads(run("detect", file, "--isolated", "--json", "-")[1])
    assert (told["point_group"], told["at_least"], told["sparse"]) == ("D4h", False, False)
    assert told["options"]["isolated"] is True
    page = tmp_path / "nodes.html"
    assert run("detect", file, "--isolated", "--report", page)[0] == 0
    assert "isolated=True" in page.read_text()


@pytest.mark.parametrize("count", [121, *(pytest.param(count, marks=pytest.mark.slow) for count in (91, 151))])
def test_atoms_spread_evenly_over_a_ball_have_their_half_turn(count: int) -> None:
    """Moments see a ball: with a little noise nothing proposed the turn, and C1 was told at 1.0."""
    rng = np.random.default_rng(count)
    places = directions(1, count, 0.0) @ random_orthogonal(rng).T
    found = detect(places + 0.002 * rng.standard_normal(places.shape))
    assert found.point_group == "C2"
    assert found.confidence > 0.95


def test_of_a_mesh_it_is_refused(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "one.off"
    file.write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    status, _, err = run("detect", file, "--isolated")
    assert (status, err.count("\n")) == (2, 1)
    assert "--isolated is for points, this is a mesh; leave it out" in err


def test_a_manifest_may_say_it(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n")
    table = tmp_path / "models.csv"
    table.write_text("path,isolated\na.xyz,yes\n")
    assert manifest(table)[0].options == {"isolated": True}
    table.write_text("path,isolated\na.xyz,no\n")
    assert manifest(table)[0].options == {"isolated": False}
    table.write_text("path,isolated\na.xyz,maybe\n")
    with pytest.raises(InputError, match=r"models.csv:2: isolated: 'maybe' is not one of yes, no"):
        manifest(table)
