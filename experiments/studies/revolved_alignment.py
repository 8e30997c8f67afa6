"""Alignment of parts of bodies of revolution: a bottle from one camera, cut, or both sides cut; and mugs that are none.

    python -m experiments.studies.revolved_alignment [--seeds N] [--first N] [--jobs N] [--objects NAME ...]

Right is a map that carries both ends of the axis to within 3 % of the diagonal, whatever the turn about it. A mug that
lost its handle in the target looks like a body of revolution there, while its model is none: how it is turned is not
known, and an answer that is relied upon has to be right in full.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.objects import damage
from experiments.objects.built_symmetry import Truth, specimen
from experiments.objects.shapes import sample
from experiments.studies.jobs import add_jobs, counted
from symrefine.align.alignment import Alignment
from symrefine.align.story import align
from symrefine.geometry import Array, Isometry, random_orthogonal, tight_diagonal, unit
from symrefine.shape import Shape

OBJECTS = {
    **dict.fromkeys(("bottle", "vase", "wine_glass", "bowl", "pawn", "candlestick", "top"), "household"),
    **dict.fromkeys(("goblet", "cone", "drum", "dumbbell", "spool"), "shape"),
}
MUG = "mug"
CONDITIONS = ("mesh onto a view", "whole onto 65 %", "70 % onto 70 %")
WITHOUT_HANDLE = "whole onto what has no handle"
POINTS, NOISE_REL, RIGHT_REL = 12_000, 0.002, 0.03
Rng = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A pair."""

    name: str
    condition: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was said of a pair, and by what fraction of the diagonal it is off."""

    case: Case
    status: str
    confidence: float
    error: float


def given(case: Case) -> tuple[Shape, Shape, Isometry, Truth]:
    """Source and target, the map from one to the other, and the symmetry of the source."""
    mesh, truth = specimen(OBJECTS.get(case.name, "household"), case.name)
    rng = np.random.default_rng([case.seed, *case.name.encode(), *case.condition.encode()])
    motion = Isometry(matrix=random_orthogonal(rng) * rng.choice([-1.0, 1.0]), shift=rng.uniform(-5.0, 5.0, 3))
    if case.condition == CONDITIONS[0]:
        seen = damage.views(mesh, 1.0, rng)
        eyes = motion.apply(np.asarray(seen.viewpoint))
        return mesh, Shape(points=motion.apply(seen.points), viewpoint=eyes), motion, truth
    source, target = (sample(mesh, POINTS, NOISE_REL, rng) for _ in range(2))
    if case.condition == WITHOUT_HANDLE:
        middle = np.median(target, axis=0)
        handle = unit(target[np.linalg.norm(target - middle, axis=1).argmax()] - middle)
        target = damage.cut_off(target, -handle, 0.4)
    else:
        share = 0.35 if case.condition == CONDITIONS[1] else 0.3
        target = damage.cut_off(target, unit(rng.normal(size=3)), share)
        source = source if case.condition == CONDITIONS[1] else damage.cut_off(source, unit(rng.normal(size=3)), share)
    return Shape(points=source), Shape(points=motion.apply(target)), motion, truth


def run(case: Case) -> Row:
    """Align a pair and compare."""
    source, target, motion, truth = given(case)
    found = align(source, target)
    error = off(found, motion, truth, source.points) / tight_diagonal(source.points)
    return Row(case=case, status=found.status, confidence=found.confidence, error=error)


def off(found: Alignment, motion: Isometry, truth: Truth, points: Array) -> float:
    """How far the ends of the axis of points [N, 3] come to lie from where they belong; of a mug any of the points."""
    group = truth.group
    if group.is_finite:
        every = [motion.apply((points - truth.center) @ g.T + truth.center) for g in group.operations()]
        return min(float(np.linalg.norm(found.apply(points) - there, axis=1).max()) for there in every)
    reach = np.abs((points - truth.center) @ group.frame[2]).max()
    ends = truth.center + np.array([[1.0], [-1.0]]) * reach * group.frame[2]
    goals = [ends] if group.is_polar else [ends, ends[::-1]]
    return min(float(np.linalg.norm(found.apply(ends) - motion.apply(g), axis=1).max()) for g in goals)


def report(rows: Sequence[Row]) -> Iterator[str]:
    """Each condition as a line, then what was sure and wrong."""
    heads = ("pairs", "right", "relied upon", "and wrong", ".95 sure", "and wrong")
    yield " ".join([" " * 30, *heads])
    for condition in (*CONDITIONS, WITHOUT_HANDLE):
        of = [r for r in rows if r.case.condition == condition]
        told, sure = [r for r in of if r.status == "ok"], [r for r in of if r.confidence >= 0.95]
        wrong = [sum(r.error > RIGHT_REL for r in some) for some in (told, sure)]
        right = sum(r.error <= RIGHT_REL for r in of)
        counts = len(of), right, len(told), wrong[0], len(sure), wrong[1]
        yield " ".join([f"{condition:30s}", *(f"{n:{len(head)}d}" for n, head in zip(counts, heads, strict=True))])
    for r in rows:
        if r.status == "ok" and r.error > RIGHT_REL:
            yield f"{r.case.name}, {r.case.condition}, seed {r.case.seed}: off by {r.error:.1%} at {r.confidence:.3f}"


def main(arguments: list[str] | None = None) -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.revolved_alignment",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seeds", type=int, default=2, metavar="N", help="pairs of each object (default: 2)")
    parser.add_argument("--first", type=int, default=1, metavar="N", help="seed of the first (default: 1)")
    parser.add_argument("--objects", nargs="+", choices=[*OBJECTS, MUG], default=[*OBJECTS, MUG], help="default: all")
    add_jobs(parser)
    options = parser.parse_args(arguments)
    seeds = range(options.first, options.first + options.seeds)
    cases = [
        Case(name=name, condition=condition, seed=seed)
        for name in options.objects
        for condition in ((WITHOUT_HANDLE,) if name == MUG else CONDITIONS)
        for seed in seeds
    ]
    print("\n".join(report(counted("pairs", run, cases, options.jobs))))


if __name__ == "__main__":
    main()
