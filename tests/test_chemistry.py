"""Molecules in files of chemists: what ASE writes is read, one frame is chosen, damage is told with its line."""

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from symrefine.cli import inputs, invoke
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.load import load, load_frames
from symrefine.shape import Shape

WATER = "3\nwater\nO 0 0 0\nH 0.76 0.59 0\nH -0.76 0.59 0\n"
EXTENDED = (
    '3\nLattice="9 0 0 0 9 0 0 0 9" Properties=species:S:1:pos:R:3:forces:R:3:charge:R:1:site:S:1 pbc="T T T"\n'
    "O 0 0 0 1 2 3 -0.8 a\nH 0.76 0.59 0 4 5 6 0.4 b\nH -0.76 0.59 0 7 8 9 0.4 b\n"
)
PLACES = [[0, 0, 0], [0.76, 0.59, 0], [-0.76, 0.59, 0]]


def loaded(folder: Path, text: str, name: str = "a.xyz", **options: object) -> Shape:
    (folder / name).write_text(text)
    return load(folder / name, **options)


def refusal(folder: Path, text: str, name: str = "a.xyz", **options: object) -> str:
    with pytest.raises(InputError) as caught:
        loaded(folder, text, name, **options)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert "\n" not in message
    return message.removeprefix(f"{folder / name}: ")


# .xyz


def test_extended_xyz(tmp_path: Path) -> None:
    shape = loaded(tmp_path, EXTENDED)
    assert shape.points.tolist() == PLACES
    assert shape.labels.tolist() == [8, 1, 1]
    assert loaded(tmp_path, EXTENDED, labels="site").labels.tolist() == [0, 1, 1]
    swapped = "2\nProperties=pos:R:3:Z:I:1:mass:R:1\n0 0 0 8 16\n1 0 0 1 1\n"
    assert loaded(tmp_path, swapped).labels.tolist() == [8, 1]
    assert loaded(tmp_path, swapped, weights="mass").weights.tolist() == [16, 1]


@pytest.mark.parametrize("kind", ["xyz", "extxyz"])
def test_what_ase_writes(tmp_path: Path, kind: str) -> None:
    ase = pytest.importorskip("ase")
    write = pytest.importorskip("ase.io").write
    rng = np.random.default_rng(0)
    frames = [ase.Atoms("CH3OH", rng.normal(size=(6, 3)), cell=np.eye(3) * 9, pbc=True) for _ in range(4)]
    for atoms in frames:
        atoms.set_initial_charges(rng.normal(size=6))
        atoms.set_velocities(rng.normal(size=(6, 3)))
    write(tmp_path / "a.xyz", frames, format=kind)
    for number, atoms in enumerate(frames):
        shape = load(tmp_path / "a.xyz", frame=number)
        np.testing.assert_allclose(shape.points, atoms.positions, rtol=0, atol=1e-8)
        assert shape.labels.tolist() == atoms.numbers.tolist()


def test_frames_are_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    second = WATER.replace("O 0", "S 9")
    for text in (WATER + second, WATER + "\n\n" + second, WATER.replace("water", "") + second + "\n"):
        assert [loaded(tmp_path, text, frame=k).labels.tolist() for k in (0, 1)] == [[8, 1, 1], [16, 1, 1]]
    assert loaded(tmp_path, WATER, frame=0).points.tolist() == PLACES
    assert "holds 2 frames; choose one with frame (--frame), from 0 to 1" in refusal(tmp_path, WATER * 2)
    assert "frame is 2; the file has 2 frames, from 0 to 1" in refusal(tmp_path, WATER * 2, frame=2)
    assert "frame is 1; the file has one of the frames, number 0" in refusal(tmp_path, WATER, frame=1)
    assert "frame is -1" in refusal(tmp_path, WATER * 2, frame=-1)
    with pytest.raises(InputError, match="frame is True; expected a whole number from 0, or None"):
        load(tmp_path / "a.xyz", frame=True)
    assert "a frame is chosen of molecules and volumes only: " in refusal(tmp_path, "0,0\n1,1\n", "a.csv", frame=0)
    path = tmp_path / "a.xyz"
    path.write_text(WATER * 2)
    assert invoke(["info", str(path)]) == 2
    assert f"{path}: holds 2 frames; choose one with frame (--frame)" in capsys.readouterr().err
    assert invoke(["info", str(path), "--frame", "1"]) == 0
    assert "a.xyz: points in 3 dimensions, 3 points" in capsys.readouterr().out
    assert invoke(["detect", str(path), "--frame", "1", "--json", "-"]) == 0
    assert '"frame": 1' in capsys.readouterr().out
    assert detect(load(path, frame=1)).point_group == "C2v"


