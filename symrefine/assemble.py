"""From judged candidates to one group: what holds is closed under multiplication, refined as a frame, judged again.

The n-tuples decide where to look. Every one lies in the subspace that the group fixes, so three independent ones leave
no symmetry but the identity, two a mirror, one an axis; only where all vanish is every direction open.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from symrefine.acceptance import EXACT, Standard, compromise, standard_of
from symrefine.axis import fold_energy
from symrefine.elements import Element, elements_of, mirror_element
from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array, Isometry, Plane, frame_with_z, householder, rotation, rotoreflection, unit
from symrefine.groups import PointGroup, from_elements
from symrefine.lone import keeps, lone_part
from symrefine.refine import Framed, Iterate
from symrefine.search import (
    Bundle,
    Evidence,
    Mirror,
    Turn,
    axis_bundle,
    axis_directions,
    closer_core,
    improper_about,
    mirrors,
    refined_closely,
    refined_if_promising,
    turns_about,
)
from symrefine.shape import Index
from symrefine.verify import Verdict

# Directions of elements are known to this before the joint refinement.
DIRECTION_ERROR_RAD = math.radians(1.5)
KNOWN_RAD = math.radians(4.0)
# Directions closer than this are the same start for an axis, which is then polished.
APART_RAD = math.radians(1.0)
MAX_OPERATIONS = 9
# An object is called round only if it misses by less than this share of the limits; a nut with its eight sides is not.
ROUND_LIMIT = 0.5
# Miss with the details from which on it is asked whether one part alone is to blame.
SUSPECT = 0.4
# How often at most: every time the group gets smaller, but improper elements may come back.
MAX_BLAMES = 4
# Azimuthal energy over its noise from which on a high order shows.
SEEN = 12.0
# Orders from which on a finite axis has to be better than a continuous one, and by what factor.
CHANCE_FOLD = 5
AS_GOOD = 1.5
# How many candidates are looked at for the list of near misses once the group is known.
NEAR = 4
NOTHING = np.zeros((0, 3))
NO_PART = np.zeros(0, dtype=np.int64)


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
    if bundle is None:
        return _from_parts(evidence)
    if math.isinf(bundle.fold):
        return _round(evidence, bundle)
    group = PointGroup(name=f"C{int(bundle.fold)}v", frame=bundle.state.frame)
    others = list(mirrors(evidence, NOTHING, count=NEAR, known=_mirror_of(group), thorough=False))
    if any(standard_of([bundle.verdict]).admits(m.verdict) for m in others):
        # A mirror beside the bundle: the axis the n-tuples claimed by chance is not all there is.
        return assemble(replace(evidence, tuples=replace(evidence.tuples, kind="vanish")))
    near = [mirror_element(m) for m in others]
    done = _finish(evidence, group, bundle.state.center, bundle.history, near)
    standard = standard_of(e.verdict for e in done.elements)
    # Some of its mirrors may be exact and the others broken by a detail: then each is asked for by itself.
    good = all(standard.admits(e.verdict) for e in done.elements) and not len(_lone_part(evidence, done))
    return done if good else _from_parts(evidence)


def _axis_open(evidence: Evidence) -> Array:
    """Directions that the n-tuples leave open for an axis: anywhere the spectrum says, near one line, or none."""
    tuples = evidence.tuples
    if tuples.kind == "vanish":
        return axis_directions(evidence)
    if tuples.kind != "axis" and tuples.significance[1] > 0.2 * tuples.significance[0]:
        return NOTHING
    along = tuples.directions[0]
    cone = math.radians(15.0) + 2.0 / tuples.significance[0]
    return np.stack([along, *(d for d in axis_directions(evidence) if abs(d @ along) > math.cos(min(cone, 1.0)))])


def _best_bundle(evidence: Evidence) -> Bundle | None:
    """Revolution about any open direction, or all the mirrors through the axis of the n-tuples."""
    vanish = evidence.tuples.kind == "vanish"
    directions = np.linalg.eigh(evidence.moments.covariance)[1].T if vanish else _axis_open(evidence)
    found: list[Bundle] = []
    for direction in _apart(directions, APART_RAD):
        bundles = axis_bundle(evidence, direction, mirrored=not vanish)
        found += [b for b in bundles if b.verdict.excess <= (ROUND_LIMIT if math.isinf(b.fold) else 1.0)]
        if any(b.verdict.bulk <= EXACT for b in found):
            break
    standard = replace(standard_of(b.verdict for b in found), bulk=EXACT)
    return max((b for b in found if standard.admits(b.verdict)), key=lambda b: b.fold, default=None)


def _round(evidence: Evidence, bundle: Bundle) -> Assembly:
    """Cinfv, or with a mirror across the axis Dinfh, or the sphere."""
    axis, center = bundle.state.frame[2], bundle.state.center
    name = "Cinfv"
    # Asked whatever the n-tuples say: by chance those of a sphere may seem to have a direction.
    tilted = refined_if_promising(evidence, _tilted(bundle.state), sources=1500, outer=4)
    across = refined_if_promising(evidence, _plane_state(axis, center), sources=3000, outer=6)
    if tilted is not None and evidence.judge(tilted.motions).excess <= max(EXACT, bundle.verdict.excess):
        name, center = "Kh", tilted.center
    elif across is not None:
        mirror = evidence.judge(across.motions)
        if standard_of([bundle.verdict, mirror]).admits(mirror):
            name, center = "Dinfh", center + axis * float(axis @ (across.center - center))
    return _finish(evidence, PointGroup(name=name, frame=bundle.state.frame), center, bundle.history, [])


def _tilted(state: Framed) -> Framed:
    """Turns about two axes across the frame's third, which only a sphere survives; they show where its centre is."""
    turns = np.stack([rotation([1, 0, 0], 1.0), rotation([0, 1, 0], 1.7)])
    return Framed(standard=turns, frame=state.frame, center=state.center)


