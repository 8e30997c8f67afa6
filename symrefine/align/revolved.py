"""What bodies of revolution leave open where only parts of them meet: any turn about the axis does as well.

A scan of a bottle tells where its model stands but for that turn, however little of it was seen. So maps that differ by
it are one, and what the parts share may turn in itself without leaving anything in doubt.
"""

import math
from dataclasses import dataclass

import numpy as np

from symrefine.align.judge import Judge, Met
from symrefine.align.pair import Evidence, Side
from symrefine.align.polish import Similarity
from symrefine.detection.result import Detection
from symrefine.fit.placed import Placed
from symrefine.geometry import Array, Isometry, householder
from symrefine.groups.elements import DIRECTION_ERROR_RAD


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turns:
    """The continuous group of what two surfaces show parts of, where it stands in the target, and how sure that is.

    Attributes:
        placed: about the target's centre, in its units.
        confidence: probability that the object has it.
    """

    placed: Placed
    confidence: float

    def relate(self, judge: Judge, one: Met, other: Met) -> bool:
        """Whether two maps differ by an operation of the group."""
        between = other.motion.after(one.motion.inverse)
        nearest = self.placed.group.nearest(between.matrix[None])[0]
        return judge.same(self._about(nearest).after(one.motion), other.motion)

    def mirrored(self, motion: Similarity) -> Similarity:
        """A map followed by a mirror through an axis, as every body of revolution has them."""
        return self._about(householder(self.placed.group.mirrors()[0])).after(motion)

    def _about(self, matrix: Array) -> Similarity:
        return Similarity.of(Isometry.about(self.placed.center, matrix))

    def ways(self, motion: Similarity) -> Array:
        """Motions [k, 6] of a map, turn and shift as `Similarity.moved` has them, that turn it about the axes."""
        axes = self.placed.group.continuous_axes()
        return np.hstack([axes, np.cross(axes, motion.shift - self.placed.center)])

    def across(self, motion: Similarity) -> Array:
        """The projection [6, 6] of motions of a map across these."""
        ways = self.ways(motion)
        return np.eye(ways.shape[1]) - np.linalg.pinv(ways) @ ways


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shows:
    """What one side shows, and whether that is all of the object."""

    side: Side
    found: Detection

    @property
    def whole(self) -> bool:
        """Whether it was seen whole, and what it is."""
        return not (self.found.undetermined or self.found.at_least)


def shown_by(evidence: Evidence, met: Met) -> list[Shows]:
    """What the sides show that a map lays on one another: one that was seen whole alone, if there is one, or both.

    Of two such the one of which less meets the other.
    """
    every = list[Shows]()
    sides = zip(met.overlap, (evidence.source, evidence.target), strict=True)
    for _, side in sorted(sides, key=lambda part: part[0]):
        shows = Shows(side=side, found=evidence.detected(side))
        if shows.whole:
            return [shows]
        every.append(shows)
    return every


def turns_between(every: list[Shows], evidence: Evidence, motion: Similarity, factor: float) -> Turns | None:
    """The turns under which what two surfaces share looks the same, given a map between them; None if there are none.

    A side that was seen whole says what the object is. Where neither was both have to be bodies of revolution, about
    the same axis: what is seen of a mug without its handle is one, too.

    Args:
        every: what the sides show.
        evidence: the two of them.
        motion: from the source to the target, each about its own centre, in units of the target.
        factor: size of the source in units of the target.
    """
    if any(shows.found.undetermined or shows.found.group.is_finite for shows in every):
        return None
    unit, placed = evidence.target.moments.scale, list[Placed]()
    for shows in every:
        of_target = shows.side is evidence.target
        center = (shows.found.center - shows.side.moments.center) * (1.0 if of_target else factor) / unit
        here = Placed(group=shows.found.group.for_point_set(), center=center)
        placed.append(here if of_target else _carried(here, motion))
    cosine = placed[0].group.frame[2] @ placed[-1].group.frame[2]
    if abs(cosine) < math.cos(2.0 * DIRECTION_ERROR_RAD):  # either axis may be off
        return None
    # The smaller group leaves less open.
    least = min(placed, key=lambda p: (len(p.group.continuous_axes()), not p.group.is_polar))
    return Turns(placed=least, confidence=min(shows.found.confidence for shows in every))


def _carried(placed: Placed, motion: Similarity) -> Placed:
    """A group where a map carries it."""
    return Placed(group=placed.group.carried(motion.matrix), center=motion.apply(placed.center[None])[0])
