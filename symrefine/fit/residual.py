"""The symmetry residual in casadi, and the Gram matrices that make its cost independent of the number of points.

`e = (T x_u - x_l).n_l` (paper, section "Boosting b-plane symmetry by axial symmetry"), with T any isometry
x -> g x + t: the reflection across a plane there, a rotation or a rotoreflection just as well. With correspondences
held fixed, e is linear in the thirteen numbers phi = (g, t, 1), so the weighted cost of any number of pairs is
phi' G phi with one Gram matrix G [13, 13], and every constraint on T (a plane through an axis, a free plane, all
operations of a group sharing one frame) is a matter of how phi depends on its unknowns; casadi differentiates that. For
the planes through an axis the form shrinks to 3x3 in (1, cos 2 theta, sin 2 theta) (method.md, section 4). This is the
only module that imports casadi.
"""

from collections.abc import Callable
from threading import local
from typing import Any

import numpy as np

from symrefine.fit.gauss_newton import Linearisation, Linearisations
from symrefine.geometry import Array, Isometry, cross_matrix

# Rows and columns of a Gram matrix: the nine entries of the operation, its shift, and one.
SIZE = 13


def design_rows(sources: Array, targets: Array, normals: Array) -> Array:
    """Rows a [N, 13] with `e_i = a_i . phi`, for pairs of points [N, 3] and the targets' normals [N, 3]."""
    rows = np.empty((len(sources), SIZE))
    for i in range(3):
        np.multiply(sources, normals[:, i : i + 1], out=rows[:, 3 * i : 3 * i + 3])
    rows[:, 9:12] = normals
    rows[:, 12] = -np.einsum("ij,ij->i", targets, normals)
    return rows


def gram(rows: Array, weights: Array) -> Array:
    """Weighted Gram matrix `A' W A` [13, 13] of design rows [N, 13]."""
    return (rows * weights[:, None]).T @ rows


def coordinates(motion: Isometry) -> Array:
    """phi = (g row by row, t, 1) [13]."""
    return np.concatenate([motion.matrix.ravel(), motion.shift, [1.0]])


class _Compiled:
    """A casadi function called through its buffers: microseconds instead of the 150 that converting arguments takes.

    The buffer interface takes contiguous float64 of the exact size in column-major order and checks none of it, so the
    arguments are copied into arrays that have just that.
    """

    def __init__(self, function: Any) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._inputs = [np.zeros(function.size_in(i), order="F") for i in range(function.n_in())]
        self._outputs = [np.zeros(function.size_out(i), order="F") for i in range(function.n_out())]
        for i, array in enumerate(self._inputs):
            self._buffer.set_arg(i, _flat(array))
        for i, array in enumerate(self._outputs):
            self._buffer.set_res(i, _flat(array))

    def __call__(self, *arguments: float | Array) -> list[Array]:
        for slot, value in zip(self._inputs, arguments, strict=True):
            slot[...] = np.reshape(value, slot.shape)
        self._evaluate()
        return [output.copy() for output in self._outputs]


def _flat(array: Array) -> Any:
    """The memory of a column-major array as one row, shared with it."""
    return memoryview(array.ravel(order="K"))  # type: ignore[arg-type]


_threads = local()


def _compiled(build: Callable[[int], Any], count: int) -> _Compiled:
    """The compiled form of a function of so many operations, one for each thread: its buffers are not to be shared."""
    known = _threads.__dict__.setdefault("functions", {})
    if (build, count) not in known:
        known[build, count] = _Compiled(build(count))
    return known[build, count]


def _beside(matrices: Array) -> Array:
    """Matrices [k, m, n] side by side [m, k n], as casadi takes the arguments of k calls."""
    return matrices.transpose(1, 0, 2).reshape(matrices.shape[1], -1)


def _apart(outputs: Array, count: int) -> Array:
    """The same the other way: [m, k n] to [k, m, n]."""
    return outputs.reshape(len(outputs), count, -1).transpose(1, 0, 2)


