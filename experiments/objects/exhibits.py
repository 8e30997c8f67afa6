"""Objects with their stated symmetry: those of the project's own making, and the fetched models (`model:NAME`)."""

from dataclasses import dataclass

from experiments.objects.household import OBJECTS
from experiments.objects.models import MODELS, PREFIX, available, load_model
from symrefine.errors import InputError
from symrefine.geometry import Array, frame_with_z, unit
from symrefine.shape import Shape


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
