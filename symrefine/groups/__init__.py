"""Point groups of 3-space: names, exact operations and elements, closure of noisy ones, fitted frames."""

from symrefine.groups.closure import Closure, close
from symrefine.groups.elements import from_elements
from symrefine.groups.identify import identify
from symrefine.groups.names import MAX_FOLD
from symrefine.groups.plane import PointGroup2D
from symrefine.groups.point_group import PointGroup, fixed_subspace, is_subgroup, point_group
from symrefine.groups.standard import OrderedAxis

__all__ = [
    "MAX_FOLD",
    "Closure",
    "OrderedAxis",
    "PointGroup",
    "PointGroup2D",
    "close",
    "fixed_subspace",
    "from_elements",
    "identify",
    "is_subgroup",
    "point_group",
]
