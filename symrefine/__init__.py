"""Symmetry of 3-D shapes: planes, axes and point groups, detected, refined and verified.

Names are imported when they are first used, so that `import symrefine` costs nothing.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from symrefine.align.story import Alignment, align
    from symrefine.detection.result import Detection
    from symrefine.detection.story import detect
    from symrefine.errors import DegenerateShapeError, InputError, SymrefineError
    from symrefine.geometry import Axis, Plane
    from symrefine.groups import PointGroup, point_group
    from symrefine.load import load
    from symrefine.ntuples.derive import derive
    from symrefine.shape import Shape

    __version__: str

__all__ = [
    "load",
    "detect",
    "align",
    "derive",
    "Shape",
    "Plane",
    "Axis",
    "PointGroup",
    "point_group",
    "Detection",
    "Alignment",
    "SymrefineError",
    "InputError",
    "DegenerateShapeError",
    "__version__",
]

_HOMES = {
    "symrefine.align.story": ("Alignment", "align"),
    "symrefine.detection.result": ("Detection",),
    "symrefine.detection.story": ("detect",),
    "symrefine.errors": ("DegenerateShapeError", "InputError", "SymrefineError"),
    "symrefine.geometry": ("Axis", "Plane"),
    "symrefine.groups": ("PointGroup", "point_group"),
    "symrefine.load": ("load",),
    "symrefine.ntuples.derive": ("derive",),
    "symrefine.shape": ("Shape",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


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
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _FrontPage
