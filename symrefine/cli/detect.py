"""`symrefine detect`: one file in, its symmetries out."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from symrefine.cli.inputs import NAME, STDIN, expanded, failure, readable
from symrefine.cli.outputs import (
    STDOUT,
    check_beside,
    check_outputs,
    complain,
    is_quiet,
    is_verbose,
    json_writer,
    note,
    print_lines,
    say,
    tell,
    text_writer,
    write_all,
)
from symrefine.cli.signs import progress, waiting
from symrefine.cli.values import (
    add_class_options,
    add_depth_options,
    add_detection_options,
    add_frame_option,
    add_path,
    add_scan_options,
    detection_options,
    grey,
    natural,
    positive,
)
from symrefine.clock import Clock
from symrefine.errors import InputError
from symrefine.files import Writer, json_array_text

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.shape import Shape

# Exit status of `--strict` where nothing is decided, and where one of several files could not be used.
UNDETERMINED, REFUSED = 3, 2
# Options whose files are of one object.
_OF_ONE = ("bop", "recording", "report", "picture")
# The labels that are no field of a file, but the colours of its images.
TEXTURE = "texture"
HELP = "find the planes, axes and point group of a mesh, cloud or picture"
DESCRIPTION = (
    "Find the mirror planes, rotation axes and point group of the mesh or point cloud in PATH (.ply .stl .obj .off "
    ".3mf .dae .step .glb .gltf .pcd .las .laz .e57 .xyz .csv .txt .npy .npz), of a molecule (.xyz .mol .sdf .pdb "
    ".cif) or of a volume (.nii .nrrd .mrc .map), or the mirror lines and turns of a picture (.png .jpg .jpeg .bmp) "
    "or of points with two coordinates (.csv .txt .npy .npz), or the hyperplanes of symmetry of points with 4 to 8 "
    "coordinates; each file may be packed (.gz). With --intrinsics PATH is a depth image. Prints a table; lengths are "
    "in the units of the file, misses in percent of the bounding-box diagonal. Several files, or a pattern in quotes, "
    "give a line each; one that cannot be used is told on its line, the others go on, and the exit status is 2."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "meshes, clouds, molecules, volumes or pictures, or patterns of them", several=True)
    parser.add_argument(
        "--json",
        metavar="FILE|-",
        help="write the whole report as JSON, of several files an array; - is stdout, with no table",
    )
    parser.add_argument("--picture", metavar="FILE.png", help="write a picture of the shape and what was found")
    parser.add_argument("--bop", metavar="FILE", help="put the symmetries into this models_info.json of BOP")
    parser.add_argument("--bop-id", type=natural, metavar="N", help="number of the object there (default: 1)")
    parser.add_argument(
        "--bop-scale",
        type=positive,
        metavar="X",
        help="millimetres in one unit of PATH: 1000 if it is in metres (default: 1)",
    )
    parser.add_argument("--recording", metavar="FILE.rrd", help="write the iterations, for `symrefine view`")
    parser.add_argument("--report", metavar="FILE.html", help="write a page with pictures and tables")
    parser.add_argument(
        "--threshold",
        type=grey,
        metavar="GREY",
        help="make a picture binary: grey value from 0 (black) to 1 (white), or `otsu` (default: pixels weigh as much "
        "as they differ from the background, which is what most of the border shows); of a volume: the surface where "
        "its values cross this share of their range (default: otsu)",
    )
    parser.add_argument("--invert", action="store_true", help="exchange object and background of a picture")
    parser.add_argument(
        "--strict", action="store_true", help=f"end with status {UNDETERMINED} where the answer is undetermined"
    )
    add_class_options(parser)
    add_frame_option(parser)
    add_scan_options(parser)
    add_depth_options(parser)
    add_detection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Detect, write the files that were asked for, print."""
    paths = expanded(args.path)
    outputs = {f"--{name}": getattr(args, name) for name in ("json", *_OF_ONE)}
    check_outputs(outputs, [Path(path) for path in paths if path != STDIN])
    check_beside("--bop", args.bop, {"--bop-id": args.bop_id, "--bop-scale": args.bop_scale})
    if len(paths) > 1:
        return _several(args, paths)
    if args.picture is not None and Path(args.picture).suffix.lower() != ".png":
        raise InputError(f"--picture {args.picture}: expected a name that ends in .png")
    if args.bop is not None:
        from symrefine.export.bop import read_models_info

        read_models_info(Path(args.bop))
    with waiting("detecting"):
        shape, detection, record = _examined(args, paths[0])
        writers = json_writer(args.json, record) | _writers(args, shape, detection)
        write_all(writers)
    for text in _notes(args, shape, detection, record):
        note(text)
    tell(args.json, record, None, writers)
    return UNDETERMINED if args.strict and record["undetermined"] else 0


