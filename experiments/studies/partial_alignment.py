"""Alignment of clouds that share a part only: cuts, strays, noise, uneven density, clutter; the peers beside us.

    python -m experiments.studies.partial_alignment [--quick] [--seeds N] [--first N] [--methods NAME ...]
                                                    [--only CONDITION ...] [--objects NAME ...] [--jobs N]
                                                    [--rows PATH] [--beside PATH ...] [--figure PATH]

Ten chiral objects, five of them the project's own and five of `../shared/objects` where these are. Source and target
are independent samples of 10,000 points, the target turned by a random rotation or reflection. Right is within 5
degrees and 2 % of the diagonal, modulo the operations of the object. Peers are asked for both hands, and the nearer
answer counts. Processor time over all threads.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from experiments.objects.built_symmetry import Truth, specimen
from experiments.objects.catalogue import catalogue
from experiments.objects.shapes import sample
from experiments.peers.registration import PEERS, installed, register
from experiments.studies.jobs import add_jobs, counted
from symrefine.align.story import align
from symrefine.files import whole
from symrefine.geometry import Array, Isometry, random_orthogonal, unit
from symrefine.groups.orthogonal import chord_angles
from symrefine.shape import Shape

OWN = {"asymmetric": "household", "camera": "household", "grinder": "household", "bolt": "shape", "fan3": "shape"}
REAL = ("drill_cordless", "shark", "panther", "magnolia", "teddy")
POINTS = 10000
# Strays lie in the bounding box, so many times as large; so large is the floor, in boxes.
BOX, FLOOR = 1.5, 1.5
RIGHT_DEG, RIGHT_REL = 5.0, 0.02
# From such a confidence on an answer counts as sure.
SURE = 0.95
Rng = np.random.Generator
Sides = tuple[Array, Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A pair of clouds and a method."""

    name: str
    condition: str
    det: int
    seed: int
    method: str = "align"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What a method made of it: errors, its own word on them, and processor seconds.

    `covered`: whether the answer or one that it calls equivalent is near enough, which is what its confidence is of.
    """

    case: Case
    det_right: bool
    error_deg: float
    error_rel: float
    covered: bool
    status: str
    confidence: float
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the answer is near enough."""
        return near_enough(self.error_deg, self.error_rel)


def near_enough(error_deg: float, error_rel: float) -> bool:
    """Whether errors of an answer are small enough to call it right."""
    return error_deg <= RIGHT_DEG and error_rel <= RIGHT_REL


@cache
def target_of(name: str) -> tuple[Shape, Truth]:
    """The mesh of an object, and the symmetry that it was built with."""
    return specimen(OWN.get(name, "catalogue"), name)


def objects() -> list[str]:
    """Those that are there."""
    return [*OWN, *(n for n in REAL if n in catalogue())]


def _pair(mesh: Shape, rng: Rng, count: int = POINTS, noise: float = 0.0) -> Sides:
    first, second = (sample(mesh, count, noise, rng) for _ in range(2))
    return first, second


def whole_object(mesh: Shape, _: float, rng: Rng) -> Sides:
    """Nothing is missing."""
    return _pair(mesh, rng)


def overlap(mesh: Shape, share: float, rng: Rng) -> Sides:
    """Each is cut off by a plane, from opposite sides: such a share of either has its counterpart in the other."""
    kept = 1.0 / (2.0 - share)
    along = unit(rng.normal(size=3))
    first, second = _pair(mesh, rng, round(POINTS / kept))
    up, down = first @ along, second @ along
    return first[up <= np.quantile(up, kept)], second[down >= np.quantile(down, 1.0 - kept)]


def outliers(mesh: Shape, share: float, rng: Rng) -> Sides:
    """A share of either cloud is anywhere in a box around the object."""
    strays = []
    for points in _pair(mesh, rng):
        low, high = points.min(axis=0), points.max(axis=0)
        count = round(share * POINTS)
        box = 0.5 * (low + high) + BOX * (rng.random((count, 3)) - 0.5) * (high - low)
        strays.append(np.concatenate([points[count:], box]))
    return strays[0], strays[1]


def noisy(mesh: Shape, level: float, rng: Rng) -> Sides:
    """Noise of so many diagonals."""
    return _pair(mesh, rng, noise=level)


def uneven(mesh: Shape, ratio: float, rng: Rng) -> Sides:
    """A density that falls off along some direction, another one for either cloud."""
    thinned = []
    for points in _pair(mesh, rng, 4 * POINTS):
        along = points @ unit(rng.normal(size=3))
        chance = ratio ** -((along - along.min()) / np.ptp(along))
        thinned.append(points[rng.choice(len(points), POINTS, replace=False, p=chance / chance.sum())])
    return thinned[0], thinned[1]


def clutter(mesh: Shape, share: float, rng: Rng) -> Sides:
    """Such a share of the target is a floor under it."""
    first, second = _pair(mesh, rng)
    count = round(share * POINTS)
    low, high = second.min(axis=0), second.max(axis=0)
    floor = 0.5 * (low + high) + FLOOR * (rng.random((count, 3)) - 0.5) * (high - low)
    floor[:, 2] = low[2]
    return first, np.concatenate([second[count:], floor])


