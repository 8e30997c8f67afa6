"""Molecules: geometry with the stated groups and bonds, found again in any pose."""

import numpy as np
import pytest

from experiments.objects.molecule_geometry import bent, images, phenyl, pyramid, tub, turned
from experiments.objects.molecule_sets import MOLECULES, RADII, Molecule, molecule
from experiments.objects.parts import marked_group
from experiments.studies.molecules import Case, check, has_pymatgen, posed, run
from symrefine.errors import InputError
from symrefine.geometry import unit


def angle_deg(a, b):
    return np.degrees(np.arccos(unit(a) @ unit(b)))


def distances(given):
    found = np.linalg.norm(given.positions[:, None] - given.positions, axis=2)
    return found + 9 * np.eye(len(found))


def test_there_are_enough():
    assert len(MOLECULES) >= 30
    assert len({group for group, _ in MOLECULES.values()}) >= 25
    assert all(2 <= len(molecule(name).symbols) <= 100 for name in MOLECULES)


@pytest.mark.parametrize("name", MOLECULES)
def test_molecules_have_the_stated_groups(name):
    given = molecule(name)
    assert marked_group(np.column_stack([given.positions, given.numbers]))[0].name == MOLECULES[name][0]


@pytest.mark.parametrize("name", MOLECULES)
def test_no_atoms_collide_and_all_are_bonded(name):
    given = molecule(name)
    away = distances(given)
    radii = np.array([RADII[s] for s in given.symbols])
    relative = away / (radii[:, None] + radii)
    assert 0.7 < relative.min() < 1.1
    assert relative.min(axis=1).max() < 1.25


def test_textbook_lengths_and_angles():
    (_, o), (_, a), (_, b) = bent("O", "H", 0.9572, 104.52)
    assert angle_deg(a - o, b - o) == pytest.approx(104.52)
    (_, n), *hydrogens = pyramid("N", "H", 1.012, 106.7)
    assert angle_deg(hydrogens[0][1] - n, hydrogens[1][1] - n) == pytest.approx(106.7)
    carbons = np.array([p for s, p in tub("H") if s == "C"])
    bonds = np.linalg.norm(carbons - np.roll(carbons, 1, axis=0), axis=1)
    assert sorted(bonds) == pytest.approx([1.337] * 4 + [1.471] * 4, abs=1e-9)
    football = distances(molecule("C60"))
    assert np.sort(football, axis=1)[:, :3] == pytest.approx(np.tile([1.40, 1.46, 1.46], (60, 1)))
    cage = distances(molecule("B12H12"))[:12, :12]
    assert np.sort(cage, axis=1)[:, :5] == pytest.approx(1.78)
    assert np.sort(distances(molecule("dodecahedrane"))[:20, :20], axis=1)[:, :3] == pytest.approx(1.54)
    assert np.sort(distances(molecule("S8")), axis=1)[:, :2] == pytest.approx(2.06)
    assert molecule("methane").mean_bond == pytest.approx(1.087)
    assert molecule("SF6").mean_bond == pytest.approx(1.56)


def test_the_crown_of_sulphur_has_its_angle():
    atoms = molecule("S8").positions
    first, left, right = 0, *np.argsort(np.linalg.norm(atoms - atoms[0], axis=1))[1:3]
    assert angle_deg(atoms[left] - atoms[first], atoms[right] - atoms[first]) == pytest.approx(108.0)


def test_images_leave_no_atom_twice():
    assert len(images([("C", np.array([1.0, 0, 0]))], "Oh")) == 6
    assert len(images([("C", np.array([0.0, 0, 0])), ("H", np.array([0.0, 0, 0]))], "Oh")) == 2
    assert [s for s, _ in phenyl(1.5, 0.3)].count("H") == 5
    assert turned([("C", np.ones(3))], -np.eye(3), (1, 1, 1))[0][1] == pytest.approx(0.0)


def test_positions_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        Molecule(symbols=("H",), positions=np.zeros((1, 3))).positions[0] = 1.0


@pytest.mark.parametrize(
    "name", ["water", "CHFClBr", "CO", "S8", "tetrafluoro-COT", "neopentane, methyls turned", "SF6"]
)
def test_clean_molecules_are_told(name):
    row = run(Case(molecule=name, seed=3))
    assert row["right"], row


def test_elements_break_what_positions_keep():
    """Carbon monoxide by its positions alone has a mirror across."""
    assert run(Case(molecule="CO"))["group"] == "Cinfv"
    assert run(Case(molecule="HCN", tolerance=0.1))["group"] == "Cinfv"


def test_noise_is_a_fraction_of_the_bond():
    given = molecule("C60")
    still, shaken = (posed(given, Case(molecule="C60", noise_bond=n)) for n in (0.0, 0.01))
    assert np.std(shaken - still) == pytest.approx(0.01 * given.mean_bond, rel=0.2)
    assert np.linalg.norm(still - still.mean(axis=0), axis=1) == pytest.approx(
        np.linalg.norm(given.positions, axis=1), abs=1e-9
    )


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("molecule", "watr", "molecule: value is 'watr', expected one of CHFClBr, "),
        ("noise_bond", -1.0, "noise_bond: value is -1"),
        ("method", "guess", "method: value is 'guess'"),
        ("tolerance", 0.5, "tolerance: value is 0.5"),
    ],
)
def test_impossible_cases(field, value, message):
    with pytest.raises(InputError, match=message) as caught:
        check(Case(**{"molecule": "water", field: value}))
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(has_pymatgen(), reason="pymatgen is installed")
def test_without_pymatgen_it_says_so():
    with pytest.raises(InputError, match="not installed"):
        check(Case(molecule="water", method="pymatgen"))
