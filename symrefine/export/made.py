"""Records of what was made of an object with its symmetry: `symmetrize --json`, `complete --json`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from symrefine.export.numbers import matrix, number, numbers, seconds
from symrefine.export.records import Record, opening_of
from symrefine.shape import Shape

if TYPE_CHECKING:
    from symrefine.complete import Completion
    from symrefine.detection.result import Detection
    from symrefine.symmetrize import Symmetrized

SYMMETRIZED_SCHEMA = "symrefine.symmetrized/1"
COMPLETED_SCHEMA = "symrefine.completed/1"


def symmetrized_record(
    made: "Symmetrized",
    found: "Detection",
    source: Shape,
    *,
    outliers: int,
    options: Mapping[str, Any],
    timings: Mapping[str, float],
    load_s: float | None = None,
) -> Record:
    """What was made exact, and how far points moved; distances are fractions of `diagonal`, the rest in input units.

    Args:
        made: the symmetric shape.
        found: the symmetry that it rests on.
        source: the shape as it was.
        outliers: points of it that were left out.
        options: and what follows as of every record.
    """
    return {
        **opening_of(SYMMETRIZED_SCHEMA, options, source),
        "found": found.point_group,
        "confidence": number(found.confidence),
        "point_group": made.group.name,
        "center": numbers(made.center, made.diagonal),
        "frame": matrix(made.group.frame),
        "method": made.method,
        "paired": number(made.paired),
        "points": len(made.shape.points),
        "outliers": outliers,
        "largest": number(made.largest, 1.0),
        "rms": number(made.rms, 1.0),
        "residual": number(made.residual),
        "diagonal": number(made.diagonal),
        "tolerance": number(found.tolerance),
        "timings": seconds(timings, load_s),
    }


def completed_record(
    made: "Completion",
    source: Shape,
    *,
    options: Mapping[str, Any],
    timings: Mapping[str, float],
    load_s: float | None = None,
) -> Record:
    """How many points of a scan, the source, were seen and inferred, under which group."""
    d = made.detection
    return {
        **opening_of(COMPLETED_SCHEMA, options, source),
        "point_group": d.point_group,
        "at_least": bool(d.at_least),
        "confidence": number(d.confidence),
        "center": numbers(d.center, d.diagonal),
        "diagonal": number(d.diagonal),
        "tolerance": number(d.tolerance),
        "seen": int((~made.inferred).sum()),
        "inferred": int(made.inferred.sum()),
        "contradicted": made.contradicted,
        "outliers": len(d.outliers),
        "timings": seconds(timings, load_s),
    }
