"""Options of commands with many tasks: where they are done, within which limits, which of them; a table of all."""

import argparse
import re
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from symrefine.cli.outputs import note, print_lines, write_all
from symrefine.cli.values import count, positive
from symrefine.errors import InputError
from symrefine.files import Writer

if TYPE_CHECKING:
    from symrefine.fleet.crew import Executor
    from symrefine.fleet.rows import Row
    from symrefine.fleet.shard import Shard

_BYTES = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "ki": 2**10, "mi": 2**20, "gi": 2**30}


def add_fleet_options(parser: argparse.ArgumentParser, task: str) -> None:
    """The options that say how many tasks are done, and which.

    Args:
        task: what one is called: "file".
    """
    add_executor_options(parser, task)
    parser.add_argument(
        "--shard",
        type=shard,
        metavar="I/N",
        help=f"only every N-th {task}, from the I-th one on; `symrefine merge` makes one of the N parts",
    )
    add_table_option(parser)


def add_executor_options(parser: argparse.ArgumentParser, task: str) -> None:
    """The options that say where tasks are done, and what one may take."""
    parser.add_argument(
        "--workers",
        type=count,
        metavar="N",
        help=f"{task}s done at the same time, each in a process of one thread, on this machine (default: 1)",
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="do them on a cluster of Dask: tcp://host:port of its scheduler, or `local` for one of --workers on this "
        "machine; needs the extra dask",
    )
    parser.add_argument(
        "--time-limit",
        type=positive,
        metavar="SECONDS",
        help=f"what one {task} may take; one that takes longer gives a row with its error (default: no limit)",
    )
    parser.add_argument(
        "--memory-limit",
        type=memory,
        metavar="SIZE",
        help=f"what the process of one {task} may hold, libraries (0.3GB) included, such as 2GB or 512MiB; on Linux "
        "(default: no limit)",
    )


def add_table_option(parser: argparse.ArgumentParser) -> None:
    """The option that asks for a flat table."""
    parser.add_argument(
        "--table", metavar="FILE", help="write all rows, flat and in order, as a table too: .csv or .parquet"
    )


def shard(text: str) -> "Shard":
    """One of several shards, such as 3/16."""
    from symrefine.fleet.shard import Shard

    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not a shard I/N with I from 1 to N, such as 3/16")
    return Shard(number=int(match[1]), of=int(match[2]))


def memory(text: str) -> int:
    """Bytes of a size with its unit."""
    match = re.fullmatch(r"([0-9]{1,12}(?:\.[0-9]{1,6})?)\s*([kmg]i?)?b?", text.lower())
    size = int(float(match[1]) * _BYTES[match[2] or ""]) if match else 0
    if not 0 < size < 2**60:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size of memory, such as 2GB or 512MiB")
    return size


def executor(args: argparse.Namespace) -> "Executor":
    """What does the tasks, as the options say.

    Raises:
        InputError: options that do not go together, or that cannot be had here.
    """
    from symrefine.fleet.crew import on_this_machine
    from symrefine.fleet.limits import Limits, check_limits

    limits = Limits(seconds=args.time_limit, memory=args.memory_limit)
    check_limits(limits)
    if args.dask is None:
        return on_this_machine(args.workers or 1, limits, note)
    from symrefine.fleet.cluster import LOCAL, Dask, check_address

    check_address(args.dask)
    if args.dask != LOCAL and args.workers is not None:
        raise InputError(f"--workers {args.workers}: is for this machine; --dask {args.dask} has workers of its own")
    return Dask(address=args.dask, workers=args.workers or 1, limits=limits, tell=note)


def write_rows(name: str | None, rows: "Sequence[Row]") -> None:
    """Write rows as a flat table if one is asked for, and say so."""
    write_all(table_writer(name, rows))
    tell_table(name, rows)


def tell_table(name: str | None, rows: "Sequence[Row]") -> None:
    """Say that the table was written, if one was asked for."""
    if name is not None:
        print_lines([f"wrote {name}: {len(rows)} rows"])


def table_writer(name: str | None, rows: "Sequence[Row]") -> dict[str, Writer]:
    """The writer of rows as a flat table if one is asked for, without their times, which differ from run to run."""
    if name is None:
        return {}
    from symrefine.fleet.rows import Rows
    from symrefine.fleet.shard import PART
    from symrefine.fleet.table import flat, write_table

    def told_of(number: int) -> "Row":
        return flat({key: value for key, value in rows[number].items() if key not in ("timings", PART)})

    return {name: partial(write_table, Rows(len(rows), told_of))}
