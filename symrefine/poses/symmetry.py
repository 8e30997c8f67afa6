"""What a symmetry does to the poses of a rigid body.

A pose X [4, 4] takes the body to where it stands: `x -> R x + t`, det R = +1. If S is an operation of the body, the
pose X S looks the same. About the centre c of the operations, X is the pair of R and of the place `p = R c + t` of the
centre; X S is the pair of R S and the same p. So a symmetry acts on rotations, from the right, and leaves places alone.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, ReadOnly, numbers
from symrefine.groups import PointGroup
from symrefine.groups.orthogonal import determinants

# By how much R'R may miss 1: what four written digits leave, and no scale.
_WRITTEN = 1e-3


def homogeneous(matrices: Array, center: Array) -> Array:
    """Matrices [N, n+1, n+1] of orthogonal maps [N, n, n] that leave a centre [n] in place."""
    dim = len(center)
    found = np.tile(np.eye(dim + 1), (len(matrices), 1, 1))
    found[:, :dim, :dim] = matrices
    found[:, :dim, dim] = center - matrices @ center
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Symmetry(ReadOnly):
    """The symmetry of a rigid body, in the coordinates and the unit of the body.

    Attributes:
        group: its rotations, placed.
        center: [3] the point nearest to the origin that all of them leave in place.
        mirrors: [0 | 1, 4, 4] one operation of determinant -1, if the body has any: it makes a pose of that
            determinant, which no rigid motion reaches, one that looks the same and can be reached.
    """

    group: PointGroup
    center: Array
    mirrors: Array

    @classmethod
    def about(cls, group: PointGroup, center: Array) -> "Symmetry":
        """That of a body with a group, proper or not, about a point [3] that it leaves in place."""
        proper = group.proper_subgroup()
        operations = group.sampled(2).operations()
        mirrors = homogeneous(operations[determinants(operations) < 0.0][:1], center)
        return cls(group=proper, center=center - _left_in_place(proper) @ center, mirrors=mirrors)

    @property
    def smallest_turn_rad(self) -> float:
        """The smallest angle between two poses that look the same and cannot be brought together by turning on.

        It is 2 pi where there are none but one; pi of a body of revolution that can be turned over.
        """
        symbol, order = self.group.symbol, self.group.order
        if math.isinf(order):
            return math.pi if symbol.family == "D" else 2.0 * math.pi
        return 2.0 * math.pi / max((n for _, n in self.group.rotation_axes()), default=1)

    def places(self, poses: Array) -> Array:
        """Where poses [..., 4, 4] put the centre [..., 3]."""
        return np.asarray(poses[..., :3, :3] @ self.center + poses[..., :3, 3])

    def turned(self, poses: Array, operations: Array) -> Array:
        """The poses X S [..., 4, 4] for rotations S [..., 3, 3] about the centre."""
        rotations = poses[..., :3, :3] @ operations
        shifts = self.places(poses) - rotations @ self.center
        last = np.broadcast_to(poses[..., 3:, :], (*shifts.shape[:-1], 1, 4))
        return np.concatenate([np.concatenate([rotations, shifts[..., None]], axis=-1), last], axis=-2)

    def nearest(self, turns: Array) -> Array:
        """The rotation of the group [..., 3, 3] nearest to each of some [..., 3, 3]."""
        return self.group.nearest(turns.reshape(-1, 3, 3)).reshape(turns.shape)

    def toward(self, poses: Array, rotations: Array) -> Array:
        """Of all poses equivalent to each of [..., 4, 4] the one turned least from a rotation [..., 3, 3]."""
        return self.turned(poses, self.nearest(poses[..., :3, :3].swapaxes(-1, -2) @ rotations))

    def rigid(self, given: ArrayLike, name: str) -> Array:
        """Poses [..., 4, 4] of determinant +1: as given, or an equivalent of one of determinant -1.

        Raises:
            InputError: what is no pose; determinant -1 and a body that differs from its mirror image.
        """
        poses = checked_poses(given, name)
        improper = np.linalg.det(poses[..., :3, :3]) < 0.0
        if not improper.any():
            return poses
        if not len(self.mirrors):
            raise InputError(
                f"{_at(name, improper)} has determinant -1: no motion makes a body its mirror image, and none of the "
                f"operations of {self.group.name} does; expected determinant +1"
            )
        return np.where(improper[..., None, None], poses @ self.mirrors[0], poses)


def checked_poses(given: ArrayLike, name: str) -> Array:
    """Poses [..., 4, 4], orthogonal maps with a shift.

    Raises:
        InputError: no numbers, another shape, or an entry that is not finite, orthogonal or homogeneous.
    """
    poses = numbers(given, f"values of {name}")
    if poses.ndim < 2 or poses.shape[-2:] != (4, 4):
        raise InputError(f"{name} has shape {list(poses.shape)}; expected [..., 4, 4]")
    lost = ~np.isfinite(poses).all(axis=(-2, -1))
    if lost.any():
        raise InputError(f"{_at(name, lost)} is not finite")
    odd = (poses[..., 3, :] != [0.0, 0.0, 0.0, 1.0]).any(axis=-1)
    if odd.any():
        raise InputError(f"{_at(name, odd)} does not end with the row 0, 0, 0, 1")
    rotations = poses[..., :3, :3]
    miss = np.abs(rotations.swapaxes(-1, -2) @ rotations - np.eye(3)).max(axis=(-2, -1))
    if (miss > _WRITTEN).any():
        worst = miss == miss.max()
        raise InputError(f"{_at(name, worst)} is not orthogonal: R'R misses 1 by {miss.max():.2g}; poses have no scale")
    return poses


def _at(name: str, where: Any) -> str:
    """The name of the first entry that is marked, as Python would have it."""
    index = ", ".join(str(i) for i in np.argwhere(where)[0])
    return f"{name}[{index}]" if index else name


def _left_in_place(group: PointGroup) -> Array:
    """The projection [3, 3] on the directions that a group of rotations leaves in place."""
    symbol = group.symbol
    if symbol.family != "C":
        return np.zeros((3, 3))
    return np.eye(3) if symbol.fold == 1 else np.outer(group.frame[2], group.frame[2])
