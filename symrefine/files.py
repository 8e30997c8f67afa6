"""Files that are whole or absent: written beside their place under another name, then moved there in one step.

A file that grows row by row has one writer at a time.
"""

import json
import os
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from symrefine.errors import InputError

# What to say of what is not `is_regular`.
ENDLESS = "is a pipe or a device; expected a file"
# Before the first record of a list in JSON, and between one entry and the next.
_FIRST, _BETWEEN = "[\n", ",\n"
# A writer fills the file it is given.
Writer = Callable[[Path], object]
# The files that were asked for since somebody wants to know.
_asked: ContextVar[list[Path] | None] = ContextVar("asked", default=None)
# What brings a file here that is asked for, where it comes from elsewhere.
_bring: ContextVar[Callable[[Path], object] | None] = ContextVar("bring", default=None)


def path_of(name: str | os.PathLike[str]) -> Path:
    """The path that is given.

    Raises:
        InputError: an empty name, which pathlib takes for this directory, or one that no system takes.
    """
    if not os.fspath(name):
        raise InputError("the name of the file is empty; expected a path")
    path = Path(name)
    if "\0" in str(path):
        raise InputError(f"{str(path)[:60]!a}: is no name of a file: embedded null byte")
    return path


def check_target(path: Path) -> None:
    """Refuse a path that cannot be written, before any work is done for it.

    Raises:
        InputError: a directory, no such parent directory, or no permission.
    """
    try:
        is_folder, place = path.is_dir(), path.resolve()
    except (OSError, ValueError, RuntimeError) as error:  # the last of links that lead to one another
        raise InputError(f"{str(path)[:60]!a}: is no name of a file: {error}") from None
    if is_folder:
        raise InputError(f"{path}: is a directory; expected a file to write")
    folders = (path.parent, place.parent)  # a link may lead to where nothing is
    if missing := next((folder for folder in folders if not folder.is_dir()), None):
        raise InputError(f"{path}: cannot be written: there is no directory {missing}")
    if path.exists() and not os.access(path, os.W_OK):
        raise InputError(f"{path}: cannot be written: the file is write-protected")
    if _is_replaceable(path):
        check_folder(place.parent, f"{path}")


def place_of(path: Path) -> Path:
    """Where a path leads, as far as links lead anywhere: where they lead to one another the file is missing."""
    return Path(os.path.realpath(path))


def check_other(path: Path, source: str, *, in_folder: bool = False) -> None:
    """Refuse to write over what was read.

    Raises:
        InputError: the path leads to the input.
    """
    if place_of(path) == place_of(Path(source)):
        raise InputError(f"{path}: is the input itself; name another {'folder' if in_folder else 'file'}")


def check_folder(folder: Path, what: str) -> None:
    """Refuse a directory that nothing can be put into, named with what was to be.

    Raises:
        InputError: no permission.
    """
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{what}: cannot be written: no permission in the directory {folder}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to; what was written there takes the place of `path` at the end, or vanishes after an error.

    Devices and pipes (`/dev/stdout`) have nothing to replace: they are written to directly.
    """
    if not _is_replaceable(path):
        yield path
        return
    place = path.resolve()
    draft = place.with_name(f".{place.stem}.{secrets.token_hex(4)}{place.suffix}")
    try:
        yield draft
        with naming(str(path)):
            if place.exists():
                draft.chmod(place.stat().st_mode)
            draft.replace(place)
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """`replacing` for a path that nobody has checked yet.

    Raises:
        InputError: the file cannot be written, before or while it is.
    """
    check_target(path)
    with replacing(path) as draft, naming(str(path), draft):
        yield draft


class _UnwrittenError(InputError):
    """A file that could not be written, by its name."""

    def __init__(self, name: str, reason: OSError) -> None:
        super().__init__(f"{name}: cannot be written: {reason.strerror or reason}")
        self.name = name


@contextmanager
def naming(name: str, draft: Path | None = None) -> Iterator[None]:
    """Name the file that could not be written: the system names none, and whoever fills a draft names that.

    Raises:
        InputError: the disk is full, or the like.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, InputError) as error:
        reason = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(reason, OSError) or (isinstance(error, _UnwrittenError) and error.name != str(draft)):
            raise
        raise _UnwrittenError(name, reason) from reason


def write_all(writers: Mapping[str, Writer]) -> None:
    """Write every file under another name first; only when all are complete does each take its place."""
    with ExitStack() as stack:
        for name, write in writers.items():
            draft = stack.enter_context(replacing(Path(name)))
            with naming(name, draft):  # and not around what is written later
                write(draft)


