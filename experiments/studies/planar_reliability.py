"""Whether 95 % sure means 95 % right in the plane.

    python -m experiments.studies.planar_reliability [--quick] [--seed N] [--figure PATH] [--jobs N]

Mirror lines and turns claimed of the drawings of `planar_images` and `planar_cases` in random poses, clean, blurred and
with grain; and of the same drawings with one part moved by 1 to 5 % of the diagonal. An element is right if the drawing
as it was made has it: a line within 3 degrees and 2 % of the diagonal, turns by their order. The map from need to
probability is that of space (`decide.posterior`), fitted to none of these pictures.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.objects.drawings import DRAWINGS, Drawing, Layer
from experiments.objects.pictures import Pose, coverage, fit, picture, random_pose
from experiments.studies.calibration import Judged, bins, plausible, plot, summary
from experiments.studies.jobs import add_jobs, counted
from experiments.studies.planar_images import Trial, examine
from symrefine.errors import InputError
from symrefine.files import check_target
from symrefine.geometry import Array

FINISHES = ("clean", "blurred", "noisy")
# How far a part is moved, over the diagonal, taken as twice the reach; 0 leaves the drawing as it is.
MOVED = (0.0, 0.01, 0.02, 0.03, 0.05)
# Looks at the whole drawing for each at a broken one: a third of all looks is broken, as in
# `experiments.studies.reliability`.
WHOLE = 8
SIDES = (128, 256)
# A part that is pushed out of place: its radius over the diagonal.
PART = 0.12
WORST_DEG, WORST_REL = 3.0, 0.02
# Pixels to the reach of a drawing where it is tested whether what was moved shows.
FRAMED = 100.0
QUICK = ("heart", "letter Z", "star", "ring")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One look at one drawing: the part of it that is moved, the finish, and the seed of all that is random."""

    drawing: str
    moved_rel: float = 0.0
    finish: str = "clean"
    side: int = 256
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """A line or turns that were claimed, how surely, and whether they are there."""

    case: Case
    kind: str
    confidence: float
    right: bool

    def judged(self) -> Judged:
        """The same for the tables of `experiments.studies.calibration`."""
        return Judged(look=self.case, confidence=self.confidence, right=self.right)


def plan(*, quick: bool, seed: int) -> Iterator[Case]:
    """All looks, or those at four drawings."""
    for name in QUICK if quick else sorted(DRAWINGS):
        for finish in FINISHES:
            for k, moved in enumerate([0.0] * WHOLE + [m for m in MOVED if m]):
                if not (moved and DRAWINGS[name].group == "C1"):
                    yield Case(drawing=name, moved_rel=moved, finish=finish, side=SIDES[k % 2], seed=100 * seed + k)


def look(case: Case) -> Trial:
    """The picture of a case and what is found in it."""
    # Not the seed alone: drawings in the same pose would err alike.
    rng = np.random.default_rng([case.seed, sorted(DRAWINGS).index(case.drawing), FINISHES.index(case.finish)])
    drawing = DRAWINGS[case.drawing]
    drawing = broken(drawing, case.moved_rel, rng) if case.moved_rel else drawing
    pose = random_pose(rng, case.side)
    return examine(drawing, pose, picture(coverage(drawing, pose), case.finish, rng))


def elements(case: Case) -> list[Element]:
    """All that is claimed in a case; of a detection that says it is undetermined, nothing."""
    trial = look(case)
    found = trial.detection
    if found.undetermined:
        return []
    center = trial.pose.apply(fit(trial.drawing.layers).apply(np.zeros((1, 2))))[0]

    def line(normal: Array, offset: float) -> bool:
        off_deg = trial.off_deg(float(np.arctan2(normal[1], normal[0])) - 0.5 * np.pi)
        off_rel = abs(float(normal @ center) - offset) / found.diagonal
        # Every line through the middle of a round drawing is one.
        return (off_deg <= WORST_DEG or trial.drawing.group == "O(2)") and off_rel <= WORST_REL

    def turns(order: float) -> bool:
        fold = trial.drawing.fold
        return fold == 0 or (bool(np.isfinite(order)) and fold % int(order) == 0)

    rows = [("line", f.confidence, line(f.line.normal, f.line.offset)) for f in found.lines]
    if found.rotation is not None:
        rows.append(("turns", found.rotation.confidence, turns(found.rotation.order)))
    return [Element(case=case, kind=k, confidence=c, right=bool(r)) for k, c, r in rows]


# --- broken drawings --------------------------------------------------------------------------------------------------


def broken(drawing: Drawing, moved_rel: float, rng: np.random.Generator) -> Drawing:
    """The drawing with one part moved: a whole layer where there are several, in every other case, or a piece of edge.

    Args:
        moved_rel: how far, over the diagonal.
    """
    reach = fit(drawing.layers).reach
    step, radius = 2.0 * moved_rel * reach, 2.0 * PART * reach
    # Tangential pushes do nothing to a round edge, and others leave it a mirror line.
    if drawing.group == "O(2)" or (len(drawing.layers) > 1 and rng.random() < 0.5):
        return _shifted(drawing, step, rng)
    # With the same corners: more of them are drawn a little differently.
    before = _framed(_pushed(drawing, np.zeros(2), np.zeros(2), radius), reach)
    points = np.concatenate([_dense(p, 0.1 * reach) for p, _ in drawing.layers])
    for _ in range(200):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        site = points[rng.integers(len(points))]
        found = _pushed(drawing, site, step * np.array([np.cos(angle), np.sin(angle)]), radius)
        # Not within another part, where nothing would show, nor along its own edge.
        shows = np.abs(_framed(found, reach) - before).sum() > 0.5 * (2.0 * PART * FRAMED) * (2.0 * moved_rel * FRAMED)
        if shows and _nearest_image(drawing, site) >= radius:
            return found
    raise InputError(f"{drawing.name}: no part of the edge shows that it is moved by {moved_rel:g} of the diagonal")


