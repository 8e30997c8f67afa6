"""Stream: a cloud that is too large to hold, in chunks that can be read as often as they are asked for."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.shape import LARGEST, Shape

# Points that are worked on at a time, 3 MiB of coordinates: enough that what a chunk costs by itself does not count.
CHUNK = 2**17


@dataclass(frozen=True, kw_only=True, eq=False)
class Stream:
    """Points in 3-space, one chunk after the other: `for chunk in stream` gives arrays [n, 3] of finite float64.

    Args:
        count: of all points, at least two.
        read: gives all points from the first to the last, in arrays [n, 3] of any length, in the units of the input.
        source: where the data come from, for messages.
        unit: of its lengths, one of `symrefine.units.METRES`, where the source says so.

    Raises:
        InputError: `count` is no whole number of two or more; while it is read: chunks of another form, numbers that
            are not finite or beyond `shape.LARGEST`, or more or fewer points than `count`.
    """

    count: int
    read: Callable[[], Iterator[Array]]
    source: str = "stream"
    unit: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.count, int | np.integer):
            raise InputError(f"{self.source}: count is {self.count!r}; expected how many points there are")
        if self.count < 2:
            raise InputError(f"{self.source}: {self.count} points; a shape needs at least two distinct points")

    @classmethod
    def of(cls, points: Array, *, source: str = "array") -> "Stream":
        """A stream over an array [N, 3], mapped from a file or not, of which no more than a chunk is copied.

        Raises:
            InputError: an array of another form, or of fewer than two points.
        """
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
            raise InputError(f"{source}: points have shape {points.shape} of {points.dtype}; expected numbers [N, 3]")
        starts = range(0, len(points), CHUNK)
        return cls(count=len(points), read=lambda: (points[s : s + CHUNK] for s in starts), source=source)

    def held(self) -> Shape:
        """All of it as a shape."""
        return Shape(np.concatenate([*self]), source=self.source, unit=self.unit)

    def __iter__(self) -> Iterator[Array]:
        """Chunks of `CHUNK` points each but for the last, however they are read."""
        waiting: list[Array] = []
        done = given = 0
        for chunk in self.read():
            waiting.append(self._points(np.asarray(chunk), done))
            done += len(chunk)
            if done - given < CHUNK:
                continue
            points = waiting[0] if len(waiting) == 1 else np.concatenate(waiting)
            ready = len(points) - len(points) % CHUNK
            yield from np.split(points[:ready], ready // CHUNK)
            waiting, given = [points[ready:]], given + ready
        if done != self.count:
            raise InputError(f"{self.source}: {self.count:,} points were announced; {done:,} are there")
        if given < done:
            yield np.concatenate(waiting)

    def _points(self, chunk: NDArray[Any], done: int) -> Array:
        """A chunk behind so many points, as numbers."""
        if chunk.ndim != 2 or chunk.shape[1] != 3 or chunk.dtype.kind not in "iuf":
            raise InputError(f"{self.source}: a chunk has shape {chunk.shape} of {chunk.dtype}; expected [n, 3]")
        points = chunk.astype(np.float64)
        inside = np.abs(points) <= LARGEST
        if not inside.all():
            bad = int(np.flatnonzero(~inside.all(axis=1))[0])
            raise InputError(
                f"{self.source}: point {done + bad} is {points[bad].tolist()}; coordinates must be finite and at most "
                f"{LARGEST:g}: remove such points"
            )
        return points
