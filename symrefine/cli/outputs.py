"""Where results go: files checked before the work and written all or none, stdout, tables, notes; how loud it is."""

import os
import sys
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from symrefine.cli.streams import aside, check_stdout
from symrefine.clock import Clock
from symrefine.errors import InputError, one_line, printable
from symrefine.files import Writer, check_target, json_text, naming, place_of, text_writer
from symrefine.files import write_all as write_all

if TYPE_CHECKING:
    import argparse

    from rich.console import Console

    from symrefine.front.answers import Answer

STDOUT = "-"
# Outputs that are no objects, and what they are called as a rule.
_REPORTS = {"--json": "x.json", "--report": "x.html", "--recording": "x.rrd", "--bop": "models_info.json"}
# Options that show an answer, and the suffixes of what they write.
SHOWN = {"recording": ".rrd", "picture": ".png", "report": ".html"}
# How much is told: "quiet" are errors alone and what stdout was asked to hold, "verbose" tells stages too.
Loudness = Literal["quiet", "normal", "verbose"]
loudness: ContextVar[Loudness] = ContextVar("loudness", default="normal")


def check_outputs(outputs: dict[str, str | None], inputs: Iterable[Path]) -> None:
    """Refuse, before any work, outputs that cannot be written, that are inputs, or that are one file twice.

    Args:
        outputs: option to path, None where the option is not given; only `--json` may be "-", for stdout.
    """
    for name in outputs.values():
        if name not in (None, STDOUT):
            check_target(Path(name))
    _check_stdout(outputs)
    given = {place_of(Path(name)) for name in outputs.values() if name not in (None, STDOUT)}
    taken = {place: "the input" for path in inputs if (place := place_of(path)) in given}
    for option, name in outputs.items():
        if name is None or (option == "--json" and name == STDOUT):
            continue
        path = Path(name)
        if name == STDOUT or (option != "--json" and path.exists() and not path.is_file()):
            raise InputError(f"{option} {name}: expected a file; only --json writes to stdout and devices")
        if path.is_file() or not path.exists():
            if (place := place_of(path)) in taken:
                raise InputError(f"{option} {name}: is the same file as {taken[place]}; name another one")
            taken[place] = f"that of {option}"
        _check_name(option, path)
        if (suffix := SHOWN.get(option[2:])) and path.suffix.lower() != suffix:
            raise InputError(f"{option} {name}: expected a name that ends in {suffix}")


def _check_stdout(outputs: dict[str, str | None]) -> None:
    """Refuse a closed stdout where the result goes there: as JSON, or as a table and nowhere else."""
    as_table = "--json" in outputs and not any(outputs.values()) and not is_quiet()
    if as_table or outputs.get("--json") == STDOUT:
        check_stdout()


def _check_name(option: str, path: Path) -> None:
    """Refuse a table of an unknown format, and a report where an object is likely to be: `--json *.ply` names one."""
    if option == "--table":
        from symrefine.fleet.table import check_table

        check_table(path)
    if option not in _REPORTS:
        return
    from symrefine.load import SUFFIXES, suffix_of

    for place in (path, place_of(path)):
        if suffix_of(place) in SUFFIXES:
            here = "" if place == path else f" is a link to {place}, which"
            raise InputError(
                f"{option} {path}:{here} has the suffix of an object; expected a name such as {_REPORTS[option]}"
            )
    if option == "--json" and path.is_file() and not _may_be_json(path):
        raise InputError(f"{option} {path}: is there already and is no JSON; expected a name such as x.json")


def _may_be_json(path: Path) -> bool:
    """Whether a file begins as JSON of records does, or holds nothing."""
    with naming(str(path)), path.open("rb") as stream:
        return stream.read(2**10).lstrip()[:1] in (b"", b"{", b"[")


def check_bop(name: str | None, details: dict[str, object]) -> None:
    """Refuse details of an entry of BOP that is not asked for, which would be ignored.

    Args:
        details: option to value, None where it is not given.
    """
    given = [detail for detail, value in details.items() if value is not None]
    if name is None and given:
        raise InputError(f"{given[0]}: says how to write --bop FILE, which is not given; add it or leave this out")


