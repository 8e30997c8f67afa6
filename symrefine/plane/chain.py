"""The groups an object in the plane may have, one inside the next, by what they need to be forgiven."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.decide.chain import ALIKE, EXACT
from symrefine.geometry import Isometry
from symrefine.plane.outline import NOISES, Outlines
from symrefine.plane.placed import SAME_RAD, START_ERROR, Placed, fitted
from symrefine.surface.misses import LIMITS, Deviation

# The largest fold that is looked for; directions of lines that are looked at, points of each outline that a look takes,
# and how many lines, and how many folds, those that look best, are fitted.
MAX_FOLD, ANGLES, LOOK, BEST = 36, 180, 300, 10
# What being off by START_ERROR adds to what a start needs: half a diagonal is the longest lever.
MISPLACED = 0.5 * START_ERROR / LIMITS[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Element:
    """A mirror line (D1), or all turns of a group (Cn, or O(2)), with their miss and the tolerances that they need.

    `needs` has one for each of `NOISES`, the measured one first.
    """

    placed: Placed
    deviation: Deviation
    needs: tuple[float, ...]

    @property
    def need(self) -> float:
        """The smallest tolerance at which it holds."""
        return self.needs[0]

    @property
    def is_line(self) -> bool:
        """Whether it stands for one mirror line."""
        return self.placed.mirrored and math.isfinite(self.placed.fold)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A group where it fits best: its elements judged, and what the worst of them needs, whatever the noise."""

    placed: Placed
    elements: tuple[Element, ...]
    needs: tuple[float, ...]

    @property
    def need(self) -> float:
        """The smallest tolerance at which it holds."""
        return self.needs[0]


NOTHING = Hypothesis(placed=Placed(fold=1, mirrored=False, center=np.zeros(2)), elements=(), needs=(0.0,) * len(NOISES))


def explore(outlines: Outlines, hint_rad: float | None, limit: float) -> tuple[Hypothesis, ...]:
    """Fit and judge what a look at the outlines proposes: lines, turns, both together, and all of them.

    Args:
        hint_rad: the line of the doublets, where they have one.
        limit: what starts that are worth a fit may need, as a fraction of the diagonal.
    """
    limit += MISPLACED
    endless = _judged(outlines, Placed(fold=math.inf, mirrored=True, center=np.zeros(2)))
    angles = [*([] if hint_rad is None else [hint_rad]), *_angles(outlines)]
    lines = list(_distinct(outlines, (_line_at(a) for a in angles), limit))
    crossing = [h for h in lines if h.need <= limit]
    turns = list(_distinct(outlines, sorted([*_implied(crossing), *_folds(outlines)], key=lambda p: -p.fold), limit))
    both = list(_distinct(outlines, _products([h for h in turns if h.need <= limit], lines), limit))
    return endless, *lines, *turns, *both


def _line_at(angle_rad: float) -> Placed:
    return Placed(fold=1, mirrored=True, center=np.zeros(2), angle_rad=angle_rad)


def _angles(outlines: Outlines) -> Iterator[float]:
    """Directions of the mirror lines through the centroid that look best, better than those beside them."""
    angles = np.pi * np.arange(ANGLES) / ANGLES
    normals = np.column_stack([-np.sin(angles), np.cos(angles)])
    matrices = np.eye(2) - 2.0 * normals[:, :, None] * normals[:, None, :]
    looks = outlines.glances([Isometry.about(np.zeros(2), m) for m in matrices], LOOK)
    lowest = np.flatnonzero((looks < np.roll(looks, 1)) & (looks <= np.roll(looks, -1)))
    yield from (float(angles[k]) for k in lowest[np.argsort(looks[lowest], kind="stable")][:BEST])


def _folds(outlines: Outlines) -> Iterator[Placed]:
    """The turns about the centroid that look best."""
    starts = [Placed(fold=n, mirrored=False, center=np.zeros(2)) for n in range(2, MAX_FOLD + 1)]
    looks = outlines.glances([p.wide_turn() for p in starts], LOOK)
    yield from (starts[k] for k in np.argsort(looks, kind="stable")[:BEST])


