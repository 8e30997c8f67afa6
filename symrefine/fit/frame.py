"""A frame polished on the moments alone: Gauss-Newton on SO(3), noise-weighted, before any point is matched."""

import numpy as np

from symrefine.geometry import Array, rotation
from symrefine.moments.harmonics import generators, to_polar_axis, turn

# A step shorter than this (radians) ends the polish: the points take over from there.
POLISHED = 1e-4


def polish_frame(harmonics: dict[int, Array], frame: Array, fold: int, *, steps: int = 6) -> Array:
    """Turn a C_bv frame until the moments that break the group vanish: Gauss-Newton on SO(3), noise-weighted.

    In the frame, the invariant coefficients are cos(m phi) with b | m; every other one is a residual whose derivative
    under a small rotation is the generator applied to the coefficients. For fold 1 the group is Cs with normal p1.

    Args:
        harmonics: c[p,l,m] with jackknife replicates, about the centre the axis passes through.
        frame: rows (p0, p1, u).
        fold: b.

    Returns: the polished frame, rows (p0, p1, u).
    """
    turned = {l: _in_frame(c[0], l, frame) for l, c in harmonics.items()}
    weights = {l: _weights(c) for l, c in harmonics.items()}
    for _ in range(steps):
        hessian, gradient = np.zeros((3, 3)), np.zeros(3)
        for l, c in turned.items():
            m = np.arange(-l, l + 1)
            breaking = (m < 0) | (m % fold != 0)
            jacobian = (c @ generators(l).transpose(0, 2, 1))[:, :, breaking]
            weighted = (jacobian * weights[l]).reshape(3, -1)
            hessian += weighted @ jacobian.reshape(3, -1).T
            gradient += weighted @ c[:, breaking].ravel()
        hessian += 1e-9 * np.trace(hessian) * np.eye(3)
        step = -np.linalg.solve(hessian, gradient)
        step *= min(1.0, 0.15 / max(float(np.linalg.norm(step)), 1e-12))
        turned = {l: c @ _small_turn(l, step).T for l, c in turned.items()}
        frame = _small_rotation(step) @ frame
        if np.linalg.norm(step) < POLISHED:
            break
    return frame


def _in_frame(c: Array, l: int, frame: Array) -> Array:
    to_pole = to_polar_axis(l, frame[2])
    spin = frame @ to_polar_axis_rotation(frame[2]).T
    angle = np.arctan2(spin[1, 0], spin[0, 0])
    return c @ (turn(l, 2, np.array(angle)) @ to_pole).T


def to_polar_axis_rotation(direction: Array) -> Array:
    """The rotation R_y(-theta) R_z(-phi) that `to_polar_axis` represents."""
    theta = np.arctan2(np.hypot(direction[0], direction[1]), direction[2])
    phi = np.arctan2(direction[1], direction[0])
    return rotation([0, 1, 0], -theta) @ rotation([0, 0, 1], -phi)


def _weights(c: Array) -> Array:
    """Inverse variance [n_p, 1] of the coefficients of each order, from the replicates; ones where they are exact.

    The mean over m does not change when the frame turns.
    """
    parts = len(c) - 1
    if parts == 0:
        return np.ones((c.shape[1], 1))
    return 1.0 / ((parts - 1) * c[1:].var(axis=0).mean(axis=1, keepdims=True) + 1e-8)


def _small_rotation(step: Array) -> Array:
    return rotation([1, 0, 0], step[0]) @ rotation([0, 1, 0], step[1]) @ rotation([0, 0, 1], step[2])


def _small_turn(l: int, step: Array) -> Array:
    return turn(l, 0, np.array(step[0])) @ turn(l, 1, np.array(step[1])) @ turn(l, 2, np.array(step[2]))
