"""Parts of the shapes of `group_shapes`: everyday objects and models, each with an exactly known symmetry."""

from collections.abc import Sequence

import numpy as np

from experiments.objects.parts import (
    Part,
    ball,
    block,
    bored,
    cylinder,
    extruded,
    hull,
    orbit,
    pipe,
    ring_of,
    rod,
    spun,
    stacked,
)
from symrefine.geometry import Array, rotation, unit

# Outlines


def polygon(fold: int, radius: float = 1.0, turn_rad: float = 0.0) -> Array:
    """A regular polygon [fold, 2]."""
    angle = 2 * np.pi * np.arange(fold) / fold + turn_rad
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def oblong(length: float, width: float) -> Array:
    """A rectangle [4, 2]."""
    return 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])


def hexagon(radius: float, count: int = 96) -> Array:
    """A hexagon [count, 2], a corner on x, at equal steps of the angle."""
    angle = 2 * np.pi * np.arange(count) / count
    aside = (angle % (np.pi / 3)) - np.pi / 6
    distance = radius * np.cos(np.pi / 6) / np.cos(aside)
    return distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def wall(outline: Array, heights: Sequence[float] | Array) -> Array:
    """The outline at several heights: rings [H, K, 3]."""
    return np.stack([np.column_stack([outline, np.full(len(outline), z)]) for z in heights])


def thread(radius: float, depth: float, pitch: float, heights: Array, count: int = 96) -> Array:
    """A right-handed helical thread with a triangular profile: rings [H, count, 3]; a crest at angle 0, height 0."""
    angle = 2 * np.pi * np.arange(count) / count
    phase = (angle[None] / (2 * np.pi) - heights[:, None] / pitch) % 1.0
    distance = radius + depth * (4 * np.abs(phase - 0.5) - 1)
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    return np.stack([x, y, np.broadcast_to(heights[:, None], x.shape)], axis=-1)


# No symmetry, one mirror, an inversion


def clutter() -> list[Part]:
    """Four boxes with nothing in common."""
    return [
        block((0, 0, 0), (1.0, 0.6, 0.2)),
        block((0.35, 0.2, 0.25), (0.15, 0.12, 0.4), 0.3),
        block((0.1, -0.4, 0.05), (0.4, 0.3, 0.1), 0.2),
        block((-0.3, -0.1, 0.2), (0.2, 0.3, 0.3), 0.7),
    ]


def flange_nut() -> list[Part]:
    """A hexagonal nut on a flange, with a coarse thread: six-fold but for the thread."""
    heights = np.linspace(-0.8, 0.8, 65)
    nut = bored(wall(hexagon(1.0), (-0.8, 0.8)), thread(0.48, 0.2, 0.8, heights))
    return [nut, pipe(0.7, 1.3, -0.9, -0.65)]


def bolt() -> list[Part]:
    """A bolt with a hexagonal head and a coarse thread."""
    return [
        extruded(polygon(6, 1.0), 0.0, 0.6),
        stacked(thread(0.55, 0.18, 0.8, np.linspace(-1.8, 0.1, 77))),
    ]


def chair() -> list[Part]:
    """A chair: seat, back, four legs."""
    legs = [block((x, y, 0.22), (0.08, 0.08, 0.44)) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
    return [block((0, 0, 0.46), (0.5, 0.5, 0.06)), block((-0.22, 0, 0.75), (0.05, 0.46, 0.5)), *legs]


def bracket() -> list[Part]:
    """An angle bracket with a bolt through each leaf."""
    leaf = hull([(x, y, z) for y in (-0.4, 0.4) for x, z in ((0, 0), (1, 0), (1, 0.12), (0, 0.12))])
    wing = hull([(x, y, z) for y in (-0.4, 0.4) for x, z in ((0, 0), (0.12, 0), (0.12, 0.8), (0, 0.8))])
    return [leaf, wing, rod((-0.2, 0, 0.55), (0.3, 0, 0.55), 0.1), rod((0.65, 0, -0.25), (0.65, 0, 0.35), 0.16)]


def wedge(center: Sequence[float], size: float = 1.0) -> Part:
    """An irregular tetrahedron: no operation maps it onto itself."""
    corners = np.array([[-0.25, -0.24, -0.19], [0.25, -0.09, 0.06], [-0.15, 0.16, 0.01], [-0.05, -0.14, 0.51]])
    return hull(size * corners + np.asarray(center))


def skew_box() -> list[Part]:
    """A parallelepiped with a wedge at either end."""
    a, b, c = np.array([[1.0, 0, 0], [0.25, 0.7, 0.1], [0.15, 0.25, 0.5]])
    corners = [i * a + j * b + k * c for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)]
    return [hull(corners), *orbit(wedge((0.75, 0.1, 0.3)), "Ci")]


