"""Kill `batch` and `run` at random moments, start them again, and compare the rows with those of undisturbed ones.

    python -m experiments.studies.kills --times 50
    python -m experiments.studies.kills --cluster --tasks 1000

Each command is killed so many times with each executor by SIGKILL: its first process alone, whose others have to
notice, or all of its processes at once. Whatever was on disk then must be there at the end, each row once, and equal to
that of an undisturbed run in one process, times apart. With --cluster it is a cluster that is killed: three workers of
Dask, one after the other, and the scheduler once.
"""

import argparse
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from experiments.studies.pages import check, put
from symrefine.errors import InputError
from symrefine.study.tables import grid

EXECUTORS: Mapping[str, Sequence[str]] = {
    "one process": [],
    "two processes": ["--workers", "2"],
    "Dask, two workers": ["--dask", "local", "--workers", "2"],
}
COMMANDS = ("batch", "run")
ROOT = Path(__file__).resolve().parents[2]
# What differs between two runs that did the same.
_TIMES = {"timings"}
EXPERIMENT = """
import time
from dataclasses import dataclass

@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    seed: int

def run(case):
    time.sleep(0.1)
    return {"third": case.seed / 3}
"""


@dataclass(kw_only=True)
class Toll:
    """What came of killing a command with one executor."""

    command: str
    executor: str
    kills: int = 0
    finished: int = 0
    rows_lost: int = 0
    rows_doubled: int = 0
    rows_different: int = 0
    orphans: int = 0

    @property
    def is_clean(self) -> bool:
        """Whether nothing was lost, doubled, changed or left running."""
        return not (self.rows_lost or self.rows_doubled or self.rows_different or self.orphans)


class Cluster:
    """A scheduler of Dask and its workers, each a process, as somebody would start them on several machines."""

    def __init__(self, workers: int) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._count = workers
        self._scheduler, self._workers = self._start_scheduler(), self._start_workers()

    def kill_worker(self) -> None:
        """Kill the oldest worker, and start another one."""
        _end(self._workers.pop(0))
        self._workers.append(self._start_worker())

    def restart(self) -> None:
        """Kill the scheduler and the workers, which would end when they miss it, and start all anew."""
        for process in [self._scheduler, *self._workers]:
            _end(process)
        self._scheduler, self._workers = self._start_scheduler(), self._start_workers()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in [self._scheduler, *self._workers]:
            _end(process)

    def _start_scheduler(self) -> "subprocess.Popen[bytes]":
        return self._start("dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port), "--no-show")

    def _start_workers(self) -> "list[subprocess.Popen[bytes]]":
        return [self._start_worker() for _ in range(self._count)]

    def _start_worker(self) -> "subprocess.Popen[bytes]":
        return self._start("dask_worker", self.address, "--nthreads", "1", "--no-nanny")

    def _start(self, name: str, *options: str) -> "subprocess.Popen[bytes]":
        line = [sys.executable, "-m", f"distributed.cli.{name}", *options, "--no-dashboard"]
        return subprocess.Popen(line, env=_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.wait()


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))}


def lay_out(folder: Path, tasks: int) -> None:
    """Write so many small objects, and a study of as many runs."""
    (folder / "objects").mkdir()
    for number in range(tasks):
        rng = random.Random(number)
        corner = [rng.uniform(0.5, 2.0) for _ in range(3)]
        box = [
            [s * c for s, c in zip((x, y, z), corner, strict=True)] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)
        ]
        text = "".join(" ".join(map(repr, point)) + "\n" for point in box)
        (folder / "objects" / f"box{number:03d}.xyz").write_text(text)
    (folder / "thirds.py").write_text(EXPERIMENT)
    (folder / "thirds.yaml").write_text(f"experiment: thirds\nout: out/thirds\nsweep: {{seed: {{range: {tasks}}}}}\n")


def campaign(folder: Path, command: str, executor: str, times: int, seed: int = 0) -> Toll:
    """Kill a command so many times in a folder that was laid out, and see what is left.

    Args:
        command: "batch" or "run".
        executor: one of `EXECUTORS`.
        seed: of the moments.
    """
    rng = random.Random(f"{command} {executor} {seed}")
    toll = Toll(command=command, executor=executor)
    expected = _rows(_started(folder, command, [], f"{command}-whole"))
    seconds = _seconds(lambda: _started(folder, command, EXECUTORS[executor], f"{command}-{executor}-timed"))
    while toll.kills < times:
        out, before = f"{command}-{executor}-{toll.finished}", list[str]()
        while True:
            process = _popen(folder, command, EXECUTORS[executor], out)
            try:
                process.wait(rng.uniform(0.0, 1.2 * seconds) if toll.kills < times else None)
                break
            except subprocess.TimeoutExpired:
                toll.kills += 1
                toll.orphans += _kill(process, everybody=rng.random() < 0.5)
            before = _lines(_file(folder, command, out))
        toll.finished += 1
        _compare(toll, before, _file(folder, command, out), expected)
    return toll


