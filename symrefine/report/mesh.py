"""Meshes for a page: small enough to be mailed, and fine enough that a colour for each vertex tells where it misses."""

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index

# Growth of the longest edge until the triangles are few enough.
COARSER = 1.3


def simplified(points: Array, faces: Index, most: int) -> tuple[Array, Index]:
    """At most about `most` triangles that look the same (quadric error metrics, Garland and Heckbert 1997)."""
    if len(faces) <= most:
        return points, faces
    from symrefine.load.open3d import open3d

    o3d = open3d()
    corners, triangles = np.array(points), np.array(faces, dtype=np.int32)  # it takes nothing that is read-only
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(corners), o3d.utility.Vector3iVector(triangles))
    mesh.merge_close_vertices(1e-9 * float(np.linalg.norm(np.ptp(points, axis=0))))
    mesh = mesh.simplify_quadric_decimation(most)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)


def subdivided(points: Array, faces: Index, longest: float, most: int) -> tuple[Array, Index, Index]:
    """The same surface with edges up to `longest`, or longer ones where that takes more than `most` triangles.

    Returns:
        Vertices, triangles, and the triangle of the input that each is a part of.
    """
    while True:
        made = _split(points, faces, longest, most)
        if made is not None:
            return made
        longest *= COARSER


def _split(points: Array, faces: Index, longest: float, most: int) -> tuple[Array, Index, Index] | None:
    """All edges beyond `longest` halved, again and again; None if that makes too many triangles."""
    owner = np.arange(len(faces))
    while True:
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        too_long = np.linalg.norm(points[ends[..., 0]] - points[ends[..., 1]], axis=2) > longest
        if not too_long.any():
            return points, faces, owner
        if len(faces) + too_long.sum() > most:
            return None
        edges, which = np.unique(np.sort(ends[too_long], axis=1), axis=0, return_inverse=True)
        middle = np.full(faces.shape, -1)
        middle[too_long] = len(points) + which.reshape(-1)
        points = np.concatenate([points, points[edges].mean(axis=1)])
        faces, part = _halved(faces, middle)
        owner = owner[part]


def _halved(faces: Index, middle: Index) -> tuple[Index, Index]:
    """Triangles [F, 3] cut at the middles [F, 3] of their edges (k, k + 1), -1 where an edge stays; and of which each
    is a part. Neighbours share middles, so that no gap opens."""
    count = (middle >= 0).sum(axis=1)
    # Turned until the edges that are cut come first.
    turn = np.where(count == 1, (middle >= 0).argmax(axis=1), np.where(count == 2, (middle < 0).argmax(axis=1) + 1, 0))
    columns = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, columns, axis=1).T
    p, q, r = np.take_along_axis(middle, columns, axis=1).T
    patterns = {
        0: [(a, b, c)],
        1: [(a, p, c), (p, b, c)],
        2: [(a, p, q), (p, b, q), (a, q, c)],
        3: [(a, p, r), (p, b, q), (r, q, c), (p, q, r)],
    }
    made, part = [], []
    for cuts, triangles in patterns.items():
        chosen = np.flatnonzero(count == cuts)
        for corners in triangles:
            made.append(np.stack([corner[chosen] for corner in corners], axis=1))
            part.append(chosen)
    return np.concatenate(made), np.concatenate(part)
