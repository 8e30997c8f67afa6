"""Values of options: text to numbers, with errors that say what is right; options that several commands share."""

import argparse
import math
from typing import Any, Literal

from symrefine.cli.inputs import one_file
from symrefine.errors import InputError
from symrefine.rounding import LARGEST_TOLERANCE, TOLERANCE
from symrefine.units import METRES, SCALES_MM, read_length

# Of options that number an object.
NUMBERED = "(default: 7 of obj_000007.ply, 1 of any other name)"
# What is done where a texture is read, and where no frame is chosen, unless a command says otherwise.
_BESIDE = "tell the group of the shape with its texture beside that of the shape"
_ONE = "there has to be one"


def add_object_options(
    parser: argparse.ArgumentParser, *, textured: str = _BESIDE, otherwise: str = _ONE, depth: bool = False
) -> None:
    """All options that decide what is found in an object: what of its file counts, how it was seen, how it is judged.

    Args:
        textured: what is done where a texture is read.
        otherwise: what happens where no frame is chosen.
        depth: whether the file may be a depth image.
    """
    add_reading_options(parser, textured=textured, otherwise=otherwise)
    add_scan_options(parser)
    if depth:
        add_depth_options(parser)
    add_detection_options(parser)


def add_detection_options(parser: argparse.ArgumentParser, counts_as: str = "symmetric") -> None:
    """The options that decide the result of a detection or an alignment."""
    parser.add_argument(
        "--tolerance",
        type=tolerance,
        default=TOLERANCE,
        metavar="REL",
        help=f"largest miss that counts as {counts_as}, as a fraction of the bounding-box diagonal, or as a length: "
        "0.5mm, 0.1A, 0.5u in units of the file (default: %(default)s)",
    )
    parser.add_argument(
        "--units",
        choices=tuple(METRES),
        help="what a length of 1 in the file is, for a tolerance in such units (default: what the format says, "
        "angstrom for molecules, metres for glTF)",
    )
    parser.add_argument(
        "--measure",
        choices=("surface", "solid"),
        help="what carries the mass of a mesh or a volume: its surface (the default) or the solid inside; not for "
        "clouds",
    )
    parser.add_argument(
        "--seed", type=natural, default=0, metavar="N", help="of the random samples (default: %(default)s)"
    )


def add_path(parser: argparse.ArgumentParser, what: str, *, several: bool = False) -> None:
    """The file or files to read, and what stdin holds where `-` stands for it."""
    many: dict[str, Any] = {"nargs": "+"} if several else {"type": one_file}
    parser.add_argument("path", metavar="PATH", help=f"{what}; - is stdin", **many)
    parser.add_argument("--format", metavar="SUFFIX", help="what stdin holds where PATH is -: ply, xyz, csv, ...")


def add_scan_options(parser: argparse.ArgumentParser) -> None:
    """The options that say which points are no part of the object, and where they were seen from."""
    parser.add_argument(
        "--outliers",
        choices=("auto", "floor", "none"),
        default="auto",
        help="auto: points of a cloud that belong to no surface, single or in clumps, are set apart and told; floor: "
        "so is the plane that the object stands on; none: all points count (default: %(default)s)",
    )
    add_viewpoint(parser)


def add_viewpoint(parser: argparse.ArgumentParser) -> None:
    """The option that says where points were seen from."""
    parser.add_argument(
        "--viewpoint",
        type=place,
        metavar="X,Y,Z",
        help="where the camera stood that saw the points, in their frame: space in front of them, or beside their "
        "outline, was seen to be free (default: the VIEWPOINT of a .pcd where that is not the origin)",
    )


def add_depth_options(parser: argparse.ArgumentParser) -> None:
    """The options that make a picture a depth image."""
    parser.add_argument(
        "--intrinsics",
        type=intrinsics,
        metavar="FX,FY,CX,CY",
        help="PATH is a depth image (.png of 16 bits, or .npy), taken by a pinhole camera of these, in pixels",
    )
    parser.add_argument(
        "--depth-scale",
        type=positive,
        metavar="X",
        help="lengths in one unit of depth (default: 0.001 for whole numbers, metres of millimetres; else 1)",
    )
    parser.add_argument(
        "--mask", metavar="FILE", help="image of the size of the depth image that is not black where the object is"
    )


def detection_options(args: argparse.Namespace) -> dict[str, Any]:
    """What was chosen of the options of a detection, for its record."""
    return {"tolerance": args.tolerance, "measure": args.measure, "seed": args.seed} | reading_options(args)


def reading_options(args: argparse.Namespace) -> dict[str, Any]:
    """What was chosen of the options that say how points were taken and what of the file counts, where given."""
    how = "frame outliers viewpoint intrinsics depth_scale mask units labels weights isolated verify texture"
    return {name: given for name in how.split() if (given := getattr(args, name, None)) is not None}