# How each is made, and its strength.
CONDITIONS: dict[str, tuple[Callable[[Shape, float, Rng], Sides], float]] = {
    "full": (whole_object, 0.0),
    "overlap 80 %": (overlap, 0.8),
    "overlap 65 %": (overlap, 0.65),
    "overlap 50 %": (overlap, 0.5),
    "overlap 40 %": (overlap, 0.4),
    "outliers 10 %": (outliers, 0.1),
    "outliers 20 %": (outliers, 0.2),
    "outliers 40 %": (outliers, 0.4),
    "noise 1 %": (noisy, 0.01),
    "density 10:1": (uneven, 10.0),
    "clutter 50 %": (clutter, 0.5),
}
QUICK = ("full", "overlap 80 %", "overlap 50 %", "outliers 20 %", "clutter 50 %")
OURS = "align"
METHODS = (OURS, *PEERS)
# What a table says of a method without rows.
ABSENT, NOTHING = "not installed", "not asked"
# What success is drawn and told over: the conditions of one kind, and what their strength is.
AXES = {"overlap": overlap, "share of outliers": outliers}


def given(case: Case) -> tuple[Array, Array, Isometry]:
    """Source, target, and the true map."""
    mesh, _ = target_of(case.name)
    make, strength = CONDITIONS[case.condition]
    rng = np.random.default_rng([case.seed, *case.name.encode(), *case.condition.encode(), case.det + 1])
    source, target = make(mesh, strength, rng)
    matrix = random_orthogonal(rng, det=case.det)
    truth = Isometry(matrix=matrix, shift=rng.uniform(-5, 5, 3) * mesh.diagonal)
    return rng.permutation(source), truth.apply(rng.permutation(target)), truth


def run(case: Case) -> Row:
    """The map that is found against the true one."""
    mesh, symmetry = target_of(case.name)
    source, target, truth = given(case)
    every, center = truth.matrix @ symmetry.group.operations(), symmetry.center

    def errors(transform: Array) -> tuple[float, float]:
        matrix, shift = transform[:3, :3], transform[:3, 3]
        away = np.linalg.norm(matrix @ center + shift - truth.apply(center[None])[0])
        return float(np.degrees(chord_angles(matrix, every).min())), float(away / mesh.diagonal)

    status, confidence = "", float("nan")
    start = time.process_time()
    if case.method == OURS:
        found = align(source, target)
        status, confidence, transform = found.status, found.confidence, found.transform
    else:
        transform = register(case.method, source, target, mesh.diagonal)
    seconds = time.process_time() - start
    here = errors(transform)
    covered = near_enough(*here) or (
        case.method == "align" and any(near_enough(*errors(t)) for t in found.equivalent_transforms)
    )
    return Row(
        case=case,
        det_right=bool(np.linalg.det(transform[:3, :3]) * case.det > 0.0),
        error_deg=here[0],
        error_rel=here[1],
        covered=covered,
        status=status,
        confidence=confidence,
        seconds=seconds,
    )


def cases(methods: Sequence[str], conditions: Sequence[str], names: Sequence[str], seeds: range) -> Iterator[Case]:
    """Every object under every condition, by every method that is there."""
    for condition in conditions:
        for method in methods:
            if method == OURS or installed(method):
                for seed in seeds:
                    for name in names:
                        for det in (1, -1):
                            yield Case(name=name, condition=condition, det=det, seed=seed, method=method)


def table(rows: Sequence[Row], methods: Sequence[str]) -> Iterator[str]:
    """A line for each condition: right of all, and mean processor milliseconds, by method."""
    yield f"{'right of all / mean processor ms':24s}" + "".join(f"{m:>21s}" for m in methods)
    for condition in dict.fromkeys(r.case.condition for r in rows):
        line = f"{condition:24s}"
        for method in methods:
            own = [r for r in rows if (r.case.condition, r.case.method) == (condition, method)]
            if own:
                spent = f"{1e3 * np.mean([r.seconds for r in own]):.0f}"
                line += f"{sum(r.right for r in own):10d}/{len(own)} {spent:>6s}"
            else:
                line += f"{NOTHING if method == OURS or installed(method) else ABSENT:>21s}"
        yield line


def reliability(rows: Sequence[Row]) -> Iterator[str]:
    """What our own word is worth: sure ones that are right, right ones that are sure, by condition.

    An answer is right here if it, or one that it calls equivalent, is near enough.
    """
    own = [r for r in rows if r.case.method == OURS]
    for condition in [*dict.fromkeys(r.case.condition for r in own), "all"]:
        here = [r for r in own if condition in (r.case.condition, "all")]
        sure, right = [r for r in here if r.confidence >= SURE], [r for r in here if r.covered]
        both = sum(r.covered for r in sure)
        expected = np.mean([r.confidence for r in here]) if here else float("nan")
        yield (
            f"    {condition:16s} right of the sure {both}/{len(sure)}, sure of the right {both}/{len(right)}, "
            f"mean confidence {expected:.2f} for {len(right) / max(len(here), 1):.2f} right"
        )


