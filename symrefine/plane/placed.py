"""Cn, Dn and O(2) placed in the plane, and fitted to the outlines: Gauss-Newton over centre and angle, re-matched."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.decide.hypotheses import MOVED
from symrefine.fit.gauss_newton import Linearisation, minimise
from symrefine.fit.matching import match, pair_equations
from symrefine.fit.placed import FITTED, FREE_TURNS, evenly, wide_angle_rad
from symrefine.fit.refine import MAX_OUTER, SETTLED
from symrefine.geometry import Array, Isometry, Plane, ReadOnly
from symrefine.groups.plane import PointGroup2D
from symrefine.plane.outline import Outlines
from symrefine.rounding import START_ERROR
from symrefine.surface.misses import RIM


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed(ReadOnly):
    """Cn, Dn (`mirrored`) or, for fold inf, O(2) about a centre, one mirror line at `angle_rad` to the x axis."""

    fold: float
    mirrored: bool
    center: Array
    angle_rad: float = 0.0

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
        return not other.mirrored or (self.mirrored and apart < min(START_ERROR, 0.25 * period))

    @property
    def is_line(self) -> bool:
        """Whether it is one mirror line."""
        return self.mirrored and self.fold == 1

    def lines(self) -> list["Placed"]:
        """The mirror lines of a finite group, each as a group of its own."""
        if not self.mirrored or math.isinf(self.fold):
            return []
        first, apart = self.group.angle_rad, math.pi / self.fold
        return [replace(self, fold=1, angle_rad=first + k * apart) for k in range(int(self.fold))]

    @property
    def line(self) -> Plane:
        """One mirror line."""
        normal = self.group.mirrors()[0]
        return Plane(normal=normal, offset=float(normal @ self.center))

    def elements(self) -> list["Placed"]:
        """Each mirror line, and all turns together; those of O(2) stand for its lines as well."""
        turns = [] if self.fold == 1 else [replace(self, mirrored=math.isinf(self.fold))]
        return self.lines() + turns

    def turn(self, angle_rad: float) -> Isometry:
        """The rotation by an angle about the centre."""
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        return Isometry.about(self.center, [[c, -s], [s, c]])

    def operations(self) -> list[Isometry]:
        """Mirrors that generate the group, or turns where it has none, whose inverses need no second look."""
        if math.isinf(self.fold):
            return [self.turn(float(a)) for a in FREE_TURNS]
        if self.mirrored:
            return [Isometry.reflection(line.line) for line in evenly(self.lines(), FITTED)]
        steps = evenly(range(1, int(self.fold) // 2 + 1), FITTED)
        return [self.turn(2.0 * math.pi * k / self.fold) for k in steps]

    def widest(self) -> Isometry:
        """An operation of a finite group far from the identity, which every object nearly bears."""
        return Isometry.reflection(self.line) if self.mirrored else self.turn(wide_angle_rad(int(self.fold)))

    def moved(self, x: Array) -> "Placed":
        """Moved by a shift and turned by an angle, x [3]."""
        return replace(self, center=self.center + x[:2], angle_rad=self.angle_rad + float(x[2]))


def fitted(outlines: Outlines, start: Placed) -> Placed:
    """The group where the points and their images agree best, from where it was proposed."""
    placed, error = start, START_ERROR
    for _ in range(MAX_OUTER):
        motions = placed.operations()
        each = MOVED // (4 * len(motions))
        matched = [
            [pair_equations(s.cloud, pairs) for pairs in match(s.cloud, motions, error, stride=s.stride(each))]
            for s in outlines.surfaces
        ]

        def linearise(x: Array, placed: Placed = placed, matched: list[list[Equations]] = matched) -> Linearisation:
            return _linearised(placed.moved(x), matched)

        x = minimise(linearise, np.zeros(3), max_steps=1, tolerance=SETTLED).x
        length = float(np.abs(x).max())
        placed, error = placed.moved(x), min(START_ERROR, RIM * length)
        if length < SETTLED:
            break
    return placed


Equations = tuple[Array, Array, Array, Array]


def _linearised(placed: Placed, matched: Sequence[Sequence[Equations]]) -> Linearisation:
    """Of `(M (x - c) + c - y).n = 0` over all pairs, by centre and angle."""
    cost, gradient, hessian = 0.0, np.zeros(3), np.zeros((3, 3))
    turning = placed.mirrored and not math.isinf(placed.fold)
    for outline in matched:
        for motion, (sources, targets, normals, weights) in zip(placed.operations(), outline, strict=True):
            arm = motion.turn(sources - placed.center)
            # A mirror line that turns by an angle turns the images by twice that, a quarter turn ahead of them.
            by_angle = 2.0 * (normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]) * turning
            rows = np.column_stack([normals @ (np.eye(2) - motion.matrix), by_angle])
            errors = np.einsum("ij,ij->i", normals, motion.apply(sources) - targets)
            cost += float(weights @ errors**2)
            gradient += rows.T @ (weights * errors)
            hessian += rows.T @ (weights[:, None] * rows)
    return Linearisation(cost=cost, gradient=gradient, hessian=hessian)
