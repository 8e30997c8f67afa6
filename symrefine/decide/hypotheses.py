"""Hypotheses: closed groups placed in space, each fitted as a whole and judged element by element.

All operations are judged on the same local planes: what each needs to be forgiven, as a fraction of the diagonal, is
the table that everything else reads.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from symrefine.decide.looks import COARSE, Look, exact_need, least_around, mended, seems, slid
from symrefine.decide.place import is_told, least_elsewhere, nowhere, told_apart
from symrefine.decide.posterior import certain, lenience
from symrefine.fit.placed import FITTED, Operations, Placed, elements
from symrefine.fit.refine import SHORT, Iterate, refine
from symrefine.geometry import Array, Axis, Isometry, frame_with_z, rotation
from symrefine.groups import PointGroup, is_subgroup
from symrefine.propose.folds import azimuthal_spectrum, folds_of
from symrefine.rounding import START_ERROR
from symrefine.samples import COUNT, GLANCE, LOOK
from symrefine.surface.misses import Deviation
from symrefine.surface.skin import Skin
from symrefine.surface.surface import Coverage, Surface
from symrefine.surface.wedge import Wedge

# Local planes that are moved in a fit and when judged by all together, and when judged by each at least: 0.6 % of fewer
# are no sample.
MOVED, MOVED_EACH = 12000, 1200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Element:
    """One element of a group about a centre, with its miss, the smallest tolerance at which it holds, and coverage."""

    operations: Operations
    center: Array
    deviation: Deviation
    need: float
    coverage: Coverage

    @property
    def motions(self) -> tuple[Isometry, ...]:
        """Its operations where it stands."""
        return self.operations.motions(self.center)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A group where it fits best: its elements judged, and what the worst of them needs.

    `history` holds the iterates of the fit; `before` counts those of the parts that it was put together from. `seen` is
    what it needs by what was seen alone, without belief in the rest, which denies nothing either; `believed` is the
    part, in squares, of what it needs that is belief. `rivals` are those that may be meant as well as it, and
    instead of it. Of atoms, `apart` says how likely they have it by more than standing densely. Where cameras are
    known, `told` says whether what they saw of its elements makes up the group, and `elsewhere` what it needs at least
    where it does not stand, or that it needs so little that it may stand there. What is `proven` holds by what was not
    measured.
    """

    placed: Placed
    elements: tuple[Element, ...]
    need: float
    history: tuple[Iterate, ...] = ()
    before: int = 0
    seen: float = 0.0
    believed: float = 0.0
    rivals: tuple[Placed, ...] = ()
    told: bool = True
    elsewhere: float = math.inf
    apart: float = 1.0
    proven: bool = False

    @property
    def supported(self) -> float:
        """Share of the surface that moves and meets itself under the element that says least.

        Of a continuous axis by the turn that says most, as each of them, over and over, makes all others.
        """
        shares = (e.coverage.told if math.isinf(e.operations.order) else e.coverage.supported for e in self.elements)
        return min(shares, default=1.0)

    @property
    def share(self) -> float:
        """How likely it is this one that is meant, if one of its name is, and none of its rivals."""
        return 1.0 / (1.0 + self._namesakes)

    @property
    def named(self) -> float:
        """How likely it is one of its name that is meant, and none of its rivals of another."""
        return (1.0 + self._namesakes) / (1.0 + len(self.rivals))

    @property
    def _namesakes(self) -> int:
        return sum(r.group.name == self.group.name for r in self.rivals)

    @property
    def group(self) -> PointGroup:
        """The group, where it stands."""
        return self.placed.group

    @property
    def iterations(self) -> int:
        """Outer iterations it took in all."""
        return self.before + max(0, len(self.history) - 1)

    def holds(self, other: Placed) -> bool:
        """Whether it has all operations of another group; see `has_all`."""
        return has_all(self.placed, other)


def has_all(placed: Placed, other: Placed, within_rad: float = START_ERROR) -> bool:
    """Whether a group has all operations of another one, as far as directions tell that may be so far apart."""
    # By a quarter of a turn of the other's own, lest turns of many folds pass for those of fewer.
    fold = other.group.symbol.fold
    turn = 2.0 * math.pi / fold if 0 < fold < math.inf else math.inf
    return is_subgroup(other.group, placed.group, min(2.0 * within_rad, 0.25 * turn))