def _examined(args: argparse.Namespace, path: str) -> tuple["Shape", Any, dict[str, Any]]:
    """What `examine` says of a file, or of stdin."""
    options, picture = detection_options(args), {"threshold": args.threshold, "invert": args.invert}
    with readable(path, args.format) as file:
        shape, detection, record = examine(file, options, **picture)
    if file != path:
        shape, record = replace(shape, source=NAME), record | {"source": NAME}
    if is_verbose():
        seconds = sum(record["timings"].values())
        complain(f"{len(shape.points):,} points in {seconds:.2f} s, {len(shape.points) / seconds:,.0f} points/s")
    return shape, detection, record


def _several(args: argparse.Namespace, paths: Sequence[str]) -> int:
    """A line for each of several files as soon as it is done; one that cannot be used does not end the others."""
    _check_several(args, paths)
    from symrefine.cli.tables import ROW_HEAD, row_line

    in_lines = args.json != STDOUT and not is_quiet()
    records: list[dict[str, Any]] = []
    with progress("detecting", len(paths), 0) as advance:
        if in_lines:
            print_lines([ROW_HEAD])
        for path in paths:
            record = _record_or_error(args, path)
            records.append(record)
            if in_lines:
                print_lines([row_line(path, {"error": None} | record)])
            elif "error" in record:
                complain(record["error"])
            advance()
    text = json_array_text(records)
    if args.json == STDOUT:
        say(text)
    elif args.json is not None:
        write_all({args.json: text_writer(text)})
        print_lines([f"wrote {args.json}"])
    if any("error" in record for record in records):
        return REFUSED
    return UNDETERMINED if args.strict and any(record["undetermined"] for record in records) else 0


def _check_several(args: argparse.Namespace, paths: Sequence[str]) -> None:
    """Refuse what is for one file."""
    if STDIN in paths:
        raise InputError("-: stdin is one file; name no others beside it")
    for name in _OF_ONE:
        if (given := getattr(args, name)) is not None:
            right = "`symrefine batch DIR --bop FILE` takes a directory" if name == "bop" else "call `detect` for each"
            raise InputError(f"--{name} {given}: is for one file, and PATH names {len(paths)}; {right}")


def _record_or_error(args: argparse.Namespace, path: str) -> dict[str, Any]:
    """The record of one of several files, or what was wrong with it."""
    try:
        return _examined(args, path)[2]
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        return {"source": path, "error": failure(path, error)}


def _notes(args: argparse.Namespace, shape: "Shape", detection: Any, record: dict[str, Any]) -> Iterator[str]:
    """What else there is to say, on stderr."""
    if args.bop is not None:
        from symrefine.export.bop import bop_limits, diameter, metres_doubt

        doubt = "" if args.bop_scale else metres_doubt(shape.source, diameter(shape.points), "--bop-scale")
        yield from filter(None, (bop_limits(detection), doubt))
    is_grey = shape.dim == 2 and "threshold" in record["options"] and args.threshold is None
    if is_grey and (record["undetermined"] or record["point_group"] == "C1"):
        yield f"{shape.source}: if object and background are of different grey, try --threshold otsu"


