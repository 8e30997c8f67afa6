"""The demo: a noisy table in a random pose, its symmetries found, and everything there is to look at written down."""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.objects.poses import Pose
from experiments.objects.shapes import mirror_normals, sample, table
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.export.records import detection_record
from symrefine.files import json_text
from symrefine.geometry import Array, Plane, line_angle_rad
from symrefine.load import load
from symrefine.picture.draw import picture_png
from symrefine.picture.words import count, headline
from symrefine.report.page import html_page
from symrefine.shape import Shape
from symrefine.viewer import record

# Of the seeds that leave the table the right way up, the first.
SEED = 5
POINTS, NOISE, PLANES = 20000, 0.01, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """Where the table's four mirror planes and their common axis are."""

    normals: Array
    axis: Array
    middle: Array


def main() -> int:
    """Make, detect, compare, write; 1 if the four planes are not found."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.demo", description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=Path("out/demo"), help="folder for the results (default: %(default)s)"
    )
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    points, truth = make(np.random.default_rng(SEED))
    write_ply(out / "table.ply", points)
    print(f"Made a square table on four legs: {POINTS:,} points, {100 * NOISE:g} % noise, a random pose (seed {SEED}).")
    start = time.perf_counter()
    shape = load(str(out / "table.ply"))
    detection = detect(shape)
    seconds = time.perf_counter() - start
    print(f"Found {headline(detection)} ({count(detection.iterations, 'iteration')}, {seconds:.1f} s).")
    if detection.point_group != "C4v" or len(detection.planes) != PLANES:
        print(f"Expected C4v with {PLANES} planes: something is wrong.", file=sys.stderr)
        return 1
    print("\n".join(comparison(detection, truth)))
    write_results(detection, shape, out)
    print("\n".join(directions(out)))
    return 0


def make(rng: np.random.Generator) -> tuple[Array, Truth]:
    """The cloud, and where its symmetries are."""
    points = sample(table(), POINTS, NOISE, rng)
    pose = Pose.random(rng)
    normals = mirror_normals("C4v") @ pose.turn.T
    return pose.of(points), Truth(normals=normals, axis=pose.turn[:, 2], middle=pose.of(np.array([0, 0, 0.4])))


def comparison(detection: Detection, truth: Truth) -> list[str]:
    """What was found against the truth."""
    first, axis = detection.history[0].state, detection.axes[0]
    rows = []
    for number, found in enumerate(detection.planes, start=1):
        before = min(first.planes, key=lambda p: line_angle_rad(p.normal, found.plane.normal))
        aside = abs(float(found.plane.signed_distance(truth.middle)))
        rows.append(
            (f"plane {number}", _error_deg(before, truth), _error_deg(found.plane, truth), aside, found.residual)
        )
    away = float(np.linalg.norm(np.cross(truth.middle - axis.axis.point, axis.axis.direction)))
    errors = [float(np.degrees(line_angle_rad(u, truth.axis))) for u in (first.frame[2], axis.axis.direction)]
    rows.append(("axis", *errors, away, axis.residual))
    return [
        "",
        "             angle to the true one       distance     95 % of the surface",
        "             at first      refined       to it        agrees within",
        *(
            f"  {name:<9}  {before:.3f} deg     {after:.3f} deg     {100 * aside / detection.diagonal:.3f} %      "
            f"{100 * residual.p95:.2f} %"
            for name, before, after, aside, residual in rows
        ),
        "  (in percent of the diagonal)",
    ]


def _error_deg(plane: Plane, truth: Truth) -> float:
    return float(np.degrees(min(line_angle_rad(plane.normal, n) for n in truth.normals)))


def write_ply(path: Path, points: Array) -> None:
    """A binary PLY of points, as exact as they are."""
    axes = "".join(f"property double {name}\n" for name in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}end_header\n"
    path.write_bytes(header.encode("ascii") + points.astype("<f8").tobytes())


def write_results(detection: Detection, shape: Shape, out: Path) -> None:
    """Numbers, picture, recording and page."""
    options = {"tolerance": detection.tolerance, "measure": shape.measure, "seed": 0}
    report = json_text(detection_record(detection, shape, options=options))
    (out / "report.json").write_text(report, encoding="utf-8")
    (out / "picture.png").write_bytes(picture_png(detection, shape))
    record(detection, shape, out / "recording.rrd")
    (out / "report.html").write_text(html_page(detection, shape), encoding="utf-8", newline="")


def directions(out: Path) -> list[str]:
    """How to look at the results."""
    command = Path(sys.executable).with_name("symrefine")
    name = command.relative_to(Path.cwd()) if command.is_relative_to(Path.cwd()) else command
    return [
        "",
        f"Written to {out}:",
        f"  report.html    open it in a browser: {(out / 'report.html').resolve().as_uri()}",
        f"  recording.rrd  every iteration in 3-D: {name} view {out / 'recording.rrd'}",
        "  picture.png    the table with its planes",
        "  report.json    all the numbers",
        f"  table.ply      the cloud; try: {name} detect {out / 'table.ply'}",
    ]


if __name__ == "__main__":
    sys.exit(main())
