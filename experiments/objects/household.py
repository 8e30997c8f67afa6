"""Objects of the project's own making for the gallery, in the manner of the paper's last figure.

Each has exactly the symmetry that it is listed with: z is upright; a lone mirror has the normal y; of b mirrors through
the z axis one holds the x axis.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.objects.shapes import Mesh, asymmetric, bottle, box, join, mug, revolve, stool, table, tube
from symrefine.geometry import Array, rotation
from symrefine.shape import Shape

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Object:
    """How to build it, and what symmetry it has."""

    build: Callable[[], Shape]
    group: str

    @property
    def normals(self) -> tuple[tuple[float, float, float], ...]:
        """Normals of its mirrors; a surface of revolution has too many to list."""
        if self.group == "Cs":
            return (Y,)
        if not (self.group.endswith("v") and self.group[1:-1].isdigit()):
            return ()
        angles = np.pi * np.arange(int(self.group[1:-1])) / int(self.group[1:-1])
        return tuple((float(-np.sin(a)), float(np.cos(a)), 0.0) for a in angles)

    @property
    def axis(self) -> tuple[float, float, float] | None:
        """Direction of its axis, if it has one."""
        return None if self.group in ("C1", "Cs") else Z


def placed(
    mesh: Mesh, shift: Sequence[float] = (0, 0, 0), *, about: Sequence[float] = Z, turn_deg: float = 0.0
) -> Mesh:
    """A part turned about an axis through the origin, then moved."""
    return mesh[0] @ rotation(about, np.radians(turn_deg)).T + np.asarray(shift), mesh[1]


def around(parts: Sequence[Mesh], count: int) -> list[Mesh]:
    """Parts repeated `count` times about the z axis."""
    return [placed(part, turn_deg=360.0 * k / count) for k in range(count) for part in parts]


def prism(outline: Sequence[Sequence[float]], height: float, start: float = 0.0) -> Mesh:
    """Upright prism on a polygon [K, 2] that is star-shaped about its mean."""
    polygon = np.asarray(outline, dtype=float)
    count, middle = len(polygon), polygon.mean(axis=0)
    layers = [np.column_stack([polygon, np.full(count, z)]) for z in (start, start + height)]
    ends = [[[*middle, z]] for z in (start, start + height)]
    k = np.arange(count)
    after = (k + 1) % count
    sides = [np.stack([k, after, after + count], 1), np.stack([k, after + count, k + count], 1)]
    caps = [np.stack([after, k, 0 * k + 2 * count], 1), np.stack([k + count, after + count, 0 * k + 2 * count + 1], 1)]
    return np.concatenate([*layers, *ends]), np.concatenate(sides + caps)


def rod(a: Sequence[float], b: Sequence[float], radius: float, end_radius: float | None = None) -> Mesh:
    """Round rod between two points, tapered if it has an end radius."""
    first, second = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    length = float(np.linalg.norm(second - first))
    last = radius if end_radius is None else end_radius
    points, faces = revolve([(0, 0), (radius, 0), (last, length), (0, length)], 60)
    z = (second - first) / length
    side = np.cross(z, X if abs(z[0]) < 0.9 else Y)
    side /= np.linalg.norm(side)
    return points @ np.stack([side, np.cross(z, side), z]) + first, faces


def ellipsoid(center: Sequence[float], radii: Sequence[float]) -> Mesh:
    """Ellipsoid with its axes along those of space."""
    angle = np.linspace(0, np.pi, 25)
    points, faces = revolve(np.column_stack([np.sin(angle), -np.cos(angle)]), 60)
    return points * np.asarray(radii) + np.asarray(center), faces


def mirrored(parts: Sequence[Mesh]) -> list[Mesh]:
    """Parts and their reflections in the plane y = 0."""
    return [*parts, *((points * [1, -1, 1], faces[:, ::-1]) for points, faces in parts)]


def arc(radius: float, start_deg: float, stop_deg: float, center: Sequence[float] = (0, 0)) -> Array:
    """Points of a circle in the x-z plane."""
    t = np.radians(np.linspace(start_deg, stop_deg, 33))
    return np.column_stack([center[0] + radius * np.cos(t), 0 * t, center[1] + radius * np.sin(t)])


# One mirror plane


def chair() -> Shape:
    legs = [box((x, 0.2, 0.22), (0.05, 0.05, 0.44)) for x in (-0.2, 0.2)]
    back = placed(box((0, 0, 0.28), (0.04, 0.45, 0.56)), (-0.22, 0, 0.46), about=Y, turn_deg=-10)
    return join([box((0, 0, 0.45), (0.48, 0.46, 0.04)), *mirrored(legs), back])


def sofa() -> Shape:
    arms = mirrored([box((0, 0.85, 0.3), (0.8, 0.15, 0.6))])
    return join([box((0, 0, 0.2), (0.8, 1.6, 0.3)), box((-0.35, 0, 0.5), (0.18, 1.6, 0.7)), *arms])


def bed() -> Shape:
    return join(
        [
            box((0, 0, 0.3), (2.0, 1.2, 0.25)),
            box((-1.02, 0, 0.5), (0.06, 1.3, 1.0)),
            box((1.02, 0, 0.3), (0.06, 1.3, 0.6)),
            box((-0.75, 0, 0.47), (0.35, 0.9, 0.1)),
        ]
    )


def laptop() -> Shape:
    screen = placed(box((0, 0, 0.36), (0.03, 1.0, 0.72)), (-0.36, 0, 0.02), about=Y, turn_deg=-20)
    return join([box((0.06, 0, 0), (0.84, 1.0, 0.05)), screen])


def airplane() -> Shape:
    hull = revolve([(0, 0), (0.06, 0.05), (0.1, 0.2), (0.1, 0.8), (0.03, 1.3), (0, 1.3)], 48)
    wing = prism([(0.45, 0.0), (0.7, 0.0), (0.82, 0.75), (0.72, 0.75)], 0.02, -0.05)
    tail = prism([(1.1, 0.0), (1.25, 0.0), (1.3, 0.28), (1.2, 0.28)], 0.02, 0.0)
    fin = placed(prism([(1.05, 0.0), (1.25, 0.0), (1.34, 0.3), (1.24, 0.3)], 0.02, -0.01), about=X, turn_deg=90)
    return join([placed(hull, about=Y, turn_deg=90), *mirrored([wing, tail]), fin])


def car() -> Shape:
    wheel = placed(revolve([(0, 0), (0.17, 0), (0.17, 0.12), (0, 0.12)], 48), about=X, turn_deg=-90)
    wheels = mirrored([placed(wheel, (x, 0.32, 0.17)) for x in (-0.5, 0.55)])
    cabin = prism([(-0.75, 0.5), (0.25, 0.5), (0.0, 0.85), (-0.55, 0.85)], 0.72, -0.36)
    body = [box((0, 0, 0.36), (1.8, 0.8, 0.28)), placed(cabin, about=X, turn_deg=90)]
    return join([*body, *wheels])


def jug() -> Shape:
    body = revolve([(0, 0), (0.28, 0), (0.36, 0.25), (0.3, 0.6), (0.2, 0.8), (0.24, 0.95), (0, 0.95)], 72)
    spout = rod((0.25, 0, 0.35), (0.62, 0, 0.85), 0.1, 0.05)
    return join([body, spout, tube(arc(0.25, 90, 270, (-0.28, 0.52)), 0.04)])


def spoon() -> Shape:
    return join([ellipsoid((0, 0, 0), (0.22, 0.15, 0.05)), tube(arc(1.6, 100, 65, (0.5, -1.55)), 0.03)])


def hammer() -> Shape:
    claw = prism([(-0.08, 0.85), (-0.08, 0.97), (-0.45, 0.75)], 0.1, -0.05)
    face = [rod((0.05, 0, 0.91), (0.18, 0, 0.91), 0.05), rod((0.18, 0, 0.91), (0.26, 0, 0.91), 0.08)]
    head = [box((0, 0, 0.91), (0.17, 0.12, 0.14)), placed(claw, about=X, turn_deg=90), *face]
    return join([box((0, 0, 0.42), (0.07, 0.05, 0.84)), *head])


def boat() -> Shape:
    hull = prism([(-0.9, -0.3), (0.4, -0.35), (1.0, 0.0), (0.4, 0.35), (-0.9, 0.3)], 0.3)
    sail = placed(prism([(-0.45, 0.35), (0.2, 0.35), (0.15, 1.5)], 0.02, -0.01), about=X, turn_deg=90)
    return join([hull, rod((0.2, 0, 0.3), (0.2, 0, 1.6), 0.03), sail, box((-0.6, 0, 0.38), (0.35, 0.4, 0.16))])


def spectacles() -> Shape:
    lens = placed(tube(arc(0.25, 0, 360), 0.025), turn_deg=90)
    half = [placed(lens, (0, 0.32, 0)), rod((0, 0.57, 0.05), (-0.8, 0.55, 0.05), 0.02)]
    return join([*mirrored(half), rod((0, -0.08, 0.1), (0, 0.08, 0.1), 0.02)])


def house() -> Shape:
    roof = placed(prism([(-0.6, 0.8), (0.6, 0.8), (0.0, 1.3)], 1.5, -0.75), turn_deg=90, about=X)
    porch = [box((0.95, 0, 0.55), (0.4, 0.6, 0.05)), *mirrored([rod((1.1, 0.25, 0), (1.1, 0.25, 0.55), 0.04)])]
    return join([box((0, 0, 0.4), (1.5, 1.1, 0.8)), placed(roof, turn_deg=90), *porch])


def dog() -> Shape:
    legs = mirrored([rod((x, 0.13, 0), (x, 0.13, 0.4), 0.06) for x in (-0.35, 0.3)])
    head = [ellipsoid((0.62, 0, 0.82), (0.2, 0.15, 0.16)), ellipsoid((0.82, 0, 0.76), (0.14, 0.08, 0.07))]
    ears = mirrored([ellipsoid((0.55, 0.15, 0.86), (0.07, 0.03, 0.15))])
    body = [ellipsoid((0, 0, 0.52), (0.55, 0.22, 0.24)), rod((0.4, 0, 0.6), (0.55, 0, 0.75), 0.11)]
    return join([*body, *head, *ears, *legs, rod((-0.5, 0, 0.6), (-0.8, 0, 0.85), 0.05, 0.02)])


# Surfaces of revolution


def round_about(*profile: tuple[float, float]) -> Callable[[], Shape]:
    """Builder of a surface of revolution from a polyline of (radius, height)."""
    return lambda: join([revolve(profile, 180)])


vase = round_about(
    (0, 0), (0.2, 0), (0.34, 0.3), (0.3, 0.6), (0.12, 0.85), (0.2, 1.05), (0.17, 1.05), (0.09, 0.85), (0, 0.85)
)
wine_glass = round_about(
    (0, 0), (0.3, 0), (0.3, 0.02), (0.03, 0.06), (0.03, 0.55), (0.25, 0.7), (0.3, 0.95), (0.25, 1.2), (0.23, 1.2),
    (0.28, 0.95), (0, 0.6),
)  # fmt: skip
bowl = round_about((0, 0), (0.2, 0), (0.22, 0.06), (0.5, 0.2), (0.6, 0.42), (0.56, 0.42), (0.47, 0.24), (0, 0.1))
bell = round_about(
    (0, 0.9), (0.12, 0.9), (0.25, 0.8), (0.3, 0.4), (0.45, 0.1), (0.5, 0), (0.45, 0), (0.26, 0.4), (0.2, 0.75), (0, 0.8)
)
pawn = round_about(
    (0, 0), (0.28, 0), (0.28, 0.08), (0.2, 0.14), (0.1, 0.5), (0.2, 0.55), (0.1, 0.6), (0.17, 0.72), (0.17, 0.82),
    (0.1, 0.92), (0, 0.95),
)  # fmt: skip
lamp = round_about(
    (0, 0), (0.25, 0), (0.25, 0.05), (0.03, 0.08), (0.03, 0.7), (0.35, 0.7), (0.18, 1.15), (0.17, 1.15), (0.33, 0.72),
    (0, 0.72),
)  # fmt: skip
candlestick = round_about(
    (0, 0), (0.25, 0), (0.1, 0.1), (0.06, 0.3), (0.12, 0.4), (0.05, 0.5), (0.05, 0.8), (0.15, 0.9), (0.06, 0.9),
    (0.06, 1.3), (0, 1.3),
)  # fmt: skip
top = round_about((0, 0), (0.02, 0.1), (0.3, 0.32), (0.42, 0.45), (0.38, 0.52), (0.06, 0.56), (0.04, 0.85), (0, 0.85))


# Several mirror planes through an axis


def rectangular_table() -> Shape:
    legs = [box((x, y, 0.335), (0.08, 0.08, 0.67)) for x in (-0.68, 0.68) for y in (-0.38, 0.38)]
    return join([box((0, 0, 0.7), (1.5, 0.9, 0.06)), *legs])


def basket() -> Shape:
    walls = [box((0, 0, 0.02), (1.0, 0.6, 0.04)), *mirrored([box((0, 0.3, 0.2), (1.0, 0.03, 0.4))])]
    ends = [box((x, 0, 0.2), (0.03, 0.6, 0.4)) for x in (-0.5, 0.5)]
    return join([*walls, *ends, tube(arc(0.5, 0, 180, (0, 0.4)), 0.03)])


def fan() -> Shape:
    hub = [revolve([(0, 0), (0.18, 0), (0.22, 0.12), (0.06, 0.2), (0.03, 0.6), (0, 0.6)], 60)]
    blade = prism([(0.15, -0.06), (0.9, -0.13), (0.9, 0.13), (0.15, 0.06)], 0.02, 0.03)
    return join([*hub, *around([blade], 3)])


def tower() -> Shape:
    legs = around([rod((0.5, 0.5, 0), (0.14, 0.14, 0.9), 0.08, 0.05)], 4)
    decks = [box((0, 0, 0.45), (0.75, 0.75, 0.06)), box((0, 0, 0.9), (0.4, 0.4, 0.06))]
    return join([*legs, *decks, placed(prism([(0.12, 0), (0, 0.12), (-0.12, 0), (0, -0.12)], 0.9, 0.9))])


def flower() -> Shape:
    petal = placed(placed(ellipsoid((0.35, 0, 0), (0.28, 0.16, 0.03)), about=Y, turn_deg=-25), (0, 0, 0.9))
    return join([rod((0, 0, 0), (0, 0, 0.9), 0.03), ellipsoid((0, 0, 0.92), (0.12, 0.12, 0.06)), *around([petal], 5)])


def chandelier() -> Shape:
    arm = [tube(arc(0.3, 180, 300, (0.35, 0.3)), 0.03), rod((0.5, 0, 0.03), (0.5, 0, 0.3), 0.06)]
    return join([revolve([(0, 0), (0.08, 0.1), (0.08, 0.4), (0.02, 0.5), (0.02, 1.0), (0, 1.0)], 60), *around(arm, 6)])


def crown() -> Shape:
    band = revolve([(0.5, 0), (0.52, 0), (0.52, 0.3), (0.5, 0.3), (0.5, 0)], 70)
    tip = prism([(-0.18, 0.0), (0.18, 0.0), (0.0, 0.4)], 0.02, -0.01)
    tip = placed(placed(placed(tip, about=X, turn_deg=90), turn_deg=90), (0.51, 0, 0.3))
    return join([band, *around([tip], 7)])


def umbrella() -> Shape:
    gore = [rod((0, 0, 1.0), (0.7, 0, 0.7), 0.02)]
    edges = [placed(part, turn_deg=30) for part in [rod((0.06, 0, 0.97), (0.5, 0, 0.73), 0.02)]]
    cloth = prism([(0.7 * np.cos(k * np.pi / 3), 0.7 * np.sin(k * np.pi / 3)) for k in range(6)], 0.01, 0.7)
    peaked = np.where(np.linalg.norm(cloth[0][:, :2], axis=1) < 1e-9, 0.3, 0.0)[:, None] * np.array(Z) + cloth[0]
    return join([(peaked, cloth[1]), *around(gore + edges, 6), rod((0, 0, 0), (0, 0, 1.1), 0.03)])


# An axis without mirrors, and nothing at all


def propeller() -> Shape:
    blade = placed(placed(box((0.5, 0, 0), (0.8, 0.2, 0.03)), about=X, turn_deg=35), (0, 0, 0.1))
    return join([revolve([(0, 0), (0.12, 0), (0.12, 0.2), (0, 0.35)], 60), *around([blade], 3)])


def camera() -> Shape:
    """A reflex camera: grip on one side, prism above the lens, which stands aside of the middle."""
    lens = revolve([(0, 0), (0.3, 0), (0.3, 0.25), (0.26, 0.25), (0.26, 0.5), (0.22, 0.5), (0.2, 0.42), (0, 0.42)], 72)
    parts = [
        box((0, 0, 0), (0.4, 1.3, 0.8)),
        placed(lens, (0.2, 0.08, -0.02), about=Y, turn_deg=90),
        box((0.25, -0.52, -0.02), (0.3, 0.24, 0.74)),
        placed(prism([(-0.2, -0.25), (0.25, -0.12), (0.25, 0.12), (-0.2, 0.25)], 0.22, 0.4), (0, 0.08, 0)),
        rod((0.05, -0.5, 0.4), (0.05, -0.5, 0.5), 0.09),
        rod((-0.05, 0.5, 0.4), (-0.05, 0.5, 0.47), 0.13),
    ]
    return join(parts)


def grinder() -> Shape:
    crank = [rod((0, 0, 0.7), (0.45, 0, 0.8), 0.03), rod((0.45, 0, 0.8), (0.45, 0, 1.0), 0.06)]
    return join(
        [
            box((0, 0, 0.25), (0.5, 0.5, 0.5)),
            revolve([(0, 0.5), (0.1, 0.5), (0.25, 0.6), (0.2, 0.7), (0, 0.75)], 60),
            *(placed(part, turn_deg=25) for part in crank),
            box((0.3, 0.05, 0.12), (0.12, 0.2, 0.12)),
        ]
    )


OBJECTS: dict[str, Object] = {
    name: Object(build=build, group=group)
    for group, builders in {
        "Cs": {
            "mug": mug, "chair": chair, "sofa": sofa, "bed": bed, "laptop": laptop, "airplane": airplane, "car": car,
            "jug": jug, "spoon": spoon, "hammer": hammer, "boat": boat, "spectacles": spectacles, "house": house,
            "dog": dog,
        },
        "Cinfv": {
            "bottle": bottle, "vase": vase, "wine_glass": wine_glass, "bowl": bowl, "bell": bell, "pawn": pawn,
            "lamp": lamp, "candlestick": candlestick, "top": top,
        },
        "C2v": {"rectangular_table": rectangular_table, "basket": basket},
        "C3v": {"stool3": lambda: stool(3), "fan": fan},
        "C4v": {"table": table, "tower": tower},
        "C5v": {"stool5": lambda: stool(5), "flower": flower},
        "C6v": {"stool6": lambda: stool(6), "chandelier": chandelier, "umbrella": umbrella},
        "C7v": {"crown": crown},
        "C8v": {"stool8": lambda: stool(8)},
        "C3": {"propeller": propeller},
        "C1": {"camera": camera, "grinder": grinder, "asymmetric": asymmetric},
    }.items()
    for name, build in builders.items()
}  # fmt: skip