def examine(
    path: str, options: dict[str, Any], *, threshold: float | Literal["otsu"] | None = None, invert: bool = False
) -> tuple["Shape", Any, dict[str, Any]]:
    """Shape, detection and JSON record of a file, with `detection_options`, and those of a picture.

    The detection is a `PlanarDetection`, a `Detection` or a `SubspaceDetection`, as the points have two, three or more
    coordinates.
    """
    from symrefine.front.verbs import detect
    from symrefine.lengths import relative_tolerance
    from symrefine.load import IMAGES, suffix_of

    clock, outliers = Clock(), options.get("outliers", "auto")
    with clock("load"):
        shape = read_scan(path, options, threshold=threshold, invert=invert)
    if threshold is not None or invert or (shape.dim == 2 and suffix_of(Path(path)) in IMAGES):
        options = options | {"threshold": threshold, "invert": invert}
    found: Any = detect(
        shape,
        outliers=outliers,
        tolerance=relative_tolerance(options["tolerance"], shape, units=options.get("units"), outliers=outliers),
        seed=options["seed"],
    )
    if options.get("labels") == TEXTURE:
        found = found.textured
    found = replace(found, options=options)
    return shape, found, found.to_dict(load_s=clock.seconds["load"])


def read_scan(path: str, options: dict[str, Any], **picture: Any) -> "Shape":
    """The shape in a file as `detection_options` say, and `picture`: a depth image, or a cloud that a camera saw."""
    from symrefine.load import load, load_depth

    known = ("intrinsics", "depth_scale", "mask", "viewpoint", "measure", "labels", "weights", "frame", "texture")
    said = {name: given for name in known if (given := options.get(name)) is not None}
    if said.get("labels") == TEXTURE:
        said = {name: given for name, given in said.items() if name != "labels"} | {"texture": True}
    depth = {name: said.pop(name) for name in ("depth_scale", "mask") if name in said}
    if "intrinsics" in said:
        camera = said.pop("intrinsics")
        idle = [name for name, given in (said | picture).items() if given not in (None, False)]
        if idle:
            raise InputError(f"{path}: is read as a depth image, so {_option(idle[0])} does not apply; leave it out")
        return load_depth(path, camera, **depth)
    if depth:
        raise InputError(f"{path}: {_option(next(iter(depth)))} goes with --intrinsics, which make it a depth image")
    viewpoint = said.pop("viewpoint", None)
    shape = load(path, **said, **picture)
    if viewpoint is None:
        return shape
    import numpy as np

    if shape.dim != 3 or shape.faces is not None:
        raise InputError(f"{shape.source}: --viewpoint is for clouds in space, leave it out")
    return replace(shape, viewpoint=np.array(viewpoint))


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def _writers(args: argparse.Namespace, shape: "Shape", detection: "Detection") -> dict[str, Writer]:
    """Writers of the files that are of one object.

    Raises:
        InputError: one is for objects in space only, and the points have two coordinates, or four and more.
    """
    writers: dict[str, Writer] = {}
    for option, name in {"--bop": args.bop, "--recording": args.recording}.items():
        if name is not None and shape.dim != 3:
            where = "lies in the plane" if shape.dim == 2 else f"has {shape.dim} coordinates"
            raise InputError(f"{option} {name}: is for objects in space; {shape.source} {where}; use --report")
    if args.bop is not None:
        from symrefine.export.bop import bop_entry, bop_text

        entry = bop_entry(detection, shape, scale=args.bop_scale or 1.0)
        number = 1 if args.bop_id is None else args.bop_id
        writers[args.bop] = text_writer(bop_text(Path(args.bop), {number: entry}))
    if args.recording is not None:
        from symrefine.viewer import record as write_recording

        writers[args.recording] = partial(write_recording, detection, shape)
    if args.picture is not None:
        from symrefine.report import draw

        writers[args.picture] = partial(draw, detection, shape)
    if args.report is not None:
        from symrefine.report import write_html

        writers[args.report] = partial(write_html, detection, shape)
    return writers
