"""Polygon files (PLY), text and binary in either byte order."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Paint, Polygons, Values, are_whole, as_float64
from symrefine.load.paint import read_images
from symrefine.load.ply_body import Rows, read_rows
from symrefine.load.ply_header import Element, Header, parse_header

_COORDINATES = ("x", "y", "z")
_NORMAL = ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_COLOUR = ("red", "green", "blue")
_TEXTURE = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_PLACE = frozenset({*_COORDINATES, *_NORMAL})


def read_ply(data: bytes, path: Path | None) -> Content:
    """Content of a PLY file; edges and camera data are not part of a shape.

    Fields are the properties of vertices and faces that are no coordinates, normals or lists, and `color` for red,
    green and blue.

    Args:
        data: of the file.
        path: of the file, if its texture is wanted: the images that `comment TextureFile` names lie beside it.
    """
    header = parse_header(data)
    elements = {element.name: element for element in header.elements}
    vertex = elements.get("vertex", Element(name="vertex", count=0))
    _check_elements(elements, vertex)
    face = elements.get("face")
    corners = _corner_property(face) if face is not None and face.count else ""
    rows = read_rows(data, header)
    vertices = rows["vertex"]
    content = Content(
        points=_stack(vertices, _COORDINATES),
        normals=_stack(vertices, _NORMAL) if not corners and set(_NORMAL) <= _scalars(vertex) else None,
        faces=_polygons(rows["face"], corners) if corners else None,
        point_fields=_fields(vertex, vertices),
        face_fields=_fields(face, rows["face"]) if face is not None and corners else {},
        point_lines=vertices.lines,
        face_lines=rows["face"].lines if corners else None,
    )
    if path is None or content.faces is None:
        return content
    return replace(content, paint=_paint(header, vertices, rows["face"], content.faces, path.parent))


def _paint(header: Header, vertices: Rows, faces: Rows, polygons: Polygons, folder: Path) -> Paint:
    """What the faces show, as MeshLab writes it: an image for each number, coordinates of corners or of vertices.

    Raises:
        InputError: no image, no coordinates, or numbers of images that are not there.
    """
    named = [comment.split(maxsplit=1)[1:] for comment in header.comments if comment.startswith("TextureFile")]
    names = [word.strip() for words in named for word in words]
    if not names:
        raise InputError("has no texture: the header has no line 'comment TextureFile NAME'")
    number = faces.columns["texnumber"].values.astype(np.int64) if "texnumber" in faces.columns else None
    image = np.zeros(len(polygons), dtype=np.int64) if number is None else number
    if len(image) and not 0 <= int(image.min()) <= int(image.max()) < len(names):
        raise InputError(f"texnumber from {image.min()} to {image.max()}; there are {len(names)} images, from 0")
    uv = _coordinates(vertices, faces, polygons)
    plain = np.full((len(polygons), 3), 255.0)
    return Paint(images=read_images([folder / name for name in names]), uv=uv, image=image, plain=plain)


def _coordinates(vertices: Rows, faces: Rows, polygons: Polygons) -> Array:
    """Texture coordinates [sum of counts, 2] of the corners of the faces."""
    if "texcoord" in faces.columns:
        column = faces.columns["texcoord"]
        if column.counts is None or (column.counts != 2 * polygons.counts).any():
            raise InputError("texcoord of faces is no list of two numbers for each corner")
        uv = as_float64(column.values).reshape(-1, 2)
    else:
        pair = next((pair for pair in _TEXTURE if set(pair) <= set(vertices.columns)), None)
        if pair is None:
            told = " or ".join(" ".join(pair) for pair in _TEXTURE)
            raise InputError(
                f"has an image and no texture coordinates; expected {told} of vertices, or texcoord of faces"
            )
        uv = _stack(vertices, pair)[polygons.corners]
    if not np.isfinite(uv).all():
        raise InputError("texture coordinates are not finite")
    return uv


def _check_elements(elements: dict[str, Element], vertex: Element) -> None:
    missing = [name for name in _COORDINATES if name not in _scalars(vertex)]
    if missing:
        raise InputError(
            f"the header declares no {' '.join(missing)} of element 'vertex' (elements: "
            f"{', '.join(elements) or 'none'}); a PLY file needs vertices with x, y and z"
        )
    counts = {name: element.count for name, element in elements.items()}
    if counts.get("tristrips"):
        raise InputError("holds triangle strips, which are not supported; save it with an element 'face'")
    if counts.get("edge") and not counts.get("face"):
        raise InputError("holds edges but no faces; expected faces, or vertices alone")


def _scalars(element: Element) -> set[str]:
    return {p.name for p in element.properties if not p.length_type}


def _corner_property(face: Element) -> str:
    for p in face.properties:
        if p.name in _CORNERS and p.length_type:
            return p.name
    names = ", ".join(p.name for p in face.properties)
    raise InputError(f"element 'face' has properties {names}; expected a list {' or '.join(_CORNERS)}")


def _fields(element: Element, rows: Rows) -> dict[str, Values]:
    """What the rows of an element hold beside places and lists, whole numbers as such where the header says so."""
    # Text is read as floating-point numbers, whatever the header says.
    columns = {p.name: _typed(rows.columns[p.name].values, p.type) for p in element.properties if not p.length_type}
    fields = {name: values for name, values in columns.items() if name not in _PLACE}
    if set(_COLOUR) <= set(fields):
        colour = np.stack([fields[name] for name in _COLOUR], axis=1)
        fields = {name: values for name, values in fields.items() if name not in (*_COLOUR, "alpha")}
        fields["color"] = colour
    return fields


def _typed(values: Values, type_: str) -> Values:
    if values.dtype.kind != "f" or type_[0] not in "iu":
        return values
    return values.astype(np.int64) if are_whole(values).all() else values


def _stack(rows: Rows, names: tuple[str, ...]) -> Array:
    return np.stack([as_float64(rows.columns[name].values) for name in names], axis=1)


def _polygons(rows: Rows, name: str) -> Polygons:
    column = rows.columns[name]
    counts = column.counts if column.counts is not None else np.empty(0, dtype=np.int64)
    corners = column.values
    # Text, and some binary files, give indices as floating-point numbers.
    if corners.dtype.kind == "f" and (bad := np.flatnonzero(~are_whole(corners))).size:
        row = int(np.searchsorted(np.cumsum(counts), bad[0], side="right"))
        at = f" (line {rows.lines[row]})" if rows.lines else ""
        raise InputError(f"face {row}{at} refers to vertex {corners[bad[0]]}; expected whole numbers")
    return Polygons(corners=corners.astype(np.int64), counts=counts)
