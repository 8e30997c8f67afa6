"""Files that are too large to hold, read in chunks: clouds in .npy, binary .ply, .las and .laz.

Coordinates alone are read: of so many points normals are fitted, and nothing tells them apart. The header must agree
with the size of the file before anything is read.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from symrefine.errors import InputError, about
from symrefine.files import path_of
from symrefine.geometry import Array
from symrefine.load.extras import library
from symrefine.load.packed import suffix_of
from symrefine.load.ply_body import Values, row_type
from symrefine.load.ply_header import parse_header
from symrefine.load.scans import check_room, las_fault
from symrefine.load.text import count, shorten
from symrefine.stream import CHUNK, Stream

# Points beyond which a file is read in chunks without being asked to: there memory is what ends first.
STREAMED = 1_000_000
# Bytes of the least such file, six to a point; what is smaller is not opened to count them.
_LEAST = 6 * STREAMED
# Headers are shorter.
_HEADER = 2**16

_Chunks = Callable[[], Iterator[Array]]


def stream(path: str | PathLike[str]) -> Stream:
    """The cloud in a file, to be read in chunks as often as it takes.

    Args:
        path: an .npy of an array [N, 3], a binary .ply of vertices alone, a .las or a .laz.

    Raises:
        InputError: another format, or a file of one that is no such cloud; missing, cut off, or with more in it than
            its header says; numbers that are not finite, while it is read; a library that is not installed.
    """
    found = _stream(path_of(path))
    if found is None:
        raise InputError(
            f"{path}: cannot be read in chunks; expected an .npy of numbers [N, 3], a binary .ply of vertices without "
            "faces, a .las or a .laz"
        )
    return found


def stream_if_large(path: str | PathLike[str]) -> Stream | None:
    """A stream of a cloud that is too large to hold; None of any other, for which there is `load`.

    Raises:
        InputError: what `stream` refuses of such a cloud.
    """
    file = Path(path)
    try:
        large = file.suffix.lower() in _READERS and file.stat().st_size >= _LEAST
    except (OSError, ValueError):
        return None
    found = _stream(file) if large else None
    return found if found is not None and found.count > STREAMED else None


def _stream(file: Path) -> Stream | None:
    reader = _READERS.get(suffix_of(file)) if file.suffix.lower() == suffix_of(file) else None
    if reader is None:
        return None
    with about(str(file)):
        try:
            found = reader(file)
        except FileNotFoundError:
            raise InputError("no such file") from None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}") from None
    return None if found is None else Stream(count=found[0], read=_named(found[1], str(file)), source=str(file))


def _named(read: _Chunks, source: str) -> _Chunks:
    """Chunks whose faults are told with the file."""

    def chunks() -> Iterator[Array]:
        with about(source):
            yield from read()

    return chunks


def _npy(file: Path) -> tuple[int, _Chunks] | None:
    try:
        points = np.load(file, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # noqa: BLE001 (NumPy evaluates the header: many types; nothing else in the block)
        raise InputError(f"not a whole .npy array of numbers: {shorten(str(error), 80)}") from None
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
        return None
    more = file.stat().st_size - points.offset - points.nbytes
    if more:
        raise InputError(f"{count(more, 'byte')} behind the array of shape {points.shape}; save it again")
    if not points.flags.c_contiguous:
        return len(points), lambda: Stream.of(points).read()
    row = np.dtype((points.dtype, (3,)))
    return len(points), lambda: _rows(file, row, len(points), points.offset)


def _ply(file: Path) -> tuple[int, _Chunks] | None:
    with file.open("rb") as opened:
        head = opened.read(_HEADER)
    header = parse_header(head)
    vertex = next((e for e in header.elements if e.name == "vertex"), None)
    alone = all(e is vertex or not e.count for e in header.elements)
    if not header.byte_order or vertex is None or not alone or vertex.has_lists:
        return None
    if not {"x", "y", "z"} <= {p.name for p in vertex.properties}:
        return None
    row = row_type(vertex, header.byte_order, [])
    room = file.stat().st_size - header.size
    if room != vertex.count * row.itemsize:
        raise InputError(
            f"the header declares {count(vertex.count, 'vertex row')} of {row.itemsize} bytes, "
            f"{vertex.count * row.itemsize} in all; {room} are there"
        )
    return vertex.count, lambda: (_xyz(rows) for rows in _rows(file, row, vertex.count, header.size))


def _rows(file: Path, row: np.dtype[Any], rows: int, offset: int) -> Iterator[Values]:
    """Rows of a table one chunk after the other: read, as what is mapped stays in memory until that is short."""
    with file.open("rb") as opened:
        opened.seek(offset)
        for start in range(0, rows, CHUNK):
            yield np.fromfile(opened, row, min(CHUNK, rows - start))


def _xyz(rows: Values) -> Array:
    return np.stack([rows[name].astype(np.float64) for name in "xyz"], axis=1)


def _las(file: Path) -> tuple[int, _Chunks] | None:
    laspy = library("laspy", "scan")
    library("lazrs", "scan")
    with _las_opened(laspy, file) as reader:
        check_room(reader.header, file.stat().st_size)
        points = int(reader.header.point_count)

    def chunks() -> Iterator[Array]:
        with _las_opened(laspy, file) as reader:
            while True:
                try:
                    some = reader.read_points(CHUNK)
                    xyz = np.column_stack([some.x, some.y, some.z]).astype(np.float64)
                except BaseException as error:  # noqa: BLE001 (raised again, as one of ours where it is no other)
                    raise las_fault(error) from None
                if not len(xyz):
                    return
                yield xyz

    return points, chunks


@contextmanager
def _las_opened(laspy: Any, file: Path) -> Iterator[Any]:
    # laspy leaves a file open that it refuses.
    with file.open("rb") as stream:
        try:
            reader = laspy.open(stream, laz_backend=laspy.LazBackend.Lazrs, closefd=False)
        except OSError:
            raise
        except BaseException as error:  # noqa: BLE001 (raised again, as one of ours where it is no other)
            raise las_fault(error) from None
        with reader:
            yield reader


_READERS = {".npy": _npy, ".ply": _ply, ".las": _las, ".laz": _las}
