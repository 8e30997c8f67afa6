"""Signs of life on stderr while something takes long: a live line if somebody looks on, else one every ten seconds."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter

from symrefine.cli.outputs import console, is_quiet, is_verbose
from symrefine.cli.streams import aside
from symrefine.clock import watched

# Seconds between two lines where nobody looks on: a log of an hour stays readable, and nobody thinks that it hangs.
EVERY = 10.0


class Doing:
    """What is being done, in words that change with the stage, the steps that are done, and the time."""

    def __init__(self, text: str, steps: int = 0, done: int = 0) -> None:
        self.text, self.stage, self.steps, self.done, self.begun = text, "", steps, done, perf_counter()
        self.points, self.entered = "", perf_counter()
        self.changed: Callable[[], None] = lambda: None

    def __str__(self) -> str:
        steps = f"{self.done} of {self.steps}" if self.steps > 1 else ""
        doing = f"{self.text}: {self.stage}" if self.stage else self.text
        return ", ".join(part for part in (doing, self.points, steps) if part)

    def advance(self) -> None:
        """One more step is done."""
        self.done += 1
        self.changed()

    def expect(self, steps: int) -> None:
        """So many more steps than was thought are to be done."""
        self.steps += steps
        self.changed()

    def watch(self, stage: str, seconds: float | None) -> None:
        """Follow the stages, and tell of each that has ended where that is asked for."""
        name, points = stage.replace("_", " "), self.points
        self.stage, self.points, self.entered = "" if seconds is not None else name, "", perf_counter()
        self.changed()
        if seconds is not None and is_verbose():
            aside(f"symrefine: {name} {seconds:.2f} s" + (f", {points}" if points else ""))

    def count(self, points: int, of: int) -> None:
        """Follow the points that a stage goes through, and how fast it does."""
        rate = points / max(perf_counter() - self.entered, 1e-9)
        self.points = f"{points:,} {'' if points == of else f'of {of:,} '}points, {rate:,.0f} points/s"
        self.changed()


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show what is being done, in which stage, and for how long already."""
    with _shown(Doing(text)):
        yield


@contextmanager
def progress(text: str, total: int, done: int) -> Iterator[Callable[[], None]]:
    """Show how many of all steps are done; the function it gives is called after each."""
    with counting(text, total, done) as doing:
        yield doing.advance


@contextmanager
def counting(text: str, total: int, done: int = 0) -> Iterator[Doing]:
    """Show how many of all steps are done, where there may be more than was thought."""
    doing = Doing(text, total, done)
    with _shown(doing):
        yield doing


@contextmanager
def _shown(doing: Doing) -> Iterator[None]:
    if is_quiet():
        yield
        return
    with _live(doing) if sys.stderr.isatty() else _every_ten_seconds(doing), watched(doing.watch, counting=doing.count):
        yield
    if is_verbose():
        aside(f"symrefine: {doing.text} {perf_counter() - doing.begun:.2f} s in all")


@contextmanager
def _live(doing: Doing) -> Iterator[None]:
    """One line that is drawn again and again, and gone at the end; what is printed meanwhile stands above it."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    words = TextColumn("{task.description}", markup=False)
    columns = [SpinnerColumn(), words, *([BarColumn()] if doing.steps > 1 else []), TimeElapsedColumn()]
    # Else rich would send to the terminal what is printed to a file.
    to_terminal = sys.stdout.isatty()
    with Progress(*columns, console=console(stderr=True), transient=True, redirect_stdout=to_terminal) as bar:
        only = bar.add_task(str(doing), total=doing.steps or None, completed=doing.done)
        doing.changed = lambda: bar.update(
            only, description=str(doing), total=doing.steps or None, completed=doing.done
        )
        yield


@contextmanager
def _every_ten_seconds(doing: Doing) -> Iterator[None]:
    over = Event()

    def tell() -> None:
        while not over.wait(EVERY):
            aside(f"symrefine: {doing}, {perf_counter() - doing.begun:.0f} s")

    teller = Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()
