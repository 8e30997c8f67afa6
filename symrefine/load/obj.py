"""Wavefront OBJ: the polygonal part of the format, one statement a line."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, polygons
from symrefine.load.paint import Material, painted, read_materials
from symrefine.load.text import Line, count, numbered_lines, parse_table, shorten

# Looks, names and smoothing: nothing of the shape.
_IGNORED = frozenset("vt o g s usemap mtllib lod".split())
# Corners of a face, each a vertex, vertex/texture, vertex//normal or vertex/texture/normal.
_CORNERS = re.compile(r"(\s+[+-]?[0-9]{1,18}(/[+-]?[0-9]*){0,2})+")


def read_obj(data: bytes, path: Path | None) -> Content:
    """Content of an OBJ file.

    Fields are `color`, behind the coordinates of the points, and `material`, the name after `usemtl` for each face.

    Args:
        data: of the file.
        path: of the file, if its textures are wanted: materials and images are found beside it.
    """
    vertices: list[Line] = []
    normals: list[Line] = []
    faces: list[tuple[int, list[int]]] = []
    materials: list[str] = []
    material = ""
    other: dict[str, int] = {}
    for number, text in _statements(numbered_lines(data, comment="#")):
        keyword, _, rest = text.replace("\t", " ").partition(" ")
        if keyword == "v":
            vertices.append((number, rest))
        elif keyword == "vn":
            normals.append((number, rest))
        elif keyword == "f":
            faces.append((number, _face((number, rest), len(vertices))))
            materials.append(material)
        elif keyword == "usemtl":
            material = rest.strip()
        elif keyword in ("l", "p"):
            other.setdefault(keyword, number)
        elif keyword not in _IGNORED:
            raise InputError(
                f"line {number}: {shorten(keyword)} is no statement of a polygonal OBJ file; expected "
                f"v vn f l p usemtl {' '.join(sorted(_IGNORED))}"
            )
    if not faces and "l" in other:
        raise InputError(f"line {other['l']}: lines but no faces; expected faces, or vertices alone")
    table = _vertices(vertices)
    of_points = normals if not faces else []  # those of a cloud belong to the points in their order
    if of_points and len(normals) != len(vertices):
        told = count(len(normals), "normal")
        raise InputError(f"{told} (vn) for {len(vertices)} points (v); expected as many")
    content = Content(
        points=table[:, :3],
        normals=parse_table(of_points, columns=(3,), layout="vn x y z") if of_points else None,
        faces=polygons(corners for _, corners in faces) if faces else None,
        point_fields={"color": table[:, 3:]} if table.shape[1] == 6 else {},
        face_fields={"material": np.array(materials)} if any(materials) else {},
        point_lines=[number for number, _ in vertices],
        face_lines=[number for number, _ in faces],
        first_index=1,
    )
    return content if path is None else _painted(content, materials, data, path.parent)


def _painted(content: Content, materials: list[str], data: bytes, folder: Path) -> Content:
    """The content with what its faces show, whose materials are named; files of materials lie in a folder."""
    if content.faces is None:
        return content
    places: list[Line] = []
    shown: list[int] = []
    known: dict[str, Material] = {}
    for number, text in _statements(numbered_lines(data, comment="#")):
        keyword, _, rest = text.replace("\t", " ").partition(" ")
        if keyword == "vt":
            places.append((number, rest))
        elif keyword == "mtllib":
            known |= read_materials(folder / rest.strip())
        elif keyword == "f":
            shown += _shown((number, rest), len(places))
    uv = np.append(_places(places), [[np.nan, np.nan]], axis=0)[shown]
    return replace(content, paint=painted(materials, known, uv, content.faces))


def _places(lines: list[Line]) -> Array:
    """Texture coordinates [M, 2]; the third of a solid texture says nothing of an image."""
    if not lines:
        return np.empty((0, 2))
    return parse_table(lines, columns=(2, 3), layout="vt u v")[:, :2]


def _shown(line: Line, places: int) -> list[int]:
    """Texture coordinates of the corners of a face, counted from 0; -1 for a corner without."""
    number, text = line
    found = []
    for field in text.split():
        index = int((field.split("/") + [""])[1] or 0)
        if index > places or index < -places:
            raise InputError(f"line {number}: a corner refers to texture coordinates {index}; there are {places} here")
        found.append(index - 1 if index > 0 else places + index if index < 0 else -1)
    return found


def _statements(lines: Iterable[Line]) -> Iterator[Line]:
    """Lines, joined where they end in a backslash; the first gives the number."""
    begun, held = 0, ""
    for number, text in lines:
        begun = begun if held else number
        if text.endswith("\\"):
            held += text[:-1] + " "
            continue
        yield begun, held + text
        held = ""
    if held:
        yield begun, held


def _vertices(lines: list[Line]) -> Array:
    """[N, 3], or [N, 6] with a colour."""
    table = parse_table(
        lines, columns=(3, 4, 6), layout="v x y z, a weight of 1 or a colour of three numbers behind it"
    )
    if table.shape[1] == 4 and (bad := np.flatnonzero(table[:, 3] != 1.0)).size:
        raise InputError(f"line {lines[bad[0]][0]}: weight {table[bad[0], 3]} of a rational vertex; expected 1 or none")
    return table if table.shape[1] == 6 else table[:, :3]


def _face(line: Line, vertices: int) -> list[int]:
    """Corners of a face, counted from 0; negative numbers in the file count back from the latest vertex."""
    number, text = line
    fields = text.split()
    if not _CORNERS.fullmatch(" " + text):
        field = next((field for field in fields if not _CORNERS.fullmatch(" " + field)), "")
        raise InputError(f"line {number}: {shorten(field)} is no corner; expected v, v/vt or v/vt/vn")
    corners = [int(field.partition("/")[0]) for field in fields]
    if min(corners) > 0:
        return [index - 1 for index in corners]
    bad = next((index for index in corners if index == 0 or index < -vertices), None)
    if bad is not None:
        raise InputError(
            f"line {number}: a face refers to vertex {bad}; vertices count from 1, or back from -1 to -{vertices} here"
        )
    return [index - 1 if index > 0 else vertices + index for index in corners]
