"""What people hold, to shapes: told by what it offers, so that no library is imported for it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Number
from operator import index
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError, about
from symrefine.load import load
from symrefine.load.content import Content, Polygons, Values, as_float64, check_distinct, check_finite, polygons
from symrefine.load.frames import Frames
from symrefine.load.mesh import mesh_arrays
from symrefine.load.scene import flattened
from symrefine.load.stream import STREAMED, stream_if_large
from symrefine.shape import LARGEST, Shape
from symrefine.stream import Stream

_EXPECTED = (
    "a path, points [N, n], (vertices, faces), a Shape, or a mesh, a cloud or a molecule of trimesh, Open3D, pyvista, "
    "ASE, pymatgen or torch"
)


def shape_of(
    given: Any,
    *,
    name: str = "array",
    frame: int | None = None,
    weights: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    viewpoint: ArrayLike | None = None,
    isolated: bool | None = None,
) -> Shape:
    """The shape of whatever is given, a mesh treated as one from a file is.

    Args:
        given: a path; an array [N, n], or what numpy or torch make one of; `(vertices, faces)`, faces of any number of
            corners; trimesh `Trimesh`, `PointCloud`, `Scene`; Open3D clouds and meshes, legacy and tensor; pyvista
            `PolyData`; ASE `Atoms`, pymatgen `Molecule`, whose elements become labels; or a `Shape`.
        name: what messages call it, where nothing names it better.
        frame: which of several objects in a file, as of `load`.
        weights: as of `Shape`; like the others only where the object does not bring its own.
        normals: as of `Shape`.
        labels: as of `Shape`.
        viewpoint: as of `Shape`.
        isolated: as of `Shape`, whatever the object says of that.

    Raises:
        InputError: an object that offers none of these, or what `load` and `Shape` refuse.
        DegenerateShapeError: fewer than two distinct points.
    """
    extra = {"weights": weights, "normals": normals, "labels": labels, "viewpoint": viewpoint}
    extra |= {"isolated": isolated}
    told: dict[str, Any] = {key: value for key, value in extra.items() if value is not None}
    _check_values(given, told)
    if isinstance(given, str | PathLike):
        return _completed(load(given, frame=frame), told)
    if frame is not None:
        raise InputError(f"frame is {frame!r}: it chooses one of the objects in a file; give its path, or leave it out")
    if isinstance(given, Shape):
        if told:
            raise InputError(f"{', '.join(told)}: belong to the Shape; give them there, or give an array of points")
        return given
    source = name if isinstance(given, tuple) else f"{type(given).__module__.partition('.')[0]} {type(given).__name__}"
    with about(source):
        content = next((made for read in _READERS if (made := read(given)) is not None), None)
        if content is not None:
            check_finite(content)
            check_distinct(content)
            if content.faces is not None:
                return _mesh(content, content.faces, told, source)
    if content is not None:
        bare = Shape(content.points, normals=content.normals, labels=content.labels, source=source)
        if content.labels is not None:
            bare = replace(bare, unit="A", elements=True, isolated=True)
        return _completed(bare, told)
    if objects_of(given) is not None:
        raise InputError(f"{name}: holds several objects; give one of them at a time")
    points = _array(given, name)
    with about(name):
        _check_size(points)
    return Shape(points, **told, source=name)


def _check_values(given: Any, told: dict[str, Any]) -> None:
    """Refuse the name of what is in a file where its values are expected: reading a file has such an option."""
    for key, value in told.items():
        if isinstance(value, str):
            file = str(given) if isinstance(given, str | PathLike) else "FILE"
            raise InputError(
                f"{key} is {value!r}, a name; expected a value for each point. What a file calls so is read with it: "
                f"symrefine.detect(symrefine.load({file!r}, {key}={value!r}))"
            )


def objects_of(given: Any) -> Sequence[Any] | None:
    """The objects of a list that holds one in each place, or the frames of a file; None of what is one object itself.

    A list of rows of numbers is one object: its points.
    """
    if isinstance(given, Frames):
        return given
    if not isinstance(given, list) or not given:
        return None
    first = given[0]
    if isinstance(first, list | tuple):
        return given if any(isinstance(v, list | tuple) or getattr(v, "ndim", 0) for v in first) else None
    return given if getattr(first, "ndim", 2) > 1 and not isinstance(first, Number) else None


def stream_of(given: Any) -> Stream | None:
    """What is read in chunks: a stream, the path of a cloud too large to hold, an array mapped from a file; else None.

    Raises:
        InputError: what `symrefine.load.stream` refuses of a large file.
    """
    if isinstance(given, Stream):
        return given
    if isinstance(given, np.memmap) and given.ndim == 2 and given.shape[1] == 3 and len(given) > STREAMED:
        return Stream.of(given, source=str(given.filename or "array"))
    return stream_if_large(given) if isinstance(given, str | PathLike) else None


def _check_size(points: Any) -> None:
    """Refuse what `load` refuses of a file: numbers so large that areas overflow. What is no array `Shape` refuses."""
    try:
        array = np.asarray(points).astype(np.float64, casting="same_kind")
    except (TypeError, ValueError, OverflowError):
        return
    if array.ndim == 2 and (np.abs(array) > LARGEST).any() and np.isfinite(array).all():
        check_finite(Content(points=array))


def _mesh(content: Content, faces: Polygons, told: dict[str, Any], source: str) -> Shape:
    """The mesh that an object holds, with the classes of its faces where they were told."""
    odd = [key for key in told if key != "labels"]
    if odd:
        raise InputError(f"{odd[0]} is for clouds; a mesh has faces, leave it out")
    if "labels" in told:
        content = replace(content, face_fields={"labels": _labels(told["labels"], len(faces))})
    return Shape(**mesh_arrays(content, faces, "labels" if told else None, source), source=source)


def _completed(shape: Shape, told: dict[str, Any]) -> Shape:
    """The shape with what was told beside it.

    Raises:
        InputError: it has that already.
    """
    twice = [name for name in told if name != "isolated" and getattr(shape, name) is not None]
    if twice:
        raise InputError(f"{shape.source}: brings its own {twice[0]}; leave {twice[0]} out, or give the points alone")
    return replace(shape, **told) if told else shape


def _labels(labels: ArrayLike, faces: int) -> Values:
    values = np.asarray(labels)
    if values.shape != (faces,):
        raise InputError(f"labels have shape {values.shape}; expected ({faces},), one for each face")
    return values


def _array(values: Any, name: str) -> Any:
    """What numpy can read, from what is on a device or carries gradients as well.

    Raises:
        InputError: a masked array, whose values do not all count; or no array at all.
    """
    if np.ma.isMaskedArray(values):
        raise InputError(f"{name}: is a masked array; give the rows that count alone, as an array without a mask")
    if _offers(values, "getbands") or _offers(values, "flip_vertical"):
        raise InputError(f"{name}: is a picture; save it, and give the path: its rows would be taken for points")
    if _offers(values, "columns", "iloc"):
        values = _frame(values, name)
    if _offers(values, "detach", "cpu"):
        try:
            values = values.detach().cpu().numpy()
        except (TypeError, NotImplementedError, RuntimeError) as error:
            raise InputError(f"{name}: is no array that numpy can hold: {error}") from None
    elif _offers(values, "cpu", "numpy"):
        values = values.cpu().numpy()
    if isinstance(values, list | tuple) and not values:
        raise InputError(f"{name}: is an empty {type(values).__name__}; expected {_EXPECTED}")
    if not isinstance(values, list | tuple) and np.asarray(values).dtype == object and np.ndim(values) == 0:
        raise InputError(f"{name}: is of type {type(values).__name__}; expected {_EXPECTED}")
    return values


def _frame(frame: Any, name: str) -> Any:
    """The coordinates in a table with titles, if it has nothing besides; any columns where none is called x."""
    titles = [str(title).lower() for title in frame.columns]
    if "x" in titles and titles not in (["x", "y"], ["x", "y", "z"]):
        raise InputError(f"{name}: has the columns {' '.join(titles)}; give those of the coordinates, x y or x y z")
    return frame.to_numpy()


def _points(values: Any) -> Any:
    """Points [N, n] as float64."""
    array = np.asarray(_array(values, "points"))
    if array.ndim != 2:
        raise InputError(f"points have shape {array.shape}; expected [N, n]")
    if not np.issubdtype(array.dtype, np.number) or np.iscomplexobj(array):
        raise InputError(f"points are {array.dtype}; expected real numbers")
    return as_float64(array)


def _faces(values: Any) -> Polygons:
    """Faces [F, k], or rows of different lengths."""
    try:
        rows = np.asarray(_array(values, "faces"))
    except ValueError:
        return polygons([_corner(corner) for corner in row] for row in values)
    if rows.ndim != 2 or not len(rows) or not np.issubdtype(rows.dtype, np.integer):
        raise InputError(f"faces have shape {rows.shape} of {rows.dtype}; expected whole numbers [F, 3], F >= 1")
    return Polygons.alike(rows.astype(np.int64))


def _corner(value: Any) -> int:
    try:
        return index(value)
    except TypeError:
        raise InputError(f"a corner of a face is {value!r}; expected a whole number") from None


def _offers(given: Any, *names: str) -> bool:
    return all(hasattr(given, name) for name in names)


def _pair(given: Any) -> Content | None:
    """`(vertices, faces)`; two points are no pair, as each of them has but one row."""
    if not isinstance(given, tuple) or len(given) != 2 or not _has_rows(given[1]):
        return None
    points = _points(given[0])
    if points.shape[1] != 3:
        raise InputError(f"vertices have {points.shape[1]} coordinates; faces are of objects in space, with 3")
    return Content(points=points, faces=_faces(given[1]))


def _has_rows(values: Any) -> bool:
    if _offers(values, "ndim"):
        return bool(values.ndim == 2)
    return isinstance(values, list | tuple) and len(values) > 0 and _offers(values[0], "__len__")


def _atoms(given: Any) -> Content | None:
    """ASE `Atoms`, pymatgen `Molecule`: the atomic numbers are labels."""
    if _offers(given, "get_positions", "get_atomic_numbers"):
        places, numbers, periodic = given.get_positions(), given.get_atomic_numbers(), bool(np.any(given.pbc))
    elif _offers(given, "cart_coords", "atomic_numbers"):
        places, numbers, periodic = given.cart_coords, given.atomic_numbers, hasattr(given, "lattice")
    else:
        return None
    if periodic:
        raise InputError(f"a {type(given).__name__} that is periodic has a space group; give the atoms of one molecule")
    return Content(points=_points(places), labels=np.array(numbers, dtype=np.int64))


def _open3d(given: Any) -> Content | None:
    """Clouds and meshes of Open3D; those of its tensor half keep positions by name."""
    if _offers(given, "vertex", "triangle"):
        return Content(points=_points(given.vertex.positions), faces=_faces(given.triangle.indices))
    if _offers(given, "vertices", "triangles", "has_triangle_normals"):
        return Content(points=_points(given.vertices), faces=_faces(given.triangles))
    if _offers(getattr(given, "point", None), "positions"):
        normals = _points(given.point.normals) if "normals" in given.point else None
        return Content(points=_points(given.point.positions), normals=normals)
    if _offers(given, "points", "has_normals"):
        return Content(points=_points(given.points), normals=_points(given.normals) if given.has_normals() else None)
    return None


def _pyvista(given: Any) -> Content | None:
    """`PolyData`, whose faces stand in one row: the number of corners, then the corners."""
    if not _offers(given, "points", "faces", "n_points", "n_strips"):
        return None
    if given.n_strips or given.n_lines:
        raise InputError("holds strips or lines; give `mesh.triangulate()`, or `mesh.points`")
    row, rows, at = np.asarray(given.faces).tolist(), [], 0
    while at < len(row):
        rows.append(row[at + 1 : at + 1 + row[at]])
        at += 1 + row[at]
    return Content(points=_points(given.points), faces=polygons(rows) if rows else None)


def _scene(given: Any) -> Content | None:
    """`Scene` of trimesh: its meshes, each where the scene puts it."""
    if not _offers(given, "geometry", "to_mesh", "graph"):
        return None
    if not given.geometry:
        raise InputError("is a scene that holds nothing; expected meshes")
    return replace(flattened(given), split=False)


def _trimesh(given: Any) -> Content | None:
    """`Trimesh` and `PointCloud`, and whatever else calls its points vertices."""
    if not _offers(given, "vertices"):
        return None
    if _offers(given, "entities"):
        raise InputError("is a path of lines; expected a mesh or a cloud")
    faces = getattr(given, "faces", None)
    return Content(points=_points(given.vertices), faces=None if faces is None else _faces(faces))


_READERS: tuple[Callable[[Any], Content | None], ...] = (_pair, _atoms, _open3d, _pyvista, _scene, _trimesh)
