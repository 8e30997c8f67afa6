"""Whether 95 % sure means 95 % right.

    python -m experiments.studies.reliability [--quick | --every N] [--figure PATH] [--fit] [--chains FILE] [--jobs N]

One answer for each look at every object there is: the shapes of all point groups and their siblings with one detail out
of place, the household objects, the catalogued meshes where they are, as meshes and as points with noise; prisms and
bodies without symmetry as few points; all in random poses and units. An answer is right if its group has the name of
the truth as built, or one that is accepted for it, and all its elements are there within 3 degrees and 2 % of the
diagonal.

`--fit` prints the constants of `decide.posterior` that suit the chains of groups best, in each half of the objects, and
what those that are shipped score there.
"""

import argparse
import math
import pickle
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.objects import boundary, built_symmetry
from experiments.objects.built_symmetry import holds, specimen
from experiments.objects.catalogue import FOLDER, catalogue
from experiments.objects.instances import Instance
from experiments.objects.poses import Pose
from experiments.studies.answers import SURE, answer_confidence, claims, outcome, within
from experiments.studies.boundary import HALVES, Case, View, check_known, shown
from experiments.studies.boundary import VIEWS as BOUNDARY_VIEWS
from experiments.studies.calibration import Judged, bins, plausible, plot, summary
from experiments.studies.jobs import add_jobs, counted
from symrefine.clock import Clock
from symrefine.decide.posterior import BLURRED, EVEN, EVEN_MIRROR, STEEPNESS, UNKNOWN, sharpness, strain
from symrefine.detection.examination import examined
from symrefine.detection.story import told
from symrefine.errors import InputError
from symrefine.files import check_target, whole
from symrefine.shape import Shape
from symrefine.surface.misses import TOLERANCE

FEW = ("sparse", "blobs")
SEEN = ((8000, 0.0), (20000, 0.005), (8000, 0.01))
VIEWS = {
    **dict.fromkeys(
        built_symmetry.FAMILIES,
        (View(form="mesh"), *(View(form="cloud", points=n, noise_rel=s) for n, s in SEEN)),
    ),
    **dict.fromkeys(FEW, BOUNDARY_VIEWS["sparse"]),
}
# A group of a chain is true if its operations are those of the truth up to so much.
NEAR_RAD = math.radians(5.0)
SHIPPED = (EVEN, EVEN_MIRROR, STEEPNESS, UNKNOWN, BLURRED)
QUICK_EVERY = 21
FIGURE = Path(__file__).parents[2] / "docs" / "reliability.png"


class Known(NamedTuple):
    """A group of a chain, with what the posterior sees of it, and whether the object has it."""

    half: str
    family: str
    name: str
    view: int
    group: str
    need: float
    noise: float
    lone: bool
    true: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came out of a look.

    Attributes:
        case: what was looked at.
        truth: the group it was built with.
        group: the answer.
        confidence: NaN where nothing is decided.
        right: whether group and elements are those of the object.
        elements: each that is claimed, by itself.
        chain: the groups that were decided between, up to the first that the object has not.
    """

    case: Case
    truth: str
    group: str
    confidence: float
    right: bool
    elements: tuple[Judged, ...]
    chain: tuple[Known, ...]

    @property
    def decided(self) -> bool:
        """Whether it is an answer at all."""
        return not math.isnan(self.confidence)

    @property
    def view(self) -> str:
        """How the object was shown."""
        return str(VIEWS[self.case.family][self.case.view])

    def judged(self) -> Judged:
        """The whole answer as one statement."""
        return Judged(look=self.case, confidence=self.confidence, right=self.right)


# --- looks ------------------------------------------------------------------------------------------------------------


@cache
def objects() -> dict[str, list[str]]:
    """The names of each family."""
    built = {family: built_symmetry.names(family) for family in built_symmetry.FAMILIES}
    return {**built, **{family: list(boundary.FAMILIES[family]) for family in FEW}}


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:
        InputError: it cannot.
    """
    check_known(case, objects(), VIEWS)


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """The answer of one detection, how sure it is, and whether it is right."""
    check(case)
    found = answered(case)
    sure = found.confidence >= SURE
    return {
        "truth": found.truth,
        "answer": found.group,
        "confidence": found.confidence if found.decided else None,
        "undetermined": not found.decided,
        "right": found.right if found.decided else None,
        "sure": sure,
        "sure_right": found.right if sure else None,
    }


