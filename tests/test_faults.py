"""Faults that were found by attack: each ends in an answer or in one line, soon, and within little memory."""

import io
import json
import os
import resource
import subprocess
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import symrefine
from symrefine.cli import invoke
from symrefine.errors import InputError, SymrefineError
from symrefine.load import load

POSIX = pytest.mark.skipif(os.name != "posix", reason="streams and limits of POSIX")
CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
# Steers a terminal: an escape sequence, the same in one byte of Latin-1, a bell, text from right to left, a new line.
EVIL = "\x1b[31m\x9b31m\x07\u202e\n"


def ellipsoid(count: int = 600) -> np.ndarray:
    directions = np.random.default_rng(0).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None] * [1.0, 2.0, 3.0]


@pytest.mark.parametrize("far", [1e3, 1e8, 1e20, 1e40, 1e59])
@pytest.mark.parametrize("dim", [2, 3, 4])
def test_a_stray_point_ends_in_an_answer_or_a_reason(dim: int, far: float) -> None:
    directions = np.random.default_rng(0).normal(size=(300, dim))
    surface = directions / np.linalg.norm(directions, axis=1)[:, None] * np.arange(1.0, dim + 1.0)
    points = np.vstack([surface, far * np.eye(dim)[0]])
    found = symrefine.detect(points)
    assert isinstance(found.undetermined, str)


@pytest.mark.parametrize("scale", [1e-59, 1.0, 1e59])
@pytest.mark.parametrize(
    "unit", [2.0**-1060, *(pytest.param(u, marks=pytest.mark.slow) for u in (2.0**-900, 2.0**900)), 2.0**1009]
)
@pytest.mark.parametrize("points", [CUBE * [1, 2, 3], ellipsoid()], ids=["few", "many"])
def test_only_ratios_of_weights_count(points: np.ndarray, unit: float, scale: float) -> None:
    weights = np.random.default_rng(1).integers(4, 8, len(points)).astype(float)
    expected, found = (symrefine.detect(scale * points, weights=w) for w in (weights, weights * unit))
    assert found.point_group == expected.point_group
    assert found.confidence == pytest.approx(expected.confidence, rel=1e-9)


@pytest.mark.parametrize("dim", [2, 3, 4])
@pytest.mark.parametrize("count", [8, 600])
def test_one_huge_weight_ends_in_an_answer_or_one_line(count: int, dim: int) -> None:
    points = np.random.default_rng(0).normal(size=(count, dim))
    weights = np.ones(count)
    for huge, message in ((1e10, None), (1e17, "weighs more than"), (1e300, "weighs more"), (1.7e308, "may add up")):
        weights[3] = huge
        if message is None:
            assert isinstance(symrefine.detect(points, weights=weights).undetermined, str)
        else:
            with pytest.raises(SymrefineError, match=message):
                symrefine.detect(points, weights=weights)


def npz(**arrays: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


@POSIX
@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"points": np.zeros((2**23, 3), dtype=np.uint8)}, "bytes unpack to 25,"),
        ({"points": np.zeros((2**20, 3), dtype=np.uint8)}, "25,165,824 bytes as double, where 8,388,608 are allowed"),
        ({"points": CUBE, "junk": np.zeros(2**25, dtype=np.uint8)}, "holds arrays junk, points"),
    ],
    ids=["points", "small numbers", "an unused member"],
)
def test_an_archive_takes_no_more_memory_than_its_size_allows(
    tmp_path: Path, arrays: dict[str, np.ndarray], message: str
) -> None:
    (tmp_path / "a.npz").write_bytes(npz(**arrays))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=message):
        load(tmp_path / "a.npz")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**14  # KiB: 16 MiB


