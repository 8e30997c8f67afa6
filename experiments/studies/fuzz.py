"""A standing campaign against all that reads what others wrote: `make fuzz`.

Sound files of every format are damaged (`fuzz_cases`, `fuzz_mutations`), and read again. To be read, or to be refused
with an `InputError`, is right. Anything else is a finding: another exception, more than `LONGEST_S`, more than
`MOST_MIB`, or the end of the process, which native code can bring about and which is why each worker is one. Findings
are made small and written to out/fuzz/; once mended, they stay in tests/fuzzed/ and are read by every test run.
"""

import argparse
import contextlib
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import FrameType

from experiments.studies.fuzz_cases import TARGETS, TYPED, Case, attempt, case
from experiments.studies.fuzz_seeds import SUFFIXES, seeds
from experiments.studies.pages import check, put
from symrefine.errors import InputError, SymrefineError
from symrefine.load import apart

# Too long for a file of a few kilobytes, in seconds of the processor, and too much.
LONGEST_S, MOST_MIB = 5.0, 1024.0
# Seconds without a word after which a worker is taken for stuck in native code.
STUCK_S = 30.0
# Seconds to make a finding small.
SMALLER_S = 5.0
# Cases at a time, and how many of what takes longer.
CHUNK = 50
SHARES = {".step": 0.02, ".stp": 0.02, ".laz": 0.1, "config": 0.1, "--set": 0.2, "command line": 0.5, ".dae": 0.5}
# Files are written and read 100,000 times: in memory, where there is such a place.
FOLDER = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
OUT = Path("out/fuzz")


@dataclass(slots=True)
class Tally:
    """What became of the cases of one target."""

    cases: int = 0
    read: int = 0
    refused: int = 0
    worst_s: float = 0.0
    peak_mib: float = 0.0
    findings: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Take in what became of more of them."""
        self.cases, self.read, self.refused = (
            self.cases + other.cases,
            self.read + other.read,
            self.refused + other.refused,
        )
        self.worst_s, self.peak_mib = max(self.worst_s, other.worst_s), max(self.peak_mib, other.peak_mib)
        self.findings += other.findings


class TooLongError(BaseException):
    """The time of a case is over; no reader may catch it."""


def judged(one: Case, folder: Path) -> tuple[str, str]:
    """How a case ends, "read", "refused" or "finding", and what there is to say of it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            attempt(one, folder)
    except SymrefineError as error:
        told = str(error)
        # What somebody typed is told to him as it is; what stands in a file must be cut.
        sound = told.strip().isprintable() and (len(told) < 2000 or one.target in TYPED)
        return ("refused", "") if sound else ("finding", f"a refusal that is no one line: {told[:200]!a}")
    except TooLongError:
        return "finding", f"more than {LONGEST_S:g} s"
    except MemoryError as error:
        return "finding", f"MemoryError {error}"
    except Exception as error:  # noqa: BLE001 - that is what is looked for
        return "finding", f"{type(error).__name__} {_where(error)}: {str(error)[:120]!a}"
    return "read", ""


def _where(error: BaseException) -> str:
    """The last line of this project that an exception passed."""
    place, trace = "", error.__traceback__
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if "symrefine" in name and "site-packages" not in name:
            place = f"{Path(name).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place


def _over(_: int, __: FrameType | None) -> None:
    raise TooLongError


