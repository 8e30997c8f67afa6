"""One depth view of many objects, judged by SymmetryNet's protocol (Shi et al., 2020): recall at a precision.

    python -m experiments.studies.single_views [--every N] [--seed N ...] [--clean] [--jobs N]

A camera looks at each object from a random side, about 10,000 rays, noisy, quantised and with flying pixels unless
`--clean`; its place is given. The true elements are the mirrors of finite groups and the axes of revolutions. One that
is told is right if it carries the points of the whole object to where a true one does: the mean distance of the two
images is at most tan 15 degrees of the farthest that the true one carries a point. Over all that is told, the surest
first, recall is read where precision falls below 95 % for the last time; the mirrors of a revolution, which are not
asked for, count for nothing if they are right. Occlusion is the share of the object that the view shows nothing of.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from experiments.objects import damage, household
from experiments.objects.built_symmetry import Truth, specimen
from experiments.objects.catalogue import catalogue
from experiments.objects.poses import Pose
from experiments.objects.shapes import sample
from experiments.studies.answers import SURE
from experiments.studies.damaged import OWN, REAL
from experiments.studies.jobs import add_jobs, in_order
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.geometry import Array, Isometry, householder, line_angle_rad, rotation, tight_diagonal
from symrefine.shape import Shape

# Of the protocol: the largest mean distance of the images, and the precision that recall is read at.
RIGHT, PRECISION = math.tan(math.radians(15.0)), 0.95
# Ends of the ranges of occlusion that are told, points of the whole object, and how near a point seen has to be.
OCCLUSION, WHOLE, SEEN_REL = (0.0, 0.6, 0.7, 0.8, 1.0), 4000, 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One object, seen once."""

    family: str
    name: str
    clean: bool
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """An element that was told: how sure, which of the true ones it is (-1 for none), and its angle to that."""

    confidence: float
    is_true: int
    error_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was found of a view: the share of the object hidden, how many elements it has, those that were told."""

    case: Case
    truth: str
    group: str
    occlusion: float
    asked: int
    told: tuple[Told, ...]


def cases(seed: int, *, clean: bool) -> list[Case]:
    """All objects that have a mirror or an axis of revolution to ask for."""
    named = [("shape", n) for n in OWN] + [("catalogue", n) for n in REAL if n in catalogue()]
    named += [("household", n) for n in household.OBJECTS]
    made = ((family, name, specimen(family, name)[1]) for family, name in named)
    return [Case(family=f, name=n, clean=clean, seed=seed) for f, n, truth in made if _elements(truth)]


def run(case: Case) -> Row:
    """Look at the object once, detect, and compare."""
    mesh, truth = specimen(case.family, case.name)
    rng = np.random.default_rng([case.seed, *case.name.encode()])
    made = damage.views(mesh, 1.0, rng, rough=not case.clean)
    pose = Pose.random(rng)
    whole = pose.of(sample(mesh, WHOLE, 0.0, rng))
    points, posed = pose.of(made.points), truth.posed(pose)
    found = detect(Shape(points=points, viewpoint=pose.of(np.asarray(made.viewpoint))))
    away = cKDTree(points).query(whole)[0]
    true = _elements(posed)
    judged = [_judged(element, sure, posed, true, whole) for element, sure in _claims(found)]
    return Row(
        case=case,
        truth=truth.group.name,
        group=("at least " if found.at_least and not found.undetermined else "") + found.point_group,
        occlusion=float((away > SEEN_REL * tight_diagonal(whole)).mean()),
        asked=len(true),
        told=tuple(t for t in judged if t.is_true < len(true)),
    )


# An element: a mirror or not, its direction [3], and a point [3] of it.
Element = tuple[bool, Array, Array]


def _elements(truth: Truth) -> list[Element]:
    """Mirrors of a finite group, or the axis of a revolution; of a ball nothing."""
    if truth.group.is_finite:
        return [(True, normal, truth.center) for normal in truth.group.mirrors()]
    return [(False, u, truth.center) for u in truth.group.continuous_axes()] if truth.group.name != "Kh" else []


def _claims(found: Detection) -> list[tuple[Element, float]]:
    """The same of a detection, each with how sure it is."""
    mirrors = [((True, p.plane.normal, p.plane.offset * p.plane.normal), p.confidence) for p in found.planes]
    round_it = [a for a in found.axes if math.isinf(a.order) and not a.improper]
    return [*mirrors, *(((False, a.axis.direction, a.axis.point), a.confidence) for a in round_it)]


def _motion(element: Element) -> Isometry:
    mirror, direction, point = element
    return Isometry.about(point, householder(direction) if mirror else rotation(direction, math.pi))


def _judged(element: Element, sure: float, truth: Truth, true: Sequence[Element], whole: Array) -> Told:
    """Which true element one is; right as well, but none that is asked for, is a mirror of a revolution."""
    mirror, direction, _ = element
    listed = bool(true) and true[0][0] == mirror
    image = _motion(element).apply(whole)
    best, which, error = RIGHT, -1, math.nan
    for index, other in enumerate(true if listed else _more(truth, element)):
        there = _motion(other).apply(whole)
        farthest = np.linalg.norm(there - whole, axis=1).max()
        if (apart := float(np.linalg.norm(image - there, axis=1).mean() / farthest)) <= best:
            best, which = apart, index if listed else len(true)
            error = math.degrees(line_angle_rad(direction, other[1]))
    return Told(confidence=sure, is_true=which, error_deg=error)


def _more(truth: Truth, element: Element) -> list[Element]:
    """The mirrors of a revolution that may be one: that through its axis nearest to it, and the one across."""
    mirror, direction, _ = element
    if truth.group.is_finite or not mirror:
        return []
    axes = truth.group.continuous_axes()
    along = sum((np.outer(u, u) for u in axes), np.zeros((3, 3))) if truth.group.name != "Kh" else np.zeros((3, 3))
    through = direction - along @ direction
    across = axes if truth.group.name in ("Cinfh", "Dinfh") else []
    normals = [*([through] if np.linalg.norm(through) > 0.5 else []), *across]
    return [(True, n / np.linalg.norm(n), truth.center) for n in normals]


def recalled(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Recall where precision last falls below `PRECISION`, the least confidence there, and the precision of all."""
    told = sorted(((t.confidence, i, t.is_true) for i, r in enumerate(rows) for t in r.told), key=lambda t: -t[0])
    right = np.cumsum([which >= 0 for _, _, which in told])
    good = np.flatnonzero(right >= PRECISION * np.arange(1, len(told) + 1))
    count = int(good[-1]) + 1 if good.size else 0
    found = {(i, which) for _, i, which in told[:count] if 0 <= which < rows[i].asked}
    least = told[count - 1][0] if count else math.nan
    return len(found) / max(sum(r.asked for r in rows), 1), least, float(right[-1]) / len(told) if told else math.nan


