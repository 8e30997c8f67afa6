"""How a whole answer is judged: its group and all its elements against the truth, and how sure it was."""

import math
import zlib
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects.built_symmetry import Claim, Truth, holds
from experiments.objects.instances import Instance
from experiments.objects.poses import Pose
from symrefine.detection.result import Detection
from symrefine.groups import PointGroup, is_subgroup
from symrefine.shape import Shape

# What is called sure.
SURE = 0.95
# A subgroup of the truth is an honest answer up to this confidence.
HONEST = 0.9
# Of ladders: how far the axes of two groups may differ, as displaced atoms tilt them, and how far an operation may
# move an atom from one of its kind, in tolerances.
TILT_RAD, FIT = math.radians(4.0), 3.0
OUTCOMES = ("right", "undetermined", "at least", "unsure and wrong", "sure and wrong", "broke")


def fitted(name: str) -> bool:
    """Whether an object is of the half that constants may be fitted to; the other half is for reporting."""
    return zlib.crc32(name.encode()) % 2 == 0


def claims(found: Detection) -> list[tuple[Claim, float]]:
    """All elements of a detection but the inversion, and how sure it is of each."""
    planes = [
        (Claim(kind="plane", order=1.0, direction=p.plane.normal, point=p.plane.offset * p.plane.normal), p.confidence)
        for p in found.planes
    ]
    axes = [
        (
            Claim(
                kind="improper" if a.improper else "axis",
                order=a.order,
                direction=a.axis.direction,
                point=found.center if a.improper else a.axis.point,
            ),
            a.confidence,
        )
        for a in found.axes
    ]
    return [*planes, *axes]


def answer_confidence(found: Detection) -> float:
    """How sure the whole answer is; NaN where there is none."""
    return math.nan if found.undetermined else found.confidence


def outcome(found: Detection, made: Instance, pose: Pose) -> str:
    """One of `OUTCOMES` for one answer."""
    if found.undetermined:
        return "right" if made.undecidable else "undetermined"
    sure, diagonal = answer_confidence(found), pose.scale * made.diagonal
    accepted = [] if made.undecidable else [t.posed(pose) for t in made.accepted(found.tolerance)]
    there = [t for t in accepted if all_there(found, t, diagonal)]
    if any(made.subgroups or t.group.name == found.point_group for t in there):
        return "right"
    if there and sure < HONEST:
        return "at least"
    return "sure and wrong" if sure >= SURE else "unsure and wrong"


def all_there(found: Detection, truth: Truth, diagonal: float) -> bool:
    """Whether the object has all elements that a detection claims."""
    if found.inversion and not truth.group.has_inversion:
        return False
    return all(holds(truth, claim, diagonal) for claim, _ in claims(found))


def ladder_faults(found: Sequence[Detection], shape: Shape, truth: Truth) -> list[tuple[float, str]]:
    """How sure each faulty answer of a ladder was, and what is wrong with it."""
    told = [f for f in found if not f.undetermined]
    faults = []
    for before, now in zip([None, *told[:-1]], told, strict=True):
        sure, at = answer_confidence(now), f"{now.point_group} at {100 * now.tolerance:g} %"
        if not within(truth.group, now.group):
            faults.append((sure, f"{at} lacks what is exact"))
        if before is not None and not within(before.group, now.group):
            faults.append((sure, f"{at} lacks what {before.point_group} has at {100 * before.tolerance:g} %"))
        if displacement(now, shape) > FIT * now.tolerance * now.diagonal:
            faults.append((sure, f"{at} does not fit"))
    return faults


def within(part: PointGroup, whole: PointGroup, tilt_rad: float = TILT_RAD) -> bool:
    """Whether one group is, but for a small tilt, a subgroup of another; its order divides the other's (Lagrange)."""
    if part.is_finite and whole.is_finite and whole.order % part.order:
        return False
    return is_subgroup(part, whole, tilt_rad)


def displacement(found: Detection, shape: Shape) -> float:
    """Largest distance of an atom, moved by any operation, from the nearest of its kind, in units of the input."""
    assert shape.labels is not None
    points = shape.points - found.center
    group = found.group if found.group.is_finite else found.group.sampled(7)
    worst = 0.0
    for kind in np.unique(shape.labels):
        alike = points[shape.labels == kind]
        moved = np.einsum("kij,nj->kni", group.operations(), alike).reshape(-1, 3)
        worst = max(worst, float(cKDTree(alike).query(moved)[0].max()))
    return worst


def ladder_outcome(found: Sequence[Detection], doubts: Sequence[float]) -> str:
    """One of `OUTCOMES` for a ladder, from how sure its faulty answers were."""
    if all(f.undetermined for f in found):
        return "undetermined"
    if not doubts:
        return "right"
    if max(doubts) >= SURE:
        return "sure and wrong"
    return "at least" if max(doubts) < HONEST else "unsure and wrong"
