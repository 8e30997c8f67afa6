"""Every point group, and shapes that miss one in a detail.

    python -m experiments.studies.groups [--quick] [--only SHAPE ...] [--seeds N] [--first N] [--jobs N]

The shapes of `group_shapes` in random poses, units and scales, without normals: as meshes, and as points with Gaussian
noise in fractions of the bounding-box diagonal. Right means that the point group is right and no plane is false. The
siblings, with one part 3 % of the diagonal out of place, are asked for at the default tolerance and at 1 %.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from time import perf_counter

import numpy as np

from experiments.objects import group_shapes, poses
from experiments.objects.parts import placed_group
from experiments.studies.jobs import add_jobs, in_order
from experiments.studies.measure import FOUND_DEG
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups import PointGroup
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

NOISES = (0.0, 0.005, 0.01)
STRICT = 0.01
QUICK = (
    "clutter flange_nut chair skew_box fan3 flat_bottle table crown_gear12 rotor4 swirl6 propeller5 brick bushed_nut "
    "gear12 crossed3 six_bars_askew methane volleyball twelve_bars cube spiked_ball bottle spool hollow_ball"
).split()


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One detection.

    Attributes:
        shape: its name in `group_shapes`.
        sibling: whether its detail is out of place.
        noise_rel: standard deviation of the noise, a fraction of the bounding-box diagonal.
        points: how many, for a sample.
        form: "mesh" or "sample".
        tolerance: as a fraction of the diagonal.
        seed: of pose, sample and noise.
    """

    shape: str
    sibling: bool = False
    noise_rel: float = 0.0
    points: int = 20000
    form: str = "sample"
    tolerance: float = TOLERANCE
    seed: int = 0


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:  InputError: it cannot.
    """
    if case.shape not in group_shapes.DESIGNS:
        raise InputError(f"shape: value is {case.shape!r}, expected one of {', '.join(group_shapes.DESIGNS)}")
    if case.form not in ("mesh", "sample"):
        raise InputError(f"form: value is {case.form!r}, expected 'mesh' or 'sample'")
    if case.form == "mesh" and case.noise_rel != 0:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected 0 for a mesh: noise belongs to samples")
    if not 0 <= case.noise_rel <= 0.1:
        raise InputError(f"noise_rel: value is {case.noise_rel}, expected a fraction of the diagonal in [0, 0.1]")
    if case.points < 10:
        raise InputError(f"points: value is {case.points}, expected at least 10")
    if not 0 < case.tolerance <= 0.2:
        raise InputError(f"tolerance: value is {case.tolerance}, expected a fraction of the diagonal in (0, 0.2]")


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """Detect one shape in a random pose and compare with the truth."""
    check(case)
    truth = true_group(case.shape, case.sibling)
    data, turn = posed(case)
    start = perf_counter()
    found = detect(data, tolerance=case.tolerance)
    seconds = perf_counter() - start
    false = sum(not is_mirror(truth, turn.T @ p.plane.normal) for p in found.planes)
    sure = [e.confidence for e in (*found.planes, *found.axes)]
    return {
        "truth": truth.name,
        "group": found.point_group,
        "right": found.point_group == truth.name and false == 0,
        "planes": len(found.planes),
        "planes_false": false,
        "confidence": min(sure, default=None),
        "nearest_miss": min((m.excess for m in found.near_misses), default=None),
        "undetermined": bool(found.undetermined),
        "detect_s": seconds,
    }


def posed(case: Case) -> tuple[Shape, Array]:
    """The object in a random pose and unit, and the rotation it was given."""
    name = list(group_shapes.DESIGNS).index(case.shape)
    rng = np.random.default_rng([case.seed, name, case.sibling, case.form == "mesh", round(1e5 * case.noise_rel)])
    pose = poses.Pose.random(rng)
    shape = group_shapes.shape(case.shape, case.sibling)
    return poses.posed(poses.observed(shape, case.form, case.points, case.noise_rel, rng), pose), pose.turn


@cache
def true_group(name: str, sibling: bool) -> PointGroup:
    """The group of a shape as it was built, in place."""
    return placed_group(group_shapes.DESIGNS[name].parts(sibling))[0]


def is_mirror(group: PointGroup, normal: Array) -> bool:
    """Whether a plane through the centre lies within 5 degrees of a mirror of the group."""
    if group.is_finite:
        return bool(len(group.mirrors()) and np.abs(group.mirrors() @ normal).max() > np.cos(np.radians(FOUND_DEG)))
    height = np.arcsin(min(1.0, abs(float(group.frame[2] @ normal))))
    along, across = height < np.radians(FOUND_DEG), height > np.pi / 2 - np.radians(FOUND_DEG)
    return group.name == "Kh" or along or (group.name == "Dinfh" and bool(across))


def cases(names: Sequence[str], seeds: Sequence[int]) -> list[Case]:
    """Shapes at every noise, then siblings at two tolerances."""
    plain = [Case(shape=name, seed=seed) for name in names for seed in seeds]
    noisy = [replace(c, noise_rel=noise) for c in plain for noise in NOISES]
    meshes = [replace(c, form="mesh") for c in plain]
    siblings = [replace(c, sibling=True, tolerance=t) for t in (TOLERANCE, STRICT) for c in noisy]
    return [*meshes, *noisy, *siblings]


def label(case: Case) -> str:
    """The line of the table a case belongs to."""
    kind = "siblings" if case.sibling else "shapes"
    form = "mesh" if case.form == "mesh" else f"{100 * case.noise_rel:g} % noise"
    return f"{kind:8s}  tolerance {100 * case.tolerance:g} %  {form}"


def main() -> None:
    """Run all cases; print what went wrong and the share that is right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a shape of each kind only")
    parser.add_argument("--seeds", type=int, default=1, help="random poses of each")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of these (default: %(default)s)")
    parser.add_argument("--only", nargs="*", default=[], help="names of shapes")
    add_jobs(parser)
    options = parser.parse_args()
    names = options.only or (QUICK if options.quick else list(group_shapes.DESIGNS))
    chosen = cases(names, range(options.first, options.first + options.seeds))
    rows = []
    for case, row in zip(chosen, in_order(run, chosen, options.jobs), strict=True):
        rows.append((label(case), row))
        if not row["right"]:
            print(f"wrong: {label(case):42s} {case.shape:18s} {describe(row)}", flush=True)
    print(f"\n{len(names)} shapes of {len({group_shapes.group(n) for n in names})} groups, {options.seeds} poses each")
    for line in sorted({line for line, _ in rows}):
        these = [row for other, row in rows if other == line]
        right, false = sum(bool(r["right"]) for r in these), sum(int(r["planes_false"] or 0) for r in these)
        lone = sum(int(r["planes_false"] or 0) for r in these if r["truth"] == "C1")
        print(
            f"{line:42s} right {right} of {len(these)} ({right / len(these):.1%}), false planes {false}, "
            f"on C1 {lone}; median {np.median([float(r['detect_s'] or 0) for r in these]):.2f} s"
        )


def describe(row: dict[str, int | float | str | bool | None]) -> str:
    """What came out instead."""
    miss = "" if row["nearest_miss"] is None else f", nearest miss {row['nearest_miss']:.2f}"
    sure = "" if row["confidence"] is None else f", least sure {row['confidence']:.2f}"
    doubt = ", undetermined" if row["undetermined"] else ""
    return f"{row['truth']} -> {row['group']}, false planes {row['planes_false']}{miss}{sure}{doubt}"


if __name__ == "__main__":
    main()
