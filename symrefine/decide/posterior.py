"""How sure each group of a chain is: the only place where needs are weighed against the tolerance.

The chain is ordinal: its groups lie one inside the next. `inside[i]`, the probability that the true group holds the
i-th group, is a logistic function of the logarithm of what that group needs over the tolerance, so the probability that
it is the i-th itself is `inside[i] - inside[i + 1]`: the worst element kept and the best one turned down both count.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from symrefine.groups import PointGroup

# One number, or many side by side.
T = TypeVar("T", bound=Any)
# Of the logistic curve: the need over the tolerance at which half of the groups are meant, and how fast they become
# fewer. Calibrated on intact, broken and noisy objects by `python -m experiments.studies.reliability --fit`.
EVEN, STEEPNESS = 0.75, 8.0
# The same of a lone mirror: bodies and devices that are meant to have just one are made less exactly than others.
EVEN_MIRROR = 1.2
# Needs within this factor are the same, as the elements of a true group miss alike; so groups that need no more than
# the tolerance by that are asked for.
ALIKE = 1.5
# A mirror is no lone one if a larger group needs less than so many times as much: the best of several mirrors that one
# part out of place breaks misses by half of what the worst does, or more, in two of five directions of the shift. With
# 3 a few more of such are told, and an ant that is posed is for certain no symmetric body.
ALONE = 2.0
# All three of pictures, where parts moved by half a tolerance are told as well, so that the curve is less steep: close
# to that of the first version, which was fitted to half of its drawings; see `experiments.studies.planar_reliability`.
EVEN_PICTURE, EVEN_PICTURE_MIRROR, STEEPNESS_PICTURE = 0.6, 0.75, 3.6
# How much of what noise alone needs is left to doubt, once it was taken away, and by how much it blurs a miss: with 1 %
# noise parts that are out of place show half to two thirds of their miss. With 1 a few more of intact bodies are sure
# that noise makes volumes of, and of 76 that have a part out of place two to three fewer are told, and 10 fewer surely.
UNKNOWN, BLURRED = 0.7, 2.0
# Probability that what no camera saw breaks what the rest shows, where as much as was seen is missing
# (`Surface.unclosed`, in single views two thirds of that), by how many mirrors of a group no operation of it exchanges
# with others: two stand for more, and being round counts as one. What is repeated a number of times is hardly broken
# where nobody looked; most things have one mirror, and a second one is what a car, a mug and a sofa lack. Of one half
# of the objects of `experiments.studies.single_views`, seeds 2721 to 2724 and 2731 to 2736, 0 of 107, 8 of 169 and 10
# of 35 were wrong, by the rule of succession over 0.62 that was missing of them; of the others 0 of 99, 7 of 167, 10 of
# 32; of what is round and has a mirror across 3 of 6 with seeds 4003 to 4007.
BROKEN = (0.015, 0.085, 0.48)
# Alternatives that are told of, and the least probability that is worth telling.
NEAR, LEAST = 8, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Of the logistic curve: the need over the tolerance at its middle, the same of a lone mirror, the steepness."""

    even: float
    even_mirror: float
    steepness: float


