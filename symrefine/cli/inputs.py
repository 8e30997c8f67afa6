"""Files to read: patterns that no shell expanded, what comes on stdin, and what was wrong with one of many."""

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING

from symrefine.clock import Clock
from symrefine.errors import InputError, SymrefineError, meant, one_line

if TYPE_CHECKING:
    from symrefine.shape import Shape

# What is written for the path of a file that comes on stdin, and what it is called afterwards.
STDIN, NAME = "-", "stdin"


def expanded(names: Sequence[str]) -> list[str]:
    """The files that names and patterns (`*`, `?`, `[ab]`, `**`) stand for, in order; a file of that name comes first.

    Raises:
        InputError: a pattern that no file matches.
    """
    found: list[str] = []
    for name in names:
        if not has_magic(name) or Path(name).exists():
            found.append(name)
            continue
        files = sorted(match for match in glob(name, recursive=True) if Path(match).is_file())  # noqa: PTH207
        if not files:
            raise InputError(f"{name}: no file matches this pattern")
        found += files
    return found


@contextmanager
def readable(name: str, suffix: str | None) -> Iterator[str]:
    """A path to read what a name stands for: itself, or a file that holds what comes on stdin, as long as this lasts.

    Args:
        suffix: the format of stdin, as a file would have it, with or without its dot.

    Raises:
        InputError: stdin without a format, a format without stdin, or one that is not known; a directory; a suffix
            that is close to a known one; whatever is wrong with what came on stdin, under that name.
    """
    if name != STDIN:
        if suffix is not None:
            raise InputError(f"--format {suffix}: is for PATH -, which reads stdin; {name} has its suffix")
        _check_named(Path(name))
        yield name
        return
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        file = Path(folder, NAME).with_suffix(_known_suffix(suffix))
        with file.open("wb") as copy:
            shutil.copyfileobj(sys.stdin.buffer, copy)
        try:
            yield str(file)
        except SymrefineError as error:
            raise type(error)(str(error).replace(str(file), NAME)) from None


def loaded(name: str, suffix: str | None, read: Callable[[str], "Shape"]) -> "Shape":
    """The shape in what a name stands for, as `readable` says, read by a function of a path."""
    with readable(name, suffix) as file, Clock()("load"):
        shape = read(file)
    return shape if file == name else replace(shape, source=NAME)


def failure(path: str, error: Exception) -> str:
    """What was wrong with one of many files, for which the others need not end."""
    if isinstance(error, SymrefineError | OSError):
        return one_line(error)
    if isinstance(error, MemoryError):
        return f"{path}: out of memory"
    return one_line(f"{path}: internal error: {type(error).__name__}: {error}")


def _known_suffix(name: str | None) -> str:
    """The suffix of a format."""
    known = _suffixes()
    if name is None:
        raise InputError(f"-: reads stdin, which has no suffix; say what it holds: --format {_bare(known)}")
    suffix = f".{name.lower().removeprefix('.')}"
    if suffix.removesuffix(".gz") not in known:
        close = meant(suffix[1:], (k[1:] for k in known))
        raise InputError(f"--format {name}: is not known; expected one of {_bare(known)}{close}")
    return suffix


def _check_named(path: Path) -> None:
    """Refuse slips of the pen with what may have been meant; whatever else is wrong the readers tell."""
    if path.is_dir():
        raise InputError(f"{path}: is a directory; expected a file (`symrefine batch {path}` takes all that are in it)")
    from symrefine.load import suffix_of

    known, suffix = _suffixes(), suffix_of(path)
    if suffix not in known and path.is_file() and (close := meant(suffix, known)):
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; known are {' '.join(known)}{close}")


def _suffixes() -> list[str]:
    from symrefine.load import SUFFIXES

    return sorted(SUFFIXES)


def _bare(suffixes: Sequence[str]) -> str:
    return " ".join(suffix[1:] for suffix in suffixes)
