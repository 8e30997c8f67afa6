"""`symrefine export`: the symmetries of a file as other programs read them."""

import argparse
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.inputs import loaded
from symrefine.cli.outputs import bytes_writer, check_outputs, note, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_detection_options, add_frame_option, add_path, count, natural, positive
from symrefine.errors import InputError
from symrefine.files import check_target

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.export.packages import Package
    from symrefine.shape import Shape

HELP = "write the symmetries as BOP, FoundationPose, MegaPose, DOPE or Isaac read them, or a canonical model"
DESCRIPTION = (
    "Find the symmetries of the mesh or cloud in PATH and write them for another program. bop: an entry in "
    "models_info.json, in the frame of PATH. npz: all rotations as N x 4 x 4 matrices, in the frame of PATH. "
    "canonical: the model with its axis on z through the origin, and the transform. foundationpose, megapose, dope, "
    "isaac: a folder with a canonical model and the file that this program reads beside it. What the program cannot "
    "express is told."
)
# Formats and the options that they alone take.
_OPTIONS: dict[str, tuple[str, ...]] = {
    "bop": ("id", "scale"),
    "foundationpose": ("id", "scale"),
    "megapose": ("id", "scale"),
    "dope": ("scale",),
    "isaac": ("scale",),
    "npz": ("improper", "steps"),
    "canonical": ("transform",),
}
_FOLDERS = ("foundationpose", "megapose", "dope", "isaac")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "mesh or point cloud")
    parser.add_argument("--to", required=True, choices=tuple(_OPTIONS), help="what to write")
    parser.add_argument("--out", required=True, metavar="OUT", help="file, or folder for " + ", ".join(_FOLDERS))
    parser.add_argument("--id", type=natural, metavar="N", help="number of the object in models_info.json (default: 1)")
    scaled = "millimetres in one unit of PATH: 1000 for metres (default: 1)"
    parser.add_argument("--scale", type=positive, metavar="X", help=scaled)
    parser.add_argument("--improper", action="store_true", default=None, help="npz: mirrors and the like too")
    parser.add_argument("--steps", type=count, metavar="N", help="npz: turns for a continuous axis (default: 72)")
    parser.add_argument(
        "--transform",
        metavar="FILE",
        help="canonical: where the 4 x 4 transform goes, .json or .npz (default: OUT_transform.json)",
    )
    add_frame_option(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect, write the files of the format, tell what they cannot express."""
    _check(args)
    with waiting("detecting"):
        shape, detection = detected(args)
        package = _package(args, shape, detection)
        _check_files(args, package)
        with ExitStack() as undo:
            if args.to in _FOLDERS and not Path(args.out).exists():
                Path(args.out).mkdir()
                undo.callback(Path(args.out).rmdir)
            write_all({str(path): bytes_writer(data) for path, data in package.files.items()})
            undo.pop_all()
    tell(None, {}, [f"{args.path}: {detection.point_group}"], map(str, package.files))
    for text in package.notes:
        note(text)
    if "scale" in _OPTIONS[args.to] and args.scale is None:
        from symrefine.export.bop import diameter, metres_doubt

        if doubt := metres_doubt(args.path, diameter(shape.points), "--scale"):
            note(doubt)
    return 0


def detected(args: argparse.Namespace) -> tuple["Shape", "Detection"]:
    """The shape in a file and its symmetries.

    Raises:
        InputError: a picture, or points with two coordinates.
    """
    from symrefine.detection.story import detect
    from symrefine.lengths import relative_tolerance
    from symrefine.load import load

    shape = loaded(args.path, args.format, partial(load, measure=args.measure, frame=args.frame))
    tolerance = relative_tolerance(args.tolerance, shape, units=args.units)
    return shape, detect(shape, tolerance=tolerance, seed=args.seed)


def _check(args: argparse.Namespace) -> None:
    """Refuse, before any work, options of other formats and outputs that cannot be written."""
    for option in ("id", "scale", "improper", "steps", "transform"):
        if getattr(args, option) is not None and option not in _OPTIONS[args.to]:
            users = ", ".join(name for name, options in _OPTIONS.items() if option in options)
            raise InputError(f"--{option}: does not apply to --to {args.to}; it is for {users}")
    if args.to in _FOLDERS:
        out = Path(args.out)
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: is a file; expected a folder")
        if not out.parent.is_dir():
            raise InputError(f"--out {out}: cannot be made: there is no directory {out.parent}")
        return
    outputs = {"--out": args.out, "--transform": str(_transform(args)) if args.to == "canonical" else None}
    check_outputs(outputs, [Path(args.path)])
    _check_names(args)


def _check_names(args: argparse.Namespace) -> None:
    """Refuse files whose names do not fit what will be in them."""
    from symrefine.export.bop import read_models_info
    from symrefine.export.models import check_suffix

    out = Path(args.out)
    if args.to == "bop":
        read_models_info(out)
    elif args.to == "npz" and out.suffix.lower() != ".npz":
        raise InputError(f"--out {out}: expected a name that ends in .npz")
    elif args.to == "canonical":
        check_suffix(out)
        if _transform(args).suffix.lower() not in (".json", ".npz"):
            raise InputError(f"--transform {args.transform}: expected a name that ends in .json or .npz")


def _check_files(args: argparse.Namespace, package: "Package") -> None:
    """Refuse to write over the input, or over what cannot be written."""
    for path in package.files:
        if path.resolve() == Path(args.path).resolve():
            raise InputError(f"--out {args.out}: {path} is the input itself; name another folder")
        if path.parent.is_dir():
            check_target(path)


def _transform(args: argparse.Namespace) -> Path:
    out = Path(args.out)
    return out.with_name(f"{out.stem}_transform.json") if args.transform is None else Path(args.transform)


def _package(args: argparse.Namespace, shape: "Shape", detection: "Detection") -> "Package":
    from symrefine.export import packages
    from symrefine.export.operations import STEPS

    out, number, scale = Path(args.out), 1 if args.id is None else args.id, args.scale or 1.0
    if args.to == "bop":
        return packages.bop_package(out, detection, shape, number=number, scale=scale)
    if args.to == "npz":
        options: dict[str, Any] = {"improper": bool(args.improper), "steps": args.steps or STEPS}
        return packages.npz_package(out, detection, shape, **options)
    if args.to == "canonical":
        return packages.canonical_package(out, detection, shape, transform=_transform(args))
    return packages.consumer_package(args.to, out, detection, shape, number=number, scale=scale)
