"""trimesh's symmetry of a mesh, by the moments of inertia of its solid."""

from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
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
