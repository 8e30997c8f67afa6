"""Whether 95 % sure means 95 % right.

    python -m experiments.studies.reliability [--quick] [--every N] [--figure PATH] [--jobs N]

Elements claimed (planes, axes, rotoreflection axes) and candidates turned down, of every object there is: the shapes of
all point groups and their siblings with one detail out of place, the household objects, and the catalogued meshes
where they are; as meshes and as points with noise, in random poses and units. An element is right if the object as it
was built has it, within 3 degrees and 2 % of the diagonal.
"""

import argparse
import math
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.objects.built_symmetry import FAMILIES, Claim, Truth, holds, names, specimen
from experiments.objects.catalogue import FOLDER, catalogue
from experiments.objects.poses import Pose, observed, posed
from experiments.studies.jobs import add_jobs, in_order
from symrefine.decide.posterior import Link, meant
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.files import check_target, whole
from symrefine.geometry import Array
from symrefine.shape import Shape

# Form, points and noise of every look at an object.
VIEWS = (("mesh", 0, 0.0), ("cloud", 8000, 0.0), ("cloud", 20000, 0.005), ("cloud", 8000, 0.01))
SURE = 0.95
EDGES = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0)
QUICK_EVERY = 21
BLUE, ORANGE, RULE, GRID = "#0072b2", "#d55e00", "#6b7484", "#e3e7ee"
FIGURE = Path(__file__).parents[2] / "docs" / "reliability.png"


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One look at one object.

    Attributes:
        family: one of `FAMILIES`.
        name: of the object there.
        view: index in `VIEWS`.
        seed: of pose, sample and noise.
    """

    family: str
    name: str
    view: int = 0
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """An element with how sure the detection was of it, whether it claimed it, and whether it is there."""

    object: str
    family: str
    view: int
    kind: str
    claimed: bool
    confidence: float
    right: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Bin:
    """Elements of similar confidence: from `low` to `high`, `sure` in the mean.

    Attributes:
        right: share that is right.
        looks: detections they come from. The elements of one stand or fall together, so that these are what counts.
        right_each: share that is right, every detection counting as one.
    """

    low: float
    high: float
    count: int
    sure: float
    right: float
    looks: int
    right_each: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How well confidences agree with what is right; shares in [0, 1], NaN where nothing is.

    Attributes:
        count: elements.
        brier: mean square of the difference.
        gap: mean over all elements of the difference between confidence and share right in their bin (expected
            calibration error).
        sure: elements at `SURE` and above.
        sure_right: share of them that is right.
        sure_right_each: the same, the elements of one detection counting as one: they stand or fall together.
    """

    count: int
    brier: float
    gap: float
    sure: int
    sure_right: float
    sure_right_each: float


def claims(found: Detection) -> list[tuple[Claim, float, bool]]:
    """All elements of a detection, and the candidates it turned down: how sure it is, and whether it claims them."""
    planes = [
        (
            Claim(kind="plane", order=1.0, direction=p.plane.normal, point=np.asarray(p.plane.offset * p.plane.normal)),
            p.confidence,
            True,
        )
        for p in found.planes
    ]
    axes = [
        (
            Claim(
                kind="improper" if a.improper else "axis",
                order=a.order,
                direction=a.axis.direction,
                point=found.center if a.improper else a.axis.point,
            ),
            a.confidence,
            True,
        )
        for a in found.axes
    ]
    near = [
        (
            Claim(kind=m.kind, order=m.order, direction=m.direction, point=m.point),
            meant(Link(need=m.excess), 1.0),
            False,
        )
        for m in found.near_misses
        if m.kind != "inversion"
    ]
    return [*planes, *axes, *near]


def check(case: Case) -> None:
    """Whether such a case can be run.

    Raises:
        InputError: it cannot.
    """
    if case.family not in FAMILIES:
        raise InputError(f"family: value is {case.family!r}, expected one of {', '.join(FAMILIES)}")
    if case.name not in names(case.family):
        known = ", ".join(names(case.family)) or f"none: {FOLDER} is not there"
        raise InputError(f"name: value is {case.name!r}, expected one of the family {case.family!r}: {known}")
    if not 0 <= case.view < len(VIEWS):
        raise InputError(f"view: value is {case.view}, expected 0 to {len(VIEWS) - 1}")
    if case.seed < 0:
        raise InputError(f"seed: value is {case.seed}, expected 0 or more")


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """What one detection claims, how much of it is right, and how much of that which it is 95 % sure of."""
    check(case)
    claimed = [row for row in judged(case) if row.claimed]
    sure = [row for row in claimed if row.confidence >= SURE]
    return {
        "claimed": len(claimed),
        "right": sum(row.right for row in claimed),
        "sure": len(sure),
        "sure_right": sum(row.right for row in sure),
        "sure_share": sum(row.right for row in sure) / len(sure) if sure else None,
        "brier": summary(claimed).brier if claimed else None,
    }