def add_reading_options(parser: argparse.ArgumentParser, *, textured: str = _BESIDE, otherwise: str = _ONE) -> None:
    """The options that name what tells the points of a file apart, and which of several objects in it counts."""
    parser.add_argument(
        "--labels",
        metavar="NAME",
        help="classes that every symmetry must keep, from the file: a property of .ply or .pcd (label, class, "
        "material_index), a titled column of .csv or .txt (numbers or texts), an array of .npz, `material` for the "
        "usemtl of .obj, or `color` for the colours of vertices or faces, where colours closer than a quarter of the "
        "scale are one class, or `texture` for the images that --texture reads, with which alone the group is then "
        "told (default: none, but the elements of molecules)",
    )
    parser.add_argument(
        "--texture",
        action="store_true",
        default=None,
        help="read the images of an .obj (map_Kd of its .mtl), .ply (TextureFile) or glTF, and "
        f"{textured}: colours within a quarter of the scale are the same",
    )
    parser.add_argument(
        "--weights",
        metavar="NAME",
        help="masses of the points of a cloud: a property, titled column or array of numbers (default: equal, or the "
        "array `weights` of .npz)",
    )
    parser.add_argument(
        "--isolated",
        action="store_true",
        default=None,
        help="the points stand for themselves, as markers and corners do, and are no samples of a surface, however "
        "many there are (default: where they are atoms, or at most 250)",
    )
    parser.add_argument(
        "--frame",
        type=natural,
        metavar="N",
        help=f"which of several molecules, models or volumes in one file, from 0 (default: {otherwise})",
    )


def tolerance(text: str) -> float | str:
    """A fraction of the diagonal, or a length with its unit as it was written."""
    value = _float(text)
    if math.isnan(value) and text[-1:].isalpha() and any(letter.isdigit() for letter in text):
        try:
            read_length(text)
        except InputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return text
    if not 0.0 < value <= LARGEST_TOLERANCE:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a fraction of the bounding-box diagonal in (0, {LARGEST_TOLERANCE}], such as 0.02, nor a "
            "length with its unit, such as 0.5mm"
        )
    return value


def grey(text: str) -> float | Literal["otsu"]:
    """A grey value between black and white, or the name of the method that chooses one."""
    if text == "otsu":
        return "otsu"
    value = _float(text)
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a grey value between 0 (black) and 1 (white), nor 'otsu'")
    return value


def place(text: str) -> tuple[float, ...]:
    """Three finite coordinates, separated by commas."""
    values = tuple(_float(part) for part in text.split(","))
    if len(values) != 3 or not all(math.isfinite(v) for v in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not a place X,Y,Z of three numbers, such as 0,0,-1.5")
    return values


def intrinsics(text: str) -> tuple[float, ...]:
    """Focal lengths above 0 and the principal point of a camera, separated by commas."""
    values = tuple(_float(part) for part in text.split(","))
    if len(values) != 4 or not all(math.isfinite(v) for v in values) or min(values[:2]) <= 0.0:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not FX,FY,CX,CY in pixels, FX and FY above 0, such as 615,615,320,240"
        )
    return values


def positive(text: str) -> float:
    """A finite number above 0."""
    value = _float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def millimetres(text: str) -> float:
    """Millimetres in one unit of a file."""
    value = _float(text)
    if not SCALES_MM[0] <= value <= SCALES_MM[1]:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a number of millimetres from {SCALES_MM[0]:g} to {SCALES_MM[1]:g}, such as 1000"
        )
    return value


def probability(text: str) -> float:
    """A number above 0 and at most 1."""
    value = _float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a probability above 0 and at most 1, such as 0.95")
    return value


def natural(text: str, first: int = 0) -> int:
    """An integer from `first`."""
    if not (text.isascii() and text.isdigit() and int(text) >= first):
        raise argparse.ArgumentTypeError(f"{text!r} is not an integer from {first}")
    return int(text)


def count(text: str) -> int:
    """An integer from 1."""
    return natural(text, 1)


def orders(text: str) -> tuple[int, ...]:
    """Orders of moments, separated by commas."""
    try:
        return tuple(count(part.strip()) for part in text.split(","))
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a list of moment orders from 1, separated by commas, such as 2,3"
        ) from None


def _float(text: str) -> float:
    """NaN for what is not a number, which no range contains."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def add_loudness(parser: argparse.ArgumentParser) -> None:
    """How much is told besides the result, which every command lets choose."""
    loud = parser.add_mutually_exclusive_group()
    loud.add_argument("-v", "--verbose", action="store_true", help="tell stages with their seconds, on stderr")
    loud.add_argument("-q", "--quiet", action="store_true", help="tell nothing but errors; files, and `-`, as ever")
