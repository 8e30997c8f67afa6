"""`symrefine view`: open a recording in the viewer."""

import argparse
from pathlib import Path

HELP = "open a recording of `detect` or `align` in the viewer"
DESCRIPTION = (
    "Open a recording that --recording FILE.rrd of `symrefine detect` or `symrefine align` wrote: the shape and every "
    "iteration, or both objects before and after."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="FILE.rrd", help="recording")
    parser.add_argument("--web", action="store_true", help="serve it to browsers until Ctrl-C; needs no display")


def run(args: argparse.Namespace) -> int:
    """Open the viewer, or serve it."""
    from symrefine.viewer import open_recording, serve_recording

    if args.web:
        serve_recording(Path(args.path), lambda address: print(address, flush=True))
    else:
        open_recording(Path(args.path))
    return 0
