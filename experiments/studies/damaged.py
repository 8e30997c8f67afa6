"""Clouds as sensors give them: strays, uneven density, missing parts, views from a camera.

    python -m experiments.studies.damaged [--only KIND ...] [--strength X ...] [--shapes NAME ... | --tangles N]
                                          [--every N] [--seed N ...] [--jobs N] [--figure PATH]

Shapes of many groups, 20,000 points with 0.3 % noise in random poses and units, damaged by kind and strength (see
`experiments.objects.damage`). A plane is asked for where at least 15 % of the points that are left move under it and
have a counterpart. It is found within 2 degrees and 2 % of the diagonal; false where the object has none within 3. Of a
revolution the axis is asked for. "Right" is the group of the object, or a subgroup in its place that is told as "at
least".
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from experiments.objects import tangles
from experiments.objects.built_symmetry import Truth, holds, specimen
from experiments.objects.catalogue import catalogue
from experiments.objects.damage import FLOORS, KINDS, Damaged, can_show
from experiments.objects.poses import Pose
from experiments.studies.answers import SURE, claims
from experiments.studies.jobs import add_jobs, in_order
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.geometry import line_angle_rad, tight_diagonal
from symrefine.groups import PointGroup
from symrefine.shape import Shape

OWN = (
    "clutter chair bracket skew_box fan3 flat_bottle stool3 table starfish swivel_base7 crown_gear12 rotor4 swirl4 "
    "propeller3 crate bossed_prism wheel5 crossed3 methane bossed_cube bottle goblet spool hollow_ball"
).split()
REAL = (
    "airplane_cessna_vedo camera_prosilica car_porsche cinder_block drill_cordless fire_hydrant handwheel_valve "
    "kinect machinist_cube plastic_cup table_rect_marble water_tower"
).split()
FOUND_DEG, FOUND_REL = 2.0, 0.02
# A claim that is worth acting on.
CLAIMED = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object, damaged."""

    family: str
    name: str
    kind: str
    strength: float
    seed: int = 0

    @property
    def damage(self) -> str:
        """Kind and strength."""
        return f"{self.kind} {self.strength:g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was found of it.

    Attributes:
        case: what was asked.
        truth: its group.
        group: the answer.
        confidence: of the answer; NaN where nothing is decided.
        right: whether the group is right.
        contradicted: whether it claims what the object has not.
        shown: planes, or axes of revolution, that the points show.
        found: of these.
        false: planes and axes of confidence .5 and more that the object has not.
        claimed: planes and axes of confidence .5 and more.
        worst_deg: largest angle error of those found; NaN without any.
        worst_rel: the same of how far they are from where they should be, as a fraction of the diagonal.
        strays: precision and recall of the points that were taken as strays; NaN without any.
        seconds: of the detection.
    """

    case: Case
    truth: str
    group: str
    confidence: float
    right: bool
    contradicted: bool
    shown: int
    found: int
    false: int
    claimed: int
    worst_deg: float
    worst_rel: float
    strays: tuple[float, float]
    seconds: float


def cases(
    kinds: Sequence[str],
    shapes: Sequence[str],
    seed: int,
    tangled: int | None = None,
    strengths: Sequence[float] = (),
) -> Iterator[Case]:
    """Every shape with every damage, or every tangle of a seed; kinds, shapes and strengths are all where none is."""
    if tangled is not None:
        named = [("tangle", n) for n in tangles.names(tangled)]
    else:
        named = [("shape", n) for n in OWN] + [("catalogue", n) for n in REAL if n in catalogue()]
    for kind, (_, known) in KINDS.items():
        if kinds and kind not in kinds:
            continue
        for strength in (k for k in known if not strengths or k in strengths):
            for family, name in named:
                if not shapes or name in shapes:
                    yield Case(family=family, name=name, kind=kind, strength=strength, seed=seed)


def damaged(case: Case) -> tuple[Damaged, Truth]:
    """The object as it is shown, and its symmetry there."""
    names = [*OWN, *REAL]
    name = [names.index(case.name)] if case.name in names else case.name.encode()
    key = [case.seed, *name, list(KINDS).index(case.kind), round(1000 * case.strength)]
    rng = np.random.default_rng(key)
    mesh, truth = specimen(case.family, case.name)
    made = KINDS[case.kind][0](mesh, case.strength, rng)
    pose = Pose.random(rng)
    seen = None if made.viewpoint is None else pose.of(made.viewpoint)
    return Damaged(points=pose.of(made.points), strays=made.strays, viewpoint=seen), truth.posed(pose)


def run(case: Case) -> Row:
    """Detect and compare."""
    made, truth = damaged(case)
    shape = Shape(points=made.points, viewpoint=made.viewpoint)
    start = perf_counter()
    found = detect(shape, outliers="floor" if case.kind in FLOORS else "auto")
    seconds = perf_counter() - start
    own = made.points[made.strays == 0]
    diagonal = tight_diagonal(own)
    errors = [_error(found, truth, n, diagonal) for n in _normals(truth.group) if _shown(own, truth, n)]
    known = [e for e in errors if e is not None]
    there = [holds(truth, claim, diagonal) for claim, _ in claims(found)]
    sure = [confidence for _, confidence in claims(found)]
    true = all(there) and not (found.inversion and not truth.group.has_inversion)
    at_least = found.at_least and true
    flagged = np.zeros(len(made.points), dtype=bool)
    flagged[found.outliers] = True
    stray = made.strays == 1
    both = float((flagged & stray).sum())
    return Row(
        case=case,
        truth=truth.group.name,
        group=("at least " if found.at_least and not found.undetermined else "") + found.point_group,
        confidence=math.nan if found.undetermined else found.confidence,
        right=not found.undetermined and true and (at_least or found.point_group == truth.group.name),
        contradicted=not true,
        shown=len(errors),
        found=len(known),
        false=sum(not t and c >= CLAIMED for t, c in zip(there, sure, strict=True)),
        claimed=sum(c >= CLAIMED for c in sure),
        worst_deg=max((angle for angle, _ in known), default=math.nan),
        worst_rel=max((away for _, away in known), default=math.nan),
        strays=(both / flagged.sum() if flagged.any() else math.nan, both / stray.sum() if stray.any() else math.nan),
        seconds=seconds,
    )


def _normals(group: PointGroup) -> list[np.ndarray]:
    """Mirrors; of a revolution its axis, of a ball none."""
    if group.is_finite:
        return list(group.mirrors())
    return [] if group.name == "Kh" else [group.frame[2]]


def _shown(points: np.ndarray, truth: Truth, direction: np.ndarray) -> bool:
    if not truth.group.is_finite:
        return True
    return can_show(points, direction, float(direction @ truth.center))


def _error(found: Detection, truth: Truth, direction: np.ndarray, diagonal: float) -> tuple[float, float] | None:
    """Angle (degrees) and distance (of the diagonal) of the nearest element of the kind; None if none is close."""
    if truth.group.is_finite:
        near = [(p.plane.normal, float(abs(p.plane.signed_distance(truth.center)))) for p in found.planes]
    else:
        near = [
            (a.axis.direction, float(np.linalg.norm(np.cross(truth.center - a.axis.point, a.axis.direction))))
            for a in found.axes
            if math.isinf(a.order)
        ]
    every = ((math.degrees(line_angle_rad(other, direction)), away / diagonal) for other, away in near)
    return min((e for e in every if e[0] <= FOUND_DEG and e[1] <= FOUND_REL), default=None)


def line(rows: Sequence[Row]) -> str:
    """Recall, precision, groups, errors, calibration and time of some rows."""
    shown, found = sum(r.shown for r in rows), sum(r.found for r in rows)
    claimed, false = sum(r.claimed for r in rows), sum(r.false for r in rows)
    each = [r.found / r.shown for r in rows if r.shown]
    sure = [r for r in rows if r.confidence >= SURE]
    off = [(r.worst_deg, 100.0 * r.worst_rel) for r in rows if not math.isnan(r.worst_deg)]
    angle, away = np.median(off, axis=0) if off else (math.nan, math.nan)
    undecided = sum(math.isnan(r.confidence) for r in rows)
    bad = sum(not (r.right or (not r.contradicted and r.group.startswith("at least"))) for r in sure)
    return (
        f"recall {found / max(shown, 1):5.2f} of {shown:3d}, by object {np.mean(each) if each else math.nan:5.2f}  "
        f"false {false:3d} of {claimed:3d}  right {sum(r.right for r in rows):3d}, undetermined {undecided:2d} "
        f"of {len(rows):3d}  sure and wrong {bad:2d} of {len(sure):3d}  error {angle:.2f} deg, {away:.2f} %"
        f"  {np.median([r.seconds for r in rows]):.2f} s, worst {max(r.seconds for r in rows):.1f}"
    )


def heat(rows: Sequence[Row], path: Path) -> None:
    """Recall by shape and damage as a picture."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    from symrefine.files import whole

    names = list(dict.fromkeys(r.case.name for r in rows))
    damages = list(dict.fromkeys(r.case.damage for r in rows))
    right = np.full((len(names), len(damages)), np.nan)
    for r in rows:
        right[names.index(r.case.name), damages.index(r.case.damage)] = r.right
    recall = np.full_like(right, np.nan)
    for r in rows:
        if r.shown:
            recall[names.index(r.case.name), damages.index(r.case.damage)] = r.found / r.shown
    figure, plots = plt.subplots(1, 2, figsize=(13, 0.24 * len(names) + 2), sharey=True, layout="constrained")
    for axes, values, title in zip(plots, (recall, right), ("planes and axes found", "group right"), strict=True):
        axes.imshow(values, vmin=0, vmax=1, cmap="RdYlGn", aspect="auto")
        axes.set_xticks(range(len(damages)), damages, rotation=90)
        axes.set_yticks(range(len(names)), names)
        axes.set_title(title)
    with whole(path) as draft:
        figure.savefig(draft, dpi=110, format="png")
    plt.close(figure)


