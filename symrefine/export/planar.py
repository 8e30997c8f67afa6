"""Detections in the plane as plain data."""

from collections.abc import Mapping
from typing import Any

from symrefine.export.records import number, numbers, opening, order, placed, residual, seconds
from symrefine.plane import FoundLine, PlanarDetection, PlanarNearMiss, VectorDoublets
from symrefine.shape import Shape

SCHEMA = "symrefine.detection2d/1"

Record = dict[str, Any]


def planar_record(
    detection: PlanarDetection, shape: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine detect --json` writes for a picture or 2-D points, in the spirit of `detection_record`.

    Returns:
        Lengths in input units (pixels), misses as fractions of `diagonal`; a mirror line is `normal.x = offset`.
    """
    d, scale = detection, detection.diagonal
    timings = ({} if load_s is None else {"load": load_s}) | dict(d.timings)
    return {
        **opening(SCHEMA, shape, options),
        "point_group": d.point_group,
        "confidence": number(d.confidence),
        "alternatives": [
            {
                "point_group": a.point_group,
                "probability": number(a.probability),
                "forgiven": number(a.forgiven),
            }
            for a in d.alternatives
        ],
        "center": numbers(d.center, scale),
        "diagonal": number(d.diagonal),
        "tolerance": number(d.tolerance),
        "lines": [_line(line, scale) for line in d.lines],
        "rotation": None
        if d.rotation is None
        else {
            "order": order(d.rotation.order),
            "residual": residual(d.rotation.residual),
            "confidence": number(d.rotation.confidence),
        },
        "near_misses": [_near_miss(m, scale) for m in d.near_misses],
        "undetermined": d.undetermined or None,
        "ntuples": {
            "kind": d.doublets.kind,
            "angle_rad": number(d.doublets.angle_rad),
            "singular_values": numbers(d.doublets.singular_values, 1.0),
            "significance": numbers(d.doublets.significance, 1.0),
            "vectors": [_vector(v) for v in d.doublets.vectors],
        },
        "timings": seconds(timings),
    }


def _line(found: FoundLine, scale: float) -> Record:
    return {
        **placed(found.line, scale),
        "residual": residual(found.residual),
        "confidence": number(found.confidence),
    }


def _near_miss(miss: PlanarNearMiss, scale: float) -> Record:
    """`excess` is the smallest tolerance at which it would hold, over the tolerance asked for."""
    nowhere = {"normal": None, "offset": None}
    return {
        "kind": "rotation" if miss.line is None else "line",
        **(nowhere if miss.line is None else placed(miss.line, scale)),
        "center": numbers(miss.center, scale),
        "order": order(miss.order),
        "residual": residual(miss.residual),
        "excess": number(miss.excess),
    }


def _vector(vector: VectorDoublets) -> Record:
    """`ratio` is None where the doublets vanish: noise over noise."""
    return {
        "orders": list(vector.orders),
        "singular_values": numbers(vector.singular_values, 1.0),
        "ratio": None if vector.vanish else number(vector.ratio),
    }
