"""What is answered at the boundary of what can be decided, and how sure.

    python -m experiments.studies.boundary [--families ...] [--half ...] [--every N | --quick] [--seed N] [--jobs N]

The objects of `experiments.objects.boundary` in random poses, units and scales, in the forms that fit each family. An
answer is right if its group is one that is accepted and all its elements are there; "at least" if it is a subgroup,
its elements are there and it is less than 90 % sure; sure and wrong if it is 95 % sure of anything else. Molecules are
asked at a ladder of tolerances, where what is found may only grow, holds what is exact and fits the atoms.

Half of the objects, those of `answers.fitted`, are for calibration, the other half for reporting.
"""

import argparse
import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from experiments.objects.boundary import FAMILIES, base, instance
from experiments.objects.instances import Instance
from experiments.objects.ladders import TOLERANCES
from experiments.objects.poses import Pose, observed, posed
from experiments.studies.answers import (
    OUTCOMES,
    SURE,
    answer_confidence,
    fitted,
    ladder_faults,
    ladder_outcome,
    outcome,
)
from experiments.studies.jobs import add_jobs, in_order
from symrefine.detection.story import detect
from symrefine.errors import InputError, SymrefineError
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

STRICT = 0.004
QUICK_EVERY = 23
# Rotors and gears up to this fold are shown with noise: half a tooth of more is not above it.
COARSE_FOLD = 24
HALVES = ("calibration", "reporting")


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How an object is shown: "mesh", "cloud" of so many points with noise in diagonals, or "given" as it is."""

    form: str
    points: int = 0
    noise_rel: float = 0.0
    tolerance: float = TOLERANCE

    def __str__(self) -> str:
        seen = self.form if self.form != "cloud" else f"{self.points} points, noise {100 * self.noise_rel:g} %"
        return seen if self.tolerance == TOLERANCE else f"{seen}, tolerance {100 * self.tolerance:g} %"


MESH, GIVEN = View(form="mesh"), View(form="given")
CLEAN, NOISY, NOISIER = (
    View(form="cloud", points=n, noise_rel=s) for n, s in ((20000, 0.0), (8000, 0.005), (8000, 0.01))
)
TURNING = (
    MESH,
    View(form="mesh", tolerance=STRICT),
    CLEAN,
    View(form="cloud", points=20000, tolerance=STRICT),
    NOISY,
)
THIN = (MESH, NOISY, *(View(form="cloud", points=20000, noise_rel=s) for s in (0.003, 0.005, 0.008)))
VIEWS: dict[str, tuple[View, ...]] = {
    "rotors": TURNING,
    "gears": TURNING,
    "round": (MESH, CLEAN, NOISY, NOISIER),
    "uneven": (MESH,),
    "scans": (MESH, CLEAN, NOISY, NOISIER),
    "sparse": tuple(View(form="cloud", points=n) for n in (600, 1000, 2000)),
    "blobs": (MESH, *(View(form="cloud", points=n) for n in (600, 2000, 20000)), NOISIER),
    "far": (GIVEN,),
    "tolerances": (GIVEN,),
    "vessels": (
        MESH,
        View(form="cloud", points=3000),
        View(form="cloud", points=3000, noise_rel=0.003),
        View(form="cloud", points=10000, noise_rel=0.003),
        View(form="cloud", points=20000, noise_rel=0.003),
        View(form="cloud", points=20000, noise_rel=0.01),
    ),
    "furniture": THIN,
    "vanes": (*THIN, CLEAN),
    "curves": (GIVEN,),
    "rods": (GIVEN,),
    "augers": (MESH, View(form="cloud", points=6000), View(form="cloud", points=10000), CLEAN, NOISY),
    "spread": (MESH, View(form="cloud", points=5000), CLEAN, NOISY),
    "finned": (MESH, View(form="cloud", points=5000), CLEAN, NOISY, View(form="cloud", points=20000, noise_rel=0.005)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object shown once.

    Attributes:
        family: one of `FAMILIES`.
        name: of the object there.
        view: index in the `VIEWS` of the family.
        seed: of dimensions, pose, sample and noise.
    """

    family: str
    name: str
    view: int = 0
    seed: int = 0

    @property
    def half(self) -> str:
        """What the object is for; the variants of an object stay together."""
        return HALVES[0] if fitted(base(self.name)) else HALVES[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came out of a case.

    Attributes:
        case: what was asked.
        truth: the group it was built with.
        group: the answer; of a ladder all different ones by rising tolerance; of an error its message.
        outcome: one of `OUTCOMES`.
        confidence: of the whole answer, of a ladder the largest in doubt; NaN where it has none.
        seconds: of detection.
        note: what else there is to say, or nothing.
    """

    case: Case
    truth: str
    group: str
    outcome: str
    confidence: float
    seconds: float
    note: str = ""


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:
        InputError: it cannot.
    """
    check_known(case, FAMILIES, VIEWS)


def check_known(case: Case, families: Mapping[str, Collection[str]], views: Mapping[str, Sequence[View]]) -> None:
    """Whether there is such an object, and such a view of it.

    Raises:
        InputError: there is not.
    """
    if case.family not in families:
        raise InputError(f"family: value is {case.family!r}, expected one of {', '.join(families)}")
    if case.name not in families[case.family]:
        known = ", ".join(families[case.family]) or "none: its meshes are not there"
        raise InputError(f"name: value is {case.name!r}, expected one of the family {case.family!r}: {known}")
    if not 0 <= case.view < len(views[case.family]):
        raise InputError(f"view: value is {case.view}, expected 0 to {len(views[case.family]) - 1}")
    if case.seed < 0:
        raise InputError(f"seed: value is {case.seed}, expected 0 or more")


def run(case: Case) -> Answer:
    """Ask once, or at all tolerances of the ladder, and compare with the truth."""
    check(case)
    made = instance(case.family, case.name, case.seed)
    shape, pose = look(case, made)
    start = perf_counter()
    try:
        tolerances = TOLERANCES if case.family == "tolerances" else (VIEWS[case.family][case.view].tolerance,)
        found = [detect(shape, tolerance=t) for t in tolerances]
    except (ArithmeticError, ValueError, IndexError, SymrefineError) as error:
        return _answer(case, made, f"{type(error).__name__}: {error}", "broke", math.nan, perf_counter() - start)
    seconds = perf_counter() - start
    if case.family == "tolerances":
        faults = ladder_faults(found, shape, made.truth.posed(pose))
        doubts = [sure for sure, _ in faults]
        groups = " ".join(dict.fromkeys("undetermined" if f.undetermined else f.point_group for f in found))
        note = "; ".join(fault for _, fault in faults)
        return _answer(case, made, groups, ladder_outcome(found, doubts), max(doubts, default=math.nan), seconds, note)
    only = found[0]
    note = f"{100 * made.differs:.2f} % of the surface differs" if made.differs else ""
    group = "undetermined" if only.undetermined else only.point_group
    return _answer(case, made, group, outcome(only, made, pose), answer_confidence(only), seconds, note)


def _answer(
    case: Case, made: Instance, group: str, verdict: str, confidence: float, seconds: float, note: str = ""
) -> Answer:
    return Answer(
        case=case,
        truth="nothing" if made.undecidable else made.truth.group.name,
        group=group,
        outcome=verdict,
        confidence=confidence,
        seconds=seconds,
        note=note,
    )


def look(case: Case, made: Instance) -> tuple[Shape, Pose]:
    """The object as it is shown, in a random pose and unit."""
    number = [list(FAMILIES).index(case.family), list(FAMILIES[case.family]).index(case.name), case.view]
    return shown(made.shape, VIEWS[case.family][case.view], np.random.default_rng([case.seed, *number]))


def shown(shape: Shape, view: View, rng: np.random.Generator) -> tuple[Shape, Pose]:
    """What a view shows of an object, in a random pose and unit."""
    pose = Pose.random(rng)
    seen = shape if view.form == "given" else observed(shape, view.form, view.points, view.noise_rel, rng)
    return posed(seen, pose), pose


def plan(families: Sequence[str], halves: Sequence[str], every: int, seed: int) -> Iterator[Case]:
    """Each `every`-th of the pairs of object and view of each family; a prime goes through all views."""
    for family in families:
        pairs = [
            Case(family=family, name=name, view=view, seed=seed)
            for name in FAMILIES[family]
            for view in range(len(VIEWS[family]))
            if sensible(family, name, VIEWS[family][view])
        ]
        yield from [case for case in pairs if case.half in halves][::every]


def sensible(family: str, name: str, view: View) -> bool:
    """Whether noise leaves what tells the fold of a rotor or gear."""
    fold = int("".join(c for c in name if c.isdigit()) or 0) if family in ("rotors", "gears") else 0
    return fold <= COARSE_FOLD or view.noise_rel == 0.0


def described(r: Answer) -> str:
    """One answer in a line."""
    view, note = VIEWS[r.case.family][r.case.view], f"; {r.note}" if r.note else ""
    asked = f"{r.case.family} {r.case.name} ({view})"
    return f"{r.outcome}: {asked}: {r.truth} -> {r.group}, confidence {r.confidence:.3f}{note}"


def report(rows: Sequence[Answer]) -> Iterator[str]:
    """What went wrong for sure, and the table, as lines."""
    yield from (described(r) for r in rows if r.outcome in ("sure and wrong", "broke"))
    yield ""
    yield f"{'family':22s} cases  " + "  ".join(OUTCOMES) + "  right %  of those 95 % sure %  median s"
    for family in dict.fromkeys(r.case.family for r in rows):
        for half in HALVES:
            yield from _line(f"{family} {half}", [r for r in rows if (r.case.family, r.case.half) == (family, half)])
    for half in HALVES:
        yield from _line(f"all {half}", [r for r in rows if r.case.half == half])


def _line(label: str, rows: Sequence[Answer]) -> Iterator[str]:
    if not rows:
        return
    counts = Counter(r.outcome for r in rows)
    right = [r for r in rows if r.outcome == "right"]
    sure = f"{100 * np.mean([r.confidence >= SURE for r in right]):.0f}" if right else "-"
    yield (
        f"{label:22s} {len(rows):5d}  "
        + "  ".join(f"{counts[o]:{len(o)}d}" for o in OUTCOMES)
        + f"  {100 * len(right) / len(rows):7.1f}  {sure:>20s}  {np.median([r.seconds for r in rows]):8.2f}"
    )


def main(arguments: list[str] | None = None) -> None:
    """Run the cases; print what is sure and wrong, and the shares by family and half."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.boundary",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES), metavar="FAMILY")
    parser.add_argument("--half", nargs="+", choices=HALVES, default=HALVES, help="of the objects (default: both)")
    parser.add_argument("--quick", action="store_true", help=f"each {QUICK_EVERY}th case of a family only")
    parser.add_argument("--every", type=int, default=1, help="each so many-th case of a family (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of dimensions, poses and samples (default: %(default)s)")
    parser.add_argument(
        "--verbose", action="store_true", help="at once a line for what is not right, nor sure and wrong"
    )
    add_jobs(parser)
    options = parser.parse_args(arguments)
    if options.every < 1:
        parser.error(f"--every is {options.every}; expected 1 or more")
    every = QUICK_EVERY if options.quick else options.every
    cases = list(plan(options.families, options.half, every, options.seed))
    rows = []
    for r in in_order(run, cases, options.jobs):
        rows.append(r)
        if options.verbose and r.outcome not in ("right", "sure and wrong", "broke"):
            print(described(r), flush=True)
    print("\n".join(report(rows)))


if __name__ == "__main__":
    main()
