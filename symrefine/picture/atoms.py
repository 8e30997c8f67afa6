"""Points that stand for themselves as balls, and as sticks what seems to be bonded."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from symrefine.geometry import Array, ReadOnly, frame_with_z
from symrefine.picture.chemistry import colour, is_element, radius
from symrefine.picture.palette import OBJECT, PALETTE, shade
from symrefine.shape import Index, Shape

# Two atoms are bonded that are no farther apart than so many sums of their radii, in units in which most atoms touch
# their nearest one; where radii are not known, so many distances to the nearest neighbour of the lonelier one.
BONDED, NEIGHBOURLY = 1.25, 1.3
# Radius of a ball in radii of its atom, of a stick in those of the smallest ball; of balls without radii in distances
# to the nearest neighbour, and their largest in diagonals.
BALL, STICK, ALONE, LARGEST = 0.42, 0.45, 0.3, 0.03
# Atoms up to which balls are smooth.
SMOOTH = 80
SIDES = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Balls(ReadOnly):
    """Balls and sticks as a mesh.

    Attributes:
        points: [V, 3] vertices, in the frame of the atoms.
        faces: [F, 3].
        colours: [F, 3] of the faces, 0 to 1.
        atoms: [V] which atom each vertex belongs to.
        centres: [N, 3] of the atoms.
        bonds: how many pairs are joined.
    """

    points: Array
    faces: Index
    colours: Array
    atoms: Index
    centres: Array
    bonds: int


def balls(shape: Shape) -> Balls:
    """The points of a cloud as balls in the colours of their elements or classes; classes and elements have bonds."""
    radii, colours = _looks(shape)
    pairs = _bonds(shape, radii)
    size = BALL * radii if radii is not None else np.full(len(shape.points), _alone(shape.points))
    unit_ball = _ball(2 if len(shape.points) <= SMOOTH else 1)
    parts = [(unit_ball[0] * r + p, unit_ball[1], k) for k, (p, r) in enumerate(zip(shape.points, size, strict=True))]
    stick = STICK * float(size.min())
    for a, b in pairs:
        middle = 0.5 * (shape.points[a] + shape.points[b])
        parts += [(*_stick(shape.points[k], middle, stick), k) for k in (int(a), int(b))]
    offsets = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts)])
    return Balls(
        points=np.concatenate([vertices for vertices, _, _ in parts]),
        faces=np.concatenate([faces + o for (_, faces, _), o in zip(parts, offsets[:-1], strict=True)]),
        colours=np.concatenate([np.tile(colours[k], (len(faces), 1)) for _, faces, k in parts]),
        atoms=np.concatenate([np.full(len(vertices), k) for vertices, _, k in parts]),
        centres=shape.points,
        bonds=len(pairs),
    )


def _looks(shape: Shape) -> tuple[Array | None, Array]:
    """Radii [N] in the units of the shape, where elements are known, and colours [N, 3], 0 to 1."""
    labels = shape.labels
    if labels is None:
        return None, np.tile(shade(OBJECT), (len(shape.points), 1))
    if shape.elements and all(is_element(int(k)) for k in np.unique(labels)):
        radii = np.array([radius(int(k)) for k in labels])
        return radii * _unit_of_length(shape.points, radii), np.array([colour(int(k)) for k in labels]) / 255.0
    rank = np.unique(labels, return_inverse=True)[1].reshape(-1)
    return None, np.array([PALETTE[k % len(PALETTE)] for k in rank]) / 255.0


def _distances(points: Array) -> Array:
    """[N, N] with nothing on the diagonal, and nothing between points that coincide."""
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    return np.where(apart > 1e-9 * apart.max(), apart, np.inf)


def _unit_of_length(points: Array, radii: Array) -> float:
    """Units of the file in one angstrom: those in which most atoms touch the nearest one."""
    return float(np.median((_distances(points) / (radii[:, None] + radii)).min(axis=1)))


def _bonds(shape: Shape, radii: Array | None) -> Index:
    """Pairs [B, 2] of points that seem bonded; none where nothing tells one point from another."""
    if shape.labels is None:
        return np.zeros((0, 2), dtype=np.int64)
    apart = _distances(shape.points)
    if radii is None:
        nearest = apart.min(axis=1)
        reach = NEIGHBOURLY * np.maximum(nearest[:, None], nearest)
    else:
        reach = BONDED * (radii[:, None] + radii)
    return np.argwhere(np.triu(apart <= reach, k=1))


def _alone(points: Array) -> float:
    nearest = _distances(points).min(axis=1)
    return float(min(ALONE * np.median(nearest), LARGEST * np.linalg.norm(np.ptp(points, axis=0))))


def _ball(fineness: int) -> tuple[Array, Any]:
    from trimesh.creation import icosphere

    sphere = icosphere(subdivisions=fineness)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces)


def _stick(start: Array, end: Array, thickness: float) -> tuple[Array, Any]:
    """An open tube."""
    side, front, _ = frame_with_z(end - start)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = thickness * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * front)
    k = np.arange(SIDES)
    after = (k + 1) % SIDES
    faces = np.concatenate([np.stack([k, after, after + SIDES], 1), np.stack([k, after + SIDES, k + SIDES], 1)])
    return np.concatenate([start + ring, end + ring]), faces
