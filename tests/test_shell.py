"""The command line at hand: several files, stdin, how loud it is, signs of life, slips of the pen."""

import io
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from shutil import which
from threading import Thread

import numpy as np
import pytest
from PIL import Image

from symrefine.cli import invoke, signs
from symrefine.clock import Clock, watched

BOX = np.array([[x, y, z] for x in (-3, 3) for y in (-2, 2) for z in (-1, 1)], dtype=float)
SCALENE = np.array([[0, 0, 0], [7, 0, 0], [1.5, 3, 0], [4, -1, 2]])
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Here: a box, a tetrahedron without symmetry, points on a line, and a file that is cut."""
    np.savetxt(tmp_path / "box.xyz", BOX)
    np.savetxt(tmp_path / "scalene.xyz", SCALENE)
    np.savetxt(tmp_path / "row.csv", np.outer(np.arange(9.0), [1, 2, 3]), delimiter=",")
    (tmp_path / "cut.ply").write_text("ply\nformat ascii 1.0\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(folder: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Status, stdout and stderr of a command line in this process, among these files."""
    assert folder == Path.cwd()

    def call(*argv: object) -> tuple[int, str, str]:
        status = invoke([str(a) for a in argv])
        return status, *capsys.readouterr()

    return call


def give(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))


def assert_refused(result: tuple[int, str, str], *parts: str) -> None:
    status, out, err = result
    assert (status, out) == (2, "")
    assert err.startswith("symrefine: ")
    assert err.count("\n") == 1, "one line"
    for part in parts:
        assert part in err


# --- several files ----------------------------------------------------------------------------------------------------


def test_several_files_have_a_line_each_and_one_that_fails_does_not_end_the_others(run: Run) -> None:
    status, out, err = run("detect", "box.xyz", "cut.ply", "scalene.xyz")
    assert (status, err) == (2, "")
    head, *lines = out.splitlines()
    assert head.split()[0] == "group"
    assert [line.split()[0] for line in lines] == ["D2h", "failed:", "C1"]
    assert [name in line for name, line in zip(("box.xyz", "cut.ply", "scalene.xyz"), lines, strict=True)] == [True] * 3
    assert run("detect", "box.xyz", "scalene.xyz")[0] == 0
    assert run("detect", "box.xyz", "--seed", 1, "scalene.xyz")[1].count("\n") == 3, "options may stand between"
    assert run("detect", "box.xyz", "row.csv")[0] == 0
    assert run("detect", "box.xyz", "row.csv", "--strict")[0] == 3
    assert run("detect", "cut.ply", "row.csv", "--strict")[0] == 2


def test_patterns_that_no_shell_expanded(run: Run, folder: Path) -> None:
    (folder / "deep").mkdir()
    (folder / "box[1].xyz").write_bytes((folder / "box.xyz").read_bytes())
    (folder / "deep" / "a.xyz").write_bytes((folder / "box.xyz").read_bytes())
    lines = run("detect", "*.xyz", "row.csv")[1].splitlines()[1:]
    names = ["box.xyz", "box[1].xyz", "scalene.xyz"]
    assert [line.split()[-1] for line in lines[:3]] == names
    assert "  row.csv: " in lines[3], "with the reason why nothing is decided"
    assert run("detect", "box[1].xyz")[1].startswith("box[1].xyz: D2h"), "a file of that name is no pattern"
    assert len(run("detect", "**/*.xyz")[1].splitlines()) == 5
    assert_refused(run("detect", "*.stl"), "*.stl: no file matches this pattern")


@pytest.mark.parametrize(
    "line", ["info {}", "symmetrize {} -o box.xyz", "export {} --to bop --out box.xyz", "align {} box.xyz"]
)
def test_patterns_where_one_file_is_taken(run: Run, folder: Path, line: str) -> None:
    before = (folder / "box.xyz").read_bytes()
    assert_refused(run(*line.format("*.stl").split()), "*.stl: no file matches this pattern")
    assert_refused(run(*line.format("*.xyz").split()), "*.xyz: 2 files match this pattern; name one of them")
    (folder / "b[1].xyz").write_bytes((folder / "box.xyz").read_bytes())
    status, out, err = run(*line.format("bo*.xyz").split())
    if "info" in line or "align" in line:
        assert (status, err) == (0, "")
        assert out.startswith("box.xyz")
        assert run(*line.format("b[1].xyz").split())[1].startswith("b[1].xyz"), "a file of that name is no pattern"
    else:
        assert_refused((status, out, err), "--out box.xyz")
    assert (folder / "box.xyz").read_bytes() == before


