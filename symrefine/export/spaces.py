"""Detections in spaces of four and more dimensions as plain data."""

from collections.abc import Mapping
from typing import Any

from symrefine.export.records import number, numbers, opening, placed, seconds
from symrefine.ndim import Hyperplane, SubspaceDetection
from symrefine.shape import Shape

SCHEMA = "symrefine.detection_nd/1"

Record = dict[str, Any]


def subspace_record(
    detection: SubspaceDetection, shape: Shape, *, options: Mapping[str, Any], timings: Mapping[str, float]
) -> Record:
    """What `symrefine detect --json` writes for points of 4 to 8 coordinates.

    Returns:
        Lengths in input units; a hyperplane is `normal.x = offset`; `asymmetry` and `noise` are fractions of moments,
        `miss` is a fraction of `diameter`; `incomplete` says why hyperplanes may be missing from the list;
        `reflection_group_order` is that of the group that the listed reflections generate, None if it is not known.
    """
    d = detection
    return {
        **opening(SCHEMA, shape, options),
        "dimension": shape.dim,
        "center": numbers(d.center, d.diameter),
        "diameter": number(d.diameter),
        "hyperplanes": [_hyperplane(h, d.diameter) for h in d.hyperplanes],
        "rejected": [_hyperplane(h, d.diameter) for h in d.rejected],
        "undetermined": d.undetermined or None,
        "incomplete": d.incomplete or None,
        "reflection_group_order": d.reflection_group_order,
        "ntuples": {
            "rank": d.fixed.rank,
            "singular_values": numbers(d.fixed.singular_values, 1.0),
            "significance": numbers(d.fixed.significance, 1.0),
        },
        "timings": seconds(timings),
    }


def _hyperplane(candidate: Hyperplane, scale: float) -> Record:
    return {
        **placed(candidate.plane, scale),
        "asymmetry": number(candidate.asymmetry, 1.0),
        "noise": number(candidate.noise, 1.0),
        "miss": number(candidate.miss, 1.0),
    }