def _plane_state(normal: Array, point: Array) -> Framed:
    return Framed(standard=np.diag([1.0, 1.0, -1.0])[None], frame=frame_with_z(normal), center=point)


def _from_parts(evidence: Evidence) -> Assembly:
    """Mirrors one by one, skipping those that the group so far implies; then axes; then inversion and the improper."""
    held, near, group = _mirror_group(evidence)
    turns = _turns(evidence, held, group)
    part: Index = NO_PART
    blames = 0
    while True:
        group, held, turns = _closed(held, turns)
        done = _group_of(evidence, group, held, turns, near, part)
        if blames < MAX_BLAMES and len(out := _lone_part(evidence, done)):
            blames += 1
            kept = [e for e in done.elements if keeps(evidence, e.motions, out)]
            less = _closed(*_as_candidates(kept))
            if less[0].order < done.group.order:
                near.extend(e for e in done.elements if e.kind == "plane" and e not in kept)
                _, held, turns = less
                part = out
                continue
        good = all(e.verdict.excess <= 1.0 for e in done.elements) and _fold_is_seen(evidence, done.group)
        if good or not (held or turns):
            return _unless_round(evidence, done)
        near.extend(mirror_element(m) for m in _without_worst(held, turns))


def _lone_part(evidence: Evidence, found: Assembly) -> Index:
    """The part that is to blame alone for what the group misses, if there is one and some elements do not keep it."""
    if max((e.verdict.detail for e in found.elements), default=0.0) < SUSPECT:
        return NO_PART
    part = lone_part(evidence, found.group, found.center)
    return part if any(not keeps(evidence, e.motions, part) for e in found.elements) else NO_PART