def opposed_rods() -> list[Part]:
    """A brick with rods of two sizes on opposite faces, point-symmetric."""
    posts = orbit(rod((0.3, 0.15, 0.2), (0.3, 0.15, 0.7), 0.12), "Ci")
    return [block((0, 0, 0), (1.2, 0.8, 0.4)), *posts, *orbit(block((0.5, 0.5, 0.05), (0.25, 0.3, 0.2)), "Ci")]


# One axis


def fan(blades: int, *, nose: bool) -> list[Part]:
    """Pitched flat blades on a hub: D_n, and C_n with a nose and a shaft."""
    blade = block((0, 0, 0), (0.7, 0.34, 0.06)).turned(rotation([1, 0, 0], np.pi / 4), (0.6, 0, 0))
    hub = [cylinder(0.3, -0.15, 0.15)]
    if nose:
        hub = [spun([(0, -0.7), (0.12, -0.7), (0.12, -0.15), (0.3, -0.15), (0.3, 0.15), (0, 0.6)])]
    return [*hub, *ring_of(blade, blades)]


def rotor(fold: int, layers: Sequence[tuple[float, int, float]], *, cap: bool = False) -> list[Part]:
    """Arms with feet in layers (height, sense of the feet, turn in arms): C_nh, S_2n, D_n, D_nh, D_nd and more."""
    low, high = min(z for z, _, _ in layers) - 0.2, max(z for z, _, _ in layers) + 0.2
    parts = [cylinder(0.3, low, high)]
    if cap:
        parts.append(spun([(0, high), (0.3, high), (0, high + 0.6)]))
    for height, sense, phase in layers:
        turn = rotation([0, 0, 1], 2 * np.pi * phase / fold)
        arm = block((0.6, 0, height), (0.64, 0.12, 0.14))
        foot = block((0.98, 0.14 * sense, height), (0.12, 0.4, 0.3))
        parts += [p.turned(turn) for p in (*ring_of(arm, fold), *ring_of(foot, fold))]
    return parts


