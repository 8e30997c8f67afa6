"""Results as plain data: numbers, strings, lists and dictionaries, in one order and with one sign."""

import math
import time
from collections.abc import Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from symrefine.export.numbers import matrix, number, numbers, seconds
from symrefine.geometry import Array, Plane, positive, toward_positive
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation

if TYPE_CHECKING:
    from symrefine.align.story import Alignment
    from symrefine.detection.result import Detection
    from symrefine.ndim import Hyperplane, SubspaceDetection
    from symrefine.plane import PlanarDetection

SCHEMA = "symrefine.detection/1"
PLANAR_SCHEMA = "symrefine.detection2d/1"
SUBSPACE_SCHEMA = "symrefine.detection_nd/1"
ALIGNMENT_SCHEMA = "symrefine.alignment/1"

Record = dict[str, Any]
_COVERAGE = ("supported", "contradicted", "unseen")


def detection_record(
    detection: "Detection", shape: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine detect --json` writes; equal input, options and version give equal records but for `timings`.

    Args:
        options: what the caller chose, for the record.
        load_s: seconds that reading took, for `timings`.

    Returns:
        Lengths in input units, misses as fractions of `diagonal`; a direction and a normal point to the side where
        their first large component is positive. An infinite number is "inf".
    """
    d, scale = detection, detection.diagonal
    return {
        **opening_of(SCHEMA, options, shape),
        "classes": _classes(shape),
        **_answer(d),
        "at_least": bool(d.at_least),
        "strewn": bool(d.strewn),
        "sparse": bool(d.sparse),
        "outliers": {
            "count": len(d.outliers),
            "clumps": int(d.clumps),
            "share": number(d.outlier_share),
            "floor": None
            if d.floor is None
            else {"normal": numbers(d.floor.normal, 1.0), "offset": number(d.floor.offset, scale)},
        },
        "exact": None
        if d.exact is None
        else {"miss": number(d.exact.miss), "faces": d.exact.faces, "point_group": d.exact.point_group},
        "sample": None if d.sample is None else {"points": d.sample.points, "of": d.sample.of},
        "even_sample": d.even_sample,
        **_elements(d),
        "staircase": _staircase(d),
        # `excess` is the miss over what the tolerance allows, the worst of its statistics.
        "near_misses": [
            {"kind": m.kind, "direction": _direction(m.direction), "point": numbers(m.point, scale), **_turned_down(m)}
            for m in d.near_misses
        ],
        "iterations": int(d.iterations),
        "verified": None
        if d.verified is None
        else {"points": d.verified.points, "residual": _residual(d.verified.residual), "beyond": d.verified.beyond},
        "undetermined": d.undetermined or None,
        "textured": None if d.textured is None else _textured(d.textured),
        "ntuples": {"kind": d.tuples.kind} | _sizes(d.tuples),
        "timings": seconds(d.timings, load_s),
    }


def _elements(d: "Detection") -> Record:
    """Planes, axes and the inversion."""
    scale = d.diagonal
    return {
        "planes": [
            _placed(p.plane, scale) | _held(p) | {"sigma": _sigma(p.sigma_rad, "offset", p.sigma)} | _covered(p)
            for p in d.planes
        ],
        "axes": [
            {
                "direction": _direction(a.axis.direction),
                "point": numbers(a.axis.point, scale),
                "order": _order(a.order),
                "improper": bool(a.improper),
                **_held(a),
                "sigma": _sigma(a.sigma_rad, "position", a.sigma),
                **_covered(a),
            }
            for a in d.axes
        ],
        "inversion": bool(d.inversion),
        "inversion_residual": None if d.inversion_residual is None else _residual(d.inversion_residual),
        "inversion_confidence": None if d.inversion_confidence is None else number(d.inversion_confidence),
    }


def _textured(d: "Detection") -> Record:
    """What is told of a shape with its texture: the group, and what of the shape's elements its colours keep."""
    answer = _answer(d)
    return {
        **{name: answer[name] for name in ("point_group", "confidence", "alternatives", "center")},
        **_elements(d),
        "staircase": _staircase(d),
        "undetermined": d.undetermined or None,
    }


def _staircase(d: "Detection") -> list[Record]:
    return [{"tolerance": number(s.tolerance), "point_group": s.point_group} for s in d.staircase]


def planar_record(
    detection: "PlanarDetection", shape: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine detect --json` writes for a picture or 2-D points, in the spirit of `detection_record`.

    Returns:
        Lengths in input units (pixels), misses as fractions of `diagonal`; a mirror line is `normal.x = offset`.
    """
    d, scale, turns = detection, detection.diagonal, detection.rotation
    nowhere = {"normal": None, "offset": None}
    return {
        **opening_of(PLANAR_SCHEMA, options, shape),
        **_answer(d),
        "lines": [_placed(found.line, scale) | _held(found) for found in d.lines],
        "rotation": None if turns is None else {"order": _order(turns.order), **_held(turns)},
        # `excess` is the smallest tolerance at which it would hold, over the tolerance asked for.
        "near_misses": [
            {
                "kind": "rotation" if m.line is None else "line",
                **(nowhere if m.line is None else _placed(m.line, scale)),
                "center": numbers(m.center, scale),
                **_turned_down(m),
            }
            for m in d.near_misses
        ],
        "undetermined": d.undetermined or None,
        "ntuples": {
            "kind": d.doublets.kind,
            "angle_rad": number(d.doublets.angle_rad),
            **_sizes(d.doublets),
            # `ratio` is None where the doublets vanish: noise over noise.
            "vectors": [
                {
                    "orders": list(v.orders),
                    "singular_values": numbers(v.singular_values, 1.0),
                    "ratio": None if v.vanish else number(v.ratio),
                }
                for v in d.doublets.vectors
            ],
        },
        "timings": seconds(d.timings, load_s),
    }


def subspace_record(
    detection: "SubspaceDetection", shape: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine detect --json` writes for points of 4 to 8 coordinates.

    Returns:
        Lengths in input units; a hyperplane is `normal.x = offset`; `asymmetry` and `noise` are fractions of moments,
        `miss` is a fraction of `diameter`; `incomplete` says why hyperplanes may be missing from the list;
        `reflection_group_order` is that of the group that the listed reflections generate, None if it is not known.
    """
    d = detection

    def hyperplane(found: "Hyperplane") -> Record:
        figures = {name: number(getattr(found, name), 1.0) for name in ("asymmetry", "noise", "miss")}
        return _placed(found.plane, d.diameter) | figures

    return {
        **opening_of(SUBSPACE_SCHEMA, options, shape),
        "dimension": shape.dim,
        "center": numbers(d.center, d.diameter),
        "diameter": number(d.diameter),
        "hyperplanes": [hyperplane(h) for h in d.hyperplanes],
        "rejected": [hyperplane(h) for h in d.rejected],
        "undetermined": d.undetermined or None,
        "incomplete": d.incomplete or None,
        "reflection_group_order": d.reflection_group_order,
        "ntuples": {"rank": d.fixed.rank} | _sizes(d.fixed),
        "timings": seconds(d.timings, load_s),
    }


def opening(schema: str, options: Mapping[str, Any], **sources: str) -> Record:
    """How every record begins: what it is, of what, by which version, and what was asked."""
    return {"schema": schema, **sources, "version": version("symrefine"), "options": dict(options)}


def opening_of(schema: str, options: Mapping[str, Any], shape: Shape) -> Record:
    """How every record of one object begins, with what counts of it."""
    return {**opening(schema, options, source=shape.source), "measure": shape.measure}


def _answer(d: "Detection | PlanarDetection") -> Record:
    """The group, how sure it is, what else it could be (`forgiven` of the diagonal), and where it stands."""
    return {
        "point_group": d.point_group,
        "confidence": number(d.confidence),
        "alternatives": [
            {"point_group": a.point_group, "probability": number(a.probability), "forgiven": number(a.forgiven)}
            for a in d.alternatives
        ],
        "center": numbers(d.center, d.diagonal),
        "diagonal": number(d.diagonal),
        "tolerance": number(d.tolerance),
    }


def alignment_record(
    alignment: "Alignment", source: Shape, target: Shape, *, options: Mapping[str, Any], load_s: float | None = None
) -> Record:
    """What `symrefine align --json` writes: `target ~ scale * matrix @ source + translation`, and its equivalents.

    `rms` is a fraction of the target's diagonal; `overlap` tells the shares that meet; `covariance` [6, 6] is that of a
    rotation vector (radians) and the translation, [0, 0] elsewhere than in 3-space; `free` spans the directions of the
    target within which any orthogonal map does as well. Where `misfit` is true no map takes the one onto the other,
    `status` says why, and all the rest is about the closest map that was found.
    """
    a = alignment
    size = float(np.abs(target.points).max())
    start = time.perf_counter()
    record = {
        **opening(ALIGNMENT_SCHEMA, options, source=source.source, target=target.source),
        "status": a.status,
        "misfit": bool(a.is_misfit),
        "confidence": number(a.confidence),
        "determinant": a.determinant,
        "determinant_confidence": number(a.determinant_confidence),
        "matrix": matrix(a.matrix),
        "translation": numbers(a.translation, size),
        "scale": number(a.scale),
        "scale_sigma": number(a.scale_sigma, 1.0),
        "overlap": {"source": number(a.overlap[0], 1.0), "target": number(a.overlap[1], 1.0)},
        "rms": number(a.rms, 1.0),
        "sigma_rad": number(a.sigma_rad),
        "covariance": [numbers(row, 0.0) for row in a.covariance],
        "exact": bool(a.exact),
        "observable": a.observable,
        "symmetry": a.coset.symmetry or None,
        "free": matrix(a.coset.free),
        "equivalents": [
            {"matrix": matrix(m), "translation": numbers(t, size)}
            for m, t in zip(a.coset.matrices, a.coset.translations, strict=True)
        ],
    }
    equivalents_s = time.perf_counter() - start
    return record | {"timings": seconds(dict(a.timings) | {"equivalents": equivalents_s}, load_s)}


def _classes(shape: Shape) -> Record | None:
    """How many classes the labels make, and how many points (faces, of a mesh) are in each, in the order of labels."""
    if shape.labels is None:
        return None
    sizes = np.unique(shape.labels, return_counts=True)[1].tolist()
    return {"count": len(sizes), "sizes": sizes}


def _placed(plane: Plane, scale: float) -> Record:
    """Where a mirror stands: `normal . x = offset`, the normal with the sign that all records give it."""
    sign = toward_positive(plane.normal)
    return {"normal": _direction(plane.normal), "offset": number(sign * plane.offset, scale)}


def _direction(direction: Array) -> list[float | str | None]:
    return numbers(positive(direction), 1.0)


def _held(found: Any) -> Record:
    """How well what was found holds."""
    return {"residual": _residual(found.residual), "confidence": number(found.confidence)}


def _covered(found: Any) -> Record:
    """Shares of the surface that the image supports (of what moves), contradicts and leaves unseen."""
    return {"coverage": {name: number(getattr(found.coverage, name), 1.0) for name in _COVERAGE}}


def _turned_down(miss: Any) -> Record:
    """What a near miss would be, and by how much it is none."""
    return {"order": _order(miss.order), "residual": _residual(miss.residual), "excess": number(miss.excess)}


def _sigma(direction_rad: float, place: str, length: float) -> Record:
    return {"direction_rad": number(direction_rad), place: number(length)}


def _sizes(tuples: Any) -> Record:
    return {name: numbers(getattr(tuples, name), 1.0) for name in ("singular_values", "significance")}


def _order(value: float) -> int | str:
    """An order of rotation as JSON can hold it."""
    return "inf" if math.isinf(value) else round(value)


def _residual(deviation: Deviation) -> Record:
    """The distribution of a miss, fractions of the diagonal."""
    return {name: number(getattr(deviation, name), 1.0) for name in ("mean", "p95", "p99", "max")}
