"""The command line: what it prints, writes, refuses, and the status it ends with."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import symrefine
from symrefine.cli import batch, invoke, objects, values
from symrefine.cli.objects import Job
from symrefine.cli.rows import MAP_HEAD, ROW_HEAD, row_line, turn_rad
from symrefine.cli.tables import detection_lines, headline, partial
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.files import naming, whole
from symrefine.fleet.journal import Journal, Row
from symrefine.geometry import random_orthogonal
from symrefine.ntuples import notation
from symrefine.ntuples.affine import derive_affine
from symrefine.ntuples.derive import derive
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SIDES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
SIDES += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
SCALENE = [[0, 0, 0], [7, 0, 0], [1.5, 3, 0], [4, -1, 2]]
SCALENE_SIDES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
Run = Callable[..., tuple[int, str, str]]


def ply(points: Any, faces: Any) -> str:
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
    head += f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(repr, map(float, p))) for p in points] + [f"3 {a} {b} {c}" for a, b, c in faces]
    return head + "\n".join(rows) + "\n"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    (folder / "box.ply").write_text(ply(CUBE * [3.0, 2.0, 1.0], SIDES))
    (folder / "scalene.ply").write_text(ply(SCALENE, SCALENE_SIDES))
    cloud = np.random.default_rng(0).standard_normal((2000, 3)) ** 3
    (folder / "cloud.xyz").write_text("\n".join(" ".join(map(repr, map(float, p))) for p in cloud))
    (folder / "cut.ply").write_text(ply(CUBE, SIDES)[:-20])
    return folder


@pytest.fixture(scope="module")
def record(data: Path) -> dict[str, Any]:
    """The report of the box, made once."""
    path = data / "box.json"
    assert invoke(["detect", str(data / "box.ply"), "--json", str(path)]) == 0
    content: dict[str, Any] = json.loads(path.read_text(), parse_constant=not_json)
    return content


def not_json(name: str) -> float:
    raise AssertionError(f"{name} is not JSON")


def command(*argv: object, **settings: Any) -> "subprocess.CompletedProcess[str]":
    """A process of its own, as a shell starts it."""
    environment = os.environ | settings.pop("env", {})
    line = [sys.executable, "-m", "symrefine", *map(str, argv)]
    return subprocess.run(line, capture_output=True, text=True, env=environment, timeout=100, check=False, **settings)


def assert_refused(result: tuple[int, str, str], *parts: str) -> None:
    status, out, err = result
    assert (status, out) == (2, "")
    assert err.startswith("symrefine: ")
    assert err.count("\n") == 1, "one line"
    for part in parts:
        assert part in err


# --- detect -----------------------------------------------------------------------------------------------------------


def test_the_report_holds_what_was_agreed(record: dict[str, Any], data: Path) -> None:
    assert record["schema"] == "symrefine.detection/1"
    assert record["source"] == str(data / "box.ply")
    assert record["version"] == symrefine.__version__
    assert record["options"] == {"tolerance": 0.02, "measure": None, "seed": 0, "outliers": "auto"}
    assert (record["point_group"], record["inversion"], record["undetermined"]) == ("D2h", True, None)
    assert len(record["center"]) == 3
    assert len(record["planes"]) == len(record["axes"]) == 3
    assert 0.0 < record["confidence"] <= 1.0
    assert record["confidence"] + sum(a["probability"] for a in record["alternatives"]) <= 1.0 + 1e-9
    for alternative in record["alternatives"]:
        assert set(alternative) == {"point_group", "probability", "forgiven"}
        assert 0.0 <= alternative["forgiven"] < 1.0
    keys = "center diagonal tolerance planes axes near_misses staircase iterations ntuples timings"
    assert set(keys.split()) <= set(record)
    assert set(record["planes"][0]) == {"normal", "offset", "residual", "confidence", "sigma", "coverage"}
    axis = {"direction", "point", "order", "improper", "residual", "confidence", "sigma", "coverage"}
    assert set(record["axes"][0]) == axis
    assert record["outliers"] == {"count": 0, "clumps": 0, "share": 0.0, "floor": None}
    assert record["at_least"] is False
    assert set(record["ntuples"]) == {"kind", "singular_values", "significance"}
    assert {step["point_group"] for step in record["staircase"]} == {"D2h"}
    assert [step["tolerance"] for step in record["staircase"]] == sorted({s["tolerance"] for s in record["staircase"]})


def test_strict_ends_with_a_status_of_its_own_where_nothing_is_decided(run: Run, tmp_path: Path, data: Path) -> None:
    row = tmp_path / "row.xyz"
    row.write_text("\n".join(f"{x} {2 * x} {3 * x}" for x in range(40)))
    status, out, _ = run("detect", row, "--json", "-", "--strict")
    record = json.loads(out)
    assert (status, record["point_group"], record["confidence"]) == (3, "undetermined", 0)
    assert "line" in record["undetermined"]
    assert {step["point_group"] for step in record["staircase"]} == {"undetermined"}
    assert run("detect", row)[0] == 0
    assert run("detect", data / "box.ply", "--strict")[0] == 0


def test_stdout_holds_the_json_alone_and_equal_runs_give_equal_bytes(data: Path, record: dict[str, Any]) -> None:
    done = command("detect", data / "box.ply", "--json", "-")
    assert (done.returncode, done.stderr) == (0, "")
    again = json.loads(done.stdout, parse_constant=not_json)
    assert list(again) == list(record)

    def without_timings(text: str) -> list[str]:
        return [line for line in text.splitlines() if not line.startswith('  "timings": ')]

    assert without_timings(done.stdout) == without_timings((data / "box.json").read_text())


def test_the_table_says_it_in_words_and_without_colour(run: Run, data: Path) -> None:
    status, out, err = run("detect", data / "box.ply")
    assert (status, err) == (0, "")
    assert "D2h, three mirror planes at right angles; tolerance 2 %" in out
    assert "mirror planes: normal" in out
    assert "% of the diagonal" in out
    assert "\x1b" not in out


def test_no_symmetry_is_an_answer(run: Run, data: Path) -> None:
    status, out, _ = run("detect", data / "scalene.ply")
    assert status == 0
    assert "C1, no symmetry; tolerance 2 %, confidence " in out


def test_files_are_written_together(run: Run, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "symrefine.viewer", viewer := ModuleType("symrefine.viewer"))
    monkeypatch.setitem(sys.modules, "symrefine.report.page", page := ModuleType("symrefine.report.page"))
    viewer.record = lambda detection, _, path: path.write_text(detection.point_group)  # type: ignore[attr-defined]
    page.html_page = lambda _, shape: shape.source  # type: ignore[attr-defined]
    names = {"--json": "a.json", "--bop": "b.json", "--recording": "c.rrd", "--report": "d.html"}
    options = [str(x) for option, name in names.items() for x in (option, tmp_path / name)]
    status, out, err = run("detect", data / "box.ply", *options, "--bop-id", 7, "--bop-scale", 10)
    assert (status, err) == (0, "")
    assert [f"wrote {tmp_path / name}" in out for name in names.values()] == [True] * 4
    assert {path.name for path in tmp_path.iterdir()} == set(names.values())
    entry = json.loads((tmp_path / "b.json").read_text())["7"]
    assert (entry["size_x"], len(entry["symmetries_discrete"])) == (60.0, 3)
    assert (tmp_path / "c.rrd").read_text() == "D2h"

    def fail(_detection: object, _shape: object, path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device", str(path))

    before = {name: (tmp_path / name).read_text() for name in names.values()}
    viewer.record = fail  # type: ignore[attr-defined]
    assert_refused(run("detect", data / "scalene.ply", *options), "No space left on device")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == before


def test_the_tolerance_of_the_command_line_is_that_of_detect() -> None:
    assert values.TOLERANCE == TOLERANCE
    with pytest.raises(InputError, match=f"0, {values.LARGEST_TOLERANCE}]"):
        detect(Shape(points=CUBE), tolerance=values.LARGEST_TOLERANCE + 1e-9)


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("", "COMMAND"),
        ("detec box.ply", "detect"),
        ("--frobnicate", "COMMAND"),
        ("detect", "PATH"),
        ("detect box.ply --frobnicate", "--frobnicate"),
        ("detect box.ply --tol 0.1", "--tol"),
        ("align box.ply scalene.ply cloud.xyz --report x.html", "--report x.html: is for one object, and B names 2"),
        ("align box.ply scalene.ply --picture x.svg", "--picture x.svg: expected a name that ends in .png"),
        ("align box.ply scalene.ply --recording box.ply", "same file as the input"),
        ("align box.ply -", "-: reads stdin, which has no suffix"),
        ("align nothing.ply box.ply scalene.ply", "nothing.ply: no such file"),
        ("align box.ply *.nothing", "no file matches this pattern"),
        ("detect nothing.ply", "nothing.ply: no such file"),
        ("detect nothing", "nothing: no such file"),
        ("detect .", "is a directory"),
        ("detect box.json", "unknown suffix"),
        ("detect cut.ply", "cut.ply"),
        ("detect box.ply --tolerance x", "--tolerance: 'x' is not a fraction of the bounding-box diagonal in (0, 0.2]"),
        ("detect box.ply --tolerance 2%", "such as 0.02"),
        ("detect box.ply --tolerance 0", "--tolerance"),
        ("detect box.ply --tolerance -1", "--tolerance"),
        ("detect box.ply --tolerance 0.5", "(0, 0.2]"),
        ("detect box.ply --tolerance nan", "--tolerance"),
        ("detect box.ply --measure volume", "surface"),
        ("detect cloud.xyz --measure solid", "clouds"),
        ("detect box.ply --seed -1", "--seed: '-1' is not an integer from 0"),
        ("detect box.ply --bop m.json --bop-scale 0", "--bop-scale"),
        ("detect box.ply --bop m.json --bop-scale inf", "--bop-scale"),
        ("detect box.ply --bop m.json --bop-id x", "--bop-id"),
        ("detect box.ply --bop-id 3", "--bop-id: says how to write --bop FILE, which is not given"),
        ("detect box.ply --bop-id 0 --json x.json", "--bop-id: says how to write --bop FILE"),
        ("detect box.ply --bop-scale 1", "--bop-scale: says how to write --bop FILE"),
        ("batch . --bop-scale 1000", "--bop-scale: says how to write --bop FILE"),
        ("detect box.ply --bop -", "only --json writes to stdout"),
        ("detect box.ply --bop scalene.ply", "has the suffix of an object"),
        ("detect box.ply --json nowhere/a.json", "there is no directory nowhere"),
        ("detect box.ply --json .", "is a directory"),
        ("detect box.ply --json box.ply", "same file as the input"),
        ("detect box.ply --json ./x.json --bop x.json", "same file as that of --json"),
        ("detect ''", "PATH: is empty; expected a name"),
        ("detect box.ply '' --seed 1", "PATH: is empty"),
        ("detect box.ply --seed 1 ''", "PATH: is empty"),
        ("detect box.ply --json ''", "--json: is empty; expected FILE|-"),
        ("detect box.ply --labels=", "--labels: is empty; expected NAME"),
        ("symmetrize box.ply -o ''", "-o/--out: is empty; expected OUT"),
        ("align box.ply ''", "B: is empty; expected a name"),
        ("batch ''", "PATH: is empty; expected a name"),
        ("batch . --table ''", "--table: is empty; expected FILE"),
        ("export box.ply --to dope --out ''", "--out: is empty; expected OUT"),
        ("label . --out ''", "--out: is empty; expected FOLDER"),
        ("merge box.ply --out ''", "--out: is empty; expected FILE|DIR"),
        ("run x.yaml --out ''", "--out: is empty; expected DIR"),
        ("view ''", "FILE.rrd: is empty; expected a name"),
        ("detect box.ply --report /dev/null", "expected a file"),
        ("align box.ply", "B"),
        ("align box.ply nothing.ply", "nothing.ply: no such file"),
        ("align box.ply scalene.ply --json scalene.ply", "same file as the input"),
        ("align box.ply scalene.ply --tolerance 1", "(0, 0.2]"),
        ("derive --orders 2,3", "--dim"),
        ("derive --dim 3", "--orders"),
        ("derive --dim 3 --orders 2;3", "--orders: '2;3' is not a list of moment orders"),
        ("derive --dim 3 --orders 2,0", "such as 2,3"),
        ("derive --dim 1 --orders 2,3", "dim 1"),
        ("derive --dim 3 --orders 2,3 --latex --python", "choose one"),
        ("derive --dim 3 --orders 2,3 --latex --json -", "choose one"),
        ("derive --dim 3 --orders 2,3 --json nowhere/a.json", "there is no directory nowhere"),
        ("derive --dim 9 --orders 9,9", "monomials"),
        ("batch nowhere", "no such directory"),
        ("batch", "expected PATH, or --manifest"),
        ("batch empty", "no mesh and no cloud"),
        ("batch . --workers 0", "--workers"),
        ("batch . --tolerance 3", "--tolerance"),
        ("batch . --out box.ply", "same file as the input"),
        ("batch . --out box.json", "holds no rows"),
        ("batch . --out -", "expected a file"),
        ("view nothing.rrd", "no such file"),
        ("view box.ply", "not a recording"),
        ("view", "FILE.rrd"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    run: Run, data: Path, record: dict[str, Any], monkeypatch: pytest.MonkeyPatch, line: str, part: str
) -> None:
    assert record
    (data / "empty").mkdir(exist_ok=True)
    monkeypatch.chdir(data)
    before = {path.name: path.stat().st_mtime_ns for path in data.iterdir()}
    assert_refused(run(*(word.strip("'") for word in line.split())), part)
    assert {path.name: path.stat().st_mtime_ns for path in data.iterdir()} == before


def test_names_that_break_lines_do_not_break_the_line(run: Run) -> None:
    assert_refused(run("detect", "a\nb.ply"), "a b.ply: no such file")
    assert_refused(run("detect", "x" * 5000 + ".ply"), "name too long")


@pytest.mark.parametrize("debug", ["", "1"])
def test_a_bug_is_one_line_unless_asked_for_more(run: Run, monkeypatch: pytest.MonkeyPatch, debug: str) -> None:
    monkeypatch.setenv("SYMREFINE_DEBUG", debug)
    monkeypatch.setattr("symrefine.cli.derive._basis", lambda _: 1 // 0)
    status, out, err = run("derive", "--dim", 3, "--orders", 3)
    assert (status, out) == (70, "")
    assert "symrefine: internal error, please report it: ZeroDivisionError" in err
    assert ("Traceback" in err) is bool(debug)
    assert debug or err.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [(KeyboardInterrupt(), 130, "interrupted"), (MemoryError(), 2, "out of memory"), (BrokenPipeError(), 141, "")],
)
def test_endings_from_outside(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: BaseException, status: int, text: str
) -> None:
    def end(_: object) -> None:
        raise error

    monkeypatch.setattr("symrefine.cli.derive._basis", end)
    monkeypatch.setattr("symrefine.cli.discard", lambda _: None)
    got, out, err = run("derive", "--dim", 3, "--orders", 3)
    assert (got, out) == (status, "")
    assert text in err


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices of POSIX")
def test_a_reader_that_leaves_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    line = [sys.executable, "-m", "symrefine", "derive", "--dim", "3", "--orders", "4,5"]
    done = subprocess.run(line, stdout=write, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_told() -> None:
    line = [sys.executable, "-m", "symrefine", "derive", "--dim", "3", "--orders", "3"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (2, "symrefine: stdout: cannot be written: No space left on device\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_told_with_the_file(run: Run, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = "symrefine: /dev/full: cannot be written: No space left on device\n"
    assert run("derive", "--dim", 3, "--orders", 3, "--json", "/dev/full") == (2, "", told)
    with Path("/dev/full").open("ab", buffering=0) as full:
        journal = Journal(path=Path("/dev/full"), by="file", places={}, torn=False, descriptor=full.fileno())
        with (
            pytest.raises(InputError, match=r"^/dev/full: cannot be written: No space left on device$"),
            naming("/dev/full"),
        ):
            journal.append({"file": "a.ply"})

    def fail(*given: Any) -> None:
        with whole(Path(given[-1])):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(import_module("symrefine.viewer"), "record", fail)
    assert_refused(run("detect", data / "box.ply", "--recording", data / "b.rrd"), f"{data / 'b.rrd'}: cannot be writ")


# --- help, version, package -------------------------------------------------------------------------------------------


def test_help_names_the_commands() -> None:
    done = command("--help")
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("detect", "align", "derive", "batch", "view"):
        assert f"    {name} " in done.stdout
        assert invoke([name, "--help"]) == 0
    assert command("--version").stdout == f"symrefine {symrefine.__version__}\n"


def test_a_table_is_told_without_scipy_and_what_draws(tmp_path: Path) -> None:
    # What the command on a small mesh imports is half of the time that it takes.
    path = tmp_path / "box.obj"
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    quads = ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    path.write_text("\n".join([*corners, *quads]) + "\n", encoding="utf-8")
    source = f"""
