"""Models as files: meshes and clouds written anew, and files whose coordinates alone are changed.

`moved` keeps everything of a PLY or OBJ file that is not a position or a normal: colours, texture coordinates,
materials, polygons, comments, the order of everything. `model_bytes` writes what a shape holds.
"""

import io
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError, about
from symrefine.geometry import Array
from symrefine.load.elements import symbol
from symrefine.load.ply_header import Element, Header, parse_header
from symrefine.shape import Shape

_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")


def check_suffix(path: Path, shape: Shape | None = None) -> None:
    """Refuse a name whose format is unknown, or cannot hold the shape.

    Raises:
        InputError: with the formats that can.
    """
    with about(str(path)):
        suffix = path.suffix.lower()
        if suffix not in MODELS:
            raise InputError(f"cannot write {suffix or 'a file without suffix'}; known are {' '.join(MODELS)}")
        if shape is not None:
            _check_format(suffix, shape)


def _check_format(suffix: str, shape: Shape) -> None:
    if shape.faces is not None and suffix in _CLOUDS:
        raise InputError(f"{suffix} holds no faces; write a mesh as {_but(_CLOUDS)}")
    if shape.faces is None and suffix == ".stl":
        raise InputError(f".stl holds nothing but faces; write a cloud as {_but(['.stl'])}")
    if shape.weights is not None and shape.faces is None and suffix != ".npz":
        raise InputError(f"{suffix} holds no weights, which {shape.source} has; write .npz")
    if shape.normals is not None and suffix in _BARE:
        raise InputError(f"{suffix} holds no normals, which {shape.source} has; write {_but(_BARE)}")


def _but(left_out: Collection[str]) -> str:
    """The formats that remain, as a list to choose from."""
    *first, last = (suffix for suffix in MODELS if suffix not in left_out)
    return f"{', '.join(first)} or {last}"


def model_bytes(suffix: str, shape: Shape) -> bytes:
    """A mesh or cloud in the format of a suffix, one of `MODELS`, coordinates in full precision.

    Raises:
        InputError: the format cannot hold the shape.
    """
    _check_format(suffix, shape)
    return _WRITERS[suffix](shape)


def keeps_labels(suffix: str, shape: Shape) -> bool:
    """Whether a format has what the labels of a shape tell apart, if it has any: elements in a table of atoms."""
    return shape.labels is None or (suffix == ".xyz" and shape.elements)


def moved(data: bytes, suffix: str, matrix: Array) -> bytes | None:
    """A PLY or OBJ file with its positions moved by `matrix` [4, 4] and its normals turned, all else as it was.

    Returns:
        None for another format, or for a file whose vertices cannot be reached row by row.
    """
    if suffix == ".obj":
        return None if b"\\\n" in data or b"\\\r" in data else _moved_obj(data, matrix)
    return _moved_ply(data, matrix) if suffix == ".ply" else None


def _directions(matrix: Array) -> Array:
    """The rotation alone of a rotation with a scale."""
    return np.asarray(matrix[:3, :3] / np.cbrt(np.linalg.det(matrix[:3, :3])))


def _moved_obj(data: bytes, matrix: Array) -> bytes:
    turn = _directions(matrix)
    lines = data.split(b"\n")
    for k, line in enumerate(lines):
        words = line.split()
        if len(words) < 4 or words[0] not in (b"v", b"vn") or b"#" in line:
            continue
        given = np.array([float(word) for word in words[1:4]])
        new = matrix[:3, :3] @ given + matrix[:3, 3] if words[0] == b"v" else turn @ given
        ending = b"\r" if line.endswith(b"\r") else b""
        lines[k] = b" ".join([words[0], *(repr(float(v)).encode() for v in new), *words[4:]]) + ending
    return b"\n".join(lines)


