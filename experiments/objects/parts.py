"""Closed parts that shapes are put together from, each with marks that tell its symmetry exactly, and their group.

A mesh of a round part is a polyhedron and shows only the symmetry of its facets. So every part carries marks: the
corners of a polyhedron, the points on the axis of a surface of revolution, the centre of a ball, labelled by what they
belong to. The operations that map the marks of a shape onto themselves are its point group, found by brute force.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from experiments.objects.shapes import box, join, revolve
from symrefine.geometry import Array, frame_with_z, read_only, rotation
from symrefine.groups import PointGroup, identify, point_group
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.shape import Index, Shape

EXACT = 1e-6
# Marks nearer than this to the centre, or to a line through it, tell no direction.
ASIDE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """A closed surface; `marks` [K, 4] are points and labels that determine it up to its mesh."""

    vertices: Array
    faces: Index
    marks: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", read_only(self.vertices))
        object.__setattr__(self, "marks", read_only(self.marks))

    @property
    def area(self) -> float:
        """Area of the surface."""
        return float(triangle_areas_and_normals(self.vertices, self.faces)[0].sum())

    def moved(self, shift: Sequence[float] | Array) -> "Part":
        """The part elsewhere."""
        return self.turned(np.eye(3), shift)

    def turned(self, matrix: Array, shift: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> "Part":
        """The image under x -> matrix x + shift, the matrix of determinant +1 or -1."""
        faces = self.faces if np.linalg.det(matrix) > 0 else self.faces[:, ::-1]
        marks = np.column_stack([self.marks[:, :3] @ matrix.T + shift, self.marks[:, 3]])
        return Part(vertices=self.vertices @ matrix.T + shift, faces=faces, marks=marks)


def _part(vertices: Array, faces: Index, points: Array, labels: Array | float = 0.0) -> Part:
    """A part whose marks are labelled by its area too, so that different parts do not match."""
    area = triangle_areas_and_normals(vertices, faces)[0].sum()
    marks = np.column_stack([points, np.broadcast_to(np.asarray(labels, dtype=float) + area, len(points))])
    return Part(vertices=vertices, faces=faces, marks=marks)


def block(center: Sequence[float], size: Sequence[float], turn_rad: float = 0.0) -> Part:
    """A box, turned about its own vertical axis."""
    vertices, faces = box(center, size, turn_rad)
    return _part(vertices, faces, vertices)


def hull(points: Array | Sequence[Sequence[float]]) -> Part:
    """The convex hull of points [K, 3], all of them corners."""
    vertices = np.asarray(points, dtype=float)
    found = ConvexHull(vertices)
    a, b, c = (vertices[found.simplices[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0
    faces = np.where(inwards[:, None], found.simplices[:, ::-1], found.simplices).astype(np.int64)
    return _part(vertices, faces, vertices)


def spun(profile: Sequence[Sequence[float]], segments: int = 96) -> Part:
    """Surface of revolution about z of a polyline of (radius, height), upwards on the outside."""
    vertices, faces = revolve(profile, segments)
    outline = np.unique(np.asarray(profile, dtype=float), axis=0)  # a closed profile names its first point twice
    axis = np.column_stack([np.zeros((len(outline), 2)), outline[:, 1]])
    return _part(vertices, faces, axis, 100.0 * (1.0 + outline[:, 0]))


def cylinder(radius: float, low: float, high: float, segments: int = 96) -> Part:
    """A solid cylinder about z."""
    return spun([(0, low), (radius, low), (radius, high), (0, high)], segments)


def pipe(inner: float, outer: float, low: float, high: float) -> Part:
    """A hollow cylinder about z, open at both ends."""
    return spun([(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)])


def rod(start: Sequence[float] | Array, end: Sequence[float] | Array, radius: float, tip: float | None = None) -> Part:
    """A solid cylinder between two points, or a cone with the radius `tip` at its end."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    last = radius if tip is None else tip
    upright = spun([(0, 0), (radius, 0), (last, float(np.linalg.norm(b - a))), (0, float(np.linalg.norm(b - a)))], 48)
    return upright.turned(frame_with_z(b - a).T, a)


def ball(radius: float, center: Sequence[float] | Array = (0.0, 0.0, 0.0), segments: int = 48) -> Part:
    """A ball."""
    t = np.linspace(0, np.pi, segments // 2 + 1)
    vertices, faces = revolve(radius * np.stack([np.sin(t), -np.cos(t)], axis=1), segments)
    return _part(vertices, faces, np.zeros((1, 3))).moved(center)


def extruded(outline: Array, low: float, high: float) -> Part:
    """A prism over a polygon [K, 2] around the origin, every corner of which is seen from there."""
    return stacked(np.stack([np.column_stack([outline, np.full(len(outline), z)]) for z in (low, high)]), outline)


def stacked(rings: Array, corners: Array | None = None) -> Part:
    """The solid between rings [H, K, 3] of points around the z axis, from below, closed by fans at both ends."""
    middle = np.array([[0.0, 0.0, rings[0, :, 2].mean()], [0.0, 0.0, rings[-1, :, 2].mean()]])
    return _walled(rings, middle, rings.reshape(-1, 3) if corners is None else np.concatenate([rings[0], rings[-1]]))


def lofted(rings: Array) -> Part:
    """The solid between rings [H, K, 3] along any path, anticlockwise as seen from its end, each seen from its mean."""
    return _walled(rings, rings[[0, -1]].mean(axis=1), rings.reshape(-1, 3))


def _walled(rings: Array, middle: Array, marks: Array) -> Part:
    """The walls between rings [H, K, 3] and a fan from either of two points [2, 3] over the ends."""
    count = rings.shape[1]
    around, following = np.arange(count), (np.arange(count) + 1) % count
    bottom = len(rings) * count
    fan = np.stack([np.full(count, bottom), following, around], axis=1)
    top = np.stack([np.full(count, bottom + 1), around + bottom - count, following + bottom - count], axis=1)
    faces = np.concatenate([_sides(len(rings), count), fan, top])
    return _part(np.concatenate([rings.reshape(-1, 3), middle]), faces, marks)


def bored(outside: Array, inside: Array) -> Part:
    """The solid between an outer wall [H, K, 3] and the wall [L, K, 3] of a bore, both from below, angle by angle."""
    rings = np.concatenate([outside, inside[::-1], outside[:1]])
    return _part(rings[:-1].reshape(-1, 3), _closed_sides(len(rings) - 1, rings.shape[1]), rings[:-1].reshape(-1, 3))


def _sides(rings: int, count: int) -> Index:
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(count), indexing="ij")
    a, b = i * count + j, i * count + (j + 1) % count
    both = [np.stack([a, b, b + count], axis=-1), np.stack([a, b + count, a + count], axis=-1)]
    return np.concatenate([f.reshape(-1, 3) for f in both])


