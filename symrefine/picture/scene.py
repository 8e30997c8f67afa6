"""The scene that every picture of a detection shows: outlines of planes, axes and near misses, with names and colours.

Everything is relative to the centre of the detection, in input units, so that single precision suffices to draw it.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from symrefine.complete import Verdicts, verdicts
from symrefine.detection.result import Detection, FoundAxis
from symrefine.geometry import Array, Mask, Plane, ReadOnly, unit
from symrefine.picture.atoms import Balls, balls
from symrefine.picture.palette import AXIS, CONTRADICTED, INFERRED, MISS, Colour, class_colours, plane_colour, shade
from symrefine.picture.rows import SAME_LINE_RAD
from symrefine.picture.upright import sign, upright
from symrefine.picture.words import order_name
from symrefine.shape import Index, Shape

# Points that tell how space was seen to be free.
RAYS = 200
# How far planes and axes stick out of the object, in diagonals.
MARGIN, AXIS_MARGIN = 0.06, 0.16
# Radius of the mark that tells the order of an axis, in diagonals.
MARK = 0.05
MAX_MARKS = 3
# Planes without an axis in common that can be seen at once.
MOST_SHEETS = 8
# Points that a shape is known by in a scene, about.
MOST_POINTS = 20_000


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
    mark: Array


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
        u = direction * sign(float(self.frame[2] @ direction))
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
        plain: [N, 3] their colours, 0 to 1, where nothing speaks against them.
        contradicted: [N] which of them have an image where the scan says that there is nothing.
        inferred: [K, 3] images where nobody looked.
        rays: [R, 2, 3] from a camera to what it saw: space that is free; none where cameras are not known.
    """

    seen: Array
    plain: Array
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
        seen = np.where(self.contradicted[:, None], shade(CONTRADICTED), self.plain)
        return np.concatenate([seen, np.tile(shade(INFERRED), (len(self.inferred), 1))])


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
    if shape.faces is None and detection.surface.cloud.body == "atoms":  # points that stand for themselves
        solid = balls(replace(shape, points=shape.points - detection.center))
        stage = stage if solid is None else replace(stage, points=solid.points)
    missed_planes, missed_axes = _missed(detection, stage)
    return Scene(
        stage=stage,
        planes=tuple(stage.quad(p.plane, str(k + 1), plane_colour(k)) for k, p in enumerate(detection.planes)),
        axes=_lines(detection, stage),
        missed_planes=missed_planes,
        missed_axes=missed_axes,
        scan=_scan(detection, shape) if detection.is_partial else None,
        balls=solid,
        outliers=detection.outliers,
    )


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
        plain=class_colours(shape.labels, len(shape.points))[kept],
        contradicted=said.contradicted,
        inferred=said.inferred - detection.center,
        rays=rays,
    )


def make_stage(detection: Detection, shape: Shape) -> Stage:
    """Where the shape stands: some of its points, outliers left out, and a frame with the main axis upright."""
    own = np.delete(shape.points, detection.outliers, axis=0)
    relative: Array = own[:: max(1, len(own) // MOST_POINTS)] - detection.center
    if shape.faces is None:
        relative = main_part(relative)
    diagonal = detection.diagonal or float(np.linalg.norm(np.ptp(relative, axis=0)))
    return Stage(center=detection.center, points=relative, frame=upright(detection, relative), diagonal=diagonal)


def main_part(points: Array) -> Array:
    """Points about the centre without the few that lie far out, where they are many."""
    if len(points) < 1000:
        return points
    distance = np.linalg.norm(points, axis=1)
    return np.asarray(points[distance <= 1.02 * np.quantile(distance, 0.999)])


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
