"""Which orthogonal map explains two objects of 3-space: the moments propose, and decide where they can; else points do.

Where the n-tuples fix the map but for its determinant, Procrustes gives the starts; else the landscape of all harmonic
moments over O(3). Gauss-Newton on the moments sharpens them, and its cost leaves only rivals that sampling noise cannot
tell apart: the two determinants of a thin propeller, or the teeth of a gear that no moment of order 8 sees. Those are
polished and judged on the points.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from symrefine.align.landscape import hills, landscape
from symrefine.align.moment_fit import LONGEST, MISFIT, Fits, as_good, best_fits, covariance, exact, misfit
from symrefine.align.pair import Evidence, few
from symrefine.align.polish import Polished, Similarity, polish
from symrefine.align.sides import size_sigma
from symrefine.geometry import Array, frame_with_z, rotation
from symrefine.groups.names import CLOSED_FOLD
from symrefine.moments.harmonics import FLOOR
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.propose.folds import BINS_PER_ORDER
from symrefine.samples import FOLLOWED
from symrefine.surface.misses import LIMITS
from symrefine.surface.skin import LocalPlanes, Skin

# Share of the limits by which the misses of true maps differ: clean samples show 0.16 at most, mirror images 0.2; a
# wheel off by four degrees misses by 0.27, the wrong hand of a posed ant by 0.6 more.
GOOD = 0.25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choice:
    """The map chosen, in units of the target about the two centres.

    Attributes:
        evidence: what it rests on; the centres are those of its moments.
        motion: matrix, shift and scale.
        covariance: [3, 3] of the rotation as the moments know it, target axes.
        exact: whether the moments agree to rounding, as for the same points on both sides.
        misfit: cost per coefficient; about 1 or below if sampling noise explains the difference of the moments.
        excess: miss over its limit; 0 where the moments were enough to decide.
        lead: by how much more the other determinant misses, over the limit; infinite where the moments deny it.
        other: the best map of that determinant, where points were asked.
    """

    evidence: Evidence
    motion: Similarity
    covariance: Array
    exact: bool
    misfit: float
    excess: float
    lead: float = math.inf
    other: Similarity | None = None

    @property
    def determinant_confidence(self) -> float:
        """Probability that the determinant is right: nine in ten where the other misses by more than true maps vary.

        A half where a reflection misses by a little less: that is told by nothing, and a rotation can be carried out.
        """
        return float(1.0 / (1.0 + 9.0 ** (-max(self.lead, 0.0) / GOOD)))

    @property
    def hand_is_open(self) -> bool:
        """Whether the other hand misses by about as much: right where the object is its own mirror image."""
        return self.lead < GOOD

    @property
    def merit(self) -> tuple[float, float]:
        """The less the better: first that the surfaces agree, then that the moments do."""
        return max(self.excess, 1.0), self.misfit


def choose(evidence: Evidence, *, reflections: bool = True, brief: bool = False) -> Choice:
    """The best map over O(3), or over SO(3) without reflections; determinant +1 wherever both do equally well.

    Where the moments do not fit, the densities of the clouds may differ: a second try gives every point its share of
    the area. With `brief` there is none where the surfaces do not agree either: they may share a part only.
    """
    first = _choose(evidence, reflections, brief=brief)
    if first.merit <= (1.0, MISFIT) or few(evidence.source.shape, evidence.target.shape):
        return first
    if brief and first.excess > 1.0:
        return first
    evened = replace(evidence, source=evidence.source.evened(), target=evidence.target.evened())
    return min(first, _choose(evened, reflections), key=lambda c: c.merit)


def _choose(evidence: Evidence, reflections: bool, *, brief: bool = False) -> Choice:
    """The best map as the moments have it; with `brief` only the best of either determinant if they do not fit."""
    pair = evidence.harmonics
    fitted = candidates(evidence, (1, -1) if reflections else (1,))
    same = exact(pair, fitted)
    if len(same.costs):
        best = Similarity(matrix=same.matrices[int(np.argmax(same.signs))], shift=np.zeros(3))
        lead = 0.0 if same.signs.min() < same.signs.max() else math.inf
        none = np.zeros((3, 3))
        return Choice(evidence=evidence, motion=best, covariance=none, exact=True, misfit=0.0, excess=0.0, lead=lead)
    rivals, unlike, spread = fitted[as_good(pair, fitted)], misfit(pair, fitted), covariance(pair, fitted)
    first = Similarity(matrix=rivals.matrices[0], shift=np.zeros(3))
    told = Choice(evidence=evidence, motion=first, covariance=spread, exact=False, misfit=unlike, excess=0.0)
    if not (len(rivals.costs) > 1 or unlike > MISFIT) or not evidence.has_points:
        return told
    if len(set(rivals.signs)) == 1 and (sure := _sure(evidence, first, spread)):
        return replace(told, motion=sure[0], excess=sure[1])
    hands = _judged(evidence, rivals, spread, brief=brief and unlike > MISFIT)
    chosen = min(hands, key=lambda det: hands[det][1] + GOOD * (det < 0))
    found = replace(told, motion=hands[chosen][0], excess=hands[chosen][1])
    if -chosen not in hands:
        return found
    return replace(found, lead=hands[-chosen][1] - found.excess, other=hands[-chosen][0])


def candidates(evidence: Evidence, determinants: tuple[int, ...]) -> Fits:
    """Maps that explain the moments, by rising cost."""
    closed, pair = evidence.closed, evidence.harmonics
    starts = [m for m in (closed.matrix, closed.flipped) if int(np.sign(np.linalg.det(m))) in determinants]
    if closed.rank > 1:
        fitted = best_fits(pair, np.array(starts))
        if misfit(pair, fitted) < MISFIT:
            return fitted
    scores = dict(zip((1, -1), landscape(evidence.source.moments, evidence.target.moments), strict=True))
    climbed = [hills(scores[d], d, count=FOLLOWED) for d in determinants]
    return best_fits(pair, np.concatenate([starts, *climbed]))


def _sure(evidence: Evidence, start: Similarity, covariance: Array) -> tuple[Similarity, float] | None:
    """The map that the moments favour, after the polish, and its excess without noise; None if that leaves a doubt."""
    if evidence.scale or few(evidence.source.shape, evidence.target.shape):
        return None
    done = polished(evidence, evidence.met, start, covariance)
    excess = evidence.excess_without_noise(done, GOOD)
    return (done.motion, excess) if excess <= GOOD else None


def _judged(evidence: Evidence, rivals: Fits, covariance: Array, *, brief: bool) -> dict[int, tuple[Similarity, float]]:
    """The rival of each determinant that the points confirm best, and its excess.

    With `brief` the first of each has to do.
    """
    best: dict[int, tuple[Similarity, float]] = {}
    for det in dict.fromkeys(int(sign) for sign in rivals.signs):  # by cost
        of_det = rivals.matrices[rivals.signs == det]
        every = of_det[:1] if brief else chain(of_det[:FOLLOWED], _phases(evidence, of_det[0], rivals))
        best[det] = _first_good(evidence, every, covariance)
    return best


def _first_good(evidence: Evidence, matrices: Iterable[Array], covariance: Array) -> tuple[Similarity, float]:
    """Polish and judge one after the other until one is good; else the first, unless another clearly misses by less.

    Those that miss by more than a polish may make up for are not polished, unless all do.
    """
    found: list[tuple[Similarity, float]] = []
    hopeless: list[tuple[Similarity, float]] = []
    for m in matrices:
        start = Similarity(matrix=m, shift=np.zeros(3))
        if (rough := evidence.excess(start)) > 1.0 + _gain(evidence, covariance):
            hopeless.append((start, rough))
            continue
        found.append(_improved(evidence, start, covariance))
        if found[-1][1] <= GOOD:
            return found[-1]
    if not found:
        return _improved(evidence, min(hopeless, key=lambda h: h[1])[0], covariance)
    best = min(found, key=lambda f: f[1])
    return found[0] if found[0][1] <= best[1] + GOOD else best


def _improved(evidence: Evidence, start: Similarity, covariance: Array) -> tuple[Similarity, float]:
    """A map after the polish on the judge's own planes, and what it misses by."""
    motion = polished(evidence, evidence.judge.cloud, start, covariance).motion
    return motion, evidence.excess(motion)


