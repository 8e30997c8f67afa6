"""Detection on one page: shape -> moments -> n-tuples and spectrum -> candidates -> refine -> judge -> group."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike

from symrefine.assemble import Assembly, assemble
from symrefine.axis import TupleClass, classify
from symrefine.elements import Element
from symrefine.errors import InputError
from symrefine.geometry import Array, Axis, Plane, read_only, tight_diagonal
from symrefine.groups import PointGroup
from symrefine.harmonics import harmonic_moments
from symrefine.matching import LocalPlanes, fills_volume, isolated_points, local_planes
from symrefine.moments import Moments, shape_moments
from symrefine.ntuples.contract import NTuples, ntuples
from symrefine.quadrature import mesh_nodes, sample_surface
from symrefine.refine import Iterate
from symrefine.search import Evidence
from symrefine.shape import Index, Shape
from symrefine.verify import TOLERANCE, Deviation, Judge, confidence, make_judge, split_floor

ORDER = 8
LARGEST_TOLERANCE = 0.2
# Tolerances of the staircase that the command line tells.
LADDER = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08)
PARTS = 16
SAMPLES = 20000
LOCAL_PLANES = 4000
CLOSER_PLANES = 12000
# Points of a cloud that fills a volume, at most.
VOLUME_POINTS = 20000
# Masses of atoms that differ by more than this fraction are masses of different kinds.
SAME_MASS = 0.01
# Up to so many points of a surface it is asked whether the answer hangs on a few: of so many parts of this size.
SPARSE = 1500
SUBSETS = 3
SUBSET = 0.8
# Up to so many distinct points stand for themselves (atoms); more are samples of a surface.
FEW = 250


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
        near_misses: candidates turned down, best first.
        iterations: outer iterations of the refinement of all planes together.
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
            surface must come within it, 99 % within 1.4 of it, and the mean within 0.28 (see `verify`).
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
    few = _is_few(shape)
    classes = _classes(shape, few)
    with clock("moments"):
        moments = _moments(shape, classes, parts=0 if few or shape.faces is not None else PARTS)
        vectors = ntuples(moments)
    with clock("local_planes"):
        gathered = few_points if few else gather
        evidence = gathered(shape, classes, moments, vectors, tolerance, np.random.default_rng(seed))
    with clock("search"):
        return vectors, evidence, assemble(evidence)


def _is_few(shape: Shape) -> bool:
    """Whether the points are few enough to stand for themselves."""
    return shape.faces is None and len(shape.points) <= FEW


def _with_mass(shape: Shape) -> Shape:
    """The shape without points of no mass, which are no part of the object."""
    if shape.weights is None or shape.faces is not None or shape.weights.all():
        return shape
    return _part(shape, np.flatnonzero(shape.weights > 0))


def _part(shape: Shape, some: Index) -> Shape:
    """Some of the points of a cloud."""
    return replace(
        shape,
        points=shape.points[some],
        weights=None if shape.weights is None else shape.weights[some],
        normals=None if shape.normals is None else shape.normals[some],
        labels=None if shape.labels is None else shape.labels[some],
    )


def _classes(shape: Shape, few: bool) -> Index | None:
    """Classes 0, 1, ... of the points (faces, for a mesh) that must match: labels, and masses where points are few."""
    kinds = [] if shape.labels is None else [shape.labels]
    if few and shape.weights is not None:
        ascending = np.argsort(shape.weights, kind="stable")
        steps = np.diff(shape.weights[ascending]) > SAME_MASS * shape.weights[ascending][1:]
        kinds.append(np.concatenate([[0], np.cumsum(steps)])[np.argsort(ascending, kind="stable")])
    if not kinds:
        return None
    classes = np.unique(np.stack(kinds), axis=1, return_inverse=True)[1].reshape(-1)
    return classes if classes.any() else None


def _moments(shape: Shape, classes: Index | None, parts: int) -> Moments:
    """Moments of the shape in which each class has a density of its own, so that they know one class from another."""
    if classes is None:
        return shape_moments(shape, ORDER, parts=parts)
    # Multiples of the golden ratio modulo 1 keep any number of classes apart.
    density = 0.5 + np.modf(0.6180339887498949 * (classes + 1))[0]
    if shape.faces is None:
        own = np.ones(len(shape.points)) if shape.weights is None else shape.weights
        return shape_moments(replace(shape, weights=own * density), ORDER, parts=parts)
    nodes, weights = mesh_nodes(replace(shape, measure="surface"), ORDER)
    heavier = weights * np.repeat(density, len(weights) // len(density))
    return shape_moments(Shape(points=shape.points[0] + nodes, weights=heavier), ORDER)


def _elsewhere(dim: int) -> str:
    """What is offered for points of another dimension."""
    if dim == 2:
        return "these points have 2 coordinates: use symrefine.planar.detect_planar"
    return (
        f"these points have {dim} coordinates: for 4 and more symrefine.subspace.detect_nd tells the rank of the "
        "n-tuples and the hyperplanes of symmetry, no turns and no groups"
    )


def _doubt(evidence: Evidence) -> str:
    """Why the cloud supports no decision at this tolerance, or nothing if it does."""
    floor, tolerance = evidence.judge.floor.p95, evidence.judge.tolerance
    if floor <= tolerance:
        return ""
    return (
        f"the cloud does not even agree with itself: 5 % of its surface misses the rest by {floor:.1%} of the diagonal "
        f"or more, against a tolerance of {tolerance:.1%}; give more points, less noise, or a larger tolerance"
    )


def _fickle(shape: Shape, found: Assembly, tolerance: float, seed: int) -> str:
    """Of a sparse surface: what else it would be if some points were missing, or nothing if the group stays."""
    count = len(shape.points)
    if shape.faces is not None or _is_few(shape) or count > SPARSE:
        return ""
    rng = np.random.default_rng(seed)
    names = {found.group.name}
    for _ in range(SUBSETS):
        some = np.sort(rng.choice(count, int(SUBSET * count), replace=False))
        names.add(_examine(_part(shape, some), tolerance, seed, Clock())[2].group.name)
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


def gather(
    shape: Shape,
    classes: Index | None,
    moments: Moments,
    vectors: NTuples,
    tolerance: float,
    rng: np.random.Generator,
) -> Evidence:
    """Moments, n-tuples and a judged cloud of local planes (points, where they fill a volume), in normalised units."""
    from scipy.spatial import cKDTree

    points, normals, weights, labels = _cloud(shape, classes, rng)
    local = (points - moments.center) / moments.scale
    exact = shape.faces is not None
    tree = None if exact else cKDTree(local, balanced_tree=False, compact_nodes=False)
    chance = None if exact or np.ptp(weights) == 0.0 else weights
    planes = partial(
        local_planes, local, rng=rng, normals=normals, labels=labels, weights=chance, exact=exact, tree=tree
    )
    filled = tree is not None and normals is None and fills_volume(local, tree, np.random.default_rng(0))
    cloud = _volume(local, labels, rng) if filled else planes(LOCAL_PLANES)
    diagonal = tight_diagonal(cloud.points)
    floor = None if exact or filled or len(local) > LOCAL_PLANES else _sparse_floor(local, labels, diagonal, rng)

    @cache
    def closer() -> Judge:
        return make_judge(cloud if filled else planes(CLOSER_PLANES), diagonal, tolerance, floor)

    return Evidence(
        moments=moments,
        harmonics=harmonic_moments(moments),
        tuples=classify(vectors),
        points=local,
        weights=weights / weights.sum(),
        judge=make_judge(cloud, diagonal, tolerance, floor),
        closer=closer,
    )


def _sparse_floor(points: Array, labels: Index | None, diagonal: float, rng: np.random.Generator) -> Deviation:
    """What two halves of a sparse cloud show against one another."""
    order = rng.permutation(len(points))
    halves = [
        local_planes(points[half], len(half), rng, labels=None if labels is None else labels[half])
        for half in (np.sort(order[::2]), np.sort(order[1::2]))
    ]
    return split_floor(halves[0], halves[1], diagonal)


def _volume(points: Array, labels: Index | None, rng: np.random.Generator) -> LocalPlanes:
    pick = np.sort(rng.choice(len(points), min(VOLUME_POINTS, len(points)), replace=False))
    return isolated_points(points[pick], None if labels is None else labels[pick], body="volume")


def few_points(
    shape: Shape, classes: Index | None, moments: Moments, vectors: NTuples, tolerance: float, _: np.random.Generator
) -> Evidence:
    """Evidence from points that stand for themselves: every direction is searched, whatever the n-tuples say."""
    local = (shape.points - moments.center) / moments.scale
    judge = make_judge(isolated_points(local, classes), tight_diagonal(local), tolerance)
    weights = np.ones(len(local)) if shape.weights is None else shape.weights
    return Evidence(
        moments=moments,
        harmonics=harmonic_moments(moments),
        tuples=replace(classify(vectors), kind="vanish"),
        points=local,
        weights=weights / weights.sum(),
        judge=judge,
        closer=lambda: judge,
    )


def _cloud(
    shape: Shape, classes: Index | None, rng: np.random.Generator
) -> tuple[Array, Array | None, Array, Index | None]:
    """Points, normals, weights and classes: samples with exact normals for a mesh, else the points themselves."""
    if shape.faces is not None:
        points, normals, face = sample_surface(shape, SAMPLES, rng)
        return points, normals, np.ones(len(points)), None if classes is None else classes[face]
    weights = np.ones(len(shape.points)) if shape.weights is None else shape.weights
    return shape.points, shape.normals, weights, classes


def _report(
    found: Assembly,
    evidence: Evidence,
    vectors: NTuples,
    doubt: str,
    stairs: tuple[Step, ...],
    timings: dict[str, float],
) -> Detection:
    origin, scale = evidence.moments.center, evidence.moments.scale
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
                confidence=confidence(e.verdict.excess),
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
                confidence=confidence(e.verdict.excess),
                sigma_rad=(known := _uncertainty(found.history, e))[0],
                sigma=known[1] * scale,
            )
            for e in axes
        ),
        inversion=found.group.has_inversion,
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
        iterations=max(0, len(found.history) - 1),
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
