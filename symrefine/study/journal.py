"""The journal of a study: it belongs to one config and one code version, which every row names."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.fleet import journal


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
    def of(cls, row: journal.Row) -> "Entry":
        """The entry that a row of the journal holds."""
        return cls(**{name: row[name] for name in ENTRY})


STAMP, ENTRY = tuple(Stamp.__dataclass_fields__), tuple(Entry.__dataclass_fields__)


@contextmanager
def opened(path: Path, stamp: Stamp, *, replace: bool) -> Iterator[tuple[dict[int, journal.Row], journal.Journal]]:
    """The rows of finished runs by index, and the journal to append to; nobody else can write to it meanwhile.

    Args:
        stamp: of the rows to come.
        replace: whether rows with another stamp are dropped instead of refused.

    Raises:
        InputError: another run is writing, rows with another stamp, or something else than rows.
    """
    busy = f"{path.parent}: another run is writing there"
    with journal.opened(path, STAMP + ENTRY, busy=busy, rows_of="a study", other="another directory") as found:
        rows, now = found.rows, asdict(stamp)
        other = [(name, row[name]) for row in rows for name in STAMP if row[name] != now[name]]
        if other and not replace:
            name, before = other[0]
            raise InputError(
                f"{path.parent}: holds rows of another {name} ({before}, now {now[name]}); "
                "name another directory with --out, or drop them with --replace"
            )
        if other:
            rows = []
            os.ftruncate(found.descriptor, 0)
        yield {row["index"]: row for row in rows}, found
