"""Files that hold several objects: molecules one after the other, models, a series of volumes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar, overload

from symrefine.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Frames(Sequence[T], Generic[T]):
    """The objects in one file, in their order; each is made when it is asked for, and once more when asked again.

    Args:
        what: they are called, in the plural.
        size: how many they are, 1 at least.
        make: one of them, from its number.
    """

    what: str
    size: int
    make: Callable[[int], T] = field(repr=False)

    def __len__(self) -> int:
        return self.size

    @overload
    def __getitem__(self, number: int) -> T: ...

    @overload
    def __getitem__(self, number: slice) -> tuple[T, ...]: ...

    def __getitem__(self, number: int | slice) -> T | tuple[T, ...]:
        numbers = range(self.size)[number]
        return self.make(numbers) if isinstance(numbers, int) else tuple(self.make(k) for k in numbers)

    def chosen(self, frame: int | None) -> T:
        """The only one, or the one that was chosen.

        Raises:
            InputError: as `check`.
        """
        self.check(frame)
        return self.make(frame or 0)

    def check(self, frame: int | None) -> None:
        """Refuse a choice of none where there are several, and of one that is not there.

        Raises:
            InputError: with the numbers that there are.
        """
        last = self.size - 1
        if frame is None and last:
            raise InputError(f"holds {self.size} {self.what}; choose one with frame (--frame), from 0 to {last}")
        if frame is not None and not 0 <= frame <= last:
            there = f"{self.size} {self.what}, from 0 to {last}" if last else f"one of the {self.what}, number 0"
            raise InputError(f"frame is {frame}; the file has {there}")


def one(content: T, what: str) -> Frames[T]:
    """The only object of a file that might have held several."""
    return Frames(what, 1, lambda _: content)
