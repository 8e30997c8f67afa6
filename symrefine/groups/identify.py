"""Name and frame of a closed set of operations, noisy or exact.

The type of the group is read from averages over all its operations (characters), which are whole numbers: noise in
single operations can hardly move them to the next one.
"""

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z, unit
from symrefine.groups.names import Symbol
from symrefine.groups.orthogonal import (
    axes_and_angles,
    determinants,
    nearest_operations,
    nearest_orthogonal,
    register,
)
from symrefine.groups.point_group import PointGroup
from symrefine.groups.standard import standard_operations

_POLYHEDRAL = {12: "T", 24: "O", 60: "I"}
_ANGLE_SLACK_RAD = 0.3  # between classes of a polyhedral group angles differ by 0.6 and more


def identify(operations: ArrayLike) -> PointGroup:
    """The point group that a closed set of operations [k, 3, 3] is, with the frame that fits all of them best.

    The frame minimises the sum of the squared angles between the given and the exact operations. Where the group
    leaves it free (the phase of Cn, Cnh, S2n, Cs; all of it for C1, Ci) some frame is returned.

    Args:
        operations: every operation of the group once, in any order; single ones may be off by a fraction of the angle
            between neighbouring operations.
    Raises:
        InputError: the operations are no group, not even roughly; says how far off the nearest guess is.
    """
    given = nearest_orthogonal(operations)
    rotations = given[determinants(given) > 0.0]
    others = given[determinants(given) < 0.0]
    if len(rotations) == 0 or len(others) not in (0, len(rotations)):
        raise InputError(f"{len(rotations)} rotations and {len(others)} improper operations cannot form a group")
    symbol, start = _symbol_and_start(rotations, others)
    group = standard_operations(symbol)
    frame, errors = register(given, group, start)
    matched = np.unique(nearest_operations(given, group, frame)[0]).size
    if not matched == len(given) == len(group):
        raise InputError(
            f"the {len(given)} operations are no group: they match {matched} of the {len(group)} operations of the "
            f"likeliest one, {symbol.name}, and are up to {np.degrees(errors.max()):.1f} degrees off"
        )
    return PointGroup(name=symbol.name, frame=frame)


def _symbol_and_start(rotations: Array, others: Array) -> tuple[Symbol, Array]:
    """The type of the group, and a frame near enough for `register`."""
    if len(rotations) == 1:
        return _without_rotations(others)
    traces = np.trace(rotations, axis1=1, axis2=2)
    if round(float(np.mean(traces))) == 1:  # one direction is fixed by all rotations
        return _cyclic(rotations, others)
    if round(float(np.mean(traces**2))) == 1 and len(rotations) in _POLYHEDRAL:  # no direction is left alone
        return _polyhedral(rotations, others)
    return _dihedral(rotations, others)


def _without_rotations(others: Array) -> tuple[Symbol, Array]:
    """C1, Ci and Cs."""
    if len(others) == 0:
        return Symbol(family="C", fold=1), np.eye(3)
    if np.trace(others[0]) < -1.0:
        return Symbol(family="S", fold=1), np.eye(3)
    return Symbol(family="Ch", fold=1), frame_with_z(axes_and_angles(others)[0][0])


def _cyclic(rotations: Array, others: Array) -> tuple[Symbol, Array]:
    """Cn, Cnv, Cnh and S2n: the mean rotation is the projection `z z'` on the axis."""
    fold = len(rotations)
    frame = frame_with_z(_top_eigenvector(rotations.mean(axis=0)))
    if len(others) == 0:
        return Symbol(family="C", fold=fold), frame
    if np.mean(others @ frame[2] @ frame[2]) > 0.0:
        normal = axes_and_angles(others)[0][0]
        return Symbol(family="Cv", fold=fold), _frame_with_zx(frame[2], np.cross(normal, frame[2]))
    return Symbol(family="Ch" if _turns_in_step(others, frame, fold) else "S", fold=fold), frame


def _dihedral(rotations: Array, others: Array) -> tuple[Symbol, Array]:
    """Dn, Dnh and Dnd: the mean square of all operations is `(1 + z z') / 2`, but 1 for D2 and D2h."""
    fold = len(rotations) // 2
    everything = np.concatenate([rotations, others])
    squares = (everything @ everything).mean(axis=0)
    two_folds = axes_and_angles(rotations)[0][np.argsort(np.trace(rotations, axis1=1, axis2=2))]
    z = two_folds[0] if np.trace(squares) > 2.5 else _top_eigenvector(squares)
    frame = _frame_with_zx(z, two_folds[np.argmin(np.abs(two_folds @ z))])
    if len(others) == 0:
        return Symbol(family="D", fold=fold), frame
    across = others[others @ frame[2] @ frame[2] < 0.0]
    return Symbol(family="Dh" if _turns_in_step(across, frame, fold) else "Dd", fold=fold), frame


