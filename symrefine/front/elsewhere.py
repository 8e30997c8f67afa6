"""What was found elsewhere than in space: in the plane, and in points of four and more coordinates."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.front.answers import Found, Operations, Options
from symrefine.geometry import householder
from symrefine.ndim import SubspaceDetection as BareSubspaceDetection
from symrefine.plane import PlanarDetection as BarePlanarDetection


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PlanarDetection(Found, BarePlanarDetection):
    """What `detect` found in a picture, or in points in the plane, with a voice.

    It has all that `symrefine.plane.detection.PlanarDetection` has.
    """

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.records import planar_record

        return planar_record(self, self.shape, options=options, load_s=load_s)

    def operations(self) -> Operations:
        """Operations of the group [N, 3, 3] in the units of the input.

        Raises:
            InputError: nothing is decided, or the group is continuous.
        """
        _check_decided(self)
        return Operations.about(self.group.operations(), self.center)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SubspaceDetection(Found, BareSubspaceDetection):
    """What `detect` found in points of four to eight coordinates, with a voice.

    It has all that `symrefine.ndim.detection.SubspaceDetection` has.
    """

    def _record(self, options: Options, load_s: float | None) -> dict[str, Any]:
        from symrefine.export.records import subspace_record

        return subspace_record(self, self.shape, options=options, load_s=load_s)

    def operations(self) -> Operations:
        """The identity and the reflections that are listed [N, n+1, n+1]; they generate the rest.

        Raises:
            InputError: nothing is decided.
        """
        _check_decided(self)
        mirrors = [householder(h.plane.normal) for h in self.hyperplanes]
        return Operations.about(np.array([np.eye(len(self.center)), *mirrors]), self.center)


def _check_decided(found: PlanarDetection | SubspaceDetection) -> None:
    if found.undetermined:
        raise InputError(f"{found.shape.source}: no operations: {found.undetermined}")