import sys
from symrefine.cli import invoke
assert invoke(["detect", {str(path)!r}]) == 0
heavy = {{"scipy", "matplotlib", "symrefine.picture.scene", "symrefine.plane", "open3d", "rerun"}} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "D2h" in done.stdout


def test_the_package_is_imported_without_its_parts() -> None:
    source = """
import sys, symrefine
assert not {"numpy", "rich", "importlib.metadata"} & set(sys.modules), "heavy"
import symrefine.detection.story, symrefine.load.ply
assert callable(symrefine.detect) and callable(symrefine.load), "hidden by the modules of the same name"
from symrefine.detection.result import Detection
assert issubclass(symrefine.Detection, Detection)
assert all(getattr(symrefine, name) is not None for name in symrefine.__all__)
assert set(symrefine.__all__) <= set(dir(symrefine))
try:
    symrefine.nothing
except AttributeError as error:
    assert "no attribute 'nothing'" in str(error)
"""
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


# --- tables -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"point_group": "Kh"}, "Kh, sphere"),
        ({"point_group": "Cinfv"}, "Cinfv, surface of revolution"),
        ({"point_group": "Cs", "planes": [{"confidence": 0.5}], "axes": []}, "Cs, one mirror plane"),
        ({"point_group": "Ci", "planes": [], "axes": [], "confidence": 0.75},
         "Ci, an inversion centre, no mirror plane; tolerance 2 %, confidence 0.75"),
        ({"point_group": "C1", "tolerance": 0.005}, "C1, no symmetry; tolerance 0.5 %, confidence "),
        ({"point_group": "C1", "undetermined": "40 points are too few"}, "undetermined: 40 points are too few"),
        ({"point_group": "S4", "planes": [], "inversion": False, "confidence": 0.25,
          "axes": [{"improper": False, "confidence": 0.25}, {"improper": True, "confidence": 0.25}]},
         "S4, a four-fold rotoreflection axis, no mirror plane; tolerance 2 %, confidence 0.25"),
    ],
)  # fmt: skip
def test_headlines(record: dict[str, Any], changes: dict[str, Any], part: str) -> None:
    assert headline(record | changes).startswith(part)