SPACE = Curve(even=EVEN, even_mirror=EVEN_MIRROR, steepness=STEEPNESS)
PICTURE = Curve(even=EVEN_PICTURE, even_mirror=EVEN_PICTURE_MIRROR, steepness=STEEPNESS_PICTURE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A group of the chain as the decision sees it: the smallest tolerance at which it holds, and if it is a mirror.

    `believed` is what of that, in squares, it takes to believe in what nobody saw; `placed` is the probability that it
    does not hold elsewhere as well, `broken` that what no camera saw breaks it, where as much as was seen is missing.
    What is `proven` was not measured, so that no noise says anything of it.
    """

    need: float
    lone_mirror: bool = False
    believed: float = 0.0
    placed: float = 1.0
    broken: float = 0.0
    proven: bool = False

    @classmethod
    def of(
        cls,
        group: PointGroup,
        need: float,
        beyond: float,
        *,
        believed: float = 0.0,
        placed: float = 1.0,
        proven: bool = False,
    ) -> "Link":
        """That of a group in space, where the next one of the chain needs so much."""
        return cls(
            need=need,
            lone_mirror=group.name == "Cs" and beyond >= ALONE * need,
            believed=believed,
            placed=placed,
            broken=_broken(group.name),
            proven=proven,
        )


@cache
def _broken(point_group: str) -> float:
    group = PointGroup(name=point_group)
    alone = len(group.lone_mirrors()) + (not group.is_finite)
    return BROKEN[min(alone, len(BROKEN) - 1)]


def odd(group: PointGroup) -> float:
    """Probability that an object which else has a group has a single thing that breaks it, as what nobody saw does."""
    return min(_broken(group.name), BROKEN[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Which group of a chain is meant: its index, the probability of each, and that the true group holds it."""

    index: int
    probabilities: tuple[float, ...]
    inside: tuple[float, ...]

    @classmethod
    def of(cls, inside: Sequence[float]) -> "Decision":
        """The likeliest group, from the probabilities that the true group holds each."""
        own = [here - beyond for here, beyond in pairwise([*inside, 0.0])]
        return cls(index=max(range(len(own)), key=own.__getitem__), probabilities=tuple(own), inside=tuple(inside))


def decide(
    links: Sequence[Link], tolerance: float, noise: float = 0.0, curve: Curve = SPACE, unclosed: float = 0.0
) -> Decision:
    """The likeliest group of a chain.

    Args:
        links: the groups beyond C1, each inside the next, needs as fractions of the diagonal.
        tolerance: largest miss that counts as symmetric.
        noise: what noise alone would need.
        curve: what was calibrated on objects of this kind.
        unclosed: how much surface no camera saw at least, by what was seen.
    """
    own = [(1.0 - link.broken * unclosed) * meant(link, tolerance, noise, curve) for link in links]
    # Where a group stands is known as well as where any larger one does.
    inside = np.maximum.accumulate(own[::-1])[::-1]
    return Decision.of([1.0, *inside.tolist()])


def meant(link: Link, tolerance: float, noise: float = 0.0, curve: Curve = SPACE) -> float:
    """Probability that a group is meant, and stands where it was put, from what it needs.

    Noise and need add up in squares. Noise also blurs what was measured: local planes grow with it, so that details of
    one size show less and less of what they miss by, and the curve gets less steep. What is believed of what nobody saw
    was not measured.
    """
    if link.proven:
        return link.placed
    even = curve.even_mirror if link.lone_mirror else curve.even
    seen = math.sqrt(max(link.need**2 - link.believed**2, 0.0))
    strained = strain(seen / tolerance, noise / tolerance, even) + (link.believed / tolerance / even) ** 2
    return link.placed * float(1.0 / (1.0 + strained ** (sharpness(noise / tolerance, curve.steepness) / 2.0)))


def lenience(point_group: str) -> float:
    """How many times as much a group of that name is forgiven as others, if it is a lone mirror."""
    return EVEN_MIRROR / EVEN if point_group == "Cs" else 1.0


def certain(tolerance: float, noise: float = 0.0) -> float:
    """The need up to which a group leaves less doubt at a tolerance than is worth telling.

    In noise, which needs so many tolerances, the one that strains a group as much.
    """
    return float(EVEN * tolerance * LEAST ** (1.0 / STEEPNESS) / math.hypot(1.0, BLURRED * noise))


def least_told(noise: float) -> float:
    """The smallest tolerance at which noise makes no exact symmetry more likely broken than not."""
    return UNKNOWN * noise


def strain(need: T, noise: T, even: T, unknown: float = UNKNOWN, blurred: float = BLURRED) -> T:
    """How far a group is from the middle of the curve, in squares; 1 there. Need and noise in tolerances."""
    return (need / even) ** 2 * (1.0 + (blurred * noise) ** 2) + (unknown * noise) ** 2


def sharpness(noise: T, steepness: float) -> T:
    """How steep the curve is where noise alone needs so many tolerances."""
    return steepness / (1.0 + noise**2)


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """Another group that the object may have been meant to have.

    `forgiven` is what its worst element misses by, as the smallest tolerance at which it would hold (fraction of the
    diagonal): what one has to forgive to believe it.
    """

    point_group: str
    probability: float
    forgiven: float


def alternatives(names: Sequence[str], needs: Sequence[float], decision: Decision, index: int) -> list[Alternative]:
    """The groups of a chain, but for one, that are worth telling, likeliest first.

    Args:
        names: of the groups from C1 upwards.
        needs: what each needs to be forgiven.
        decision: how likely each is.
        index: the group that is told as the answer; -1 if none is.
    """
    found = [
        Alternative(point_group=name, probability=p, forgiven=need)
        for i, (name, need, p) in enumerate(zip(names, needs, decision.probabilities, strict=True))
        if i != index and p >= LEAST
    ]
    return sorted(found, key=lambda a: -a.probability)[:NEAR]
