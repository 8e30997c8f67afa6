"""Real meshes in random poses.

    python -m experiments.studies.catalogue [--groups all|first] [--seeds N] [--jobs N]

Every mesh of `../shared/objects` (52 files, not part of the product) as a mesh and as an 8,000-point sample without
normals, turned, moved and scaled at random. Right means that the point group is right and no plane is false.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.objects.shapes import random_pose
from experiments.studies.measure import score_planes
from symrefine.detect import Detection, detect
from symrefine.geometry import unit
from symrefine.load import load
from symrefine.moments.quadrature import sample_surface
from symrefine.shape import Shape

OBJECTS = Path(__file__).parents[3] / "shared" / "objects"
SAMPLE = 8000


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


def posed(mesh: Shape, form: str, rng: np.random.Generator) -> tuple[Shape, np.ndarray]:
    """The object in a random pose as "mesh" or "sample", and the rotation it was given."""
    turn, shift, scale = random_pose(rng)
    if form == "mesh":
        return Shape(points=scale * mesh.points @ turn.T + shift, faces=mesh.faces, measure="surface"), turn
    dense, _, _ = sample_surface(mesh, 50 * SAMPLE, rng)
    points = dense[rng.choice(len(dense), SAMPLE, replace=False)]  # independent, not stratified: noisier moments
    return Shape(points=scale * points @ turn.T + shift), turn


def rows(seeds: int, every: bool) -> Iterator[Row]:
    """Detect every object, form and seed."""
    for index, entry in enumerate(json.loads((OBJECTS / "catalog.json").read_text())):
        if not (every or first_groups(entry["point_group"])):
            continue
        mesh = load(OBJECTS / entry["file"])
        for form in ("mesh", "sample"):
            for seed in range(seeds):
                shape, turn = posed(mesh, form, np.random.default_rng([seed, index, form == "mesh"]))
                yield _row(entry, form, detect(shape), turn)


def _row(entry: dict, form: str, found: Detection, turn: np.ndarray) -> Row:
    # A surface of revolution has planes everywhere about its axis; the catalogue lists four samples of them.
    listed = [] if entry["point_group"] in ("Cinfv", "Dinfh") else entry["planes"]
    score = score_planes(found, [turn @ unit(p["normal"]) for p in listed])
    return Row(
        name=entry["name"],
        form=form,
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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--groups", choices=("first", "all"), default="all")
    options = parser.parse_args()
    if not OBJECTS.is_dir():
        print(f"{OBJECTS} is not there: nothing to measure")
        return
    print("object                  form    truth  found   planes  false  error deg  iterations  seconds  nearest miss")
    found = []
    for r in rows(options.seeds, options.groups == "all"):
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
