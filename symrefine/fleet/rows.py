"""Rows of very many tasks, of which few are ever held."""

from collections.abc import Callable, Sequence
from typing import Any, overload

Row = dict[str, Any]


class Rows(Sequence[Row]):
    """Rows that are made when they are asked for, such as read from a file, and once more when asked again.

    Args:
        count: how many they are.
        make: one of them, from its number.
    """

    def __init__(self, count: int, make: Callable[[int], Row]) -> None:
        self._numbers, self._make = range(count), make

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, number: int) -> Row: ...

    @overload
    def __getitem__(self, number: slice) -> list[Row]: ...

    def __getitem__(self, number: int | slice) -> Row | list[Row]:
        numbers = self._numbers[number]
        return self._make(numbers) if isinstance(numbers, int) else [self._make(k) for k in numbers]
