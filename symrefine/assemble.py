"""From judged candidates to one group: what holds is closed under multiplication, refined as a frame, judged again.

The n-tuples decide where to look. Every one lies in the subspace that the group fixes, so three independent ones leave
no symmetry but the identity, two a mirror, one an axis; only where all vanish is every direction open.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from symrefine.acceptance import EXACT, Standard, standard_of
from symrefine.closure import (
    NEAR,
    Generators,
    apart,
    axis_open,
    joint,
    mirror_group,
    mirror_of,
    with_improper,
    with_turns,
)
from symrefine.elements import Element, elements_of, mirror_element
from symrefine.fit.refine import Framed, Iterate
from symrefine.geometry import Array, Isometry, frame_with_z, householder, rotation, rotoreflection
from symrefine.groups import PointGroup
from symrefine.lone import keeps, lone_part
from symrefine.propose.folds import fold_energy
from symrefine.search import (
    LOOK,
    Bundle,
    Evidence,
    axis_bundle,
    closer_core,
    mirrors,
    refined_closely,
    refined_if_promising,
)
from symrefine.shape import Index
from symrefine.surface.misses import Verdict

# Directions closer than this are the same start for an axis, which is then polished.
APART_RAD = math.radians(1.0)
# An object is called round only if it misses by less than this share of the limits; a nut with its eight sides is not.
ROUND_LIMIT = 0.5
# Miss with the details from which on it is asked whether one part alone is to blame.
SUSPECT = 0.4
# How often at most: every time the group gets smaller, but improper elements may come back.
MAX_BLAMES = 4
# Azimuthal energy over its noise from which on a high order shows.
SEEN = 12.0
# Orders from which on a finite axis has to be better than a continuous one, and by what factor. Of a volume the thin
# outside shows any order by chance.
CHANCE_FOLD = 5
CHANCE_FOLD_VOLUME = 2
AS_GOOD = 1.5
NO_PART = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assembly:
    """The group placed in space (normalised units), its elements with their misses, and what was turned down.

    `history` is the refinement of all elements together; `before` counts the outer iterations of the one that took most
    where they were first found one by one.
    """

    group: PointGroup
    center: Array
    elements: tuple[Element, ...]
    rejected: tuple[Element, ...]
    history: tuple[Iterate, ...]
    before: int = 0


def assemble(evidence: Evidence) -> Assembly:
    """The largest group that holds, from the axis of the n-tuples where they have one, from the spectrum elsewhere."""
    bundle = _best_bundle(evidence)
    if bundle is None:
        return _from_parts(evidence)
    if math.isinf(bundle.fold):
        return _round(evidence, bundle)
    group = PointGroup(name=f"C{int(bundle.fold)}v", frame=bundle.state.frame)
    others = list(mirrors(evidence, np.zeros((0, 3)), count=NEAR, known=mirror_of(group), thorough=False))
    beside = [*(m.verdict for m in others), *_across(evidence, bundle)]
    if any(standard_of([bundle.verdict]).admits(v) for v in beside):
        # Something beside the bundle: the axis the n-tuples claimed by chance is not all there is.
        return assemble(replace(evidence, tuples=replace(evidence.tuples, kind="vanish")))
    near = [mirror_element(m) for m in others]
    done = _finish(evidence, group, bundle.state.center, bundle.history, near)
    standard = standard_of(e.verdict for e in done.elements)
    # Some of its mirrors may be exact and the others broken by a detail: then each is asked for by itself.
    good = all(standard.admits(e.verdict) for e in done.elements) and not len(_lone_part(evidence, done))
    return done if good else _from_parts(evidence)


def _across(evidence: Evidence, bundle: Bundle) -> Iterator[Verdict]:
    """A first look at what may turn the axis of finite C_bv over: the mirror across it, and S_2b, of D_bh and D_bd."""
    axis = bundle.state.frame[2]
    for matrix in (householder(axis), rotoreflection(axis, math.pi / bundle.fold)):
        yield evidence.judge([Isometry.about(bundle.state.center, matrix)], stride=evidence.stride(LOOK))


def _best_bundle(evidence: Evidence) -> Bundle | None:
    """Revolution about any open direction, or all the mirrors through the axis of the n-tuples."""
    vanish = evidence.tuples.kind == "vanish"
    directions = np.linalg.eigh(evidence.moments.covariance)[1].T if vanish else axis_open(evidence)
    found: list[Bundle] = []
    for direction in apart(directions, APART_RAD):
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
    # The thin outside of a volume misses every turn by chance, one a little more than another.
    slack = AS_GOOD if evidence.judge.cloud.body == "volume" else 1.0
    if tilted is not None and evidence.judge(tilted.motions).excess <= max(EXACT, slack * bundle.verdict.excess):
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
    mirrors_held, near, group = mirror_group(evidence)
    held = with_turns(evidence, mirrors_held, group)
    before = max((e.iterations for e in held.all), default=0)
    part: Index = NO_PART
    blames = 0
    while True:
        group, held = held.closed()
        done = _group_of(evidence, group, held, near, part)
        if blames < MAX_BLAMES and len(out := _lone_part(evidence, done)):
            blames += 1
            kept = [e for e in done.elements if keeps(evidence, e.motions, out)]
            smaller, less = Generators.of(kept).closed()
            if smaller.order < done.group.order:
                near.extend(e for e in done.elements if e.kind == "plane" and e not in kept)
                held, part = less, out
                continue
        good = all(e.verdict.excess <= 1.0 for e in done.elements) and _fold_is_seen(evidence, done.group)
        if good or not held:
            return replace(_unless_round(evidence, done), before=before)
        held, dropped = held.without_worst()
        near.extend(mirror_element(m) for m in dropped)


def _lone_part(evidence: Evidence, found: Assembly) -> Index:
    """The part that is to blame alone for what the group misses, if there is one and some elements do not keep it."""
    if max((e.verdict.detail for e in found.elements), default=0.0) < SUSPECT:
        return NO_PART
    part = lone_part(evidence, found.group, found.center)
    return part if any(not keeps(evidence, e.motions, part) for e in found.elements) else NO_PART


def _fold_is_seen(evidence: Evidence, group: PointGroup) -> bool:
    """Whether the surface shows the order of the main axis about it: nearly round, it has mirrors at any angle."""
    main = [(u, int(k)) for u, k in group.rotation_axes()[:1] if CHANCE_FOLD < k < math.inf]
    if evidence.judge.cloud.isolated:
        return True
    return all(fold_energy(evidence.points, evidence.weights, u, k) > SEEN for u, k in main)


def _unless_round(evidence: Evidence, found: Assembly) -> Assembly:
    """A high order about an axis that any turn keeps as well is chance: on a round object every mirror holds."""
    least = CHANCE_FOLD_VOLUME if evidence.judge.cloud.body == "volume" else CHANCE_FOLD
    main = [u for u, k in found.group.rotation_axes()[:1] if k >= least]
    for bundle in (b for u in main for b in axis_bundle(evidence, u, mirrored=False)):
        worst = max((e.verdict.bulk for e in found.elements), default=0.0)
        if Standard(bulk=max(EXACT, AS_GOOD * worst)).admits(bundle.verdict):
            return _round(evidence, bundle)
    return found


def _group_of(evidence: Evidence, group: PointGroup, held: Generators, near: list[Element], part: Index) -> Assembly:
    """The group with what it may have of improper elements, refined as one frame and judged."""
    center = held.common_point
    if evidence.tuples.kind == "vanish":
        group = with_improper(evidence, group, [e.verdict for e in held.all], center, part)
    start = joint(group, center)
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
