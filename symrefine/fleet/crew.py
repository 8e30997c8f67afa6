"""Tasks on this machine: in this process, or in several that are replaced when they die, of which fewer go on."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Protocol, Self

from symrefine.fleet.cell import Cell, out_of_memory
from symrefine.fleet.limits import Limits, Lost

Tell = Callable[[str], None]


class Executor(Protocol):
    """A way to do many tasks, within limits. Which one is taken changes nothing but the time and the order."""

    @property
    def limits(self) -> Limits:
        """What one task may take."""

    def do(self, work: Callable[[Any], Any], parcels: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """The index of each parcel with what `work` makes of it, or a `Lost`, as soon as it is done.

        Args:
            work: a function of a module, which another process can import.
            parcels: what it is called with, one after the other; they and what it returns can be pickled.

        Raises:
            Exception: what `work` raised.
        """


class Here:
    """All tasks in this process, one after the other, without limits."""

    limits = Limits()

    def do(self, work: Callable[[Any], Any], parcels: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As of every `Executor`."""
        for index, parcel in enumerate(parcels):
            try:
                outcome = work(parcel)
            except MemoryError:
                outcome = out_of_memory(None)
            yield index, outcome


HERE = Here()


class Cells:
    """Processes that are borrowed for one task each; those that are no longer fit are replaced.

    Args:
        limits: of each task.
        folder: where paths count from, if it is there.
    """

    def __init__(self, limits: Limits, folder: str = ".") -> None:
        self._limits, self._folder = limits, folder
        self._idle: list[Cell] = []
        self._busy: set[Cell] = set()
        self._over = False

    def do(self, work: Callable[[Any], Any], parcel: Any) -> Any:
        """What `work` makes of a parcel, or a `Lost`; may be called by several threads."""
        try:
            cell = self._idle.pop()
        except IndexError:
            cell = Cell(self._limits, self._folder)
        self._busy.add(cell)
        try:
            if self._over:
                return Lost(why="was not begun")
            return cell.do(work, parcel)
        finally:
            if cell.is_fit and not self._over:
                self._idle.append(cell)
            else:
                cell.end()
            self._busy.discard(cell)

    def rest(self, kept: int) -> None:
        """End those that are idle beyond a number."""
        while len(self._idle) > kept:
            self._idle.pop().end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._over = True
        for cell in [*self._busy]:
            cell.end()
        self.rest(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Processes:
    """Tasks in several processes of one thread each.

    A process that the system kills, most likely for want of memory, halves their number. Its task is tried once more,
    as the last one; so is that of a process which crashed.

    Attributes:
        workers: processes at the same time.
        tell: what to call with a sentence on what goes wrong meanwhile.
    """

    workers: int
    limits: Limits = field(default_factory=Limits)
    tell: Tell = lambda _: None

    def do(self, work: Callable[[Any], Any], parcels: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As of every `Executor`."""
        workers = min(self.workers, len(parcels)) or 1
        waiting, running, tried = deque(range(len(parcels))), dict[Future[Any], int](), set[int]()
        with ThreadPoolExecutor(workers) as threads, Cells(self.limits) as cells:
            while waiting or running:
                while waiting and len(running) < workers:
                    index = waiting.popleft()
                    running[threads.submit(cells.do, work, parcels[index])] = index
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    index, outcome = running.pop(future), future.result()
                    if isinstance(outcome, Lost) and outcome.killed and workers > 1:
                        workers //= 2
                        cells.rest(workers)
                        self.tell(f"a worker process was killed, perhaps for want of memory; {workers} go on")
                    if is_worth_another(outcome) and index not in tried:
                        tried.add(index)
                        waiting.append(index)
                    else:
                        yield index, outcome


def is_worth_another(outcome: Any) -> bool:
    """Whether a task was lost for what may have been no fault of its own."""
    return isinstance(outcome, Lost) and not outcome.under


def on_this_machine(workers: int, limits: Limits = Here.limits, tell: Tell = lambda _: None) -> Executor:
    """This process where that will do, else processes of its own."""
    return HERE if workers == 1 and not limits else Processes(workers=workers, limits=limits, tell=tell)
