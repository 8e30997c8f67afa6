"""What can go wrong, as types: the shell turns each into one line and exit status 2."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

# Characters of a message that somebody reads; a damaged file can put megabytes between quotes.
LONGEST = 1200


class SymrefineError(Exception):
    """Base of every error the package raises on purpose; its text is one clear line that steers no terminal."""

    def __str__(self) -> str:
        """The text; names of files and what stands in them may hold anything, and a traceback shows it as it is."""
        text = printable(" ".join(super().__str__().splitlines()))
        return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


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


def meant(word: str, known: Iterable[str]) -> str:
    """`; did you mean X?`, to end a message with, where one of the known words is close to an unknown one."""
    from difflib import get_close_matches

    close = get_close_matches(word, [*known], 1)
    return f"; did you mean {close[0]}?" if close else ""


def printable(text: str) -> str:
    """A text in which characters that would steer a terminal, and those that it cannot show, are spelled out."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def one_line(text: object) -> str:
    """A text on one line, printable."""
    return printable(" ".join(str(text).split()))