def test_every_kind_of_element_has_its_line(record: dict[str, Any]) -> None:
    from symrefine.cli.outputs import console

    axis = record["axes"][0]
    miss = {k: axis[k] for k in ("direction", "point", "residual")} | {"excess": 1.25}
    changes = {
        "axes": [axis | {"order": "inf"}, axis | {"order": 8, "improper": True}],
        "near_misses": [miss | {"kind": k, "order": 3} for k in ("plane", "axis", "improper", "inversion")],
    }
    out = console()
    with out.capture() as capture:
        for line in detection_lines(record | changes):
            out.print(line)
        out.print(row_line("[b].ply", record | {"error": None}))
        out.print(row_line("c.ply", {"error": "no [/b]"}))
    text = capture.get()
    for part in (
        "revolution",
        "rotoreflection 8",
        " mirror ",
        "rotation 3",
        "about the centre",
        "1.25",
        "[b].ply",
        "failed: c.ply: no [/b]",
    ):
        assert part in text


def test_what_it_may_be_instead_has_a_line(record: dict[str, Any]) -> None:
    others = [("C1", 0.07, 0.0), ("D4h", 0.051, 0.03)]
    told = [{"point_group": g, "probability": p, "forgiven": f} for g, p, f in others]
    lines = [line for line in detection_lines(record | {"alternatives": told}) if isinstance(line, str)]
    assert "It may be meant otherwise: C1 (7 %); D4h (5 %), forgiving 3 %." in lines
    alone = [line for line in detection_lines(record | {"alternatives": []}) if isinstance(line, str)]
    assert not any("otherwise" in line for line in alone)


