"""The denoised surface as a judge: by how much an operation misses it, and what noise alone would show."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from symrefine.geometry import Array, Axis, Isometry, Mask, read_only
from symrefine.moments.moments import PARTS
from symrefine.samples import COUNT, LOOK
from symrefine.surface.drift import Drift
from symrefine.surface.misses import (
    DISCS,
    LIMITS,
    SHARES,
    SURE,
    TOLERANCE,
    disc_distances,
    miss_distances,
    needs,
    needs_of_atoms,
    spread_distance,
)
from symrefine.surface.openings import Openings, agreed
from symrefine.surface.skin import LocalPlanes, Skin
from symrefine.surface.wedge import Wedge

# Standard deviation over mean of the distance to the nearest of random points in a volume (Weibull, shape 3).
NEAREST_SPREAD = 0.363
# Local planes that show how the patches of an image hang together.
PATCHES = 1500
# Misses of an open surface end where the least of it needs so many tolerances: nothing beyond is told apart.
HOPELESS = 3.0


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Shares of a surface that operations carry onto itself (of what moves), where it says no, where nobody looked.

    Where parts are unseen, `told` is the share that is carried onto another part of it, not along its own plane, by the
    operation that says most: a flat piece slides on itself under many, wherever it ends.
    """

    supported: float
    contradicted: float
    unseen: float
    told: float

    @property
    def belief(self) -> float:
        """What it asks to believe: 1 where as much of the image was not seen as was; areas grow with lengths.

        Where all that was seen but for a detail slides on itself, there is nothing to believe it for.
        """
        return math.sqrt(self.unseen / max(self._telling, 1e-9))

    @property
    def tells_nothing(self) -> bool:
        """Whether it was not seen whole, and nothing of what was seen says anything for it."""
        return self.unseen > 0.0 and self._telling == 0.0

    @property
    def _telling(self) -> float:
        return self.supported if self.told > SHARES[0] else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Local planes in normalised units, the diagonal their misses are measured by, and what noise alone would show.

    Attributes:
        cloud: the local planes.
        diagonal: normalised units.
        noise: [M] misses that noise alone shows, fractions of the diagonal; none if empty.
        openings: where the surface is open, or None.
        drift: windows that tell of parts out of place, where noise is thick.
        skin: the points that the local planes were fitted to; None where there is no more to be known of them.
        wedges: what was folded of it so far, where details may be finer than neighbourhoods.
        tolerance: what is asked for, as a fraction of the diagonal: of a surface with openings, what misses by more
            than 95 % may meets no surface.
    """

    cloud: LocalPlanes
    diagonal: float
    noise: Array = field(default_factory=lambda: np.empty(0))
    openings: Openings | None = None
    drift: Drift | None = None
    skin: Skin | None = None
    wedges: list[Wedge] = field(default_factory=list)
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        object.__setattr__(self, "noise", read_only(np.sort(self.noise)))

    def look_about(self, axis: Axis, fold: int) -> None:
        """Fold it about an axis of so many folds, unless it was, or neighbourhoods are small enough without."""
        if self.skin is not None and fold > 1 and not self.looked_about(axis, fold):
            self.wedges.append(Wedge.of(self.skin, axis, fold))

    def looked_about(self, axis: Axis, fold: int) -> bool:
        """Whether it was folded so often about an axis, as near as neighbourhoods tell, or that would tell no more."""
        if any(w.is_about(axis, fold) for w in self.wedges):
            return True
        return self.skin is None or Wedge.is_needless(self.skin, axis, fold)

    @property
    def viewed(self) -> bool:
        """Whether cameras are known that saw it: then they say what was not seen, and normals point out of the body."""
        return self.openings is not None and bool(self.openings.cameras)

    @property
    def is_open(self) -> bool:
        """Whether parts of it may be missing: cameras did not see them, or it ends somewhere. A clump only hides."""
        return self.viewed or (self.openings is not None and bool(self.openings.line.any()))

    @property
    def is_noisy(self) -> bool:
        """Whether noise leaves no planes to the smallest neighbourhoods, or no surface at all."""
        return self.cloud.body == "volume" or (self.skin is not None and self.skin.noisy)

    @property
    def lacks_much(self) -> bool:
        """Whether much of it may be missing: what it ends at is no whim of the sample, or it stands on something."""
        return self.is_open and self.openings is not None and self.openings.hide_much

    @cached_property
    def closed(self) -> "Surface":
        """The surface taken as whole: it ends where it does, and something may hide parts of it."""
        closed = None if self.openings is None else self.openings.closed
        return self if closed is self.openings else replace(self, openings=closed)

    @cached_property
    def unclosed(self) -> float:
        """How much of it cameras did not see at least, by the area that they saw: 1/2 of half a ball; 0 without them.

        The normals of a closed surface, out of it and as long as its parts are large, add up to nothing.
        """
        areas = self.cloud.reach**2
        return float(np.linalg.norm(areas @ self.cloud.normals) / areas.sum()) if self.viewed else 0.0

    @property
    def far(self) -> float:
        """Misses from which on a point meets no surface, a fraction of the diagonal."""
        return LIMITS[1] * self.tolerance

    @property
    def margin(self) -> float:
        """The same in normalised units."""
        return self.far * self.diagonal

    @property
    def ceiling(self) -> float:
        """What is needed from which on nothing is told apart of an open surface."""
        return HOPELESS * self.tolerance

    def stride(self, sources: int, *, matched: bool = False) -> int:
        """Stride that leaves about `sources` local planes; enough for the patches of an image to hang together.

        Those that are only to be `matched` need not hang together, but of a view few have a counterpart.
        """
        least = PATCHES if self.viewed or (self.is_open and not matched) else 1
        return max(1, len(self.cloud.points) // max(sources, least))

    def meets(self, places: Array) -> Mask:
        """Which of places [N, 3] lie on the surface, of whatever class it is there."""
        return disc_distances(self.of_one_class, places) <= self.margin

    @cached_property
    def of_one_class(self) -> LocalPlanes:
        """Its local planes, where any point may meet any other."""
        return self.cloud.of_one_class()

    def misses(
        self, motions: Sequence[Isometry], *, sources: int = 10**9, bound: float = math.inf, discs: int = DISCS
    ) -> Array:
        """By how much each of K operations misses the surface [K, N], fractions of the diagonal.

        Args:
            motions: the operations.
            sources: local planes that are moved.
            bound: misses end here, which is quicker.
            discs: as of `disc_distances`.
        """
        stride = self.stride(sources)
        bound = min(bound, LIMITS[-1] * self.ceiling) if self.is_open else bound
        bound *= self.diagonal
        return miss_distances(self.cloud, motions, stride=stride, bound=bound, discs=discs) / self.diagonal

    def seen(
        self,
        misses: Array,
        motions: Sequence[Isometry],
        *,
        sources: int = 10**9,
        together: bool = False,
        group: Sequence[Isometry] = (),
    ) -> Array:
        """The misses [K, N] of K operations, NaN for what they carry to where nobody looked.

        `sources` as before. Of operations that are judged `together` most say whether somebody looked at a place,
        unless cameras do. Operations of their `group` tell where an object ends that has it, see `Openings.unseen`.
        """
        if self.openings is None:
            return misses
        stride, away = self.stride(sources), misses > self.far
        points, normals = self.cloud.points[::stride], self.cloud.normals[::stride]
        moved = np.stack([motion.apply(points) for motion in motions])
        turned = np.stack([motion.turn(normals) for motion in motions]) if self.viewed else None
        unseen = self.openings.unseen(self.cloud, moved, away, stride, self.margin, turned=turned, group=group)
        if together and not self.viewed:
            unseen[away] = agreed(moved[away], unseen[away])
        return np.where(unseen, np.nan, misses)

    def coverage(self, misses: Array, motions: Sequence[Isometry], *, sources: int = 10**9) -> Coverage:
        """What K operations say that miss by so much where it was seen [K, N]: the one that says least."""
        some = slice(None, None, self.stride(sources))
        still, far = self.cloud.points[some], self.margin
        travels = np.stack([m.apply(still) - still for m in motions])
        lengths = np.linalg.norm(travels, axis=2)
        unseen = np.isnan(misses)
        off = np.nan_to_num(misses) > self.far
        met = ~unseen & ~off
        supported = float(((lengths > far) & met).mean(axis=1).min())
        told = supported
        if unseen.any():
            # Out of the own plane, as it was and as it came to lie, by more than its tilt may be wrong.
            normals = self.cloud.normals[some]
            turned = np.stack([m.turn(normals) for m in motions])
            heights = np.maximum(*(abs(np.einsum("kni,kni->kn", travels, n)) for n in (normals[None], turned)))
            told = float(((heights > far + self.cloud.flatness[some] * lengths) & met).mean(axis=1).max())
        return Coverage(
            supported=supported,
            contradicted=float(off.mean(axis=1).max()),
            unseen=float(unseen.mean(axis=1).max()),
            told=told,
        )

    def needed(self, misses: Array, motions: Sequence[Isometry], tests: int = 1) -> Array:
        """The smallest tolerances [K], fractions of the diagonal, at which operations hold that miss so [K, N].

        Of a volume the nearest points tell the outline only; by how much its mass spreads otherwise counts like a mean.
        `tests` as of `needs`.
        """
        if self.cloud.body == "atoms":
            return needs_of_atoms(misses, tests)
        found = needs(misses, self.noise, tests)
        if self.cloud.body == "surface":
            return found
        own, chance = self._spread
        apart = np.array([spread_distance(own, m.matrix @ own @ m.matrix.T) for m in motions]) ** 2
        # An operation may compare no more than two components, as a mirror does: then the square is exponentially
        # distributed. It may be as large as is as rare as `SURE` standard deviations are.
        chance *= math.log(tests / math.erfc(SURE / math.sqrt(2.0)))
        return np.maximum(found, np.sqrt(np.maximum(apart - chance, 0.0)) / (self.diagonal * LIMITS[0]))

    @cached_property
    def _spread(self) -> tuple[Array, float]:
        """Covariance of the points [3, 3], and by how much, in squares, chance puts it off its image in the mean."""
        points = self.cloud.points[np.random.default_rng(0).permutation(len(self.cloud.points))]
        own, parts = np.cov(points.T), [np.cov(points[k::PARTS].T) for k in range(PARTS)]
        # One of n pieces is n - 1 times as far off as the whole, in squares, and the image is off as much once more.
        return own, float(2.0 * np.mean([spread_distance(own, part) ** 2 for part in parts]) / (PARTS - 1))

    def drifts(self, motions: Sequence[Isometry]) -> Array:
        """How far windows of each of K images lie from those of the cloud [K, S], fractions of the diagonal."""
        if self.drift is None:
            return np.empty((len(motions), 0))
        drifts = self.drift.misses(motions, _windows_each(motions)) / self.diagonal
        if self.openings is None or self.openings.floor is None:
            return drifts
        return np.where(self.drift.cut(motions, _windows_each(motions), self.openings.floor), np.nan, drifts)

    def drifts_seen(self, drifts: Array, misses: Array, motions: Sequence[Isometry], *, sources: int = 10**9) -> Array:
        """The same, NaN where a window reaches what operations carry to where nobody looked, where they miss by NaN.

        `sources` as of `misses`.
        """
        if self.drift is None or not drifts.any():
            return drifts
        unseen = self._unseen(misses, motions, sources)
        return np.where(self.drift.reach(motions, _windows_each(motions), unseen), np.nan, drifts)

    def drifted(self, drifts: Array, tests: int = 1) -> tuple[Array, float]:
        """The smallest tolerances [K] at which operations hold whose windows drift so [K, S], and that of all together.

        `tests` as of `needs`.
        """
        if self.drift is None:
            return np.zeros(len(drifts)), 0.0
        noise = self.drift.noise / self.diagonal
        each, every = (self.drift.redundancy(count) for count in (drifts.shape[1], drifts.size))
        # All operations compare the same windows: they tell of no more of them than one does.
        together = needs(drifts.ravel(), noise, redundancy=every, noise_redundancy=each)
        return needs(drifts, noise, tests, each), float(together)

    def _unseen(self, misses: Array, motions: Sequence[Isometry], sources: int) -> list[tuple[Array, Array]]:
        """Of each operation what it, and what its inverse, takes to where nobody looked, [., 3] each."""
        points = self.cloud.points[:: self.stride(sources)]
        unseen = np.isnan(misses)
        back, turns = unseen.copy(), [k for k, m in enumerate(motions) if not m.is_involution]
        if turns:
            ways = [motions[k].inverse for k in turns]
            back[turns] = np.isnan(self.seen(self.misses(ways, sources=sources), ways, sources=sources))
        return [(points[a], points[b]) for a, b in zip(unseen, back, strict=True)]

    def needed_by_all(self, misses: Array) -> float:
        """The smallest tolerance at which a surface holds that operations together miss so [K, N]."""
        return float(needs(misses.ravel(), self.noise)) if self.cloud.body == "surface" else 0.0

    def needs(
        self,
        motions: Sequence[Isometry],
        *,
        sources: int = 10**9,
        most: float = math.inf,
        discs: int = DISCS,
        tests: int = 1,
        together: bool = False,
    ) -> Array:
        """The smallest tolerances [K] at which each of K operations holds, as far as it was seen.

        From `most` on they are lower bounds, which is quicker. `sources` and `discs` as of `misses`, `tests` as of
        `needed`, `together` as of `seen`.
        """
        misses = self.misses(motions, sources=sources, bound=LIMITS[-1] * most, discs=discs)
        return self.needed(self.seen(misses, motions, sources=sources, together=together), motions, tests)

    def need(self, motions: Sequence[Isometry], *, sources: int = 10**9) -> float:
        """The smallest tolerance at which all of some operations hold."""
        return float(self.needs(motions, sources=sources).max())

    @cached_property
    def floor(self) -> float:
        """The smallest tolerance at which what noise alone shows would count as symmetric.

        Of a volume the noise is the distance to the nearest point, which is known; only how it spreads is not.
        """
        if not self.noise.size:
            return 0.0
        share = NEAREST_SPREAD if self.cloud.body == "volume" else 1.0
        return share * float(needs(self.noise, np.empty(0)))


def _windows_each(motions: Sequence[Isometry]) -> int:
    """Windows that each of some operations moves."""
    return max(LOOK, COUNT // len(motions))
