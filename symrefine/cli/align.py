"""`symrefine align`: the map that takes one object onto another."""

import argparse
from pathlib import Path
from typing import Any

from symrefine.cli.outputs import check_outputs, json_writer, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_detection_options, natural
from symrefine.clock import Clock

HELP = "find the map that takes one object onto another, reflections included"
DESCRIPTION = (
    "Find the orthogonal matrix M and the translation t that take the mesh or cloud A onto B, b = M a + t, without "
    "correspondences; det M = -1 means a mirror image. Also tells which other maps do as well, because B is symmetric."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("source", metavar="A", help="mesh or point cloud to be moved")
    parser.add_argument("target", metavar="B", help="mesh or point cloud to move it onto")
    parser.add_argument("--json", metavar="FILE|-", help="write the whole result as JSON; - is stdout, with no table")
    parser.add_argument("--scale", action="store_true", help="let the size differ too: b = s M a + t")
    for name, letter in (("source", "A"), ("target", "B")):
        parser.add_argument(
            f"--{name}-frame",
            type=natural,
            metavar="N",
            help=f"which of several molecules, models or volumes in {letter}, from 0 (default: there has to be one)",
        )
    parser.add_argument("--rotations-only", action="store_true", help="admit det M = +1 only")
    add_detection_options(parser, counts_as="agreement")


def run(args: argparse.Namespace) -> int:
    """Align, write the file that was asked for, print."""
    check_outputs({"--json": args.json}, [Path(args.source), Path(args.target)])
    with waiting("aligning"):
        record = _record(args)
    write_all(writers := json_writer(args.json, record))
    tell(args.json, record, None, writers)
    return 0


def _record(args: argparse.Namespace) -> dict[str, Any]:
    from symrefine.front.verbs import align
    from symrefine.load import load

    clock = Clock()
    with clock("load"):
        given = ((args.source, args.source_frame), (args.target, args.target_frame))
        source, target = (load(path, measure=args.measure, frame=frame) for path, frame in given)
    asked = {"tolerance": args.tolerance, "units": args.units, "scale": args.scale, "seed": args.seed}
    found = align(source, target, allow_reflection=not args.rotations_only, **asked)
    frames = {"source_frame": args.source_frame, "target_frame": args.target_frame}
    chosen = {"measure": args.measure} | {name: k for name, k in frames.items() if k is not None}
    return found.to_dict(options={**found.options, **chosen}, load_s=clock.seconds["load"])
