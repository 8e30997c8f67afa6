"""Stereolithography files, binary and text: triangles one by one, each with its own three vertices."""

import re

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons, as_float64
from symrefine.load.text import Line, numbered_lines, parse_table, shorten

_HEADER = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET = ("facet normal", "outer loop", "vertex", "vertex", "vertex", "endloop", "endfacet")
# Numbers follow the first two kinds of line, nothing the others.
_PATTERN = [
    re.compile(r"\s+".join(phrase.split()) + (r"\b" if phrase in ("facet normal", "vertex") else "$"), re.IGNORECASE)
    for phrase in _FACET
]
_BRACKET = {False: re.compile(r"solid\b", re.IGNORECASE), True: re.compile(r"endsolid\b", re.IGNORECASE)}


def read_stl(data: bytes) -> Content:
    """Content of an STL file; normals of facets repeat what the vertices say.

    Many binary files begin with `solid` like text files do, so the size decides.
    """
    declared = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else None
    if declared is not None and len(data) == _HEADER + declared * _RECORD.itemsize:
        records = np.frombuffer(data, _RECORD, offset=_HEADER)
        return _content(as_float64(records["vertices"].reshape(-1, 3)), None)
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        lines = _vertex_lines(numbered_lines(data))
        table = parse_table(lines, columns=(3,), layout="vertex x y z")
        return _content(table, [number for number, _ in lines])
    if declared is None:
        raise InputError(f"not an STL file: neither 'solid' nor a header of {_HEADER} bytes")
    raise InputError(
        f"not a whole STL file: does not begin with 'solid', and as a binary file would hold {declared} "
        f"triangles in {_HEADER + declared * _RECORD.itemsize} bytes; it has {len(data)}"
    )


def _content(points: Array, lines: list[int] | None) -> Content:
    if len(points) == 0:
        return Content(points=points)
    faces = Polygons.alike(np.arange(len(points), dtype=np.int64).reshape(-1, 3))
    return Content(
        points=points, faces=faces, point_lines=lines, face_lines=None if lines is None else lines[::3], split=True
    )


def _vertex_lines(lines: list[Line]) -> list[Line]:
    """Coordinates of all vertices in order; every line must be the one the grammar asks for.

    file := (solid facet* endsolid)+
    """
    vertices: list[Line] = []
    position = 0  # in _FACET, of the line that comes next within a solid
    inside = False
    for number, text in lines:
        if position == 0 and _BRACKET[inside].match(text):
            inside = not inside
            continue
        match = _PATTERN[position].match(text) if inside else None
        if match is None:
            choice = _expected(position) if inside else "solid"
            raise InputError(f"line {number}: {shorten(text)}; expected {choice}")
        if _FACET[position] == "vertex":
            vertices.append((number, text[match.end() :]))
        position = (position + 1) % len(_FACET)
    if inside:
        raise InputError(f"ends after line {lines[-1][0]}, where {_expected(position)} should follow")
    return vertices


def _expected(position: int) -> str:
    return _FACET[position] if position else "facet normal or endsolid"
