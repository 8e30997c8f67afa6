"""Rows on disk while a study runs: one JSON object a line, appended whole and synced; nothing is done twice.

A journal belongs to one config and one code version, named in every line. A last line that a killed run left
incomplete is dropped; everything before it counts.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.files import is_only_writer

_FIRST_KEY = b'{"config": '


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


@contextmanager
def opened(path: Path, stamp: Stamp, *, replace: bool) -> Iterator[tuple[dict[int, Entry], "Journal"]]:
    """The finished runs by index, and the journal to append to; nobody else can write to it meanwhile.

    Args:
        path: of the journal; it is made if it is not there.
        stamp: of the rows to come.
        replace: whether rows with another stamp are dropped instead of refused.

    Raises:
        InputError: another run is writing, rows with another stamp, or something else than rows.
    """
    with path.open("ab", buffering=0) as stream:
        if not is_only_writer(stream.fileno()):
            raise InputError(f"{path.parent}: another run is writing there; wait, or name another directory")
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if not _is_ours(whole, data[len(whole) :]):
            raise InputError(f"{path}: is there already and holds no rows of a study; name another directory")
        lines = [_row(line, path) for line in whole.splitlines()]
        if other := [line for line in lines if _stamp(line) != stamp]:
            if not replace:
                raise InputError(_difference(path, _stamp(other[0]), stamp))
            whole, lines = b"", []
        if len(whole) < len(data):
            os.ftruncate(stream.fileno(), len(whole))
        entries = {line["index"]: _entry(line) for line in lines}
        yield entries, Journal(descriptor=stream.fileno(), stamp=stamp)


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """An open journal."""

    descriptor: int
    stamp: Stamp

    def append(self, entry: Entry) -> None:
        """Append a row in one write and wait until it is on disk.

        Raises:
            OSError: no room.
        """
        stamp = {"config": self.stamp.config, "code": self.stamp.code, "libraries": dict(self.stamp.libraries)}
        run = {"index": entry.index, "error": entry.error, "results": entry.results, "timings": entry.timings}
        line = json.dumps(stamp | run).encode("ascii") + b"\n"
        if os.write(self.descriptor, line) != len(line):
            raise OSError(28, os.strerror(28))
        os.fsync(self.descriptor)


def _is_ours(whole: bytes, rest: bytes) -> bool:
    return all(line.startswith(_FIRST_KEY) for line in whole.splitlines()) and (
        rest.startswith(_FIRST_KEY) or rest == _FIRST_KEY[: len(rest)]
    )


def _row(line: bytes, path: Path) -> dict[str, Any]:
    try:
        row: dict[str, Any] = json.loads(line)
        _stamp(row), _entry(row)
    except (ValueError, KeyError) as error:
        raise InputError(f"{path}: is damaged: {error}; name another directory") from None
    return row


def _stamp(row: Mapping[str, Any]) -> Stamp:
    return Stamp(config=row["config"], code=row["code"], libraries=row["libraries"])


def _entry(row: Mapping[str, Any]) -> Entry:
    return Entry(index=row["index"], error=row["error"], results=row["results"], timings=row["timings"])


def _difference(path: Path, old: Stamp, new: Stamp) -> str:
    for what, before, now in (
        ("config", old.config, new.config),
        ("code", old.code, new.code),
        ("libraries", dict(old.libraries), dict(new.libraries)),
    ):
        if before != now:
            return (
                f"{path.parent}: holds rows of another {what} ({before}, now {now}); "
                "name another directory with --out, or drop them with --replace"
            )
    raise AssertionError("equal stamps")
