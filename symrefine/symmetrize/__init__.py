"""The nearest exactly symmetric shape: `nearest` (the story), `counterparts` and `surface` (its parts), `subgroup`."""

from symrefine.symmetrize.nearest import Symmetrized, exact_place, symmetrize
from symrefine.symmetrize.subgroup import placed_subgroup

__all__ = ["Symmetrized", "exact_place", "placed_subgroup", "symmetrize"]
