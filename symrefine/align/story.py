"""Alignment, the other story: the orthogonal map between two objects, reflections included, without correspondences.

moments of both -> n-tuples -> Procrustes (or the landscape over O(3) where the tuples vanish) -> Gauss-Newton on all
moments -> rivals judged on the points -> polish on the points -> the coset of maps that do equally well.
Where neither moments nor surfaces agree as a whole: local planes that look alike -> consensus -> polish -> what each
map lays on the other side, what contradicts it, and what nobody saw.
Elsewhere than in 3-space, and for what spans less of it: `align.elsewhere`.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from symrefine.align.alignment import OK, Alignment, Nearness, Verdict
from symrefine.align.coset import Coset, coset_of_group, coset_of_maps, with_copies
from symrefine.align.elsewhere import align_in_span
from symrefine.align.kinds import nearness, with_one_set_of_classes
from symrefine.align.landscape import least_misfit
from symrefine.align.moment_fit import MISFIT, ROUNDING, unlikely
from symrefine.align.pair import Evidence, few
from symrefine.align.partial import Meeting, partial_meeting
from symrefine.align.polish import Polished, Similarity
from symrefine.align.revolved import shown_by, turns_between
from symrefine.align.rivals import Choice, choose, information, polished
from symrefine.align.scaled import Size, size_of_parts
from symrefine.align.sides import ORDERS, differ_in_size, rank_of, same_size, side_of, size_sigma, thinned, unlike_sizes
from symrefine.clock import Clock
from symrefine.decide.maps import SURE
from symrefine.decide.posterior import Link, certain, meant
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.geometry import Array, check_tolerance, cross_matrix
from symrefine.groups import PointGroup
from symrefine.moments.moments import PARTS
from symrefine.shape import Shape
from symrefine.surface.misses import RIM, TOLERANCE
from symrefine.threads import one_thread

__all__ = ["Alignment", "align"]


@one_thread()
def align(
    source: Shape | ArrayLike,
    target: Shape | ArrayLike,
    *,
    scale: bool = False,
    polish: bool = True,
    allow_reflection: bool = True,
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> Alignment:
    """Orthogonal map and translation that take one object onto another; samplings, densities and formats may differ.

    Args:
        source: a `Shape`, or points [N, n].
        target: a `Shape`, or points [M, n].
        scale: and what follows as of `symrefine.align`.
        tolerance: as a fraction of the diagonal: it decides between rivals, and about symmetry.

    Raises:
        InputError: points that cannot be used, of different dimensions, or options out of range.
        DegenerateShapeError: the points do not spread.
    """
    a, b = (
        given if isinstance(given, Shape) else Shape(points=np.asarray(given), source=name)
        for given, name in ((source, "source"), (target, "target"))
    )
    _check(a, b, tolerance)
    a, b = with_one_set_of_classes(a, b)
    clock = Clock()
    with clock("moments"):
        a, b = thinned(a, b, seed) if polish else (a, b)
        parts = 0 if few(a, b) else PARTS
        sides = side_of(a, parts), side_of(b, parts)
    ranks = [rank_of(s.moments) for s in sides]
    if max(ranks) - min(ranks) > 1:
        lean, full = (a, b) if ranks[0] < ranks[1] else (b, a)
        raise DegenerateShapeError(
            f"{lean.source} spans {min(ranks)} of {a.dim} dimensions, {full.source} {max(ranks)}: nothing maps them"
        )
    if a.dim != 3 or max(ranks) < 3:
        return align_in_span(sides, scale, allow_reflection, tolerance, clock)
    evidence = Evidence(
        source=sides[0], target=sides[1], scale=scale or differ_in_size(*sides), tolerance=tolerance, seed=seed
    )
    return _align_solid(evidence, scale, polish, allow_reflection, clock)


def _check(source: Shape, target: Shape, tolerance: float) -> None:
    if source.dim != target.dim:
        raise InputError(
            f"{source.source} has {source.dim} coordinates, {target.source} has {target.dim}; both need the same number"
        )
    if source.dim > max(ORDERS):
        raise InputError(f"points have {source.dim} coordinates; align takes {max(ORDERS)} at most")
    if {source.measure, target.measure} == {"surface", "solid"}:
        raise InputError(
            f"{source.source} is taken as a {source.measure}, {target.source} as a {target.measure}; "
            "their moments differ, give both the same measure"
        )
    check_tolerance(tolerance)


def _align_solid(
    evidence: Evidence, scale: bool, polish: bool, reflections: bool, clock: Clock, *, cleaned: bool = False
) -> Alignment:
    """The story in 3-space. Objects of unlike size are compared at one size, even where the scale is not asked for.

    Where it is not sure that they agree, points of no surface are set apart (`cleaned`), and all begins anew.
    """
    surfaces = polish and evidence.has_points and not few(evidence.source.shape, evidence.target.shape)
    partly = surfaces and not scale
    tried = partly and least_misfit(evidence.harmonics) > MISFIT
    if tried and (part := _in_part(evidence, reflections, clock)) is not None:
        return _unless_of_other_size(part, evidence, reflections, clock)
    with clock("choose"):
        choice = choose(evidence, reflections=reflections, brief=partly)
    whole, motion = choice.evidence, choice.motion
    # Where the sizes differ though nobody said so, it may be that one shows more than the other.
    agree, done = choice.excess <= 1.0 and whole.scale == scale, None
    if polish and (agree or not partly) and not choice.exact and whole.has_points:
        with clock("planes"):
            _ = whole.moving, whole.met
        with clock("polish"):
            done = polished(whole, whole.met, motion, choice.covariance)
            motion = done.motion
    excess = _excess(choice, motion, None if scale else done, agree=agree) if surfaces else 0.0
    likely = meant(Link(need=excess), 1.0) if excess <= 1.0 else 0.0
    if likely < SURE and not cleaned and (clean := evidence.cleaned()) is not None:
        clean = replace(clean, scale=scale or differ_in_size(clean.source, clean.target))
        return _align_solid(clean, scale, polish, reflections, clock, cleaned=True)
    if partly and not tried and likely < SURE:
        part = _in_part(evidence, reflections, clock)
        if part is not None and part.confidence >= likely:
            return _unless_of_other_size(part, evidence, reflections, clock, choice)
    if scale and surfaces and likely < SURE:
        part = _in_part(evidence, reflections, clock, scale=True)
        if part is not None and part.confidence >= max(likely, SURE):
            return part
    known = excess if surfaces and agree else None
    found = _as_whole(choice, motion, done, clock, scale=scale, reflections=reflections, excess=known)
    return found if likely >= SURE or not partly else _unless_of_other_size(found, evidence, reflections, clock, choice)


def _unless_of_other_size(
    found: Alignment, evidence: Evidence, reflections: bool, clock: Clock, choice: Choice | None = None
) -> Alignment:
    """What was found of surfaces as they are, unless it is not sure and they surely agree at one size.

    By the choice that was made, if they were compared at one size.
    """
    if found.confidence >= SURE:
        return found
    if choice is None or not evidence.scale:
        with clock("choose"):
            choice = choose(replace(evidence, scale=True), reflections=reflections, brief=True)
    whole = choice.evidence
    blurred = math.hypot(size_sigma(whole.source, whole.target), _blurred(whole))
    apart = abs(_factor(whole, choice.motion) - 1.0) > RIM * blurred
    if not apart or meant(Link(need=choice.excess), 1.0) < SURE:
        return found
    return _as_whole(choice, choice.motion, None, clock, scale=False, reflections=reflections, excess=None)


def _as_whole(
    choice: Choice,
    motion: Similarity,
    done: Polished | None,
    clock: Clock,
    *,
    scale: bool,
    reflections: bool,
    excess: float | None,
) -> Alignment:
    """The answer for objects that are compared as wholes: a map, after the polish if there was one, and its excess."""
    evidence = choice.evidence
    covariance: Array = np.zeros((6, 6))
    scale_sigma = 0.0
    if done is not None:
        covariance, scale_sigma = done.covariance, math.hypot(done.scale_sigma, _blurred(evidence))
    elif not choice.exact:
        covariance = np.linalg.inv(information(evidence, choice.covariance))[:6, :6]
        scale_sigma = size_sigma(evidence.source, evidence.target)
    # Copies of another size have the same moments at one size, which says nothing of how they miss as they are.
    exact = choice.exact and (scale or same_size(evidence.source, evidence.target))
    known = excess if exact == choice.exact else None
    matrix, translation, factor = _in_input_units(evidence, motion, scale)

    def coset() -> Coset:
        group, center = _symmetry(evidence, motion)
        return coset_of_group(matrix, translation, group, center, reflections=reflections)

    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=factor,
        scale_sigma=factor * scale_sigma if scale else 0.0,
        sigma_rad=float(np.sqrt(np.trace(covariance[:3, :3]))),
        covariance=_of_transform(covariance, evidence, matrix, factor),
        exact=exact,
        timings=clock.seconds,
        _coset=coset,
        _verdict=lambda: _verdict(choice, motion, scale, reflections, known),
        _nearness=lambda: _nearness(choice, motion, scale),
    )


def _excess(choice: Choice, motion: Similarity, done: Polished | None, *, agree: bool) -> float:
    """By how much surfaces exceed what they may differ by: as the polish has it, where that leaves no doubt.

    Infinite, or what the polish has, where they were not found to agree before.
    """
    if choice.exact:
        return 0.0
    enough = certain(1.0)
    unforgiven = math.inf if done is None else choice.evidence.excess_without_noise(done, enough)
    return choice.evidence.excess(motion) if agree and unforgiven > enough else unforgiven


def _in_part(evidence: Evidence, reflections: bool, clock: Clock, *, scale: bool = False) -> Alignment | None:
    """The answer for surfaces that share a part only; None where there is nothing to be said for it."""
    with clock("partial"):
        size = size_of_parts(evidence) if scale else Size(factor=1.0, sigma=0.0)
        meeting = size and partial_meeting(evidence, reflections=reflections, factor=size.factor)
    if not (size and meeting and meeting.status):
        return None
    return _met_in_part(meeting, evidence, size, clock, reflections=reflections)


def _met_in_part(meeting: Meeting, evidence: Evidence, size: Size, clock: Clock, *, reflections: bool) -> Alignment:
    """The answer for surfaces that share a part only, the source at this size."""
    maps = [_placed(evidence, m.motion, size.factor) for m in (meeting.best, *meeting.equals)]
    (matrix, translation), best = maps[0], meeting.best

    def coset() -> Coset:
        shown = [] if meeting.turns else shown_by(evidence, best)
        if turns := meeting.turns or turns_between(shown, evidence, best.motion, size.factor):
            center = evidence.target.moments.center + evidence.target.moments.scale * turns.placed.center
            return coset_of_group(matrix, translation, turns.placed.group, center, reflections=reflections)
        # What carries a whole side onto itself makes maps that do as well.
        every, either = maps, meeting.determinant_confidence <= 0.5
        if shown[0].whole:
            side, found = shown[0].side, shown[0].found
            either |= not found.group.is_chiral
            if found.group.is_finite:
                of_target = side is evidence.target
                every = with_copies(maps, found.group, found.center, size.factor, of_target=of_target)
        every = [m for m in every if reflections or np.linalg.det(m[0]) > 0.0]
        matrices, shifts = (np.array(parts) for parts in zip(*every, strict=True))
        return coset_of_maps(matrices, shifts, both_hands=reflections and either)

    rms = best.rms * evidence.target.moments.scale / evidence.target.shape.diagonal
    verdict = Verdict(
        status=meeting.status,
        excess=0.0,
        determinant_confidence=meeting.determinant_confidence,
        confidence=meeting.confidence,
    )
    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=size.factor,
        scale_sigma=size.factor * size.sigma,
        sigma_rad=np.inf if meeting.slides else float(np.sqrt(np.trace(best.covariance[:3, :3]))),
        covariance=_of_transform(best.covariance, evidence, matrix, size.factor),
        exact=False,
        timings=clock.seconds,
        _coset=coset,
        _verdict=lambda: verdict,
        _nearness=lambda: Nearness(rms=rms, overlap=best.overlap),
    )


def _of_transform(covariance: Array, evidence: Evidence, matrix: Array, factor: float) -> Array:
    """Covariance [6, 6] of rotation vector and translation, in input units, from that about the source's centre."""
    change: Array = np.eye(6)
    change[3:, :3] = cross_matrix(factor * (matrix @ evidence.source.moments.center))
    change[3:, 3:] *= evidence.target.moments.scale
    return change @ covariance @ change.T


