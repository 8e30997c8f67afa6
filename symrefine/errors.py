"""What can go wrong, as types: the shell turns each into one line and exit status 2."""

from collections.abc import Iterator
from contextlib import contextmanager


class SymrefineError(Exception):
    """Base of every error the package raises on purpose; its text is one clear line."""


class InputError(SymrefineError, ValueError):
    """The caller's data or options cannot be used: says what, where, and what would be right."""


class DegenerateShapeError(SymrefineError, ValueError):
    """The data are valid but do not determine the quantity asked for."""


@contextmanager
def about(what: str) -> Iterator[None]:
    """Put before every `InputError` raised inside what it is about: a file, or a part of one.

    Raises:
        InputError: with `what` in front.
    """
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
