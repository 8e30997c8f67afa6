"""Fields of a file to classes that a symmetry must keep, and to weights."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Values, are_whole
from symrefine.shape import Index
from symrefine.texture import colour_classes, eight_bit

# Classes [N], and the colours [K, 3] or texts [K] that they stand for; None where they are numbers of their own.
Classes = tuple[Index, NDArray[Any] | None]


def point_classes(content: Content, name: str) -> Classes:
    """Classes [N] of the points of a cloud by a field of that name, and what they stand for.

    Raises:
        InputError: no such field, or values that are neither whole numbers, texts nor colours.
    """
    key = _key(content, name, "labels")
    weights = np.ones(len(content.points)) if content.weights is None else content.weights
    return _classes(content, key, "point", weights)


def triangle_classes(content: Content, name: str, owner: Index, corners: Index) -> Classes:
    """Classes [T] of the triangles of a mesh by a field of its faces, or else of its vertices, and what they stand for.

    A triangle takes the class of two corners or more; where all three differ, that of the first.

    Args:
        owner: [T] face of the file that each triangle is part of.
        corners: [T, 3] points of the file.

    Raises:
        InputError: as for `point_classes`.
    """
    key = _key(content, name, "labels")
    a, b, c = (content.points[corners[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    if key in content.face_fields:
        covered = np.bincount(owner, areas, minlength=len(content.face_fields[key])).astype(np.float64)
        classes, kinds = _classes(content, key, "face", covered)
        return classes[owner], kinds
    covered = np.bincount(corners.ravel(), np.repeat(areas, 3), minlength=len(content.points)).astype(np.float64)
    classes, kinds = _classes(content, key, "point", covered)
    first, second, third = classes[corners].T
    return np.asarray(np.where(second == third, second, first)), kinds


def point_weights(content: Content, name: str) -> Array:
    """Weights [N] of the points of a cloud by a field of that name; `Shape` judges the numbers.

    Raises:
        InputError: no such field, or values that are no numbers.
    """
    if name == "weights" and content.weights is not None:
        return content.weights
    key = _key(content, name, "weights")
    values = content.point_fields.get(key)
    if values is None or values.ndim != 1 or values.dtype.kind not in "iuf":
        raise InputError(f"{key} cannot weigh points; expected one number for each point")
    return values.astype(np.float64)


def _key(content: Content, name: str, what: str) -> str:
    """Name of the field as the file has it; titles of tables are in lower case."""
    offered = sorted({*content.point_fields, *content.face_fields})
    for key in (name, name.lower()):
        if key in offered:
            return key
    told = f"the file offers {', '.join(offered)}" if offered else "the file offers none"
    raise InputError(f"no {what} {name!r}; {told}")


def _classes(content: Content, key: str, kind: Literal["point", "face"], weights: Array) -> Classes:
    values = (content.face_fields if kind == "face" else content.point_fields)[key]
    if values.dtype.kind not in "US" and (row := _unfit(values)) is not None:
        right = "whole numbers" if values.ndim == 1 else "finite colours from 0 on"
        raise InputError(f"{key} of {content.name(kind, row)} is {values[row].tolist()}; labels are {right}")
    if values.ndim == 2:
        classes = colour_classes(values, weights)
        return classes, _class_colours(values, classes)
    if values.dtype.kind in "US":
        kinds, own = np.unique(values, return_inverse=True)
        return own.reshape(-1).astype(np.int64), kinds
    return values.astype(np.int64), None


def _unfit(values: Values) -> int | None:
    """The first row that cannot be a class."""
    with np.errstate(invalid="ignore"):
        if values.ndim == 2:
            fit = (np.isfinite(values) & (values >= 0) & (values <= 65535)).all(axis=1)
        elif values.dtype.kind == "f":
            fit = are_whole(values)
        else:
            fit = np.ones(len(values), dtype=bool)
    bad = np.flatnonzero(~fit)
    return int(bad[0]) if bad.size else None


def _class_colours(colours: Values, classes: NDArray[np.int64]) -> Array:
    """Mean colours [K, 3], 0 to 255, of classes [N], 0 .. K - 1, of colours [N, 3] on any of these scales."""
    count = np.maximum(np.bincount(classes), 1)
    return np.stack([np.bincount(classes, channel) for channel in eight_bit(colours).T], axis=1) / count[:, None]
