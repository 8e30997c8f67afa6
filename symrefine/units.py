"""Units of length: how they are written, how long they are."""

import math
import re
from collections.abc import Mapping
from numbers import Real
from typing import Any

from symrefine.errors import InputError, meant

# Metres in each.
METRES: Mapping[str, float] = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "A": 1e-10, "in": 0.0254,
}  # fmt: skip
# Millimetres in one unit of a file, at least and at most: beyond what anybody measures, and far from overflow.
SCALES_MM = (1e-12, 1e12)
# What a length in units of the file is written with, whatever these are.
OF_FILE = "u"
# Things that people scan, model and grasp measure 5 mm to 5 m: as numbers, millimetres and metres do not overlap.
EVERYDAY_M = (5e-3, 5.0)
_LENGTH = re.compile(r"([-+0-9.eE]*[0-9.])\s*([^\W\d_]+)")
_SPELT = {"µm": "um", "μm": "um", "Å": "A", "å": "A"}


def check_scale(scale: Any) -> None:
    """Refuse a number of millimetres that no unit has.

    Raises:
        InputError: it is no number, not positive, or far from all that there is.
    """
    if isinstance(scale, bool) or not isinstance(scale, Real) or not SCALES_MM[0] <= float(scale) <= SCALES_MM[1]:
        raise InputError(
            f"scale is {scale!r}; expected millimetres in one unit of the file, such as 1 or 1000, from "
            f"{SCALES_MM[0]:g} to {SCALES_MM[1]:g}"
        )


def read_length(text: str) -> tuple[float, str]:
    """A positive number and its unit, one of `METRES` or `u`: `0.5mm`, `2e-3 m`, `0.1A`.

    Raises:
        InputError: something else.
    """
    found = _LENGTH.fullmatch(text.strip())
    try:
        value = float(found[1]) if found else math.nan
    except ValueError:
        value = math.nan
    if found is None or not 0.0 < value < math.inf:
        raise InputError(f"{text!r} is not a length above 0 with its unit, such as 0.5mm, 0.1A or 2u")
    unit = _SPELT.get(found[2], found[2])
    if unit not in (*METRES, OF_FILE):
        known = " ".join(METRES)
        raise InputError(
            f"{text!r}: unit {unit} is not known; {known}, or u for units of the file{meant(unit, METRES)}"
        )
    return value, unit


def unit_of_size(size: float) -> str | None:
    """The one of millimetres and metres in which a size is that of an everyday thing; None if it is in neither."""
    low, high = EVERYDAY_M
    return next((unit for unit in ("mm", "m") if low <= size * METRES[unit] < high), None)