def look(case: Case) -> tuple[Shape, Pose, Instance]:
    """An object as one of the views shows it, its pose there, and all that is known of it."""
    number = [list(objects()).index(case.family), objects()[case.family].index(case.name), case.view]
    made = _made(case)
    view = VIEWS[case.family][case.view]
    return (*shown(made.shape, view, np.random.default_rng([case.seed, *number])), made)


def _made(case: Case) -> Instance:
    if case.family in FEW:
        return boundary.instance(case.family, case.name, case.seed)
    mesh, truth = specimen(case.family, case.name)
    return Instance(shape=mesh, truth=truth, diagonal=mesh.diagonal)


def answered(case: Case) -> Answer:
    """Detect an object once and compare with the truth."""
    shape, pose, made = look(case)
    evidence = examined(shape, clock=Clock())
    found = told(evidence, clock=Clock())
    truths = [t.posed(pose) for t in made.accepted(TOLERANCE)]
    chain = []
    for link, seen in zip(evidence.links[1:], evidence.known(evidence.surface.tolerance), strict=True):
        true = any(within(link.group, t.group, NEAR_RAD) for t in truths)
        place = (case.half, case.family, case.name, case.view)
        chain.append(Known(*place, link.group.name, link.need, evidence.surface.floor, seen.lone_mirror, true))
        if not true:
            break
    return Answer(
        case=case,
        truth=made.truth.group.name,
        group=found.point_group,
        confidence=answer_confidence(found),
        right=outcome(found, made, pose) == "right",
        elements=tuple(
            Judged(look=case, confidence=sure, right=any(holds(t, claim, found.diagonal) for t in truths))
            for claim, sure in claims(found)
        ),
        chain=tuple(chain),
    )


def plan(every: int, seed: int) -> Iterator[Case]:
    """One in `every` of the pairs of object and view of each family, shuffled so that any number meets all views."""
    for family, known in objects().items():
        pairs = [(name, view) for name in known for view in range(len(VIEWS[family]))]
        for i in sorted(np.random.default_rng(0).permutation(len(pairs))[::every]):
            yield Case(family=family, name=pairs[i][0], view=pairs[i][1], seed=seed)


# --- report -----------------------------------------------------------------------------------------------------------


def mixes(rows: Sequence[Answer]) -> dict[str, list[Answer]]:
    """Selections that are summed up one by one: how far the figures hang on what one looks at."""
    return {
        "all": list(rows),
        **{half: [r for r in rows if r.case.half == half] for half in HALVES},
        **{family: [r for r in rows if r.case.family == family] for family in objects()},
        **{view: [r for r in rows if r.view == view] for view in dict.fromkeys(r.view for r in rows)},
    }


def report(rows: Sequence[Answer]) -> Iterator[str]:
    """The reliability table, what is sure and wrong, and the figures of each selection, as lines."""
    yield "confidence    answers  mean confidence %  right %  95 % interval"
    for b in bins([r.judged() for r in rows if r.decided]):
        low, high = plausible(b.right, b.count)
        share = f"{100 * b.sure:17.1f}  {100 * b.right:7.1f}  {100 * low:.0f} to {100 * high:.0f}"
        yield f"{b.low:.2f} to {b.high:.2f}  {b.count:7d}  {share}"
    yield from ("", *sure_and_wrong(rows), "")
    yield "                                                     of answers     called 95 % sure     right ones"
    yield "                           looks  undetermined     right %  Brier   count    right %  called so %"
    for label, these in mixes(rows).items():
        s = summary([r.judged() for r in these if r.decided])
        yield (
            f"{label:26s} {len(these):5d}  {len(these) - s.count:12d}  {100 * s.right:10.1f}  {s.brier:.3f}"
            f"  {s.sure:6d}  {100 * s.sure_right:9.2f}  {100 * s.right_sure:11.1f}"
        )
    e = summary([element for r in rows for element in r.elements])
    yield ""
    yield (
        f"{e.count} elements claimed, {100 * e.right:.1f} % right; of {e.sure} called 95 % sure "
        f"{100 * e.sure_right:.2f} %, each look counting once {100 * e.sure_right_each:.2f} %"
    )


def sure_and_wrong(rows: Sequence[Answer]) -> Iterator[str]:
    """A line for every answer that is sure and not right."""
    for r in rows:
        if r.confidence >= SURE and not r.right:
            asked = f"{r.case.family} {r.case.name} ({r.view}), seed {r.case.seed}"
            yield f"sure and wrong: {asked}: {r.truth} -> {r.group}, confidence {r.confidence:.3f}"


