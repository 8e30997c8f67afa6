"""Symmetries for pose estimators that read less than the BOP format says, each as it really reads them.

All of them get a model in its canonical pose (`canonical`), since none can do without: MegaPose asserts that a
continuous axis goes through the origin and has components that sum to 1, scales translations anew at every call, and
turns about coordinate axes only; FoundationPose reads the first continuous axis alone, snaps it to x, y or z, takes its
offset for a translation (in metres, unlike all else) and does not multiply it with discrete ones; DOPE puts
translations into the wrong row of its matrix; Isaac knows angles about x, y and z only. About the origin of a canonical
model nothing translates, and the axis is z.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from symrefine.export.bop import Entry, placed_entry
from symrefine.export.operations import STEPS, motions, motions_bytes, reflections_left_out
from symrefine.files import json_text
from symrefine.geometry import Array, rotation
from symrefine.groups import PointGroup

Consumer = Literal["foundationpose", "megapose", "dope", "isaac"]

_ORIGIN = np.zeros(3)
_SPHERE = "a sphere is read as turns about x, y and z, not their products"
# A product of turns belongs to the group if it is this near one of its operations.
_MEMBER_RAD = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What one consumer gets beside the model: a file of its own, and what it cannot hold, a sentence each.

    `models_info` is an entry for that file, `name` and `content` a file that stands by itself (empty if there is none).
    """

    models_info: Entry | None = None
    name: str = ""
    content: bytes = b""
    notes: tuple[str, ...] = ()


def reading(consumer: Consumer, group: PointGroup, points: Array) -> Reading:
    """What a consumer gets for a canonical model with a group about the origin.

    Args:
        points: [N, 3] vertices in the canonical pose, in millimetres.
    """
    found = CONSUMERS[consumer][0](group, points)
    return replace(found, notes=(*reflections_left_out(group), *found.notes))


def _megapose(group: PointGroup, points: Array) -> Reading:
    """`models_info.json` as it is: each discrete symmetry is multiplied with 64 turns about each continuous axis."""
    return Reading(models_info=placed_entry(group, _ORIGIN, points), notes=(_SPHERE,) * _is_sphere(group))


def _foundationpose(group: PointGroup, points: Array) -> Reading:
    """`models_info.json` in which products of a half turn with turns are listed, and all of it as `symmetry_tfs`."""
    entry = placed_entry(group, _ORIGIN, points)
    notes: tuple[str, ...] = ()
    proper = group.proper_subgroup()
    rest = motions(proper, _ORIGIN)[1:]
    if _is_sphere(group):
        entry |= {"symmetries_continuous": entry["symmetries_continuous"][2:]}
        notes = ("a sphere is read as turns about z and the 60 rotations of an icosahedron, not their products",)
    elif not proper.is_finite:
        rest = rest[STEPS - 1 :]
        notes = (f"a continuous axis is read as turns by {360 // STEPS} degrees",)
    if len(rest):
        entry |= {"symmetries_discrete": [m.reshape(-1).tolist() for m in np.where(np.abs(rest) < 1e-12, 0.0, rest)]}
    content = motions_bytes(group, _ORIGIN)
    return Reading(models_info=entry, name="symmetry_tfs.npz", content=content, notes=notes)


def _dope(group: PointGroup, points: Array) -> Reading:
    """`model_info.json`: symmetries as in BOP, and `align_axes`, by which one of all equal poses is chosen."""
    entry = placed_entry(group, _ORIGIN, points)
    kept = {key: value for key, value in entry.items() if key.startswith("symmetries")}
    # Which axis of the object is brought near which of the camera: y to the view, then z (if turned over) down.
    near = [{"object": [0, 1, 0], "camera": [0, 0, 1]}, {"object": [0, 0, 1], "camera": [0, 1, 0]}]
    if kept:
        kept |= {"align_axes": near[:1] if group.symbol.family.startswith(("C", "S")) else near}
    notes = (_SPHERE,) * _is_sphere(group)
    return Reading(name="model_info.json", content=json_text(kept).encode(), notes=notes)


def _isaac(group: PointGroup, _: Array) -> Reading:
    """ROS parameters: all products Rz Ry Rx of the listed angles about x, y and z count as symmetries."""
    names, notes = _isaac_strings(group.proper_subgroup())
    quoted = ", ".join(f'"{name}"' for name in names)
    text = f"/**:\n  ros__parameters:\n    symmetry_axes: [{quoted}]\n" if names else "/**:\n  ros__parameters: {}\n"
    return Reading(name="symmetry_axes.yaml", content=text.encode(), notes=notes)


def _isaac_strings(proper: PointGroup) -> tuple[list[str], tuple[str, ...]]:
    """Strings whose products are all in the group, as many as can be, and what they do not say of it."""
    if _is_sphere(proper):
        note = "a sphere is read as products of turns by 30 degrees about z, y and x"
        return [f"{axis}_full" for axis in "xyz"], (note,)
    if not proper.is_finite:
        half = ["x_180"] if proper.symbol.family == "D" else []
        return [*half, "z_full"], ("a continuous axis is read as turns by 30 degrees",)
    angles = {axis: _angles(proper, direction) for axis, direction in zip("xyz", np.eye(3), strict=True)}
    # All angles about some of the axes, none about the others.
    allowed = [
        {axis: angles[axis] if axis in kept else [] for axis in angles} for kept in ("z", "xz", "xyz", "x", "y", "")
    ]
    best = max(allowed, key=lambda chosen: _products_inside(proper, chosen))
    names = [f"{axis}_{angle:.9g}" for axis, degrees in best.items() for angle in degrees]
    order = int(proper.order)
    left = order - _products_inside(proper, best)
    note = f"{left} of {order} rotations left out: no product of turns about x, y and z gives them"
    return names, (note,) * (left > 0)


def _angles(proper: PointGroup, axis: Array) -> list[float]:
    """Angles in degrees, other than 0, by which the group turns about an axis."""
    order = max((n for u, n in proper.rotation_axes() if abs(float(u @ axis)) > 1.0 - 1e-9), default=1)
    return [360.0 * k / order for k in range(1, int(order))]


def _products_inside(proper: PointGroup, chosen: dict[str, list[float]]) -> int:
    """How many different rotations the products are; 0 if one of them is no operation."""
    made = isaac_products(chosen["x"], chosen["y"], chosen["z"])
    if proper.distance_rad(made).max() > _MEMBER_RAD:
        return 0
    return len(np.unique(np.round(made.reshape(-1, 9), 6) + 0.0, axis=0))


def isaac_products(x_deg: list[float], y_deg: list[float], z_deg: list[float]) -> Array:
    """Products Rz Ry Rx [n, 3, 3] over the angles about each axis, 0 among them."""
    turns = [
        [rotation(axis, math.radians(a)) for a in (0.0, *degrees)]
        for axis, degrees in zip(np.eye(3), (x_deg, y_deg, z_deg), strict=True)
    ]
    return np.array([c @ b @ a for a in turns[0] for b in turns[1] for c in turns[2]])


def _is_sphere(group: PointGroup) -> bool:
    return group.symbol.family in ("K", "Kh")


# How each reads, what its models are written as, and in how many units a metre.
CONSUMERS: dict[str, tuple[Callable[[PointGroup, Array], Reading], str, float]] = {
    "foundationpose": (_foundationpose, ".ply", 1000.0),
    "megapose": (_megapose, ".ply", 1000.0),
    "dope": (_dope, ".obj", 1.0),
    "isaac": (_isaac, ".obj", 1.0),
}