def test_names_stay_whole(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    name = f"{'n' * 90}.xyz"
    (folder / name).write_bytes((folder / "box.xyz").read_bytes())
    assert name in run("detect", name, "box.xyz")[1]
    assert name in run("batch", ".")[1]


def test_the_json_of_several_files_is_an_array(run: Run, folder: Path) -> None:
    one = json.loads(run("detect", "box.xyz", "--json", "-")[1])
    status, out, err = run("detect", "box.xyz", "cut.ply", "--json", "-")
    found = json.loads(out)
    assert (status, [set(r) for r in found]) == (2, [set(one), {"source", "error"}])
    assert found[0] | {"timings": 0} == one | {"timings": 0}
    assert err == f"symrefine: {found[1]['error']}\n"
    assert "wrote all.json" in run("detect", "box.xyz", "scalene.xyz", "--json", "all.json")[1]
    assert [r["point_group"] for r in json.loads((folder / "all.json").read_text())] == ["D2h", "C1"]


@pytest.mark.parametrize("option", ["--bop", "--report", "--recording", "--picture"])
def test_what_is_of_one_file_is_refused_for_several(run: Run, folder: Path, option: str) -> None:
    before = sorted(folder.iterdir())
    right = "symrefine batch DIR --bop" if option == "--bop" else "`detect` for each"
    name = {"--picture": "f.png", "--recording": "f.rrd"}.get(option, "f.html")
    assert_refused(run("detect", "box.xyz", "row.csv", option, name), f"{option} {name}: is for one object", right)
    assert_refused(run("detect", "box.xyz", "row.csv", "--json", "row.csv"), "same file as the input")
    assert sorted(folder.iterdir()) == before


def test_a_link_to_an_object_is_no_place_for_a_report(run: Run, folder: Path) -> None:
    (folder / "other.json").symlink_to(folder / "scalene.xyz")
    (folder / "lost.json").symlink_to(folder / "nowhere" / "x.json")
    before = (folder / "scalene.xyz").read_bytes()
    assert_refused(run("detect", "box.xyz", "--json", "other.json"), "other.json: is a link to", "suffix of an object")
    assert (folder / "scalene.xyz").read_bytes() == before
    assert_refused(run("detect", "box.xyz", "--json", "lost.json"), "lost.json: cannot be written", "no directory")
    (folder / "here.json").symlink_to(folder / "there.json")
    (folder / "there.json").symlink_to(folder / "here.json")
    assert_refused(run("detect", "box.xyz", "--json", "here.json"), "is no name of a file", "loop")


@pytest.mark.parametrize("command", ["detect", "info", "align box.xyz", "complete -o x.ply", "merge --out z"])
def test_links_that_lead_to_one_another_are_no_input(run: Run, folder: Path, command: str) -> None:
    (folder / "round.ply").symlink_to(folder / "again.ply")
    (folder / "again.ply").symlink_to(folder / "round.ply")
    verb, *rest = command.split()
    status, _, err = run(verb, *rest[: rest[:1] == ["box.xyz"]], "round.ply", *rest[rest[:1] == ["box.xyz"] :])
    assert status == 2
    assert "round.ply" in err
    assert "internal" not in err
    assert err.count("\n") == 1


def test_a_report_takes_the_place_of_reports_alone(run: Run, folder: Path) -> None:
    (folder / "box.mtl").write_text("newmtl red\n")
    assert_refused(run("detect", "box.xyz", "--json", "box.mtl"), "--json box.mtl: is there already and is no JSON")
    assert (folder / "box.mtl").read_text() == "newmtl red\n"
    (folder / "box.json").write_text("\n {}")
    for _ in range(2):
        assert run("detect", "box.xyz", "--json", "box.json")[0] == 0


def test_a_picture_is_written(run: Run, folder: Path) -> None:
    assert_refused(run("detect", "box.xyz", "--picture", "box.svg"), "--picture box.svg: expected a name", ".png")
    assert "wrote box.png" in run("detect", "box.xyz", "--picture", "box.png")[1]
    assert (folder / "box.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["symmetrize", "complete"])
def test_what_is_made_has_a_page_and_a_picture(run: Run, folder: Path, command: str) -> None:
    directions = np.random.default_rng(0).normal(size=(3000, 3))
    points = directions / np.linalg.norm(directions, axis=1)[:, None] * [1.0, 2.0, 3.0]
    np.savetxt(folder / "scan.xyz", points)
    line = (command, "scan.xyz", "-o", "made.ply", "--report", "made.html", "--picture", "made.png")
    assert_refused(run(*line[:-1], "made.svg"), "--picture made.svg: expected a name", ".png")
    assert_refused(run(*line[:5], "made.obj"), "--report made.obj: has the suffix of an object")
    status, out, _ = run(*line)
    assert (status, *(f"wrote made.{kind}\n" in out for kind in ("ply", "html", "png"))) == (0, True, True, True)
    assert (folder / "made.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "made.html").read_text(encoding="utf-8").lower().startswith("<!doctype html>")


# --- stdin ------------------------------------------------------------------------------------------------------------


def test_stdin_is_a_file_like_any_other(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = json.loads(run("detect", "box.xyz", "--json", "-")[1])
    for suffix in ("xyz", ".XYZ"):
        give(monkeypatch, (folder / "box.xyz").read_bytes())
        status, out, err = run("detect", "-", "--format", suffix, "--json", "-")
        assert (status, err) == (0, "")
        assert json.loads(out) | {"timings": 0} == one | {"timings": 0, "source": "stdin"}
    give(monkeypatch, (folder / "box.xyz").read_bytes())
    status, out, _ = run("export", "-", "--format", "xyz", "--to", "bop", "--out", "m.json")
    assert (status, out.splitlines()[0]) == (0, "stdin: D2h")
    assert len(json.loads((folder / "m.json").read_text())["1"]["symmetries_discrete"]) == 3


def test_what_is_wrong_with_stdin_is_told(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    give(monkeypatch, (folder / "cut.ply").read_bytes())
    assert_refused(run("detect", "-", "--format", "ply"), "symrefine: stdin: ")
    give(monkeypatch, b"")
    assert_refused(run("detect", "-", "--format", "ply"), "symrefine: stdin: is empty")
    assert_refused(run("detect", "-"), "which has no suffix", "--format")
    assert_refused(run("detect", "-", "--format", "plt"), "--format plt: is not known", "did you mean ply?")
    assert_refused(run("detect", "box.xyz", "--format", "xyz"), "is for PATH -")
    assert_refused(run("detect", "-", "box.xyz", "--format", "xyz"), "stdin is one file")


def test_either_object_of_an_alignment_may_come_on_stdin(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = (folder / "box.xyz").read_bytes()
    one = json.loads(run("align", "box.xyz", "box.xyz", "--json", "-")[1])
    for names, side in ((("-", "box.xyz"), "source"), (("box.xyz", "-"), "target")):
        give(monkeypatch, box)
        status, out, err = run("align", *names, "--format", "xyz", "--json", "-")
        assert (status, err) == (0, "")
        assert json.loads(out) | {"timings": 0} == one | {"timings": 0, side: "stdin"}
    give(monkeypatch, box)
    several = json.loads(run("align", "box.xyz", "box.xyz", "-", "--format", "xyz", "--json", "-")[1])
    assert [each["target"] for each in several] == ["box.xyz", "stdin"]
    assert_refused(run("align", "-", "-", "--format", "xyz"), "stands for 2 of A and B")
    assert_refused(run("align", "box.xyz", "-", "-", "--format", "xyz"), "stands for 2 of A and B")
    assert_refused(run("align", "-", "box.xyz"), "which has no suffix", "--format")
    assert_refused(run("align", "box.xyz", "box.xyz", "--format", "xyz"), "is for an A or B that is -")


def test_labels_of_an_alignment_are_compared_by_their_texts(run: Run, folder: Path) -> None:
    corners = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.5) for z in (0.0, 2.2)]
    kinds = ["screw", "nut", "pin", "pin", "nut", "pin", "pin", "pin"]
    for name, order in (("a", (0, 1, 2)), ("b", (1, 2, 0))):
        rows = [",".join([*(str(c[k]) for k in order), kind]) for c, kind in zip(corners, kinds, strict=True)]
        (folder / f"{name}.csv").write_text("\n".join(["x,y,z,kind", *rows]) + "\n")
    told = json.loads(run("align", "a.csv", "b.csv", "--labels", "kind", "--json", "-")[1])
    assert len(told["equivalents"]) == 1, "of eight corners alone eight maps are as good"
    assert told["options"]["labels"] == "kind"
    for row, right in zip(told["matrix"], ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), strict=True):
        assert row == pytest.approx(right, abs=1e-6)
    assert_refused(
        run("align", "a.csv", "b.csv", "--labels", "size"), "a.csv: line 1: columns 'x,y,z,kind'", "name one as labels"
    )


# --- how loud it is ---------------------------------------------------------------------------------------------------


def test_quiet_tells_nothing_but_errors(run: Run, folder: Path) -> None:
    assert run("detect", "box.xyz", "-q") == (0, "", "")
    assert run("detect", "box.xyz", "-q", "--bop", "m.json") == (0, "", "")
    assert json.loads((folder / "m.json").read_text())
    assert run("detect", "-q", "row.csv", "--strict") == (3, "", "")
    status, out, err = run("detect", "box.xyz", "cut.ply", "-q")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("symrefine: cut.ply: ")
    assert run("batch", ".", "--quiet") == (1, "", err)
    assert json.loads(run("detect", "box.xyz", "-q", "--json", "-")[1])["point_group"] == "D2h"
    assert_refused(run("detect", "box.xyz", "-q", "-v"), "not allowed with")


def test_verbose_tells_stages_with_seconds_and_a_rate(run: Run) -> None:
    _, plain, nothing = run("detect", "scalene.xyz", "--json", "-")
    _, out, err = run("detect", "scalene.xyz", "--json", "-", "-v")
    assert nothing == ""
    assert json.loads(out) | {"timings": 0} == json.loads(plain) | {"timings": 0}
    told = [line.split()[1] for line in err.splitlines()]
    assert told == ["load", "moments", "local", "vertices", "search", "decide", "4", "detecting"]
    for stage in ("load", "moments"):
        assert re.search(rf"^symrefine: {stage} \d+\.\d\d s, 4 points, [\d,]+ points/s$", err, re.MULTILINE)


@pytest.mark.slow
def test_what_is_drawn_has_stages_of_its_own(run: Run) -> None:
    """Drawing takes longer than detecting as a rule, and was told as that."""
    shown = ("--report", "a.html", "--picture", "a.png", "--recording", "a.rrd")
    status, _, err = run("detect", "box.xyz", *shown, "-v")
    assert status == 0
    for stage in ("page", "picture", "recording"):
        assert re.search(rf"^symrefine: {stage} [0-9.]+ s$", err, re.MULTILINE), stage


def test_whoever_watches_is_told_of_stages_and_nobody_else_is() -> None:
    told: list[tuple[str, bool]] = []
    clock = Clock()
    with watched(lambda stage, seconds: told.append((stage, seconds is None))), clock("a"):
        assert told == [("a", True)]
    with clock("b"):
        pass
    assert told == [("a", True), ("a", False)]
    assert list(clock.seconds) == ["a", "b"]


def test_a_stage_that_comes_again_counts_again() -> None:
    """An object measured twice, as where something is set apart, told the seconds of its second time alone."""
    told: dict[str, float] = {"a": 0.0, "b": 0.0}

    def add(stage: str, seconds: float | None) -> None:
        told[stage] += seconds or 0.0

    clock = Clock()
    with watched(add):
        for stage in ("a", "b", "a"):
            with clock(stage):
                time.sleep(0.002)
    assert clock.seconds == pytest.approx(told)
    assert clock.seconds["a"] >= 2 * 0.002


def test_a_line_now_and_then_where_nobody_looks_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(signs, "EVERY", 0.02)
    with signs.progress("working", 3, 1) as advance, Clock()("first_stage"):
        advance()
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) > 1
    assert lines[-1] == "symrefine: working: first stage, 2 of 3, 0 s"
    time.sleep(0.1)
    assert capsys.readouterr().err == "", "it ends with the work"


@pytest.mark.skipif(os.name != "posix", reason="terminals of POSIX")
@pytest.mark.usefixtures("folder")
def test_on_a_terminal_one_line_lives_and_stdout_keeps_what_is_its() -> None:
    import pty

    ours, theirs = pty.openpty()
    seen = bytearray()

    def look_on() -> None:  # what nobody reads would stop who writes it
        with suppress(OSError):
            while part := os.read(ours, 4096):
                seen.extend(part)

    watcher = Thread(target=look_on, daemon=True)
    watcher.start()
    line = [sys.executable, "-m", "symrefine", "detect", "box.xyz", "scalene.xyz"]
    env = os.environ | {"TERM": "xterm"}
    done = subprocess.run(line, stdout=subprocess.PIPE, stderr=theirs, env=env, timeout=100, check=False)
    os.close(theirs)
    watcher.join(10)
    os.close(ours)
    assert done.returncode == 0
    assert [row.split()[0] for row in done.stdout.decode().splitlines()] == ["group", "D2h", "C1"]
    assert b"detecting" in seen
    assert b"2 of 2" in seen


# --- slips of the pen, and notes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("detec box.xyz", "detect"),
        ("symetrize box.xyz", "symmetrize"),
        ("detect box.xyz --tolernace 0.1", "--tolerance"),
        ("detect box.xyz --jsn=-", "--json"),
        ("export box.xyz --to foundatonpose --out x", "foundationpose"),
        ("detect part.pyl", ".ply"),
        ("detect box.xyz part.pyl --report x.html", None),
        ("detect box.xyz --zzzzz", None),
    ],
)
def test_what_was_meant_is_offered(run: Run, folder: Path, line: str, meant: str | None) -> None:
    (folder / "part.pyl").write_text("ply\n")
    status, _, err = run(*line.split())
    assert (status, err.count("\n")) == (2, 1)
    assert (f"; did you mean {meant}?" in err) if meant else ("did you mean" not in err)


