"""One object in two poses, as in the paper's sections on the mug, the bottle and the camera.

From the object to its image under an orthogonal map: the symmetry of both, the singular values of the n-tuples, the map
recovered, and the refinement iteration by iteration (`trace`). The paper's own models (ShapeNet, McGill) are not
published with it: shapes of the project's own making and fetched models stand for them.
"""

import time
from dataclasses import dataclass

import numpy as np

from experiments.objects.exhibits import Exhibit, check_exhibit, exhibit
from experiments.objects.poses import FORMS, Pose, observed, posed
from experiments.studies.alignment import PRINTED, RANDOM
from experiments.studies.measure import judge
from symrefine.align.story import align
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.fit.refine import Iterate
from symrefine.geometry import Array, householder, line_angle_rad, random_orthogonal, rotation
from symrefine.groups.orthogonal import nearest_orthogonal
from symrefine.shape import Shape

Result = int | float | str | bool | None

PAIRS = ("same", "independent")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """An object, what is seen of it, and the map to its image.

    Attributes:
        name: of the object.
        form: "mesh", or "cloud" of `points` points with noise of `noise_rel` diagonals on both sides.
        pair: of clouds: the image has the "same" points, or "independent" ones.
        motion: "R", "F" or "R_F" of the paper, or a random "rotation" or "reflection" (determinant -1).
    """

    name: str
    form: str = "cloud"
    points: int = 20000
    noise_rel: float = 0.0
    pair: str = "same"
    motion: str = "R"
    seed: int = 0


def check(case: Case) -> None:
    """Refuse what cannot be run.

    Raises:
        InputError: field, value and what would be right.
    """
    check_exhibit(case.name)
    chosen = [("form", FORMS), ("pair", PAIRS), ("motion", (*PRINTED, *RANDOM))]
    for field, choices in chosen:
        if (value := getattr(case, field)) not in choices:
            raise InputError(f"{field}: value is {value!r}, expected one of {list(choices)}")
    if case.form == "mesh" and (case.noise_rel or case.pair != "same"):
        raise InputError("form: value is 'mesh', expected 'cloud' for noise_rel above 0 or pair 'independent'")
    if case.points < 1000:
        raise InputError(f"points: value is {case.points}, expected at least 1000")
    if not 0 <= case.noise_rel <= 0.1:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected 0 to 0.1")


def given(case: Case) -> tuple[Exhibit, Shape, Shape, Pose]:
    """The object, what is seen of it, what is seen of its image, and the map between them."""
    thing = exhibit(case.name)
    rng = np.random.default_rng([case.seed, *case.name.encode()])
    if case.motion in PRINTED:
        turn, shift = nearest_orthogonal(np.array([PRINTED[case.motion]]))[0], np.zeros(3)
    else:
        turn = random_orthogonal(rng, det=RANDOM[case.motion])
        shift = rng.uniform(-5, 5, 3) * thing.mesh.diagonal
    pose = Pose(turn=turn, shift=shift, scale=1.0)
    first = observed(thing.mesh, case.form, case.points, case.noise_rel, rng)
    again = observed(thing.mesh, case.form, case.points, case.noise_rel, rng) if case.pair == "independent" else first
    return thing, first, posed(again, pose), pose


def run(case: Case) -> dict[str, Result]:
    """A row: symmetry in both poses, singular values, and the map recovered."""
    thing, first, second, pose = given(case)
    start = time.perf_counter()
    found, image = detect(first, seed=case.seed), detect(second, seed=case.seed)
    halfway = time.perf_counter()
    aligned = align(first, second, seed=case.seed)
    stop = time.perf_counter()
    here = judge(found, thing, Pose(turn=np.eye(3), shift=np.zeros(3), scale=1.0))
    there = judge(image, thing, pose)
    sigma, sigma_image = found.tuples.singular_values, image.tuples.singular_values
    return {
        "group": thing.group,
        "answer": image.point_group,
        "right": here.right and there.right,
        "tuples": image.tuples.kind,
        "sigma1": float(sigma[0]),
        "sigma12": ratio(sigma, 0, 1),
        "sigma13": ratio(sigma, 0, 2),
        "sigma23": ratio(sigma, 1, 2),
        "sigma_change": float(np.abs(sigma - sigma_image).max() / sigma[0]),
        "worst_deg": there.worst_deg,
        "offset_rel": there.offset_rel,
        "carried_deg": carried_deg(found, image, pose.turn),
        "iterations": image.iterations,
        **map_errors(aligned.matrix, pose.turn, thing),
        "detect_s": (halfway - start) / 2,
        "align_s": stop - halfway,
    }


