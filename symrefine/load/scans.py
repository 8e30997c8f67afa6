"""Scans as surveyors keep them: .las and .laz, read by laspy and lazrs, and .e57, read by pye57 with its checksums.

Lengths are in the unit of the file, metres as a rule; offsets and poses are applied.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.apart import apart
from symrefine.load.content import Content, Values
from symrefine.load.extras import library
from symrefine.load.packed import allowance, on_disk
from symrefine.load.text import count, shorten
from symrefine.shape import CAMERAS

# lazrs believes every size that a compressed file tells, and where there is no memory for it, ends the process. So it
# works in a process of its own, whose memory is bounded.
_UNPACK = """
import io, sys, laspy
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2)
except (ImportError, ValueError, OSError):
    pass
with laspy.open(io.BytesIO(sys.stdin.buffer.read()), laz_backend=laspy.LazBackend.Lazrs) as reader:
    cloud, declared = reader.read(), reader.header.point_count
if len(cloud.points) != declared:
    sys.exit(f"the header declares {declared} points; {len(cloud.points)} are there")
made = io.BytesIO()
cloud.write(made, do_compress=False)
sys.stdout.buffer.write(made.getvalue())
"""
_COLOURS = ("red", "green", "blue")
_COORDINATES = frozenset({"X", "Y", "Z"})


def read_las(data: bytes) -> Content:
    """Points of a .las or .laz file; what else it tells of each point (`classification`, `intensity`) are fields.

    Raises:
        InputError: damaged, cut off, another number of points than the header says, more than memory holds; laspy is
            not installed.
    """
    laspy = library("laspy", "scan")
    library("lazrs", "scan")
    _check_records(data)
    if data[104:105] >= b"\x40":
        data = _unpacked(data)
    try:
        with laspy.open(io.BytesIO(data)) as reader:
            check_room(reader.header, len(data))
            cloud = reader.read()
            points = np.array(cloud.xyz, dtype=np.float64)
            fields = _las_fields(cloud)
            expected = reader.header.point_count
    except BaseException as error:  # noqa: BLE001 (raised again, as one of ours where it is no other)
        raise las_fault(error) from None
    if len(points) != expected:
        raise InputError(f"the header declares {count(expected, 'point')}; {len(points)} are there")
    return Content(points=points, point_fields=fields)


def las_fault(error: BaseException) -> BaseException:
    """What laspy and lazrs raise, as one of ours; what lazrs, in Rust, raises where it panics is no Exception."""
    if isinstance(error, InputError | MemoryError) or (
        not isinstance(error, Exception) and type(error).__name__ != "PanicException"
    ):
        return error
    return InputError(f"not a whole LAS file: {shorten(str(error), 80)}")


def _check_records(data: bytes) -> None:
    """Refuse more records before and behind the points than there is room for: laspy looks for each of billions."""
    before, behind = _whole(data, 100, 4), _whole(data, 243, 4) if data[25:26] >= b"\4" else 0
    for number, smallest in ((before, 54), (behind, 60)):
        if number * smallest > len(data):
            raise InputError(f"the header declares {count(number, 'record')} besides points in {len(data)} bytes")


def _whole(data: bytes, start: int, size: int) -> int:
    """A whole number of a LAS file."""
    return int.from_bytes(data[start : start + size], "little")


def _unpacked(data: bytes) -> bytes:
    """The uncompressed file of a compressed one."""
    # Legacy counts of points are at 107, those of version 1.4 at 247.
    points = max(_whole(data, 107, 4), _whole(data, 247, 8) if data[25:26] >= b"\4" else 0)
    needed, most = points * (_whole(data, 105, 2) + 24), allowance(len(data))
    if needed > most:
        raise InputError(
            f"the header declares {count(points, 'point')}, {needed:,} bytes once they are read; at most {most:,} of a "
            f"file of {len(data):,}"
        )
    done = apart(_UNPACK, data, str(2**30 + 4 * most), doing="unpacked")
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", errors="replace").strip().splitlines()
        told = shorten(said[-1], 80) if said and done.returncode > 0 else "it asks for more than there is"
        raise InputError(f"not a whole LAS file: {told}")
    return done.stdout


def check_room(header: Any, size: int) -> None:
    """Refuse counts that the file has no room for, or too much: laspy reads what there is."""
    points, each = int(header.point_count), int(header.point_format.size)
    if header.are_points_compressed:
        return
    behind = [
        int(getattr(header, name, 0) or 0) for name in ("start_of_first_evlr", "start_of_waveform_data_packet_record")
    ]
    end = min([start for start in behind if start > header.offset_to_point_data], default=size)
    room = end - int(header.offset_to_point_data)
    if not points * each <= room < points * each + each:
        raise InputError(
            f"the header declares {count(points, 'point')} of {each} bytes, {points * each} in all; {room} are there"
        )


def _las_fields(cloud: Any) -> dict[str, Values]:
    names = set(cloud.point_format.dimension_names) - _COORDINATES
    fields: dict[str, Values] = {name: np.array(cloud[name]) for name in sorted(names)}
    if names.issuperset(_COLOURS):
        fields["color"] = np.column_stack([fields.pop(name) for name in _COLOURS])
    return fields


def read_e57(data: bytes, path: Path) -> Content:
    """Points of all scans of an .e57 file, each where its pose puts it and seen from there.

    The scanners' places become viewpoints, unless there are no poses, none but the origin, or more than a shape can
    have. Fields are `intensity` and `color`, where all scans have them.

    Raises:
        InputError: damaged (by the checksum of every page), cut off, more than memory holds; pye57 is not installed.
    """
    pye57 = library("pye57", "scan")
    with on_disk(data, path) as file:
        try:
            scans = _e57_scans(pye57, file)
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 (a third party's reader, and nothing else, in the block)
            raise InputError(f"not a whole E57 file: {shorten(str(error).partition(chr(10))[0], 80)}") from None
    if not scans:
        raise InputError("holds no scans")
    clouds = [np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"]) for scan, _ in scans]
    fields: dict[str, Values] = {}
    if all("intensity" in scan for scan, _ in scans):
        fields["intensity"] = np.concatenate([scan["intensity"] for scan, _ in scans])
    if all("colorRed" in scan for scan, _ in scans):
        channels = [[scan[f"color{name.capitalize()}"] for scan, _ in scans] for name in _COLOURS]
        fields["color"] = np.column_stack([np.concatenate(channel) for channel in channels])
    return Content(
        points=np.concatenate(clouds).astype(np.float64),
        point_fields=fields,
        viewpoint=_viewpoints([place for _, place in scans], [len(cloud) for cloud in clouds]),
    )


def _e57_scans(pye57: Any, file: Path) -> list[tuple[dict[str, Values], Array | None]]:
    """Columns of each scan, and where its scanner stood, if that is told."""
    opened = pye57.E57(str(file))
    try:
        headers = [opened.get_header(k) for k in range(opened.scan_count)]
        points = sum(header.point_count for header in headers)
        if points * 6 * 8 > (most := allowance(file.stat().st_size)):
            raise InputError(f"holds {count(points, 'point')}; at most {most // 48:,} of a file of its size")
        scans: list[tuple[dict[str, Values], Array | None]] = []
        for k, header in enumerate(headers):
            names = set(header.point_fields)
            scan = opened.read_scan(
                k, intensity="intensity" in names, colors={"colorRed", "colorGreen", "colorBlue"} <= names,
                ignore_missing_fields=True,
            )  # fmt: skip
            scans.append((scan, np.array(header.translation, dtype=np.float64) if header.has_pose() else None))
        return scans
    finally:
        opened.close()


def _viewpoints(places: list[Array | None], sizes: list[int]) -> Array | None:
    known = [place for place in places if place is not None]
    if len(known) < len(places) or not any(place.any() for place in known):
        return None
    if len(np.unique(known, axis=0)) > CAMERAS:
        return None
    return np.repeat(np.array(known), sizes, axis=0)
