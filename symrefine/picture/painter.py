"""The painter: a lit shape, translucent planes that cross it and one another, lines that pierce them.

Everything is decided for each pixel by depth, so that planes that intersect come out right.
"""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, unit
from symrefine.picture.camera import Camera
from symrefine.picture.palette import shade
from symrefine.picture.raster import Raster
from symrefine.picture.scene import Line, Quad, Scene
from symrefine.picture.surface import Surface
from symrefine.shape import Index
from symrefine.texture import corner_weights

# The picture is painted this many times larger and averaged.
FINER = 2
LIGHTS = (((-0.45, 0.75, 0.5), 0.5), ((0.9, 0.1, 0.45), 0.12), ((0.0, 0.0, 1.0), 0.22))
AMBIENT = 0.36
# Widths in pixels of the finished picture: edges of planes, axes, and the curves in which planes cut the shape.
EDGE, AXIS_LINE, TRACE = 1.3, 2.6, 1.6
# Opacity of an axis behind the shape.
HIDDEN = 0.3
ROWS = 96


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pixels:
    """The rays through height x width pixels, each of depth 1, as the sum of a row [W] and a column [H]."""

    camera: Camera
    width: int
    height: int

    def along(self, vector: Array, rows: slice = slice(None)) -> Array:
        """[H, W] scalar product of each ray with a vector."""
        right, up, back = self.camera.frame @ vector
        x = (np.arange(self.width) + 0.5 - 0.5 * self.width) / self.camera.focal(self.height)
        y = (0.5 * self.height - np.arange(self.height)[rows] - 0.5) / self.camera.focal(self.height)
        return np.asarray((right * x)[None, :] + (up * y - back)[:, None])

    def depth(self, quad: Quad, rows: slice) -> Array:
        """[rows, W] depth of a quad, infinite beside it."""
        origin, a, b = (quad.corners[k] for k in (0, 1, 3))
        ahead = float((origin - self.camera.eye) @ quad.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ahead / self.along(quad.normal, rows)
            inside = depth > 0
            for side in (a - origin, b - origin):
                share = float((self.camera.eye - origin) @ side) + depth * self.along(side, rows)
                inside &= (share >= 0) & (share <= side @ side)
        return np.where(inside, depth, np.inf)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strokes:
    """Lines in each pixel: [H, W] depth and number, and the colour [S, 3] and opacity behind the shape [S] of each."""

    depth: Array
    number: Index
    colours: Array
    ghosts: Array


def paint(scene: Scene, surface: Surface, camera: Camera, width: int, height: int) -> Array:
    """Picture [height, width, 3] of values 0 to 1 on white."""
    pixels = Pixels(camera=camera, width=FINER * width, height=FINER * height)
    near, far = _range(scene, surface, camera)
    solid = _rasterised(surface, camera, Raster(pixels.width, pixels.height, near, far))
    depth = solid.depth()
    picture = _lit(solid, depth, surface, camera)
    if surface.faces is not None:
        for quad in scene.planes:
            _trace(picture, depth, quad, pixels)
    sheets = () if scene.crowded else scene.planes  # the curves in which they cut the shape remain
    strokes = _strokes(sheets, scene.axes, camera, Raster(pixels.width, pixels.height, near, far))
    for start in range(0, pixels.height, ROWS):
        _blend(picture, depth, sheets, strokes, pixels, slice(start, start + ROWS))
    return np.asarray(picture.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3)))


def _range(scene: Scene, surface: Surface, camera: Camera) -> tuple[float, float]:
    """Depths that nothing lies outside of."""
    everything = [surface.points, *(q.corners for q in scene.planes), *(a.ends for a in scene.axes)]
    depth = np.concatenate([(camera.eye - points) @ camera.frame[2] for points in everything])
    slack = 0.05 * float(np.ptp(depth))
    return max(float(depth.min()) - slack, 1e-6 * float(depth.max())), float(depth.max()) + slack


def _rasterised(surface: Surface, camera: Camera, raster: Raster) -> Raster:
    xy, depth = camera.project(surface.points, raster.width, raster.height)
    if surface.faces is not None:
        raster.triangles(xy, depth, surface.faces)
        return raster
    pixel = depth / camera.focal(raster.height)
    radius = np.clip(surface.radius / pixel, 1.2, 12.0)
    raster.discs(xy, depth, radius, np.arange(len(xy)), bulge=0.5 * radius * pixel)
    return raster


def _lit(raster: Raster, depth: Array, surface: Surface, camera: Camera) -> Array:
    """The shape on white: three lamps beside and behind the camera; creases and rims are darker."""
    seen = np.isfinite(depth)
    normals = surface.normals @ camera.frame.T
    normals = normals * np.where(normals[:, 2:] < 0, -1.0, 1.0)
    light = np.full(len(normals), AMBIENT)
    for lamp, power in LIGHTS:
        light += power * np.clip(normals @ unit(lamp), 0.0, None)
    numbers = raster.numbers()[seen]
    colours = surface.colours[numbers] if surface.texture is None else _shown(surface, depth, numbers, camera)
    picture = np.ones((*seen.shape, 3))
    lit = np.clip(colours * light[numbers, None] * 1.08, 0.0, 1.0)
    picture[seen] = lit * _crease(depth, surface.depth_scale)[seen][:, None]
    return picture


def _shown(surface: Surface, depth: Array, numbers: Index, camera: Camera) -> Array:
    """Colours [n, 3], 0 to 1, that a texture gives the pixels in which something is seen, given the faces there [n]."""
    assert surface.texture is not None
    assert surface.faces is not None
    height, width = depth.shape
    rows, columns = np.nonzero(np.isfinite(depth))
    x, y = columns + 0.5 - 0.5 * width, 0.5 * height - rows - 0.5
    rays = np.column_stack([x, y, np.full(len(x), -camera.focal(height))]) @ camera.frame / camera.focal(height)
    places = camera.eye + depth[rows, columns, None] * rays
    return surface.texture.colours(numbers, corner_weights(places, surface.points[surface.faces[numbers]])) / 255.0


