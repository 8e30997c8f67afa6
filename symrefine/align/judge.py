"""Maps between two surfaces that share a part only, as the two judge them: proposed, polished, and what follows.

What a map lays on the other side speaks for it, and what it lays where somebody looked and nothing is against it. What
carries one side, or what is shared, onto itself makes further maps that do as well.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symrefine.align.alike import maps_between
from symrefine.align.contact import met_by
from symrefine.align.pair import Side
from symrefine.align.polish import COARSE, Polished, Similarity, polish
from symrefine.align.shown import Shown
from symrefine.decide.maps import Merit, ahead, as_good, score, well_met
from symrefine.decide.posterior import LEAST
from symrefine.fit.matching import AGREE
from symrefine.fit.refine import MAX_OUTER
from symrefine.geometry import Array, Isometry, Mask, householder, tight_diagonal
from symrefine.ntuples.rank import SIGNIFICANT
from symrefine.propose.maps import PLANES, WITHIN, maps_onto_itself
from symrefine.propose.votes import mirror_votes
from symrefine.rounding import SINGLE
from symrefine.samples import FOLLOWED
from symrefine.shape import Index
from symrefine.surface.misses import LIMITS, disc_distances
from symrefine.surface.surface import HOPELESS

# Share of what meets under the best map that has to meet under one that is polished.
WORTH = 0.5
# Maps that are looked at where many do as well: as many as the rotations of a cube, and their images, would be 48.
MOST_MAPS = 16
# Densest spots of votes for mirrors that are looked at. Mirrors of whole chairs and beds are among the first four.
MIRRORS = 12
# Share of what meets that has to meet in a mirror, as it was voted for, lest the polish is wasted.
ITS_OWN = 0.8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Met:
    """A map between two surfaces that was polished, and what they say of it.

    Attributes:
        motion: the map.
        covariance: [6, 6] of the rotation vector (target axes, radians) and the shift; zero along what nothing tells.
        sides: what of the source, and of the target, it lays on the other.
        overlap: share of the source, and of the target, that meets the other.
        rms: of the misses where they meet.
        sigma: standard deviation of the score, as the local planes are drawn.
    """

    motion: Similarity
    covariance: Array
    sides: tuple[Merit, Merit]
    overlap: tuple[float, float]
    rms: float
    sigma: float

    @property
    def score(self) -> float:
        """The more the better."""
        return score(self.sides)

    @property
    def is_promising(self) -> bool:
        """Whether more speaks for it than against it."""
        return self.score > 0.0

    @property
    def determinant(self) -> int:
        """+1 or -1."""
        return int(np.sign(np.linalg.det(self.motion.matrix)))

    @property
    def is_loose(self) -> bool:
        """Whether it may slide or turn, and meets as well."""
        return bool(np.linalg.matrix_rank(self.covariance) < len(self.covariance))


@dataclass(frozen=True, kw_only=True, eq=False)
class Judge:
    """Two surfaces that judge maps between them, the smaller diagonal of both, and the tolerance."""

    source: Shown
    target: Shown
    diagonal: float
    tolerance: float

    @classmethod
    def of(
        cls, sides: Sequence[Side], units: Sequence[float], tolerance: float, seed: int, planes: int = PLANES
    ) -> "Judge | None":
        """Two sides, each about its own centre and in its own units, the coarser one made as fine as the other.

        None where one of them shows no surface: see `Shown.of`.
        """
        source, target = (Shown.of(side, unit, seed, planes) for side, unit in zip(sides, units, strict=True))
        if source is None or target is None:
            return None
        finest = min(source.cloud.spacing, target.cloud.spacing)
        source, target = source.as_fine_as(finest), target.as_fine_as(finest)
        diagonal = min(tight_diagonal(shown.cloud.points) for shown in (source, target))
        return cls(source=source, target=target, diagonal=diagonal, tolerance=tolerance)

    @cached_property
    def near(self) -> float:
        """Miss up to which local planes are well met, diagonals: as the noisier side has it, as both miss by that."""
        return max(well_met(side.noise) for side in (self.source, self.target)) / self.diagonal

    @property
    def beside(self) -> float:
        """How far off a map may be that was made of polished ones: less than local planes lie apart."""
        return min(self.source.cloud.spacing, self.target.cloud.spacing)

    @property
    def far(self) -> float:
        """Miss from which on nothing is met, diagonals."""
        return LIMITS[1] * self.tolerance

    def promising(self) -> list[Similarity]:
        """The maps of each determinant that are proposed under which most local planes meet others, as they stand."""
        proposed = maps_between(self.source.cloud, self.target.cloud, self.diagonal)
        every = [Similarity.of(p) for p in proposed]
        count = [int(self.meets(m).sum()) for m in every]
        order = [i for i in np.argsort(-np.array(count), kind="stable") if count[i] >= max(WORTH * max(count), 1.0)]
        signs = [float(np.sign(np.linalg.det(every[i].matrix))) for i in order]
        return [every[i] for k, i in enumerate(order) if signs[:k].count(signs[k]) < FOLLOWED]

    def meets(self, motion: Similarity) -> Mask:
        """Which of every so many local planes of the source meet others of the target, as they stand."""
        every = slice(None, None, COARSE)
        some, classes = self.source.cloud.chosen(every), self.source.cloud.classes(every)
        away, met = met_by(self.target.cloud, motion.apply(some.points), classes)
        facing = np.abs(np.einsum("ij,ij->i", motion.turn(some.normals), met.normals)) > AGREE
        return facing & (away < WITHIN * self.diagonal)

    def shared(self, motion: Similarity) -> float:
        """What shares of the local planes of both meet others, as they stand, multiplied."""
        back = replace(self, source=self.target, target=self.source)
        return float(self.meets(motion).mean() * back.meets(motion.inverse).mean())

    def mirrored(self, best: Met) -> list[Similarity]:
        """What the best map is followed by where what meets under it may be its own mirror image, to be polished.

        Of many equal matches few agree on any one map, so that others as good need not be among those proposed.
        """
        meets, motion = self.meets(best.motion), best.motion
        some = self.source.cloud.chosen(slice(None, None, COARSE)).chosen(meets)
        planes = _mirrors(motion.apply(some.points), motion.turn(some.normals))
        return [s for s in (p.after(motion) for p in planes) if self.meets(s).sum() >= ITS_OWN * meets.sum()]

    def images(self, best: Met) -> list[Similarity]:
        """The best map after what carries all of the source onto itself, and before what does so of the target.

        That makes maps that do as well, whatever the other side shows of it.
        """
        before, after = replace(self, target=self.source), replace(self, source=self.target)
        starts = [best.motion.after(p) for p in before.own_maps()]
        return starts + [p.after(best.motion) for p in after.own_maps()]

    def own_maps(self) -> list[Similarity]:
        """What carries most of a surface, judged with itself, onto itself: mirrors that it votes for, and other maps.

        Polished, as all of it tells where they stand, and not only what the other side shows. What is evidently a part
        hardly has any other.
        """
        cloud, found, still = self.source.cloud, list[Similarity](), Similarity(matrix=np.eye(3), shift=np.zeros(3))
        whole = not self.source.openings.evident
        others = maps_onto_itself(cloud, self.diagonal, np.random.default_rng(0)) if whole else []
        for start in (*_mirrors(cloud.points, cloud.normals), *map(Similarity.of, others)):
            if not self._among(start, [still, *found]) and self.meets(start).mean() >= ITS_OWN:
                found.append(self._polish(start).motion)
        return found

    def polished(self, start: Similarity) -> Met:
        """A map after the polish, judged from both sides."""
        return self._judged(self._polish(start))

    def _polish(self, start: Similarity, *, patient: bool = True, error: float | None = None) -> Polished:
        """A map after the polish, which is given up early where nothing comes of it, unless one is `patient`.

        The start may be off by `error`, radians and RMS radii; by as much as matches lie apart if None.
        """
        known, worth = np.zeros((6, 6)), lambda m: self.within_reach(m) > 0.0
        asked, error = None if patient else worth, WITHIN * self.diagonal if error is None else error
        return polish(self.source.moving, self.target.cloud, start, error=error, known=known, worthwhile=asked)

    def _judged(self, done: Polished) -> Met:
        there, back = (self.source, self.target, done.motion), (self.target, self.source, done.motion.inverse)
        (one, misses), (other, back_misses) = self.side(*there), self.side(*back)
        met = np.concatenate([misses, back_misses])
        return Met(
            motion=done.motion,
            covariance=done.covariance,
            sides=(one, other),
            overlap=(one.well + one.less, other.well + other.less),
            rms=self.diagonal * float(np.sqrt(np.mean(met**2))) if len(met) else math.inf,
            sigma=max(one.sigma(len(self.source.cloud.points)), other.sigma(len(self.target.cloud.points))),
        )

    def side(self, here: Shown, there: Shown, motion: Similarity) -> tuple[Merit, Array]:
        """What one side says of a map, and by how much its local planes miss the other where they meet, diagonals."""
        moved = motion.apply(here.cloud.points)
        misses = self.misses(there, moved, here.cloud.labels)
        unseen = here.unseen(there, moved, misses > self.far, self.far * self.diagonal)
        return Merit.of(misses, unseen, self.near, self.far), misses[~unseen & (misses <= self.far)]

    def misses(self, there: Shown, moved: Array, classes: Index | None) -> Array:
        """By how much points [N, 3] of some classes [N] miss one of the two surfaces, diagonals."""
        bound = HOPELESS * self.far * self.diagonal
        return disc_distances(there.cloud, moved, classes, bound=bound) / self.diagonal

    def within_reach(self, motion: Similarity) -> float:
        """What a map scores at best, as every so many local planes tell it: nobody looked where nothing is met."""
        every, found = slice(None, None, COARSE), []
        ways = (self.source, self.target, motion), (self.target, self.source, motion.inverse)
        for here, there, way in ways:
            misses = self.misses(there, way.apply(here.cloud.points[every]), here.cloud.classes(every))
            merit = Merit.of(misses, misses > self.far, self.near, self.far)
            found.append(merit.score + SIGNIFICANT * merit.sigma(len(misses)))
        return max(found)

    def uphill(self, met: Met) -> tuple[Met, float]:
        """A map, or what it leads to where it does better slid aside; and the best score, at most, slid from there.

        The polish ends where too few of the local planes tell it to go on along a ridge.
        """
        for _ in range(MAX_OUTER):
            aside, slid = self.aside(met)
            if slid <= met.score or (further := self.polished(aside)).score <= met.score:
                break
            met = further
        return met, slid

    def aside(self, met: Met, across: Array | None = None) -> tuple[Similarity, float]:
        """A map slid or turned in the way that is known worst, to the better side, and its score, at most.

        The score is the bound `within_reach` where that leaves less doubt than is worth telling. What is left open
        anyway is not asked, given the projection [6, 6] `across` it; of the rest what nothing tells is known worst.
        """
        worst = np.linalg.eigh(met.covariance if across is None else _known(met.covariance, across))[1][:, -1]
        arms = met.motion.turn(self.source.moving.points)
        travel = np.linalg.norm(np.cross(worst[:3], arms) + worst[3:], axis=1).mean()
        step = WITHIN * self.diagonal / travel * worst
        moved = [met.motion.moved(x) for x in (step, -step)]
        scores = [self.within_reach(m) for m in moved]
        if ahead(met.score, scores) <= 1.0 - LEAST:
            scores = [self._score(m) for m in moved]
        return max(zip(moved, scores, strict=True), key=lambda pair: pair[1])

    def _score(self, motion: Similarity) -> float:
        there, back = (self.source, self.target, motion), (self.target, self.source, motion.inverse)
        return score([self.side(*way)[0] for way in (there, back)])

    def polished_all(
        self, known: Sequence[Met], starts: Sequence[Similarity], *, patient: bool = False, error: float | None = None
    ) -> list[Met]:
        """The maps that are known, and those that starts lead to and are none of them, nor far behind the best.

        The most promising are judged first, which shows how good the others would have to be; one is told if one is
        `patient`. `error` as of the polish.
        """
        every, ends, there = list(known), list[Polished](), [m.motion for m in known]
        for start in starts:
            if self._among(start, there):
                continue
            done = self._polish(start, patient=patient, error=error)
            if not done.given_up and not self._among(done.motion, there):
                ends.append(done)
                there.append(done.motion)
        bounds = [self.within_reach(done.motion) for done in ends]
        for bound, done in sorted(zip(bounds, ends, strict=True), key=lambda pair: -pair[0]):
            if not every or (bound > 0.0 and as_good(max(m.score for m in every), bound)):
                every.append(self._judged(done))
        return every

    def not_short_of(self, known: Sequence[Met], starts: Sequence[Similarity]) -> list[Met]:
        """The maps that are known, but for those that do worse than a start beside them does as it stands.

        Of a part in common few local planes tell where the polish should end, and it may end before.
        """
        return [m for m in known if not any(self.same(s, m.motion) and self._score(s) > m.score for s in starts)]

    def _among(self, one: Similarity, others: Sequence[Similarity]) -> bool:
        return any(self.same(one, other) for other in others)

    def same(self, one: Similarity, other: Similarity) -> bool:
        """Whether two maps are one."""
        points = self.source.cloud.points[::COARSE]
        away = np.linalg.norm(one.apply(points) - other.apply(points), axis=1)
        return float(away.mean()) < WITHIN * self.diagonal

    def closed(self, found: Sequence[Met], best: Met) -> list[Met]:
        """With the maps that what leads from the best to another as good makes of those as good, until none is new.

        They differ by what carries onto themselves the parts that are shared: each is as good but for what is not.
        """
        every, tried = list(found), [m.motion for m in found]
        while len(every) < MOST_MAPS:
            good = [m.motion for m in every if as_good(best.score, m.score)]
            products = (a.after(best.motion.inverse).after(b) for a in good for b in good)
            fresh = next((p for p in products if not self._among(p, tried)), None)
            if fresh is None:
                break
            tried.append(fresh)
            every = self.polished_all(every, [fresh], error=self.beside)
            tried.append(every[-1].motion)
        return every


def _known(covariance: Array, across: Array) -> Array:
    """A covariance [6, 6] projected, up to a factor; largest along what nothing tells, where it was zero."""
    known, ways = np.linalg.eigh(covariance)
    known /= max(known[-1], np.finfo(float).tiny)
    known[: len(known) - np.linalg.matrix_rank(covariance)] = 1.0 / SINGLE
    return across @ (ways * known) @ ways.T @ across


def _mirrors(points: Array, normals: Array) -> list[Similarity]:
    """The mirrors that local planes [N, 3] vote for; none where there are too few of them."""
    votes = mirror_votes(points, normals, np.random.default_rng(0), told=MIRRORS)
    return [Similarity.of(Isometry.about(foot, householder(normal))) for normal, foot in zip(*votes, strict=True)]
