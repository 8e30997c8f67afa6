"""Alignment of surfaces that share a part only: no centroid, both determinants at once.

Local planes of either side that look alike whichever way they are turned or mirrored -> maps that many of them agree
upon -> the polish on the points -> what each map lays on the other side, where that says no, and where nobody looked.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.align.alignment import OK, OPEN
from symrefine.align.judge import Judge, Met
from symrefine.align.pair import Evidence
from symrefine.align.revolved import Turns, shown_by, turns_between
from symrefine.decide.maps import ahead, as_good, fits, said_by_both


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Meeting:
    """The map that two surfaces which share a part agree upon best.

    Attributes:
        best: the map; of those that do about as well the one that both surfaces together say most for.
        equals: the others.
        confidence: probability that it is right, or one of those.
        determinant_confidence: probability that its determinant is.
        slides: whether it does as well where it slides or turns a little.
        status: "ok", or why it should not be relied upon.
        turns: what it is right up to, of parts of a body of revolution.
    """

    best: Met
    equals: tuple[Met, ...]
    confidence: float
    determinant_confidence: float
    slides: bool
    status: str
    turns: Turns | None = None


def partial_meeting(evidence: Evidence, *, reflections: bool, factor: float = 1.0) -> Meeting | None:
    """How two surfaces meet that share a part only; None where nothing suggests that they do.

    Maps of either determinant are tried; without `reflections` those of -1 are rivals only. `factor` is the size of the
    source in units of the target.
    """
    unit = evidence.target.moments.scale
    sides = evidence.source, evidence.target
    judge = Judge.of(sides, (unit / factor, unit), evidence.tolerance, evidence.seed)
    if judge is None:
        return None
    starts = judge.promising()
    found = judge.polished_all([], starts)
    if not any(m.is_promising for m in found):
        found = judge.polished_all([], starts, patient=True)
    if not (admitted := [m for m in found if reflections or m.determinant > 0]):
        proper = [s for s in starts if np.linalg.det(s.matrix) > 0.0]
        admitted = [] if reflections else judge.polished_all([], proper, patient=True)
        found += admitted
    if not admitted:
        return None
    best = max(admitted, key=lambda m: m.score)
    if best.is_promising:
        found = judge.polished_all(found, judge.mirrored(best))
        images = judge.images(best)
        found = judge.closed(judge.polished_all(judge.not_short_of(found, images), images, error=judge.beside), best)
        best = max((m for m in found if reflections or m.determinant > 0), key=lambda m: m.score)
    ridge = best
    best, slid = judge.uphill(ridge)
    rivals = [m for m in found if m is not ridge and not judge.same(m.motion, best.motion)]  # what leads to it is none
    open_ = judge.source.openings.evident or judge.target.openings.evident
    rivals = sorted(rivals, key=lambda m: -m.score)
    met = _weighed(best, rivals, math.inf if best.is_loose else slid, reflections=reflections, open_=open_)
    if not (met.slides and best.is_promising):
        return met
    turns = turns_between(shown_by(evidence, best), evidence, best.motion, factor)
    return met if turns is None else _but_for(turns, judge, best, rivals, reflections=reflections, open_=open_)


def _but_for(
    turns: Turns, judge: Judge, best: Met, rivals: Sequence[Met], *, reflections: bool, open_: bool
) -> Meeting:
    """How sure the best map is where those that differ from it by turns of the objects themselves are one with it."""
    related = [r for r in rivals if turns.relate(judge, best, r)]
    others = [r for r in rivals if r not in related]
    if best.determinant < 0:
        best = _first([best, *related])
    if best.determinant < 0 and as_good(best.score, (image := judge.polished(turns.mirrored(best.motion))).score):
        best = image
    slid = judge.aside(best, turns.across(best.motion))[1]
    met = _weighed(best, others, slid, reflections=reflections, open_=open_)
    across = turns.across(met.best.motion)
    sure, status = met.confidence * turns.confidence, met.status
    if status == OK and sure <= 0.5:
        status = f"{OPEN}: what the objects share turns in itself, they may not"
    return replace(
        met,
        best=replace(met.best, covariance=across @ met.best.covariance @ across),
        confidence=sure,
        status=status,
        turns=turns,
    )


def _weighed(best: Met, rivals: Sequence[Met], slid: float, *, reflections: bool, open_: bool) -> Meeting:
    """How sure the best map is, or those that do as well, given its rivals and how well it does where it is slid.

    A map of a determinant that is not admitted tells against them only where it does better.
    """
    fitting = fits(best.sides)
    admitted = [r for r in rivals if reflections or r.determinant > 0]
    barred = max((r.score for r in rivals if r not in admitted), default=-math.inf)
    reflected = ahead(barred, [best.score])
    alike = [r for r in admitted if as_good(best.score, r.score) and as_good(r.score, best.score)]
    others = [r.score for r in admitted if r not in alike]
    slides = ahead(best.score, [slid]) < 0.5
    first = _first([best, *alike])
    rest = [(m, said_by_both(m.sides)) for m in (best, *alike) if m is not first]
    # What one side alone takes for as good the other one may deny.
    most = said_by_both(first.sides)
    equals = tuple(m for m, said in rest if as_good(most, said))
    denied = [said for _, said in rest if not as_good(most, said)]
    leads = ahead(best.score, [*others, slid]) * ahead(most, denied) * (1.0 - reflected)
    certain = 0.0 if slides else fitting * leads
    other_hand = [m.score for m in (best, *rivals) if m.determinant != first.determinant]
    return Meeting(
        best=first,
        equals=equals,
        confidence=certain,
        # Where nothing fits, either is as likely; where one is not admitted, nobody asks.
        determinant_confidence=0.5 + fitting * (max(ahead(first.score, other_hand), 0.5) - 0.5) if reflections else 1.0,
        slides=slides,
        status=OK if certain > 0.5 else _doubt(best, rivals, fitting, slides, open_, reflected),
    )


def _first(every: Sequence[Met]) -> Met:
    """Of maps that do about as well the one that both sides say most for; a rotation where nothing tells the hand."""
    first, *others = sorted(every, key=lambda m: -said_by_both(m.sides))
    if first.determinant > 0:
        return first
    most = said_by_both(first.sides)
    level = (m for m in others if most - said_by_both(m.sides) < math.hypot(first.sigma, m.sigma))
    return next((m for m in level if m.determinant > 0), first)


def _doubt(best: Met, rivals: Sequence[Met], fitting: float, slides: bool, open_: bool, reflected: float) -> str:
    """Why the best map is not to be relied upon; nothing where the objects do not fit, and nothing may be missing."""
    if any(not as_good(r.score, best.score) for r in rivals) or (fitting < 0.5 and not open_):
        return ""
    if slides:
        return f"{OPEN}: what the objects share may slide or turn in itself"
    if reflected > 0.5:
        return f"{OPEN}: a reflection lays the objects on one another better, and none is admitted"
    met = " and ".join(f"{100 * share:.0f} %" for share in best.overlap)
    well = 100 * max(side.well for side in best.sides)
    return f"{OPEN}: {met} of source and target meet, {well:.0f} % as well as one object does, which may be chance"
