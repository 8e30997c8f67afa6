"""The shape as the painter takes it: triangles with their normals, or points with estimated ones."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from symrefine.geometry import Array, ReadOnly
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.picture.palette import OUTLIER, class_colours, shade
from symrefine.picture.scene import Quad, Scene
from symrefine.shape import Index, Shape
from symrefine.texture import Texture

# Points of a cloud that are painted, and the fewest whose neighbourhoods say anything about normals.
MOST_POINTS, FEWEST_FOR_NORMALS, NEIGHBOURS = 40000, 300, 40
# Radius of a painted point in typical spacings.
COVER = 0.6
# Share of the points in a plane from which they are the shape rather than its cut with that plane.
FLAT = 0.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface(ReadOnly):
    """Something to paint, relative to the centre of its scene.

    Attributes:
        points: [N, 3] of a cloud, or vertices.
        normals: [N, 3] of the points or [F, 3] of the faces, unit or zero, any sign.
        colours: [N, 3] of the points or [F, 3] of the faces, 0 to 1.
        faces: [F, 3], or None for a cloud.
        radius: of each point of a cloud.
        depth_scale: steps in depth of this size look like the edge of something.
        texture: what the faces show instead of their colours, or None.
    """

    points: Array
    normals: Array
    colours: Array
    faces: Index | None
    radius: float
    depth_scale: float
    texture: Texture | None = None


def make_surface(shape: Shape, scene: Scene) -> Surface:
    """The shape, or a part of the points of a large cloud, by class; points that lie in a plane have its colour.

    Points that stand for themselves are balls. Of a scan that shows a part of an object, its points without outliers
    and what is inferred.
    """
    stage = scene.stage
    if scene.balls is not None:
        solid, scale = scene.balls, 0.06 * stage.diagonal
        _, normals = triangle_areas_and_normals(solid.points, solid.faces)
        return Surface(
            points=solid.points,
            normals=normals,
            colours=solid.colours,
            faces=solid.faces,
            radius=0.0,
            depth_scale=scale,
        )
    if shape.faces is not None:
        corners, scale = shape.points - stage.center, 0.03 * stage.diagonal
        _, normals = triangle_areas_and_normals(corners, shape.faces)
        return Surface(
            points=corners,
            normals=normals,
            colours=class_colours(shape.labels, len(shape.faces)),
            faces=shape.faces,
            radius=0.0,
            depth_scale=scale,
            texture=shape.texture,
        )
    every = shape.points - stage.center if scene.scan is None else scene.scan.points
    step = max(1, -(-len(every) // MOST_POINTS))
    points = every[::step]
    radius = COVER * stage.diagonal * _spacing(points / stage.diagonal)
    colours = class_colours(shape.labels, len(every)) if scene.scan is None else scene.scan.colours.copy()
    if scene.scan is None:
        colours[scene.outliers] = shade(OUTLIER)
    plain = colours[::step]
    known = None if scene.scan is not None else shape.normals
    return Surface(
        points=points,
        normals=_normals(points / stage.diagonal) if known is None else known[::step],
        colours=_tinted(plain, points, scene.planes, 0.9 * radius),
        faces=None,
        radius=radius,
        depth_scale=0.06 * stage.diagonal,
    )


def _tinted(plain: Array, points: Array, planes: tuple[Quad, ...], width: float) -> Array:
    """Colours of points: those of the planes they are closer to than `width`, else the plain ones."""
    colours = plain.copy()
    for quad in planes:
        near = np.abs((points - quad.corners[0]) @ quad.normal) < width
        if near.mean() < FLAT:
            colours[near] += 0.75 * (shade(quad.colour) - colours[near])
    return colours


def _spacing(points: Array) -> float:
    """Typical distance from a point to its fourth neighbour, as a fraction of the diagonal, within reason."""
    distance, _ = cKDTree(points).query(points[:: max(1, len(points) // 2000)], k=min(5, len(points)))
    return float(np.clip(np.median(distance[:, -1]), 0.003, 0.02))


def _normals(points: Array) -> Array:
    """Unit normals [N, 3] of planes fitted to neighbours; zero for clouds too thin to tell."""
    if len(points) < FEWEST_FOR_NORMALS:
        return np.zeros(points.shape)
    _, near = cKDTree(points).query(points, k=NEIGHBOURS)
    spread = points[near] - points[near].mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))[1][:, :, 0])
