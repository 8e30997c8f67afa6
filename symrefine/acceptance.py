"""By which standard candidates are taken for true, given the best of them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from symrefine.search import Mirror, closer_core
from symrefine.surface.misses import Verdict

# Beside an element that holds exactly, one that misses this many times more, and by this share of the limit, is not
# the same kind of truth: a wheel maps onto itself nearly as well between its spokes.
RIVAL = 4.0
EXACT = 0.45
# The same with the details: one leg of eight out of place shows in no bulk.
RIVAL_DETAIL = 2.5
EXACT_DETAIL = 0.55
# Planes closer than this (angle, RMS radii) may be fits of one and the same mirror.
BESIDE_RAD = math.radians(8.0)
BESIDE = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Standard:
    """Misses, of the bulk and with the details, up to which candidates are taken for true."""

    bulk: float = 1.0
    detail: float = 1.0

    def admits(self, verdict: Verdict) -> bool:
        """Whether an element holds by this standard."""
        return verdict.excess <= 1.0 and verdict.bulk <= self.bulk and verdict.detail <= self.detail


def standard_of(verdicts: Iterable[Verdict]) -> Standard:
    """The standard that the best of the candidates sets."""
    given = tuple(verdicts)
    bulk = min((v.bulk for v in given), default=1.0)
    detail = min((v.detail for v in given), default=1.0)
    return Standard(bulk=max(EXACT, RIVAL * bulk), detail=max(EXACT_DETAIL, RIVAL_DETAIL * detail))


def compromise(mirror: Mirror, other: Mirror) -> bool:
    """Whether a mirror is only what the fit of a detail made of another one beside it, which most of the surface
    keeps far better."""
    apart = abs(float(mirror.plane.normal @ other.plane.normal)) < math.cos(BESIDE_RAD)
    side = math.copysign(1.0, float(mirror.plane.normal @ other.plane.normal))
    shifted = abs(mirror.plane.offset - side * other.plane.offset) > BESIDE
    return not apart and not shifted and closer_core(other.verdict, mirror.verdict)
