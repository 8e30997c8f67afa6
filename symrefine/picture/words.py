"""What a point group means, in words a person reads."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from symrefine.detection.result import Detection
from symrefine.geometry import Array, positive
from symrefine.groups import PointGroup
from symrefine.surface.misses import LIMITS

if TYPE_CHECKING:
    from symrefine.ndim import SubspaceDetection
    from symrefine.plane import PlanarDetection

# By what something is turned down that the tolerance allows.
MORE = "more than objects mostly do that are meant to have it"
_NAMED = {
    "C1": "no symmetry",
    "Cs": "one mirror plane",
    "Ci": "an inversion centre, no mirror plane",
    "Cinfv": "surface of revolution",
    "Dinfh": "surface of revolution with a mirror plane across its axis",
    "K": "the rotations of a sphere, no mirror plane",
    "Kh": "sphere",
    "D2": "three two-fold axes at right angles, no mirror plane",
    "D2h": "three mirror planes at right angles",
    "T": "the rotations of a tetrahedron, no mirror plane",
    "Td": "the full symmetry of a tetrahedron",
    "Th": "the rotations of a tetrahedron and an inversion centre",
    "O": "the rotations of a cube, no mirror plane",
    "Oh": "the full symmetry of a cube",
    "I": "the rotations of an icosahedron, no mirror plane",
    "Ih": "the full symmetry of an icosahedron",
}
_AXIAL = {
    "C": "{axis}, no mirror plane",
    "Cv": "{mirrors} through {axis}",
    "Ch": "{axis} with a mirror plane across it",
    "S": "{rotoreflection}, no mirror plane",
    "D": "{axis} and {half_turns} across it, no mirror plane",
    "Dh": "{mirrors} through {axis} and one across it",
    "Dd": "{mirrors} through {axis}, {half_turns} between them",
}
_COUNTS = "no one two three four five six seven eight nine ten eleven twelve".split()
# What the rank of the n-tuples allows.
TUPLES = {
    "none": "span space: no mirror plane and no axis is possible",
    "plane": "lie in one plane, within their noise: a mirror plane at most",
    "axis": "lie on one line, within their noise: where to look first",
    "vanish": "all vanish, within their noise: every direction is looked at",
}
# What the rank of the doublets allows in the plane.
DOUBLETS = {
    "none": "span the plane: no exact mirror line and no turn",
    "line": "lie on one line: a mirror line at most",
    "centre": "all vanish: turns, with or without mirror lines",
}
# Where somebody said that there is a floor.
NO_FLOOR = "no floor was found: no plane has all else to one side of it and reaches beyond that"
_KINDS = {"plane": "mirror plane", "axis": "rotation", "improper": "rotoreflection", "inversion": "inversion"}


def sentence(text: str) -> str:
    """A message as a sentence."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def headline(detection: Detection) -> str:
    """The result in one line: the group with its meaning, or why there is none."""
    if detection.undetermined:
        return f"Undetermined: {detection.undetermined}"
    least = "At least " if detection.at_least else ""
    return f"{least}{symbol(detection.point_group)}: {meaning(detection.group)}"


def planar_headline(detection: "PlanarDetection") -> str:
    """The same of an object in the plane."""
    if detection.undetermined:
        return f"Undetermined: {detection.undetermined}"
    return f"{detection.point_group}: {detected_lines(detection)}"


def detected_lines(detection: "PlanarDetection") -> str:
    """What the lines and turns that were found in the plane come to."""
    turns = detection.rotation
    return planar_meaning(detection.point_group, len(detection.lines), None if turns is None else turns.order)


def planar_meaning(group: str, lines: int, turns: float | None) -> str:
    """What a group of the plane comes to: so many mirror lines, and turns of some order, if there are any."""
    if group in ("C1", "O(2)", "SO(2)"):
        return {"C1": "no symmetry", "O(2)": "round"}.get(group, "all turns, no mirror line")
    mirrors = count(lines, "mirror line") if lines else "no mirror line"
    return mirrors + ("" if turns is None else f", {turns_name(turns)}")


def turns_name(order: float) -> str:
    """What the turns of an object in the plane are called."""
    return "all turns" if math.isinf(order) else f"turns of order {round(order)}"


