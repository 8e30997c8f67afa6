"""What people wait for: the command on a box, meshes of `../shared/objects`, small noisy clouds, the staircase."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.detection import best_of
from benchmarks.metric import Metric
from experiments.objects.constructions import polygon
from experiments.objects.parts import extruded
from experiments.objects.shapes import sample, table
from symrefine.detection.story import LADDER, detect
from symrefine.load import load
from symrefine.shape import Shape

OBJECTS = Path(__file__).resolve().parents[2] / "shared" / "objects"
SMALL, NOISY = (1500, 6400), (0.0, 0.005, 0.01)


def command() -> float:
    """Processor seconds of `symrefine detect` on a mesh of twelve triangles, imports and all."""
    program = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True)\n"
    program += "u = resource.getrusage(resource.RUSAGE_CHILDREN); print(u.ru_utime + u.ru_stime)"
    box = Path("out/bench/box.off")
    box.parent.mkdir(parents=True, exist_ok=True)
    part = extruded(polygon(4), -0.3, 0.5)
    rows = [" ".join(map(str, p)) for p in part.vertices.tolist()]
    rows += ["3 " + " ".join(map(str, f)) for f in part.faces.tolist()]
    box.write_text("\n".join(["OFF", f"{len(part.vertices)} {len(part.faces)} 0", *rows]) + "\n")
    line = [sys.executable, "-c", program, sys.executable, "-m", "symrefine", "detect", str(box)]
    return min(float(subprocess.run(line, capture_output=True, text=True, check=True).stdout) for _ in range(3))


def bolts() -> Iterator[tuple[str, float]]:
    """Extruded shapes with an 8-fold axis, by few points, with noise or without."""
    part = extruded(polygon(8), -0.4, 0.4)
    prism = Shape(part.vertices, part.faces)
    for count in SMALL:
        for noise in NOISY:
            cloud = sample(prism, count, noise, np.random.default_rng(5))
            yield f"8-fold prism, {count:,} points, {100 * noise:g} % noise", best_of(lambda c=cloud: detect(c), 2)


def meshes(*, full: bool) -> list[Shape]:
    """The meshes of `../shared/objects`, every fourth unless `full`; none where they are not there."""
    return [load(file) for file in sorted(OBJECTS.glob("*.ply"))[:: 1 if full else 4]]


def seconds_of(shapes: list[Shape], *, ladder: tuple[float, ...] = ()) -> list[float]:
    """Processor seconds of `detect` on each."""
    return [best_of(lambda s=shape: detect(s, ladder=ladder), 1) for shape in shapes]


def metrics(*, full: bool = False) -> Iterator[Metric]:
    """The figures that are compared with stored ones."""
    yield Metric(key="the command on a box", value=command(), unit="s", target=1.2)
    for name, seconds in bolts():
        target = 0.3 if f"{SMALL[0]:,}" in name else 0.4
        yield Metric(key=name, value=seconds, unit="s", target=target)
    cloud = sample(table(), 20_000, 0.003, np.random.default_rng(5))
    ratio = best_of(lambda: detect(cloud, ladder=LADDER), 5) / best_of(lambda: detect(cloud), 5)
    yield Metric(key="with the staircase", value=ratio, unit="ratio", target=1.1)
    if shapes := meshes(full=full):
        seconds = seconds_of(shapes)
        yield Metric(key="meshes of shared/objects, median", value=float(np.median(seconds)), unit="s", target=0.2)
        yield Metric(key="meshes of shared/objects, worst", value=max(seconds), unit="s", target=0.8)
        ratio = sum(seconds_of(shapes, ladder=LADDER)) / sum(seconds)
        yield Metric(key="meshes of shared/objects, with the staircase", value=ratio, unit="ratio", target=1.1)
