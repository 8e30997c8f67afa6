"""Symmetry operations as N x 4 x 4 matrices, for readers that take nothing else (CaTGrasp's `symmetry_tfs`)."""

import numpy as np

from symrefine.errors import InputError
from symrefine.export.models import npz_bytes
from symrefine.geometry import Array
from symrefine.groups import PointGroup
from symrefine.groups.names import MAX_FOLD
from symrefine.poses.symmetry import homogeneous

# Turns that stand for a continuous axis: every five degrees, as FoundationPose samples one.
STEPS = 72


def motions(group: PointGroup, center: Array, *, improper: bool = False, steps: int = STEPS) -> Array:
    """Operations [N, 4, 4] about a centre, the identity first, then the other rotations, then reflections if asked for.

    A continuous axis is given by `steps` turns, a sphere by the 60 rotations of an icosahedron.

    Raises:
        InputError: fewer than one step, or more turns than a group can have.
    """
    if not 1 <= steps <= MAX_FOLD:
        raise InputError(f"steps is {steps}; expected 1 to {MAX_FOLD} turns for a continuous axis")
    kept = group if improper else group.proper_subgroup()
    return homogeneous(kept.sampled(steps).operations(), center)


def motions_limits(group: PointGroup, *, improper: bool, steps: int) -> list[str]:
    """What the matrices do not hold."""
    notes = [] if improper else reflections_left_out(group)
    if group.symbol.family in ("K", "Kh"):
        return [*notes, "a sphere has endlessly many rotations: the 60 of an icosahedron stand for them"]
    return notes if group.is_finite else [*notes, f"the continuous axis is given by {steps} turns"]


def reflections_left_out(group: PointGroup) -> list[str]:
    """That operations of determinant -1 are no rigid motions, if the group has any."""
    if group.is_chiral:
        return []
    count = f"{int(group.order) // 2} operation{'s' * (group.order > 2)}" if group.is_finite else "operations"
    return [f"{count} of determinant -1 (mirrors and the like) left out: no rigid motion makes them"]


def motions_bytes(group: PointGroup, center: Array, *, improper: bool = False, steps: int = STEPS) -> bytes:
    """A .npz file: `symmetry_tfs` [N, 4, 4] in the units of the centre, `determinant` [N], `point_group`."""
    found = motions(group, center, improper=improper, steps=steps)
    determinants = np.rint(np.linalg.det(found[:, :3, :3]))
    return npz_bytes(symmetry_tfs=found, determinant=determinants, point_group=np.array(group.name))
