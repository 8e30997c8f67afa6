"""Hypotheses: axes, mirrors and rotations that the moments propose, each refined and judged on the points.

The n-tuples speak first: where they do not vanish they give the axis, and the azimuthal spectrum about it the fold and
the mirrors. The directional spectrum proposes what they cannot see. Everything is in normalised units (RMS radius 1).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from symrefine.axis import FoldCandidate, TupleClass, fold_candidates, polish_frame
from symrefine.geometry import Array, Isometry, Plane, frame_with_z, rotation, rotoreflection, unit
from symrefine.moments import Moments
from symrefine.refine import Framed, Iterate, mirror_bundle, refine, single_plane
from symrefine.spectrum import axis_misses, local_minima, mirror_candidates, whitened
from symrefine.verify import Deviation, Judge

# Turns that no finite fold below 36 shares; a surface of revolution survives them all.
IRRATIONAL_TURNS = 2.0 * np.pi * np.array([0.0823, 0.1381966, 0.2360680, 0.4270510])
# A revolution that misses by less than this fraction of the limits is round, whatever folds its facets suggest.
ROUND = 0.3
# Sources of a first look: enough to tell hopeless from possible.
LOOK = 600


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """What a search may use: moments, the class of the n-tuples, points, and a judge with its cloud."""

    moments: Moments
    harmonics: dict[int, Array]
    tuples: TupleClass
    points: Array
    weights: Array
    judge: Judge

    def stride(self, sources: int) -> int:
        """Stride that leaves about `sources` local planes."""
        return max(1, len(self.judge.cloud.points) // sources)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mirror:
    """A refined candidate plane and by how much it misses."""

    plane: Plane
    deviation: Deviation
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turn:
    """A refined candidate axis with its order (inf for revolution) and by how much it misses."""

    point: Array
    direction: Array
    order: float
    deviation: Deviation
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bundle:
    """An axis with all its mirrors: C_bv for a finite fold, C_infv for fold inf; `history` holds the iterations."""

    state: Framed
    fold: float
    history: tuple[Iterate, ...]
    deviation: Deviation
    excess: float


def refined(evidence: Evidence, start: Framed, *, sources: int = 10**9, outer: int = 10, error_rad: float = 0.05) -> tuple[Iterate, ...]:
    """All iterates of a refinement from `start`."""
    cloud, stride = evidence.judge.cloud, evidence.stride(sources)
    return tuple(refine(cloud, start, start_error_rad=error_rad, max_outer=outer, stride=stride))


def axis_bundle(evidence: Evidence, direction: Array) -> Iterator[Bundle]:
    """C_infv, then C_bv by falling plausibility, about an axis through the centre; every one that passes a first look."""
    round_one = _revolution(evidence, direction)
    if round_one.excess <= ROUND:
        yield round_one
        return
    for candidate in fold_candidates(evidence.points, evidence.weights, direction)[:3]:
        found = _mirrors_through(evidence, candidate)
        if found is not None:
            yield found
    yield round_one


def _mirrors_through(evidence: Evidence, candidate: FoldCandidate) -> Bundle | None:
    frame = polish_frame(evidence.harmonics, candidate.frame, candidate.fold)
    start = mirror_bundle(candidate.fold, frame, np.zeros(3))
    if _look(evidence, start.motions[:4]) > 4.0:
        return None
    history = refined(evidence, start, sources=max(LOOK, 16000 // candidate.fold))
    state = history[-1].state
    deviation = evidence.judge.deviation(state.motions, stride=evidence.stride(20000 // candidate.fold))
    return Bundle(
        state=state, fold=candidate.fold, history=history, deviation=deviation, excess=evidence.judge.excess(deviation)
    )


def _look(evidence: Evidence, motions: tuple[Isometry, ...]) -> float:
    return evidence.judge.excess(evidence.judge.deviation(motions, stride=evidence.stride(LOOK)))


def _revolution(evidence: Evidence, direction: Array) -> Bundle:
    """The axis as if the object were round: polish on m = 0 alone, refine with five planes, judge by free turns."""
    frame = polish_frame(evidence.harmonics, frame_with_z(direction), 10**6)
    start = mirror_bundle(5, frame, np.zeros(3))
    state, history = start, ()
    if _look(evidence, _free_turns(start)[:1]) <= 4.0:
        history = refined(evidence, start, sources=1500)
        state = history[-1].state
    deviation = evidence.judge.deviation(_free_turns(state), stride=evidence.stride(2500))
    return Bundle(state=state, fold=np.inf, history=history, deviation=deviation, excess=evidence.judge.excess(deviation))


def _free_turns(state: Framed) -> tuple[Isometry, ...]:
    return tuple(Isometry.about(state.center, rotation(state.frame[2], a)) for a in IRRATIONAL_TURNS)


def mirrors(evidence: Evidence, extra: Array, *, count: int = 16) -> list[Mirror]:
    """Every candidate mirror of the spectrum, and the `extra` normals [E, 3]: refined and judged, best first."""
    found: list[Mirror] = []
    directions = np.concatenate([extra.reshape(-1, 3), mirror_candidates(evidence.moments, count=count).directions])
    for normal in directions:
        plane = _settle(evidence, Plane(normal=normal, offset=0.0), sources=LOOK, outer=4)
        if any(_same_plane(plane, m.plane) for m in found):
            continue
        excess = _look(evidence, (Isometry.reflection(plane),))
        if excess <= 2.0:
            plane = _settle(evidence, plane, sources=4000, outer=6)
        if any(_same_plane(plane, m.plane) for m in found):
            continue
        stride = evidence.stride(LOOK) if excess > 2.0 else 1
        deviation = evidence.judge.deviation([Isometry.reflection(plane)], stride=stride)
        found.append(Mirror(plane=plane, deviation=deviation, excess=evidence.judge.excess(deviation)))
    return sorted(found, key=lambda m: m.excess)


def _settle(evidence: Evidence, plane: Plane, *, sources: int, outer: int) -> Plane:
    last = refined(evidence, single_plane(plane), sources=sources, outer=outer, error_rad=0.1)[-1]
    return last.state.planes[0]


def _same_plane(a: Plane, b: Plane) -> bool:
    return abs(float(a.normal @ b.normal)) > np.cos(np.radians(2.0))


def axis_directions(evidence: Evidence, normals: Array) -> Array:
    """Directions [D, 3] worth trying as rotation axes: those the mirrors imply, then the spectrum's, then the tuples'."""
    crossings = [unit(c) for i, a in enumerate(normals) for b in normals[:i] if np.linalg.norm(c := np.cross(a, b)) > 0.05]
    white = whitened(evidence.moments)
    minima = [local_minima(axis_misses(white, k), count=n).directions for k, n in ((2, 4), (3, 5), (5, 3))]
    principal = np.linalg.eigh(evidence.moments.covariance)[1].T
    all_of = np.concatenate([np.array(crossings).reshape(-1, 3), normals, *minima, principal, evidence.tuples.directions[:1]])
    kept: list[Array] = []
    for d in all_of:
        if all(abs(d @ k) < np.cos(np.radians(4.0)) for k in kept):
            kept.append(d)
    return np.array(kept)


def turns_about(evidence: Evidence, direction: Array, center: Array) -> Turn | None:
    """The rotation of highest order about a direction that holds, or None."""
    frame = frame_with_z(direction)
    spectrum_folds = [c.fold for c in fold_candidates(evidence.points, evidence.weights, direction)]
    best: Turn | None = None
    for fold in sorted({*spectrum_folds, 2, 3}, reverse=True):
        if best is not None and best.order % fold == 0:
            continue
        start = Framed(standard=rotation([0, 0, 1], 2 * np.pi / fold)[None], frame=frame, center=center)
        if _look(evidence, start.motions) > 5.0:
            continue
        state = refined(evidence, start, sources=2000, outer=6)[-1].state
        deviation = evidence.judge.deviation(state.motions)
        excess = evidence.judge.excess(deviation)
        if excess <= 1.0 and (best is None or fold > best.order):
            best = Turn(
                point=state.center, direction=state.frame[2], order=float(fold), deviation=deviation, excess=excess
            )
    return best


def improper_about(evidence: Evidence, direction: Array, center: Array, order: int) -> float:
    """Excess of the rotoreflection S_order about a direction through the centre, after refinement."""
    standard = rotoreflection([0, 0, 1], 2 * np.pi / order)[None]
    start = Framed(standard=standard, frame=frame_with_z(direction), center=center)
    state = refined(evidence, start, sources=2000, outer=6)[-1].state
    return evidence.judge.excess(evidence.judge.deviation(state.motions))


def at_center(state: Framed, center: Array) -> Framed:
    """The same operations about another centre."""
    return replace(state, center=center)
