"""Options as Python gives them: yes or no, and whole numbers, of any type that is one; a text for no is none."""

from operator import index
from typing import Any

import numpy as np

from symrefine.errors import InputError


def flag_of(name: str, value: Any) -> bool:
    """Yes or no, as Python or numpy says it; a text or a number may mean either.

    Raises:
        InputError: another value; it is called by its name.
    """
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} is {value!r}; expected True or False")
    return bool(value)


def whole_of(name: str, value: Any, *, least: int = 0) -> int:
    """A number without fraction, of any type that is one.

    Raises:
        InputError: another value, or a smaller number; it is called by its name.
    """
    try:
        whole = index(value)
    except TypeError:
        whole = least - 1
    if whole < least:
        raise InputError(f"{name} is {value!r}; expected a whole number from {least}")
    return whole
