"""`symrefine run`: what it prints and refuses, and that a killed run loses no finished row and changes no byte."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from symrefine.cli import invoke

EXPERIMENT = """
import os
import time
from dataclasses import dataclass

from symrefine.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    seed: int
    wait: float = 0.0


def run(case):
    with open(os.environ.get("BEGUN", os.devnull), "a") as begun:
        begun.write(f"{case.seed}\\n")
    time.sleep(case.wait if case.seed < 5 else float(os.environ.get("HELD", case.wait)))
    if case.seed == 3:
        raise InputError("three is\\nrefused")
    return {"third": case.seed / 3}
"""
CONFIG = """\
experiment: wait_and_divide
out: out/thirds
fixed: {wait: 0.0}
sweep: {seed: {range: 8}}
tables: [{title: Thirds, groups: [wait], values: {mean: mean third}}]
"""


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "wait_and_divide.py").write_text(EXPERIMENT)
    path = tmp_path / "thirds.yaml"
    path.write_text(CONFIG)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "wait_and_divide", raising=False)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    return path


def test_run_prints_its_tables_and_tells_failures(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["run", str(config)]) == 1
    out, err = capsys.readouterr()
    assert "| 0 | 1.19 | 8 |" in out
    assert "1 of 8 runs failed" in out
    assert out.splitlines()[-1] == "8 runs, 1 failed, written to out/thirds"
    assert err == "symrefine: note: a run failed: three is refused\n"
    assert invoke(["run", str(config), "--quiet"]) == 1
    assert capsys.readouterr() == ("", "symrefine: a run failed: three is refused\n")
    assert invoke(["run", str(config), "--limit", "2", "--out", "few"]) == 0
    assert invoke(["run", str(config), "--set", "sweep.seed=[0, 1]", "--out", "few"]) == 2
    assert "few: holds rows of another config" in capsys.readouterr().err
    assert invoke(["run", str(config), "--set", "sweep.seed=[0, 1]", "--out", "few", "--replace"]) == 0
    assert invoke(["run", str(config), "--set", "sweep.seed=[0, 1]", "--out", "few"]) == 0
    assert "2 runs, 2 done before, written to few" in capsys.readouterr().out
    assert invoke(["run", str(config), "--limit", "1", "--out", "one"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "1 run, written to one"


def test_what_there_is_to_run_is_listed(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (config.parent / "empty").mkdir()
    assert invoke(["run", "--list", "empty"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(
        f"symrefine: {config.parent / 'empty'}: no config in it, in configs there, or in configs above"
    )
    assert err.count("\n") == 1
    assert "examples are in the directories configs and experiments/studies of symrefine's repository" in err
    assert invoke(["run", "--list"]) == 0
    assert capsys.readouterr().out == f"{config.name}  wait_and_divide\n"
    (config.parent / "configs").mkdir()
    (config.parent / "configs" / "b.yaml").write_text(CONFIG)
    (config.parent / "configs" / "a.yaml").write_text(f"title: By three\n{CONFIG}")
    (config.parent / "configs" / "other.yaml").write_text("seeds: 3\n")
    assert invoke(["run", "--list"]) == 0
    assert capsys.readouterr().out == "configs/a.yaml  By three\nconfigs/b.yaml  wait_and_divide\n"
    assert invoke(["run", "--list", "empty"]) == 0
    listed = config.parent / "configs"
    assert capsys.readouterr().out.splitlines()[0].split() == [str(listed / "a.yaml"), "By", "three"]
    before = sorted(config.parent.iterdir())
    assert invoke(["run", str(config), "--list", "--limit", "2", "--set", "sweep.wait=[0.5, 1]"]) == 2
    assert "is in `sweep` too" in capsys.readouterr().err
    assert invoke(["run", str(config), "--list", "--limit", "2"]) == 0
    assert capsys.readouterr().out == "1  seed=0\n2  seed=1\n"
    assert [path for path in sorted(config.parent.iterdir()) if path.name != "__pycache__"] == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "CONFIG.yaml is missing; `symrefine run --list` names"),
        (["thirds.yaml", "--set", "tabels=1"], "did you mean tables?"),
        (["none.yaml"], "none.yaml: no such config file"),
        (["."], ".: is a directory; expected a config (`symrefine run --list .` names those in it)"),
        (["thirds.yaml", "--set", "sweep.sede=1"], "--set sweep.sede=1: sweep.sede: wait_and_divide has no field"),
        (["thirds.yaml", "--set", "fixed.wait=no"], "--set fixed.wait=no: fixed.wait: expected float, got 'no'"),
        (["thirds.yaml", "--workers", "0"], "--workers: '0' is not an integer from 1"),
        (["--list", "--out", "x"], "--out: does not apply to --list, which prints configs alone; leave it out"),
        (["--list", ".", "--quick"], "--quick: does not apply to --list, which prints configs alone"),
        (
            ["thirds.yaml", "--list", "--table", "x.csv"],
            "--table: does not apply to --list, which prints the runs of a",
        ),
        (["thirds.yaml", "--list", "--replace"], "--replace: does not apply to --list"),
        (["thirds.yaml", "--list", "--workers", "1"], "--workers: does not apply to --list"),
        (["thirds.yaml", "--limit", "-1"], "--limit: '-1' is not an integer from 1"),
        (["thirds.yaml", "--out", "thirds.yaml"], "thirds.yaml: cannot be made a directory: a file is in the way"),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(
    config: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    before = sorted(config.parent.iterdir())
    assert invoke(["run", *arguments]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert [p for p in sorted(config.parent.iterdir()) if p.name != "__pycache__"] == before


@pytest.fixture
def interruptible() -> Iterator[None]:
    """What is started is, though this process may run in the background of a shell, which has it ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def start(config: Path, out: str, *options: str, **environment: str) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "symrefine", "run", str(config), "--out", out, *options]
    pipe, surroundings = subprocess.PIPE, os.environ | environment
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, env=surroundings, start_new_session=True)


