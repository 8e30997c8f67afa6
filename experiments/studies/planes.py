"""Mirror planes of shapes with known symmetry, by several methods, all judged by the same code: `symrefine run`.

Random poses, units and scales; isotropic noise in fractions of the bounding-box diagonal. A plane counts as found
within 5 degrees and 2 % of the diagonal of a true one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from experiments.objects import shapes
from experiments.objects.poses import Pose, posed
from experiments.studies.measure import FOUND_DEG, FOUND_REL
from experiments.studies.methods import METHODS, Scan
from symrefine.errors import InputError
from symrefine.geometry import Array, Plane, line_angle_rad
from symrefine.shape import Shape

# From here on a plane counts as settled in the trace.
SETTLED_DEG = 0.5


def solid(sides: int, top: float) -> Shape:
    """A right prism over a regular polygon (`top` 1) or a pyramid (`top` 0), a mirror through x."""
    return shapes.join([shapes.revolve([(0, 0), (0.5, 0), (0.5 * top, 0.9), (0, 0.9)], sides)])


SHAPES: dict[str, tuple[Callable[[], Shape], str]] = {
    **shapes.SHAPES,
    **{f"pyramid{b}": (partial(solid, b, 0.0), f"C{b}v") for b in (5, 6, 8)},
    **{f"prism{b}": (partial(solid, b, 1.0), f"D{b}h") for b in (5, 6, 8)},
    "cuboid": (lambda: shapes.join([shapes.box((0, 0, 0), (1.0, 0.7, 0.4))]), "D2h"),
    "cube": (lambda: shapes.join([shapes.box((0, 0, 0), (1, 1, 1))]), "Oh"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object, one method."""

    shape: str
    method: str
    points: int
    noise_rel: float
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """What holds: the true planes, the group, and for a surface of revolution the direction of its axis."""

    planes: Sequence[Plane]
    group: str
    center: Array
    diagonal: float
    round_about: Array | None


def check(case: Case) -> None:
    """Refuse what cannot be run."""
    for name, value, known in (("shape", case.shape, SHAPES), ("method", case.method, METHODS)):
        if value not in known:
            raise InputError(f"{name}: value is {value!r}, expected one of {', '.join(known)}")
    if not 100 <= case.points <= 1_000_000:
        raise InputError(f"points: value is {case.points}, expected 100 to 1,000,000")
    if not 0.0 <= case.noise_rel <= 0.2:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected a fraction of the diagonal from 0 to 0.2")
    if case.seed < 0:
        raise InputError(f"seed: value is {case.seed}, expected an integer from 0")
    if case.method == "trimesh" and case.noise_rel > 0:
        raise InputError("noise_rel: trimesh takes meshes, not noisy points; expected 0")


def make(case: Case) -> tuple[Scan, Truth]:
    """The scan of a case and the truth about it; equal for every method."""
    build, group = SHAPES[case.shape]
    shape = build()
    rng = np.random.default_rng([case.seed, case.points, round(1e4 * case.noise_rel)])
    pose = Pose.random(rng)
    points, normals = shapes.oriented_sample(shape, case.points, case.noise_rel, rng)
    scan = Scan(points=pose.of(points), normals=normals @ pose.turn.T, mesh=posed(shape, pose))
    return scan, _truth(shape, group, pose)


def _truth(shape: Shape, group: str, pose: Pose) -> Truth:
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))
    # Every mirror holds the z axis or halves the height; the mug's handle shifts its box in x.
    middle = np.array([0.0, 0.0, middle[2]])
    center = pose.of(middle)
    placed = shapes.mirror_normals(group) @ pose.turn.T
    return Truth(
        planes=[Plane(normal=n, offset=float(n @ center)) for n in placed],
        group=group,
        center=center,
        diagonal=pose.scale * shape.diagonal,
        round_about=pose.turn[:, 2] if group == "Cinfv" else None,
    )


def run(case: Case) -> dict[str, Any]:
    """Run one method on one scan."""
    scan, truth = make(case)
    start = perf_counter()
    answer = METHODS[case.method](scan)
    total = perf_counter() - start
    return {
        **score(answer.planes, truth),
        "group": answer.group,
        "right": answer.group == truth.group,
        "starts": answer.starts,
        "iterations": answer.iterations,
        "iterations_all": answer.iterations_all,
        "passes": answer.passes,
        "evaluations": answer.evaluations,
        "time_s": total - answer.normals_s,
        "normals_s": answer.normals_s,
    }


def score(planes: Sequence[Plane], truth: Truth) -> dict[str, float | int | None]:
    """True planes found, false ones reported, and the largest errors in angle and offset over those that are right.

    Of a surface of revolution every plane through the axis is true, none in particular is to be found.
    """
    pairs = [_nearest(plane, truth) for plane in planes]
    right = [p for p in pairs if p is not None and p[1] < FOUND_DEG and p[2] < FOUND_REL]
    found = {index for index, _, _ in right}
    return {
        "true_planes": len(truth.planes),
        "found": len(found) if truth.round_about is None else 0,
        "false": len(planes) - (len(found) if truth.round_about is None else len(right)),
        "all_found": len(found) == len(truth.planes) and truth.round_about is None,
        "worst_deg": max((angle for _, angle, _ in right), default=None),
        "worst_offset_rel": max((offset for _, _, offset in right), default=None),
    }


def _nearest(plane: Plane, truth: Truth) -> tuple[int, float, float] | None:
    """Index, angle and offset error of the true plane nearest in angle."""
    if truth.round_about is not None:
        tilt = np.degrees(np.arcsin(min(1.0, abs(float(plane.normal @ truth.round_about)))))
        return 0, float(tilt), abs(float(plane.signed_distance(truth.center))) / truth.diagonal
    if not truth.planes:
        return None
    angles = [float(np.degrees(line_angle_rad(plane.normal, t.normal))) for t in truth.planes]
    nearest = int(np.argmin(angles))
    return nearest, angles[nearest], abs(float(plane.signed_distance(truth.center))) / truth.diagonal


def trace(case: Case) -> list[dict[str, Any]]:
    """Errors at the start and after each outer iteration, over the planes that are reported in the end."""
    scan, truth = make(case)
    answer = METHODS[case.method](scan)
    return [{"iteration": k, **_progress(normals, truth)} for k, normals in enumerate(answer.steps)]


def _progress(normals: Sequence[Array], truth: Truth) -> dict[str, float | int | None]:
    """True planes that an iterate has within half a degree, and the worst of those that it has within five."""
    angles = np.array([[np.degrees(line_angle_rad(n, t.normal)) for n in normals] for t in truth.planes])
    nearest = angles.min(axis=1) if angles.size else np.zeros(0)
    return {
        "settled_planes": int((nearest < SETTLED_DEG).sum()),
        "worst_deg": float(nearest.max()) if nearest.size else None,
        "mean_deg": float(nearest.mean()) if nearest.size else None,
    }


def record(case: Case, path: Path) -> None:
    """A rerun recording of our detection on this scan."""
    from symrefine.detection.story import detect
    from symrefine.viewer import record as record_detection

    scan, _ = make(case)
    shape = Shape(points=scan.points)
    record_detection(detect(shape), shape, path)
