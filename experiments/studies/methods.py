"""Methods that look for mirror planes, behind one answer: ours, the paper's, the baseline, trimesh.

Every method gets the same points. The baseline also gets what it needs, oriented normals: those of the surface that was
sampled ("true", which a scanner does not have) or estimated ones. trimesh gets the mesh, all that it takes.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from experiments.ecins import SHIPPED, TUNED, Settings, ecins, estimated_normals
from experiments.ecins.starts import grid_normals
from experiments.peers.trimesh_inertia import trimesh_symmetry
from symrefine.detection.masses import ORDER
from symrefine.detection.measure import PARTS, PLANES, gather, measure
from symrefine.detection.story import detect
from symrefine.errors import DegenerateShapeError
from symrefine.fit.matching import match, pair_equations
from symrefine.fit.refine import MAX_OUTER, SETTLED, Framed, closest_planes, refine
from symrefine.fit.residual import axis_gram, design_rows, gram
from symrefine.geometry import Array, Isometry, Plane, frame_with_z
from symrefine.groups import from_elements
from symrefine.moments.moments import shape_moments
from symrefine.ntuples.contract import ntuples
from symrefine.ntuples.rank import fixed_subspace
from symrefine.propose.folds import azimuthal_spectrum, folds_of
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE
from symrefine.surface.skin import LocalPlanes, local_planes

# A candidate of the grid may be this far off: half the way to the next one, and more.
GRID_ERROR_RAD = math.radians(18.0)
# The same for planes through the axis of the n-tuples.
START_ERROR_RAD = 0.05
# Planes whose normals are closer than this are one.
SAME_RAD = math.radians(2.0)
# Normals of planes that generate a group are known to this.
GROUP_RAD = math.radians(1.5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """An object as the methods get it: points [N, 3], true normals [N, 3], and the mesh it was sampled from."""

    points: Array
    normals: Array
    mesh: Shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What a method says.

    Attributes:
        planes: mirror planes, input units.
        group: Schoenflies symbol; for methods that know planes only, of the group that these generate.
        starts: planes (or bundles of planes) that were refined from.
        iterations: most outer iterations behind a plane that is reported.
        iterations_all: most outer iterations of any start.
        passes: over all pairs of points to set up an outer iteration, each plane of a bundle and each start counted.
        evaluations: of the residual of all pairs as the original counts them; ours needs one for each pass.
        steps: normals of the reported planes, start first, one list for each outer iteration.
        normals_s: seconds that estimating normals took, for methods that need them.
    """

    planes: Sequence[Plane]
    group: str
    starts: int | None = None
    iterations: int | None = None
    iterations_all: int | None = None
    passes: int | None = None
    evaluations: int | None = None
    steps: Sequence[Sequence[Array]] = ()
    normals_s: float = 0.0


def from_ntuples(scan: Scan) -> Answer:
    """`detect`: n-tuples or spectrum for the start, one joint refinement, the judge."""
    found = detect(scan.points)
    history = [[p.normal for p in iterate.state.planes] for iterate in found.history]
    bundle = len(history[-1]) if history else 0
    return Answer(
        planes=[p.plane for p in found.planes],
        group=found.point_group,
        starts=1 if history else 0,
        iterations=found.iterations,
        iterations_all=found.iterations,
        passes=bundle * found.iterations,
        evaluations=bundle * found.iterations,
        steps=history,
    )


def single_plane(plane: Plane) -> Framed:
    """One mirror, its normal on the frame's third axis."""
    return Framed(
        standard=np.diag([1.0, 1.0, -1.0])[None], frame=frame_with_z(plane.normal), center=plane.offset * plane.normal
    )


def from_grid(scan: Scan) -> Answer:
    """Our refinement and our judge, each plane for itself, from the 25 planes that the baseline starts from."""
    measured = measure(Shape(points=scan.points))
    _, surface = gather(measured, np.random.default_rng(0))
    origin, scale = measured.moments.center, measured.moments.scale
    basis = _principal_basis(scan.points)
    histories = [
        list(refine(surface.cloud, single_plane(Plane(normal=normal, offset=0.0)), start_error_rad=GRID_ERROR_RAD))
        for normal in grid_normals(SHIPPED.divisions, basis)
    ]
    planes = [history[-1].state.planes[0] for history in histories]
    excess = [surface.need([Isometry.reflection(plane)]) / TOLERANCE for plane in planes]
    kept: list[int] = []
    for i in np.argsort(excess, kind="stable").tolist():
        alone = all(abs(planes[i].normal @ planes[j].normal) < math.cos(SAME_RAD) for j in kept)
        if excess[i] <= 1.0 and alone:
            kept.append(i)
    placed = [_placed(planes[i], origin, scale) for i in kept]
    return Answer(
        planes=placed,
        group=generated(placed),
        starts=len(histories),
        iterations=max((len(histories[i]) - 1 for i in kept), default=None),
        iterations_all=max(len(history) - 1 for history in histories),
        passes=sum(len(history) - 1 for history in histories),
        evaluations=sum(len(history) - 1 for history in histories),
        steps=_steps([[it.state.planes[0].normal for it in histories[i]] for i in kept]),
    )


