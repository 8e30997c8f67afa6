"""`symrefine batch`: every file of a directory, one row each; a run that was killed goes on where it ended."""

import argparse
import re
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symrefine import journal
from symrefine.cli.inputs import failure
from symrefine.cli.outputs import (
    check_beside,
    check_outputs,
    complain,
    is_quiet,
    note,
    print_lines,
    write_all,
)
from symrefine.cli.signs import progress
from symrefine.cli.values import (
    add_class_options,
    add_detection_options,
    add_frame_option,
    add_scan_options,
    count,
    detection_options,
    positive,
)
from symrefine.errors import InputError
from symrefine.files import naming, text_writer

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.plane import PlanarDetection
    from symrefine.shape import Shape

HELP = "detect the symmetries of every file in a directory"
DESCRIPTION = (
    "Detect the symmetries of every mesh and cloud in DIR and print a line for each as soon as it is done. With --out, "
    "also append a JSON row for each; run again, files whose content and options have a row are not done again. A file "
    "that cannot be used gives a row with its error, the others go on, and the exit status is 1. With --bop, DIR is a "
    "folder of models as BOP names them, obj_000001.ply for object 1, and one models_info.json holds all of them."
)

Row = dict[str, Any]
# Directory, path of the file in it, options of `detect`, millimetres in a unit if its entry of BOP is wanted.
Job = tuple[str, str, dict[str, Any], float | None]
# Object 1 of BOP is obj_000001.ply.
_BOP_NAME = re.compile(r"obj_([0-9]{1,9})")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("dir", metavar="DIR", help="directory of meshes and clouds")
    parser.add_argument("--out", metavar="FILE.jsonl", help="append the rows to this file (default: print only)")
    parser.add_argument("--bop", metavar="FILE", help="put the symmetries of all into this models_info.json of BOP")
    parser.add_argument(
        "--bop-scale", type=positive, metavar="X", help="millimetres in one unit of the files (default: 1)"
    )
    parser.add_argument("--recursive", action="store_true", help="directories inside DIR too")
    parser.add_argument(
        "--workers", type=count, default=1, metavar="N", help="files done at the same time (default: %(default)s)"
    )
    add_class_options(parser)
    add_frame_option(parser)
    add_scan_options(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect in every file, print the table, tell whether all went well."""
    files = _files(Path(args.dir), recursive=args.recursive)
    check_outputs({"--out": args.out, "--bop": args.bop}, [Path(args.dir, name) for name in files])
    check_beside("--bop", args.bop, {"--bop-scale": args.bop_scale})
    scale = _check_bop(args, files)
    options = detection_options(args)
    from symrefine.cli.rows import ROW_HEAD, row_line
    from symrefine.study.work import in_processes

    with opened(Path(args.out)) if args.out else nullcontext() as out:
        if out and out.torn:
            note(f"{args.out}: the last row is incomplete; it is removed and done again")
        latest = {row["file"]: row for row in out.rows} if out else {}
        done = {name: latest[name] for name in files if name in latest}
        rows = {name: row for name, row in done.items() if _holds(row, args.dir, options, scale)}
        jobs = [(args.dir, name, options, scale) for name in files if name not in rows]
        print_lines([ROW_HEAD, *(row_line(name, row) for name, row in rows.items())])
        with progress("detecting", len(files), len(rows)) as advance:
            for row in in_processes(examine_file, jobs, args.workers):
                if out:
                    with naming(args.out):
                        out.append(row)
                rows[row["file"]] = row
                _show(row)
                advance()
    kept, failed = len(files) - len(jobs), sum(row["error"] is not None for row in rows.values())
    parts = [f"{len(files)} files", f"{kept} done before" if kept else "", f"{failed} failed" if failed else ""]
    print_lines([", ".join(part for part in parts if part)])
    left_out = _write_bop(args.bop, rows, told=args.bop_scale is not None) if args.bop else 0
    return int(left_out > 0 or failed > 0)


def _show(row: Row) -> None:
    """A line for a file that was done, and an error even where nothing else is told."""
    from symrefine.cli.rows import row_line

    if is_quiet() and row["error"] is not None:
        complain(row["error"])
    print_lines([row_line(row["file"], row)])


def _check_bop(args: argparse.Namespace, files: list[str]) -> float | None:
    """The scale, if entries of BOP are wanted.

    Raises:
        InputError: a file whose name tells no object, two of one object, or a file that is no `models_info.json`.
    """
    if args.bop is None:
        return None
    from symrefine.export.bop import read_models_info
    from symrefine.load import stem_of

    read_models_info(Path(args.bop))
    owners: dict[int, str] = {}
    for name in files:
        match = _BOP_NAME.fullmatch(stem_of(Path(name)))
        if match is None:
            raise InputError(f"{Path(args.dir, name)}: --bop takes the number of an object from names: obj_000001.ply")
        other = owners.setdefault(int(match[1]), name)
        if other != name:
            raise InputError(f"{Path(args.dir, name)}: is object {int(match[1])}, and so is {other}; --bop takes one")
    return float(args.bop_scale or 1.0)


def opened(path: Path) -> AbstractContextManager[journal.Journal]:
    """The journal of a batch.

    Raises:
        InputError: another batch is writing to it, or it holds something else than rows of a batch.
    """
    busy = f"{path}: another `symrefine batch` is writing to it"
    return journal.opened(path, ("file",), busy=busy, rows_of="`symrefine batch`", other="another file")


def _holds(row: Row, folder: str, options: dict[str, Any], scale: float | None) -> bool:
    """Whether a row done before still tells of its file, with the entry of BOP if one is wanted and can be had."""
    now = _head(Path(folder, row["file"]), row["file"], options)
    if now["sha256"] is None or any(row.get(key) != now[key] for key in ("sha256", "version", "options")):
        return False
    return scale is None or row["error"] is not None or row.get("bop", {}).get("scale") == scale


def _head(path: Path, name: str, options: dict[str, Any]) -> Row:
    """What names a row: the file, its content, the options, the version; `error` is set if the file cannot be read."""
    from hashlib import file_digest
    from importlib.metadata import version

    row: Row = {"file": name, "sha256": None, "error": None, "version": version("symrefine"), "options": options}
    try:
        with path.open("rb") as stream:
            row["sha256"] = file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        row["error"] = f"{path}: cannot be read: {error.strerror}"
    return row


def _write_bop(name: str, rows: dict[str, Row], *, told: bool) -> int:
    """Write the entries of all rows that have one; tells of the others, and how many they are.

    Args:
        told: whether the millimetres in one unit were given, so that there is nothing to doubt.
    """
    from symrefine.export.bop import bop_text, metres_doubt
    from symrefine.load import stem_of

    entries, left_out = {}, 0
    for file, row in sorted(rows.items()):
        found = row.get("bop", {"note": row["error"]})
        if found.get("note"):
            lost = "entry" not in found and row["error"] is None
            (complain if lost and is_quiet() else note)(found["note"])
        if "entry" in found:
            entries[int(_BOP_NAME.fullmatch(stem_of(Path(file)))[1])] = found["entry"]  # type: ignore[index]
        else:
            left_out += 1
    write_all({name: text_writer(bop_text(Path(name), dict(sorted(entries.items()))))})
    if entries and not told:
        size, number = min((entry["diameter"], number) for number, entry in entries.items())
        if doubt := metres_doubt(f"object {number}", size, "--bop-scale"):
            note(doubt)
    print_lines([f"wrote {name}: {len(entries)} of {len(rows)} objects"])
    return left_out


def _files(folder: Path, *, recursive: bool) -> list[str]:
    """Paths below `folder` of the files that can be read, in order."""
    from symrefine.load import READERS, suffix_of

    if not folder.is_dir():
        raise InputError(f"{folder}: {'is a file, not a' if folder.exists() else 'no such'} directory")
    found = folder.rglob("*") if recursive else folder.glob("*")
    names = [p.relative_to(folder) for p in found if suffix_of(p) in READERS and p.is_file()]
    shown = sorted(name.as_posix() for name in names if not any(part.startswith(".") for part in name.parts))
    if not shown:
        raise InputError(f"{folder}: no mesh and no cloud in it; known are {' '.join(READERS)}, and .gz of each")
    return shown


def examine_file(job: Job) -> Row:
    """The row of one file: its record, or what was wrong with it."""
    from symrefine.cli.detect import examine

    folder, name, options, scale = job
    path = Path(folder, name)
    row = _head(path, name, options)
    if row["error"] is not None:
        return row
    try:
        shape, detection, record = examine(str(path), options)
        return row | record | ({} if scale is None else {"bop": _bop(detection, shape, scale)})
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        return row | {"error": failure(str(path), error)}


def _bop(found: "Detection | PlanarDetection", shape: "Shape", scale: float) -> Row:
    """The entry of BOP with its scale and what it cannot hold, or why there is none."""
    from symrefine.export.bop import bop_entry, bop_limits

    if shape.dim != 3:
        return {"scale": scale, "note": f"{shape.source}: lies in the plane; BOP is for objects in space"}
    detection = cast("Detection", found)
    try:
        entry = bop_entry(detection, shape, scale=scale)
    except InputError as error:
        return {"scale": scale, "note": str(error)}
    limits = bop_limits(detection)
    return {"scale": scale, "entry": entry, "note": f"{shape.source}: {limits}" if limits else None}
