"""Idealised geometry of molecules in angstroms, from textbook bond lengths and angles, regular polyhedra and groups."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from symrefine.geometry import Array, rotation, unit
from symrefine.groups import point_group

TETRAHEDRAL = np.arccos(-1 / 3)
PHI = (1 + np.sqrt(5)) / 2
Atoms = list[tuple[str, Array]]

# How coordinates are made


def at(symbol: str, *position: float) -> tuple[str, Array]:
    """One atom."""
    return symbol, np.array(position, dtype=float)


def images(atoms: Atoms, group: str) -> Atoms:
    """The different images of atoms under a group in its standard placement."""
    found: Atoms = []
    for symbol, position in atoms:
        for image in point_group(group).operations() @ position:
            if not any(s == symbol and np.linalg.norm(image - p) < 1e-6 for s, p in found):
                found.append((symbol, image))
    return found


def turned(atoms: Atoms, matrix: Array, shift: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Atoms:
    """Atoms under x -> matrix x + shift."""
    return [(s, matrix @ p + np.asarray(shift, dtype=float)) for s, p in atoms]


def ring(symbol: str, count: int, radius: float, height: float = 0.0, turn_rad: float = 0.0) -> Atoms:
    """Atoms around z, the first on x before the turn."""
    angles = 2 * np.pi * np.arange(count) / count + turn_rad
    return [at(symbol, radius * np.cos(a), radius * np.sin(a), height) for a in angles]


def ring_radius(side: float, count: int) -> float:
    """Radius of the circle around a regular polygon of that side."""
    return float(side / (2 * np.sin(np.pi / count)))


def rotor(symbol: str, count: int, bond: float, angle_rad: float, turn_rad: float = 0.0) -> Atoms:
    """Atoms on a centre at the origin whose own bond points to -z, at `angle_rad` to that bond."""
    return ring(symbol, count, bond * np.sin(angle_rad), -bond * np.cos(angle_rad), turn_rad)


def along(atoms: Atoms, axis: Sequence[float] | Array, distance: float, up: Sequence[float] | Array) -> Atoms:
    """Atoms about the origin carried out along an axis, their z on it and their x on what of `up` is normal to it."""
    z = unit(np.asarray(axis, dtype=float))
    x = unit(np.asarray(up, dtype=float) - (np.asarray(up) @ z) * z)
    return turned(atoms, np.column_stack([x, np.cross(z, x), z]), distance * z)


# Molecules


def bent(center: str, ends: str, bond: float, angle_deg: float) -> Atoms:
    """AX2 with an angle, in the x-z plane."""
    half = np.radians(angle_deg) / 2
    return [at(center, 0, 0, 0), *(at(ends, s * bond * np.sin(half), 0, bond * np.cos(half)) for s in (-1, 1))]


def pyramid(center: str, ends: str, bond: float, angle_deg: float) -> Atoms:
    """AX3 with the angle X-A-X."""
    tilt = np.arcsin(2 * np.sin(np.radians(angle_deg) / 2) / np.sqrt(3))
    return [at(center, 0, 0, 0), *rotor(ends, 3, bond, np.pi - tilt)]


def tetrahedral(center: str, ends: Sequence[tuple[str, float]]) -> Atoms:
    """AX4 with bonds of their own lengths."""
    corners = unit(np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]))
    return [at(center, 0, 0, 0), *((s, bond * corner) for (s, bond), corner in zip(ends, corners, strict=True))]


def peroxide() -> Atoms:
    """H2O2: two planes at 111.5 degrees."""
    half, angle = np.radians(111.5) / 2, np.radians(94.8)
    out, up = 0.95 * np.sin(angle), 0.737 - 0.95 * np.cos(angle)
    one = [at("O", 0, 0, 0.737), at("H", out * np.cos(half), out * np.sin(half), up)]
    return one + turned(one, np.diag([1.0, -1.0, -1.0]))


def zigzag(inner: str, outer: str, bond: float, arm: float, angle_deg: float) -> Atoms:
    """Planar trans X-A=A-X."""
    angle = np.radians(angle_deg)
    return images([at(inner, bond / 2, 0, 0), at(outer, bond / 2 - arm * np.cos(angle), arm * np.sin(angle), 0)], "Ci")


def butadiene() -> Atoms:
    """Planar trans-butadiene."""
    a, b = np.array([0.735, 0.0, 0.0]), 1.34 * np.array([np.cos(1.02), np.sin(1.02), 0.0])
    half = [("C", a), ("C", a + b)]
    half.append(("H", a + 1.09 * rotation([0, 0, 1], np.radians(-61.0)) @ [1.0, 0, 0]))
    half += [("H", a + b + 1.09 * rotation([0, 0, 1], t) @ unit(b)) for t in np.radians([61.0, -61.0])]
    return images(half, "Ci")


def ethane(twist_deg: float) -> Atoms:
    """Ethane, its methyls turned against each other: 0 is eclipsed, 60 staggered."""
    twist = np.radians(twist_deg) / 2
    top = [at("C", 0, 0, 0), *rotor("H", 3, 1.09, np.radians(111.2), twist)]
    bottom = [at("C", 0, 0, 0), *rotor("H", 3, 1.09, np.radians(111.2), twist)]
    return turned(top, np.eye(3), (0, 0, 0.768)) + turned(bottom, rotation([1, 0, 0], np.pi), (0, 0, -0.768))


def allene() -> Atoms:
    """H2C=C=CH2, the ends crossed."""
    half = np.radians(118.2 / 2)
    end = [at("C", 0, 0, 0), at("H", np.sin(half), 0, np.cos(half)), at("H", -np.sin(half), 0, np.cos(half))]
    end = [(s, 1.087 * p) for s, p in end]
    across = np.diag([1.0, 1.0, -1.0]) @ rotation([0, 0, 1], np.pi / 2)
    return [at("C", 0, 0, 0), *turned(end, np.eye(3), (0, 0, 1.308)), *turned(end, across, (0, 0, -1.308))]


def ethylene() -> Atoms:
    """H2C=CH2."""
    out = np.radians(121.3)
    return images([at("C", 0, 0, 0.669), at("H", 1.087 * np.sin(out), 0, 0.669 - 1.087 * np.cos(out))], "D2h")


def plane_triangle(center: str, ends: str, bond: float) -> Atoms:
    """Planar AX3."""
    return [at(center, 0, 0, 0), *ring(ends, 3, bond)]


def bipyramid() -> Atoms:
    """PF5."""
    return [at("P", 0, 0, 0), *ring("F", 3, 1.534), at("F", 0, 0, 1.577), at("F", 0, 0, -1.577)]


def hydroxyl_ring(count: int, side: float, metal: tuple[str, float] | None = None) -> Atoms:
    """C_n(OH)_n with all hydroxyls turned the same way in its plane, under a metal or without."""
    radius, angle = ring_radius(side, count), np.radians(109.0)
    hydrogen = np.array([radius + 1.36 - 0.96 * np.cos(angle), 0.96 * np.sin(angle), 0.0])
    one = [at("C", radius, 0, 0), at("O", radius + 1.36, 0, 0), ("H", hydrogen)]
    return images(one, f"C{count}") + ([at(metal[0], 0, 0, metal[1])] if metal else [])


def hydroxyl_sandwich(count: int, side: float, gap: float) -> Atoms:
    """A metal between two such rings, staggered, turned the same way."""
    upper = turned(hydroxyl_ring(count, side), np.eye(3), (0, 0, gap))
    lower = turned(upper, np.diag([1.0, 1.0, -1.0]) @ rotation([0, 0, 1], np.pi / count))
    return [at("Ni", 0, 0, 0), *upper, *lower]


def carbon_ring(count: int, side: float = 1.40, hydrogen: float = 1.084) -> Atoms:
    """C_nH_n, flat."""
    radius = ring_radius(side, count)
    return ring("C", count, radius) + ring("H", count, radius + hydrogen)


def sandwich(metal: str, count: int, gap: float, twist_deg: float, side: float = 1.42) -> Atoms:
    """A metal between two rings C_nH_n, turned against each other."""
    half = rotation([0, 0, 1], np.radians(twist_deg) / 2)
    leaf = carbon_ring(count, side)
    return [at(metal, 0, 0, 0), *turned(leaf, half, (0, 0, gap)), *turned(leaf, half.T, (0, 0, -gap))]


def half_sandwich(metal: str, count: int, gap: float, side: float = 1.42) -> Atoms:
    """A metal over a ring."""
    return [at(metal, 0, 0, gap), *carbon_ring(count, side)]


def sulphur_crown() -> Atoms:
    """S8."""
    angle = np.radians(108.0)
    radius = 2.06 * np.sin(angle / 2) / np.sin(np.pi / 4)  # half the second-neighbour distance over sin 45 degrees
    height = np.sqrt(2.06**2 - (2 * radius * np.sin(np.pi / 8)) ** 2) / 2
    return [a for k in range(2) for a in ring("S", 4, radius, (-1) ** k * height, k * np.pi / 4)]


def eclipsed_dimer(twist_deg: float) -> Atoms:
    """Re2Cl8, its halves turned against each other."""
    half = rotation([0, 0, 1], np.radians(twist_deg) / 2)
    leaf = [at("Re", 0, 0, 0), *ring("Cl", 4, 2.22, 0.55)]
    down = np.diag([1.0, 1.0, -1.0])
    return turned(leaf, half, (0, 0, 1.11)) + turned(leaf, down @ half.T, (0, 0, -1.11))


def phenyl(bond: float, twist_rad: float) -> Atoms:
    """C6H5 with its axis on x at the distance `bond` from the origin, turned about it out of the x-y plane."""
    leaf = turned(carbon_ring(6, 1.395), np.eye(3), (bond + 1.395, 0, 0))
    leaf = [(s, p) for s, p in leaf if not (s == "H" and p[0] < bond)]
    return turned(leaf, rotation([1, 0, 0], twist_rad))


def triphenyl(center: str, bond: float, pucker_rad: float = 0.0, cap: tuple[str, float] | None = None) -> Atoms:
    """Three phenyl rings as a propeller about an atom, drawn down where it is a pyramid."""
    blade = turned(phenyl(bond, np.radians(40.0)), rotation([0, 1, 0], pucker_rad))
    return [at(center, 0, 0, 0), *([at(cap[0], 0, 0, cap[1])] if cap else []), *images(blade, "C3")]


def biphenyl() -> Atoms:
    """Two phenyl rings 44 degrees out of each other's plane."""
    return images(phenyl(0.745, np.radians(22.0)), "D2")