def _gain(evidence: Evidence, covariance: Array) -> float:
    """By how much less a start may miss after the polish, over the limit: as far as the moments leave open its points.

    A turn w with covariance C moves a point x by w cross x, which is `tr(C) |x|^2 - x'Cx` in the mean square.
    """
    points = evidence.judge.cloud.points
    squares = np.trace(covariance) * (points**2).sum(axis=1) - np.einsum("ni,ij,nj->n", points, covariance, points)
    shift = SIGNIFICANT * float(np.sqrt(squares.mean()))
    return shift / (LIMITS[0] * evidence.tolerance * evidence.judge.diagonal)


def _phases(evidence: Evidence, matrix: Array, rivals: Fits) -> Iterator[Array]:
    """The best turns about the axis that the moments know least about, from the azimuths of both clouds.

    With c_k the azimuthal coefficients about that axis, a turn by phi multiplies those of the source by exp(i k phi).
    """
    axis = np.linalg.eigh(rivals.hessians[0])[1][:, 0]
    frame = frame_with_z(axis)
    source, target = evidence.source.azimuths(frame @ matrix), evidence.target.azimuths(frame)
    circle = BINS_PER_ORDER * CLOSED_FOLD
    spectrum = np.zeros(circle, complex)
    spectrum[1 : len(source)] = (np.conj(target) * source).sum(axis=1)[1:]
    score = np.fft.ifft(spectrum).real
    peaks = np.flatnonzero((score > np.roll(score, 1)) & (score >= np.roll(score, -1)))
    for i in peaks[np.argsort(-score[peaks])][:FOLLOWED]:
        yield rotation(axis, 2.0 * np.pi * i / circle) @ matrix


def polished(evidence: Evidence, target: Skin | LocalPlanes, start: Similarity, covariance: Array) -> Polished:
    """Polish on the points of the evidence from a start whose rotation the moments know with this covariance [3, 3]."""
    known = information(evidence, covariance)
    return polish(evidence.moving, target, start, error=_error(covariance), known=known, scale=evidence.scale)


def _error(covariance: Array) -> float:
    """How far a start may be off, radians and RMS radii, whose rotation the moments know with a covariance [3, 3]."""
    return min(SIGNIFICANT * float(np.sqrt(np.trace(covariance))), LONGEST)


def information(evidence: Evidence, covariance: Array) -> Array:
    """Inverse covariance of rotation and shift (RMS radii) that the moments carry, and of log scale where it is open.

    [6, 6] or [7, 7].
    """
    known: Array = np.zeros((7, 7))
    known[:3, :3] = np.linalg.inv(covariance + FLOOR * np.eye(3))
    counts = [np.sum(s.weights**2) for s in (evidence.source, evidence.target)]
    known[3:6, 3:6] = np.eye(3) / (sum(counts) / 3.0 + FLOOR)
    known[6, 6] = 1.0 / (size_sigma(evidence.source, evidence.target) ** 2 + FLOOR)
    return known if evidence.scale else known[:6, :6]
