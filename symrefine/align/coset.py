"""What else explains a pair of objects: the coset G R of a symmetric target, and what no data can determine.

If the target has the symmetry group G, then R and g R, g in G, map the source onto it equally well, and no method can
tell them apart. A continuous group leaves a whole subspace free: every orthogonal map within it does as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from symrefine.geometry import Array, ReadOnly, householder, unit
from symrefine.groups import PointGroup
from symrefine.groups.orthogonal import chord_angles
from symrefine.groups.plane import PointGroup2D
from symrefine.rounding import SINGLE, START_ERROR


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coset(ReadOnly):
    """All maps that explain a pair as well as one another.

    Attributes:
        matrices: [k, n, n] orthogonal, the representative first; with a free subspace, one for each connected part.
        translations: [k, n] that go with them.
        free: [j, n] orthonormal directions of the target within whose span any orthogonal map (about the same point) is
            as good: j = 0, or j >= 2. In 3-space two directions mean any turn about the axis normal to both.
        symmetry: Schoenflies symbol of the target in 3-space, "" elsewhere.
        observable: what is determined, in words; "full" if everything is.
        has_both_hands: whether a rotation and a reflection do equally well.
    """

    matrices: Array
    translations: Array
    free: Array
    symmetry: str
    observable: str
    has_both_hands: bool


def coset_of_group(
    matrix: Array, translation: Array, group: PointGroup | PointGroup2D, center: Array, *, reflections: bool = True
) -> Coset:
    """The coset of a target whose symmetry group, about `center`, is known.

    Args:
        matrix: [n, n] the representative; n = 3, or n = 2 where the group is finite.
        translation: [n].
        group: of the target, placed in its coordinates.
        center: [n] point of the target that the group leaves in place.
        reflections: whether improper operations count.
    """
    free: Array = np.zeros((0, len(matrix)))
    operations: Array
    observable = ""
    if isinstance(group, PointGroup) and not group.is_finite:
        # The mirrors, one for each continuous family of them, and their products lead to every connected part.
        group = group.for_point_set()
        operations, free = np.eye(3)[None], group.frame if group.symbol.family == "Kh" else group.frame[:2]
        for normal in group.mirrors():
            operations = np.concatenate([operations, householder(normal) @ operations])
        observable = _continuous_in_words(group)
    else:
        operations = group.operations()
    if not reflections:
        operations = operations[np.linalg.det(operations) > 0.0]
    both_hands, many = _both_signs(operations), f"the {len(operations)} operations of {group.name}"
    return Coset(
        matrices=operations @ matrix,
        translations=center + (translation - center) @ operations.transpose(0, 2, 1),
        free=free,
        symmetry=group.name,
        observable=observable or _in_words(many, len(operations), both_hands=both_hands),
        has_both_hands=both_hands,
    )


def _continuous_in_words(group: PointGroup) -> str:
    if group.name == "Kh":
        return "the position only: the target is a sphere"
    return f"up to any turn about {spelled(group.frame[2])}: the target is a body of revolution ({group.name})"


def _in_words(many: str, count: int, *, both_hands: bool) -> str:
    """What finitely many maps leave open: nothing if there is only one."""
    if count == 1:
        return "full"
    return f"up to {many}" + (", and the determinant is free" if both_hands else "")


def _both_signs(matrices: Array) -> bool:
    signs = np.linalg.det(matrices)
    return bool(signs.min() < 0.0 < signs.max())


def coset_of_list(
    matrices: Array, source_center: Array, target_center: Array, scale: float, free: Array, *, every: bool
) -> Coset:
    """The coset of maps that do equally well, about the two centres; `every` if no others can, in any dimension."""
    dim, both_hands = matrices.shape[1], _both_signs(matrices)
    if len(free):
        observable = f"up to any orthogonal map within {len(free)} of the {dim} dimensions"
    else:
        least = "" if every or dim <= 3 else "at least "
        many = f"{least}{len(matrices)} maps that do equally well"
        observable = _in_words(many, len(matrices), both_hands=both_hands)
    return Coset(
        matrices=matrices,
        translations=target_center - scale * (matrices @ source_center),
        free=free,
        symmetry="",
        observable=observable,
        has_both_hands=both_hands,
    )


def coset_of_maps(matrices: Array, translations: Array, *, both_hands: bool) -> Coset:
    """The coset where what two objects share of one another allows these maps [k, n, n] and [k, n], the best first.

    They do about as well as one another, those of the other determinant equally well only where `both_hands` says so.
    """
    many = f"{len(matrices)} maps that lay what is seen on one another about as well"
    return Coset(
        matrices=matrices,
        translations=translations,
        free=np.zeros((0, matrices.shape[1])),
        symmetry="",
        observable=_in_words(many, len(matrices), both_hands=both_hands),
        has_both_hands=both_hands,
    )


def with_copies(
    maps: Sequence[tuple[Array, Array]], group: PointGroup, center: Array, scale: float, *, of_target: bool
) -> list[tuple[Array, Array]]:
    """Maps ([3, 3], [3]) of a size, and behind them what they are before or after the operations of a finite group.

    One of the two objects has that group about a point [3]: what carries it onto itself makes maps that do as well. A
    copy near a map before it is that map, found by itself.
    """
    operations = group.operations()
    apart = chord_angles(operations, np.eye(3))
    nearest = min(0.5 * float(apart[apart > SINGLE].min(initial=np.inf)), 2.0 * START_ERROR)
    kept = list(maps)
    for (matrix, shift), operation in product(maps, operations):
        copy = operation @ matrix if of_target else matrix @ operation
        if chord_angles(np.array([known for known, _ in kept]), copy).min() >= nearest:
            moved = operation @ (shift - center) + center
            kept.append((copy, moved if of_target else shift + scale * (matrix @ (center - operation @ center))))
    return kept


def lifted(
    inner: Coset,
    source_basis: Array,
    target_basis: Array,
    centers: tuple[Array, Array],
    scale: float,
    *,
    reflections: bool = True,
) -> Coset:
    """The coset in n-space of two sets that span r < n dimensions only, from the one within their spans.

    What happens across the span no point can see: a reflection is free there, for n - r >= 2 every orthogonal map.

    Args:
        inner: coset in r-space.
        source_basis: [n, n] orthonormal rows, the first r spanning the source.
        target_basis: [n, n] the same for the target.
        centers: centres of source and target.
        scale: of the source.
        reflections: whether determinant -1 is an answer.
    """
    rank, dim = inner.matrices.shape[1], len(source_basis)
    within = []
    for m in inner.matrices:
        for sign in (1.0, -1.0):
            full: Array = np.eye(dim)
            full[:rank, :rank] = m
            full[-1, -1] = sign
            within.append(target_basis.T @ full @ source_basis)
    within = [m for m in within if reflections or np.linalg.det(m) > 0.0]
    matrices = np.array(sorted(within, key=lambda m: -np.sign(np.linalg.det(m))))
    across = target_basis[rank:]
    parts: list[Array] = [inner.free @ target_basis[:rank]] if len(inner.free) else []
    if len(across) > 1:
        parts.append(across)
    missing = f"the points span {rank} of {dim} dimensions: "
    missing += f"the reflection across {spelled(across[0])}" if len(across) == 1 else "every map across them"
    within_words = "" if inner.observable == "full" else f"; within them {inner.observable}"
    return Coset(
        matrices=matrices,
        translations=centers[1] - scale * (matrices @ centers[0]),
        free=np.concatenate(parts) if parts else np.zeros((0, dim)),
        symmetry="",
        observable=f"{missing} is free{within_words}",
        has_both_hands=_both_signs(matrices),
    )


def spelled(direction: Array) -> str:
    """A direction for a message."""
    return "(" + ", ".join(f"{x:.3f}" for x in unit(direction) + 0.0) + ")"
