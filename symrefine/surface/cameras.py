"""Cameras: what one of them saw of a surface tells where there is nothing.

A ray that ends on the surface crosses free space before, and one that passes beside all that was seen never ends: a
point in front of the surface, or beside its outline, would have been seen. A point behind it was hidden.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Mask, rows, unit
from symrefine.surface.tree import Tree

# Rays around a point that tell how far the camera saw there, and spacings of rays up to which one is around.
RAYS, WITHIN = 4, 2.0
# Rays around a point that tell whether others hide it.
BESIDE = 8


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

    def sees_through(self, points: Array, margin: float) -> Mask:
        """Which of points [N, 3] lie in space that the camera saw to be free, by more than a margin."""
        away = points - self.eye
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        angle, near = self.directions.query(away / distance[:, None], min(RAYS, len(self.ranges)))
        around = angle <= WITHIN * self.spacing
        behind = np.where(around, self.ranges[near], np.inf).min(axis=1)
        # Beside the outline is what no ray is near to, even moved by the margin.
        beside = angle[:, 0] * distance > np.maximum(margin, WITHIN * self.spacing * distance)
        return np.asarray(np.where(around.any(axis=1), distance < behind - margin, beside))

    def off(self, points: Array) -> Array:
        """How far points [N, 3] are from what the rays nearest to them ended on [N]."""
        away = points - self.eye
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        angle, near = self.directions.nearest(away / distance[:, None])
        return np.asarray(np.hypot(angle * distance, self.ranges[near] - distance))

    @property
    def hidden(self) -> Mask:
        """Which of the points [K] it cannot have seen: most rays around end before, by more than they are apart there.

        They stand on all sides, and not on one as where the outline of something nearer passes.
        """
        rays = self.directions.points
        if len(rays) <= BESIDE:
            return np.zeros(len(rays), dtype=bool)
        near = self.directions.query(rays, BESIDE, skip=1)[1]
        front = self.ranges[near] < (self.ranges * (1.0 - WITHIN * self.spacing))[:, None]
        aside = rows(rays, near) - rays[:, None]
        weight = front / np.maximum(np.linalg.norm(aside, axis=2), 1e-300)
        aside = np.einsum("nk,nki->ni", weight, aside)
        # Of directions on one side the mean is 2 / pi long, of those on all sides nothing is left.
        return np.asarray((front.mean(axis=1) >= 0.5) & (np.linalg.norm(aside, axis=1) < front.sum(axis=1) / np.pi))


def cameras(points: Array, viewpoints: Array) -> tuple[Camera, ...]:
    """The cameras that saw points [N, 3], each from its place [N, 3]."""
    places, owner = np.unique(viewpoints, axis=0, return_inverse=True)
    return tuple(_camera(place, points[owner.ravel() == k]) for k, place in enumerate(places))


def outwards(views: Sequence[Camera], points: Array, normals: Array) -> Array:
    """Normals [N, 3] of parts of a surface at points [N, 3], turned to the cameras that saw them."""
    seen_by = np.argmin([view.off(points) for view in views], axis=0)
    towards = np.array([view.eye for view in views])[seen_by] - points
    return np.where(np.einsum("ni,ni->n", towards, normals)[:, None] < 0.0, -normals, normals)


def _camera(eye: Array, points: Array) -> Camera:
    points = np.unique(points, axis=0)  # rays that are told twice would seem to lie side by side without a gap
    ranges = np.linalg.norm(points - eye, axis=1)
    seen = ranges > 0.0
    directions = Tree(unit(points[seen] - eye))
    spacing = directions.query(directions.points, 1, skip=1)[0] if seen.sum() > 1 else np.zeros(1)
    return Camera(eye=eye, directions=directions, ranges=ranges[seen], spacing=float(np.median(spacing)))