NOTHING = Hypothesis(placed=Placed(group=PointGroup(name="C1"), center=np.zeros(3)), elements=(), need=0.0)


def fitted(
    surface: Surface,
    start: Placed,
    *,
    error_rad: float = START_ERROR,
    before: int = 0,
    most: float = math.inf,
    close: float = math.inf,
) -> Hypothesis:
    """The group fitted as a whole from where it stands, which may be off by `error_rad`, and judged.

    It may stay where it stands if the fit does not settle, or if the surface is open: what lies behind its borders is
    matched with what does not. There it is moved sideways, too, to where edges say that it belongs. One that wherever
    it may stand seems to need more than `close` is judged by few points, one that needs far more than `most` in one
    place only; where no start leads to as little, no elements are told, and the fit ends after `SHORT` steps.
    """
    state, hopeless = start.framed(), max(most, mended(surface))
    stride = surface.stride(_moved_each(len(state.standard), GLANCE), matched=True)
    asked, steps = seems(surface, start) if surface.is_open else 0.0, list[Iterate]()
    for iterate in refine(surface.cloud, state, start_error_rad=error_rad, stride=stride):
        steps.append(iterate)
        short = asked > hopeless and iterate.index == SHORT
        if short and (needs := seems(surface, start.moved(iterate.state))) > hopeless:
            return Hypothesis(placed=start, elements=(), need=min(asked, needs), before=before)
    history, end = tuple(steps), start.moved(steps[-1].state)
    # What leaves no doubt by what was seen leaves no less elsewhere; of a view it tells where it stands.
    clear = exact_need(surface.floor) if surface.viewed else max(exact_need(surface.floor), doubtless(surface))
    if not surface.is_open and history[-1].converged:
        found = _placed(surface, end, history, before)
        if found.need <= clear:
            return found
        other = _placed(surface, least_around(surface, start, history, LOOK), history, before)
        return min(found, other, key=lambda h: h.need)
    asked = asked if surface.is_open else seems(surface, start)
    every = [(seems(surface, end), end, history), (asked, start, history[:1])]
    needs, first, history = min(every, key=lambda k: k[0])
    best, least = slid(surface, first, needs, close) if needs > close else (first, needs)
    if least > hopeless:
        found = Hypothesis(placed=best, elements=(), need=least, history=history, before=before)
    elif least > close:
        found = _placed(surface, best, history, before, GLANCE)
    else:
        found = _placed(surface, best, history, before)
        if clear < found.seen and found.need <= COARSE * most:
            found = _moved(surface, found, every, was_slid=best is not first)
    if not surface.viewed or not found.elements:
        return found
    if not is_told(found.placed, [(e.operations, e.coverage.supported) for e in found.elements]):
        return replace(found, told=False)
    return replace(found, elsewhere=least_elsewhere(surface, found.placed, nowhere(surface)))


def doubtless(surface: Surface) -> float:
    """The need that leaves no doubt worth telling at the tolerance asked for, in the noise that there is."""
    return certain(surface.tolerance, surface.floor / surface.tolerance)


def hidden_need(surface: Surface) -> float:
    """The need up to which noise tells no two groups apart, and none is doubted for it."""
    return min(exact_need(surface.floor), doubtless(surface))


def _moved(
    surface: Surface,
    found: Hypothesis,
    others: Sequence[tuple[float, Placed, tuple[Iterate, ...]]],
    *,
    was_slid: bool,
) -> Hypothesis:
    """A group that was judged where it needs least: there, where else it may stand, or moved sideways unless it was."""

    def better(placed: Placed, history: tuple[Iterate, ...]) -> Hypothesis:
        return min(found, _placed(surface, placed, history, found.before), key=lambda h: h.need)

    for needs, placed, history in others:
        if placed is not found.placed and needs < found.seen:
            found = better(placed, history)
    aside = found.placed if was_slid else slid(surface, found.placed, found.seen)[0]
    return found if aside is found.placed else better(aside, found.history)


def judged(surface: Surface, placed: Placed) -> Hypothesis:
    """A group judged where it stands."""
    return _placed(surface, placed, (), 0)


