"""Cases in several processes."""

import argparse
import math

import pytest

from experiments.studies.jobs import add_jobs, counted, in_order
from symrefine.cli import signs


def test_rows_come_in_the_order_of_the_cases_however_many_processes() -> None:
    cases = [30_000, 3, 2, 1, 0, 20_000, 5]  # the first takes longest
    assert list(in_order(math.factorial, cases, 1)) == list(in_order(math.factorial, cases, 2))


@pytest.mark.parametrize("jobs", [1, 2])
def test_how_many_are_done_is_shown_meanwhile(jobs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr(signs.Doing, "advance", lambda doing: shown.append(str(doing)))
    assert counted("factors", math.factorial, [3, 2, 1], jobs) == [6, 2, 1]
    assert shown == ["factors, 0 of 3"] * 3


def test_nothing_to_do_starts_nothing() -> None:
    assert list(in_order(math.sqrt, [], 2)) == []


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "two"])
def test_jobs_are_counted(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    add_jobs(parser)
    assert parser.parse_args([]).jobs == 1
    assert parser.parse_args(["--jobs", "2"]).jobs == 2
    with pytest.raises(SystemExit):
        parser.parse_args([f"--jobs={text}"])
    assert "is not a number of processes, 1 or more" in capsys.readouterr().err
