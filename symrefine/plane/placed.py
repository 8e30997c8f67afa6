"""Cn, Dn and O(2) placed in the plane, and fitted to the outlines: Gauss-Newton over centre and angle, re-matched."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.fit.gauss_newton import Linearisation, minimise
from symrefine.fit.matching import match, pair_equations
from symrefine.fit.placed import FREE_TURNS, evenly, wide_angle_rad
from symrefine.geometry import Array, Isometry, Plane, read_only
from symrefine.groups import PointGroup2D
from symrefine.plane.outline import Outlines

# Operations of one kind that are judged together, those that are fitted, and the points that they are fitted to.
MOST, FITTED, SOURCES = 8, 4, 1000
# Matches at most; one that moves nothing by more than the second (radians, RMS radii) is the last.
MATCHES, SETTLED = 16, 5e-5
# How far what is proposed may be off, radians and RMS radii: 250 samples put the centroid wrong by 0.05.
START_ERROR = 0.05
# Mirror lines that are nearer than this are one.
SAME_RAD = math.radians(3.0)


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

    def holds(self, other: "Placed") -> bool:
        """Whether it has all operations of another group, as far as fold and angle tell."""
        if math.isinf(self.fold):
            return True
        if math.isinf(other.fold) or self.fold % other.fold:
            return False
        period = math.pi / self.fold
        apart = abs((self.angle_rad - other.angle_rad + 0.5 * period) % period - 0.5 * period)
        return not other.mirrored or (self.mirrored and apart < min(SAME_RAD, 0.25 * period))

    def lines(self) -> tuple[Plane, ...]:
        """The mirror lines of a finite group."""
        if math.isinf(self.fold):
            return ()
        return tuple(Plane(normal=n, offset=float(n @ self.center)) for n in self.group.mirrors())

    def turns(self) -> tuple[Isometry, ...]:
        """Rotations that stand for all of them; their inverses need no second look."""
        if math.isinf(self.fold):
            angles = [float(a) for a in FREE_TURNS]
        else:
            angles = [2.0 * np.pi * k / self.fold for k in evenly(range(1, int(self.fold) // 2 + 1), MOST)]
        return tuple(self.turn(a) for a in angles)

    def turn(self, angle_rad: float) -> Isometry:
        """The rotation by an angle about the centre."""
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        return Isometry.about(self.center, [[c, -s], [s, c]])

    def wide_turn(self) -> Isometry:
        """A generator of the turns far from the identity, which every object nearly bears."""
        return self.turn(wide_angle_rad(int(self.fold)))

    def generators(self) -> tuple[Isometry, ...]:
        """Mirrors that generate the group, or turns where it has none; no more than are fitted."""
        if not self.mirrored or math.isinf(self.fold):
            return tuple(evenly(self.turns(), FITTED))
        return tuple(Isometry.reflection(line) for line in evenly(self.lines(), FITTED))

    def moved(self, x: Array) -> "Placed":
        """Moved by a shift and turned by an angle, x [3]."""
        return replace(self, center=self.center + x[:2], angle_rad=self.angle_rad + float(x[2]))


def fitted(outlines: Outlines, start: Placed) -> Placed:
    """The group where the points and their images agree best, from where it was proposed."""
    placed, error = start, START_ERROR
    for _ in range(MATCHES):
        matched = [
            [
                pair_equations(s.cloud, match(s.cloud, motion, error, stride=s.stride(SOURCES)))
                for motion in placed.generators()
            ]
            for s in outlines.surfaces
        ]

        def linearise(x: Array, placed: Placed = placed, matched: list[list[Equations]] = matched) -> Linearisation:
            return _linearised(placed.moved(x), matched)

        x = minimise(linearise, np.zeros(3), max_steps=1, tolerance=SETTLED).x
        length = float(np.abs(x).max())
        placed, error = placed.moved(x), min(START_ERROR, 4.0 * length)
        if length < SETTLED:
            break
    return placed


Equations = tuple[Array, Array, Array, Array]


def _linearised(placed: Placed, matched: Sequence[Sequence[Equations]]) -> Linearisation:
    """Of `(M (x - c) + c - y).n = 0` over all pairs, by centre and angle."""
    cost, gradient, hessian = 0.0, np.zeros(3), np.zeros((3, 3))
    turning = placed.mirrored and not math.isinf(placed.fold)
    for outline in matched:
        for motion, (sources, targets, normals, weights) in zip(placed.generators(), outline, strict=True):
            arm = motion.turn(sources - placed.center)
            # A mirror line that turns by an angle turns the images by twice that, a quarter turn ahead of them.
            by_angle = 2.0 * (normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]) * turning
            rows = np.column_stack([normals @ (np.eye(2) - motion.matrix), by_angle])
            errors = np.einsum("ij,ij->i", normals, motion.apply(sources) - targets)
            cost += float(weights @ errors**2)
            gradient += rows.T @ (weights * errors)
            hessian += rows.T @ (weights[:, None] * rows)
    return Linearisation(cost=cost, gradient=gradient, hessian=hessian)