def _symmetry(evidence: Evidence, motion: Similarity) -> tuple[PointGroup, Array]:
    """Symmetry group of the target and its centre, from whichever of the two objects is the better known.

    Where they are not sure to be alike, from that of the larger group: what carries one of them onto itself makes maps
    that do as well, whatever the other has beside.
    """
    alike = not evidence.has_points or evidence.excess(motion, both=True) <= certain(1.0)
    sides = sorted((evidence.target, evidence.source), key=lambda s: (not s.is_mesh, -len(s.shape.points)))
    every = [(s, evidence.detected(s)) for s in sides[: 1 if alike else 2]]
    side, found = max(every, key=lambda known: known[1].group.order)
    if side is evidence.target:
        return found.group, found.center
    # The centre moves with the object, at the target's size.
    matrix, translation, factor = _in_input_units(evidence, motion, evidence.scale)
    return found.group.carried(matrix), factor * (matrix @ found.center) + translation


def _in_input_units(evidence: Evidence, motion: Similarity, scale: bool) -> tuple[Array, Array, float]:
    """Matrix, translation and scale for the input's own coordinates."""
    factor = _factor(evidence, motion) if scale else 1.0
    return *_placed(evidence, motion, factor), factor


def _factor(evidence: Evidence, motion: Similarity) -> float:
    """How many times as large the target is."""
    return motion.scale * evidence.target.moments.scale / evidence.source.moments.scale