def main() -> None:
    """Print a line for each damage, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], choices=list(KINDS), metavar="KIND")
    parser.add_argument("--shapes", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--tangles", type=int, metavar="N", help="tangles of this seed (`experiments.objects.tangles`)")
    parser.add_argument("--every", type=int, default=1, help="each so many-th case (default: %(default)s)")
    parser.add_argument("--strength", nargs="*", default=[], type=float, metavar="X", help="of damage (default: all)")
    parser.add_argument("--seed", nargs="+", type=int, default=[0], help="of damage, noise and poses (default: 0)")
    parser.add_argument("--figure", type=Path, help="where a heat map of shapes by damage goes")
    add_jobs(parser)
    options = parser.parse_args()
    rows = []
    given = (options.only, options.shapes)
    every = [
        case
        for seed in options.seed
        for case in list(cases(*given, seed, options.tangles, options.strength))[:: options.every]
    ]
    for row in in_order(run, every, options.jobs):
        rows.append(row)
        if not row.right or row.false or row.found < row.shown:
            print(
                f"{row.case.damage:16s} {row.case.name:20s} {row.truth:6s} -> {row.group:15s} {row.confidence:5.2f}  "
                f"{row.found}/{row.shown} false {row.false}/{row.claimed}{'' if row.right else '  <- not right'}",
                flush=True,
            )
    print()
    for damage in dict.fromkeys(r.case.damage for r in rows):
        print(f"{damage:16s} {line([r for r in rows if r.case.damage == damage])}")
    if options.figure is not None:
        heat(rows, options.figure)
        print(f"wrote {options.figure}")


if __name__ == "__main__":
    main()
