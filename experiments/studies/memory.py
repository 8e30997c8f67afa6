"""How much memory `batch`, `merge`, `run` and `label` take by the number of rows, all of which were done before.

    python -m experiments.studies.memory --rows 200000 --page docs/fleets.md

Nothing is detected: there are so many links to one small object with so many rows of it, as if a fleet had been killed
when all but its table was written, the same rows in two parts, a study with as many runs as one may have, and a data
set to be labelled, of which half is settled.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from experiments.studies.pages import check, put
from symrefine.errors import InputError
from symrefine.fleet.rows import Row
from symrefine.fleet.shard import Shard, Whole
from symrefine.study.tables import grid

ROOT = Path(__file__).resolve().parents[2]
# The most runs that a study may have.
RUNS = 100_000
BOX = "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 2) for z in (0, 3))
CUBE = "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
EXPERIMENT = """
from dataclasses import dataclass

@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    seed: int

def run(case):
    return {"third": case.seed / 3, "odd": bool(case.seed % 2), "name": f"run {case.seed}"}
"""
STUDY = """
experiment: thirds
out: thirds
sweep: {{seed: {{range: {runs}}}}}
tables:
  - title: Thirds
    groups: []
    values: {{largest: max third, odd: tally odd}}
"""


def peak(folder: Path, *arguments: str) -> tuple[int, float]:
    """Bytes that a command holds at most, and the seconds that it takes.

    The system counts what this process holds as it begins, too, which therefore is little.
    """
    line = [sys.executable, "-m", "symrefine", *arguments, "--quiet"]
    start = time.perf_counter()
    process = subprocess.Popen(line, cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)})
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"symrefine {' '.join(arguments)} ends with status {process.returncode}")
    return used.ru_maxrss * 1024, time.perf_counter() - start


def lay_out(folder: Path, rows: int) -> None:
    """The objects and rows of a batch, its parts, a study of which all is done, and labels that nobody looked at."""
    (folder / "objects").mkdir()
    (folder / "box.xyz").write_text(BOX)
    names = [f"box{number:06d}.xyz" for number in range(rows)]
    for name in names:
        (folder / "objects" / name).symlink_to("../box.xyz")
    peak(folder, "batch", "box.xyz", "--out", "one.jsonl")
    row = json.loads((folder / "one.jsonl").read_text())
    _write(folder / "rows.jsonl", (row | {"file": name} for name in names))
    whole = Whole.of(rows, ["memory"])
    for number in (1, 2):
        shard = Shard(number=number, of=2)
        own = (i for i in range(rows) if shard.takes(i))
        _write(folder / f"part{number}.jsonl", (row | {"file": names[i]} | whole.mark(shard, i) for i in own))
    runs = min(rows, RUNS)
    (folder / "thirds.py").write_text(EXPERIMENT)
    (folder / "thirds.yaml").write_text(STUDY.format(runs=runs))
    peak(folder, "run", "thirds.yaml", "--limit", "1")
    row = json.loads((folder / "thirds" / "journal.jsonl").read_text())
    results = ({"third": i / 3, "odd": bool(i % 2), "name": f"run {i}"} for i in range(runs))
    _write(folder / "thirds" / "journal.jsonl", (row | {"index": i, "results": r} for i, r in enumerate(results)))
    _lay_out_labels(folder, rows)


def _lay_out_labels(folder: Path, objects: int) -> None:
    (folder / "models").mkdir()
    first = folder / "models" / "obj_000000.xyz"
    first.write_text(CUBE)
    peak(folder, "label", "models", "--out", "labels")
    row = json.loads((folder / "labels" / "objects.jsonl").read_text())
    names = [f"obj_{number:06d}" for number in range(objects)]
    pictures = [path.name.removeprefix(names[0]) for path in (folder / "labels" / "pictures").iterdir()]
    for name in names[1:]:
        (folder / "models" / f"{name}.xyz").symlink_to(first.name)
        for picture in pictures:
            (folder / "labels" / "pictures" / f"{name}{picture}").hardlink_to(
                folder / "labels" / "pictures" / f"{names[0]}{picture}"
            )
    own = ({"object": i, "file": f"{name}.xyz", "confidence": i % 10 / 10} for i, name in enumerate(names))
    _write(folder / "labels" / "objects.jsonl", (row | told for told in own))


def _write(path: Path, rows: Iterable[Row]) -> None:
    with path.open("w") as stream:
        stream.writelines(json.dumps(row) + "\n" for row in rows)


COMMANDS = {
    "batch --table rows.parquet": "batch objects --out rows.jsonl --table rows.parquet",
    "batch --table rows.csv": "batch objects --out rows.jsonl --table rows.csv",
    "merge --table all.parquet": "merge part1.jsonl part2.jsonl --out all.jsonl --table all.parquet",
    "run": "run thirds.yaml",
    "label": "label models --out labels --accept 0.5",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=200_000, help="the most (default: 200000); a hundredth beside it")
    parser.add_argument("--page", type=Path, help="put the table into this page, between the markers `memory`")
    options = parser.parse_args(argv)
    if options.page is not None:
        check(options.page, "memory")
    lines = []
    for rows in (options.rows // 100, options.rows):
        with tempfile.TemporaryDirectory(prefix="symrefine-memory-") as name:
            lay_out(Path(name), rows)
            for command, line in COMMANDS.items():
                size, seconds = peak(Path(name), *line.split())
                count = min(rows, RUNS) if command == "run" else rows
                lines.append([command, f"{count:,}", f"{size / 1e6:.0f}", f"{seconds:.0f}"])
                print(*lines[-1], sep="  ", file=sys.stderr, flush=True)
    table = grid(["command", "rows", "MB at most", "seconds"], lines)
    print(table, end="")
    if options.page is not None:
        put(options.page, "memory", table)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(f"memory: {error}")