def _blurred(evidence: Evidence) -> float:
    """How far off noise may put a size: it moves all planes of a side out or in at once, by half of their thickness."""
    return 0.5 * float(np.median(evidence.moving.thickness))


def _placed(evidence: Evidence, motion: Similarity, factor: float) -> tuple[Array, Array]:
    """Matrix and translation for the input's own coordinates, given the size of the source in units of the target."""
    a, b = evidence.source.moments, evidence.target.moments
    return motion.matrix, b.center + b.scale * motion.shift - factor * (motion.matrix @ a.center)


def _verdict(choice: Choice, motion: Similarity, scale: bool, reflections: bool, excess: float | None) -> Verdict:
    """Whether the map holds in 3-space, given its excess if that is known."""
    evidence, status = choice.evidence, _sizes(choice, scale)
    sure = choice.determinant_confidence if reflections else 1.0
    if status != OK or not evidence.has_points:
        return Verdict(status=status, excess=unlikely(choice.misfit), determinant_confidence=sure)
    excess = evidence.excess(motion) if excess is None else excess
    if excess > 1.0 and not choice.exact:
        farthest = float(np.quantile(evidence.misses(motion), 0.99))
        status = (
            f"the objects differ by {excess:.1f} times what the tolerance allows: 99 % of the source comes within "
            f"{_percent(farthest)} of the diagonal"
        )
    asked = status == OK and reflections and choice.hand_is_open
    hand = sure + (1.0 - sure) * _has_both_hands(choice) if asked else 1.0
    return Verdict(status=status, excess=excess, determinant_confidence=sure, hand=hand)