def _shifted(drawing: Drawing, step: float, rng: np.random.Generator) -> Drawing:
    """A layer other than the first moved across the mirror lines: halfway between two of them."""
    which = int(rng.integers(1, len(drawing.layers)))
    angle = drawing.angle_rad + 0.5 * np.pi / max(drawing.fold, 1)
    points, grey = drawing.layers[which]
    layers = list(drawing.layers)
    layers[which] = (points + step * np.array([np.cos(angle), np.sin(angle)]), grey)
    left, along = ("D1", float(angle)) if drawing.group == "O(2)" else ("C1", 0.0)
    return replace(drawing, name=f"{drawing.name}, part moved", layers=tuple(layers), group=left, angle_rad=along)


def _pushed(drawing: Drawing, site: Array, push: Array, radius: float) -> Drawing:
    """What lies within a radius of a point pushed, fully over the inner half, less towards the rim."""

    def moved(layer: Layer) -> Layer:
        points = _dense(layer[0], 0.1 * radius)
        near = np.clip(1.0 - np.linalg.norm(points - site, axis=1) / radius, 0.0, 1.0)
        return points + np.clip(2.0 * near, 0.0, 1.0)[:, None] * push, layer[1]

    name = f"{drawing.name}, part moved"
    return replace(drawing, name=name, layers=tuple(moved(p) for p in drawing.layers), group="C1", angle_rad=0.0)


def _framed(drawing: Drawing, reach: float) -> Array:
    """Coverage of the drawing at a size and place that do not depend on what is moved."""
    frame = 1.5 * reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    radius = FRAMED * 1.5 * np.sqrt(2.0)
    pose = Pose(radius=radius, side=2 * int(radius) + 8)
    return coverage(replace(drawing, layers=((frame, 0.0), *drawing.layers)), pose)


def _nearest_image(drawing: Drawing, site: Array) -> float:
    """Distance from a point to the nearest of its images under the group, apart from the identity."""
    place, fold = complex(site @ np.array([1.0, 1j])), max(drawing.fold, 1)
    turns = np.exp(2j * np.pi * np.arange(1, fold) / fold) * place
    mirrors = np.exp(2j * drawing.line_angles) * np.conj(place)
    return float(np.abs(np.concatenate([turns, mirrors]) - place).min())


def _dense(points: Array, spacing: float) -> Array:
    """A polygon with corners no farther apart than `spacing`."""
    pieces = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / spacing)))
        pieces.append(a + np.arange(count)[:, None] / count * (b - a))
    return np.concatenate(pieces)


# --- report ---------------------------------------------------------------------------------------------------------


def report(rows: Sequence[Element]) -> Iterator[str]:
    """Confidence against truth of what is claimed, then in a line for each finish and each distance."""
    every = [r.judged() for r in rows]
    yield "confidence    elements  mean confidence %  right %  looks  right, each once %  95 % interval"
    for b in bins(every):
        low, high = plausible(b.right_each, b.looks)
        yield (
            f"{b.low:.2f} to {b.high:.2f}  {b.count:8d}  {100 * b.sure:17.1f}  {100 * b.right:7.1f}  {b.looks:5d}"
            f"  {100 * b.right_each:18.1f}  {100 * low:.0f} to {100 * high:.0f}"
        )
    yield ""
    yield "                                          of those called 95 % sure"
    yield "                elements   Brier   gap %   count  right %  each once %"
    mixes = {
        "all": rows,
        **{finish: [r for r in rows if r.case.finish == finish] for finish in FINISHES},
        "whole": [r for r in rows if not r.case.moved_rel],
        **{f"moved by {m:.0%}": [r for r in rows if r.case.moved_rel == m] for m in MOVED if m},
    }
    for label, some in mixes.items():
        s = summary([r.judged() for r in some])
        yield (
            f"{label:14s}  {s.count:8d}  {s.brier:.4f}  {100 * s.gap:6.2f}  {s.sure:6d}  {100 * s.sure_right:7.2f}"
            f"  {100 * s.sure_right_each:11.2f}"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables; 2 if the plot has no place to go."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.planar_reliability")
    parser.add_argument("--quick", action="store_true", help="four drawings only")
    parser.add_argument("--seed", type=int, default=0, help="of poses, grain and moved parts (default: %(default)s)")
    parser.add_argument("--figure", type=Path, help="where a plot goes")
    add_jobs(parser)
    args = parser.parse_args(argv)
    try:
        if args.figure is not None:
            check_target(args.figure)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    cases = list(plan(quick=args.quick, seed=args.seed))
    rows = [row for found in counted("looking", elements, cases, args.jobs) for row in found]
    print(f"{len(cases)} looks at {len({c.drawing for c in cases})} drawings")
    print("\n".join(report(rows)))
    if args.figure is not None:
        plot([r.judged() for r in rows], args.figure)
        print(f"\nwrote {args.figure}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
