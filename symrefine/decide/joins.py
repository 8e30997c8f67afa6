"""What hypotheses generate together: fitted unless it is known, and told by few points where it is hopeless."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from symrefine.decide.hypotheses import NOTHING, Hypothesis, fitted, has_all, roughly_judged, single
from symrefine.decide.looks import COARSE, by_chance, looked_at
from symrefine.decide.place import nowhere
from symrefine.decide.pool import is_at
from symrefine.decide.posterior import ALIKE
from symrefine.fit.placed import Placed, joined
from symrefine.groups import PointGroup
from symrefine.rounding import START_ERROR
from symrefine.surface.surface import Surface


def join(
    surface: Surface, parts: list[Hypothesis], known: Iterable[Hypothesis], most: float, close: float = math.inf
) -> Hypothesis | None:
    """The group that hypotheses generate, fitted unless it is one of them or known; None if they generate none.

    One that seems to need more than `most` is told without elements; one that no fit brings to `close`, by few points.
    """
    placed = [h.placed for h in parts if h is not NOTHING]
    return generated(surface, placed, (*parts, *known), max(h.iterations for h in parts), most, close)


def generated(
    surface: Surface,
    parts: Sequence[Placed],
    known: Sequence[Hypothesis],
    before: int,
    most: float,
    close: float = math.inf,
) -> Hypothesis | None:
    """The group that parts generate, fitted after so many iterations unless it is one of those known; see `join`."""
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
    if look.needs > ALIKE * close:
        return roughly_judged(surface, look, before=before)
    return fitted(surface, look.placed, error_rad=look.error_rad, before=before)


def is_loose(surface: Surface, found: Hypothesis) -> bool:
    """Whether what was seen does not tell that a group holds, or where: as likely as not it holds elsewhere as well.

    Of atoms that are no more likely than not to have it, whatever it needs, nothing was.
    """
    return not found.told or found.elsewhere <= nowhere(surface) or found.apart < 0.5


def size_of(placed: Placed) -> float:
    """How many operations a group has, as far as sizes are compared."""
    return placed.group.order if placed.group.is_finite else 100.0


def better_parts(found: Hypothesis) -> list[Hypothesis]:
    """The elements of a group, where it has several, that need less than all of it does, each alone."""
    return [single(e) for e in found.elements if ALIKE * e.need < found.need] if len(found.elements) > 1 else []


def _told_apart(surface: Surface, placed: Placed | None, parts: Sequence[Placed]) -> Placed | None:
    """What parts generate, or the continuous group about its axis where the fold is none of theirs and says nothing.

    Any two mirrors of something round make some fold, and two that are one a large one.
    """
    if placed is None:
        return None
    fold = placed.group.symbol.fold
    if any(fold <= p.group.symbol.fold for p in parts):
        return placed
    return endless(placed) if math.inf > fold > math.pi / START_ERROR or by_chance(surface, placed) else placed


def endless(placed: Placed) -> Placed:
    """The continuous group about the axis of a group."""
    name = "Cinfv" if placed.group.symbol.family in ("C", "Cv") else "Dinfh"
    return replace(placed, group=PointGroup(name=name, frame=placed.group.frame))
