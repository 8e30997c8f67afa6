"""What may be asked: tolerances, and what was found before."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from symrefine.errors import InputError
from symrefine.rounding import SINGLE

if TYPE_CHECKING:
    from symrefine.front.space import Detection
    from symrefine.shape import Shape


def told(tolerance: float | str, units: str | None) -> dict[str, Any]:
    """A tolerance as it was asked for, for the record: a fraction, or a length with what it is in if that was said."""
    asked: dict[str, Any] = {"tolerance": tolerance if isinstance(tolerance, str) else float(tolerance)}
    return asked if units is None else asked | {"units": units}


def ladder_of(tolerances: Any) -> tuple[float, ...]:
    """Several tolerances, each of which is checked where it is used.

    Raises:
        InputError: one value alone.
    """
    if isinstance(tolerances, str) or not isinstance(tolerances, Iterable):
        raise InputError(f"ladder is {tolerances!r}; expected several tolerances, such as [0.01, 0.02]")
    return tuple(tolerances)


def in_space(found: Any) -> "Detection":
    """What was found before, if it is of an object in space.

    Raises:
        InputError: something else.
    """
    from symrefine.front.space import Detection

    if not isinstance(found, Detection):
        raise InputError(f"found is of type {type(found).__name__}; expected what symrefine.detect found in space")
    return found


def found_in(found: Any, shape: "Shape") -> "Detection":
    """What was found before, if it is of this object in space.

    Raises:
        InputError: something else, or found in other points or triangles.
    """
    known = in_space(found).shape
    if found.sample is not None and found.sample.of == len(shape.points) != len(known.points):
        return in_space(found)  # only a part of the points is known
    if known.points.shape != shape.points.shape:
        raise InputError(_other(known, shape, f"it has {len(known.points):,} points, this has {len(shape.points):,}"))
    away = float(np.abs(known.points - shape.points).max())
    if not away <= SINGLE * found.diagonal:
        raise InputError(_other(known, shape, f"a coordinate of its points differs by {away:.3g}"))
    triangles, those = (() if given.faces is None else given.faces for given in (known, shape))
    if not np.array_equal(triangles, those):
        raise InputError(_other(known, shape, "its triangles are others"))
    return in_space(found)


def _other(known: "Shape", shape: "Shape", why: str) -> str:
    return f"{shape.source}: what was found is of another object, {known.source}: {why}; detect in this one"
