"""Object File Format: OFF, with colours (COFF) or normals (NOFF) of the vertices."""

import re

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, polygons
from symrefine.load.text import Line, numbered_lines, parse_integers, parse_table, shorten

# The counts may follow the keyword in its line; ModelNet forgets the space between them.
_KEYWORD = re.compile(r"(C|N)?OFF\b|(C|N)?OFF(?=[0-9])")
_COLUMNS = {"OFF": (3,), "COFF": (6, 7), "NOFF": (6,)}
_LAYOUT = {"OFF": "x y z", "COFF": "x y z and a colour of three or four numbers", "NOFF": "x y z nx ny nz"}


def read_off(data: bytes) -> Content:
    """Content of an OFF file; the colours of vertices, or those of faces where every face has one, are fields."""
    lines = numbered_lines(data, comment="#")
    kind, lines = _keyword(lines)
    vertices, faces = _counts(lines)
    body = lines[1:]
    if len(body) != vertices + faces:
        at = f", the last in line {body[-1][0]}" if body else ""
        raise InputError(
            f"line {lines[0][0]} declares {vertices} vertices and {faces} faces, which need "
            f"{vertices + faces} lines; {len(body)} follow{at}"
        )
    rows, rest = body[:vertices], body[vertices:]
    table = parse_table(rows, columns=_COLUMNS[kind], layout=f"a vertex {_LAYOUT[kind]}")
    return Content(
        points=table[:, :3],
        normals=table[:, 3:] if kind == "NOFF" and not faces else None,
        faces=polygons([_face(line) for line in rest]) if faces else None,
        point_fields={"color": table[:, 3:6]} if kind == "COFF" else {},
        face_fields=_face_colours(rest),
        point_lines=[number for number, _ in rows],
        face_lines=[number for number, _ in rest],
    )


def _keyword(lines: list[Line]) -> tuple[str, list[Line]]:
    """Kind of file, and the lines from the counts on."""
    number, text = lines[0] if lines else (1, "")
    match = _KEYWORD.match(text)
    if match is None:
        raise InputError(f"line {number}: {shorten(text)}; an OFF file begins with OFF, COFF or NOFF")
    counts = text[match.end() :].strip()
    return match.group(), [(number, counts), *lines[1:]] if counts else lines[1:]


def _counts(lines: list[Line]) -> tuple[int, int]:
    expected = "the numbers of vertices, faces and edges"
    if not lines:
        raise InputError(f"ends before {expected}")
    values = parse_integers(lines[0], expected)
    if len(values) not in (2, 3) or min(values) < 0:
        raise InputError(f"line {lines[0][0]}: {shorten(lines[0][1])}; expected {expected}")
    return values[0], values[1]


def _face(line: Line) -> list[int]:
    """Corners of a face: their number, their indices, and a colour of up to four numbers."""
    number, text = line
    fields = text.split()
    expected = "the number of corners and as many vertex indices"
    (size,) = parse_integers((number, fields[0]), expected)
    if size < 0 or not size + 1 <= len(fields) <= size + 5:
        raise InputError(f"line {number}: {shorten(text)}; expected {expected}")
    return parse_integers((number, " ".join(fields[1 : size + 1])), expected)


def _face_colours(lines: list[Line]) -> dict[str, Array]:
    """Colours [F, 3] behind the corners, if every face has three or four numbers there."""
    behind = [text.split()[int(text.split()[0]) + 1 :] for _, text in lines]
    if not behind or not all(len(fields) in (3, 4) for fields in behind):
        return {}
    rows = [(number, " ".join(fields[:3])) for (number, _), fields in zip(lines, behind, strict=True)]
    return {"color": parse_table(rows, columns=(3,), layout="a colour of three or four numbers")}
