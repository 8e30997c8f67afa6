"""The groups an object may have, one inside the next, by what they need to be forgiven.

`explore` fits what the moments propose until the largest group within a limit has no neighbour left that holds as well;
`chain` then joins elements in the order of what they need, the exact ones first. So the group grows with the tolerance,
an exact element stays in it, and the group at any tolerance is read from the same table.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from symrefine.decide.hypotheses import (
    GLANCE,
    NOTHING,
    START_ERROR,
    Hypothesis,
    fitted,
    joined,
    looked_at,
    need,
    single,
)
from symrefine.fit.placed import Placed
from symrefine.propose.candidates import Evidence, beside, proposals
from symrefine.surface.misses import LIMITS
from symrefine.surface.surface import Surface

# What a start that is off by START_ERROR may miss by: half a diagonal is the longest lever.
HOPELESS = 0.5 * START_ERROR / LIMITS[0]
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
    """Small groups fitted and judged, the largest within the limit, larger ones that failed, candidates turned down."""

    small: tuple[Hypothesis, ...] = ()
    largest: Hypothesis = NOTHING
    turned_down: tuple[tuple[Placed, float], ...] = ()
    failed: tuple[Hypothesis, ...] = ()


def explore(surface: Surface, evidence: Evidence, limit: float) -> Pool:
    """Fit and judge what the moments propose, and what may stand beside the largest group that holds.

    Args:
        limit: what the largest group may need, as a fraction of the diagonal.
    """
    pool = Pool()
    for starts in proposals(evidence):
        pool = _settled(surface, _tried(surface, pool, starts, limit), pool.largest, limit)
    nearest = sorted(pool.turned_down, key=lambda k: k[1])[:TOLD] if not pool.small else []
    return replace(pool, small=(*pool.small, *(fitted(surface, start) for start, _ in nearest)))


def _settled(surface: Surface, pool: Pool, before: Hypothesis, limit: float) -> Pool:
    """The pool when the neighbours of its largest group were tried, and of the one that this makes, and so on."""
    while pool.largest is not before:
        before = pool.largest
        pool = _tried(surface, pool, beside(before.placed), limit)
    return pool


def _glanced(surface: Surface, largest: Hypothesis, starts: Iterable[Placed]) -> list[tuple[Placed, float]]:
    """The starts that are new with what they seem to need at a glance, large groups that look good first."""
    glances = [(s, need(surface, s, GLANCE)) for s in starts if not largest.holds(s)]
    return sorted(glances, key=lambda k: k[1] / math.log2(1.0 + _size(k[0])))


def _size(placed: Placed) -> float:
    return placed.group.order if placed.group.is_finite else 100.0


def _tried(surface: Surface, pool: Pool, starts: Iterable[Placed], limit: float) -> Pool:
    """The pool with candidates fitted, but for those that the group so far has anyway."""
    small, largest, turned_down, failed = list(pool.small), pool.largest, list(pool.turned_down), list(pool.failed)
    for start, glance in _glanced(surface, largest, starts):
        if largest.holds(start):
            continue
        moved, needs = (start, glance) if glance > HOPELESS else looked_at(surface, start)
        if glance > HOPELESS or needs > COARSE * limit:
            turned_down.append((moved, needs))
            continue
        if largest.holds(moved) or any(_same(moved, h.placed) for h in small):
            continue
        found = fitted(surface, moved)
        if largest.holds(found.placed) or any(_same(found.placed, h.placed) for h in small):
            continue
        small.append(found)
        if found.need > limit:
            continue
        both = _join(surface, [largest, found], failed)
        if both is not None and both.need <= limit:
            largest = both
        else:
            failed += [both] if both is not None else []
            largest = max(largest, found, key=lambda h: _size(h.placed))
    return Pool(small=tuple(small), largest=largest, turned_down=tuple(turned_down), failed=tuple(failed))


def _same(a: Placed, b: Placed) -> bool:
    """Whether two groups are one, as far as directions tell."""
    return a.group.name == b.group.name and Hypothesis(placed=a, elements=(), need=0.0).holds(b)


def _join(surface: Surface, parts: list[Hypothesis], known: Iterable[Hypothesis]) -> Hypothesis | None:
    """The group that hypotheses generate, fitted unless it is one of them or known; None if they generate none."""
    placed = joined([h.placed for h in parts if h.elements])
    if placed is None:
        return None
    for h in (*parts, *known):
        if _same(h.placed, placed):
            return h
    return fitted(surface, placed, before=max(h.iterations for h in parts))


def chain(surface: Surface, pool: Pool, limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit."""
    elements = [single(e) for e in pool.largest.elements if e.need < pool.largest.need / ALIKE]
    rest = sorted([*pool.small, *elements], key=lambda h: h.need)
    known = [pool.largest, *pool.failed]
    links = [NOTHING]
    while rest := [h for h in rest if not links[-1].holds(h.placed)]:
        here = links[-1]
        if rest[0].need > limit:
            break
        level = max(ALIKE * rest[0].need, here.need, EXACT, 0.5 * surface.floor)
        batch = [h for h in rest if h.need <= level]
        found = _join(surface, [here, *batch], known)
        if found is None or found.need > ALIKE * level:
            tried = [] if found is None else [found]
            singly = [_join(surface, [here, h], known) for h in batch[:SINGLY]]
            found = min((h for h in (*tried, *singly) if h is not None), key=lambda h: h.need, default=None)
            known += [h for h in (*tried, *singly) if h is not None]
        if found is None:
            rest = [h for h in rest if h not in batch]
            continue
        links.append(replace(found, need=max(found.need, here.need)))
        if found.need > limit:
            break
    return tuple(links)
