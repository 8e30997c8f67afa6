"""Symmetry of 3-D shapes: planes, axes and point groups, detected, refined and verified.

Names are imported when they are first used, so that `import symrefine` costs nothing.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from symrefine.errors import DegenerateShapeError as DegenerateShapeError
    from symrefine.errors import InputError as InputError
    from symrefine.errors import SymrefineError as SymrefineError
    from symrefine.front.aligned import Alignment as Alignment
    from symrefine.front.derived import Completion as Completion
    from symrefine.front.derived import Symmetrized as Symmetrized
    from symrefine.front.elsewhere import PlanarDetection as PlanarDetection
    from symrefine.front.elsewhere import SubspaceDetection as SubspaceDetection
    from symrefine.front.made import complete as complete
    from symrefine.front.made import export as export
    from symrefine.front.made import symmetrize as symmetrize
    from symrefine.front.space import Detection as Detection
    from symrefine.front.verbs import align as align
    from symrefine.front.verbs import detect as detect
    from symrefine.front.verbs import report as report
    from symrefine.geometry import Axis as Axis
    from symrefine.geometry import Plane as Plane
    from symrefine.groups import PointGroup as PointGroup
    from symrefine.groups import point_group as point_group
    from symrefine.load import load as load
    from symrefine.load import load_frames as load_frames
    from symrefine.load import stream as stream
    from symrefine.load.depth import load_depth as load_depth
    from symrefine.ntuples.derive import derive as derive
    from symrefine.poses.canonicalizer import Canonicalizer as Canonicalizer
    from symrefine.poses.distance import symmetric_distance as symmetric_distance
    from symrefine.shape import Shape as Shape
    from symrefine.stream import Stream as Stream

    __version__: str

# Where each public name comes from.
_HOMES = {
    "symrefine.load": ("load", "load_frames", "stream"),
    "symrefine.load.depth": ("load_depth",),
    "symrefine.front.verbs": ("detect", "align", "report"),
    "symrefine.front.made": ("symmetrize", "complete", "export"),
    "symrefine.front.space": ("Detection",),
    "symrefine.front.elsewhere": ("PlanarDetection", "SubspaceDetection"),
    "symrefine.front.aligned": ("Alignment",),
    "symrefine.front.derived": ("Symmetrized", "Completion"),
    "symrefine.ntuples.derive": ("derive",),
    "symrefine.poses.canonicalizer": ("Canonicalizer",),
    "symrefine.poses.distance": ("symmetric_distance",),
    "symrefine.shape": ("Shape",),
    "symrefine.stream": ("Stream",),
    "symrefine.geometry": ("Plane", "Axis"),
    "symrefine.groups": ("PointGroup", "point_group"),
    "symrefine.errors": ("SymrefineError", "InputError", "DegenerateShapeError"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
__all__ = ["__version__"] + list(_HOME)


class _FrontPage(ModuleType):
    """This package: `symrefine.detect` stays the function when the module of that name is imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = import_module("importlib.metadata").version("symrefine")
    elif name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


sys.modules[__name__].__class__ = _FrontPage
