"""Tables of coordinates: .xyz, .csv and .txt as text, .npy and .npz as NumPy writes them."""

import io
import math
import re
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError, about
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons, Values, as_float64
from symrefine.load.extras import reading
from symrefine.load.frames import Frames, one
from symrefine.load.molecule import is_bare_molecule, is_molecule, read_bare_molecule, read_molecule
from symrefine.load.packed import allowance, archive
from symrefine.load.text import (
    Line,
    count,
    is_number,
    numbered_lines,
    parse_table,
    separators,
    shorten,
    split_lines,
    with_points,
)

_FIELDS = ("points", "normals", "weights", "faces")
# What `complete` writes beside the points, of no matter unless it is asked for, as the property of a .ply.
_MARK = "inferred"
_COLOURS = (("red", "green", "blue"), ("r", "g", "b"))
# First columns that number the rows; pandas writes the last where it has read the first.
_INDEX = re.compile(r"|index|id|unnamed: 0")
# Rounding of normals written with three digits; colours and coordinates are far from it.
_UNIT = 1e-2


def read_xyz(data: bytes) -> Frames[Content]:
    """Points of 3-space, with unit normals or without, where `#` begins a remark; or the atoms of chemical .xyz."""
    lines = numbered_lines(data, comment="#")
    if is_molecule(lines):
        return read_molecule(data)
    return one(read_bare_molecule(lines) if is_bare_molecule(lines) else _cloud(lines), "clouds")


def _cloud(lines: list[Line]) -> Content:
    table = parse_table(lines, columns=(3, 6), layout="3 columns (x y z) or 6 (x y z and a unit normal)")
    normals = table[:, 3:] if table.shape[1] == 6 else None
    if normals is not None and (bad := np.flatnonzero(~_is_unit(normals))).size:
        raise InputError(
            f"line {lines[bad[0]][0]}: columns 4 to 6 are {normals[bad[0]].tolist()}, no unit normal; "
            "expected 3 columns (x y z) or 6 (x y z and a unit normal), so remove colours"
        )
    return Content(points=table[:, :3], normals=normals, point_lines=[number for number, _ in lines])


def read_table(data: bytes, named: Collection[str]) -> Content:
    """Points of n-space, one a line, between semicolons, commas, tabs or white space, as the first line has them.

    `#` begins a remark. Between semicolons decimals may have a comma. A first line of names may say which columns are
    coordinates and which a normal; a first column without a name, or named index or id, is none.

    Args:
        named: fields that the caller asks for: names of columns of numbers or texts, or `color` for those of red,
            green and blue. Other columns are refused as ever.
    """
    lines, delimiter = split_lines(data)
    names = [name.strip().strip('"').lower() for name in lines[0][1].split(delimiter)] if lines else []
    titled = bool(names) and not any(re.match(r"[+-]?[.,]?[0-9]|[+-]?(nan|inf)", name) for name in names)
    rows = lines[1:] if titled else lines
    index = [0] if titled and _INDEX.fullmatch(names[0]) else []
    fields = _field_columns(names if titled else [], named)
    taken = {column for group in fields.values() for column in group}.union(index)
    places = [column for column in range(len(names)) if column not in taken]
    normals = _check_names([names[k] for k in places], lines[0][0]) if titled else False
    columns = (len(names),) if titled else ()
    layout = f"{count(len(names), 'column')} as in the first line" if titled else "as many numbers in every line"
    texts = {k: entries for k in taken if (entries := _texts(rows, k, delimiter))}
    numeric = [_without(row, texts, delimiter) for row in rows] if texts else rows
    if delimiter == ";":
        numeric = with_points(numeric)
    table = parse_table(numeric, columns=columns, layout=layout, delimiter=delimiter)
    values = {name: np.array(texts.get(group[0], table[:, group])) for name, group in fields.items()}
    if titled:
        table = table[:, places]
    else:
        _refuse_hidden_normals(table, "name the columns in a first line: x,y,z,nx,ny,nz or x1,...,x6")
    _check_shape(table)
    return Content(
        points=table[:, :3] if normals else table,
        normals=table[:, 3:] if normals else None,
        point_fields={name: v[:, 0] if v.shape[1:] == (1,) else v for name, v in values.items()},
        point_lines=[number for number, _ in rows],
    )


