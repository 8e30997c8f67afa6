"""What was found in a picture, or in points in the plane."""

from dataclasses import dataclass
from typing import Any

from symrefine.errors import InputError
from symrefine.front.answers import Found, Operations, Options
from symrefine.plane import PlanarDetection as BarePlanarDetection
from symrefine.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PlanarDetection(Found, BarePlanarDetection):
    """What `detect` found in a picture, or in points in the plane, with a voice.

    It has all that `symrefine.plane.detection.PlanarDetection` has.

    Attributes:
        shape: what it was found in.
        options: what it was asked with.
    """

    shape: Shape
    options: Options

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.records import planar_record

        return planar_record(self, self.shape, options=options, load_s=load_s)

    def operations(self) -> Operations:
        """Operations of the group [N, 3, 3] in the units of the input.

        Raises:
            InputError: nothing is decided, or the group is continuous.
        """
        if self.undetermined:
            raise InputError(f"{self.shape.source}: no operations: {self.undetermined}")
        return Operations.about(self.group.operations(), self.center)
