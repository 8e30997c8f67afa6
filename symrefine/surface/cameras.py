"""Cameras: what one of them saw of a surface tells where there is nothing.

A ray that ends on the surface crosses free space before, and one that passes beside all that was seen never ends: a
point in front of the surface, or beside its outline, would have been seen. A point behind it was hidden.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, unit
from symrefine.surface.tree import Tree

# Rays around a point that tell how far the camera saw there, and spacings of rays up to which one is around.
RAYS, WITHIN = 4, 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """A place that points were seen from.

    Attributes:
        eye: [3].
        directions: kd-tree over the unit vectors to the points that it saw.
        ranges: [K] how far away they are.
        spacing: median angle between neighbouring rays (radians).
    """

    eye: Array
    directions: Tree
    ranges: Array
    spacing: float

    def sees_through(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """Which of points [N, 3] lie in space that the camera saw to be free, by more than a margin."""
        away = points - self.eye
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        angle, near = self.directions.query(away / distance[:, None], min(RAYS, len(self.ranges)))
        around = angle <= WITHIN * self.spacing
        behind = np.where(around, self.ranges[near], np.inf).min(axis=1)
        # Beside the outline is what no ray is near to, even moved by the margin.
        beside = angle[:, 0] * distance > np.maximum(margin, WITHIN * self.spacing * distance)
        return np.asarray(np.where(around.any(axis=1), distance < behind - margin, beside))


def cameras(points: Array, viewpoints: Array) -> tuple[Camera, ...]:
    """The cameras that saw points [N, 3], each from its place [N, 3]."""
    places, owner = np.unique(viewpoints, axis=0, return_inverse=True)
    return tuple(_camera(place, points[owner.ravel() == k]) for k, place in enumerate(places))


def _camera(eye: Array, points: Array) -> Camera:
    ranges = np.linalg.norm(points - eye, axis=1)
    seen = ranges > 0.0
    directions = Tree(unit(points[seen] - eye))
    spacing = directions.query(directions.points, 1, skip=1)[0] if seen.sum() > 1 else np.zeros(1)
    return Camera(eye=eye, directions=directions, ranges=ranges[seen], spacing=float(np.median(spacing)))
