"""Alignment elsewhere than in 3-space, and of sets that span fewer dimensions than they live in.

Few points stand for themselves: maps that carry each onto one of the others. Where there are none, and of more points:
moments within the span -> n-tuples -> Procrustes -> Gauss-Newton on the moments.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from symrefine.align.alignment import OK, OPEN, Alignment, Verdict
from symrefine.align.coset import Coset, coset_of_group, coset_of_list, lifted
from symrefine.align.kinds import nearest_both_ways, nearness
from symrefine.align.moment_fit import MISFIT, ROUNDING, unlikely
from symrefine.align.onto import maps_onto
from symrefine.align.pair import Side, few
from symrefine.align.sides import rank_of, same_size, size_sigma, told_sizes, within
from symrefine.align.span import span_fit
from symrefine.clock import Clock
from symrefine.decide.posterior import ALIKE
from symrefine.geometry import Array
from symrefine.ntuples.contract import PAPER_ORDERS, ntuples
from symrefine.plane import detect_planar
from symrefine.shape import Shape
from symrefine.surface.misses import ATOM_LIMITS, needs_of_atoms
from symrefine.surface.tree import Tree


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Span:
    """What two sides span, and how a map within their spans is one in all of space.

    Attributes:
        sides: source and target.
        ranks: how many dimensions each spans.
        bases: [n, n] of each, orthonormal rows of which the first `rank` span it.
        reflections: whether determinant -1 is an answer.
    """

    sides: tuple[Side, Side]
    ranks: tuple[int, int]
    bases: tuple[Array, Array]
    reflections: bool

    @classmethod
    def of(cls, sides: tuple[Side, Side], reflections: bool) -> "_Span":
        dim, ranks = sides[0].shape.dim, (rank_of(sides[0].moments), rank_of(sides[1].moments))
        whole = max(ranks) == dim
        one, other = (np.eye(dim) if whole else np.linalg.eigh(s.moments.covariance)[1].T[::-1] for s in sides)
        return cls(sides=sides, ranks=ranks, bases=(one, other), reflections=reflections)

    @property
    def rank(self) -> int:
        """How many dimensions the larger side spans."""
        return max(self.ranks)

    @property
    def of_points(self) -> bool:
        """Whether both sides are points, and no meshes."""
        return all(s.shape.faces is None for s in self.sides)

    @property
    def either_hand(self) -> bool:
        """Whether determinant -1 is an answer within the span: across it there is always one that undoes it."""
        return self.reflections or self.rank < self.sides[0].shape.dim

    def coset(self, matrices: Array, free: Array, centers: tuple[Array, Array], scale: float, *, every: bool) -> Coset:
        """The maps in all of space of those within the span, about the two centres."""
        if self.rank == self.sides[0].shape.dim:
            return coset_of_list(matrices, *centers, scale, free, every=every)
        still = np.zeros(self.rank)
        inner = coset_of_list(matrices, still, still, scale, free, every=every)
        return lifted(inner, *self.bases, centers, scale, reflections=self.reflections)


def align_in_span(
    sides: tuple[Side, Side], scale: bool, reflections: bool, tolerance: float, clock: Clock
) -> Alignment:
    """The story elsewhere; arguments as of `align`, which has checked them."""
    span = _Span.of(sides, reflections)
    one, other = (len(s.shape.points) for s in sides)
    if span.of_points and min(span.ranks) == span.rank and one == other:
        with clock("choose"):
            found = _by_points(span, scale, tolerance, clock)
        if found is not None:
            return found
    return _by_moments(span, scale, tolerance, clock)


def _by_points(span: _Span, scale: bool, tolerance: float, clock: Clock) -> Alignment | None:
    """The answer for as many points on either side, each with one of its own; None where no map was found."""
    a, b = (s.shape for s in span.sides)
    centers = a.points.mean(axis=0), b.points.mean(axis=0)
    source, target = (
        (s.points - c) @ basis[: span.rank].T / b.diagonal
        for s, c, basis in zip((a, b), centers, span.bases, strict=True)
    )
    factor = float(np.linalg.norm(target) / np.linalg.norm(source)) if scale else 1.0
    onto, most = partial(maps_onto, factor * source, target, (a.labels, b.labels)), ATOM_LIMITS[-1] * tolerance
    if not few(a, b):
        # Of many points, which may be samples, each has to be the nearest to its own, and nearer than its neighbours.
        onto = partial(onto, crowded=False)
        most = min(most, float(np.median(Tree(target).query(target, 1, skip=1)[0])))
    found = _maps(onto, most, tolerance, reflections=span.either_hand)
    if found is None:
        return None
    matrices, misses, complete = found
    # Rotations come first where they do as well.
    rms, hands = np.sqrt((misses**2).mean(axis=1)), np.sign(np.linalg.det(matrices))
    well = rms <= max(ALIKE * rms.min(), ROUNDING)
    order = np.lexsort((rms, -hands * well, ~well))
    best = misses[order[0]]
    coset = span.coset(matrices[order], np.zeros((0, span.rank)), centers, factor, every=complete)
    verdict = Verdict(status=OK, excess=float(needs_of_atoms(best)) / tolerance)
    exact, matrix, translation = bool(rms[order[0]] < ROUNDING), coset.matrices[0], coset.translations[0]
    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=factor,
        scale_sigma=0.0 if exact or not scale else factor * _scaled_by(best, target),
        sigma_rad=0.0 if exact else _turned_by(best, target),
        covariance=np.zeros((0, 0)),
        exact=exact,
        timings=clock.seconds,
        _coset=lambda: coset,
        _verdict=lambda: verdict,
        _nearness=lambda: nearness(a, b, matrix, translation, factor, tolerance),
    )


def _maps(
    onto: Callable[[float], tuple[Array, Array] | None], most: float, tolerance: float, *, reflections: bool
) -> tuple[Array, Array, bool] | None:
    """Maps within the tolerance with what they miss by, and whether these are all; None if there is none, or too many.

    Points are in units of the diagonal. By how much they may be off is tried from rounding upwards, tenfold: of many
    points near one another few have the same distances then. What is found so stands for all where a larger error
    leaves too many to be asked.
    """
    most = max(most, ROUNDING)
    allowed, known = np.geomspace(ROUNDING, most, 1 + math.ceil(math.log10(most / ROUNDING))).tolist(), None
    while allowed:
        found = onto(allowed.pop(0))
        if found is None:
            return known
        matrices, misses = found
        good = (needs_of_atoms(misses) <= tolerance) & (reflections | (np.linalg.det(matrices) > 0.0))
        if good.any():
            known = matrices[good], misses[good], not allowed
            allowed = allowed[-1:]
    return known


def _variance(misses: Array, target: Array) -> float:
    """Of each coordinate, by what is left of it after the fit of a map."""
    count, dim = target.shape
    return float((misses**2).sum() / max(count * dim - dim * (dim + 1) // 2, 1))


def _turned_by(misses: Array, target: Array) -> float:
    """Standard deviation of the rotation, all planes together: in each the spreads of both its axes hold it."""
    spreads = np.linalg.eigvalsh(target.T @ target)
    one, other = np.triu_indices(len(spreads), 1)
    return float(np.sqrt((_variance(misses, target) / (spreads[one] + spreads[other])).sum()))


def _scaled_by(misses: Array, target: Array) -> float:
    """Standard deviation of the ratio of the sizes."""
    return float(np.sqrt(_variance(misses, target) / (target**2).sum()))


def _by_moments(span: _Span, scale: bool, tolerance: float, clock: Clock) -> Alignment:
    a, b = span.sides
    with clock("choose"):
        source, target = (within(s, basis[: span.rank]) for s, basis in zip(span.sides, span.bases, strict=True))
        orders = [t for t in PAPER_ORDERS if max(t) <= source.order]
        tuples = ntuples(source, orders), ntuples(target, orders)
        found = span_fit(source, target, tuples, reflections=span.either_hand)
    factor = b.moments.scale / a.moments.scale if scale else 1.0
    coset = span.coset(found.matrices, found.free, (a.moments.center, b.moments.center), factor, every=False)
    matrix, translation = coset.matrices[0], coset.translations[0]
    known = partial(_planar_coset, b.shape, coset, span.reflections)

    def verdict() -> Verdict:
        status, excess = OK if scale else told_sizes(a, b), unlikely(found.misfit)
        if few(a.shape, b.shape) or (found.exact and span.of_points):
            excess = _missed(span, matrix, translation, factor) / tolerance
            if status == OK and excess > 1.0:
                status = f"the points differ by {excess:.1f} times what the tolerance allows"
                if found.exact:
                    status = f"{OPEN}: moments to order {source.order} allow maps that carry no point onto another"
        elif found.misfit > MISFIT and not found.exact:
            status = f"the moments differ by {found.misfit:.0f} times what sampling explains"
        if status == OK and not np.isfinite(found.sigma_rad) and not found.exact:
            status = f"{OPEN}: the noise of the moments hides every direction; give more points"
        return Verdict(status=status, excess=excess)

    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=factor,
        scale_sigma=factor * size_sigma(a, b) if scale and not found.exact else 0.0,
        sigma_rad=0.0 if found.exact else found.sigma_rad,
        covariance=np.zeros((0, 0)),
        exact=found.exact and (scale or same_size(a, b)),
        timings=clock.seconds,
        _coset=known if a.shape.dim == span.rank == 2 else lambda: coset,
        _verdict=verdict,
        _nearness=lambda: nearness(a.shape, b.shape, matrix, translation, factor, tolerance),
    )


def _missed(span: _Span, matrix: Array, translation: Array, factor: float) -> float:
    """What the nearest points of two sets need as a tolerance, from either side."""
    a, b = (s.shape for s in span.sides)
    moved = factor * a.points @ matrix.T + translation
    return float(max(map(needs_of_atoms, nearest_both_ways(moved, b.points, (a.labels, b.labels), b.diagonal))))


def _planar_coset(target: Shape, known: Coset, reflections: bool) -> Coset:
    """In the plane, the operations of the target that `detect_planar` finds, after the map that is known."""
    found = detect_planar(target)
    if found.undetermined or np.isinf(found.group.order) or len(known.free):
        return known
    return coset_of_group(known.matrices[0], known.translations[0], found.group, found.center, reflections=reflections)
