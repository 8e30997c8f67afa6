"""Cases run one after the other or in several processes; what goes wrong with one does not end the others."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from symrefine.errors import SymrefineError
from symrefine.study.experiment import Experiment, load_experiment
from symrefine.study.journal import Entry
from symrefine.study.versions import LIBRARIES

P = TypeVar("P")
R = TypeVar("R")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
TIMING = "_s"
WALL = "wall_s"
# What the runner adds to every row.
OWN_COLUMNS = ("config", "code", *LIBRARIES, "error")

# Place in the sweep and the case.
Job = tuple[int, Any]
# Module, its root, place in the sweep, fields of the case: what a process can be sent.
_Parcel = tuple[str, str, int, dict[str, Any]]


def one_thread_each() -> None:
    """Keep the libraries loaded from here on to one thread, so that sums do not depend on the number of cores."""
    for name in THREADS:
        os.environ[name] = "1"


def finish(experiment: Experiment, jobs: Sequence[Job], workers: int) -> Iterator[Entry]:
    """The entry of each job, as soon as it is done.

    Raises:
        SymrefineError: a process died.
    """
    if workers == 1 or len(jobs) < 2:
        yield from (attempt(experiment, index, case) for index, case in jobs)
        return
    parcels = [(experiment.name, str(experiment.root), index, asdict(case)) for index, case in jobs]
    yield from in_processes(_unpack, parcels, workers)


def in_processes(work: Callable[[P], R], parcels: Sequence[P], workers: int) -> Iterator[R]:
    """What `work` makes of each parcel, as soon as it is done, in this process or in several of one thread.

    Raises:
        SymrefineError: a process died.
    """
    if workers == 1 or len(parcels) < 2:
        yield from map(work, parcels)
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    one_thread_each()
    pool = ProcessPoolExecutor(min(workers, len(parcels)), get_context("spawn"), _start_worker)
    try:
        for done in as_completed([pool.submit(work, parcel) for parcel in parcels]):
            yield done.result()
    except BrokenProcessPool:
        raise SymrefineError(
            "a worker process died, perhaps out of memory; finished rows are kept, run it again"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _start_worker() -> None:
    """Make a worker end with an interrupt, and with the process that started it."""
    import signal
    import threading
    import warnings
    from multiprocessing import parent_process

    warnings.simplefilter("ignore")
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = parent_process()
    if parent is None:
        return

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _unpack(parcel: _Parcel) -> Entry:
    name, root, index, fields = parcel
    experiment = load_experiment(name, Path(root))
    return attempt(experiment, index, experiment.case(**fields))


def attempt(experiment: Experiment, index: int, case: Any) -> Entry:
    """Run a case; its results and timings, or its error."""
    start = perf_counter()
    row: Mapping[str, Any] = {}
    error = None
    try:
        row = {name: _plain(name, value) for name, value in experiment.run(case).items()}
        if taken := sorted({*experiment.hints, *OWN_COLUMNS} & set(row)):
            raise TypeError(f"the result {taken[0]!r} is named like another column")
    except SymrefineError as caught:
        error = " ".join(str(caught).split())
    except MemoryError:
        raise
    except Exception as caught:  # noqa: BLE001 - one run must not end the others
        error = " ".join(f"internal error: {type(caught).__name__}: {caught}".split())
    timings = {name: row[name] for name in row if name.endswith(TIMING) or name in experiment.measured}
    return Entry(
        index=index,
        error=error,
        results={name: value for name, value in row.items() if name not in timings},
        timings=timings | {WALL: perf_counter() - start},
    )


def _plain(name: str, value: Any) -> Any:
    """A result as a plain scalar; a number that is not finite means that there is none."""
    value = value.item() if hasattr(value, "item") else value
    if value is not None and not isinstance(value, int | float | str | bool):
        raise TypeError(f"result {name!r} is of type {type(value).__name__}, not a plain number, text or truth value")
    return None if isinstance(value, float) and math.isnan(value) else value
