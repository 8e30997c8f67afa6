"""Polygons to triangles without changing the surface: no overlap on concave faces, no preference for a vertex order."""

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z
from symrefine.load.content import Content, Polygons
from symrefine.shape import Index

Flags = NDArray[np.bool_]

# Relative to the polygon's own area: far above rounding, far below any corner that is meant to be concave.
FLAT = 1e-9
# Squares of the numbers of corners of all outlines that are cut ear by ear, together: two seconds or so.
MOST = 10_000**2


def triangulate(content: Content, faces: Polygons) -> tuple[Index, Index]:
    """Triangles [T, 3] of all faces and the face [T] each is part of, in the order of the faces.

    A quadrilateral is cut along its shorter diagonal, so that mirror images are cut alike even where they are not
    flat; other polygons are fans where convex, cut ear by ear where not.

    Raises:
        InputError: fewer than three corners; outlines that cross themselves, or are cut ear by ear and too long.
    """
    few = np.flatnonzero(faces.counts < 3)
    if few.size:
        row = int(few[0])
        raise InputError(f"{content.name('face', row)} has {faces.counts[row]} corners; expected at least 3")
    triples = np.flatnonzero(faces.counts == 3)
    quads = np.flatnonzero(faces.counts == 4)
    pieces = [_gather(faces, triples, 3), _quads(content, faces, quads)]
    owners = [triples, np.repeat(quads, 2)]
    steps, starts = 0, faces.starts
    for row in np.flatnonzero(faces.counts > 4).tolist():
        corners = faces.corners[starts[row] :][: faces.counts[row]]
        local, outline = _fan(content.points[corners])
        if len(outline):
            steps += len(outline) ** 2
            if steps > MOST:
                raise InputError(
                    f"{content.name('face', row)} is concave and has {len(outline):,} corners; all such faces together "
                    f"may take {MOST:,} steps, the square of the corners of each: split it into triangles"
                )
            local = _clip_ears(outline)
        if len(local) == 0:
            raise _crossing(content, row)
        pieces.append(corners[local])
        owners.append(np.full(len(local), row))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order]


