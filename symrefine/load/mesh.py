"""Faces as a file holds them, made into a triangle mesh in which every vertex counts and every triangle has area."""

import logging
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load.content import Content, Polygons
from symrefine.load.labels import triangle_classes
from symrefine.load.paint import texture_of
from symrefine.load.polygons import negligible, triangulate
from symrefine.shape import Index
from symrefine.surface.ordered import distinct

_LOG = logging.getLogger(__name__)


def mesh_arrays(content: Content, faces: Polygons, labels: str | None, source: str) -> dict[str, Any]:
    """Points [V, 3], triangles [T, 3] and their classes [T], or None, of a file with faces, by the names `Shape` has.

    Polygons are triangulated; vertices that the format repeats are merged; triangles without area and vertices
    without a face carry no mass and go, so that they influence nothing.

    Args:
        labels: name of a field of the faces or the vertices that becomes the classes of the triangles.
        source: name of the file, for the log.

    Raises:
        InputError: indices out of range, crossing outlines, no area at all, no such field.
    """
    _check_range(content, faces)
    triangles, owner = triangulate(content, faces)
    corners = triangles
    points, triangles = _merged(content.points, triangles) if content.split else (content.points, triangles)
    flat = negligible(points, triangles)
    if flat.all():
        raise InputError(
            f"no face has an area (first: {content.name('face', int(owner[0]))}, corners "
            f"{points[triangles[0]].tolist()}); a mesh needs faces that are not collapsed to a line or a point"
        )
    used, compact = np.unique(triangles[~flat], return_inverse=True)
    _LOG.info(
        "%s: %d vertices, %d triangles; left out %d triangles without area and %d vertices without a face",
        source, len(used), int((~flat).sum()), int(flat.sum()), len(points) - len(used),
    )  # fmt: skip
    none = None, None
    classes, kinds = none if labels is None else triangle_classes(content, labels, owner[~flat], corners[~flat])
    arrays = {"points": points[used], "faces": compact.reshape(-1, 3), "labels": classes, "kinds": kinds}
    if content.paint is None:
        return arrays
    return arrays | {"texture": texture_of(content.paint, faces, corners[~flat], owner[~flat])}


def _check_range(content: Content, faces: Polygons) -> None:
    bad = np.flatnonzero((faces.corners < 0) | (faces.corners >= len(content.points)))
    if bad.size:
        row = int(np.searchsorted(faces.starts, bad[0], side="right")) - 1
        first = content.first_index
        raise InputError(
            f"{content.name('face', row)} refers to vertex {faces.corners[bad[0]] + first}; there are "
            f"{len(content.points)} vertices, numbered {first} to {len(content.points) - 1 + first}"
        )


def _merged(points: Array, triangles: Index) -> tuple[Array, Index]:
    """One vertex for each set of exactly equal ones, in the order of their first appearance."""
    kept, compact = distinct(points, None)  # -0.0 equals 0.0 here, as it should
    return points[kept], compact[triangles]
