"""Detection in the plane: shape -> outlines -> proposals -> fits -> needs -> the group, and how sure."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from symrefine.clock import Clock
from symrefine.decide.doubts import on_a_line, set_by_strays
from symrefine.decide.posterior import ALIKE, NEAR, PICTURE, Alternative, Decision, Link, alternatives, decide
from symrefine.errors import InputError
from symrefine.geometry import Array, Plane, ReadOnly, check_tolerance, toward_positive
from symrefine.groups.plane import PointGroup2D
from symrefine.moments.moments import PARTS, Moments, shape_moments
from symrefine.ntuples.contract import NTuples, ntuples
from symrefine.plane.chain import Hypothesis, chain, explore
from symrefine.plane.doublets import ORDER, PLANAR_ORDERS, DoubletClass, classify_doublets
from symrefine.plane.outline import NOISES, Outlines, make_outlines
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE, Deviation
from symrefine.threads import one_thread


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundLine:
    """A mirror line `normal.x = offset` in input units: its miss in fractions of the diagonal, and how sure it is."""

    line: Plane
    residual: Deviation
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundRotation:
    """The turns about the centre: `order` is `math.inf` for a round object; `residual` is that of the worst of them."""

    order: float
    residual: Deviation
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanarNearMiss:
    """A line, or a turn of some order about a centre (`line` None), that was fitted and turned down.

    `excess` is the smallest tolerance at which it would hold, over the tolerance asked for.
    """

    line: Plane | None
    center: Array
    order: float
    residual: Deviation
    excess: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarDetection(ReadOnly):
    """Everything `detect_planar` found, in the frame and units of the input.

    Attributes:
        point_group: "C1" when there is nothing, "D1" for one line, "Cn", "Dn", or "O(2)" for a round object;
            "undetermined" where the data support no decision.
        confidence: probability that this is the group: the worst element kept and the best turned down both count.
        alternatives: the groups it may be instead, likeliest first.
        group: the same with the direction of a mirror line; C1 where nothing is decided.
        center: [2] a point that all operations leave in place; on the line nearest to the centroid for D1.
        lines: mirror lines, best first; none are listed for O(2), where every line through the centre is one.
        rotation: the turns, or None where there is but the identity.
        near_misses: candidates turned down, best first.
        doublets: what the n-tuples say, with the singular values of each vector of moments.
        vectors: the n-tuples themselves.
        tolerance: the tolerance the decisions were made at, as a fraction of `diagonal`.
        diagonal: diagonal of the smallest bounding box over all orientations, input units.
        undetermined: why the data support no decision; empty when they do.
        timings: seconds by stage; everything else is a function of the input and the options alone.
    """

    point_group: str
    confidence: float
    alternatives: tuple[Alternative, ...]
    group: PointGroup2D
    center: Array
    lines: tuple[FoundLine, ...]
    rotation: FoundRotation | None
    near_misses: tuple[PlanarNearMiss, ...]
    doublets: DoubletClass
    vectors: NTuples
    tolerance: float
    diagonal: float
    undetermined: str
    timings: dict[str, float] = field(default_factory=dict)


@one_thread()
def detect_planar(
    shape: Shape | ArrayLike, *, weights: ArrayLike | None = None, tolerance: float = TOLERANCE, seed: int = 0
) -> PlanarDetection:
    """Point group, mirror lines and turns of an object in the plane, with what it misses each of them by.

    Points on a square grid are the pixels of a picture, known to a fraction of a pixel; up to 250 others stand for
    themselves (see `Shape.atoms`); more are random samples of an outline or of an area, whose noise is estimated
    (jackknife) and allowed for.

    Args:
        shape: a `Shape`, or points [N, 2].
        weights: [N] masses of the points; not with a `Shape`, which carries its own. Weights count: where they differ,
            the outlines of three levels of weight must agree.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal: 95 % of the
            outline must come within 0.75 of it, 99 % within 1.6, the mean within 0.22 (see `surface.misses`).
        seed: of the random choices (subsets of large clouds).

    Raises:
        InputError: not a 2-D shape, or a tolerance outside (0, 0.2].
        DegenerateShapeError: the points do not spread.
    """
    if not isinstance(shape, Shape):
        shape = Shape.of(shape, weights=weights)
    elif weights is not None:
        raise InputError("weights belong to the Shape; give them there, or give an array of points")
    if shape.dim != 2:
        raise InputError(f"{shape.source}: detect_planar takes 2-D shapes; these points have {shape.dim} coordinates")
    check_tolerance(tolerance)
    clock = Clock()
    with clock("moments", len(shape.points)):
        frame = shape_moments(shape, 2)
        rng = np.random.default_rng(seed)
        outlines = make_outlines(shape, frame.center, frame.scale, rng)
        moments = shape_moments(shape, ORDER, parts=PARTS if outlines.sampled else 0)
        doublets = classify_doublets(moments, tolerance, outlines.pixel_noise)
    flaw = _flaw(shape, frame, outlines)
    with clock("search"):
        hint = None if doublets.kind == "centre" else doublets.angle_rad
        pool = () if flaw else explore(outlines, hint, ALIKE * tolerance)
        links = chain(outlines, pool, ALIKE * tolerance)
    with clock("decide"):
        decision, hopeless = _decided(links, tolerance)
        reason = flaw or ("" if hopeless else _doubt(outlines, tolerance))
    return _report(links, pool, decision, reason, moments, doublets, outlines, tolerance, clock)


def _decided(links: Sequence[Hypothesis], tolerance: float) -> tuple[Decision, bool]:
    """The group, as likely as it is on average over what noise may be, and whether it is C1 whatever that is."""
    each = [
        decide([Link(need=h.needs[k], lone_mirror=h.placed.is_line) for h in links[1:]], tolerance, curve=PICTURE)
        for k in range(len(NOISES))
    ]
    return Decision.of(np.mean([d.inside for d in each], axis=0).tolist()), not any(d.index for d in each)


def _flaw(shape: Shape, frame: Moments, outlines: Outlines) -> str:
    """Why the points support no decision at any tolerance, or nothing if they do; a picture may have specks."""
    points = shape.points if shape.weights is None else shape.points[shape.weights > 0]
    strays = "" if outlines.pixel_noise else set_by_strays(points, few=not outlines.sampled)
    return strays or on_a_line(frame.covariance)


def _doubt(outlines: Outlines, tolerance: float) -> str:
    """Why the points do not tell a symmetry from none at this tolerance, or nothing if they do."""
    if outlines.floor <= tolerance:
        return ""
    what, more = ("noise", "points, less noise") if outlines.sampled else ("pixels", "pixels")
    return (
        f"the {what} could hide anything: what they leave unknown alone needs a tolerance of {outlines.floor:.1%} of "
        f"the diagonal, {tolerance:.1%} is asked; give more {more}, or a larger tolerance"
    )


def _report(
    links: Sequence[Hypothesis],
    pool: Sequence[Hypothesis],
    decision: Decision,
    reason: str,
    moments: Moments,
    doublets: DoubletClass,
    outlines: Outlines,
    tolerance: float,
    clock: Clock,
) -> PlanarDetection:
    origin, scale = moments.center, moments.scale
    index = 0 if reason else decision.index
    chosen = links[index]
    told = alternatives(
        [h.placed.group.name for h in links], [h.need for h in links], decision, -1 if reason else index
    )

    def sure(element: Hypothesis) -> float:
        """That the true group holds the first group of the chain which has the element."""
        return next(p for h, p in zip(links, decision.inside, strict=True) if h.placed.holds(element.placed))

    def line(element: Hypothesis) -> Plane:
        found = element.placed.line
        sign = toward_positive(found.normal)
        return Plane(normal=sign * found.normal, offset=sign * (scale * found.offset + float(found.normal @ origin)))

    turns = next((e for e in chosen.elements if not e.placed.is_line), None)
    return PlanarDetection(
        point_group="undetermined" if reason else chosen.placed.group.name,
        confidence=0.0 if reason else decision.probabilities[index],
        alternatives=tuple(told),
        group=chosen.placed.group,
        center=origin + scale * chosen.placed.center,
        lines=tuple(
            FoundLine(line=line(e), residual=e.deviation, confidence=sure(e))
            for e in sorted(chosen.elements, key=lambda e: e.need)
            if e.placed.is_line
        ),
        rotation=None
        if turns is None
        else FoundRotation(order=turns.placed.fold, residual=turns.deviation, confidence=sure(turns)),
        near_misses=tuple(
            PlanarNearMiss(
                line=line(e) if e.placed.is_line else None,
                center=origin + scale * e.placed.center,
                order=e.placed.fold,
                residual=e.deviation,
                excess=e.need / tolerance,
            )
            for e in _turned_down(pool, chosen)
        ),
        doublets=doublets,
        vectors=ntuples(moments, PLANAR_ORDERS),
        tolerance=tolerance,
        diagonal=outlines.diagonal * scale,
        undetermined=reason,
        timings=clock.seconds,
    )


def _turned_down(pool: Sequence[Hypothesis], chosen: Hypothesis) -> list[Hypothesis]:
    """Elements that were fitted and judged and are not in the group, best first."""
    found: list[Hypothesis] = []
    for e in sorted((e for h in pool for e in h.elements), key=lambda e: e.need):
        if not any(
            p.holds(e.placed)
            for p in (chosen.placed, *(o.placed for o in found if o.placed.is_line == e.placed.is_line))
        ):
            found.append(e)
    return found[:NEAR]
