"""Objects with their stated symmetry: those of the project's own making, and the fetched models (`model:NAME`)."""

from dataclasses import dataclass

import numpy as np

from experiments.objects.household import OBJECTS
from experiments.objects.models import MODELS, PREFIX, available, load_model
from experiments.objects.shapes import random_pose, sample
from experiments.studies.measure import score_planes
from symrefine.detect import Detection
from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z, line_angle_rad, unit
from symrefine.shape import Shape

FORMS = ("mesh", "cloud")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exhibit:
    """An object in its own frame, and where its symmetry is.

    Attributes:
        name: with the prefix `model:` if it was fetched.
        mesh: its surface.
        group: Schoenflies symbol.
        normals: of its mirrors, in its own frame; none for a surface of revolution, which has too many to list.
        axis: direction of its axis, or None.
        centred: whether the origin lies in all mirrors and on the axis.
    """

    name: str
    mesh: Shape
    group: str
    normals: tuple[Array, ...]
    axis: Array | None
    centred: bool

    @property
    def kind(self) -> str:
        """The paper's word for what it is an example of."""
        if self.group in ("C1", "Cs"):
            return {"C1": "none", "Cs": "reflection"}[self.group]
        if self.group.endswith("v"):
            return "axial" if self.group == "Cinfv" else "b-plane"
        return "rotation"


def check_exhibit(name: str, field: str = "name") -> None:
    """Refuse a name that stands for nothing, or a model that is not fetched.

    Raises:
        InputError: with the names that exist, or how to fetch.
    """
    if name.removeprefix(PREFIX) not in (MODELS if name.startswith(PREFIX) else OBJECTS):
        raise InputError(f"{field}: value is {name!r}, expected one of {list(OBJECTS)} or {PREFIX} and {list(MODELS)}")
    if name.startswith(PREFIX) and name.removeprefix(PREFIX) not in available():
        raise InputError(
            f"{field}: {name} is not in the cache; fetch it with: python -m experiments.objects.models fetch"
        )


def exhibit(name: str) -> Exhibit:
    """The object of that name.

    Raises:
        InputError: no such object, or a model that is not fetched.
    """
    check_exhibit(name)
    if name.startswith(PREFIX):
        return _fetched(name)
    entry = OBJECTS[name]
    normals, axis = tuple(unit(n) for n in entry.normals), None if entry.axis is None else unit(entry.axis)
    return Exhibit(name=name, mesh=entry.build(), group=entry.group, normals=normals, axis=axis, centred=True)


def _fetched(name: str) -> Exhibit:
    """A model, set upright."""
    model, mesh = MODELS[name.removeprefix(PREFIX)], load_model(name.removeprefix(PREFIX))
    upright = frame_with_z(model.up)
    return Exhibit(
        name=name,
        mesh=Shape(points=mesh.points @ upright.T, faces=mesh.faces, measure=mesh.measure, source=mesh.source),
        group=model.group,
        normals=tuple(upright @ unit(n) for n in model.normals),
        axis=None if model.axis is None else upright @ unit(model.axis),
        centred=False,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """x -> scale * turn x + shift, `turn` of determinant +1."""

    turn: Array
    shift: Array
    scale: float

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Pose":
        """Any rotation, a shift of several units, a scale from a twentieth to twenty."""
        turn, shift, scale = random_pose(rng)
        return cls(turn=turn, shift=shift, scale=scale)

    def of(self, points: Array) -> Array:
        """Points [N, 3] in this pose."""
        return self.scale * points @ self.turn.T + self.shift


def observed(mesh: Shape, form: str, points: int, noise_rel: float, rng: np.random.Generator) -> Shape:
    """What is given to a method: the mesh itself, or points of it with noise of `noise_rel` diagonals, no normals."""
    return mesh if form == "mesh" else Shape(points=sample(mesh, points, noise_rel, rng))


def posed(shape: Shape, pose: Pose) -> Shape:
    """The same in another pose."""
    return Shape(points=pose.of(shape.points), faces=shape.faces, measure=shape.measure)


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
