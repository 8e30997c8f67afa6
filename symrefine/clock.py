"""Wall-clock seconds by stage; whoever wants to know is told of each stage while it passes."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Called with the name of a stage when it begins, and once more, with its seconds, when it has ended.
Watcher = Callable[[str, float | None], None]
# Called with how many points a stage has been through, and of how many.
Counter = Callable[[int, int], None]
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)
_counter: ContextVar[Counter | None] = ContextVar("counter", default=None)


class Clock:
    """Seconds of each stage, all its rounds together, in the order in which they first ended."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str, points: int = 0) -> Iterator[None]:
        """Time one stage, which goes through so many points."""
        told = _watcher.get() or _nobody
        told(stage, None)
        start = time.perf_counter()
        yield
        seconds = time.perf_counter() - start
        # What seems to be no part of an object has it measured again, without.
        self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds
        if points:
            passed(points, points)
        told(stage, seconds)


@contextmanager
def watched(by: Watcher, *, counting: Counter | None = None) -> Iterator[None]:
    """Tell `by` of every stage that any clock of this thread times meanwhile, and `counting` of points gone through."""
    watcher, counter = _watcher.set(by), _counter.set(counting)
    try:
        yield
    finally:
        _watcher.reset(watcher)
        _counter.reset(counter)


def passed(points: int, of: int) -> None:
    """Tell whoever wants to know how many points the stage that is under way has been through."""
    counting = _counter.get()
    if counting is not None:
        counting(points, of)


def _nobody(_stage: str, _seconds: float | None) -> None:
    """The watcher where there is none."""
