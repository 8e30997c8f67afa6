"""What users hold that says how a body is symmetric: a name, a group, a detection, matrices, an entry of BOP."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError, about
from symrefine.geometry import Array, Axis, frame_with_z, numbers
from symrefine.groups import MAX_FOLD, PointGroup, identify, point_group
from symrefine.groups.elements import DIRECTION_ERROR_RAD as TILT_RAD
from symrefine.groups.orthogonal import chord_angles, determinants
from symrefine.poses.symmetry import Symmetry, checked_poses, homogeneous
from symrefine.rounding import SINGLE

# What is nearer to the identity is it: a tenth of the smallest turn that a group here has.
_IDENTITY_RAD = 0.1 * 2.0 * np.pi / MAX_FOLD
# By how much operations may disagree where they meet: of how far they shift the origin, or of the diameter. As
# coarse as `bop_toolkit` samples a continuous symmetry.
_MEET_REL = 0.01
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
    place = np.zeros(3) if center is None else numbers(center, "coordinates of the centre")
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
        return numbers(given, "").shape
    except InputError:
        return ()


def _of_operations(given: Any, center: Array) -> Symmetry:
    shape = _shape(given)
    if len(shape) != 3 or shape[0] == 0 or shape[1:] not in ((3, 3), (4, 4)):
        told = f"has shape {list(shape)}" if shape else f"is of type {type(given).__name__}"
        raise InputError(
            f"group {told}; expected a Schoenflies symbol, a PointGroup, what symrefine.detect found in space, "
            "operations [N, 3, 3] or [N, 4, 4], or the entry of an object in models_info.json"
        )
    listed = numbers(given, "operations")
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
    """The group that orthogonal matrices [N, 3, 3] are, each off by no more than a degree and a half."""
    group = identify(rotations)
    worst = float(group.distance_rad(rotations).max())
    if worst > TILT_RAD:
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
    # A size of nothing leaves rounding, in any unit in which things that one can hold have poses.
    if misses.max() > max(_MEET_REL * size, SINGLE):
        raise InputError(
            f"operation {int(misses.argmax())} moves the point that all should leave in place by {misses.max():.3g}; "
            "the operations of a body have a point in common"
        )


def _of_bop(entry: Mapping[str, Any]) -> Symmetry:
    """The group that an entry's discrete and continuous symmetries generate, as `bop_toolkit` multiplies them."""
    if not {"diameter", *_BOP} & entry.keys():
        raise InputError(f"has the keys {', '.join(map(str, entry))[:60]!r}; expected the entry of one object")
    discrete = _motions(entry.get(_BOP[0], []))
    axes = _axes(entry.get(_BOP[1], []))
    diameter = _length(entry.get("diameter", 0.0))
    if not axes:
        return _listed(discrete, diameter)
    alike = all(abs(axis.direction @ axes[0].direction) > np.cos(TILT_RAD) for axis in axes)
    group, center = _of_revolution(axes[0], discrete) if alike else _of_sphere(axes)
    away = max(float(np.linalg.norm(np.cross(center - axis.point, axis.direction))) for axis in axes)
    if away > max(_MEET_REL * diameter, SINGLE):
        raise InputError(f"{_BOP[1]} holds axes that do not meet in a point: they pass it by {away:.3g}")
    if len(discrete):
        _check_meet(discrete, center, diameter)
    return Symmetry.about(group, center)


def _length(given: Any) -> float:
    """The diameter of an entry."""
    values = numbers(given, "values of diameter")
    if values.shape or not 0.0 <= values < np.inf:
        raise InputError(f"diameter is {given!r:.40}; expected a length")
    return float(values)


def _motions(listed: Any) -> Array:
    """Rigid motions [N, 4, 4] of lists of 16 numbers."""
    values = numbers(listed, _BOP[0])
    if values.size % 16:
        raise InputError(f"{_BOP[0]} has shape {list(values.shape)}; expected lists of 16 numbers")
    motions = checked_poses(values.reshape(-1, 4, 4), _BOP[0])
    if (determinants(motions[:, :3, :3]) < 0.0).any():
        raise InputError(f"{_BOP[0]} holds a matrix of determinant -1; expected rigid motions")
    return motions


def _axes(listed: Any) -> list[Axis]:
    """Axes of revolution, each through its point nearest to the origin."""
    try:
        axes = [Axis(point=_triple(given["offset"]), direction=_triple(given["axis"])) for given in listed]
    except (KeyError, TypeError):
        raise InputError(f"{_BOP[1]} is {listed!r:.60}; expected a list of axes, each with axis and offset") from None
    return [Axis(point=a.point - (a.point @ a.direction) * a.direction, direction=a.direction) for a in axes]


def _triple(given: Any) -> Array:
    values = numbers(given, f"axis and offset of {_BOP[1]}").ravel()
    if values.shape != (3,) or not np.isfinite(values).all():
        raise InputError(f"{_BOP[1]} holds {given!r:.60}; expected three finite numbers")
    return values


def _of_sphere(axes: Sequence[Axis]) -> tuple[PointGroup, Array]:
    """Axes of revolution that meet generate all rotations; their point is the one nearest to all lines."""
    across = np.array([np.eye(3) - np.outer(axis.direction, axis.direction) for axis in axes])
    points = np.array([axis.point for axis in axes])
    return point_group("K"), np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points))


def _of_revolution(axis: Axis, discrete: Array) -> tuple[PointGroup, Array]:
    """All turns about an axis, and what else is listed: turns about the same, and half turns across it."""
    cosines = discrete[:, :3, :3] @ axis.direction @ axis.direction
    tilts = np.arccos(np.clip(np.abs(cosines), 0.0, 1.0))
    if tilts.max(initial=0.0) > TILT_RAD:
        raise InputError(
            f"{_BOP[0]}[{int(tilts.argmax())}] tilts the axis of revolution by {np.degrees(tilts.max()):.2g} degrees"
        )
    over = cosines < 0.0
    # A half turn across takes the origin twice as far along the axis as the centre lies.
    along = 0.5 * float(np.mean(discrete[over, :3, 3] @ axis.direction)) if over.any() else 0.0
    group = point_group("Dinf" if over.any() else "Cinf", frame_with_z(axis.direction))
    return group, axis.point + along * axis.direction
