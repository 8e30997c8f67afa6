"""Libraries of others: those that only some formats need are installed when asked for; all may stumble over a file."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from symrefine.errors import InputError
from symrefine.load.text import shorten


def library(module: str, extra: str) -> Any:
    """The module; heavy ones come here when a file needs them.

    Args:
        extra: the optional dependencies of this package that it is one of.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        raise missing(module.partition(".")[0], extra) from None


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Take whatever a library raises within, of types of its own and others, for damage of what it reads.

    Raises:
        InputError: the file is no whole one of what it should be, or as it was raised within.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 (libraries leak many types on damaged files)
        raise InputError(f"not a whole {what}: {shorten(str(error), 80)}") from None


def missing(package: str, extra: str) -> InputError:
    """What to raise where a package of an extra is not installed."""
    return InputError(f"{package} is needed to read it and is not installed: pip install 'symrefine[{extra}]'")