def _theta_function(count: int) -> Any:
    """casadi function (thetas, G) -> costs, gradients and Gauss-Newton matrices of planes through an axis."""
    import casadi as ca

    theta, g = ca.SX.sym("theta"), ca.SX.sym("G", 3, 3)
    phi = ca.vertcat(1, ca.cos(2 * theta), ca.sin(2 * theta))
    jacobian, weighted = ca.densify(ca.jacobian(phi, theta)), ca.mtimes(g, phi)
    outputs = [ca.dot(phi, weighted), ca.mtimes(jacobian.T, weighted), ca.mtimes([jacobian.T, g, jacobian])]
    return ca.Function("theta", [theta, g], [ca.densify(o) for o in outputs]).map(count)


def _frame_function(count: int) -> Any:
    """casadi function (x, frame, center, standard) -> phi of each operation, its derivatives in x beside it.

    What the operations share goes in once.
    """
    import casadi as ca

    x, frame, center = ca.SX.sym("x", 6), ca.SX.sym("frame", 3, 3), ca.SX.sym("center", 3)
    standard = ca.SX.sym("standard", 3, 3)
    moved = ca.mtimes(_turn(ca, x[:3]), frame)
    matrix = ca.mtimes([moved.T, standard, moved])
    shifted = center + ca.mtimes(frame.T, x[3:])
    phi = ca.vertcat(ca.reshape(matrix.T, 9, 1), shifted - ca.mtimes(matrix, shifted), 1)
    outputs = [ca.densify(ca.horzcat(phi, ca.jacobian(phi, x)))]
    return ca.Function("frame", [x, frame, center, standard], outputs).map("frames", "serial", count, [0, 1, 2], [])


def _turn(ca: Any, w: Any) -> Any:
    """Rotation matrix of the unit quaternion along (1, w/2): a chart without a singularity at w = 0."""
    s = 1 / ca.sqrt(1 + ca.dot(w, w) / 4)
    k = ca.skew(w / 2 * s)
    return ca.SX.eye(3) + 2 * s * k + 2 * ca.mtimes(k, k)


def turn_frame(frame: Array, w: Array) -> Array:
    """The frame (rows are its axes) after the small rotation w [3], as `frame_model` parametrises it."""
    s = 1.0 / np.sqrt(1.0 + w @ w / 4.0)
    k = cross_matrix(0.5 * s * w)
    return (np.eye(3) + 2 * s * k + 2 * k @ k) @ frame


def theta_models(grams3: Array, thetas_rad: Array) -> Linearisations:
    """Costs and derivatives in theta [b, 1] of planes through a fixed axis, each from its Gram matrix [b, 3, 3]."""
    count = len(thetas_rad)
    found = _compiled(_theta_function, count)(thetas_rad.T, _beside(grams3))
    costs, gradients, hessians = (_apart(output, count) for output in found)
    return Linearisations(costs=costs[:, 0, 0], gradients=gradients[:, :, 0], hessians=hessians)


def frame_model(grams: Array, standard: Array, frame: Array, center: Array, x: Array) -> Linearisation:
    """Cost and derivatives in x = (rotation, shift) [6] of operations that share one frame and one centre.

    Args:
        grams: [k, 13, 13], one for each operation.
        standard: [k, 3, 3] the operations in the frame's own coordinates.
        frame: [3, 3] the frame's axes as rows.
        center: [3].
        x: small rotation about, and shift along, the frame's axes.
    """
    rows = _compiled(_frame_function, len(standard))(x, frame, center, _beside(standard))[0].T.reshape(-1, 7, SIZE)
    weighted = rows @ grams
    products = rows.transpose(1, 0, 2).reshape(7, -1) @ weighted.transpose(1, 0, 2).reshape(7, -1).T
    return Linearisation(cost=float(products[0, 0]), gradient=products[1:, 0], hessian=products[1:, 1:])


def axis_gram(gram13: Array, frame: Array, point: Array) -> Array:
    """Gram matrices [..., 3, 3] in (1, cos 2 theta, sin 2 theta) of planes through an axis, from the general ones."""
    angles = np.array([0.0, np.pi / 3, 2 * np.pi / 3])
    normals = np.stack([-np.sin(angles), np.cos(angles)], axis=1) @ frame[:2]
    mirrors = [np.eye(3) - 2.0 * np.outer(m, m) for m in normals]
    phi = np.stack([coordinates(Isometry.about(point, m)) for m in mirrors], axis=1)
    basis = phi @ np.linalg.inv(np.stack([np.ones(3), np.cos(2 * angles), np.sin(2 * angles)]))
    return basis.T @ gram13 @ basis