def test_damage_is_told_in_any_frame(tmp_path: Path) -> None:
    assert "line 11 declares 4 atoms; 3 follow from line 13 on" in refusal(tmp_path, WATER * 2 + "4" + WATER[1:])
    assert "line 11 declares 3 atoms; 0 follow from line 13 on" in refusal(tmp_path, WATER * 2 + "3\n", frame=0)
    assert "line 8 is empty" in refusal(tmp_path, WATER + "3\nwater\n\nO 0 0 0\nH 0 0 1\n", frame=0)
    assert "line 9, column 2: 'x' is not a number" in refusal(tmp_path, WATER + WATER.replace("0.76", "x", 1), frame=1)


def test_atoms_without_their_number(tmp_path: Path) -> None:
    shape = loaded(tmp_path, "# water\n" + WATER.split("\n", 2)[2])
    assert (shape.points.tolist(), shape.labels.tolist()) == (PLACES, [8, 1, 1])
    bare = "C 0 0 0\nO 1 0 0\n"
    assert "line 2: 'Q' is no element" in refusal(tmp_path, bare.replace("O", "Q"))
    assert "line 1: 'x' is no element" in refusal(tmp_path, "x 0 0 0\ny 1 1 1\n")
    assert "line 2 has 3 columns; expected an element and x y z" in refusal(tmp_path, "C 0 0 0\n6 0 0\n")
    assert "line 1 has 4 columns; expected 3 columns" in refusal(tmp_path, "6 0 0 0\n8 1 0 0\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("forces:R:3", "forces:R:4", "line 3 has 9 columns; expected 10 columns: species pos forces charge site"),
        ("pos:R:3", "pos:R:2", "line 2: Properties='species:S:1:pos:R:2:forces:R:3:charge...'; expected as species"),
        ("species:S:1", "species:S", "expected as species:S:1:pos:R:3"),
        ("charge:R:1", "charge:Q:1", "expected as species:S:1:pos:R:3"),
        ("charge:R:1", "pos:R:1", "expected as species:S:1:pos:R:3"),
        ("charge:R:1", "charge:R:999999999999", "expected as species:S:1:pos:R:3"),
        ("species", "name", "expected species:S:1 (or Z:I:1) among them"),
        ("O 0 0 0 1 2", "O 0 0 0 1 x", "line 3, column 6: 'x' is not a number; expected 9 columns: species pos"),
        ("O 0 0 0 1 2 3 ", "O 0 0 0 ", "line 3 has 6 columns"),
        ("H 0.76", "H inf", "point 1 (line 4) is [inf, 0.59, 0.0]"),
    ],
)
def test_extended_xyz_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in refusal(tmp_path, EXTENDED.replace(old, new, 1))


# .mol, .sdf

MOL = """water
  made by a test    3D
a remark, maybe empty
  3  2  0  0  0  0  0  0  0  0999 V2000
    0.0000    0.0000    0.0000 O   0  0  0  0  0  0  0  0  0  0  0  0
    0.7600    0.5900    0.0000 H   0  0  0  0  0  0  0  0  0  0  0  0
   -0.7600    0.5900    0.0000 H   0  0  0  0  0  0  0  0  0  0  0  0
  1  2  1  0
  1  3  1  0
M  CHG  1   1   0
M  END
"""
V3000 = """water

remark
  0  0  0     0  0            999 V3000
M  V30 BEGIN CTAB
M  V30 COUNTS 3 2 0 0 0
M  V30 BEGIN ATOM
M  V30 1 O 0 0 0 0
M  V30 2 H 0.76 0.59 0 0
M  V30 3 H -0.76 0.59 0 0 MASS=1
M  V30 END ATOM
M  V30 BEGIN BOND
M  V30 1 1 1 2
M  V30 2 1 1 3
M  V30 END BOND
M  V30 END CTAB
M  END
"""


