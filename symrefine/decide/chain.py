"""The groups an object may have, one inside the next, by what they need to be forgiven.

Elements are joined in the order of what they need, the exact ones first. So the group grows with the tolerance, what is
exact stays in it, and the group at any tolerance is read from the same table.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter

from symrefine.decide.hypotheses import NOTHING, Hypothesis, doubtless, fitted, has_all, hidden_need, single
from symrefine.decide.joins import better_parts, is_loose, join, size_of
from symrefine.decide.looks import COARSE, by_chance
from symrefine.decide.place import is_told, least_elsewhere, told_apart
from symrefine.decide.pool import Pool
from symrefine.decide.posterior import ALIKE, ALONE, lenience
from symrefine.fit.placed import Placed, joined
from symrefine.rounding import DOUBLE, START_ERROR
from symrefine.samples import FOLLOWED
from symrefine.surface.surface import Surface

_need = attrgetter("need")


def chain(surface: Surface, pool: Pool, limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit.

    Those that no fit brings within the limit of the pool are only looked at: what larger tolerances would make of them.
    Where nothing comes near it, what comes nearest is fitted, if that may be within the limit here.
    """
    seen, surface = surface, surface.closed if pool.whole else surface
    turned_down = pool.turned_down()
    near = [h for h in turned_down if h.need <= COARSE * pool.limit]
    if not (near or pool.small):
        nearest = (h for h in turned_down[:FOLLOWED] if h.need <= ALIKE * limit * lenience(h.group.name))
        near = [fitted(surface, h.placed) for h in nearest]
    # What is hidden by noise, or by the least tolerance that is asked for, tells no two groups apart; nor does, of what
    # cameras saw a part of, what leaves no doubt, as a group needs the less the more of it is unseen.
    hidden = max(hidden_need(surface), pool.nothing / ALIKE, doubtless(surface) if surface.viewed else 0.0)
    worst = partial(_worst, hidden=hidden)
    # What does not hold within the limit had its better elements tried.
    holding = (h for h in (*pool.small, pool.largest) if h.need <= pool.limit)
    every = [*pool.small, *(part for h in holding for part in better_parts(h)), pool.largest, *near]
    rest = sorted((h for h in every if h.need <= hidden or not by_chance(seen, h.placed)), key=worst)
    known = [pool.largest, *pool.failed, *pool.small]
    links = [NOTHING, *[h for h in every if h.proven][:1]]
    while rest := [h for h in rest if not links[-1].holds(h.placed)]:
        here = links[-1]
        # A lone mirror is forgiven more, and is one by what the next group needs.
        most = max(limit, ALONE * here.need) if here.group.name == "Cs" else limit
        most *= 1.0 if here.elements else lenience(rest[0].group.name)
        if rest[0].need > most:
            break
        level = max(ALIKE * _asked(rest[0]), here.need, hidden)
        batch = [h for h in rest if _asked(h) <= level]
        found = join(surface, [here, *batch], known, most, pool.limit)
        if found is None or is_loose(surface, found) or not found.elements or _asked(found) > level:
            tried = [] if found is None else [found]
            for other in batch[:FOLLOWED]:
                one = join(surface, [here, other], [*known, *tried], most, pool.limit)
                tried += [] if one is None else [one]
            tried = [h for h in tried if not is_loose(surface, h)]
            known += tried
            found = _best(tried, hidden, hidden if surface.viewed else hidden_need(surface))
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
    told = [NOTHING]
    for link in links[1:]:
        part = _unbroken(surface, link)
        if part and part.holds(told[-1].placed) and not told[-1].holds(part.placed):
            need, elsewhere = min(max(part.need, told[-1].need), link.need), least_elsewhere(surface, part.placed)
            told.append(replace(part, need=need, elsewhere=elsewhere))
        told.append(link)
    return tuple(_beside_chance(surface, link) for link in told)


def _beside_chance(surface: Surface, link: Hypothesis) -> Hypothesis:
    """A link with how likely it is there by more than chance, where that says anything of it."""
    # Of a continuous group it was asked before, lest it be joined; of others it takes as long as a look.
    apart = told_apart(surface, link.placed, link.need) if link.group.is_finite else link.apart
    return link if apart == link.apart else replace(link, apart=apart)


