"""`symrefine align`: the map that takes one object onto another, or onto each of several."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.inputs import FRAMES, STDIN, Object, expanded, loaded, objects, one_file
from symrefine.cli.outputs import add_outputs, check_outputs, json_writer, shown, shown_writers, tell, write_all
from symrefine.cli.rows import MAP_HEAD, map_line
from symrefine.cli.several import UNDETERMINED, Many, check_alone
from symrefine.cli.signs import counting
from symrefine.cli.values import add_detection_options, natural
from symrefine.clock import Clock
from symrefine.errors import InputError

if TYPE_CHECKING:
    from symrefine.front.aligned import Alignment
    from symrefine.load import Frames
    from symrefine.shape import Shape

HELP = "find the map that takes one object onto another, or onto each of several, reflections included"
DESCRIPTION = (
    "Find the orthogonal matrix M and the translation t that take the mesh or cloud A onto B, b = M a + t, without "
    "correspondences; det M = -1 means a mirror image. Also tells which other maps do as well, because B is symmetric. "
    "Several B, or a pattern in quotes, or a file of several molecules, models or volumes, give a line for each; one "
    "that cannot be used is told on its line, the others go on, and the exit status is 2."
)
# Status of an answer that can be relied upon.
_OK = "ok"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("source", metavar="A", type=one_file, help="mesh or point cloud to be moved; - is stdin")
    parser.add_argument(
        "target", metavar="B", nargs="+", help="meshes or point clouds to move it onto, or patterns; - is stdin"
    )
    parser.add_argument("--format", metavar="SUFFIX", help="what stdin holds where A or a B is -: ply, xyz, csv, ...")
    add_outputs(
        parser,
        json="write the whole result as JSON, of several B an array; - is stdout, with no table",
        picture="write a picture of both before and after",
        recording="write before, after and the equivalents, for `view`",
        report="write a page with a model that turns",
    )
    parser.add_argument("--scale", action="store_true", help="let the size differ too: b = s M a + t")
    others = {"source": "there has to be one", "target": "each of them"}
    for name, letter in (("source", "A"), ("target", "B")):
        parser.add_argument(
            f"--{name}-frame",
            type=natural,
            metavar="N",
            help=f"which of several molecules, models or volumes in {letter}, from 0 (default: {others[name]})",
        )
    parser.add_argument(
        "--labels",
        metavar="NAME",
        help="classes that what meets has to share, from both files, as of `detect`: numbers or texts that are equal, "
        "or `color`, where colours closer than a quarter of the scale are the same (default: none, but the elements of "
        "molecules)",
    )
    parser.add_argument("--rotations-only", action="store_true", help="admit det M = +1 only")
    parser.add_argument(
        "--strict", action="store_true", help=f"end with status {UNDETERMINED} where the status of an answer is not ok"
    )
    add_detection_options(parser, counts_as="agreement")


def run(args: argparse.Namespace) -> int:
    """Align, write the files that were asked for, print."""
    paths = expanded(args.target)
    _check(args, paths)
    clock = Clock()
    with counting("aligning", len(paths)) as doing:
        with clock("load"):
            source = loaded(args.source, args.format if args.source == STDIN else None, partial(_source, args=args))
        given = chain.from_iterable(
            objects([path], args.format if path == STDIN else None, partial(_targets, args=args)) for path in paths
        )
        first = next(given)
        aligned = partial(_aligned, args, source, clock.seconds["load"])
        many = Many(
            json_to=args.json,
            head=MAP_HEAD,
            line=map_line,
            record=lambda one: aligned(one)[1],
            beside=lambda one: {"source": source.source, "target": one.name},
        )
        if several := len(paths) > 1 or first.frames > 1:
            check_alone(shown(args), f"{paths[0]} holds {first.frames}", "choose one with --target-frame")
            records = list(many.told(chain([first], given), doing))
        else:
            found, record = aligned(first)
            writers = json_writer(args.json, record) | shown_writers(args, found)
            write_all(writers)
    if several:
        return many.end(records, undetermined=args.strict and any(r.get("status", _OK) != _OK for r in records))
    tell(args.json, record, None, writers)
    return UNDETERMINED if args.strict and record["status"] != _OK else 0


def _check(args: argparse.Namespace, paths: Sequence[str]) -> None:
    """Refuse, before any work, outputs that cannot be written or do not fit together, and what is for one pair."""
    piped = [args.source, *paths].count(STDIN)
    if piped > 1:
        raise InputError(f"-: stands for {piped} of A and B, and stdin is one file; write the others to files")
    if args.format is not None and not piped:
        raise InputError(f"--format {args.format}: is for an A or B that is -; files have their suffix")
    check_outputs({"--json": args.json} | shown(args), [Path(p) for p in (args.source, *paths) if p != STDIN])
    if len(paths) > 1:
        check_alone(shown(args), f"B names {len(paths)}", "call `align` for each")


def _source(path: str, args: argparse.Namespace) -> "Shape":
    """The object in a file that is moved."""
    found = _objects(path, args, args.source_frame)
    if (last := len(found) - 1) > 0:
        raise InputError(f"{path}: holds {last + 1} {found.what}; choose one with --source-frame, from 0 to {last}")
    return found[0]


def _targets(path: str, args: argparse.Namespace) -> "Frames[Shape]":
    """The objects in a file that it is moved onto."""
    found = _objects(path, args, args.target_frame)
    if len(found) > FRAMES:
        raise InputError(f"{path}: holds {len(found)} {found.what}, more than {FRAMES}; choose one with --target-frame")
    return found


def _objects(path: str, args: argparse.Namespace, frame: int | None) -> "Frames[Shape]":
    """The objects in a file: all, or the one that is chosen."""
    from symrefine.load import Frames, load, load_frames

    if frame is None:
        return load_frames(path, measure=args.measure, labels=args.labels)
    one = partial(load, path, measure=args.measure, labels=args.labels, frame=frame)
    return Frames("objects", 1, lambda _: one())


def _aligned(
    args: argparse.Namespace, source: "Shape", load_s: float, given: Object
) -> tuple["Alignment", dict[str, Any]]:
    """The map onto an object in a file, and its JSON record; `load_s` are the seconds that reading the source took."""
    from symrefine.front.verbs import align

    found = align(
        source,
        given.shape,
        allow_reflection=not args.rotations_only,
        tolerance=args.tolerance,
        units=args.units,
        scale=args.scale,
        seed=args.seed,
    )
    frames = {"source_frame": args.source_frame, "target_frame": args.target_frame}
    frames |= {} if given.frame is None else {"target_frame": given.frame}
    chosen = {"measure": args.measure} | {name: k for name, k in frames.items() if k is not None}
    chosen |= {} if args.labels is None else {"labels": args.labels}
    found = replace(found, options={**found.options, **chosen})
    return found, found.to_dict(load_s=load_s + given.load_s)
