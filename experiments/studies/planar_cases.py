"""The paper's case study in the plane: a rectangle, the same with a disc on either axis, and an object with two discs.

    python -m experiments.studies.planar_cases [--out DIR]

prints what the doublets tell of each object and the ratios of their singular values beside those of the paper, and
writes DIR/case_study.png; the exit status is 1 if a group is wrong. The paper shows its objects but gives no sizes:
ours have the same symmetry and their own ratios. `symrefine run configs/planar_cases.yaml` turns them, too.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.objects.drawings import CASE_STUDY, DRAWINGS
from experiments.objects.pictures import Pose, coverage, picture
from experiments.studies.planar_images import Trial, examine, summary
from symrefine.errors import InputError

# Section "Experiments in 2D space": of the object without symmetry. For the others the paper says in words what we
# print as a class: doublets in the origin, on a line along x, on a line along y.
PAPER_RATIOS = {(2, 3): 8.73, (4, 5): 2.71, (6, 3): 5.59}
NAMES = tuple(d.name for d in CASE_STUDY)
RADIUS = 0.375


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One of the four objects, turned, in a binary picture of `side` pixels."""

    object: str = "rectangle"
    angle_deg: float = 0.0
    side: int = 320


def check(case: Case) -> None:
    """Refuse a case that cannot be.

    Raises:
        InputError: an unknown object, or a picture too small or too large.
    """
    if case.object not in NAMES:
        raise InputError(f"object: value is {case.object!r}, expected one of {', '.join(NAMES)}")
    if not 32 <= case.side <= 2048:
        raise InputError(f"side: value is {case.side}, expected a number of pixels from 32 to 2048")


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """The row of `planar_images` and, of each vector of moments, the ratio of the singular values of its doublets.

    A ratio is None where the doublets vanish.
    """
    found = trial(case)
    ratios = {
        f"ratio_{v.orders[0]}_{v.orders[1]}": None if v.vanish else v.ratio for v in found.detection.doublets.vectors
    }
    large, small = found.detection.doublets.singular_values
    return summary(found) | {"sigma_1": float(large), "sigma_2": float(small)} | ratios


def trial(case: Case) -> Trial:
    """The picture and what was found in it."""
    drawing = DRAWINGS[case.object]
    pose = Pose(angle_rad=float(np.radians(case.angle_deg)), radius=RADIUS * case.side, side=case.side)
    return examine(drawing, pose, picture(coverage(drawing, pose), "binary", np.random.default_rng(0)))


def ratio_lines(trials: Sequence[Trial]) -> list[str]:
    """Ratios of the singular values of the doublets of each vector of moments, an object to a column."""
    wide = 22
    lines = [f"{'doublets of':14s}" + "".join(f"{t.drawing.name:>{wide}s}" for t in trials) + f"{'paper':>{wide}s}"]
    for row in zip(*(t.detection.doublets.vectors for t in trials), strict=True):
        told = ["vanish" if v.vanish else f"{v.ratio:.4g}" for v in row]
        paper = PAPER_RATIOS.get(row[0].orders, "")
        lines.append(f"v{row[0].orders!s:13s}" + "".join(f"{text:>{wide}s}" for text in told) + f"{paper!s:>{wide}s}")
    kinds = [t.detection.doublets.kind for t in trials]
    groups = [t.detection.point_group for t in trials]
    lines.append(f"{'they tell':14s}" + "".join(f"{kind:>{wide}s}" for kind in kinds))
    return [*lines, f"{'group found':14s}" + "".join(f"{group:>{wide}s}" for group in groups)]


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; 1 if anything is found wrong, 2 if the folder cannot be written."""
    from experiments.studies.planar_figures import case_study_figure

    parser = argparse.ArgumentParser(description="The paper's case study in the plane.")
    parser.add_argument("--out", type=Path, default=Path("out/planar_cases"), help="folder (default: %(default)s)")
    args = parser.parse_args(argv)
    trials = [trial(Case(object=name)) for name in NAMES]
    print("\n".join(ratio_lines(trials)), end="\n\n")
    try:
        args.out.mkdir(parents=True, exist_ok=True)
        case_study_figure(trials, args.out / "case_study.png")
    except OSError as error:
        print(f"planar_cases: cannot write to {args.out}: {error.strerror}", file=sys.stderr)
        return 2
    print(f"wrote {args.out / 'case_study.png'}")
    return int(not all(t.right for t in trials))


if __name__ == "__main__":
    sys.exit(main())
