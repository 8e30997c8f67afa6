"""The groups an object may have, one inside the next, by what they need to be forgiven.

`explore` fits what the moments propose until the largest group within a limit has no neighbour left that holds as well;
`chain` then joins elements in the order of what they need, the exact ones first. So the group grows with the tolerance,
an exact element stays in it, and the group at any tolerance is read from the same table.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.decide.hypotheses import (
    DIRECTION_ERROR,
    NOTHING,
    SAME_RAD,
    Hypothesis,
    fitted,
    glances,
    joined,
    looked_at,
    single,
    start_error,
)
from symrefine.fit.placed import Placed
from symrefine.groups import is_subgroup
from symrefine.propose.candidates import Evidence, about, beside, prime_axes, proposals, voted
from symrefine.surface.misses import LIMITS
from symrefine.surface.surface import Surface

# Share of a surface that has to be carried onto itself for anything to be said of an operation.
SUPPORTED = 0.15
# A coarse fit on few points may need so many times what a fine one does.
COARSE = 3.5
# Needs within this factor are the same, as the elements of a true group miss alike; so are those below what rounding
# of coordinates to five digits leaves.
ALIKE, EXACT = 1.5, 1e-5
# Candidates turned down after a look that are fitted all the same where nothing else was: the nearest misses.
TOLD = 2
# Elements that are joined one by one, where all of a level together make no group.
SINGLY = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pool:
    """What was found so far.

    Attributes:
        small: groups fitted and judged.
        largest: the largest that holds within the limit.
        failed: groups that the largest and another one generate, which do not hold.
        looked: candidates turned down after a look, where a coarse fit put them, with what they seem to need.
        hopeless: the same of those turned down at a glance.
    """

    small: tuple[Hypothesis, ...] = ()
    largest: Hypothesis = NOTHING
    failed: tuple[Hypothesis, ...] = ()
    looked: tuple[tuple[Placed, float], ...] = ()
    hopeless: tuple[tuple[Placed, float], ...] = ()

    @property
    def seen(self) -> list[tuple[Placed, float]]:
        """Candidates where a fit put them, with what they need."""
        return [*((h.placed, h.need) for h in self.small), *self.looked]

    def has(self, placed: Placed, needs: float) -> bool:
        """Whether a group is in one that was fitted and needs no more than it does."""
        return any(h.need <= ALIKE * needs and h.holds(placed) for h in (self.largest, *self.small))

    def met(self, placed: Placed) -> bool:
        """Whether a group was fitted at this very place."""
        near = [h.group for h in self.small if h.group.name == placed.group.name]
        return any(is_subgroup(placed.group, g, DIRECTION_ERROR) for g in near)

    def with_failed(self, failed: Hypothesis | None) -> "Pool":
        """The pool that knows of a group, if there is one, that it does not hold."""
        return self if failed is None or failed in self.failed else replace(self, failed=(*self.failed, failed))


def explore(surface: Surface, evidence: Evidence, limit: float) -> Pool:
    """Fit and judge what the moments propose, and what may stand beside the largest group that holds.

    Args:
        limit: what the largest group may need, as a fraction of the diagonal.
    """
    pool = Pool()
    if surface.openings is not None:
        pool = _settled(surface, _tried(surface, pool, voted(surface.cloud.points, surface.cloud.normals), limit), pool.largest, limit)
    for starts in proposals(evidence):
        pool = _settled(surface, _tried(surface, pool, starts, limit), pool.largest, limit)
    for axis, glance in _glanced(surface, pool, prime_axes(evidence)):
        if glance < _hopeless(surface) and not pool.has(axis, exact_need(surface.floor)):
            starts = about(evidence, axis.group.frame[2])
            pool = _settled(surface, _tried(surface, pool, starts, limit), pool.largest, limit)
    nearest = sorted((*pool.looked, *pool.hopeless), key=lambda k: k[1])[:TOLD] if not pool.small else []
    return replace(pool, small=(*pool.small, *(fitted(surface, start) for start, _ in nearest)))


def _hopeless(surface: Surface) -> float:
    """What a start may seem to need: half a diagonal is the longest lever of what it may be off by."""
    return 0.5 * start_error(surface) / LIMITS[0]


def _settled(surface: Surface, pool: Pool, before: Hypothesis, limit: float) -> Pool:
    """The pool when the neighbours of its largest group were tried, and of the one that this makes, and so on."""
    while pool.largest is not before:
        before = pool.largest
        pool = _tried(surface, pool, beside(before.placed), limit)
    return pool


def _glanced(surface: Surface, pool: Pool, starts: Iterable[Placed]) -> list[tuple[Placed, float]]:
    """The starts that are new with what they seem to need at a glance, large groups that look good first."""
    new = [s for s in starts if not pool.has(s, exact_need(surface.floor))]
    seen = zip(new, glances(surface, new, _hopeless(surface)), strict=True)
    return sorted(seen, key=lambda k: k[1] / math.log2(1.0 + _size(k[0])))


def _size(placed: Placed) -> float:
    return placed.group.order if placed.group.is_finite else 100.0


def _tried(surface: Surface, pool: Pool, starts: Iterable[Placed], limit: float) -> Pool:
    """The pool with candidates fitted, but for those that the group so far has anyway."""
    for start, glance in _glanced(surface, pool, starts):
        least = exact_need(surface.floor)
        if pool.has(start, least) or _is_image(start, glance, pool):
            continue
        if glance >= _hopeless(surface):
            pool = replace(pool, hopeless=(*pool.hopeless, (start, glance)))
            continue
        moved, needs = looked_at(surface, start)
        if needs > COARSE * limit:
            pool = replace(pool, looked=(*pool.looked, (moved, needs)))
        elif not pool.has(moved, max(needs / COARSE, least)) and not pool.met(moved):
            pool = _joined_at_once(surface, pool, moved) if needs <= limit and pool.largest.elements else pool
            if not pool.has(moved, max(needs / COARSE, least)):
                pool = _grown(surface, pool, fitted(surface, moved), limit)
    return pool


def _joined_at_once(surface: Surface, pool: Pool, start: Placed) -> Pool:
    """The pool where a candidate and the largest group hold together as far as noise tells: no need to part them."""
    both = _generated(surface, [pool.largest.placed, start], pool.failed, pool.largest.iterations)
    if both is not None and both.need <= exact_need(surface.floor):
        return replace(pool, largest=both)
    return pool.with_failed(both)


def exact_need(floor: float) -> float:
    """The need up to which noise, which alone needs `floor`, or the rounding of coordinates tells nothing apart."""
    return max(EXACT, 0.5 * floor)


def _grown(surface: Surface, pool: Pool, found: Hypothesis, limit: float) -> Pool:
    """The pool with what was fitted, and its largest group joined to it, if both hold together, or else the larger."""
    if pool.has(found.placed, max(found.need, exact_need(surface.floor))):
        return pool
    if surface.openings is not None and found.supported < SUPPORTED:
        return pool
    if found.need > limit:
        return replace(pool, small=(*pool.small, found))
    both = _join(surface, [pool.largest, found], pool.failed)
    if both is not None and both.need <= limit:
        largest = both
    else:
        largest, pool = max(pool.largest, found, key=lambda h: _size(h.placed)), pool.with_failed(both)
    # What is replaced may hold better than what takes its place.
    kept = [pool.largest] if largest is not pool.largest and pool.largest.elements else []
    return replace(pool, small=(*pool.small, *kept, found), largest=largest)


def _is_image(start: Placed, glance: float, pool: Pool) -> bool:
    """Whether the largest group carries a mirror or turn that was seen onto this one, which looks no better."""
    if start.group.symbol.family not in ("C", "Ch") or not pool.largest.group.is_finite:
        return False
    images = pool.largest.group.operations() @ start.group.frame[2]
    seen = [(p.group.frame[2], need) for p, need in pool.seen if p.group.name == start.group.name]
    return any(need < ALIKE * glance and np.abs(images @ u).max() > np.cos(SAME_RAD) for u, need in seen)


def _same(a: Placed, b: Placed) -> bool:
    """Whether two groups are one, as far as directions tell."""
    return a.group.name == b.group.name and Hypothesis(placed=a, elements=(), need=0.0).holds(b)


def _join(surface: Surface, parts: list[Hypothesis], known: Iterable[Hypothesis]) -> Hypothesis | None:
    """The group that hypotheses generate, fitted unless it is one of them or known; None if they generate none."""
    placed = [h.placed for h in parts if h.elements]
    return _generated(surface, placed, (*parts, *known), max(h.iterations for h in parts))


def _generated(
    surface: Surface, parts: Sequence[Placed], known: Iterable[Hypothesis], before: int
) -> Hypothesis | None:
    placed = joined(parts)
    if placed is None:
        return None
    same = (h for h in known if h.history and _same(h.placed, placed))
    return next(same, None) or fitted(surface, placed, before=before)


def _worst(found: Hypothesis) -> tuple[float, float]:
    """What a group needs; of those that noise hides, the mean miss of its worst element."""
    return found.need, max((e.deviation.mean for e in found.elements), default=0.0)


def chain(surface: Surface, pool: Pool, limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit."""
    elements = [single(e) for e in pool.largest.elements if e.need < pool.largest.need / ALIKE]
    rest = sorted([*pool.small, *elements, pool.largest], key=_worst)
    known = [pool.largest, *pool.failed]
    links = [NOTHING]
    while rest := [h for h in rest if not links[-1].holds(h.placed)]:
        here = links[-1]
        if rest[0].need > limit:
            break
        level = max(ALIKE * rest[0].need, here.need, exact_need(surface.floor))
        batch = [h for h in rest if h.need <= level]
        found = _join(surface, [here, *batch], known)
        if found is None or found.need > ALIKE * level:
            tried = [] if found is None else [found]
            singly = [_join(surface, [here, h], known) for h in batch[:SINGLY]]
            found = min((h for h in (*tried, *singly) if h is not None), key=_worst, default=None)
            known += [h for h in (*tried, *singly) if h is not None]
        if found is None:
            rest = [h for h in rest if h not in batch]
            continue
        links.append(replace(found, need=max(found.need, here.need)))
        if found.need > limit:
            break
    return tuple(links)
