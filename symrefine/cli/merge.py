"""`symrefine merge`: the parts that `--shard` wrote become one."""

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from symrefine.cli.fleet import add_table_option, table_writer, tell_table
from symrefine.cli.outputs import check_outputs, print_lines, write_all
from symrefine.errors import InputError
from symrefine.files import check_target, naming, pieces_writer, place_of

if TYPE_CHECKING:
    from symrefine.fleet.rows import Row

HELP = "make one of the parts that --shard wrote"
DESCRIPTION = (
    "Put the parts that `symrefine batch --shard` or `symrefine run --shard` wrote together, rows in the order of the "
    "tasks. Parts that are incomplete, overlap, or belong to another fleet are refused, and so is an output that is "
    "there already. Parts of `batch` are its files; those of `run` are its directories, and `symrefine run` on the "
    "directory made of them writes the tables."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="PART", nargs="+", help="all files of a batch, or all directories of a study")
    parser.add_argument("--out", metavar="FILE|DIR", required=True, help="file, or directory, for the whole")
    add_table_option(parser)


def run(args: argparse.Namespace) -> int:
    """Merge, and say what was merged."""
    from symrefine.fleet.shard import merged
    from symrefine.study.runner import JOURNAL

    parts = [Path(name) for name in args.path]
    studies = [path for path in parts if path.is_dir()]
    for path, count in Counter(map(place_of, parts)).items():
        if count > 1:
            raise InputError(f"{path}: is named {count} times; merge takes each part once")
    if studies and len(studies) < len(parts):
        other = next(path for path in parts if path not in studies)
        raise InputError(f"{other}: is no directory as {studies[0]} is; merge takes files, or directories")
    files = [path / JOURNAL for path in parts] if studies else parts
    out = Path(args.out, JOURNAL) if studies else Path(args.out)
    if Path(args.out).exists():
        raise InputError(f"{args.out}: is there already; name another one with --out")
    if studies and args.table:
        raise InputError(f"--table {args.table}: is for parts of `batch`; `symrefine run` writes the table of a study")
    check_outputs(({} if studies else {"--out": args.out}) | {"--table": args.table}, files)
    rows = merged({str(path): _rows(path, is_study=bool(studies)) for path in files})
    with naming(str(out)):
        out.parent.mkdir(exist_ok=True)
    check_target(out)
    lines = (f"{json.dumps(row)}\n" for row in rows)
    write_all({str(out): pieces_writer(lines)} | table_writer(args.table, rows))
    tell_table(args.table, rows)
    print_lines([f"wrote {args.out}: {len(rows)} rows of {len(parts)} parts"])
    return 0


def _rows(path: Path, *, is_study: bool) -> Sequence["Row"]:
    from symrefine.cli.objects import KINDS as BATCH
    from symrefine.fleet.journal import read_rows
    from symrefine.study.journal import KINDS

    kinds, rows_of = (KINDS, "a study") if is_study else (BATCH, "`symrefine batch`")
    return read_rows(path, kinds, rows_of=rows_of)
