"""Candidates for lines and turns, fitted and judged on the outlines, and the group that they make."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.plane.judge import LineVerdict
from symrefine.plane.outline import Outlines
from symrefine.plane.placed import Placed, fitted
from symrefine.plane.spectrum import MAX_FOLD, AngularSpectrum

# Lines and folds that are fitted, and the sources of a first look.
LINES, FOLDS, LOOK = 10, 8, 300
# Excess beyond which a candidate is not worth fitting; fractions of the energy that no true fold leaves aside, and that
# no false one is content with.
HOPELESS, HOPELESS_LEAK, SURE_LEAK = 15.0, 0.4, 0.1
# Beside an element that holds exactly, one that misses this many times more, and by this share of the limit, is not
# the same kind of truth (the first share for pixels and points that stand for themselves, the second for samples);
# unless both are within the last multiple of what the outlines miss themselves by.
RIVAL, EXACT, SEEN = 4.0, (0.15, 0.35), 1.5
# A round object misses free turns by less than this share of the limits, or by hardly more than its group; each first
# where the spectrum tells something, then where it does not.
ROUND, HARDLY_MORE, AT_MOST = (0.3, 0.5), (1.25, 2.0), (1.0, 1.25)
# Higher folds are hardly told from round: the spectrum must tell them, or they must hold as well as the lower ones.
LOW = 8
# Candidates that end up closer than this are one.
SAME_RAD = math.radians(2.0)
KNOWN_RAD = math.radians(3.0)
_ORIGIN = np.zeros(2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """A fitted line (D1) or turn (Cn, or O(2) for fold inf) with its verdict."""

    placed: Placed
    verdict: LineVerdict

    @property
    def is_line(self) -> bool:
        """Whether it stands for one mirror line."""
        return self.placed.mirrored and math.isfinite(self.placed.fold)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """The group, each of its lines with a verdict, the verdict of its turns, and what was turned down, best first."""

    placed: Placed
    lines: tuple[Candidate, ...]
    turns: LineVerdict | None
    rejected: tuple[Candidate, ...]


def search(outlines: Outlines, spectrum: AngularSpectrum, hint_rad: float | None) -> Found:
    """The largest group that holds; `hint_rad` is the line of the doublets, where they have one."""
    endless = _judged_turns(outlines, Placed(fold=math.inf, mirrored=True, center=_ORIGIN))
    if endless is not None and endless.verdict.excess <= max(ROUND[not spectrum.tells], outlines.haze):
        return _finish(outlines, endless.placed, [])
    center = _ORIGIN if endless is None else endless.placed.center
    turns = list(_judged_folds(outlines, spectrum, center))
    angles = [*([] if hint_rad is None else [hint_rad]), *spectrum.lines(LINES)]
    lines = list(_judged_lines(outlines, angles))
    everything = [*lines, *turns, *([] if endless is None else [endless])]
    limit = _limit(outlines, everything)
    implied = _implied_fold([c for c in lines if _holds(c, limit)])
    if implied > 1 and all(c.placed.fold != implied for c in turns):
        more = _judged_turns(outlines, Placed(fold=implied, mirrored=False, center=center))
        turns += [] if more is None else [more]
        everything += [] if more is None else [more]
    turning = _sure(outlines, spectrum, [c for c in turns if _holds(c, limit)])
    group = _largest(outlines, [c for c in lines if _holds(c, limit)], turning)
    if endless is not None and _is_rather_round(outlines, spectrum, group, endless):
        return _finish(outlines, endless.placed, [])
    free = math.inf if endless is None else endless.verdict.excess
    return _finish(outlines, group, [c for c in everything if c is endless or c.is_line or c.verdict.excess < free])


def _is_rather_round(outlines: Outlines, spectrum: AngularSpectrum, group: Placed, endless: Candidate) -> bool:
    """Whether free turns miss by hardly more than the group, and the spectrum does not speak for the group's fold."""
    if spectrum.tells and group.fold > 2:
        return False
    silent = not spectrum.tells
    worst = outlines(_all(group)).excess if group.order > 1 else math.inf
    return endless.verdict.excess <= min(AT_MOST[silent], HARDLY_MORE[silent] * worst)


def _judged_folds(outlines: Outlines, spectrum: AngularSpectrum, center: Array) -> Iterable[Candidate]:
    """The folds that the spectrum does not rule out and that look best on the outlines, largest first."""
    possible = [n for n in range(2, MAX_FOLD + 1) if not spectrum.tells or spectrum.leak(n) < HOPELESS_LEAK]
    starts = [Placed(fold=n, mirrored=False, center=center) for n in possible]
    looks = np.array([outlines([_wide_turn(p)], sources=LOOK).excess for p in starts])
    best = [starts[k] for k in np.argsort(looks, kind="stable")[:FOLDS] if looks[k] <= HOPELESS]
    exact: list[float] = []
    for start in sorted(best, key=lambda p: -p.fold):
        found = None if any(n % start.fold == 0 for n in exact) else _judged_turns(outlines, start)
        if found is not None:
            exact += [found.placed.fold] if found.verdict.excess <= EXACT[outlines.sampled] else []
            yield found


def _implied_fold(lines: list[Candidate]) -> int:
    """The smallest fold whose mirrors stand where the lines do; 1 for one line or none, or if there is none."""
    angles = np.array([c.placed.angle_rad for c in lines])
    for fold in range(1, MAX_FOLD + 1):
        steps = (angles - angles[:1]) * fold / math.pi
        if np.all(np.abs(steps - np.round(steps)) * math.pi < SAME_RAD * fold):
            return fold
    return 1


