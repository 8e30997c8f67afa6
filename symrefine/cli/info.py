"""`symrefine info`: what was read from a file, before any symmetry is looked for."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.cli.inputs import loaded, read_scan
from symrefine.cli.outputs import check_outputs, json_writer, tell, write_all
from symrefine.cli.signs import waiting
from symrefine.cli.values import add_depth_options, add_path, add_reading_options, add_viewpoint, reading_options
from symrefine.clock import Clock
from symrefine.units import EVERYDAY_M, unit_of_size

if TYPE_CHECKING:
    from symrefine.shape import Shape
    from symrefine.survey import Survey

SCHEMA = "symrefine.info/1"
# Classes and cameras that are told one by one.
_SHOWN = 8
_KINDS = {"mesh": "a mesh", "cloud": "a point cloud", "points": "points", "picture": "a picture"}
HELP = "tell what a file holds: size, parts, sampling, and what may go wrong"
DESCRIPTION = (
    "Read a mesh, point cloud or picture and tell what it is: points and faces, box and size, the unit it may be in, "
    "whether a mesh is closed, connected parts, repeated points, strays, whether the density is even, classes, "
    "normals, viewpoints, and what of it may go wrong in a detection."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_path(parser, "mesh, point cloud or picture")
    parser.add_argument("--json", metavar="FILE|-", help="write all of it as JSON; - is stdout, with no table")
    add_reading_options(parser)
    add_viewpoint(parser)
    add_depth_options(parser)


def run(args: argparse.Namespace) -> int:
    """Read, look it over, print."""
    check_outputs({"--json": args.json}, [Path(args.path)])
    with waiting("reading"):
        from symrefine.survey import survey

        shape = loaded(args.path, args.format, lambda file: read_scan(file, reading_options(args)))
        with Clock()("survey", len(shape.points)):
            found = survey(shape)
        record = _record(args, shape, found)
        write_all(writers := json_writer(args.json, record))
    tell(args.json, record, _lines(record), writers)
    return 0


def _record(args: argparse.Namespace, shape: "Shape", found: "Survey") -> dict[str, Any]:
    from symrefine.export.numbers import number, numbers
    from symrefine.export.records import opening
    from symrefine.load import IMAGES, suffix_of
    from symrefine.survey import doubts

    size = float((found.high - found.low).max())
    return {
        **opening(SCHEMA, reading_options(args), source=shape.source),
        "kind": "picture" if shape.dim == 2 and suffix_of(Path(shape.source)) in IMAGES else found.kind,
        "dimension": shape.dim,
        "points": found.points,
        "repeated": found.repeated,
        "low": numbers(found.low, size),
        "high": numbers(found.high, size),
        "diagonal": None if found.diagonal is None else number(found.diagonal),
        "spread": numbers(found.spread, size),
        "units": _units(shape, found.diagonal or size),
        "mesh": found.mesh and {**_fields(found.mesh), "area": number(found.mesh.area), "closed": found.mesh.closed},
        "cloud": found.cloud and _fields(found.cloud),
        "classes": None if found.classes is None else {"count": len(found.classes), "sizes": list(found.classes)},
        "normals": found.normals,
        "weights": found.weighted,
        "viewpoints": [numbers(place, size) for place in found.viewpoints],
        "doubts": list(doubts(found)),
    }


def _fields(part: Any) -> dict[str, Any]:
    from dataclasses import asdict

    return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(part).items()}


def _units(shape: "Shape", size: float) -> dict[str, Any]:
    """The unit that the format says or the size suggests, and why; None where neither does."""
    if shape.dim != 3:
        return {"unit": None, "why": "only of objects in space"}
    if shape.unit is not None:
        return {"unit": shape.unit, "why": "the format says so"}
    low, high = EVERYDAY_M
    if unit := unit_of_size(size):
        return {"unit": unit, "why": f"a guess: in it the size is between {1000 * low:g} mm and {high:g} m"}
    return {"unit": None, "why": f"neither in mm nor in m the size is between {1000 * low:g} mm and {high:g} m"}


def _lines(record: dict[str, Any]) -> Iterator[str]:
    """What a person wants to know of a file."""
    low, high, mesh, cloud = record["low"], record["high"], record["mesh"], record["cloud"]
    what = _KINDS[record["kind"]]
    faces = f" and {mesh['faces']:,} triangles" if mesh else ""
    yield f"{record['source']}: {what} in {record['dimension']} dimensions, {record['points']:,} points{faces}"
    yield f"box      {' x '.join(f'{b - a:.6g}' for a, b in zip(low, high, strict=True))}, from {_place(low)}"
    if record["diagonal"] is not None:
        yield f"diagonal {record['diagonal']:.6g}, of the smallest box over all orientations"
    yield f"unit     {record['units']['unit'] or 'not known'}: {record['units']['why']}"
    if mesh:
        closed = "closed" if mesh["closed"] else "not closed"
        edges = f"{mesh['open_edges']:,} edges with one face, {mesh['crowded_edges']:,} with more than two"
        turned = f"{mesh['turned_edges']:,} between faces turned against one another"
        yield f"surface  {closed}: {edges}, {turned}; area {mesh['area']:.6g}"
    parts = (mesh or cloud or {}).get("parts")
    if parts:
        yield f"parts    {parts:,} that hang together"
    if cloud:
        density = "even" if cloud["even"] else "differs from place to place"
        yield f"sampling {'of a volume' if cloud['volume'] else 'of a surface'}, density {density}"
        yield f"outliers {cloud['strays']:,} strays, {len(cloud['clumps'])} clumps"
    yield f"repeated {record['repeated']:,} points"
    if classes := record["classes"]:
        more = ", ..." if classes["count"] > _SHOWN else ""
        yield f"classes  {classes['count']}, of {', '.join(f'{n:,}' for n in classes['sizes'][:_SHOWN])}{more}"
    has = [name for name in ("normals", "weights") if record[name]]
    yield f"has      {', '.join(has) or 'neither normals nor weights'}"
    for place in record["viewpoints"][:_SHOWN]:
        yield f"seen from {_place(place)}"
    yield from (f"beware:  {doubt}" for doubt in record["doubts"])


def _place(values: list[float]) -> str:
    return f"({', '.join(f'{v:.6g}' for v in values)})"