def _moved_ply(data: bytes, matrix: Array) -> bytes | None:
    header = parse_header(data)
    vertex = header.elements[0] if header.elements else Element(name="", count=0)
    whole = [p.name for p in vertex.properties if p.name in (*_POSITION, *_NORMAL) and not p.type.startswith("f")]
    if vertex.name != "vertex" or vertex.has_lists or whole:
        return None
    return (_moved_ply_binary if header.byte_order else _moved_ply_text)(data, header, vertex, matrix)


def _moved_ply_binary(data: bytes, header: Header, vertex: Element, matrix: Array) -> bytes:
    rows = np.dtype([(p.name, header.byte_order + p.type) for p in vertex.properties])
    table = np.frombuffer(data, rows, count=vertex.count, offset=header.size).copy()
    for name, column in _moved_columns({p.name: table[p.name] for p in vertex.properties}, matrix).items():
        table[name] = column
    return data[: header.size] + table.tobytes() + data[header.size + table.nbytes :]


def _moved_ply_text(data: bytes, header: Header, vertex: Element, matrix: Array) -> bytes | None:
    lines = data[header.size :].splitlines(keepends=True)
    rows = lines[: vertex.count]
    table = [row.split() for row in rows]
    if any(len(row) != len(vertex.properties) for row in table):
        return None  # blank lines between rows
    places = {p.name: (k, p.type == "f4") for k, p in enumerate(vertex.properties) if p.name in (*_POSITION, *_NORMAL)}
    given = {name: np.array([float(row[k]) for row in table]) for name, (k, _) in places.items()}
    for name, column in _moved_columns(given, matrix).items():
        k, short = places[name]
        for row, value in zip(table, column.tolist(), strict=True):
            row[k] = (f"{value:.9g}" if short else repr(value)).encode()
    ends = [row[len(row.rstrip(b"\r\n")) :] for row in rows]
    return data[: header.size] + b"".join(
        [b" ".join(r) + e for r, e in zip(table, ends, strict=True)] + lines[len(rows) :]
    )


def _moved_columns(columns: Mapping[str, Array], matrix: Array) -> dict[str, Array]:
    """The columns [N] of positions moved and those of normals turned, of such as are there."""
    new: dict[str, Array] = {}
    for names, turn, shift in ((_POSITION, matrix[:3, :3], matrix[:3, 3]), (_NORMAL, _directions(matrix), np.zeros(3))):
        if set(names) <= set(columns):
            values = np.stack([columns[name] for name in names], axis=1).astype(np.float64)
            new |= dict(zip(names, (values @ turn.T + shift).T, strict=True))
    return new


def _table(shape: Shape) -> Array:
    """[N, 3] points, or [N, 6] with their normals."""
    return shape.points if shape.normals is None else np.column_stack([shape.points, shape.normals])