def water_on(axis: Sequence[float], bond: float, twist_rad: float, up: Sequence[float]) -> Atoms:
    """A water molecule bound by its oxygen, its plane turned about the bond from the direction `up`."""
    half = np.radians(106.0) / 2
    atoms = [at("O", 0, 0, 0), *(at("H", s * 0.97 * np.sin(half), 0, 0.97 * np.cos(half)) for s in (-1, 1))]
    return along(turned(atoms, rotation([0, 0, 1], twist_rad)), axis, bond, up)


def aqua_th() -> Atoms:
    """A hexaaqua ion with each water in a coordinate plane."""
    return [at("Al", 0, 0, 0), *images(water_on((1, 0, 0), 1.9, 0.0, (0, 1, 0)), "T")]


def aqua_s6() -> Atoms:
    """The same with all waters turned out of those planes, about the inversion and one three-fold axis only."""
    tilt = np.arctan(np.sqrt(2))
    water = water_on((np.sin(tilt), 0, np.cos(tilt)), 1.9, np.radians(25.0), (0, 0, 1))
    return [at("Al", 0, 0, 0), *images(water, "S6")]


def vanadyl(twist_deg: float) -> Atoms:
    """VO with four waters, turned like the blades of a propeller."""
    water = water_on((1, 0, 0), 2.0, np.radians(twist_deg), (0, 0, 1))
    return [at("V", 0, 0, 0), at("O", 0, 0, 1.6), *images(water, "C4")]


