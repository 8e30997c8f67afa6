"""Looks at candidates, before they are fitted in earnest: by a few operations on a few points, or by a short fit.

Most candidates are hopeless, and seen to be so at a glance. Where surface is missing a look also moves a group to where
edges say that it belongs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.fit.placed import FREE_TURNS, Placed, elements, evenly
from symrefine.fit.refine import SHORT, Iterate, refine
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array, Isometry, Mask, rotation
from symrefine.groups.names import far_steps
from symrefine.propose.votes import AGREE_RAD
from symrefine.rounding import DOUBLE, START_ERROR
from symrefine.samples import COUNT, GLANCE, LOOK
from symrefine.surface.misses import LIMITS, RIM, SURE
from symrefine.surface.surface import Surface

# A fit that is not settled may need so many times what it does then.
COARSE = 3.5
# A glance allows for the worst of the operations of a group that it takes: without, the share that details may have
# (0.6 %) is less than one of its points, and a single stray among them turns down every candidate.
GLANCED = 4
# Steps to either side that a group is moved: of 0.02 RMS radii, some four to a valley at the usual tolerance. Of one
# that is narrower its slopes tell as much.
ASIDE = 7


def glances(
    surface: Surface, starts: Sequence[Placed], most: float = math.inf, *, sources: int = GLANCE
) -> list[float]:
    """What each of several groups needs, as a few operations tell on a few points; from `most` on a lower bound."""
    each = [few_motions(s) for s in starts]
    owner = np.repeat(np.arange(len(starts)), [len(motions) for motions in each])
    every, found = [m for motions in each for m in motions], np.zeros(len(starts))
    if every:
        needs = surface.needs(every, sources=sources, most=most, discs=1, tests=GLANCED)
        np.maximum.at(found, owner, needs)
    return found.tolist()


def few_motions(placed: Placed) -> list[Isometry]:
    """The operations of a few elements of a group where it stands."""
    parts = elements(placed.group)
    return [m for part in parts[:: max(1, len(parts) // GLANCED)] for m in part.motions(placed.center)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """A group where a fit on a few points put it, what it needs by them, and how far off it may stand (radians)."""

    placed: Placed
    history: tuple[Iterate, ...]
    needs: float
    error_rad: float


def looked_at(
    surface: Surface,
    start: Placed,
    most: float,
    known: Callable[[Placed], bool] = lambda _: False,
    *,
    useful: float = math.inf,
    follow: float = math.inf,
) -> Look:
    """A fit on a few points; one that needs more than `most` after `SHORT` steps ends, and is judged by fewer.

    One that comes to what is `known` to need nothing ends there, and one that wherever the fit goes will need more than
    is worth to `follow`. What it asks to believe in is needed as well, and one that asks for more than is `useful`, or
    needs more wherever it is moved sideways, stays where the fit put it.
    """
    state, error, history = start.roughly_framed(), start_error(surface), list[Iterate]()
    stride = look_stride(surface, len(state.standard))
    for iterate in refine(surface.cloud, state, start_error_rad=error, stride=stride):
        history.append(iterate)
        if iterate.converged or iterate.index < SHORT:
            continue
        here = start.moved(iterate.state)
        if known(here):
            needs, asked = 0.0, _told(surface, here, LOOK)[1]
            break
        if iterate.index == SHORT:
            # No image is farther off than by twice what the group may be, as of a mirror.
            reach = 2.0 * min(error, RIM * iterate.step) / surface.diagonal if follow < math.inf else 0.0
            needs, asked, least = _told(surface, here, GLANCE, reach)
            if needs > most:
                break
            if least > follow:
                needs = needs if surface.is_open else seems(surface, here)
                break
    else:
        needs, asked, _ = _told(surface, start.moved(iterate.state), LOOK)
        # Where noise is as thick as a surface it may draw a fit away, step by step.
        if not iterate.converged and (stayed := seems(surface, start)) < needs:
            aside, needs = slid(surface, start, stayed, useful)
            return Look(placed=aside, history=tuple(history[:1]), needs=needs, error_rad=error)
        if needs > useful and not surface.is_open:
            there = least_around(surface, start, history)
            needs, aside = min((needs, start.moved(iterate.state)), (seems(surface, there), there), key=lambda k: k[0])
            return Look(placed=aside, history=tuple(history), needs=needs, error_rad=error)
    off = max(iterate.step, math.sqrt(max(float(np.diag(iterate.covariance).max()), 0.0)))
    aside = start.moved(iterate.state)
    # Where it asks to believe in too much it is not worth a search, and where little is missing most of it tells.
    if asked <= useful and surface.lacks_much:
        aside, needs = slid(surface, aside, needs, useful)
    needs = math.hypot(needs, asked)
    return Look(placed=aside, history=tuple(history), needs=needs, error_rad=min(error, RIM * off))


def look_stride(surface: Surface, operations: int) -> int:
    """Stride that leaves local planes enough for a fit of so many operations on a few points."""
    return surface.stride(max(GLANCE, LOOK // operations), matched=True)


def least_around(surface: Surface, start: Placed, history: Sequence[Iterate], sources: int = GLANCE) -> Placed:
    """Where a fit passed, or may as well have come to, a group seems to need least, by a few points.

    What is round but for a handle is turned about its axis by noise of all of it: the fit passes where the handle is
    met, and goes on to where the rest agrees a little better. So places are asked along the direction that it tells
    least, as far as it may be off there; and farther, twice as far each time, as long as nothing is better: of a spring
    only its ends tell how far along its own screw the axis lies.
    """
    end = history[-1]
    variance, ways = np.linalg.eigh(end.covariance)
    off = math.sqrt(max(float(variance[-1]), 0.0))

    def aside(k: float) -> Placed:
        return start.moved(end.state.moved(k * off * ways[:, -1]))

    passed, needs = [start.moved(i.state) for i in history], dict[float, float]()
    least, best = min(zip(glances(surface, passed, sources=sources), passed, strict=True), key=lambda k: k[0])
    asked = [k for k in np.arange(-RIM, RIM + 1.0).tolist() if k]
    while asked:
        needs |= zip(asked, glances(surface, [aside(k) for k in asked], sources=sources), strict=True)
        lowest = min(needs.values())
        there = sorted(k for k in needs if needs[k] == lowest)
        ends = {k for k in there if k in (min(needs), max(needs)) and abs(k) * off < math.pi}
        asked = [2.0 * k for k in ends if lowest < least]
    return aside(there[len(there) // 2]) if lowest < least else best


def slid(surface: Surface, placed: Placed, needs: float, useful: float = math.inf) -> tuple[Placed, float]:
    """A group that seems to need so much, moved sideways to where it needs least; of open surfaces only.

    Of a sofa one view shows no two sides that a mirror exchanges, and where their middle is no pair of local planes
    tells: the edges of the seat do, which have to meet one another. Where it needs no less than it does, and than is
    `useful`, it stays.
    """
    if not surface.is_open or not exact_need(surface.floor) < needs <= mended(surface):
        return placed, needs
    steps = start_error(surface) / ASIDE * np.arange(-ASIDE, ASIDE + 1.0)
    for way in _sideways(placed):
        most = min(needs, useful)  # where it needs more it will not go
        needs_there = _valley(surface, placed, way, steps, most)
        found = _lowest(steps, needs_there, surface.tolerance) if needs_there.min() <= most else 0.0
        moved = replace(placed, center=placed.center + found * way)
        if found != 0.0 and (least := seems(surface, moved)) < needs:
            placed, needs = moved, least
    return placed, needs


def _valley(surface: Surface, placed: Placed, way: Array, steps: Array, useful: float) -> Array:
    """What a group needs [N] where it is moved along a way by steps [N], where that is least; elsewhere a lower bound.

    No image moves by more than the group does, times what its operation makes of the way. So from what it misses by in
    one place follows what it misses by at least in others, as far as the same is seen there: those that need too much
    are not asked.
    """
    still = np.eye(3)
    pace = np.array([np.linalg.norm((still - m.matrix) @ way) for m in few_motions(placed)]) / surface.diagonal
    needs, asked = np.zeros(len(steps)), np.zeros(len(steps), dtype=bool)
    here = len(steps) // 2
    while True:
        motions = few_motions(replace(placed, center=placed.center + steps[here] * way))
        misses = surface.misses(motions, sources=GLANCE, discs=1)
        seen = surface.seen(misses, motions, sources=GLANCE)
        asked[here] = True
        needs[here] = surface.needed(seen, motions, GLANCED).max()
        ground = float(needs[asked].min())
        most = min(ground + surface.tolerance, useful)
        bound, far, away = float(needs[here]), steps[1] - steps[0], np.abs(steps - steps[here])
        while bound > most and far < 2.0 * (steps[-1] - steps[0]):
            nearer = np.maximum(seen - far * pace[:, None], 0.0)
            bound = float(surface.needed(nearer, motions, GLANCED).max())
            within = ~asked & (away < far + ROUNDED)
            needs[within] = np.maximum(needs[within], bound)
            far *= 2.0
        wanted = ~asked & (needs <= most)
        if not wanted.any() and ground <= useful:  # between which slopes the valley lies
            low = np.flatnonzero(asked & (needs == ground))
            rims = [_rim(needs, low[0], ground + surface.tolerance, side) for side in (-1, 1)]
            wanted[[r for r in rims if 0 <= r < len(steps) and not asked[r]]] = True
        if not wanted.any():
            return needs
        apart = np.abs(steps[:, None] - steps[asked]).min(axis=1)
        here = int(np.lexsort((-apart, needs, ~wanted))[0])


def _lowest(places: Array, needs: Array, level: float) -> float:
    """The middle of the valley of needs [N] along places [N], by where its slopes pass a level above its ground.

    The ground itself is flat, as what noise explains needs nothing.
    """
    least = int(needs.argmin())
    ends = []
    for side in (-1, 1):
        rim = _rim(needs, least, needs[least] + level, side)
        if not 0 <= rim < len(needs):
            return float(places[least])
        part = (needs[rim] - needs[least] - level) / (needs[rim] - needs[rim - side])
        ends.append(places[rim] + part * (places[rim - side] - places[rim]))
    return float(0.5 * (ends[0] + ends[1]))


def _rim(needs: Array, least: int, level: float, side: int) -> int:
    """The first place to a side of the least of needs [N] that needs more than a level; beyond all if none does."""
    rim = least + side
    while 0 <= rim < len(needs) and needs[rim] <= level:
        rim += side
    return rim


def _sideways(placed: Placed) -> Array:
    """Directions [k, 3] in which the centre of a group moves its elements, and does not glide along them."""
    moves = [np.eye(3) - m.matrix for m in few_motions(placed)]
    values, vectors = np.linalg.eigh(sum((m.T @ m for m in moves), np.zeros((3, 3))))
    return np.asarray(vectors[:, values > ROUNDED * values[-1]].T)


def seems(surface: Surface, placed: Placed) -> float:
    """What a group where it stands needs, as a few operations tell on a few points."""
    return float(surface.needs(few_motions(placed), sources=LOOK, tests=GLANCED, together=True).max())


def unmet_by(surface: Surface, placed: Placed, sources: int) -> Mask:
    """Which of about so many local planes most of a few operations of a group carry to where nothing is."""
    motions = few_motions(placed)
    misses = surface.seen(surface.misses(motions, sources=sources), motions, sources=sources)
    return np.asarray((np.nan_to_num(misses) > surface.far).mean(axis=0) > 0.5)


def by_chance(surface: Surface, placed: Placed) -> bool:
    """Whether a fold is none of the object: turns by parts of it more are met as well, for all that a sample tells.

    What is round but for something small is forgiven as it moves, by any turn: folds that miss it by less than all
    turns do are many, and say nothing. All turns go far, as noise that moves by little meets itself; what lies by the
    axis does not, and counts by how far aside it lies.
    """
    fold = placed.group.symbol.fold
    if not 1 < fold < math.inf:
        return False
    steps = np.array(evenly(far_steps(int(fold)), len(FREE_TURNS)))
    beyond = np.resize(steps, len(FREE_TURNS)) + FREE_TURNS / (2.0 * math.pi)
    turns = [rotation(placed.group.frame[2], 2.0 * math.pi / fold * k) for k in (*steps, *beyond)]
    motions = [Isometry.about(placed.center, turn) for turn in turns]
    for sources in (LOOK, COUNT):
        misses = np.nan_to_num(surface.seen(surface.misses(motions, sources=sources), motions, sources=sources))
        better = misses[len(steps) :].mean(axis=0) - misses[: len(steps)].mean(axis=0)
        points = surface.cloud.points[:: surface.stride(sources)] - placed.center
        aside = np.linalg.norm(np.cross(points, placed.group.frame[2]), axis=1)
        aside /= max(aside.sum(), DOUBLE)
        mean = aside @ better
        if mean > SURE * math.sqrt(aside**2 @ (better - mean) ** 2):
            return False
    return True


def mended(surface: Surface) -> float:
    """What a group may need at most that some start leads to where it needs nothing."""
    return 2.0 * start_error(surface) / (LIMITS[1] * surface.diagonal)  # a mirror takes what it is off by twice


def hopeless(error_rad: float) -> float:
    """What a candidate so far off may seem to need at a glance: half a diagonal is the longest lever."""
    return 0.5 * error_rad / LIMITS[0]


def start_error(surface: Surface) -> float:
    """How far a start may be off: moments know no more where surface is missing than votes do, nor than few samples."""
    if surface.is_open:
        return AGREE_RAD
    sampled = 0.0 if surface.cloud.body == "atoms" else SURE / math.sqrt(len(surface.cloud.points))
    return max(START_ERROR, sampled)


def _told(surface: Surface, placed: Placed, sources: int, reach: float = 0.0) -> tuple[float, float, float]:
    """What a group needs where it stands as it `seems`, to be believed where nobody looked, and at least near there.

    Half of the operations of a group have to be believed, or more: the others follow. Near is where images are no more
    than `reach` away, a fraction of the diagonal.
    """
    motions = few_motions(placed)
    seen = surface.seen(surface.misses(motions, sources=sources), motions, sources=sources, together=True)
    needs = float(surface.needed(seen, motions, GLANCED).max())
    # Misses end early on open surfaces, so that a group may need more than it seems to.
    least = float(surface.needed(np.maximum(seen - reach, 0.0), motions, GLANCED).max()) if reach else needs
    if not surface.is_open or surface.viewed:
        return needs, 0.0, least
    each = [surface.coverage(miss[None], [m], sources=sources).belief for miss, m in zip(seen, motions, strict=True)]
    return needs, surface.tolerance * sorted(each)[len(each) // 2], least


def exact_need(floor: float) -> float:
    """The need up to which noise, which alone needs `floor`, or the rounding of coordinates tells nothing apart."""
    return max(ROUNDED, 0.5 * floor)
