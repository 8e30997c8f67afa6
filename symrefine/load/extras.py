"""Libraries that only some formats need, and that are installed when asked for."""

from importlib import import_module
from typing import Any

from symrefine.errors import InputError


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


def missing(package: str, extra: str) -> InputError:
    """What to raise where a package of an extra is not installed."""
    return InputError(f"{package} is needed to read it and is not installed: pip install 'symrefine[{extra}]'")
