"""Small pictures: icons and letters 32 to 64 pixels wide, edges between pixels, as PNG and as JPEG.

    python -m experiments.studies.small_pictures [--poses N] [--seed N] [--jobs N]

Of each kind of picture: how many are right, undetermined, wrong, and wrong although called 95 % sure.
"""

import argparse
import io
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from experiments.objects.icons import ICONS
from experiments.objects.pictures import coverage, picture, random_pose
from experiments.studies.jobs import add_jobs, counted
from symrefine.load.content import Wanted
from symrefine.load.image import read_image
from symrefine.plane import PlanarDetection, detect_planar
from symrefine.shape import Shape

SIDES = (32, 48, 64)
# Of JPEG; 0 for PNG.
QUALITIES = (0, 90, 75, 60)
SURE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """An icon in a pose, the side of its picture in pixels, and the quality of JPEG (0: PNG)."""

    icon: str
    side: int = 48
    quality: int = 0
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The true group, the one found, and how sure it is."""

    case: Case
    truth: str
    found: str
    confidence: float

    @property
    def verdict(self) -> str:
        """One of "right", "undetermined", "wrong", "sure and wrong"."""
        if self.found in (self.truth, "undetermined"):
            return "right" if self.found == self.truth else "undetermined"
        return "sure and wrong" if self.confidence >= SURE else "wrong"


VERDICTS = ("right", "undetermined", "wrong", "sure and wrong")


def examine(case: Case) -> PlanarDetection:
    """The picture of a case, saved, loaded, and looked at."""
    rng = np.random.default_rng([case.seed, zlib.crc32(case.icon.encode()), case.side])
    image = picture(coverage(ICONS[case.icon], random_pose(rng, case.side)), "clean", rng)
    return detect_planar(loaded(image, case.quality))


def loaded(image: Image.Image, quality: int) -> Shape:
    """A picture as a file of it gives it, as PNG, or as JPEG of some quality."""
    file = io.BytesIO()
    if quality:
        image.save(file, "JPEG", quality=quality)
    else:
        image.save(file, "PNG")
    content = read_image(file.getvalue(), ".jpg" if quality else ".png", Wanted())
    return Shape(points=content.points, weights=content.weights)


def answer(case: Case) -> Answer:
    """What is found against what is there."""
    found = examine(case)
    name = "undetermined" if found.undetermined else found.point_group
    return Answer(case=case, truth=ICONS[case.icon].group, found=name, confidence=found.confidence)


def plan(poses: int, seed: int) -> Iterator[Case]:
    """Every icon in every kind of picture."""
    for side in SIDES:
        for quality in QUALITIES:
            for icon in ICONS:
                for k in range(poses):
                    yield Case(icon=icon, side=side, quality=quality, seed=1000 * seed + k)


def report(answers: Sequence[Answer]) -> Iterator[str]:
    """A line for each kind of picture, then the answers that are sure and wrong."""
    yield f"{'picture':24s}{'count':>7s}" + "".join(f"{v:>16s}" for v in VERDICTS)
    kinds = {(s, q): f"{s} px, {f'JPEG {q}' if q else 'PNG'}" for s in SIDES for q in QUALITIES}
    for (side, quality), label in kinds.items():
        yield _line(label, [a for a in answers if (a.case.side, a.case.quality) == (side, quality)])
    yield _line("all", answers)
    for a in answers:
        if a.verdict == "sure and wrong":
            told = f"{a.case.icon} is {a.truth}, found {a.found} ({a.confidence:.3f})"
            yield f"{kinds[a.case.side, a.case.quality]}: {told}"


def _line(label: str, answers: Sequence[Answer]) -> str:
    counts = [sum(a.verdict == v for a in answers) for v in VERDICTS]
    return f"{label:24s}{len(answers):7d}" + "".join(f"{c:16d}" for c in counts)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; 1 if any answer is sure and wrong."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.small_pictures")
    parser.add_argument("--poses", type=int, default=1, help="of each icon in each kind of picture (default: 1)")
    parser.add_argument("--seed", type=int, default=0, help="of the poses (default: %(default)s)")
    add_jobs(parser)
    args = parser.parse_args(argv)
    answers = counted("looking", answer, list(plan(args.poses, args.seed)), args.jobs)
    print("\n".join(report(answers)))
    return int(any(a.verdict == "sure and wrong" for a in answers))


if __name__ == "__main__":
    sys.exit(main())
