"""Looks at candidates, before they are fitted in earnest: by a few operations on a few points, or by a short fit.

Most candidates are hopeless, and seen to be so at a glance. Where surface is missing a look also moves a group to where
edges say that it belongs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.fit.placed import Placed, elements
from symrefine.fit.refine import SPREAD, Iterate, refine
from symrefine.fit.vertices import ROUNDED
from symrefine.geometry import Array, Isometry
from symrefine.propose.votes import AGREE_RAD
from symrefine.surface.misses import LIMITS
from symrefine.surface.surface import Surface

# Local planes that are moved: at a glance by each operation, in a fit at least; in a look by all together.
GLANCE, LOOK = 120, 600
# Steps of a look after which those that will not come near end.
SHORT = 2
# A glance allows for the worst of the operations of a group that it takes: without, the share that details may have
# (0.6 %) is less than one of its points, and a single stray among them turns down every candidate.
GLANCED = 4
# Steps to either side that a group is moved: of 0.02 RMS radii, some four to a valley at the usual tolerance. Of one
# that is narrower its slopes tell as much.
ASIDE = 7
# How far the moments may put a start wrong (radians, RMS radii; 0.04 was the most of 698 true ones).
START_ERROR = 0.05


def glances(surface: Surface, starts: Sequence[Placed], most: float = math.inf) -> list[float]:
    """What each of several groups needs, as a few operations tell on a few points; from `most` on a lower bound."""
    each = [few_motions(s) for s in starts]
    owner = np.repeat(np.arange(len(starts)), [len(motions) for motions in each])
    every, found = [m for motions in each for m in motions], np.zeros(len(starts))
    # Most candidates are hopeless, and seen to be so without a wide search; of an open surface none is made.
    for limit in (LIMITS[1], LIMITS[-1]) if surface.openings is None else LIMITS[-1:]:
        asked = np.flatnonzero(found[owner] < most)
        if asked.size:
            motions, bound = [every[i] for i in asked], limit * most
            needs = surface.needs(motions, sources=GLANCE, bound=bound, discs=1, tests=GLANCED)
            np.maximum.at(found, owner[asked], needs)
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

    @property
    def settled(self) -> bool:
        """Whether the fit came to its end."""
        return self.history[-1].converged


def looked_at(surface: Surface, start: Placed, most: float, known: Callable[[Placed], bool] = lambda _: False) -> Look:
    """A fit on a few points; one that needs more than `most` after `SHORT` steps ends, and is judged by fewer.

    One that comes to what is `known` to need nothing ends there, and needs nothing.
    """
    state, error, history = start.roughly_framed(), start_error(surface), []
    stride = surface.stride(max(GLANCE, LOOK // len(state.standard)))
    for iterate in refine(surface.cloud, state, start_error_rad=error, stride=stride):
        history.append(iterate)
        if iterate.converged or iterate.index < SHORT:
            continue
        here = start.moved(iterate.state)
        if known(here):
            needs = 0.0
            break
        if iterate.index == SHORT and (needs := _seems(surface, here, GLANCE)) > most:
            break
    else:
        needs = _seems(surface, start.moved(iterate.state), LOOK)
        # Where noise is as thick as a surface it may draw a fit away, step by step.
        if not iterate.converged and (stayed := _seems(surface, start, LOOK)) < needs:
            aside, needs = slid(surface, start, stayed)
            return Look(placed=aside, history=tuple(history[:1]), needs=needs, error_rad=error)
    off = max(iterate.step, math.sqrt(max(float(np.diag(iterate.covariance).max()), 0.0)))
    aside, needs = slid(surface, start.moved(iterate.state), needs)
    return Look(placed=aside, history=tuple(history), needs=needs, error_rad=min(error, SPREAD * off))


def slid(surface: Surface, placed: Placed, needs: float) -> tuple[Placed, float]:
    """A group that seems to need so much, moved sideways to where it needs least; of surfaces with openings only.

    Of a sofa one view shows no two sides that a mirror exchanges, and where their middle is no pair of local planes
    tells: the edges of the seat do, which have to meet one another.
    """
    farthest = start_error(surface)
    mends = 2.0 * farthest / (LIMITS[1] * surface.diagonal)  # a mirror takes what it is off by twice
    if surface.openings is None or not exact_need(surface.floor) < needs <= mends:
        return placed, needs
    steps = farthest / ASIDE * np.arange(-ASIDE, ASIDE + 1.0)
    for way in _sideways(placed):
        tried = [replace(placed, center=placed.center + step * way) for step in steps]
        found = _lowest(steps, np.array(glances(surface, tried)), surface.tolerance)
        moved = replace(placed, center=placed.center + found * way)
        if (least := _seems(surface, moved, LOOK)) < needs:
            placed, needs = moved, least
    return placed, needs


def _lowest(places: Array, needs: Array, level: float) -> float:
    """The middle of the valley of needs [N] along places [N], by where its slopes pass a level above its ground.

    The ground itself is flat, as what noise explains needs nothing.
    """
    least = int(needs.argmin())
    high = np.flatnonzero(needs > needs[least] + level)
    ends = []
    for last, inner in ((high[high < least][-1:], 1), (high[high > least][:1], -1)):
        if not last.size:
            return float(places[least])
        rim = int(last[0])
        part = (needs[rim] - needs[least] - level) / (needs[rim] - needs[rim + inner])
        ends.append(places[rim] + part * (places[rim + inner] - places[rim]))
    return float(0.5 * (ends[0] + ends[1]))


def _sideways(placed: Placed) -> Array:
    """Directions [k, 3] in which the centre of a group moves its elements, and does not glide along them."""
    moves = [np.eye(3) - m.matrix for m in few_motions(placed)]
    values, vectors = np.linalg.eigh(sum((m.T @ m for m in moves), np.zeros((3, 3))))
    return np.asarray(vectors[:, values > ROUNDED * values[-1]].T)


def _seems(surface: Surface, placed: Placed, sources: int) -> float:
    """What a group where it stands needs, as a few operations tell on a few points."""
    return float(surface.needs(few_motions(placed), sources=sources, tests=GLANCED, together=True).max())


def start_error(surface: Surface) -> float:
    """How far a start may be off: moments know no more where surface is missing than votes do."""
    return START_ERROR if surface.openings is None else AGREE_RAD


def exact_need(floor: float) -> float:
    """The need up to which noise, which alone needs `floor`, or the rounding of coordinates tells nothing apart."""
    return max(ROUNDED, 0.5 * floor)
