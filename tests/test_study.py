"""Studies: configs read or refused, sweeps, summaries, resumed runs, equal bytes, tables, figures, claims."""

import csv
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from symrefine.errors import InputError
from symrefine.fleet.crew import Processes
from symrefine.study import journal, runner, versions
from symrefine.study.document import Node
from symrefine.study.plan import Plan, make_plan
from symrefine.study.runner import Outcome, run_study
from symrefine.study.summary import Expectation, Measure, Summary, short, summarise

TOY = """
import os
import time
from dataclasses import dataclass
from pathlib import Path

from symrefine.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    shape: str
    seed: int
    noise: float = 0.0
    wait: float = 0.0
    broken: str = ""


def check(case):
    if case.shape not in ("disc", "square"):
        raise InputError(f"shape: value is {case.shape!r}, expected disc or square")


def run(case):
    time.sleep(case.wait)
    if case.broken == "refused" and case.seed == 1:
        raise InputError("no luck")
    if case.broken == "bug" and case.seed == 1:
        raise ZeroDivisionError("oops")
    if case.broken == "list":
        return {"found": [1]}
    if case.broken == "taken":
        return {"seed": 1}
    row = {"found": 4 - case.seed % 2, "err": case.noise / 7 + case.seed / 3, "right": case.seed != 1, "spent_s": 0.5}
    row["pulse"] = time.time()
    return row | {"group": "C4v" if case.seed < 3 else "C2v", "miss": float("nan") if case.seed else 0.25}


def trace(case):
    return [{"iteration": i, "err": (1 + case.seed) * 2.0**-i} for i in range(3 + case.seed)]


def record(case, path):
    path.write_text(repr(case))


MEASURED = ("pulse",)
"""
CONFIG = """\
experiment: lab.toy
out: out/toy
fixed: {wait: 0}
sweep:
  shape: [square, disc]
  noise: [0, 0.01]
  seed: {range: 3}
quick: {sweep.seed: 0}
tables:
  - title: All
    groups: [shape, noise]
    values: {found: mean found, right: tally right, error: max err, group: group}
figures:
  - {title: Error, kind: line, x: noise, y: mean err, by: shape}
  - {title: Found, kind: bar, x: shape, y: mean found, by: noise}
  - {title: Steps, kind: convergence, y: err, by: shape, where: {noise: 0.01}, log: true}
record: [{shape: square, noise: 0.01, seed: 0}]
claims:
  - claim: finds all
    source: section 1
    paper: 4
    value: mean found
    ours: {shape: square}
    peers: {discs: {shape: disc}}
    expect: ">= 4"
  - {claim: right group, source: section 2, paper: C4v, value: group, ours: {seed: 0}, expect: == C4v, main: true}
"""
Make = Callable[..., Plan]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory with an experiment of its own; what it imports is forgotten afterwards."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "toy.py").write_text(TOY)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in ("lab", "lab.toy"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(runner, "code_version", lambda *_: "test")
    return tmp_path


@pytest.fixture
def make(lab: Path) -> Make:
    """A plan from the config with some text exchanged."""

    def from_config(*changes: tuple[str, str], settings: tuple[str, ...] = (), quick: bool = False) -> Plan:
        text = CONFIG
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (lab / "configs").mkdir(exist_ok=True)
        (lab / "configs" / "toy.yaml").write_text(text)
        return make_plan(lab / "configs" / "toy.yaml", settings, quick=quick)

    return from_config