def rows_done(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.is_file() else 0


@pytest.mark.usefixtures("interruptible")
@pytest.mark.skipif(os.name != "posix", reason="kills a process")
@pytest.mark.parametrize(
    ("kill", "workers"),
    [pytest.param(signal.SIGKILL, "1", marks=pytest.mark.slow), (signal.SIGKILL, "2"), (signal.SIGINT, "2")],
)
def test_killed_runs_lose_nothing_and_end_with_the_same_bytes(config: Path, kill: signal.Signals, workers: str) -> None:
    slow = ("--set", "fixed.wait=0.2", "--workers", workers)
    whole = start(config, "whole", *slow)
    cut = start(config, "cut", *slow, HELD="60")  # the last of its tasks, lest it be done before it is killed
    journal = config.parent / "cut" / "journal.jsonl"
    deadline = time.monotonic() + 60
    while rows_done(journal) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    os.killpg(cut.pid, kill)
    assert cut.wait(60) != 0
    before = rows_done(journal)
    assert 2 <= before < 8
    assert not (config.parent / "cut" / "rows.csv").exists()
    again = start(config, "cut", *slow)
    out, _ = again.communicate(timeout=60)
    whole.communicate(timeout=60)
    assert (again.returncode, whole.returncode) == (1, 1)
    assert f"8 runs, {before} done before, 1 failed" in out.decode()
    for name in ("rows.csv", "tables.md"):
        assert (config.parent / "cut" / name).read_bytes() == (config.parent / "whole" / name).read_bytes()
    assert cut.stdout is not None
    assert cut.stderr is not None
    cut.stdout.close()
    cut.stderr.close()


@pytest.mark.skipif(os.name != "posix", reason="interrupts a process")
def test_what_a_shell_keeps_from_interrupts_goes_on_with_its_workers(config: Path) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        begun = config.parent / "begun"
        whole = start(config, "whole", "--set", "fixed.wait=0.2", "--workers", "2", BEGUN=str(begun))
        journal = config.parent / "whole" / "journal.jsonl"
        deadline = time.monotonic() + 60
        while rows_done(journal) < 1 and time.monotonic() < deadline:
            time.sleep(0.01)
        os.killpg(whole.pid, signal.SIGINT)
        whole.communicate(timeout=60)
    finally:
        signal.signal(signal.SIGINT, before)
    assert whole.returncode == 1  # one of its tasks is refused
    assert rows_done(journal) == 8
    assert sorted(begun.read_text().split()) == list("01234567"), "none was begun again"
