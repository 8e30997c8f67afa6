"""Planes, axes and orthogonal maps of n-space: the vocabulary of every other module.

Conventions: a plane is `n.x = d` with |n| = 1, and (n, d) ~ (-n, -d); an axis is a point and a unit
direction u ~ -u; `T_a_b` maps b to a.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cache, lru_cache
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrefine.errors import InputError
from symrefine.rounding import LARGEST_TOLERANCE as LARGEST_TOLERANCE

Array = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

# Numbers that a batch holds at once: 8 MB, what a cache and a small machine have.
_AT_ONCE = 2**20


def check_tolerance(tolerance: Any) -> None:
    """Refuse what is no tolerance.

    Raises:
        InputError: not a number in (0, 0.2].
    """
    if not isinstance(tolerance, Real) or not 0.0 < float(tolerance) <= LARGEST_TOLERANCE:
        raise InputError(f"tolerance is {tolerance!r}; expected a fraction of the diagonal in (0, {LARGEST_TOLERANCE}]")


def read_only(values: ArrayLike) -> Array:
    """A private float64 copy that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array


def rows(values: Array, chosen: NDArray[Any] | slice) -> Array:
    """Some of the rows of an array [N, ...], by indices of any shape, a mask [N] or a slice.

    What `values[chosen]` is, which takes four times as long where rows are short.
    """
    if isinstance(chosen, slice):
        return values[chosen]
    return values.compress(chosen, axis=0) if chosen.dtype == np.bool_ else values.take(chosen, axis=0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadOnly:
    """Base of dataclasses that nobody can write to: every field declared as `Array` holds a private, read-only copy."""

    def __post_init__(self) -> None:
        for name in _arrays_of(type(self)):  # type: ignore[arg-type]  # classes have hashes, whatever their instances have
            object.__setattr__(self, name, read_only(getattr(self, name)))


@cache
def _arrays_of(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a dataclass that are declared as `Array`: asked once, as maps are made by the thousand."""
    return tuple(field.name for field in fields(kind) if field.type == Array)


def numbers(values: ArrayLike, name: str) -> Array:
    """Real numbers as they are given, as float64.

    Raises:
        InputError: a mask, complex numbers, texts, or rows of different lengths.
    """
    try:
        array = unmasked(values, name)
        if array.dtype.kind not in "iuf":
            kind = "complex" if np.iscomplexobj(array) else f"of type {array.dtype}"
            raise InputError(f"{name} are not numbers in rows of one length: they are {kind}")
        return array.astype(np.float64)
    except InputError:
        raise
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} are not numbers in rows of one length: {error}") from None


def unmasked(values: ArrayLike, name: str) -> NDArray[Any]:
    """Values as they are given.

    Raises:
        InputError: a masked array.
    """
    if np.ma.isMaskedArray(values):
        raise InputError(f"{name} are a masked array; give the rows that count alone, without a mask")
    return np.asarray(values)


def batches(count: int, each: int) -> Iterator[slice]:
    """Slices that cover `count` items of `each` numbers, few enough in one to be held at once."""
    step = max(1, _AT_ONCE // max(each, 1))
    yield from (slice(start, start + step) for start in range(0, count, step))


def dots(a: Array, b: Array) -> Array:
    """Products [...] of vectors [..., n] with one another along the last axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def column_dots(a: Array, b: Array) -> Array:
    """Products [K] of vectors that stand in columns, [3, K] and [3, K]."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def unit(vector: ArrayLike) -> Array:
    """`vector / |vector|` along the last axis."""
    v = np.asarray(vector, dtype=np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def toward_positive(direction: Array) -> float:
    """The sign, +1.0 or -1.0, that makes the first component of at least a tenth of the largest positive."""
    size = np.abs(direction)
    return float(np.copysign(1.0, direction[int(np.argmax(size >= 0.1 * size.max()))]))


def positive(direction: Array) -> Array:
    """A direction with the sign of `toward_positive`: every result, record and table has its directions so."""
    return toward_positive(direction) * direction + 0.0  # no -0.0


def _vector(values: ArrayLike, name: str) -> Array:
    """A row of numbers [n]."""
    vector = numbers(values, f"components of {name}")
    if vector.ndim != 1:
        raise InputError(f"{name} has shape {list(vector.shape)}; expected [n]")
    return vector


def _length(vector: ArrayLike, name: str) -> float:
    """Length of a vector that is to be a direction."""
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < np.inf:
        raise InputError(f"{name} is {np.asarray(vector).tolist()}; expected a direction: finite and not zero")
    return length


@dataclass(frozen=True, kw_only=True, eq=False)
class Plane:
    """Hyperplane `normal.x = offset`, kept in Hessian normal form: both are divided by the length of the normal.

    The sign of the pair is arbitrary.

    Raises:
        InputError: a normal that is zero, not finite or no row of numbers; an offset that is no finite number.
    """

    normal: Array
    offset: float

    def __post_init__(self) -> None:
        normal, offset = _vector(self.normal, "normal"), numbers(self.offset, "offset")
        if offset.ndim or not np.isfinite(offset):
            raise InputError(f"offset is {offset.tolist()}; expected a finite number")
        length = _length(normal, "normal")
        object.__setattr__(self, "normal", read_only(unit(normal)))
        object.__setattr__(self, "offset", float(offset) / length)

    def signed_distance(self, points: Array) -> Array:
        """Signed distances [N] of points [N, n]."""
        return points @ self.normal - self.offset

    def reflect(self, points: Array) -> Array:
        """Mirror images [N, n] of points [N, n]."""
        return points - 2.0 * np.multiply.outer(self.signed_distance(points), self.normal)


@dataclass(frozen=True, kw_only=True, eq=False)
class Axis:
    """Line through `point` along the unit `direction`, the sign of the direction being arbitrary.

    Raises:
        InputError: a direction that is zero or not finite, a point that is not finite, no rows of as many numbers.
    """

    point: Array
    direction: Array

    def __post_init__(self) -> None:
        point, direction = _vector(self.point, "point"), _vector(self.direction, "direction")
        _length(direction, "direction")
        if point.shape != direction.shape or not np.isfinite(point).all():
            raise InputError(f"point is {point.tolist()}; expected {len(direction)} finite numbers")
        object.__setattr__(self, "point", read_only(point))
        object.__setattr__(self, "direction", read_only(unit(direction)))


def householder(normal: ArrayLike) -> Array:
    """Reflection `I - 2 n n'` [n, n] with determinant -1 across the plane through 0 normal to `normal`."""
    n = np.asarray(normal, dtype=np.float64) / _length(normal, "normal")
    return np.eye(n.size) - 2.0 * np.outer(n, n)


def cross_matrix(u: ArrayLike) -> Array:
    """`[u]_x`, so that `[u]_x v = u x v`."""
    x, y, z = np.asarray(u, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation(axis: ArrayLike, angle_rad: float) -> Array:
    """Rotation [3, 3], determinant +1, by `angle_rad` about `axis` (Rodrigues)."""
    u = np.asarray(axis, dtype=np.float64) / _length(axis, "axis")
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return c * np.eye(3) + s * cross_matrix(u) + (1.0 - c) * np.outer(u, u)


def rotoreflection(axis: ArrayLike, angle_rad: float) -> Array:
    """Improper rotation [3, 3], determinant -1: rotate about `axis`, reflect in the plane normal to it."""
    return householder(axis) @ rotation(axis, angle_rad)


def frame_with_z(direction: ArrayLike) -> Array:
    """Right-handed orthonormal rows (p0, p1, u) with u along `direction`; p0 and p1 span the plane normal to it."""
    u = np.asarray(direction, dtype=np.float64) / _length(direction, "direction")
    # In plain numbers, as frames are made by the thousand: a tenth of the time of arrays of three.
    x, y, z = u.tolist()
    across = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))[int(np.argmin(np.abs(u)))]
    length = math.hypot(*across)
    a, b, c = (component / length for component in across)
    return np.array([(a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a), (x, y, z)])


def random_orthogonal(rng: np.random.Generator, dim: int = 3, det: int = 1) -> Array:
    """Haar-distributed orthogonal matrix [dim, dim] of determinant `det` (+1 or -1)."""
    q, r = np.linalg.qr(rng.standard_normal((dim, dim)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) * det < 0:
        q[:, 0] = -q[:, 0]
    return q


def orthogonal_factor(matrices: Array, *, proper: bool = False) -> Array:
    """The orthogonal matrices nearest to `matrices` [..., n, n], of either determinant, or of +1 where `proper`.

    With M = sum_i t_i s_i' it is the R that minimises `sum_i |t_i - R s_i|^2` (Schoenemann 1966; Kabsch 1976).
    """
    u, _, vt = np.linalg.svd(matrices)
    if proper:
        u[..., -1] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt)


def line_angle_rad(a: ArrayLike, b: ArrayLike) -> float:
    """Angle in [0, pi/2] between two unsigned directions, accurate for small angles too."""
    u, v = unit(a), unit(b)
    s = np.linalg.norm(u - np.dot(u, v) * v)
    return float(np.arctan2(s, abs(np.dot(u, v))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Isometry(ReadOnly):
    """Map x -> matrix x + shift with an orthogonal matrix of determinant +1 or -1."""

    matrix: Array
    shift: Array

    @classmethod
    def about(cls, center: ArrayLike, matrix: ArrayLike) -> "Isometry":
        """The map that applies `matrix` while `center` stays where it is."""
        c, m = np.asarray(center, dtype=np.float64), np.asarray(matrix, dtype=np.float64)
        return cls(matrix=m, shift=c - m @ c)

    @classmethod
    def reflection(cls, plane: Plane) -> "Isometry":
        """The reflection across `plane`."""
        return cls(matrix=householder(plane.normal), shift=2.0 * plane.offset * plane.normal)

    def apply(self, points: Array) -> Array:
        """Images [N, n] of points [N, n]."""
        return points @ self.matrix.T + self.shift

    def turn(self, vectors: Array) -> Array:
        """Images [N, n] of directions [N, n]."""
        return vectors @ self.matrix.T

    @property
    def inverse(self) -> "Isometry":
        """The way back."""
        return Isometry(matrix=self.matrix.T, shift=-(self.shift @ self.matrix))

    @property
    def is_involution(self) -> bool:
        """Whether it is its own inverse, up to rounding, where it leaves a point in place."""
        return np.allclose(self.matrix, self.matrix.T, rtol=0.0, atol=1e-12)


def images(motions: Sequence[Isometry], points: Array) -> Array:
    """Where K operations take points [N, n], those of the first one first [K N, n]."""
    return np.concatenate([m.apply(points) for m in motions])


@lru_cache(maxsize=1)
def _box_trials() -> tuple[Array, Array, Array]:
    """Probe directions [P, 3], frames [F, 3, 3] and small turns [4, T, 3, 3] for `tight_diagonal`; fixed for good."""
    rng = np.random.default_rng(0)
    probes = unit(rng.standard_normal((120, 3)))
    frames = np.stack([np.eye(3), *(random_orthogonal(rng) for _ in range(200))])
    widths = (0.3, 0.1, 0.03, 0.01)
    turns = [[rotation(w, width * float(np.linalg.norm(w))) for w in rng.standard_normal((60, 3))] for width in widths]
    return probes, frames, np.array(turns)


def tight_diagonal(points: Array) -> float:
    """Diagonal of the smallest box around points [N, 3] over all orientations, to within about three percent.

    Unlike the axis-aligned box of the input it does not change when the object is turned. The search starts from the
    principal axes and a fixed set of rotations, then shrinks.
    """
    probes, frames, turns = _box_trials()
    centred = points - points.mean(axis=0)
    _, principal = np.linalg.eigh(centred.T @ centred)
    reach = (probes @ principal.T) @ centred.T  # numpy finds the extremes of rows five times as fast as of columns
    hull = centred[np.unique(np.concatenate([reach.argmax(axis=1), reach.argmin(axis=1)]))]
    best, frame = _smallest_box(hull, frames @ principal.T)
    for nearby in turns:
        trial, turned = _smallest_box(hull, nearby @ frame)
        if trial < best:
            best, frame = trial, turned
    return best


def hull_volume(points: Array) -> float:
    """Volume of the convex hull of points [N, 3]; 0 where they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0


def corners(points: Array) -> Array:
    """Corners [k, n] of the convex hull of points [N, n], in the space that they span: flat sets have no volume."""
    from scipy.spatial import ConvexHull

    centred = points - points.mean(axis=0)
    _, sizes, rows = np.linalg.svd(centred, full_matrices=False)
    spanned = centred @ rows[sizes > 1e-9 * sizes[0]].T
    if spanned.shape[1] == 0:
        return points[:1]
    if spanned.shape[1] == 1:
        return points[[int(spanned.argmin()), int(spanned.argmax())]]
    return np.asarray(points[ConvexHull(spanned).vertices])


def _smallest_box(points: Array, frames: Array) -> tuple[float, Array]:
    along = (frames.reshape(-1, 3) @ points.T).reshape(len(frames), 3, -1)
    extent = along.max(axis=2) - along.min(axis=2)
    diagonals = np.linalg.norm(extent, axis=1)
    best = int(diagonals.argmin())
    return float(diagonals[best]), frames[best]