def _peak_kib(*, reset: bool = False) -> int:
    """The most memory that the process took since the last reset, where the system tells it."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
        return 0
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0])


def work(pipe: Connection, seed: int) -> None:
    """Judge the cases that come through a pipe, each told before it is begun, so that a crash has a name."""
    null = os.open(os.devnull, os.O_RDWR)
    for number in (1, 2):
        os.dup2(null, number)  # native code complains there
    signal.signal(signal.SIGPROF, _over)
    # Other programs work there, and are given up by the readers themselves.
    apart.LONGEST_S = LONGEST_S - 1.0
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=FOLDER) as name:
        folder = Path(name)
        for suffix in SUFFIXES:  # what libraries take for themselves is no case's fault
            for k, data in enumerate(seeds(suffix)):
                judged(Case(suffix, 4 * k, f"a{suffix}", data), folder)
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + 3 * 2**30,) * 2)
        pipe.send("ready")
        while (job := pipe.recv()) is not None:
            target, numbers = job
            tally = Tally()
            for number in numbers:
                pipe.send(number)
                _judge(case(seed, target, number), folder, tally)
            pipe.send(tally)


def _judge(one: Case, folder: Path, tally: Tally) -> None:
    _peak_kib(reset=True)
    before, begun = _peak_kib(), time.process_time()
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        end, told = judged(one, folder)
    except TooLongError:
        end, told = "finding", f"more than {LONGEST_S:g} s"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    seconds, peak = time.process_time() - begun, (_peak_kib() - before) / 1024
    if end != "finding" and peak > MOST_MIB:
        end, told = "finding", f"{peak:.0f} MiB"
    tally.cases, tally.read = tally.cases + 1, tally.read + (end == "read")
    tally.refused, tally.worst_s = tally.refused + (end == "refused"), max(tally.worst_s, seconds)
    tally.peak_mib = max(tally.peak_mib, peak)
    if end == "finding":
        if seconds < 0.1:
            one = smaller(one, told, folder)
        tally.findings.append(told)
        keep(one, told)


def smaller(one: Case, told: str, folder: Path) -> Case:
    """The case without all that its finding does not need."""
    data, size, end = one.data, len(one.data) // 2, time.monotonic() + SMALLER_S
    while size and one.name and time.monotonic() < end:
        at = 0
        while at < len(data) and time.monotonic() < end:
            less = Case(one.target, one.number, one.name, data[:at] + data[at + size :])
            if judged(less, folder) == ("finding", told):
                data = less.data
            else:
                at += size
        size //= 2
    return Case(one.target, one.number, one.name, data)


def keep(one: Case, told: str) -> Path:
    """Write a finding where it can be looked at: named by what it ends in, so that there is one of each kind."""
    kind = zlib.crc32(told.partition(": ")[0].encode())
    name = f"{one.target.strip('.-').replace(' ', '-')}-{kind:08x}{Path(one.name).name.removeprefix('a')}"
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / name).write_bytes(one.data)
    return OUT / name


class Worker:
    """A process that judges cases, and is begun again where it died."""

    def __init__(self, seed: int) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, seed), daemon=True)
        self.process.start()
        theirs.close()
        self.target, self.left, self.current, self.heard = "", [0], -1, time.monotonic() + 60.0

    def give(self, job: tuple[str, list[int]] | None) -> None:
        """Give it cases, or none any more."""
        self.pipe.send(job)
        if job is not None:
            self.target, self.left, self.heard = job[0], list(job[1]), time.monotonic()


def campaign(plan: dict[str, int], seed: int, jobs: int) -> Iterator[tuple[str, Tally]]:
    """What becomes of so many cases of each target, part by part."""
    parts = ((target, at, min(at + CHUNK, count)) for target, count in plan.items() for at in range(0, count, CHUNK))
    todo = [(target, list(range(start, end))) for target, start, end in parts][::-1]
    workers = [Worker(seed) for _ in range(jobs)]
    while workers:
        ready = wait([worker.pipe for worker in workers], timeout=1.0)
        for worker in list(workers):
            if worker.pipe in ready:
                try:
                    said = worker.pipe.recv()
                except EOFError:
                    yield from _lost(worker, workers, todo, seed, "the process died")
                    continue
                worker.heard = time.monotonic()
                if isinstance(said, int):
                    worker.current = said
                    continue
                if isinstance(said, Tally):
                    yield worker.target, said
                if todo:
                    worker.give(todo.pop())
                else:
                    worker.give(None)
                    workers.remove(worker)
            elif time.monotonic() - worker.heard > STUCK_S:
                worker.process.kill()
                yield from _lost(worker, workers, todo, seed, f"stuck for {STUCK_S:g} s")


def _lost(
    worker: Worker, workers: list[Worker], todo: list[tuple[str, list[int]]], seed: int, why: str
) -> Iterator[tuple[str, Tally]]:
    """A finding for the case that ended a worker, and another worker for all others that it had."""
    worker.process.join()
    workers.remove(worker)
    if worker.current < 0:
        raise SystemExit("a worker died before its first case")
    told = f"{why}, status {worker.process.exitcode}, case {worker.current}"
    keep(case(seed, worker.target, worker.current), why)
    yield worker.target, Tally(cases=1, findings=[told], worst_s=STUCK_S if "stuck" in why else 0.0)
    todo.append((worker.target, [number for number in worker.left if number != worker.current]))
    workers.append(Worker(seed))


def plan(cases: int, targets: Sequence[str]) -> dict[str, int]:
    """How many cases of each target; few of those that take longer, as another program is started, or YAML is read."""
    shares = {target: SHARES.get(target, 1.0) for target in targets}
    each = cases / sum(shares.values())
    counts = {target: max(1, int(each * share)) for target, share in shares.items()}
    counts[targets[0]] += max(cases - sum(counts.values()), 0)
    return counts


def table(tallies: dict[str, Tally]) -> str:
    """A row for each target, and their sum."""
    whole = Tally()
    for tally in tallies.values():
        whole.add(tally)
    titles = ["read as", "cases", "read", "refused", "findings", "slowest, s", "most memory, MiB"]
    rows = [titles, ["---"] * len(titles)]
    for name, t in [*sorted(tallies.items()), ("all", whole)]:
        counts = [f"{count:,}" for count in (t.cases, t.read, t.refused, len(t.findings))]
        rows.append([name, *counts, f"{t.worst_s:.2f}", f"{t.peak_mib:.0f}"])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign, print its table and its findings."""
    parser = argparse.ArgumentParser(prog="python -m experiments.studies.fuzz", description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=100_000, help="all together (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="other seeds, other cases (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=TARGETS, metavar="WHAT", help="some of the formats, such as .ply")
    parser.add_argument("--page", type=Path, help="put the table into this page, between the markers `fuzz`")
    args = parser.parse_args(argv)
    if args.page is not None:
        check(args.page, "fuzz")
    begun = time.perf_counter()
    counts = plan(args.cases, args.only or TARGETS)
    tallies = {target: Tally() for target in counts}
    with contextlib.suppress(KeyboardInterrupt):  # what is done until then counts
        for target, tally in campaign(counts, args.seed, args.jobs):
            tallies[target].add(tally)
            if sys.stderr.isatty():
                print(f"\r{sum(t.cases for t in tallies.values()):,} cases", end="", file=sys.stderr, flush=True)
    seconds = time.perf_counter() - begun
    rate = sum(tally.cases for tally in tallies.values()) / seconds
    how = f"Seed {args.seed}, {args.jobs} processes, {seconds:.0f} s, {rate:.0f} cases a second."
    told = f"{table(tallies)}\n\n{how}"
    print(told)
    if args.page is not None and all(tallies[target].cases == count for target, count in counts.items()):
        put(args.page, "fuzz", told)
    for target, tally in tallies.items():
        for told, count in Counter(tally.findings).most_common():
            print(f"finding: {target}: {count} x {told}")
    return int(any(tally.findings for tally in tallies.values()))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(f"fuzz: {error}")
