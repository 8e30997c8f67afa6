"""Candidates that hold, and the group they generate: mirrors one by one, axes beside them, improper elements last."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from symrefine.acceptance import Standard, compromise, standard_of
from symrefine.elements import Element, mirror_element
from symrefine.errors import DegenerateShapeError
from symrefine.fit.refine import Framed
from symrefine.geometry import Array, Isometry, Plane, frame_with_z, householder, rotation, rotoreflection, unit
from symrefine.groups import PointGroup, from_elements
from symrefine.lone import keeps
from symrefine.search import Evidence, Mirror, Turn, axis_directions, improper_about, mirrors, turns_about
from symrefine.shape import Index
from symrefine.surface.misses import Verdict

# Directions of elements are known to this before the joint refinement.
DIRECTION_ERROR_RAD = math.radians(1.5)
KNOWN_RAD = math.radians(4.0)
MAX_OPERATIONS = 9
# How many candidates are looked at for the list of near misses once the group is known.
NEAR = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Generators:
    """Mirrors and turns that hold, each by itself; together they may generate a group."""

    mirrors: tuple[Mirror, ...] = ()
    turns: tuple[Turn, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.mirrors or self.turns)

    @staticmethod
    def of(elements: Iterable[Element]) -> "Generators":
        """The mirrors and turns among the elements of a group, as candidates for another one."""
        held, turns = [], []
        for e in elements:
            if e.kind == "plane":
                plane = Plane(normal=e.direction, offset=float(e.direction @ e.point))
                held.append(Mirror(plane=plane, verdict=e.verdict))
            elif e.kind == "axis":
                turns.append(Turn(point=e.point, direction=e.direction, order=e.order, verdict=e.verdict))
        return Generators(mirrors=tuple(held), turns=tuple(turns))

    @property
    def all(self) -> tuple[Mirror | Turn, ...]:
        """Mirrors first."""
        return (*self.mirrors, *self.turns)

    @property
    def standard(self) -> Standard:
        """The standard that the best of them sets."""
        return standard_of(e.verdict for e in self.all)

    @property
    def common_point(self) -> Array:
        """Point nearest to the centroid that lies on all planes and axes, in the sense of least squares."""
        rows = [m.plane.normal for m in self.mirrors]
        values = [m.plane.offset for m in self.mirrors]
        for t in self.turns:
            p = frame_with_z(t.direction)[:2]
            rows += list(p)
            values += list(p @ t.point)
        if not rows:
            return np.zeros(3)
        # Normals are known to a degree or so: what little they leave their common plane by is no third condition.
        return np.linalg.lstsq(np.array(rows), np.array(values), rcond=0.1)[0]

    def without_worst(self) -> tuple["Generators", tuple[Mirror, ...]]:
        """All but the least convincing one; that one too, if it is a mirror."""
        worst = max(self.all, key=lambda e: e.verdict.bulk)
        if isinstance(worst, Turn):
            return replace(self, turns=tuple(t for t in self.turns if t is not worst)), ()
        return replace(self, mirrors=tuple(m for m in self.mirrors if m is not worst)), (worst,)

    def closed(self) -> tuple[PointGroup, "Generators"]:
        """The group they generate; the worst are left out until there is one."""
        kept = self
        while True:
            try:
                group = from_elements(
                    mirrors=[m.plane.normal for m in kept.mirrors],
                    axes=[(t.direction, t.order) for t in kept.turns],
                    tolerance_rad=DIRECTION_ERROR_RAD,
                )
                return group, kept
            except DegenerateShapeError:
                kept, _ = kept.without_worst()


def mirror_group(evidence: Evidence) -> tuple[Generators, list[Element], PointGroup]:
    """The mirrors that hold, skipping those that the group so far implies; those that nearly do; the group."""
    held, near, group = Generators(), list[Mirror](), PointGroup(name="C1")

    def known(normal: Array) -> bool:
        return mirror_of(group)(normal)

    def keep(candidates: Iterable[Mirror]) -> tuple[PointGroup, Generators]:
        return Generators(mirrors=tuple(candidates)).closed()

    few = evidence.tuples.kind != "vanish"

    def offered() -> Iterator[Mirror]:
        yield from mirrors(evidence, evidence.tuples.directions[2:], known=known)
        if not few:
            # Mirrors through an axis may crowd out the one across it.
            main = np.array([u for u, _ in group.rotation_axes()[:1]]).reshape(-1, 3)
            yield from mirrors(evidence, main, count=0, known=known)

    for mirror in offered():
        if mirror.verdict.excess > 1.0:
            near.append(mirror)
            near += [m for m in held.mirrors if compromise(m, mirror)]
            group, held = keep(m for m in held.mirrors if not compromise(m, mirror))
        elif any(compromise(mirror, m) for m in near):
            near.append(mirror)
        else:
            held = replace(held, mirrors=(*held.mirrors, mirror))
            standard = held.standard
            near += [m for m in held.mirrors if not standard.admits(m.verdict)]
            group, held = keep(m for m in held.mirrors if standard.admits(m.verdict))
        if few and held and len(near) >= NEAR:
            break
    return held, [mirror_element(m) for m in near], group


def mirror_of(group: PointGroup) -> Callable[[Array], bool]:
    """Whether a direction is, within a few degrees, the normal of one of the group's mirrors."""
    normals = group.mirrors()

    def known(normal: Array) -> bool:
        return bool(len(normals)) and bool(np.abs(normals @ normal).max() > np.cos(KNOWN_RAD))

    return known


