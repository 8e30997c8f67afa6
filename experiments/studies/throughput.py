"""How many objects `batch` does in a second, by the number of workers, and that each number gives the same table.

    python -m experiments.studies.throughput                  # meshes of our own making
    python -m experiments.studies.throughput models/ --workers 1,2,4

The figure is that of the fastest of some runs, start included; on a machine that does something else only the
seconds of processors say anything: what more of them the same objects take with more workers is the cost of the fleet.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from experiments.objects.household import OBJECTS
from symrefine.shape import Shape
from symrefine.study.tables import grid

ROOT = Path(__file__).resolve().parents[2]


def write_off(shape: Shape, path: Path) -> None:
    """Write a mesh in the simplest of all formats."""
    faces = () if shape.faces is None else shape.faces
    lines = ["OFF", f"{len(shape.points)} {len(faces)} 0", *(" ".join(map(repr, p)) for p in shape.points.tolist())]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def seconds_of(folder: Path, workers: int, table: Path) -> tuple[float, float]:
    """What a batch of all objects in a folder takes, by the clock and of processors."""
    line = [sys.executable, "-m", "symrefine", "batch", str(folder), "--quiet"]
    start, busy = time.perf_counter(), _busy()
    done = subprocess.run(
        [*line, "--workers", str(workers), "--table", str(table)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode not in (0, 1):  # an object that cannot be used is no failure of the batch
        raise SystemExit(f"symrefine batch {folder} ends with status {done.returncode}")
    return time.perf_counter() - start, _busy() - busy


def _busy() -> float:
    """Seconds of processors that all ended processes took."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the table; 1 if the tables differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="directory of objects (default: the gallery's)")
    parser.add_argument("--workers", default="1,2", help="numbers of workers to compare (default: 1,2)")
    parser.add_argument("--copies", type=int, default=4, help="of the gallery, to outweigh the start (default: 4)")
    parser.add_argument("--repeat", type=int, default=2, help="runs of each, of which the fastest counts (default: 2)")
    options = parser.parse_args(argv)
    counts = [int(text) for text in options.workers.split(",")]
    with tempfile.TemporaryDirectory(prefix="symrefine-throughput-") as name:
        folder = options.folder or Path(name, "objects")
        if options.folder is None:
            folder.mkdir()
            for title, known in OBJECTS.items():
                for copy in range(options.copies):
                    write_off(known.build(), folder / f"{title.replace(' ', '_')}_{copy}.off")
        tables = {count: Path(name, f"{count}.csv") for count in counts}
        # One after the other in turn, so that all see the same machine.
        runs = [{count: seconds_of(folder, count, tables[count]) for count in counts} for _ in range(options.repeat)]
        seconds = {count: min(run[count] for run in runs) for count in counts}
        number = len(tables[counts[0]].read_text().splitlines()) - 1
        same = len({table.read_bytes() for table in tables.values()}) == 1
    first = seconds[counts[0]][0]
    lines = [
        [f"{count}", f"{clock:.1f}", f"{busy:.1f}", f"{number / clock:.2f}", f"{first / clock:.2f}"]
        for count, (clock, busy) in seconds.items()
    ]
    head = ["workers", "seconds", "seconds of processors", "objects per second", f"times that of {counts[0]}"]
    print(grid(head, lines), end="")
    print(f"{number} objects, {'the same table by all' if same else 'TABLES DIFFER'}; {os.cpu_count()} cores")
    return int(not same)


if __name__ == "__main__":
    raise SystemExit(main())
