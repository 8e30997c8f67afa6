"""Alignment, the other story: the orthogonal map between two objects, reflections included, without correspondences.

moments of both -> n-tuples -> Procrustes (or the landscape over O(3) where the tuples vanish) -> Gauss-Newton on all
moments -> rivals judged on the points -> polish on the points -> the coset of maps that do equally well.
Elsewhere than in 3-space: moments -> n-tuples -> Procrustes -> Gauss-Newton on the moment tensors.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from symrefine.coset import Coset, coset_of_group, coset_of_list, lifted
from symrefine.detect import Clock, detect
from symrefine.errors import InputError
from symrefine.geometry import Array, read_only
from symrefine.moments import Moments, central_moments, shape_moments
from symrefine.ntuples.contract import PAPER_ORDERS, ntuples
from symrefine.polish import Similarity
from symrefine.procrustes import procrustes
from symrefine.quadrature import mesh_nodes
from symrefine.rivals import MISFIT, Evidence, Side, choose, information, polished, start_error
from symrefine.shape import Shape
from symrefine.tensor_fit import tensor_fit
from symrefine.verify import TOLERANCE

ORDER, PARTS = 8, 16
# Orders in other dimensions: n^order components each.
ORDER_ND, ORDER_HIGH = 5, 3
HIGH_DIMENSION, HIGHEST_DIMENSION = 7, 10
# Variance across, as a fraction of the whole, below which points count as lying in a subspace: rounding of float32.
FLAT = 1e-12
# Radii that differ by more than this factor are no matter of sampling.
RADII = 1.2
OK = "ok"


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """`target ~ scale * matrix @ source + translation`, and what else would do as well.

    Attributes:
        matrix: [n, n] orthogonal, determinant +1 or -1; +1 wherever both explain the pair equally well.
        translation: [n], units of the target.
        scale: 1.0 unless it was asked for.
        sigma_rad: standard deviation of the rotation from sampling noise; 0 where the moments agree to rounding, large
            where some turn is not observable.
        exact: whether the moments of both agree to rounding: the same points in another pose.
        timings: seconds by stage.
    """

    matrix: Array
    translation: Array
    scale: float
    sigma_rad: float
    exact: bool
    timings: dict[str, float]
    _coset: Callable[[], Coset] = field(repr=False)
    _miss: Callable[[], tuple[float, str]] = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", read_only(self.matrix))
        object.__setattr__(self, "translation", read_only(self.translation))

    @property
    def determinant(self) -> int:
        """+1 for a rotation, -1 for a reflection or rotoreflection."""
        return int(np.sign(np.linalg.det(self.matrix)))

    @property
    def transform(self) -> Array:
        """Homogeneous matrix [n+1, n+1], scale included."""
        return _homogeneous(self.scale * self.matrix, self.translation)

    def apply(self, points: ArrayLike) -> Array:
        """Points [N, n] of the source, in the pose of the target."""
        return np.asarray(self.scale * (np.asarray(points, dtype=np.float64) @ self.matrix.T) + self.translation)

    @cached_property
    def coset(self) -> Coset:
        """All maps that do equally well; in 3-space from what `detect` finds in the target, on first use."""
        return self._coset()

    @property
    def equivalents(self) -> Array:
        """[k, n, n] matrices of the coset, `matrix` first; one for each connected part if some subspace is free."""
        return self.coset.matrices

    @property
    def equivalent_transforms(self) -> Array:
        """[k, n+1, n+1] homogeneous matrices of the coset, scale included."""
        pairs = zip(self.coset.matrices, self.coset.translations, strict=True)
        return np.array([_homogeneous(self.scale * m, t) for m, t in pairs])

    @property
    def observable(self) -> str:
        """What the pair determines: "full", or up to what."""
        return self.coset.observable

    @property
    def free_axis(self) -> Array:
        """[0 or 1, 3] direction in the target about which any turn does equally well; n = 3 only."""
        free = self.coset.free
        return np.cross(free[0], free[1])[None] if free.shape == (2, 3) else np.zeros((0, self.matrix.shape[0]))

    @cached_property
    def _fit(self) -> tuple[float, str]:
        return self._miss()

    @property
    def rms(self) -> float:
        """Root mean square distance from the moved source to the target as a fraction of the target's diagonal.

        In 3-space between denoised surfaces; elsewhere, and for fewer than 60 points, to the nearest point.
        """
        return self._fit[0]

    @property
    def status(self) -> str:
        """ "ok", or why the result should not be relied upon."""
        return self._fit[1]


def _homogeneous(matrix: Array, shift: Array) -> Array:
    full = np.eye(len(shift) + 1)
    full[:-1, :-1], full[:-1, -1] = matrix, shift
    return full


def align(
    source: Shape | ArrayLike,
    target: Shape | ArrayLike,
    *,
    scale: bool = False,
    polish: bool = True,
    allow_reflection: bool = True,
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> Alignment:
    """Orthogonal map and translation that take one object onto another; samplings, densities and formats may differ.

    Args:
        source: a `Shape`, or points [N, n].
        target: a `Shape`, or points [M, n].
        scale: whether the objects may differ in size; then `target ~ scale * matrix @ source + translation`.
        polish: refine on the points (3-space only); without it the moments have the last word, in a third of the time.
        allow_reflection: whether determinant -1 is an answer.
        tolerance: largest miss that still counts as agreement, as in `detect`: decides between rivals, and symmetry.
        seed: of the random choices (samples of meshes, subsets of clouds).

    Raises:
        InputError: points that cannot be used, of different dimensions, or options out of range.
        DegenerateShapeError: the points do not spread.
    """
    a, b = (_shape(s, name) for s, name in ((source, "source"), (target, "target")))
    _check(a, b, tolerance)
    clock = Clock()
    with clock("moments"):
        evidence = Evidence(source=_side(a), target=_side(b), scale=scale, tolerance=tolerance, seed=seed)
    if a.dim == 3 and max(_rank(s.moments) for s in (evidence.source, evidence.target)) == 3:
        return _align_solid(evidence, polish, allow_reflection, clock)
    return _align_moments(evidence, allow_reflection, clock)


def _shape(values: Shape | ArrayLike, name: str) -> Shape:
    return values if isinstance(values, Shape) else Shape(points=np.asarray(values), source=name)


def _check(source: Shape, target: Shape, tolerance: float) -> None:
    if source.dim != target.dim:
        raise InputError(
            f"{source.source} has {source.dim} coordinates, {target.source} has {target.dim}; both need the same number"
        )
    if source.dim > HIGHEST_DIMENSION:
        raise InputError(f"points have {source.dim} coordinates; align takes {HIGHEST_DIMENSION} at most")
    if {source.measure, target.measure} == {"surface", "solid"}:
        raise InputError(
            f"{source.source} is taken as a {source.measure}, {target.source} as a {target.measure}; "
            "their moments differ, give both the same measure"
        )
    if not 0.0 < tolerance <= 0.2:
        raise InputError(f"tolerance is {tolerance}; expected a fraction of the diagonal in (0, 0.2]")


def _order(dim: int) -> int:
    return ORDER if dim <= 3 else ORDER_ND if dim < HIGH_DIMENSION else ORDER_HIGH


def _side(shape: Shape) -> Side:
    order = _order(shape.dim)
    if shape.faces is not None:
        return Side(shape=shape, moments=shape_moments(shape, order), weights=np.zeros(0))
    weights = np.ones(len(shape.points)) if shape.weights is None else shape.weights
    parts = min(PARTS, len(weights) // 2)
    return Side(shape=shape, moments=shape_moments(shape, order, parts=parts), weights=weights / weights.sum())


def _rank(moments: Moments) -> int:
    """Dimension of the subspace that the points spread in."""
    return int((np.linalg.eigvalsh(moments.covariance) > FLAT).sum())


def _align_solid(evidence: Evidence, polish: bool, reflections: bool, clock: Clock) -> Alignment:
    """The story in 3-space."""
    with clock("choose"):
        choice = choose(evidence, reflections=reflections)
    motion, covariance = choice.motion, choice.covariance
    if polish and not choice.exact and evidence.has_points:
        with clock("planes"):
            _ = evidence.surfaces
        with clock("polish"):
            known = information(evidence, covariance)
            done = polished(evidence, motion, error=start_error(covariance), known=known)
            motion, covariance = done.motion, done.covariance[:3, :3]
    matrix, translation, scale = _in_input_units(evidence, motion)

    def coset() -> Coset:
        found = detect(evidence.target.shape, tolerance=evidence.tolerance, seed=evidence.seed)
        return coset_of_group(matrix, translation, found.group, found.center, reflections=reflections)

    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=scale,
        sigma_rad=float(np.sqrt(np.trace(covariance))),
        exact=choice.exact,
        timings=clock.seconds,
        _coset=coset,
        _miss=lambda: _miss(evidence, motion, choice.exact),
    )


def _in_input_units(evidence: Evidence, motion: Similarity) -> tuple[Array, Array, float]:
    """Matrix, translation and scale for the input's own coordinates."""
    a, b = evidence.source.moments, evidence.target.moments
    scale = motion.scale * b.scale / a.scale if evidence.scale else 1.0
    return motion.matrix, b.center + b.scale * motion.shift - scale * (motion.matrix @ a.center), scale


