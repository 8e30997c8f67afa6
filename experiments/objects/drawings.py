"""Plane objects of known symmetry, drawn as polygons painted one over the other."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array

# A polygon and the grey it is painted with: 1 for object, 0 for background.
Layer = tuple[Array, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """An object: its layers, its point group about the origin, and the direction of one mirror line.

    `rough` is how far the drawing is from that symmetry on purpose, for the reader.
    """

    name: str
    layers: tuple[Layer, ...]
    group: str
    angle_rad: float = 0.0
    rough: str = ""

    @property
    def fold(self) -> int:
        """Order of the turns; 0 where every turn is one."""
        return 0 if self.group == "O(2)" else int(self.group[1:])

    @property
    def line_angles(self) -> Array:
        """Directions [n] of all mirror lines, radians."""
        if not self.group.startswith("D"):
            return np.zeros(0)
        return self.angle_rad + np.pi * np.arange(self.fold) / self.fold


# --- parts ------------------------------------------------------------------------------------------------------------


def ellipse(x: float, y: float, a: float, b: float | None = None) -> Array:
    """An ellipse, or a circle, as 240 points."""
    t = 2.0 * np.pi * np.arange(240) / 240
    return np.column_stack([x + a * np.cos(t), y + (a if b is None else b) * np.sin(t)])


def box(x0: float, y0: float, x1: float, y1: float) -> Array:
    """A rectangle."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def polar(radius: Callable[[Array], Array], count: int = 720) -> Array:
    """A closed curve given by its radius."""
    t = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(t), np.sin(t)]) * radius(t)[:, None]


def star(points: int, inner: float) -> Array:
    """A star with one tip on the x axis; `inner` is the radius between the tips."""
    t = np.pi * np.arange(2 * points) / points
    return np.column_stack([np.cos(t), np.sin(t)]) * np.where(np.arange(2 * points) % 2, inner, 1.0)[:, None]


def turned(points: Array, angle_rad: float) -> Array:
    """Points turned about the origin."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return points @ np.array([[c, s], [-s, c]])


def repeated(points: Array, fold: int) -> list[Layer]:
    """A part and its copies about the origin."""
    return [(turned(points, 2.0 * np.pi * k / fold), 1.0) for k in range(fold)]


def letter(text: str, family: str = "DejaVu Sans", weight: str = "bold") -> tuple[Layer, ...]:
    """A letter in a font that matplotlib brings; what lies inside another outline is a hole."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    outline = TextPath((0, 0), text, size=400.0, prop=FontProperties(family=family, weight=weight))
    parts = sorted((np.asarray(p) for p in outline.to_polygons()), key=lambda p: -abs(_area(p)))
    sign = np.sign(_area(parts[0]))
    middle = 0.5 * (parts[0].min(axis=0) + parts[0].max(axis=0))
    return tuple((p - middle, float(np.sign(_area(p)) == sign)) for p in parts)


def _area(points: Array) -> float:
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


# --- objects ----------------------------------------------------------------------------------------------------------

PLATE = box(-1.0, -0.5, 1.0, 0.5)
CASE_STUDY = (
    Drawing(name="rectangle", layers=((PLATE, 1.0),), group="D2"),
    Drawing(name="disc on the x axis", layers=((PLATE, 1.0), (ellipse(0.95, 0.0, 0.38), 1.0)), group="D1"),
    Drawing(
        name="disc on the y axis",
        layers=((PLATE, 1.0), (ellipse(0.0, 0.5, 0.38), 1.0)),
        group="D1",
        angle_rad=0.5 * np.pi,
    ),
    Drawing(
        name="two discs",
        layers=((PLATE, 1.0), (ellipse(0.75, 0.5, 0.38), 1.0), (ellipse(-0.8, -0.4, 0.22), 1.0)),
        group="C1",
    ),
)


def _leaf() -> Drawing:
    x = np.linspace(-1.0, 1.0, 160)
    half = 0.52 * (1 - x**2) ** 0.75 * (1 - 0.28 * x)
    teeth = 0.016 * np.abs(np.sin(19 * x))
    blade = np.concatenate([np.column_stack([x, half + teeth]), np.column_stack([x, -half + 0.012 * x])[::-1]])
    stem = np.array([[-1.5, -0.045], [-0.95, -0.03], [-0.95, 0.03], [-1.5, -0.005]])
    vein = np.array([[-0.9, -0.016], [0.75, -0.006], [0.75, 0.006], [-0.9, 0.016]])
    ribs = [
        (np.array([[p, 0], [p + 0.32, s * 0.29], [p + 0.345, s * 0.275], [p + 0.05, 0]]), 0.0)
        for p in (-0.7, -0.35, 0.0)
        for s in (1, -1)
    ]
    layers = ((blade, 1.0), (stem, 1.0), (vein, 0.0), *ribs)
    return Drawing(name="leaf", layers=layers, group="D1", rough="one toothed side, bent stem")


