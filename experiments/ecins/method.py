"""The baseline from points and normals to planes."""

from dataclasses import dataclass

import numpy as np

from experiments.ecins.clouds import Clouds, prepare
from experiments.ecins.fitting import Fit, refine_plane
from experiments.ecins.judging import Score, representatives, score
from experiments.ecins.settings import SHIPPED, Settings
from experiments.ecins.starts import grid_normals, position
from symrefine.geometry import Array, read_only


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EcinsPlane:
    """A plane `normal.x = offset` that was found, in input units, with its scores and the start it came from."""

    normal: Array
    offset: float
    cloud_score: float
    correspondence_score: float
    candidate: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", read_only(self.normal))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One start: its plane before and after each outer iteration, and what it was worth.

    Attributes:
        normals, offsets: [T + 1, 3] and [T + 1] iterates in input units, the start (after the position step) first.
        evaluations: residual evaluations by the original's count: each one a pass over all pairs there.
        converged: whether it came to rest before `max_outer`.
        cloud_score, correspondence_score: of the last iterate.
    """

    normals: Array
    offsets: Array
    evaluations: int
    converged: bool
    cloud_score: float
    correspondence_score: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "normals", read_only(self.normals))
        object.__setattr__(self, "offsets", read_only(self.offsets))

    @property
    def iterations(self) -> int:
        """Outer iterations; ours needs one pass over the pairs in each."""
        return len(self.offsets) - 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EcinsResult:
    """Planes found, the largest clique first, and the history of every start."""

    planes: tuple[EcinsPlane, ...]
    history: tuple[Candidate, ...]

    @property
    def candidates(self) -> int:
        """Number of starts."""
        return len(self.history)

    @property
    def iterations(self) -> tuple[int, ...]:
        """Outer iterations of the start behind each plane."""
        return tuple(self.history[p.candidate].iterations for p in self.planes)

    @property
    def max_iterations(self) -> int:
        """Most outer iterations that any start took, found or not: what the method has to wait for."""
        return max(c.iterations for c in self.history)

    @property
    def evaluations(self) -> int:
        """Residual evaluations over all starts as the original counts them."""
        return sum(c.evaluations for c in self.history)

    @property
    def passes(self) -> int:
        """Passes over pairs that this implementation needed for the same: one Gram matrix an outer iteration."""
        return sum(c.iterations for c in self.history)


def ecins(points: Array, normals: Array | None, *, settings: Settings = SHIPPED) -> EcinsResult:
    """Planes of symmetry after Ecins, Fermuller, Aloimonos, "Detecting Reflectional Symmetries in 3D Data Through
    Symmetrical Fitting" (ICCV workshops, 2017), as its public code does it.

    Args:
        points: [N, 3] any units, pose and scale.
        normals: [N, 3] oriented: opposite signs are opposite sides. See `estimated_normals` where there are none.
        settings: constants; SHIPPED are those of the public code, TUNED has wider cells and more starts.

    Raises:
        InputError: no normals, zero or NaN ones, not 3-space, or too few points.
        DegenerateShapeError: all points coincide.
    """
    clouds = prepare(points, normals, settings)
    starts = [position(clouds, n, settings) for n in grid_normals(settings.divisions, clouds.basis)]
    fits = [refine_plane(clouds, start, settings) for start in starts]
    scores = [score(clouds, fit.planes[-1], settings) for fit in fits]
    good = [i for i, s in enumerate(scores) if s.cloud > settings.least_cloud_score]
    kept = [good[i] for i in representatives([fits[i].planes[-1] for i in good], settings)]
    history = tuple(_candidate(clouds, fit, value) for fit, value in zip(fits, scores, strict=True))
    return EcinsResult(planes=tuple(_found(history[i], i) for i in kept), history=history)


def _candidate(clouds: Clouds, fit: Fit, value: Score) -> Candidate:
    normals = np.stack([p.normal for p in fit.planes])
    return Candidate(
        normals=normals,
        offsets=normals @ clouds.center + clouds.scale * np.array([p.offset for p in fit.planes]),
        evaluations=fit.evaluations,
        converged=fit.converged,
        cloud_score=value.cloud,
        correspondence_score=value.correspondence,
    )


def _found(candidate: Candidate, index: int) -> EcinsPlane:
    return EcinsPlane(
        normal=candidate.normals[-1],
        offset=float(candidate.offsets[-1]),
        cloud_score=candidate.cloud_score,
        correspondence_score=candidate.correspondence_score,
        candidate=index,
    )
