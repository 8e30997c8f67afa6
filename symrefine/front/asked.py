"""What may be asked: tolerances, seeds, and what was found before."""

from operator import index
from typing import TYPE_CHECKING, Any

from symrefine.errors import InputError

if TYPE_CHECKING:
    from symrefine.front.space import Detection


def told(tolerance: float | str, units: str | None) -> dict[str, Any]:
    """A tolerance as it was asked for, for the record: a fraction, or a length with what it is in if that was said."""
    asked: dict[str, Any] = {"tolerance": tolerance if isinstance(tolerance, str) else float(tolerance)}
    return asked if units is None else asked | {"units": units}


def seed_of(seed: Any) -> int:
    """A seed that numpy takes and JSON can hold.

    Raises:
        InputError: no whole number from 0.
    """
    try:
        whole = index(seed)
    except TypeError:
        whole = -1
    if whole < 0:
        raise InputError(f"seed is {seed!r}; expected a whole number from 0")
    return whole


def in_space(found: Any) -> "Detection":
    """What was found before, if it is of an object in space.

    Raises:
        InputError: something else.
    """
    from symrefine.front.space import Detection

    if not isinstance(found, Detection):
        raise InputError(f"found is of type {type(found).__name__}; expected what symrefine.detect found in space")
    return found
