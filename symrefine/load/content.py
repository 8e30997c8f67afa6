"""Content: what a file holds, exactly as written; the readers make it, `mesh` and `load` judge it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.shape import LARGEST, Index
from symrefine.texture import Pixels

# Values of any kind, one for each point or face: numbers, texts, or the three of a colour.
Values = NDArray[Any]

# Squares of areas of smaller triangles are 0.
SMALLEST = 1e-60


Threshold = float | Literal["otsu"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a caller wants of a file beyond its coordinates.

    Args:
        labels: name of a field that becomes labels.
        weights: name of a field that becomes weights.
        measure: "solid" for the voxels of a volume, else its surface.
        threshold: grey value that makes a picture or a volume binary, or how to find it; None leaves it as it is.
        invert: exchange object and background of a picture or a volume.
        texture: what the faces show, which images beside the file may hold.
    """

    labels: str | None = None
    weights: str | None = None
    measure: Literal["surface", "solid"] | None = None
    threshold: Threshold | None = None
    invert: bool = False
    texture: bool = False

    @property
    def fields(self) -> list[str]:
        """Names of labels and weights, for formats in which what nobody names is refused."""
        return [name for name in (self.labels, self.weights) if name is not None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polygons:
    """Faces of any number of corners, one after the other.

    Args:
        corners: [sum of counts] vertex indices, counted from 0.
        counts: [F] corners of each face.
    """

    corners: Index
    counts: Index

    @classmethod
    def alike(cls, rows: Index) -> "Polygons":
        """Faces [F, k] that have all as many corners."""
        return cls(corners=rows.ravel(), counts=np.full(len(rows), rows.shape[1]))

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def starts(self) -> Index:
        """[F] where each face begins in `corners`."""
        return np.cumsum(self.counts) - self.counts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Paint:
    """What faces show.

    Args:
        images: [H, W, 3] each, 0 to 255.
        uv: [sum of counts, 2] of the corners of the faces in their order, v upwards over the image.
        image: [F] which image a face shows; -1 where it is of one colour.
        plain: [F, 3] that colour, 0 to 255.
    """

    images: tuple[Pixels, ...]
    uv: Array
    image: Index
    plain: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Content:
    """Points, normals and faces of one file, not yet checked against one another.

    Args:
        points: [N, n] coordinates, possibly not finite.
        normals: [N, n] or None.
        weights: [N] or None.
        labels: [N] classes that count unasked (the elements of atoms), or None.
        point_fields: what else the file tells of each point, by name: [N] whole numbers, numbers or texts, or [N, 3]
            colours.
        face_fields: the same of each face.
        faces: polygons over `points`, or None for a cloud.
        point_lines: line of the file that each point stands in, for text formats.
        face_lines: the same for the faces.
        first_index: number the format gives its first vertex (1 in OBJ), for messages.
        viewpoint: [3] or [N, 3] where the sensor stood, in the frame of the points, or None.
        unit: of its lengths, where the file says so, one of `symrefine.units.METRES`.
        paint: what the faces show, where that was asked for.
        split: the format repeats a vertex for each face or each attribute (STL, glTF).
    """

    points: Array
    normals: Array | None = None
    weights: Array | None = None
    labels: Index | None = None
    faces: Polygons | None = None
    point_fields: Mapping[str, Values] = field(default_factory=dict)
    face_fields: Mapping[str, Values] = field(default_factory=dict)
    point_lines: Sequence[int] | None = None
    face_lines: Sequence[int] | None = None
    first_index: int = 0
    viewpoint: Array | None = None
    unit: str | None = None
    split: bool = False
    paint: Paint | None = None

    def name(self, kind: Literal["point", "face"], row: int) -> str:
        """A point or a face as a message calls it: `point 7 (line 12)`, numbered as the format does."""
        lines = self.point_lines if kind == "point" else self.face_lines
        return f"{kind} {row + self.first_index}" + (f" (line {lines[row]})" if lines is not None else "")


def polygons(rows: Iterable[Sequence[int]]) -> Polygons:
    """Faces given one by one, each a list of vertex indices counted from 0."""
    faces = list(rows)
    corners = [corner for face in faces for corner in face]
    counts = [len(face) for face in faces]
    return Polygons(corners=np.array(corners, dtype=np.int64), counts=np.array(counts, dtype=np.int64))


def are_whole(values: Values) -> NDArray[np.bool_]:
    """Which values are whole numbers that float64 holds exactly."""
    return (values == np.rint(values)) & (np.abs(values) <= 2.0**53)


def as_float64(values: NDArray[Any]) -> Array:
    """Values as float64, without the warning that NumPy gives for some NaNs: they are refused by name later."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def check_finite(content: Content) -> None:
    """Refuse coordinates that are NaN, infinite or so large that areas overflow, naming the first such point."""
    large = ~(np.abs(content.points) <= LARGEST)
    if large.any():
        bad = np.flatnonzero(large.any(axis=1))
        raise InputError(
            f"{content.name('point', int(bad[0]))} is {content.points[bad[0]].tolist()} "
            f"({bad.size} such of {len(content.points)}); coordinates must be finite and at most {LARGEST:g}: "
            "remove these points"
        )


def check_distinct(content: Content) -> None:
    """Refuse files without two distinct points, or with points so close together that areas underflow."""
    points = content.points
    if len(points) < 2 or (points == points[0]).all():
        told = f"all {len(points)} points are {points[0].tolist()}" if len(points) > 1 else "no points"
        told = f"only one point, {points[0].tolist()}" if len(points) == 1 else told
        raise InputError(f"{told}; a shape needs at least two distinct points")
    spread = float(np.ptp(points, axis=0).max())
    if spread < SMALLEST:
        raise InputError(
            f"coordinates differ by {spread:.3g} at most; a shape needs {SMALLEST:g}: give them in a smaller unit"
        )