def _implied(lines: Sequence[Hypothesis]) -> Iterator[Placed]:
    """The turns that the line that needs least makes with each other one: by twice their angle, where they cross."""
    first, *others = sorted(lines, key=lambda h: h.need)[:BEST] or [NOTHING]
    for other in others:
        (a,), (b,) = first.placed.lines(), other.placed.lines()
        angle = (other.placed.angle_rad - first.placed.angle_rad) / math.pi
        folds = range(2, MAX_FOLD + 1)
        fold = next((n for n in folds if abs(n * angle - round(n * angle)) * math.pi < n * SAME_RAD / 2.0), None)
        if fold is not None:
            center = np.linalg.solve([a.normal, b.normal], [a.offset, b.offset])
            yield Placed(fold=fold, mirrored=False, center=center)


def _products(turns: Sequence[Hypothesis], lines: Sequence[Hypothesis]) -> Iterator[Placed]:
    """Each of the turns with the line that needs least."""
    line = min(lines, key=lambda h: h.need, default=None)
    if line is not None:
        yield from (replace(h.placed, mirrored=True, angle_rad=line.placed.angle_rad) for h in turns)


def _distinct(outlines: Outlines, starts: Iterable[Placed], limit: float) -> Iterator[Hypothesis]:
    """The starts fitted and judged, but for those that miss by far, or that a group has that was fitted before them."""
    seen: list[Hypothesis] = []

    def known(placed: Placed) -> bool:
        """Whether a group fitted before is the same, or has it and holds exactly."""
        return any(h.placed.holds(placed) and (h.need <= EXACT or h.placed.order == placed.order) for h in seen)

    for start in starts:
        if known(start):
            continue
        if outlines.need(start.generators()[-1:]) > limit:
            continue
        found = _judged(outlines, start)
        if not known(found.placed):
            seen.append(found)
            yield found


def _judged(outlines: Outlines, start: Placed) -> Hypothesis:
    """The group fitted as a whole, and each of its elements judged."""
    placed = fitted(outlines, start)
    if placed.order == 2 and placed.mirrored:
        (line,) = placed.lines()
        placed = replace(placed, center=line.offset * line.normal)
    parts: list[tuple[Placed, Sequence[Isometry]]] = []
    if placed.mirrored:
        parts += [(_line(placed, k), [Isometry.reflection(line)]) for k, line in enumerate(placed.lines())]
    if placed.fold > 1:
        parts.append((replace(placed, mirrored=False) if math.isfinite(placed.fold) else placed, placed.turns()))
    judged = [(p, *outlines.judged(m)) for p, m in parts]
    found = tuple(Element(placed=p, deviation=d, needs=needs) for p, d, needs in judged)
    return Hypothesis(placed=placed, elements=found, needs=_largest(e.needs for e in found))


def _largest(needs: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    return tuple(map(max, zip(*needs, strict=True)))


def _line(placed: Placed, index: int) -> Placed:
    """The mirror line of a group by its place in `lines`, as a group of its own."""
    return replace(placed, fold=1, angle_rad=placed.group.angle_rad + math.pi * index / placed.fold)


def chain(outlines: Outlines, pool: Sequence[Hypothesis], limit: float) -> tuple[Hypothesis, ...]:
    """Groups from C1 upwards, each inside the next, by what they need; the last one may be beyond the limit."""
    links = [NOTHING]
    while beyond := [h for h in pool if h.placed.order > links[-1].placed.order and h.placed.holds(links[-1].placed)]:
        here, least = links[-1], min(h.need for h in beyond)
        level = max(ALIKE * least, here.need, EXACT, 0.5 * outlines.floor)
        found = max((h for h in beyond if h.need <= level), key=lambda h: (h.placed.order, -h.need))
        links.append(replace(found, needs=_largest((found.needs, here.needs))))
        if found.need > limit:
            break
    return tuple(links)
