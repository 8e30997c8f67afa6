"""The groups an object may have, one inside the next, by what they need to be forgiven.

`explore` fits what the moments propose until the largest group within a limit has no neighbour left that holds as well;
`chain` then joins elements in the order of what they need, the exact ones first. So the group grows with the tolerance,
an exact element stays in it, and the group at any tolerance is read from the same table.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter

from symrefine.decide.broken import unbroken
from symrefine.decide.ends import (
    ends_there,
    ends_too,
    hidden_by,
    hides_surely,
    hides_there,
    often_kept,
    often_left,
    thin_ends,
)
from symrefine.decide.hypotheses import (
    NOTHING,
    SAME_RAD,
    Hypothesis,
    belief_in_as_much,
    doubtless,
    fitted,
    has_all,
    roughly_judged,
    single,
)
from symrefine.decide.looks import COARSE, by_chance, exact_need, glances, hopeless, looked_at, start_error
from symrefine.decide.place import SUPPORTED, least_elsewhere
from symrefine.decide.pool import Pool, is_at
from symrefine.decide.posterior import ALIKE, ALONE, EVEN, LEAST, Link, certain, meant
from symrefine.fit.placed import Placed, elements, joined
from symrefine.groups import PointGroup
from symrefine.propose.candidates import (
    Evidence,
    about,
    beside,
    prime_axes,
    proposals,
    repeated,
    turned_over,
    voted_mirrors,
)
from symrefine.samples import FOLLOWED
from symrefine.surface.surface import Surface

# Candidates of an open surface that are looked at: where little was seen many seem possible at a glance.
LOOKED = 24

_need = attrgetter("need")


def explore(surface: Surface, evidence: Evidence, limit: float, finest: float = 0.0) -> Pool:
    """Fit and judge what the moments propose, and what may stand beside the largest group that holds.

    Of a surface with open borders all that is judged once as if it were whole, and then with what votes propose where
    nobody looked beyond them.

    Args:
        limit: what the largest group may need, as a fraction of the diagonal.
        finest: the smallest tolerance that is asked for.
    """
    nothing = max(ALIKE * _hidden(surface), certain(finest))
    whole = replace(_of_whole(surface.closed, evidence, limit, nothing), whole=True)
    if surface.openings is None or (not surface.is_open and surface.openings.floor is None):
        return replace(whole, at_least=surface.openings is not None and surface.openings.evident)
    ends, evident = ends_there(surface, whole.largest), surface.openings.evident
    opens = evident and not (ends and thin_ends(surface))
    if not whole.largest.group.is_polar and (ends or not evident):
        return replace(whole, at_least=opens)  # no single hole leaves such a group, and there is hardly one
    evident = surface.openings.hide_much
    part = _of_part(surface, whole)
    more = _size(part.largest.placed) > _size(whole.largest.placed)
    hidden = max((e.coverage.unseen for e in part.largest.elements), default=0.0)
    # A group that a single hole leaves may keep its border because it keeps the border of almost any.
    ends = ends and not (more and often_kept(surface, whole.largest, hidden))
    # What may not be open at all is missing a part only where that explains more.
    unseen = hidden_by(surface, part.largest) if more else []
    missing = (evident or (more and hides_there(surface, unseen))) and not ends
    missing = missing or often_left(whole.largest, part.largest)
    missing = missing and not (more and ends_too(surface, part.largest, unseen, ALIKE * limit))
    if missing and (not more or hides_surely(surface, part.largest, limit)):
        return replace(part, at_least=True)
    # What a border hides may be why a larger group is in doubt.
    doubted = (h for h in (part.largest, *part.small) if _size(h.placed) > _size(whole.largest.placed))
    hides = not ends and any(meant(Link(need=h.need), surface.tolerance) > LEAST for h in doubted)
    if not more:
        return replace(whole, at_least=hides or opens or surface.openings.floor is not None)
    whole = replace(whole, at_least=evident or hides or missing)
    # To believe that what ends so evenly is missing a part takes as much as to believe in as much as was seen.
    asked, known = belief_in_as_much(surface, part.largest.placed), part.largest
    rival = replace(known, need=math.hypot(known.need, asked), believed=math.hypot(known.believed, asked))
    return replace(whole, small=(*whole.small, rival))


def _hidden(surface: Surface) -> float:
    """The need up to which noise tells no two groups apart, and none is doubted for it."""
    return min(exact_need(surface.floor), doubtless(surface))


def _of_whole(surface: Surface, evidence: Evidence, limit: float, nothing: float) -> Pool:
    pool, starts = Pool(nothing=nothing, limit=limit), proposals(evidence)
    if evidence.vertices is not None:
        pool = _with_vertices(surface, pool, evidence.vertices, proven=evidence.proven)
        starts = [*beside(pool.largest.placed), *starts]
    pool = _with(surface, pool, starts)
    for axis, glance in _glanced(surface, pool, prime_axes(evidence)):
        if glance < hopeless(start_error(surface)) and pool.wants(axis):
            pool = _with(surface, pool, about(evidence, axis.group.frame[2]))
    # Turns that hold better than the largest group may have half turns across them which that has not.
    better = [h for h in pool.small if ALIKE * h.need < pool.largest.need]
    for known in {h.group.name: h for h in (*better, pool.largest)}.values():
        pool = _with(surface, pool, turned_over(evidence, known.placed))
    nearest = sorted((*pool.looked, *pool.hopeless), key=lambda k: k[1])[:FOLLOWED] if not pool.small else []
    return replace(pool, small=(*pool.small, *(fitted(surface, start) for start, _ in nearest)))


def _with_vertices(surface: Surface, pool: Pool, known: Placed, *, proven: bool) -> Pool:
    """The pool with what the vertices of a mesh have, unless they are those of something round."""
    if known.group.symbol.fold > 2:
        pool = _tried(surface, pool, [_endless(known)])
    if pool.has(known):
        return pool
    found = fitted(surface, known)
    return _grown(surface, pool, replace(found, need=0.0) if proven else found)


def _of_part(surface: Surface, whole: Pool) -> Pool:
    pool = Pool(nothing=whole.nothing, limit=whole.limit)
    known = [h for h in (whole.largest, *whole.small) if h.elements]
    voted = [*voted_mirrors(surface.cloud), *repeated(surface.cloud, surface.diagonal)]
    if surface.viewed:
        parts = list[Placed]()
        for h in known:
            again = fitted(surface, h.placed)
            pool = _grown(surface, pool, again)
            # Of what was not seen enough to tell the whole group, enough may have been seen of its elements.
            parts += _holding(surface, again.placed, ALIKE * pool.limit) if _is_loose(surface, again) else []
        return _with(surface, pool, [*parts, *voted])
    # What holds without them asks nothing of openings.
    for h in (h for h in known if h.need <= exact_need(surface.floor)):
        pool = _grown(surface, pool, h)
    # Votes find most of what was found of the whole, and better, as nothing that is missing biases them.
    pool = _with(surface, pool, voted)
    for h in known:
        pool = pool if pool.has(h.placed, h.need) else _grown(surface, pool, fitted(surface, h.placed))
    return pool


def _with(surface: Surface, pool: Pool, starts: Iterable[Placed]) -> Pool:
    """The pool with candidates tried, and then the neighbours of its largest group, as long as that grows."""
    before, pool = pool.largest, _tried(surface, pool, starts)
    while pool.largest is not before:
        before = pool.largest
        pool = _tried(surface, pool, beside(before.placed))
    return pool


def _glanced(surface: Surface, pool: Pool, starts: Iterable[Placed]) -> list[tuple[Placed, float]]:
    """The starts that are new with what they seem to need at a glance, large groups that look good first."""
    new = [s for s in starts if pool.wants(s)]
    # What they carry to where nobody looked tells little of their order, and takes long to be told.
    blind = surface.is_open and not surface.viewed
    at, most = (surface.closed, surface.ceiling) if blind else (surface, hopeless(start_error(surface)))
    seen = zip(new, glances(at, new, most), strict=True)
    best = sorted(seen, key=lambda k: max(k[1], pool.nothing) / math.log2(1.0 + _size(k[0])))
    return best[:LOOKED] if surface.is_open else best


def _is_loose(surface: Surface, found: Hypothesis) -> bool:
    """Whether what was seen does not tell that a group holds, or where: as likely as not it holds elsewhere as well."""
    return not found.told or found.elsewhere <= EVEN * surface.tolerance


def _size(placed: Placed) -> float:
    return placed.group.order if placed.group.is_finite else 100.0


def _tried(surface: Surface, pool: Pool, starts: Iterable[Placed]) -> Pool:
    """The pool with candidates fitted, but for those that the group so far has anyway."""
    parts: list[Placed] = []
    for start, glance in _glanced(surface, pool, starts):
        if not pool.wants(start) or pool.shows(start, glance):
            continue
        if glance >= hopeless(start_error(surface)):
            pool = replace(pool, hopeless=(*pool.hopeless, (start, glance)))
            continue
        look = looked_at(surface, start, COARSE * pool.limit, pool.has_as_seen, useful=ALIKE * pool.limit)
        moved, needs = look.placed, look.needs
        pool = replace(pool, looks=(*pool.looks, (glance, moved)))
        if needs > ALIKE * pool.limit:
            pool = replace(pool, looked=(*pool.looked, (moved, needs)))
            parts += _holding(surface, moved, ALIKE * pool.limit)
        elif not pool.has(moved, needs) and not pool.met(moved):
            pool = _joined_at_once(surface, pool, moved) if needs <= pool.limit and pool.largest.elements else pool
            if not pool.has(moved, needs):
                found = fitted(surface, moved, error_rad=look.error_rad, close=ALIKE * pool.limit)
                if surface.openings is None or surface.viewed or found.supported >= SUPPORTED:
                    pool = _grown(surface, pool, found)
                    # What does not hold may have elements that do, which nothing else proposes.
                    parts += [p.placed for p in _better(found)] if found.need > pool.limit else []
    return _tried(surface, pool, parts) if parts else pool


def _holding(surface: Surface, placed: Placed, most: float) -> list[Placed]:
    """The elements that seem to hold alone of a group that does not, or of which too little was seen.

    Of a gear's mirrors those that its holes share; of a slab from above all but its own plane.
    """
    every = [e.alone(placed.center) for e in elements(placed.group)]
    alone = [p for p in every if p.group.name != placed.group.name]  # of S4 one generates all of it
    return [p for p, needs in zip(alone, glances(surface, alone, most), strict=True) if needs < most]


def _better(found: Hypothesis) -> list[Hypothesis]:
    """The elements of a group that need less than all of it does, each alone."""
    return [single(e) for e in found.elements if ALIKE * e.need < found.need]


def _joined_at_once(surface: Surface, pool: Pool, start: Placed) -> Pool:
    """The pool where a candidate and the largest group hold together as far as noise tells: no need to part them.

    Where the largest has it already and holds worse, that is the largest of those in it that need nothing; of what is
    round any two mirrors through its axis make some fold, which says nothing.
    """
    if pool.largest.holds(start) and not pool.largest.group.is_finite:
        return pool
    exact = [h for h in pool.small if h.need <= pool.nothing and h.elements] if pool.largest.holds(start) else []
    known = max(exact or [pool.largest], key=lambda h: _size(h.placed))
    if known.holds(start) or has_all(start, known.placed):
        return pool
    both = _generated(surface, [known.placed, start], pool.failed, known.iterations, ALIKE * pool.nothing)
    if both is None or _is_loose(surface, both) or both.need > pool.nothing:
        return pool.with_failed(both)
    return replace(pool, small=(*pool.small, both)) if exact else replace(pool, largest=both)


def _grown(surface: Surface, pool: Pool, found: Hypothesis) -> Pool:
    """The pool with what was fitted, and its largest group joined to it, if both hold together, or else the larger."""
    if pool.has(found.placed, found.need) or _is_loose(surface, found):
        return pool
    if found.need > pool.limit:
        return replace(pool, small=(*pool.small, found))
    both = _join(surface, [pool.largest, found], pool.failed, ALIKE * pool.limit)
    if both is not None and not _is_loose(surface, both) and both.need <= pool.limit:
        largest = both
    else:
        largest, pool = max(pool.largest, found, key=lambda h: _size(h.placed)), pool.with_failed(both)
    # What is replaced may hold better than what takes its place.
    kept = [pool.largest] if largest is not pool.largest and pool.largest.elements else []
    return replace(pool, small=(*pool.small, *kept, found), largest=largest)


def _join(
    surface: Surface, parts: list[Hypothesis], known: Iterable[Hypothesis], most: float, close: float = math.inf
) -> Hypothesis | None:
    """The group that hypotheses generate, fitted unless it is one of them or known; None if they generate none.

    One that seems to need more than `most` is told without elements; one that no fit brings to `close`, by few points.
    """
    placed = [h.placed for h in parts if h is not NOTHING]
    return _generated(surface, placed, (*parts, *known), max(h.iterations for h in parts), most, close)


def _generated(
    surface: Surface,
    parts: Sequence[Placed],
    known: Sequence[Hypothesis],
    before: int,
    most: float,
    close: float = math.inf,
) -> Hypothesis | None:
    # Directions of what holds less well may be off by more than one fit tells two of them apart by.
    whole = (p for p in parts if all(has_all(p, other) for other in parts))
    placed = next(whole, None) or _told_apart(surface, joined(parts), parts)
    if placed is None:
        return None
    told = [h for h in known if h.history and h.elements] + [h for h in known if not h.elements and h.need > most]
    same = next((h for h in told if is_at(h.placed, placed)), None)
    if same is not None:
        return same
    if surface.is_open:
        return fitted(surface, placed, before=before, most=ALIKE * most, close=ALIKE * close)
    look = looked_at(surface, placed, COARSE * most)
    if look.needs > most:
        return Hypothesis(placed=placed, elements=(), need=look.needs)
    if look.needs > (ALIKE if look.settled else COARSE) * close:
        return roughly_judged(surface, look, before=before)
    return fitted(surface, look.placed, error_rad=look.error_rad, before=before)


def _told_apart(surface: Surface, placed: Placed | None, parts: Sequence[Placed]) -> Placed | None:
    """What parts generate, or the continuous group about its axis where the fold is none of theirs and says nothing.

    Any two mirrors of something round make some fold, and two that are one a large one.
    """
    if placed is None:
        return None
    fold = placed.group.symbol.fold
    if any(fold <= p.group.symbol.fold for p in parts):
        return placed
    return _endless(placed) if math.inf > fold > math.pi / SAME_RAD or by_chance(surface, placed) else placed


def _endless(placed: Placed) -> Placed:
    """The continuous group about the axis of a group."""
    name = "Cinfv" if placed.group.symbol.family in ("C", "Cv") else "Dinfh"
    return replace(placed, group=PointGroup(name=name, frame=placed.group.frame))


def _worst(found: Hypothesis, hidden: float) -> tuple[float, float]:
    """What a group needs; of those that need no more than is hidden, the mean miss of its worst element."""
    return max(found.need, hidden), max((e.deviation.mean for e in found.elements), default=0.0)


def _best(tried: Sequence[Hypothesis], hidden: float, noise: float) -> Hypothesis | None:
    """Of groups that do not hold together the one that needs least; of those that need as good as nothing the largest.

    By chance fewer operations hold than many. Of those as large it is the one that misses least in the mean; how many
    others there are that need as little, or as little as noise, tells how sure it is.
    """

    def rank(found: Hypothesis) -> tuple[float, float, float]:
        need, mean = _worst(found, hidden)
        return need, -_size(found.placed), mean

    best = min((h for h in tried if h.elements), key=rank, default=None)
    if best is None or best.need > hidden:
        return best
    apart, most = [best.placed], max(ALIKE * best.need, noise)
    for other in sorted((h for h in tried if h.elements and h.need <= most), key=rank):
        apart += [] if any(has_all(p, other.placed) or has_all(other.placed, p) for p in apart) else [other.placed]
    return replace(best, rivals=tuple(apart[1:]))


def chain(surface: Surface, pool: Pool, limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit.

    Those that no fit brings within the limit of the pool are only looked at: what larger tolerances would make of them.
    """
    seen, surface = surface, surface.closed if pool.whole else surface
    near = [h for h in pool.turned_down() if h.need <= COARSE * pool.limit]
    # What is hidden by noise, or by the least tolerance that is asked for, tells no two groups apart.
    hidden = max(_hidden(surface), pool.nothing / ALIKE)
    worst = partial(_worst, hidden=hidden)
    every = [*pool.small, *_better(pool.largest), pool.largest, *near]
    rest = sorted((h for h in every if h.need <= hidden or not by_chance(seen, h.placed)), key=worst)
    known = [pool.largest, *pool.failed, *pool.small]
    links = [NOTHING]
    while rest := [h for h in rest if not links[-1].holds(h.placed)]:
        here = links[-1]
        # A mirror is a lone one by what the next group needs.
        most = max(limit, ALONE * here.need) if here.group.name == "Cs" else limit
        if rest[0].need > most:
            break
        level = max(ALIKE * rest[0].need, here.need, hidden)
        batch = [h for h in rest if h.need <= level]
        found = _join(surface, [here, *batch], known, most, pool.limit)
        if found is None or _is_loose(surface, found) or not found.elements or found.need > ALIKE * level:
            tried = [] if found is None else [found]
            for other in batch[:FOLLOWED]:
                one = _join(surface, [here, other], [*known, *tried], most, pool.limit)
                tried += [] if one is None else [one]
            tried = [h for h in tried if not _is_loose(surface, h)]
            known += tried
            found = _best(tried, hidden, _hidden(surface))
        # Directions may part what together makes the same group again.
        if found is None or found.group.name == here.group.name:
            rest = [h for h in rest if h not in batch]
            continue
        # What holds together holds in every part of it, though a part alone may not tell what was not seen.
        inside = (h for h in known if h.elements and h.holds(found.placed))
        asks = max(min([found, *inside], key=_need), here, key=_need)
        links.append(replace(found, need=asks.need, believed=asks.believed))
        if asks.need > limit:
            break
    links = [_excluded(link, links[i + 1 :], limit) for i, link in enumerate(links)]
    told = [NOTHING]
    for link in links[1:]:
        part = unbroken(surface, link)
        if part and part.holds(told[-1].placed) and not told[-1].holds(part.placed):
            need, elsewhere = min(max(part.need, told[-1].need), link.need), least_elsewhere(surface, part.placed)
            told.append(replace(part, need=need, elsewhere=elsewhere))
        told.append(link)
    return tuple(told)


def _excluded(link: Hypothesis, larger: Sequence[Hypothesis], limit: float) -> Hypothesis:
    """A link without rivals of another name that a larger group within the limit may hold as well."""
    both = [h for h in larger if h.need <= limit]
    kept = [r for r in link.rivals if r.group.name == link.group.name or not any(h.holds(r) for h in both)]
    return replace(link, rivals=tuple(kept))
