"""Points that stand for themselves as balls, and as sticks what seems to be bonded."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from symrefine.geometry import Array, ReadOnly, frame_with_z
from symrefine.picture.chemistry import colour, is_element, radius
from symrefine.picture.palette import OBJECT, PALETTE, shade
from symrefine.shape import Index, Shape
from symrefine.surface.tree import Tree, pairs_within

# Two atoms are bonded that are no farther apart than so many sums of their radii, in units in which most atoms touch
# their nearest one; where radii are not known, so many distances to the nearest neighbour of the lonelier one.
BONDED, NEIGHBOURLY = 1.25, 1.3
# Radius of a ball in radii of its atom, of a stick in those of the smallest ball; of balls without radii in distances
# to the nearest neighbour, and their largest in diagonals.
BALL, STICK, ALONE, LARGEST = 0.42, 0.45, 0.3, 0.03
# How often the faces of an icosahedron are split for a ball, and the sides of a stick, the finest first: the first that
# makes no more than so many triangles, and balls up to so many atoms, is drawn. A page carries them all.
FINENESS, SMOOTH, TRIANGLES = ((2, 12), (1, 12), (0, 6), (0, 3)), 80, 200_000
# Neighbours among which is the one that an atom touches, whatever their radii.
AROUND = 12


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


def balls(shape: Shape) -> Balls | None:
    """The points of a cloud as balls in the colours of their elements or classes; classes and elements have bonds.

    None of more than can be drawn so.
    """
    if 20 * len(shape.points) > TRIANGLES:
        return None
    radii, colours = _looks(shape)
    pairs = _bonds(shape, radii)
    finest = FINENESS if len(shape.points) <= SMOOTH else FINENESS[1:]
    every = ((20 * 4**split * len(shape.points) + 4 * sides * len(pairs), split, sides) for split, sides in finest)
    split, sides = next(((split, sides) for count, split, sides in every if count <= TRIANGLES), (0, 0))
    if not sides:
        return None
    size = BALL * radii if radii is not None else np.full(len(shape.points), _alone(shape.points))
    unit_ball = _ball(split)
    parts = [(unit_ball[0] * r + p, unit_ball[1], k) for k, (p, r) in enumerate(zip(shape.points, size, strict=True))]
    stick = STICK * float(size.min())
    for a, b in pairs:
        middle = 0.5 * (shape.points[a] + shape.points[b])
        parts += [(*_stick(shape.points[k], middle, stick, sides), k) for k in (int(a), int(b))]
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


def _around(points: Array) -> tuple[Array, Index]:
    """Distances and indices, both [N, k], of the points nearest to each, itself first; none where another one is."""
    away, near = Tree(points).query(points, min(AROUND, len(points)))
    return np.where(away > 1e-9 * np.ptp(points), away, np.inf), near


def _unit_of_length(points: Array, radii: Array) -> float:
    """Units of the file in one angstrom: those in which most atoms touch the nearest one."""
    away, near = _around(points)
    return float(np.median((away / (radii[:, None] + radii[near])).min(axis=1)))


def _bonds(shape: Shape, radii: Array | None) -> Index:
    """Pairs [B, 2] of points that seem bonded; none where nothing tells one point from another."""
    if shape.labels is None:
        return np.zeros((0, 2), dtype=np.int64)
    if radii is not None:
        pairs = pairs_within(shape.points, 2.0 * BONDED * float(radii.max()))
        reach = BONDED * (radii[pairs[:, 0]] + radii[pairs[:, 1]])
    else:
        nearest = _around(shape.points)[0].min(axis=1)
        every = cKDTree(shape.points).query_ball_point(shape.points, NEIGHBOURLY * nearest)
        ends = np.repeat(np.arange(len(every)), [len(near) for near in every])
        pairs = np.unique(np.sort(np.column_stack([ends, np.concatenate(every)]), axis=1), axis=0).astype(np.int64)
        reach = NEIGHBOURLY * np.maximum(nearest[pairs[:, 0]], nearest[pairs[:, 1]])
    apart = np.linalg.norm(shape.points[pairs[:, 0]] - shape.points[pairs[:, 1]], axis=1)
    bonded = pairs[(apart <= reach) & (apart > 1e-9 * np.ptp(shape.points))]
    return np.asarray(bonded[np.lexsort(bonded.T[::-1])])


def _alone(points: Array) -> float:
    nearest = _around(points)[0].min(axis=1)
    return float(min(ALONE * np.median(nearest), LARGEST * np.linalg.norm(np.ptp(points, axis=0))))


def _ball(fineness: int) -> tuple[Array, Any]:
    from trimesh.creation import icosphere

    sphere = icosphere(subdivisions=fineness)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces)


def _stick(start: Array, end: Array, thickness: float, sides: int) -> tuple[Array, Any]:
    """An open tube."""
    side, front, _ = frame_with_z(end - start)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = thickness * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * front)
    k = np.arange(sides)
    after = (k + 1) % sides
    faces = np.concatenate([np.stack([k, after, after + sides], 1), np.stack([k, after + sides, k + sides], 1)])
    return np.concatenate([start + ring, end + ring]), faces