def test_no_color_means_no_escape_codes(record: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    from symrefine.cli.outputs import console

    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    out = console()
    with out.capture() as capture:
        for line in detection_lines(record):
            out.print(line)
    assert "\x1b" not in capture.get()


def test_an_inversion_alone_has_its_line_and_its_place_in_a_batch(record: dict[str, Any]) -> None:
    from symrefine.cli.outputs import console

    miss = {"mean": 0.001, "p95": 0.00321, "p99": 0.004, "max": 0.005}
    alone = record | {"point_group": "Ci", "planes": [], "axes": [], "near_misses": []}
    alone |= {"inversion_residual": miss, "inversion_confidence": 0.75, "confidence": 0.65}
    early = {name: value for name, value in alone.items() if not name.startswith("inversion_")}
    out = console()
    with out.capture() as capture:
        for line in detection_lines(alone):
            out.print(line)
    lines = capture.get().splitlines()
    assert ["about", "the", "centre", "0.100", "0.321", "0.500", "0.75"] in [line.split() for line in lines]
    assert any("misses in % of the diagonal" in line for line in lines)
    told = [row_line("a.ply", r | {"error": None}) for r in (alone, early)]
    assert told[0].split()[:5] == ["Ci", "0", "0", "0.321", "0.65"]
    assert told[1].split()[:4] == ["Ci", "0", "0", "0.65"]
    assert len(told[1].split()) == 6
    assert all(line.index("a.ply") == ROW_HEAD.index("file") for line in told)


def test_a_mirror_that_holds_as_well_as_what_was_found_is_told_so(record: dict[str, Any]) -> None:
    axis = record["axes"][0]
    miss = {k: axis[k] for k in ("direction", "point", "residual")} | {"kind": "plane", "order": 1}
    told = "One of 0.00 holds as well as what was found: the two exclude one another."
    for excess, group, is_told in ((0.001, "D2h", True), (0.001, "C1", False), (0.7, "D2h", False)):
        changed = record | {"point_group": group, "near_misses": [miss | {"excess": excess}]}
        assert (told in list(detection_lines(changed))) is is_told


def test_what_speaks_for_a_scan_is_told_in_shares(record: dict[str, Any]) -> None:
    covered = [{"supported": 0.73, "contradicted": 0.012, "unseen": 0.27}, {"supported": 0.9, "contradicted": 0.0}]
    planes = [record["planes"][0] | {"coverage": {"unseen": 0.1} | c} for c in covered]
    assert partial(record | {"planes": planes, "axes": []}).endswith(
        "at least 73 % of what was seen supports each element, at most 1.2 % contradicts it, "
        "up to 27 % has its image where nobody looked"
    )


def test_a_row_is_as_sure_as_the_answer_and_tells_why_there_is_none(record: dict[str, Any]) -> None:
    row = record | {"error": None, "confidence": 0.625}
    assert row_line("a.ply", row).split()[4] == "0.62", "that of the worst element is another one"
    alone = row | {"point_group": "C1", "planes": [], "axes": [], "inversion_residual": None}
    assert row_line("a.ply", alone).split()[:4] == ["C1", "0", "0", "0.62"]
    told = row_line("a.ply", alone | {"undetermined": "40 points are too few", "confidence": 0.0})
    assert told.split()[:4] == ["undetermined", "0", "0", f"{sum(record['timings'].values()):.2f}"], "no confidence"
    assert told.endswith("a.ply: 40 points are too few")


# --- align ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("det", [1, -1])
def test_align_finds_the_map(run: Run, data: Path, tmp_path: Path, det: int) -> None:
    matrix = random_orthogonal(np.random.default_rng(4), det=det)
    corners = np.array(SCALENE) @ matrix.T + [3.0, 4.0, 5.0]
    (tmp_path / "turned.ply").write_text(ply(corners, SCALENE_SIDES))
    status, out, err = run("align", data / "scalene.ply", tmp_path / "turned.ply", "--json", "-")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=not_json)
    assert found["schema"] == "symrefine.alignment/1"
    assert (found["status"], found["determinant"], found["observable"]) == ("ok", det, "full")
    assert found["misfit"] is False
    moved = np.array(SCALENE) @ np.transpose(found["matrix"]) + found["translation"]
    np.testing.assert_allclose(moved, corners, atol=1e-6)
    assert found["equivalents"] == [{k: found[k] for k in ("matrix", "translation")}]


