"""Symmetry of pictures: the paper's case study in the plane, made anew, and drawings in random poses.

    python -m experiments.images [--out DIR] [--seed N]

Draws every object, detects, prints truth against what was found, and writes DIR/case_study.png and DIR/gallery.png. Its
exit status is 1 if a group is wrong or a line off by a degree.
"""

import argparse
import io
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from experiments.drawings import CASE_STUDY, GALLERY, Drawing, Pose, coverage, photograph, random_pose
from experiments.figures import case_study_figure, gallery_figure
from symrefine.geometry import Array
from symrefine.load import load
from symrefine.planar import PlanarDetection, detect_planar

WORST_DEG = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A drawing in a pose, its picture [H, W, 3], what was found in it, and the seconds that took."""

    drawing: Drawing
    pose: Pose
    picture: Array
    detection: PlanarDetection
    seconds: float

    @property
    def errors_deg(self) -> list[float]:
        """Angle between each line found and the nearest true one, degrees."""
        truth = self.drawing.line_angles + self.pose.angle_rad
        found = [np.arctan2(f.line.normal[1], f.line.normal[0]) - 0.5 * np.pi for f in self.detection.lines]
        apart = [np.abs((truth - angle + 0.5 * np.pi) % np.pi - 0.5 * np.pi) for angle in found]
        return [float(np.degrees(a.min(initial=np.pi))) for a in apart]

    @property
    def right(self) -> bool:
        """Group right, no line false."""
        return self.detection.point_group == self.drawing.group and max(self.errors_deg, default=0.0) < WORST_DEG


def case_study() -> list[Trial]:
    """The paper's objects upright, as binary pictures."""
    trials = []
    for drawing in CASE_STUDY:
        pose = Pose(radius=120.0, side=320)
        share = coverage(drawing, pose) >= 0.5
        picture = np.repeat(np.where(share, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
        trials.append(_trial(drawing, pose, Image.fromarray(picture), None))
    return trials


def gallery(rng: np.random.Generator) -> list[Trial]:
    """Every drawing once, photographed in a random pose; the picture is made grey, then binary, as in the paper."""
    trials = []
    for drawing in GALLERY:
        pose = random_pose(rng)
        trials.append(_trial(drawing, pose, photograph(coverage(drawing, pose), rng), "otsu"))
    return trials


def _trial(drawing: Drawing, pose: Pose, picture: Image.Image, threshold: str | None) -> Trial:
    data = io.BytesIO()
    picture.save(data, format="PNG")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        path.write_bytes(data.getvalue())
        shape = load(path, threshold=threshold)
    start = time.perf_counter()
    detection = detect_planar(shape)
    seconds = time.perf_counter() - start
    return Trial(drawing=drawing, pose=pose, picture=np.asarray(picture), detection=detection, seconds=seconds)


def ratio_lines(trials: Sequence[Trial]) -> list[str]:
    """Ratios of the singular values of the doublets of each vector of moments, an object to a column."""
    lines = [f"{'doublets of':14s}" + "".join(f"{t.drawing.name:>22s}" for t in trials)]
    for row in zip(*(t.detection.doublets.vectors for t in trials), strict=True):
        told = ["vanish" if v.vanish else f"{v.ratio:.4g}" for v in row]
        lines.append(f"v{row[0].orders!s:13s}" + "".join(f"{text:>22s}" for text in told))
    kinds = [f"{t.detection.doublets.kind}" for t in trials]
    return [*lines, f"{'they tell':14s}" + "".join(f"{kind:>22s}" for kind in kinds)]


def table_lines(trials: Sequence[Trial]) -> list[str]:
    """Truth against found."""
    lines = [f"{'object':26s}{'truth':>6s}{'found':>7s}{'confidence':>12s}{'worst line':>12s}{'nearest miss':>14s}"]
    for t in trials:
        worst = f"{max(t.errors_deg):.2f} deg" if t.errors_deg else ""
        miss = f"{t.detection.near_misses[0].excess:.1f} x limit" if t.detection.near_misses else ""
        mark = "" if t.right else "  WRONG"
        lines.append(
            f"{t.drawing.name:26s}{t.drawing.group:>6s}{t.detection.point_group:>7s}{t.detection.confidence:12.2f}"
            f"{worst:>12s}{miss:>14s}{mark}"
        )
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; 1 if anything is found wrong, 2 if the folder cannot be written."""
    parser = argparse.ArgumentParser(description="Symmetry of pictures, truth against found.")
    parser.add_argument("--out", type=Path, default=Path("out/images"), help="folder (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the poses and the grain (default: %(default)s)")
    args = parser.parse_args(argv)
    studied = case_study()
    print("\n".join(ratio_lines(studied)), end="\n\n")
    drawn = gallery(np.random.default_rng(args.seed))
    trials = [*studied, *drawn]
    print("\n".join(table_lines(trials)), end="\n\n")
    right = sum(t.right for t in trials)
    print(f"{right} of {len(trials)} right, {np.median([t.seconds for t in trials]):.2f} s each")
    try:
        args.out.mkdir(parents=True, exist_ok=True)
        case_study_figure(studied, args.out / "case_study.png")
        gallery_figure(drawn, args.out / "gallery.png")
    except OSError as error:
        print(f"images: cannot write to {args.out}: {error.strerror}", file=sys.stderr)
        return 2
    print(f"wrote {args.out}/case_study.png and {args.out}/gallery.png")
    return int(right < len(trials))


if __name__ == "__main__":
    sys.exit(main())
