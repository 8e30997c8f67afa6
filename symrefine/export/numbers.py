"""Numbers, vectors and matrices as every record has them: twelve digits, and nothing that JSON does not know."""

import math
from collections.abc import Iterable, Mapping

from symrefine.geometry import Array
from symrefine.rounding import twelve_digits


def number(value: float, scale: float = 0.0) -> float | str | None:
    """A finite number to 12 significant digits, 0 if it is nothing beside `scale`; "inf", "-inf", or None for NaN."""
    value = float(value)
    if math.isnan(value):
        return None
    if math.isinf(value):
        return str(value)
    return twelve_digits(value, scale)


def numbers(values: Iterable[float], scale: float) -> list[float | str | None]:
    """Each value as `number` writes it."""
    return [number(v, scale) for v in values]


def matrix(rows: Array) -> list[list[float | str | None]]:
    """A matrix of numbers about 1, row by row."""
    return [numbers(row, 1.0) for row in rows]


def seconds(timings: Mapping[str, float], load_s: float | None = None) -> dict[str, float]:
    """Seconds by stage, to the microsecond, those of reading first."""
    stages = ({} if load_s is None else {"load": load_s}) | dict(timings)
    return {stage: round(spent, 6) for stage, spent in stages.items()}
