"""Shape: what every source of data becomes before any mathematics sees it."""

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrefine.errors import DegenerateShapeError, InputError, about
from symrefine.geometry import Array, numbers, read_only, unmasked
from symrefine.options import flag_of
from symrefine.texture import Texture

Measure = Literal["points", "surface", "solid"]
Index = NDArray[np.integer[Any]]
# Views of an object that are told apart.
CAMERAS = 64
# Masses of atoms that differ by more than this fraction are masses of different kinds.
SAME_MASS = 0.01
# Up to so many points of a cloud stand for themselves (atoms, markers, corners), if nothing else is said.
FEW = 250
# Squares of areas between such points are still numbers; no unit of length asks for more.
LARGEST = 1e60


def kinds_of_mass(masses: Array) -> Index:
    """Kinds [N] that points of masses [N] are of, by number: one ends where the next heavier is not the same."""
    ascending = np.argsort(masses, kind="stable")
    steps = np.diff(masses[ascending]) > SAME_MASS * masses[ascending][1:]
    return np.concatenate([[0], np.cumsum(steps)])[np.argsort(ascending, kind="stable")]


@dataclass(frozen=True, eq=False)
class Shape:
    """Weighted points in n-space, with normals or triangles where the source has them: `Shape(points, faces)`.

    Args:
        points: [N, n] finite coordinates in the units of the input; the vertices, for a mesh.
        faces: [F, 3] vertex indices of a triangle mesh in 3-space, or None.
        weights: [N] non-negative, not all zero; equal if absent. A mesh takes its weights from its measure.
        normals: [N, n], any length but zero, any sign; estimated where needed if absent.
        labels: [N] integers for a cloud, [F] for a mesh: classes (elements, colours, materials) that a symmetry must
            keep; one class if absent.
        kinds: [K, 3] colours, 0 to 255, or [K] texts that labels 0 .. K - 1 stand for; None where they are numbers that
            mean the same in any object.
        viewpoint: [3] or [N, 3] place of the camera that saw the points of a cloud, or each of them; 64 places at most.
            Beside the outline of what it saw it saw that there is nothing: not for what the edge of a picture cuts off.
        measure: "points" for a cloud; "surface" (if None) or "solid" for a mesh: what carries the mass.
        texture: what colours the triangles of a mesh; the shape has a group without it, and one with it.
        unit: of its lengths, one of `symrefine.units.METRES`, where the source says so.
        elements: whether the labels are atomic numbers.
        isolated: whether the points stand for themselves, as atoms, markers and corners do, and are no samples of a
            surface; if None they do where they have elements, or are at most 250.
        source: where the data came from, for messages.

    Raises:
        InputError: wrong shape, NaN or infinite values, negative weights, indices out of range.
        DegenerateShapeError: fewer than two distinct points.
    """

    points: Array
    faces: Index | None = None
    _: KW_ONLY
    weights: Array | None = None
    normals: Array | None = None
    labels: Index | None = None
    kinds: NDArray[Any] | None = None
    viewpoint: Array | None = None
    measure: Measure = None  # type: ignore[assignment]  # never None once made
    texture: Texture | None = None
    unit: str | None = None
    elements: bool = False
    isolated: bool | None = None
    source: str = "array"

    def __post_init__(self) -> None:
        with about(self.source):
            for name, checked in self._checked():
                object.__setattr__(self, name, checked)
        if (self.points[-1] == self.points[0]).all() and (self.points == self.points[0]).all():
            some = f"all {len(self.points)} points coincide" if len(self.points) > 1 else "one point"
            raise DegenerateShapeError(f"{self.source}: {some}; a shape needs at least two distinct points")

    def _checked(self) -> Iterator[tuple[str, Any]]:
        """Fields as they are kept, one after the other: those that come later are checked against them."""
        yield "points", _points(self.points)
        if self.weights is not None:
            yield "weights", _weights(self.weights, len(self.points))
        if self.normals is not None:
            yield "normals", _normals(self.normals, self.points)
        if self.faces is not None:
            yield "faces", _faces(self.faces, self.points)
        if self.isolated is not None:
            yield "isolated", flag_of("isolated", self.isolated)
        for name in ("weights", "normals", "viewpoint", "isolated"):
            if self.faces is not None and getattr(self, name) is not None:
                raise InputError(f"{name} is for clouds; a mesh has faces, leave it out")
        if self.labels is not None:
            count, what = (len(self.points), "point") if self.faces is None else (len(self.faces), "face")
            yield "labels", _labels(self.labels, count, what)
        yield "kinds", _kinds(self.kinds, self.labels)
        if self.texture is not None and len(self.texture.image) != (0 if self.faces is None else len(self.faces)):
            raise InputError(f"texture has {len(self.texture.image)} triangles; expected those of the mesh")
        if self.viewpoint is not None:
            yield "viewpoint", _viewpoint(self.viewpoint, self.points.shape)
        yield "measure", _measure(self.measure, self.faces)

    @classmethod
    def of(
        cls,
        points: ArrayLike,
        *,
        weights: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        labels: ArrayLike | None = None,
        viewpoint: ArrayLike | None = None,
        isolated: bool | None = None,
    ) -> "Shape":
        """A cloud from anything numpy can read as an array [N, n]."""
        given = {"weights": weights, "normals": normals, "labels": labels, "viewpoint": viewpoint, "isolated": isolated}
        return cls(points=points, **{k: v for k, v in given.items() if v is not None})  # type: ignore[arg-type]

    def chosen(self, rows: Index) -> "Shape":
        """Some of the points of a cloud, with what is known of each."""
        weights, normals, viewpoint = (
            None if v is None else v[rows] for v in (self.weights, self.normals, self.viewpoint)
        )
        labels = None if self.labels is None else self.labels[rows]
        points = self.points[rows]
        return replace(self, points=points, weights=weights, normals=normals, labels=labels, viewpoint=viewpoint)

    def without(self, rows: Index) -> "Shape":
        """The cloud without some of its points, with what is known of each of the others."""
        return self.chosen(np.delete(np.arange(len(self.points)), rows))

    @property
    def dim(self) -> int:
        """Dimension of the ambient space."""
        return int(self.points.shape[1])

    @property
    def atoms(self) -> bool:
        """Whether the points stand for themselves, and not for a surface."""
        if self.isolated is None:
            return self.faces is None and (self.elements or len(self.points) <= FEW)
        return self.isolated

    @property
    def masses(self) -> Array:
        """[N] weights of the points of a cloud, 1 each where none are given."""
        return np.ones(len(self.points)) if self.weights is None else self.weights

    @property
    def diagonal(self) -> float:
        """Diagonal of the axis-aligned bounding box, in input units."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def _measure(measure: str | None, faces: Index | None) -> str:
    """What carries the mass, where that was not said: the surface of a mesh, the points of a cloud."""
    if measure is None:
        return "points" if faces is None else "surface"
    if measure not in get_args(Measure):
        raise InputError(f"measure is {measure!r}; expected one of {list(get_args(Measure))}")
    if (faces is None) != (measure == "points"):
        raise InputError(
            f"measure is {measure!r}, but a cloud has measure 'points' and a mesh has 'surface' or 'solid'"
        )
    return measure


def _points(values: ArrayLike) -> Array:
    array = numbers(values, "points")
    if array.ndim != 2 or array.shape[1] < 2:
        raise InputError(f"points have shape {array.shape}; expected [N, n] with n >= 2")
    if len(array) == 0:
        raise InputError("no points; expected at least two distinct points")
    if not np.isfinite(array).all():
        bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
        raise InputError(
            f"{bad.size} of {len(array)} points hold NaN or infinity, the first in row {bad[0]}; remove those rows"
        )
    return read_only(array)


def _weights(values: ArrayLike, count: int) -> Array:
    array = numbers(values, "weights")
    if array.shape != (count,):
        raise InputError(f"weights have shape {array.shape}; expected ({count},), one for each point")
    if not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise InputError("weights must be finite, non-negative and not all zero")
    if array.max() > np.finfo(np.float64).max / count:
        raise InputError(
            f"weights of up to {array.max():.3g} may add up to more than {np.finfo(np.float64).max:.3g}; "
            "divide all of them by the largest"
        )
    return read_only(array)


def _viewpoint(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = numbers(values, "viewpoints")
    if array.shape not in (shape, shape[1:]) or shape[1] != 3:
        raise InputError(f"viewpoint has shape {array.shape}; expected (3,), or {shape}, one for each point")
    if not (np.abs(array) <= LARGEST).all():
        raise InputError(f"viewpoints hold NaN, infinity, or more than {LARGEST:g}")
    places = len(np.unique(array.reshape(-1, 3), axis=0))
    if places > CAMERAS:
        raise InputError(f"{places} different viewpoints; expected at most {CAMERAS}, one for each view")
    return read_only(np.broadcast_to(array, shape))


def _labels(values: ArrayLike, count: int, what: str) -> Index:
    array = unmasked(values, "labels")
    if not np.issubdtype(array.dtype, np.integer):
        raise InputError(f"labels are {array.dtype}; expected integers, one class for each {what}")
    if array.shape != (count,):
        raise InputError(f"labels have shape {array.shape}; expected ({count},), one for each {what}")
    array = array.astype(np.int64)
    array.flags.writeable = False
    return array


def _kinds(values: ArrayLike | None, labels: Index | None) -> NDArray[Any] | None:
    if values is None:
        return None
    array = np.array(values)
    if array.dtype.kind not in "US":
        array = numbers(array, "kinds")
    right = array.ndim == 1 if array.dtype.kind in "US" else array.ndim == 2 and array.shape[1] == 3
    if not right or labels is None or not 0 <= int(labels.min()) <= int(labels.max()) < len(array):
        raise InputError(f"kinds have shape {array.shape}; expected colours [K, 3] or texts [K] for labels 0 .. K - 1")
    array.flags.writeable = False
    return array


def _normals(values: ArrayLike, points: Array) -> Array:
    array = numbers(values, "normals")
    if array.shape != points.shape:
        raise InputError(f"normals have shape {array.shape}; expected {points.shape}, one for each point")
    length = np.linalg.norm(array, axis=1)
    bad = np.flatnonzero(~(np.isfinite(length) & (length > 0)))
    if bad.size:
        raise InputError(f"normal of row {bad[0]} is {array[bad[0]].tolist()}; expected a finite, non-zero vector")
    return read_only(array / length[:, None])


def _faces(values: ArrayLike, points: Array) -> Index:
    try:
        array = np.array(values)
    except ValueError:
        raise InputError("faces are ragged; expected [F, 3] integers, triangles only") from None
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer) or len(array) == 0:
        raise InputError(f"faces have shape {array.shape} of {array.dtype}; expected [F, 3] integers, F >= 1")
    if points.shape[1] != 3:
        raise InputError(f"faces need points in 3-space, these have {points.shape[1]} coordinates")
    if array.min() < 0 or array.max() >= len(points):
        wrong = array.min() if array.min() < 0 else array.max()
        raise InputError(f"face index {wrong} is out of range; there are {len(points)} vertices")
    array = array.astype(np.int64)
    array.flags.writeable = False
    return array