def seen_to_end(surface: Surface, found: Hypothesis) -> float:
    """What an open surface needs to have a group by what was seen, and by where it ends if it has the group."""
    parts = _Parts.of(found.placed, MOVED_EACH, 0)
    return _seen_judged(surface, parts, *_met(surface, parts), found.placed.motions())[1]


def roughly_judged(surface: Surface, look: Look, *, before: int = 0) -> Hypothesis:
    """A group judged where a look put it, by as few points of each element as a fit moves."""
    return _placed(surface, look.placed, look.history, before, GLANCE)


def _placed(
    surface: Surface, placed: Placed, history: tuple[Iterate, ...], before: int, least: int = MOVED_EACH
) -> Hypothesis:
    """A group judged where a fit put it, by so many points of each element at least."""
    # What holds of a turn need not hold of its powers where the rest was not seen.
    parts = _Parts.of(placed, least, FITTED if surface.viewed else 0)
    misses, drifts = _met(surface, parts)
    if surface.viewed:  # cameras tell what nobody saw of it
        found, need, believed = _seen_judged(surface, parts, misses, drifts)
    else:
        found, need = _judged(surface, parts, misses, drifts)
        believed = 0.0
    seen = need
    # What holds without it asks for no belief in anything unseen.
    if surface.openings is not None and not surface.viewed and need > exact_need(surface.floor):
        partly, seen, belief = _seen_judged(surface, parts, misses, drifts)
        if math.hypot(seen, belief) < need:
            found, need, believed = partly, math.hypot(seen, belief), belief
    if least == MOVED_EACH:
        found, closely = _closely_judged(surface, found, need)
        if closely > need:  # a wedge shows what was seen, too
            need, seen, believed = closely, max(seen, closely), 0.0
    return Hypothesis(
        placed=placed,
        elements=found,
        need=need,
        history=history,
        before=before,
        seen=seen,
        believed=believed,
        apart=1.0 if placed.group.is_finite else told_apart(surface, placed, need),
    )


def _closely_judged(surface: Surface, found: tuple[Element, ...], need: float) -> tuple[tuple[Element, ...], float]:
    """The elements of a group that seems to hold, and what it needs, by what one wedge about an axis tells of them.

    There it shows which way details lean that are finer than neighbourhoods, and, of what seems round, teeth.
    """
    if surface.skin is None or need > surface.tolerance:
        return found, need
    turns = [e for e in found if e.operations.kind == "axis"]
    highest = max((e.operations.order for e in turns), default=0.0)
    for axis in (e for e in turns if e.operations.order == highest):
        about = Axis(direction=axis.operations.direction, point=axis.center)
        fold = _fold(surface.skin, about)
        if fold and (len(found) > 1 or math.isinf(highest)) and not surface.looked_about(about, fold):
            # Turns alone tell their axis best: judged, the surface is folded about where they are fitted.
            start = PointGroup(name=f"C{fold}", frame=frame_with_z(about.direction))
            fitted(surface, Placed(group=start, center=about.point))
        exact = axis.need <= exact_need(surface.floor) and math.isfinite(highest)
        surface.look_about(about, fold or (int(highest) if exact else 0))
    hidden = exact_need(surface.floor)  # noise puts the fit itself so far off
    for wedge in surface.wedges if found else ():
        each = [_telling(e, wedge) for e in found]
        told = wedge.needs(
            [m for motions in each for m in motions], surface.diagonal, open_=surface.openings is not None
        )
        ends = np.cumsum([len(motions) for motions in each])
        told[told <= hidden] = 0.0
        own = [float(part.max()) for part in np.split(told, ends[:-1])]
        found = tuple(replace(e, need=max(e.need, n)) for e, n in zip(found, own, strict=True))
        need = max(need, *own)
    return found, need


def _telling(element: Element, wedge: Wedge) -> tuple[Isometry, ...]:
    """The operations that tell of an element; of what is round about the axis of a wedge, one that swaps its halves."""
    if math.isfinite(element.operations.order):
        return element.motions
    return (Isometry.about(element.center, rotation(element.operations.direction, 0.5 * wedge.pitch)),)


