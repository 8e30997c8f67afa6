"""Rows of a batch on disk: one JSON object a line, appended whole; what is there need not be done again."""

import errno
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from symrefine.cli.outputs import naming, note
from symrefine.errors import InputError
from symrefine.files import is_only_writer

Row = dict[str, Any]

_FIRST_KEY = b'{"file": '


def head(path: Path, name: str, options: dict[str, Any]) -> Row:
    """What names a row: the file, its content, the options, the version; `error` is set if the file cannot be read."""
    from hashlib import file_digest

    row: Row = {"file": name, "sha256": None, "error": None, "version": _version(), "options": options}
    try:
        with path.open("rb") as stream:
            row["sha256"] = file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        row["error"] = f"{path}: cannot be read: {error.strerror}"
    return row


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Keep other batches from `path`, which is made if it is not there, until the end or the death of this process.

    Raises:
        InputError: another batch is writing to it.
    """
    with path.open("ab", buffering=0) as stream:
        if not is_only_writer(stream.fileno()):
            raise InputError(f"{path}: another `symrefine batch` is writing to it; wait, or name another file")
        yield


def append(path: Path, row: Row) -> None:
    """Append a row in one write, so that a reader or a killed run never sees half of one.

    Raises:
        InputError: no room.
    """
    line = json.dumps(row, allow_nan=False).encode("ascii") + b"\n"
    with naming(str(path)), path.open("ab", buffering=0) as stream:
        if stream.write(line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def finished(path: Path, folder: Path, files: Iterable[str], options: dict[str, Any]) -> dict[str, Row]:
    """The rows in `path` that still hold, by file; a line that a killed run left incomplete is removed.

    Raises:
        InputError: the file holds something else than rows of a batch.
    """
    if not path.is_file():
        return {}
    latest = {row["file"]: row for row in _read(path)}
    return {name: latest[name] for name in files if name in latest and _holds(latest[name], folder / name, options)}


def _holds(row: Row, path: Path, options: dict[str, Any]) -> bool:
    if row.get("options") != options or row.get("version") != _version() or row.get("sha256") is None:
        return False
    return bool(row["sha256"] == head(path, row["file"], options)["sha256"])


@cache
def _version() -> str:
    from importlib.metadata import version

    return version("symrefine")


def _read(path: Path) -> list[Row]:
    data = path.read_bytes()
    whole, _, rest = data.rpartition(b"\n")
    lines = whole.split(b"\n") if whole else []
    if not all(line.startswith(_FIRST_KEY) for line in lines) or not rest.startswith(_FIRST_KEY[: len(rest)]):
        raise InputError(f"{path}: is there already and holds no rows of `symrefine batch`; name another file")
    try:
        rows = [json.loads(line) for line in lines]
    except ValueError as error:
        raise InputError(f"{path}: is damaged: {error}; name another file") from None
    if rest:
        note(f"{path}: the last row is incomplete; it is removed and done again")
        os.truncate(path, len(data) - len(rest))
    return rows
