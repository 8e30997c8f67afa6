"""A process for one task at a time, which may be ended at any moment and takes no other task with it.

The pools of `concurrent.futures` and loky lose all that is running when one process dies, cannot end one, and do not
say whose task it was; here each process has a pipe of its own, so nobody waits for a lock that a killed one held.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from symrefine.errors import SymrefineError, one_line
from symrefine.fleet.limits import Limits, Lost, hold_memory, one_thread_each, spelled

# What libraries keep from task to task is given back so often; starting anew costs about as much as one task.
_TASKS = 200
# What the end of a process that was killed may take until its status is known.
_GRACE_S = 5.0


class Cell:
    """A process that does one task after the other, in one thread, within limits.

    Args:
        limits: of each task.
        folder: where paths count from, if it is there; by default as here.

    Raises:
        SymrefineError: it cannot start.
    """

    def __init__(self, limits: Limits, folder: str = ".") -> None:
        from multiprocessing import current_process, get_context

        one_thread_each()
        if current_process().daemon:  # as workers of Dask are, which would be allowed no processes of their own
            current_process().daemon = False
        spawn = get_context("spawn")
        self._limits, self._left = limits, _TASKS
        self._pipe, inner = spawn.Pipe()
        self._process = spawn.Process(target=_serve, args=(inner, limits.memory, folder), daemon=True)
        self._process.start()
        inner.close()
        try:
            self._pipe.recv()  # it has begun, so that its start does not count as time of the first task
        except (EOFError, OSError):
            self._process.join(_GRACE_S)
            raise SymrefineError(f"a worker process ended at once, with status {self._process.exitcode}") from None

    @property
    def is_fit(self) -> bool:
        """Whether it may take another task."""
        return self._left > 0 and self._process.is_alive()

    def do(self, work: Callable[[Any], Any], parcel: Any) -> Any:
        """What `work` makes of a parcel, or a `Lost`.

        Raises:
            Exception: what `work` raised.
        """
        self._left -= 1
        try:
            self._pipe.send((work, parcel))
            if not self._pipe.poll(self._limits.seconds):
                self.end()
                seconds = f"{self._limits.seconds:g} s"
                return Lost(why=f"takes longer than {seconds}, the limit of time", under=seconds)
            outcome = self._pipe.recv()
        except (EOFError, OSError):
            return self._epitaph()
        if isinstance(outcome, Exception):
            raise outcome
        if isinstance(outcome, Lost):
            self._left = 0  # who knows what it still holds
        return outcome

    def end(self) -> None:
        """Kill the process, whatever it is doing."""
        self._left = 0
        self._process.kill()
        self._process.join(_GRACE_S)

    def _epitaph(self) -> Lost:
        self._left = 0
        self._process.join(_GRACE_S)
        code, limit = self._process.exitcode, self._limits.memory
        how = f"ended with status {code}" if code is None or code >= 0 else f"was killed by signal {-code}"
        perhaps = "; perhaps it took too much memory" if limit is None else f"; perhaps {limit:,} bytes are too few"
        return Lost(why=f"its process {how}{perhaps}", killed=code == -9)


def _serve(pipe: Connection, memory: int | None, folder: str) -> None:
    """What the process does."""
    with suppress(OSError):  # on another machine there may be no such folder, nor need of one
        os.chdir(folder)
    _end_with_parent()
    hold_memory(memory)
    pipe.send(None)
    while True:
        try:
            work, parcel = pipe.recv()
        except EOFError:
            return
        except MemoryError:  # not enough to import what it is asked for
            pipe.send(out_of_memory(memory))
            continue
        except Exception as error:  # noqa: BLE001 - what it is sent cannot be imported here
            pipe.send(SymrefineError(one_line(f"a worker process cannot take its task: {error}")))
            continue
        pipe.send(_outcome(work, parcel, memory))


def _outcome(work: Callable[[Any], Any], parcel: Any, memory: int | None) -> Any:
    import pickle

    try:
        result = work(parcel)
        pickle.dumps(result)
        return result
    except MemoryError:
        return out_of_memory(memory)
    except Exception as error:  # noqa: BLE001 - raised again where it was asked for
        is_known_there = type(error).__module__ in ("builtins", SymrefineError.__module__)
        return error if is_known_there else SymrefineError(one_line(error))


def out_of_memory(memory: int | None) -> Lost:
    """What to say of a task that could get no memory."""
    if memory is None:
        return Lost(why="out of memory")
    under = spelled(Limits(memory=memory))[0]
    return Lost(why=f"needs more memory than {under}, the limit", under=under)


def _end_with_parent() -> None:
    """Make this process end with an interrupt, and with the process that started it, even if that was killed."""
    import signal
    import threading
    import warnings
    from multiprocessing import parent_process

    warnings.simplefilter("ignore")
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as of what a shell runs in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