@pytest.mark.parametrize("text", [MOL, V3000], ids=["V2000", "V3000"])
def test_molfiles(tmp_path: Path, text: str) -> None:
    for name, data in (("a.mol", text), ("a.sdf", text + "> <ENERGY>\n1.0\n\n$$$$\n"), ("b.mol", text[5:])):
        shape = loaded(tmp_path, data, name)
        assert (shape.points.tolist(), shape.labels.tolist()) == (PLACES, [8, 1, 1])
    two = text + "$$$$\n" + text.replace(" O ", " S ") + "$$$$\n\n"
    assert [loaded(tmp_path, two, "a.sdf", frame=k).labels[0] for k in (0, 1)] == [8, 16]
    assert "holds 2 molecules; choose one with frame" in refusal(tmp_path, two, "a.sdf")


def test_ase_reads_molfiles_alike(tmp_path: Path) -> None:
    read = pytest.importorskip("ase.io").read
    shape = loaded(tmp_path, MOL, "a.mol")
    atoms = read(tmp_path / "a.mol", format="mol")
    assert np.array_equal(shape.points, atoms.positions)
    assert shape.labels.tolist() == atoms.numbers.tolist()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (MOL, MOL[:-8], "cut off: the molecule that begins in line 1 has no line 'M  END'"),
        (MOL, MOL[:20], "cut off after line 2; expected three lines of a header"),
        ("  3  2  0", "  4  2  0", "line 4 declares 4 atoms and 2 bonds; 5 lines of them follow"),
        ("  3  2  0", "  2  3  0", "line 7: '   -0.7600    0.5900    0.0000 H   0 ...'; expected a bond"),
        ("  3  2  0", "  x  2  0", "expected the numbers of atoms and bonds in columns 1 to 6"),
        ("V2000", "V1000", "line 4: version 'V1000'; expected V2000 or V3000 from column 34 on"),
        ("    0.7600", "    0.7x00", "line 6: x is '    0.7x00', which is not a number"),
        ("    0.7600", "          ", "line 6: x is '          ', which is not a number"),
        ("    0.7600", "       nan", "point 1 (line 6) is [nan, 0.59, 0.0]"),
        ("0.0000 O ", "0.0000 R#", "line 5: 'R#' is no element; expected a symbol"),
        ("  1  3  1", "  1  4  1", "line 9: '  1  4  1  0'; expected a bond of two of the atoms 1 to 3"),
        ("    3D", "    2D", "line 2: is marked 2D and has no heights: a drawing"),
    ],
)
def test_molfiles_that_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in refusal(tmp_path, MOL.replace(old, new, 1), "a.mol")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("COUNTS 3", "COUNTS 4", "line 6 declares 4 atoms; 3 follow"),
        ("COUNTS 3", "COUNTS x", "line 4: V3000 needs one line 'M  V30 COUNTS' with a number of atoms"),
        ("END ATOM", "END ATOMS", "line 6: expected one block of atoms, from 'BEGIN ATOM' to 'END ATOM', behind it"),
        ("H 0.76", "H o.76", "line 9: x is 'o.76', which is not a number"),
        ("H 0.76 0.59 0 0", "H 0.76 0.59 -", "line 9: expected a number, a symbol, x y z and a map number"),
        ("1 O", "1 [O,N]", "line 8: '[O,N]' is no element"),
    ],
)
def test_v3000_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in refusal(tmp_path, V3000.replace(old, new, 1), "a.mol")


# .pdb

PDB = """\
HEADER    TEST
ATOM      1  N   ALA A   1      11.104   6.134  -6.504  0.50  0.00           N
ATOM      2  CA  ALA A   1      11.639   6.071  -5.147  1.00  0.00           C
HETATM    3 CA    CA B   2      12.639   6.071  -5.147  1.00  0.00          CA
TER
END
"""


def models(text: str) -> str:
    lines = text.splitlines(keepends=True)[1:4]
    shifted = [line.replace("  6.071", "  7.071") for line in lines]
    return "".join(["MODEL        1\n", *lines, "ENDMDL\nMODEL        2\n", *shifted, "ENDMDL\nEND\n"])


