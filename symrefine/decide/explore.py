"""What the moments propose, fitted and judged until the largest group that holds has no neighbour that holds, too."""

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from symrefine.decide.ends import (
    ends_elsewhere,
    ends_there,
    ends_too,
    hidden_by,
    hides_surely,
    hides_there,
    is_denied,
    often_kept,
    often_left,
    thin_ends,
)
from symrefine.decide.hypotheses import (
    Hypothesis,
    belief_in_as_much,
    doubtless,
    fitted,
    has_all,
    hidden_need,
    judged,
)
from symrefine.decide.joins import better_parts, endless, generated, is_loose, join, size_of
from symrefine.decide.looks import COARSE, exact_need, glances, hopeless, looked_at, start_error, unmet_by
from symrefine.decide.place import SUPPORTED
from symrefine.decide.pool import Pool, is_at
from symrefine.decide.posterior import ALIKE, EVEN, LEAST, Link, certain, lenience, meant
from symrefine.fit.placed import Placed, elements
from symrefine.propose.candidates import (
    Evidence,
    about,
    beside,
    beside_details,
    fine,
    prime_axes,
    proposals,
    repeated,
    turned_over,
    voted_mirrors,
)
from symrefine.samples import COUNT, FOLLOWED
from symrefine.surface.surface import Surface

# Candidates of an open surface that are looked at: where little was seen many seem possible at a glance.
LOOKED = 24


def explore(surface: Surface, evidence: Evidence, limit: float, finest: float = 0.0) -> Pool:
    """Fit and judge what the moments propose, and what may stand beside the largest group that holds.

    Of a surface with open borders all that is judged once as if it were whole, and then with what votes propose where
    nobody looked beyond them.

    Args:
        limit: what the largest group may need, as a fraction of the diagonal.
        finest: the smallest tolerance that is asked for.
    """
    if surface.cloud.body == "atoms":  # what is half way to a neighbour is that as well
        finest = min(finest, 0.5 * surface.cloud.spacing / surface.diagonal)
    nothing = max(ALIKE * hidden_need(surface), certain(finest))
    whole = replace(_of_whole(surface.closed, evidence, limit, nothing), whole=True)
    if surface.openings is None or (not surface.is_open and surface.openings.floor is None):
        return replace(whole, at_least=surface.openings is not None and surface.openings.evident)
    ends, evident = ends_there(surface, whole.largest), surface.openings.evident
    opens = evident and not (ends and thin_ends(surface))
    if not whole.largest.group.is_polar and (ends or not evident):
        return replace(whole, at_least=opens)  # no single hole leaves such a group, and there is hardly one
    evident = surface.openings.hide_much
    part = _of_part(surface, whole)
    more = size_of(part.largest.placed) > size_of(whole.largest.placed)
    is_missing = partial(_is_missing, surface, whole.largest, limit=limit, ends=ends)
    missing = is_missing(part.largest)
    if missing and not more:
        return replace(part, at_least=True)
    for found in _larger(part, whole.largest):
        if (missing if found is part.largest else is_missing(found)) and hides_surely(surface, found, limit):
            return replace(_believed(surface, part, found), at_least=True)
    # What a border hides may be why a larger group is in doubt.
    doubted = (h for h in (part.largest, *part.small) if size_of(h.placed) > size_of(whole.largest.placed))
    links = (Link.of(h.group, h.need, math.inf) for h in doubted)
    hides = not ends and any(meant(link, surface.tolerance) > LEAST for link in links)
    if not more:
        return replace(whole, at_least=hides or opens or surface.openings.floor is not None)
    whole = replace(whole, at_least=evident or hides or missing)
    return replace(whole, small=(*whole.small, _as_rival(surface, part.largest)))


def _larger(part: Pool, than: Hypothesis) -> list[Hypothesis]:
    """The largest group of a pool and a few parts of it that were found, largest first, where larger than another."""
    every, found = (h for h in (part.largest, *part.small) if part.largest.holds(h.placed)), list[Hypothesis]()
    for h in sorted(every, key=lambda known: -size_of(known.placed)):
        if h.need <= part.limit and size_of(h.placed) > size_of(than.placed):
            found += [] if any(is_at(h.placed, other.placed) for other in found) else [h]
    return found[:FOLLOWED]