def with_turns(evidence: Evidence, held: Generators, group: PointGroup) -> Generators:
    """Mirrors with the axes worth having beside them: those the n-tuples leave open, or a higher order of the main one.

    Two mirrors or more imply their axes; then only the main one can be of a higher order than the mirrors show. Beside
    one mirror alone an axis can only stand across it, where all n-tuples vanish. No finite group holds Oh or Ih.
    """
    if group.name in ("Oh", "Ih"):
        return held
    if len(held.mirrors) > 1:
        directions = np.array([u for u, _ in group.rotation_axes()[:1]]).reshape(-1, 3)
        if group.name == "D2h":
            # The one group whose mirrors do not imply all its axes: Th has the same three.
            directions = np.concatenate([directions, unit(group.frame.sum(axis=0))[None]])
    elif held and evidence.tuples.kind != "vanish":
        return held
    else:
        normals = np.array([m.plane.normal for m in held.mirrors]).reshape(-1, 3)
        offered = axis_open(evidence) if held or evidence.tuples.kind == "vanish" else axis_directions(evidence)
        directions = np.concatenate([normals, evidence.tuples.directions[:1], offered])
    center = held.common_point
    found = [t for d in apart(directions, KNOWN_RAD) if (t := turns_about(evidence, d, center)) is not None]
    everything = replace(held, turns=tuple(found))
    standard = everything.standard
    return replace(everything, turns=tuple(t for t in found if standard.admits(t.verdict)))


def axis_open(evidence: Evidence) -> Array:
    """Directions [D, 3] that the n-tuples leave open for an axis: wherever the spectrum says, near one line, none."""
    tuples = evidence.tuples
    if tuples.kind == "vanish":
        return axis_directions(evidence)
    if tuples.kind != "axis" and tuples.significance[1] > 0.2 * tuples.significance[0]:
        return np.zeros((0, 3))
    along = tuples.directions[0]
    cone = math.radians(15.0) + 2.0 / tuples.significance[0]
    return np.stack([along, *(d for d in axis_directions(evidence) if abs(d @ along) > math.cos(min(cone, 1.0)))])


def apart(directions: Array, angle_rad: float) -> list[Array]:
    """The directions without those within an angle of an earlier one."""
    kept: list[Array] = []
    for d in directions:
        if all(abs(d @ k) < np.cos(angle_rad) for k in kept):
            kept.append(d)
    return kept


def with_improper(
    evidence: Evidence, group: PointGroup, verdicts: list[Verdict], center: Array, part: Index
) -> PointGroup:
    """The group with the inversion, or the rotoreflection of its main axis, where they hold as well as the rest and
    keep the part that others are blamed for."""
    standard = standard_of(verdicts)

    def admitted(direction: Array, order: int) -> bool:
        motion = Isometry.about(center, rotoreflection(direction, 2.0 * np.pi / order))
        return standard.admits(improper_about(evidence, direction, center, order)) and keeps(evidence, [motion], part)

    axes = [(u, int(2 * k)) for u, k in group.rotation_axes()[:1] if k <= 12]
    improper = [(u, k) for u, k in axes if admitted(u, k)] if not group.improper_axes() else []
    inversion = group.has_inversion or admitted(np.array([0.0, 0.0, 1.0]), 2)
    if inversion == group.has_inversion and not improper:
        return group
    try:
        return from_elements(
            mirrors=group.mirrors(),
            axes=group.rotation_axes(),
            improper=improper,
            inversion=inversion,
            tolerance_rad=DIRECTION_ERROR_RAD,
        )
    except DegenerateShapeError:
        return group


def joint(group: PointGroup, center: Array) -> Framed | None:
    """All mirrors, or where there are none all turns and rotoreflections, in the frame of the group."""
    standard = PointGroup(name=group.name)
    operations = [householder(n) for n in standard.mirrors()]
    operations += [rotation(u, 2 * np.pi / k) for u, k in standard.rotation_axes() if math.isfinite(k)]
    operations += [rotoreflection(u, 2 * np.pi / k) for u, k in standard.improper_axes() if math.isfinite(k)]
    if group.has_inversion and not operations:
        operations = [-np.eye(3)]
    if not operations:
        return None
    return Framed(standard=np.stack(operations[:MAX_OPERATIONS]), frame=group.frame, center=center)
