"""Large molecules: cages, tubes, grains of crystals, assemblies of chains, of hundreds and thousands of atoms.

Each with the group that its construction gives it, and beside these some that lack it: a grain with one atom replaced,
an assembly with a chain that is folded otherwise.
"""

from collections.abc import Callable
from itertools import combinations, product

import numpy as np

from experiments.objects.molecule_geometry import images
from experiments.objects.molecule_sets import Molecule
from symrefine.geometry import Array, rotation, unit
from symrefine.groups import PointGroup
from symrefine.groups.standard import GOLDEN

# Between neighbours of a chain, a cage or a ring, and of a lattice, where any two elements count as bonded.
BOND, STEP = 1.45, 1.8


def cage(frequency: int) -> Array:
    """Carbons of an icosahedral fullerene, 20 f^2: the centres of the small triangles on the faces, on a sphere."""
    found = []
    for a, b, c in _faces():
        for i, j in product(range(frequency), repeat=2):
            if i + j < frequency:
                found.append((frequency - i - j - 2 / 3) * a + (i + 1 / 3) * b + (j + 1 / 3) * c)
            if i + j < frequency - 1:
                found.append((frequency - i - j - 4 / 3) * a + (i + 2 / 3) * b + (j + 2 / 3) * c)
    return _bonded(unit(np.array(found)))


def tube(around: int, rows: int) -> Array:
    """Rings of atoms, every other one turned by half a step."""
    angle = 2.0 * np.pi * (np.arange(around) + 0.5 * (np.arange(rows)[:, None] % 2)) / around
    height = np.broadcast_to(0.3 * np.arange(rows)[:, None], angle.shape)
    return _bonded(np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3))


def grain(*sizes: int) -> Array:
    """Places of a cubic lattice in a box."""
    return STEP * np.array(list(product(*map(range, sizes))), dtype=float)


def octahedron(size: int) -> Array:
    """Places of a cubic lattice within an octahedron."""
    every = np.array(list(product(range(-size, size + 1), repeat=3)), dtype=float)
    return STEP * every[np.abs(every).sum(axis=1) <= size]


def shells(count: int) -> Array:
    """A Mackay icosahedron: an atom within so many shells of icosahedra."""
    faces, found = _faces(), [np.zeros((1, 3))]
    for shell in range(1, count + 1):
        steps = [(i, j, shell - i - j) for i, j in product(range(shell + 1), repeat=2) if i + j <= shell]
        found += [np.array(steps) @ face for face in faces]
    every = np.concatenate(found)
    return STEP * every[np.unique(every.round(6), axis=0, return_index=True)[1]]


def chain(length: int, seed: int) -> Array:
    """A folded chain: each atom a bond from the one before it, away from the others, and drawn to the middle."""
    rng = np.random.default_rng(seed)
    places, onwards = np.zeros((length, 3)), rng.normal(size=3)
    for k in range(1, length):
        steps = unit(rng.normal(size=(8, 3)) + 0.4 * onwards - 0.04 * places[k - 1])
        free = [np.linalg.norm(places[:k] - places[k - 1] - BOND * s, axis=1).min() for s in steps]
        onwards = steps[int(np.argmax(free))]
        places[k] = places[k - 1] + BOND * onwards
    return places


def assembly(group: str, length: int, *, seed: int = 0, odd: bool = False) -> Molecule:
    """Copies of a chain under every operation of a group of turns; the last of them is another chain if `odd`."""
    operations = PointGroup(name=group).operations()
    place = np.array([0.31, 0.52, 0.79]) * (1.2 if len(operations) < 12 else 2.6)

    def apart(own: Array) -> Array:
        return own - own.mean(axis=0) + np.ptp(own, axis=0).max() * place

    own = apart(chain(length, seed))
    copies = [own @ g.T for g in operations]
    if odd:
        copies[-1] = apart(chain(length, seed + 1)) @ operations[-1].T
    symbols = np.random.default_rng(seed).choice(list("CCCNO"), length)
    return Molecule(symbols=tuple(np.tile(symbols, len(operations)).tolist()), positions=np.concatenate(copies))


