"""`symrefine view`: open a recording in the viewer."""

import argparse
from pathlib import Path

HELP = "open a recording of `detect --recording` in the viewer"
DESCRIPTION = "Open a recording that `symrefine detect --recording FILE.rrd` wrote: the shape and every iteration."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="FILE.rrd", help="recording")


def run(args: argparse.Namespace) -> int:
    """Open the viewer."""
    from symrefine.viewer import open_recording

    open_recording(Path(args.path))
    return 0
