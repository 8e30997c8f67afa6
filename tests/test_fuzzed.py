"""What `make fuzz` found once is read, or refused in one line, for ever; and its cases are the same every time."""

import warnings
from pathlib import Path

import pytest

from experiments.studies import fuzz
from symrefine.errors import InputError
from symrefine.load import SUFFIXES, load

FOUND = sorted((Path(__file__).parent / "fuzzed").iterdir())


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.name)
def test_what_was_found_is_read_or_refused(path: Path) -> None:
    told = ""
    try:
        load(path)
    except InputError as error:
        told = str(error)
    assert told.isprintable()
    assert len(told) < 2000


def test_every_format_is_damaged() -> None:
    assert set(SUFFIXES) <= set(fuzz.TARGETS)
    assert sum(fuzz.plan(100_000, fuzz.TARGETS).values()) == 100_000


@pytest.mark.parametrize("target", [name for name in fuzz.TARGETS if name not in (".step", ".stp", ".laz", "config")])
def test_a_few_cases_of_every_format(target: str, tmp_path: Path) -> None:
    for number in range(6):
        case = fuzz.case(7, target, number)
        assert case == fuzz.case(7, target, number)
        with warnings.catch_warnings():
            assert fuzz.judged(case, tmp_path)[0] in ("read", "refused"), case
