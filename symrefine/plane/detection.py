"""Detection in the plane: shape -> moments -> doublets and angular spectrum -> candidates -> fit -> judge -> group."""

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, Plane, read_only
from symrefine.groups import PointGroup2D
from symrefine.moments.moments import shape_moments
from symrefine.ntuples.contract import NTuples
from symrefine.plane.doublets import ORDER, DoubletClass, classify_doublets, planar_doublets
from symrefine.plane.judge import LineDeviation, confidence
from symrefine.plane.outline import Outlines, make_outlines
from symrefine.plane.placed import Placed
from symrefine.plane.search import Found, search, unclaimed
from symrefine.plane.spectrum import FLOOR, angular_spectrum
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

PARTS = 32
NEAR = 8
# What the outline may be off by, in tolerances: beyond the first, pixels are too coarse for any decision, and samples
# beyond 1; below the second, both are as good as exact; between, a near miss may hold: of pixels one that lies within
# the limit, of samples one that exceeds it by no more than so many times that share.
COARSE_PIXELS, QUIET, HIDDEN = 2.5, 0.25, 1.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundLine:
    """A mirror line `normal.x = offset` in input units: its miss in fractions of the diagonal, and how sure it is.

    `excess` is the miss over what the tolerance allows, at most 1.
    """

    line: Plane
    residual: LineDeviation
    excess: float
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundRotation:
    """The turns about the centre: `order` is `math.inf` for a round object; `residual` is that of the worst of them."""

    order: float
    residual: LineDeviation
    excess: float
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanarNearMiss:
    """A line, or a turn of some order about a centre (`line` None), that was fitted and turned down."""

    line: Plane | None
    center: Array
    order: float
    residual: LineDeviation
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanarDetection:
    """Everything `detect_planar` found, in the frame and units of the input.

    Attributes:
        point_group: "C1" when there is nothing, "D1" for one line, "Cn", "Dn", or "O(2)" for a round object.
        group: the same with the direction of a mirror line.
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(self.center))

    @property
    def confidence(self) -> float:
        """How sure the group is: its least sure element, or for C1 that the nearest miss is one."""
        found = [line.confidence for line in self.lines]
        if self.rotation is not None:
            found.append(self.rotation.confidence)
        return min(found, default=1.0 - confidence(min((m.excess for m in self.near_misses), default=math.inf)))


def detect_planar(
    shape: Shape | ArrayLike, *, weights: ArrayLike | None = None, tolerance: float = TOLERANCE, seed: int = 0
) -> PlanarDetection:
    """Point group, mirror lines and turns of an object in the plane, with what it misses each of them by.

    Points on a square grid are the pixels of a picture, known to a fraction of a pixel; up to 250 others stand for
    themselves; more are random samples of an outline or of an area, whose noise is estimated (jackknife) and allowed
    for.

    Args:
        shape: a `Shape`, or points [N, 2].
        weights: [N] masses of the points; not with a `Shape`, which carries its own. Weights count: where they differ,
            the outlines of three levels of weight must agree.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal: 95 % of the
            outline must come within it, 99 % within 1.4 of it, and the mean within 0.28 (see `verify`).
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
    if not 0.0 < tolerance <= 0.2:
        raise InputError(f"tolerance is {tolerance}; expected a fraction of the diagonal in (0, 0.2]")
    clock = _Clock()
    frame = shape_moments(shape, 2)
    rng = np.random.default_rng(seed)
    outlines = make_outlines(shape.points, shape.weights, frame.center, frame.scale, tolerance, rng)
    clock("outlines")
    moments = shape_moments(shape, ORDER, parts=PARTS if outlines.sampled else 0)
    doublets = classify_doublets(moments, tolerance, outlines.pixel_noise)
    floor = float(np.hypot(FLOOR, outlines.pixel_noise))
    spectrum = angular_spectrum(outlines.cells, outlines.masses, sampled=outlines.sampled, floor=floor)
    clock("moments")
    found = search(outlines, spectrum, None if doublets.kind == "centre" else doublets.angle_rad)
    clock("search")
    doubt = _doubt(outlines, found, tolerance)
    found = _in_input_units(unclaimed(found) if doubt else found, frame.center, frame.scale)
    return _report(found, doublets, planar_doublets(moments), outlines.diagonal * frame.scale, tolerance, doubt, clock)


class _Clock:
    """Wall-clock seconds by stage, each told when it ends."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.last = time.perf_counter()

    def __call__(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage], self.last = now - self.last, now


def _in_input_units(found: Found, origin: Array, scale: float) -> Found:
    def moved(placed: Placed) -> Placed:
        return replace(placed, center=origin + scale * placed.center)

    return replace(
        found,
        placed=moved(found.placed),
        lines=tuple(replace(c, placed=moved(c.placed)) for c in found.lines),
        rejected=tuple(replace(c, placed=moved(c.placed)) for c in found.rejected),
    )


def _report(
    found: Found,
    doublets: DoubletClass,
    vectors: NTuples,
    diagonal: float,
    tolerance: float,
    doubt: str,
    clock: _Clock,
) -> PlanarDetection:
    turns = found.turns
    rotation = None
    if turns is not None:
        rotation = FoundRotation(
            order=found.placed.fold,
            residual=turns.deviation,
            excess=turns.excess,
            confidence=confidence(turns.excess),
        )
    return PlanarDetection(
        point_group=found.placed.group.name,
        group=found.placed.group,
        center=found.placed.center,
        lines=tuple(
            FoundLine(
                line=c.placed.lines()[0],
                residual=c.verdict.deviation,
                excess=c.verdict.excess,
                confidence=confidence(c.verdict.excess),
            )
            for c in found.lines
        ),
        rotation=rotation,
        near_misses=tuple(
            PlanarNearMiss(
                line=c.placed.lines()[0] if c.is_line else None,
                center=c.placed.center,
                order=c.placed.fold,
                residual=c.verdict.deviation,
                excess=c.verdict.excess,
            )
            for c in found.rejected[:NEAR]
        ),
        doublets=doublets,
        vectors=vectors,
        tolerance=tolerance,
        diagonal=diagonal,
        undetermined=doubt,
        timings=clock.seconds,
    )


def _doubt(outlines: Outlines, found: Found, tolerance: float) -> str:
    """Why the points support no decision at this tolerance, or nothing if they do."""
    floor = max(j.floor.p95 for j in outlines.judges)
    share = floor / tolerance
    more = "points or less noise" if outlines.sampled else "pixels"
    if share > (1.0 if outlines.sampled else COARSE_PIXELS):
        return (
            f"the {'noise' if outlines.sampled else 'pixels'} could hide anything: 5 % of the outline may be off by "
            f"{floor:.1%} of the diagonal or more, against a tolerance of {tolerance:.1%}; give more {more}, or a "
            "larger tolerance"
        )
    nearest = min((c.verdict.excess for c in found.rejected), default=math.inf)
    if share <= QUIET or nearest >= (1.0 + HIDDEN * share if outlines.sampled else 1.0):
        return ""
    return (
        f"a near miss (by {nearest:.2f} times the limit) may be a symmetry: 5 % of the outline may be off by "
        f"{floor:.1%} of the diagonal or more, against a tolerance of {tolerance:.1%}; give more {more}"
    )
