"""`symrefine symmetrize`: the nearest exactly symmetric mesh or cloud."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.export import detected
from symrefine.cli.outputs import bytes_writer, check_outputs, json_writer, note, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_detection_options, add_frame_option, add_path, detection_options

if TYPE_CHECKING:
    from symrefine.front.space import Detection
    from symrefine.shape import Shape
    from symrefine.symmetrize import Symmetrized

HELP = "write the nearest exactly symmetric mesh or cloud"
DESCRIPTION = (
    "Find the symmetry of the mesh or cloud in PATH and write the nearest shape that has it exactly: points that "
    "correspond become the means of their orbits; otherwise each point moves to where the symmetric surface is, and of "
    "a cloud one sector is copied to the others. A continuous axis becomes an axis of a finite order, which is told."
)
_METHODS = {
    "vertices": "every point has its counterparts; points are means over their orbits",
    "orbits": "points without exact counterparts: one sector moved onto the symmetric surface, and its copies",
    "surface": "vertices without exact counterparts lie on the symmetric surface; the triangles are as they were",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "mesh or point cloud")
    parser.add_argument(
        "-o", "--out", required=True, metavar="OUT", help="file to write: .ply .obj .off .xyz .npy .npz"
    )
    parser.add_argument("--group", metavar="NAME", help="make only this subgroup of what was found exact, such as Cs")
    parser.add_argument("--json", metavar="FILE|-", help="write the figures as JSON; - is stdout, with no table")
    add_frame_option(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect, make symmetric, write, print by how much points moved."""
    from symrefine.export.models import check_suffix, model_bytes
    from symrefine.front.verbs import symmetrize

    check_outputs({"--out": args.out, "--json": args.json}, [Path(args.path)])
    check_suffix(Path(args.out))
    with waiting("detecting"):
        shape, detection = detected(args)
        made = symmetrize(shape, detection, group=args.group, tolerance=detection.tolerance, seed=args.seed)
        data = model_bytes(Path(args.out), made.shape)
        record = _record(args, shape, detection, made)
        writers = {args.out: bytes_writer(data)} | json_writer(args.json, record)
        write_all(writers)
    tell(args.json, record, _lines(record), writers)
    if shape.labels is not None:
        note("labels are not written")
    if not detection.group.is_finite and args.group is None:
        note(f"{detection.point_group} is continuous, no finite set of points has it: {made.group.name} was made exact")
    return 0


def _record(args: argparse.Namespace, shape: "Shape", detection: "Detection", made: "Symmetrized") -> dict[str, Any]:
    from symrefine.export.records import number, numbers

    return {
        "schema": "symrefine.symmetrized/1",
        "source": shape.source,
        "options": detection_options(args) | {"group": args.group},
        "found": detection.point_group,
        "point_group": made.group.name,
        "center": numbers(made.center, made.diagonal),
        "frame": [numbers(row, 1.0) for row in made.group.frame],
        "method": made.method,
        "paired": number(made.paired),
        "points": len(made.shape.points),
        "largest": number(made.largest, 1.0),
        "rms": number(made.rms, 1.0),
        "residual": number(made.residual),
        "diagonal": number(made.diagonal),
    }


def _lines(record: dict[str, Any]) -> list[str]:
    moved = f"moved by {record['largest']:.3%} of the diagonal at most, {record['rms']:.3%} RMS"
    return [
        f"{record['source']}: {record['found']}; made exact: {record['point_group']}",
        f"{_METHODS[record['method']]} ({record['paired']:.1%} paired)",
        f"{moved}; the result misses itself by {record['residual']:.1e} of the diagonal",
    ]
