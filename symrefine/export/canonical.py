"""Canonical pose: the symmetry in its standard placement, the same for every pose in which an object was given.

The main axis lies on z through the origin, a second axis or a mirror beside it on x (Schoenflies' tables; `groups`);
Cs has its mirror on z = 0, a cubic group its cube axes on x, y, z, an icosahedral one a five-fold axis on z and a
two-fold one on x. Where the group leaves the origin free (along the axis of Cn, Cnv; in the plane of Cs) it is the
middle of the bounding box. What else the group leaves open (which end of a cup is up, which of two kinds of mirrors is
on x) the mass decides: the first of a row of moments that tells the choices apart is made positive. The rotation about
an axis of revolution, and that of Ci, is the one nearest to the axes of the file.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array, ReadOnly, frame_with_z, rotation
from symrefine.groups import PointGroup
from symrefine.groups.standard import GOLDEN
from symrefine.moments.quadrature import mesh_nodes
from symrefine.shape import Shape

_X, _, _Z = np.eye(3)
_FLIP = rotation(_X, math.pi)
# From the standard placement of I and Ih, two-fold axes on x, y, z, to a five-fold axis on z.
_FIVE_UP = rotation(_X, math.atan2(1.0, GOLDEN))
# Moments (of RMS radius and mass 1) that differ by less do not tell two choices apart.
_TELLS = 1e-3
_DEGREE = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Canonical(ReadOnly):
    """A canonical pose: `canonical = rotation (x - center)` for x in the units of the file.

    Attributes:
        rotation: [3, 3], determinant +1.
        center: [3] what becomes the origin, in the coordinates of the file.
        group: the group as it stands about the origin afterwards.
    """

    rotation: Array
    center: Array
    group: PointGroup

    def matrix(self, scale: float = 1.0) -> Array:
        """The transform [4, 4] from the file to the canonical pose, `scale` units there for one of the file."""
        matrix = np.eye(4)
        matrix[:3, :3] = scale * self.rotation
        matrix[:3, 3] = -scale * self.rotation @ self.center
        return matrix

    def apply(self, points: Array, scale: float = 1.0) -> Array:
        """Canonical coordinates [N, 3] of points [N, 3] of the file."""
        return np.asarray(scale * (points - self.center) @ self.rotation.T)

    def shape(self, shape: Shape, scale: float = 1.0) -> Shape:
        """The shape in its canonical pose: vertices, faces and everything else in their order."""
        normals = None if shape.normals is None else shape.normals @ self.rotation.T
        return replace(shape, points=self.apply(shape.points, scale), normals=normals)


def canonical_pose(group: PointGroup, center: Array, shape: Shape) -> Canonical:
    """The canonical pose of a shape with a group about a centre; C1 is only moved to the middle of its box.

    Raises:
        InputError: not a 3-D shape.
    """
    if shape.dim != 3:
        raise InputError(f"{shape.source}: a canonical pose is for 3-D shapes; these points have {shape.dim}")
    nodes, weights = _masses(shape)
    fold = int(group.symbol.fold) if group.is_finite and group.symbol.fold else 1
    standard = _best(_choices(group, nodes, weights), nodes, weights, fold)
    tilt = _FIVE_UP if group.symbol.family in ("I", "Ih") else np.eye(3)
    turn = tilt @ standard
    placed = PointGroup(name=group.name, frame=tilt.T)
    local = (shape.points - center) @ turn.T
    middle = 0.5 * (local.min(axis=0) + local.max(axis=0))
    return Canonical(rotation=turn, center=center + (middle * _free(group)) @ turn, group=placed)


def _free(group: PointGroup) -> Array:
    """1 for each canonical axis along which every operation leaves the origin free, else 0."""
    family, fold = group.symbol.family, group.symbol.fold
    if family == "C" and fold == 1:
        return np.ones(3)
    if family == "Ch" and fold == 1:
        return np.array([1.0, 1.0, 0.0])
    return _Z if family in ("C", "Cv") else np.zeros(3)


def _masses(shape: Shape) -> tuple[Array, Array]:
    """Nodes [M, 3] about the centre of mass, RMS radius 1, and weights [M] of sum 1; the surface of a mesh."""
    if shape.faces is None:
        nodes, weights = shape.points, shape.masses
    else:
        nodes, weights = mesh_nodes(replace(shape, measure="surface"), _DEGREE)
        nodes = nodes + shape.points[0]
    weights = weights / weights.sum()
    nodes = nodes - weights @ nodes
    return nodes / math.sqrt(weights @ np.sum(nodes**2, axis=1)), weights


def _choices(group: PointGroup, nodes: Array, weights: Array) -> list[Array]:
    """Rotations [3, 3] to the standard placement, one for each that the group itself does not make equal.

    They are the cosets of its rotations in the rotations that map the group to itself (its normaliser in SO(3)).
    """
    family, fold = group.symbol.family, group.symbol.fold
    if family in ("S", "C", "K", "Kh") and fold in (0, 1):  # C1, Ci, spheres: any rotation will do
        return [np.eye(3)]
    if math.isinf(fold):
        upright = _nearest_to_file(group.frame[2])
        return [upright, _FLIP @ upright] if family in ("C", "Cv") else [upright]
    if family in ("C", "Ch", "S"):
        ends = [group.frame, _FLIP @ group.frame]
        return [turned for end in ends for turned in _phased(end, nodes, weights, int(fold), odd=family == "S")]
    half, quarter = rotation(_Z, math.pi / max(fold, 1)), rotation(_Z, 0.5 * math.pi)
    if family in ("D", "Dh") and fold == 2:
        cycle = np.roll(np.eye(3), 1, axis=0)
        steps = [turn @ np.linalg.matrix_power(cycle, k) for turn in (np.eye(3), quarter) for k in range(3)]
    elif family == "Cv":
        steps = [np.eye(3), half, _FLIP, _FLIP @ half]
    elif family in ("D", "Dh", "Dd"):
        steps = [np.eye(3), half]
    else:
        steps = [np.eye(3), quarter] if family.startswith("T") else [np.eye(3)]
    return [step @ group.frame for step in steps]


def _nearest_to_file(axis: Array) -> Array:
    """The frame with z along an axis whose x is the best of the file's axes made perpendicular to it."""
    rough = frame_with_z(axis)
    best = np.eye(3)[int(np.argmin(np.abs(axis)))]
    phase = math.atan2(float(rough[1] @ best), float(rough[0] @ best))
    return np.asarray(rotation(_Z, -phase) @ rough)


