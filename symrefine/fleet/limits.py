"""What one task may take, and what came in the way of one that has no result."""

import os
import sys
from dataclasses import dataclass

from symrefine.errors import InputError

# Seconds: a system is told how long to wait in milliseconds, by a number of 31 bits.
LONGEST = 2**31 // 1000
# Bytes: the libraries of a detection take 0.25 GB on Linux on x86-64; with less than this every task would fail.
LEAST = 2 * 10**8
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one task may take; None is no limit.

    Attributes:
        seconds: time from when a process begins with it.
        memory: bytes that its process may hold, libraries included.
    """

    seconds: float | None = None
    memory: int | None = None

    def __bool__(self) -> bool:
        return self != Limits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """A task without a result, which may have one under other conditions.

    Attributes:
        why: what happened, to follow the name of the task and a colon.
        under: the limit that it met; empty if its process was killed or the machine had no more memory.
        killed: whether something from outside ended the process, as a system does that runs out of memory.
    """

    why: str
    under: str = ""
    killed: bool = False


def one_thread_each() -> None:
    """Keep the libraries loaded from here on to one thread, so that sums do not depend on the number of cores."""
    for name in THREADS:
        os.environ[name] = "1"


def spelled(limits: Limits) -> tuple[str, ...]:
    """The limits as `Lost.under` names them: what was lost under one of these need not be tried again."""
    seconds = () if limits.seconds is None else (f"{limits.seconds:g} s",)
    return (*seconds, *(() if limits.memory is None else (f"{limits.memory:,} bytes",)))


def check_limits(limits: Limits) -> None:
    """Refuse a limit that this system cannot hold.

    Raises:
        InputError: memory, elsewhere than on Linux, or less than the libraries alone take; more time than it can wait.
    """
    if limits.seconds is not None and limits.seconds > LONGEST:
        raise InputError(f"a limit of time of {limits.seconds:g} s is more than {LONGEST:,}, 24 days; leave it out")
    if limits.memory is not None and sys.platform != "linux":
        raise InputError(f"a limit of memory needs Linux, this is {sys.platform}; leave it out")
    if limits.memory is not None and limits.memory < LEAST:
        raise InputError(
            f"a limit of memory of {limits.memory:,} bytes is less than the libraries of a task alone take, 0.3 GB; "
            "give 0.5GB or more"
        )


def hold_memory(limit: int | None) -> None:
    """Let this process take no more memory for data than a number of bytes; what asks for more gets a MemoryError."""
    if limit is None:
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