def from_axis(scan: Scan) -> Answer:
    """The paper's scheme as printed: the n-tuples' axis stays, each plane through it has one unknown, theta.

    The plane of an object with one mirror is that of the n-tuples, without refinement. The fold b, which the paper
    takes as known, comes from the azimuthal spectrum; correspondences and weights are ours.
    """
    moments = shape_moments(Shape(points=scan.points), ORDER, parts=PARTS)
    tuples = fixed_subspace(ntuples(moments))
    if tuples.kind == "plane":
        plane = Plane(normal=tuples.directions[2], offset=float(tuples.directions[2] @ moments.center))
        return Answer(planes=[plane], group="Cs", starts=1, iterations=0, iterations_all=0, passes=0, evaluations=0)
    local = (scan.points - moments.center) / moments.scale
    axis = tuples.directions[0]
    folds = folds_of(azimuthal_spectrum(local, np.full(len(local), 1.0 / len(local)), axis), axis)
    if tuples.kind != "axis" or not folds:
        return Answer(planes=[], group="Cinfv" if tuples.kind == "axis" else "C1", starts=0)
    fold, frame = folds[0].fold, folds[0].frame
    cloud = local_planes(local, PLANES, np.random.default_rng(0))
    steps = list(_thetas(cloud, frame, np.pi * np.arange(fold) / fold))
    normals = [[rotated @ frame for rotated in _about_third(theta)] for theta in steps]
    planes = [Plane(normal=n, offset=float(n @ moments.center)) for n in normals[-1]]
    return Answer(
        planes=planes,
        group=f"C{fold}v",
        starts=fold,
        iterations=len(steps) - 1,
        iterations_all=len(steps) - 1,
        passes=fold * (len(steps) - 1),
        evaluations=fold * (len(steps) - 1),
        steps=normals,
    )


def _about_third(theta: Array) -> Array:
    """Normals [b, 3], in the frame, of planes through its third axis at angles theta [b] from its first."""
    return np.stack([-np.sin(theta), np.cos(theta), np.zeros(len(theta))], axis=1)


def _thetas(cloud: LocalPlanes, frame: Array, theta: Array) -> Iterator[Array]:
    """Angles [b] of the planes through a fixed axis: the start, then after each outer iteration until they settle."""
    step = np.inf
    yield theta
    for _ in range(MAX_OUTER):
        mirrors = [Isometry.reflection(Plane(normal=n, offset=0.0)) for n in _about_third(theta) @ frame]
        grams = []
        for pairs in match(cloud, mirrors, min(START_ERROR_RAD, 4.0 * step)):
            sources, targets, directions, weights = pair_equations(cloud, pairs)
            grams.append(axis_gram(gram(design_rows(sources, targets, directions), weights), frame, np.zeros(3)))
        turned = closest_planes(np.stack(grams), theta)
        step, theta = float(np.abs(turned - theta).max()), turned
        yield theta
        if step < SETTLED:
            return


def _principal_basis(points: Array) -> Array:
    """Principal axes as rows, the longest first, right-handed."""
    basis = np.linalg.eigh(np.cov(points.T))[1].T[::-1].copy()
    basis[2] *= np.sign(np.linalg.det(basis))
    return basis


def _placed(plane: Plane, origin: Array, scale: float) -> Plane:
    return Plane(normal=plane.normal, offset=float(plane.normal @ origin) + scale * plane.offset)


def _steps(histories: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """Normals by outer iteration of planes that were refined apart; one that has come to rest stays."""
    last = max((len(history) for history in histories), default=0)
    return [[history[min(k, len(history) - 1)] for history in histories] for k in range(last)]


def baseline(settings: Settings, *, estimate: bool) -> Callable[[Scan], Answer]:
    """The method of Ecins et al. with these settings and true or estimated normals."""

    def method(scan: Scan) -> Answer:
        start = perf_counter()
        normals = estimated_normals(scan.points) if estimate else scan.normals
        normals_s = perf_counter() - start if estimate else 0.0
        found = ecins(scan.points, normals, settings=settings)
        planes = [Plane(normal=p.normal, offset=p.offset) for p in found.planes]
        return Answer(
            planes=planes,
            group=generated(planes),
            starts=found.candidates,
            iterations=max(found.iterations, default=None),
            iterations_all=found.max_iterations,
            passes=found.passes,
            evaluations=found.evaluations,
            steps=_steps([found.history[p.candidate].normals for p in found.planes]),
            normals_s=normals_s,
        )

    return method


def from_inertia(scan: Scan) -> Answer:
    """trimesh: equal moments of inertia mean "radial" or "spherical"; it knows no planes."""
    return Answer(planes=[], group={"none": "C1"}.get(kind := trimesh_symmetry(scan.mesh).kind, kind))


def generated(planes: Sequence[Plane]) -> str:
    """The group that the mirrors of some planes generate; "none" if they do not close to a finite one."""
    try:
        return from_elements(mirrors=[p.normal for p in planes], axes=[], tolerance_rad=GROUP_RAD).name
    except DegenerateShapeError:
        return "none"


METHODS: dict[str, Callable[[Scan], Answer]] = {
    "ntuples": from_ntuples,
    "ntuples_theta": from_axis,
    "baseline_start": from_grid,
    "ecins_shipped": baseline(SHIPPED, estimate=False),
    "ecins_shipped_est": baseline(SHIPPED, estimate=True),
    "ecins_tuned": baseline(TUNED, estimate=False),
    "ecins_tuned_est": baseline(TUNED, estimate=True),
    "trimesh": from_inertia,
}
