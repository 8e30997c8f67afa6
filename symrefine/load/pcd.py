"""Point clouds of the Point Cloud Library (PCD 0.7), in its three encodings."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, as_float64
from symrefine.load.open3d import open3d
from symrefine.load.packed import allowance, on_disk
from symrefine.load.text import NATURAL, count, numbered_lines, parse_table, shorten

_KEYS = frozenset("VERSION FIELDS SIZE TYPE COUNT WIDTH HEIGHT VIEWPOINT POINTS DATA".split())
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_TYPES = frozenset({"F4", "F8", "I1", "I2", "I4", "I8", "U1", "U2", "U4", "U8"})
_COORDINATES = ("x", "y", "z")
_NORMAL = ("normal_x", "normal_y", "normal_z")
_NOT_FIELDS = frozenset({*_COORDINATES, *_NORMAL, "_", "rgb", "rgba"})


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    """Fields with their NumPy types and numbers of values, points, encoding; where the data begin.

    An `organised` cloud has a point for every pixel of its sensor.
    """

    names: list[str]
    types: list[str]
    counts: list[int]
    points: int
    organised: bool
    encoding: str
    size: int
    lines: int
    viewpoint: Array | None

    @property
    def record(self) -> np.dtype[np.void]:
        """One point as the binary encoding stores it."""
        # Names need not be unique ("_" pads); positions are.
        return np.dtype(
            [(str(k), "<" + t.lower(), (c,)) for k, (t, c) in enumerate(zip(self.types, self.counts, strict=True))]
        )


def read_pcd(data: bytes, path: Path) -> Content:
    """Content of a PCD file; the viewpoint is where the sensor stood and moves no point (see `_viewpoint`).

    A pixel of an organised cloud that saw nothing has a point of three NaN, which is none, as in a depth image.

    Fields are those of one value a point beside places, normals and colours (which PCD packs into one number); of
    compressed files, none.
    """
    header = _parse_header(data)
    normals = set(_NORMAL) <= set(header.names)
    wanted = [*_COORDINATES, *(_NORMAL if normals else ())]
    places = len(wanted)
    single = [name for name, size in zip(header.names, header.counts, strict=True) if size == 1]
    others = [name for name in single if name not in _NOT_FIELDS and header.names.count(name) == 1]
    if header.encoding == "ascii":
        table, lines = _read_text(data, header, [*wanted, *others])
    elif header.encoding == "binary":
        table, lines = _read_binary(data, header, [*wanted, *others]), None
    else:
        table, lines, others = _read_compressed(data, path, header, wanted), None, []
    if header.organised:
        seen = np.flatnonzero(~np.isnan(table[:, :3]).all(axis=1))
        table, lines = table[seen], None if lines is None else [lines[k] for k in seen]
    return Content(
        points=table[:, :3],
        normals=table[:, 3:6] if normals else None,
        point_fields={name: table[:, k] for k, name in enumerate(others, start=places)},
        point_lines=lines,
        viewpoint=header.viewpoint,
    )


def _parse_header(data: bytes) -> _Header:
    entries: dict[str, list[str]] = {}
    size = lines = 0
    for line in data.splitlines(keepends=True):
        size, lines = size + len(line), lines + 1
        text = line.decode("utf-8", errors="replace").partition("#")[0]
        words = text.split()
        if words and words[0] not in _KEYS:
            raise InputError(
                f"line {lines}: {shorten(text.strip())}; the header of a PCD file has lines FIELDS SIZE TYPE "
                "COUNT WIDTH HEIGHT POINTS and ends with DATA"
            )
        if words:
            entries[words[0]] = words[1:]
        if "DATA" in entries:
            return _interpret(entries, size, lines)
    raise InputError("the header has no line DATA; the file is cut off or not a PCD file")


def _interpret(entries: dict[str, list[str]], size: int, lines: int) -> _Header:
    names = entries.get("FIELDS", [])
    types = [kind + width for kind, width in zip(entries.get("TYPE", []), entries.get("SIZE", []), strict=False)]
    counts = entries.get("COUNT", ["1"] * len(names))
    if not 0 < len(names) == len(entries.get("SIZE", [])) == len(entries.get("TYPE", [])) == len(counts):
        raise InputError("FIELDS, SIZE, TYPE and COUNT of the header differ in length or are missing")
    if not set(types) <= _TYPES:
        raise InputError(f"TYPE and SIZE give {' '.join(types)}; expected of {' '.join(sorted(_TYPES))}")
    if any(names.count(name) != 1 or counts[names.index(name)] != "1" for name in _COORDINATES):
        raise InputError(f"FIELDS are {shorten(' '.join(names), 99)}; expected one x, one y, one z, each of COUNT 1")
    encoding = " ".join(entries["DATA"])
    if encoding not in _ENCODINGS:
        raise InputError(f"line {lines}: DATA {shorten(encoding)}; expected one of {', '.join(_ENCODINGS)}")
    return _Header(
        names=names, types=types, counts=_whole(counts, "COUNT"), points=_points(entries),
        organised=entries["HEIGHT"] != ["1"], encoding=encoding, size=size, lines=lines,
        viewpoint=_viewpoint(entries.get("VIEWPOINT")),
    )  # fmt: skip


def _viewpoint(words: list[str] | None) -> Array | None:
    """Where the sensor stood; the origin, which writers put where they know nothing, counts as unknown."""
    if words is None:
        return None
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.empty(0)
    if len(values) != 7 or not np.isfinite(values).all():
        raise InputError(
            f"VIEWPOINT {shorten(' '.join(words))} in the header; expected seven numbers, the place and a quaternion"
        )
    return values[:3] if values[:3].any() else None


def _points(entries: dict[str, list[str]]) -> int:
    """Number of points, which the header gives twice."""
    given = {key: entries.get(key, []) for key in ("WIDTH", "HEIGHT", "POINTS")}
    if any(len(words) != 1 for words in given.values()):
        raise InputError("the header needs WIDTH, HEIGHT and POINTS, each with one number")
    width, height, points = (_whole(words, key)[0] for key, words in given.items())
    if width * height != points:
        raise InputError(f"the header gives POINTS {points}, but WIDTH {width} times HEIGHT {height}")
    return points


def _whole(words: list[str], key: str) -> list[int]:
    if not all(NATURAL.fullmatch(word) for word in words):
        raise InputError(f"{key} {shorten(' '.join(words))} in the header; expected whole numbers")
    return [int(word) for word in words]


def _read_text(data: bytes, header: _Header, wanted: list[str]) -> tuple[Array, list[int]]:
    lines = [(number + header.lines, text) for number, text in numbered_lines(data[header.size :])]
    layout = f"one line for each point: {' '.join(header.names)}"
    table = parse_table(lines, columns=(sum(header.counts),), layout=layout)
    if len(table) != header.points:
        raise InputError(f"the header gives POINTS {header.points}, {len(table)} lines of points follow it")
    starts = [0, *itertools.accumulate(header.counts)]
    columns = [starts[header.names.index(name)] for name in wanted]
    return table[:, columns], [number for number, _ in lines]


def _read_binary(data: bytes, header: _Header, wanted: list[str]) -> Array:
    record = header.record
    if len(data) - header.size != header.points * record.itemsize:
        raise InputError(
            f"the header gives {count(header.points, 'point')} of {record.itemsize} bytes, "
            f"{header.points * record.itemsize} in all; {len(data) - header.size} follow it"
        )
    table = np.frombuffer(data, record, offset=header.size)
    return np.stack([as_float64(table[str(header.names.index(name))][:, 0]) for name in wanted], axis=1)


def _read_compressed(data: bytes, path: Path, header: _Header, wanted: list[str]) -> Array:
    """Compressed data through open3d, after the checks of size that it leaves out."""
    full = header.points * header.record.itemsize
    packed = int.from_bytes(data[header.size : header.size + 4], "little")
    unpacked = int.from_bytes(data[header.size + 4 : header.size + 8], "little")
    follow = len(data) - header.size - 8
    if follow != packed or unpacked != full:
        raise InputError(
            f"compressed data of {packed} bytes for {unpacked} are announced; {max(follow, 0)} follow, and "
            f"the header asks for {full}"
        )
    if full > allowance(len(data)):
        raise InputError(f"{len(data):,} bytes unpack to {full:,}; at most {allowance(len(data)):,}: save it as binary")
    if any(header.types[header.names.index(name)] != "F4" for name in wanted):
        raise InputError("compressed coordinates must be of TYPE F and SIZE 4; save it as binary or ascii")
    with on_disk(data, path) as file:
        return _open3d_points(file, header, len(wanted))


def _open3d_points(path: Path, header: _Header, columns: int) -> Array:
    o3d = open3d()
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.io.read_point_cloud(path, format="pcd")
    arrays = [np.asarray(cloud.points), np.asarray(cloud.normals)][: columns // 3]
    if any(len(array) != header.points for array in arrays):
        raise InputError(f"the compressed data cannot be unpacked to {count(header.points, 'point')}")
    return np.concatenate(arrays, axis=1)
