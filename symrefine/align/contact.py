"""What the planes of one surface meet of another under a motion; the other may be known by its points alone."""

from dataclasses import dataclass

import numpy as np

from symrefine.fit.matching import facing, reach_of
from symrefine.geometry import Array, Isometry, Mask
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes, Patches, Planes, Skin


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contact:
    """Local planes of one object, and those of another that they lie nearest to under a motion.

    Attributes:
        source: [M] as they stand.
        target: [M] what each is nearest to.
        away: [M] from the moved point to the nearest of the other object's.
        kept: [M] which of these pairs count.
    """

    source: Planes
    target: Planes
    away: Array
    kept: Mask


def meet(
    source: Patches, target: Skin | LocalPlanes, motion: Isometry, uncertainty: float, *, stride: int = 1
) -> Contact:
    """Every `stride`-th local plane of one object, moved, with those of another; pairs count by the same rules."""
    every = slice(None, None, stride)
    some = source.chosen(every)
    away, met = met_by(target, motion.apply(some.points), source.classes(every))
    kept = away < reach_of(target.spacing, uncertainty)
    if not target.isolated:
        kept &= facing(motion.turn(some.normals), met.normals)
    return Contact(source=some, target=met, away=away, kept=kept)


def met_by(surface: Skin | LocalPlanes, queries: Array, classes: Index | None = None) -> tuple[Array, Planes]:
    """Distance [Q] from each query [Q, 3] of the classes [Q] to the nearest of the points, and the planes met there.

    Of a skin the planes are those of the points around the queries, and the distance is infinite where the nearest
    point is not of the class of the query.
    """
    if isinstance(surface, LocalPlanes):
        distance, nearest = surface.nearest(queries, classes)
        return distance, surface.chosen(nearest)
    near: Index | None = None
    # Where cells are the points themselves, what a plane is fitted to begins with the nearest of them.
    if surface.neighbours > 1 and surface.neighbourhoods.tree is surface.tree:
        away, near = surface.tree.query(queries, surface.neighbourhoods.count)
        distance, nearest = away[:, 0], near[:, 0]
    else:
        distance, nearest = surface.tree.nearest(queries)
    return _of_class(surface, distance, nearest, classes), surface.planes_at(queries, nearest, near)


def distances(skin: Skin, queries: Array, classes: Index | None) -> Array:
    """Distance [Q] from each query [Q, 3] to the nearest point; infinite where that is not of its class [Q]."""
    return _of_class(skin, *skin.tree.nearest(queries), classes)


def _of_class(skin: Skin, distance: Array, near: Index, classes: Index | None) -> Array:
    if skin.labels is None or classes is None:
        return distance
    return np.where(skin.labels[near] == classes, distance, np.inf)