def test_an_array_that_is_not_there_takes_no_memory(tmp_path: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**45, 3)})
    (tmp_path / "a.npy").write_bytes(header.getvalue())
    with pytest.raises(InputError, match=r"the header gives shape \(35184372088832, 3\) of float64, .* 0 follow"):
        load(tmp_path / "a.npy")


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "its aliases stand for 3.57e+11 values; at most 100,000"),
        ("[" * 5000, "nested too deep"),
        ("- " * 5000 + "1", "nested too deep"),
        ("a: 1\n" * 20000, "has 100,000 bytes; a config has at most 65,536"),
        ("? [a, b]\n: 1\n", "keys are text, got "),
        ("? {a: b}\n: 1\n", "keys are text, got "),
        ("a: !!int x\n", "not YAML: invalid literal"),
        ("a: 2001-99-99\n", "not YAML: month must be in 1..12"),
        (f"a: {'1' * 5000}\n", "not YAML: Exceeds the limit"),
        (f'"a\\e{EVIL[:5]}": 1\n', "not YAML"),
        ('out: a\nexperiment: b\n"a\\e[31m": 1\n', "a\\x1b[31m: unknown key"),
    ],
    ids=["bomb", "brackets", "dashes", "long", "list", "mapping", "tag", "date", "digits", "ESC", "\\e"],
)
def test_configs_that_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str) -> None:
    (tmp_path / "a.yaml").write_text(text)
    assert invoke(["run", str(tmp_path / "a.yaml"), "--list"]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.removesuffix("\n").isprintable()


def printable(text: str) -> bool:
    return all(line.isprintable() for line in text.split("\n"))


@pytest.fixture(name="evil")
def _evil(tmp_path: Path) -> Path:
    """A box whose file name steers a terminal."""
    path = tmp_path / f"{EVIL}.csv"
    path.write_text("x,y,z\n" + "".join(f"{x},{2 * y},{3 * z}\n" for x, y, z in CUBE))
    return path


@pytest.mark.slow
@POSIX
def test_no_name_steers_a_terminal(tmp_path: Path, evil: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = evil.with_name(f"bad{EVIL}.xyz")
    bad.write_text(f"0 0 0\n1 {EVIL[:5]} 2\n")
    page, made = tmp_path / "a.html", tmp_path / "a.csv"
    for line in (
        ["detect", evil], ["detect", "-v", evil], ["detect", evil, bad], ["detect", "--json", "-", evil],
        ["detect", "--report", page, evil], ["detect", f"/{EVIL}"], ["detect", "--json", f"/{EVIL}/a", evil],
        ["info", evil], ["align", evil, evil], ["symmetrize", evil, "-o", made], ["batch", tmp_path],
        ["batch", tmp_path, "-v"], ["detect", evil, "--tolerance", EVIL], [EVIL], ["detect", f"--{EVIL}"],
        ["run", EVIL], ["run", "configs/table.yaml", "--list", "--set", f"{EVIL}=1"], ["view", EVIL],
    ):  # fmt: skip
        assert invoke([str(word) for word in line]) in (0, 1, 2)
        told = capsys.readouterr()
        assert printable(told.out), line
        assert printable(told.err), line
    assert "\x1b" not in page.read_text()
    found = symrefine.detect(evil)
    assert printable(str(found))
    assert printable(repr(symrefine.align(evil, evil)))
    with pytest.raises(InputError) as caught:
        symrefine.detect(bad)
    assert printable("".join(traceback.format_exception_only(caught.value)))


@POSIX
@pytest.mark.parametrize(
    ("streams", "status", "written"),
    [
        ("<&- >&- 2>&-", 0, True), ("-v 2> >(true)", 0, True), (">/dev/full", 2, True),
        ("--tolerance x 2>/dev/full", 2, False), ("--json - >&-", 2, False), ("--json - > >(true)", 141, False),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (">&-", 0, True), ("2>&-", 0, True), ("-v 2>/dev/full", 0, True), ("--tolerance x 2>&-", 2, False),
                ("--json - >/dev/full", 2, False), ("--json - >/dev/null", 0, False), ("-q >&-", 0, True),
            )
        ),
    ],
)  # fmt: skip
def test_streams_that_are_closed_or_full(tmp_path: Path, streams: str, status: int, written: bool) -> None:
    np.savetxt(tmp_path / "a.xyz", CUBE * [1, 2, 3])
    line = f"'{sys.executable}' -m symrefine detect a.xyz --json a.json {streams}"
    root = str(Path(__file__).parents[1])
    done = subprocess.run(
        ["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
        env=os.environ | {"PYTHONPATH": root},
    )  # fmt: skip
    assert done.returncode == status
    assert "internal error" not in done.stdout + done.stderr
    assert (tmp_path / "a.json").exists() == written
    if written:
        assert json.loads((tmp_path / "a.json").read_text())["point_group"] == "D2h"


@POSIX
@pytest.mark.parametrize(("more", "status"), [("", 2), ("-q", 0)])
def test_a_table_that_nobody_can_read_is_no_success(tmp_path: Path, more: str, status: int) -> None:
    """With nothing else asked for; silence is what -q asks for."""
    np.savetxt(tmp_path / "a.xyz", CUBE * [1, 2, 3])
    line = f"'{sys.executable}' -m symrefine detect a.xyz {more} >&-"
    path = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False, env=path)
    assert done.returncode == status
    assert ("standard output is closed" in done.stderr) == (status == 2)


