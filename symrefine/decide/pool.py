"""What was found so far: groups fitted, joined, turned down, and which starts they make needless."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from symrefine.decide.hypotheses import NOTHING, Hypothesis, has_all
from symrefine.decide.posterior import ALIKE
from symrefine.fit.placed import Placed
from symrefine.groups import PointGroup, is_subgroup
from symrefine.groups.closure import MAXIMAL, may_be_in_one
from symrefine.groups.elements import DIRECTION_ERROR_RAD
from symrefine.rounding import START_ERROR
from symrefine.samples import FOLLOWED


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pool:
    """What was found so far.

    Attributes:
        small: groups fitted and judged.
        largest: the largest that holds within the limit.
        failed: groups that the largest and another one generate, which do not hold.
        looks: what candidates that were looked at seemed to need at a glance, and where the look put them.
        looked: candidates turned down after a look, where a coarse fit put them, with what they seem to need.
        hopeless: the same of those turned down at a glance.
        vain: what candidates seemed to need that no fit brought within the limit.
        whole: whether the surface was taken as whole, and not as what was seen of one.
        at_least: whether there may be more that was not seen.
        nothing: what is as good as no need: noise hides it, or no tolerance that is asked for makes a doubt of it.
        limit: what the largest may need.
    """

    small: tuple[Hypothesis, ...] = ()
    largest: Hypothesis = NOTHING
    failed: tuple[Hypothesis, ...] = ()
    looks: tuple[tuple[float, Placed], ...] = ()
    looked: tuple[tuple[Placed, float], ...] = ()
    hopeless: tuple[tuple[Placed, float], ...] = ()
    vain: tuple[float, ...] = ()
    whole: bool = False
    at_least: bool = False
    nothing: float = 0.0
    limit: float = 0.0

    @property
    def seen(self) -> list[tuple[Placed, float]]:
        """Candidates where a fit put them, with what they need."""
        return [*((h.placed, h.need) for h in self.small), *self.looked]

    def turned_down(self) -> list[Hypothesis]:
        """Candidates turned down after a look, best first, with nothing known of them but what they seem to need."""
        found = (Hypothesis(placed=placed, elements=(), need=need) for placed, need in self.looked)
        return sorted(found, key=lambda h: h.need)

    def has(self, placed: Placed, needs: float = 0.0) -> bool:
        """Whether a group is in one that was fitted and needs no more than it does, or as good as nothing."""
        most = max(ALIKE * needs, self.nothing)
        return any(h.need <= most and h.holds(placed) for h in (self.largest, *self.small))

    def has_as_seen(self, placed: Placed) -> bool:
        """Whether a group is in one that was fitted and needs as good as nothing but belief in what was not seen."""
        most = self.nothing
        return any(h.need <= math.hypot(most, h.believed) and h.holds(placed) for h in (self.largest, *self.small))

    @property
    def exact(self) -> Hypothesis:
        """The largest group if it needs nothing and carries all that was seen onto what was, or else `NOTHING`.

        No smaller one: where noise hides what it needs it hides where it stands as well, and something larger tells.
        """
        found = self.largest
        keeps = bool(found.elements) and not any(e.coverage.unseen > 0.0 for e in found.elements)
        return found if keeps and found.need <= self.nothing else NOTHING

    def wants(self, start: Placed, error_rad: float) -> bool:
        """Whether a group is in none that is as good as exact, and something may hold both it and the exact largest.

        What is exact is in every larger group: a start that may be so far off has to stand where some point group holds
        it, too. Of those that hold all of a cube or an icosahedron there is but that of a ball.
        """
        exact = self.exact.group
        if self.has(start) or (exact.name in MAXIMAL and start.group.name != "Kh"):
            return False
        return may_be_in_one(exact, start.group, error_rad)

    def denies(self, needs: float) -> bool:
        """Whether a group seems to need more than the limit, and several that seemed no worse do when fitted.

        Of what is nearly a ball any axis seems to hold within little more than the limit, and fits say the same.
        """
        return needs > self.limit and sum(seemed <= needs for seemed in self.vain) >= FOLLOWED

    def met(self, placed: Placed) -> bool:
        """Whether a group was fitted at this very place."""
        return any(is_at(h.placed, placed) for h in self.small)

    def shows(self, start: Placed, glance: float, *, whole: bool = True) -> bool:
        """Whether the largest group carries a group that was seen onto this one, which looks no better at a glance.

        Of what is in a continuous group something may hold better than the rest: there a start tells of itself alone.
        Where the `whole` was not seen, operations carry what was onto what was not: one shows itself alone there. But
        what is exact carries a group to where it needs as much, and looks so but for the sample.
        """
        inside = not self.largest.group.is_finite and self.largest.holds(start)
        exact, name = self.exact.group, start.group.name
        glance = math.hypot(glance, self.nothing)  # by less no two starts differ
        alike = [p for p, need in self.seen if p.group.name == name and need < ALIKE * glance]
        # From another start, no worse than this one, a look came to where this one stands.
        worst = (1.0 if exact.name == "C1" else ALIKE) * glance
        ends = (end for seemed, end in self.looks if end.group.name == name and seemed <= worst)
        alike += [end for end in ends if np.linalg.norm(end.center - start.center) < START_ERROR]
        # A quarter of a turn lies half way between mirrors of two kinds.
        fold = exact.symbol.fold
        within = min(START_ERROR, 0.5 * math.pi / fold) if 0 < fold < math.inf else START_ERROR
        within = DIRECTION_ERROR_RAD if inside else within
        carrying = NOTHING.group if inside else self.largest.group if whole else exact
        return any(is_same(image, start, within) for p in alike for image in _images(p, carrying, start))

    def with_failed(self, failed: Hypothesis | None) -> "Pool":
        """The pool that knows of a group, if there is one, that it does not hold."""
        return self if failed is None or failed in self.failed else replace(self, failed=(*self.failed, failed))


def is_at(a: Placed, b: Placed) -> bool:
    """Whether two groups are one and stand at the very same place, as far as fitted directions tell."""
    return a.group.name == b.group.name and is_subgroup(b.group, a.group, DIRECTION_ERROR_RAD)


def is_same(a: Placed, b: Placed, within_rad: float = START_ERROR) -> bool:
    """Whether two groups are one, as far as directions tell that may be so far apart."""
    return a.group.name == b.group.name and has_all(a, b, within_rad)


def _images(known: Placed, group: PointGroup, wanted: Placed) -> Iterator[Placed]:
    """A placed group, and where operations carry it that bring its axis near that of another one."""
    yield known  # axes tell nothing of the inversion, and those of half turns may stand for one another
    axis, goal = known.group.frame[2], wanted.group.frame[2]
    for operation in group.bringing(axis, goal):
        if abs(goal @ operation @ axis) > np.cos(START_ERROR):
            yield replace(known, group=known.group.carried(operation))
