"""What is taken for true beside the best candidates, and which mirrors are only compromises."""

from itertools import product

import pytest

from symrefine.acceptance import BESIDE, EXACT, EXACT_DETAIL, Standard, compromise, standard_of
from symrefine.geometry import Plane, rotation, unit
from symrefine.search import CORE_NOISE, Mirror
from symrefine.surface.misses import Deviation, Verdict

NOTHING = Deviation(mean=0, p80=0, p95=0, p97=0, p99=0, p994=0, max=0)
NORMAL = unit([0.3, -0.5, 0.8])


def verdict(bulk=0.1, detail=None, excess=None, core=0.0):
    detail = bulk if detail is None else detail
    excess = max(bulk, detail) if excess is None else excess
    return Verdict(deviation=NOTHING, bulk=bulk, detail=detail, excess=excess, core=core)


def mirror(core, *, turn_deg=0.0, shift=0.0, sign=1.0):
    """A mirror near the plane NORMAL.x = 0.5, its pair of normal and offset with either sign."""
    normal = rotation([0.8, 0, -0.3], turn_deg / 57.29578) @ NORMAL
    return Mirror(plane=Plane(normal=sign * normal, offset=sign * (0.5 + shift)), verdict=verdict(core=core))


# The standard


@pytest.mark.parametrize("name", ["bulk", "detail", "excess"])
def test_every_limit_can_turn_a_candidate_down(name):
    good = {"bulk": 0.3, "detail": 0.3, "excess": 0.9}
    limits = {"bulk": 0.5, "detail": 0.5, "excess": 1.0}
    standard = Standard(bulk=limits["bulk"], detail=limits["detail"])
    assert standard.admits(verdict(**good))
    assert standard.admits(verdict(**good | {name: limits[name]}))
    assert not standard.admits(verdict(**good | {name: 1.01 * limits[name]}))


def test_the_standard_falls_with_the_best_down_to_what_counts_as_exact():
    levels = [0.0, 0.05, 0.2, 0.4, 0.8]
    found = [standard_of([verdict(level)]) for level in levels]
    assert [s.bulk for s in found] == sorted(s.bulk for s in found)
    assert [s.detail for s in found] == sorted(s.detail for s in found)
    assert (found[0].bulk, found[0].detail) == (EXACT, EXACT_DETAIL)
    assert standard_of([]) == standard_of([verdict(1.0)])


def test_a_better_candidate_never_lets_more_of_the_others_in():
    rivals = [verdict(b, d) for b, d in product([0.1, 0.3, 0.5, 0.7, 0.9], repeat=2)]
    for best in ([verdict(0.3, 0.4)], [verdict(0.3, 0.4), verdict(0.1, 0.1)]):
        assert standard_of(best).admits(best[-1])
    before, after = standard_of([verdict(0.3, 0.4)]), standard_of([verdict(0.3, 0.4), verdict(0.1, 0.1)])
    admitted = [(before.admits(v), after.admits(v)) for v in rivals]
    assert all(a or not b for a, b in admitted)
    assert any(a and not b for a, b in admitted)


@pytest.mark.parametrize("best", [0.0, 0.05, 0.1])
def test_beside_what_holds_exactly_what_nearly_misses_is_not_the_same_truth(best):
    standard = standard_of([verdict(best)])
    assert standard.admits(verdict(0.4))
    assert not standard.admits(verdict(0.9))
    assert not standard.admits(verdict(0.1, 0.9))
    assert not standard.admits(verdict(0.9, 0.1))


@pytest.mark.parametrize("level", [0.01, 0.3, 0.6, 1.0])
def test_alike_candidates_hold_together(level):
    several = [verdict(level), verdict(min(1.0, 1.5 * level))]
    assert all(standard_of(several).admits(v) for v in several)


# Compromises


@pytest.mark.parametrize(("sign", "other_sign"), list(product([1.0, -1.0], repeat=2)))
def test_a_compromise_is_known_whatever_the_sign_of_the_normals(sign, other_sign):
    drawn, true = mirror(0.5, turn_deg=3, shift=0.05, sign=sign), mirror(0.1, sign=other_sign)
    assert compromise(drawn, true)
    assert not compromise(true, drawn)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_planes_elsewhere_are_no_compromises(sign):
    true = mirror(0.1)
    assert not compromise(mirror(0.5, turn_deg=30, sign=sign), true)
    assert not compromise(mirror(0.5, shift=2 * BESIDE, sign=sign), true)
    assert not compromise(mirror(0.5, shift=-2 * BESIDE, sign=sign), true)


def test_planes_that_most_of_the_surface_keeps_alike_are_no_compromises():
    assert not compromise(mirror(0.5), mirror(0.5))
    assert not compromise(mirror(0.5), mirror(0.49))
    assert not compromise(mirror(0.9 * CORE_NOISE), mirror(0.0))  # sampling alone shows as much
