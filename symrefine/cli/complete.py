"""`symrefine complete`: a scan with what its symmetry says of the parts that nobody saw."""

import argparse
from pathlib import Path

from symrefine.cli.inputs import loaded, read_scan
from symrefine.cli.outputs import add_outputs, check_outputs, json_writer, note, shown, shown_writers, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_depth_options, add_detection_options, add_path, add_scan_options, detection_options
from symrefine.errors import InputError

HELP = "write a scan completed by its symmetry"
DESCRIPTION = (
    "Find the symmetry of the point cloud in PATH, which may lack parts, and write its points with their images where "
    "nobody looked; outliers, and images where the scan says that there is nothing, are left out. A .ply has the "
    "property `inferred`, a .npz the array: 0 for points that were seen, 1 for images."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "point cloud")
    parser.add_argument("-o", "--out", required=True, metavar="OUT", help="file to write: .ply or .npz")
    add_outputs(
        parser,
        json="write the figures as JSON; - is stdout, with no table",
        picture="write a picture of the scan and what was found",
        report="write a page with a model that turns: what was seen, inferred and contradicted",
    )
    add_scan_options(parser)
    add_depth_options(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect, complete, write, print how much was seen and inferred."""
    from symrefine.export.models import MARKED
    from symrefine.front.lines import summary
    from symrefine.front.made import complete

    check_outputs({"--out": args.out, "--json": args.json} | shown(args), [Path(args.path)])
    suffix = Path(args.out).suffix.lower()
    if suffix not in MARKED:
        raise InputError(
            f"--out {args.out}: cannot mark what is inferred in {suffix or 'that'}; write {' or '.join(MARKED)}"
        )
    with waiting("completing"):
        shape = loaded(args.path, args.format, lambda file: read_scan(file, detection_options(args)))
        made = complete(shape, outliers=args.outliers, tolerance=args.tolerance, units=args.units, seed=args.seed)
        record = made.to_dict(options=detection_options(args))
        model = {args.out: made.writer(suffix)}
        write_all(writers := model | shown_writers(args, made) | json_writer(args.json, record))
    tell(args.json, record, summary(record), writers)
    if not made.inferred.any():
        note("nothing was unseen: what was written is the cloud without its outliers")
    return 0