def text_writer(text: str) -> Writer:
    """A writer of text in UTF-8, lines ending as they are."""
    return bytes_writer(text.encode("utf-8"))


def pieces_writer(pieces: Iterable[str]) -> Writer:
    """A writer of text that is made piece by piece while it is written, once; in UTF-8, lines ending as they are."""

    def write(path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="") as stream:
            stream.writelines(pieces)

    return write


def bytes_writer(data: bytes) -> Writer:
    """A writer of bytes."""
    return lambda path: path.write_bytes(data)


def json_text(data: Mapping[str, Any]) -> str:
    """Strict JSON in ASCII: a line for each entry, and for each object in a list of objects.

    Raises:
        ValueError: NaN or infinity, which JSON does not know.
    """
    return "".join(json_pieces(data.items()))


def json_pieces(entries: Iterable[tuple[str, Any]]) -> Iterator[str]:
    """What `json_text` has, piece by piece; an iterator of objects stands for a list of them that nobody holds.

    Raises:
        ValueError: NaN or infinity, which JSON does not know.
    """
    yield "{\n"
    for number, (key, value) in enumerate(entries):
        yield f"{_BETWEEN if number else ''}  {json.dumps(key)}: "
        yield from _entry(value)
    yield "\n}\n"


def json_array_text(records: Iterable[Mapping[str, Any]]) -> str:
    """Strict JSON in ASCII of several records, each as `json_text` writes it.

    Raises:
        ValueError: NaN or infinity, which JSON does not know.
    """
    return "[\n" + ",\n".join(json_text(record).rstrip("\n") for record in records) + "\n]\n"


def _entry(value: Any) -> Iterator[str]:
    if not isinstance(value, Iterator) and not (isinstance(value, list) and value and isinstance(value[0], dict)):
        yield json.dumps(value, allow_nan=False)
        return
    empty = True
    for record in value:
        yield f"{_FIRST if empty else _BETWEEN}    {json.dumps(record, allow_nan=False)}"
        empty = False
    yield "[]" if empty else "\n  ]"


def is_only_writer(descriptor: int) -> bool:
    """Lock an open file for one writer; False if another process has it. The lock ends with the process that holds it.

    Where the system or the file system knows no such locks, it trusts.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError)
    return True


def _is_replaceable(path: Path) -> bool:
    return path.is_file() or not path.exists()


def file_bytes(file: Path, *, first: int | None = None, most: int | None = None) -> bytes:
    """What a file holds.

    Args:
        first: so many bytes of it are wanted, or all.
        most: bytes that it may have.

    Raises:
        InputError: it is missing, unreadable, empty or too large, or no file.
    """
    ask(file)
    try:
        state = file.stat()
        if most is not None and state.st_size > most:
            raise InputError(f"has {state.st_size:,} bytes; expected {most:,} at most")
        data = _first_bytes(file, first) if is_regular(state) else None
    except FileNotFoundError:
        raise InputError("no such file") from None
    except ValueError as error:  # a name that no system takes
        raise InputError(f"is no name of a file: {error}") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}") from None
    if data is None:
        raise InputError(ENDLESS)
    if not data:
        raise InputError("is empty (0 bytes)")
    return data


def _first_bytes(file: Path, count: int | None) -> bytes:
    if count is None:
        return file.read_bytes()
    with file.open("rb") as stream:
        return stream.read(count)


def is_regular(state: os.stat_result) -> bool:
    """Whether something is no pipe and no device, which have no end that one could wait for."""
    return stat.S_ISREG(state.st_mode) or stat.S_ISDIR(state.st_mode)


def ask(file: Path) -> None:
    """Tell those who want to know that a file is asked for, by a reader that does not come here, and have it brought.

    Raises:
        InputError: it cannot be brought from where it lies.
    """
    if (asked := _asked.get()) is not None and file not in asked:
        asked.append(file)
    if (bring := _bring.get()) is not None and not os.path.lexists(file):
        bring(file)


@contextmanager
def asked_for() -> Iterator[list[Path]]:
    """The files that are asked for as long as this lasts, each once, whether they are there or not."""
    asked: list[Path] = []
    token = _asked.set(asked)
    try:
        yield asked
    finally:
        _asked.reset(token)


@contextmanager
def brought(bring: Callable[[Path], object]) -> Iterator[None]:
    """Have files brought that are asked for and not there, as long as this lasts.

    Args:
        bring: puts a file in its place, if it can be had.
    """
    token = _bring.set(bring)
    try:
        yield
    finally:
        _bring.reset(token)
