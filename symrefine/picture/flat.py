"""The picture of an object in the plane: what it is made of, its mirror lines, the point it turns about."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Plane, ReadOnly
from symrefine.picture.canvas import TITLE, Canvas
from symrefine.picture.palette import AXIS, MISS, OBJECT, Colour, plane_colour, shade
from symrefine.picture.words import order_name, planar_headline
from symrefine.plane.detection import PlanarDetection
from symrefine.plane.raster import Raster, coarser, raster_of
from symrefine.shape import Shape

# How far lines stick out of the object, and what is free around it, in diagonals.
MARGIN, FREE = 0.07, 0.13
LETTER = 24
# Points of a cloud that are drawn, and longest side of the grid of a picture.
MOST_POINTS, MOST_CELLS = 6000, 900


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stroke(ReadOnly):
    """The part of a mirror line to draw, relative to the centre: ends [2, 2], the upper one last, name and colour."""

    ends: Array
    name: str
    colour: Colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatScene:
    """An object in the plane, relative to `center`, in input units.

    Attributes:
        center: [2] what the turns leave in place.
        diagonal: of the smallest box around the object.
        raster: its pixels, or None for points.
        points: [N, 2] of it; some, where they are many; of pixels, how far they reach.
        lines: mirror lines that were found.
        missed: those of the near misses, None for turns.
        order: of the turns; 1 where there are none.
    """

    center: Array
    diagonal: float
    raster: Raster | None
    points: Array
    lines: tuple[Stroke, ...]
    missed: tuple[Stroke | None, ...]
    order: float

    @property
    def radius(self) -> float:
        """Half the side of the square about the centre that holds everything."""
        strokes = [*self.lines, *(m for m in self.missed if m is not None)]
        reach = max(float(np.abs(a).max()) for a in (self.points, *(s.ends for s in strokes)))
        return reach + 0.5 * FREE * self.diagonal


def flat_scene(detection: PlanarDetection, shape: Shape) -> FlatScene:
    """What there is to draw."""
    points = shape.points - detection.center
    raster = raster_of(shape.points, shape.weights)
    some = points[:: max(1, -(-len(points) // MOST_POINTS))]

    def stroke(line: Plane, name: str, colour: Colour) -> Stroke:
        foot = (line.offset - float(line.normal @ detection.center)) * line.normal
        along = np.array([-line.normal[1], line.normal[0]])
        along = -along if along[1] < -1e-9 else along
        reach, slack = points @ along, MARGIN * detection.diagonal
        ends = [foot + (reach.min() - slack) * along, foot + (reach.max() + slack) * along]
        return Stroke(ends=np.array(ends), name=name, colour=colour)

    return FlatScene(
        center=detection.center,
        diagonal=detection.diagonal,
        raster=None if raster is None else coarser(raster, MOST_CELLS),
        points=some if raster is None else np.stack([points.min(axis=0), points.max(axis=0)]),
        lines=tuple(stroke(found.line, str(k + 1), plane_colour(k)) for k, found in enumerate(detection.lines)),
        missed=tuple(
            None if m.line is None else stroke(m.line, f"near miss {k}", MISS)
            for k, m in enumerate(detection.near_misses, start=1)
        ),
        order=1.0 if detection.rotation is None else detection.rotation.order,
    )


def flat_png(detection: PlanarDetection, shape: Shape, *, width: int, height: int, title: bool) -> bytes:
    """PNG of `width` x `height` pixels: the object with its mirror lines and the centre of its turns."""
    scene = flat_scene(detection, shape)
    top = TITLE if title else 0
    side = min(width, height - top)
    left = 0.5 * (width - side)
    canvas = Canvas(width, height, planar_headline(detection) if title else "")
    axes = canvas.panel(left, top, side, side)
    radius = scene.radius
    axes.set(xlim=(-radius, radius), ylim=(-radius, radius))
    _draw_object(axes, scene)
    strokes = scene.lines or tuple(m for m in scene.missed if m is not None)[:1]
    for stroke in strokes:
        axes.plot(*stroke.ends.T, color=shade(stroke.colour), linewidth=2.6, dashes=() if scene.lines else (5, 3))
    if scene.order > 1:
        axes.plot([0.0], [0.0], marker="o", markersize=9, color=shade(AXIS), markeredgecolor="white")

    def name(text: str, at: Array, colour: Colour) -> None:
        x, y = 0.5 + 0.5 * at / radius
        canvas.name(text, left + side * float(x), top + side * float(1.0 - y), colour, LETTER)

    for stroke in scene.lines:
        out = stroke.ends[1] - stroke.ends[0]
        name(stroke.name, stroke.ends[1] + 0.035 * scene.diagonal * out / np.linalg.norm(out), stroke.colour)
    if scene.order > 1:
        name(order_name(scene.order), np.array([0.05, -0.05]) * scene.diagonal, AXIS)
    return canvas.png()


def placed_cells(raster: Raster, center: Array) -> Array:
    """[2, 3] the map from (column, row, 1) of a raster to the plane, relative to a centre."""
    turned = np.array([-raster.step[1], raster.step[0]])
    return np.stack([raster.step, turned, raster.origin - center], axis=1)


def _draw_object(axes, scene: FlatScene) -> None:  # type: ignore[no-untyped-def]
    if scene.raster is None:
        size = np.clip(4000.0 / len(scene.points), 1.5, 90.0)
        axes.scatter(*scene.points.T, s=size, color=shade(OBJECT), linewidths=0)
        return
    from matplotlib.transforms import Affine2D

    (a, c, e), (b, d, f) = placed_cells(scene.raster, scene.center).tolist()
    share = shares(scene.raster)
    tint = np.broadcast_to(shade(OBJECT), (*share.shape, 3))
    picture = axes.imshow(np.dstack([tint, share]), origin="lower", interpolation="antialiased", aspect="auto")
    picture.set_transform(Affine2D.from_values(a, b, c, d, e, f) + axes.transData)
    radius = scene.radius
    axes.set(xlim=(-radius, radius), ylim=(-radius, radius))


def shares(raster: Raster) -> Array:
    """How much [H, W] of each cell is object, 0 to 1."""
    return np.asarray(np.clip(raster.values / max(float(np.quantile(raster.values, 0.99)), 1e-300), 0.0, 1.0))