def _miss(evidence: Evidence, motion: Similarity, exact: bool) -> tuple[float, str]:
    """rms and status in 3-space."""
    a, b = evidence.source.moments.scale, evidence.target.moments.scale
    if not evidence.has_points:
        rms = _nearest(evidence.source.shape, evidence.target.shape, *_in_input_units(evidence, motion))
        return rms, _sizes(a, b, evidence.scale)
    misses = evidence.surfaces.misses(motion)
    rms, excess = float(np.sqrt(np.mean(misses**2))), evidence.surfaces.excess(motion)
    if excess > 1.0 and not exact:
        differ = (
            f"the objects differ by {excess:.1f} times what the tolerance allows: 99 % of the source comes within "
            f"{100 * float(np.quantile(misses, 0.99)):.2g} % of the diagonal"
        )
        sizes = _sizes(a, b, evidence.scale)
        return rms, differ if sizes == OK else f"{differ}; {sizes}"
    return rms, _sizes(a, b, evidence.scale)


def _sizes(source: float, target: float, scale: bool) -> str:
    ratio = target / source
    if scale or 1.0 / RADII < ratio < RADII:
        return OK
    return f"the target is {ratio:.3g} times as large as the source: ask for the scale"


def _nearest(source: Shape, target: Shape, matrix: Array, translation: Array, scale: float) -> float:
    """Root mean square distance of the moved source points to the nearest point of the target, over its diagonal."""
    from scipy.spatial import cKDTree

    moved = scale * (source.points @ matrix.T) + translation
    distance, _ = cKDTree(target.points).query(moved)
    return float(np.sqrt(np.mean(distance**2)) / target.diagonal)