def _field_columns(names: list[str], named: Collection[str]) -> dict[str, list[int]]:
    """Columns of each field that was asked for and is there."""
    fields = {name.lower(): [names.index(name.lower())] for name in named if name.lower() in names}
    colours = next((c for c in _COLOURS if set(c) <= set(names)), None)
    if "color" in named and "color" not in fields and colours is not None:
        fields["color"] = [names.index(name) for name in colours]
    return fields


def _texts(rows: list[Line], column: int, delimiter: str | None) -> list[str]:
    """Entries of a column that holds anything but numbers; none of a column of numbers, or where a row is short."""
    entries = [fields[column].strip().strip('"') for _, text in rows if len(fields := text.split(delimiter)) > column]
    numbers = [entry.replace(",", ".") for entry in entries] if delimiter == ";" else entries
    if len(entries) < len(rows) or all(map(is_number, numbers)):
        return []
    if "" in entries:
        raise InputError(f"line {rows[entries.index('')][0]}, column {column + 1}: is empty")
    return entries


def _without(row: Line, columns: Collection[int], delimiter: str | None) -> Line:
    """The row with a number in place of texts, so that columns keep their places in messages."""
    number, text = row
    fields = ["0" if k in columns else field for k, field in enumerate(text.split(delimiter))]
    return number, (delimiter or " ").join(fields)


def _check_names(names: list[str], line: int) -> bool:
    """Whether the columns end in a normal; refuses names that are no coordinates."""
    numbered = [[f"x{k + first}" for k in range(len(names))] for first in (0, 1)]
    if names == ["x", "y", "z", "nx", "ny", "nz"]:
        return True
    if names in (["x", "y"], ["x", "y", "z"]) or names in numbered:  # a w may be a weight
        return False
    raise InputError(
        f"line {line}: columns {shorten(','.join(names))}; expected x,y or x,y,z or x,y,z,nx,ny,nz or "
        "x1,...,xn: keep only these, name one as labels or weights, or remove the line of names if every column is a "
        f"coordinate{separators(','.join(names), ',')}"
    )


def read_npy(data: bytes) -> Content:
    """Points of n-space: one array [N, n] of real numbers."""
    points = _numbers(read_array(io.BytesIO(data)), "the array")
    _refuse_hidden_normals(points, "save points and normals in an .npz, or 6-D points as `points` in an .npz")
    _check_shape(points)
    return Content(points=points)


def read_npz(data: bytes, named: Collection[str]) -> Content:
    """Arrays named as the fields of a shape: points, and normals, weights or faces [F, 3] if there are any.

    Args:
        named: further arrays that the caller asks for: numbers or texts [F] for faces, [N] for points (the faces have
            them where both would do), or colours [F, 3] or [N, 3], [F, 4] or [N, 4]. Others are refused as ever.
    """
    arrays = _read_archive(data, named)
    fields = {name: arrays.pop(name) for name in named if name in arrays and name not in _FIELDS}
    arrays.pop(_MARK, None)
    numbers = {name: _numbers(array, name) for name, array in arrays.items() if name != "faces"}
    _check_shape(numbers["points"])
    faces = _faces(arrays["faces"]) if "faces" in arrays else None
    if faces is not None and "weights" in arrays:
        raise InputError("weights and faces; a mesh takes its weights from its faces: remove one of them")
    if faces is not None and numbers["points"].shape[1] != 3:
        raise InputError(f"faces over points {numbers['points'].shape}; faces need points [N, 3]")
    point_fields, face_fields = _sorted(fields, len(numbers["points"]), 0 if faces is None else len(faces))
    return Content(
        points=numbers["points"],
        normals=numbers.get("normals") if faces is None else None,
        weights=numbers.get("weights"),
        faces=faces,
        point_fields=point_fields,
        face_fields=face_fields,
    )