def _face() -> Drawing:
    mouth = np.concatenate([ellipse(0, -0.12, 0.55, 0.5)[125:235], ellipse(0, -0.05, 0.5, 0.36)[125:235][::-1]])
    layers = (
        (ellipse(0, 0, 0.86, 1.0), 1.0),
        (ellipse(-0.98, 0.05, 0.14, 0.22), 1.0),
        (ellipse(0.98, 0.06, 0.14, 0.21), 1.0),
        (ellipse(-0.34, 0.3, 0.15, 0.11), 0.0),
        (ellipse(0.35, 0.31, 0.145, 0.11), 0.0),
        (np.array([[0.0, 0.18], [0.12, -0.2], [-0.1, -0.2]]), 0.0),
        (mouth, 0.0),
    )
    return Drawing(name="face", layers=layers, group="D1", angle_rad=0.5 * np.pi, rough="drawn by hand")


def _arrow() -> Drawing:
    shape = [[-1, -0.16], [0.25, -0.16], [0.25, -0.5], [1, 0], [0.25, 0.5], [0.25, 0.16], [-1, 0.16]]
    return Drawing(name="arrow", layers=((np.array(shape), 1.0),), group="D1")


def _heart() -> Drawing:
    t = 2.0 * np.pi * np.arange(400) / 400
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    points = np.column_stack([16 * np.sin(t) ** 3, y]) / 16
    return Drawing(name="heart", layers=((points, 1.0),), group="D1", angle_rad=0.5 * np.pi)


def _letter_z() -> Drawing:
    half = np.array([[-0.8, 0.64], [-0.8, 1.0], [0.8, 1.0], [0.8, 0.64], [-0.28, -0.64]])
    return Drawing(name="letter Z", layers=((np.concatenate([half, -half]), 1.0),), group="C2")


def _key() -> Drawing:
    layers = (
        (ellipse(-0.75, 0, 0.42), 1.0),
        (ellipse(-0.75, 0, 0.24), 0.0),
        (box(-0.4, -0.09, 1.0, 0.09), 1.0),
        (box(0.55, -0.36, 0.68, 0.0), 1.0),
        (box(0.82, -0.27, 1.0, 0.0), 1.0),
    )
    return Drawing(name="key", layers=layers, group="C1")


def _pinwheel(fold: int) -> Drawing:
    width = 2.0 * np.pi / fold
    tip = np.array([[0.0, 0.0], [1.0, 0.0], [0.62 * np.cos(0.55 * width), 0.62 * np.sin(0.55 * width)]])
    return Drawing(name=f"pinwheel of {fold}", layers=tuple(repeated(tip, fold)), group=f"C{fold}")


def _snowflake() -> Drawing:
    arm = [
        (box(0.0, -0.045, 1.0, 0.045), 1.0),
        *((turned(box(0.0, -0.035, 0.34, 0.035), s * np.pi / 3) + [0.5, 0.0], 1.0) for s in (1, -1)),
        *((turned(box(0.0, -0.03, 0.18, 0.03), s * np.pi / 3) + [0.78, 0.0], 1.0) for s in (1, -1)),
    ]
    layers = tuple((turned(part, np.pi * k / 3), grey) for k in range(6) for part, grey in arm)
    return Drawing(name="snowflake", layers=layers, group="D6")


def _gear() -> Drawing:
    rim = polar(lambda t: 0.86 + 0.14 * np.tanh(6 * np.cos(12 * t)))
    holes = [(ellipse(0.5 * np.cos(a), 0.5 * np.sin(a), 0.13), 0.0) for a in np.pi / 2 * np.arange(4)]
    return Drawing(name="gear, 12 teeth, 4 holes", layers=((rim, 1.0), (ellipse(0, 0, 0.14), 0.0), *holes), group="D4")


GALLERY = (
    _leaf(),
    _face(),
    _arrow(),
    _heart(),
    Drawing(name="letter A", layers=letter("A"), group="D1", angle_rad=0.5 * np.pi),
    Drawing(name="letter N", layers=letter("N"), group="C2"),
    Drawing(name="letter R", layers=letter("R"), group="C1"),
    Drawing(name="letter S", layers=letter("S"), group="C1", rough="C2 but for the smaller upper bowl"),
    _letter_z(),
    Drawing(name="letter O", layers=letter("O"), group="D2"),
    _key(),
    Drawing(name="triangle", layers=((star(3, 0.5), 1.0),), group="D3"),
    Drawing(name="star", layers=((star(5, 0.42), 1.0),), group="D5"),
    _snowflake(),
    _pinwheel(3),
    _pinwheel(4),
    _pinwheel(6),
    _gear(),
    Drawing(name="octagon", layers=((star(4, 1.0), 1.0),), group="D8"),
    Drawing(name="ring", layers=((ellipse(0, 0, 1.0), 1.0), (ellipse(0, 0, 0.55), 0.0)), group="O(2)"),
)

DRAWINGS = {d.name: d for d in (*CASE_STUDY, *GALLERY)}