def _wide_turn(placed: Placed) -> Isometry:
    """A generator of the turns far from the identity, which every object nearly bears."""
    n = int(placed.fold)
    power = min((k for k in range(1, n) if math.gcd(k, n) == 1), key=lambda k: abs(k / n - 0.382))
    return placed.turn(2.0 * math.pi * power / n)


def _sure(outlines: Outlines, spectrum: AngularSpectrum, turns: list[Candidate]) -> list[Candidate]:
    """The turns without the high folds that are hardly told from round, by the spectrum or by their verdict."""
    least = min((c.verdict.excess for c in turns), default=1.0)
    high = max(EXACT[outlines.sampled], SEEN * outlines.haze, HARDLY_MORE[0] * least)

    def sure(c: Candidate) -> bool:
        told = spectrum.tells and spectrum.leak(int(c.placed.fold)) < SURE_LEAK
        return c.placed.fold <= LOW or told or c.verdict.excess <= high

    return [c for c in turns if sure(c)]


def _limit(outlines: Outlines, candidates: Iterable[Candidate]) -> float:
    least = min((c.verdict.bulk for c in candidates), default=1.0)
    return min(1.0, max(EXACT[outlines.sampled], SEEN * outlines.haze, RIVAL * least))


def _holds(candidate: Candidate, limit: float) -> bool:
    return candidate.verdict.excess <= 1.0 and candidate.verdict.bulk <= limit


def _judged_turns(outlines: Outlines, start: Placed) -> Candidate | None:
    if outlines(start.turns()[:1], sources=LOOK).excess > HOPELESS:
        return None
    placed = fitted(outlines, start)
    return Candidate(placed=placed, verdict=outlines(placed.turns()))


def _judged_lines(outlines: Outlines, angles: Iterable[float]) -> Iterable[Candidate]:
    seen: list[float] = []
    for angle in angles:
        start = Placed(fold=1, mirrored=True, center=_ORIGIN, angle_rad=float(angle))
        if outlines(start.generators(), sources=LOOK).excess > HOPELESS:
            continue
        placed = fitted(outlines, start)
        if all(_apart(placed.angle_rad, other) > SAME_RAD for other in seen):
            seen.append(placed.angle_rad)
            yield Candidate(placed=placed, verdict=outlines(placed.generators()))


def _apart(a: float, b: float) -> float:
    """Angle in [0, pi/2] between lines at two angles."""
    return abs((a - b + 0.5 * math.pi) % math.pi - 0.5 * math.pi)


def _largest(outlines: Outlines, lines: list[Candidate], turns: list[Candidate]) -> Placed:
    """The turns of highest order, with the mirrors where a line holds and the group that both generate does."""
    best = max(turns, key=lambda c: c.placed.fold, default=None)
    group = Placed(fold=1, mirrored=False, center=_ORIGIN) if best is None else best.placed
    if not lines:
        return group
    line = min(lines, key=lambda c: c.verdict.excess)
    by_fold = {int(c.placed.fold): c.placed for c in turns}
    folds = {m for n in by_fold for m in range(2, n + 1) if n % m == 0}
    for fold in sorted(folds, reverse=True):
        if 2 * fold <= group.order:
            break
        center = _foot(line.placed, by_fold[fold].center if fold in by_fold else group.center)
        start = replace(line.placed, fold=fold, center=center)
        placed = min((start, fitted(outlines, start)), key=lambda p: outlines(_all(p)).excess)
        if outlines(_all(placed)).excess <= 1.0:
            return placed
    return group if group.order > 2 else replace(line.placed, center=_foot(line.placed, _ORIGIN))


def _foot(line: Placed, point: Array) -> Array:
    """The point of a line that is closest to another point."""
    (mirror,) = line.lines()
    return point - float(mirror.signed_distance(point)) * mirror.normal


def _all(placed: Placed) -> list[Isometry]:
    return [*placed.generators(), *placed.turns()]


def _finish(outlines: Outlines, group: Placed, candidates: list[Candidate]) -> Found:
    angles = [math.atan2(p.normal[1], p.normal[0]) + 0.5 * math.pi for p in group.lines()]
    lines = [
        Candidate(placed=replace(group, fold=1, angle_rad=a), verdict=outlines([Isometry.reflection(p)]))
        for a, p in zip(angles, group.lines(), strict=True)
    ]
    rejected = [c for c in candidates if not _belongs(c, group, angles)]
    return Found(
        placed=group,
        lines=tuple(sorted(lines, key=lambda c: c.verdict.excess)),
        turns=outlines(group.turns()) if group.fold > 1 else None,
        rejected=tuple(sorted(rejected, key=lambda c: c.verdict.excess)),
    )


def _belongs(candidate: Candidate, group: Placed, angles: list[float]) -> bool:
    """Whether the group has the candidate's line, or turns of its order."""
    if candidate.is_line:
        return any(_apart(candidate.placed.angle_rad, a) < KNOWN_RAD for a in angles)
    return math.isfinite(candidate.placed.fold) and group.fold % candidate.placed.fold == 0


def unclaimed(found: Found) -> Found:
    """The same findings as candidates only."""
    about = replace(found.placed, mirrored=False)
    turns = [] if found.turns is None else [Candidate(placed=about, verdict=found.turns)]
    return Found(
        placed=Placed(fold=1, mirrored=False, center=found.placed.center),
        lines=(),
        turns=None,
        rejected=(*found.lines, *turns, *found.rejected),
    )