def called_sure(rows: Sequence[Row]) -> str:
    """How many elements were told as surely as answers are called sure, and how many of them are right."""
    sure = [t for r in rows for t in r.told if t.confidence >= SURE]
    return f"{len(sure)} told with {SURE:g} and more, {sum(t.is_true >= 0 for t in sure)} of them right"


def line(rows: Sequence[Row]) -> str:
    """The figures of some rows."""
    recall, least, precision = recalled(rows)
    errors = [t.error_deg for r in rows for t in r.told if 0 <= t.is_true < r.asked]
    each = [len({t.is_true for t in r.told if 0 <= t.is_true < r.asked}) / r.asked for r in rows]
    return (
        f"{len(rows):3d} objects, {sum(r.asked for r in rows):3d} elements: recall {recall:.2f} at precision "
        f"{PRECISION:g} (confidence {least:.2f} and more), by object {np.mean(each):.2f}; precision of all "
        f"{precision:.2f}; median error {np.median(errors or [math.nan]):.2f} deg"
    )


def main() -> None:
    """Print what was missed or is wrong, and a line for each range of occlusion."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=1, help="each so many-th object (default: %(default)s)")
    parser.add_argument("--seed", type=int, nargs="+", default=[0], help="of views, noise and poses; all together")
    parser.add_argument("--clean", action="store_true", help="no noise of the depth, no flying pixels")
    add_jobs(parser)
    options = parser.parse_args()
    rows = []
    every = [case for seed in options.seed for case in cases(seed, clean=options.clean)[:: options.every]]
    for row in in_order(run, every, options.jobs):
        rows.append(row)
        found, false = {t.is_true for t in row.told if t.is_true >= 0}, [t for t in row.told if t.is_true < 0]
        if len(found) < row.asked or false:
            sure = ", ".join(f"{t.confidence:.2f}" for t in false)
            print(
                f"{row.case.name:20s} occlusion {row.occlusion:.2f}  {row.truth:6s} -> {row.group:15s} "
                f"{len(found)}/{row.asked}{'  false: ' + sure if false else ''}",
                flush=True,
            )
    print()
    for low, high in pairwise(OCCLUSION):
        some = [r for r in rows if low < r.occlusion <= high]
        if some:
            print(f"occlusion {low:.1f} to {high:.1f}  {line(some)}")
    print(f"all                   {line(rows)}; {called_sure(rows)}")


if __name__ == "__main__":
    main()