def _percent(fraction: float) -> str:
    """A fraction in percent, to two digits, and never as a power of ten."""
    return f"{100 * fraction:{'.2g' if fraction < 0.995 else '.0f'}} %"


def _has_both_hands(choice: Choice) -> float:
    """Probability that the target is its own mirror image, where what leads from one hand to the other says so."""
    if choice.other is None:
        return 1.0
    return meant(Link(need=choice.evidence.own_excess(choice.other.after(choice.motion.inverse))), 1.0)


def _nearness(choice: Choice, motion: Similarity, scale: bool) -> Nearness:
    """How near the map brings the objects in 3-space."""
    evidence = choice.evidence
    surfaces = _sizes(choice, scale) == OK and evidence.has_points
    if choice.exact or not surfaces:
        matrix, translation, factor = _in_input_units(evidence, motion, scale)
        shapes = evidence.source.shape, evidence.target.shape
        points = nearness(*shapes, matrix, translation, factor, evidence.tolerance)
        # The same points; of the same surface either side may have others, too.
        if not surfaces or (points.rms < ROUNDING and points.overlap == (1.0, 1.0)):
            return points
    misses, back, far = evidence.misses(motion), evidence.misses_back(motion), evidence.judge.far
    shares = float((misses <= far).mean()), float((back <= far).mean())
    return Nearness(rms=float(np.sqrt(np.mean(misses**2))), overlap=shares)


def _sizes(choice: Choice, scale: bool) -> str:
    """The status as the sizes have it: of objects that do not agree at any size, the size is not to blame."""
    if scale or not choice.evidence.scale or choice.excess > 1.0:
        return OK
    return unlike_sizes(_factor(choice.evidence, choice.motion))
