"""What others say of the same objects, through thin adapters: trimesh by inertia, pymatgen on small sets of atoms.

Open3D beside `align` is in the alignment experiment. A package that is not installed is named in one line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups.names import parse
from symrefine.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inertia:
    """What trimesh's `symmetry` says: "none", "radial" with the direction of the axis, or "spherical"."""

    kind: str
    axis: Array | None


def trimesh_symmetry(mesh: Shape) -> Inertia:
    """trimesh's answer for a mesh: equal principal moments of inertia of its solid, to 1e-4 of their norm.

    Raises:
        InputError: a cloud; trimesh offers this for meshes only.
    """
    if mesh.faces is None:
        raise InputError(f"{mesh.source}: trimesh's symmetry needs a mesh, this is a cloud")
    import trimesh

    theirs = trimesh.Trimesh(vertices=mesh.points, faces=mesh.faces, process=False)
    if theirs.volume < 0:
        theirs.invert()  # its inertia is that of the solid, so let the surface face outwards
    kind = theirs.symmetry or "none"
    return Inertia(kind=kind, axis=np.asarray(theirs.symmetry_axis) if kind == "radial" else None)


def point_group_pymatgen(elements: Sequence[str], points: Array, tolerance: float) -> str:
    """Schoenflies symbol, in our spelling, that pymatgen's PointGroupAnalyzer gives to atoms.

    Args:
        elements: [N] chemical symbols; atoms of different elements do not match.
        points: [N, 3] positions.
        tolerance: largest distance at which two atoms match, in the units of the points.

    Raises:
        InputError: pymatgen is not installed, or finds nothing it has a name for.
    """
    try:
        from pymatgen.core import Molecule
        from pymatgen.symmetry.analyzer import PointGroupAnalyzer
    except ModuleNotFoundError as error:
        raise InputError(f"pymatgen is not installed ({error.name} is missing); pip install pymatgen") from None
    molecule = Molecule(list(elements), np.asarray(points, dtype=float))
    return schoenflies(str(PointGroupAnalyzer(molecule, tolerance=tolerance).sch_symbol))


def schoenflies(symbol: str) -> str:
    """pymatgen's symbol in our spelling: its infinity is a star.

    Raises:
        InputError: no point group.
    """
    return parse(symbol.replace("*", "inf")).name