def _unbroken(surface: Surface, found: Hypothesis) -> Hypothesis | None:
    """What stays of a group where something that no camera saw breaks a mirror that is no image of others.

    Of a mirror across an axis of order 3 or more that leaves what keeps the direction of the axis; of several mirrors
    that are all such, the one of which cameras saw most. Otherwise None, as of Cs and C2h, and where too little was
    seen to tell what is left.
    """
    group, lone = found.group, found.group.lone_mirrors() if surface.viewed else ()
    mirrors = [e for e in found.elements if e.operations.kind == "plane"]
    if len(lone) == 1 and group.symbol.fold > 2:
        axis = group.frame[2]
        kept = tuple(e for e in found.elements if all(axis @ m @ axis > 0.0 for m in e.operations.matrices))
        placed = joined([e.operations.alone(e.center) for e in kept]) if kept else None
        if placed is None or not is_told(placed, [(e.operations, e.coverage.supported) for e in kept]):
            return None
        return Hypothesis(placed=placed, elements=kept, need=max(e.need for e in kept))
    if 1 < len(mirrors) == len(lone):
        first, *others = sorted((single(e) for e in mirrors), key=lambda h: -h.supported)
        return replace(first, rivals=tuple(h.placed for h in others))
    return None


def _asked(found: Hypothesis) -> float:
    """What a group needs, if nobody believed more of a lone mirror than of others because it is forgiven more."""
    belief = found.believed / lenience(found.group.name)
    return math.sqrt(max(found.need**2 - found.believed**2, 0.0) + belief**2)


def _worst(found: Hypothesis, hidden: float) -> tuple[float, float]:
    """What a group needs; of those that need no more than is hidden, the mean miss of its worst element.

    For as much of the surface as speaks for it: what is mostly unseen hardly misses.
    """
    mean = max((e.deviation.mean for e in found.elements), default=0.0)
    return max(_asked(found), hidden), mean / max(found.supported, DOUBLE)


def _best(tried: Sequence[Hypothesis], hidden: float, noise: float) -> Hypothesis | None:
    """Of groups that do not hold together the one that needs least; of those that need as good as nothing the largest.

    By chance fewer operations hold than many. Of those as large it is the one that misses least in the mean; how many
    others there are that need as little, or as little as noise, tells how sure it is. Each of two that are one may be
    off: of what is round but for a label noise leaves any mirror near its own.
    """

    def is_in(one: Placed, other: Placed) -> bool:
        # Of many folds a turn less than that is another.
        apart_rad = 0.25 * math.pi / max(other.group.symbol.fold, 1.0)
        return has_all(other, one, max(START_ERROR, min(2.0 * START_ERROR, apart_rad)))

    def rank(found: Hypothesis) -> tuple[float, float, float]:
        need, mean = _worst(found, hidden)
        return need, -size_of(found.placed), mean

    best = min((h for h in tried if h.elements), key=rank, default=None)
    if best is None:
        return None
    apart, most = [best.placed], max(ALIKE * _asked(best), noise)
    for other in sorted((h for h in tried if h.elements and _asked(h) <= most), key=rank):
        apart += [] if any(is_in(p, other.placed) or is_in(other.placed, p) for p in apart) else [other.placed]
    return replace(best, rivals=tuple(apart[1:]))


def excluding(links: Sequence[Hypothesis], limit: float) -> tuple[Hypothesis, ...]:
    """Links of a chain without rivals of another name that a larger group within the limit holds as well."""

    def alone(link: Hypothesis, larger: Sequence[Hypothesis]) -> Hypothesis:
        both = [h for h in larger if h.need <= limit]
        kept = [r for r in link.rivals if r.group.name == link.group.name or not any(h.holds(r) for h in both)]
        return replace(link, rivals=tuple(kept))

    return tuple(alone(link, links[i + 1 :]) if link.rivals else link for i, link in enumerate(links))
