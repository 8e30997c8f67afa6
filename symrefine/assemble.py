"""From judged candidates to one group: what holds is closed under multiplication, refined as a frame, judged again.

The n-tuples decide where to look. Every one lies in the subspace that the group fixes, so three independent ones leave
no symmetry but the identity, two a mirror, one an axis; only where all vanish is every direction open.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array, Isometry, Plane, frame_with_z, householder, rotation, rotoreflection
from symrefine.groups import PointGroup, from_elements
from symrefine.refine import Framed, Iterate
from symrefine.search import (
    Bundle,
    Evidence,
    Mirror,
    Turn,
    axis_bundle,
    axis_directions,
    improper_about,
    mirrors,
    refined,
    turns_about,
)
from symrefine.verify import Deviation

# Beside an element that holds exactly, one that misses this many times more, and by this share of the limit, is not
# the same kind of truth: a wheel maps onto itself nearly as well between its spokes.
RIVAL = 4.0
EXACT = 0.35
# Directions of elements are known to this before the joint refinement.
DIRECTION_ERROR_RAD = math.radians(1.5)
MAX_OPERATIONS = 24


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Element:
    """One element of the group in normalised units: "plane", "axis" or "improper", and by how much it misses."""

    kind: str
    direction: Array
    point: Array
    order: float
    deviation: Deviation
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assembly:
    """The group placed in space (normalised units), its elements with their misses, and what was turned down."""

    group: PointGroup
    center: Array
    elements: tuple[Element, ...]
    rejected: tuple[Element, ...]
    history: tuple[Iterate, ...]


def assemble(evidence: Evidence) -> Assembly:
    """The largest group that holds, from the axis of the n-tuples where they have one, from the spectrum elsewhere."""
    bundle = _best_bundle(evidence)
    if bundle is not None and math.isinf(bundle.fold):
        return _round(evidence, bundle)
    if bundle is not None and evidence.tuples.kind != "vanish":
        group = PointGroup(name=f"C{int(bundle.fold)}v", frame=bundle.state.frame)
        near = _near(evidence, group, mirrors(evidence, np.zeros((0, 3)), count=5))
        return _finish(evidence, group, bundle.state.center, bundle.history, near)
    seeds = np.zeros((0, 3)) if bundle is None else np.stack([p.normal for p in bundle.state.planes])
    return _from_parts(evidence, np.concatenate([seeds, evidence.tuples.directions[2:]]))


def _limit(excesses: list[float]) -> float:
    """Excess up to which candidates are taken for true, given the best of them."""
    return min(1.0, max(EXACT, RIVAL * min(excesses, default=1.0)))


def _axis_open(evidence: Evidence) -> Array:
    """Directions that the n-tuples leave open for an axis of revolution or a bundle of mirrors."""
    tuples = evidence.tuples
    if tuples.kind == "vanish":
        return np.linalg.eigh(evidence.moments.covariance)[1].T
    lone = tuples.kind == "axis" or tuples.significance[1] < 0.2 * tuples.significance[0]
    return tuples.directions[:1] if lone else np.zeros((0, 3))


def _best_bundle(evidence: Evidence) -> Bundle | None:
    found: list[Bundle] = []
    for direction in _axis_open(evidence):
        found += [b for b in axis_bundle(evidence, direction) if b.excess <= 1.0]
    if not found:
        return None
    limit = _limit([b.excess for b in found])
    return max((b for b in found if b.excess <= limit), key=lambda b: b.fold)


def _round(evidence: Evidence, bundle: Bundle) -> Assembly:
    """Cinfv, or with a mirror across the axis Dinfh, or the sphere."""
    axis, center = bundle.state.frame[2], bundle.state.center
    if evidence.tuples.kind == "vanish":
        tilted = Framed(standard=rotation([1, 0, 0], 1.0)[None], frame=bundle.state.frame, center=center)
        sphere = evidence.judge.excess(evidence.judge.deviation(tilted.motions))
        across = refined(evidence, _plane_state(axis, center), sources=3000, outer=6)[-1].state
        mirror = evidence.judge.excess(evidence.judge.deviation(across.motions))
        if sphere <= max(EXACT, bundle.excess):
            return _finish(evidence, PointGroup(name="Kh"), center, bundle.history, [])
        if mirror <= _limit([bundle.excess, mirror]):
            middle = center + axis * float(axis @ (across.center - center))
            return _finish(evidence, PointGroup(name="Dinfh", frame=bundle.state.frame), middle, bundle.history, [])
    return _finish(evidence, PointGroup(name="Cinfv", frame=bundle.state.frame), center, bundle.history, [])


def _plane_state(normal: Array, point: Array) -> Framed:
    return Framed(standard=np.diag([1.0, 1.0, -1.0])[None], frame=frame_with_z(normal), center=point)


def _from_parts(evidence: Evidence, seeds: Array) -> Assembly:
    planes = mirrors(evidence, seeds)
    limit = _limit([m.excess for m in planes])
    held = [m for m in planes if m.excess <= limit]
    near = [_mirror_element(m) for m in planes if m.excess > limit]
    turns = _turns(evidence, held, limit)
    group, held, turns = _closed(held, turns)
    center = _common_point(held, turns)
    if evidence.tuples.kind == "vanish":
        group = _with_improper(evidence, group, held, turns, center)
    state = _joint(group, center)
    history = refined(evidence, state, sources=max(600, 20000 // len(state.standard))) if state is not None else ()
    if history:
        frame = history[-1].state.frame
        group, center = PointGroup(name=group.name, frame=frame), history[-1].state.center
    done = _finish(evidence, group, center, history, near)
    if done.elements and max(e.excess for e in done.elements) > 1.0 and len(held) + len(turns) > 1:
        return _fallback(evidence, held, near)
    return done


def _fallback(evidence: Evidence, held: list[Mirror], near: list[Element]) -> Assembly:
    """The best mirror alone, where the closure of all that held does not hold itself."""
    if not held:
        return _finish(evidence, PointGroup(name="C1"), np.zeros(3), (), near)
    best = held[0]
    frame = frame_with_z(best.plane.normal)
    group = PointGroup(name="Cs", frame=frame)
    near = [*near, *(_mirror_element(m) for m in held[1:])]
    return _finish(evidence, group, best.plane.offset * best.plane.normal, (), near)


def _turns(evidence: Evidence, held: list[Mirror], limit: float) -> list[Turn]:
    """Rotation axes worth having beside the mirrors: along the n-tuples, or anywhere if they vanish."""
    normals = np.array([m.plane.normal for m in held]).reshape(-1, 3)
    vanish = evidence.tuples.kind == "vanish"
    directions = axis_directions(evidence, normals) if vanish else _axis_open(evidence)
    center = _common_point(held, [])
    found = [t for d in directions if (t := turns_about(evidence, d, center)) is not None]
    best = min([limit / RIVAL, *(t.excess for t in found)])
    return [t for t in found if t.excess <= min(1.0, max(EXACT, RIVAL * best))]


def _closed(held: list[Mirror], turns: list[Turn]) -> tuple[PointGroup, list[Mirror], list[Turn]]:
    """The group the elements generate; the worst are left out until they generate one."""
    held, turns = list(held), list(turns)
    while True:
        try:
            group = from_elements(
                mirrors=[m.plane.normal for m in held],
                axes=[(t.direction, t.order) for t in turns],
                tolerance_rad=DIRECTION_ERROR_RAD,
            )
            return group, held, turns
        except DegenerateShapeError:
            if turns and (not held or max(t.excess for t in turns) >= held[-1].excess):
                turns.remove(max(turns, key=lambda t: t.excess))
            else:
                held.pop()


def _with_improper(
    evidence: Evidence, group: PointGroup, held: list[Mirror], turns: list[Turn], center: Array
) -> PointGroup:
    """The group with inversion and rotoreflections added, where they hold as well as its other elements."""
    limit = _limit([*(m.excess for m in held), *(t.excess for t in turns)]) if held or turns else 1.0
    inversion = group.has_inversion
    if not inversion:
        miss = evidence.judge.excess(evidence.judge.deviation([Isometry.about(center, -np.eye(3))]))
        inversion = miss <= limit
    improper = []
    for direction, order in group.rotation_axes():
        if math.isfinite(order) and order <= 8 and improper_about(evidence, direction, center, int(2 * order)) <= limit:
            improper.append((direction, float(2 * order)))
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


def _common_point(held: list[Mirror], turns: list[Turn]) -> Array:
    """Point nearest to the centroid that lies on all planes and axes, in the sense of least squares."""
    rows = [m.plane.normal for m in held]
    values = [m.plane.offset for m in held]
    for t in turns:
        p = frame_with_z(t.direction)[:2]
        rows += list(p)
        values += list(p @ t.point)
    if not rows:
        return np.zeros(3)
    return np.linalg.lstsq(np.array(rows), np.array(values), rcond=1e-3)[0]


def _joint(group: PointGroup, center: Array) -> Framed | None:
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


def _finish(
    evidence: Evidence, group: PointGroup, center: Array, history: tuple[Iterate, ...], near: list[Element]
) -> Assembly:
    elements = tuple(sorted(_elements(evidence, group, center), key=lambda e: (-e.order, e.excess)))
    own = [e.direction for e in elements if e.kind == "plane"]
    rejected = [e for e in near if all(abs(e.direction @ n) < np.cos(np.radians(3.0)) for n in own)]
    return Assembly(
        group=group,
        center=center,
        elements=elements,
        rejected=tuple(sorted(rejected, key=lambda e: e.excess)),
        history=history,
    )


def _elements(evidence: Evidence, group: PointGroup, center: Array) -> list[Element]:
    """Every discrete mirror, every axis and rotoreflection axis of the group, judged."""
    found = []
    lone = {"Cinfv": 0, "Kh": 0}.get(group.name)
    normals = group.mirrors() if lone is None else []
    if group.name == "Dinfh":
        normals = [n for n in normals if abs(n @ group.frame[2]) > 0.9]
    for normal in normals:
        found.append(_judged(evidence, "plane", normal, center, 1.0, [householder(normal)]))
    for direction, order in _listed_axes(group):
        angles = 2 * np.pi / order if math.isfinite(order) else np.array([0.517, 1.234, 2.6833])
        turns = [rotation(direction, float(a)) for a in np.atleast_1d(angles)]
        found.append(_judged(evidence, "axis", direction, center, order, turns))
    if group.is_finite:
        for direction, order in group.improper_axes():
            turn = rotoreflection(direction, 2 * np.pi / order)
            found.append(_judged(evidence, "improper", direction, center, order, [turn]))
    return found


def _listed_axes(group: PointGroup) -> list[tuple[Array, float]]:
    """Discrete axes, and the continuous one; a sphere or a cylinder's endless family is left to the group's name."""
    if group.is_finite:
        return group.rotation_axes()
    return [(u, k) for u, k in group.rotation_axes() if math.isinf(k)][:1]


def _judged(evidence: Evidence, kind: str, direction: Array, center: Array, order: float, matrices: list[Array]) -> Element:
    motions = [Isometry.about(center, m) for m in matrices]
    deviation = evidence.judge.deviation(motions)
    excess = evidence.judge.excess(deviation)
    return Element(kind=kind, direction=direction, point=center, order=order, deviation=deviation, excess=excess)


def _mirror_element(m: Mirror) -> Element:
    return Element(
        kind="plane",
        direction=m.plane.normal,
        point=m.plane.offset * m.plane.normal,
        order=1.0,
        deviation=m.deviation,
        excess=m.excess,
    )


def _near(evidence: Evidence, group: PointGroup, planes: list[Mirror]) -> list[Element]:
    return [_mirror_element(m) for m in planes]


def shifted(plane: Plane, by: Array) -> Plane:
    """The plane after a translation."""
    return replace(plane, offset=plane.offset + float(plane.normal @ by))