def rows_of(folder: Path, name: str = "rows.csv") -> list[dict[str, str]]:
    with (folder / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def contents(folder: Path) -> dict[str, bytes]:
    """Everything that must not depend on how the rows came about."""
    files = [p for p in folder.rglob("*") if p.is_file() and p.name not in ("journal.jsonl", "timings.csv")]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


# --- plans ------------------------------------------------------------------------------------------------------------


def test_sweep_is_a_product_in_order(make: Make) -> None:
    plan = make()
    assert [(c.shape, c.noise, c.seed) for c in plan.cases[:4]] == [
        ("square", 0.0, 0),
        ("square", 0.0, 1),
        ("square", 0.0, 2),
        ("square", 0.01, 0),
    ]
    assert len(plan.cases) == 12
    assert all(isinstance(c.noise, float) and isinstance(c.wait, float) for c in plan.cases)


def test_sweep_may_be_a_list_of_blocks(make: Make) -> None:
    block = "sweep:\n  shape: [square, disc]\n  noise: [0, 0.01]\n  seed: {range: 3}\n"
    blocks = "sweep:\n  - {shape: square, seed: {range: [1, 3]}, noise: [0, 0.01]}\n  - {shape: disc, seed: 7}\n"
    plan = make((block, blocks))
    assert [(c.shape, c.seed, c.noise) for c in plan.cases] == [
        ("square", 1, 0.0),
        ("square", 1, 0.01),
        ("square", 2, 0.0),
        ("square", 2, 0.01),
        ("disc", 7, 0.0),
    ]
    everywhere = make((block, blocks), settings=("sweep.seed=5",))
    assert [c.seed for c in everywhere.cases] == [5, 5, 5]
    assert [c.seed for c in make((block, blocks), settings=("sweep.1.seed=[8, 9]",)).cases][-2:] == [8, 9]


def test_command_line_and_quick_version_change_the_config(make: Make) -> None:
    assert {c.seed for c in make(quick=True).cases} == {0}
    plan = make(settings=("sweep.seed=[4,5]", "fixed.wait=1", "sweep.shape=disc"), quick=True)
    assert {(c.seed, c.wait, c.shape) for c in plan.cases} == {(4, 1.0, "disc"), (5, 1.0, "disc")}
    assert make(settings=("out=elsewhere",)).study.out == "elsewhere"


def test_hash_is_that_of_the_cases_alone(make: Make) -> None:
    plain = make().config_hash
    assert make(("title: All", "title: Every one"), ("fixed: {wait: 0}", "fixed: {wait: 0.0}")).config_hash == plain
    assert make(settings=("sweep.seed={range: 4}",)).config_hash != plain
    assert make(settings=("fixed.wait=0.5",)).config_hash != plain


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "seed: {range: 3}",
            "sede: {range: 3}",
            r"toy.yaml:7: sweep.sede: lab.toy has no field 'sede'",
        ),
        ("[square, disc]", "[square, dics]", r"toy.yaml:5: sweep.shape\[1\]: value is 'dics', expected disc or square"),
        ("[0, 0.01]", "[0, a]", r"toy.yaml:6: sweep.noise\[1\]: expected float, got 'a'"),
        ("[0, 0.01]", "[0, .inf]", r"toy.yaml:6: sweep.noise\[1\]: expected a finite number"),
        ("[0, 0.01]", "[]", "toy.yaml:6: sweep.noise: expected at least one value"),
        ("[0, 0.01]", "[0, 0.0]", "toy.yaml:4: sweep: the same case twice"),
        ("{range: 3}", "{range: x}", "toy.yaml:7: sweep.seed: expected a value, a list"),
        ("{range: 3}", "{rang: 3}", "toy.yaml:7: sweep.seed.rang: unknown key"),
        ("{range: 3}", "[1.5]", r"toy.yaml:7: sweep.seed\[0\]: expected int, got 1.5"),
        ("{range: 3}", "[true]", r"toy.yaml:7: sweep.seed\[0\]: expected int, got True"),
        ("{wait: 0}", "{seed: 0}", "toy.yaml:3: fixed.seed: is in `sweep` too"),
        ("  seed: {range: 3}\n", "", "toy.yaml:1: config: neither `fixed` nor `sweep` sets seed"),
        ("tables:", "tabels:", "toy.yaml:9: tabels: unknown key; expected one of"),
        ("title: All", "titel: All", r"toy.yaml:10: tables\[0\].titel: unknown key"),
        ("out: out/toy", "out: 3", "toy.yaml:2: out: expected str, got 3"),
        ("lab.toy", "lab.tooy", "toy.yaml:1: experiment: there is no lab/tooy.py"),
        ("lab.toy", "../lab", "toy.yaml:1: experiment: expected the name of a Python module"),
        ("experiment: lab.toy\n", "", "config: missing experiment"),
        ("experiment:", "experimnt:", r"toy.yaml:1: experimnt: unknown key; did you mean experiment\?"),
        ("fixed: {wait: 0}", "out: twice", "toy.yaml:3: not YAML"),
        ("{range: 3}", "{range: [1", "not YAML"),
    ],
)
def test_configs_that_are_wrong_are_refused(make: Make, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make((old, new))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("groups: [shape, noise]", "groups: [shape, nose]", r"tables\[0\].groups\[1\]: lab.toy has no field 'nose'"),
        ("mean found, right", "maen found, right", r"tables\[0\].values.found: expected COLUMN or AGGREGATE COLUMN"),
        ("by: shape}", "by: shap}", r"toy.yaml:14: figures\[0\].by: lab.toy has no field"),
        ("kind: bar", "kind: pie", r"toy.yaml:15: figures\[1\].kind: expected one of line, bar, convergence"),
        ("title: Found", "title: Error", r"figures\[0\].title: names the file"),
        ("seed: 0}]", "seed: 9}]", r"toy.yaml:17: record\[0\]: picks no run of the sweep"),
        ("where: {noise: 0.01}", "where: {noise: x}", r"figures\[2\].where.noise: expected float, got 'x'"),
        ("ours: {seed: 0}", "ours: {seed: 9}", r"toy.yaml:26: claims\[1\].ours: picks no run of the sweep"),
        ("{shape: disc}", "{shape: disc, seed: 3}", r"toy.yaml:24: claims\[0\].peers.discs: picks no run of the sweep"),
        ("ours: {shape: square}", "ours: {shap: square}", r"toy.yaml:23: claims\[0\].ours.shap: lab.toy has no field"),
        ('">= 4"', '"=> 4"', r"toy.yaml:25: claims\[0\].expect: expected a comparison"),
        ("experiment: lab.toy", "experiment: lab.bare", "no `trace`"),
    ],
)
def test_what_is_made_of_the_rows_is_checked_before_the_runs(
    make: Make, lab: Path, old: str, new: str, message: str
) -> None:
    (lab / "lab" / "bare.py").write_text(TOY.split("def trace")[0])
    with pytest.raises(InputError, match=message):
        run_study(make((old, new)), lab / "out")
    assert not (lab / "out").exists()


