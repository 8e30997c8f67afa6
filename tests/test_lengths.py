"""Tolerances in units of length: what they are of the diagonal, and what is refused."""

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symrefine.cli import invoke
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal
from symrefine.lengths import object_diagonal, relative_tolerance
from symrefine.load import load
from symrefine.shape import Shape
from symrefine.units import METRES, read_length

BOX = np.array([[x, y, z] for x in (-3, 3) for y in (-2, 2) for z in (-1, 1)], dtype=float)
WATER = "3\nwater\nO 0 0 0.117\nH 0 0.757 -0.469\nH 0 -0.757 -0.469\n"
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """A command line beside a box, in nobody knows what unit, and a molecule of water."""
    monkeypatch.chdir(tmp_path)
    np.savetxt("box.csv", BOX, delimiter=",")
    Path("water.xyz").write_text(WATER)

    def call(*argv: object) -> tuple[int, str, str]:
        status = invoke([str(a) for a in argv])
        return status, *capsys.readouterr()

    return call


@given(st.floats(1e-9, 1e9), st.sampled_from([*METRES, "u"]), st.sampled_from(["", " "]))
def test_what_is_written_is_read(value: float, unit: str, between: str) -> None:
    assert read_length(f"{value!r}{between}{unit}") == (value, unit)


@pytest.mark.parametrize("text", ["", "mm", "0mm", "-1mm", "1", "1e400m", "nanmm", "1.2.3mm", "1mm2", "1 m m", "0x1m"])
def test_what_is_no_length_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"is not a length above 0 with its unit, such as 0\.5mm"):
        read_length(text)


def test_a_unit_that_is_not_known_is_answered() -> None:
    with pytest.raises(InputError, match=r"unit mmm is not known; .*did you mean mm\?"):
        read_length("1mmm")
    assert read_length("1µm") == (1.0, "um")
    assert read_length("2Å") == (2.0, "A")


def test_formats_that_say_their_unit(tmp_path: Path) -> None:
    atoms, points = "3\n\nO 0 0 0\nH 0 0.8 0.6\nH 0 -0.8 0.6\n", "0 0 0\n1 0 0\n0 1 0\n0 0 2\n"
    for text, unit in ((atoms, "A"), (points, None)):
        path = tmp_path / "a.xyz"
        path.write_text(text)
        packed = tmp_path / "a.xyz.gz"
        packed.write_bytes(gzip.compress(text.encode()))
        assert [load(file).unit for file in (path, packed)] == [unit, unit]
        assert load(path).elements is (unit == "A")


def test_the_same_length_is_the_same_fraction_in_every_unit() -> None:
    rng = np.random.default_rng(3)
    shape = Shape(points=BOX @ random_orthogonal(rng).T, source="box.ply")
    diagonal = object_diagonal(shape)
    assert diagonal == pytest.approx(2 * np.sqrt(14), rel=0.03)
    assert relative_tolerance("0.1u", shape) * diagonal == pytest.approx(0.1)
    for unit, metres in METRES.items():
        scaled = replace(shape, points=shape.points * 1e-3 / metres)
        for asked in ("0.1mm", "0.01cm", "0.0001 m"):
            found = relative_tolerance(asked, scaled, units=unit)
            assert found * diagonal == pytest.approx(0.1, rel=1e-9)
    assert relative_tolerance(0.05, shape) == 0.05


@pytest.mark.parametrize(("noise_rel", "larger"), [(0.0, 0.0), (0.005, 0.04), (0.01, 0.09)])
def test_noise_is_in_the_diagonal_of_points_and_not_in_that_of_a_detection(noise_rel: float, larger: float) -> None:
    """As docs/conventions.md says it."""
    rng = np.random.default_rng(0)
    side, points = rng.choice(3, 6000, p=np.array([6.0, 3.0, 2.0]) / 11.0), rng.random((6000, 3))
    points[np.arange(6000), side] = rng.integers(0, 2, 6000)
    points *= [1.0, 2.0, 3.0]
    shape = Shape(points=points + noise_rel * np.sqrt(14.0) * rng.standard_normal(points.shape))
    assert object_diagonal(shape) / detect(shape).diagonal == pytest.approx(1.0 + larger, abs=0.01)


