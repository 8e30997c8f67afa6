"""Results as plain data: numbers, strings, lists and dictionaries, in one order and with one sign."""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from symrefine.align.story import Alignment
from symrefine.decide.alternatives import Alternative
from symrefine.detection.result import Detection, FoundAxis, FoundPlane, NearMiss
from symrefine.geometry import Array, Plane
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation

SCHEMA = "symrefine.detection/1"
ALIGNMENT_SCHEMA = "symrefine.alignment/1"

Record = dict[str, Any]

# Digits that are kept: what lies beyond differs between processors.
_DIGITS = 12


def detection_record(
    detection: Detection, shape: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine detect --json` writes; equal input, options and version give equal records but for `timings`.

    Args:
        shape: what it was detected on.
        options: what the caller chose, for the record.
        load_s: seconds that reading took, for `timings`.

    Returns:
        Lengths in input units, misses as fractions of `diagonal`; a direction and a normal point to the side where
        their first large component is positive. An infinite number is "inf".
    """
    d, scale = detection, detection.diagonal
    timings = ({} if load_s is None else {"load": load_s}) | dict(d.timings)
    return {
        **opening(SCHEMA, shape, options),
        "classes": _classes(shape),
        "point_group": d.point_group,
        "confidence": number(d.confidence),
        "alternatives": alternatives(d.alternatives),
        "center": numbers(d.center, scale),
        "diagonal": number(d.diagonal),
        "tolerance": number(d.tolerance),
        "planes": [_plane(p, scale) for p in d.planes],
        "axes": [_axis(a, scale) for a in d.axes],
        "inversion": bool(d.inversion),
        "inversion_residual": None if d.inversion_residual is None else residual(d.inversion_residual),
        "inversion_confidence": None if d.inversion_confidence is None else number(d.inversion_confidence),
        "staircase": [
            {
                "tolerance": number(s.tolerance),
                "point_group": s.point_group,
            }
            for s in d.staircase
        ],
        "near_misses": [_near_miss(m, scale) for m in d.near_misses],
        "iterations": int(d.iterations),
        "undetermined": d.undetermined or None,
        "ntuples": {
            "kind": d.tuples.kind,
            "singular_values": numbers(d.tuples.singular_values, 1.0),
            "significance": numbers(d.tuples.significance, 1.0),
        },
        "timings": seconds(timings),
    }


def opening(schema: str, shape: Shape, options: Mapping[str, Any]) -> Record:
    """How every record of a detection begins: what it is, of what, by which version, and what was asked."""
    return {
        "schema": schema,
        "source": shape.source,
        "version": version("symrefine"),
        "options": dict(options),
        "measure": shape.measure,
    }


def alignment_record(
    alignment: Alignment, source: Shape, target: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine align --json` writes: `target ~ scale * matrix @ source + translation`, and its equivalents.

    `rms` is a fraction of the target's diagonal; `free` spans the directions of the target within which any orthogonal
    map does as well. Where `misfit` is true no map takes the one onto the other, `status` says why, and all the rest
    is about the closest map that was found.
    """
    a = alignment
    size = float(np.abs(target.points).max())
    timings = ({} if load_s is None else {"load": load_s}) | dict(a.timings)
    start = time.perf_counter()
    record = {
        "schema": ALIGNMENT_SCHEMA,
        "source": source.source,
        "target": target.source,
        "version": version("symrefine"),
        "options": dict(options),
        "status": a.status,
        "misfit": bool(a.is_misfit),
        "determinant": a.determinant,
        "matrix": _matrix(a.matrix),
        "translation": numbers(a.translation, size),
        "scale": number(a.scale),
        "rms": number(a.rms, 1.0),
        "sigma_rad": number(a.sigma_rad),
        "exact": bool(a.exact),
        "observable": a.observable,
        "symmetry": a.coset.symmetry or None,
        "free": _matrix(a.coset.free),
        "equivalents": [
            {"matrix": _matrix(m), "translation": numbers(t, size)}
            for m, t in zip(a.coset.matrices, a.coset.translations, strict=True)
        ],
    }
    timings["equivalents"] = time.perf_counter() - start
    return record | {"timings": seconds(timings)}


def _classes(shape: Shape) -> Record | None:
    """How many classes the labels make, and how many points (faces, of a mesh) are in each, in the order of labels."""
    if shape.labels is None:
        return None
    sizes = np.unique(shape.labels, return_counts=True)[1].tolist()
    return {"count": len(sizes), "sizes": sizes}


def toward_positive(direction: Array) -> float:
    """The sign, +1.0 or -1.0, that makes the first component of at least a tenth of the largest positive."""
    size = np.abs(direction)
    return math.copysign(1.0, direction[int(np.argmax(size >= 0.1 * size.max()))])


def number(value: float, scale: float = 0.0) -> float | str | None:
    """A finite number to 12 significant digits, 0 if it is nothing beside `scale`; "inf", "-inf", or None for NaN."""
    value = float(value)
    if math.isnan(value):
        return None
    if math.isinf(value):
        return str(value)
    return 0.0 if abs(value) <= 10.0**-_DIGITS * scale else float(f"{value:.{_DIGITS}g}")


def numbers(values: Iterable[float], scale: float) -> list[float | str | None]:
    """Each value as `number` writes it."""
    return [number(v, scale) for v in values]


def _matrix(rows: Array) -> list[list[float | str | None]]:
    return [numbers(row, 1.0) for row in rows]


def seconds(timings: Mapping[str, float]) -> dict[str, float]:
    """Seconds by stage, to the microsecond."""
    return {stage: round(spent, 6) for stage, spent in timings.items()}


def placed(plane: Plane, scale: float) -> Record:
    """Where a mirror stands: `normal . x = offset`, the normal with the sign that all records give it."""
    sign = toward_positive(plane.normal)
    return {"normal": _direction(plane.normal), "offset": number(sign * plane.offset, scale)}


def _direction(direction: Array) -> list[float | str | None]:
    return numbers(toward_positive(direction) * direction, 1.0)


def _plane(found: FoundPlane, scale: float) -> Record:
    return {
        **placed(found.plane, scale),
        "residual": residual(found.residual),
        "confidence": number(found.confidence),
        "sigma": {"direction_rad": number(found.sigma_rad), "offset": number(found.sigma)},
    }


def _axis(found: FoundAxis, scale: float) -> Record:
    return {
        "direction": _direction(found.axis.direction),
        "point": numbers(found.axis.point, scale),
        "order": order(found.order),
        "improper": bool(found.improper),
        "residual": residual(found.residual),
        "confidence": number(found.confidence),
        "sigma": {"direction_rad": number(found.sigma_rad), "position": number(found.sigma)},
    }


def alternatives(found: Sequence[Alternative]) -> list[Record]:
    """Other groups with their probability, and what would have to be forgiven: a fraction of the diagonal."""
    return [
        {
            "point_group": a.point_group,
            "probability": number(a.probability),
            "forgiven": number(a.forgiven),
        }
        for a in found
    ]


def _near_miss(miss: NearMiss, scale: float) -> Record:
    """`excess` is the miss over what the tolerance allows, the worst of its statistics."""
    return {
        "kind": miss.kind,
        "direction": _direction(miss.direction),
        "point": numbers(miss.point, scale),
        "order": order(miss.order),
        "residual": residual(miss.residual),
        "excess": number(miss.excess),
    }


def order(value: float) -> int | str:
    """An order of rotation as JSON can hold it."""
    return "inf" if math.isinf(value) else round(value)


def residual(deviation: Deviation) -> Record:
    """The distribution of a miss, fractions of the diagonal."""
    names = ("mean", "p95", "p99", "max")
    return {name: number(getattr(deviation, name), 1.0) for name in names}