def _sorted(fields: dict[str, NDArray[Any]], points: int, faces: int) -> tuple[dict[str, Values], dict[str, Values]]:
    """The fields of the points and those of the faces, by their lengths."""
    of_points: dict[str, Values] = {}
    of_faces: dict[str, Values] = {}
    for name, array in fields.items():
        fit = array.ndim == 1 or (array.ndim == 2 and array.shape[1] in (3, 4) and array.dtype.kind != "U")
        if not fit or len(array) not in {points, faces or points} or array.dtype.kind not in "biufUS":
            lengths = f"{points} points" + (f", {faces} faces" if faces else "")
            raise InputError(
                f"{name} is {array.dtype} of shape {array.shape}; expected numbers or texts, or colours "
                f"[N, 3], for {lengths}"
            )
        values = array.astype(np.int64) if array.dtype.kind == "b" else array
        (of_faces if len(array) == faces else of_points)[name] = values[:, :3] if array.ndim == 2 else values
    return of_points, of_faces


def _read_archive(data: bytes, named: Collection[str]) -> dict[str, NDArray[Any]]:
    """Arrays by name, none of them read that is not known or asked for."""

    def check(members: Collection[str]) -> None:
        names = {member.removesuffix(".npy") for member in members}
        if not {"points"} <= names <= {*_FIELDS, _MARK, *named}:
            raise InputError(
                f"holds arrays {', '.join(sorted(names)) or '(none)'}; expected points, and any of "
                f"{', '.join(_FIELDS[1:])}, and what you name as labels or weights"
            )

    arrays, left = {}, allowance(len(data))
    for name, member in archive(data, ".npz", check).items():
        with about(name):
            array = read_array(io.BytesIO(member), left)
            left -= _room(array.shape, array.dtype)
            arrays[name.removesuffix(".npy")] = array
    return arrays


def _room(shape: tuple[int, ...], dtype: "np.dtype[Any]") -> int:
    """Bytes that an array takes in the end."""
    return math.prod(shape) * max(dtype.itemsize, 8)


def read_array(stream: io.BytesIO, most: int | None = None) -> NDArray[Any]:
    """The array of an .npy file, of any type but objects.

    Args:
        most: bytes that it may take as float64; any, as many as the file has for it, if None.
    """
    with reading(".npy array of numbers"):  # whose header NumPy evaluates
        _check_header(stream, most)
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    rest = len(stream.read())
    if rest:
        raise InputError(f"{count(rest, 'byte')} behind the array of shape {array.shape}; save it again")
    return array


def _check_header(stream: io.BytesIO, most: int | None) -> None:
    """Refuse arrays that are larger than what there is of them, or than they may be, before memory is taken."""
    size = len(stream.getbuffer())
    first = np.lib.format.read_magic(stream) < (2, 0)
    read = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    told, there = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if told > there and not dtype.hasobject:
        raise InputError(f"the header gives shape {shape} of {dtype}, {told} bytes; {there} follow: cut off or damaged")
    if most is not None and _room(shape, dtype) > most:
        raise InputError(
            f"{_room(shape, dtype):,} bytes as double, where {most:,} are allowed of so small a file; save it unpacked"
        )
    stream.seek(0)


def _numbers(array: NDArray[Any], name: str) -> Array:
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} is of type {array.dtype}; expected real numbers, integer or floating")
    return as_float64(array)


def _faces(array: NDArray[Any]) -> Polygons:
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InputError(f"faces have shape {array.shape} of {array.dtype}; expected [F, 3] integers, F >= 1")
    return Polygons.alike(array.astype(np.int64))


def _check_shape(table: Array) -> None:
    if table.ndim != 2 or table.shape[1] < 2:
        shape = f"shape {table.shape}" if table.ndim != 2 else f"{len(table)} rows of {count(table.shape[1], 'number')}"
        raise InputError(f"{shape}; expected one row [N, n] for each point, n >= 2 coordinates")


def _refuse_hidden_normals(table: Array, remedy: str) -> None:
    """Six columns are points of 6-space, unless the last three are always a unit vector: that is no accident."""
    if table.ndim == 2 and table.shape[1] == 6 and len(table) and _is_unit(table[:, 3:]).all():
        raise InputError(f"columns 4 to 6 are unit vectors in every row, normals or coordinates? {remedy}")


def _is_unit(vectors: Array) -> NDArray[np.bool_]:
    with np.errstate(over="ignore"):
        unit: NDArray[np.bool_] = np.abs(np.linalg.norm(vectors, axis=1) - 1.0) <= _UNIT
    return unit
