"""The classes of two objects, as one object sees those of the other."""

from dataclasses import replace

import numpy as np

from symrefine.align.alignment import Nearness
from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.shape import Index, Shape
from symrefine.texture import COLOUR_TOLERANCE


def with_one_set_of_classes(source: Shape, target: Shape) -> tuple[Shape, Shape]:
    """Both with labels 0, 1, ... that mean the same in either; without any where only one has some, or all are alike.

    Numbers and texts are the same where they are equal, colours where they are near enough.

    Raises:
        InputError: classes that cannot be compared, or of solids.
    """
    if source.labels is None or target.labels is None:
        return tuple(s if s.labels is None else replace(s, labels=None, kinds=None) for s in (source, target))  # type: ignore[return-value]
    for shape in (source, target):
        if shape.measure == "solid":
            raise InputError(f"{shape.source}: labels are of its surface, and it is taken as a solid; leave one out")
    one, other = _compared(source, target)
    every, own = np.unique(np.concatenate([one, other]), return_inverse=True)
    own = own.reshape(-1)
    parts = (own[: len(one)], own[len(one) :]) if len(every) > 1 else (None, None)
    first, second = (replace(s, labels=part, kinds=None) for s, part in zip((source, target), parts, strict=True))
    return first, second


def nearest_both_ways(
    moved: Array, target: Array, labels: tuple[Index | None, Index | None], size: float
) -> tuple[Array, Array]:
    """Distances over a size from points [N, n] to the nearest of [M, n], [N], and back, [M].

    Points of different classes stand apart by the size along one more coordinate, where there are classes.
    """
    from scipy.spatial import cKDTree

    one, other = (set_apart(points, own, size) for points, own in zip((moved, target), labels, strict=True))
    return cKDTree(other).query(one)[0] / size, cKDTree(one).query(other)[0] / size


def set_apart(points: Array, labels: Index | None, size: float) -> Array:
    """Points [..., N, n] of the classes [N] with one more coordinate, in which these stand apart by a size."""
    if labels is None:
        return points
    return np.concatenate([points, np.broadcast_to(size * labels, points.shape[:-1])[..., None]], axis=-1)


def nearness(
    source: Shape, target: Shape, matrix: Array, translation: Array, scale: float, tolerance: float
) -> Nearness:
    """How near the points of the moved source and of the target come to one another; of meshes those of any class."""
    moved, labels = scale * (source.points @ matrix.T) + translation, (source.labels, target.labels)
    if source.faces is not None or target.faces is not None:  # classes are those of faces, and points are vertices
        labels = (None, None)
    there, back = nearest_both_ways(moved, target.points, labels, target.diagonal)
    shares = float((there <= tolerance).mean()), float((back <= tolerance).mean())
    return Nearness(rms=float(np.sqrt(np.mean(there**2))), overlap=shares)


def _compared(source: Shape, target: Shape) -> tuple[Index, Index]:
    """The labels of both, such that those which mean the same are the same."""
    assert source.labels is not None
    assert target.labels is not None
    a, b = source.kinds, target.kinds
    if a is None and b is None:
        return source.labels, target.labels
    if a is None or b is None or a.ndim != b.ndim:
        raise InputError(
            f"the labels of {source.source} are {_words(a)}, those of {target.source} {_words(b)}; "
            "expected the same in both"
        )
    same = _nearest_colours(a, b) if a.ndim == 2 else [np.flatnonzero(a == text) for text in b]
    place = np.array([int(found[0]) if len(found) else len(a) + k for k, found in enumerate(same)], dtype=np.int64)
    return source.labels, place[target.labels]


def _nearest_colours(known: Array, colours: Array) -> list[Index]:
    """Of each of colours [K, 3] the known one that is nearest, if it is the same."""
    away = np.linalg.norm(colours[:, None] - known, axis=2)
    return [np.array([row.argmin()]) if row.min() <= COLOUR_TOLERANCE else np.zeros(0, dtype=np.int64) for row in away]


def _words(kinds: Array | None) -> str:
    if kinds is None:
        return "numbers"
    return "colours" if kinds.ndim == 2 else "texts"