def test_align_says_it_in_words(run: Run, data: Path, tmp_path: Path) -> None:
    line = ("align", data / "scalene.ply", data / "scalene.ply", "--json", tmp_path / "a.json")
    status, out, err = run(*line)
    assert (status, err) == (0, "")
    assert "scalene.ply: ok" in out
    assert "determinant +1 (rotation)" in out
    assert "determined: everything" in out
    assert json.loads((tmp_path / "a.json").read_text())["determinant"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "told"),
    [
        ((), "no orthogonal map takes the one onto the other within 2 % of the diagonal: the objects differ by"),
        (("--tolerance", 0.01, "--rotations-only"), "no rotation takes the one onto the other within 1 % of the diag"),
        (("--scale",), "no orthogonal map with any scale takes the one onto the other within 2 % of the diagonal"),
    ],
)
def test_align_does_not_tell_a_misfit_as_an_answer(
    run: Run, data: Path, tmp_path: Path, option: tuple[object, ...], told: str
) -> None:
    (tmp_path / "other.ply").write_text(ply([[0, 0, 0], [6, 3, 0], [1, -3, 1], [3, 1, 3]], SCALENE_SIDES))
    line = ("align", data / "scalene.ply", tmp_path / "other.ply", *option)
    status, out, err = run(*line, "--json", tmp_path / "a.json")
    assert (status, err) == (0, "")
    assert out.splitlines()[0].startswith(f"{data / 'scalene.ply'} onto {tmp_path / 'other.ply'}: {told}")
    assert "The closest map that was found, and no answer:" in out
    for claim in ("known", "equal to rounding", "determined"):
        assert claim not in out
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["misfit"] is True
    assert {"status", "matrix", "sigma_rad", "exact", "observable"} <= set(found)


