"""The scene that every picture of a detection shows: outlines of planes, axes and near misses, with names and colours.

Everything is relative to the centre of the detection, in input units, so that single precision suffices to draw it.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from symrefine.complete import Verdicts, verdicts
from symrefine.detection.result import Detection, FoundAxis
from symrefine.geometry import Array, Mask, Plane, ReadOnly, unit
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.picture.atoms import Balls, balls
from symrefine.picture.palette import AXIS, CONTRADICTED, INFERRED, MISS, OBJECT, Colour, plane_colour
from symrefine.picture.words import order_name
from symrefine.shape import Index, Shape

# Points that tell how space was seen to be free.
RAYS = 200
# How far planes and axes stick out of the object, in diagonals.
MARGIN, AXIS_MARGIN = 0.06, 0.16
# Axes this close together are one line with two names.
SAME_LINE_RAD = math.radians(1.0)
# Radius of the mark that tells the order of an axis, in diagonals.
MARK = 0.05
MAX_MARKS = 3
# So far from the vertical of the input the object may still be meant to stand as it does; sides of its hull that are
# looked at, the largest.
UPRIGHT_RAD, SIDES = math.radians(10.0), 400
# Planes without an axis in common that can be seen at once.
MOST_SHEETS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quad(ReadOnly):
    """Part of a plane to draw: corners [4, 3] in turn, unit normal, name and colour."""

    corners: Array
    normal: Array
    name: str
    colour: Colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line(ReadOnly):
    """Part of an axis to draw: ends [2, 3], name, colour, order, and a mark [K, 3] around it that tells its order."""

    ends: Array
    name: str
    colour: Colour
    order: float
    mark: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage(ReadOnly):
    """Where a shape stands in its picture.

    Attributes:
        center: [3] the detection's centre; everything else is relative to it.
        points: [M, 3] some of the shape's points.
        frame: [3, 3] rows: two horizontal directions and the vertical one, determinant +1.
        diagonal: of the smallest bounding box.
    """

    center: Array
    points: Array
    frame: Array
    diagonal: float

    def quad(self, plane: Plane, name: str, colour: Colour) -> Quad:
        """The part of a plane (input units) that the shape fills, and a little more."""
        along = self._vertical_in(plane.normal)
        across = np.cross(plane.normal, along)
        foot = (plane.offset - float(plane.normal @ self.center)) * plane.normal
        a_low, a_high = self._extent(along, MARGIN)
        b = max(abs(v) for v in self._extent(across, MARGIN))
        corners = [foot + s * along + t * across for s, t in ((a_low, -b), (a_low, b), (a_high, b), (a_high, -b))]
        return Quad(corners=np.array(corners), normal=plane.normal, name=name, colour=colour)

    def line(
        self, point: Array, direction: Array, name: str, colour: Colour, order: float, *, marked: bool = False
    ) -> Line:
        """The part of an axis (input units) that pierces the shape, and a little more, the upper end last."""
        u = direction * _sign(float(self.frame[2] @ direction))
        foot = point - self.center
        foot = foot - (foot @ u) * u
        low, high = self._extent(u, AXIS_MARGIN)
        mark = foot + (high - 0.4 * AXIS_MARGIN * self.diagonal) * u + self._mark(u, order)
        return Line(
            ends=np.stack([foot + low * u, foot + high * u]),
            name=name,
            colour=colour,
            order=order,
            mark=mark if marked else np.zeros((0, 3)),
        )

    def _mark(self, u: Array, order: float) -> Array:
        """The crystallographer's sign of an axis: a lens, a triangle, a square, ... a circle."""
        corners = 64 if order > 12 or order == 2 else int(order)
        angles = 2 * np.pi * np.arange(corners + 1) / corners
        narrow = 0.35 if order == 2 else 1.0
        base = self.frame[0] if abs(u @ self.frame[0]) < 0.9 else self.frame[1]
        side = unit(base - (base @ u) * u)
        front = np.cross(u, side)
        ring = np.cos(angles)[:, None] * side + narrow * np.sin(angles)[:, None] * front
        return MARK * self.diagonal * ring

    def _vertical_in(self, normal: Array) -> Array:
        """The direction in a plane that is nearest to the vertical, or to a horizontal for planes that lie."""
        base = self.frame[2] if abs(normal @ self.frame[2]) < 0.95 else self.frame[1]
        return unit(base - (base @ normal) * normal)

    def _extent(self, direction: Array, margin: float) -> tuple[float, float]:
        reach = self.points @ direction
        return float(reach.min()) - margin * self.diagonal, float(reach.max()) + margin * self.diagonal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan(ReadOnly):
    """The points of a scan that shows a part of an object.

    Attributes:
        seen: [N, 3] without outliers.
        contradicted: [N] which of them have an image where the scan says that there is nothing.
        inferred: [K, 3] images where nobody looked.
        rays: [R, 2, 3] from a camera to what it saw: space that is free; none where cameras are not known.
    """

    seen: Array
    contradicted: Mask
    inferred: Array
    rays: Array

    @property
    def points(self) -> Array:
        """[N + K, 3] what was seen, then what is inferred."""
        return np.concatenate([self.seen, self.inferred])

    @property
    def colours(self) -> Array:
        """[N + K, 3] of these points, 0 to 1."""
        seen = np.where(self.contradicted[:, None], CONTRADICTED, OBJECT)
        return np.concatenate([seen, np.tile(INFERRED, (len(self.inferred), 1))]) / 255.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """What there is to draw beside the shape: planes and axes found, and the candidates turned down.

    Of a scan that shows a part of an object, `scan` has what was seen and what is inferred; of points that stand for
    themselves, `balls` has what is drawn in their stead, relative to the centre. `outliers` are indices of points that
    are no part of the object.
    """

    stage: Stage
    planes: tuple[Quad, ...]
    axes: tuple[Line, ...]
    missed_planes: tuple[Quad, ...]
    missed_axes: tuple[Line, ...]
    scan: Scan | None = None
    balls: Balls | None = None
    outliers: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def main_axes(self) -> tuple[Line, ...]:
        """The axes of the highest order."""
        highest = max((a.order for a in self.axes), default=0.0)
        return tuple(a for a in self.axes if a.order == highest)

    @property
    def crowded(self) -> bool:
        """Whether there are many planes without an axis in common, as in a cube: too many to see through."""
        normals = np.array([q.normal for q in self.planes]).reshape(-1, 3)
        return len(normals) > MOST_SHEETS and np.linalg.svd(normals, compute_uv=False)[2] > 0.1


