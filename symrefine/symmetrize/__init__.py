"""The nearest exactly symmetric shape: `nearest` (the story), `leftover` and `surface` (its parts)."""

from symrefine.fit.finite import placed_subgroup
from symrefine.symmetrize.nearest import Symmetrized, exact_place, symmetrize

__all__ = ["Symmetrized", "exact_place", "placed_subgroup", "symmetrize"]