def _believed(surface: Surface, part: Pool, found: Hypothesis) -> Pool:
    """The pool where one of its groups is the largest that may be believed in, and what it has not asks for more.

    Where the object mostly ends at its borders, one more is a hole or such an end: as likely as not. So is a border
    that narrow neighbourhoods deny, and wide ones tell no longer than chance may.
    """
    as_end = EVEN * surface.tolerance if is_denied(surface) or ends_elsewhere(surface, found) else 0.0
    if found is part.largest and not as_end:
        return part

    def asked(known: Hypothesis) -> Hypothesis:
        if not known.believed:
            return known
        if not found.holds(known.placed):
            return _as_rival(surface, known)
        return _asking(known, as_end * lenience(known.group.name))

    others = part.failed if found is part.largest else (part.largest, *part.failed)
    small, failed = (tuple(map(asked, hypotheses)) for hypotheses in (part.small, others))
    return replace(part, largest=asked(found), small=small, failed=failed)


def _is_missing(surface: Surface, whole: Hypothesis, part: Hypothesis, limit: float, *, ends: bool) -> bool:
    """Whether a part of a surface is missing if it has a group that it has not as it is: no object ends like that.

    `ends` says whether what it has as it is keeps its borders.
    """
    assert surface.openings is not None
    more = size_of(part.placed) > size_of(whole.placed)
    hidden = max((e.coverage.unseen for e in part.elements), default=0.0)
    # A group that a single hole leaves may keep its border because it keeps the border of almost any.
    ends = ends and not (more and often_kept(surface, whole, hidden))
    # What may not be open at all is missing a part only where that explains more.
    unseen = hidden_by(surface, part) if more else []
    missing = (surface.openings.hide_much or (more and hides_there(surface, unseen))) and not ends
    missing = missing or often_left(whole, part)
    return missing and not (more and ends_too(surface, part, unseen, ALIKE * limit))


def _as_rival(surface: Surface, found: Hypothesis) -> Hypothesis:
    """A group that asks for what may just end there.

    To believe that what ends so evenly is missing a part takes as much as to believe in as much as was seen.
    """
    return _asking(found, belief_in_as_much(surface, found.placed))


def _asking(found: Hypothesis, belief: float) -> Hypothesis:
    """A group that asks for so much more belief, and so does each of its elements."""
    elements = tuple(replace(e, need=math.hypot(e.need, belief)) for e in found.elements)
    need, believed = math.hypot(found.need, belief), math.hypot(found.believed, belief)
    return replace(found, elements=elements, need=need, believed=believed)


def _of_whole(surface: Surface, evidence: Evidence, limit: float, nothing: float) -> Pool:
    pool, starts = Pool(nothing=nothing, limit=limit), proposals(evidence)
    for exact in (evidence.proven, evidence.vertices):
        pool = pool if exact is None else _with_vertices(surface, pool, exact, proven=exact is evidence.proven)
    starts = [*beside(pool.largest.placed), *starts] if evidence.vertices is not None else starts
    pool = _with(surface, pool, starts)
    vain, error = 0, start_error(surface)  # of what is nearly a ball every axis seems possible
    for axis, glance in _glanced(surface, pool, prime_axes(evidence)):
        if vain < FOLLOWED and glance < hopeless(error) and pool.wants(axis, error):
            before, pool = pool.largest, _with(surface, pool, about(evidence, axis.group.frame[2]))
            vain = vain + 1 if pool.largest is before else 0
    # Turns that hold better than the largest group may have half turns across them which that has not.
    better = [h for h in pool.small if ALIKE * h.need < pool.largest.need]
    for known in {h.group.name: h for h in (*better, pool.largest)}.values():
        pool = _with(surface, pool, turned_over(evidence, known.placed))
    # Where the n-tuples say nothing, or what was found says little, the moments may see too coarsely.
    if evidence.tuples.rank == 0 or not pool.largest.elements or pool.largest.need > doubtless(surface):
        pool = _with(surface, pool, fine(evidence))
    # Where nothing comes near, what comes nearest is told of, and looked at for that.
    if pool.small or min((needs for _, needs in pool.looked), default=math.inf) <= COARSE * limit:
        return pool
    nearest = sorted(pool.hopeless, key=lambda k: k[1])[:FOLLOWED]
    looks = (looked_at(surface, start, COARSE * limit) for start, _ in nearest)
    return replace(pool, looked=(*pool.looked, *((look.placed, look.needs) for look in looks)))


