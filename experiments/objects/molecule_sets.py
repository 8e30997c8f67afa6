"""Molecules of many point groups: idealised geometry from textbook bond lengths and angles, in angstroms.

Coordinates are computed here: from bonds and angles, from the regular polyhedra, or as the images of a few atoms under
a group. Twisted rotors (methyl, hydroxyl, water) lower the group of a framework to its rotations.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.objects import molecule_geometry as made
from symrefine.geometry import Array, read_only
from symrefine.surface.tree import pairs_within

NUMBERS = {
    s: z
    for z, s in enumerate(
        "H He Li Be B C N O F Ne Na Mg Al Si P S Cl Ar K Ca Sc Ti V Cr Mn Fe Co Ni Cu Zn Ga Ge As Se Br".split(), 1
    )
} | {"Xe": 54, "Re": 75, "Pt": 78, "U": 92}
# Covalent radii in angstroms (Cordero and others, 2008), to tell which atoms are bonded.
RADII = {
    "H": 0.31, "B": 0.84, "C": 0.76, "N": 0.71, "O": 0.66, "F": 0.57, "Al": 1.21, "P": 1.07, "S": 1.05, "Cl": 1.02,
    "V": 1.53, "Cr": 1.39, "Mn": 1.39, "Fe": 1.32, "Ni": 1.24, "Br": 1.20, "Xe": 1.40, "Re": 1.51, "Pt": 1.36,
    "U": 1.96,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Molecule:
    """Element symbols and positions [N, 3] in angstroms."""

    symbols: tuple[str, ...]
    positions: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", read_only(self.positions))

    @property
    def numbers(self) -> list[int]:
        """Atomic numbers."""
        return [NUMBERS[s] for s in self.symbols]

    @property
    def mean_bond(self) -> float:
        """Mean length of the bonds: pairs of atoms nearer than 1.25 times the sum of their covalent radii."""
        radii = np.array([RADII[s] for s in self.symbols])
        one, other = pairs_within(self.positions, 2.5 * radii.max()).T
        distance = np.linalg.norm(self.positions[one] - self.positions[other], axis=1)
        return float(distance[distance < 1.25 * (radii[one] + radii[other])].mean())


def molecule(name: str) -> Molecule:
    """A molecule by name."""
    atoms = MOLECULES[name][1]()
    return Molecule(symbols=tuple(s for s, _ in atoms), positions=np.array([p for _, p in atoms]))


MOLECULES: dict[str, tuple[str, Callable[[], made.Atoms]]] = {
    "CHFClBr": ("C1", lambda: made.tetrahedral("C", [("H", 1.09), ("F", 1.36), ("Cl", 1.76), ("Br", 1.93)])),
    "CH2FCl": ("Cs", lambda: made.tetrahedral("C", [("H", 1.09), ("H", 1.09), ("F", 1.36), ("Cl", 1.76)])),
    "meso-CHFCl-CHFCl": ("Ci", made.meso),
    "H2O2": ("C2", made.peroxide),
    "phosphoric acid": ("C3", made.phosphoric_acid),
    "triphenylmethane": ("C3", lambda: made.triphenyl("C", 1.52, 0.33, ("H", 1.09))),
    "vanadyl, waters turned": ("C4", lambda: made.vanadyl(35.0)),
    "C5(OH)5Ni": ("C5", lambda: made.hydroxyl_ring(5, 1.42, ("Ni", 1.75))),
    "C6(OH)6Cr": ("C6", lambda: made.hydroxyl_ring(6, 1.40, ("Cr", 1.65))),
    "water": ("C2v", lambda: made.bent("O", "H", 0.9572, 104.52)),
    "SO2": ("C2v", lambda: made.bent("S", "O", 1.432, 119.5)),
    "ammonia": ("C3v", lambda: made.pyramid("N", "H", 1.012, 106.7)),
    "CH3Cl": ("C3v", lambda: made.tetrahedral("C", [("H", 1.09), ("H", 1.09), ("H", 1.09), ("Cl", 1.78)])),
    "BrF5": ("C4v", made.square_pyramid),
    "C5H5Ni": ("C5v", lambda: made.half_sandwich("Ni", 5, 1.75)),
    "C6H6Cr": ("C6v", lambda: made.half_sandwich("Cr", 6, 1.61)),
    "C7H7V": ("C7v", lambda: made.half_sandwich("V", 7, 1.46)),
    "N2F2": ("C2h", lambda: made.zigzag("N", "F", 1.214, 1.40, 105.5)),
    "butadiene": ("C2h", made.butadiene),
    "boric acid": ("C3h", made.boric_acid),
    "Pt(OH)4": ("C4h", made.platinum_hydroxide),
    "C5(OH)5-": ("C5h", lambda: made.hydroxyl_ring(5, 1.42)),
    "C6(OH)6": ("C6h", lambda: made.hydroxyl_ring(6, 1.40)),
    "tetrafluoro-COT": ("S4", lambda: made.tub("HF")),
    "hexaaqua, waters turned": ("S6", made.aqua_s6),
    "C4(OH)4 sandwich": ("S8", lambda: made.hydroxyl_sandwich(4, 1.46, 1.75)),
    "C5(OH)5 sandwich": ("S10", lambda: made.hydroxyl_sandwich(5, 1.43, 1.65)),
    "biphenyl": ("D2", made.biphenyl),
    "gauche ethane": ("D3", lambda: made.ethane(30.0)),
    "triphenylborane": ("D3", lambda: made.triphenyl("B", 1.57)),
    "Re2Cl8, turned": ("D4", lambda: made.eclipsed_dimer(20.0)),
    "ferrocene, turned": ("D5", lambda: made.sandwich("Fe", 5, 1.65, 18.0)),
    "Cr(C6H6)2, turned": ("D6", lambda: made.sandwich("Cr", 6, 1.61, 15.0)),
    "ethylene": ("D2h", made.ethylene),
    "BF3": ("D3h", lambda: made.plane_triangle("B", "F", 1.313)),
    "PF5": ("D3h", made.bipyramid),
    "eclipsed ethane": ("D3h", lambda: made.ethane(0.0)),
    "XeF4": ("D4h", lambda: [made.at("Xe", 0, 0, 0), *made.ring("F", 4, 1.95)]),
    "Re2Cl8": ("D4h", lambda: made.eclipsed_dimer(0.0)),
    "ferrocene, eclipsed": ("D5h", lambda: made.sandwich("Fe", 5, 1.65, 0.0)),
    "benzene": ("D6h", lambda: made.carbon_ring(6, 1.395)),
    "C7H7+": ("D7h", lambda: made.carbon_ring(7)),
    "uranocene": ("D8h", lambda: made.sandwich("U", 8, 1.92, 0.0, 1.40)),
    "allene": ("D2d", made.allene),
    "cyclooctatetraene": ("D2d", lambda: made.tub("H")),
    "staggered ethane": ("D3d", lambda: made.ethane(60.0)),
    "S8": ("D4d", made.sulphur_crown),
    "ferrocene, staggered": ("D5d", lambda: made.sandwich("Fe", 5, 1.65, 36.0)),
    "Cr(C6H6)2, staggered": ("D6d", lambda: made.sandwich("Cr", 6, 1.61, 30.0)),
    "neopentane, methyls turned": ("T", lambda: made.neopentane(25.0)),
    "methane": ("Td", lambda: made.tetrahedral("C", [("H", 1.087)] * 4)),
    "neopentane": ("Td", lambda: made.neopentane(0.0)),
    "adamantane": ("Td", made.adamantane),
    "hexaaqua": ("Th", made.aqua_th),
    "octamethylcubane, methyls turned": ("O", made.octamethylcubane),
    "SF6": ("Oh", lambda: made.octahedral("S", "F", 1.56)),
    "cubane": ("Oh", made.cubane),
    "methyldodecahedrane, methyls turned": ("I", made.methyldodecahedrane),
    "B12H12": ("Ih", made.borane),
    "dodecahedrane": ("Ih", made.dodecahedrane),
    "C60": ("Ih", made.fullerene),
    "HCN": ("Cinfv", lambda: made.line(("H", -1.066), ("C", 0.0), ("N", 1.156))),
    "CO": ("Cinfv", lambda: made.line(("C", 0.0), ("O", 1.128))),
    "CO2": ("Dinfh", lambda: made.line(("O", -1.163), ("C", 0.0), ("O", 1.163))),
    "acetylene": ("Dinfh", lambda: made.line(("H", -1.661), ("C", -0.601), ("C", 0.601), ("H", 1.661))),
}