def _phased(frame: Array, nodes: Array, weights: Array, fold: int, *, odd: bool) -> list[Array]:
    """The frame turned about z so that the first clear angular moment is real and positive.

    For Cs it is the longest direction in the plane, with either sign.
    """
    x, y, z = (nodes @ frame.T).T
    lever, angle = np.hypot(x, y), np.arctan2(y, x)
    if fold == 1:
        phase = 0.5 * float(np.angle(weights @ (lever**2 * np.exp(2j * angle))))
        return [rotation(_Z, -phase + k * math.pi) @ frame for k in range(2)]
    heights = (z,) if odd else (np.ones_like(z), z, z**2)
    moments = [complex(weights @ (lever * h * np.exp(1j * fold * angle))) for h in heights]
    clear = next((m for m in moments if abs(m) > _TELLS), max(moments, key=abs))
    return [rotation(_Z, -float(np.angle(clear)) / fold) @ frame]


def _best(choices: list[Array], nodes: Array, weights: Array, fold: int) -> Array:
    """The choice with the largest moments: by the first that tells them apart, then by the next; else nearest to I."""
    signatures = np.array([_signature(nodes @ turn.T, weights, fold) for turn in choices])
    left = np.arange(len(choices))
    for values in signatures.T:
        left = left[values[left] >= values[left].max() - _TELLS]
    return max((choices[k] for k in left), key=lambda turn: float(np.trace(turn)))


def _signature(points: Array, weights: Array, fold: int) -> list[float]:
    """Moments that change where a choice does: length before width, top and front heavier, then handedness."""
    x, y, z = points.T
    lever, angle = np.hypot(x, y), np.arctan2(y, x)
    waves = [lever * h * np.exp(1j * k * fold * angle) for k in (1, 2) for h in (np.ones_like(z), z)]
    values = [z**2, x**2, z**3, *(part for w in waves for part in (w.real, w.imag)), x**3, y**3, x * y * z]
    values.append((x**2 - y**2) * (y**2 - z**2) * (z**2 - x**2))
    return [float(weights @ v) for v in values]
