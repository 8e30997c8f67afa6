"""The subspace that the symmetries of an object fix, in any dimension: the rank of its n-tuples.

Every n-tuple turns with the object, so each lies in the subspace that all its symmetries leave in place, and
generically they span it (paper, section "Reflection transformation and symmetry"). Rank n: no symmetry at all;
rank n - 1: a reflection at most, whose hyperplane holds all n-tuples; rank 0: too much symmetry for n-tuples to tell.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, Plane, read_only
from symrefine.moments import shape_moments
from symrefine.ntuples.contract import PAPER_ORDERS, NTuples, ntuples
from symrefine.shape import Shape

# A singular value speaks when it exceeds what sampling noise alone gives by this factor. The n-tuples share few
# moments, so that noise alone exceeds 2 in one cloud of twenty.
SIGNIFICANT = 3.0
# ... and, for exact moments, this fraction of the bound |v| <= 1: a tenth of the tolerance of `verify`.
FLOOR = 2e-3
PARTS = 16
# Up to so many points stand for themselves, without sampling noise.
FEW = 250
LARGEST_DIM = 8
# Points whose nearest neighbours are looked up.
LOOKED_UP = 2000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixedSubspace:
    """What the singular values of the n-tuples say.

    Attributes:
        rank: dimension of the subspace that the symmetries fix, as far as the n-tuples tell.
        singular_values: [n] of the scaled n-tuples.
        significance: [n] singular values, each n-tuple weighted by its noise, over what noise and tolerance alone give.
        directions: [n, n] right singular vectors as rows: the first `rank` span the subspace.
    """

    rank: int
    singular_values: Array
    significance: Array
    directions: Array

    def __post_init__(self) -> None:
        for name in ("singular_values", "significance", "directions"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


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
    allowed = np.hypot(_jackknife(tuples, weights, directions), math.sqrt(len(weights)) * floor * weights.min())
    significance = _padded(values, dim) / allowed
    below = np.flatnonzero(significance <= SIGNIFICANT)
    return FixedSubspace(
        rank=int(below[0]) if below.size else dim,
        singular_values=_padded(np.linalg.svd(tuples.vectors, compute_uv=False), dim),
        significance=significance,
        directions=directions,
    )


def _jackknife(tuples: NTuples, weights: Array, directions: Array) -> Array:
    """Standard deviation [n] of the singular values along `directions`, from the sampling of the points."""
    parts = len(tuples.replicates)
    if parts == 0:
        return np.zeros(len(directions))
    spread = (tuples.replicates - tuples.replicates.mean(axis=0)) * weights[:, None]
    along = np.einsum("btn,kn->btk", spread, directions)
    return np.sqrt((parts - 1) / parts * (along**2).sum(axis=(0, 1)))


def _padded(values: Array, dim: int) -> Array:
    return np.pad(values, (0, dim - len(values)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SubspaceDetection:
    """What `detect_nd` found.

    Attributes:
        fixed: rank and singular values of the n-tuples.
        center: [n] the point that every symmetry leaves in place.
        hyperplane: the only hyperplane of symmetry there can be, where the rank is n - 1.
        ratio: mean distance from the points, reflected in it, to the nearest points, over that from the points to their
            own nearest neighbours; about 1 for a sampled symmetric object, NaN without a hyperplane.
    """

    fixed: FixedSubspace
    center: Array
    hyperplane: Plane | None
    ratio: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(self.center))


def detect_nd(
    shape: Shape | ArrayLike, *, tolerance: float = 10.0 * FLOOR, sampled: bool | None = None
) -> SubspaceDetection:
    """Class of symmetry of an object in n-space, 2 <= n <= 8, from its n-tuples alone; nothing is refined.

    Args:
        shape: a cloud, or points [N, n].
        tolerance: what still counts as symmetric; n-tuples, whose bound is 1, may differ by a tenth of it. The singular
            values fall fast in high dimensions: exact points bear 1e-6.
        sampled: whether the points are random samples of the object, whose noise hides what is smaller, or the object
            itself; more than 250 points are samples if None.

    Raises:
        InputError: more dimensions, or a mesh.
        DegenerateShapeError: the points do not spread.
    """
    shape = shape if isinstance(shape, Shape) else Shape.of(shape)
    if not 0.0 < tolerance <= 0.2:
        raise InputError(f"tolerance is {tolerance}; expected a number in (0, 0.2]")
    if shape.dim > LARGEST_DIM or shape.faces is not None:
        what = "a mesh" if shape.faces is not None else f"{shape.dim} coordinates"
        raise InputError(f"{shape.source}: {what}; detect_nd takes points of 2 to {LARGEST_DIM} coordinates")
    sampled = len(shape.points) > FEW if sampled is None else sampled
    moments = shape_moments(shape, 5, parts=PARTS if sampled else 0)
    fixed = fixed_subspace(ntuples(moments, PAPER_ORDERS), floor=0.1 * tolerance)
    if fixed.rank != shape.dim - 1:
        return SubspaceDetection(fixed=fixed, center=moments.center, hyperplane=None, ratio=math.nan)
    normal = fixed.directions[-1]
    plane = Plane(normal=normal, offset=float(normal @ moments.center))
    return SubspaceDetection(fixed=fixed, center=moments.center, hyperplane=plane, ratio=_ratio(shape.points, plane))


def _ratio(points: Array, plane: Plane) -> float:
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    some = points[:: max(1, len(points) // LOOKED_UP)]
    own = tree.query(some, k=2)[0][:, 1].mean()
    return float(tree.query(plane.reflect(some))[0].mean() / max(own, 1e-300))