def platinum_hydroxide() -> Atoms:
    """A square Pt(OH)4, flat, its hydroxyls turned the same way."""
    angle = np.radians(108.0)
    hydrogen = at("H", 2.0 - 0.96 * np.cos(angle), 0.96 * np.sin(angle), 0)
    return [at("Pt", 0, 0, 0), *images([at("O", 2.0, 0, 0), hydrogen], "C4")]


def boric_acid() -> Atoms:
    """B(OH)3, flat."""
    angle = np.radians(112.0)
    hydrogen = at("H", 1.36 - 0.96 * np.cos(angle), 0.96 * np.sin(angle), 0)
    return [at("B", 0, 0, 0), *images([at("O", 1.36, 0, 0), hydrogen], "C3")]


def phosphoric_acid() -> Atoms:
    """OP(OH)3, its hydroxyls turned the same way."""
    arm = along([at("O", 0, 0, 0)], (np.sin(TETRAHEDRAL), 0, np.cos(TETRAHEDRAL)), 1.57, (0, 1, 0))
    tip = along(
        turned([at("H", 0.97 * np.sin(1.95), 0, -0.97 * np.cos(1.95))], rotation([0, 0, 1], np.radians(40.0))),
        (np.sin(TETRAHEDRAL), 0, np.cos(TETRAHEDRAL)),
        1.57,
        (0, 0, 1),
    )
    return [at("P", 0, 0, 0), at("O", 0, 0, 1.48), *images(arm + tip, "C3")]