def test_pdb(tmp_path: Path) -> None:
    shape = loaded(tmp_path, PDB, "a.pdb")
    assert shape.points.tolist() == [[11.104, 6.134, -6.504], [11.639, 6.071, -5.147], [12.639, 6.071, -5.147]]
    assert shape.labels.tolist() == [7, 6, 20]
    bare = "".join(line[:66].rstrip() + "\n" for line in PDB.splitlines())
    assert loaded(tmp_path, bare, "a.pdb").labels.tolist() == [7, 6, 20]
    assert loaded(tmp_path, PDB, "a.pdb", labels="chain").labels.tolist() == [0, 0, 1]
    assert loaded(tmp_path, PDB, "a.pdb", weights="occupancy").weights.tolist() == [0.5, 1, 1]
    assert [loaded(tmp_path, models(PDB), "a.pdb", frame=k).points[1, 1] for k in (0, 1)] == [6.071, 7.071]
    assert "holds 2 models; choose one with frame" in refusal(tmp_path, models(PDB), "a.pdb")


def test_places_of_one_atom_need_weights(tmp_path: Path) -> None:
    text = PDB.replace("  CA  ALA", "  CA AALA")
    assert loaded(tmp_path, text, "a.pdb").points.shape == (3, 3)  # what has one place only is no alternative
    lines = text.splitlines(keepends=True)
    text = "".join([*lines[:3], lines[2].replace("AALA", "BALA").replace("  6.071", "  6.571"), *lines[3:]])
    assert "line 3: an atom has alternative places, here 'A'; keep one of them, or take" in refusal(
        tmp_path, text, "a.pdb"
    )
    assert loaded(tmp_path, text, "a.pdb", weights="occupancy").points.shape == (4, 3)


@pytest.mark.parametrize("seed", range(3))
def test_gemmi_and_we_read_pdb_alike(tmp_path: Path, seed: int) -> None:
    gemmi = pytest.importorskip("gemmi")
    rng = np.random.default_rng(seed)
    structure = gemmi.Structure()
    structure.add_model(gemmi.Model(1))
    structure[0].add_chain(gemmi.Chain("A"))
    residue = gemmi.Residue()
    residue.name, residue.seqid = "LIG", gemmi.SeqId("1")
    for k in range(20):
        atom = gemmi.Atom()
        atom.element = gemmi.Element(int(rng.integers(1, 80)))
        atom.name = f"{atom.element.name}{k}"[:4]
        atom.pos = gemmi.Position(*rng.uniform(-99, 99, size=3))
        residue.add_atom(atom)
    structure[0][0].add_residue(residue)
    structure.setup_entities()
    read = gemmi.read_pdb_string(structure.make_pdb_string())
    atoms = [a for model in read for chain in model for r in chain for a in r]
    for name, text in (("a.pdb", structure.make_pdb_string()), ("a.cif", structure.make_mmcif_document().as_string())):
        shape = loaded(tmp_path, text, name)
        np.testing.assert_allclose(shape.points, [a.pos.tolist() for a in atoms], rtol=0, atol=2e-3)
        assert shape.labels.tolist() == [a.element.atomic_number for a in atoms]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("   6.134", "   6.x34", "line 2: y is '   6.x34' in columns 39 to 46; expected a number"),
        ("   6.134", "        ", "line 2: y is '        ' in columns 39 to 46; expected a number"),
        ("   6.134", "     nan", "line 2: y is '     nan' in columns 39 to 46; expected a number with three decimals"),
        ("      N\n", "      Q\n", "line 2, columns 77 and 78: 'Q' is no element"),
        ("N   ALA A   1      11.104   6.134  -6.504", "N   ALA A   1      11.104   6.134", "line 2: z is"),
        (PDB, PDB[:60], "line 2: y is '   6.13' in columns 39 to 46"),
        (PDB, "garbage\n", "no line ATOM or HETATM; not a PDB file"),
        (PDB, models(PDB)[:-11], "cut off: the model that begins in line 6 has no ENDMDL"),
        (
            PDB,
            models(PDB).replace("ENDMDL\n", "", 1),
            "line 5: MODEL, but the model that begins in line 1 has no ENDMDL",
        ),
        (PDB, models(PDB) + PDB, "line 13: an atom outside of the models"),
        (
            PDB,
            PDB.replace(" CA  ALA", "HG11 ALA").replace("          C\n", "\n"),
            "line 3: columns 77 and 78 name no elem",
        ),
    ],
)
def test_pdb_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in refusal(tmp_path, PDB.replace(old, new, 1), "a.pdb")


# .cif