def _with_vertices(surface: Surface, pool: Pool, known: Placed, *, proven: bool) -> Pool:
    """The pool with what the vertices of a mesh have, and first with the round group that they may be those of."""
    if known.group.symbol.fold > 2:
        pool = _tried(surface, pool, [endless(known)])
    if (is_round := pool.has(known)) and not proven:
        return pool
    found = judged(surface, known) if is_round else fitted(surface, known)
    found = replace(found, need=0.0, proven=True) if proven else found
    return replace(pool, small=(*pool.small, found)) if is_round else _grown(surface, pool, found)


def _of_part(surface: Surface, whole: Pool) -> Pool:
    pool = Pool(nothing=whole.nothing, limit=whole.limit)
    known = [h for h in (whole.largest, *whole.small) if h.elements]
    voted = [*voted_mirrors(surface.cloud), *repeated(surface.cloud, surface.diagonal)]
    if surface.viewed:
        parts = list[Placed]()
        for h in known:
            again = fitted(surface, h.placed, close=ALIKE * pool.limit)
            pool = _grown(surface, pool, again)
            # Of what was not seen enough to tell the whole group, enough may have been seen of its elements.
            parts += _holding(surface, again.placed, ALIKE * pool.limit) if is_loose(surface, again) else []
        return _with(surface, pool, [*parts, *voted])
    # What holds without them asks nothing of openings.
    for h in (h for h in known if h.need <= exact_need(surface.floor)):
        pool = _grown(surface, pool, h)
    # Votes find most of what was found of the whole, and better, as nothing that is missing biases them.
    pool = _with(surface, pool, voted)
    pool = _with(surface, pool, _by_details(surface, pool), anew=True)
    for h in known:
        if not pool.has(h.placed, h.need):
            pool = _grown(surface, pool, fitted(surface, h.placed, close=ALIKE * pool.limit))
    return pool


def _by_details(surface: Surface, pool: Pool) -> list[Placed]:
    """What details tell of what is round but for them: votes find any mirror through its axis, and these its own.

    They are what turns about the axis carry to where nothing is.
    """
    nearly_round = next((p for p, _ in pool.looked if not p.group.is_finite and p.group.symbol.fold > 0), None)
    if nearly_round is None:
        return []
    details = surface.cloud.points[:: surface.stride(COUNT)][unmet_by(surface, nearly_round, COUNT)]
    return beside_details(nearly_round, details)


def _with(surface: Surface, pool: Pool, starts: Iterable[Placed], *, anew: bool = False) -> Pool:
    """The pool with candidates tried, and then the neighbours of its largest group, as long as that grows."""
    before, pool = pool.largest, _tried(surface, pool, starts, anew=anew)
    while pool.largest is not before:
        before = pool.largest
        pool = _tried(surface, pool, beside(before.placed))
    return pool


def _glanced(surface: Surface, pool: Pool, starts: Iterable[Placed]) -> list[tuple[Placed, float]]:
    """The starts that are new with what they seem to need at a glance, large groups that look good first."""
    error = start_error(surface)
    new = [s for s in starts if pool.wants(s, error)]
    # What they carry to where nobody looked tells little of their order, and takes long to be told.
    blind = surface.is_open and not surface.viewed
    at, most = (surface.closed, surface.ceiling) if blind else (surface, hopeless(error))
    seen = zip(new, glances(at, new, most), strict=True)
    best = sorted(seen, key=lambda k: max(k[1], pool.nothing) / math.log2(1.0 + size_of(k[0])))
    return best[:LOOKED] if surface.is_open else best


