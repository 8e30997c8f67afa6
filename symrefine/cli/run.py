"""`symrefine run`: an experiment over the sweep of a YAML config; a run that was killed goes on where it ended."""

import argparse
from collections.abc import Iterator, Sequence, Set
from itertools import islice
from pathlib import Path
from typing import Any

from symrefine.cli.fleet import add_fleet_options, executor, write_rows
from symrefine.cli.outputs import check_outputs, complain, is_quiet, note, print_lines, say_lines
from symrefine.cli.signs import progress
from symrefine.cli.values import count
from symrefine.errors import InputError
from symrefine.files import naming

HELP = "run the experiment of a YAML config and write its rows, tables and figures"
DESCRIPTION = (
    "Run an experiment for every case of the sweep in CONFIG.yaml. Every finished run is on disk at once; run again, "
    "it is not done again. A run that fails gives a row with its error, the others go on, and the exit status is 1. "
    "A directory holds the rows of one config and one version of the code; others are refused unless --replace."
)
# What --list has a use for, by the names of the values: where it prints configs, and where runs.
_OF_CONFIGS = frozenset({"config", "list", "quiet", "verbose"})
_OF_RUNS = _OF_CONFIGS | {"set", "quick", "limit"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("config", metavar="CONFIG.yaml", nargs="?", help="experiment, sweep, tables, figures")
    parser.add_argument(
        "--list",
        action="store_true",
        help="do nothing but print the runs of CONFIG.yaml; without it, the configs in ./configs, else in this "
        "directory, else in configs of one above; a directory may stand in its place",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="put another value in the config, such as sweep.seed=[0,1] or fixed.points=5000; may be repeated",
    )
    parser.add_argument("--quick", action="store_true", help="the quick version: what the config sets under `quick`")
    parser.add_argument("--out", metavar="DIR", help="directory to write to (default: `out` of the config)")
    parser.add_argument("--limit", type=count, metavar="N", help="only the first N runs of the sweep")
    add_fleet_options(parser, "run")
    parser.add_argument(
        "--replace", action="store_true", help="drop rows of another config or code version in the directory"
    )


def run(args: argparse.Namespace) -> int:
    """Run the study, print its tables, tell whether all went well."""
    if args.config is None and not args.list:
        args.parser.error("CONFIG.yaml is missing; `symrefine run --list` names those that are here")
    of_configs = args.list and (args.config is None or Path(args.config).is_dir())
    if args.list:
        _check_list(args, *(("configs", _OF_CONFIGS) if of_configs else ("the runs of a config", _OF_RUNS)))
    from symrefine.fleet.limits import one_thread_each

    one_thread_each()  # before anything heavy is imported
    from symrefine.study.plan import make_plan
    from symrefine.study.runner import run_study

    if of_configs:
        say_lines(_configs(Path(args.config or ".")))
        return 0
    plan = make_plan(Path(args.config), args.set, quick=args.quick)
    if args.list:
        say_lines(_runs(plan.cases[: args.limit]))
        return 0
    folder = Path(args.out or plan.study.out)
    check_outputs({"--table": args.table}, [])
    with naming(str(folder)):
        outcome = run_study(
            plan,
            folder,
            executor=executor(args),
            shard=args.shard,
            limit=args.limit,
            replace=args.replace,
            progress=progress,
        )
    print_lines(outcome.tables.split("\n") if outcome.tables else [])
    for row in islice((row for row in outcome.rows if row["error"] is not None), 5):
        (complain if is_quiet() else note)(f"a run failed: {row['error']}")
    runs = len(outcome.rows)
    parts = [f"{runs} {'run' if runs == 1 else 'runs'}", f"{outcome.resumed} done before" if outcome.resumed else ""]
    parts += [f"{outcome.failed} failed" if outcome.failed else "", f"written to {folder}"]
    print_lines([", ".join(part for part in parts if part)])
    write_rows(args.table, outcome.untimed)
    return int(outcome.failed > 0)


def _check_list(args: argparse.Namespace, listed: str, used: Set[str]) -> None:
    """Refuse options that say how a study is run, where nothing is run.

    Raises:
        InputError: one of them is given.
    """
    for action in args.parser.arguments:
        if action.dest not in used and getattr(args, action.dest, action.default) != action.default:
            raise InputError(
                f"{action.option_strings[-1]}: does not apply to --list, which prints {listed} alone; leave it out"
            )


def _configs(folder: Path) -> Iterator[str]:
    """A line for each config of a directory, or of the nearest one that has some: its path and title.

    Raises:
        InputError: there are none.
    """
    from symrefine.study.document import read_document
    from symrefine.study.plan import configs_near

    found = configs_near(folder)
    width = max(len(str(path)) for path in found)
    for path in found:
        root = read_document(path)
        title = root.at("title" if "title" in root.value else "experiment")
        yield f"{path!s:<{width}}  {title.plain()}"


def _runs(cases: Sequence[Any]) -> Iterator[str]:
    """A line for each run of a sweep, numbered from 1 as `--limit` counts them: the fields in which they differ."""
    from symrefine.study.plan import varying

    names = varying(cases)
    for number, case in enumerate(cases, start=1):
        yield " ".join([f"{number:>{len(str(len(cases)))}} ", *(f"{name}={getattr(case, name)}" for name in names)])
