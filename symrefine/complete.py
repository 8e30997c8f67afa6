"""Completion: a scan and its images under the symmetry found, where nobody looked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.clock import Clock
from symrefine.detection.examination import examined
from symrefine.detection.measure import Outliers, is_few
from symrefine.detection.result import Detection
from symrefine.detection.story import told
from symrefine.errors import InputError
from symrefine.geometry import Array, Isometry
from symrefine.groups import PointGroup
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE
from symrefine.surface.neighbourhoods import kd_tree
from symrefine.surface.surface import Surface

# Turns that stand for those of a surface of revolution.
ROUND = 36


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Completion:
    """A scan with what its symmetry says of the parts that nobody saw.

    Attributes:
        points: [N, 3] those that were seen, outliers left out, then those inferred.
        inferred: [N] which of them nobody saw.
        contradicted: seen points with an image where the scan says that there is nothing; such images are left out.
        detection: the symmetry that it rests on.
    """

    points: Array
    inferred: NDArray[np.bool_]
    contradicted: int
    detection: Detection


def complete(shape: Shape, *, outliers: Outliers = "auto", tolerance: float = TOLERANCE, seed: int = 0) -> Completion:
    """The points of a scan and their images where nobody looked, under the group that is found in it.

    Args:
        shape: a cloud in 3-space, with its viewpoint where that is known.
        outliers: as of `detect`.
        tolerance: as of `detect`.
        seed: as of `detect`.

    Raises:
        InputError: a mesh or atoms, an object without a symmetry, or none that can be decided.
    """
    if shape.faces is not None or shape.dim != 3 or is_few(shape):
        raise InputError(f"{shape.source}: completion is for clouds of the surface of an object in space")
    clock = Clock()
    known = examined(shape, outliers=outliers, tolerance=tolerance, seed=seed, clock=clock)
    found = told(known, tolerance=tolerance, clock=clock)
    if found.undetermined or found.point_group == "C1":
        why = found.undetermined or "no symmetry was found"
        raise InputError(f"{shape.source}: nothing to complete it by: {why}")
    seen = np.delete(shape.points, found.outliers, axis=0)
    local = (seen - found.origin) / found.scale
    images, contradicted = _images(known.surface, found.group, (found.center - found.origin) / found.scale, local)
    points = np.concatenate([seen, found.origin + found.scale * images])
    return Completion(
        points=points,
        inferred=np.arange(len(points)) >= len(seen),
        contradicted=contradicted,
        detection=found,
    )


def _images(surface: Surface, group: PointGroup, center: Array, points: Array) -> tuple[Array, int]:
    """Images of points [N, 3] where nobody looked, and how many points have one where there is nothing."""
    every = (group if group.is_finite else group.sampled(ROUND)).operations()
    motions = [Isometry.about(center, m) for m in every if not np.allclose(m, np.eye(3))]
    misses = surface.misses(motions)
    unseen = np.isnan(surface.seen(misses, motions))
    owner = surface.cloud.tree.query(points)[1] if surface.cloud.labels is None else np.arange(len(points))
    found: Array = np.empty((0, 3))
    for motion, hidden in zip(motions, unseen, strict=True):
        new = motion.apply(points[hidden[owner]])
        if len(found) and len(new):  # where another image lies already, one is enough
            new = new[kd_tree(found).query(new)[0] > 2.0 * surface.cloud.spacing]
        found = np.concatenate([found, new])
    against = np.asarray((~unseen & (misses > surface.far)).any(axis=0))
    return found, int(against[owner].sum())
