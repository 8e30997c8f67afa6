"""What was found in one of many objects, on one line."""

from typing import Any

from symrefine.errors import one_line

Record = dict[str, Any]

# One of many files; names last, so that none is ever cut or folded, and no row waits for the longest.
_ROW = "{:<13}  {:>6}  {:>4}  {:>6}  {:>10}  {:>7}  {}"
ROW_HEAD = _ROW.format("group", "planes", "axes", "p95 %", "confidence", "seconds", "file")


def row_line(name: str, row: Record) -> str:
    """What was found in one of many files, or what was wrong with it; the name stands last and whole."""
    if row["error"] is not None:
        told, name = one_line(row["error"]), one_line(name)
        return f"failed: {told}" if name in told else f"failed: {name}: {told}"
    if "hyperplanes" in row:
        told, mirrors, turns = f"{row['dimension']}-D", row["hyperplanes"], None
    else:
        # Planes and axes of a detection in space, lines and turns of one in the plane.
        mirrors = row["lines"] if "lines" in row else row["planes"]
        turns = ([row["rotation"]] if row["rotation"] else []) if "lines" in row else row["axes"]
        told = f"at least {row['point_group']}" if row.get("at_least") else row["point_group"]
    elements = [] if turns is None else mirrors + turns + inversions(row)
    return _ROW.format(
        "undetermined" if row["undetermined"] else told,
        len(mirrors),
        "" if turns is None else len(turns),
        percentage(max(e["residual"]["p95"] for e in elements)) if elements else "",
        f"{min(e['confidence'] for e in elements):.2f}" if elements else "",
        seconds(row),
        one_line(name),
    )


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
