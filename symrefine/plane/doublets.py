"""Doublets, the n-tuples of the plane, and what their singular values say (paper, "Experiments in 2D space")."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from symrefine.geometry import Array, ReadOnly
from symrefine.moments.moments import Moments
from symrefine.ntuples.contract import ntuples
from symrefine.ntuples.rank import FLOOR, fixed_subspace
from symrefine.surface.misses import TOLERANCE

# The ten vectors of moments of the paper, 56 doublets in all.
PLANAR_ORDERS = ((2, 3), (2, 5), (4, 3), (4, 5), (6, 3), (6, 5), (6, 7), (6, 9), (8, 7), (8, 9))
ORDER = max(map(max, PLANAR_ORDERS))
DoubletKind = Literal["centre", "line", "none"]
_KINDS: tuple[DoubletKind, ...] = ("centre", "line", "none")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VectorDoublets(ReadOnly):
    """The doublets of one vector of moments.

    Attributes:
        orders: of its two factors.
        doublets: [T, 2] scaled, |v| <= 1.
        singular_values: [2].
        vanish: whether noise and tolerance explain them; their ratio then means nothing.
    """

    orders: tuple[int, int]
    doublets: Array
    singular_values: Array
    vanish: bool

    @property
    def ratio(self) -> float:
        """Larger over smaller singular value: the larger, the closer the doublets are to a line; inf on a line."""
        large, small = self.singular_values
        # What is smaller than that is rounding, another on each processor.
        return float(large / small) if small > 1e-10 * large else float("inf")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DoubletClass(ReadOnly):
    """What all doublets together say.

    Attributes:
        kind: "centre" (all vanish: a turn, or no more than the tolerance), "line" (rank 1: a mirror line at most, along
            `angle_rad`), "none" (rank 2: no symmetry beyond the tolerance).
        singular_values: [2] of all scaled doublets.
        significance: [2] the same over what noise and tolerance alone give.
        angle_rad: direction of the line the doublets are closest to, in [0, pi).
        vectors: the same for each vector of moments.
    """

    kind: DoubletKind
    singular_values: Array
    significance: Array
    angle_rad: float
    vectors: tuple[VectorDoublets, ...]


def classify_doublets(moments: Moments, tolerance: float, pixel_noise: float) -> DoubletClass:
    """Rank of the doublets against sampling noise (jackknife), or against tolerance and pixels where they are exact.

    Args:
        moments: to order 9, with jackknife replicates for samples.
        tolerance: as a fraction of the bounding-box diagonal.
        pixel_noise: what pixels add to a moment, as a fraction of its bound; 0 for other points.
    """
    floor = float(np.hypot(FLOOR * tolerance / TOLERANCE, pixel_noise))
    fixed = fixed_subspace(ntuples(moments, PLANAR_ORDERS), floor=floor)
    along = fixed.directions[0]
    each = [(orders, ntuples(moments, [orders])) for orders in PLANAR_ORDERS]
    owns = [fixed_subspace(tuples, floor=floor) for _, tuples in each]
    return DoubletClass(
        kind=_KINDS[fixed.rank],
        singular_values=fixed.singular_values,
        significance=fixed.significance,
        angle_rad=float(np.arctan2(along[1], along[0]) % np.pi),
        vectors=tuple(
            VectorDoublets(
                orders=orders, doublets=tuples.vectors, singular_values=own.singular_values, vanish=own.rank == 0
            )
            for (orders, tuples), own in zip(each, owns, strict=True)
        ),
    )
