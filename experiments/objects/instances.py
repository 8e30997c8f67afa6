"""An object to be asked for, with everything that is known of it: what every family of `boundary` makes.

Right answers are groups in place. Most objects have one; where the tolerance or the coarseness of a mesh leaves a
choice, each of several is right.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.objects.built_symmetry import Truth
from experiments.objects.parts import Part, assembled
from symrefine.geometry import Array, frame_with_z
from symrefine.groups import PointGroup
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape

# Samples that a place for a detail is chosen among.
PLACES = 4000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Instance:
    """An object with what may be answered.

    Attributes:
        shape: a mesh, or a cloud as it is.
        truth: the symmetry it was built with.
        also: other groups in the same place that are right too.
        also_from: the tolerance from which they are.
        subgroups: whether every subgroup is right too: what counts is that nothing is invented.
        undecidable: whether the data determine nothing, so that only "undetermined" is right.
        differs: share of the surface without a counterpart under the truth.
        diagonal: of what the elements belong to, in its units; where one point is far off, of all the others.
    """

    shape: Shape
    truth: Truth
    also: tuple[PointGroup, ...] = ()
    also_from: float = 0.0
    subgroups: bool = False
    undecidable: bool = False
    differs: float = 0.0
    diagonal: float

    def accepted(self, tolerance: float) -> tuple[Truth, ...]:
        """All that is right at a tolerance, what it was built with first."""
        others = self.also if tolerance >= self.also_from else ()
        return (self.truth, *(Truth(group=group, center=self.truth.center) for group in others))


Build = Callable[[np.random.Generator], Instance]


def centred(name: str) -> Truth:
    """A group in its standard placement; a lone mirror across y, as our objects stand."""
    frame = frame_with_z([0.0, 1.0, 0.0]) if name == "Cs" else np.eye(3)
    return Truth(group=PointGroup(name=name, frame=frame), center=np.zeros(3))


def of_parts(parts: Sequence[Part], name: str, *also: str, also_from: float = 0.0) -> Instance:
    """An instance built around the origin, of a group in its standard placement."""
    shape = assembled(parts)
    groups = tuple(centred(other).group for other in also)
    return Instance(shape=shape, truth=centred(name), also=groups, also_from=also_from, diagonal=shape.diagonal)


def as_built(parts: Sequence[Part]) -> Instance:
    """An instance that has, where it stands, the symmetry that its parts have together."""
    shape = assembled(parts)
    return Instance(shape=shape, truth=Truth.of_parts(parts), diagonal=shape.diagonal)


def free_place(shape: Shape, rng: np.random.Generator, room: float, apart: Array | None = None) -> tuple[Array, Array]:
    """A point [3] on the outside of a mesh and the normal [3] there, with free space of `room` in front of it.

    Args:
        apart: normals [m, 3] of mirrors through the origin that the point keeps `room` away from.
    """
    points, normals, _ = sample_surface(shape, PLACES, rng)
    points, normals = points.copy(), normals.copy()
    for i in rng.permutation(PLACES):
        point, normal = points[i], normals[i]
        away = points - point
        ahead = away @ normal
        beside = np.linalg.norm(away - ahead[:, None] * normal, axis=1)
        free = not bool(((ahead > 1e-3 * room) & (beside < room)).any())
        if free and (apart is None or np.abs(apart @ point).min(initial=np.inf) > room):
            return point, normal
    raise AssertionError("no place on this object has so much room")