def stool(legs: int) -> list[Part]:
    """A round seat on legs."""
    seat = cylinder(0.5, 0.6, 0.7, 2 * legs * (96 // (2 * legs) + 1))
    return [seat, *ring_of(rod((0.38, 0, 0), (0.38, 0, 0.6), 0.07), legs)]


def table() -> list[Part]:
    """A square table with a leg in each corner."""
    legs = [block((x, y, 0.32), (0.12, 0.12, 0.64)) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    return [block((0, 0, 0.67), (1, 1, 0.06)), *legs]


def bottle(body: Part) -> list[Part]:
    """A body 0.9 high with a round neck and cap."""
    return [body, spun([(0, 0.85), (0.13, 0.85), (0.13, 1.1), (0.2, 1.1), (0.2, 1.35), (0, 1.35)])]


def flat_sided(count: int = 48) -> Part:
    """A round body with two flat sides."""
    angle = np.linspace(-np.pi / 6, np.pi / 6, count)
    side = 0.45 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return extruded(np.concatenate([side, -side]), 0.0, 0.9)


def starfish() -> list[Part]:
    """Five pointed arms, flat below."""
    arm = hull([(0.1, -0.25, 0), (0.1, 0.25, 0), (1.0, 0, 0), (0.1, 0, 0.35)])
    return [extruded(polygon(5, 0.45, np.pi / 5), 0.0, 0.25), *ring_of(arm, 5)]


def swivel_base(arms: int) -> list[Part]:
    """The base of a swivel chair."""
    foot = block((0.95, 0, 0.0), (0.16, 0.18, 0.35))
    beam = hull([(x, y, z) for y in (-0.05, 0.05) for x, z in ((0.05, 0.1), (0.05, 0.35), (0.98, 0.05), (0.98, 0.17))])
    return [cylinder(0.14, 0.05, 0.9), *ring_of(beam, arms), *ring_of(foot, arms)]


def crown_gear() -> list[Part]:
    """A disc with twelve upright teeth on one side, on a shaft."""
    tooth = block((0.85, 0, 0.2), (0.3, 0.14, 0.5))
    return [cylinder(1.0, -0.15, 0.0), cylinder(0.2, -0.8, 0.1), *ring_of(tooth, 12)]


def threaded_collar() -> list[Part]:
    """A hexagonal nut with a coarse thread and two wings: a half turn across the axis remains."""
    nut = bored(wall(hexagon(1.0), (-0.8, 0.8)), thread(0.48, 0.2, 0.8, np.linspace(-0.8, 0.8, 65)))
    return [nut, *orbit(block((0, 1.1, 0), (0.25, 0.7, 0.5)), "C2")]


# Several axes


def crate() -> list[Part]:
    """A box with lids above and below and a handle at either end."""
    lids = [block((0, 0, z), (1.3, 0.9, 0.1)) for z in (-0.3, 0.3)]
    handles = [block((x, 0, 0), (0.3, 0.5, 0.12)) for x in (-0.7, 0.7)]
    return [block((0, 0, 0), (1.2, 0.8, 0.6)), *lids, *handles]


def slabs() -> list[Part]:
    """Three boxes on one another."""
    return [block((0, 0, 0), (1.2, 0.7, 0.4)), *(block((0, 0, z), (0.9, 0.5, 0.3)) for z in (-0.35, 0.35))]


def bossed_prism() -> list[Part]:
    """A triangular prism with a boss on each side."""
    boss = rod((0.3, 0, 0), (0.85, 0, 0), 0.22).turned(rotation([0, 0, 1], np.pi / 3))
    return [extruded(polygon(3), -0.4, 0.4), *ring_of(boss, 3)]


def cross() -> list[Part]:
    """Four arms about a square bar, a plate at the end of each."""
    arm, plate = block((0.5, 0, 0), (0.8, 0.3, 0.3)), block((0.95, 0, 0), (0.12, 0.6, 0.5))
    return [block((0, 0, 0), (0.4, 0.4, 1.2)), *ring_of(arm, 4), *ring_of(plate, 4)]


def wheel(spokes: int) -> list[Part]:
    """A rim, a hub and flat spokes."""
    spoke = block((0.5, 0, 0), (0.75, 0.08, 0.28))
    return [pipe(0.85, 1.0, -0.15, 0.15), pipe(0.1, 0.2, -0.25, 0.25), *ring_of(spoke, spokes)]


def bushed_nut() -> list[Part]:
    """A hexagonal nut with a plain bushing in its bore."""
    circle = polygon(96, 0.6)
    return [bored(wall(hexagon(1.0), (-0.35, 0.35)), wall(circle, (-0.35, 0.35))), pipe(0.4, 0.6, -0.6, 0.6)]


def gear(teeth: int) -> list[Part]:
    """A disc with a bore and teeth."""
    tooth = block((0.98, 0, 0), (0.44, 1.6 / teeth, 0.4))
    return [pipe(0.25, 0.8, -0.2, 0.2), *ring_of(tooth, teeth)]


# No single axis


def bars(name: str, turn_rad: float, at: float = 0.9) -> list[Part]:
    """A ball with a bar across each two-fold axis that the group has on x, turned about it."""
    bar = block((0, 0, 0), (0.5, 1.0, 0.24)).turned(rotation([1, 0, 0], turn_rad), (at, 0, 0))
    return [ball(at - 0.1), *orbit(bar, name)]


def twelve_bars() -> list[Part]:
    """A ball with a bar across each edge of a cube, askew."""
    bar = block((0, 0, 0), (0.5, 0.62, 0.16)).turned(rotation([1, 0, 0], np.pi / 4), (1.0, 0, 0))
    return [ball(0.9), *orbit(bar.turned(rotation([0, 0, 1], np.pi / 4)), "O")]


def thirty_bars() -> list[Part]:
    """A ball with a bar across each edge of an icosahedron, askew."""
    bar = block((0, 0, 0), (0.6, 0.44, 0.12)).turned(rotation([1, 0, 0], np.pi / 4), (1.0, 0, 0))
    return [ball(0.85), *orbit(bar, "I")]


def snub_balls() -> list[Part]:
    """A ball at each corner of a snub cube, about a cube."""
    t = float(np.real(np.roots([1, -1, -1, -1])[0]))
    return [block((0, 0, 0), (1.1, 1.1, 1.1)), *orbit(ball(0.3, (1.0, 1 / t, t), 24), "O")]


def methane() -> list[Part]:
    """A ball with four rods and a ball on each."""
    corner = unit([1, 1, 1])
    sticks = orbit(rod(0.2 * corner, 0.9 * corner, 0.12), "T")
    return [ball(0.4), *sticks, *orbit(ball(0.3, corner), "T")]


def caltrop() -> list[Part]:
    """Four spikes out of a tetrahedron."""
    corner = unit([1, 1, 1])
    return [
        hull(0.6 * unit([[-1, -1, -1], [-1, 1, 1], [1, -1, 1], [1, 1, -1]])),
        *orbit(rod(0.1 * corner, 1.2 * corner, 0.25, 0.0), "T"),
    ]


def jack() -> list[Part]:
    """Three crossed rods with a ball at every end."""
    sticks = [rod(-np.eye(3)[i], np.eye(3)[i], 0.12) for i in range(3)]
    return [*sticks, *orbit(ball(0.28, (1, 0, 0)), "O")]


def bossed_cube() -> list[Part]:
    """A cube with a square boss on each face."""
    return [block((0, 0, 0), (1, 1, 1)), *orbit(block((0.6, 0, 0), (0.4, 0.5, 0.5)), "O")]


def spiked_ball() -> list[Part]:
    """A ball with twelve pegs, like a virus."""
    corner = unit([0.0, 1.0, (1 + np.sqrt(5)) / 2])
    return [ball(0.8), *orbit(rod(0.6 * corner, 1.3 * corner, 0.15), "I")]


def dumbbell() -> list[Part]:
    """Two balls on a bar with a collar."""
    return [rod((0, 0, -1), (0, 0, 1), 0.15), cylinder(0.4, -0.15, 0.15), ball(0.4, (0, 0, -1)), ball(0.4, (0, 0, 1))]


def spool() -> list[Part]:
    """A cylinder between two discs."""
    return [cylinder(0.5, -0.5, 0.5), cylinder(0.8, -0.65, -0.5), cylinder(0.8, 0.5, 0.65)]


def goblet() -> list[Part]:
    """A foot, a stem and a bowl."""
    bowl = [(0, 0.6), (0.3, 0.7), (0.42, 0.95), (0.42, 1.3), (0.37, 1.3), (0.37, 0.95), (0, 0.7)]
    return [spun([(0, 0), (0.4, 0), (0.4, 0.06), (0.07, 0.12), (0.07, 0.65), (0, 0.65)]), spun(bowl)]


def hollow_ball() -> list[Part]:
    """A ball in a ball."""
    return [ball(1.0, segments=96), ball(0.6, segments=96)]


def halves(outline: Array, height: float) -> list[Part]:
    """A prism cut in two halfway up."""
    return [extruded(outline, -height / 2, 0.0), extruded(outline, 0.0, height / 2)]


def eight_cubes() -> list[Part]:
    """A cube of eight cubes."""
    return orbit(block((0.5, 0.5, 0.5), (1, 1, 1)), "O")


def drum() -> list[Part]:
    """A cylinder cut in two halfway up."""
    return [cylinder(0.5, -0.6, 0.0), cylinder(0.5, 0.0, 0.6)]


def cone() -> list[Part]:
    """A cone cut in two halfway up."""
    return [spun([(0, 0), (0.8, 0), (0.4, 0.7), (0, 0.7)]), spun([(0, 0.7), (0.4, 0.7), (0, 1.4)])]


def dodecahedral_frame() -> list[Part]:
    """The edges of a dodecahedron as rods, its corners as balls."""
    corner = np.ones(3)
    corners = np.array([p.marks[0, :3] for p in orbit(ball(0.1, corner, 8), "I")])
    nearest = corners[np.argsort(np.linalg.norm(corners - corner, axis=1))[1]]
    return [*orbit(rod(corner, nearest, 0.1), "I"), *orbit(ball(0.3, corner, 24), "I")]
