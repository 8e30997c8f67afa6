"""The three standard streams, which whoever starts the command may have closed, filled or left."""

import os
import sys
from typing import TextIO


def fill_closed() -> None:
    """Open what is closed of stdin, stdout and stderr on nothing.

    Else Python has no stream there, and the next file that is opened, a result perhaps, takes the number that native
    code prints to.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(nowhere)
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - lives as long as the process
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


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
