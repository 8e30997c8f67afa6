"""Tasks in, rows out: each row is on disk before anybody hears of it."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TypeVar

from symrefine.fleet.crew import Executor
from symrefine.fleet.journal import Journal
from symrefine.fleet.limits import Limits, Lost, spelled
from symrefine.fleet.rows import Row

P = TypeVar("P")


def finish(
    executor: Executor,
    work: Callable[[P], Row],
    parcels: Sequence[P],
    lost: Callable[[P, Lost], Row],
    journal: Journal | None = None,
) -> Iterator[Row]:
    """The row of each parcel, in the order in which they are done.

    Args:
        work: makes the row of a parcel; a function of a module, which another process can import.
        lost: makes the row of a parcel that has none.
        journal: where each row goes first.

    Raises:
        InputError: no room for a row.
        Exception: what `work` raised.
    """
    for index, outcome in executor.do(work, parcels):
        # A task that was lost tells the limit that it met.
        row = lost(parcels[index], outcome) | {"lost": outcome.under} if isinstance(outcome, Lost) else outcome
        if journal is not None:
            journal.append(row)
        yield row


@cache
def our_version() -> str:
    """The version that rows are made with."""
    from importlib.metadata import version

    return version("symrefine")


def is_final(row: Row, limits: Limits) -> bool:
    """Whether a row done before stands: it was not lost, or to a limit that is the same today."""
    return row.get("lost") is None or row["lost"] in spelled(limits)
