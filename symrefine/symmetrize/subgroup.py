"""A subgroup that is asked for by name, where a group stands."""

from collections.abc import Iterator

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array, unit
from symrefine.groups import PointGroup, is_subgroup, point_group
from symrefine.rounding import SINGLE


def placed_subgroup(group: PointGroup, name: str) -> PointGroup:
    """The first subgroup called `name` of a group where it stands: on its axes and mirrors in their order.

    Raises:
        InputError: there is none.
    """
    wanted = point_group(name)
    for frame in _frames(group):
        candidate = PointGroup(name=wanted.name, frame=frame)
        if is_subgroup(candidate, group):
            return candidate
    raise InputError(f"{wanted.name} is no subgroup of {group.name}, which the object has; name one of its subgroups")


def _frames(group: PointGroup) -> Iterator[Array]:
    """Frames on pairs of perpendicular directions that the group singles out, its own frame first."""
    yield group.frame
    axes = [u for u, _ in (*group.rotation_axes(), *group.improper_axes())]
    directions = np.array([*axes, *group.mirrors(), *group.frame])
    crosses = np.cross(directions[:, None], directions[None]).reshape(-1, 3)
    every = np.concatenate([directions, unit(crosses[np.linalg.norm(crosses, axis=1) > SINGLE])])
    for z in directions:
        for x in every[np.abs(every @ z) < SINGLE]:
            yield np.stack([x, np.cross(z, x), z])