def _polyhedral(rotations: Array, others: Array) -> tuple[Symbol, Array]:
    """T, O, I and what mirrors or the inversion make of them."""
    letter = _POLYHEDRAL[len(rotations)]
    if len(others) == 0:
        suffix = ""
    elif np.trace(others, axis1=1, axis2=2).min() < -2.0:  # the inversion is among them
        suffix = "h"
    else:
        suffix = "d"
    family = letter + suffix if suffix != "d" or letter == "T" else letter + "h"
    symbol = Symbol(family=family, fold=0)
    return symbol, polyhedral_start(rotations, symbol, _ANGLE_SLACK_RAD)


def polyhedral_start(operations: Array, symbol: Symbol, slack_rad: float) -> Array:
    """Rough frame of a polyhedral group that contains all `operations` [k, 3, 3], two of them with different axes.

    The best-separated pair of axes is laid on every pair of elements of the same kind and at the same angle, up to
    `slack_rad`; the placement that leaves the smallest angles to all operations wins (the identity if no pair fits).
    """
    group = standard_operations(symbol)
    frames = _pair_frames(operations, group, slack_rad)
    turned = frames[:, None] @ operations @ frames[:, None].transpose(0, 1, 3, 2)
    overlap = turned.reshape(-1, 9) @ group.reshape(-1, 9).T
    worst = overlap.max(axis=1).reshape(len(frames), -1).min(axis=1)
    return np.asarray(frames[np.argmax(worst)])


def has_alike(operations: Array, symbol: Symbol, slack_rad: float) -> bool:
    """Whether every operation [k, 3, 3] has the determinant and, up to `slack_rad`, the angle of some element."""
    group = standard_operations(symbol)
    (_, angles), (_, known) = axes_and_angles(operations), axes_and_angles(group)
    alike = (determinants(operations)[:, None] == determinants(group)) & (np.abs(angles[:, None] - known) < slack_rad)
    return bool(alike.any(axis=1).all())


def _pair_frames(operations: Array, group: Array, slack_rad: float) -> Array:
    """Frames [h, 3, 3], the identity first, that lay one pair of operations on alike pairs of `group`."""
    axes, angles = axes_and_angles(operations)
    sines = np.where((angles[:, None] > 0.5) & (angles > 0.5), 1.0 - (axes @ axes.T) ** 2, 0.0)
    i, j = np.unravel_index(np.argmax(sines), sines.shape)
    if sines[i, j] < 0.1:
        return np.eye(3)[None]
    first, second = (_alike(operations[[k]], angles[k], group, slack_rad) for k in (i, j))
    wanted = np.arccos(np.clip(axes[i] @ axes[j], -1.0, 1.0))
    p, q = np.nonzero(np.abs(np.arccos(np.clip(first @ second.T, -1.0, 1.0)) - wanted) < slack_rad)
    here, there = _triads(axes[[i]], axes[[j]]), _triads(first[p], second[q])
    return np.concatenate([np.eye(3)[None], there.transpose(0, 2, 1) @ here])


def _alike(operation: Array, angle: float, group: Array, slack_rad: float) -> Array:
    """Axes [m, 3] of elements with the determinant and angle of `operation`, half turns in both senses."""
    axes, angles = axes_and_angles(group)
    alike = (determinants(group) == determinants(operation)) & (np.abs(angles - angle) < slack_rad)
    half_turn = alike & (angles > np.pi - slack_rad)
    return np.concatenate([axes[alike], -axes[half_turn]])


def _triads(a: Array, b: Array) -> Array:
    """Right-handed orthonormal rows [k, 3, 3] built from pairs of directions [k, 3], treating both alike."""
    x, y = unit(a + b), unit(a - b)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _turns_in_step(others: Array, frame: Array, fold: int) -> bool:
    """Whether rotoreflections about z turn by multiples of 2 pi / n (Cnh, Dnh), not by odd multiples of pi / n."""
    turned = frame @ others @ frame.T
    angles = np.arctan2(turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1])
    return bool(np.mean(np.cos(fold * angles)) > 0.0)


def _top_eigenvector(matrix: Array) -> Array:
    """Eigenvector [3] of the largest eigenvalue of the symmetric part."""
    return np.asarray(np.linalg.eigh(matrix + matrix.T)[1][:, -1])


def _frame_with_zx(z: Array, x: Array) -> Array:
    """Frame with the z row along `z` and the x row along what of `x` is normal to it."""
    across = unit(x - (x @ z) * z)
    return np.stack([across, np.cross(z, across), z])
