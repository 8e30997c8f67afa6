"""Rotors without mirrors and gears with them, of 7 to 60 blades and teeth, the first on x, the axis on z.

Round parts have a multiple of the number of blades as facets, so that the meshes have their groups exactly.
"""

from collections.abc import Callable

import numpy as np

from experiments.objects.constructions import polygon, wall
from experiments.objects.instances import Build, Instance, of_parts
from experiments.objects.parts import Part, assembled, block, cylinder, extruded, lofted, ring_of, spun, stacked
from symrefine.geometry import Array, rotation

Rng = np.random.Generator
# Facets that a round part has at least.
FACETS = 96


def facets(count: int) -> int:
    """Even multiple of `count`, at least `FACETS`."""
    return 2 * count * -(-FACETS // (2 * count))


def _instance(parts: list[Part], count: int, name: str, *also: str) -> Instance:
    """The object, also right as `also` where the tolerance is a quarter of the way from tip to tip or more."""
    return of_parts(parts, name, *also, also_from=0.25 * 2.0 * np.pi / count / assembled(parts).diagonal)


def _cyclic(parts: list[Part], count: int) -> Instance:
    return _instance(parts, count, f"C{count}", f"C{count}v", "Cinfv")


def _dihedral(parts: list[Part], count: int) -> Instance:
    return _instance(parts, count, f"D{count}", f"D{count}h", "Dinfh")


def _hub(count: int, radius: float, half: float, nose: float = 0.0) -> Part:
    """A cylinder, with a cone on top and a shaft below if there is a nose."""
    around = facets(count)
    if nose == 0.0:
        return cylinder(radius, -half, half, around)
    shaft = 0.4 * radius
    return spun(
        [(0, -half - nose), (shaft, -half - nose), (shaft, -half), (radius, -half), (radius, half), (0, half + nose)],
        around,
    )


def _pitched(count: int, rng: Rng, hub: float) -> Part:
    """A flat blade, pitched about the line that it stands on."""
    middle = 0.5 * (hub + 1.0)
    chord = rng.uniform(0.8, 1.3) * 2.0 * np.pi * middle / count
    flat = block((0, 0, 0), (1.04 - hub, chord, rng.uniform(0.08, 0.2) * chord))
    return flat.turned(rotation([1, 0, 0], rng.uniform(0.5, 0.9)), (middle, 0, 0))


def fan(count: int, rng: Rng) -> Instance:
    """Pitched flat blades on a hub with a nose and a shaft: C_n."""
    hub = rng.uniform(0.25, 0.45)
    parts = [
        _hub(count, hub, rng.uniform(0.08, 0.16), rng.uniform(0.2, 0.5)),
        *ring_of(_pitched(count, rng, hub), count),
    ]
    return _cyclic(parts, count)


def propeller(count: int, rng: Rng) -> Instance:
    """The same with both ends alike: D_n."""
    hub = rng.uniform(0.25, 0.45)
    parts = [_hub(count, hub, rng.uniform(0.08, 0.2)), *ring_of(_pitched(count, rng, hub), count)]
    return _dihedral(parts, count)


def turbine(count: int, rng: Rng) -> Instance:
    """Cambered blades, twisted from hub to tip: C_n."""
    hub = rng.uniform(0.3, 0.5)
    along = np.linspace(hub - 0.03, 1.0, 9)
    chord = rng.uniform(0.8, 1.2) * 2.0 * np.pi * hub / count
    t = np.linspace(-0.5, 0.5, 7)
    camber, thick = rng.uniform(0.1, 0.2) * (1.0 - 4.0 * t**2), 0.05 * (1.2 - 4.0 * t**2 * 0.8)
    section = chord * np.concatenate([np.stack([t, camber - thick], 1), np.stack([t, camber + thick], 1)[::-1]])
    angles = np.linspace(rng.uniform(1.0, 1.3), rng.uniform(0.4, 0.7), len(along))
    rings = [
        np.column_stack([np.full(len(section), r), section @ _turn2(a).T]) for r, a in zip(along, angles, strict=True)
    ]
    parts = [_hub(count, hub, rng.uniform(0.1, 0.2), rng.uniform(0.2, 0.4)), *ring_of(lofted(np.array(rings)), count)]
    return _cyclic(parts, count)


def impeller(count: int, rng: Rng) -> Instance:
    """Upright blades swept backwards on a disc: C_n."""
    hub, height = rng.uniform(0.2, 0.4), rng.uniform(0.15, 0.4)
    along = np.linspace(hub, 1.0, 13)
    sweep = rng.uniform(0.5, 1.0) * (along - hub) / (1.0 - hub)
    path = np.stack([along * np.cos(sweep), along * np.sin(sweep)], axis=1)
    ahead = np.gradient(path, axis=0)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.linalg.norm(ahead, axis=1, keepdims=True)
    half = rng.uniform(0.08, 0.14) * 2.0 * np.pi * hub / count
    corners = [(-half, -0.02), (half, -0.02), (half, height), (-half, height)]
    rings = np.array([[[*(p + s * a), z] for s, z in corners] for p, a in zip(path, aside, strict=True)])
    around = facets(count)
    parts = [cylinder(1.0, -0.06, 0.0, around), cylinder(hub, -0.02, 0.6 * height, around)]
    return _cyclic([*parts, *ring_of(lofted(rings), count)], count)


def ratchet(count: int, rng: Rng) -> Instance:
    """Saw teeth on a disc with a boss on one side: C_n."""
    depth, half = rng.uniform(1.5, 2.5) / count, rng.uniform(0.06, 0.15)
    steep = rng.uniform(0.05, 0.15)
    tooth = [(0.0, 1.0 - depth), (steep, 1.0), (0.5 * (1 + steep), 1.0 - 0.5 * depth)]
    boss = cylinder(rng.uniform(0.25, 0.5), half - 0.02, half + rng.uniform(0.1, 0.3), facets(count))
    return _cyclic([extruded(_toothed(count, tooth), -half, half), boss], count)


def helical(count: int, rng: Rng) -> Instance:
    """A gear whose teeth wind around it, on a shaft with both ends alike: D_n."""
    half, heights = rng.uniform(0.12, 0.3), np.linspace(-1.0, 1.0, 9)
    outline, twist = _toothed(count, _flank(count, rng)), rng.uniform(0.5, 1.0) * 2.0 * np.pi / count
    rings = [np.column_stack([outline @ _turn2(0.5 * twist * h).T, np.full(len(outline), half * h)]) for h in heights]
    reach = half + rng.uniform(0.1, 0.3)
    return _dihedral([stacked(np.array(rings)), cylinder(rng.uniform(0.2, 0.4), -reach, reach, facets(count))], count)


def _turn2(angle_rad: float) -> Array:
    return rotation([0, 0, 1], angle_rad)[:2, :2]


def _toothed(count: int, tooth: list[tuple[float, float]]) -> Array:
    """An outline [K, 2] of `count` teeth, each by (angle in teeth, radius)."""
    angle = np.array([2.0 * np.pi * (j + a) / count for j in range(count) for a, _ in tooth])
    radius = np.array([r for _ in range(count) for _, r in tooth])
    return np.asarray(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def _flank(count: int, rng: Rng) -> list[tuple[float, float]]:
    """A tooth with sloping flanks, centred on x, as high as gear teeth are (2.25 modules) or lower."""
    root, foot, tip = 1.0 - rng.uniform(3.0, 4.5) / (count + 4), rng.uniform(0.27, 0.32), rng.uniform(0.1, 0.16)
    return [(-foot, root), (-tip, 1.0), (tip, 1.0), (foot, root)]


def spur(count: int, rng: Rng) -> Instance:
    """A gear on a shaft with both ends alike: D_nh."""
    half = rng.uniform(0.08, 0.25)
    reach = half + rng.uniform(0.05, 0.3)
    shaft = cylinder(rng.uniform(0.2, 0.4), -reach, reach, facets(count))
    return _instance([extruded(_toothed(count, _flank(count, rng)), -half, half), shaft], count, f"D{count}h", "Dinfh")


def bossed(count: int, rng: Rng) -> Instance:
    """A gear with a boss on one side: C_nv."""
    half = rng.uniform(0.08, 0.25)
    boss = cylinder(rng.uniform(0.25, 0.5), half - 0.02, half + rng.uniform(0.15, 0.4), facets(count))
    return _instance([extruded(_toothed(count, _flank(count, rng)), -half, half), boss], count, f"C{count}v", "Cinfv")


def crown(count: int, rng: Rng) -> Instance:
    """Upright teeth on a disc: C_nv."""
    width, height = rng.uniform(0.4, 0.6) * 2.0 * np.pi * 0.85 / count, rng.uniform(0.15, 0.4)
    tooth = block((0.85, 0, 0.5 * height - 0.02), (rng.uniform(0.2, 0.3), width, height))
    disc = cylinder(1.0, -rng.uniform(0.1, 0.2), 0.0, facets(count))
    return _instance([disc, *ring_of(tooth, count)], count, f"C{count}v", "Cinfv")


def knob(count: int, rng: Rng) -> Instance:
    """A fluted knob, narrower above: C_nv."""
    angle = 2.0 * np.pi * np.arange(8 * count) / (8 * count)
    lobed = 1.0 - rng.uniform(0.8, 1.4) / (count + 4) * (1.0 - np.cos(count * angle))
    outline = lobed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    height, top = rng.uniform(0.5, 1.0), rng.uniform(0.7, 0.9)
    rings = wall(outline, (0.0, height))
    rings[1, :, :2] *= top
    skirt = extruded(polygon(facets(count), 1.1), -0.12, 0.0)
    return _instance([stacked(rings), skirt], count, f"C{count}v", "Cinfv")


def _family(counts: dict[Callable[[int, Rng], Instance], str]) -> dict[str, Build]:
    return {
        f"{build.__name__}{number}": lambda rng, build=build, number=number: build(int(number), rng)  # type: ignore[misc]
        for build, numbers in counts.items()
        for number in numbers.split()
    }


ROTORS = _family(
    {
        fan: "7 16 23 36",
        propeller: "9 12 24 41",
        turbine: "12 24 60",
        impeller: "11 19 30 48",
        ratchet: "16 36 60",
        helical: "19 30 48",
    }
)
GEARS = _family({spur: "8 13 20 25 32 45 60", bossed: "9 16 24 29 40 60", crown: "12 21 36", knob: "18 30 48"})
