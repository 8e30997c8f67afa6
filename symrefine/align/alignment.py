"""The answer to "which map takes one object onto another", with what else would do as well and how well it does."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.align.coset import Coset
from symrefine.decide.posterior import Link, meant
from symrefine.errors import InputError
from symrefine.geometry import Array, ReadOnly, numbers
from symrefine.threads import one_thread

OK = "ok"
# How a status begins that leaves open whether the objects agree.
OPEN = "not determined"


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearness:
    """How near a map brings two objects.

    Attributes:
        rms: distance from the moved source to the target, RMS, as a fraction of the target's diagonal.
        overlap: share of the source that the map lays on the target, and share of the target that is met.
    """

    rms: float
    overlap: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether a map holds.

    Attributes:
        status: "ok", or why the result should not be relied upon.
        excess: what the map misses by over what the tolerance, or the noise of the moments, allows; where that is sure
            even so, as if no miss were noise.
        determinant_confidence: probability that the determinant is right, unless either does equally well.
        hand: probability that the determinant is right, or that the object is its own mirror image and has either.
        confidence: probability that the map is, where it was not told from the excess.
    """

    status: str
    excess: float
    determinant_confidence: float = 1.0
    hand: float = 1.0
    confidence: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment(ReadOnly):
    """`target ~ scale * matrix @ source + translation`, and what else would do as well.

    Attributes:
        matrix: [n, n] orthogonal, determinant +1 or -1; +1 wherever both explain the pair equally well.
        translation: [n], units of the target.
        scale: 1.0 unless it was asked for.
        scale_sigma: standard deviation of the scale from sampling noise; 0 unless it was asked for, and where the
            moments agree to rounding.
        sigma_rad: standard deviation of the rotation from sampling noise; 0 where the moments agree to rounding, large
            where some turn is not observable.
        covariance: [6, 6] of `y = exp([w]) matrix x + translation + d`: rotation vector w (target axes, radians), then
            d (units of the target); n = 3 only, else [0, 0]. Zero where the moments agree to rounding, and along what
            nothing tells.
        exact: whether the moments of both agree to rounding: the same points in another pose.
        timings: seconds by stage.
    """

    matrix: Array
    translation: Array
    scale: float
    scale_sigma: float
    sigma_rad: float
    covariance: Array
    exact: bool
    timings: dict[str, float]
    _coset: Callable[[], Coset] = field(repr=False)
    _verdict: Callable[[], Verdict] = field(repr=False)
    _nearness: Callable[[], Nearness] = field(repr=False)

    def __reduce__(self) -> tuple[Callable[..., "Alignment"], tuple[Any, ...]]:
        told = {f.name: getattr(self, f.name) for f in fields(self) if f.name[0] != "_"}
        return _known, (type(self), told, self.coset, self._said, self._near)  # what is told on first use, too

    @property
    def determinant(self) -> int:
        """+1 for a rotation, -1 for a reflection or rotoreflection."""
        return int(np.sign(np.linalg.det(self.matrix)))

    @property
    def transform(self) -> Array:
        """Homogeneous matrix [n+1, n+1], scale included."""
        return _homogeneous(self.scale * self.matrix, self.translation)

    def apply(self, points: ArrayLike) -> Array:
        """Points [N, n] of the source, in the pose of the target.

        Raises:
            InputError: another number of coordinates, or no numbers.
        """
        given, dim = numbers(points, "points"), len(self.matrix)
        if given.shape[-1:] != (dim,):
            raise InputError(f"points have shape {given.shape}; expected [N, {dim}]")
        return np.asarray(self.scale * (given @ self.matrix.T) + self.translation)

    @cached_property
    @one_thread()
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
        """What the pair determines: "full", or up to what; "nothing" where there is one map, and it does not hold."""
        told = self.coset.observable
        return told if told != "full" or self.status == OK else "nothing"

    @property
    def free_axis(self) -> Array:
        """[0 or 1, 3] direction in the target about which any turn does equally well; n = 3 only."""
        free = self.coset.free
        return np.cross(free[0], free[1])[None] if free.shape == (2, 3) else np.zeros((0, self.matrix.shape[0]))

    @cached_property
    @one_thread()
    def _said(self) -> Verdict:
        return self._verdict()

    @cached_property
    @one_thread()
    def _near(self) -> Nearness:
        return self._nearness()

    @property
    def rms(self) -> float:
        """Root mean square distance from the moved source to the target as a fraction of the target's diagonal.

        In 3-space between denoised surfaces; elsewhere, and of points that are the same, to the nearest point.
        """
        return self._near.rms

    @property
    def status(self) -> str:
        """ "ok", or why the result should not be relied upon."""
        return self._said.status

    @property
    def confidence(self) -> float:
        """Probability that the objects are meant to agree under this map, or one of its equivalents.

        Of what the map misses by, as `detect` tells it of a symmetry; of objects that share a part only, of how much
        meets and of what other maps do as well. 0 where the status leaves open or denies it.
        """
        if self.status != OK:
            return 0.0
        if self._said.confidence is not None:
            return self._said.confidence
        if self.exact:
            return 1.0
        # The details that tell one hand from the other may be lost in noise or strays.
        return min(meant(Link(need=self._said.excess), 1.0), self._said.hand)

    @property
    def overlap(self) -> tuple[float, float]:
        """Share of the source that comes to lie on the target within the tolerance, and share of the target it meets.

        In 3-space of the surface; elsewhere, and where the points are the same, of the points.
        """
        return self._near.overlap

    @property
    def determinant_confidence(self) -> float:
        """Probability that the determinant is right, 0.5 where a reflection does as well; 1 where none is admitted."""
        told = self._said.determinant_confidence
        return min(told, 0.5) if self.coset.has_both_hands else told

    @property
    def is_misfit(self) -> bool:
        """Whether no map that was admitted takes the source onto the target: then `matrix` is the closest found."""
        return not self.status.startswith((OK, OPEN))


def _known(kind: type[Alignment], told: dict[str, Any], coset: Coset, said: Verdict, near: Nearness) -> Alignment:
    return kind(**told, _coset=lambda: coset, _verdict=lambda: said, _nearness=lambda: near)


def _homogeneous(matrix: Array, shift: Array) -> Array:
    full = np.eye(len(shift) + 1)
    full[:-1, :-1], full[:-1, -1] = matrix, shift
    return full