def gltf(change: Callable[[dict], object]) -> str:
    """A triangle as glTF, with a change to its text."""
    import base64

    points, corners = np.eye(3, dtype="<f4").tobytes(), np.arange(3, dtype="<u4").tobytes()
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "buffers": [
            {"byteLength": 48, "uri": "data:;base64," + base64.b64encode(points + corners).decode()},
        ],
    }  # fmt: skip
    change(tree)
    return json.dumps(tree)


@pytest.mark.parametrize("value", [0, -1, True, 1.5, None, "3", 2**63], ids=repr)
def test_gltf_of_numbers_that_count_nothing(tmp_path: Path, value: object) -> None:
    path = tmp_path / "a.gltf"
    path.write_text(gltf(dict))
    assert load(path).faces is not None
    for change in (
        lambda tree: tree["accessors"][1].update(count=value),
        lambda tree: tree["meshes"][0]["primitives"][0].update(indices=value if value != 0 else -1),
        lambda tree: tree["nodes"].append({"mesh": value if value != 0 else 1}),
        lambda tree: tree.update(scene=value if value != 0 else -1),
    ):
        path.write_text(gltf(change))
        with pytest.raises(InputError):
            load(path)


def test_buffers_beside_gltf_are_read_as_far_as_they_are_said_to_go(tmp_path: Path) -> None:
    import base64

    path, buffer = tmp_path / "a.gltf", tmp_path / "a b.bin"
    data = base64.b64decode(json.loads(gltf(dict))["buffers"][0]["uri"].partition(",")[2])
    path.write_text(gltf(lambda tree: tree["buffers"][0].update(uri="a%20b.bin")))
    with buffer.open("wb") as stream:
        stream.write(data)
        stream.truncate(2**40)  # takes no room on the disk
    assert len(load(path).points) == 3
    buffer.write_bytes(data[:-1])
    with pytest.raises(InputError, match=r"buffer 'a%20b\.bin': has 47 bytes; expected 48, its byteLength"):
        load(path)


@POSIX
@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("pipe", "is a pipe or a device"),
        ("/dev/zero", "lies outside of the folder"),
        ("x/../../y", "lies outside of the folder"),
        ("none.bin", "no such file"),
        ("a\0b", "is no name of a file"),
        (EVIL, "no such file"),
        (5, "buffer 0 has uri '5'"),
        ("", "Is a directory"),
    ],
    ids=ascii,
)
def test_what_is_no_buffer_beside_gltf(tmp_path: Path, uri: object, said: str) -> None:
    path = tmp_path / "a.gltf"
    os.mkfifo(tmp_path / "pipe")
    path.write_text(gltf(lambda tree: tree["buffers"][0].update(uri=uri)))
    with pytest.raises(InputError, match=said) as refusal:
        load(path)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("options", [{"tolerance": "x"}, {"tolerance": None}, {"seed": -1}, {"seed": "1"}], ids=str)
def test_options_that_are_none(options: dict[str, object]) -> None:
    for call in (lambda: symrefine.detect(CUBE, **options), lambda: symrefine.align(CUBE, CUBE, **options)):
        with pytest.raises(InputError, match=f"{next(iter(options))}(:| is) "):
            call()
