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
# Cosine of the angle within which two candidates are one.
_SAME = math.cos(math.radians(2.0))


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
class Hyperplane:
    """A candidate for a hyperplane of symmetry.

    Attributes:
        plane: in input units.
        asymmetry: what the moments of orders 2 to 4 have against it, as a fraction of the whole.
        noise: what sampling alone would leave of that; 0 for points that stand for themselves.
        miss: of those, the largest distance from a reflected point to its nearest neighbour, over the diameter; NaN for
            samples, whose neighbours say nothing in high dimensions.
    """

    plane: Plane
    asymmetry: float
    noise: float
    miss: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SubspaceDetection:
    """What `detect_nd` found.

    Attributes:
        fixed: rank and singular values of the n-tuples.
        center: [n] the point that every symmetry leaves in place.
        hyperplanes: of symmetry, best first; several at right angles to one another where there are.
        rejected: candidates turned down, best first.
        diameter: twice the largest distance of a point from the centre.
        undetermined: why the data support no decision; empty when they do.
    """

    fixed: FixedSubspace
    center: Array
    hyperplanes: tuple[Hyperplane, ...]
    rejected: tuple[Hyperplane, ...]
    diameter: float
    undetermined: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(self.center))


def detect_nd(
    shape: Shape | ArrayLike, *, tolerance: float = 10.0 * FLOOR, sampled: bool | None = None
) -> SubspaceDetection:
    """Hyperplanes of symmetry of points in n-space, 2 <= n <= 8, and the rank of their n-tuples.

    The normal of a hyperplane of symmetry is an eigenvector of the second moments, and the only one at right angles to
    the n-tuples where these have rank n - 1. From there it is turned until the moments of orders 2 to 4 are closest to
    their images. Where second moments coincide, hyperplanes can escape; turns are not looked for.

    Args:
        shape: a cloud, or points [N, n].
        tolerance: what still counts as symmetric: points that stand for themselves may miss by this fraction of the
            diameter; the moments of samples, and n-tuples, by a tenth of it.
        sampled: whether the points are random samples of the object, whose noise hides what is smaller, or the object
            itself; more than 250 points are samples if None.

    Raises:
        InputError: other dimensions, or a mesh.
        DegenerateShapeError: the points do not spread.
    """
    shape = shape if isinstance(shape, Shape) else Shape.of(shape)
    if not 0.0 < tolerance <= 0.2:
        raise InputError(f"tolerance is {tolerance}; expected a number in (0, 0.2]")
    if not 2 <= shape.dim <= LARGEST_DIM or shape.faces is not None:
        what = "a mesh" if shape.faces is not None else f"{shape.dim} coordinates"
        raise InputError(f"{shape.source}: {what}; detect_nd takes points of 2 to {LARGEST_DIM} coordinates")
    sampled = len(shape.points) > FEW if sampled is None else sampled
    moments = shape_moments(shape, 5, parts=PARTS if sampled else 0)
    fixed = fixed_subspace(ntuples(moments, PAPER_ORDERS), floor=0.1 * tolerance)
    points = (shape.points - moments.center) / moments.scale
    masses = np.ones(len(points)) if shape.weights is None else shape.weights
    kept = masses > 0
    points, masses = points[kept], masses[kept] / masses.sum()
    reach = float(np.linalg.norm(points, axis=1).max())
    parts = _parts(points, masses, PARTS if sampled else 1)
    whole = [np.sum(part, axis=0) for part in zip(*parts, strict=True)]
    found: list[Hyperplane] = []
    for normal in _normals(whole, fixed):
        if all(abs(float(normal @ other.plane.normal)) < _SAME for other in found):
            miss = math.nan if sampled else _miss(points, normal) / (2.0 * reach)
            plane = Plane(normal=normal, offset=float(normal @ moments.center))
            asymmetry, noise = _against(whole, parts, normal)
            found.append(Hyperplane(plane=plane, asymmetry=asymmetry, noise=noise, miss=miss))
    found.sort(key=lambda h: h.asymmetry)
    holds = [h for h in found if _holds(h, tolerance)]
    doubt = _doubt(holds, tolerance)
    return SubspaceDetection(
        fixed=fixed,
        center=moments.center,
        hyperplanes=() if doubt else tuple(holds),
        rejected=tuple(found) if doubt else tuple(h for h in found if h not in holds),
        diameter=2.0 * reach * moments.scale,
        undetermined=doubt,
    )


