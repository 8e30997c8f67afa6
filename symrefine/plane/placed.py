"""Cn and Dn placed in the plane, and fitted to the outlines: Gauss-Newton over centre and angle with re-matching."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from symrefine.fit.matching import match
from symrefine.geometry import Array, Isometry, Plane, read_only
from symrefine.groups import PointGroup2D
from symrefine.plane.outline import Outlines
from symrefine.surface.skin import LocalPlanes

T = TypeVar("T")
# Turns that no finite fold below 36 shares.
IRRATIONAL_TURNS = tuple(2.0 * math.pi * share for share in (0.0823, 0.1381966, 0.2360680, 0.4270510))
# Operations of one kind that are judged together, and that are fitted.
MOST, FITTED = 8, 4
MAX_STEPS = 16
# A step shorter than this (radians, RMS radii) ends the fit.
SETTLED = 5e-5
# How far the moments may put a line or a centre wrong, radians and RMS radii.
START_ERROR = 0.1
_QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed:
    """Cn, Dn (`mirrored`) or, for fold inf, O(2) about a centre, one mirror line at `angle_rad` to the x axis."""

    fold: float
    mirrored: bool
    center: Array
    angle_rad: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(self.center))

    @property
    def group(self) -> PointGroup2D:
        """The point group."""
        if math.isinf(self.fold):
            return PointGroup2D(name="O(2)")
        angle = self.angle_rad % (math.pi / self.fold) if self.mirrored else 0.0
        return PointGroup2D(name=f"{'D' if self.mirrored else 'C'}{int(self.fold)}", angle_rad=angle)

    @property
    def order(self) -> float:
        """Number of operations."""
        return self.group.order

    def lines(self) -> tuple[Plane, ...]:
        """The mirror lines of a finite group."""
        if math.isinf(self.fold):
            return ()
        return tuple(Plane(normal=n, offset=float(n @ self.center)) for n in self.group.mirrors())

    def turns(self) -> tuple[Isometry, ...]:
        """Rotations that stand for all of them; their inverses need no second look."""
        if math.isinf(self.fold):
            angles = list(IRRATIONAL_TURNS)
        else:
            angles = [2.0 * np.pi * k / self.fold for k in _some(range(1, int(self.fold) // 2 + 1), MOST)]
        return tuple(self.turn(a) for a in angles)

    def turn(self, angle_rad: float) -> Isometry:
        """The rotation by an angle about the centre."""
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        return Isometry.about(self.center, [[c, -s], [s, c]])

    def generators(self, most: int = MOST) -> tuple[Isometry, ...]:
        """Mirrors that generate the group, or turns where it has none."""
        if not self.mirrored or math.isinf(self.fold):
            return _some(self.turns(), most)
        return tuple(Isometry.reflection(line) for line in _some(self.lines(), most))


def _some(items: Sequence[T], most: int) -> tuple[T, ...]:
    """At most `most` of them, spread evenly, the first one in any case."""
    return tuple(items[k * len(items) // most] for k in range(most)) if len(items) > most else tuple(items)


def fitted(outlines: Outlines, start: Placed, *, steps: int = MAX_STEPS, sources: int = 1000) -> Placed:
    """The group where the points and their images agree best, from where the moments put it."""
    placed, error = start, START_ERROR
    for _ in range(steps):
        hessian, gradient = np.zeros((3, 3)), np.zeros(3)
        for judge in outlines.judges:
            stride = max(1, len(judge.cloud.points) // sources)
            for motion in placed.generators(FITTED):
                rows, errors, weights = _equations(judge.cloud, motion, placed, error, stride)
                hessian += rows.T @ (weights[:, None] * rows)
                gradient += rows.T @ (weights * errors)
        size = float(np.trace(hessian))
        if size == 0.0:
            return placed
        x = -np.linalg.solve(hessian + 1e-6 * size * np.eye(3), gradient)
        length = float(np.abs(x).max())
        x *= min(1.0, START_ERROR / max(length, 1e-300))
        placed = replace(placed, center=placed.center + x[:2], angle_rad=placed.angle_rad + x[2])
        error = min(START_ERROR, 4.0 * length)
        if length < SETTLED:
            break
    return placed


def _equations(
    cloud: LocalPlanes, motion: Isometry, placed: Placed, error: float, stride: int
) -> tuple[Array, Array, Array]:
    """Rows [E, 3] by centre and angle, residuals [E] and weights [E] of `(M (x - c) + c - y).n = 0` over the pairs."""
    pairs = match(cloud, motion, error, stride=stride)
    sources, targets = cloud.points[pairs.sources], cloud.points[pairs.targets]
    missed = motion.apply(sources) - targets
    by_angle = np.zeros_like(sources)
    if placed.mirrored and not math.isinf(placed.fold):
        by_angle = 2.0 * motion.turn(sources - placed.center) @ _QUARTER_TURN.T
    by_center = np.eye(2) - motion.matrix
    if cloud.isolated:
        rows = np.concatenate(
            [np.column_stack([np.tile(by_center[k], (len(sources), 1)), by_angle[:, k]]) for k in (0, 1)]
        )
        return rows, missed.T.ravel(), np.tile(pairs.weights, 2)
    normals = cloud.normals[pairs.targets]
    rows = np.column_stack([normals @ by_center, np.einsum("ij,ij->i", normals, by_angle)])
    return rows, np.einsum("ij,ij->i", normals, missed), pairs.weights
