"""Which orthogonal map explains two objects of 3-space: the moments propose, and decide where they can; else points do.

Where the n-tuples fix the map but for its determinant, Procrustes gives the starts; else the landscape of all harmonic
moments over O(3). Gauss-Newton on the moments sharpens them, and its cost leaves only rivals that sampling noise cannot
tell apart: the two determinants of a thin propeller, or the teeth of a gear that no moment of order 8 sees. Those are
polished and judged on the points.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrefine.axis import azimuthal_spectrum
from symrefine.geometry import Array, frame_with_z, rotation
from symrefine.harmonic_fit import (
    HarmonicFit,
    HarmonicPair,
    fit,
    harmonic_pair,
    hills,
    landscape,
    mismatch,
    rotation_covariance,
)
from symrefine.matching import LocalPlanes, local_planes
from symrefine.moments import Moments
from symrefine.ntuples.contract import ntuples
from symrefine.polish import Polished, Similarity, Surfaces, polish
from symrefine.procrustes import Procrustes, procrustes
from symrefine.quadrature import sample_surface
from symrefine.shape import Shape

# Hills of the landscape that are climbed, for each determinant: a few steps for all, the rest for those in sight.
HILLS = 8
FIRST_STEPS, LAST_STEPS = 4, 8
IN_SIGHT = 30.0
# A map whose cost exceeds the best by this factor, and by this much per coefficient, is out; measured on 52 objects,
# costs of true maps scatter between 0.02 and 2.5 per coefficient.
RIVAL = 5.0
PER_COEFFICIENT = 2.0
# Above this cost per coefficient the moments do not fit at all: other densities, other noise, or other objects.
MISFIT = 20.0
# Moments that agree to this are those of the same points.
ROUNDING = 1e-7
# Singular values of the n-tuples this many times beyond significance make the landscape unnecessary.
CLEAR = 5.0
# Local planes of the source and of the target, and points below which local planes say nothing.
SOURCE_PLANES, TARGET_PLANES, FEWEST = 1000, 2000, 60
# A rival that misses by less than this share of the limits is good; no other of its determinant is tried.
GOOD = 0.35
# The mirrored map is as good if its miss is below this many times the other's (compare `assemble`).
AS_GOOD = 4.0
# Rivals judged for each determinant, planes and iterations spent on each.
JUDGED, LOOK, LOOK_OUTER = 4, 400, 4
# Bounds of what the start of a polish may be off, radians; the moments' own estimate lies between.
START_ERROR = (0.03, 0.3)
# Standard deviation that the moments' rotation is never trusted beyond, radians.
TRUST = 1e-3
PHASES, PHASE_GRID = 3, 720


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """One of the two objects: its moments, and the weights of its points if it is a cloud."""

    shape: Shape
    moments: Moments
    weights: Array

    def planes(self, count: int, unit: float, rng: np.random.Generator) -> LocalPlanes:
        """`count` local planes about the centre, in units of `unit`."""
        points, normals = self.shape.points, self.shape.normals
        exact = self.shape.faces is not None
        if exact:
            points, normals, _ = sample_surface(self.shape, 2 * count, rng)
        return local_planes((points - self.moments.center) / unit, count, rng, normals=normals, exact=exact)

    def azimuths(self, frame: Array) -> Array:
        """Azimuthal coefficients [K, 4] about the frame's third axis, scaled by what random azimuths would give."""
        points = self.shape.points
        weights = self.weights
        if self.shape.faces is not None:
            points, _, _ = sample_surface(self.shape, 20000, np.random.default_rng(0))
            weights = np.full(len(points), 1.0 / len(points))
        local = (points - self.moments.center) @ frame.T / self.moments.scale
        c, sigma = azimuthal_spectrum(local, weights, np.array([0.0, 0.0, 1.0]))
        return c / sigma


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """Everything an alignment in 3-space may use; each part is worked out when first needed."""

    source: Side
    target: Side
    scale: bool
    tolerance: float
    seed: int

    @cached_property
    def closed(self) -> Procrustes:
        """Procrustes solution of the n-tuples."""
        return procrustes(ntuples(self.source.moments), ntuples(self.target.moments))

    @cached_property
    def harmonics(self) -> HarmonicPair:
        """Harmonic moments of both sides."""
        return harmonic_pair(self.source.moments, self.target.moments)

    @cached_property
    def surfaces(self) -> Surfaces:
        """Local planes of both sides in units of the target."""
        unit = self.source.moments.scale if self.scale else self.target.moments.scale
        return Surfaces(
            source=self.source.planes(SOURCE_PLANES, unit, np.random.default_rng(self.seed)),
            target=self.target.planes(TARGET_PLANES, self.target.moments.scale, np.random.default_rng(self.seed)),
            tolerance=self.tolerance,
        )

    @property
    def has_points(self) -> bool:
        """Whether there is enough of a surface on both sides for local planes."""
        sides = (self.source.shape, self.target.shape)
        solid = {s.measure for s in sides} == {"solid", "points"}
        return not solid and all(s.faces is not None or len(s.points) >= FEWEST for s in sides)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choice:
    """The map chosen, in units of the target about the two centres.

    Attributes:
        motion: matrix, shift and scale.
        covariance: [3, 3] of the rotation as the moments know it, target axes.
        exact: whether the moments agree to rounding, as for the same points on both sides.
    """

    motion: Similarity
    covariance: Array
    exact: bool


