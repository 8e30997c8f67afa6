"""Molecules in files of chemists: what ASE writes is read, one frame is chosen, damage is told with its line."""

from pathlib import Path

import numpy as np
import pytest

from symrefine.cli import invoke
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.load import load
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
    assert invoke(["detect", str(path)]) == 2
    assert "choose one with frame (--frame)" in capsys.readouterr().err
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
