"""The groups an object in the plane may have, one inside the next, by what they need to be forgiven."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from symrefine.decide.looks import exact_need, hopeless
from symrefine.decide.posterior import ALIKE, NEAR
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array
from symrefine.groups import MAX_FOLD
from symrefine.groups.elements import DIRECTION_ERROR_RAD
from symrefine.plane.outline import NOISES, Outlines
from symrefine.plane.placed import Placed, fitted
from symrefine.rounding import START_ERROR
from symrefine.samples import LOOK
from symrefine.surface.misses import NO_MISS, Deviation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A group where it fits best: its miss and the tolerances that it needs, those of the worst of its elements.

    Its elements are hypotheses of their own: mirror lines (D1), and all turns of a group (Cn, or O(2)). `needs` has one
    tolerance for each of `NOISES`, the measured one first.
    """

    placed: Placed
    deviation: Deviation
    needs: tuple[float, ...]
    elements: tuple["Hypothesis", ...] = ()

    @property
    def need(self) -> float:
        """The smallest tolerance at which it holds."""
        return self.needs[0]


NOTHING = Hypothesis(
    placed=Placed(fold=1, mirrored=False, center=np.zeros(2)), deviation=NO_MISS, needs=(0.0,) * len(NOISES)
)


def explore(outlines: Outlines, hint_rad: float | None, limit: float) -> tuple[Hypothesis, ...]:
    """Fit and judge what a look at the outlines proposes: lines, turns, both together, and all of them.

    Args:
        hint_rad: the line of the doublets, where they have one.
        limit: what starts that are worth a fit may need, as a fraction of the diagonal.
    """
    limit += hopeless(START_ERROR)
    center = np.zeros(2)
    endless = _judged(outlines, Placed(fold=math.inf, mirrored=True, center=center))
    # So many directions that one is off by a quarter of what a start may be off by.
    angles = np.linspace(0.0, np.pi, math.ceil(2.0 * np.pi / START_ERROR), endpoint=False)
    looks = _looks(outlines, around := [Placed(fold=1, mirrored=True, center=center, angle_rad=a) for a in angles])
    # Only those better than the ones beside them.
    looks[(looks >= np.roll(looks, 1)) | (looks > np.roll(looks, -1))] = np.inf
    hint = [] if hint_rad is None else [replace(around[0], angle_rad=hint_rad)]
    lines = list(_distinct(outlines, [*hint, *_best(around, looks)], limit))
    crossing = [h for h in lines if h.need <= limit]
    folds = [Placed(fold=n, mirrored=False, center=center) for n in range(MAX_FOLD, 1, -1)]
    # Where several hold exactly the largest has all of them.
    looks = np.maximum(_looks(outlines, folds), ROUNDED * outlines.diagonal)
    spun = [*_implied(crossing), *_best(folds, looks)]
    turns = list(_distinct(outlines, sorted(spun, key=lambda p: -p.fold), limit))
    both = list(_distinct(outlines, _products([h for h in turns if h.need <= limit], lines), limit))
    return endless, *lines, *turns, *both


def _looks(outlines: Outlines, starts: Sequence[Placed]) -> Array:
    return outlines.glances([p.widest() for p in starts], LOOK)


def _best(starts: Sequence[Placed], looks: Array) -> list[Placed]:
    """The starts that look best, as many as are told of in the end."""
    return [starts[k] for k in np.argsort(looks, kind="stable")[:NEAR] if np.isfinite(looks[k])]


def _implied(lines: Sequence[Hypothesis]) -> Iterator[Placed]:
    """The turns that the line that needs least makes with each other one: by twice their angle, where they cross."""
    first, *others = sorted(lines, key=lambda h: h.need) or [NOTHING]
    for other in others:
        a, b = first.placed.line, other.placed.line
        angle = (other.placed.angle_rad - first.placed.angle_rad) / math.pi
        # From some fold on any angle is as near to one of its steps as directions are known.
        folds = range(2, math.ceil(0.5 * math.pi / DIRECTION_ERROR_RAD))
        fold = next((n for n in folds if abs(n * angle - round(n * angle)) * math.pi < n * DIRECTION_ERROR_RAD), None)
        if fold is not None:
            center = np.linalg.solve([a.normal, b.normal], [a.offset, b.offset])
            yield Placed(fold=fold, mirrored=False, center=center)


def _products(turns: Sequence[Hypothesis], lines: Sequence[Hypothesis]) -> Iterator[Placed]:
    """Each of the turns with the line that needs least."""
    line = min(lines, key=lambda h: h.need, default=None)
    if line is not None:
        yield from (replace(h.placed, mirrored=True, angle_rad=line.placed.angle_rad) for h in turns)


def _distinct(outlines: Outlines, starts: Iterable[Placed], limit: float) -> Iterator[Hypothesis]:
    """The starts fitted and judged, but for those that miss by far, or that a group has that was fitted before them.

    A fit may end beside where a group holds: what is the same but looks better than that is fitted as well.
    """
    seen: list[Hypothesis] = []

    def known(placed: Placed, needs: float) -> bool:
        """Whether a group fitted before has it and holds exactly, or is the same and needs no more."""
        return any(
            h.placed.holds(placed)
            and (h.need <= ROUNDED or (h.placed.order == placed.order and h.need <= ALIKE * needs))
            for h in seen
        )

    for start in starts:
        if known(start, 0.0):
            continue
        needs = outlines.need([start.widest()])
        if needs > limit or known(start, needs):
            continue
        found = _judged(outlines, start)
        if not known(found.placed, found.need):
            seen.append(found)
            yield found


def _judged(outlines: Outlines, start: Placed) -> Hypothesis:
    """The group fitted as a whole, and each of its elements judged."""
    placed = fitted(outlines, start)
    if placed.is_line:
        placed = replace(placed, center=placed.line.offset * placed.line.normal)
    judged = [(p, *outlines.judged(p.operations())) for p in placed.elements()]
    found = tuple(Hypothesis(placed=p, deviation=d, needs=needs) for p, d, needs in judged)
    worst = reduce(Deviation.at_least, (e.deviation for e in found))
    return Hypothesis(placed=placed, deviation=worst, needs=_largest(e.needs for e in found), elements=found)


def _largest(needs: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    return tuple(map(max, zip(*needs, strict=True)))


def chain(outlines: Outlines, pool: Sequence[Hypothesis], limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit."""
    links = [NOTHING]
    while beyond := [h for h in pool if h.placed.order > links[-1].placed.order and h.placed.holds(links[-1].placed)]:
        here, least = links[-1], min(h.need for h in beyond)
        level = max(ALIKE * least, here.need, exact_need(outlines.floor))
        found = max((h for h in beyond if h.need <= level), key=lambda h: (h.placed.order, -h.need))
        links.append(replace(found, needs=_largest((found.needs, here.needs))))
        if found.need > limit:
            break
    return tuple(links)