def choose(evidence: Evidence, *, reflections: bool = True) -> Choice:
    """The best map over O(3), or over SO(3) without reflections; determinant +1 wherever both do equally well."""
    fitted = candidates(evidence, (1, -1) if reflections else (1,))
    exact = fitted.matrices[mismatch(evidence.harmonics, fitted.matrices) < ROUNDING]
    if len(exact):
        best = exact[int(np.argmax(np.linalg.det(exact)))]
        return Choice(motion=Similarity(matrix=best, shift=np.zeros(3)), covariance=np.zeros((3, 3)), exact=True)
    size = evidence.harmonics.size
    rivals = fitted[fitted.costs <= fitted.costs[0] * RIVAL + PER_COEFFICIENT * size]
    covariance = _covariance(evidence, fitted)
    motion = Similarity(matrix=rivals.matrices[0], shift=np.zeros(3))
    if (len(rivals.costs) > 1 or rivals.costs[0] > MISFIT * size) and evidence.has_points:
        motion = _judged(evidence, rivals, start_error(covariance))
    return Choice(motion=motion, covariance=covariance, exact=False)


def candidates(evidence: Evidence, determinants: tuple[int, ...]) -> HarmonicFit:
    """Maps that explain the moments, by rising cost."""
    closed, pair = evidence.closed, evidence.harmonics
    starts = [m for m in (closed.matrix, closed.flipped) if int(np.sign(np.linalg.det(m))) in determinants]
    if closed.singular_values[1] > CLEAR * closed.significance:
        fitted = fit(pair, np.array(starts), steps=FIRST_STEPS + LAST_STEPS)
        if fitted.costs[0] < MISFIT * pair.size:
            return fitted
    scores = dict(zip((1, -1), landscape(evidence.source.moments, evidence.target.moments, pair), strict=True))
    climbed = [hills(scores[d], d, count=HILLS) for d in determinants]
    coarse = fit(pair, np.concatenate([starts, *climbed]), steps=FIRST_STEPS)
    near = coarse[coarse.costs <= IN_SIGHT * (coarse.costs[0] + pair.size)]
    return _distinct(fit(pair, near.matrices, steps=LAST_STEPS))


def _distinct(fitted: HarmonicFit) -> HarmonicFit:
    kept: list[int] = []
    for i, m in enumerate(fitted.matrices):
        if all(np.linalg.norm(m - fitted.matrices[k]) > 0.02 for k in kept):
            kept.append(i)
    return fitted[np.array(kept)]


