"""What was found and what was turned down, one by one: as rows of the list, and as what the script draws and copies."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symrefine.detection.result import Detection, FoundAxis
from symrefine.fit.placed import FREE_TURNS, wide_angle_rad
from symrefine.geometry import Array, Isometry, Plane, ReadOnly, householder, rotation, rotoreflection, toward_positive
from symrefine.picture.palette import AXIS, MISS
from symrefine.picture.rows import SAME_LINE_RAD, Row, found_rows, near_miss_rows
from symrefine.picture.scene import Line, Quad, Scene
from symrefine.picture.words import body_name, length, order_name, percent, turned_down
from symrefine.report.markup import homogeneous_rows, rounded

# Cosine of the angle up to which two axes are one line.
SAME_LINE = math.cos(SAME_LINE_RAD)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Element(ReadOnly):
    """A mirror plane, an axis or the inversion, found or turned down.

    Attributes:
        row: its name, colour and misses.
        kind: "plane", "axis", "improper" or "inversion".
        missed: whether it was turned down.
        direction: [3] its normal or direction, with the sign that the JSON report gives it.
        point: [3] a point that it leaves in place, input units.
        place: where it stands, in words.
        order: of the axis; infinite for revolution.
        quad: what is drawn of a plane.
        line: what is drawn of an axis.
        coverage: what a scan says of it, in words; empty where there is nothing to say.
    """

    row: Row
    kind: str
    missed: bool
    direction: Array
    point: Array
    place: str
    order: float
    quad: Quad | None = None
    line: Line | None = None
    coverage: str = ""

    @property
    def title(self) -> str:
        """What it is called above its figures."""
        if self.missed:
            return f"Near miss {self.row.name}: {self.row.kind}"
        kind = self.row.kind.capitalize()
        return kind if self.kind == "inversion" else f"{kind} {self.row.name}"

    @property
    def angle_rad(self) -> float:
        """Turn that shows best what an axis does: of the smallest one hardly anything can be seen."""
        if self.kind not in ("axis", "improper"):
            return 0.0
        return float(FREE_TURNS[-1]) if math.isinf(self.order) else wide_angle_rad(round(self.order))

    def motion(self, angle_rad: float) -> Isometry:
        """The operation in input units, an axis turning by an angle."""
        turns: dict[str, Callable[[], Array]] = {
            "plane": lambda: householder(self.direction),
            "axis": lambda: rotation(self.direction, angle_rad),
            "improper": lambda: rotoreflection(self.direction, angle_rad),
            "inversion": lambda: -np.eye(3),
        }
        return Isometry.about(self.point, turns[self.kind]())

    def matrix(self, diagonal: float) -> Any:
        """4x4 of the operation in input units, an axis turning by the smallest angle; None for revolution."""
        if math.isinf(self.order):
            return None
        return homogeneous_rows(self.motion(2.0 * math.pi / max(self.order, 1.0)), diagonal)


def space_elements(detection: Detection, scene: Scene) -> list[Element]:
    """Planes, axes and the inversion as the detection lists them, then the near misses."""
    d, rows = detection, found_rows(detection)
    planes = [
        _plane(row, found.plane, quad, d.diagonal, missed=False, coverage=_covered(d, found.coverage))
        for row, found, quad in zip(rows, d.planes, scene.planes, strict=False)
    ]
    axes = [_axis(d, scene, row, found) for row, found in zip(rows[len(d.planes) :], d.axes, strict=False)]
    central = [
        Element(row=row, kind="inversion", missed=False, direction=np.zeros(3), point=d.center, place="", order=2.0)
        for row in rows[len(d.planes) + len(d.axes) :]
    ]
    return [*planes, *axes, *central, *_missed(d, scene)]


def _plane(row: Row, plane: Plane, quad: Quad, diagonal: float, *, missed: bool, coverage: str = "") -> Element:
    sign = toward_positive(plane.normal)
    return Element(
        row=row,
        kind="plane",
        missed=missed,
        direction=sign * plane.normal,
        point=plane.offset * plane.normal,
        place=f"offset {length(sign * plane.offset, diagonal)}",
        order=1.0,
        quad=quad,
        coverage=coverage,
    )


def _axis(d: Detection, scene: Scene, row: Row, found: FoundAxis) -> Element:
    name, direction = order_name(found.order, found.improper), found.axis.direction
    beside = [line for line in scene.axes if abs(_along(line) @ direction) > SAME_LINE]
    mark = beside[0].mark if beside else np.zeros((0, 3))
    line = scene.stage.line(found.axis.point, direction, name, AXIS, found.order)
    return Element(
        row=row,
        kind="improper" if found.improper else "axis",
        missed=False,
        direction=toward_positive(direction) * direction,
        point=found.axis.point,
        place="through the centre",
        order=found.order,
        line=Line(ends=line.ends, name=name, colour=AXIS, order=found.order, mark=mark),
        coverage=_covered(d, found.coverage),
    )


def _missed(d: Detection, scene: Scene) -> list[Element]:
    quads = {quad.name.split()[-1]: quad for quad in scene.missed_planes}
    lines = {line.name.split(",")[0].split()[-1]: line for line in scene.missed_axes}
    made = []
    for row, miss in zip(near_miss_rows(d), d.near_misses, strict=True):
        if miss.kind == "plane":
            plane = Plane(normal=miss.direction, offset=float(miss.direction @ miss.point))
            made.append(_plane(row, plane, quads[row.name], d.diagonal, missed=True))
            continue
        made.append(
            Element(
                row=row,
                kind=miss.kind,
                missed=True,
                direction=toward_positive(miss.direction) * miss.direction,
                point=miss.point,
                place="",
                order=miss.order,
                line=lines.get(row.name),
            )
        )
    return made


def _along(line: Line) -> Array:
    span = line.ends[1] - line.ends[0]
    return np.asarray(span / np.linalg.norm(span))


def _covered(d: Detection, coverage: Any) -> str:
    if not d.is_partial:
        return ""
    return (
        f"{100 * coverage.supported:.0f} % of the surface support it, {100 * coverage.contradicted:.2g} % contradict "
        f"it, the images of {100 * coverage.unseen:.0f} % lie where nobody looked."
    )


def drawn(elements: Sequence[Element], detection: Detection, scene: Scene) -> list[dict[str, Any]]:
    """The elements as the script draws them: relative to the centre, in diagonals."""
    center, diagonal = detection.center, detection.diagonal
    labels = _labels(elements, scene)
    main = {line.name.split()[0] for line in scene.main_axes}
    found = []
    for element, label in zip(elements, labels, strict=True):
        shown = not scene.crowded or (element.kind == "axis" and element.row.name in main)
        found.append(
            {
                "title": element.title,
                "label": label,
                "kind": element.kind,
                "missed": element.missed,
                "shown": shown and not element.missed,
                "colour": list(MISS if element.missed else element.row.colour),
                "axis": rounded(element.direction),
                "point": rounded((element.point - center) / diagonal),
                "angle": rounded(element.angle_rad),
                "order": None if math.isinf(element.order) else round(element.order),
                "corners": None if element.quad is None else _short(element.quad.corners / diagonal),
                "ends": None if element.line is None else _short(element.line.ends / diagonal),
                "mark": [] if element.line is None else _short(element.line.mark / diagonal),
                "told": told(element, detection, body_name(detection.surface.cloud.body)),
                "matrix": element.matrix(diagonal),
            }
        )
    return found


def told(element: Element, detection: Detection, body: str) -> str:
    """What there is to say of an element, in sentences."""
    miss = element.row.residual
    said = f"95 % of the {body} meet their image within {percent(miss.p95)}, the worst within {percent(miss.max)}."
    if element.missed:
        said += f" {turned_down(element.row.score, detection.tolerance, detection.point_group)}"
    return f"{said} {element.coverage}".rstrip()


def _labels(elements: Sequence[Element], scene: Scene) -> list[str]:
    """Names in the model: axes on one line share the label of the rotation."""
    lines, free = scene.axes, [line.name for line in scene.axes]
    labels = [element.row.name if element.kind == "plane" else "" for element in elements]
    for index, element in sorted(enumerate(elements), key=lambda pair: pair[1].kind == "improper"):
        if element.missed or element.line is None:
            continue
        same = [k for k, line in enumerate(lines) if abs(_along(line) @ element.direction) > SAME_LINE]
        labels[index] = free[same[0]] if same else ""
        for k in same:
            free[k] = ""
    return labels


def _short(values: Array) -> Any:
    """To a millionth of the diagonal: enough for what is only drawn."""
    return np.round(values, 6).tolist()
