"""Where results go: files checked before the work and written all or none, stdout, tables, a sign of life."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.errors import InputError
from symrefine.files import Writer, check_target, json_text
from symrefine.files import write_all as write_all

if TYPE_CHECKING:
    from rich.console import Console

STDOUT = "-"


def check_outputs(outputs: dict[str, str | None], inputs: list[Path]) -> None:
    """Refuse, before any work, outputs that cannot be written, that are inputs, or that are one file twice.

    Args:
        outputs: option to path, None where the option is not given; only `--json` may be "-", for stdout.
    """
    taken = {path.resolve(): "the input" for path in inputs}
    for option, name in outputs.items():
        if name is None or (option == "--json" and name == STDOUT):
            continue
        path = Path(name)
        if name != STDOUT:
            check_target(path)
        if name == STDOUT or (option != "--json" and path.exists() and not path.is_file()):
            raise InputError(f"{option} {name}: expected a file; only --json writes to stdout and devices")
        if path.is_file() or not path.exists():
            if path.resolve() in taken:
                raise InputError(f"{option} {name}: is the same file as {taken[path.resolve()]}; name another one")
            taken[path.resolve()] = f"that of {option}"


def check_beside(option: str, name: str | None, details: dict[str, object]) -> None:
    """Refuse details of an output that is not asked for, which would be ignored.

    Args:
        details: option to value, None where it is not given.
    """
    given = [detail for detail, value in details.items() if value is not None]
    if name is None and given:
        raise InputError(f"{given[0]}: says how to write {option} FILE, which is not given; add it or leave this out")


def text_writer(text: str) -> Writer:
    """A writer of text in UTF-8, lines ending as they are."""
    return bytes_writer(text.encode("utf-8"))


def bytes_writer(data: bytes) -> Writer:
    """A writer of bytes."""
    return lambda path: path.write_bytes(data)


def json_writer(name: str | None, record: Mapping[str, Any]) -> dict[str, Writer]:
    """The writer of a record as JSON, if a file is asked for."""
    return {} if name in (None, STDOUT) else {str(name): text_writer(json_text(record))}


def tell(json_to: str | None, record: dict[str, Any], lines: Iterable[Any] | None, written: Iterable[str]) -> None:
    """Print a record: as JSON if stdout is asked for, else as lines and tables, and the names of the files written.

    Args:
        lines: to print; those that tables has for such a record if None.
    """
    if json_to == STDOUT:
        say(json_text(record))
        return
    from symrefine.cli.tables import record_lines

    out = console()
    for line in (*(record_lines(record) if lines is None else lines), *(f"wrote {name}" for name in written)):
        out.print(line, soft_wrap=isinstance(line, str))
    sys.stdout.flush()


def say(text: str) -> None:
    """Write to stdout as it stands."""
    sys.stdout.write(text)


def note(text: str) -> None:
    """Tell something on stderr, where it is in nobody's way."""
    print("symrefine: note:", text, file=sys.stderr)


def console(*, stderr: bool = False) -> "Console":
    """A console that colours nothing for files, pipes and NO_COLOR, and takes every text literally."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    plain = "NO_COLOR" in os.environ
    return Console(
        file=stream,
        color_system=None if plain else "auto",
        width=None if stream.isatty() else 160,
        highlight=False,
        markup=False,
        emoji=False,
    )


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """A sign of life on stderr while something takes long, if somebody looks on."""
    if not sys.stderr.isatty():
        yield
        return
    with console(stderr=True).status(text):
        yield


@contextmanager
def progress(text: str, total: int, done: int) -> Iterator[Callable[[], None]]:
    """A bar on stderr, if somebody looks on; the function it gives is called after each step."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.progress import Progress

    with Progress(console=console(stderr=True)) as bar:
        task = bar.add_task(text, total=total, completed=done)
        yield lambda: bar.advance(task)
