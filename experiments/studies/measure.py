"""How a detection is compared with the truth: one place for every experiment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.objects.exhibits import Exhibit
from experiments.objects.poses import Pose
from symrefine.detection.result import Detection
from symrefine.geometry import Array, line_angle_rad

FOUND_DEG = 5.0
# Of a plane's distance from the true one, in diagonals.
FOUND_REL = 0.02


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """A detection against what is stated; angles in degrees and `offset_rel` in diagonals are NaN without a truth.

    Attributes:
        right: group right, every mirror found, none false.
        worst_deg: largest angle between what was found and what is true, planes and axis.
        offset_rel: largest distance of the origin, which lies in every true plane, from the planes found.
    """

    right: bool
    found: int
    true: int
    false: int
    worst_deg: float
    offset_rel: float


def judge(detection: Detection, truth: Exhibit, pose: Pose) -> Score:
    """Compare what was found in a pose with the stated symmetry."""
    planes = score_planes(detection, [pose.turn @ n for n in truth.normals])
    angles = [planes.worst_deg]
    if truth.axis is not None and detection.axes:
        angles.append(float(np.degrees(line_angle_rad(detection.axes[0].axis.direction, pose.turn @ truth.axis))))
    offsets = _offsets(detection, pose.shift) / detection.diagonal if truth.centred else np.empty(0)
    return Score(
        right=detection.point_group == truth.group and planes.found == planes.true and planes.false == 0,
        found=planes.found,
        true=planes.true,
        false=planes.false,
        worst_deg=float(np.nanmax(angles)) if not np.isnan(angles).all() else float("nan"),
        offset_rel=float(offsets.max()) if offsets.size else float("nan"),
    )


def _offsets(detection: Detection, origin: Array) -> Array:
    """Distances of a point from all planes and axes found."""
    planes = [abs(float(p.plane.signed_distance(origin))) for p in detection.planes]
    axes = [np.linalg.norm(np.cross(origin - a.axis.point, a.axis.direction)) for a in detection.axes]
    return np.array([*planes, *axes])
