"""The groups that an object may have been meant to have instead, for any dimension."""

from collections.abc import Sequence
from dataclasses import dataclass

from symrefine.decide.posterior import Decision

# Alternatives that are told of, and the least probability that is worth telling.
NEAR, LEAST = 8, 0.01
# Groups that need up to so many tolerances are asked for.
BEYOND = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
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