def look(case: Case) -> tuple[Shape, Truth]:
    """An object in a random pose and unit as one of the views shows it, and its symmetry there."""
    form, points, noise_rel = VIEWS[case.view]
    number = names(case.family).index(case.name)
    rng = np.random.default_rng([case.seed, FAMILIES.index(case.family), number, case.view])
    mesh, truth = specimen(case.family, case.name)
    pose = Pose.random(rng)
    return posed(observed(mesh, form, points, noise_rel, rng), pose), truth.posed(pose)


def judged(case: Case) -> list[Judged]:
    """Detect an object; every element with its truth. A detection that says it is undetermined says nothing."""
    shape, truth = look(case)
    found = detect(shape)
    if found.undetermined:
        return []
    return [
        Judged(
            object=case.name,
            family=case.family,
            view=case.view,
            kind=claim.kind,
            claimed=claimed,
            confidence=sure,
            right=holds(truth, claim, found.diagonal),
        )
        for claim, sure, claimed in claims(found)
    ]


def plan(every: int, seed: int) -> Iterator[Case]:
    """Each `every`-th of all pairs of object and view; an odd number goes through all views."""
    for family in FAMILIES:
        pairs = [(name, view) for name in names(family) for view in range(len(VIEWS))]
        yield from (Case(family=family, name=name, view=view, seed=seed) for name, view in pairs[::every])


def fitted(name: str) -> bool:
    """Whether an object is of the half that the constants of `verify.confidence` were fitted to."""
    return zlib.crc32(name.encode()) % 2 == 0


def mixes(rows: Sequence[Judged]) -> dict[str, list[Judged]]:
    """Selections whose elements are summed up one by one: how far the figures hang on what one looks at."""
    return {
        "all": list(rows),
        "not fitted to": [r for r in rows if not fitted(r.object)],
        **{family: [r for r in rows if r.family == family] for family in FAMILIES},
        "all but siblings": [r for r in rows if r.family != "sibling"],
    }


def bins(rows: Sequence[Judged], edges: Sequence[float] = EDGES) -> list[Bin]:
    """Rows by confidence: a bin holds its lower edge, the last one both; empty ones are left out."""
    sure, _ = _columns(rows)
    place = np.clip(np.searchsorted(edges, sure, side="right") - 1, 0, len(edges) - 2)
    return [_bin([rows[j] for j in np.flatnonzero(place == i)], edges[i], edges[i + 1]) for i in np.unique(place)]


def _bin(rows: Sequence[Judged], low: float, high: float) -> Bin:
    sure, right = _columns(rows)
    each = _by_look(rows)
    return Bin(
        low=low,
        high=high,
        count=len(rows),
        sure=_mean(sure),
        right=_mean(right),
        looks=len(each),
        right_each=_mean(each),
    )


def summary(rows: Sequence[Judged]) -> Summary:
    """All rows in a few figures."""
    sure, right = _columns(rows)
    return Summary(
        count=len(rows),
        brier=_mean((sure - right) ** 2),
        gap=sum(b.count * abs(b.sure - b.right) for b in bins(rows)) / max(1, len(rows)),
        sure=int((sure >= SURE).sum()),
        sure_right=_mean(right[sure >= SURE]),
        sure_right_each=_mean(_by_look([r for r in rows if r.confidence >= SURE])),
    )


def _by_look(rows: Sequence[Judged]) -> Array:
    """Share right [K] of each detection that the rows come from."""
    looks: dict[tuple[str, str, int], list[bool]] = {}
    for r in rows:
        looks.setdefault((r.family, r.object, r.view), []).append(r.right)
    return np.array([np.mean(found) for found in looks.values()])


def _columns(rows: Sequence[Judged]) -> tuple[Array, Array]:
    """Confidences [N] and, as 0 and 1, whether each is right [N]."""
    return np.array([r.confidence for r in rows]), np.array([r.right for r in rows], dtype=float)


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else math.nan


def plausible(right: float, count: int) -> tuple[float, float]:
    """Interval of the true share, 95 %, given the share right of `count` (Wilson 1927)."""
    z2 = 1.96**2
    middle = (right + z2 / (2 * count)) / (1 + z2 / count)
    half = math.sqrt(z2 * (right * (1 - right) / count + z2 / (4 * count**2))) / (1 + z2 / count)
    return middle - half, middle + half


