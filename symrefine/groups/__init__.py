"""Point groups of 3-space: names, exact operations and elements, closure of noisy ones, fitted frames."""

from symrefine.groups.closure import close
from symrefine.groups.elements import from_elements
from symrefine.groups.identify import identify
from symrefine.groups.names import MAX_FOLD, TURNS
from symrefine.groups.point_group import PointGroup, is_subgroup, point_group

__all__ = ["MAX_FOLD", "TURNS", "PointGroup", "close", "from_elements", "identify", "is_subgroup", "point_group"]
