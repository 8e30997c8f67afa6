"""Name and frame of a closed set of operations, noisy or exact.

The type of the group is read from averages over all its operations (characters), which are whole numbers: noise in
single operations can hardly move them to the next one.
"""

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z, rotation, unit
from symrefine.groups.axial import planar_parts
from symrefine.groups.names import Symbol, parse
from symrefine.groups.orthogonal import (
    ROUGH,
    axes_and_angles,
    determinants,
    nearest_operations,
    nearest_orthogonal,
    register,
)
from symrefine.groups.point_group import PointGroup
from symrefine.groups.standard import standard_operations

POLYHEDRAL = ("T", "Td", "Th", "O", "Oh", "I", "Ih")  # by order


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
    everything = np.concatenate([rotations, others])
    for symbol in map(parse, POLYHEDRAL):
        if len(standard_operations(symbol)) == len(everything) and has_alike(everything, symbol, ROUGH):
            return symbol, polyhedral_start(rotations, symbol, ROUGH)
    frame = frame_with_z(_main_axis(rotations, others))
    parts = planar_parts(everything, frame)
    fold = int(np.count_nonzero((parts.ends > 0) & (parts.dets > 0)))
    flips, over = parts.dets < 0, parts.ends < 0
    if flips.any():
        # The x axis lies in a mirror or, where there are any, along a half turn.
        phase = parts.angles_rad[flips & over if (flips & over).any() else flips][0]
        frame = rotation([0.0, 0.0, 1.0], -0.5 * phase) @ frame
    # Rotoreflections turn by multiples of 2 pi / n (Cnh, Dnh), or by odd multiples of pi / n.
    in_step = np.cos(fold * parts.angles_rad[over & ~flips]).sum() > 0.0
    if (flips & over).any():
        family = "D" if not others.size else "Dh" if in_step else "Dd"
    else:
        family = "C" if not others.size else "Cv" if flips.any() else "Ch" if in_step else "S"
    return Symbol(family=family, fold=fold), frame


def _main_axis(rotations: Array, others: Array) -> Array:
    """Direction [3] of the z axis of an axial group."""
    if len(rotations) == 1:
        return np.asarray(axes_and_angles(others)[0][0]) if len(others) else np.array([0.0, 0.0, 1.0])
    mean = rotations.mean(axis=0)
    if round(float(np.trace(mean))) == 1:  # the projection on the one direction that all rotations fix
        return _top_eigenvector(mean)
    everything = np.concatenate([rotations, others])
    squares = (everything @ everything).mean(axis=0)  # `(1 + z z') / 2`, but 1 for D2 and D2h
    half_turn = axes_and_angles(rotations)[0][np.argmin(np.trace(rotations, axis1=1, axis2=2))]
    return np.asarray(half_turn) if np.trace(squares) > 2.5 else _top_eigenvector(squares)


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


def _top_eigenvector(matrix: Array) -> Array:
    """Eigenvector [3] of the largest eigenvalue of the symmetric part."""
    return np.asarray(np.linalg.eigh(matrix + matrix.T)[1][:, -1])
