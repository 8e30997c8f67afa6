"""`symrefine batch`: every file of a directory, one row each; a run that was killed goes on where it ended."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli import journal
from symrefine.cli.outputs import check_outputs, console, progress
from symrefine.cli.values import add_detection_options, count
from symrefine.errors import InputError, SymrefineError

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

NAME = "batch"
HELP = "detect the symmetries of every file in a directory"
DESCRIPTION = (
    "Detect the symmetries of every mesh and cloud in DIR and print a line for each. With --out, also append a JSON "
    "row for each file as soon as it is done; run again, files whose content and options have a row are not done "
    "again. A file that cannot be used gives a row with its error, the others go on, and the exit status is 1."
)

Row = dict[str, Any]
# Directory, path of the file in it, options of `detect`.
Job = tuple[str, str, dict[str, Any]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("dir", metavar="DIR", help="directory of meshes and clouds")
    parser.add_argument("--out", metavar="FILE.jsonl", help="append the rows to this file (default: print only)")
    parser.add_argument("--recursive", action="store_true", help="directories inside DIR too")
    parser.add_argument(
        "--workers", type=count, default=1, metavar="N", help="files done at the same time (default: %(default)s)"
    )
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect in every file, print the table, tell whether all went well."""
    files = _files(Path(args.dir), recursive=args.recursive)
    check_outputs({"--out": args.out}, [Path(args.dir, name) for name in files])
    options = {"tolerance": args.tolerance, "measure": args.measure, "seed": args.seed}
    rows = journal.finished(Path(args.out), Path(args.dir), files, options) if args.out else {}
    jobs = [(args.dir, name, options) for name in files if name not in rows]
    with progress("detecting", len(files), len(rows)) as advance:
        for row in _rows(jobs, args.workers):
            if args.out:
                journal.append(Path(args.out), row)
            rows[row["file"]] = row
            advance()
    _print([rows[name] for name in files], len(files) - len(jobs))
    return int(any(row["error"] is not None for row in rows.values()))


def _files(folder: Path, *, recursive: bool) -> list[str]:
    """Paths below `folder` of the files that can be read, in order."""
    from symrefine.load import READERS

    if not folder.is_dir():
        raise InputError(f"{folder}: {'is a file, not a' if folder.exists() else 'no such'} directory")
    found = folder.rglob("*") if recursive else folder.glob("*")
    names = [p.relative_to(folder) for p in found if p.suffix.lower() in READERS and p.is_file()]
    shown = sorted(name.as_posix() for name in names if not any(part.startswith(".") for part in name.parts))
    if not shown:
        raise InputError(f"{folder}: no mesh and no cloud in it; known are {' '.join(sorted(READERS))}")
    return shown


def _rows(jobs: list[Job], workers: int) -> Iterator[Row]:
    """A row for each job, as soon as it is done."""
    if workers == 1 or len(jobs) < 2:
        yield from map(examine_file, jobs)
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # the workers share the cores already
    pool = ProcessPoolExecutor(min(workers, len(jobs)), get_context("spawn"), _start_worker)
    try:
        for done in as_completed([pool.submit(examine_file, job) for job in jobs]):
            yield done.result()
    except BrokenProcessPool:
        raise SymrefineError(
            "a worker process died, perhaps out of memory; finished rows are kept, run it again"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _start_worker() -> None:
    """Make a worker end with an interrupt, and with the process that started it."""
    import signal
    import threading
    from multiprocessing import parent_process

    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: "BaseProcess") -> None:
    parent.join()
    os._exit(1)


def examine_file(job: Job) -> Row:
    """The row of one file: its record, or what was wrong with it."""
    from symrefine.cli.detect import examine

    folder, name, options = job
    path = Path(folder, name)
    row = journal.head(path, name, options)
    if row["error"] is not None:
        return row
    try:
        return row | examine(str(path), **options)[2]
    except (SymrefineError, OSError) as error:
        return row | {"error": " ".join(str(error).split())}
    except MemoryError:
        return row | {"error": f"{path}: out of memory"}
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        return row | {"error": f"{path}: internal error: {type(error).__name__}: {error}"}


def _print(rows: list[Row], kept: int) -> None:
    from symrefine.cli.tables import batch_table

    failed = sum(row["error"] is not None for row in rows)
    out = console()
    out.print(batch_table(rows))
    parts = [f"{len(rows)} files", f"{kept} done before" if kept else "", f"{failed} failed" if failed else ""]
    out.print(", ".join(part for part in parts if part))
