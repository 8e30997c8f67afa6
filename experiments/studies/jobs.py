"""Cases of a study in several processes, their rows in the order of the cases."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from symrefine.errors import SymrefineError
from symrefine.fleet.crew import Processes
from symrefine.fleet.limits import Lost

C = TypeVar("C")
R = TypeVar("R")


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """The option `--jobs`."""
    parser.add_argument("--jobs", type=_count, default=1, metavar="N", help="cases run at the same time (default: 1)")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of processes, 1 or more")
    return int(text)


def in_order(work: Callable[[C], R], cases: Sequence[C], jobs: int) -> Iterator[R]:
    """What `work` makes of each case, in their order, each as soon as it and all before it are done.

    Args:
        work: a function of a module, which another process can import.
        cases: what it is called with; they and what it returns can be pickled.
        jobs: processes of one thread each; with 1 all is done in this one.

    Raises:
        SymrefineError: the process of a case died, twice.
    """
    if jobs == 1 or len(cases) < 2:
        yield from map(work, cases)
        return
    early: dict[int, R] = {}
    following = 0
    for index, result in Processes(workers=jobs).do(work, cases):
        if isinstance(result, Lost):
            raise SymrefineError(f"case {index}: {result.why}")
        early[index] = result
        while following in early:
            yield early.pop(following)
            following += 1


def counted(text: str, work: Callable[[C], R], cases: Sequence[C], jobs: int) -> list[R]:
    """The same, all at the end, for tables of all cases: how many are done is shown on stderr meanwhile.

    Args:
        text: what is being done.
    """
    from symrefine.cli.signs import progress

    rows = []
    with progress(text, len(cases), 0) as advance:
        for row in in_order(work, cases, jobs):
            rows.append(row)
            advance()
    return rows