def levels(axis: str) -> dict[float, str]:
    """The conditions along an axis by their strength, a whole object among them; the easiest first."""
    found = {strength: name for name, (make, strength) in CONDITIONS.items() if make is AXES[axis]}
    easiest = 1.0 if axis == "overlap" else 0.0
    return dict(sorted((found | {easiest: "full"}).items(), reverse=axis == "overlap"))


def success(rows: Sequence[Row], axis: str, method: str) -> dict[float, float]:
    """Share of a method's answers that are right along an axis, by strength, where there are any."""
    own = [r for r in rows if r.case.method == method]
    right = {s: [r.right for r in own if r.case.condition == name] for s, name in levels(axis).items()}
    return {s: float(np.mean(each)) for s, each in right.items() if each}


def curves(rows: Sequence[Row], methods: Sequence[str]) -> Iterator[str]:
    """What `picture` draws, in figures: a row for each method, those that are not installed too."""
    for axis in AXES:
        yield f"right, over {axis:16s}" + "".join(f"{100 * s:>7.0f} %" for s in levels(axis))
        for method in methods:
            found = success(rows, axis, method)
            if not found:
                yield f"    {method:24s}{NOTHING if method == OURS or installed(method) else ABSENT}"
                continue
            cells = (f"{found[s]:9.2f}" if s in found else f"{'':9s}" for s in levels(axis))
            yield f"    {method:24s}{''.join(cells)}".rstrip()


def picture(rows: Sequence[Row], methods: Sequence[str], path: Path) -> None:
    """Success over overlap and over strays, a line for each method; one that is not installed stands in the legend."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, plots = plt.subplots(1, 2, figsize=(10, 3.6), sharey=True, layout="constrained")
    for axes, axis in zip(plots, AXES, strict=True):
        for k, method in enumerate(methods):
            found = success(rows, axis, method)
            absent = "" if found or method == OURS or installed(method) else f" ({ABSENT})"
            # Ours above the others, each with a marker of its own: lines that coincide are told apart.
            look = {"lw": 2.6, "zorder": 3} if method == OURS else {"lw": 1.4, "mfc": "none", "ms": 6.0 + 1.5 * k}
            axes.plot(list(found), list(found.values()), marker="os^Dvp"[k % 6], label=f"{method}{absent}", **look)
        ticks = list(levels(axis))
        axes.set(xlabel=axis, ylim=(-0.05, 1.08), xticks=ticks, xticklabels=[f"{100 * s:.0f} %" for s in ticks])
    plots[0].invert_xaxis()
    plots[0].set_ylabel("right")
    figure.legend(*plots[0].get_legend_handles_labels(), loc="outside right upper")
    with whole(path) as draft:
        figure.savefig(draft, dpi=110, format="png", metadata={"Software": None})
    plt.close(figure)


def read(path: Path) -> Iterator[Row]:
    """The rows that `--rows` wrote."""
    for line in path.read_text(encoding="utf-8").splitlines():
        given = json.loads(line)
        yield Row(**given | {"case": Case(**given["case"])})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="four objects, one seed, five conditions")
    parser.add_argument("--seeds", type=int, default=10, help="pairs of each object, condition and determinant")
    parser.add_argument("--first", type=int, default=0, help="first of the seeds; the limits were chosen on 0 and 1")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS, metavar="NAME")
    parser.add_argument("--only", nargs="*", default=list(CONDITIONS), choices=list(CONDITIONS), metavar="CONDITION")
    parser.add_argument("--objects", nargs="*", default=objects(), choices=objects(), metavar="NAME")
    parser.add_argument("--rows", type=Path, help="where the rows go, a line of JSON each")
    parser.add_argument("--beside", type=Path, nargs="*", default=[], help="rows of earlier runs, told as well")
    parser.add_argument("--figure", type=Path, help="where the picture goes")
    add_jobs(parser)
    options = parser.parse_args()
    names, conditions = options.objects, options.only
    seeds = range(options.first, options.first + (1 if options.quick else options.seeds))
    if options.quick:
        names, conditions = names[::3], [c for c in QUICK if c in conditions]
    every = list(cases(options.methods, conditions, names, seeds))
    rows = counted("aligning", run, every, options.jobs)
    told = rows + [row for path in options.beside for row in read(path)]
    methods = [m for m in METHODS if m in {*options.methods, *(r.case.method for r in told)}]
    print("\n".join(table(told, methods)))
    print("\n" + "\n".join(curves(told, methods)))
    if OURS in options.methods:
        print("\nour own word, at 95 %")
        print("\n".join(reliability(rows)))
    if options.rows is not None:
        with whole(options.rows) as draft:
            draft.write_text("".join(json.dumps(asdict(r)) + "\n" for r in rows), encoding="utf-8")
    if options.figure is not None:
        picture(told, methods, options.figure)


if __name__ == "__main__":
    main()
