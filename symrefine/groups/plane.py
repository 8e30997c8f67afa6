"""The point groups of the plane: Cn, Dn, SO(2) and O(2)."""

import math
import re
from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups.names import MAX_FOLD
from symrefine.groups.orthogonal import about_z

_PATTERN = re.compile(r"([CD])([1-9][0-9]{0,5})")
_ENDLESS = {"SO(2)": "C", "O(2)": "D"}


@dataclass(frozen=True, slots=True, kw_only=True)
class PointGroup2D:
    """`Cn`, `Dn` (n turns and n mirror lines, D1 being a single mirror), `SO(2)` or `O(2)`.

    `angle_rad` is the direction of one mirror line; it says nothing for Cn, SO(2) and O(2).
    """

    name: str
    angle_rad: float = 0.0

    def __post_init__(self) -> None:
        match = _PATTERN.fullmatch(self.name)
        if self.name not in _ENDLESS and not (match and int(match[2]) <= MAX_FOLD):
            raise InputError(
                f"{self.name!r} is no point group of the plane; use Cn, Dn (n <= {MAX_FOLD}), SO(2) or O(2)"
            )

    @property
    def fold(self) -> float:
        """Order of the rotations: n, or `math.inf`."""
        return math.inf if self.name in _ENDLESS else int(self.name[1:])

    @property
    def has_mirrors(self) -> bool:
        """Whether half of the operations are reflections."""
        return _ENDLESS.get(self.name, self.name[0]) == "D"

    @property
    def order(self) -> float:
        """Number of operations: an int, or `math.inf`."""
        return self.fold * (2 if self.has_mirrors else 1)

    def operations(self) -> Array:
        """All operations [order, 2, 2]: rotations (determinant +1), then reflections (determinant -1).

        Raises:  InputError: the group is continuous.
        """
        if math.isinf(self.fold):
            raise InputError(f"{self.name} has infinitely many operations: take those of a Cn or Dn")
        turns: Array = 2.0 * np.pi * np.arange(self.fold, dtype=np.float64) / self.fold
        found = about_z(1.0, 1.0, turns)
        if self.has_mirrors:
            found = np.concatenate([found, about_z(1.0, -1.0, 2.0 * self.angle_rad + turns)])
        return np.asarray(found[:, :2, :2])

    def mirrors(self) -> Array:
        """Unit normals [n, 2] of the mirror lines; O(2) is represented by one."""
        if not self.has_mirrors:
            return np.zeros((0, 2))
        count = 1 if math.isinf(self.fold) else int(self.fold)
        angles = self.angle_rad + np.pi * (0.5 + np.arange(count) / count)
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