def subspace_headline(detection: "SubspaceDetection") -> str:
    """How many hyperplanes of symmetry there are, and the order of the group they generate."""
    if detection.undetermined:
        return f"Undetermined: {detection.undetermined}"
    number, dim = len(detection.hyperplanes), len(detection.center)
    if not number:
        return f"None: no hyperplane of symmetry in {dim} dimensions"
    order = detection.reflection_group_order
    group = "" if order is None else f"; {generated(number, order)}"
    return f"{number}: {'hyperplane' if number == 1 else 'hyperplanes'} of symmetry in {dim} dimensions{group}"


def generated(hyperplanes: int, order: int) -> str:
    """What the reflections in some hyperplanes generate."""
    return (
        f"{'its reflection generates' if hyperplanes == 1 else 'their reflections generate'} a group of order {order:,}"
    )


def symbol(name: str) -> str:
    """Schoenflies symbol with its infinity: Cinfv becomes C∞v."""
    return name.replace("inf", "∞")


def meaning(group: PointGroup) -> str:
    """What a point group stands for."""
    if group.name in _NAMED:
        return _NAMED[group.name]
    fold = group.symbol.fold
    if math.isinf(fold):
        return "surface of revolution"
    n = int(fold)
    return _AXIAL[group.symbol.family].format(
        axis=f"{_fold(n)} axis",
        rotoreflection=f"{_fold(2 * n)} rotoreflection axis",
        mirrors=count(n, "mirror plane"),
        half_turns=count(n, "two-fold axis", "two-fold axes"),
    )


def _fold(n: int) -> str:
    article = "an" if n in (8, 11, 18) or 80 <= n < 90 else "a"
    return f"{article} {_spelt(n)}-fold"


def fit(detection: Detection) -> str:
    """How well what was found holds, in one sentence; empty when nothing was found."""
    misses = [p.residual.p95 for p in detection.planes] + [a.residual.p95 for a in detection.axes]
    misses += [] if detection.inversion_residual is None else [detection.inversion_residual.p95]
    if not misses or detection.undetermined:
        return ""
    each = "it" if len(misses) == 1 else "each of them"
    body = body_name(detection.surface.cloud.body)
    meets = "meets itself" if body == "surface" else "meet their images"
    return (
        f"Under {each}, 95 % of the {body} {meets} within {percent(max(*misses, 1e-4))} of the diagonal, "
        f"where the tolerance of {percent(detection.tolerance)} allows {percent(LIMITS[1] * detection.tolerance)}."
    )


def body_name(body: str) -> str:
    """What misses its image: the surface, or points that stand for themselves or for a volume."""
    return "surface" if body == "surface" else "points"


def more_for(*, strewn: bool, sparse: bool) -> str:
    """Why there may be more symmetry than was found."""
    if strewn:
        return "strays that are left near the surface may hide more"
    if sparse:
        return (
            "its points are carried onto one another, so they stand for themselves; if samples of a surface were "
            "copied so, there may be more (--isolated says that none were)"
        )
    return "parts of the surface were not seen: there may be more"


def scanned(detection: Detection) -> str:
    """What is to be said of the points: how exact vertices are, outliers, parts that were not seen; or nothing."""
    d = detection
    of = None if d.sample is None else (d.sample.points, d.sample.of)
    exact = "" if d.exact is None else exactly(d.exact.miss, d.exact.faces, d.exact.point_group)
    apart = taken_out(len(d.outliers), d.outlier_share, d.clumps, floor=d.floor is not None)
    told = exact, apart, NO_FLOOR if d.no_floor else "", sampled(of), evened(d.even_sample)
    more = more_for(strewn=d.strewn, sparse=d.sparse) if d.at_least else ""
    return " ".join(f"{t[:1].upper()}{t[1:]}." for t in (*told, more) if t)


def verdicts_told(detection: Detection) -> str:
    """What the colours of a scan mean that shows a part of an object; empty of any other."""
    if not detection.is_partial or detection.point_group == "C1":
        return ""
    return "Green: inferred, where nobody looked. Red: seen, with an image where the scan says there is nothing."


def taken_out(outliers: int, share: float, clumps: int, *, floor: bool) -> str:
    """How many points were taken as no part of the object, if any: `1,214 points (6 %) taken as outliers`."""
    parts = [part for part in ("the floor" if floor else "", count(clumps, "clump") if clumps else "") if part]
    among = f", {' and '.join(parts)} among them" if parts else ""
    return f"{outliers:,} points ({percent(share)}) taken as outliers{among}" if outliers else ""


