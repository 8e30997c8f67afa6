"""`symrefine detect`: one file in, its symmetries out."""

import argparse
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from symrefine.cli.outputs import (
    Writer,
    check_beside,
    check_outputs,
    json_writer,
    note,
    tell,
    text_writer,
    waiting,
    write_all,
)
from symrefine.cli.values import (
    add_class_options,
    add_depth_options,
    add_detection_options,
    add_frame_option,
    add_scan_options,
    detection_options,
    grey,
    natural,
    positive,
)
from symrefine.errors import InputError

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.shape import Shape

# Exit status of `--strict` where nothing is decided.
UNDETERMINED = 3
HELP = "find the planes, axes and point group of a mesh, cloud or picture"
DESCRIPTION = (
    "Find the mirror planes, rotation axes and point group of the mesh or point cloud in PATH (.ply .stl .obj .off "
    ".3mf .step .glb .gltf .pcd .las .laz .e57 .xyz .csv .txt .npy .npz), of a molecule (.xyz .mol .sdf .pdb .cif) or "
    "of a volume (.nii .nrrd .mrc .map), or the mirror lines and turns of a picture (.png .jpg .jpeg .bmp) or of "
    "points with two coordinates (.csv .txt .npy .npz), or the hyperplanes of symmetry of points with 4 to 8 "
    "coordinates; each file may be packed (.gz). With --intrinsics PATH is a depth image. Prints a table; lengths are "
    "in the units of the file, misses in percent of the bounding-box diagonal."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("path", metavar="PATH", help="mesh, point cloud, molecule, volume or picture")
    parser.add_argument("--json", metavar="FILE|-", help="write the whole report as JSON; - is stdout, with no table")
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
    outputs = {"--json": args.json, "--bop": args.bop, "--recording": args.recording, "--report": args.report}
    check_outputs(outputs, [Path(args.path)])
    check_beside("--bop", args.bop, {"--bop-id": args.bop_id, "--bop-scale": args.bop_scale})
    if args.bop is not None:
        from symrefine.export.bop import read_models_info

        read_models_info(Path(args.bop))
    with waiting("detecting"):
        options = detection_options(args)
        shape, detection, record = examine(args.path, options, threshold=args.threshold, invert=args.invert)
        writers = json_writer(args.json, record) | _writers(args, shape, detection)
        write_all(writers)
    if args.bop is not None:
        from symrefine.export.bop import bop_limits

        if limits := bop_limits(detection):
            note(limits)
    tell(args.json, record, None, writers)
    return UNDETERMINED if args.strict and record["undetermined"] else 0


def examine(
    path: str, options: dict[str, Any], *, threshold: float | Literal["otsu"] | None = None, invert: bool = False
) -> tuple["Shape", Any, dict[str, Any]]:
    """Shape, detection and JSON record of a file, with `detection_options`, and those of a picture.

    The detection is a `PlanarDetection`, a `Detection` or a `SubspaceDetection`, as the points have two, three or more
    coordinates.
    """
    from symrefine.load import IMAGES, suffix_of

    start = time.perf_counter()
    shape = read_scan(path, options, threshold=threshold, invert=invert)
    load_s = time.perf_counter() - start
    if threshold is not None or invert or (shape.dim == 2 and suffix_of(Path(path)) in IMAGES):
        options = options | {"threshold": threshold, "invert": invert}
    tolerance, seed, outliers = options["tolerance"], options["seed"], options.get("outliers", "auto")
    if shape.labels is not None and shape.dim != 3:
        raise InputError(
            f"{path}: points have {shape.dim} coordinates; labels are for objects in space, leave them out"
        )
    if shape.dim == 2:
        from symrefine.export.records import planar_record
        from symrefine.plane import detect_planar

        flat = detect_planar(shape, tolerance=tolerance, seed=seed)
        return shape, flat, planar_record(flat, shape, options=options, load_s=load_s)
    if shape.dim > 3:
        from symrefine.export.records import subspace_record
        from symrefine.ndim import detect_nd

        start = time.perf_counter()
        beyond = detect_nd(shape, tolerance=tolerance)
        timings = {"load": load_s, "detect": time.perf_counter() - start}
        return shape, beyond, subspace_record(beyond, shape, options=options, timings=timings)
    from symrefine.detection.story import LADDER, detect
    from symrefine.export.records import detection_record

    detection = detect(shape, outliers=outliers, tolerance=tolerance, ladder=LADDER, seed=seed)
    return shape, detection, detection_record(detection, shape, options=options, load_s=load_s)


def read_scan(path: str, options: dict[str, Any], **picture: Any) -> "Shape":
    """The shape in a file as `detection_options` say, and `picture`: a depth image, or a cloud that a camera saw."""
    from symrefine.load import load, load_depth

    known = ("intrinsics", "depth_scale", "mask", "viewpoint", "measure", "labels", "weights", "frame")
    said = {name: given for name in known if (given := options.get(name)) is not None}
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
    """Writers of what is for objects in space only.

    Raises:
        InputError: it is asked for, and the points have two coordinates, or four and more.
    """
    writers: dict[str, Writer] = {}
    for option, name in {"--bop": args.bop, "--recording": args.recording, "--report": args.report}.items():
        if name is not None and shape.dim != 3:
            where = "lies in the plane" if shape.dim == 2 else f"has {shape.dim} coordinates"
            raise InputError(f"{option} {name}: is for objects in space; {args.path} {where}, use --json")
    if args.bop is not None:
        from symrefine.export.bop import bop_entry, bop_text

        entry = bop_entry(detection, shape, scale=args.bop_scale or 1.0)
        number = 1 if args.bop_id is None else args.bop_id
        writers[args.bop] = text_writer(bop_text(Path(args.bop), {number: entry}))
    if args.recording is not None:
        from symrefine.viewer import record as write_recording

        writers[args.recording] = partial(write_recording, detection, shape)
    if args.report is not None:
        from symrefine.report import write_html

        writers[args.report] = partial(write_html, detection, shape)
    return writers
