"""Triangles of a mesh, measured once: which are but a part of an edge, which lie in one plane with a neighbour."""

from dataclasses import dataclass, replace

import numpy as np

from symrefine.geometry import Array, Mask, column_dots
from symrefine.shape import Index
from symrefine.surface.neighbourhoods import smallest_eigenvectors
from symrefine.surface.ordered import ordered


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triangles:
    """Triangles [F, 3] of points, and integers [F] that tell them apart. Vectors stand in columns: so sums are quick.

    Attributes:
        points: [3, N].
        faces: [F, 3].
        labels: [F].
        across: [3, F] normals, as long as twice the area.
        areas: [F] twice the area.
        sides: [3, F] lengths: from the first corner to the second, and so on.
    """

    points: Array
    faces: Index
    labels: Index
    across: Array
    areas: Array
    sides: Array

    @classmethod
    def of(cls, points: Array, faces: Index, labels: Index) -> "Triangles":
        """Triangles [F, 3] of points [N, 3], and their labels [F]."""
        columns = np.ascontiguousarray(points.T)
        first, second, third = (_of(columns, corner) for corner in np.ascontiguousarray(faces.T))
        one, two = second - first, third - second
        across = _cross(one, two)
        sides = np.array([_norm(one), _norm(two), _norm(first - third)])
        return cls(points=columns, faces=faces, labels=labels, across=across, areas=_norm(across), sides=sides)

    def only(self, rows: Mask) -> "Triangles":
        """Some of the triangles."""
        if rows.all():
            return self
        return replace(
            self,
            faces=self.faces[rows],
            labels=self.labels[rows],
            across=self.across[:, rows],
            areas=self.areas[rows],
            sides=self.sides[:, rows],
        )

    def slivers(self, within: float) -> Mask:
        """Which triangles [F] are but a part of an edge of others: no wider than that, and along one.

        Those that close the gap where a corner of one triangle lies on the edge of another.
        """
        longest = self.sides.max(axis=0)
        thin: Mask = np.asarray(self.areas <= within * longest)
        if not thin.any():
            return thin
        edge, rows = self._edges().reshape(-1, 3), np.flatnonzero(thin)
        along, own = np.unique(edge[rows, self.sides.argmax(axis=0)[rows]], return_inverse=True)
        place = np.minimum(np.searchsorted(along, edge), len(along) - 1)
        place[along[place] != edge] = len(along)
        covered: Mask = np.asarray(~self.sides.any(axis=0))
        there = np.zeros(len(along) + 1, dtype=bool)
        there[place[~thin | covered]] = True
        while True:  # what lies along an edge of such a one does, too
            more = rows[there[own.ravel()] & ~covered[rows]]
            if not len(more):
                return covered & ~covered.all()  # where there is nothing else they are the shape
            covered[more] = there[place[more]] = True

    def pairs(self, within: float) -> tuple[Index, Index]:
        """Triangles that share an edge, lie in one plane on both sides of it, and have the same label.

        Four corners are in one plane if moving each by no more than `within` brings them there: what they enclose
        changes by as much times the area across from each. A plane through a small triangle would tell little of a
        large one.
        """
        order, first = ordered([self._edges()])
        # An edge of three triangles or more is where facets meet.
        first = first[np.diff(np.append(first, len(order))) == 2]
        one, two = order[first], order[first + 1]
        alike = self.labels[one // 3] == self.labels[two // 3]
        if not alike.all():
            one, two = one[alike], two[alike]
        flat = self._plane(one, two, within)
        one, two = one[flat], two[flat]
        unfolded = self._unfolded(one, two, within)
        return one[unfolded] // 3, two[unfolded] // 3

    def _edges(self) -> Index:
        """A number [3 F] for each edge, of one triangle after the other."""
        first, second, third = np.ascontiguousarray(self.faces.T)
        pairs = ((first, second), (second, third), (third, first))
        count = self.points.shape[1]
        return np.column_stack([np.minimum(a, b) * count + np.maximum(a, b) for a, b in pairs]).ravel()

    def _plane(self, one: Index, two: Index, within: float) -> Index:
        """Which of pairs of sides [P], each the same edge of two triangles, have four corners in one plane; indices."""
        near, far = one // 3, two // 3
        corners = self.faces.ravel()
        start, beyond = corners[one], corners[3 * far + (two + 2) % 3]
        volume = np.abs(column_dots(_of(self.across, near), _of(self.points, beyond) - _of(self.points, start)))
        least = self.areas[near] + self.areas[far]
        # Twice the other two areas, each of two sides that meet, are no more than twice the square of the longest.
        longest = self.sides.max(axis=0)
        most = least + 2.0 * np.maximum(longest[near], longest[far]) ** 2
        rows = np.flatnonzero(volume <= within * most)
        unsure = volume[rows] > within * least[rows]
        if unsure.any():
            some = rows[unsure]
            first, last = (3 * near[some] + (one[some] + turn) % 3 for turn in (1, 2))
            places = (start[some], corners[first], corners[last], beyond[some])
            from_, to, apex, other = (_of(self.points, place) for place in places)
            more = _norm(_cross(apex - from_, other - from_)) + _norm(_cross(apex - to, other - to))
            unsure[unsure] = volume[some] > within * (least[some] + more)
        return np.asarray(rows[~unsure])

    def _unfolded(self, one: Index, two: Index, within: float) -> Mask:
        """Which of pairs of sides [P] have a triangle on either side.

        Folded over, two triangles of a plane lie on each other: by as much as the smaller one reaches.
        """
        near, far = one // 3, two // 3
        corners = self.faces.ravel()
        length = self.sides.T.ravel()[one]
        # Seen along the edge in one sense, normals of what lies on both its sides point in opposite ones.
        inner = column_dots(_of(self.across, near), _of(self.across, far))
        inner = np.where(corners[one] == corners[two], inner, -inner)
        unfolded = inner <= within * length * np.maximum(self.areas[near], self.areas[far])
        if (none := np.flatnonzero(length == 0.0)).size:  # of an edge without length all that is told is where they go
            apex, beyond = (corners[3 * (of[none] // 3) + (of[none] + 2) % 3] for of in (one, two))
            own, other = (self.points[:, of] - self.points[:, corners[one[none]]] for of in (apex, beyond))
            unfolded[none] = column_dots(own, other) <= within * np.maximum(_norm(own), _norm(other))
        return np.asarray(unfolded)

    def planes(self, rows: Index, of: Index) -> tuple[Array, Array]:
        """Unit normals [3, K] of the planes some triangles [R] are in, each in one, and how far off they are [R]."""
        count = int(of.max()) + 1
        corners = [_of(self.points, corner) for corner in np.ascontiguousarray(self.faces[rows].T)]
        uses = 3.0 * np.bincount(of, minlength=count)
        middle = np.array([_summed(values, of, count) for values in sum(corners, start=np.zeros(()))]) / uses
        corners = [corner - _of(middle, of) for corner in corners]
        spread = np.empty((3, 3, count))
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            products = sum((corner[i] * corner[j] for corner in corners), start=np.zeros(()))
            spread[i, j] = spread[j, i] = _summed(products, of, count)
        normals = _sharpened(np.ascontiguousarray(smallest_eigenvectors(spread.transpose(2, 0, 1))[1].T), spread)
        own = _of(normals, of)
        return normals, np.max([np.abs(column_dots(corner, own)) for corner in corners], axis=0)


def _sharpened(normals: Array, spread: Array) -> Array:
    """Unit normals [3, K] of planes, as near as rounding allows: those in closed form are off along narrow facets.

    The first step of Jacobi's rotations, of the normal alone, towards where its spread [3, 3, K] has no product with
    that along the plane.
    """
    columns = np.arange(normals.shape[1])
    axis = np.zeros_like(normals)
    axis[np.abs(normals).argmin(axis=0), columns] = 1.0
    one = _cross(normals, axis)
    one /= _norm(one)
    two = _cross(normals, one)
    across, along, beside = ((spread * way).sum(axis=1) for way in (normals, one, two))
    least = column_dots(normals, across)
    a, b, c = column_dots(one, along) - least, column_dots(one, beside), column_dots(two, beside) - least
    p, q = column_dots(one, across), column_dots(two, across)
    scale = a * c - b * b
    told = scale > 0.0  # else any plane through a line does
    scale = np.where(told, scale, 1.0)
    turned = (
        normals
        - np.where(told, (c * p - b * q) / scale, 0.0) * one
        - np.where(told, (a * q - b * p) / scale, 0.0) * two
    )
    return np.asarray(turned / _norm(turned))


def _summed(values: Array, of: Index, count: int) -> Array:
    """Sums [K] of values [R], each of one."""
    return np.asarray(np.bincount(of, weights=values, minlength=count))


def _of(columns: Array, chosen: Index) -> Array:
    """Some of columns [3, N], with indices [K]: quicker than by brackets."""
    return np.take(columns, chosen, axis=1)


def _cross(a: Array, b: Array) -> Array:
    """Vectors [3, K] across others."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _norm(a: Array) -> Array:
    """Lengths [K] of vectors [3, K]."""
    return np.sqrt(column_dots(a, a))
