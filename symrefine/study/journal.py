"""The journal of a study: it belongs to one config and one code version, which every row names."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import NoneType
from typing import Any

from symrefine.errors import InputError
from symrefine.fleet import journal
from symrefine.fleet.rows import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamp:
    """What rows must have in common to stand in one table."""

    config: str
    code: str
    libraries: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A finished run: its place in the sweep, its results, its timings, or what went wrong."""

    index: int
    error: str | None
    results: Mapping[str, Any]
    timings: Mapping[str, float]

    @classmethod
    def of(cls, row: Row) -> "Entry":
        """The entry that a row of the journal holds."""
        return cls(**{name: row[name] for name in cls.__dataclass_fields__})


STAMP = tuple(Stamp.__dataclass_fields__)
# What every row has: a stamp and an entry.
KINDS: journal.Kinds = {
    "config": (str,), "code": (str,), "libraries": (dict,),
    "index": (int,), "error": (str, NoneType), "results": (dict,), "timings": (dict,),
}  # fmt: skip


@contextmanager
def opened(path: Path, stamp: Stamp, runs: int, *, replace: bool) -> Iterator[journal.Journal]:
    """The journal with the rows of finished runs by index, to append to; nobody else can write to it meanwhile.

    Args:
        stamp: of the rows to come.
        runs: of the sweep.
        replace: whether rows with another stamp are dropped instead of refused.

    Raises:
        InputError: another run is writing, rows with another stamp, or something else than rows.
    """
    busy = f"{path.parent}: another run is writing there"
    with journal.opened(path, KINDS, "index", busy=busy, rows_of="a study", other="another directory") as found:
        now = asdict(stamp)
        other = next(((n, row[n]) for row in found.latest.values() for n in STAMP if row[n] != now[n]), None)
        if other is not None and not replace:
            name, before = other
            raise InputError(
                f"{path.parent}: holds rows of another {name} ({before}, now {now[name]}); "
                "name another directory with --out, or drop them with --replace"
            )
        if other is not None:
            found.clear()
        if foreign := [index for index in found.latest if index not in range(runs)]:
            raise InputError(f"{path}: is damaged: it has a row of run {foreign[0]}, and the sweep {runs} runs")
        yield found