def add_outputs(parser: "argparse.ArgumentParser", **told: str) -> None:
    """Options that say where an answer goes, `json` or one of `SHOWN`, each with its help."""
    for name, help_text in told.items():
        kind = "FILE|-" if name == "json" else f"FILE{SHOWN[name]}"
        parser.add_argument(f"--{name}", metavar=kind, help=help_text)


def shown(args: "argparse.Namespace") -> dict[str, str | None]:
    """The options of a command that show an answer, with the files that they are to fill."""
    return {f"--{name}": getattr(args, name) for name in SHOWN if name in args}


def shown_writers(args: "argparse.Namespace", answer: "Answer") -> dict[str, Writer]:
    """The writers of the files that show an answer, as far as they are asked for, each a stage of its own."""
    asked = {option.removeprefix("--"): name for option, name in shown(args).items() if name is not None}
    return {name: _staged(answer, option) for option, name in asked.items()}


def _staged(answer: "Answer", option: str) -> Writer:
    """What writes one of the files that show an answer: pages and pictures are drawn now, recordings as they go."""
    if option == "recording":
        write = answer.writer(SHOWN[option])

        def recorded(path: Path) -> None:
            with Clock()(option):
                write(path)

        return recorded
    with Clock()("page" if option == "report" else option):
        return answer.writer(SHOWN[option])


def json_writer(name: str | None, record: Mapping[str, Any]) -> dict[str, Writer]:
    """The writer of a record as JSON, if a file is asked for."""
    return {} if name in (None, STDOUT) else {str(name): text_writer(json_text(record))}


def is_quiet() -> bool:
    """Whether nothing but errors is to be told."""
    return loudness.get() == "quiet"


def is_verbose() -> bool:
    """Whether stages and their seconds are to be told."""
    return loudness.get() == "verbose"


def tell(json_to: str | None, record: dict[str, Any], lines: Iterable[Any] | None, written: Iterable[str]) -> None:
    """Print a record: as JSON if stdout is asked for, else as lines and tables, and the names of the files written.

    Args:
        lines: to print; those that tables has for such a record if None.
    """
    if json_to == STDOUT:
        say(json_text(record))
    elif not is_quiet():
        from symrefine.cli.tables import record_lines

        told = record_lines(record) if lines is None else lines
        print_lines((*told, *(f"wrote {name}" for name in written)))


def print_lines(lines: Iterable[Any]) -> None:
    """Print lines, whole, and tables on stdout at once, unless nothing but errors is to be told."""
    if is_quiet():
        return
    out = console()
    with naming("stdout"):
        for line in lines:
            if isinstance(line, str):
                out.print(printable(line), soft_wrap=True)
            else:
                out.print(line)
        sys.stdout.flush()


def say(text: str) -> None:
    """Write to stdout, as it stands, what was asked to be there.

    Raises:
        InputError: stdout is closed.
    """
    check_stdout()
    with naming("stdout"):
        sys.stdout.write(text)
        sys.stdout.flush()


def say_lines(lines: Iterable[str]) -> None:
    """Write lines to stdout that were asked for, however quiet it is to be."""
    say("".join(f"{printable(line)}\n" for line in lines))


def note(text: str) -> None:
    """Tell something on stderr, where it is in nobody's way."""
    if not is_quiet():
        aside(f"symrefine: note: {one_line(text)}")


def complain(text: str) -> None:
    """Tell on stderr what went wrong, however quiet it is to be."""
    aside(f"symrefine: {one_line(text)}")


def console(*, stderr: bool = False) -> "Console":
    """A console that colours nothing for files, pipes and NO_COLOR, and takes every text literally."""
    from rich.console import Console

    class Honest(Console):
        """A console that tells of a reader who left, where rich would end the process with status 1."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    stream = sys.stderr if stderr else sys.stdout
    plain = "NO_COLOR" in os.environ
    return Honest(
        file=stream,
        color_system=None if plain else "auto",
        width=None if stream.isatty() else 160,
        highlight=False,
        markup=False,
        emoji=False,
    )
