"""Detections in spaces of four and more dimensions as plain data."""

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from symrefine.export.records import number, toward_positive
from symrefine.shape import Shape
from symrefine.subspace import Hyperplane, SubspaceDetection

SCHEMA = "symrefine.detection_nd/1"

Record = dict[str, Any]


def subspace_record(
    detection: SubspaceDetection, shape: Shape, *, options: Mapping[str, Any], timings: Mapping[str, float]
) -> Record:
    """What `symrefine detect --json` writes for points of 4 to 8 coordinates.

    Returns:
        Lengths in input units; a hyperplane is `normal.x = offset`; `asymmetry` and `noise` are fractions of moments,
        `miss` is a fraction of `diameter`.
    """
    d = detection
    return {
        "schema": SCHEMA,
        "source": shape.source,
        "version": version("symrefine"),
        "options": dict(options),
        "measure": shape.measure,
        "dimension": shape.dim,
        "center": [number(x, d.diameter) for x in d.center],
        "diameter": number(d.diameter),
        "hyperplanes": [_hyperplane(h, d.diameter) for h in d.hyperplanes],
        "rejected": [_hyperplane(h, d.diameter) for h in d.rejected],
        "undetermined": d.undetermined or None,
        "ntuples": {
            "rank": d.fixed.rank,
            "singular_values": [number(s, 1.0) for s in d.fixed.singular_values],
            "significance": [number(s, 1.0) for s in d.fixed.significance],
        },
        "timings": {stage: round(seconds, 6) for stage, seconds in timings.items()},
    }


def _hyperplane(candidate: Hyperplane, scale: float) -> Record:
    sign = toward_positive(candidate.plane.normal)
    return {
        "normal": [number(sign * x, 1.0) for x in candidate.plane.normal],
        "offset": number(sign * candidate.plane.offset, scale),
        "asymmetry": number(candidate.asymmetry, 1.0),
        "noise": number(candidate.noise, 1.0),
        "miss": number(candidate.miss, 1.0),
    }
