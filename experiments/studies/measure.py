"""How a detection is compared with the truth: one place for every experiment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.detect import Detection
from symrefine.geometry import Array, line_angle_rad

FOUND_DEG = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneScore:
    """True planes found, false ones reported, and the largest angle error in degrees over those found."""

    found: int
    true: int
    false: int
    worst_deg: float


def score_planes(detection: Detection, normals: Sequence[Array]) -> PlaneScore:
    """Compare the planes of a detection with the true normals; a plane counts as found within 5 degrees."""
    angles = np.array(
        [[np.degrees(line_angle_rad(p.plane.normal, n)) for n in normals] for p in detection.planes]
    ).reshape(len(detection.planes), len(normals))
    if angles.size == 0:
        return PlaneScore(found=0, true=len(normals), false=len(detection.planes), worst_deg=float("nan"))
    nearest = angles.min(axis=1)
    matched = {int(i) for i, a in zip(angles.argmin(axis=1), nearest, strict=True) if a < FOUND_DEG}
    worst = float(nearest[nearest < FOUND_DEG].max()) if matched else float("nan")
    return PlaneScore(
        found=len(matched), true=len(normals), false=len(detection.planes) - len(matched), worst_deg=worst
    )


def bundle_normals(fold: int, rotation: Array) -> list[Array]:
    """Normals of the mirrors of C_fold,v with its axis on z and one mirror holding x, after a rotation."""
    angles = np.pi * np.arange(fold) / fold
    return [rotation @ np.array([-np.sin(a), np.cos(a), 0.0]) for a in angles]
