"""Planes, axes and orthogonal maps of n-space: the vocabulary of every other module.

Conventions: a plane is `n.x = d` with |n| = 1, and (n, d) ~ (-n, -d); an axis is a point and a unit
direction u ~ -u; `T_a_b` maps b to a.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def read_only(values: ArrayLike) -> Array:
    """A private float64 copy that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array


def unit(vector: ArrayLike) -> Array:
    """`vector / |vector|` along the last axis."""
    v = np.asarray(vector, dtype=np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """Hyperplane `normal.x = offset` in Hessian normal form, the sign of the normal being arbitrary."""

    normal: Array
    offset: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", read_only(unit(self.normal)))
        object.__setattr__(self, "offset", float(self.offset))

    def signed_distance(self, points: Array) -> Array:
        """Signed distances [N] of points [N, n]."""
        return points @ self.normal - self.offset

    def reflect(self, points: Array) -> Array:
        """Mirror images [N, n] of points [N, n]."""
        return points - 2.0 * np.multiply.outer(self.signed_distance(points), self.normal)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Axis:
    """Line through `point` along the unit `direction`, the sign of the direction being arbitrary."""

    point: Array
    direction: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(self.point))
        object.__setattr__(self, "direction", read_only(unit(self.direction)))


def householder(normal: ArrayLike) -> Array:
    """Reflection `I - 2 n n'` [n, n] with determinant -1 across the plane through 0 normal to `normal`."""
    n = unit(normal)
    return np.eye(n.size) - 2.0 * np.outer(n, n)


def cross_matrix(u: ArrayLike) -> Array:
    """`[u]_x`, so that `[u]_x v = u x v`."""
    x, y, z = np.asarray(u, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation(axis: ArrayLike, angle_rad: float) -> Array:
    """Rotation [3, 3], determinant +1, by `angle_rad` about `axis` (Rodrigues)."""
    u = unit(axis)
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return c * np.eye(3) + s * cross_matrix(u) + (1.0 - c) * np.outer(u, u)


def rotoreflection(axis: ArrayLike, angle_rad: float) -> Array:
    """Improper rotation [3, 3], determinant -1: rotate about `axis`, reflect in the plane normal to it."""
    return householder(axis) @ rotation(axis, angle_rad)


def frame_with_z(direction: ArrayLike) -> Array:
    """Right-handed orthonormal rows (p0, p1, u) with u along `direction`; p0 and p1 span the plane normal to it."""
    u = unit(direction)
    helper = np.eye(3)[int(np.argmin(np.abs(u)))]
    p0 = unit(np.cross(helper, u))
    return np.stack([p0, np.cross(u, p0), u])


def random_orthogonal(rng: np.random.Generator, dim: int = 3, det: int = 1) -> Array:
    """Haar-distributed orthogonal matrix [dim, dim] of determinant `det` (+1 or -1)."""
    q, r = np.linalg.qr(rng.standard_normal((dim, dim)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) * det < 0:
        q[:, 0] = -q[:, 0]
    return q


def line_angle_rad(a: ArrayLike, b: ArrayLike) -> float:
    """Angle in [0, pi/2] between two unsigned directions, accurate for small angles too."""
    u, v = unit(a), unit(b)
    s = np.linalg.norm(u - np.dot(u, v) * v)
    return float(np.arctan2(s, abs(np.dot(u, v))))