def test_names_may_begin_with_a_dash(run: Run, folder: Path) -> None:
    (folder / "-x.xyz").write_bytes((folder / "box.xyz").read_bytes())
    assert run("detect", "--", "-x.xyz")[1].startswith("-x.xyz: D2h")
    for line in ("--seed 1 -- -x.xyz box.xyz", "./-x.xyz box.xyz", "box.xyz --seed 1 -- -x.xyz"):
        assert [row.split()[0] for row in run("detect", *line.split())[1].splitlines()] == ["group", "D2h", "D2h"]
    assert run("symmetrize", "-o-exact.xyz", "--json=-figures.json", "-q", "--", "-x.xyz")[0] == 0
    assert (folder / "-exact.xyz").is_file()
    assert_refused(run("detect", "box.xyz", "--seed", "1", "-"), "-: stdin is one file")


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("detect -x.ply", "-x.ply"),
        ("detect box.xyz -q.ply", "-q.ply"),
        ("batch -models", "-models"),
        ("view -x.rrd", "-x.rrd"),
        ("detect box.xyz --json -o.json", "-o.json"),
        ("symmetrize box.xyz -o -exact.xyz", "-exact.xyz"),
        ("symmetrize box.xyz -oexact.xyz --seed x", None),
        ("detect -- -x.ply", None),
        ("detect box.xyz --tolernace=0.5u.v", None),
    ],
)
def test_names_that_pass_for_options_are_told(run: Run, folder: Path, line: str, name: str | None) -> None:
    (folder / "-models").mkdir()
    told = f"; if {name} is a file, write ./{name}\n" if name else "\n"
    assert_refused(result := run(*line.split()), told)
    assert ("is a file" in result[2]) is (name is not None)