def _fold(skin: Skin, axis: Axis) -> int:
    """How often a surface repeats about an axis, as the azimuths of its points tell; 0 if they do not."""
    points = skin.points - axis.point
    told = folds_of(azimuthal_spectrum(points, np.ones(len(points)), axis.direction), axis.direction)
    return told[0].fold if told else 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Parts:
    """The elements of a group where it stands, with the operations that stand for them in one row.

    `rows` are those of each element; `sources` is how many local planes each of them moves.
    """

    placed: Placed
    operations: tuple[Operations, ...]
    motions: tuple[Isometry, ...]
    rows: tuple[slice, ...]
    sources: int

    @classmethod
    def of(cls, placed: Placed, least: int, powers: int) -> "_Parts":
        operations = elements(placed.group, powers=powers)
        each = [part.motions(placed.center) for part in operations]
        ends = np.cumsum([0, *map(len, each)]).tolist()
        return cls(
            placed=placed,
            operations=tuple(operations),
            motions=tuple(motion for motions in each for motion in motions),
            rows=tuple(slice(*pair) for pair in pairwise(ends)),
            sources=_moved_each(len(operations), least),
        )


def _met(surface: Surface, parts: _Parts) -> tuple[Array, Array]:
    """How far operations miss the surface [K, N], and how far windows drift under them [K, S]."""
    return surface.misses(parts.motions, sources=parts.sources), surface.drifts(parts.motions)


def _seen_judged(
    surface: Surface, parts: _Parts, misses: Array, drifts: Array, group: Sequence[Isometry] = ()
) -> tuple[tuple[Element, ...], float, float]:
    """The elements of a group by what was seen of them, what all need by that, and to be believed in the rest."""
    seen = surface.seen(misses, parts.motions, sources=parts.sources, together=True, group=group)
    told = surface.drifts_seen(drifts, seen, parts.motions, sources=parts.sources)
    found, need = _judged(surface, parts, seen, told)
    if surface.openings is None or surface.viewed:  # cameras say what they could not see
        return found, need, 0.0
    whole = belief_in_as_much(surface, parts.placed)
    beliefs = [whole * e.coverage.belief for e in found]
    believed = tuple(replace(e, need=math.hypot(e.need, b)) for e, b in zip(found, beliefs, strict=True))
    return believed, need, _believed(parts, beliefs)


def _believed(parts: _Parts, beliefs: Sequence[float]) -> float:
    """What a group asks to be believed in whose elements ask for so much.

    More than half of its operations generate it (Lagrange), so that the others follow. Of a continuous one turns about
    its axes do, which what is round has with all mirrors through them, and one operation that turns an axis around.
    """
    each = [*zip(parts.operations, beliefs, strict=True)]
    turns = [b for part, b in each if math.isinf(part.order)]
    if not turns:
        return sorted(beliefs)[len(beliefs) // 2]
    axis = parts.placed.group.frame[2]
    around = (b for part, b in each if any(axis @ m @ axis < 0.0 for m in part.matrices))
    return max(*turns, min(around, default=0.0))


def belief_in_as_much(surface: Surface, placed: Placed) -> float:
    """What it needs to believe that as much as was seen of a group is there where nobody looked.

    A lone mirror is forgiven more for being made inexactly, not for what nobody saw of it.
    """
    return surface.tolerance * lenience(placed.group.name)


def _moved_each(operations: int, least: int) -> int:
    return min(max(least, MOVED // operations), COUNT)


def _judged(surface: Surface, parts: _Parts, misses: Array, drifts: Array) -> tuple[tuple[Element, ...], float]:
    """The elements of a group from the misses [K, N] and drifts [K, S] of its operations, and what all of them need."""
    tests = len(parts.operations)
    drifted, all_drifted = surface.drifted(drifts, tests)
    needs = np.maximum(surface.needed(misses, parts.motions, tests), drifted)
    found = tuple(
        Element(
            operations=part,
            center=parts.placed.center,
            deviation=Deviation.of(misses[rows]),
            need=float(needs[rows].max()),
            coverage=surface.coverage(misses[rows], parts.motions[rows], sources=parts.sources),
        )
        for part, rows in zip(parts.operations, parts.rows, strict=True)
    )
    # A part out of place is met by all operations: together they tell it from noise where none does alone.
    return found, max(surface.needed_by_all(misses), all_drifted, *(e.need for e in found))


def single(element: Element) -> Hypothesis:
    """An element of a group as a group of its own."""
    return Hypothesis(placed=element.operations.alone(element.center), elements=(element,), need=element.need)