def test_strays_do_not_stretch_the_diagonal() -> None:
    rng = np.random.default_rng(0)
    sphere = rng.standard_normal((4000, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    shape = Shape(points=np.vstack([sphere, [[30, 0, 0], [0, -40, 0]]]))
    assert object_diagonal(shape) == pytest.approx(2 * np.sqrt(3), rel=0.03)
    assert object_diagonal(shape, outliers="none") > 10


@pytest.mark.parametrize(
    ("asked", "units", "part"),
    [
        ("0.1mm", None, "box.ply: does not say its unit, which tolerance 0.1mm needs; give it as units"),
        ("2u", None, "of the diagonal, 7.483 in units of the file; expected at most 0.2 of it"),
        ("1mm", "yd", "units are 'yd'"),
        (0.02, "mm", "units are 'mm', for a tolerance with a unit, such as 0.5mm; 0.02 has none"),
    ],
)
def test_what_makes_no_tolerance_is_refused(asked: float | str, units: str | None, part: str) -> None:
    with pytest.raises(InputError, match=part):
        relative_tolerance(asked, Shape(points=BOX, source="box.ply"), units=units)


def test_beyond_space_there_is_no_diagonal() -> None:
    with pytest.raises(InputError, match="has 4 coordinates"):
        relative_tolerance("1u", Shape(points=np.eye(4)))


def test_the_record_says_what_was_asked_and_what_it_came_to(run: Run) -> None:
    told = [
        json.loads(run("detect", "box.csv", "--tolerance", *asked, "--json", "-")[1])
        for asked in (["0.1u"], ["0.1mm", "--units", "mm"], ["0.01cm", "--units", "mm"])
    ]
    assert [t["options"]["tolerance"] for t in told] == ["0.1u", "0.1mm", "0.01cm"]
    assert [t["options"].get("units") for t in told] == [None, "mm", "mm"]
    assert {round(t["tolerance"] * t["diagonal"], 12) for t in told} == {0.1}, "points that stand for themselves"
    assert "tolerance 0.1u, 1.34 %" in run("detect", "box.csv", "--tolerance", "0.1u")[1]
    water = json.loads(run("detect", "water.xyz", "--tolerance", "0.1A", "--json", "-")[1])
    assert water["tolerance"] * water["diagonal"] == pytest.approx(0.1)
    assert water["point_group"] == "C2v"


def test_every_command_that_takes_a_tolerance_takes_a_length(run: Run) -> None:
    asked = ("--tolerance", "0.1mm", "--units", "cm")
    found = json.loads(run("align", "box.csv", "box.csv", *asked, "--json", "-")[1])
    assert found["options"]["tolerance"] == "0.1mm"
    assert found["options"]["relative_tolerance"] == pytest.approx(0.01 / (2 * np.sqrt(14)), rel=0.03)
    other = BOX[[0, 1, 2, 4]] * [1, 1, 2]
    Path("deep").mkdir()
    np.savetxt("deep/other.csv", other, delimiter=",")
    told = run("align", "box.csv", "deep/other.csv", "--tolerance", "0.01u", "--rotations-only")[1]
    assert f"within {1 / object_diagonal(Shape(points=other)):.4g} % of the diagonal" in told
    assert run("export", "box.csv", "--to", "npz", "--out", "a.npz", *asked)[0] == 0
    assert run("symmetrize", "box.csv", "-o", "a.ply", *asked)[0] == 0
    status, out, _ = run("batch", ".", "--tolerance", "0.1mm")
    assert (status, out.count("does not say its unit")) == (1, 2), "the box and the .ply; water is in angstrom"


@pytest.mark.parametrize("text", ["0.5", "1e9mm2", "0.1 yards", "5%"])
def test_a_tolerance_that_is_none_is_refused(run: Run, text: str) -> None:
    status, out, err = run("detect", "box.csv", "--tolerance", text)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"--tolerance: '{text}'" in err