CIF = """\
data_water
_cell_length_a 10
_cell_length_b 11
_cell_length_c 12.0(1)
_cell_angle_alpha 90
_cell_angle_beta 100
_cell_angle_gamma 90
_symmetry_space_group_name_H-M 'P 1'
loop_
_atom_site_label
_atom_site_type_symbol
_atom_site_fract_x
_atom_site_fract_y
_atom_site_fract_z
O1 O2- 0.1 0.2 0.3(2)
H1 H 0.2 0.2 0.3
H2 H 0.1 0.3 0.3
"""


def test_cif_of_a_crystal(tmp_path: Path) -> None:
    pytest.importorskip("gemmi")
    shape = loaded(tmp_path, CIF, "a.cif")
    beta = np.radians(100)
    axes = np.array([[10, 0, 0], [0, 11, 0], [12 * np.cos(beta), 0, 12 * np.sin(beta)]])
    np.testing.assert_allclose(shape.points, np.array([[1, 2, 3], [2, 2, 3], [1, 3, 3]]) / 10 @ axes, atol=1e-12)
    assert shape.labels.tolist() == [8, 1, 1]
    two = CIF + CIF.replace("water", "other").replace("H 0.2", "H 0.4")
    assert loaded(tmp_path, two, "a.cif", frame=1).points[1, 0] > 3
    assert "holds 2 models" in refusal(tmp_path, two, "a.cif")


def test_ase_and_we_read_cif_alike(tmp_path: Path) -> None:
    pytest.importorskip("gemmi")
    ase = pytest.importorskip("ase")
    atoms = ase.Atoms("CH3OH", np.random.default_rng(0).random((6, 3)) * 5, cell=[6, 7, 8, 80, 95, 110], pbc=True)
    atoms.write(tmp_path / "a.cif", wrap=False)
    shape = load(tmp_path / "a.cif")
    lengths = [np.linalg.norm(p[:, None] - p, axis=2) for p in (shape.points, atoms.positions)]
    np.testing.assert_allclose(*lengths, atol=1e-5)
    assert shape.labels.tolist() == atoms.numbers.tolist()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.2 0.3(2)", "0.2 0.3(x)", "atom 1 ('O1'): fract_z is '0.3(x)'; expected a number"),
        ("0.2 0.3(2)", "? 0.3(2)", "atom 1 ('O1'): fract_y is '?'; expected a number"),
        ("0.2 0.3(2)", "nan 0.3(2)", "point 0 is [nan"),
        ("O2-", "Qq", "atom 1 ('O1'): 'Qq' is no element"),
        ("H2 H 0.1 0.3 0.3", "H2 H 0.1 0.3", "not a whole CIF file: 'string:"),
        ("'P 1'", "'P 21/c'", "block 'water': a crystal of space group 'P 21/c', of which only the atoms"),
        ("length_a 10", "length_a ?", "block 'water': cell '? 11 12.0(1) 90 100 90'; expected three lengths"),
        ("beta 100", "beta 190", "expected three lengths and three angles"),
        ("alpha 90", "alpha 179", "block 'water': cell '10 11 12.0(1) 179 100 90' has no volume"),
        (CIF, "data_x\n_a 1\n", "holds no coordinates of atoms"),
        (CIF, "garbage\n", "not a whole CIF file"),
    ],
)
def test_cif_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    pytest.importorskip("gemmi")
    assert message in refusal(tmp_path, CIF.replace(old, new, 1), "a.cif")


def test_disorder_needs_weights(tmp_path: Path) -> None:
    pytest.importorskip("gemmi")
    heads = "_atom_site_disorder_group\n_atom_site_occupancy\n"
    text = CIF.replace("fract_z\n", "fract_z\n" + heads).replace("0.3(2)\n", "0.3(2) . 1\n")
    text = text.replace("0.2 0.3\n", "0.2 0.3 1 0.7\n").replace("0.3 0.3\n", "0.3 0.3 2 0.3\n")
    assert "atoms are in several places, disorder groups '1 2'; keep one of them" in refusal(tmp_path, text, "a.cif")
    assert loaded(tmp_path, text, "a.cif", weights="occupancy").weights.tolist() == [1, 0.7, 0.3]


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gemmi", None)
    assert "gemmi is needed to read it and is not installed: pip install 'symrefine[chem]'" in refusal(
        tmp_path, CIF, "a.cif"
    )


