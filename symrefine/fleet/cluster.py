"""Tasks on a Dask cluster: its workers may die and its scheduler may be started anew, the tasks go on."""

import re
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.errors import InputError
from symrefine.fleet.crew import Cells, Tell, is_worth_another
from symrefine.fleet.limits import Limits, Lost
from symrefine.fleet.tasks import our_version

if TYPE_CHECKING:
    from distributed import Client, Future

LOCAL = "local"
# Processes of the cluster that die while they hold a task before it is taken to be the cause.
_DEATHS = 5
# A task that the cluster gave up, as its worker died with it too often.
_DIED = object()
# What a scheduler may take to answer at first.
_ANSWER_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Dask:
    """Tasks on a cluster of Dask; each worker of it does them in processes of its own, within the limits.

    Attributes:
        address: of its scheduler, tcp://host:port; or "local" for one on this machine.
        workers: how many a local one has.
        tell: what to call with a sentence on what goes wrong meanwhile.
        patience: seconds to wait for a scheduler that went away.
    """

    address: str
    workers: int = 1
    limits: Limits = field(default_factory=Limits)
    tell: Tell = lambda _: None
    patience: float = 120.0

    def do(self, work: Callable[[Any], Any], parcels: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As of every `Executor`.

        Raises:
            InputError: distributed is not installed, there is no scheduler at the address, or it went away for good.
        """
        check_address(self.address)
        waiting, deaths, patience = set(range(len(parcels))), Counter[int](), _ANSWER_S
        with _local(self.workers) if parcels and self.address == LOCAL else nullcontext(self.address) as address:
            while waiting:
                with closing(_client(address, patience)) as client:
                    for index, outcome in self._answers(client, work, parcels, sorted(waiting)):
                        if isinstance(outcome, _Raised):
                            raise outcome.error
                        deaths[index] += outcome is _DIED
                        if outcome is _DIED and deaths[index] < _DEATHS:
                            continue  # among those that wait for the next round
                        waiting.discard(index)
                        lost = Lost(why=f"{_DEATHS} processes of the cluster died with it")
                        yield index, (lost if outcome is _DIED else outcome)
                patience = self.patience
                if waiting:
                    self.tell(f"{address}: {len(waiting)} tasks have no result yet; connecting to the scheduler anew")

    def _answers(
        self, client: "Client", work: Callable[[Any], Any], parcels: Sequence[Any], indices: Sequence[int]
    ) -> Iterator[tuple[int, Any]]:
        """The outcomes of tasks as they come in, `_DIED` of one that the cluster gave up."""
        from distributed import KilledWorker, as_completed

        with _until_it_is_gone():
            self._check_workers(client)
            futures: dict[Future[Any], int] = {
                client.submit(_on_a_worker, work, parcels[index], self.limits, str(Path.cwd()), pure=False): index
                for index in indices
            }
            for future in as_completed(futures, loop=client.loop):
                try:
                    outcome = future.result()
                except KilledWorker:
                    outcome = _DIED
                yield futures.pop(future), outcome

    def _check_workers(self, client: "Client") -> None:
        """Refuse workers that would do something else; say where there are none."""
        try:
            versions = client.run(our_version)
        except ImportError:
            raise InputError(f"{self.address}: its workers have no symrefine; install it there, too") from None
        if not versions:
            self.tell(f"{self.address}: has no workers yet; start some with `dask worker {self.address}`")
        if other := sorted(set(versions.values()) - {our_version()}):
            raise InputError(f"{self.address}: its workers have symrefine {other[0]}, here it is {our_version()}")


@contextmanager
def _until_it_is_gone() -> Iterator[None]:
    """End a round early, and in silence, where the scheduler goes away."""
    import logging

    from distributed.client import FutureCancelledError

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    with suppress(FutureCancelledError, OSError):  # a connection that was closed raises one of these
        yield


@dataclass(frozen=True, slots=True)
class _Raised:
    """What `work` raised, apart from what the cluster does."""

    error: Exception


def _on_a_worker(work: Callable[[Any], Any], parcel: Any, limits: Limits, folder: str) -> Any:
    """What a worker of the cluster does: a process of its own does the task, so that a crash ends no worker."""
    cells = _CELLS.setdefault((limits, folder), Cells(limits, folder))
    try:
        outcome = cells.do(work, parcel)
        return cells.do(work, parcel) if is_worth_another(outcome) else outcome
    except Exception as error:  # noqa: BLE001 - raised again where it was asked for
        return _Raised(error)


# Of a worker of the cluster, kept from task to task.
_CELLS: dict[tuple[Limits, str], Cells] = {}


def check_address(address: str) -> None:
    """Refuse what is no address, or a cluster where nothing for one is installed.

    Raises:
        InputError: naming what would be right.
    """
    if address != LOCAL and not re.fullmatch(r"(tcp|tls|ws|wss|ucx)://[^\s/]+:[0-9]+", address):
        raise InputError(f"{address}: is no address of a Dask scheduler; expected tcp://host:port or `local`")
    from importlib.util import find_spec

    if find_spec("distributed") is None:
        raise InputError('a Dask cluster needs distributed: pip install "symrefine[dask]"')


@contextmanager
def _local(workers: int) -> Iterator[str]:
    """A cluster of processes on this machine, which end with it in silence, even at an interrupt from the keyboard."""
    from distributed import LocalCluster

    with _deaf_children():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",  # any free port: there may be other clusters here
            silence_logs="CRITICAL",
        )
    with cluster:
        yield cluster.scheduler_address


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes started meanwhile hear no interrupt from the keyboard; who started them does, and ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _client(address: str, patience: float) -> "Client":
    """A connection to a scheduler, as soon as there is one.

    Raises:
        InputError: there is none.
    """
    from distributed import Client

    deadline = time.monotonic() + patience
    while True:
        try:
            return Client(address, timeout=_ANSWER_S, set_as_default=False)
        except (OSError, ValueError) as error:
            if isinstance(error, ValueError) or time.monotonic() > deadline:
                raise InputError(
                    f"{address}: no scheduler of Dask answers there; start one with `dask scheduler`"
                ) from None
            time.sleep(0.5)
