"""Refinement on the points: outer iterations (match, then Gauss-Newton) as a generator of immutable iterates.

One skeleton for every case: operations that share one frame and one centre. The b planes through an axis have five
unknowns, a lone plane three, a full group up to six. Everything is in normalised units (RMS radius 1).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from symrefine.fit.gauss_newton import Linearisation, Solution, minimise, minimise_all
from symrefine.fit.matching import Pairs, match, pair_equations
from symrefine.fit.residual import (
    axis_gram,
    design_rows,
    frame_model,
    gram,
    theta_models,
    turn_frame,
)
from symrefine.geometry import Array, Isometry, Plane, ReadOnly, householder
from symrefine.rounding import DOUBLE
from symrefine.surface.misses import RIM
from symrefine.surface.skin import LocalPlanes

# Outer iterations at most; two or three settle what can be settled.
MAX_OUTER = 10
# Those after which what will not come near is given up.
SHORT = 2
# An outer iteration that moves nothing by more than this (radians, RMS radii) ends the refinement ...
SETTLED = 2e-4
# ... and so does one that moves everything by less than this share of what the noise leaves uncertain.
WITHIN_NOISE = 0.22
# Largest ratio of successive steps that is extrapolated.
LONGEST = 0.7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Framed(ReadOnly):
    """Operations given in the coordinates of a frame, and where that frame stands.

    Attributes:
        standard: [k, 3, 3] orthogonal matrices, det +1 or -1, in the frame's own coordinates.
        frame: [3, 3] the frame's axes as rows; a direction v of space has coordinates `frame @ v`.
        center: [3] point that all the operations leave in place.
        bundle: whether the operations are mirrors through the frame's third axis, so that theta has a meaning.
    """

    standard: Array
    frame: Array
    center: Array
    bundle: bool = False

    @property
    def motions(self) -> tuple[Isometry, ...]:
        """The operations in space."""
        return tuple(Isometry.about(self.center, self.frame.T @ s @ self.frame) for s in self.standard)

    def moved(self, x: Array) -> "Framed":
        """The same operations with the frame turned about its axes and shifted along them by x [6]."""
        return replace(self, frame=turn_frame(self.frame, x[:3]), center=self.center + self.frame.T @ x[3:])

    @property
    def planes(self) -> tuple[Plane, ...]:
        """The mirror planes among the operations."""
        mirrors = [s for s in self.standard if np.linalg.det(s) < 0 and np.isclose(np.trace(s), 1.0)]
        normals = [self.frame.T @ _normal(s) for s in mirrors]
        return tuple(Plane(normal=n, offset=float(n @ self.center)) for n in normals)


def _normal(mirror: Array) -> Array:
    """Unit normal of a reflection matrix `I - 2 n n'`."""
    outer = 0.5 * (np.eye(3) - mirror)
    column = outer[:, int(np.argmax(np.diag(outer)))]
    return column / np.linalg.norm(column)


def mirror_bundle(fold: int, frame: Array, center: Array) -> Framed:
    """The b mirrors of C_bv: planes through the frame's third axis at multiples of pi/b from its first."""
    angles = np.pi * np.arange(fold) / fold
    normals = np.stack([-np.sin(angles), np.cos(angles), np.zeros(fold)], axis=1)
    return Framed(standard=np.stack([householder(n) for n in normals]), frame=frame, center=center, bundle=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Iterate(ReadOnly):
    """State after one outer iteration.

    Attributes:
        index: 0 for the start, then 1, 2, ...
        state: the operations and their frame now.
        theta_rad: [b] what each plane alone would turn about the shared axis (the paper's unknown); empty if no bundle.
        step: size of the last change, radians and RMS radii together.
        covariance: [6, 6] of the frame's rotation and shift (about and along its axes), zero where unobservable.
        cost: mean weighted squared residual over the inliers, squared RMS radii.
        inliers: pairs used, over all operations.
        pairs: correspondences of each operation.
        converged: whether the change has settled.
    """

    index: int
    state: Framed
    theta_rad: Array
    step: float
    covariance: Array
    cost: float
    inliers: int
    pairs: tuple[Pairs, ...]
    converged: bool


def refine(
    cloud: LocalPlanes,
    start: Framed,
    *,
    start_error_rad: float = 0.05,
    stride: int = 1,
) -> Iterator[Iterate]:
    """Refine operations that share a frame: theta of each plane first, then the unknowns they have in common.

    Args:
        cloud: local planes, normalised units.
        start: the operations where the moments put them.
        start_error_rad: how far the start may be off; sets the first gate and robust scale.
        stride: use every stride-th local plane as a source.

    Yields: the start as iterate 0, then one iterate for each outer iteration, the last one when the change settles.
    """
    state, step = start, np.inf
    last: Array = np.zeros(6)
    way: Array = np.zeros(6)
    yield Iterate(
        index=0, state=state, theta_rad=np.zeros(0), step=np.inf, covariance=np.zeros((6, 6)), cost=np.nan, inliers=0,
        pairs=(), converged=False,
    )  # fmt: skip
    for index in range(1, MAX_OUTER + 1):
        uncertainty = min(start_error_rad, RIM * step)
        pairs = match(cloud, state.motions, uncertainty, stride=stride)
        grams = np.stack([pair_gram(cloud, p) for p in pairs])
        theta = _thetas(grams, state) if state.bundle else np.zeros(0)
        solution, sight, unseen = _solve(grams, state, float(np.median(theta)) if theta.size else 0.0)
        weight = max(sum(float(p.weights.sum()) for p in pairs), 1e-300)
        covariance = cloud.redundancy * solution.cost / weight * sight
        noise = WITHIN_NOISE * np.sqrt(np.clip(np.diag(covariance), 0.0, None))
        settled = bool(np.abs(solution.x).max() < SETTLED or np.all(np.abs(solution.x) <= noise))
        last = solution.x * _remaining(solution.x, last)
        state, step, way = state.moved(last), float(np.abs(last).max()), way + last
        # A tilt lets what is unseen seem seen: how far it went meanwhile is taken back.
        if unseen.size:
            away = unseen @ (unseen.T @ way)
            state, way = state.moved(-away), way - away
        yield Iterate(
            index=index,
            state=state,
            theta_rad=theta,
            step=step,
            covariance=covariance,
            cost=max(solution.cost, 0.0) / weight,
            inliers=sum(len(p.sources) for p in pairs),
            pairs=pairs,
            converged=settled,
        )
        if settled:
            return


def answered(cloud: LocalPlanes, end: Iterate, reach: float, *, stride: int = 1) -> Array:
    """The covariance [6, 6] of the end of a fit, by what of the pairs' information tells where the operations stand.

    In noise pairs seem to know more. Normals of a round wall lean a little to either side, so that any turn about its
    axis seems to be told; and of points that fill a volume one is the nearest wherever they are moved. If all that
    pairs say told where the operations stand, these would be led all the way back from where they are moved aside by
    `reach` (radians, RMS radii). The part of the way that they are is the part of the information H that tells. Chance
    leads them astray by what all of it says, the variance v of a pair for each: those that tell err together with the
    `redundancy` of planes that share their points, the rest each for itself. So the covariance is v (redundancy told +
    1 - told) / (told^2 H), where the fit says v redundancy / H.

    Args:
        cloud: local planes, normalised units.
        end: the last iterate.
        reach: how far operations are moved, as far as a start may be off.
        stride: use every stride-th local plane as a source.
    """

    def led(aside: Array) -> Array:
        state = end.state.moved(aside)
        pairs = match(cloud, state.motions, reach, stride=stride)
        return _solve(np.stack([pair_gram(cloud, p) for p in pairs]), state, 0.0)[0].x

    variances, ways = np.linalg.eigh(end.covariance)
    for k in np.flatnonzero(variances > DOUBLE * variances[-1]):
        aside = reach * ways[:, k]
        back = float(ways[:, k] @ (led(-aside) - led(aside))) / (2.0 * reach)
        told = min(max(back, DOUBLE), 1.0)
        more = (told + (1.0 - told) / cloud.redundancy) / told**2
        # Where nothing is told all of half a turn is as likely.
        variances[k] = min(more * variances[k], math.pi**2 / 12.0)
    return (ways * variances) @ ways.T


def _remaining(x: Array, last: Array) -> float:
    """Factor that sums the geometric series of the steps to come.

    Noisy points match back towards where the object stands now, so each step covers a fixed share of the way. Where two
    steps point the same way and shrink, their ratio q tells the share, and 1 / (1 - q) the way that is left.
    """
    length = float(np.linalg.norm(x) * np.linalg.norm(last))
    if length == 0.0 or x @ last < 0.7 * length:
        return 1.0
    ratio = float(np.linalg.norm(x) / np.linalg.norm(last))
    return 1.0 / (1.0 - min(ratio, LONGEST)) if ratio < 0.95 else 1.0


def pair_gram(cloud: LocalPlanes, pairs: Pairs) -> Array:
    """The Gram matrix [13, 13] of the equations that pairs make; see `residual`."""
    sources, targets, directions, weights = pair_equations(cloud, pairs)
    return gram(design_rows(sources, targets, directions), weights)


def _thetas(grams: Array, state: Framed) -> Array:
    """What each plane through the axis alone would turn by, on its 3x3 Gram matrix."""
    angles = np.pi * np.arange(len(grams)) / len(grams)
    return closest_planes(axis_gram(grams, state.frame, state.center), angles) - angles


def closest_planes(grams3: Array, angles_rad: Array) -> Array:
    """Angles [b] of planes through an axis after Gauss-Newton over theta, on their Gram matrices [b, 3, 3]."""
    found = minimise_all(lambda theta, which: theta_models(grams3[which], theta), angles_rad[:, None])
    return found.x[:, 0]


def _solve(grams: Array, state: Framed, theta: float) -> tuple[Solution, Array, Array]:
    """Gauss-Newton over what the pairs see of the shared frame's motions, from a turn by theta about its third axis.

    They see no glide along a plane and no turn about a lone normal, which change no operation; nor, along an open tube
    all of whose normals lie across it, how far to go, which rounding alone would say.

    Returns: the solution, x [6]; the inverse [6, 6] of its matrix over the motions seen, 0 over the others; and those,
    [6, 6 - p], orthonormal.
    """

    def model(x: Array) -> Linearisation:
        return frame_model(grams, state.standard, state.frame, state.center, x)

    here = model(np.zeros(6))
    values, vectors = np.linalg.eigh(here.hessian)
    seen = values > DOUBLE * values[-1]
    basis = vectors[:, seen]

    def within(full: Linearisation) -> Linearisation:
        return Linearisation(cost=full.cost, gradient=basis.T @ full.gradient, hessian=basis.T @ full.hessian @ basis)

    start = basis.T @ np.array([0.0, 0.0, theta, 0.0, 0.0, 0.0])
    solution = minimise(
        lambda y: within(model(basis @ y)),
        start,
        first=within(model(basis @ start) if theta else here),
        # What a step leaves is about its square (radians, RMS radii), and the next iterate takes it.
        tolerance=math.sqrt(0.1 * SETTLED),
    )
    return replace(solution, x=basis @ solution.x), (basis / values[seen]) @ basis.T, vectors[:, ~seen]