def told(argv: list[object], capsys: pytest.CaptureFixture[str]) -> tuple[int, Any]:
    """Status of a command line, and the JSON it wrote; seconds and names apart."""
    status = invoke([*map(str, argv), "--json", "-"])
    records = json.loads(capsys.readouterr().out)
    for record in records if isinstance(records, list) else [records]:
        record.pop("timings", None)
    return status, records


@pytest.mark.parametrize(("name", "text"), [("a.xyz", WATER + WATER.replace("O 0", "S 9")), ("b.sdf", MOL * 2)])
def test_each_frame_is_an_object_of_its_own(
    tmp_path: Path, name: str, text: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = text.replace("M  END\n", "M  END\n$$$$\n")
    path = tmp_path / name
    path.write_text(text)
    status, each = told(["detect", path], capsys)
    alone = [told(["detect", path, "--frame", k], capsys)[1] for k in (0, 1)]
    assert status == 0
    assert [record.pop("source") for record in each] == [f"{path}#0", f"{path}#1"]
    assert {record.pop("source") for record in alone} == {str(path)}
    assert each == alone
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    status, piped = told(["detect", "-", "--format", path.suffix], capsys)
    assert [record.pop("source") for record in piped] == ["stdin#0", "stdin#1"]
    assert (status, piped) == (0, alone)


def test_a_frame_that_fails_does_not_end_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, other = tmp_path / "a.xyz", tmp_path / "b.xyz"
    path.write_text(WATER + WATER.replace("O 0", "Qq 0") + WATER)
    other.write_text(WATER)
    assert invoke(["detect", str(path), str(other)]) == 2
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split()[0] == "group"
    assert [line.split()[0] for line in lines] == ["C2v", "failed:", "C2v", "C2v"]
    assert [line.split()[-1] for line in (lines[0], *lines[2:])] == [f"{path}#0", f"{path}#2", str(other)]
    assert f"{path}#1: line 8: 'Qq' is no element" in lines[1]
    for option, name in (("--report", "a.html"), ("--picture", "a.png"), ("--recording", "a.rrd"), ("--bop", "a.json")):
        assert invoke(["detect", str(path), option, str(tmp_path / name)]) == 2
        assert f"is for one object, and {path} holds 3; " in capsys.readouterr().err
        assert not (tmp_path / name).exists()


def test_more_frames_than_are_kept_at_once_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inputs, "FRAMES", 2)
    path = tmp_path / "a.xyz"
    path.write_text(WATER * 3)
    assert invoke(["detect", str(path)]) == 2
    assert capsys.readouterr().err == f"symrefine: {path}: holds 3 frames, more than 2; choose one with --frame\n"
    assert invoke(["detect", str(path), "--frame", "2"]) == 0


def test_frames_of_one_file_are_aligned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.xyz"
    turned = "3\nwater\nO 0 0 0\nH 0.59 0 0.76\nH 0.59 0 -0.76\n"
    path.write_text(WATER + turned)
    status, record = told(["align", path, path, "--source-frame", 0, "--target-frame", 1], capsys)
    assert (status, record["status"], record["options"]["target_frame"]) == (0, "ok", 1)
    # Each frame of the target is a target of its own; the source is one.
    assert invoke(["align", str(path), str(path), "--source-frame", "0"]) == 0
    out = capsys.readouterr().out
    assert all(f"a.xyz#{k}" in out for k in (0, 1))
    assert invoke(["align", str(path), str(path)]) == 2
    err = capsys.readouterr().err
    assert err == f"symrefine: {path}: holds 2 frames; choose one with --source-frame, from 0 to 1\n"


def test_load_frames_makes_what_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.xyz"
    path.write_text(WATER + WATER.replace("O 0", "Qq 0") + WATER)
    frames = load_frames(path)
    assert len(frames) == 3
    assert [shape.source for shape in (frames[0], frames[-1], *frames[:1])] == [f"{path}#{k}" for k in (0, 2, 0)]
    assert frames[2].points.tolist() == load(path, frame=2).points.tolist()
    with pytest.raises(InputError, match=r"a\.xyz#1: line 8"):
        list(frames)
    with pytest.raises(IndexError):
        frames[3]
    path.write_text(WATER)
    only = load_frames(path)[0]
    assert (only.source, only.unit, only.elements) == (str(path), "A", True)