def _one(places: Array, symbol: str = "C") -> Molecule:
    return Molecule(symbols=(symbol,) * len(places), positions=places)


def _salt(places: Array) -> Molecule:
    """Every other place of a lattice is of another element."""
    odd = np.rint(places.sum(axis=1) / STEP).astype(int) % 2
    return Molecule(symbols=tuple("F" if k else "Al" for k in odd), positions=places)


def _marked(places: Array, index: int) -> Molecule:
    """One atom is of another element."""
    return Molecule(symbols=tuple("N" if k == index else "C" for k in range(len(places))), positions=places)


def _faces() -> Array:
    """The corners [20, 3, 3] of the faces of an icosahedron."""
    corners = np.array([place for _, place in images([("C", unit([0.0, 1.0, GOLDEN]))], "I")])
    triples = corners[list(combinations(range(12), 3))]
    sides = np.linalg.norm(triples - np.roll(triples, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(triples[sides < 1.01 * sides.min()])


def _bonded(places: Array) -> Array:
    """Scaled so that the nearest are a bond apart."""
    every = np.linalg.norm(places[0] - places[1:], axis=1)
    return places * (BOND / every.min())


def ring(count: int) -> Array:
    """Atoms evenly spaced on a circle, and one above its middle."""
    around = [rotation(np.array([0.0, 0.0, 1.0]), 2.0 * np.pi * k / count) @ [1.0, 0.0, 0.0] for k in range(count)]
    return _bonded(np.array([*around, [0.0, 0.0, 0.5]]))


ASSEMBLIES: dict[str, tuple[str, Callable[[], Molecule]]] = {
    "C320": ("Ih", lambda: _one(cage(4))),
    "C500": ("Ih", lambda: _one(cage(5))),
    "C1280": ("Ih", lambda: _one(cage(8))),
    "C319N": ("Cs", lambda: _marked(cage(4), 0)),
    "C319N, aside": ("C1", lambda: _marked(cage(4), 7)),
    "tube 12": ("D12d", lambda: _one(tube(12, 30))),
    "tube 17": ("D17h", lambda: _one(tube(17, 21))),
    "ring 100": ("C100v", lambda: _one(ring(100))),
    "ring 300": ("C300v", lambda: _one(ring(300))),
    "salt 7": ("Oh", lambda: _salt(grain(7, 7, 7))),
    "salt 7 7 10": ("C4v", lambda: _salt(grain(7, 7, 10))),
    "grain 6 6 9": ("D4h", lambda: _one(grain(6, 6, 9), "Al")),
    "grain 7, one odd": ("C4v", lambda: _marked(grain(7, 7, 7), 24)),
    "octahedron 8": ("Oh", lambda: _one(octahedron(8), "Pt")),
    "shells 4": ("Ih", lambda: _one(shells(4), "Pt")),
    "shells 6": ("Ih", lambda: _one(shells(6), "Pt")),
    "shells 8": ("Ih", lambda: _one(shells(8), "Pt")),
    "chain": ("C1", lambda: _one(chain(1200, 1))),
    "dimer": ("C2", lambda: assembly("C2", 600, seed=2)),
    "dimer, long": ("C2", lambda: assembly("C2", 2000, seed=3)),
    "dimer, odd": ("C1", lambda: assembly("C2", 600, seed=2, odd=True)),
    "trimer": ("C3", lambda: assembly("C3", 400, seed=4)),
    "tetramer": ("D2", lambda: assembly("D2", 300, seed=5)),
    "heptamer": ("C7", lambda: assembly("C7", 200, seed=6)),
    "heptamer, odd": ("C1", lambda: assembly("C7", 200, seed=6, odd=True)),
    "cage of 24": ("O", lambda: assembly("O", 40, seed=7)),
    "capsid": ("I", lambda: assembly("I", 40, seed=8)),
}


def large_molecule(name: str) -> Molecule:
    """A large molecule by name."""
    return ASSEMBLIES[name][1]()
