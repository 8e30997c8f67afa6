"""What users hold that says how a body is symmetric: a name, a group, a detection, matrices, an entry of BOP."""

from collections.abc import Mapping
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError, about
from symrefine.geometry import Array, frame_with_z, homogeneous, unit
from symrefine.groups import MAX_FOLD, PointGroup, identify, point_group
from symrefine.groups.orthogonal import chord_angles, determinants
from symrefine.poses.symmetry import Symmetry, checked_poses

# What is nearer to the identity is it: a tenth of the smallest turn that a group here has.
_IDENTITY_RAD = 0.1 * 2.0 * np.pi / MAX_FOLD
# By how much operations may disagree where they meet: of how far they shift the origin, or of the diameter. As
# coarse as `bop_toolkit` samples a continuous symmetry.
_MEET_REL = 0.01
# What is shorter is rounding, in any unit in which things that one can hold have poses.
_ROUNDING = 1e-6
# By how much operations may be off their group, tilt an axis of revolution, and two such axes differ: as in
# `groups.from_elements`.
_TILT_RAD = np.radians(2.0)
_BOP = ("symmetries_discrete", "symmetries_continuous")


@runtime_checkable
class Placed(Protocol):
    """What was found somewhere, as `symrefine.Detection` is."""

    def placed(self) -> tuple[PointGroup, Array]:
        """The group, and the point [3] that it leaves in place."""
        ...


Group: TypeAlias = str | PointGroup | Placed | Mapping[str, Any] | ArrayLike


def symmetry_of(given: Group, center: ArrayLike | None = None) -> Symmetry:
    """The symmetry of a body, from whatever says it.

    Args:
        given: as of `Canonicalizer`.
        center: [3] the point that symbol, `PointGroup` or [N, 3, 3] leave in place; the origin if None.

    Raises:
        InputError: nothing of the kind; operations that are no group or do not meet; nothing decided; a centre for what
            has one.
    """
    free = isinstance(given, str | PointGroup) or _shape(given)[-2:] == (3, 3)
    if center is not None and not free:
        raise InputError("center is for a name, a PointGroup or operations [N, 3, 3]; this group has its own")
    place = np.zeros(3) if center is None else np.asarray(center, dtype=np.float64)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(f"center has shape {list(place.shape)}; expected three finite numbers")
    match given:
        case str():
            return Symmetry.about(point_group(given), place)
        case PointGroup():
            return Symmetry.about(given, place)
        case Placed():
            return Symmetry.about(*given.placed())
        case Mapping():
            with about("models_info.json"):
                return _of_bop(given)
    return _of_operations(given, place)


def _shape(given: Any) -> tuple[int, ...]:
    """The shape of an array, or of what can become one; none of anything else."""
    try:
        return np.asarray(given, dtype=np.float64).shape
    except (TypeError, ValueError):
        return ()


def _of_operations(given: Any, center: Array) -> Symmetry:
    shape = _shape(given)
    if len(shape) != 3 or shape[0] == 0 or shape[1:] not in ((3, 3), (4, 4)):
        told = f"has shape {list(shape)}" if shape else f"is of type {type(given).__name__}"
        raise InputError(
            f"group {told}; expected a Schoenflies symbol, a PointGroup, what symrefine.detect found in space, "
            "operations [N, 3, 3] or [N, 4, 4], or the entry of an object in models_info.json"
        )
    listed = np.asarray(given, dtype=np.float64)
    return _listed(checked_poses(listed if shape[1:] == (4, 4) else homogeneous(listed, center), "group"), 0.0)


def _listed(operations: Array, diameter: float) -> Symmetry:
    """The symmetry with operations [N, 4, 4], the identity or not among them, and no others."""
    if chord_angles(operations[:, :3, :3], np.eye(3)).min(initial=np.inf) > _IDENTITY_RAD:
        operations = np.concatenate([np.eye(4)[None], operations])
    with about("expected all operations of a group, each once"):
        group = _identified(operations[:, :3, :3])
    center = operations[:, :3, 3].mean(axis=0)  # the images of the origin, whose mean every operation leaves in place
    _check_meet(operations, center, diameter)
    return Symmetry.about(group, center)


def _identified(rotations: Array) -> PointGroup:
    """The group that orthogonal matrices [N, 3, 3] are, each off by no more than two degrees."""
    group = identify(rotations)
    worst = float(group.distance_rad(rotations).max())
    if worst > _TILT_RAD:
        raise InputError(
            f"the {len(rotations)} operations are no group: those of the likeliest one, {group.name}, are up to "
            f"{np.degrees(worst):.2g} degrees off"
        )
    return group