def test_names_do_not_steer_the_terminal(run: Run, folder: Path) -> None:
    name = "\x1b[31mred\x07.xyz"
    (folder / name).write_bytes((folder / "cut.ply").read_bytes())
    for line in (("detect", name), ("detect", name, "box.xyz"), ("batch", ".")):
        _, out, err = run(*line)
        assert "\\x1b[31mred\\x07.xyz" in out + err
        assert "\x1b" not in out + err


def test_a_small_diameter_is_doubted_unless_the_scale_was_given(run: Run, folder: Path) -> None:
    (folder / "models").mkdir()
    np.savetxt(folder / "models" / "obj_000001.xyz", BOX / 1000)
    file, doubt = "models/obj_000001.xyz", "metres? then give"
    for line, option in (
        (("detect", file, "--bop", "a.json"), "--bop-scale"),
        (("batch", "models", "--bop", "a.json"), "--bop-scale"),
        (("export", file, "--to", "bop", "--out", "a.json"), "--scale"),
    ):
        status, _, err = run(*line)
        assert status == 0
        assert f"{doubt} {option} 1000" in err
        assert doubt not in run(*line, option, 1000)[2]
        assert json.loads((folder / "a.json").read_text())["1"]["diameter"] == pytest.approx(2 * np.sqrt(14))


