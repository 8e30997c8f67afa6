"""How cost grows: points, planes, fold, faces and atoms, each with the exponent of a power law, and peers beside it.

`python -m benchmarks.growth [--full]` prints the tables and draws `out/bench/growth.png`. Processor time over all
threads, the least of two runs; of peers that are not installed the row says so. `--full` adds what takes minutes.
"""

import argparse
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.detection import best_of
from benchmarks.metric import Metric
from experiments.ecins.method import ecins
from experiments.ecins.settings import TUNED
from experiments.objects.constructions import polygon
from experiments.objects.parts import extruded
from experiments.objects.poses import Pose
from experiments.objects.shapes import mug, oriented_sample, sample, stool, table
from experiments.peers.pymatgen_groups import point_group_pymatgen
from experiments.peers.trimesh_inertia import trimesh_symmetry
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.files import whole
from symrefine.geometry import Array
from symrefine.load.stream import stream
from symrefine.shape import Shape

PICTURE = Path("out/bench/growth.png")
POINTS, NOISE_REL, REPEATS = 20_000, 0.003, 2
# A run that takes longer ends its row: what comes after it would take longer still.
PATIENCE_S = 20.0
# Points of the two clouds whose memory is measured, and the budgets, in MB.
IN_CHUNKS = {5_000_000: 400.0, 100_000_000: 2048.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What one method takes as one quantity grows: sizes and seconds, or why there are none."""

    sweep: str
    method: str
    sizes: tuple[float, ...] = ()
    seconds: tuple[float, ...] = ()
    missing: str = ""

    @property
    def exponent(self) -> float:
        """Slope of the line through the logarithms; NaN of fewer than three sizes."""
        if len(self.sizes) < 3:
            return math.nan
        return float(np.polyfit(np.log(self.sizes), np.log(self.seconds), 1)[0])

    def __str__(self) -> str:
        told = "  ".join(f"{size:.4g}: {s:.3g} s" for size, s in zip(self.sizes, self.seconds, strict=True))
        exponent = "" if math.isnan(self.exponent) else f"  exponent {self.exponent:.2f}"
        return f"    {self.sweep:7s} {self.method:17s} {told}{exponent}{self.missing}"


# A method makes its input from a size, outside of the time that counts, and gives what is timed.
Method = Callable[[int], Callable[[], object]]


def measured(sweep: str, method: str, sizes: Sequence[int], prepare: Method) -> Row:
    """The row of one method, as far as it is installed and patience lasts."""
    seconds: list[float] = []
    for size in sizes:
        try:
            seconds.append(best_of(prepare(size), REPEATS))
        except InputError as error:
            if "not installed" not in str(error):
                raise
            return Row(sweep=sweep, method=method, missing="not installed")
        if seconds[-1] > PATIENCE_S:
            break
    return Row(sweep=sweep, method=method, sizes=tuple(sizes[: len(seconds)]), seconds=tuple(seconds))


def _posed(mesh: Shape, count: int) -> Array:
    rng = np.random.default_rng(11)
    return Pose.random(rng).of(sample(mesh, count, NOISE_REL, rng))


def _cloud(build: Callable[[int], Shape]) -> Method:
    """Detection in a cloud of an object that a number makes."""

    def prepare(size: int) -> Callable[[], object]:
        points = _posed(build(size), POINTS)
        return lambda: detect(points)

    return prepare


def _points(count: int) -> Callable[[], object]:
    cloud = _posed(table(), count)
    return lambda: detect(cloud)


def _kd_pass(count: int) -> Callable[[], object]:
    cloud = _posed(table(), count)
    return lambda: cKDTree(cloud).query(cloud)


def _ecins(count: int) -> Callable[[], object]:
    points, normals = oriented_sample(table(), count, NOISE_REL, np.random.default_rng(11))
    return lambda: ecins(points, normals, settings=TUNED)


def _with_planes(count: int) -> Shape:
    return mug() if count == 1 else stool(count)


def _star(fold: int) -> Shape:
    """A prism over a star: its points tell the fold, however large it is."""
    part = extruded(np.tile([1.0, 0.7], fold)[:, None] * polygon(2 * fold), -0.4, 0.4)
    return Shape(part.vertices, part.faces)


def _mesh(faces: int) -> Shape:
    """A table whose triangles are split in four until there are about so many of them."""
    mesh = table()
    points, triangles = mesh.points, mesh.faces
    assert triangles is not None
    while 2 * len(triangles) < faces:
        corners = points[triangles]
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        start = len(points) + 3 * np.arange(len(triangles))[:, None] + np.arange(3)
        points = np.concatenate([points, middles.reshape(-1, 3)])
        a, b, c = triangles.T
        ab, bc, ca = start.T
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return Shape(points, triangles)


def _faces(count: int) -> Callable[[], object]:
    mesh = _mesh(count)
    return lambda: detect(mesh)


def _trimesh(count: int) -> Callable[[], object]:
    mesh = _mesh(count)
    return lambda: trimesh_symmetry(mesh)


def _rings(count: int) -> Array:
    """Atoms in two rings, one above the other."""
    ring = np.column_stack([polygon(count // 2), np.zeros(count // 2)])
    return np.concatenate([ring, ring + [0.0, 0.0, 0.7]])


def _atoms(count: int) -> Callable[[], object]:
    points = _rings(count)
    return lambda: detect(points)


def _pymatgen(count: int) -> Callable[[], object]:
    points = _rings(count)
    return lambda: point_group_pymatgen(["C"] * count, points, 0.02)


def sweeps(*, full: bool) -> Iterator[Row]:
    """Every row; `full` goes to the ends that the budgets are told for."""
    points = [10**3, 3 * 10**3, 10**4, 3 * 10**4, 10**5, 3 * 10**5, 10**6, *([10**7] if full else [])]
    yield measured("points", "symrefine", points, _points)
    yield measured("points", "kd-tree pass", points[: None if full else -1], _kd_pass)
    yield measured("points", "Ecins, tuned", points[:5] if full else points[:3], _ecins)
    yield measured("planes", "symrefine", [1, 3, 4, 6, 8, 12, 24], _cloud(_with_planes))
    yield measured("fold", "symrefine", [3, 6, 12, 24, 36, 60], _cloud(_star))
    faces = [10**2, 10**3, 10**4, 10**5, *([10**6] if full else [])]
    yield measured("faces", "symrefine", faces, _faces)
    yield measured("faces", "trimesh symmetry", faces, _trimesh)
    atoms = [12, 24, 60, 120, 240]
    yield measured("atoms", "symrefine", atoms, _atoms)
    yield measured("atoms", "pymatgen", atoms if full else atoms[:3], _pymatgen)


def drawn(rows: Sequence[Row], path: Path = PICTURE) -> None:
    """The rows on logarithmic axes, a field for each quantity, with the power laws that fit them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    names = list(dict.fromkeys(row.sweep for row in rows))
    figure = Figure(figsize=(4.2 * len(names), 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        for row in (r for r in rows if r.sweep == name and r.sizes):
            exponent = "" if math.isnan(row.exponent) else f" ~ n^{row.exponent:.2f}"
            line = axes.loglog(row.sizes, row.seconds, "o-", label=row.method + exponent)[0]
            if exponent:
                slope, start = np.polyfit(np.log(row.sizes), np.log(row.seconds), 1)
                axes.loglog(row.sizes, np.exp(start) * np.power(row.sizes, slope), ":", color=line.get_color())
        axes.set_xlabel(name)
        # Powers of ten where there are some, else the sizes themselves.
        sizes = sorted({size for r in rows if r.sweep == name for size in r.sizes})
        if sizes[-1] < 100 * sizes[0]:
            axes.set_xticks(sizes, labels=[f"{size:g}" for size in sizes])
            axes.minorticks_off()
        seconds = [s for r in rows if r.sweep == name for s in r.seconds]
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if max(seconds) < 100 * min(seconds) else (1,)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        axes.set_ylabel("processor time [s]" if name == names[0] else "")
        axes.grid(which="both", alpha=0.25)
        axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as draft:
        figure.savefig(draft, dpi=130)


def over_tree(count: int = 10**6) -> float:
    """Time of a detection over that of a tree over all points and 20,000 queries."""
    cloud = _posed(table(), count)
    return best_of(lambda: detect(cloud), REPEATS) / best_of(lambda: cKDTree(cloud).query(cloud[:20_000]), REPEATS)


def in_chunks(count: int) -> tuple[float, float]:
    """Processor seconds, those of imports included, and MB at most, of the command on a file of so many points."""
    with tempfile.TemporaryDirectory(prefix="symrefine-bench-") as folder:
        file = Path(folder, "table.npy")
        points = np.lib.format.open_memmap(file, mode="w+", dtype=np.float32, shape=(count, 3))
        for start in range(0, count, 10**6):
            rows = min(10**6, count - start)
            points[start : start + rows] = sample(table(), rows, NOISE_REL, np.random.default_rng(start))
        points.flush()
        del points
        assert stream(file).count == count
        program = (
            "import atexit, sys, time; from symrefine.cli import main; status = open('/proc/self/status')\n"
            "told = lambda: [time.process_time(), *(s.split()[1] for s in status if s.startswith('VmHWM'))]\n"
            "atexit.register(lambda: print(*told(), file=sys.stderr)); sys.exit(main())"
        )
        command = [sys.executable, "-c", program, "detect", str(file), "-q"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds, kilobytes = done.stderr.split()
        return float(seconds), float(kilobytes) / 1024.0


def metrics(*, full: bool = False) -> Iterator[Metric]:
    """The tables, the picture, and the figures that are compared with stored ones."""
    print("how cost grows: seconds of processor time")
    rows = []
    for row in sweeps(full=full):
        print(row, flush=True)
        rows.append(row)
    drawn(rows)
    print(f"    drawn in {PICTURE}\n")
    for row in rows:
        if row.method == "symrefine" and not math.isnan(row.exponent):
            yield Metric(key=f"growth with {row.sweep}", value=row.exponent, unit="exponent", target=0.75)
    yield Metric(key="1,000,000 points over tree and 20,000 queries", value=over_tree(), unit="ratio", target=1.0)
    for count, most in IN_CHUNKS.items() if Path("/proc/self/status").exists() else ():
        if count < 10**7 or full:
            seconds, megabytes = in_chunks(count)
            budget = 6.0 * count / 5_000_000
            yield Metric(key=f"the command on {count:,} points", value=seconds, unit="s", target=budget)
            yield Metric(key=f"its memory on {count:,} points", value=megabytes, unit="MB", target=most, rel_tol=0.1)


def main() -> None:
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="to 10,000,000 points and 1,000,000 faces, peers too")
    for metric in metrics(full=parser.parse_args().full):
        print(f"    {metric.key}: {metric.value:.3g} {metric.unit}, target {metric.target:g}")


if __name__ == "__main__":
    main()