def cluster_campaign(folder: Path, tasks: int) -> Toll:
    """Kill three workers of a cluster while it does a batch, and its scheduler once, at even shares of the work."""
    toll = Toll(command="batch", executor="Dask, three workers of a cluster")
    expected = _rows(_started(folder, "batch", [], "whole"))
    with Cluster(3) as cluster:
        file, process = folder / "far.jsonl", _popen(folder, "batch", ["--dask", cluster.address], "far")
        for share, strike in enumerate((cluster.kill_worker, cluster.restart, *[cluster.kill_worker] * 2), start=1):
            while len(_lines(file)) < tasks * share / 5 and process.poll() is None:
                time.sleep(0.1)
            before = _lines(file)
            strike()
            toll.kills += 1
        toll.finished += process.wait() == 0
    _compare(toll, before, file, expected)
    return toll


def _compare(toll: Toll, before: Sequence[str], file: Path, expected: Mapping[str, Any]) -> None:
    after, rows = _lines(file), _rows(file)
    toll.rows_lost += sum(line not in after for line in before) + len(set(expected) - set(rows))
    toll.rows_doubled += len(after) - len(rows)
    toll.rows_different += sum(rows[name] != row for name, row in expected.items() if name in rows)


def _popen(folder: Path, command: str, options: Sequence[str], out: str) -> "subprocess.Popen[bytes]":
    what = ["objects", "--out", f"{out}.jsonl"] if command == "batch" else ["thirds.yaml", "--out", out]
    line = [sys.executable, "-m", "symrefine", command, *what, "--quiet", *options]
    return subprocess.Popen(line, cwd=folder, env=_environment(), start_new_session=True, stderr=subprocess.DEVNULL)


def _started(folder: Path, command: str, options: Sequence[str], out: str) -> Path:
    """The rows of a run that nobody disturbs."""
    if _popen(folder, command, options, out).wait() != 0:
        raise SystemExit(f"symrefine {command} fails undisturbed, too")
    return _file(folder, command, out)


def _file(folder: Path, command: str, out: str) -> Path:
    return folder / f"{out}.jsonl" if command == "batch" else folder / out / "journal.jsonl"


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _kill(process: "subprocess.Popen[bytes]", *, everybody: bool) -> int:
    """Kill a process, or all that it started too; 1 if some of them still run ten seconds later."""
    (os.killpg if everybody else os.kill)(process.pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return 0
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    return 1


def _lines(file: Path) -> list[str]:
    """The whole rows of a file as they stand."""
    text = file.read_text() if file.is_file() else ""
    return text[: text.rfind("\n") + 1].splitlines()


def _rows(file: Path) -> dict[str, Any]:
    """The rows by what they are of, times apart."""
    rows = [json.loads(line) for line in _lines(file)]
    return {str(row.get("file", row.get("index"))): {k: v for k, v in row.items() if k not in _TIMES} for row in rows}


def main(argv: Sequence[str] | None = None) -> int:
    """Kill, print the table, 1 if anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=50, help="kills of each command with each executor (default: 50)")
    parser.add_argument("--tasks", type=int, default=24, help="objects, and runs of the study (default: 24)")
    parser.add_argument("--cluster", action="store_true", help="kill processes of a cluster instead")
    parser.add_argument("--seed", type=int, default=0, help="of the moments (default: 0)")
    parser.add_argument(
        "--page", type=Path, help="put the table into this page, between the markers `kills`, or `cluster`"
    )
    options = parser.parse_args(argv)
    study = "cluster" if options.cluster else "kills"
    if options.page is not None:
        check(options.page, study)
    tolls = []
    with tempfile.TemporaryDirectory(prefix="symrefine-kills-") as name:
        lay_out(Path(name), options.tasks)
        if options.cluster:
            tolls.append(cluster_campaign(Path(name), options.tasks))
        for command in () if options.cluster else COMMANDS:
            for executor in EXECUTORS:
                tolls.append(campaign(Path(name), command, executor, options.times, options.seed))
                print(tolls[-1], file=sys.stderr, flush=True)
    columns = [column.replace("_", " ") for column in asdict(tolls[0])]
    table = grid(columns, [[str(value) for value in asdict(toll).values()] for toll in tolls])
    print(table, end="")
    if options.page is not None:
        put(options.page, study, table)
    return int(not all(toll.is_clean for toll in tolls))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(f"kills: {error}")
