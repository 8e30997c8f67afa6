"""What was found in one of many objects, on one line."""

import math
from collections.abc import Sequence
from typing import Any

from symrefine.errors import one_line

Record = dict[str, Any]

# One of many files; names last, so that none is ever cut or folded, and no row waits for the longest.
_ROW = "{:<13}  {:>6}  {:>4}  {:>6}  {:>10}  {:>7}  {}"
ROW_HEAD = _ROW.format("group", "planes", "axes", "p95 %", "confidence", "seconds", "file")


# One of many targets of an alignment.
_MAP_ROW = "{:<6}  {:>5}  {:>3}  {:>7}  {:>34}  {:>7}  {:>9}  {:>5}  {:>7}  {}"
MAP_HEAD = _MAP_ROW.format(
    "status", "conf.", "det", "turn °", "translation", "rms %", "overlap %", "equiv", "seconds", "target"
)


def row_line(name: str, row: Record) -> str:
    """What was found in one of many files, or what was wrong with it; the name stands last and whole.

    The confidence is that of the answer, as a table of one object has it; behind the name stands why there is none.
    """
    if row["error"] is not None:
        return _failed(name, row["error"])
    if "hyperplanes" in row:
        told, mirrors, turns = f"{row['dimension']}-D", row["hyperplanes"], None
    else:
        # Planes and axes of a detection in space, lines and turns of one in the plane.
        mirrors = row["lines"] if "lines" in row else row["planes"]
        turns = ([row["rotation"]] if row["rotation"] else []) if "lines" in row else row["axes"]
        told = f"at least {row['point_group']}" if row.get("at_least") else row["point_group"]
    elements = [] if turns is None else mirrors + turns + inversions(row)
    sure = None if row["undetermined"] else row.get("confidence")
    reason = f": {one_line(row['undetermined'])}" if row["undetermined"] else ""
    return _ROW.format(
        "undetermined" if row["undetermined"] else told,
        len(mirrors),
        "" if turns is None else len(turns),
        percentage(max(e["residual"]["p95"] for e in elements)) if elements else "",
        "" if sure is None else f"{sure:.2f}",
        seconds(row),
        f"{one_line(name)}{reason}",
    )


def map_line(name: str, row: Record) -> str:
    """The map onto one of many targets, or what was wrong with it; of a misfit nothing that looks like an answer."""
    if row["error"] is not None:
        return _failed(name, row["error"])
    status, fits = row["status"], not row["misfit"]
    word = status if status == "ok" else "open" if fits else "misfit"
    met = "/".join(f"{100 * row['overlap'][side]:.0f}" for side in ("source", "target"))
    shift = " ".join(f"{x + 0.0:.5g}".rjust(10) for x in row["translation"])
    told = (
        f"{row['confidence']:.2f}",
        f"{row['determinant']:+d}",
        f"{math.degrees(turn_rad(row['matrix'])):.2f}",
        shift,
        percentage(row["rms"]),
        met,
        "inf" if row["free"] else len(row["equivalents"]),
    )
    shown = told if fits else ("", "", "", "", told[4], "", "")
    reason = "" if status == "ok" else f": {one_line(status)}"
    return _MAP_ROW.format(word, *shown, seconds(row), f"{one_line(name)}{reason}")


def turn_rad(matrix: Sequence[Sequence[float]]) -> float:
    """Largest angle in [0, pi] by which an orthogonal matrix [n, n] turns some plane.

    Of determinant -1 that of what is left beside one reversed direction: 0 for a mirror, and for a rotoreflection the
    angle that goes with its mirror, as in S4.
    """
    import numpy as np

    operation = np.asarray(matrix, dtype=np.float64)
    values = np.linalg.eigvals(operation)
    if np.linalg.det(operation) < 0.0:
        values = np.delete(values, int(np.argmin(np.abs(values + 1.0))))
    return float(np.abs(np.angle(values)).max(initial=0.0))


def _failed(name: str, error: str) -> str:
    told, name = one_line(error), one_line(name)
    return f"failed: {told}" if name in told else f"failed: {name}: {told}"


def inversions(record: Record) -> list[Record]:
    """The inversion as an element, if there is one; rows of a batch in the plane, or of an early version, tell none."""
    if not record.get("inversion_residual"):
        return []
    return [{"residual": record["inversion_residual"], "confidence": record["inversion_confidence"]}]


def percentage(fraction: float) -> str:
    """A fraction in percent, without the sign."""
    return f"{100 * fraction:.3f}"


def seconds(record: Record) -> str:
    """Seconds that everything took together."""
    return f"{sum(record['timings'].values()):.2f}"
