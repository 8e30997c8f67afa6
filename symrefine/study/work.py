"""One run of a study, wherever it is done; what goes wrong with it does not end the others."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

from symrefine.errors import SymrefineError
from symrefine.fleet.limits import Lost
from symrefine.fleet.rows import Row
from symrefine.study.experiment import Experiment, load_experiment
from symrefine.study.journal import Entry
from symrefine.study.versions import LIBRARIES

TIMING = "_s"
WALL = "wall_s"
# What the runner adds to every row.
OWN_COLUMNS = ("config", "code", *LIBRARIES, "error")

# Module, its root, place in the sweep, fields of the case, what the row begins with: what a process can be sent.
Parcel = tuple[str, str, int, dict[str, Any], Mapping[str, Any]]


def parcel(experiment: Experiment, index: int, case: Any, head: Mapping[str, Any]) -> Parcel:
    """A run as another process can be sent it.

    Args:
        index: place in the sweep.
        head: what its row begins with.
    """
    return experiment.name, str(experiment.root), index, asdict(case), head


def attempt(sent: Parcel) -> Row:
    """The row of a run: its results and timings, or its error."""
    name, root, index, fields, head = sent
    experiment = load_experiment(name, Path(root))
    return {**head, **asdict(_entry(experiment, index, experiment.case(**fields)))}


def lost(sent: Parcel, why: Lost) -> Row:
    """The row of a run that was lost."""
    return {**sent[-1], **asdict(Entry(index=sent[2], error=f"the run {why.why}", results={}, timings={}))}


def _entry(experiment: Experiment, index: int, case: Any) -> Entry:
    start = perf_counter()
    row: Mapping[str, Any] = {}
    error = None
    try:
        row = {name: _plain(name, value) for name, value in experiment.run(case).items()}
        if taken := sorted({*experiment.hints, *OWN_COLUMNS} & set(row)):
            raise TypeError(f"the result {taken[0]!r} is named like another column")
    except SymrefineError as caught:
        error = " ".join(str(caught).split())
    except MemoryError:
        raise
    except Exception as caught:  # noqa: BLE001 - one run must not end the others
        error = " ".join(f"internal error: {type(caught).__name__}: {caught}".split())
    timings = {name: row[name] for name in row if name.endswith(TIMING) or name in experiment.measured}
    return Entry(
        index=index,
        error=error,
        results={name: value for name, value in row.items() if name not in timings},
        timings=timings | {WALL: perf_counter() - start},
    )


def _plain(name: str, value: Any) -> Any:
    """A result as a plain scalar; a number that is not finite means that there is none."""
    value = value.item() if hasattr(value, "item") else value
    if value is not None and not isinstance(value, int | float | str | bool):
        raise TypeError(f"result {name!r} is of type {type(value).__name__}, not a plain number, text or truth value")
    return None if isinstance(value, float) and math.isnan(value) else value