def _tried(surface: Surface, pool: Pool, starts: Iterable[Placed], *, anew: bool = False) -> Pool:
    """The pool with candidates fitted, but for those that the group so far has anyway.

    And, unless they are tried `anew`, for those beside one that was seen to be no better.
    """
    parts, inside, error = list[Placed](), 0, start_error(surface)
    for start, glance in _glanced(surface, pool, starts):
        if not pool.wants(start, error) or (not anew and pool.shows(start, glance, whole=not surface.is_open)):
            continue
        # Parts of what is round beyond doubt only matter to smaller tolerances, and the first of them tell.
        clear = not pool.largest.group.is_finite and pool.largest.need <= doubtless(surface)
        inside += clear and pool.largest.holds(start)
        if inside > FOLLOWED:
            continue
        if glance >= hopeless(error):
            pool = replace(pool, hopeless=(*pool.hopeless, (start, glance)))
            continue
        useful = ALIKE * pool.limit
        # Of a whole surface the first few tell what a larger tolerance may take.
        follow = useful if surface.is_open or len(pool.looked) >= FOLLOWED else math.inf
        look = looked_at(surface, start, COARSE * pool.limit, pool.has_as_seen, useful=useful, follow=follow)
        moved, needs = look.placed, look.needs
        pool = replace(pool, looks=(*pool.looks, (glance, moved)))
        if needs > useful or pool.denies(needs):
            pool = replace(pool, looked=(*pool.looked, (moved, needs)))
            parts += _holding(surface, moved, useful)
        elif not pool.has(moved, needs) and not pool.met(moved):
            pool = _joined_at_once(surface, pool, moved) if needs <= pool.nothing and pool.largest.elements else pool
            if not pool.has(moved, needs):
                found = fitted(surface, moved, error_rad=look.error_rad, close=useful)
                pool = pool if found.need <= pool.limit else replace(pool, vain=(*pool.vain, needs))
                if surface.openings is None or surface.viewed or found.supported >= SUPPORTED:
                    pool = _grown(surface, pool, found)
                    # What does not hold may have elements that do, which nothing else proposes.
                    parts += [p.placed for p in better_parts(found)] if found.need > pool.limit else []
    return _tried(surface, pool, parts) if parts else pool


def _holding(surface: Surface, placed: Placed, most: float) -> list[Placed]:
    """The elements that seem to hold alone of a group that does not, or of which too little was seen.

    Of a gear's mirrors those that its holes share; of a slab from above all but its own plane.
    """
    every = [e.alone(placed.center) for e in elements(placed.group)]
    alone = [p for p in every if p.group.name != placed.group.name]  # of S4 one generates all of it
    return [p for p, needs in zip(alone, glances(surface, alone, most), strict=True) if needs < most]


def _joined_at_once(surface: Surface, pool: Pool, start: Placed) -> Pool:
    """The pool where a candidate and the largest group hold together as far as noise tells: no need to part them.

    Where the largest has it already and holds worse, that is the largest of those in it that need nothing. Of what is
    round and open any two mirrors through its axis make some fold, which says nothing and takes a whole fit to tell.
    """
    if surface.is_open and not pool.largest.group.is_finite and pool.largest.holds(start):
        return pool
    exact = [h for h in pool.small if h.need <= pool.nothing and h.elements] if pool.largest.holds(start) else []
    known = max(exact or [pool.largest], key=lambda h: size_of(h.placed))
    if known.holds(start) or has_all(start, known.placed):
        return pool
    both = generated(surface, [known.placed, start], pool.failed, known.iterations, ALIKE * pool.nothing)
    if both is None or is_loose(surface, both) or both.need > pool.nothing:
        return pool.with_failed(both)
    return replace(pool, small=(*pool.small, both)) if exact else replace(pool, largest=both)


def _grown(surface: Surface, pool: Pool, found: Hypothesis) -> Pool:
    """The pool with what was fitted, and its largest group joined to it, if both hold together, or else the larger."""
    if pool.has(found.placed, found.need) or is_loose(surface, found):
        return pool
    if found.need > pool.limit:
        return replace(pool, small=(*pool.small, found))
    both = join(surface, [pool.largest, found], pool.failed, ALIKE * pool.limit)
    if both is not None and not is_loose(surface, both) and both.need <= pool.limit:
        largest = both
    else:
        largest, pool = max(pool.largest, found, key=lambda h: size_of(h.placed)), pool.with_failed(both)
    # What is replaced may hold better than what takes its place.
    kept = [pool.largest] if largest is not pool.largest and pool.largest.elements else []
    return replace(pool, small=(*pool.small, *kept, found), largest=largest)
