"""Objects at the boundary of what can be decided: instances of what has gone wrong, each with its exact truth.

    python -m experiments.objects.boundary

prints them. Families: rotors without mirrors and gears, surfaces of revolution with something to them, meshes of uneven
area, scans with defects and their siblings, prisms for sparse clouds, objects without symmetry, clouds with something
extreme, molecules for a ladder of tolerances, thin-walled open vessels, furniture of thin boards and rods, thin blades
of which one is shorter, bodies with fins or pins at one place, balls with details spread evenly, points on curves and
on bent rods, screw conveyors. Names are keys; a seed varies all dimensions.
"""

import zlib

import numpy as np

from experiments.objects.augers import AUGERS
from experiments.objects.blobs import BLOBS
from experiments.objects.curves import CURVES
from experiments.objects.extremes import FAR
from experiments.objects.finned import FINNED
from experiments.objects.furniture import FURNITURE
from experiments.objects.instances import Build, Instance
from experiments.objects.ladders import LADDERS
from experiments.objects.lathe import ROUND
from experiments.objects.prisms import SPARSE
from experiments.objects.rods import RODS
from experiments.objects.scans import SCANS
from experiments.objects.spread import SPREAD
from experiments.objects.turning import GEARS, ROTORS
from experiments.objects.uneven import UNEVEN
from experiments.objects.vanes import VANES
from experiments.objects.vessels import VESSELS

FAMILIES: dict[str, dict[str, Build]] = {
    "rotors": ROTORS,
    "gears": GEARS,
    "round": ROUND,
    "uneven": UNEVEN,
    "scans": SCANS,
    "sparse": SPARSE,
    "blobs": BLOBS,
    "far": FAR,
    "tolerances": LADDERS,
    "vessels": VESSELS,
    "furniture": FURNITURE,
    "vanes": VANES,
    "finned": FINNED,
    "spread": SPREAD,
    "curves": CURVES,
    "rods": RODS,
    "augers": AUGERS,
}


def instance(family: str, name: str, seed: int = 0) -> Instance:
    """An object with dimensions that are a function of its name and the seed.

    The variants of an object (`table doubled`, `table shelled`; `cabinet dent`, `cabinet shifted`) share them.
    """
    return FAMILIES[family][name](np.random.default_rng([zlib.crc32(base(name).encode()), seed]))


def base(name: str) -> str:
    """What the variants of an object have in common: the first word of their names."""
    return name.split()[0].rstrip(",")


def main() -> None:
    """Print every object of every family."""
    print("family      object                  group   also right        unmatched %")
    for family, builds in FAMILIES.items():
        for name in builds:
            made = instance(family, name)
            also = ", ".join(g.name for g in made.also)
            print(
                f"{family:11s} {name:23s} {made.truth.group.name:7s} {also:17s} {100 * made.differs:6.2f}", flush=True
            )


if __name__ == "__main__":
    main()