def registry() -> Any:
    """The schemas, each under its name."""
    from referencing import Registry, Resource

    folder = Path(symrefine.__file__).parent / "schema"
    every = [Resource.from_contents(json.loads(path.read_text())) for path in folder.glob("*.json")]
    return Registry().with_resources([(str(resource.id()), resource) for resource in every])


@pytest.mark.slow
def test_align_takes_several_targets(run: Run, data: Path, tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    matrix = random_orthogonal(np.random.default_rng(4), det=-1)
    (tmp_path / "turned.ply").write_text(ply(np.array(SCALENE) @ matrix.T + [3.0, 4.0, 5.0], SCALENE_SIDES))
    (tmp_path / "other.ply").write_text(ply([[0, 0, 0], [6, 3, 0], [1, -3, 1], [3, 1, 3]], SCALENE_SIDES))
    targets = [tmp_path / "turned.ply", tmp_path / "none.ply", tmp_path / "other.ply"]
    status, out, err = run("align", data / "scalene.ply", *targets)
    assert (status, err) == (2, "")
    head, turned, missing, other = out.splitlines()
    assert head == MAP_HEAD
    assert all(row.index(str(tmp_path)) == head.index("target") for row in (turned, other))
    assert turned.split()[:4] == ["ok", "1.00", "-1", f"{np.degrees(turn_rad(matrix)):.2f}"]
    assert missing == f"failed: {tmp_path / 'none.ply'}: no such file"
    assert other.split()[0] == "misfit"
    assert other.endswith("of the diagonal"), "the reason"
    status, out, err = run("align", data / "scalene.ply", *targets, "--json", "-")
    assert (status, err) == (2, f"symrefine: {tmp_path / 'none.ply'}: no such file\n")
    found = json.loads(out, parse_constant=not_json)
    rule = json.loads((Path(symrefine.__file__).parent / "schema" / "alignments.schema.json").read_text())
    jsonschema.Draft202012Validator(rule, registry=registry()).validate(found)
    assert set(found[1]) == {"source", "target", "error"}
    alone = json.loads(run("align", data / "scalene.ply", targets[0], "--json", "-")[1])
    assert found[0] | {"timings": 0} == alone | {"timings": 0}


@pytest.mark.slow
def test_align_strict_ends_with_a_status_of_its_own(run: Run, data: Path, tmp_path: Path) -> None:
    (tmp_path / "other.ply").write_text(ply([[0, 0, 0], [6, 3, 0], [1, -3, 1], [3, 1, 3]], SCALENE_SIDES))
    one, other = data / "scalene.ply", tmp_path / "other.ply"
    targets = {(one,): 0, (other,): 3, (one, one): 0, (one, other): 3, (other, tmp_path / "none.ply"): 2}
    assert {names: run("align", one, *names, "--strict")[0] for names in targets} == targets


# --- derive -----------------------------------------------------------------------------------------------------------


def test_derive_writes_every_form(run: Run, tmp_path: Path) -> None:
    basis = derive(3, (2, 3))
    line = ("derive", "--dim", 3, "--orders", "3,2")
    assert run(*line) == (0, notation.to_text(basis), "")
    assert run(*line, "--json", "-") == (0, notation.to_json(basis), "")
    assert run(*line, "--latex", "--json", tmp_path / "a.json") == (0, notation.to_latex(basis), "")
    assert (tmp_path / "a.json").read_text() == notation.to_json(basis)
    assert run(*line, "--python") == (0, notation.to_python(basis), "")
    assert run("derive", "--dim", 2, "--orders", "2,3", "--affine")[1] == notation.to_text(derive_affine(2, (2, 3)))
    assert "no n-tuples" in run("derive", "--dim", 3, "--orders", 2)[1]


# --- batch ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def shelf(data: Path, tmp_path: Path) -> Path:
    """Two good files, a bad one, one in a directory, and things that are not for us."""
    folder = tmp_path / "shelf"
    (folder / "deep").mkdir(parents=True)
    for source, name in (
        ("box.ply", "b.ply"),
        ("scalene.ply", "A.PLY"),
        ("cut.ply", "c.ply"),
        ("box.ply", "deep/d.ply"),
    ):
        (folder / name).write_bytes((data / source).read_bytes())
    for name in ("notes.md", ".hidden.ply"):
        (folder / name).write_text("not for us")
    return folder


def rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line, parse_constant=not_json) for line in path.read_text().splitlines()]


