"""The command line: parse, call, print, exit. Only it prints and exits; `--help` imports nothing heavy."""

import io
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import NoReturn

from symrefine.cli.streams import aside, discard, fill_closed
from symrefine.errors import SymrefineError, one_line

BAD_INPUT, BUG, INTERRUPTED, BROKEN_PIPE = 2, 70, 130, 141


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """The command `symrefine`: end the process with the status of `invoke`."""
    fill_closed()
    if not sys.warnoptions and not _debugging():
        warnings.simplefilter("ignore")  # of numpy and others: nothing that who runs a command could act upon
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a file name may hold what the terminal cannot show
    sys.exit(invoke(sys.argv[1:] if argv is None else argv))


def invoke(argv: Sequence[str]) -> int:
    """Run one command line and return its exit status; whatever goes wrong becomes one line on stderr."""
    try:
        status = _command(argv)
        sys.stdout.flush()
        return status
    except SymrefineError as error:
        return _refuse(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _refuse("interrupted", INTERRUPTED)
    except BrokenPipeError:
        discard(sys.stdout)
        return BROKEN_PIPE
    except OSError as error:
        discard(sys.stdout)
        return _refuse(": ".join(str(part) for part in (error.filename, error.strerror or error) if part), BAD_INPUT)
    except MemoryError:
        return _refuse("out of memory: use a smaller cloud or mesh", BAD_INPUT)
    except Exception as error:  # noqa: BLE001 - a bug, told in one line unless asked for more
        return _bug(error)


def _command(argv: Sequence[str]) -> int:
    from symrefine.cli.outputs import loudness
    from symrefine.cli.parser import parse

    try:
        args = parse(argv)
    except SystemExit as done:  # argparse after --help and --version
        return int(done.code or 0)
    token = loudness.set("quiet" if args.quiet else "verbose" if args.verbose else "normal")
    try:
        status: int = args.run(args)
        return status
    finally:
        loudness.reset(token)


def _refuse(message: str, status: int) -> int:
    aside(f"symrefine: {one_line(message)}")
    return status


def _bug(error: Exception) -> int:
    if _debugging():
        traceback.print_exception(error)
    kind = type(error).__name__
    return _refuse(
        f"internal error, please report it: {kind}: {error} (SYMREFINE_DEBUG=1 shows where it happened)", BUG
    )


def _debugging() -> bool:
    return os.environ.get("SYMREFINE_DEBUG", "0") not in ("", "0")
