"""The picture of an alignment: the two side by side as they came, and laid on one another as what each place says."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symrefine.errors import printable
from symrefine.geometry import Array
from symrefine.picture.camera import FOV_RAD, look_at, seen_from
from symrefine.picture.canvas import TITLE, Canvas
from symrefine.picture.painter import paint
from symrefine.picture.pair import Pair, Side
from symrefine.picture.palette import AXIS, CONTRADICTED, INFERRED, Colour
from symrefine.picture.surface import Surface

# Height of the words below, in pixels of the finished picture; size of a letter, height of a line.
WORDS, LETTER, LINE = 104, 17, 24
# Of a name so many letters are told, the last.
NAME = 48
# Width of a letter over its size, of bold ones.
WIDE = 0.64


def pair_png(pair: Pair, title: str, *, width: int, height: int) -> bytes:
    """PNG of `width` x `height` pixels: before on the left, after on the right, told above unless `title` is empty."""
    top = TITLE if title else 0
    half, high = width // 2, height - top - WORDS
    canvas = Canvas(width, height, title)
    picture = np.ones((height, width, 3))
    for k, panel in enumerate(_panels(pair, half, high)):
        picture[top : top + high, k * half : (k + 1) * half] = panel
    canvas.figure.figimage(picture, origin="upper", zorder=-1)
    for k, words in enumerate((_before(pair), _after(pair))):
        size = min(LETTER, 0.96 * half / (WIDE * max(len(text) for text, _ in words)))
        for row, (text, colour) in enumerate(words):
            canvas.name(text, (k + 0.5) * half, top + high + (row + 0.7) * LINE, colour, size)
    return canvas.png()


def _panels(pair: Pair, width: int, height: int) -> list[Array]:
    """Before and after, seen from one side: pictures [height, width, 3]."""
    best, up = pair.ways[0], np.array([0.0, 0.0, 1.0])
    aspect = width / height
    back = look_at(pair.stage(best.matrix, best.shift), aspect=aspect, fov_rad=FOV_RAD).frame[2]
    shown, panels = [_shown(pair, side) for side in pair.sides], []
    for share in (0.0, 1.0):
        # A panel is higher than wide: what stands beside the other stands above it there.
        matrix, shift = best.part(share, pair.beside(up))
        scene = pair.stage(matrix, shift)
        camera = seen_from(back, scene.stage.points, up, aspect=aspect, fov_rad=FOV_RAD, fill=0.9)
        source, target = (judged if share else bare for bare, judged in shown)
        moved = replace(source, points=source.points @ matrix.T + shift, normals=source.normals @ matrix.T)
        panels.append(paint(scene, _joined([moved, target]), camera, width, height))
    return panels


def _before(pair: Pair) -> list[tuple[str, Colour]]:
    return [("before", AXIS), *((printable(side.name)[-NAME:], side.colour) for side in pair.sides)]


def _after(pair: Pair) -> list[tuple[str, Colour]]:
    one, other = pair.shares(0)
    shown = [("contradicted", one.contradicted, other.contradicted, CONTRADICTED)]
    shown += [("where nobody looked", one.unseen, other.unseen, INFERRED)]
    met = f"after, as drawn: {100 * one.met:.0f} % of the source meet {100 * other.met:.0f} % of the target"
    rest = [(f"{name} {100 * a:.0f} % and {100 * b:.0f} %", colour) for name, a, b, colour in shown]
    return [(met, AXIS), *rest]


def _shown(pair: Pair, side: Side) -> tuple[Surface, Surface]:
    """What is painted of a side, in its own colours and in those of what is said; without strays."""
    surface = side.surface(dense=True)
    balls, places = side.scene(pair.diagonal).balls, surface.points
    if balls is not None and surface.faces is not None:
        places = balls.centres[balls.atoms[surface.faces[:, 0]]]
    misses = pair.misses(side.index, places)[0]
    if surface.faces is None and len(own := np.flatnonzero(~(misses < 0.0))):
        points, normals, colours = (v[own] for v in (surface.points, surface.normals, surface.colours))
        surface, misses = replace(surface, points=points, normals=normals, colours=colours), misses[own]
    return surface, replace(surface, colours=pair.coloured(surface.colours, misses))


def _joined(surfaces: Sequence[Surface]) -> Surface:
    """Surfaces of one kind as one."""
    first = surfaces[0]
    offsets = np.cumsum([0, *(len(s.points) for s in surfaces)])
    faces = [s.faces + o for s, o in zip(surfaces, offsets, strict=False) if s.faces is not None]
    points, normals, colours = (
        np.concatenate([getattr(s, name) for s in surfaces]) for name in ("points", "normals", "colours")
    )
    return replace(
        first,
        points=points,
        normals=normals,
        colours=colours,
        faces=np.concatenate(faces) if faces else None,
        radius=max(s.radius for s in surfaces),
        texture=None,
    )
