"""Real meshes in random poses.

    python -m experiments.studies.catalogue [--groups all|first] [--seeds N] [--jobs N]

Every mesh of `../shared/objects` (52 files, not part of the product) as a mesh and as an 8,000-point sample without
normals, turned, moved and scaled at random. Right means that the point group is right and no plane is false.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.objects.catalogue import FOLDER, catalogue, catalogued, listed_normals
from experiments.objects.poses import Pose, posed
from experiments.studies.jobs import add_jobs, in_order
from experiments.studies.measure import score_planes
from symrefine.detection.story import detect
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape

SAMPLE = 8000


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object as a "mesh" or as a "sample", in one pose."""

    name: str
    form: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One object in one form and pose."""

    name: str
    form: str
    truth: str
    found: str
    planes: str
    false: int
    worst_deg: float
    iterations: int
    seconds: float
    nearest_miss: float

    @property
    def right(self) -> bool:
        """Group right and no false plane."""
        return self.truth == self.found and self.false == 0


def first_groups(group: str) -> bool:
    """Whether a group is C1, Cs, Cnv or Cinfv: those on which n-tuples do not all vanish."""
    return group in ("C1", "Cs") or (group.startswith("C") and group.endswith("v"))


def cases(seeds: int, every: bool) -> Iterator[Case]:
    """Every object, form and seed."""
    for name, entry in catalogue().items():
        if every or first_groups(entry["point_group"]):
            yield from (Case(name=name, form=form, seed=seed) for form in ("mesh", "sample") for seed in range(seeds))


def shown(case: Case) -> tuple[Shape, Pose]:
    """The object in a random pose, and that pose."""
    mesh, index = catalogued(case.name), list(catalogue()).index(case.name)
    rng = np.random.default_rng([case.seed, index, case.form == "mesh"])
    pose = Pose.random(rng)
    if case.form == "mesh":
        return posed(mesh, pose), pose
    dense, _, _ = sample_surface(mesh, 50 * SAMPLE, rng)
    points = dense[rng.choice(len(dense), SAMPLE, replace=False)]  # independent, not stratified: noisier moments
    return Shape(points=pose.of(points)), pose


def run(case: Case) -> Row:
    """What was found of one object, against the catalogue."""
    shape, pose = shown(case)
    found, entry = detect(shape), catalogue()[case.name]
    score = score_planes(found, [pose.turn @ n for n in listed_normals(entry)])
    return Row(
        name=case.name,
        form=case.form,
        truth=entry["point_group"],
        found=found.point_group,
        planes=f"{score.found}/{score.true}",
        false=0 if entry["point_group"] == "Dinfh" else score.false,
        worst_deg=score.worst_deg,
        iterations=found.iterations,
        seconds=sum(found.timings.values()),
        nearest_miss=min((m.excess for m in found.near_misses), default=float("nan")),
    )


def main() -> None:
    """Print the table of right and wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--groups", choices=("first", "all"), default="all")
    add_jobs(parser)
    options = parser.parse_args()
    if not catalogue():
        print(f"{FOLDER} is not there: nothing to measure")
        return
    print("object                  form    truth  found   planes  false  error deg  iterations  seconds  nearest miss")
    found = []
    for r in in_order(run, list(cases(options.seeds, options.groups == "all")), options.jobs):
        found.append(r)
        print(
            f"{r.name:23s} {r.form:7s} {r.truth:6s} {r.found:6s} {r.planes:>7s}  {r.false:5d}  {r.worst_deg:9.3f}"
            f"  {r.iterations:10d}  {r.seconds:7.2f}  {r.nearest_miss:12.2f}{'' if r.right else '   <- wrong'}",
            flush=True,
        )
    print()
    for label, chosen in (("C1, Cs, Cnv, Cinfv", first_groups), ("all groups", lambda _: True)):
        for form in ("mesh", "sample"):
            these = [r for r in found if r.form == form and chosen(r.truth)]
            false = sum(r.false for r in these)
            right = sum(r.right for r in these)
            print(
                f"{label:20s} {form:7s} right {right} of {len(these)} ({right / len(these):.1%}), false planes {false}"
            )


if __name__ == "__main__":
    main()
