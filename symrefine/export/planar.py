"""Detections in the plane as plain data."""

from collections.abc import Iterable, Mapping
from importlib.metadata import version
from typing import Any

from symrefine.export.records import number, toward_positive
from symrefine.geometry import Plane
from symrefine.planar import FoundLine, PlanarDetection, PlanarNearMiss, VectorDoublets
from symrefine.planar.judge import LineDeviation
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
        "schema": SCHEMA,
        "source": shape.source,
        "version": version("symrefine"),
        "options": dict(options),
        "measure": shape.measure,
        "point_group": d.point_group,
        "confidence": number(d.confidence),
        "center": _numbers(d.center, scale),
        "diagonal": number(d.diagonal),
        "tolerance": number(d.tolerance),
        "lines": [_line(line, scale) for line in d.lines],
        "rotation": None
        if d.rotation is None
        else {
            "order": _order(d.rotation.order),
            "residual": _residual(d.rotation.residual),
            "confidence": number(d.rotation.confidence),
        },
        "near_misses": [_near_miss(m, scale) for m in d.near_misses],
        "undetermined": d.undetermined or None,
        "ntuples": {
            "kind": d.doublets.kind,
            "angle_rad": number(d.doublets.angle_rad),
            "singular_values": _numbers(d.doublets.singular_values, 1.0),
            "significance": _numbers(d.doublets.significance, 1.0),
            "vectors": [_vector(v) for v in d.doublets.vectors],
        },
        "timings": {stage: round(seconds, 6) for stage, seconds in timings.items()},
    }


def _numbers(values: Iterable[float], scale: float) -> list[float | str | None]:
    return [number(v, scale) for v in values]


def _placed(line: Plane, scale: float) -> Record:
    sign = toward_positive(line.normal)
    return {"normal": _numbers(sign * line.normal, 1.0), "offset": number(sign * line.offset, scale)}


def _line(found: FoundLine, scale: float) -> Record:
    return {
        **_placed(found.line, scale),
        "residual": _residual(found.residual),
        "confidence": number(found.confidence),
    }


def _near_miss(miss: PlanarNearMiss, scale: float) -> Record:
    """`excess` is the miss over what the tolerance allows, the worst of its statistics."""
    nowhere = {"normal": None, "offset": None}
    return {
        "kind": "rotation" if miss.line is None else "line",
        **(nowhere if miss.line is None else _placed(miss.line, scale)),
        "center": _numbers(miss.center, scale),
        "order": _order(miss.order),
        "residual": _residual(miss.residual),
        "excess": number(miss.excess),
    }


def _vector(vector: VectorDoublets) -> Record:
    """`ratio` is None where the doublets vanish: noise over noise."""
    return {
        "orders": list(vector.orders),
        "singular_values": _numbers(vector.singular_values, 1.0),
        "ratio": None if vector.vanish else number(vector.ratio),
    }


def _order(order: float) -> int | str:
    return "inf" if order == float("inf") else round(order)


def _residual(deviation: LineDeviation) -> Record:
    return {name: number(getattr(deviation, name), 1.0) for name in ("mean", "p95", "p99", "max")}
