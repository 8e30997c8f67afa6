"""Pictures of points in many dimensions: each hyperplane seen on edge, as a line that halves the points."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, ReadOnly, toward_positive, unit
from symrefine.ndim.detection import Hyperplane, SubspaceDetection
from symrefine.picture.canvas import TITLE, Canvas
from symrefine.picture.palette import MISS, OBJECT, Colour, plane_colour, shade
from symrefine.picture.words import subspace_headline
from symrefine.shape import Shape

# Hyperplanes that are shown, and points of each projection.
MOST, MOST_POINTS = 6, 3000
LETTER, GAP = 20, 24


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Projection(ReadOnly):
    """Points [N, 2] relative to the centre: across a hyperplane, and along the widest direction within it.

    Where it is that of a hyperplane its trace is the vertical through the centre; `missed` says that it was turned
    down.
    """

    points: Array
    name: str
    colour: Colour
    missed: bool


def projections(detection: SubspaceDetection, shape: Shape) -> list[Projection]:
    """One for each hyperplane, the best six; of the nearest misses where there is none."""
    points = shape.points[:: max(1, -(-len(shape.points) // MOST_POINTS))] - detection.center
    missed = not detection.hyperplanes
    shown = (detection.rejected if missed else detection.hyperplanes)[:MOST]
    names = [f"near miss {k}" if missed else str(k) for k in range(1, len(shown) + 1)]
    return [
        Projection(
            points=points @ np.stack(_view(hyperplane, points)).T,
            name=name,
            colour=MISS if missed else plane_colour(k),
            missed=missed,
        )
        for k, (name, hyperplane) in enumerate(zip(names, shown, strict=True))
    ]


def _view(hyperplane: Hyperplane, points: Array) -> tuple[Array, Array]:
    """The normal, and the direction within the hyperplane along which the points reach farthest."""
    normal = toward_positive(hyperplane.plane.normal) * hyperplane.plane.normal
    within = points - np.multiply.outer(points @ normal, normal)
    along = np.linalg.eigh(within.T @ within)[1][:, -1]
    along = unit(along - (along @ normal) * normal)
    return normal, toward_positive(along) * along


def projections_png(detection: SubspaceDetection, shape: Shape, *, width: int, height: int, title: bool) -> bytes:
    """PNG of `width` x `height` pixels: the projections side by side, in one scale."""
    shown = projections(detection, shape)
    top = TITLE if title else 0
    canvas = Canvas(width, height, subspace_headline(detection) if title else "")
    columns = min(3, max(1, len(shown)))
    rows = max(1, -(-len(shown) // columns))
    radius = 1.12 * max((float(np.abs(p.points).max()) for p in shown), default=1.0)
    side = min((width - GAP) / columns, (height - top - GAP) / rows) - GAP
    wide, high = columns * (side + GAP) - GAP, rows * (side + GAP) - GAP
    for k, projection in enumerate(shown):
        row, column = divmod(k, columns)
        left = 0.5 * (width - wide) + column * (side + GAP)
        above = top + 0.5 * (height - top - high) + row * (side + GAP)
        _draw(canvas.panel(left, above, side, side), projection, radius)
        canvas.name(projection.name, left + 0.5 * side, above + 0.6 * LETTER, projection.colour, LETTER)
    return canvas.png()


def _draw(axes, projection: Projection, radius: float) -> None:  # type: ignore[no-untyped-def]
    axes.set(xlim=(-radius, radius), ylim=(-radius, radius))
    size = float(np.clip(4000.0 / len(projection.points), 4.0, 60.0))
    axes.scatter(*projection.points.T, s=size, color=shade(OBJECT), linewidths=0)
    axes.plot(
        [0, 0],
        [-0.93 * radius, 0.84 * radius],
        color=shade(projection.colour),
        linewidth=2.4,
        dashes=(5, 3) if projection.missed else (),
    )
