"""Rows on disk while they are made: one JSON object a line, appended whole and synced; nothing is done twice.

One process writes at a time. A last line that a killed run left incomplete is dropped; everything before it counts.
Rows are read where they stand when they are asked for: what is held of each is its key and its place.
"""

import errno
import json
import os
import tempfile
from array import array
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from symrefine.errors import InputError
from symrefine.files import is_only_writer, naming
from symrefine.fleet.rows import Row, Rows

# What a row has, and of which types: it begins with the first of them.
Kinds = Mapping[str, tuple[type, ...]]
# Bytes of a row: a thousand times what the largest group with all that came near to it takes.
LONGEST = 64 * 2**20


class Latest(Mapping[str | int, Row]):
    """Of the rows of a file the last one of each key, read when it is asked for."""

    def __init__(self, path: Path, places: dict[str | int, int]) -> None:
        self._path, self._places = path, places

    def __getitem__(self, key: str | int) -> Row:
        return _row_at(self._path, self._places[key])

    def __iter__(self) -> Iterator[str | int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """An open journal, whose rows are told apart by the value of a key.

    Attributes:
        by: that key.
        places: where the last row of each value begins.
        torn: whether an incomplete row was dropped.
        descriptor: of the file, where the next row goes.
    """

    path: Path
    by: str
    places: dict[str | int, int]
    torn: bool
    descriptor: int

    @property
    def latest(self) -> Latest:
        """The last row of each value of the key, those to come included."""
        return Latest(self.path, self.places)

    def among(self, keys: Iterable[str | int]) -> Latest:
        """The last row of each of some values of the key, in their order.

        Raises:
            KeyError: a value has no row.
        """
        return Latest(self.path, {key: self.places[key] for key in keys})

    def append(self, row: Row) -> None:
        """Append a row in one write, so that nobody ever sees half of one, and wait until it is on disk.

        Raises:
            InputError: no room.
        """
        line = json.dumps(row).encode("ascii") + b"\n"
        with naming(str(self.path)):
            place = os.fstat(self.descriptor).st_size
            if os.write(self.descriptor, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self.descriptor)
        self.places[row[self.by]] = place

    def clear(self) -> None:
        """Drop all rows."""
        os.ftruncate(self.descriptor, 0)
        self.places.clear()


@contextmanager
def opened(path: Path, kinds: Kinds, by: str, *, busy: str, rows_of: str, other: str) -> Iterator[Journal]:
    """The journal in a file, made if it is not there; nobody else can write to it until the end of this process.

    Args:
        kinds: what every row has.
        by: the key that tells rows apart.
        busy: what to say if another process is writing.
        rows_of: what such rows belong to, for messages.
        other: what to name instead: "another file".

    Raises:
        InputError: another process is writing, or the file holds something else than such rows.
    """
    with path.open("ab", buffering=0) as stream:
        if not is_only_writer(stream.fileno()):
            raise InputError(f"{busy}; wait, or name {other}")
        places: dict[str | int, int] = {}
        end = 0
        for place, after, row in _whole_rows(path, kinds, rows_of, other):
            places[row[by]], end = place, after
        torn = end < os.fstat(stream.fileno()).st_size
        if torn:
            os.ftruncate(stream.fileno(), end)
        yield Journal(path=path, by=by, places=places, torn=torn, descriptor=stream.fileno())


@contextmanager
def passing(by: str) -> Iterator[Journal]:
    """A journal that nobody asked for, gone with the end of this."""
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        path = Path(folder, "rows.jsonl")
        with path.open("ab", buffering=0) as stream:
            yield Journal(path=path, by=by, places={}, torn=False, descriptor=stream.fileno())


def read_rows(path: Path, kinds: Kinds, *, rows_of: str) -> Rows:
    """The rows of a journal that nobody writes to any more, which stays as it is.

    Args:
        kinds: what every row has.
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
        places, end = array("q"), 0
        for place, after, _ in _whole_rows(path, kinds, rows_of, other):
            places.append(place)
            end = after
        if end < os.fstat(stream.fileno()).st_size:
            raise InputError(f"{path}: the last row is incomplete; run again what writes it, or name {other}")
    return Rows(len(places), lambda k: _row_at(path, places[k]))


def _row_at(path: Path, place: int) -> Row:
    with path.open("rb") as stream:
        stream.seek(place)
        row: Row = json.loads(stream.readline())
        return row


def _whole_rows(path: Path, kinds: Kinds, rows_of: str, other: str) -> Iterator[tuple[int, int, Row]]:
    """Where each row of a file begins and ends, and the row; half of one may follow the last."""
    first = json.dumps(next(iter(kinds))).encode("ascii").join([b"{", b": "])
    place = 0
    with path.open("rb") as stream:
        while line := stream.readline(LONGEST):
            if not line.startswith(first[: len(line)]):
                raise InputError(f"{path}: is there already and holds no rows of {rows_of}; name {other}")
            if not line.endswith(b"\n"):
                if len(line) < LONGEST:
                    return
                raise InputError(f"{path}: is damaged: a row takes more than {LONGEST:,} bytes; name {other}")
            try:
                row = json.loads(line)
                _check(row, kinds)
            except (ValueError, KeyError, RecursionError) as error:
                raise InputError(f"{path}: is damaged: {error}; name {other}") from None
            yield place, place + len(line), row
            place += len(line)


def _check(row: Row, kinds: Kinds) -> None:
    for key, known in kinds.items():
        if type(row[key]) not in known:
            raise ValueError(f"a row has a {key} that is {row[key]!r}")
