"""Sets of matrices of O(3): axes, angles, quaternions, and the frame that best maps one set to another.

A quaternion is (w, x, y, z) with w >= 0. An improper matrix (determinant -1) is represented by the quaternion of its
negative: -1 commutes with everything, so it plays no part in any fit.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array, batches
from symrefine.rounding import DOUBLE, SINGLE

Index = NDArray[np.intp]
# What is farther than this from an operation is none: angles of the classes of a polyhedral group differ by 0.6 and
# more.
ROUGH = 0.3


def nearest_orthogonal(matrices: ArrayLike) -> Array:
    """The orthogonal matrices [k, 3, 3], each with its own determinant +-1, nearest to `matrices` [k, 3, 3].

    Raises:  InputError: wrong shape, not finite, or not even roughly orthogonal.
    """
    given = np.asarray(matrices, dtype=np.float64)
    if given.ndim != 3 or given.shape[1:] != (3, 3) or not np.isfinite(given).all():
        raise InputError(f"operations must be finite with shape [k, 3, 3]; the shape here is {list(given.shape)}")
    u, s, vt = np.linalg.svd(given)
    worst = float(np.abs(s - 1.0).max(initial=0.0))
    if worst > ROUGH:
        raise InputError(f"operations must be orthogonal; a singular value is off 1 by {worst:.2g}")
    return np.asarray(u @ vt)


def nearest_rotation(matrix: Array) -> Array | None:
    """The rotation [3, 3] nearest to a matrix that is one to single precision; None if it is none.

    Each step of Newton's iteration squares by how much it is none (Higham 1986); a fifth of the time of a `svd`.
    """
    if matrix.shape != (3, 3):
        return None
    given, off = matrix, math.inf
    while off > DOUBLE:
        gram = matrix @ matrix.T
        off = float(np.abs(gram - np.eye(3)).max())
        if (
            not off <= 4.0 * SINGLE
        ):  # rows that are off by SINGLE in each component have products off by 2 sqrt(3) of it
            return None
        matrix = 1.5 * matrix - 0.5 * (gram @ matrix)
    if np.abs(matrix - given).max() > SINGLE:
        return None
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    determinant = a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
    return matrix if determinant > 0.0 else None


def determinants(operations: Array) -> Array:
    """+1.0 or -1.0 for every orthogonal matrix [k, 3, 3]."""
    return np.asarray(np.sign(np.linalg.det(operations)))


def quaternions(operations: Array) -> Array:
    """Quaternions [k, 4], w >= 0, of `det(S) S`, accurate at every angle.

    The elements of a rotation are sums of products of two components: the row of all products with the largest one is
    the quaternion, up to its length. (A tenth of the time of scipy's `Rotation`.)
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (operations * determinants(operations)[:, None, None]).transpose(1, 2, 0)
    products = np.array(
        [
            [1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz],
        ]
    ).transpose(2, 0, 1)
    each = np.arange(len(products))
    q = products[each, np.argmax(np.diagonal(products, axis1=1, axis2=2), axis=1)]
    first = q[each, np.argmax(q != 0.0, axis=1)]  # the sign of a half turn, whose w vanishes, is that of x, y or z
    return np.asarray(q * (np.sign(first) / np.linalg.norm(q, axis=1))[:, None])


def axes_and_angles(operations: Array) -> tuple[Array, Array]:
    """Axis [k, 3] and angle [k] in [0, pi] of the rotations `det(S) S`; the axis is z where the angle vanishes.

    A mirror therefore has its normal as axis and the angle pi; the inversion has the angle 0.
    """
    q = quaternions(operations)
    sine = np.linalg.norm(q[:, 1:], axis=1)
    still = sine < SINGLE
    axes = np.where(still[:, None], [0.0, 0.0, 1.0], q[:, 1:] / np.where(still, 1.0, sine)[:, None])
    return axes, 2.0 * np.arctan2(sine, q[:, 0])


def half_turns(directions: Array) -> Array:
    """Rotations [k, 3, 3], determinant +1, by pi about unit `directions` [k, 3]: each stands for an unsigned line."""
    return 2.0 * directions[:, :, None] * directions[:, None, :] - np.eye(3)


def chord_angles(a: Array, b: Array) -> Array:
    """Angle [...] of `a' b` for orthogonal matrices [..., 3, 3]; pi where the determinants differ much."""
    squares = ((a - b) ** 2).sum(axis=(-2, -1))
    return np.asarray(2.0 * np.arcsin(np.minimum(np.sqrt(squares / 8.0), 1.0)))


def about_z(ends: ArrayLike, dets: ArrayLike, angles_rad: Array) -> Array:
    """Operations [k, 3, 3] that multiply z by `ends` and, across it, rotate (`dets` +1) or reflect (-1) by angles [k].

    A reflection keeps the direction at half of its angle.
    """
    cosine, sine = np.cos(angles_rad), np.sin(angles_rad)
    operations = np.zeros((len(angles_rad), 3, 3))
    operations[:, 0, 0], operations[:, 0, 1] = cosine, -np.asarray(dets) * sine
    operations[:, 1, 0], operations[:, 1, 1] = sine, np.asarray(dets) * cosine
    operations[:, 2, 2] = ends
    return operations


def angles_about_z(operations: Array, dets: ArrayLike) -> Array:
    """The angles [k] of the operations of that kind that are nearest to those given [k, 3, 3]."""
    f = np.asarray(dets)
    sines, cosines = operations[:, 1, 0] - f * operations[:, 0, 1], operations[:, 0, 0] + f * operations[:, 1, 1]
    return np.asarray(np.arctan2(sines, cosines))


def unique_lines(directions: Array) -> tuple[Array, Index]:
    """Distinct unsigned directions [m, 3] and how often each occurs [m], for directions exact to 1e-9."""
    key = np.round(directions, 9) + 0.0
    last = np.where(key[:, 2] != 0.0, key[:, 2], np.where(key[:, 1] != 0.0, key[:, 1], key[:, 0]))
    sign = np.where(last < 0.0, -1.0, 1.0)[:, None]
    _, first, counts = np.unique(key * sign + 0.0, axis=0, return_index=True, return_counts=True)
    return (directions * sign)[first] + 0.0, counts


def nearest_operations(operations: Array, group: Array, frame: Array) -> tuple[Index, Array]:
    """For each operation [k, 3, 3] the nearest `F' G F`, G in `group` [m, 3, 3]: its index [k] and angle away [k]."""
    turned = frame @ operations @ frame.T
    index = np.empty(len(turned), dtype=np.intp)
    for batch, traces in _traces(turned, group):
        index[batch] = np.argmax(traces, axis=1)
    return index, chord_angles(turned, group[index])


def overlaps(operations: Array, group: Array) -> Array:
    """Traces [k] of `A' G` for each of operations [k, 3, 3] and the G of a group [m, 3, 3] that is nearest to it."""
    return np.concatenate([traces.max(axis=1) for _, traces in _traces(operations, group)])


def _traces(operations: Array, group: Array) -> Iterator[tuple[slice, Array]]:
    """Batches of operations [k, 3, 3], and the traces [.., m] of `A' G` for each and every G of a group [m, 3, 3]."""
    given, known = operations.reshape(len(operations), 9), group.reshape(len(group), 9).T
    for batch in batches(len(given), len(group)):
        yield batch, given[batch] @ known


def angle_of_overlap(trace: float) -> float:
    """The angle that `chord_angles` tells of orthogonal matrices A and B, from the trace of `A' B`."""
    return 2.0 * math.asin(math.sqrt(min(max(3.0 - trace, 0.0) / 4.0, 1.0)))


def overlaps_about_z(operations: Array, end: float, det: float) -> Array:
    """The same [k] of all that `about_z` makes of an end and a determinant."""
    x, y = operations[:, 0], operations[:, 1]
    return np.asarray(np.hypot(x[:, 0] + det * y[:, 1], y[:, 0] - det * x[:, 1]) + end * operations[:, 2, 2])


def fit_frame(sources: Array, targets: Array, start: Array) -> Array:
    """Least-squares frame F, determinant +1, with `F S_i F' = A_i` for corresponding operations [k, 3, 3].

    `F S = A F` reads `q_F q_S = +- q_A q_F` in quaternions: linear in q_F, so the sum of squares (of half the residual
    angles, in small-angle terms) has its exact minimum at an eigenvector of a 4 x 4 matrix. Where the minimum is not
    unique (a single axis leaves its phase free), the solution nearest to `start` is taken.
    """
    q_start = quaternions(start[None])[0]
    q_source, q_target = quaternions(sources), quaternions(targets)
    right, left = _right(q_source), _left(q_target)
    sign = np.where(np.sum((right @ q_start) * (left @ q_start), axis=1) < 0.0, -1.0, 1.0)
    overlap = np.einsum("k,kji,kjl->il", sign, right, left)
    values, vectors = np.linalg.eigh(overlap + overlap.T)
    top = vectors[:, values > values[-1] - SINGLE * (1.0 + abs(values[-1]))]
    q = nearest_in_span(top, q_start)[None]
    return np.asarray((_left(q)[0] @ _right(q * [1.0, -1.0, -1.0, -1.0])[0])[1:, 1:])


def nearest_in_span(basis: Array, vector: Array) -> Array:
    """Unit vector [n] nearest to `vector` in the span of orthonormal columns [n, m]; the first if none is nearest."""
    shadow = basis @ (basis.T @ vector)
    size = float(np.linalg.norm(shadow))
    return np.asarray(shadow / size if size > SINGLE else basis[:, 0])


def register(operations: Array, group: Array, start: Array) -> tuple[Array, Array]:
    """Fit a frame to `operations` [k, 3, 3] by alternating nearest elements of `group` [m, 3, 3] and `fit_frame`.

    Returns: the frame [3, 3] and the angle [k] left between each operation and its element.
    """
    frame = start
    index, errors = nearest_operations(operations, group, frame)
    for _ in range(8):
        frame = fit_frame(operations, group[index], frame)
        previous = index
        index, errors = nearest_operations(operations, group, frame)
        if np.array_equal(index, previous):
            break
    return frame, errors


def _left(q: Array) -> Array:
    """Matrices [k, 4, 4] of `p -> q p`."""
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]).transpose(2, 0, 1)


def _right(q: Array) -> Array:
    """Matrices [k, 4, 4] of `p -> p q`."""
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]]).transpose(2, 0, 1)