def negligible(points: Array, triangles: Index) -> Flags:
    """[T] triangles whose area is within the rounding of their own coordinates."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.sqrt((edges**2).sum(axis=2).max(axis=0))
    reach = np.abs(np.stack([a, b, c])).max(axis=(0, 2))
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # |da x e| <= |e| |da|, da the rounding of the coordinates and of their differences.
    return np.asarray(doubled_area <= 8.0 * np.finfo(np.float64).eps * longest * (longest + reach))


def _gather(faces: Polygons, rows: Index, corners: int) -> Index:
    return np.asarray(faces.corners[faces.starts[rows][:, None] + np.arange(corners)])


def _quads(content: Content, faces: Polygons, rows: Index) -> Index:
    """Both halves [2Q, 3] of each quadrilateral, along the shorter of the diagonals that lie inside."""
    if len(rows) == 0:
        return np.empty((0, 3), dtype=np.int64)
    quads = _gather(faces, rows, 4)
    first, second = quads[:, [[0, 1, 2], [0, 2, 3]]], quads[:, [[0, 1, 3], [1, 2, 3]]]
    p = content.points[quads]
    # The Newell normal of a quadrilateral, twice its area vector, is the product of its diagonals.
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    valid_first, valid_second = (_inside(content.points, halves, normal) for halves in (first, second))
    bad = np.flatnonzero(~(valid_first | valid_second))
    if bad.size:
        raise _crossing(content, int(rows[bad[0]]))
    shorter = ((p[:, 2] - p[:, 0]) ** 2).sum(axis=1) <= ((p[:, 3] - p[:, 1]) ** 2).sum(axis=1)
    use_first = valid_first & (shorter | ~valid_second)
    return np.where(use_first[:, None, None], first, second).reshape(-1, 3)


def _inside(points: Array, halves: Index, normal: Array) -> Flags:
    """[Q] whether both halves [Q, 2, 3] turn the way the whole does, that is, do not overlap."""
    p = points[halves]
    area = np.cross(p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0])
    size = np.linalg.norm(area, axis=2)
    agrees = np.einsum("qhk,qk->qh", area, normal) > -FLAT * size * np.linalg.norm(normal, axis=1)[:, None]
    # The halves of a symmetric bow tie cancel: its normal is zero, though it has area.
    cancels = np.linalg.norm(normal, axis=1) <= FLAT * size.sum(axis=1)
    empty = negligible(points, halves.reshape(-1, 3)).reshape(-1, 2)
    return np.asarray((agrees | empty).all(axis=1) & (~cancels | empty.all(axis=1)))


def _fan(points: Array) -> tuple[Index, Array]:
    """Triangles [n - 2, 3] of one polygon [n, 3], none if its outline crosses itself; that [n, 2] if it is concave."""
    inner, convex = np.arange(1, len(points) - 1), np.empty((0, 2))
    fan = np.stack([np.zeros_like(inner), inner, inner + 1], axis=1)
    if negligible(points, fan).all():
        return fan, convex
    following = np.roll(points, -1, axis=0)
    areas = np.cross(points - points[0], following - points[0])
    normal = areas.sum(axis=0)
    if np.linalg.norm(normal) <= FLAT * np.linalg.norm(areas, axis=1).sum():
        return fan[:0], convex
    flat = (points - points[0]) @ frame_with_z(normal)[:2].T
    if _is_convex(flat):
        return fan, convex
    return fan[:0], convex if _runs_twice(flat) else flat


def _runs_twice(flat: Array) -> bool:
    """Whether the outline [n, 2] runs along an edge twice the same way: a bridge to a hole it runs there and back."""
    edges = np.column_stack([flat, np.roll(flat, -1, axis=0)])
    edges = edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
    return len(np.unique(edges, axis=0)) < len(edges)


def _is_convex(flat: Array) -> bool:
    """Whether the outline [n, 2] only turns left, and once around in total."""
    edge = np.roll(flat, -1, axis=0) - flat
    edge = edge[edge.any(axis=1)]
    after = np.roll(edge, -1, axis=0)
    turn = np.arctan2(_cross(edge, after), (edge * after).sum(axis=1))
    return bool((turn > -FLAT).all() and abs(turn.sum() - 2.0 * np.pi) < 1e-6)


def _clip_ears(flat: Array) -> Index:
    """Cut off the ear with the shortest diagonal until a triangle is left; nothing if there is no ear."""
    corners = _Corners(flat)
    triangles = []
    for _ in range(len(flat) - 3):
        k = int(np.argmin(np.where(corners.occupants == 0, corners.diagonals, np.inf)))
        if corners.occupants[k] or not np.isfinite(corners.diagonals[k]):
            return np.empty((0, 3), dtype=np.int64)
        triangles.append(corners.cut(k))
    a, b, c = flat[corners.left]
    if _cross(b - a, c - a) < -corners.tolerance:
        return np.empty((0, 3), dtype=np.int64)
    return np.array([*triangles, tuple(np.flatnonzero(corners.left))], dtype=np.int64)


class _Corners:
    """The corners of an outline [n, 2] that are left, each with the triangle of its two neighbours and itself.

    One that is cut off changes the triangles of two others, and leaves those that it stood in: n operations each time.

    Attributes:
        left: [n] whether a corner is not cut off.
        diagonals: [n] squared distances of the two neighbours; infinite where the outline turns right, or is cut off.
        occupants: [n] how many other corners a triangle holds.
        tolerance: of twice an area.
    """

    def __init__(self, flat: Array) -> None:
        count = len(flat)
        self.tolerance = FLAT * float(np.ptp(flat, axis=0).max()) ** 2
        # One on the diagonal would pinch what is left; one on the two sides belongs to a bridge to a hole.
        self._least = np.array([[self.tolerance], [self.tolerance], [-self.tolerance]])
        self._flat, self._before, self._after = flat, np.arange(-1, count - 1) % count, np.arange(1, count + 1) % count
        self.left, self.diagonals = np.ones(count, dtype=bool), np.zeros(count)
        self.occupants = np.zeros(count, dtype=np.int64)
        # Along the normals of its sides a point of a triangle is farther than the sides are, which reach so far.
        self._normals, self._reach = np.zeros((2, 3, count)), np.zeros((3, count))
        self._look(np.arange(count))

    def cut(self, k: int) -> tuple[int, int, int]:
        """Cut off a corner; its triangle."""
        a, c = int(self._before[k]), int(self._after[k])
        self.occupants -= self._holds(slice(None), k)
        self._after[a], self._before[c] = c, a
        self.left[k], self.diagonals[k] = False, np.inf
        self._look(np.array([a, c]))
        return a, k, c

    def _look(self, corners: Index) -> None:
        """Look at corners whose neighbours are new."""
        triangle = self._flat[np.stack([self._before[corners], corners, self._after[corners]])]
        sides = np.roll(triangle, -1, axis=0) - triangle
        turns_left = _cross(sides[0], sides[1]) >= -self.tolerance
        self.diagonals[corners] = np.where(turns_left, (sides[2] ** 2).sum(axis=1), np.inf)
        self._normals[:, :, corners] = np.stack([-sides[..., 1], sides[..., 0]])
        self._reach[:, corners] = _cross(sides, triangle)
        for corner in corners:
            self.occupants[corner] = np.count_nonzero(self._holds(slice(corner, corner + 1), slice(None)) & self.left)

    def _holds(self, corners: slice, points: int | slice) -> Flags:
        """Which triangles hold a point, or which points a triangle holds."""
        x, y = self._flat[points].T
        across = self._normals[0, :, corners] * x + self._normals[1, :, corners] * y
        return np.asarray((across - self._reach[:, corners] > self._least).all(axis=0))


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _crossing(content: Content, row: int) -> InputError:
    return InputError(
        f"the outline of {content.name('face', row)} crosses or folds over itself; split it into triangles"
    )