def _closed_sides(rings: int, count: int) -> Index:
    """The same with the last ring joined to the first."""
    return _sides(rings + 1, count) % (rings * count)


def orbit(part: Part, group: str) -> list[Part]:
    """The different images of a part under a group in its standard placement."""
    copies: list[Part] = []
    for operation in point_group(group).operations():
        image = part.turned(operation)
        if not any(_same(image.marks, other.marks) for other in copies):
            copies.append(image)
    return copies


def ring_of(part: Part, fold: int) -> list[Part]:
    """`fold` copies of a part around z."""
    return [part.turned(rotation([0, 0, 1], 2 * np.pi * j / fold)) for j in range(fold)]


def assembled(parts: Sequence[Part]) -> Shape:
    """One surface from several parts."""
    return join([(p.vertices, p.faces) for p in parts])


def exact_group(parts: Sequence[Part]) -> str:
    """The point group of the marks of all parts, by trying every map of two marks onto two others of their kind."""
    return placed_group(parts)[0].name


def placed_group(parts: Sequence[Part]) -> tuple[PointGroup, Array]:
    """The same in place, and the centre [3] that its operations leave where it is."""
    return marked_group(np.concatenate([p.marks for p in parts]))


def marked_group(marks: Array) -> tuple[PointGroup, Array]:
    """The group of labelled points [K, 4] in place, and its centre [3]."""
    marks = marks[np.unique(marks.round(6) + 0.0, axis=0, return_index=True)[1]]
    center = marks[:, :3].mean(axis=0)
    marks[:, :3] -= center
    _, strengths, directions = np.linalg.svd(marks[:, :3], full_matrices=False)
    if strengths[0] < EXACT:
        return PointGroup(name="Kh"), center
    if strengths[1] < EXACT:
        name = "Dinfh" if _same(marks * [-1, -1, -1, 1], marks) else "Cinfv"
        return PointGroup(name=name, frame=frame_with_z(directions[0])), center
    return identify(_operations(marks)), center


def _operations(marks: Array) -> Array:
    """Every orthogonal matrix that maps the centred marks [K, 4] onto themselves."""
    first = _rarest(marks, np.linalg.norm(marks[:, :3], axis=1) > ASIDE)
    aside = np.linalg.norm(np.cross(marks[:, :3], marks[first, :3]), axis=1)
    second = _rarest(marks, aside > ASIDE * np.linalg.norm(marks[first, :3]))
    p, q = marks[first], marks[second]
    tree = cKDTree(marks)
    here = np.linalg.inv(np.column_stack([p[:3], q[:3], np.cross(p[:3], q[:3])]))
    found = []
    for a in marks[_alike(marks, p)]:
        for b in marks[_alike(marks, q)]:
            if abs(a[:3] @ b[:3] - p[:3] @ q[:3]) > EXACT:
                continue
            for sign in (1.0, -1.0):
                matrix = np.column_stack([a[:3], b[:3], sign * np.cross(a[:3], b[:3])]) @ here
                if tree.query(_apply(matrix, marks))[0].max() < EXACT:
                    found.append(matrix)
    return np.array(found)


def _apply(matrix: Array, marks: Array) -> Array:
    return np.column_stack([marks[:, :3] @ matrix.T, marks[:, 3]])


def _alike(marks: Array, mark: Array) -> Index:
    """Marks with the label and the distance from the centre of one of them."""
    distance = np.linalg.norm(marks[:, :3], axis=1) - np.linalg.norm(mark[:3])
    return np.flatnonzero((np.abs(distance) < EXACT) & (np.abs(marks[:, 3] - mark[3]) < EXACT))


def _rarest(marks: Array, allowed: Array) -> int:
    """The allowed mark with the fewest like it."""
    candidates = np.flatnonzero(allowed)
    kinds = np.column_stack([np.linalg.norm(marks[:, :3], axis=1), marks[:, 3]]).round(5)[candidates]
    _, index, counts = np.unique(kinds, axis=0, return_index=True, return_counts=True)
    return int(candidates[index[np.argmin(counts)]])


def _same(a: Array, b: Array) -> bool:
    """Whether two sets of marks are one."""
    return len(a) == len(b) and bool(cKDTree(a).query(b)[0].max() < EXACT and cKDTree(b).query(a)[0].max() < EXACT)