def _as_candidates(elements: Iterable[Element]) -> tuple[list[Mirror], list[Turn]]:
    """Elements of a group as candidates for another one."""
    mirrors_kept, turns_kept = [], []
    for e in elements:
        if e.kind == "plane":
            plane = Plane(normal=e.direction, offset=float(e.direction @ e.point))
            mirrors_kept.append(Mirror(plane=plane, verdict=e.verdict))
        elif e.kind == "axis":
            turns_kept.append(Turn(point=e.point, direction=e.direction, order=e.order, verdict=e.verdict))
    return mirrors_kept, turns_kept


def _fold_is_seen(evidence: Evidence, group: PointGroup) -> bool:
    """Whether the surface shows the order of the main axis about it: nearly round, it has mirrors at any angle."""
    main = [(u, int(k)) for u, k in group.rotation_axes()[:1] if CHANCE_FOLD < k < math.inf]
    if evidence.judge.cloud.isolated:
        return True
    return all(fold_energy(evidence.points, evidence.weights, u, k) > SEEN for u, k in main)


def _unless_round(evidence: Evidence, found: Assembly) -> Assembly:
    """A high order about an axis that any turn keeps as well is chance: on a round object every mirror holds."""
    main = [u for u, k in found.group.rotation_axes()[:1] if k >= CHANCE_FOLD]
    for bundle in (b for u in main for b in axis_bundle(evidence, u, mirrored=False)):
        worst = max((e.verdict.bulk for e in found.elements), default=0.0)
        if Standard(bulk=max(EXACT, AS_GOOD * worst)).admits(bundle.verdict):
            return _round(evidence, bundle)
    return found


