"""Windows tell of parts that are out of place where noise is as thick as they are."""

import numpy as np
import pytest

from experiments.objects.shapes import sample
from experiments.objects.vessels import VESSELS
from experiments.studies import groups
from symrefine.decide.hypotheses import judged
from symrefine.detection.measure import gather, measure
from symrefine.detection.story import detect
from symrefine.fit.placed import Placed
from symrefine.geometry import Array, Isometry, Plane, rotation
from symrefine.groups import point_group
from symrefine.shape import Shape
from symrefine.surface.drift import Drift
from symrefine.surface.misses import needs
from symrefine.surface.tree import Tree

NOISE, AWAY = 0.03, 0.06
MIRROR = Isometry.reflection(Plane(normal=np.array([1.0, 0.0, 0.0]), offset=0.0))


def rods(rng: np.random.Generator, away: float = 0.0) -> Array:
    """Points [4000, 3] of two rods as thin as their noise, mirror images but for what one of them is off."""
    along = rng.uniform(-1.0, 1.0, 4000)
    side = np.repeat([-0.4, 0.4 + away], 2000)
    return np.column_stack([side, np.zeros(4000), along]) + NOISE * rng.standard_normal((4000, 3))


def sheet(rng: np.random.Generator) -> Array:
    """Points [6000, 3] of a square of side 2 with noise across it."""
    points = rng.uniform(-1.0, 1.0, (6000, 3))
    points[:, 2] = NOISE * rng.standard_normal(6000)
    return points


def drift(points: Array) -> Drift:
    return Drift.of(points, Tree(points), 1500, np.random.default_rng(0))


@pytest.mark.parametrize("seed", range(3))
def test_a_rod_out_of_place_is_told_by_how_much_it_is(seed: int) -> None:
    found = drift(rods(np.random.default_rng(seed), AWAY))
    assert np.median(found.misses([MIRROR], 1500)) == pytest.approx(AWAY, rel=0.2)
    assert np.quantile(found.noise, 0.99) < 0.5 * AWAY


@pytest.mark.parametrize("seed", range(3))
def test_rods_in_place_need_next_to_nothing(seed: int) -> None:
    def need(away: float) -> float:
        found = drift(rods(np.random.default_rng(seed), away))
        return float(needs(found.misses([MIRROR], 1500), found.noise)[0])

    assert need(0.0) < 0.1 * need(AWAY)


def test_of_a_slide_along_a_sheet_only_its_ends_tell() -> None:
    found = drift(sheet(np.random.default_rng(0)))
    slide = Isometry(matrix=np.eye(3), shift=np.array([AWAY, 0.0, 0.0]))
    misses = found.misses([slide], 1500)[0]
    inside = np.abs(found.sources[:, 0]) < 0.7
    assert np.median(misses[inside]) < 0.3 * AWAY
    assert np.median(misses[found.sources[:, 0] > 0.97]) > 0.5 * AWAY


def test_what_is_found_turns_with_the_cloud() -> None:
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    points = rods(np.random.default_rng(1), AWAY)
    there = Isometry(matrix=turn @ MIRROR.matrix @ turn.T, shift=np.zeros(3))
    here, moved = drift(points), drift(points @ turn.T)
    np.testing.assert_allclose(moved.misses([there], 1500), here.misses([MIRROR], 1500), atol=1e-9)
    np.testing.assert_allclose(moved.noise, here.noise, atol=1e-9)


def test_fewer_windows_are_some_of_them() -> None:
    found = drift(rods(np.random.default_rng(2), AWAY))
    np.testing.assert_allclose(found.misses([MIRROR], 500), found.misses([MIRROR], 1500)[:, ::3], atol=1e-12)


def test_windows_that_reach_what_nobody_saw_are_those_that_what_is_missing_moves() -> None:
    points = rods(np.random.default_rng(3))
    whole, cut = drift(points), drift(points[(points[:, 0] < 0.0) | (points[:, 2] < 0.5)])
    height, side = cut.sources[:, 2], cut.sources[:, 0]
    # Of the rod that is whole the upper half is carried to where the other is cut off.
    hidden = cut.sources[(side < 0.0) & (height > 0.5)]
    seen, misses = ~cut.reach([MIRROR], 1500, [(hidden, hidden)])[0], cut.misses([MIRROR], 1500)[0]
    assert seen[height < 0.0].all()
    assert not seen[np.abs(height - 0.5) < 0.05].any()
    assert misses[seen].max() < 2.0 * whole.misses([MIRROR], 1500).max() < misses.max()


@pytest.mark.parametrize("count", [1, 3, 4, 5])
def test_however_many_windows_are_moved_those_that_reach_what_nobody_saw_are_told(count: int) -> None:
    """Of 2,000 windows four operations move 667, which are not what one in three of 2,000 would be."""
    rng = np.random.default_rng(1)
    shape = Shape(points=sample(VESSELS["pan handle"](rng).shape, 2000, 0.01, rng))
    surface = gather(measure(shape), np.random.default_rng(0))[1]
    assert surface.drift is not None
    assert surface.openings is not None
    motions = [Isometry.about(np.zeros(3), rotation([0.0, 0.0, 1.0], angle)) for angle in np.arange(1.0, count + 1.0)]
    drifts, misses = surface.drifts(motions), surface.misses(motions)
    misses[:, ::7] = np.nan
    seen = surface.drifts_seen(drifts, misses, motions)
    assert np.isnan(seen).any()
    told = np.isfinite(seen)
    np.testing.assert_array_equal(seen[told], drifts[told])


@pytest.mark.parametrize("seed", [41, pytest.param(64, marks=pytest.mark.slow)])
def test_a_tooth_out_of_place_is_told_though_noise_makes_teeth_look_open(seed: int) -> None:
    made, _ = groups.posed(groups.Case(shape="gear24", sibling=True, noise_rel=0.01, seed=seed))
    found = detect(made)
    assert found.surface.openings is not None
    assert found.point_group == "Cs" or (seed == 64 and found.undetermined)  # Cs or C2v, by the noise of that cloud
    assert found.examined.choices(found.tolerance)[-1].probability < 0.5


@pytest.mark.parametrize("seed", [1002, 1008, 1044])
def test_many_operations_tell_no_more_of_the_same_windows(seed: int) -> None:
    """Of the 30 of a cube each compares the same few windows: taken for 30 times as many, chance spoke against Oh."""
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (4000, 3))
    measured = measure(Shape(points=points))
    surface = gather(measured, np.random.default_rng(0))[1]
    cube = Placed(group=point_group("Oh"), center=np.zeros(3))
    assert surface.drift is not None
    once = surface.drift.misses(cube.motions()[1:2], 600) / surface.diagonal
    assert surface.drifted(np.repeat(once, 30, axis=0))[1] == pytest.approx(surface.drifted(once)[1], rel=0.2)
    assert judged(surface, cube).need == 0.0
