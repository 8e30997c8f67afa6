"""`symrefine export`: the symmetries of a file as other programs read them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.inputs import loaded, read_scan
from symrefine.cli.outputs import check_outputs, note, tell
from symrefine.cli.signs import waiting
from symrefine.cli.values import NUMBERED, add_object_options, add_path, count, detection_options, millimetres, natural
from symrefine.errors import InputError, about
from symrefine.export.formats import TAKES, takers
from symrefine.files import check_folder, path_of

if TYPE_CHECKING:
    from symrefine.detection.measure import Outliers
    from symrefine.front.space import Detection
    from symrefine.shape import Shape

HELP = "write the symmetries as BOP, FoundationPose, MegaPose, DOPE or Isaac read them, or a canonical model"
DESCRIPTION = (
    "Find the symmetries of the mesh or cloud in PATH and write them for another program. bop: an entry in "
    "models_info.json, in the frame of PATH. npz: all rotations as N x 4 x 4 matrices, in the frame of PATH. "
    "canonical: the model with its axis on z through the origin, and the transform. foundationpose, megapose, dope, "
    "isaac: a folder with a canonical model and the file that this program reads beside it. What the program cannot "
    "express is told."
)
# Options that not every format takes, and what `symrefine.export` calls them.
_OPTIONS = {"id": "number", "scale": "scale", "improper": "improper", "steps": "steps", "transform": "transform"}
_FOLDERS = ("foundationpose", "megapose", "dope", "isaac")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "mesh or point cloud")
    parser.add_argument("--to", required=True, choices=tuple(TAKES), help="what to write")
    parser.add_argument("--out", required=True, metavar="OUT", help="file, or folder for " + ", ".join(_FOLDERS))
    parser.add_argument("--id", type=natural, metavar="N", help=f"number of the object in models_info.json {NUMBERED}")
    scaled = "millimetres in one unit of PATH: 1000 for metres (default: 1)"
    parser.add_argument("--scale", type=millimetres, metavar="X", help=scaled)
    parser.add_argument("--improper", action="store_true", default=None, help="npz: mirrors and the like too")
    parser.add_argument("--steps", type=count, metavar="N", help="npz: turns for a continuous axis (default: 72)")
    parser.add_argument(
        "--transform",
        metavar="FILE",
        help="canonical: where the 4 x 4 transform goes, .json or .npz (default: OUT_transform.json)",
    )
    add_object_options(parser, textured="write the symmetries of the shape with its texture")


def run(args: argparse.Namespace) -> int:
    """Detect, write the files of the format, tell what they cannot express."""
    from symrefine.export.packages import package_of, write_package

    _check(args)
    with waiting("detecting"):
        shape, detection = detected(args)
        shape = detection.own(shape)
        package = package_of(args.to, Path(args.out), detection, shape, **_options(args))
        write_package(package, args.to, Path(args.out))
    tell(None, {}, [f"{shape.source}: {detection.point_group}"], map(str, package.files))
    for text in package.notes:
        note(text)
    if "scale" in TAKES[args.to]:
        from symrefine.export.bop import diameter, metres_doubt

        size = (args.scale or 1.0) * diameter(shape.points)
        if doubt := metres_doubt(shape.source, size, "--scale", args.scale):
            note(doubt)
    return 0


def detected(args: argparse.Namespace) -> tuple["Shape", "Detection"]:
    """The shape in a file and its symmetries, those with its texture where that is asked for.

    Raises:
        InputError: a picture, or points with two coordinates.
    """
    from symrefine.front.space import Detection
    from symrefine.front.verbs import detect_in_space

    shape = loaded(args.path, args.format, lambda file: read_scan(file, detection_options(args)))
    outliers: Outliers = getattr(args, "outliers", "auto")
    found = detect_in_space(shape, outliers=outliers, tolerance=args.tolerance, units=args.units, seed=args.seed)
    if shape.texture is not None:
        assert isinstance(found.textured, Detection)
        found = found.textured
    return shape, found


def _check(args: argparse.Namespace) -> None:
    """Refuse, before any work, options of other formats and outputs that cannot be written."""
    from symrefine.export.packages import check_folder_name

    for option, name in _OPTIONS.items():
        if getattr(args, option) is not None and name not in TAKES[args.to]:
            raise InputError(f"--{option}: does not apply to --to {args.to}; it is for {', '.join(takers(name))}")
    if args.to in _FOLDERS:
        out = path_of(args.out)
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: is a file; expected a folder")
        with about("--out"):
            check_folder_name(args.to, out)
        if not out.parent.is_dir():
            raise InputError(f"--out {out}: cannot be made: there is no directory {out.parent}")
        check_folder(out if out.exists() else out.parent, f"--out {out}")
        return
    outputs = {"--out": args.out, "--transform": str(_transform(args)) if args.to == "canonical" else None}
    check_outputs(outputs, [Path(args.path)])
    _check_names(args)


def _check_names(args: argparse.Namespace) -> None:
    """Refuse files whose names do not fit what will be in them."""
    from symrefine.export.bop import read_models_info
    from symrefine.export.models import check_suffix
    from symrefine.export.packages import check_table_name

    out = Path(args.out)
    if args.to == "bop":
        with about("--out"):
            check_table_name(out)
        read_models_info(out)
    elif args.to == "npz" and out.suffix.lower() != ".npz":
        raise InputError(f"--out {out}: expected a name that ends in .npz")
    elif args.to == "canonical":
        check_suffix(out)
        if _transform(args).suffix.lower() not in (".json", ".npz"):
            raise InputError(f"--transform {args.transform}: expected a name that ends in .json or .npz")


def _transform(args: argparse.Namespace) -> Path:
    from symrefine.export.packages import place_of_transform

    return place_of_transform(Path(args.out)) if args.transform is None else Path(args.transform)


def _options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of the format that were given, by the names that `package_of` has for them."""
    given = {name: getattr(args, option) for option, name in _OPTIONS.items()}
    given["transform"] = args.transform and Path(args.transform)
    return {name: value for name, value in given.items() if value is not None}