def _group_of(
    evidence: Evidence, group: PointGroup, held: list[Mirror], turns: list[Turn], near: list[Element], part: Index
) -> Assembly:
    """The group with what it may have of improper elements, refined as one frame and judged."""
    center = _common_point(held, turns)
    if evidence.tuples.kind == "vanish":
        verdicts = [*(m.verdict for m in held), *(t.verdict for t in turns)]
        group = _with_improper(evidence, group, verdicts, center, part)
    start = _joint(group, center)
    if start is None:
        return _finish(evidence, group, center, (), near)
    history = refined_closely(evidence, start, sources=max(500, 12000 // len(start.standard)))
    state = history[-1].state
    done = _finish(evidence, PointGroup(name=group.name, frame=state.frame), state.center, history, near)
    if all(e.verdict.excess <= 1.0 for e in done.elements):
        return done
    # Where the symmetry is only approximate, the closest fit of most points can be worse for the rest.
    unrefined = _finish(evidence, group, center, history[:1], near)
    cores = (max((e.verdict for e in d.elements), key=lambda v: v.core) for d in (done, unrefined))
    return done if closer_core(*cores) else unrefined


def _without_worst(held: list[Mirror], turns: list[Turn]) -> list[Mirror]:
    """Take the least convincing element out of the lists; a mirror so taken is returned."""
    everything: list[Mirror | Turn] = [*held, *turns]
    worst = max(everything, key=lambda e: e.verdict.bulk)
    if isinstance(worst, Turn):
        turns.remove(worst)
        return []
    held.remove(worst)
    return [worst]


def _mirror_group(evidence: Evidence) -> tuple[list[Mirror], list[Element], PointGroup]:
    held: list[Mirror] = []
    near: list[Mirror] = []
    group = PointGroup(name="C1")

    def known(normal: Array) -> bool:
        return _mirror_of(group)(normal)

    few = evidence.tuples.kind != "vanish"
    for mirror in mirrors(evidence, evidence.tuples.directions[2:], known=known):
        if mirror.verdict.excess > 1.0:
            near.append(mirror)
            near += [m for m in held if compromise(m, mirror)]
            group, held, _ = _closed([m for m in held if not compromise(m, mirror)], [])
        elif any(compromise(mirror, m) for m in near):
            near.append(mirror)
        else:
            held.append(mirror)
            standard = standard_of(m.verdict for m in held)
            near += [m for m in held if not standard.admits(m.verdict)]
            group, held, _ = _closed([m for m in held if standard.admits(m.verdict)], [])
        if few and held and len(near) >= NEAR:
            break
    return held, [mirror_element(m) for m in near], group


def _mirror_of(group: PointGroup) -> Callable[[Array], bool]:
    """Whether a direction is, within a few degrees, the normal of one of the group's mirrors."""
    normals = group.mirrors()

    def known(normal: Array) -> bool:
        return bool(len(normals)) and bool(np.abs(normals @ normal).max() > np.cos(KNOWN_RAD))

    return known


def _turns(evidence: Evidence, held: list[Mirror], group: PointGroup) -> list[Turn]:
    """Rotation axes worth having beside the mirrors: those the n-tuples leave open, or a higher order of the main axis.

    Two mirrors or more imply their axes; then only the main one can be of a higher order than the mirrors show. Beside
    one mirror alone an axis can only stand across it, where all n-tuples vanish. No finite group holds Oh or Ih.
    """
    if group.name in ("Oh", "Ih"):
        return []
    center = _common_point(held, [])
    if len(held) > 1:
        directions = np.array([u for u, _ in group.rotation_axes()[:1]]).reshape(-1, 3)
        if group.name == "D2h":
            # The one group whose mirrors do not imply all its axes: Th has the same three.
            directions = np.concatenate([directions, unit(group.frame.sum(axis=0))[None]])
    elif held and evidence.tuples.kind != "vanish":
        return []
    else:
        normals = [m.plane.normal for m in held]
        offered = _axis_open(evidence) if held or evidence.tuples.kind == "vanish" else axis_directions(evidence)
        directions = np.concatenate([np.array(normals).reshape(-1, 3), evidence.tuples.directions[:1], offered])
    found = [t for d in _apart(directions, KNOWN_RAD) if (t := turns_about(evidence, d, center)) is not None]
    standard = standard_of([*(m.verdict for m in held), *(t.verdict for t in found)])
    return [t for t in found if standard.admits(t.verdict)]


def _apart(directions: Array, angle_rad: float) -> list[Array]:
    """The directions without those within an angle of an earlier one."""
    kept: list[Array] = []
    for d in directions:
        if all(abs(d @ k) < np.cos(angle_rad) for k in kept):
            kept.append(d)
    return kept


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
            _without_worst(held, turns)


def _with_improper(
    evidence: Evidence, group: PointGroup, verdicts: list[Verdict], center: Array, part: Index
) -> PointGroup:
    """The group with the inversion, or the rotoreflection of its main axis, where they hold as well as the rest and
    keep the part that others are blamed for."""
    standard = standard_of(verdicts)

    def admitted(direction: Array, order: int) -> bool:
        motion = Isometry.about(center, rotoreflection(direction, 2.0 * np.pi / order))
        return standard.admits(improper_about(evidence, direction, center, order)) and keeps(evidence, [motion], part)

    axes = [(u, int(2 * k)) for u, k in group.rotation_axes()[:1] if k <= 12]
    improper = [(u, k) for u, k in axes if admitted(u, k)] if not _has_all(group) else []
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


def _has_all(group: PointGroup) -> bool:
    """Whether the main axis carries a rotoreflection already."""
    return bool(group.improper_axes())


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
    # Normals are known to a degree or so: what little they leave their common plane by is no third condition.
    return np.linalg.lstsq(np.array(rows), np.array(values), rcond=0.1)[0]


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
    elements = elements_of(evidence, group, center)
    own = [e.direction for e in elements if e.kind == "plane"]
    rejected = [e for e in near if all(abs(e.direction @ n) < np.cos(np.radians(3.0)) for n in own)]
    return Assembly(
        group=group,
        center=center,
        elements=elements,
        rejected=tuple(sorted(rejected, key=lambda e: e.verdict.excess)),
        history=history,
    )