def test_batch_goes_on_and_resumes(run: Run, shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "rows.jsonl"
    status, table, err = run("batch", shelf, "--out", out)
    assert (status, err) == (1, "symrefine: note: 1 file of other kinds not looked at (.md)\n")
    assert "3 files, 1 failed" in table
    first = rows(out)
    assert [(r["file"], r["error"] is None, r.get("point_group")) for r in first] == [
        ("A.PLY", True, "C1"),
        ("b.ply", True, "D2h"),
        ("c.ply", False, None),
    ]
    assert "c.ply" in first[2]["error"]

    done: list[str] = []
    monkeypatch.setattr(objects, "examine_file", counting(objects.examine_file, done))
    assert "3 files, 3 done before, 1 failed" in run("batch", shelf, "--out", out)[1]
    assert done == []
    out.write_bytes(out.read_bytes()[:-30])
    status, _, err = run("batch", shelf, "--out", out)
    assert "the last row is incomplete" in err
    assert done == ["c.ply"]
    assert rows(out) == first
    (shelf / "A.PLY").write_bytes((shelf / "b.ply").read_bytes())
    assert run("batch", shelf, "--out", out)[0] == 1
    assert done == ["c.ply", "A.PLY"]
    assert rows(out)[-1]["point_group"] == "D2h"
    (shelf / "c.ply").unlink()
    assert run("batch", shelf, "--out", out, "--seed", 1)[0] == 0
    assert done == ["c.ply", "A.PLY", "A.PLY", "b.ply"]


def test_two_batches_cannot_write_to_one_file(run: Run, shelf: Path, tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    out = tmp_path / "rows.jsonl"
    with batch.opened(out):
        assert_refused(run("batch", shelf, "--out", out), str(out), "another `symrefine batch` is writing")
        assert out.read_bytes() == b""
    assert run("batch", shelf, "--out", out)[0] == 1
    assert len(rows(out)) == 3


def test_a_batch_that_was_killed_leaves_no_lock(run: Run, shelf: Path, tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    out = tmp_path / "rows.jsonl"
    hold = f"""
from pathlib import Path
from symrefine.cli import batch
with batch.opened(Path({str(out)!r})):
    print("held", flush=True)
    input()
"""
    line = [sys.executable, "-c", hold]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        assert_refused(run("batch", shelf, "--out", out), "another `symrefine batch` is writing")
        holder.kill()
        holder.wait(60)
    assert run("batch", shelf, "--out", out)[0] == 1
    assert len(rows(out)) == 3


def counting(function: Callable[[objects.Job], Row], done: list[str]) -> Callable[[objects.Job], Row]:
    def counted(job: objects.Job) -> Row:
        done.append(job.name)
        return function(job)

    return counted


def test_batch_without_out_writes_nothing(
    run: Run, shelf: Path, record: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(shelf)
    monkeypatch.setattr("symrefine.cli.objects._found", lambda *_: record)
    before = sorted(shelf.rglob("*"))
    status, table, _ = run("batch", ".", "--recursive")
    assert status == 0
    assert "deep/d.ply" in table
    assert "4 files" in table
    assert sorted(shelf.rglob("*")) == before


def test_a_bug_in_one_file_does_not_end_the_others(
    run: Run, shelf: Path, tmp_path: Path, record: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def found(job: Job, *_: object) -> dict[str, Any]:
        if job.path.endswith("b.ply"):
            raise ZeroDivisionError("oh")
        return record

    monkeypatch.setattr("symrefine.cli.objects._found", found)
    assert run("batch", shelf, "--out", tmp_path / "r.jsonl")[0] == 1
    errors = {r["file"]: r["error"] for r in rows(tmp_path / "r.jsonl")}
    assert errors["A.PLY"] is errors["c.ply"] is None
    assert errors["b.ply"].endswith("internal error: ZeroDivisionError: oh")


@pytest.mark.slow
def test_workers_give_the_same_rows(shelf: Path, tmp_path: Path) -> None:
    done = command("batch", shelf, "--workers", 2, "--out", tmp_path / "r.jsonl")
    assert done.returncode == 1
    others = [line for line in done.stderr.splitlines() if "of other kinds" not in line]
    assert all(line.startswith("symrefine: detecting, ") for line in others), "a slow machine"
    assert {(r["file"], r.get("point_group")) for r in rows(tmp_path / "r.jsonl")} == {
        ("A.PLY", "C1"),
        ("b.ply", "D2h"),
        ("c.ply", None),
    }
