"""Depth images: each pixel a point in front of a pinhole camera, which stands in the origin.

Frame: that of the camera, x to the right, y down, z forward; the unit is what the depth has after `depth_scale`. The
pixel in column c and row r with depth z (along the axis, no range) is the point ((c - cx) z / fx, (r - cy) z / fy, z).
A pixel of depth 0, or one of floating point that is not finite, measured nothing.
"""

import io
import math
from collections.abc import Sequence
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError, about
from symrefine.files import file_bytes, path_of
from symrefine.geometry import Array, numbers
from symrefine.load.content import Content, check_distinct
from symrefine.load.image import FORMATS, open_image
from symrefine.load.tables import read_array
from symrefine.shape import Shape

# Suffixes of depth images: others lose digits.
DEPTHS = (".npy", ".png")
# Of whole numbers, as cameras write them: millimetres to metres.
DEPTH_SCALE = 0.001


def load_depth(
    path: str | PathLike[str],
    intrinsics: Sequence[float],
    *,
    depth_scale: float | None = None,
    mask: str | PathLike[str] | None = None,
) -> Shape:
    """The points that a depth image shows, with the camera that saw them as their viewpoint.

    Args:
        path: .png of one channel, of 16 bits, or of 8 where `depth_scale` is told; or .npy [H, W].
        intrinsics: fx, fy, cx, cy in pixels, the centre of the first pixel being (0, 0).
        depth_scale: lengths in one unit of depth; 0.001 for whole numbers if None, which makes metres of millimetres,
            and 1 for floating point.
        mask: image of the same size that is not black where the object is; everything that was measured if None.

    Raises:
        InputError: what is no depth image or no mask of its size; depths below 0; fewer than two distinct points.
    """
    fx, fy, cx, cy = _checked(intrinsics)
    _check_scale(depth_scale)
    file = path_of(path)
    with about(str(path)):
        depth = _depth(file)
        if depth_scale is None and depth.dtype == np.uint8:
            raise InputError("has pixels of 8 bits, as pictures do; of depths that are stored so, tell the depth scale")
        scale = depth_scale or (1.0 if np.issubdtype(depth.dtype, np.floating) else DEPTH_SCALE)
        seen = np.isfinite(depth) & (depth != 0)
        below = np.argwhere(seen & (depth < 0))
        if len(below):
            row, column = below[0]
            raise InputError(f"row {row}, column {column}: depth {depth[row, column]}; expected 0 (none) or more")
    if mask is not None:
        with about(str(mask)):
            seen &= _mask(path_of(mask), depth.shape)
    with about(str(path)):
        row, column = np.nonzero(seen)
        z = scale * depth[row, column].astype(np.float64)
        content = Content(points=np.column_stack([(column - cx) * z / fx, (row - cy) * z / fy, z]))
        if not len(z):
            raise InputError("no pixel has a depth" if mask is None else f"no pixel in {mask} has a depth")
        check_distinct(content)
    return Shape(source=str(path), points=content.points, viewpoint=np.zeros(3))


def _checked(intrinsics: Sequence[float]) -> tuple[float, ...]:
    values = numbers(intrinsics, "intrinsics")
    if values.shape != (4,) or not np.isfinite(values).all() or values[:2].min() <= 0.0:
        raise InputError(f"intrinsics are {values.tolist()}; expected fx, fy, cx, cy in pixels, fx and fy above 0")
    return tuple(values.tolist())


def _check_scale(scale: Any) -> None:
    if scale is not None and not (isinstance(scale, Real) and 0.0 < float(scale) < math.inf):
        raise InputError(f"depth_scale is {scale!r}; expected a number above 0")


def _depth(file: Path) -> Array:
    """Depths [H, W] as stored."""
    suffix = file.suffix.lower()
    if suffix not in DEPTHS:
        raise InputError(f"unknown suffix {file.suffix!r} of a depth image; expected {' or '.join(DEPTHS)}")
    data = file_bytes(file)
    if suffix == ".png":
        image = open_image(data, suffix)
        if image.mode not in ("I;16", "I;16B", "I", "L"):
            raise InputError(f"has pixels of mode {image.mode}; a depth image has one channel, of 16 bits as a rule")
        return np.asarray(image)
    array = read_array(io.BytesIO(data))
    if array.ndim != 2 or array.dtype.kind not in "uif":
        raise InputError(f"holds {array.dtype} of shape {array.shape}; a depth image has real numbers [H, W]")
    return array


def _mask(file: Path, size: tuple[int, ...]) -> NDArray[np.bool_]:
    suffix = file.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"unknown suffix {file.suffix!r} of a mask; expected {' '.join(sorted(FORMATS))}")
    mask = np.asarray(open_image(file_bytes(file), suffix).convert("L")) > 0
    if mask.shape != size:
        raise InputError(f"has {mask.shape[1]} x {mask.shape[0]} pixels, the depth image {size[1]} x {size[0]}")
    return mask