def _parts(points: Array, masses: Array, count: int) -> list[list[Array]]:
    """Moment tensors [n, n], [n, n, n] and [n, n, n, n] of each of `count` equal shares of the points."""
    return [_tensors(points[k::count], masses[k::count]) for k in range(count)]


def _tensors(points: Array, masses: Array) -> list[Array]:
    squares = np.einsum("ai,aj->aij", points, points).reshape(len(points), -1)
    weighted = masses[:, None] * points
    n = points.shape[1]
    second, third = weighted.T @ points, weighted.T @ squares
    fourth = (masses[:, None] * squares).T @ squares
    return [second, third.reshape((n,) * 3), fourth.reshape((n,) * 4)]


def _odd(tensors: list[Array], normal: Array) -> float:
    """Energy of the part of the tensors that a reflection flips."""
    flip = np.eye(len(normal)) - 2.0 * np.outer(normal, normal)
    energy = 0.0
    for tensor in tensors:
        image = tensor
        # The axes come round: each product takes the first one and appends its image.
        for _ in range(tensor.ndim):
            image = np.tensordot(image, flip, (0, 0))
        energy += 0.25 * float(((tensor - image) ** 2).sum())
    return energy


def _normals(tensors: list[Array], fixed: FixedSubspace) -> list[Array]:
    """Normals where the odd energy is least, from each eigenvector of the second moments and from the n-tuples."""
    from scipy.optimize import minimize

    normals = []
    for start in (fixed.directions[-1], *np.linalg.eigh(tensors[0])[1].T):

        def turned(x: Array, start: Array = start) -> Array:
            moved = start + x - (x @ start) * start
            return np.asarray(moved / np.linalg.norm(moved))

        best = minimize(lambda x: _odd(tensors, turned(x)), np.zeros(len(start)), method="BFGS")
        normals.append(turned(best.x))
    return sorted(normals, key=lambda n: _odd(tensors, n))


def _against(whole: list[Array], parts: list[list[Array]], normal: Array) -> tuple[float, float]:
    """Asymmetry and its sampling noise (jackknife), as fractions of the whole."""
    size = math.fsum(float((t**2).sum()) for t in whole)
    count = len(parts)
    apart = [_odd([count * p - t for p, t in zip(part, whole, strict=True)], normal) for part in parts]
    noise = math.fsum(apart) / (count * max(count - 1, 1)) if count > 1 else 0.0
    return math.sqrt(_odd(whole, normal) / size), math.sqrt(noise / size)


def _miss(points: Array, normal: Array) -> float:
    from scipy.spatial import cKDTree

    image = points - 2.0 * np.outer(points @ normal, normal)
    return float(cKDTree(points).query(image)[0].max())


def _holds(candidate: Hyperplane, tolerance: float) -> bool:
    if not math.isnan(candidate.miss):
        return candidate.miss <= tolerance
    return candidate.asymmetry <= math.hypot(0.1 * tolerance, math.sqrt(SIGNIFICANT) * candidate.noise)


def _doubt(holds: list[Hyperplane], tolerance: float) -> str:
    """Why too little is known of what seems to hold, or nothing."""
    noise = max((h.noise for h in holds), default=0.0)
    if noise <= 0.5 * tolerance:
        return ""
    return (
        f"the noise of the samples, {noise:.1%} of the moments, hides asymmetries of {tolerance:.1%}; give more points"
    )
