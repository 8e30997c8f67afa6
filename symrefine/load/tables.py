"""Tables of coordinates: .xyz, .csv and .txt as text, .npy and .npz as NumPy writes them."""

import io
import re
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons, as_float64
from symrefine.load.text import count, numbered_lines, parse_table, shorten

_FIELDS = ("points", "normals", "weights", "faces")
# Rounding of normals written with three digits; colours and coordinates are far from it.
_UNIT = 1e-2


def read_xyz(data: bytes, source: str) -> Content:
    """Points of 3-space, with unit normals or without; `#` begins a remark."""
    lines = numbered_lines(data, source, comment="#")
    table = parse_table(lines, source, columns=(3, 6), layout="3 columns (x y z) or 6 (x y z and a unit normal)")
    normals = table[:, 3:] if table.shape[1] == 6 else None
    if normals is not None and (bad := np.flatnonzero(~_is_unit(normals))).size:
        raise InputError(
            f"{source}: line {lines[bad[0]][0]}: columns 4 to 6 are {normals[bad[0]].tolist()}, no unit normal; "
            "expected 3 columns (x y z) or 6 (x y z and a unit normal), so remove colours"
        )
    return Content(points=table[:, :3], normals=normals, point_lines=[number for number, _ in lines])


def read_table(data: bytes, source: str) -> Content:
    """Points of n-space, one a line, between commas if the first line has any; `#` begins a remark.

    A first line of names may say which columns are coordinates and which a normal.
    """
    lines = numbered_lines(data, source, comment="#")
    delimiter = "," if lines and "," in lines[0][1] else None
    names = [name.strip().strip('"').lower() for name in lines[0][1].split(delimiter)] if lines else []
    titled = bool(names) and not any(re.match(r"[+-]?\.?[0-9]|[+-]?(nan|inf)", name) for name in names)
    rows = lines[1:] if titled else lines
    normals = _check_names(names, lines[0][0], source) if titled else False
    columns = (len(names),) if titled else ()
    layout = f"{count(len(names), 'column')} as in the first line" if titled else "as many numbers in every line"
    table = parse_table(rows, source, columns=columns, layout=layout, delimiter=delimiter)
    if not titled:
        _refuse_hidden_normals(table, source, "name the columns in a first line: x,y,z,nx,ny,nz or x1,...,x6")
    _check_shape(table, source)
    return Content(
        points=table[:, :3] if normals else table,
        normals=table[:, 3:] if normals else None,
        point_lines=[number for number, _ in rows],
    )


def _check_names(names: list[str], line: int, source: str) -> bool:
    """Whether the columns end in a normal; refuses names that are no coordinates."""
    numbered = [[f"x{k + first}" for k in range(len(names))] for first in (0, 1)]
    if names == ["x", "y", "z", "nx", "ny", "nz"]:
        return True
    if names in (["x", "y"], ["x", "y", "z"], ["x", "y", "z", "w"]) or names in numbered:
        return False
    raise InputError(
        f"{source}: line {line}: columns {shorten(','.join(names))}; expected x,y or x,y,z or x,y,z,nx,ny,nz or "
        "x1,...,xn: keep only these, or remove the line of names if every column is a coordinate"
    )


def read_npy(data: bytes, source: str) -> Content:
    """Points of n-space: one array [N, n] of real numbers."""
    points = _numbers(_read_array(io.BytesIO(data), source), "the array", source)
    _refuse_hidden_normals(points, source, "save points and normals in an .npz, or 6-D points as `points` in an .npz")
    _check_shape(points, source)
    return Content(points=points)


def read_npz(data: bytes, source: str) -> Content:
    """Arrays named as the fields of a shape: points, and normals, weights or faces [F, 3] if there are any."""
    arrays = _read_archive(data, source)
    unknown = sorted(set(arrays) - set(_FIELDS))
    if unknown or "points" not in arrays:
        raise InputError(
            f"{source}: holds arrays {', '.join(sorted(arrays)) or '(none)'}; expected points, and any of "
            f"{', '.join(_FIELDS[1:])}"
        )
    numbers = {name: _numbers(array, name, source) for name, array in arrays.items() if name != "faces"}
    _check_shape(numbers["points"], source)
    faces = _faces(arrays["faces"], source) if "faces" in arrays else None
    if faces is not None and "weights" in arrays:
        raise InputError(f"{source}: weights and faces; a mesh takes its weights from its faces: remove one of them")
    if faces is not None and numbers["points"].shape[1] != 3:
        raise InputError(f"{source}: faces over points {numbers['points'].shape}; faces need points [N, 3]")
    return Content(
        points=numbers["points"],
        normals=numbers.get("normals") if faces is None else None,
        weights=numbers.get("weights"),
        faces=faces,
    )


def _read_archive(data: bytes, source: str) -> dict[str, NDArray[Any]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception as error:  # noqa: BLE001 (zipfile leaks many types on damaged files; nothing else in the block)
        raise InputError(f"{source}: not a whole .npz archive: {shorten(str(error), 80)}") from None
    return {
        name.removesuffix(".npy"): _read_array(io.BytesIO(member), f"{source}: {name}")
        for name, member in members.items()
    }


def _read_array(stream: io.BytesIO, source: str) -> NDArray[Any]:
    try:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    except Exception as error:  # noqa: BLE001 (NumPy evaluates the header: many types; nothing else in the block)
        raise InputError(f"{source}: not a whole .npy array of numbers: {shorten(str(error), 80)}") from None
    rest = len(stream.read())
    if rest:
        raise InputError(f"{source}: {count(rest, 'byte')} behind the array of shape {array.shape}; save it again")
    return array


def _numbers(array: NDArray[Any], name: str, source: str) -> Array:
    if array.dtype.kind not in "iuf":
        raise InputError(f"{source}: {name} is of type {array.dtype}; expected real numbers, integer or floating")
    return as_float64(array)


def _faces(array: NDArray[Any], source: str) -> Polygons:
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InputError(f"{source}: faces have shape {array.shape} of {array.dtype}; expected [F, 3] integers, F >= 1")
    return Polygons(corners=array.ravel().astype(np.int64), counts=np.full(len(array), 3))


def _check_shape(table: Array, source: str) -> None:
    if table.ndim != 2 or table.shape[1] < 2:
        shape = f"shape {table.shape}" if table.ndim != 2 else f"{len(table)} rows of {count(table.shape[1], 'number')}"
        raise InputError(f"{source}: {shape}; expected one row [N, n] for each point, n >= 2 coordinates")


def _refuse_hidden_normals(table: Array, source: str, remedy: str) -> None:
    """Six columns are points of 6-space, unless the last three are always a unit vector: that is no accident."""
    if table.ndim == 2 and table.shape[1] == 6 and len(table) and _is_unit(table[:, 3:]).all():
        raise InputError(f"{source}: columns 4 to 6 are unit vectors in every row, normals or coordinates? {remedy}")


def _is_unit(vectors: Array) -> NDArray[np.bool_]:
    with np.errstate(over="ignore"):
        unit: NDArray[np.bool_] = np.abs(np.linalg.norm(vectors, axis=1) - 1.0) <= _UNIT
    return unit
