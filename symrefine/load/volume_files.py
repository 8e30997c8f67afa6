"""Formats of volumes, each read by the library that keeps it: nibabel, mrcfile, and pynrrd for headers."""

import bz2
import gzip
import io
import math
import warnings
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.load.content import Content, Wanted
from symrefine.load.extras import library, reading
from symrefine.load.frames import Frames, one
from symrefine.load.text import count, shorten
from symrefine.load.volume import Volume, check_size, volume_content

# Names that NRRD has for types of numbers.
_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}

# How NRRD packs its data.
_OPENERS: dict[str, Any] = {"gzip": gzip.open, "gz": gzip.open, "bzip2": bz2.open, "bz2": bz2.open}
_NIFTI_UNITS = {"meter": "m", "mm": "mm", "micron": "um"}


def read_nifti(data: bytes, wanted: Wanted) -> Frames[Content]:
    """The volumes of a NIfTI file, by its affine map, in millimetres as a rule.

    Raises:
        InputError: damaged, colours or complex numbers, nibabel is not installed; of a volume, when it is asked for: as
            `volume_content`.
    """
    nibabel = library("nibabel", "volumes")
    kind = nibabel.Nifti2Image if 540 in _heads(data) else nibabel.Nifti1Image
    with reading("NIfTI file"), nibabel.imageglobals.LoggingOutputSuppressor(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        image = kind.from_bytes(data)
        shape, dtype = image.shape, np.dtype(image.get_data_dtype())
        start = int(image.dataobj.offset)
        slope, shift = np.asanyarray(image.dataobj.slope), np.asanyarray(image.dataobj.inter)
        affine = np.array(image.affine, dtype=np.float64)
        unit = _NIFTI_UNITS.get(image.header.get_xyzt_units()[0])
    if dtype.kind not in "iuf":
        raise InputError(f"holds values of type {dtype}; expected real numbers, integer or floating")
    _check_length(shape, dtype, len(data) - start)
    check_size(shape[:3])
    series = [(0,) * (len(shape) - 3)] if len(shape) == 3 else list(np.ndindex(*shape[3:]))

    def scaled(values: Any) -> Any:
        with reading("NIfTI file"), np.errstate(all="ignore"):
            return nibabel.volumeutils.apply_read_scaling(values, slope, shift)

    def made(k: int) -> Content:
        values = np.frombuffer(data, dtype, offset=start).reshape(shape, order="F")[(..., *series[k])]
        volume = Volume(values=values, axes=affine[:3, :3], origin=affine[:3, 3], scaled=scaled)
        return replace(volume_content(volume, wanted), unit=unit)

    return Frames("volumes", len(series), made)


def _heads(data: bytes) -> tuple[int, int]:
    """The size of its header that a NIfTI file begins with, in both orders of bytes."""
    return int.from_bytes(data[:4], "little"), int.from_bytes(data[:4], "big")


def _check_length(shape: tuple[int, ...], dtype: "np.dtype[Any]", there: int) -> None:
    size = math.prod(shape) * dtype.itemsize if shape else 0
    if size != there:
        raise InputError(
            f"the header gives {' x '.join(map(str, shape))} values of {dtype}, {size} bytes; {there} follow it"
        )


def read_mrc(data: bytes, wanted: Wanted) -> Frames[Content]:
    """Density maps, in the unit of their cell (Angstrom).

    The place of the grid is the origin in the header, or its first voxel where that is 0. A cell without lengths, as
    of maps in voxels, counts as one of the unit for each voxel.

    Raises:
        InputError: damaged, pictures instead of volumes, complex numbers, mrcfile is not installed; of a volume, when
            it is asked for: a cell without right angles, and as `volume_content`.
    """
    interpreter, known = library("mrcfile.mrcinterpreter", "volumes"), library("mrcfile.utils", "volumes")
    sizes = [
        [abs(int.from_bytes(data[k : k + 4], order, signed=True)) for k in (0, 4, 8)] for order in ("little", "big")
    ]
    # Half a byte is the least that a voxel takes.
    if min(math.prod(size) for size in sizes) > 2 * len(data):
        raise InputError(
            f"has {' x '.join(map(str, sizes[0]))} voxels, which {len(data)} bytes cannot hold; not a MRC file?"
        )
    extended = [abs(int.from_bytes(data[92:96], order, signed=True)) for order in ("little", "big")]
    if min(extended) > len(data):
        raise InputError(
            f"has an extended header of {min(extended)} bytes, which {len(data)} cannot hold; not a MRC file?"
        )
    head = data[: 1024 + max(size for size in extended if size <= len(data))]  # of all it would make a copy
    with reading("MRC file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        header = interpreter.MrcInterpreter(iostream=io.BytesIO(head), header_only=True).header.copy()
        dtype, shape = known.data_dtype_from_header(header), known.data_shape_from_header(header)
    if dtype.kind not in "iuf":
        raise InputError(f"holds values of {dtype}; expected real numbers")
    start = 1024 + int(header.nsymbt)
    _check_length(shape, dtype, len(data) - start)
    if len(shape) == 2 or (len(shape) == 3 and header.ispg == known.IMAGE_STACK_SPACEGROUP):
        raise InputError(f"holds {count(1 if len(shape) == 2 else shape[0], 'picture')}, no volume (mode of its grid)")
    values = np.frombuffer(data, dtype, offset=start).reshape(shape)
    parts = values if len(shape) == 4 else values[None]
    return Frames("volumes", len(parts), lambda k: volume_content(_map(parts[k], header), wanted))


def _map(values: Any, header: Any) -> Volume:
    """A map whose axes are put in the order x, y, z."""
    check_size(values.shape)
    order = [int(header[name]) for name in ("mapc", "mapr", "maps")]
    if sorted(order) != [1, 2, 3] and order != [0, 0, 0]:
        raise InputError(f"axes MAPC MAPR MAPS are {order}; expected 1, 2 and 3 in some order")
    angles = [float(header.cellb[name]) for name in ("alpha", "beta", "gamma")]
    if any(angle not in (0.0, 90.0) for angle in angles):
        raise InputError(f"angles of the cell are {angles}; expected right angles: resample it")
    places = [order.index(axis) for axis in (1, 2, 3)] if any(order) else [0, 1, 2]
    # Columns are the last axis of the array; transposed, they are the first.
    turned = np.transpose(values.T, places)
    samples = np.array([int(header[name]) for name in ("mx", "my", "mz")], dtype=np.float64)
    cell = np.array([float(header.cella[name]) for name in "xyz"])
    steps = cell / np.maximum(samples, 1.0) if cell.any() else np.ones(3)
    origin = np.array([float(header.origin[name]) for name in "xyz"])
    starts = np.array([int(header[name]) for name in ("nxstart", "nystart", "nzstart")], dtype=np.float64)[places]
    return Volume(values=turned, axes=np.diag(steps), origin=origin if origin.any() else starts * steps)


def read_nrrd(data: bytes, wanted: Wanted) -> Frames[Content]:
    """A volume of a NRRD file, by its directions and origin, or its spacings.

    Raises:
        InputError: damaged, data in another file, other axes than three of space, and as `volume_content`; pynrrd is
            not installed.
    """
    nrrd = library("nrrd", "volumes")
    stream = io.BytesIO(data)
    with reading("NRRD file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        header = nrrd.read_header(stream)
    detached = {"data file", "datafile", "line skip", "lineskip", "byte skip", "byteskip"} & set(header)
    if detached:
        raise InputError(f"has {min(detached)!r}: expected header and data in one file, one behind the other")
    shape = tuple(int(size) for size in np.atleast_1d(header.get("sizes", [])))
    check_size(shape)
    dtype = _nrrd_type(header)
    body = _unpacked(memoryview(data)[stream.tell() :], str(header.get("encoding")), math.prod(shape) * dtype.itemsize)
    _check_length(shape, dtype, len(body))
    values = np.frombuffer(body, dtype).reshape(shape, order="F")
    axes, origin = _nrrd_frame(header)
    return one(volume_content(Volume(values=values, axes=axes, origin=origin), wanted), "volumes")


def _nrrd_type(header: Mapping[str, Any]) -> "np.dtype[Any]":
    word = " ".join(str(header.get("type", "")).lower().split())
    code = next((code for code, words in _TYPES.items() if word in words), None)
    endian = header.get("endian")
    if code is None or (code[1] != "1" and endian not in ("little", "big")):
        raise InputError(f"type is {shorten(word)}, endian {endian!r}; expected real numbers, little or big")
    return np.dtype(("<" if endian == "little" else ">") + code)


def _unpacked(body: memoryview, encoding: str, size: int) -> bytes | memoryview:
    """Data of a NRRD file; one byte more than expected at most."""
    if encoding == "raw":
        return body
    if encoding in _OPENERS:
        try:
            with _OPENERS[encoding](io.BytesIO(body)) as file:
                return file.read(size + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError(f"the data are damaged: {shorten(str(error), 80)}") from None
    raise InputError(f"encoding is {shorten(encoding)}; expected raw, gzip or bzip2")


def _nrrd_frame(header: Mapping[str, Any]) -> tuple[Any, Any]:
    """Axes [3, 3] as columns, and the middle of the first voxel."""
    directions, spacings = header.get("space directions"), header.get("spacings")
    axes = np.diag(np.ones(3) if spacings is None else np.array(spacings, dtype=np.float64))
    if directions is not None:
        axes = np.array(directions, dtype=np.float64).T
    if axes.shape != (3, 3):
        raise InputError(f"space directions are {axes.T.tolist()}; expected three of three numbers")
    origin = np.array(header.get("space origin", np.zeros(3)), dtype=np.float64)
    return axes, origin if origin.shape == (3,) else np.full(3, np.nan)
