"""What a recording draws: sheets, lines and names, on a dark background."""

from typing import Any

import numpy as np
import rerun as rr

from symrefine.geometry import Array
from symrefine.picture.palette import AXIS as DARK
from symrefine.picture.palette import Colour
from symrefine.picture.scene import Line, Quad

# Colours for a dark background.
AXIS: Colour = (245, 247, 250)
OPACITY, MISS_OPACITY = 60, 40


def log_quad(stream: Any, entity: str, quad: Quad, opacity: int) -> None:
    """A translucent sheet, and its edge with a name at a corner."""
    sheet = rr.Mesh3D(
        vertex_positions=quad.corners,
        triangle_indices=[[0, 1, 2], [0, 2, 3]],
        vertex_normals=np.tile(quad.normal, (4, 1)),
        albedo_factor=[*bright(quad.colour), opacity],
    )
    stream.log(entity, sheet)
    edge = rr.LineStrips3D([[*quad.corners, quad.corners[0]]], colors=[bright(quad.colour)], radii=[pixels(1.2)])
    stream.log(f"{entity}/edge", edge)
    beside = quad.corners[2] + 0.05 * (quad.corners[2] - quad.corners.mean(axis=0))
    log_name(stream, f"{entity}/name", beside, quad.name, bright(quad.colour))


def log_name(stream: Any, entity: str, at: Array, name: str, colour: Colour) -> None:
    """A name beside what it names."""
    point = rr.Points3D([at], labels=[name], show_labels=True, colors=[colour], radii=[pixels(0.5)])
    stream.log(entity, point)


def log_line(stream: Any, entity: str, line: Line, *, named: bool = True) -> None:
    """An axis with the mark of its order, and its name at the upper end."""
    colour = AXIS if line.colour == DARK else line.colour
    strips = [line.ends] + ([line.mark] if len(line.mark) else [])
    stream.log(entity, rr.LineStrips3D(strips, colors=[colour], radii=[pixels(1.5)]))
    if named:
        log_name(stream, f"{entity}/name", line.ends[1], line.name, colour)


def bright(colour: Colour) -> Colour:
    """The same hue for a dark background."""
    r, g, b = (min(255, round(0.72 * c + 80)) for c in colour)
    return r, g, b


def pixels(width: float) -> float:
    """A radius in points of the screen, which rerun writes as a negative number."""
    return -width