def _check_meet(operations: Array, center: Array, diameter: float) -> None:
    """Refuse operations [N, 4, 4] that do not leave the centre in place."""
    shifts = operations[:, :3, 3]
    misses = np.linalg.norm(operations[:, :3, :3] @ center + shifts - center, axis=1)
    size = max(diameter, float(np.linalg.norm(shifts, axis=1).max()))
    if misses.max() > max(_MEET_REL * size, _ROUNDING):
        raise InputError(
            f"operation {int(misses.argmax())} moves the point that all should leave in place by {misses.max():.3g}; "
            "the operations of a body have a point in common"
        )


def _of_bop(entry: Mapping[str, Any]) -> Symmetry:
    """The group that an entry's discrete and continuous symmetries generate, as `bop_toolkit` multiplies them."""
    if not {"diameter", *_BOP} & entry.keys():
        raise InputError(f"has the keys {', '.join(map(str, entry))[:60]}; expected the entry of one object")
    discrete = _motions(entry.get(_BOP[0], []))
    lines = [_line(turning) for turning in entry.get(_BOP[1], [])]
    diameter = float(entry.get("diameter", 0.0))
    if not lines:
        return _listed(discrete, diameter)
    points, axes = (np.array(column) for column in zip(*lines, strict=True))
    if np.abs(axes @ axes[0]).min() < np.cos(_TILT_RAD):
        return _of_sphere(points, axes, diameter)
    return _of_revolution(points[0], axes[0], discrete, diameter)


def _motions(listed: Any) -> Array:
    try:
        matrices = np.array(listed, dtype=np.float64).reshape(-1, 4, 4)
    except (TypeError, ValueError):
        raise InputError(f"{_BOP[0]} holds something else than lists of 16 numbers") from None
    motions = checked_poses(matrices, _BOP[0])
    if (determinants(motions[:, :3, :3]) < 0.0).any():
        raise InputError(f"{_BOP[0]} holds a matrix of determinant -1; expected rigid motions")
    return motions


def _line(turning: Any) -> tuple[Array, Array]:
    """A point on an axis of revolution, the nearest to the origin, and its direction."""
    try:
        axis, point = (np.array(turning[key], dtype=np.float64).reshape(3) for key in ("axis", "offset"))
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{_BOP[1]} holds {turning!r:.60}; expected axis and offset, three numbers each") from None
    if not (np.isfinite(axis).all() and np.isfinite(point).all() and axis.any()):
        raise InputError(f"{_BOP[1]} holds an axis that is zero or not finite")
    direction = unit(axis)
    return point - (point @ direction) * direction, direction


def _of_sphere(points: Array, axes: Array, diameter: float) -> Symmetry:
    """Two axes of revolution that meet generate all rotations; their point is the one nearest to all lines."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    center = np.linalg.solve(across.sum(axis=0), (across @ points[:, :, None]).sum(axis=0)[:, 0])
    if np.linalg.norm(across @ (points - center)[:, :, None], axis=1).max() > max(_MEET_REL * diameter, _ROUNDING):
        raise InputError(f"{_BOP[1]} holds axes that do not meet in a point")
    return Symmetry.about(point_group("K"), center)


def _of_revolution(point: Array, axis: Array, discrete: Array, diameter: float) -> Symmetry:
    """All turns about an axis, and what else is listed: turns about the same, and half turns across it."""
    images = discrete[:, :3, :3] @ axis
    over = images @ axis < 0.0
    tilts = np.arccos(np.clip(np.abs(images @ axis), 0.0, 1.0))
    if tilts.max(initial=0.0) > _TILT_RAD:
        raise InputError(
            f"{_BOP[0]}[{int(tilts.argmax())}] tilts the axis of revolution by {np.degrees(tilts.max()):.2g} degrees"
        )
    images_of_origin = discrete[over, :3, 3]
    halfway = 0.5 * images_of_origin.mean(axis=0) if over.any() else np.zeros(3)
    center = point + (halfway @ axis) * axis
    if len(discrete):
        _check_meet(discrete, center, diameter)
    name = "Dinf" if over.any() else "Cinf"
    return Symmetry.about(point_group(name, frame_with_z(axis)), center)
