"""The one kind of `.vtk` file that the fetched models use: a polygonal surface in VTK's legacy text format."""

import re

from symrefine.errors import InputError


def vtk_to_off(data: bytes, source: str) -> bytes:
    """A polygonal surface in VTK's legacy text format as OFF, the numbers as they are written.

    Raises:
        InputError: binary, another kind of data set, or not as long as it says.
    """
    head, _, rest = data.partition(b"POINTS ")
    if not head.startswith(b"# vtk DataFile") or head.split()[-3:] != [b"ASCII", b"DATASET", b"POLYDATA"]:
        raise InputError(f"{source}: expected '# vtk DataFile', ASCII, DATASET POLYDATA and POINTS, in this order")
    body = re.split(rb"\n(?:CELL_DATA|POINT_DATA) ", rest, maxsplit=1)[0]
    points, _, polygons = body.partition(b"POLYGONS ")
    try:
        (count, _, *coordinates), (faces, size, *indices) = points.split(), polygons.split()
        [float(word) for word in coordinates]
        whole = len(coordinates) == 3 * int(count) and len(indices) == int(size)
        rows = _runs([int(word) for word in indices])
    except ValueError:
        raise InputError(f"{source}: expected numbers after POINTS and POLYGONS, and nothing else") from None
    if not whole or len(rows) != int(faces):
        raise InputError(f"{source}: not as many coordinates and polygons as POINTS and POLYGONS declare")
    lines = [b" ".join(coordinates[k : k + 3]) for k in range(0, len(coordinates), 3)]
    lines += [" ".join(map(str, row)).encode("ascii") for row in rows]
    return b"\n".join([b"OFF", b"%d %d 0" % (int(count), len(rows)), *lines, b""])


def _runs(numbers: list[int]) -> list[list[int]]:
    """Rows that each begin with the number of entries that follow, that number included."""
    rows, at = [], 0
    while at < len(numbers):
        row = numbers[at : at + 1 + numbers[at]]
        if len(row) != 1 + numbers[at] or numbers[at] < 3:
            raise ValueError("a polygon is cut short")
        rows.append(row)
        at += len(row)
    return rows
