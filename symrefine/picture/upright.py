"""How an object stands in its picture."""

import math

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from symrefine.detection.result import Detection
from symrefine.geometry import Array, unit
from symrefine.moments.quadrature import triangle_areas_and_normals

# So far from the vertical of the input the object may still be meant to stand as it does; sides of its hull that are
# looked at, the largest.
UPRIGHT_RAD, SIDES = math.radians(10.0), 400


def upright(detection: Detection, points: Array) -> Array:
    """Frame with the vertical where a person would put it, as far as the symmetry lets it be.

    What stands on a floor that was found stands so. The main axis of an axial group stands. Of other objects the third
    axis of the input does, where the symmetry found agrees that it is the vertical: it lies in the one mirror plane, or
    along a two-fold axis, within ten degrees. If not, the object was turned, and its largest flat side lies, again
    within the symmetry. Nothing found says nothing.
    """
    name, group = detection.point_group, detection.group
    x, y, z = group.frame
    if detection.floor is not None:
        up = detection.floor.normal
        return _facing(up, group.frame[int(np.abs(group.frame @ up).argmin())])
    if name in ("C1", "Ci", "Kh", "undetermined"):
        return np.eye(3)
    if name == "Cs":
        normal = detection.planes[0].plane.normal if detection.planes else z
        return _standing(_in_plane(normal, points), normal)
    if group.symbol.fold in (0, 2):
        up = _of_three(group.frame, points)
        return _standing(up, x if abs(x @ up) < 0.5 else y)
    return _standing(z, x)


def _in_plane(normal: Array, points: Array) -> Array:
    """Vertical of an object with one mirror: in it lies what stands."""
    if abs(normal[2]) < math.sin(UPRIGHT_RAD):
        return unit(np.array([0.0, 0.0, 1.0]) - normal[2] * normal)
    normals, areas = _sides(points)
    lying = np.abs(normals @ normal) < math.sin(UPRIGHT_RAD)
    if not lying.any():  # flat or without a side: its longest extent stands
        across = points - np.multiply.outer(points @ normal, normal)
        longest: Array = np.linalg.eigh(across.T @ across)[1][:, -1]
        return unit(longest - (longest @ normal) * normal)
    best = normals[lying][int(np.argmax(areas[lying].round(6)))]
    return unit(best - (best @ normal) * normal)


def _of_three(frame: Array, points: Array) -> Array:
    """The row of a frame that is the vertical of the input, or else the one on whose side the object can lie."""
    along = np.abs(frame[:, 2])
    if along.max() > math.cos(UPRIGHT_RAD):
        return np.asarray(frame[int(along.argmax())])
    normals, areas = _sides(points)
    facing = np.abs(normals @ frame.T) > math.cos(UPRIGHT_RAD)
    covered = (facing * areas[:, None]).sum(axis=0).round(6)
    return np.asarray(frame[int(np.lexsort((-along, -covered))[0])])


def _sides(points: Array) -> tuple[Array, Array]:
    """Unit normals [K, 3] of the sides of the convex hull, and the share of the hull [K] that faces so, nearly."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3)), np.zeros(0)
    areas, normals = triangle_areas_and_normals(points, hull.simplices)
    largest = np.argsort(-areas)[:SIDES]
    near = np.abs(normals[largest] @ normals.T) > math.cos(0.5 * UPRIGHT_RAD)
    return normals[largest], near @ areas / areas.sum()


def _standing(up: Array, side: Array) -> Array:
    """Right-handed rows (side, front, up), the vertical pointing to the upper side of the input."""
    largest = up[2] if abs(up[2]) > 0.05 else up[int(np.argmax(np.abs(up)))]
    return _facing(up * sign(float(largest)), side)


def _facing(up: Array, side: Array) -> Array:
    """Right-handed rows (side, front, up), the side as near to a direction as the vertical lets it be."""
    side = unit(side - (side @ up) * up)
    return np.stack([side, np.cross(up, side), up])


def sign(value: float) -> float:
    """-1 for what is negative, else +1."""
    return -1.0 if value < 0 else 1.0
