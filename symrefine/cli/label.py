"""`symrefine label`: a folder of models to `models_info.json`, with a page on which a person decides the doubtful."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symrefine.cli.fleet import add_executor_options, executor
from symrefine.cli.inputs import failure
from symrefine.cli.outputs import complain, is_quiet, note, print_lines, write_all
from symrefine.cli.signs import progress
from symrefine.cli.values import add_loudness, add_object_options, detection_options, millimetres, probability
from symrefine.errors import InputError, about, one_line
from symrefine.files import pieces_writer, text_writer, whole

if TYPE_CHECKING:
    from symrefine.fleet.crew import Executor
    from symrefine.fleet.journal import Journal
    from symrefine.fleet.limits import Lost
    from symrefine.review.decisions import Decisions
    from symrefine.review.labels import Labels
    from symrefine.review.objects import Row

    Rows = Mapping[int, Row]

HELP = "label the symmetries of a data set: detect all, and have a person decide the doubtful ones on a page"
DESCRIPTION = (
    "Detect the symmetries of all models in DIR, named as BOP does (obj_000001.ply is object 1) or else numbered in "
    "the order of their names, and write to a folder: models_info.json with the symmetries of all that are settled, "
    "labels.json with who settled them and what is still open, and review.html, a page that needs no server, on which "
    "a person chooses the group of each object and saves the choices as decisions.json. Run again with --decisions "
    "they are applied, and kept in the folder. An object is settled where a person decided it, or its confidence is "
    "that of --accept or more; no other has an entry in models_info.json. What was detected with the same options is "
    "not detected again."
)
# Of a group that was not found: the least probability that is worth a word.
_WORTH = 0.01
# What names an object, its folder, and that of the labels.
Job = tuple["Row", str, str]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "dir",
        metavar="DIR",
        help="folder of models: obj_000001.ply is object 1; where no name is like that, all are numbered from 1 on, "
        "and keep their numbers",
    )
    parser.add_argument("--out", required=True, metavar="FOLDER", help="where the labels go; it is made if not there")
    parser.add_argument("--decisions", metavar="FILE", help="apply these choices, saved from the page of the review")
    parser.add_argument(
        "--accept",
        type=probability,
        metavar="P",
        help="settle objects of this confidence or more without a look, such as 0.95 (default: none)",
    )
    parser.add_argument(
        "--scale", type=millimetres, metavar="X", help="millimetres in one unit of the files (default: 1)"
    )
    add_executor_options(parser, "file")
    add_object_options(parser, otherwise="there has to be one; files that hold one are taken as they are")


def run(args: argparse.Namespace) -> int:
    """Detect what is new, apply what was decided, write the labels, tell what is left."""
    from symrefine.fleet.limits import one_thread_each

    one_thread_each()  # so that one worker gives the same bytes as several
    from symrefine.export.bop import models_of
    from symrefine.review.decisions import read_decisions
    from symrefine.review.labels import labelled, merged
    from symrefine.review.objects import doubtful_first
    from symrefine.review.store import DECISIONS, LABELS, heads, numbers_before, opened

    does, out = executor(args), Path(args.out)
    models, is_told = models_of(Path(args.dir), numbers_before(out))
    asked = heads(models, detection_options(args), float(args.scale or 1.0))
    given = read_decisions(Path(args.decisions)) if args.decisions else {}
    _check(args.decisions, given, asked)
    if not is_told:
        note(f"{args.dir}: no name tells a number, as obj_000001.ply does; {out / LABELS} has those that were given")
    with opened(out) as held:
        kept = read_decisions(out / DECISIONS) if (out / DECISIONS).is_file() else {}
        rows = _detected(args, does, asked, held, merged(kept, given))
        _check(args.decisions, given, rows)
        decisions = merged(_fitting(kept, rows, out / DECISIONS), given)
        labels = labelled(rows, decisions, args.accept)
        order = doubtful_first(rows)
        _write(args, rows, order, decisions, labels)
    failed = len(rows) - len(order)
    _tell(args, len(rows), failed, labels)
    return int(failed > 0)


def _check(name: str, given: "Decisions", rows: "Rows") -> None:
    """Refuse a decision that does not fit its object."""
    from symrefine.review.labels import trouble

    for k, decision in enumerate(given.values()):
        if told := trouble(decision, rows):
            raise InputError(f"{name}: decisions[{k}].{told}")


def _fitting(kept: "Decisions", rows: "Rows", place: Path) -> "Decisions":
    """The decisions of before whose objects are as they were; tells of the others, which are open again."""
    from symrefine.review.labels import trouble

    told = {number: trouble(decision, rows) for number, decision in kept.items()}
    for number, why in told.items():
        if why:
            note(f"{place}: object {number} is open again: {why}")
    return {number: decision for number, decision in kept.items() if not told[number]}


def _detected(
    args: argparse.Namespace, does: "Executor", asked: "Rows", held: "Journal", decisions: "Decisions"
) -> "Rows":
    """The rows of all objects, on disk; those that still tell of their files are not made again.

    A line tells of each, and what was decided of it.
    """
    from symrefine.fleet.tasks import finish
    from symrefine.review.store import ROWS, holds

    out = Path(args.out)
    if held.torn:
        note(f"{out / ROWS}: the last row is incomplete; it is removed and done again")
    latest = held.latest
    kept = {n: None for n, row in asked.items() if holds(out, cast("Row | None", latest.get(n)), row, does.limits)}
    jobs = [(row, args.dir, args.out) for number, row in asked.items() if number not in kept]
    print_lines(_line(row, decisions) for row in cast("Rows", held.among(kept)).values())
    with progress("detecting", len(asked), len(kept)) as advance:
        for made in finish(does, examine_model, jobs, lost, held):
            row = cast("Row", made)
            if is_quiet() and row["error"] is not None:
                complain(row["error"])
            print_lines([_line(row, decisions)])
            advance()
    return cast("Rows", held.among(sorted(asked)))


def examine_model(job: Job) -> dict[str, Any]:
    """The row of one object: what was found, or what was wrong with it; its pictures are written first."""
    from symrefine.cli.detect import detected
    from symrefine.detection.result import Detection
    from symrefine.review.objects import examined
    from symrefine.review.store import place_of_picture

    row, folder, out = job
    path = Path(folder, row["file"])
    if row["error"] is not None:
        return dict(row)
    try:
        found = detected(_read(str(path), row["options"]), row["options"], str(path))
        shape = found.shape
        if not isinstance(found, Detection):
            raise InputError(f"{path}: points have {shape.dim} coordinates; labels are for objects in space")
        kept = examined(found, shape, scale=row["scale"])
        for k, picture in enumerate(kept.pictures):
            with whole(place_of_picture(Path(out), row, k)) as draft:
                draft.write_bytes(picture)
        return {**row, **kept.told}
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        return {**row, "error": failure(str(path), error)}


def _read(path: str, options: dict[str, Any]) -> Any:
    """The object in a file; the one that `frame` of the options chooses where it holds several."""
    from symrefine.cli.inputs import scans

    frame, others = options.get("frame"), {name: given for name, given in options.items() if name != "frame"}
    found = scans(path, others, in_chunks=True)
    if len(found) == 1:
        return found[0]
    if frame is None:
        raise InputError(
            f"{path}: holds {len(found)} {found.what}, and a label is of one object: choose with --frame, from 0 to "
            f"{len(found) - 1}, which counts for all such files, or write each to a file obj_NNNNNN of its own"
        )
    with about(path):
        return found.chosen(frame)


def lost(job: Job, why: "Lost") -> dict[str, Any]:
    """The row of an object that was lost."""
    row, folder, _ = job
    return {**row, "error": one_line(f"{Path(folder, row['file'])}: {why.why}")}


def _write(args: argparse.Namespace, rows: "Rows", order: list[int], decisions: "Decisions", labels: "Labels") -> None:
    """All results, or none of them."""
    from symrefine.review.cards import page_text
    from symrefine.review.decisions import decisions_text
    from symrefine.review.labels import info_json, labels_json
    from symrefine.review.store import DECISIONS, INFO, LABELS, PAGE

    out = Path(args.out)
    writers = {
        DECISIONS: text_writer(decisions_text(decisions)),
        INFO: pieces_writer(info_json(rows, labels)),
        LABELS: pieces_writer(labels_json(rows, labels, args.accept)),
        PAGE: text_writer(page_text(args.dir, out, rows, order, decisions, labels, _again(args.argv))),
    }
    write_all({str(out / name): writer for name, writer in writers.items()})


def _again(argv: list[str]) -> list[str]:
    """The command that applies what the page saves: with all options that a result depends on, and no others."""
    others = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    others.add_argument("--decisions")
    add_executor_options(others, "file")
    add_loudness(others)
    words = others.parse_known_args(argv)[1]
    end = words.index("--") if "--" in words else len(words)  # what follows are names, whatever they begin with
    return ["symrefine", *words[:end], "--decisions", "decisions.json", *words[end:]]


def _line(row: "Row", decisions: "Decisions") -> str:
    """What was found in an object and what else it may be, or what a person decided, or what was wrong with it."""
    from symrefine.review.labels import trouble

    if row["error"] is not None:
        return f"failed: {one_line(row['error'])}"
    found, name = row["answer"] or "undetermined", one_line(row["file"])
    decision = decisions.get(row["object"])
    if decision is not None and decision.point_group is not None and not trouble(decision, {row["object"]: row}):
        return f"{decision.point_group:<13}{'decided':<9}{name}  (found {found} {row['confidence']:.3f})"
    asked = row["tolerances"].index(row["tolerance"])
    likely = {choice["point_group"]: choice["probabilities"][asked] or 0.0 for choice in row["choices"]}
    others = [f"{group} {p:.2g}" for group, p in likely.items() if group != row["answer"] and p >= _WORTH]
    told = f"  or {', '.join(others)}" if others else ""
    return f"{found:<13}{row['confidence']:<9.3f}{name}{told}"


def _tell(args: argparse.Namespace, objects: int, failed: int, labels: "Labels") -> None:
    """How many are settled, by whom, and what is to be done with the others."""
    from symrefine.export.bop import metres_doubt
    from symrefine.review.store import INFO, LABELS, PAGE

    by = [label.by for label in labels.values()]
    left = objects - len(labels) - failed
    settled = f"{len(labels)} settled ({by.count('confidence')} by confidence, {by.count('person')} by a person)"
    parts = [f"{objects} objects: {settled}", f"{left} to look at", f"{failed} failed" if failed else ""]
    print_lines([", ".join(part for part in parts if part)])
    print_lines(f"wrote {Path(args.out, name)}" for name in (INFO, LABELS, PAGE))
    if left:
        print_lines([f"open {Path(args.out, PAGE)}, choose, save, and run this again with --decisions"])
    if labels:
        farthest = min if args.scale is None else max
        size, number = farthest((label.diameter, number) for number, label in labels.items())
        if doubt := metres_doubt(f"object {number}", size, "--scale", args.scale):
            note(doubt)