def _crease(depth: Array, scale: float) -> Array:
    """Eye-dome lighting [H, W]: a pixel is darker the farther it lies behind those around it."""
    steps = np.where(np.isfinite(depth), depth / scale, 1e9)
    dark, (height, width) = np.zeros(depth.shape), depth.shape
    for reach, weight in ((2 * FINER, 1.0), (5 * FINER, 0.5)):
        beside = np.pad(steps, reach, constant_values=np.inf)  # behind everything
        for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            other = beside[(1 + dy) * reach :, (1 + dx) * reach :][:height, :width]
            dark += weight * np.clip(steps - other, 0.0, 1.0)
    return np.asarray(np.exp(-0.13 * dark))


def _trace(picture: Array, depth: Array, quad: Quad, pixels: Pixels) -> None:
    """Colour the curve in which a plane cuts the surface."""
    offset = float((pixels.camera.eye - quad.corners[0]) @ quad.normal)
    with np.errstate(invalid="ignore"):
        distance = offset + depth * pixels.along(quad.normal)
    pixel = depth / pixels.camera.focal(pixels.height)
    y, x = np.nonzero(np.abs(distance[1:-1, 1:-1]) < 3.0 * TRACE * FINER * pixel[1:-1, 1:-1])
    y, x = y + 1, x + 1
    with np.errstate(invalid="ignore"):
        right_left, down_up = (distance[y + j, x + i] - distance[y - j, x - i] for i, j in ((1, 0), (0, 1)))
    slope = 0.5 * np.hypot(right_left, down_up) / pixel[y, x]
    # A slope beyond what surfaces in sight have is the step to another surface.
    smooth = np.isfinite(slope) & (slope < 3.0) & (slope > 1e-6)
    y, x, slope = y[smooth], x[smooth], slope[smooth]
    away = np.abs(distance[y, x]) / (pixel[y, x] * slope)
    cover = 0.85 * np.clip(0.5 * TRACE * FINER + 0.5 - away, 0.0, 1.0)[:, None]
    picture[y, x] += cover * (shade(quad.colour) - picture[y, x])


def _strokes(planes: tuple[Quad, ...], axes: tuple[Line, ...], camera: Camera, raster: Raster) -> Strokes:
    """Edges of planes, axes and their marks."""
    drawn = [(np.vstack([quad.corners, quad.corners[:1]]), EDGE, quad.colour, 0.0) for quad in planes]
    for line in axes:
        drawn += [(line.ends, AXIS_LINE, line.colour, HIDDEN)]
        drawn += [(line.mark, 0.75 * AXIS_LINE, line.colour, HIDDEN)] if len(line.mark) else []
    for number, (strip, thickness, _, _) in enumerate(drawn):
        _draw(raster, strip, thickness, number, camera)
    return Strokes(
        depth=raster.depth(),
        number=raster.numbers(),
        colours=np.array([shade(colour) for _, _, colour, _ in drawn]).reshape(-1, 3),
        ghosts=np.array([ghost for _, _, _, ghost in drawn]),
    )


def _draw(raster: Raster, strip: Array, thickness: float, number: int, camera: Camera) -> None:
    """A round pen along a polyline [K, 3]."""
    xy, _ = camera.project(strip, raster.width, raster.height)
    steps = np.maximum(1, np.ceil(np.linalg.norm(np.diff(xy, axis=0), axis=1) * 1.5)).astype(np.int64)
    dense = np.concatenate([np.linspace(a, b, n + 1) for a, b, n in zip(strip[:-1], strip[1:], steps, strict=True)])
    xy, depth = camera.project(dense, raster.width, raster.height)
    raster.discs(xy, depth, np.full(len(xy), 0.5 * thickness * FINER), np.full(len(xy), number, dtype=np.int64))


def _blend(
    picture: Array, depth: Array, planes: tuple[Quad, ...], strokes: Strokes, pixels: Pixels, rows: slice
) -> None:
    """Lay planes and lines over some rows of the picture, the farthest first."""
    solid, stroke = depth[rows], strokes.depth[rows]
    hidden = np.isfinite(stroke) & (stroke > solid * (1 + 1e-4))
    layers = [np.where((at := pixels.depth(quad, rows)) < solid, at, np.inf) for quad in planes]
    stack = np.array([*layers, np.where(hidden, solid * (1 - 1e-4), stroke)])
    there = np.isfinite(stack).any(axis=0)
    if not there.any():
        return
    stack, number = stack[:, there], strokes.number[rows][there]
    line_opacity = np.where(hidden[there], strokes.ghosts[number], 1.0) if len(strokes.ghosts) else 0.0
    line_colour = strokes.colours[number] if len(strokes.ghosts) else np.zeros((1, 3))
    colours = np.array([*(shade(quad.colour) for quad in planes), np.zeros(3)])
    opacity = float(np.clip(0.9 / max(1, len(planes)), 0.09, 0.26))
    mixed = picture[rows][there]
    for k in np.argsort(-stack, axis=0, kind="stable"):
        is_line = k == len(planes)
        share = np.where(is_line, line_opacity, opacity)
        share = np.where(np.isfinite(np.take_along_axis(stack, k[None], axis=0)[0]), share, 0.0)
        mixed += share[:, None] * (np.where(is_line[:, None], line_colour, colours[k]) - mixed)
    picture[rows][there] = mixed