def tub(substituents: str) -> Atoms:
    """Cyclooctatetraene's tub, with the substituents named taking turns around the ring."""
    operations = point_group("D2d").operations()

    def lengths(p: Array) -> Array:
        distance = np.sort(np.linalg.norm(operations[1:] @ p - p, axis=1))
        return np.array([distance[0] - 1.337, distance[1] - 1.471, distance[2] - 2.50])

    corner = least_squares(lengths, [1.6, 0.6, 0.4], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    carbons = np.array([p for _, p in images([("C", corner)], "D2d")])
    order = [0]
    while len(order) < 8:
        near = np.argsort(np.linalg.norm(carbons - carbons[order[-1]], axis=1))[1:3]
        order.append(next(int(i) for i in near if int(i) not in order))
    carbons = carbons[order]
    outwards = unit(2 * carbons - np.roll(carbons, 1, axis=0) - np.roll(carbons, -1, axis=0))
    bonds = {"H": 1.087, "F": 1.34}
    kinds = [substituents[i % len(substituents)] for i in range(8)]
    rim = [(s, c + bonds[s] * o) for s, c, o in zip(kinds, carbons, outwards, strict=True)]
    return [("C", c) for c in carbons] + rim


def meso() -> Atoms:
    """meso-CHFCl-CHFCl, stretched out."""
    arms = rotor("X", 3, 1.0, np.radians(110.0))
    bonds = zip(("H", "F", "Cl"), (1.09, 1.37, 1.77), arms, strict=True)
    half = [at("C", 0, 0, 0.77), *((s, bond * p + [0, 0, 0.77]) for s, bond, (_, p) in bonds)]
    return images(half, "Ci")


def methyls(framework: Atoms, bond: float, twist_deg: float, up: Sequence[float], group: str) -> Atoms:
    """A methyl on the first atom of a framework, turned about its bond, and its images under a group."""
    _, first = framework[0]
    methyl = [at("C", 0, 0, 0), *rotor("H", 3, 1.09, TETRAHEDRAL, np.radians(twist_deg))]
    return framework + images(along(methyl, first, float(np.linalg.norm(first)) + bond, up), group)


def neopentane(twist_deg: float) -> Atoms:
    """C(CH3)4, its methyls turned: 0 is staggered."""
    corner = [("C", 1.54 * unit([1.0, 1, 1]))]
    rim = along(rotor("H", 3, 1.09, TETRAHEDRAL, np.radians(twist_deg)), (1, 1, 1), 1.54, (-1, -1, 1))
    return [at("C", 0, 0, 0), *images(corner, "T"), *images(rim, "T")]


def cubane() -> Atoms:
    """C8H8."""
    corner = unit([1.0, 1, 1])
    radius = 1.57 * np.sqrt(3) / 2
    return images([("C", radius * corner), ("H", (radius + 1.09) * corner)], "O")


def octamethylcubane() -> Atoms:
    """C8(CH3)8, its methyls turned by 25 degrees."""
    return methyls(cubane()[:8], 1.52, 25.0, (0, 0, 1), "O")


def dodecahedron() -> Array:
    """A corner of a dodecahedron with edges of 1.54."""
    return 1.54 * np.sqrt(3) * PHI / 2 * unit([1.0, 1, 1])


def dodecahedrane() -> Atoms:
    """C20H20."""
    corner = dodecahedron()
    return images([("C", corner), ("H", corner + 1.09 * unit(corner))], "I")


def methyldodecahedrane() -> Atoms:
    """C20(CH3)20, its methyls turned by 25 degrees: a hundred atoms."""
    neighbour = (0, PHI, 1 / PHI)
    return methyls(images([("C", dodecahedron())], "I"), 1.53, 25.0, neighbour, "I")


def borane() -> Atoms:
    """B12H12 2-, an icosahedron with edges of 1.78."""
    corner = unit([0.0, 1.0, PHI])
    radius = 1.78 * np.sin(2 * np.pi / 5)
    return images([("B", radius * corner), ("H", (radius + 1.2) * corner)], "I")


def fullerene() -> Atoms:
    """C60 with bonds of 1.40 between hexagons and 1.46 around pentagons."""
    a, b = np.array([0.0, 1.0, PHI]), np.array([0.0, -1.0, PHI])
    edge = 2 * 1.46 + 1.40
    return images([("C", edge / 2 * (a + (b - a) * 1.46 / edge))], "I")


def adamantane() -> Atoms:
    """C10H16, cut out of the diamond lattice."""
    step = 1.54 / np.sqrt(3)
    ch, ch2 = step * np.array([1.0, 1, 1]), step * np.array([2.0, 0, 0])
    tip = 1.09 / np.sqrt(3)
    return images([("C", ch), ("C", ch2), ("H", ch + tip), ("H", ch2 + tip * np.array([1.0, 1, -1]))], "T")


def octahedral(center: str, end: str, bond: float) -> Atoms:
    """AX6."""
    return [at(center, 0, 0, 0), *images([at(end, bond, 0, 0)], "O")]


def square_pyramid() -> Atoms:
    """BrF5."""
    angle = np.radians(84.8)
    return [at("Br", 0, 0, 0), at("F", 0, 0, 1.69), *ring("F", 4, 1.77 * np.sin(angle), 1.77 * np.cos(angle))]


def line(*atoms: tuple[str, float]) -> Atoms:
    """Atoms on z."""
    return [at(s, 0, 0, z) for s, z in atoms]