def exactly(miss: float, faces: bool | None, group: str) -> str:
    """How exactly vertices are mapped onto vertices, and whether faces onto faces; of a cloud points onto points."""
    exact = f"exact to {miss:.1g} of the diagonal"
    if faces is None:
        return f"{exact}: {group} maps points onto points"
    if faces:
        return f"{exact}: {group} maps vertices onto vertices, faces onto faces"
    return f"{exact} in its vertices, which {group} maps onto one another; not its faces"


def sampled(sample: tuple[int, int] | None) -> str:
    """How many points were looked at, and of how many, where that was not all of them."""
    return "" if sample is None else f"the surface is known by {sample[0]:,} of {sample[1]:,} points, drawn at random"


def evened(sample: int | None) -> str:
    """By how many points it was decided, where that was not all of them."""
    return "" if sample is None else f"the density differs: decided by {sample:,} points, more evenly spread"


def as_well(excess: float) -> bool:
    """Whether what was turned down misses by nothing: it holds as well as what was found, which excludes it."""
    return round(excess, 2) == 0.0


def exceeds(excess: float) -> str:
    """How many times something exceeds what the tolerance allows; of what nothing tells that was seen, that."""
    return "unseen" if math.isinf(excess) else f"{excess:.2f}"


def turned_down(excess: float, tolerance: float, group: str) -> str:
    """Why something was turned down where a group was found, in a sentence."""
    if math.isinf(excess):
        return "It was turned down: nothing that was seen tells of it."
    if as_well(excess) and group != "C1":
        return "It holds as well as what was found, and the two exclude one another."
    told = f"It was turned down: {excess:.2f} times what a tolerance of {percent(tolerance)} allows"
    if excess >= 1.0:
        return f"{told}."
    excluded = "" if group == "C1" else "excludes what was found, or "
    return f"{told}; it {excluded}misses by {MORE}."


def all_turned_down(excesses: Sequence[float], group: str) -> Iterator[str]:
    """The same of all near misses, in sentences about a column `x limit`."""
    yield "Near misses were refined and turned down: they miss by `x limit` times what the tolerance allows."
    if any(map(math.isinf, excesses)):
        yield "Of what is `unseen` nothing tells that was seen: all would have to be believed."
    if group != "C1" and any(map(as_well, excesses)):
        yield "One of 0.00 holds as well as what was found: the two exclude one another."
    elif min(excesses) < 1.0:
        excluded = "" if group == "C1" else "exclude what was found, or "
        yield f"Those below 1 {excluded}miss by {MORE}."


def elsewhere(group: str, confidence: float, each: Sequence[float]) -> str:
    """That a group is surer than where it stands, if it is surer than any of its elements; else nothing."""
    if not each or max(each) >= confidence:
        return ""
    return f"That it is {group} is surer than where: it may stand elsewhere as well, and not in two places at once."


def kind_name(kind: str, order: float = 0.0) -> str:
    """What an element is called: a plane, an axis, an improper one, the inversion."""
    return "revolution" if kind == "axis" and math.isinf(order) else _KINDS[kind]


def percent(fraction: float) -> str:
    """A fraction to two significant digits, in percent."""
    if 0.0 < fraction < 1e-4:
        return "less than 0.01 %"
    return f"{100.0 * fraction:.{2 if fraction < 0.995 else 3}g} %"


def count(number: int, noun: str, plural: str = "") -> str:
    """A number with its noun."""
    return f"{_spelt(number)} {noun if number == 1 else plural or noun + 's'}"


def _spelt(number: int) -> str:
    return _COUNTS[number] if number < len(_COUNTS) else str(number)


def order_name(order: float, improper: bool = False) -> str:
    """Symbol of an axis: C4, S8, C∞."""
    return ("S" if improper else "C") + ("∞" if math.isinf(order) else str(round(order)))


def direction(vector: Array) -> str:
    """A unit vector in brackets, turned so that its first component of some size is positive."""
    return "(" + ", ".join(f"{round(float(v), 4) + 0.0:.4f}" for v in positive(vector)) + ")"


def length(value: float, scale: float) -> str:
    """A length, to a ten-thousandth of `scale`."""
    return coordinates([value], scale)[1:-1]


def coordinates(values: Iterable[float], scale: float) -> str:
    """A point in brackets, to a ten-thousandth of `scale`, whatever its distance from the origin."""
    digits = min(12, max(0, 4 - math.floor(math.log10(scale)))) if scale > 0 else 6
    plain = [f"{round(float(v), digits) + 0.0:.{digits}f}" for v in values]
    return "(" + ", ".join(p if len(p) < 18 else f"{float(v):.9g}" for p, v in zip(plain, values, strict=True)) + ")"
