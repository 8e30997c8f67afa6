"""Symmetry of pictures: drawings in random poses, several finishes, and siblings without the symmetry.

    python -m experiments.studies.planar_images [--out DIR] [--seed N]

photographs every drawing once, makes the picture grey, then binary by Otsu's threshold (the paper's last experiment in
the plane), prints truth against what was found, and writes DIR/gallery.png; the exit status is 1 if a group is wrong or
a line off by a degree. `symrefine run configs/planar_images.yaml` does it for many poses and finishes.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from experiments.objects.drawings import DRAWINGS, GALLERY, Drawing
from experiments.objects.pictures import DEFECTS, FINISHES, Pose, coverage, fit, picture, random_pose, sibling
from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.load import load
from symrefine.plane import PlanarDetection, detect_planar

# A line found is a true one if it is no farther off.
WORST_DEG = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A drawing, the detail that spoils it and its size over the diagonal, and how the picture is made and read."""

    drawing: str = "heart"
    defect: str = "none"
    defect_rel: float = 0.06
    finish: str = "clean"
    side: int = 256
    tolerance: float = 0.02
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A drawing in a pose, its picture [H, W] or [H, W, 3], what was found in it, and the seconds that took."""

    drawing: Drawing
    pose: Pose
    picture: Array
    detection: PlanarDetection
    seconds: float

    @property
    def errors_deg(self) -> list[float]:
        """Angle between each line found and the nearest true one, degrees."""
        angles = [float(np.arctan2(f.line.normal[1], f.line.normal[0])) - 0.5 * np.pi for f in self.detection.lines]
        return [self.off_deg(angle) for angle in angles]

    @property
    def offsets_rel(self) -> list[float]:
        """Distance of the true centre from each line found, in fractions of the diagonal."""
        center = self.pose.apply(fit(self.drawing.layers).apply(np.zeros((1, 2))))[0]
        return [abs(float(f.line.signed_distance(center))) / self.detection.diagonal for f in self.detection.lines]

    def off_deg(self, angle_rad: float) -> float:
        """Angle between a line and the nearest true one, degrees; 90 if there is none."""
        truth = self.drawing.line_angles + self.pose.angle_rad
        apart = np.abs((truth - angle_rad + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
        return float(np.degrees(apart.min(initial=0.5 * np.pi)))

    @property
    def right(self) -> bool:
        """Group right, no line false, nothing in doubt."""
        same = self.detection.point_group == self.drawing.group and not self.detection.undetermined
        return same and max(self.errors_deg, default=0.0) < WORST_DEG


def check(case: Case) -> None:
    """Refuse a case that cannot be.

    Raises:
        InputError: an unknown drawing, defect or finish, a size out of range, a defect of what has no symmetry.
    """
    for name, known in (("drawing", sorted(DRAWINGS)), ("defect", DEFECTS), ("finish", FINISHES)):
        value = getattr(case, name)
        if value not in known:
            raise InputError(f"{name}: value is {value!r}, expected one of {', '.join(known)}")
    for name, low, high in (("defect_rel", 0.0, 0.2), ("side", 16, 2048), ("tolerance", 1e-4, 0.2), ("seed", 0, 2**63)):
        value = getattr(case, name)
        if not low <= value <= high:
            raise InputError(f"{name}: value is {value}, expected a number from {low:g} to {high:g}")
    if case.defect != "none" and DRAWINGS[case.drawing].group == "C1":
        raise InputError(f"defect: value is {case.defect!r}, expected 'none': {case.drawing} has no symmetry to lose")


def run(case: Case) -> dict[str, int | float | str | bool | None]:
    """Truth and what was found; angles in degrees, offsets in fractions of the diagonal."""
    rng = np.random.default_rng(case.seed)
    drawing = sibling(DRAWINGS[case.drawing], case.defect, case.defect_rel)
    pose = random_pose(rng, case.side)
    threshold = "otsu" if case.finish == "photo" else None
    image = picture(coverage(drawing, pose), case.finish, rng)
    return summary(examine(drawing, pose, image, threshold=threshold, tolerance=case.tolerance))


def examine(
    drawing: Drawing, pose: Pose, image: Image.Image, *, threshold: str | None = None, tolerance: float = 0.02
) -> Trial:
    """Save the picture as PNG, load it, detect."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        image.save(path)
        shape = load(path, threshold=threshold)
    start = time.perf_counter()
    detection = detect_planar(shape, tolerance=tolerance)
    seconds = time.perf_counter() - start
    return Trial(drawing=drawing, pose=pose, picture=np.asarray(image), detection=detection, seconds=seconds)


def summary(trial: Trial) -> dict[str, int | float | str | bool | None]:
    """One flat row; `doublets_deg` is the error of the line that the paper reads off the singular vectors alone."""
    found, errors = trial.detection, trial.errors_deg
    lined = trial.drawing.group == "D1" and found.doublets.kind == "line"
    return {
        "truth": trial.drawing.group,
        "found": "undetermined" if found.undetermined else found.point_group,
        "right": trial.right,
        "lines": len(trial.drawing.line_angles),
        "lines_found": sum(e < WORST_DEG for e in errors),
        "lines_false": sum(e >= WORST_DEG for e in errors),
        "worst_deg": max((e for e in errors if e < WORST_DEG), default=None),
        "offset_rel": max(trial.offsets_rel, default=None),
        "doublets": found.doublets.kind,
        "doublets_deg": trial.off_deg(found.doublets.angle_rad) if lined else None,
        "confidence": found.confidence,
        "near_excess": min((m.excess for m in found.near_misses), default=None),
        "detect_s": trial.seconds,
    }


def gallery(rng: np.random.Generator) -> list[Trial]:
    """Every drawing once, photographed in a random pose."""
    trials = []
    for drawing in GALLERY:
        pose = random_pose(rng)
        image = picture(coverage(drawing, pose), "photo", rng)
        trials.append(examine(drawing, pose, image, threshold="otsu"))
    return trials


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
    from experiments.studies.planar_figures import gallery_figure

    parser = argparse.ArgumentParser(description="Symmetry of photographs of drawings, truth against found.")
    parser.add_argument("--out", type=Path, default=Path("out/planar_images"), help="folder (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the poses and the grain (default: %(default)s)")
    args = parser.parse_args(argv)
    trials = gallery(np.random.default_rng(args.seed))
    print("\n".join(table_lines(trials)), end="\n\n")
    right = sum(t.right for t in trials)
    print(f"{right} of {len(trials)} right, {np.median([t.seconds for t in trials]):.2f} s each")
    try:
        args.out.mkdir(parents=True, exist_ok=True)
        gallery_figure(trials, args.out / "gallery.png")
    except OSError as error:
        print(f"planar_images: cannot write to {args.out}: {error.strerror}", file=sys.stderr)
        return 2
    print(f"wrote {args.out / 'gallery.png'}")
    return int(right < len(trials))


if __name__ == "__main__":
    sys.exit(main())