def test_a_grey_picture_without_symmetry_is_told_of_otsu(run: Run, folder: Path) -> None:
    picture = np.full((60, 60), 255, dtype=np.uint8)
    picture[10:20, 5:50] = picture[10:50, 5:15] = picture[40:44, 5:30] = 90
    Image.fromarray(picture).save(folder / "f.png")
    told = "--threshold otsu"
    status, out, err = run("detect", "f.png")
    assert (status, "C1" in out or "undetermined" in out) == (0, True)
    assert told in err
    assert told not in run("detect", "f.png", "--threshold", "otsu")[2]


# --- completion -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_accept_their_completion(run: Run, folder: Path, shell: str) -> None:
    status, script, err = run("completion", shell)
    assert (status, err) == (0, "")
    assert "symrefine" in script
    for known in ("symmetrize", "tolerance", "foundationpose"):
        assert known in script
    if which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    (folder / "script").write_text(script)
    done = subprocess.run([shell, "-n", "script"], capture_output=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(which("bash") is None, reason="no bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("sym", "symmetrize"),
        ("detect --tol", "--tolerance"),
        ("export box.xyz --to found", "foundationpose"),
        ("detect scal", "scalene.xyz"),
        ("completion z", "zsh"),
    ],
)
def test_bash_completes(run: Run, folder: Path, typed: str, offered: str) -> None:
    (folder / "script").write_text(run("completion", "bash")[1])
    words = typed.split()
    ask = f"source ./script; COMP_WORDS=(symrefine {typed}); COMP_CWORD={len(words)}; _shtab_symrefine symrefine "
    ask += f"'{words[-1]}' '{(['symrefine', *words])[-2]}'; echo \"${{COMPREPLY[@]}}\""
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, timeout=60, check=False)
    assert offered in done.stdout.split()