def make_scene(detection: Detection, shape: Shape) -> Scene:
    """The scene of a detection; planes are named 1, 2, ... in their order there, axes by their symbol."""
    stage, solid = make_stage(detection, shape), None
    if are_atoms(detection, shape):
        solid = balls(replace(shape, points=shape.points - detection.center))
        stage = replace(stage, points=solid.points)
    missed_planes, missed_axes = _missed(detection, stage)
    return Scene(
        stage=stage,
        planes=tuple(stage.quad(p.plane, str(k + 1), plane_colour(k)) for k, p in enumerate(detection.planes)),
        axes=_lines(detection, stage),
        missed_planes=missed_planes,
        missed_axes=missed_axes,
        scan=_scan(detection, shape) if detection.at_least else None,
        balls=solid,
        outliers=detection.outliers,
    )


def are_atoms(detection: Detection, shape: Shape) -> bool:
    """Whether the points of a shape stand for themselves."""
    return shape.faces is None and detection.surface.cloud.body == "atoms"


def _scan(detection: Detection, shape: Shape) -> Scan:
    """The verdicts on all points; what nothing was found in says nothing of images."""
    kept = np.setdiff1d(np.arange(len(shape.points)), detection.outliers)
    seen, rays = shape.points[kept], np.empty((0, 2, 3))
    if shape.viewpoint is not None:
        some = slice(None, None, max(1, len(kept) // RAYS))
        rays = np.stack([shape.viewpoint[kept[some]], seen[some]], axis=1) - detection.center
    if detection.point_group == "C1":
        said = Verdicts(contradicted=np.zeros(len(seen), dtype=bool), inferred=seen[:0])
    else:
        said = verdicts(detection, seen)
    return Scan(
        seen=seen - detection.center,
        contradicted=said.contradicted,
        inferred=said.inferred - detection.center,
        rays=rays,
    )


def make_stage(detection: Detection, shape: Shape, most: int = 20000) -> Stage:
    """Where the shape stands: up to `most` of its points, outliers left out, and a frame with the main axis upright."""
    own = np.delete(shape.points, detection.outliers, axis=0)
    relative = own[:: max(1, len(own) // most)] - detection.center
    if shape.faces is None and len(relative) >= 1000:
        distance = np.linalg.norm(relative, axis=1)
        relative = relative[distance <= 1.02 * np.quantile(distance, 0.999)]
    diagonal = detection.diagonal or float(np.linalg.norm(np.ptp(relative, axis=0)))
    return Stage(center=detection.center, points=relative, frame=_upright(detection, relative), diagonal=diagonal)


def _upright(detection: Detection, points: Array) -> Array:
    """Frame with the vertical where a person would put it, as far as the symmetry lets it be.

    The main axis of an axial group stands. Of other objects the third axis of the input does, where the symmetry found
    agrees that it is the vertical: it lies in the one mirror plane, or along a two-fold axis, within ten degrees. If
    not, the object was turned, and its largest flat side lies, again within the symmetry. Nothing found says nothing.
    """
    name, group = detection.point_group, detection.group
    x, y, z = group.frame
    if name in ("C1", "Ci", "Kh", "undetermined"):
        return np.eye(3)
    if name == "Cs":
        normal = detection.planes[0].plane.normal if detection.planes else z
        return _standing(_in_plane(normal, points), normal)
    if group.symbol.fold in (0, 2):
        up = _of_three(group.frame, points)
        return _standing(up, x if abs(x @ up) < 0.5 else y)
    return _standing(z, x)


def _in_plane(normal: Array, points: Array) -> Array:
    """Vertical of an object with one mirror: in it lies what stands."""
    if abs(normal[2]) < math.sin(UPRIGHT_RAD):
        return unit(np.array([0.0, 0.0, 1.0]) - normal[2] * normal)
    normals, areas = _sides(points)
    lying = np.abs(normals @ normal) < math.sin(UPRIGHT_RAD)
    if not lying.any():  # flat or without a side: its longest extent stands
        across = points - np.multiply.outer(points @ normal, normal)
        longest: Array = np.linalg.eigh(across.T @ across)[1][:, -1]
        return unit(longest - (longest @ normal) * normal)
    best = normals[lying][int(np.argmax(areas[lying].round(6)))]
    return unit(best - (best @ normal) * normal)


def _of_three(frame: Array, points: Array) -> Array:
    """The row of a frame that is the vertical of the input, or else the one on whose side the object can lie."""
    along = np.abs(frame[:, 2])
    if along.max() > math.cos(UPRIGHT_RAD):
        return np.asarray(frame[int(along.argmax())])
    normals, areas = _sides(points)
    facing = np.abs(normals @ frame.T) > math.cos(UPRIGHT_RAD)
    covered = (facing * areas[:, None]).sum(axis=0).round(6)
    return np.asarray(frame[int(np.lexsort((-along, -covered))[0])])


def _sides(points: Array) -> tuple[Array, Array]:
    """Unit normals [K, 3] of the sides of the convex hull, and the share of the hull [K] that faces so, nearly."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3)), np.zeros(0)
    areas, normals = triangle_areas_and_normals(points, hull.simplices)
    largest = np.argsort(-areas)[:SIDES]
    near = np.abs(normals[largest] @ normals.T) > math.cos(0.5 * UPRIGHT_RAD)
    return normals[largest], near @ areas / areas.sum()


def _standing(up: Array, side: Array) -> Array:
    """Right-handed rows (side, front, up), the vertical pointing to the upper side of the input."""
    largest = up[2] if abs(up[2]) > 0.05 else up[int(np.argmax(np.abs(up)))]
    up = up * _sign(float(largest))
    side = unit(side - (side @ up) * up)
    return np.stack([side, np.cross(up, side), up])


def _sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _lines(detection: Detection, stage: Stage) -> tuple[Line, ...]:
    """One line for each axis; a rotoreflection about the same line only adds its name."""
    bundles: list[list[FoundAxis]] = []
    for found in detection.axes:
        for known in bundles:
            if abs(found.axis.direction @ known[0].axis.direction) > math.cos(SAME_LINE_RAD):
                known.append(found)
                break
        else:
            bundles.append([found])
    bundles = [sorted(bundle, key=lambda found: found.improper) for bundle in bundles]
    marked = len(bundles) <= MAX_MARKS
    names = [" ".join(order_name(found.order, found.improper) for found in bundle) for bundle in bundles]
    return tuple(
        stage.line(first.axis.point, first.axis.direction, name, AXIS, first.order, marked=marked)
        for name, (first, *_) in zip(names, bundles, strict=True)
    )


def _missed(detection: Detection, stage: Stage) -> tuple[tuple[Quad, ...], tuple[Line, ...]]:
    quads, lines = [], []
    for number, miss in enumerate(detection.near_misses, start=1):
        if miss.kind == "plane":
            plane = Plane(normal=miss.direction, offset=float(miss.direction @ miss.point))
            quads.append(stage.quad(plane, f"near miss {number}", MISS))
        elif miss.kind != "inversion":
            name = f"near miss {number}, {order_name(miss.order, miss.kind == 'improper')}"
            lines.append(stage.line(miss.point, miss.direction, name, MISS, miss.order))
    return tuple(quads), tuple(lines)
