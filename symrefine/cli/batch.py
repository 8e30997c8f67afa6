"""`symrefine batch`: every file of a data set, one row each; a run that was killed goes on where it ended."""

import argparse
import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from symrefine.cli.fleet import add_fleet_options, executor, write_rows
from symrefine.cli.outputs import check_bop, check_outputs, complain, is_quiet, note, print_lines, write_all
from symrefine.cli.signs import counting
from symrefine.cli.values import add_object_options, detection_options, millimetres
from symrefine.errors import InputError
from symrefine.files import text_writer

if TYPE_CHECKING:
    from symrefine.cli.objects import Job
    from symrefine.cli.sources import Sources
    from symrefine.fleet.journal import Journal
    from symrefine.fleet.rows import Row

HELP = "detect the symmetries of every file of a data set"
DESCRIPTION = (
    "Detect the symmetries of every mesh and cloud that PATH or a manifest names and print a line for each as soon as "
    "it is done. PATH is a directory, a file, a pattern, or an address that fsspec knows (s3://bucket/models/; needs "
    "the extra remote). With --out, also append a JSON row for each; run again, files whose content and options have a "
    "row are not done again. A file of several molecules, models or volumes gives a row for each, called FILE#0 and so "
    "on. A file that cannot be used gives a row with its error, the others go on, and the exit status is 1. --workers, "
    "--dask and --shard change the order of the rows, but no row. With --bop, files are named as BOP names models, "
    "obj_000001.ply for object 1, or numbered by the ids of the manifest, and one models_info.json holds all of them."
)
# What tells an object of BOP in a manifest.
_BOP_ID = re.compile(r"[0-9]{1,9}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="PATH", nargs="*", help="directories, files, patterns or addresses of objects")
    parser.add_argument(
        "--manifest",
        metavar="FILE.csv",
        help="what to look at instead of PATH: a column `path`, relative to this file, and any of id, scale "
        "(millimetres in one unit), tolerance, units, measure, seed, frame, outliers, viewpoint, labels, weights, "
        "isolated (yes or no), which count before the options of the same name",
    )
    parser.add_argument("--out", metavar="FILE.jsonl", help="append the rows to this file (default: print only)")
    parser.add_argument("--bop", metavar="FILE", help="put the symmetries of all into this models_info.json of BOP")
    parser.add_argument(
        "--bop-scale", type=millimetres, metavar="X", help="millimetres in one unit of the files (default: 1)"
    )
    parser.add_argument("--recursive", action="store_true", help="directories inside directories too")
    add_fleet_options(parser, "file")
    add_object_options(parser, otherwise="each of them; with --bop there has to be one")


def run(args: argparse.Namespace) -> int:
    """Detect in every file, print the table, tell whether all went well."""
    from symrefine.fleet.limits import one_thread_each

    one_thread_each()  # before anything heavy is imported
    found = _sources(args)
    jobs, numbers = _jobs(args, found.ours)
    does = executor(args)
    from symrefine.cli.objects import detected, holds, known_apart
    from symrefine.cli.rows import ROW_HEAD, row_line
    from symrefine.fleet.journal import passing
    from symrefine.fleet.rows import Rows

    with opened(Path(args.out)) if args.out else passing("file") as out:
        if out.torn:
            note(f"{args.out}: the last row is incomplete; it is removed and done again")
        if others := found.passed_over(_written(args).values()):
            note(others)
        rows_by_name = out.latest
        known = known_apart(jobs, rows_by_name, does.limits)
        done = [job for job in known if holds(rows_by_name.get(job.name), job, does.limits)]
        kept = {job.name for job in done}
        print_lines(chain([ROW_HEAD], (row_line(job.name, rows_by_name[job.name]) for job in done)))
        with counting("detecting", len(known), len(done)) as doing:
            new = [job for job in known if job.name not in kept]
            for job, row in detected(new, does, out, expect=doing.expect):
                done.append(job)
                _show(row)
                doing.advance()
        order = {job.name: place for place, job in enumerate(jobs)}
        done.sort(key=lambda job: (order[job.whole], job.frame or 0))
        rows = Rows(len(done), lambda k: rows_by_name[done[k].name])
        failed = sum(row["error"] is not None for row in rows)
        files = "1 file" if len(jobs) == 1 else f"{len(jobs)} files"
        parts = [files, f"{len(rows)} objects" if len(rows) > len(jobs) else ""]
        parts += [f"{len(kept)} done before" if kept else "", f"{failed} failed" if failed else ""]
        print_lines([", ".join(part for part in parts if part)])
        write_rows(args.table, rows)
        left_out = _write_bop(args, rows, numbers) if args.bop else 0
    return int(left_out > 0 or failed > 0)


def _show(row: "Row") -> None:
    """A line for a file that was done, and an error even where nothing else is told."""
    from symrefine.cli.rows import row_line

    if is_quiet() and row["error"] is not None:
        complain(row["error"])
    print_lines([row_line(row["file"], row)])


def _jobs(args: argparse.Namespace, found: Sequence["Job"]) -> tuple[list["Job"], dict[str, int]]:
    """The jobs of this shard, and the numbers of all objects of BOP by their names.

    Raises:
        InputError: nothing to do, or outputs that cannot be written.
    """
    from symrefine.fleet.shard import Whole
    from symrefine.fleet.tasks import our_version

    outputs = _written(args)
    manifests = () if args.manifest is None else (args.manifest,)
    check_outputs(outputs, (Path(name) for name in chain(manifests, (job.path for job in found))))
    check_bop(args.bop, {"--bop-scale": args.bop_scale})
    numbers = {} if args.bop is None else _numbered(args, found)
    options = detection_options(args)
    scale = None if args.bop is None else args.bop_scale or 1.0
    jobs = [
        replace(
            job,
            options=options | dict(job.options) if job.options else options,  # of many one copy is held
            scale=scale and job.told.get("scale", scale),
        )
        for job in found
    ]
    if args.shard is None:
        return jobs, numbers
    about = ([job.name, dict(job.told), dict(job.options), job.scale] for job in jobs)
    fleet = Whole.of(len(jobs), chain([our_version()], about))
    own = [index for index in range(len(jobs)) if args.shard.takes(index)]
    return [replace(jobs[index], mark=fleet.mark(args.shard, index)) for index in own], numbers


def _written(args: argparse.Namespace) -> dict[str, str | None]:
    """The files that are written, by option."""
    return {"--out": args.out, "--bop": args.bop, "--table": args.table}


def _sources(args: argparse.Namespace) -> "Sources":
    from symrefine.cli.sources import Sources, manifest, sources

    if (args.manifest is None) != bool(args.path):
        args.parser.error("expected PATH, or --manifest FILE.csv, and not both")
    if args.manifest is None:
        return sources(args.path, recursive=args.recursive)
    if args.recursive:
        args.parser.error("--recursive: is for directories, and a manifest names files; leave it out")
    return Sources(ours=manifest(Path(args.manifest)))


def _numbered(args: argparse.Namespace, found: Sequence["Job"]) -> dict[str, int]:
    """The number of each object of BOP.

    Raises:
        InputError: a name or id that tells no object, two of one object, or a file that is no `models_info.json`.
    """
    from symrefine.export.bop import number_of, read_models_info
    from symrefine.load import stem_of

    read_models_info(Path(args.bop))
    owners: dict[int, str] = {}
    for job in found:
        told = job.told.get("id")
        by_id = int(told) if told and _BOP_ID.fullmatch(told) else None
        number = by_id if told else number_of(stem_of(Path(job.path)))
        if number is None:
            right = f"ids, and {told!r} is no number" if told else "names: obj_000001.ply"
            raise InputError(f"{job.place}: --bop takes the number of an object from {right}")
        other = owners.setdefault(number, job.name)
        if other != job.name:
            raise InputError(f"{job.place}: is object {number}, and so is {other}; --bop takes one")
    return {name: number for number, name in owners.items()}


def opened(path: Path) -> AbstractContextManager["Journal"]:
    """The journal of a batch.

    Raises:
        InputError: another batch is writing to it, or it holds something else than rows of a batch.
    """
    from symrefine.cli.objects import KINDS
    from symrefine.fleet import journal

    busy = f"{path}: another `symrefine batch` is writing to it"
    return journal.opened(path, KINDS, "file", busy=busy, rows_of="`symrefine batch`", other="another file")


def _write_bop(args: argparse.Namespace, rows: Sequence["Row"], numbers: Mapping[str, int]) -> int:
    """Write the entries of all rows that have one; tells of the others, and how many they are."""
    from symrefine.export.bop import bop_text, metres_doubt

    entries, left_out, told = {}, 0, args.bop_scale is not None
    for row in rows:
        found = row.get("bop", {"note": row["error"]})
        if found.get("note"):
            lost = "entry" not in found and row["error"] is None
            (complain if lost and is_quiet() else note)(found["note"])
        if "entry" in found:
            entries[numbers[row["file"]]] = found["entry"]
        else:
            left_out += 1
        told = told or "scale" in row
    name = args.bop
    write_all({name: text_writer(bop_text(Path(name), dict(sorted(entries.items()))))})
    if entries and not told:
        size, number = min((entry["diameter"], number) for number, entry in entries.items())
        if doubt := metres_doubt(f"object {number}", size, "--bop-scale", None):
            note(doubt)
    print_lines([f"wrote {name}: {len(entries)} of {len(rows)} objects"])
    return left_out
