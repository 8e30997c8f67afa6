"""`symrefine symmetrize`: the nearest exactly symmetric mesh or cloud."""

import argparse
from pathlib import Path

from symrefine.cli.export import detected
from symrefine.cli.outputs import add_outputs, check_outputs, json_writer, note, shown, shown_writers, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_object_options, add_path, detection_options

HELP = "write the nearest exactly symmetric mesh or cloud"
DESCRIPTION = (
    "Find the symmetry of the mesh or cloud in PATH and write the nearest shape that has it exactly: points that "
    "correspond become the means of their orbits; otherwise each point moves to where the symmetric surface is, and of "
    "a cloud one sector is copied to the others. A continuous axis becomes an axis of a finite order, which is told."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "mesh or point cloud")
    parser.add_argument(
        "-o",
        "--out",
        required=True,
        metavar="OUT",
        help="file to write: .ply .obj .off .stl .npz; of points also .csv .txt .xyz .pcd .npy",
    )
    parser.add_argument("--group", metavar="NAME", help="make only this subgroup of what was found exact, such as Cs")
    add_outputs(
        parser,
        json="write the figures as JSON; - is stdout, with no table",
        picture="write a picture of the exact shape",
        report="write a page with a model that turns: the shape as it was, and what was found in it",
    )
    add_object_options(parser, textured="make exact what the shape has with its texture")


def run(args: argparse.Namespace) -> int:
    """Detect, make symmetric, write, print by how much points moved."""
    from symrefine.export.models import check_suffix, keeps_labels
    from symrefine.front.lines import summary
    from symrefine.front.made import symmetrize
    from symrefine.picture.words import symbol

    check_outputs({"--out": args.out, "--json": args.json} | shown(args), [Path(args.path)])
    check_suffix(out := Path(args.out))
    with waiting("detecting"):
        shape, detection = detected(args)
        made = symmetrize(
            shape, detection, group=args.group, tolerance=args.tolerance, units=args.units, seed=args.seed
        )
        check_suffix(out, made.shape)
        record = made.to_dict(options=detection_options(args) | {"group": args.group})
        model = {args.out: made.writer(out.suffix.lower())}
        write_all(writers := model | shown_writers(args, made) | json_writer(args.json, record))
    tell(args.json, record, summary(record), writers)
    if made.outliers:
        note(f"{made.outliers:,} points were taken as outliers: they are left out")
    if not keeps_labels(out.suffix.lower(), shape):
        note("labels are not written")
    if not detection.group.is_finite and args.group is None:
        whole = symbol(detection.point_group)
        note(f"{whole} is continuous, no finite set of points has it: {made.group.name} stands for it")
    return 0