def _ply(shape: Shape) -> bytes:
    table = np.ascontiguousarray(_table(shape), dtype="<f8")
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    head += [f"property double {name}" for name in (*_POSITION, *_NORMAL)[: table.shape[1]]]
    body = table.tobytes()
    if shape.faces is not None:
        head += [f"element face {len(shape.faces)}", "property list uchar int vertex_indices"]
        faces = np.zeros(len(shape.faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
        faces["count"], faces["corners"] = 3, shape.faces
        body += faces.tobytes()
    return "\n".join([*head, "end_header", ""]).encode("ascii") + body


def _rows(values: Array, before: str = "") -> list[str]:
    return [before + " ".join(map(repr, row)) for row in values.tolist()]


def _obj(shape: Shape) -> bytes:
    lines = _rows(shape.points, "v ")
    lines += [] if shape.normals is None else _rows(shape.normals, "vn ")
    lines += [] if shape.faces is None else [f"f {a} {b} {c}" for a, b, c in (shape.faces + 1).tolist()]
    return "\n".join([*lines, ""]).encode("ascii")


def _off(shape: Shape) -> bytes:
    faces = [] if shape.faces is None else [f"3 {a} {b} {c}" for a, b, c in shape.faces.tolist()]
    lines = ["OFF", f"{len(shape.points)} {len(faces)} 0", *_rows(shape.points), *faces]
    return "\n".join([*lines, ""]).encode("ascii")


def _xyz(shape: Shape) -> bytes:
    if shape.elements and shape.labels is not None:
        atoms = [f"{symbol(k)} {row}" for k, row in zip(shape.labels.tolist(), _rows(shape.points), strict=True)]
        return "\n".join([str(len(atoms)), "", *atoms, ""]).encode("ascii")
    return _txt(shape)


def _txt(shape: Shape) -> bytes:
    return "\n".join([*_rows(_table(shape)), ""]).encode("ascii")


def _csv(shape: Shape) -> bytes:
    table = _table(shape)
    names = ",".join((*_POSITION, *_NORMAL)[: table.shape[1]])
    return "\n".join([names, *(",".join(map(repr, row)) for row in table.tolist()), ""]).encode("ascii")


def _pcd(shape: Shape) -> bytes:
    table = np.ascontiguousarray(_table(shape), dtype="<f8")
    count, width = table.shape
    names = (*_POSITION, *(f"normal_{axis}" for axis in _POSITION))[:width]
    head = ["# .PCD v0.7", "VERSION 0.7", f"FIELDS {' '.join(names)}", f"SIZE{width * ' 8'}", f"TYPE{width * ' F'}"]
    head += [f"COUNT{width * ' 1'}", f"WIDTH {count}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {count}"]
    return "\n".join([*head, "DATA binary", ""]).encode("ascii") + table.tobytes()


def _stl(shape: Shape) -> bytes:
    """Text, as the binary kind rounds to single precision."""
    assert shape.faces is not None
    corners = shape.points[shape.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
    lines = ["solid symrefine"]
    for normal, triangle in zip(_rows(normals, "facet normal "), corners, strict=True):
        lines += [normal, "outer loop", *_rows(triangle, "vertex "), "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid symrefine", ""]).encode("ascii")


def _npy(shape: Shape) -> bytes:
    stream = io.BytesIO()
    np.save(stream, shape.points)
    return stream.getvalue()


def _npz(shape: Shape) -> bytes:
    arrays = {"points": shape.points, "normals": shape.normals, "faces": shape.faces}
    arrays |= {"weights": shape.weights} if shape.faces is None else {}
    return npz_bytes(**{name: array for name, array in arrays.items() if array is not None})


def npz_bytes(**arrays: NDArray[Any]) -> bytes:
    """A .npz file of arrays by name."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def marked_bytes(suffix: str, points: Array, inferred: NDArray[np.bool_]) -> bytes:
    """Points [N, 3] with a mark for those that nobody saw, as .npz or else .ply."""
    if suffix == ".npz":
        return npz_bytes(points=points, inferred=inferred)
    table = np.zeros(len(points), dtype=[("place", "<f8", (3,)), ("inferred", "u1")])
    table["place"], table["inferred"] = points, inferred
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    head += [*(f"property double {name}" for name in _POSITION), "property uchar inferred", "end_header", ""]
    return "\n".join(head).encode("ascii") + table.tobytes()


_WRITERS: dict[str, Callable[[Shape], bytes]] = {
    ".csv": _csv,
    ".npy": _npy,
    ".npz": _npz,
    ".obj": _obj,
    ".off": _off,
    ".pcd": _pcd,
    ".ply": _ply,
    ".stl": _stl,
    ".txt": _txt,
    ".xyz": _xyz,
}
# Formats of models, those that hold no faces, those that hold no normals, and those that mark what is inferred.
MODELS = tuple(_WRITERS)
_CLOUDS = (".csv", ".npy", ".pcd", ".txt", ".xyz")
_BARE = (".npy", ".off", ".stl", ".txt")
MARKED = (".npz", ".ply")
