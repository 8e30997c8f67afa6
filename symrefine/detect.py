"""Detection on one page: shape -> moments -> n-tuples and spectrum -> candidates -> refine -> judge -> group."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from symrefine.assemble import Assembly, assemble
from symrefine.elements import Element, inversion_of
from symrefine.errors import InputError
from symrefine.fit.refine import Iterate
from symrefine.gather import gather, is_few, measure, part
from symrefine.geometry import Array, Axis, Plane, read_only
from symrefine.groups import PointGroup
from symrefine.ntuples.contract import NTuples
from symrefine.ntuples.rank import TupleClass
from symrefine.search import Evidence
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE, Deviation, Verdict, confidence

LARGEST_TOLERANCE = 0.2
# Tolerances of the staircase that the command line tells.
LADDER = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08)
# Up to so many points of a surface it is asked whether the answer hangs on a few: of so many parts of this size.
SPARSE = 1500
SUBSETS = 3
SUBSET = 0.8
# Share of the tolerance that such a cloud may miss itself by.
SPARSE_FLOOR = 0.75
# Miss over its limit from which on a group is in doubt (97 % sure).
DOUBT = 0.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundPlane:
    """A mirror plane in input units: its miss as fractions of the bounding-box diagonal, and how sure it is.

    `sigma_rad` is the standard deviation of the normal in its least certain direction, `sigma` that of the offset in
    input units: both from the joint refinement of the whole group; NaN where there was none.
    """

    plane: Plane
    residual: Deviation
    confidence: float
    sigma_rad: float
    sigma: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundAxis:
    """A rotation axis (or rotoreflection, if `improper`) in input units; `order` is `math.inf` for revolution.

    `sigma_rad` and `sigma` (input units) are standard deviations of direction and position, each where it is least
    certain; NaN where no refinement told them.
    """

    axis: Axis
    order: float
    improper: bool
    residual: Deviation
    confidence: float
    sigma_rad: float
    sigma: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The answer at one tolerance: the group as a function of the tolerance is a staircase."""

    tolerance: float
    point_group: str
    undetermined: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NearMiss:
    """A candidate that was refined and turned down, with what it misses by, for a person to judge."""

    kind: str
    direction: Array
    point: Array
    order: float
    residual: Deviation
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """Everything `detect` found, in the frame and units of the input.

    Attributes:
        point_group: Schoenflies symbol; "C1" when there is nothing.
        group: the same placed in space.
        center: [3] the point all operations leave in place.
        planes: discrete mirror planes, best first.
        axes: rotation and rotoreflection axes, highest order first.
        inversion: whether the inversion about the centre is a symmetry.
        inversion_residual: its miss as fractions of the diagonal; None where there is none.
        inversion_confidence: how sure it is, from its own miss and those of the elements; None where there is none.
        near_misses: candidates turned down, best first.
        iterations: outer iterations of the refinement of all planes together; where they had to be found one by one,
            those of the element that took most come on top (coarse looks at a tenth of the points do not count).
        tolerance: the tolerance the decisions were made at, as a fraction of `diagonal`.
        diagonal: diagonal of the smallest bounding box over all orientations, input units.
        undetermined: why the data support no decision; empty when they do.
        staircase: the group at the tolerances that were asked for besides.
        tuples: class of the n-tuples, with singular values.
        vectors: the n-tuples themselves, dimensionless.
        history: the iterates of that refinement, in normalised units; `scale` and `origin` undo the normalisation.
        points: [M, 3] the points the refinement used, normalised units.
        timings: seconds by stage; everything else is a function of the input and the options alone.
    """

    point_group: str
    group: PointGroup
    center: Array
    planes: tuple[FoundPlane, ...]
    axes: tuple[FoundAxis, ...]
    inversion: bool
    inversion_residual: Deviation | None
    inversion_confidence: float | None
    near_misses: tuple[NearMiss, ...]
    iterations: int
    tolerance: float
    diagonal: float
    undetermined: str
    staircase: tuple[Step, ...]
    tuples: TupleClass
    vectors: NTuples
    history: tuple[Iterate, ...]
    points: Array
    origin: Array
    scale: float
    timings: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("center", "points", "origin"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def detect(
    shape: Shape | ArrayLike,
    *,
    weights: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    tolerance: float = TOLERANCE,
    ladder: Sequence[float] = (),
    seed: int = 0,
) -> Detection:
    """Point group, mirror planes and rotation axes of an object in 3-space, with what it misses each of them by.

    Args:
        shape: a `Shape`, or points [N, 3].
        weights: [N] masses of the points; not with a `Shape`, which carries its own. Of up to 250 points those of
            different mass are different things, which no symmetry exchanges; of more, masses are a sampling density.
        normals: [N, 3] normals, any sign; estimated where absent. Not with a `Shape`.
        labels: [N] integers: classes (elements, colours, materials) that every symmetry must keep. Not with a `Shape`.
        tolerance: largest miss that still counts as symmetric, as a fraction of the bounding-box diagonal: 95 % of the
            surface must come within 0.75 of it, 99 % within 1.6, the mean within 0.22 (see `verify`), and no part may
            stand 1.3 of it from where its counterpart is (see `displaced`).
        ladder: other tolerances to tell the group at, from the same evidence; see `Detection.staircase`.
        seed: of the random choices (samples of a mesh, subsets of a cloud).

    Raises:
        InputError: not a 3-D shape, or tolerances outside (0, 0.2].
        DegenerateShapeError: the points do not spread.
    """
    if not isinstance(shape, Shape):
        shape = Shape.of(shape, weights=weights, normals=normals, labels=labels)
    elif not (weights is None and normals is None and labels is None):
        raise InputError("weights, normals and labels belong to the Shape; give them there, or give an array of points")
    if shape.dim != 3:
        raise InputError(f"{shape.source}: detect takes 3-D shapes; {_elsewhere(shape.dim)}")
    for t in (tolerance, *ladder):
        if not 0.0 < t <= LARGEST_TOLERANCE:
            raise InputError(f"tolerance is {t}; expected a fraction of the diagonal in (0, {LARGEST_TOLERANCE}]")
    shape = _with_mass(shape)
    clock = Clock()
    vectors, evidence, found = _examine(shape, tolerance, seed, clock)
    with clock("doubt"):
        doubt = _doubt(evidence) or _fickle(shape, found, tolerance, seed)
    with clock("staircase"):
        stairs = tuple(_step(evidence, t) for t in sorted(ladder))
    return _report(_unclaimed(found) if doubt else found, evidence, vectors, doubt, stairs, clock.seconds)


def _step(evidence: Evidence, tolerance: float) -> Step:
    """The group at another tolerance, from the same evidence."""
    judge = replace(evidence.judge, tolerance=tolerance)
    asked = replace(evidence, judge=judge, closer=lambda: replace(evidence.closer(), tolerance=tolerance))
    doubt = bool(_doubt(asked))
    return Step(tolerance=tolerance, point_group="C1" if doubt else assemble(asked).group.name, undetermined=doubt)


def _examine(shape: Shape, tolerance: float, seed: int, clock: "Clock") -> tuple[NTuples, Evidence, Assembly]:
    """The n-tuples, all evidence, and the group that it speaks for."""
    with clock("moments"):
        measured = measure(shape)
    with clock("local_planes"):
        evidence = gather(measured, tolerance, np.random.default_rng(seed))
    with clock("search"):
        return measured.vectors, evidence, assemble(evidence)


def _with_mass(shape: Shape) -> Shape:
    """The shape without points of no mass, which are no part of the object."""
    if shape.weights is None or shape.faces is not None or shape.weights.all():
        return shape
    return part(shape, np.flatnonzero(shape.weights > 0))


def _elsewhere(dim: int) -> str:
    """What is offered for points of another dimension."""
    if dim == 2:
        return "these points have 2 coordinates: use symrefine.plane.detect_planar"
    return (
        f"these points have {dim} coordinates: for 4 and more symrefine.ndim.detect_nd tells the rank of the "
        "n-tuples and the hyperplanes of symmetry, no turns and no groups"
    )


def _doubt(evidence: Evidence) -> str:
    """Why the cloud supports no decision at this tolerance, or nothing if it does."""
    floor, tolerance = evidence.judge.floor.p95, evidence.judge.tolerance
    sparse = evidence.judge.cloud.body == "surface" and len(evidence.points) <= SPARSE
    needed = (SPARSE_FLOOR if sparse else 1.0) * tolerance
    if floor <= needed:
        return ""
    return (
        f"the cloud does not even agree with itself: 5 % of it misses the rest by {floor:.1%} of the diagonal or more, "
        f"and a tolerance of {tolerance:.1%} needs {needed:.1%}; give more points, less noise, or a larger tolerance"
    )


def _fickle(shape: Shape, found: Assembly, tolerance: float, seed: int) -> str:
    """Of a sparse surface: what else it would be if some points were missing, or nothing if the group stays."""
    count = len(shape.points)
    if shape.faces is not None or is_few(shape) or count > SPARSE:
        return ""
    rng = np.random.default_rng(seed)
    names = {found.group.name}
    for _ in range(SUBSETS):
        some = np.sort(rng.choice(count, int(SUBSET * count), replace=False))
        names.add(_examine(part(shape, some), tolerance, seed, Clock())[2].group.name)
    if len(names) == 1:
        return ""
    return (
        f"{count} points are too few for this surface: without a fifth of them it could be {' or '.join(sorted(names))}"
        "; give more points"
    )


def _unclaimed(found: Assembly) -> Assembly:
    """The same findings as candidates only."""
    return Assembly(
        group=PointGroup(name="C1"),
        center=found.center,
        elements=(),
        rejected=found.elements + found.rejected,
        history=found.history,
    )


class Clock:
    """Wall-clock seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time one stage."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = time.perf_counter() - start


def _report(
    found: Assembly,
    evidence: Evidence,
    vectors: NTuples,
    doubt: str,
    stairs: tuple[Step, ...],
    timings: dict[str, float],
) -> Detection:
    origin, scale = evidence.moments.center, evidence.moments.scale
    # One figure for all elements of a group: they stand or fall together. The inversion needs them all and itself.
    inverted = inversion_of(evidence, found.group, found.center)
    sure = _confidence(evidence, [e.verdict for e in found.elements])
    all_sure = None if inverted is None else min(sure, _confidence(evidence, [inverted]))
    planes = [e for e in found.elements if e.kind == "plane"]
    axes = [e for e in found.elements if e.kind != "plane"]
    return Detection(
        point_group=found.group.name,
        group=found.group,
        center=origin + scale * found.center,
        planes=tuple(
            FoundPlane(
                plane=_plane(e, origin, scale),
                residual=e.verdict.deviation,
                confidence=sure,
                sigma_rad=(known := _uncertainty(found.history, e))[0],
                sigma=known[1] * scale,
            )
            for e in sorted(planes, key=lambda e: e.verdict.excess)
        ),
        axes=tuple(
            FoundAxis(
                axis=Axis(point=origin + scale * e.point, direction=e.direction),
                order=e.order,
                improper=e.kind == "improper",
                residual=e.verdict.deviation,
                confidence=sure,
                sigma_rad=(known := _uncertainty(found.history, e))[0],
                sigma=known[1] * scale,
            )
            for e in axes
        ),
        inversion=found.group.has_inversion,
        inversion_residual=None if inverted is None else inverted.deviation,
        inversion_confidence=all_sure,
        near_misses=tuple(
            NearMiss(
                kind=e.kind,
                direction=e.direction,
                point=origin + scale * e.point,
                order=e.order,
                residual=e.verdict.deviation,
                excess=e.verdict.excess,
            )
            for e in found.rejected[:8]
        ),
        iterations=found.before + max(0, len(found.history) - 1),
        tolerance=evidence.judge.tolerance,
        diagonal=evidence.judge.diagonal * scale,
        undetermined=doubt,
        staircase=stairs,
        tuples=evidence.tuples,
        vectors=vectors,
        history=found.history,
        points=evidence.judge.cloud.points,
        origin=origin,
        scale=scale,
        timings=timings,
    )


def _confidence(evidence: Evidence, verdicts: Sequence[Verdict]) -> float:
    """Confidence in the worst of verdicts; where it is in doubt, noise is asked how much of it is its own."""
    worst = max((v.excess for v in verdicts), default=0.0)
    if worst > DOUBT:
        worst = max(evidence.judge.beyond(v, evidence.halves()) for v in verdicts)
    return confidence(worst)


def _uncertainty(history: tuple[Iterate, ...], element: Element) -> tuple[float, float]:
    """Standard deviations of an element's direction (radians) and place (RMS radii), each where it is least certain.

    The covariance of the joint refinement is that of a small turn w and a shift of the common frame: a direction u
    moves by w x u, a plane along its normal, an axis across itself.
    """
    if len(history) < 2:
        return math.nan, math.nan
    frame, covariance = history[-1].state.frame, history[-1].covariance
    u = frame @ element.direction
    cross = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    along = np.outer(u, u)
    moves = along if element.kind == "plane" else np.eye(3) - along
    turned, shifted = cross @ covariance[:3, :3] @ cross.T, moves @ covariance[3:, 3:] @ moves
    largest = [max(float(np.linalg.eigvalsh(c)[-1]), 0.0) for c in (turned, shifted)]
    return math.sqrt(largest[0]), math.sqrt(largest[1])


def _plane(element: Element, origin: Array, scale: float) -> Plane:
    point = origin + scale * element.point
    return Plane(normal=element.direction, offset=float(element.direction @ point))
