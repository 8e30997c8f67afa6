"""The picture of an object in space with its labels."""

from dataclasses import dataclass, replace

import numpy as np

from symrefine.detection.result import Detection
from symrefine.geometry import Array
from symrefine.picture.camera import FOV_RAD, Camera, look_at
from symrefine.picture.canvas import TITLE, Canvas
from symrefine.picture.painter import paint
from symrefine.picture.palette import CONTRADICTED, INFERRED, OUTLIER, Colour
from symrefine.picture.scene import Scene, make_scene
from symrefine.picture.surface import make_surface
from symrefine.picture.words import headline, symbol
from symrefine.shape import Shape

# Size of a letter and room for a label, in pixels of the finished picture; letters and lines of what colours mean.
LETTER, ROOM = 21, 26
SMALL, LINE = 17, 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A name in the picture: its middle in pixels, and its colour."""

    text: str
    x: float
    y: float
    colour: Colour


def space_png(detection: Detection, shape: Shape, *, width: int, height: int, title: bool) -> bytes:
    """PNG of `width` x `height` pixels: the shape with the planes and axes that were found.

    With `title` the group is told above, and below what the colours of a scan mean.
    """
    scene = _shown(make_scene(detection, shape))
    told = _meanings(scene) if title else []
    top, below = TITLE if title else 0, LINE * len(told)
    camera = look_at(scene, aspect=width / (height - top - below), fov_rad=FOV_RAD, fill=0.88)
    painted = paint(scene, make_surface(shape, scene), camera, width, height - top - below)
    labels = place_labels(scene, camera, painted)
    canvas = Canvas(width, height, headline(detection) if title else "")
    blank = np.ones((top, width, 3)), np.ones((below, width, 3))
    canvas.figure.figimage(np.concatenate([blank[0], painted, blank[1]]), origin="upper")
    for label in labels:
        canvas.name(label.text, label.x, label.y + top, label.colour, LETTER)
    for row, (text, colour) in enumerate(told):
        canvas.name(text, 0.5 * width, height - below + (row + 0.4) * LINE, colour, SMALL)
    return canvas.png()


def _meanings(scene: Scene) -> list[tuple[str, Colour]]:
    """What the colours of points mean, of those that are there, each in its colour."""
    if scene.scan is None:
        out = len(scene.outliers)
        return [(f"{out:,} {'outlier' if out == 1 else 'outliers'}, no part of it", OUTLIER)] if out else []
    against = bool(scene.scan.contradicted.any())
    inferred = [("inferred, where nobody looked", INFERRED)] if len(scene.scan.inferred) else []
    return inferred + [("seen, with an image where the scan says that there is nothing", CONTRADICTED)] * against


def _shown(scene: Scene) -> Scene:
    """The scene, with the nearest miss where nothing was found, and of very many axes the main ones."""
    if not scene.planes and not scene.axes:
        return replace(scene, planes=scene.missed_planes[:1])
    if scene.crowded:
        return replace(scene, axes=scene.main_axes)
    return scene


def place_labels(scene: Scene, camera: Camera, painted: Array) -> list[Label]:
    """Names of axes and planes beside what they name, each where there is room; those without room are left out."""
    height, width = painted.shape[:2]
    placed: list[Label] = []
    wanted = [(line.name, line.colour, line.ends[::-1]) for line in scene.axes]
    if not scene.crowded:
        # Corners and middles of the sides.
        around = [np.concatenate([q.corners, 0.5 * (q.corners + np.roll(q.corners, -1, axis=0))]) for q in scene.planes]
        wanted += [(quad.name, quad.colour, places) for quad, places in zip(scene.planes, around, strict=True)]
    middle, _ = camera.project(np.zeros((1, 3)), width, height)
    for text, colour, anchors in wanted:
        xy, depth = camera.project(anchors, width, height)
        out = xy - middle
        away = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
        xy = xy + away * np.array([ROOM - 0.34 * LETTER + _half_width(text), ROOM])
        ranked = sorted(range(len(xy)), key=lambda k: (_inked(painted, xy[k]), k if len(xy) == 2 else depth[k]))
        for x, y in xy[ranked]:
            label = Label(text=symbol(text), x=float(x), y=float(y), colour=colour)
            if _fits(label, placed, width, height):
                placed.append(label)
                break
    return placed


def _inked(painted: Array, at: Array) -> float:
    """Whether anything is painted where a label would stand, in tenths."""
    x, y = (int(v) for v in at)
    patch = painted[max(0, y - 10) : max(0, y + 11), max(0, x - 10) : max(0, x + 11)]
    return round(float((patch.min(axis=2) < 0.98).mean()), 1) if patch.size else 1.0


def _fits(label: Label, placed: list[Label], width: int, height: int) -> bool:
    half = _half_width(label.text)
    if not (half <= label.x <= width - half and LETTER * 0.6 <= label.y <= height - LETTER * 0.6):
        return False
    return all(abs(label.x - p.x) > half + _half_width(p.text) or abs(label.y - p.y) > 1.15 * LETTER for p in placed)


def _half_width(text: str) -> float:
    return 0.34 * LETTER * len(text) + 4