def _align_moments(evidence: Evidence, reflections: bool, clock: Clock) -> Alignment:
    """The story elsewhere, and for sets that span fewer dimensions than they live in: moments within the span."""
    a, b = evidence.source, evidence.target
    dim, rank = a.shape.dim, max(_rank(a.moments), _rank(b.moments))
    bases = [np.eye(dim) if rank == dim else np.linalg.eigh(s.moments.covariance)[1].T[::-1] for s in (a, b)]
    with clock("choose"):
        source, target = _within(a, bases[0][:rank]), _within(b, bases[1][:rank])
        orders = [t for t in PAPER_ORDERS if max(t) <= source.order]
        closed = procrustes(ntuples(source, orders), ntuples(target, orders))
        found = tensor_fit(source, target, closed, reflections=reflections or rank < dim)
    scale = b.moments.scale / a.moments.scale if evidence.scale else 1.0
    if rank == dim:
        coset = coset_of_list(found.matrices, a.moments.center, b.moments.center, scale, found.free)
    else:
        inner = coset_of_list(found.matrices, np.zeros(rank), np.zeros(rank), scale, found.free)
        centers = (a.moments.center, b.moments.center)
        coset = lifted(inner, bases[0], bases[1], centers, scale, reflections=reflections)
    matrix, translation = coset.matrices[0], coset.translations[0]

    def miss() -> tuple[float, str]:
        status = _sizes(a.moments.scale, b.moments.scale, evidence.scale)
        if found.misfit > MISFIT and not found.exact:
            status = f"the moments differ by {found.misfit:.0f} times what sampling explains"
        return _nearest(a.shape, b.shape, matrix, translation, scale), status

    return Alignment(
        matrix=matrix,
        translation=translation,
        scale=scale,
        sigma_rad=0.0 if found.exact else found.sigma_rad,
        exact=found.exact,
        timings=clock.seconds,
        _coset=lambda: coset,
        _miss=miss,
    )


def _within(side: Side, basis: Array) -> Moments:
    """Moments of the projection on orthonormal rows [r, n]; those of the side itself if the rows are those of I."""
    if len(basis) == side.shape.dim:
        return side.moments
    if side.shape.faces is None:
        points, weights = side.shape.points - side.moments.center, side.weights
    else:
        nodes, weights = mesh_nodes(side.shape, side.moments.order)
        points = nodes + (side.shape.points[0] - side.moments.center)
    parts = len(side.moments.replicates)
    return central_moments(points @ basis.T, weights, side.moments.order, parts=parts)