def test_a_config_that_is_not_there_is_told_with_those_that_are(
    make: Make, lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    configs = lab / "configs"
    (configs / "other.yaml").write_text("seeds: 10\n")
    (configs / "folder.yaml").mkdir()
    there = re.escape(f"in {configs} there are toy.yaml")
    for path in (configs / "tyo.yaml", lab / "nowhere" / "toy.yaml"):
        monkeypatch.chdir(lab / "lab")
        with pytest.raises(InputError, match=f"{path.name}: no such config file; {there}$"):
            make_plan(path)
    with pytest.raises(InputError, match=r"folder\.yaml: is a directory; expected a config"):
        make_plan(configs / "folder.yaml")
    with pytest.raises(InputError, match=f"other.yaml:1: config: missing experiment, .*; {there}$"):
        make_plan(configs / "other.yaml")
    (configs / "toy.yaml").unlink()
    with pytest.raises(InputError, match="examples are in the directories configs and experiments"):
        make_plan(configs / "toy.yaml")


def test_experiments_that_are_none_are_refused(make: Make, lab: Path) -> None:
    for name, text, message in (
        ("empty", "", "needs a dataclass `Case`"),
        ("syntax", "def (", "cannot be imported"),
        ("missing", "import surely_not_there", "cannot be imported: No module named"),
        ("field", TOY.replace("seed: int", "seed: list"), "Case.seed: is <class 'list'>"),
    ):
        (lab / "lab" / f"{name}.py").write_text(text)
        with pytest.raises(InputError, match=f"toy.yaml:1: experiment: lab.{name}.*{message}"):
            make(("lab.toy", f"lab.{name}"))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("foo", "--set foo: expected KEY=VALUE"),
        ("=3", "expected KEY=VALUE"),
        ("fixed.wait=abc", "--set fixed.wait=abc: fixed.wait: expected float, got 'abc'"),
        ("fixed.points=3", "--set fixed.points=3: fixed.points: lab.toy has no field 'points'"),
        ("fixed.noise=1", r"--set fixed.noise=1: fixed.noise: is in `sweep` too \(.*toy.yaml:6\)"),
        ("sweep.shape=[a]", r"--set sweep.shape=\[a\]: sweep.shape\[0\]: value is 'a'"),
        ("sweep.seed=[0", r"--set sweep.seed=\[0: not YAML"),
        ("sweep.seed.x=3", "--set sweep.seed.x=3: sweep.seed.x: unknown key"),
        ("out.x=3", "--set out.x=3: out is 'out/toy', it holds no key 'x'"),
        ("tables.3.title=x", "--set tables.3.title=x: tables has 1 entries"),
    ],
)
def test_a_wrong_setting_names_the_option(make: Make, setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(settings=(setting,))


# --- runs -------------------------------------------------------------------------------------------------------------


def test_everything_is_written(make: Make, lab: Path) -> None:
    outcome = run_study(make(), lab / "out")
    rows = rows_of(lab / "out")
    assert len(rows) == 12
    assert list(rows[0])[:5] == ["shape", "seed", "noise", "wait", "broken"]
    assert {"config", "code", "numpy", "scipy", "casadi", "open3d", "error", "found"} <= set(rows[0])
    assert not {"spent_s", "pulse"} & set(rows[0])
    assert [(r["shape"], r["noise"], r["seed"]) for r in rows[3:5]] == [
        ("square", "0.01", "0"),
        ("square", "0.01", "1"),
    ]
    assert [r["miss"] for r in rows[:3]] == ["0.25", "", ""]
    assert float(rows[4]["err"]) == 0.01 / 7 + 1 / 3
    timings = rows_of(lab / "out", "timings.csv")
    assert {t["spent_s"] for t in timings} == {"0.5"}
    assert len({t["pulse"] for t in timings}) == 12
    assert all(float(t["wall_s"]) >= 0 for t in timings)
    assert outcome.failed == 0
    assert {p.name for p in (lab / "out").iterdir()} >= {
        "tables.md",
        "claims.csv",
        "traces.csv",
        "error.png",
        "found.png",
    }
    assert (lab / "out" / "recordings" / "square-0-0.01.rrd").read_text().startswith("Case(shape='square', seed=0")
    assert (lab / "out" / "steps.png").read_bytes().startswith(b"\x89PNG")


def test_tables_group_in_the_order_of_the_sweep(make: Make, lab: Path) -> None:
    outcome = run_study(make(), lab / "out")
    lines = outcome.tables.splitlines()
    assert lines[2] == "| shape | noise | found | right | error | group | runs |"
    assert lines[4:8] == [
        "| square | 0 | 3.67 | 2 of 3 | 0.667 | C4v | 3 |",
        "| square | 0.01 | 3.67 | 2 of 3 | 0.668 | C4v | 3 |",
        "| disc | 0 | 3.67 | 2 of 3 | 0.667 | C4v | 3 |",
        "| disc | 0.01 | 3.67 | 2 of 3 | 0.668 | C4v | 3 |",
    ]


def test_claims_are_judged(make: Make, lab: Path) -> None:
    finds_all, group = run_study(make(), lab / "out").verdicts
    assert (finds_all.met, finds_all.ours.text, finds_all.peers["discs"].text) == (False, "3.67", "3.67")
    assert (group.met, group.ours.text) == (True, "C4v")
    assert [r["met"] for r in rows_of(lab / "out", "claims.csv")] == ["false", "true"]


@pytest.mark.parametrize(
    ("said", "total", "told"),
    [
        (">= 100", 12, "all"), (">= 95", 12, "all"), (">= 95", 40, "at least 38 of 40"), ("== 0", 5, "none"),
        ("<= 25", 8, "at most 2 of 8"), ("40 to 60", 10, "4 to 6 of 10"), ("== 50", 4, "2 of 4"),
        ("== 50", 3, "== 50 %"),
        (">= 95", None, ">= 95"), ("== C4v", None, "== C4v"),
    ],
)  # fmt: skip
def test_what_is_expected_of_counts_is_told_in_counts(said: str, total: int | None, told: str) -> None:
    assert Expectation.read(Node(value=said, place="x", path="expect")).of(total) == told


def test_failed_runs_become_rows_and_miss_claims(make: Make, lab: Path) -> None:
    for broken, message in (("refused", "no luck"), ("bug", "internal error: ZeroDivisionError: oops")):
        outcome = run_study(
            make(("{wait: 0}", f"{{wait: 0, broken: {broken}}}"), ("mean found\n", "min found\n")), lab / broken
        )
        assert outcome.failed == 4
        assert [r["error"] for r in rows_of(lab / broken)][:3] == ["", message, ""]
        assert "4 of 12 runs failed" in outcome.tables
        assert outcome.verdicts[0].ours.text == "4"
        assert outcome.verdicts[0].met is False


def test_results_must_be_plain_and_have_names_of_their_own(make: Make, lab: Path) -> None:
    for broken, message in (("list", "'found' is of type list"), ("taken", "'seed' is named like another column")):
        run_study(make(("{wait: 0}", f"{{wait: 0, broken: {broken}}}")), lab / broken)
        assert all(message in r["error"] for r in rows_of(lab / broken))


def test_unknown_results_are_told_and_rows_kept(make: Make, lab: Path) -> None:
    with pytest.raises(InputError, match=r"toy.yaml:12: tables\[0\].values.found: no run has a result 'fuond'"):
        run_study(make(("found: mean found", "found: mean fuond")), lab / "out")
    assert len(rows_of(lab / "out")) == 12
    with pytest.raises(InputError, match="group is text, such as 'C4v'; mean takes numbers"):
        run_study(make(("found: mean found", "found: mean group")), lab / "out")
    with pytest.raises(InputError, match=r"figures\[2\].y: no iteration has 'er'; there are"):
        run_study(make(("y: err, by: shape, where", "y: er, by: shape, where")), lab / "out")
    assert run_study(make(), lab / "out").resumed == 12


def test_same_bytes_in_one_process_in_two_and_after_a_kill(make: Make, lab: Path) -> None:
    plan = make()
    run_study(plan, lab / "one")
    run_study(plan, lab / "two", executor=Processes(workers=2))
    assert run_study(plan, lab / "cut", limit=5).resumed == 0
    path = lab / "cut" / "journal.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[: -len(whole.splitlines()[-1]) // 2])  # half of the last row
    assert run_study(plan, lab / "cut").resumed == 4
    expected = contents(lab / "one")
    assert len(expected) == 8
    assert contents(lab / "two") == expected
    assert contents(lab / "cut") == expected


def test_every_cut_of_the_journal_resumes(make: Make, lab: Path) -> None:
    plan = make(settings=("sweep.shape=square", "sweep.noise=0", "figures=[]", "record=[]"))
    run_study(plan, lab / "out")
    expected, whole = contents(lab / "out"), (lab / "out" / "journal.jsonl").read_bytes()
    ends = [i + 1 for i, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(0, len(whole), 61):
        (lab / "out" / "journal.jsonl").write_bytes(whole[:cut])
        assert run_study(plan, lab / "out").resumed == sum(end <= cut for end in ends)
        assert contents(lab / "out") == expected


def test_an_interrupt_keeps_what_is_done(make: Make, lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = make()
    done = iter(range(7))

    def interrupted(*args: Any) -> Any:
        if next(done) == 6:
            raise KeyboardInterrupt
        return attempt(*args)

    attempt = runner.attempt
    with monkeypatch.context() as patch:
        patch.setattr(runner, "attempt", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run_study(plan, lab / "out")
    assert run_study(plan, lab / "out").resumed == 6


def test_rows_of_others_are_refused_or_dropped(make: Make, lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_study(make(), lab / "out")
    before = contents(lab / "out")
    other = make(settings=("sweep.seed={range: 4}",))
    with pytest.raises(InputError, match=r"holds rows of another config .* --replace"):
        run_study(other, lab / "out")
    monkeypatch.setattr(runner, "code_version", lambda *_: "newer")
    with pytest.raises(InputError, match=r"holds rows of another code \(test, now newer\)"):
        run_study(make(), lab / "out")
    assert contents(lab / "out") == before
    assert run_study(other, lab / "out", replace=True).resumed == 0
    assert len(rows_of(lab / "out")) == 16


def test_a_folder_that_is_no_studys_is_left_alone(make: Make, lab: Path) -> None:
    (lab / "out").mkdir()
    for text in ("my notes\n", '{"config": "a"}\n', '{"config": nonsense\n'):
        (lab / "out" / "journal.jsonl").write_text(text)
        with pytest.raises(InputError, match=r"holds no rows of a study|is damaged"):
            run_study(make(), lab / "out", replace=True)
        assert (lab / "out" / "journal.jsonl").read_text() == text
    (lab / "file").write_text("x")
    with pytest.raises(InputError, match="a file is in the way"):
        run_study(make(), lab / "file")


def test_two_runs_cannot_write_to_one_folder(make: Make, lab: Path) -> None:
    pytest.importorskip("fcntl")
    plan = make()
    stamp = journal.Stamp(config=plan.config_hash, code="test", libraries=versions.library_versions())
    (lab / "out").mkdir()
    with (
        journal.opened(lab / "out" / "journal.jsonl", stamp, 5, replace=False),
        pytest.raises(InputError, match="another run is writing there"),
    ):
        run_study(plan, lab / "out")


def test_rows_are_appended_whole(make: Make, lab: Path) -> None:
    run_study(make(), lab / "out", limit=2)
    lines = [json.loads(line) for line in (lab / "out" / "journal.jsonl").read_text().splitlines()]
    assert [line["index"] for line in lines] == [0, 1]
    assert lines[0]["results"]["miss"] == 0.25
    assert lines[1]["results"]["miss"] is None
    assert len(rows_of(lab / "out")) == 2


# --- summaries --------------------------------------------------------------------------------------------------------


def node(text: str) -> Node:
    return Node(value=text, place="x.yaml:1", path="value")


def summary(how: str, *values: Any) -> Summary:
    rows = [{"error": None, "v": v} for v in values] + [{"error": "failed", "v": 1000}]
    return summarise(rows, Measure.read(node(f"{how} v".strip())))


@pytest.mark.parametrize(
    ("how", "values", "text"),
    [
        ("mean", (1, 2, 4), "2.33"),
        ("median", (1, 2, 40, None), "2"),
        ("max", (0.01234, 0.5), "0.5"),
        ("min", (0.01234, 0.5), "0.0123"),
        ("sum", (True, True, False), "2"),
        ("sum", (), "0"),
        ("count", (1, None, 3), "2"),
        ("std", (1, 3), "1"),
        ("p95", tuple(range(101)), "95"),
        ("share", (True, False, False, False), "25 %"),
        ("tally", (True, False, True), "2 of 3"),
        ("mean", (), "-"),
        ("mean", (12345.6,), "12346"),
        ("mean", (19.96,), "19.96"),
        ("max", (7740008392.25,), "7.74e+09"),
        ("", (0.5, 0.5), "0.5"),
        ("", (1, 3), "1 to 3"),
        ("", ("b", "a", "b"), "a, b"),
        ("", (True, True), "yes"),
    ],
)
def test_summaries(how: str, values: tuple[Any, ...], text: str) -> None:
    assert summary(how, *values).text == text


@pytest.mark.parametrize(
    ("text", "fits", "does_not"),
    [
        (">= 4", (4, 5.5), 3.99),
        ("<= 1e-3", (0, 1e-3), 0.002),
        ("== 0", (0, 0.0), 1),
        ("< 4", (3,), 4),
        ("> -1", (0,), -1),
        ("0.4 to 0.6", (0.4, 0.5, 0.6), 0.61),
        ("== Cs", ("Cs",), "C1"),
    ],
)
def test_expectations(text: str, fits: tuple[Any, ...], does_not: Any) -> None:
    expected = Expectation.read(node(text))
    assert expected.holds(Summary(text="", values=fits))
    assert not expected.holds(Summary(text="", values=(*fits, does_not)))
    assert not expected.holds(Summary(text="-", values=()))


def test_short_texts() -> None:
    assert [short(v) for v in (None, True, 0.1 + 0.2, 3.0, 1e-9, "x")] == ["-", "yes", "0.3", "3", "1e-09", "x"]
    assert [short(v) for v in (1e300, float("inf"), 65536, 1234.5)] == ["1e+300", "inf", "65536", "1234"]


def test_measures_name_their_place() -> None:
    assert Measure.read(node("found")) == Measure(how="", column="found", node=node("found"))
    with pytest.raises(InputError, match=r"x.yaml:1: value: expected COLUMN or AGGREGATE COLUMN"):
        Measure.read(node("mean of found"))


def test_code_version_knows_changes(tmp_path: Path) -> None:
    (tmp_path / "package").mkdir()
    for name, file in (("alone", "alone.py"), ("package.study", "package/beside.py")):
        (tmp_path / file).write_text("x = 1\n")
        first = versions.code_version(name, tmp_path)
        (tmp_path / "alone").mkdir(exist_ok=True)  # what the study writes
        assert versions.code_version(name, tmp_path) == first
        (tmp_path / file).write_text("x = 2\n")
        assert versions.code_version(name, tmp_path) != first
    assert set(versions.library_versions()) == {"numpy", "scipy", "casadi", "open3d"}


def git(folder: Path, *arguments: str) -> str:
    settings = ["-c", "user.name=x", "-c", "user.email=x@y", "-c", "commit.gpgsign=false"]
    done = subprocess.run(["git", "-C", str(folder), *settings, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_code_version_is_the_commit_with_a_mark_for_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("symrefine/study", "experiments"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "code.py").write_text("x = 1\n")
    monkeypatch.setattr(versions, "_PACKAGE", tmp_path / "symrefine")
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "symrefine" / "study" / "code.py"))
    assert versions.code_version("experiments.code", tmp_path).startswith("symrefine ")
    git(tmp_path, "init", "--quiet")
    assert versions.code_version("experiments.code", tmp_path).startswith("symrefine ")  # of a repository around it
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "all")
    commit = git(tmp_path, "rev-parse", "--short=10", "HEAD")
    assert versions.code_version("experiments.code", tmp_path) == commit
    (tmp_path / "README.md").write_text("no code\n")
    (tmp_path / "experiments" / "notes.txt").write_text("no code\n")
    assert versions.code_version("experiments.code", tmp_path) == commit
    seen = {commit}
    for name in ("experiments/code.py", "experiments/new.py", "symrefine/study/code.py"):
        (tmp_path / name).write_text("x = 2\n")
        seen.add(versions.code_version("experiments.code", tmp_path))
    assert len(seen) == 4
    assert all(version == commit or version.startswith(f"{commit}+dirty.") for version in seen)


def test_outcome_tells_how_much_is_new(make: Make, lab: Path) -> None:
    first: Outcome = run_study(make(), lab / "out", limit=4)
    assert (first.resumed, len(first.rows)) == (0, 4)
    assert (lambda o: (o.resumed, len(o.rows)))(run_study(make(), lab / "out", limit=2)) == (2, 4)
    assert run_study(make(), lab / "out").resumed == 4
