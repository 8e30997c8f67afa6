"""`symrefine detect`: files in, the symmetries of the objects in them out."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from symrefine.cli.inputs import STDIN, TEXTURE, Object, expanded, objects, scans
from symrefine.cli.outputs import (
    add_outputs,
    check_bop,
    check_outputs,
    complain,
    is_quiet,
    is_verbose,
    json_writer,
    note,
    shown,
    shown_writers,
    tell,
    write_all,
)
from symrefine.cli.rows import ROW_HEAD, row_line
from symrefine.cli.several import UNDETERMINED, Many, check_alone
from symrefine.cli.signs import counting
from symrefine.cli.values import NUMBERED, add_object_options, add_path, detection_options, grey, millimetres, natural
from symrefine.errors import InputError
from symrefine.files import Writer, asked_for, text_writer

if TYPE_CHECKING:
    from symrefine.export.bop import Entry
    from symrefine.shape import Shape
    from symrefine.stream import Stream

HELP = "find the planes, axes and point group of a mesh, cloud or picture"
DESCRIPTION = (
    "Find the mirror planes, rotation axes and point group of the mesh or point cloud in PATH (.ply .stl .obj .off "
    ".3mf .dae .step .glb .gltf .pcd .las .laz .e57 .xyz .csv .txt .npy .npz), of a molecule (.xyz .mol .sdf .pdb "
    ".cif) or of a volume (.nii .nrrd .mrc .map), or the mirror lines and turns of a picture (.png .jpg .jpeg .bmp) "
    "or of points with two coordinates (.csv .txt .npy .npz), or the hyperplanes of symmetry of points with 4 to 8 "
    "coordinates; each file may be packed (.gz). With --intrinsics PATH is a depth image. Prints a table; lengths are "
    "in the units of the file, misses in percent of the bounding-box diagonal. Several files, or a pattern in quotes, "
    "or a file of several molecules, models or volumes, give a line for each object; one that cannot be used is told "
    "on its line, the others go on, and the exit status is 2."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "meshes, clouds, molecules, volumes or pictures, or patterns of them", several=True)
    add_outputs(
        parser,
        json="write the whole report as JSON, of several objects an array; - is stdout, with no table",
        picture="write a picture of the shape and what was found",
    )
    parser.add_argument("--bop", metavar="FILE", help="put the symmetries into this models_info.json of BOP")
    parser.add_argument("--bop-id", type=natural, metavar="N", help=f"number of the object there {NUMBERED}")
    parser.add_argument(
        "--bop-scale",
        type=millimetres,
        metavar="X",
        help="millimetres in one unit of PATH: 1000 if it is in metres (default: 1)",
    )
    add_outputs(
        parser, recording="write the iterations, for `symrefine view`", report="write a page with pictures and tables"
    )
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
    parser.add_argument(
        "--verify",
        choices=("sample", "all"),
        help="all: move all points of a cloud, one by one, by every element that was found, and tell what they miss "
        "by; microseconds for each point and element (default: a sample of a cloud of more than 100,000 points tells)",
    )
    add_object_options(parser, otherwise="each of them", depth=True)


def run(args: argparse.Namespace) -> int:
    """Detect, write the files that were asked for, print."""
    paths = expanded(args.path)
    _check(args, paths)
    read = partial(scans, options=detection_options(args), in_chunks=True, **_picture(args))
    many = Many(json_to=args.json, head=ROW_HEAD, line=row_line, record=lambda given: _examined(args, given)[2])
    with counting("detecting", len(paths)) as doing:
        given = objects(paths, args.format, read)
        with asked_for() as asked:
            first = next(given)
        check_outputs(_of_one(args), asked)  # images of textures and masks are inputs, too
        if several := len(paths) > 1 or first.frames > 1:
            check_alone(_of_one(args), f"{paths[0]} holds {first.frames}", "choose one with --frame")
            records = list(many.told(chain([first], given), doing))
        else:
            shape, detection, record = _examined(args, first)
            entries = _entries(args, shape, detection)
            # What was there is known before it is replaced.
            notes = list(_notes(args, shape, detection, record, entries))
            writers = json_writer(args.json, record) | _writers(args, shape, detection, entries)
            write_all(writers)
    if several:
        for text in _floorless(records):
            note(text)
        return many.end(records, undetermined=args.strict and any(r.get("undetermined") for r in records))
    for text in notes:
        note(text)
    tell(args.json, record, None, writers)
    return UNDETERMINED if args.strict and record["undetermined"] else 0


def _check(args: argparse.Namespace, paths: Sequence[str]) -> None:
    """Refuse, before any work, outputs that cannot be written or do not fit together, and what is for one file."""
    check_outputs({"--json": args.json} | _of_one(args), [Path(path) for path in paths if path != STDIN])
    check_bop(args.bop, {"--bop-id": args.bop_id, "--bop-scale": args.bop_scale})
    if len(paths) > 1:
        if STDIN in paths:
            raise InputError("-: stdin is one file; name no others beside it")
        of_bop = "`symrefine batch DIR --bop FILE` takes a directory"
        check_alone(_of_one(args), f"PATH names {len(paths)}", of_bop if args.bop else "call `detect` for each")
    if args.bop is not None:
        from symrefine.export.bop import read_models_info

        read_models_info(Path(args.bop))


def _of_one(args: argparse.Namespace) -> dict[str, str | None]:
    """The outputs that are of one object, with the files that they are to fill."""
    return {"--bop": args.bop} | shown(args)


def _picture(args: argparse.Namespace) -> dict[str, Any]:
    return {"threshold": args.threshold, "invert": args.invert}


def _examined(args: argparse.Namespace, given: Object) -> tuple["Shape", Any, dict[str, Any]]:
    """Shape, detection and JSON record of an object in a file."""
    options = detection_options(args) | ({} if given.frame is None else {"frame": given.frame})
    detection = detected(given.shape, options, given.file, **_picture(args))
    shape = detection.shape
    record = detection.to_dict(load_s=given.load_s)
    if is_verbose():
        seconds, sample = sum(record["timings"].values()), record.get("sample")
        points = len(shape.points) if sample is None else sample["of"]
        complain(f"{points:,} points in {seconds:.2f} s, {points / seconds:,.0f} points/s")
    return shape, detection, record


def _entries(args: argparse.Namespace, shape: "Shape", detection: Any) -> "dict[int, Entry]":
    """What goes into a `models_info.json`, by the number of the object.

    Raises:
        InputError: the points have two coordinates, or four and more, or nothing is decided.
    """
    if args.bop is None:
        return {}
    from symrefine.export.bop import bop_entry, number_for

    _check_in_space("--bop", args.bop, shape)
    number = number_for(shape.source, args.bop_id)
    return {number: bop_entry(detection, detection.own(shape), scale=args.bop_scale or 1.0)}


def _check_in_space(option: str, name: str, shape: "Shape") -> None:
    """Refuse what is for objects in space only."""
    if shape.dim != 3:
        where = "lies in the plane" if shape.dim == 2 else f"has {shape.dim} coordinates"
        raise InputError(f"{option} {name}: is for objects in space; {shape.source} {where}; use --report")


def _notes(
    args: argparse.Namespace, shape: "Shape", detection: Any, record: dict[str, Any], entries: "Mapping[int, Entry]"
) -> Iterator[str]:
    """What else there is to say, on stderr."""
    if args.bop is not None:
        from symrefine.export.bop import bop_limits, metres_doubt, replaced

        (entry,) = entries.values()
        doubt = metres_doubt(shape.source, entry["diameter"], "--bop-scale", args.bop_scale)
        yield from filter(None, (bop_limits(detection), doubt, replaced(Path(args.bop), entries)))
    is_grey = shape.dim == 2 and "threshold" in record["options"] and args.threshold is None
    if is_grey and (record["undetermined"] or record["point_group"] == "C1"):
        yield f"{shape.source}: if object and background are of different grey, try --threshold otsu"
    if shape.dim == 2 and not is_quiet():
        from symrefine.load.image import is_deep

        if is_deep(Path(shape.source)):
            yield f"{shape.source}: 16 bits: if this is a depth image, give --intrinsics"
    if shape.dim == 3 and record["options"].get("outliers", "auto") == "auto" and not is_quiet():
        yield from _floor(shape, detection)


def _floorless(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """In which of several objects no floor was found that was asked for, as their lines do not say."""
    asked = [r for r in records if r.get("options", {}).get("outliers") == "floor" and "outliers" in r]
    if without := [r["source"] for r in asked if r["outliers"]["floor"] is None]:
        yield f"no floor was found in {len(without)} of {len(asked)}: {', '.join(without)}"


def _floor(shape: "Shape", detection: Any) -> Iterator[str]:
    """That a scan in which not all was found may be one of a floor, too."""
    if detection.surface.cloud.body != "surface" or shape.faces is not None:
        return
    if detection.at_least or detection.undetermined or detection.point_group == "C1":
        from symrefine.survey import points_of_floor

        if points := points_of_floor(shape):
            yield (
                f"{shape.source}: {points:,} points lie in a plane that all others stand on; if that is a floor, not a "
                "face of it, try --outliers floor"
            )


def detected(
    shape: "Shape | Stream",
    options: dict[str, Any],
    file: str,
    *,
    threshold: float | Literal["otsu"] | None = None,
    invert: bool = False,
) -> Any:
    """What `detect` says of the shape in a file, with `detection_options`, and those of a picture."""
    from symrefine.front.verbs import detect
    from symrefine.load import IMAGES, suffix_of
    from symrefine.shape import Shape

    is_flat = isinstance(shape, Shape) and shape.dim == 2
    if threshold is not None or invert or (is_flat and suffix_of(Path(file)) in IMAGES):
        options = options | {"threshold": threshold, "invert": invert}
    found: Any = detect(
        shape,
        outliers=options.get("outliers", "auto"),
        tolerance=options["tolerance"],
        units=options.get("units"),
        seed=options["seed"],
        verify=options.get("verify", "sample"),
    )
    if options.get("labels") == TEXTURE:
        found = found.textured
    return replace(found, options=options)


def _writers(
    args: argparse.Namespace, shape: "Shape", detection: Any, entries: "Mapping[int, Entry]"
) -> dict[str, Writer]:
    """Writers of the files that are of one object.

    Raises:
        InputError: one is for objects in space only, and the points have two coordinates, or four and more.
    """
    writers: dict[str, Writer] = {}
    if args.recording is not None:
        _check_in_space("--recording", args.recording, shape)
    if args.bop is not None:
        from symrefine.export.bop import bop_text

        writers[args.bop] = text_writer(bop_text(Path(args.bop), entries))
    return writers | shown_writers(args, detection)
