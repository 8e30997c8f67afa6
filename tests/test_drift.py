"""Windows tell of parts that are out of place where noise is as thick as they are."""

import numpy as np
import pytest

from symrefine.geometry import Array, Isometry, Plane
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
