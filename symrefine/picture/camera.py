"""Where to look from: a pinhole camera, and the view that shows planes as planes and the shape from its broad side."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from symrefine.geometry import Array, ReadOnly, unit
from symrefine.picture.scene import Scene

# What the height of a picture spans, and that of a page's model.
FOV_RAD = math.radians(26.0)
ELEVATIONS_DEG = (22, 26, 30, 34)
AZIMUTH_STEP_DEG = 5
# |cos| between normal and line of sight from which a plane is well seen, and where it starts to hide the rest.
OPEN, FRONTAL = 0.35, 0.8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera(ReadOnly):
    """Pinhole camera at `eye` [3], looking at `target` [3], with `up` [3] upwards; `fov_rad` spans the height."""

    eye: Array
    target: Array
    up: Array
    fov_rad: float

    @property
    def frame(self) -> Array:
        """Rows: right, up, and backwards towards the eye."""
        return _frame(self.eye - self.target, self.up)

    def focal(self, height: int) -> float:
        """Focal length in pixels of an image of this height."""
        return 0.5 * height / math.tan(0.5 * self.fov_rad)

    def project(self, points: Array, width: int, height: int) -> tuple[Array, Array]:
        """Pixel coordinates [N, 2], rows downwards, and depth [N] along the line of sight of points [N, 3]."""
        right, up, back = self.frame @ (points - self.eye).T
        depth = -back
        scale = self.focal(height) / depth
        return np.stack([0.5 * width + scale * right, 0.5 * height - scale * up], axis=1), depth


def look_at(scene: Scene, *, aspect: float, fov_rad: float, fill: float = 0.92) -> Camera:
    """Camera that has everything found in view, and shows it well.

    Args:
        aspect: width over height of the image.
        fov_rad: angle that the height of the image spans.
        fill: share of the image that may be used.
    """
    # The direction from the shape to the eye is the best of a grid.
    angles = np.radians(list(product(ELEVATIONS_DEG, range(0, 360, AZIMUTH_STEP_DEG))))
    level = [(math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)) for e, a in angles]
    candidates = np.array(level) @ scene.stage.frame
    back = candidates[int(np.argmax(np.round(_merit(candidates, scene), 4)))]
    sheets = [] if scene.crowded else [q.corners for q in scene.planes]
    points = np.concatenate([scene.stage.points, *sheets, *(a.ends for a in scene.axes)])
    return seen_from(back, points, scene.stage.frame[2], aspect=aspect, fov_rad=fov_rad, fill=fill)


def seen_from(back: Array, points: Array, up: Array, *, aspect: float, fov_rad: float, fill: float) -> Camera:
    """Camera in the direction `back` [3] from points [N, 3], all of which it has in view; the rest as of `look_at`."""
    frame = _frame(back, up)
    corners = points @ frame.T
    tangent = np.array([aspect, 1.0]) * fill * math.tan(0.5 * fov_rad)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    for _ in range(4):  # what is near looks larger, so the middle moves with the distance
        away = corners - middle
        distance = float((away[:, 2:] + np.abs(away[:, :2]) / tangent).max())
        seen = away[:, :2] / (distance - away[:, 2:])
        middle[:2] += 0.5 * distance * (seen.min(axis=0) + seen.max(axis=0))
    target = middle @ frame
    return Camera(eye=target + distance * frame[2], target=target, up=up, fov_rad=fov_rad)


def _frame(back: Array, up: Array) -> Array:
    back = unit(back)
    right = unit(np.cross(up, back))
    return np.stack([right, np.cross(back, right), back])


def _merit(candidates: Array, scene: Scene) -> Array:
    """How well each direction [K, 3] shows the scene: no plane on edge or before all else, and much area."""
    covariance = scene.stage.points.T @ scene.stage.points
    # The area of an ellipsoid's silhouette along v is sqrt(v' adj(C) v): the square root of the product of two axes.
    values, vectors = np.linalg.eigh(covariance)
    adjugate = np.array([values[1] * values[2], values[0] * values[2], values[0] * values[1]])
    area = np.sqrt(np.maximum(((candidates @ vectors) ** 2) @ adjugate, 0.0))
    merit = 0.6 * area / max(float(area.max()), 1e-300) - 0.2 * np.abs(candidates @ scene.stage.frame[2] - 0.45)
    quads = scene.planes or scene.missed_planes[:1]
    if quads:
        seen = np.abs(candidates @ np.array([q.normal for q in quads]).T)
        merit += np.minimum(seen / OPEN, 1.0).min(axis=1) + 0.3 * np.minimum(seen / OPEN, 1.0).mean(axis=1)
        merit -= 1.5 * np.maximum(seen.max(axis=1) - FRONTAL, 0.0)
    return np.asarray(merit)
