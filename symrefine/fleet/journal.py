"""Rows on disk while they are made: one JSON object a line, appended whole and synced; nothing is done twice.

One process writes at a time. A last line that a killed run left incomplete is dropped; everything before it counts.
"""

import errno
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.files import is_only_writer, naming

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """An open journal: the rows that it held, whether an incomplete one was dropped, and where the next one goes."""

    path: Path
    rows: Sequence[Row]
    torn: bool
    descriptor: int

    def append(self, row: Mapping[str, Any]) -> None:
        """Append a row in one write, so that nobody ever sees half of one, and wait until it is on disk.

        Raises:
            InputError: no room.
        """
        line = json.dumps(row).encode("ascii") + b"\n"
        with naming(str(self.path)):
            if os.write(self.descriptor, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self.descriptor)


@contextmanager
def opened(path: Path, keys: Sequence[str], *, busy: str, rows_of: str, other: str) -> Iterator[Journal]:
    """The journal in a file, made if it is not there; nobody else can write to it until the end of this process.

    Args:
        keys: that every row has, the one first that it begins with.
        busy: what to say if another process is writing.
        rows_of: what such rows belong to, for messages.
        other: what to name instead: "another file".

    Raises:
        InputError: another process is writing, or the file holds something else than such rows.
    """
    with path.open("ab", buffering=0) as stream:
        if not is_only_writer(stream.fileno()):
            raise InputError(f"{busy}; wait, or name {other}")
        rows, size, torn = _rows(path, keys, rows_of, other)
        if torn:
            os.ftruncate(stream.fileno(), size)
        yield Journal(path=path, rows=rows, torn=torn, descriptor=stream.fileno())


def read_rows(path: Path, keys: Sequence[str], *, rows_of: str) -> list[Row]:
    """The rows of a journal that nobody writes to any more, which stays as it is.

    Args:
        keys: that every row has, the one first that it begins with.
        rows_of: what such rows belong to, for messages.

    Raises:
        InputError: there is none, a process is writing, the last row is incomplete, or it holds something else.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    other = "another one"
    with path.open("rb") as stream:
        if not is_only_writer(stream.fileno()):
            raise InputError(f"{path}: is being written to; wait, or name {other}")
        rows, _, torn = _rows(path, keys, rows_of, other)
    if torn:
        raise InputError(f"{path}: the last row is incomplete; run again what writes it, or name {other}")
    return rows


def _rows(path: Path, keys: Sequence[str], rows_of: str, other: str) -> tuple[list[Row], int, bool]:
    """The rows of a file, the bytes that they take, and whether half of one follows."""
    first = json.dumps(keys[0]).encode("ascii").join([b"{", b": "])
    data = path.read_bytes()
    size = data.rfind(b"\n") + 1
    whole, rest = data[:size].splitlines(), data[size:]
    if not all(line.startswith(first) for line in whole) or not rest.startswith(first[: len(rest)]):
        raise InputError(f"{path}: is there already and holds no rows of {rows_of}; name {other}")
    try:
        rows = [json.loads(line) for line in whole]
        [row[key] for row in rows for key in keys]
    except (ValueError, KeyError, RecursionError) as error:
        raise InputError(f"{path}: is damaged: {error}; name {other}") from None
    return rows, size, bool(rest)
