"""Rank of the n-tuples against their sampling noise: the dimension of the subspace that the symmetry group fixes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from symrefine.geometry import Array, read_only
from symrefine.ntuples.contract import NTuples

TupleKind = Literal["none", "plane", "axis", "vanish"]

# A singular value speaks when it exceeds what sampling noise alone gives by this factor.
SIGNIFICANT = 3.0
# ... and, for exact moments, twice this fraction of the bound |v| <= 1: below it the miss is a matter of the tolerance.
FLOOR = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TupleClass:
    """What the singular values of the n-tuples say: the dimension of the subspace the symmetry group fixes.

    Attributes:
        kind: "none" (rank 3, C1), "plane" (rank 2, Cs), "axis" (rank 1, Cn or Cnv), "vanish" (rank 0, all else).
        singular_values: [3] of the scaled tuples.
        significance: [3] each divided by its standard deviation under sampling noise (inf where moments are exact).
        directions: [3, 3] right singular vectors as rows: the first spans the axis, the last is the plane's normal.
    """

    kind: TupleKind
    singular_values: Array
    significance: Array
    directions: Array

    def __post_init__(self) -> None:
        for name in ("singular_values", "significance", "directions"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def classify(tuples: NTuples) -> TupleClass:
    """Rank of the n-tuples against the sampling noise of their singular values (method.md, section 3).

    Tuples are weighted by their own noise first, so that no noisy high order drowns a precise low one.
    """
    noise = tuples.noise
    weights = 1.0 / np.sqrt(noise**2 + FLOOR**2)
    weighted = tuples.vectors * weights[:, None]
    _, values, directions = np.linalg.svd(weighted, full_matrices=True)
    values = np.pad(values, (0, 3 - len(values)))
    sigma = tuples.noise_along(directions, weights)
    significance = values / np.hypot(sigma, np.sqrt(len(weighted)) * FLOOR * weights.min() / 1.5)
    rank = int((significance > SIGNIFICANT).sum())
    kinds: tuple[TupleKind, ...] = ("vanish", "axis", "plane", "none")
    return TupleClass(
        kind=kinds[rank],
        singular_values=np.linalg.svd(tuples.vectors, compute_uv=False)[:3],
        significance=significance,
        directions=directions,
    )
