"""The three standard streams, which whoever starts the command may have closed, filled or left."""

import os
import sys
from typing import TextIO

from symrefine.errors import InputError

# The numbers of the standard streams that were closed when the process began.
_CLOSED: set[int] = set()


def fill_closed() -> None:
    """Open what is closed of stdin, stdout and stderr on nothing.

    Else Python has no stream there, and the next file that is opened, a result perhaps, takes the number that native
    code prints to.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(nowhere)
    _CLOSED.update(number for number, stream in enumerate((sys.stdin, sys.stdout, sys.stderr)) if stream is None)
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - lives as long as the process
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def check_stdout() -> None:
    """Refuse to put a result on stdout if that was closed: nobody would have it.

    Raises:
        InputError: it was.
    """
    if 1 in _CLOSED:
        raise InputError("standard output is closed, and the result was to go there; open it, or name a file")


def discard(stream: TextIO) -> None:
    """Send what is still to be flushed, and all that follows, nowhere: nobody reads it, or it cannot be written."""
    try:
        target = stream.fileno()
    except OSError:
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, target)
    os.close(nowhere)


def aside(text: str) -> None:
    """A line on stderr at once; where it cannot be written the work goes on, and its results and status stand."""
    stream = sys.stderr
    try:
        print(text, file=stream, flush=True)
    except OSError:
        discard(stream)
