"""The subspace that the symmetries of an object fix, in any dimension: the rank of its n-tuples.

Every n-tuple turns with the object, so each lies in the subspace that all its symmetries leave in place, and
generically they span it (paper, section "Reflection transformation and symmetry"). Rank n: no symmetry at all;
rank n - 1: a reflection at most, whose hyperplane holds all n-tuples; rank 0: too much symmetry for n-tuples to tell.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from symrefine.geometry import Array, ReadOnly
from symrefine.ntuples.contract import NTuples

TupleKind = Literal["none", "plane", "axis", "vanish"]

# A singular value speaks when it exceeds what sampling noise alone gives by this factor. The n-tuples share few
# moments, so that noise alone exceeds 2 in one cloud of twenty.
SIGNIFICANT = 3.0
# ... and, for exact moments, 0.004 of the bound |v| <= 1, a fifth of the tolerance of 2 %: below it a miss is a matter
# of the tolerance. It counts like noise, so that a singular value must exceed it as many times.
FLOOR = 0.004 / SIGNIFICANT


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixedSubspace(ReadOnly):
    """What the singular values of the n-tuples say.

    Attributes:
        rank: dimension of the subspace that the symmetries fix, as far as the n-tuples tell.
        singular_values: [n] of the scaled n-tuples.
        significance: [n] singular values, each n-tuple weighted by its noise, over what noise and tolerance alone give.
        directions: [n, n] right singular vectors as rows: the first `rank` span the subspace; in space the first spans
            the axis, the last is the plane's normal.
    """

    rank: int
    singular_values: Array
    significance: Array
    directions: Array

    @property
    def kind(self) -> TupleKind:
        """In space: "none" (rank 3, C1), "plane" (rank 2, Cs), "axis" (rank 1, Cn or Cnv), "vanish" (all else)."""
        kinds: tuple[TupleKind, ...] = ("vanish", "axis", "plane", "none")
        return kinds[self.rank]


def fixed_subspace(tuples: NTuples, *, floor: float = FLOOR) -> FixedSubspace:
    """Rank of the n-tuples against the sampling noise of their singular values (method.md, section 3).

    Tuples are weighted by their own noise first, so that no noisy high order drowns a precise low one.

    Args:
        tuples: with jackknife replicates, or without where the moments are exact.
        floor: what an n-tuple of bound 1 may differ by even then.
    """
    dim = tuples.vectors.shape[1]
    weights = 1.0 / np.hypot(tuples.noise, floor)
    _, values, directions = np.linalg.svd(tuples.vectors * weights[:, None], full_matrices=True)
    allowed = np.hypot(tuples.noise_along(directions, weights), math.sqrt(len(weights)) * floor * weights.min())
    significance = _padded(values, dim) / allowed
    below = np.flatnonzero(significance <= SIGNIFICANT)
    return FixedSubspace(
        rank=int(below[0]) if below.size else dim,
        singular_values=_padded(np.linalg.svd(tuples.vectors, compute_uv=False), dim),
        significance=significance,
        directions=directions,
    )


def _padded(values: Array, dim: int) -> Array:
    return np.pad(values, (0, dim - len(values)))
