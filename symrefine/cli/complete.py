"""`symrefine complete`: a scan with what its symmetry says of the parts that nobody saw."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.inputs import loaded, read_scan
from symrefine.cli.outputs import bytes_writer, check_outputs, json_writer, note, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_depth_options, add_detection_options, add_path, add_scan_options, detection_options
from symrefine.errors import InputError

if TYPE_CHECKING:
    from symrefine.complete import Completion
    from symrefine.shape import Shape

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
    parser.add_argument("--json", metavar="FILE|-", help="write the figures as JSON; - is stdout, with no table")
    add_scan_options(parser)
    add_depth_options(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect, complete, write, print how much was seen and inferred."""
    from symrefine.complete import complete
    from symrefine.export.models import marked_bytes
    from symrefine.lengths import relative_tolerance

    check_outputs({"--out": args.out, "--json": args.json}, [Path(args.path)])
    suffix = Path(args.out).suffix.lower()
    if suffix not in (".ply", ".npz"):
        raise InputError(f"--out {args.out}: cannot mark what is inferred in {suffix or 'that'}; write .ply or .npz")
    with waiting("completing"):
        shape = loaded(args.path, args.format, lambda file: read_scan(file, detection_options(args)))
        tolerance = relative_tolerance(args.tolerance, shape, units=args.units, outliers=args.outliers)
        made = complete(shape, outliers=args.outliers, tolerance=tolerance, seed=args.seed)
        record = _record(args, shape, made)
        data = marked_bytes(suffix, made.points, made.inferred)
        writers = {args.out: bytes_writer(data)} | json_writer(args.json, record)
        write_all(writers)
    tell(args.json, record, _lines(record), writers)
    if not made.inferred.any():
        note("nothing was unseen: what was written is the cloud without its outliers")
    return 0


def _record(args: argparse.Namespace, shape: "Shape", made: "Completion") -> dict[str, Any]:
    from symrefine.export.records import number, numbers

    d = made.detection
    return {
        "schema": "symrefine.completed/1",
        "source": shape.source,
        "options": detection_options(args),
        "point_group": d.point_group,
        "at_least": bool(d.at_least),
        "confidence": number(d.confidence),
        "center": numbers(d.center, d.diagonal),
        "seen": int((~made.inferred).sum()),
        "inferred": int(made.inferred.sum()),
        "contradicted": made.contradicted,
        "outliers": len(d.outliers),
    }


def _lines(record: dict[str, Any]) -> list[str]:
    least = "at least " if record["at_least"] else ""
    told = f"{record['source']}: {least}{record['point_group']}, confidence {record['confidence']:.2f}"
    against = f"{record['contradicted']:,} have an image that the scan contradicts"
    counts = (
        f"{record['seen']:,} points seen, {record['inferred']:,} inferred; {record['outliers']:,} outliers left out"
    )
    return [told, f"{counts}; {against}"]