def plot(rows: Sequence[Judged], path: Path) -> None:
    """The reliability plot of what is claimed, and below it how many elements and detections its points stand for."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    found = bins([r for r in rows if r.claimed])
    figure = Figure(figsize=(6.4, 7.2), dpi=130, facecolor="white")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    sure, right = [b.sure for b in found], np.array([b.right_each for b in found])
    ends = np.array([plausible(b.right_each, b.looks) for b in found]).reshape(-1, 2).T
    upper.plot([0, 1], [0, 1], color=RULE, lw=1, zorder=0, label="as sure as right")
    upper.errorbar(
        sure,
        right,
        np.maximum(np.abs(ends - right), 0.0),
        fmt="o-",
        color=BLUE,
        capsize=3,
        label="elements claimed, each detection counted once, with 95 % interval",
    )
    upper.plot(sure, [b.right for b in found], "s", color=ORANGE, mfc="none", label="elements claimed, one by one")
    for side, (colour, counts) in enumerate([(ORANGE, [b.count for b in found]), (BLUE, [b.looks for b in found])]):
        widths = np.array([b.high - b.low for b in found]) / 2.2
        lower.bar(
            [b.low + side * w for b, w in zip(found, widths, strict=True)], counts, widths, align="edge", color=colour
        )
    upper.set(
        ylabel="share that is right", ylim=(-0.03, 1.2), yticks=np.linspace(0, 1, 6), title="Confidence against truth"
    )
    upper.legend(loc="upper left", frameon=False, fontsize=9)
    lower.set(xlabel="confidence", ylabel="elements, detections", yscale="log", xlim=(-0.02, 1.02))
    for axes in (upper, lower):
        axes.grid(color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    with whole(path) as draft:
        figure.savefig(draft, format="png", metadata={"Software": None})


def report(rows: Sequence[Judged]) -> Iterator[str]:
    """The reliability table, and the figures family by family, as lines."""
    for label, these in (("claimed", [r for r in rows if r.claimed]), ("claimed and turned down", rows)):
        yield f"Elements {label}"
        yield "confidence    elements  mean confidence %  right %  detections  right, each once %  95 % interval"
        for b in bins(these):
            low, high = plausible(b.right_each, b.looks)
            yield (
                f"{b.low:.2f} to {b.high:.2f}  {b.count:8d}  {100 * b.sure:17.1f}  {100 * b.right:7.1f}"
                f"  {b.looks:10d}  {100 * b.right_each:18.1f}  {100 * low:.0f} to {100 * high:.0f}"
            )
        yield ""
    yield from sure_and_wrong(rows)
    yield "                                                           of those called 95 % sure"
    yield "                               elements   Brier    gap %   count  right %  each once %"
    for label, these in mixes(rows).items():
        for first, kind, some in ((label, "claimed", [r for r in these if r.claimed]), ("", "and turned down", these)):
            s = summary(some)
            yield (
                f"{first:16s} {kind:15s} {s.count:6d}  {s.brier:.4f}  {100 * s.gap:7.2f}"
                f"  {s.sure:6d}  {100 * s.sure_right:7.2f}  {100 * s.sure_right_each:11.2f}"
            )


def sure_and_wrong(rows: Sequence[Judged]) -> Iterator[str]:
    """A line for every detection that claims what is not there and is sure of it."""
    wrong = [r for r in rows if r.claimed and r.confidence >= SURE and not r.right]
    for family, name, view in dict.fromkeys((r.family, r.object, r.view) for r in wrong):
        these = [r for r in wrong if (r.family, r.object, r.view) == (family, name, view)]
        kinds = ", ".join(sorted({r.kind for r in these}))
        form, points, noise_rel = VIEWS[view]
        seen = form if form == "mesh" else f"{points} points, noise {100 * noise_rel:g} %"
        yield f"sure and wrong: {family} {name} ({seen}): {len(these)} of {kinds}"
    yield ""


def main(arguments: list[str] | None = None) -> int:
    """Print the table, write the plot; 2 if the plot has no place to go."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.reliability", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help=f"each {QUICK_EVERY}th look only, no figure unless asked")
    parser.add_argument("--every", type=int, default=1, help="each so many-th look (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of poses, samples and noise (default: %(default)s)")
    parser.add_argument("--figure", type=Path, help=f"where the plot goes (default: {FIGURE.name} in docs)")
    add_jobs(parser)
    options = parser.parse_args(arguments)
    path = options.figure or (None if options.quick else FIGURE)
    if options.every < 1:
        parser.error(f"--every is {options.every}; expected 1 or more")
    try:
        if path is not None:
            check_target(path)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    cases = list(plan(QUICK_EVERY if options.quick else options.every, options.seed))
    rows = [row for found in in_order(judged, cases, options.jobs) for row in found]
    print(f"{len(cases)} looks at {len({(c.family, c.name) for c in cases})} objects")
    if not catalogue():
        print(f"without the catalogued meshes: {FOLDER} is not there")
    print("\n".join(report(rows)))
    if path is not None:
        plot(rows, path)
        print(f"\nwrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
