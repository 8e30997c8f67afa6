"""Hypotheses: axes, mirrors and rotations that the moments propose, each refined and judged on the points.

The n-tuples speak first: where they do not vanish they give the axis, and the azimuthal spectrum about it the fold and
the mirrors. The directional spectrum proposes what they cannot see. Everything is in normalised units (RMS radius 1).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symrefine.displaced import displacement
from symrefine.fit.frame import polish_frame
from symrefine.fit.matching import ROBUST
from symrefine.fit.refine import Framed, Iterate, mirror_bundle, refine, single_plane
from symrefine.geometry import Array, Isometry, Plane, frame_with_z, rotation, rotoreflection
from symrefine.moments.moments import Moments
from symrefine.ntuples.rank import TupleClass
from symrefine.propose.folds import FoldCandidate, fold_candidates
from symrefine.propose.spectrum import axis_misses, half_sphere, local_minima, mirror_candidates, whitened
from symrefine.surface.misses import Deviation, Judge, Verdict

# Turns that no finite fold below 36 shares; a surface of revolution survives them all.
IRRATIONAL_TURNS = 2.0 * np.pi * np.array([0.0823, 0.1381966, 0.2360680, 0.4270510])
# A revolution that misses by less than this fraction of the limits is round, whatever folds its facets suggest.
ROUND = 0.3
# A bundle of mirrors that misses by less is not outdone by another about nearly the same axis.
CLEAR = 0.5
# Excess of a free turn, at the start, beyond which an object is not round.
BARELY_ROUND = 1.5
# Sources of a first look: enough to tell hopeless from possible.
LOOK = 400
# How far a candidate may be off (radians) where the spectrum proposes it.
COARSE_RAD = 0.1
# Excess beyond which a candidate is not worth refining: at the start, after a first coarse fit, after a second.
HOPELESS = 12.0
UNPROMISING = 3.5
PROMISING = 2.0
# Fraction of the energy that no true axis moves.
AXIS_HOPELESS = 0.15
# Excesses between these are close calls.
CLOSE = (0.5, 1.4)
# Miss from which on it is asked whether parts stand out of place (of a volume only the outline shows).
SUSPECT = {"surface": 0.4, "volume": 0.1, "atoms": 1.0}
# How much of the surface may be shifted by how many tolerances. Buttons and connectors of a real camera are at 1.23,
# parts shifted by 3 % of the diagonal at 1.47 and more; in volumes nothing meets anything but a shifted part.
SHIFTED_SHARE = {"surface": 0.009, "volume": 0.005, "atoms": 1.0}
SHIFT_LIMIT = {"surface": 1.3, "volume": 1.0, "atoms": 1.0}
# A miss below this share of the limits is no compromise between parts.
SURE = 0.5
# Gate (spacings) of a refinement held to what agrees.
LOCK = 0.5
# Scale of its weights over the median absolute residual: what misses by more than most does hardly counts.
STRICT = 1.5
# How much better most of the surface has to agree for such a fit to be believed ...
MUCH_BETTER = 0.75
# ... beyond what sampling alone may show (tolerances).
CORE_NOISE = 0.07
# Folds tried one by one about the axes of a small set of points.
SMALL_FOLD = 12
# A fold that no moment reaches: only the coefficients with m = 0 are invariant.
ROUND_FOLD = 10**6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """What a search may use: moments, the class of the n-tuples, points, a judge with its cloud, and a closer judge.

    `halves` tells what independent samples of the same surface would show against one another, if that is more than the
    cloud shows against itself.
    """

    moments: Moments
    harmonics: dict[int, Array]
    tuples: TupleClass
    points: Array
    weights: Array
    judge: Judge
    closer: Callable[[], Judge]
    halves: Callable[[], Deviation]

    def verdict(self, motions: Sequence[Isometry], *, stride: int = 1) -> Verdict:
        """Verdict on operations together; a close call is judged again on a denser cloud, and asked for parts that
        stand out of place."""
        verdict = self.judge(motions, stride=stride)
        if CLOSE[0] < verdict.excess < CLOSE[1]:
            verdict = self.closer()(motions, stride=stride)
        body = self.judge.cloud.body
        if not SUSPECT[body] < verdict.excess <= 1.0:
            return verdict
        shifted = max(displacement(self.closer(), m, SHIFTED_SHARE[body]) for m in motions)
        return verdict.with_shifted(shifted / SHIFT_LIMIT[body])

    def stride(self, sources: int) -> int:
        """Stride that leaves about `sources` local planes."""
        return max(1, len(self.judge.cloud.points) // sources)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mirror:
    """A refined candidate plane, by how much it misses, and the outer iterations beyond coarse looks it took."""

    plane: Plane
    verdict: Verdict
    iterations: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turn:
    """A refined candidate axis with its order (inf for revolution), by how much it misses, and its iterations."""

    point: Array
    direction: Array
    order: float
    verdict: Verdict
    iterations: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bundle:
    """An axis with all its mirrors: C_bv for a finite fold, C_infv for fold inf; `history` holds the iterations."""

    state: Framed
    fold: float
    history: tuple[Iterate, ...]
    verdict: Verdict


def refined(
    evidence: Evidence,
    start: Framed,
    *,
    sources: int = 10**9,
    outer: int = 10,
    error_rad: float = 0.05,
    robust: float = ROBUST,
) -> tuple[Iterate, ...]:
    """All iterates of a refinement from `start`."""
    cloud, stride = evidence.judge.cloud, evidence.stride(sources)
    return tuple(refine(cloud, start, start_error_rad=error_rad, max_outer=outer, stride=stride, robust=robust))


def refined_if_promising(evidence: Evidence, start: Framed, *, sources: int, outer: int) -> Framed | None:
    """The refined state, or None where a first look finds nothing to refine."""
    if _look(evidence, start.motions) > UNPROMISING:
        return None
    return refined(evidence, start, sources=sources, outer=outer)[-1].state


def preferred(verdict: Verdict, other: Verdict) -> bool:
    """Whether a fit in which most of the surface agrees far better, or else one that misses by less, is this one."""
    if closer_core(verdict, other):
        return True
    return verdict.excess < other.excess and not closer_core(other, verdict)


def closer_core(verdict: Verdict, other: Verdict) -> bool:
    """Whether most of the surface agrees far better under this one."""
    return verdict.core < MUCH_BETTER * other.core and other.core > CORE_NOISE


def refined_closely(evidence: Evidence, start: Framed, *, sources: int) -> tuple[Iterate, ...]:
    """All iterates from a start that is known to less than the spacing of the points."""
    gate = LOCK * evidence.judge.cloud.spacing
    return refined(evidence, start, sources=sources, outer=8, error_rad=gate, robust=STRICT)


def axis_bundle(evidence: Evidence, direction: Array, *, mirrored: bool = True) -> Iterator[Bundle]:
    """C_infv, then C_bv by falling plausibility, about an axis through the centre; every one that passes a first look.

    Args:
        mirrored: whether to try finite folds with their mirrors too.
    """
    frame = polish_frame(evidence.harmonics, frame_with_z(direction), ROUND_FOLD)
    endless = _revolution(evidence, frame)
    if endless is not None:
        yield endless
    if mirrored and (endless is None or endless.verdict.excess > ROUND):
        for axis in (frame[2], direction):
            for candidate in fold_candidates(evidence.points, evidence.weights, axis)[:3]:
                found = _mirrors_through(evidence, candidate)
                if found is not None:
                    yield found
                    if found.verdict.excess < CLEAR:
                        return


def _mirrors_through(evidence: Evidence, candidate: FoldCandidate) -> Bundle | None:
    frame = polish_frame(evidence.harmonics, candidate.frame, candidate.fold)
    start = mirror_bundle(candidate.fold, frame, np.zeros(3))
    if _look(evidence, start.motions[:4]) > 4.0:
        return None
    history = refined(evidence, start, sources=max(LOOK, 12000 // candidate.fold))
    stride = evidence.stride(max(LOOK, 4000 // candidate.fold))
    history, verdict = locked(evidence, history, evidence.judge(history[-1].state.motions, stride=stride), stride)
    return Bundle(state=history[-1].state, fold=candidate.fold, history=history, verdict=verdict)


def locked(
    evidence: Evidence, history: tuple[Iterate, ...], verdict: Verdict, stride: int
) -> tuple[tuple[Iterate, ...], Verdict]:
    """The same refinement, or one that went on with narrow gates, if most of the surface then agrees far better.

    A detail out of place draws the fit of everything to a compromise in which nothing agrees exactly and nothing
    misses by much; held to what agrees, the same detail shows its whole miss.
    """
    if verdict.excess < SURE:
        return history, verdict
    state = history[-1].state
    more = refined_closely(evidence, state, sources=max(LOOK, 12000 // len(state.standard)))
    held = evidence.verdict(more[-1].state.motions, stride=stride)
    if preferred(held, verdict):
        return (*history, *(replace(i, index=len(history) - 1 + i.index) for i in more[1:])), held
    return history, verdict


def _look(evidence: Evidence, motions: tuple[Isometry, ...]) -> float:
    return evidence.judge(motions, stride=evidence.stride(LOOK)).excess


def _revolution(evidence: Evidence, frame: Array) -> Bundle | None:
    """The axis as if the object were round: refine with five planes, judge by free turns; None if hopeless."""
    start = mirror_bundle(5, frame, np.zeros(3))
    if _look(evidence, _free_turns(start)[:1]) > BARELY_ROUND:
        return None
    history = refined(evidence, start, sources=1500)
    state = history[-1].state
    verdict = evidence.judge(_free_turns(state), stride=evidence.stride(2500))
    return Bundle(state=state, fold=np.inf, history=history, verdict=verdict)


def _free_turns(state: Framed) -> tuple[Isometry, ...]:
    return tuple(Isometry.about(state.center, rotation(state.frame[2], a)) for a in IRRATIONAL_TURNS)


def mirrors(
    evidence: Evidence,
    extra: Array,
    *,
    count: int = 16,
    known: Callable[[Array], bool] = lambda _: False,
    thorough: bool = True,
) -> Iterator[Mirror]:
    """Candidate mirrors, the `extra` normals [E, 3] first, then `count` of the spectrum by falling promise.

    Each is refined as far as it deserves (coarsely only, unless `thorough`) and judged. Candidates that end up where
    `known` says so are passed over.
    """
    found: list[Plane] = []
    proposed = mirror_candidates(evidence.moments, count=count).directions if count else np.zeros((0, 3))
    for normal in np.concatenate([extra.reshape(-1, 3), proposed]):
        start = Plane(normal=normal, offset=0.0)
        if known(normal) or _look(evidence, (Isometry.reflection(start),)) > HOPELESS:
            continue
        plane = _settle(evidence, start, sources=LOOK, outer=2)
        if thorough and _look(evidence, (Isometry.reflection(plane),)) < UNPROMISING:
            plane = _settle(evidence, plane, sources=LOOK, outer=2)
        if known(plane.normal) or any(_same_plane(plane, p) for p in found):
            continue
        mirror = _judged(evidence, plane, stride=evidence.stride(LOOK))
        if thorough and mirror.verdict.excess <= PROMISING:
            fine = refined(evidence, single_plane(plane), sources=3000, outer=6, error_rad=COARSE_RAD)
            plane = fine[-1].state.planes[0]
            if known(plane.normal) or any(_same_plane(plane, p) for p in found):
                continue
            mirror = _held(evidence, fine)
            if 1.0 < mirror.verdict.excess < PROMISING:
                other = _judged(evidence, _polished(evidence, normal))
                mirror = other if preferred(other.verdict, mirror.verdict) else mirror
        found.append(mirror.plane)
        yield mirror


def _judged(evidence: Evidence, plane: Plane, *, stride: int = 1) -> Mirror:
    return Mirror(plane=plane, verdict=evidence.verdict([Isometry.reflection(plane)], stride=stride))


def _held(evidence: Evidence, history: tuple[Iterate, ...]) -> Mirror:
    """The mirror at the end of a refinement, or of one that went on with narrow gates."""
    history, verdict = locked(evidence, history, evidence.verdict(history[-1].state.motions), 1)
    return Mirror(plane=history[-1].state.planes[0], verdict=verdict, iterations=len(history) - 1)


def _polished(evidence: Evidence, normal: Array) -> Plane:
    """The plane where the moments alone put it: for approximate symmetry often a better mean than the closest fit."""
    u, p0, p1 = frame_with_z(normal)[[0, 1, 2]]
    frame = polish_frame(evidence.harmonics, np.stack([u, p1, -p0]), 1)
    return Plane(normal=frame[1], offset=0.0)


def _settle(evidence: Evidence, plane: Plane, *, sources: int, outer: int) -> Plane:
    last = refined(evidence, single_plane(plane), sources=sources, outer=outer, error_rad=COARSE_RAD)[-1]
    return last.state.planes[0]


def _same_plane(a: Plane, b: Plane) -> bool:
    return abs(float(a.normal @ b.normal)) > math.cos(math.radians(2.0))


def axis_directions(evidence: Evidence) -> Array:
    """Directions [D, 3] worth trying as rotation axes: principal axes and minima of the whitened spectrum that the
    moments do not rule out; an axis of any order is one of a prime order too."""
    white = whitened(evidence.moments)
    misses = {k: axis_misses(white, k) for k in (2, 3, 5, 7)}
    principal = np.linalg.eigh(evidence.moments.covariance)[1].T
    nearest = np.abs(half_sphere() @ principal.T).argmax(axis=0)
    lowest = np.min([m[nearest] for m in misses.values()], axis=0)
    minima = [local_minima(misses[k], count=n) for k, n in ((2, 4), (3, 5), (5, 3))]
    likely = [c.directions[c.misses < AXIS_HOPELESS] for c in minima]
    return np.concatenate([principal[lowest < AXIS_HOPELESS], *likely])


def turns_about(evidence: Evidence, direction: Array, center: Array) -> Turn | None:
    """The rotation of highest order about a direction that holds, or None."""
    frame = frame_with_z(direction)
    folds = {c.fold for c in fold_candidates(evidence.points, evidence.weights, direction)}
    if evidence.judge.cloud.isolated:
        folds |= set(range(2, min(len(evidence.points), SMALL_FOLD) + 1))
    best: Turn | None = None
    for fold in sorted({*folds, 2, 3}, reverse=True):
        if best is not None and best.order % fold == 0:
            continue
        start = Framed(standard=rotation([0, 0, 1], 2 * np.pi / fold)[None], frame=frame, center=center)
        if _look(evidence, start.motions) > HOPELESS:
            continue
        start = refined(evidence, start, sources=LOOK, outer=3, error_rad=COARSE_RAD)[-1].state
        if _look(evidence, start.motions) > PROMISING:
            continue
        history = refined(evidence, start, sources=2000, outer=6)
        history, verdict = locked(evidence, history, evidence.verdict(history[-1].state.motions), 1)
        state = history[-1].state
        if verdict.excess <= 1.0 and (best is None or fold > best.order):
            best = Turn(
                point=state.center, direction=state.frame[2], order=float(fold), verdict=verdict,
                iterations=len(history) - 1,
            )  # fmt: skip
    return best


def improper_about(evidence: Evidence, direction: Array, center: Array, order: int) -> Verdict:
    """Verdict on the rotoreflection S_order about a direction through the centre, after refinement."""
    standard = rotoreflection([0, 0, 1], 2 * np.pi / order)[None]
    start = Framed(standard=standard, frame=frame_with_z(direction), center=center)
    state = refined(evidence, start, sources=2000, outer=6)[-1].state
    return evidence.verdict(state.motions)