def ratio(sigma: Array, a: int, b: int) -> float:
    """One singular value over another, which counts as no less than the rounding of the largest."""
    return float(sigma[a] / max(sigma[b], np.finfo(float).eps * sigma[0]))


def carried_deg(found: Detection, image: Detection, turn: Array) -> float:
    """V_R = R V: how far the axis, or the lone mirror's normal, of the image is from that of the object, turned."""
    directions = [_main_direction(d) for d in (found, image)]
    if any(d is None for d in directions):
        return float("nan")
    return float(np.degrees(line_angle_rad(turn @ directions[0], directions[1])))


def _main_direction(found: Detection) -> Array | None:
    if found.axes:
        return found.axes[0].axis.direction
    return found.planes[0].plane.normal if len(found.planes) == 1 else None


def map_errors(found: Array, truth: Array, thing: Exhibit) -> dict[str, Result]:
    """Errors of a map, modulo the symmetry of the object: largest entry, mean square of the entries, angle.

    Of a surface of revolution only the axis can be recovered: `map_deg` is the angle it misses by.
    """
    right = bool(np.linalg.det(found) * np.linalg.det(truth) > 0) or thing.kind not in ("none", "rotation")
    if thing.group == "Cinfv":
        tilt = float(np.degrees(line_angle_rad(found @ thing.axis, truth @ thing.axis)))
        return {"det_right": right, "map_entry": float("nan"), "map_mse": float("nan"), "map_deg": tilt}
    misses = [found - truth @ g for g in operations(thing)]
    nearest = min(misses, key=lambda m: float(np.linalg.norm(m)))
    angle = 2.0 * np.degrees(np.arcsin(min(1.0, np.linalg.norm(nearest) / np.sqrt(8.0))))
    return {
        "det_right": right,
        "map_entry": float(np.abs(nearest).max()),
        "map_mse": float((nearest**2).mean()),
        "map_deg": float(angle),
    }


def operations(thing: Exhibit) -> list[Array]:
    """All orthogonal matrices of the stated group: mirrors and their products, or the turns about the axis."""
    if thing.kind == "rotation":
        fold = int(thing.group[1:])
        return [rotation(thing.axis, 2 * np.pi * k / fold) for k in range(fold)]
    mirrors = [householder(n) for n in thing.normals]
    return [np.eye(3), *mirrors, *(a @ b for a in mirrors for b in mirrors)]


def trace(case: Case) -> list[dict[str, Result]]:
    """The refinement of the image's planes or axis, a row for each outer iteration, the start first.

    `worst_deg` is the largest angle to the truth, `residual_rel` the RMS distance of the pairs in diagonals; both are
    NaN where they have no meaning. Empty where nothing was refined.
    """
    thing, _, second, pose = given(case)
    found = detect(second, seed=case.seed)
    unit = found.scale / found.diagonal
    return [
        {
            "iteration": i.index,
            "worst_deg": iterate_error_deg(i, thing, pose.turn),
            "residual_rel": unit * float(np.sqrt(max(i.cost, 0.0))) if i.index else float("nan"),
            "step": i.step if i.index else float("nan"),
            "pairs": i.inliers,
        }
        for i in found.history
    ]


def iterate_error_deg(iterate: Iterate, thing: Exhibit, turn: Array) -> float:
    """Largest angle between the planes of an iterate and the nearest true ones; for revolution that of the axis."""
    if thing.group == "Cinfv":
        return float(np.degrees(line_angle_rad(iterate.state.frame[2], turn @ thing.axis)))
    if not thing.normals:
        return float("nan")
    planes = iterate.state.planes
    return float(max(np.degrees(min(line_angle_rad(p.normal, turn @ n) for n in thing.normals)) for p in planes))