def _covariance(evidence: Evidence, fitted: HarmonicFit) -> Array:
    """Jackknife covariance of the best fit, raised by what the moments misfit beyond their noise."""
    misfit = max(1.0, float(fitted.costs[0]) / evidence.harmonics.size)
    return misfit * rotation_covariance(evidence.harmonics, fitted.matrices[0], fitted.hessians[0])


def start_error(covariance: Array) -> float:
    """Three standard deviations of the rotation, within bounds: how far a start may be off."""
    return float(np.clip(3.0 * np.sqrt(np.trace(covariance)), *START_ERROR))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Judged:
    motion: Similarity
    excess: float


def _judged(evidence: Evidence, rivals: HarmonicFit, error: float) -> Similarity:
    """The rival that the points confirm best; the proper one if its mirror image does no better."""
    best: dict[int, _Judged] = {}
    for det in (1, -1):
        of_det = [m for m in rivals.matrices if np.linalg.det(m) * det > 0.0]
        found = _first_good(evidence, iter(of_det[:JUDGED]), error)
        if of_det and min((f.excess for f in found), default=np.inf) > GOOD:
            found += _first_good(evidence, _phases(evidence, of_det[0], rivals), error)
        if found:
            best[det] = min(found, key=lambda f: f.excess)
    if len(best) < 2:
        return next(iter(best.values())).motion
    proper, improper = best[1], best[-1]
    as_good = proper.excess <= min(1.0, max(GOOD, AS_GOOD * improper.excess)) or proper.excess <= improper.excess
    return proper.motion if as_good else improper.motion


def _first_good(evidence: Evidence, matrices: Iterator[Array], error: float) -> list[_Judged]:
    found: list[_Judged] = []
    for m in matrices:
        start = Similarity(matrix=m, shift=np.zeros(3))
        motion = polished(evidence, start, error=error, known=np.zeros((6, 6)), queries=LOOK, outer=LOOK_OUTER).motion
        found.append(_Judged(motion=motion, excess=evidence.surfaces.excess(motion)))
        if found[-1].excess <= GOOD:
            break
    return found


def _phases(evidence: Evidence, matrix: Array, rivals: HarmonicFit) -> Iterator[Array]:
    """The best turns about the axis that the moments know least about, from the azimuths of both clouds.

    With c_k the azimuthal coefficients about that axis, a turn by phi multiplies those of the source by exp(i k phi).
    """
    axis = np.linalg.eigh(rivals.hessians[0])[1][:, 0]
    frame = frame_with_z(axis)
    source, target = evidence.source.azimuths(frame @ matrix), evidence.target.azimuths(frame)
    spectrum = np.zeros(PHASE_GRID, complex)
    spectrum[1 : len(source)] = (np.conj(target) * source).sum(axis=1)[1:]
    score = np.fft.ifft(spectrum).real
    for _ in range(PHASES):
        i = int(np.argmax(score))
        yield rotation(axis, 2.0 * np.pi * i / PHASE_GRID) @ matrix
        window = (np.arange(-6, 7) + i) % PHASE_GRID
        score[window] = -np.inf


def polished(
    evidence: Evidence, start: Similarity, *, error: float, known: Array, queries: int = 10**9, outer: int = 12
) -> Polished:
    """Polish on the surfaces of the evidence."""
    return polish(
        evidence.surfaces, start, error=error, known=known, scale=evidence.scale, queries=queries, outer=outer
    )


def information(evidence: Evidence, covariance: Array) -> Array:
    """Inverse covariance [6, 6] of rotation and shift (RMS radii) that the moments carry."""
    known: Array = np.zeros((6, 6))
    known[:3, :3] = np.linalg.inv(covariance + TRUST**2 * np.eye(3))
    counts = [np.sum(s.weights**2) for s in (evidence.source, evidence.target)]
    known[3:, 3:] = np.eye(3) / (sum(counts) / 3.0 + TRUST**2)
    return known