# --- readers that leave -----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "line",
    [
        "--help",
        "--version",
        "detect --help",
        "detect box.xyz",
        "detect box.xyz --json -",
        "detect box.xyz scalene.xyz",
        "detect box.xyz scalene.xyz --json -",
        "align scalene.xyz scalene.xyz",
        "batch .",
        "export box.xyz --to npz --out a.npz",
        "symmetrize box.xyz -o a.ply",
        "complete ball.npy -o a.ply",
        "completion bash",
        "info box.xyz",
        "run --list",
    ],
)
def test_a_reader_that_leaves_is_no_error(line: str) -> None:
    points = np.random.default_rng(0).standard_normal((3000, 3))
    np.save("ball.npy", points / np.linalg.norm(points, axis=1)[:, None])
    Path("configs").mkdir()
    Path("configs/a.yaml").write_text("experiment: a\n")
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "symrefine", *line.split()]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, timeout=100, check=False)
    os.close(write)
    assert done.returncode == (0 if line.endswith("--help") else 141), "argparse takes no notice"
    signs = re.compile(rb"symrefine: (note: |\w+(: [\w ]+)?, \d+ s)")  # a slow machine is told of what takes long
    assert not [row for row in done.stderr.splitlines() if not signs.match(row)]


@pytest.mark.usefixtures("folder")
def test_a_report_does_not_take_the_place_of_an_object() -> None:
    Path("a.ply").write_text("an object")
    for option in ("--json", "--report", "--recording", "--bop"):
        command = [sys.executable, "-m", "symrefine", "detect", option, "a.ply", "box.xyz"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "has the suffix of an object; expected a name such as" in done.stderr
    assert Path("a.ply").read_text() == "an object"


def test_a_camera_may_stand_at_negative_coordinates() -> None:
    command = [sys.executable, "-m", "symrefine", "detect", "nowhere.ply", "--viewpoint", "-1,0,0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.stderr == "symrefine: nowhere.ply: no such file\n"
