"""Our baseline beside the C++ program it follows.

    python -m experiments.studies.baseline_check [--part NAME ...] [--seeds N]

`REFERENCE` holds what the public code of Ecins, Fermuller and Aloimonos (2017) gave, five random poses each, as
shared/baseline.md records it. The shapes there are not published; ours have the same symmetry, not the same
proportions. A plane counts as found within 5 degrees and 2 % of the diagonal.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter, process_time

import numpy as np

from experiments.ecins import SHIPPED, TUNED, EcinsResult, Settings, ecins, estimated_normals
from experiments.objects.poses import Pose
from experiments.objects.shapes import SHAPES, box, join, mirror_normals, oriented_sample, revolve
from experiments.studies.measure import FOUND_DEG, FOUND_REL
from symrefine.errors import InputError
from symrefine.geometry import Array, line_angle_rad
from symrefine.moments.quadrature import triangle_areas_and_normals
from symrefine.shape import Shape

METHODS: dict[str, Settings] = {"ecins_shipped": SHIPPED, "ecins_tuned": TUNED}
NORMALS = ("true", "estimated", "sided")
ROUND = "Cinfv"


def pyramid(sides: int) -> Shape:
    """Pyramid on a regular polygon: C_sides v."""
    return join([revolve([(0, 0), (0.5, 0), (0, 0.6)], sides)])


def prism(sides: int) -> Shape:
    """Upright prism on a regular polygon: D_sides h."""
    return join([revolve([(0, 0), (0.5, 0), (0.5, 0.4), (0, 0.4)], sides)])


ALL_SHAPES: dict[str, tuple[Callable[[], Shape], str]] = {
    **SHAPES,
    **{f"pyramid{n}": (lambda n=n: pyramid(n), f"C{n}v") for n in (5, 6, 8)},
    **{f"prism{n}": (lambda n=n: prism(n), f"D{n}h") for n in (5, 6, 8)},
    "cuboid": (lambda: join([box((0, 0, 0), (1.0, 0.7, 0.4))]), "D2h"),
    "cube": (lambda: join([box((0, 0, 0), (1.0, 1.0, 1.0))]), "Oh"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One run of the baseline.

    `normals` are "true", "estimated" from that many `neighbours`, or "sided": estimated, with the true signs, so that
    no fault of the orientation is laid at the baseline's door.
    """

    shape: str = "table"
    method: str = "ecins_shipped"
    normals: str = "true"
    neighbours: int = 30
    noise_rel: float = 0.0
    points: int = 20000
    max_outer: int = SHIPPED.max_outer
    seed: int = 0


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:  InputError: it cannot.
    """
    for name, known in (("shape", list(ALL_SHAPES)), ("method", list(METHODS)), ("normals", list(NORMALS))):
        if getattr(case, name) not in known:
            raise InputError(f"{name}: value is {getattr(case, name)!r}, expected one of {', '.join(known)}")
    if not 0 <= case.noise_rel <= 0.1:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected 0 to 0.1 of the diagonal")
    if case.points < 100:
        raise InputError(f"points: value is {case.points}, expected at least 100")
    if not 3 <= case.neighbours <= case.points:
        raise InputError(f"neighbours: value is {case.neighbours}, expected 3 to the number of points")
    if case.max_outer < 1:
        raise InputError(f"max_outer: value is {case.max_outer}, expected at least 1")
    if case.seed < 0:
        raise InputError(f"seed: value is {case.seed}, expected 0 or more")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posed:
    """Samples of a shape in a random pose, with the true planes: normals [m, 3], all through one point.

    Where all planes through an axis are true, `axis` is its direction and there are no normals.
    """

    points: Array
    normals: Array
    true_normals: Array
    axis: Array | None
    center: Array
    diagonal: float

    def error_deg(self, normal: Array, offset: float) -> Array:
        """Angles [m] to the true planes, infinite if out of place; for a round shape one angle, to the nearest."""
        if abs(float(normal @ self.center) - offset) > FOUND_REL * self.diagonal:
            return np.full(self.columns, np.inf)
        if self.axis is not None:
            return np.array([90.0 - np.degrees(line_angle_rad(normal, self.axis))])
        return self.angles_deg(normal) if len(self.true_normals) else np.full(1, np.inf)

    @property
    def columns(self) -> int:
        """Length of `error_deg`; one where there is no true plane."""
        return max(len(self.true_normals), 1)

    def angles_deg(self, normal: Array) -> Array:
        """Angles [m] to the true normals."""
        return np.array([np.degrees(line_angle_rad(normal, n)) for n in self.true_normals])


def posed(case: Case) -> Posed:
    """The samples of a case: the points are those of `shapes.sample` for the same generator."""
    build, group = ALL_SHAPES[case.shape]
    shape = build()
    rng = np.random.default_rng([case.seed, case.points, round(1e4 * case.noise_rel)])
    pose = Pose.random(rng)
    points, normals = oriented_sample(shape, case.points, case.noise_rel, rng)
    return Posed(
        points=pose.of(points),
        normals=normals @ pose.turn.T,
        true_normals=mirror_normals(group) @ pose.turn.T,
        axis=pose.turn[:, 2] if group == ROUND else None,
        center=pose.of(_surface_centroid(shape)),
        diagonal=pose.scale * shape.diagonal,
    )


def _surface_centroid(shape: Shape) -> Array:
    assert shape.faces is not None
    areas, _ = triangle_areas_and_normals(shape.points, shape.faces)
    return areas @ shape.points[shape.faces].mean(axis=1) / areas.sum()


def solve(case: Case) -> tuple[Posed, EcinsResult, dict[str, float]]:
    """The samples, what the baseline says of them, and seconds: of the normals, of the method, of its one thread."""
    data = posed(case)
    start = perf_counter()
    normals = _given_normals(case, data)
    middle, busy = perf_counter(), process_time()
    result = ecins(data.points, normals, settings=replace(METHODS[case.method], max_outer=case.max_outer))
    seconds = {"normals_s": middle - start, "total_s": perf_counter() - middle, "cpu_s": process_time() - busy}
    return data, result, seconds


def _given_normals(case: Case, data: Posed) -> Array:
    if case.normals == "true":
        return data.normals
    found = estimated_normals(data.points, case.neighbours)
    if case.normals == "estimated":
        return found
    wrong = np.einsum("ij,ij->i", found, data.normals) < 0
    return np.where(wrong[:, None], -found, found)


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """Planes found and missed, errors, effort, and how far from the true planes the starts stood.

    `found_start_deg` and `missed_start_deg`: the largest angle from a true plane that was found to the nearest start,
    and the smallest from one that was missed. For a round shape `found` counts the planes through the axis.
    """
    data, result, seconds = solve(case)
    errors = np.array([data.error_deg(p.normal, p.offset) for p in result.planes]).reshape(-1, data.columns)
    right = errors.min(axis=1, initial=np.inf) < FOUND_DEG
    nearest = errors.min(axis=1, initial=np.inf)[right]
    hit = set(errors[right].argmin(axis=1).tolist()) if right.any() else set()
    starts = np.array([data.angles_deg(c.normals[0]) for c in result.history]).min(axis=0, initial=np.inf)
    found = [a for i, a in enumerate(starts.tolist()) if i in hit]
    missed = [a for i, a in enumerate(starts.tolist()) if i not in hit]
    score = [p.cloud_score for p in result.planes]
    return {
        "found": int(right.sum()) if data.axis is not None else len(hit),
        "true": None if data.axis is not None else len(data.true_normals),
        "false": int((~right).sum()) if data.axis is not None else len(result.planes) - len(hit),
        "mean_deg": float(nearest.mean()) if right.any() else None,
        "worst_deg": float(nearest.max()) if right.any() else None,
        "found_start_deg": max(found, default=None),
        "missed_start_deg": min(missed, default=None),
        "true_score": float(np.median(np.array(score)[right])) if right.any() else None,
        "false_score": float(np.median(np.array(score)[~right])) if not right.all() else None,
        "iterations": max(result.iterations, default=None),
        "max_iterations": result.max_iterations,
        "evaluations": result.evaluations,
        "passes": result.passes,
        "candidates": result.candidates,
        **seconds,
    }


def trace(case: Case) -> list[dict[str, int | float]]:
    """After each outer iteration: true planes that some start is within 5 degrees and 2 % of, and the errors then."""
    data, result, _ = solve(case)
    rows: list[dict[str, int | float]] = []
    for iteration in range(result.max_iterations + 1):
        last = [min(iteration, c.iterations) for c in result.history]
        errors = [data.error_deg(c.normals[i], c.offsets[i]) for c, i in zip(result.history, last, strict=True)]
        best = np.min(errors, axis=0)
        near = best[best < FOUND_DEG]
        rows.append(
            {
                "iteration": iteration,
                "planes": len(near),
                "mean_deg": float(near.mean()) if near.size else float("nan"),
                "worst_deg": float(near.max()) if near.size else float("nan"),
            }
        )
    return rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """What the C++ program gave for some cases, as text: "-" where baseline.md says nothing."""

    part: str
    case: Case
    found: str
    false: str
    error_deg: str = "-"
    cpu_s: str = "-"


def _table(normals: str, noise_rel: float, found: str, false: str, error_deg: str, cpu_s: str) -> Reference:
    case = Case(normals=normals, noise_rel=noise_rel)
    return Reference(part="table", case=case, found=found, false=false, error_deg=error_deg, cpu_s=cpu_s)


def _sparse(normals: str, noise_rel: float, found: str) -> Reference:
    case = Case(normals=normals, noise_rel=noise_rel, points=5000)
    return Reference(part="sparse", case=case, found=found, false="-")


def _other(shape: str, found: str, false: str) -> Reference:
    return Reference(part="shapes", case=Case(shape=shape, normals="estimated"), found=found, false=false)


def _tuned(noise_rel: float, error_deg: str, cpu_s: str) -> Reference:
    case = Case(method="ecins_tuned", noise_rel=noise_rel)
    return Reference(part="tuned", case=case, found="4", false="0", error_deg=error_deg, cpu_s=cpu_s)


_CLEAN = (
    _other("pyramid5", "5 of 5", "0"),
    _other("pyramid6", "4.8 of 6", "-"),
    _other("pyramid8", "5 of 8", "-"),
    _other("prism5", "6 of 6", "-"),
    _other("prism6", "6 of 7", "-"),
    _other("prism8", "8.5 of 9", "-"),
    _other("stool3", "1 of 3", "4.0"),
    _other("stool5", "1 of 5", "4.0"),
    _other("stool6", "2.7 of 6", "2.3"),
    _other("stool8", "3 of 8", "-"),
    _other("mug", "0 of 1", "-"),
    _other("bottle", "6 to 7", "-"),
    _other("cuboid", "3 of 3", "-"),
    _other("cube", "9 of 9", "-"),
    _other("asymmetric", "0", "2.0"),
)
REFERENCE = (
    _table("true", 0.0, "2.8", "1.8", "0.01/0.03", "2.5"),
    _table("true", 0.005, "2.6", "0", "0.08/0.13", "3.9"),
    _table("true", 0.01, "2.8", "0", "0.34/1.68", "5.3"),
    _table("true", 0.02, "0", "0", "-", "5.7"),
    _table("estimated", 0.0, "3.2", "1.0", "0.31/4.78", "2.5"),
    _table("estimated", 0.005, "2.0", "0", "0.07/0.12", "4.3"),
    _table("estimated", 0.01, "0", "0", "-", "5"),
    _table("estimated", 0.02, "0", "0", "-", "5"),
    *(_sparse("true", noise, found) for noise, found in ((0.0, "2.6"), (0.005, "2.0"), (0.01, "0"), (0.02, "0"))),
    *(_sparse("estimated", noise, "0") for noise in (0.0, 0.005, 0.01, 0.02)),
    *(_table("sided", noise, "-", "-", "-", "-") for noise in (0.0, 0.005, 0.01)),
    _tuned(0.0, "0.05/0.10", "1.35"),
    _tuned(0.01, "0.20/0.39", "2.8"),
    *_CLEAN,
    *(
        replace(r, part="noisy", case=replace(r.case, noise_rel=0.01), found="> 0" if r.case.shape == "cube" else "0")
        for r in _CLEAN
    ),
)
PARTS = tuple(dict.fromkeys(r.part for r in REFERENCE))


def _mean(rows: list[dict], key: str) -> float:
    values = [row[key] for row in rows if row[key] is not None]
    return float(np.mean(values)) if values else float("nan")


def _line(reference: Reference, seeds: int) -> str:
    case = reference.case
    rows = [run(replace(case, seed=seed)) for seed in range(seeds)]
    worst = max((row["worst_deg"] for row in rows if row["worst_deg"] is not None), default=float("nan"))
    false = "-" if reference.part == "noisy" else reference.false
    return (
        f"{case.shape:10s} {case.method[6:]:7s} {case.normals:9s} {case.points:6d} {100 * case.noise_rel:5.1f}"
        f"  {_mean(rows, 'found'):5.1f} {reference.found:>8s}  {_mean(rows, 'false'):5.1f} {false:>4s}"
        f"  {_mean(rows, 'mean_deg'):5.2f}/{worst:4.2f} {reference.error_deg:>9s}"
        f"  {_mean(rows, 'missed_start_deg'):6.1f} {_mean(rows, 'iterations'):5.1f}"
        f"  {_mean(rows, 'evaluations'):7.0f} {_mean(rows, 'passes'):6.0f}"
        f"  {_mean(rows, 'cpu_s'):5.2f} {reference.cpu_s:>5s}"
    )


def main() -> None:
    """Print our figures beside those of the C++ program."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=PARTS, nargs="+", default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=5, help="random poses for each line")
    options = parser.parse_args()
    print("                                         found            false        error deg mean/max     nearest start")
    print(
        "shape      setting normals   points noise    ours      C++   ours  C++       ours       C++"
        "  missed iter.  evaluat. passes  CPU s   C++"
    )
    for reference in REFERENCE:
        if reference.part in options.part:
            print(_line(reference, options.seeds), flush=True)


if __name__ == "__main__":
    main()
