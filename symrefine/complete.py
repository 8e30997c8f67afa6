"""Completion: a scan and its images under the symmetry found, where nobody looked."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from symrefine.detection.result import Detection
from symrefine.errors import InputError
from symrefine.fit.placed import Placed
from symrefine.geometry import Array
from symrefine.groups.names import TURNS
from symrefine.shape import Shape
from symrefine.surface.tree import Tree
from symrefine.threads import one_thread


@dataclass(frozen=True, kw_only=True, eq=False)
class Completion:
    """A scan with what its symmetry says of the parts that nobody saw.

    Attributes:
        points: [N, 3] those that were seen, outliers left out, then those inferred.
        inferred: [N] which of them nobody saw.
        contradicted: seen points with an image where the scan says that there is nothing; such images are left out.
        detection: the symmetry that it rests on.
    """

    points: Array = field(repr=False)
    inferred: NDArray[np.bool_] = field(repr=False)
    contradicted: int
    detection: Detection


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdicts:
    """What a scan says of its images under the symmetry found in it.

    Attributes:
        contradicted: [N] which of its points have an image where the scan says that there is nothing.
        inferred: [K, 3] images where nobody looked, in the units of the scan.
    """

    contradicted: NDArray[np.bool_]
    inferred: Array


@one_thread()
def complete(shape: Shape, found: Detection) -> Completion:
    """The points of a scan and their images where nobody looked, under the group that is found in it.

    Args:
        shape: a cloud in 3-space, with its viewpoint where that is known.
        found: what `detect` found in it.

    Raises:
        InputError: a mesh or atoms, an object without a symmetry, or none that can be decided.
    """
    check_scan(shape)
    if found.undetermined or found.point_group == "C1":
        why = found.undetermined or "no symmetry was found"
        raise InputError(f"{shape.source}: nothing to complete it by: {why}")
    seen = np.delete(shape.points, found.outliers, axis=0)
    said = verdicts(found, seen)
    points = np.concatenate([seen, said.inferred])
    return Completion(
        points=points,
        inferred=np.arange(len(points)) >= len(seen),
        contradicted=int(said.contradicted.sum()),
        detection=found,
    )


def check_scan(shape: Shape) -> None:
    """Refuse what nobody scanned.

    Raises:
        InputError: a mesh, atoms, or points that are not of space.
    """
    if shape.faces is not None or shape.dim != 3 or shape.atoms:
        told = "completion is for clouds of the surface of an object in space"
        if shape.faces is not None:
            told += (
                "; this is a mesh, whose surface is all there: sample points on it, as a camera would, and give these"
            )
        raise InputError(f"{shape.source}: {told}")


def verdicts(found: Detection, points: Array) -> Verdicts:
    """What points [N, 3] of the scan in which a group was found say of their images under it."""
    surface = found.surface
    center, local = ((x - found.origin) / found.scale for x in (found.center, points))
    motions = Placed(group=found.group, center=center).motions(TURNS)
    misses = surface.misses(motions)
    unseen = np.isnan(surface.seen(misses, motions))
    owner = surface.of_one_class.nearest(local, None)[1]
    images: Array = np.empty((0, 3))
    for motion, hidden in zip(motions, unseen, strict=True):
        new = motion.apply(local[hidden[owner]])
        if len(images) and len(new):  # where another image lies already, one is enough
            new = new[Tree(images).nearest(new)[0] > 2.0 * surface.cloud.spacing]
        images = np.concatenate([images, new])
    against = np.asarray((~unseen & (misses > surface.far)).any(axis=0))
    return Verdicts(contradicted=against[owner], inferred=found.origin + found.scale * images)