# --- fit --------------------------------------------------------------------------------------------------------------


def misfit(constants: Sequence[float], links: Sequence[Known]) -> float:
    """Negative log likelihood of what is true of each link, a link, under constants in the order of `SHIPPED`."""
    even, even_mirror, steepness, unknown, blurred = constants
    evens = np.array([even_mirror if k.lone else even for k in links])
    noise, needs = (np.array([getattr(k, name) for k in links]) / TOLERANCE for name in ("noise", "need"))
    squares = np.maximum(strain(needs, noise, evens, unknown, blurred), np.finfo(float).tiny)
    wrong_odds = sharpness(noise, steepness) / 2.0 * np.log(squares)
    return float(np.logaddexp(0.0, np.where([k.true for k in links], wrong_odds, -wrong_odds)).mean())


def best(links: Sequence[Known]) -> tuple[float, ...]:
    """Constants of the greatest likelihood."""
    from scipy.optimize import minimize

    found = minimize(lambda x: misfit(np.exp(x), links), np.log(SHIPPED), method="Nelder-Mead")
    return tuple(float(c) for c in np.exp(found.x))


def fit_report(links: Sequence[Known]) -> Iterator[str]:
    """The best constants of each half, and what they and those shipped score on both, as lines."""
    halves = {half: [k for k in links if k.half == half] for half in HALVES}
    for half, ks in halves.items():
        yield f"{half}: {len(ks)} links, {sum(not k.true for k in ks)} of them false"
    if not all(halves.values()):
        yield "nothing to fit to in one of the halves"
        return
    named = "EVEN  EVEN_MIRROR  STEEPNESS  UNKNOWN  BLURRED"
    yield f"{'':22s} {named}  negative log likelihood a link: {', '.join(HALVES)}"
    for label, c in (("shipped", SHIPPED), *((f"best for {half}", best(ks)) for half, ks in halves.items())):
        scores = ", ".join(f"{misfit(c, ks):.5f}" for ks in halves.values())
        yield f"{label:20s} {c[0]:6.3f}  {c[1]:11.3f}  {c[2]:9.2f}  {c[3]:7.3f}  {c[4]:7.3f}  {scores}"


def kept(path: Path) -> list[Known]:
    """The links of an earlier run."""
    return [Known(*row) for row in pickle.loads(path.read_bytes())]


def keep(links: Sequence[Known], path: Path) -> None:
    """Put links where `kept` finds them: as plain tuples, which do not depend on how this module was started."""
    with whole(path) as draft:
        draft.write_bytes(pickle.dumps([tuple(k) for k in links]))


def main(arguments: list[str] | None = None) -> int:
    """Print the tables, write the plot; 2 if a file has no place to go."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.reliability", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help=f"each {QUICK_EVERY}th look only, no figure unless asked")
    parser.add_argument("--every", type=int, default=1, help="each so many-th look (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of poses, samples and noise (default: %(default)s)")
    parser.add_argument("--figure", type=Path, help=f"where the plot goes (default: {FIGURE.name} in docs)")
    parser.add_argument("--fit", action="store_true", help="constants of the posterior that suit each half best")
    parser.add_argument("--chains", type=Path, metavar="FILE", help="keeps what is fitted to; with --fit read if there")
    add_jobs(parser)
    options = parser.parse_args(arguments)
    path = options.figure or (None if options.quick else FIGURE)
    if options.every < 1:
        parser.error(f"--every is {options.every}; expected 1 or more")
    if options.fit and options.chains is not None and options.chains.is_file():
        print("\n".join(fit_report(kept(options.chains))))
        return 0
    try:
        for target in (path, options.chains):
            if target is not None:
                check_target(target)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    cases = list(plan(QUICK_EVERY if options.quick else options.every, options.seed))
    rows = counted("looking", answered, cases, options.jobs)
    links = [link for r in rows for link in r.chain]
    if options.chains is not None:
        keep(links, options.chains)
    print(f"{len(cases)} looks at {len({(c.family, c.name) for c in cases})} objects")
    if not catalogue():
        print(f"without the catalogued meshes: {FOLDER} is not there")
    print("\n".join(report(rows)))
    if options.fit:
        print("\n".join(["", *fit_report(links)]))
    if path is not None:
        plot([r.judged() for r in rows if r.decided], path)
        print(f"\nwrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
