"""Laws of `detect` and `align` for whatever hypothesis thinks of: poses, units, orders, copies, and layouts in memory.

Points that stand for themselves obey them to rounding, and take milliseconds; surfaces, which are sampled, within
their noise.
"""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import symrefine
from experiments.objects.shapes import asymmetric, mug, sample, table
from symrefine.geometry import Array, random_orthogonal
from symrefine.groups import point_group

SEEDS = st.integers(0, 2**32 - 1)
DETERMINANTS = st.sampled_from((1, -1))
# Powers of ten from -50 to 50: sizes that any unit of length gives.
SIZES = st.floats(-50.0, 50.0).map(lambda power: 10.0**power)
GROUPS = ("C1", "Cs", "Ci", "C2", "C3", "C2v", "C2h", "S4", "D2")
MORE = (*GROUPS, "C3v", "D3", "D2d", "D2h", "D3h", "D3d", "C5", "T")
THREE = np.array([[1.0, 0.35, 0.2], [0.3, 0.9, 0.6], [-0.5, 0.4, 1.1]])
# A single triple of points would have the plane through them.
FOUR = np.array([*THREE.tolist(), [0.2, -0.7, 0.35]])
LAWFUL = settings(max_examples=5, deadline=None)
LONG = settings(max_examples=60, deadline=None)


def orbit(name: str) -> Array:
    return np.einsum("kij,pj->kpi", point_group(name).operations(), FOUR).reshape(-1, 3)


def polygon(fold: int) -> Array:
    """Points of the plane whose group is the cyclic one of this order."""
    angle = 2.0 * np.pi * np.arange(fold) / fold
    turns = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    return np.einsum("kij,pj->kpi", turns, FOUR[:, :2]).reshape(-1, 2)


OBJECTS = st.one_of(st.sampled_from(GROUPS).map(orbit), st.integers(1, 6).map(polygon))


def motion(dim: int, det: int, seed: int) -> Array:
    return np.asarray(random_orthogonal(np.random.default_rng(seed), dim, det))


def moved_operations(operations: Array, matrix: Array, scale: float, shift: Array) -> Array:
    """G S G^-1 of x -> scale matrix x + shift."""
    dim = len(matrix)
    there = np.eye(dim + 1)
    there[:dim, :dim], there[:dim, dim] = scale * matrix, shift
    return np.asarray(there @ operations @ np.linalg.inv(there))


def check_same_operations(found: Array, expected: Array, size: float, atol: float) -> None:
    """The same operations in any order; shifts are measured by the size of the object."""
    assert len(found) == len(expected)
    unit = np.ones_like(found[0])
    unit[:-1, -1] = 1.0 / size
    misses = np.abs((found[:, None] - expected[None]) * unit).max(axis=(2, 3))
    assert misses.min(axis=1).max() < atol
    assert len(set(misses.argmin(axis=1).tolist())) == len(found)


def record(points: Any, **options: Any) -> str:
    """All that is told of an object, but how long it took."""
    told = symrefine.detect(points, **options).to_dict()
    del told["timings"]
    return json.dumps(told)


def check_moves(points: Array, seed: int, det: int, scale: float, atol: float) -> None:
    """detect(g X) = g detect(X)."""
    rng, dim = np.random.default_rng(seed), points.shape[1]
    matrix, extent = motion(dim, det, seed), float(np.linalg.norm(np.ptp(points, axis=0)))
    shift = scale * extent * rng.normal(size=dim)
    found, other = symrefine.detect(points), symrefine.detect(scale * points @ matrix.T + shift)
    assert other.point_group == found.point_group
    assert other.confidence == pytest.approx(found.confidence, abs=1e-3 if atol < 1e-3 else 0.1)
    expected = moved_operations(np.asarray(found.operations()), matrix, scale, shift)
    check_same_operations(np.asarray(other.operations()), expected, scale * extent, atol)


@LAWFUL
@given(points=OBJECTS, seed=SEEDS, det=DETERMINANTS, scale=SIZES)
def test_the_answer_moves_with_the_points(points: Array, seed: int, det: int, scale: float) -> None:
    check_moves(points, seed, det, scale, 1e-5)


@pytest.mark.slow
@LONG
@given(points=st.sampled_from(MORE).map(orbit), seed=SEEDS, det=DETERMINANTS, scale=SIZES)
def test_the_answer_moves_with_the_points_always(points: Array, seed: int, det: int, scale: float) -> None:
    check_moves(points, seed, det, scale, 1e-5)


SURFACES = {
    name: sample(make(), 4000, 0.002, np.random.default_rng(7)) for name, make in (("table", table), ("mug", mug))
}


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(name=st.sampled_from(sorted(SURFACES)), seed=SEEDS, det=DETERMINANTS, scale=SIZES)
def test_the_answer_moves_with_a_surface(name: str, seed: int, det: int, scale: float) -> None:
    check_moves(SURFACES[name], seed, det, scale, 0.02)


@pytest.mark.slow
@LAWFUL
@given(points=OBJECTS, seed=SEEDS, power=st.integers(-166, 166))
def test_order_and_units_that_are_powers_of_two_change_nothing(points: Array, seed: int, power: int) -> None:
    order = np.random.default_rng(seed).permutation(len(points))
    unit = 2.0**power
    found, permuted, larger = (symrefine.detect(p) for p in (points, points[order], unit * points))
    assert permuted.point_group == larger.point_group == found.point_group
    assert larger.confidence == found.confidence
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    check_same_operations(np.asarray(permuted.operations()), np.asarray(found.operations()), size, 1e-6)
    for one, two in zip(found.operations(), larger.operations(), strict=True):
        np.testing.assert_array_equal(two[:-1, :-1], one[:-1, :-1])
        np.testing.assert_array_equal(two[:-1, -1], unit * one[:-1, -1])


@LAWFUL
@given(points=OBJECTS, copies=st.integers(2, 4))
def test_copies_of_all_points_change_no_answer(points: Array, copies: int) -> None:
    found, other = symrefine.detect(points), symrefine.detect(np.tile(points, (copies, 1)))
    assert other.point_group == found.point_group
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    check_same_operations(np.asarray(other.operations()), np.asarray(found.operations()), size, 1e-6)


def strided(points: Array) -> Array:
    wide = np.full((2 * len(points), 3 * points.shape[1]), np.nan)
    wide[::2, ::3] = points
    return wide[::2, ::3]


def backwards(points: Array) -> Array:
    return np.ascontiguousarray(points[::-1, ::-1])[::-1, ::-1]


def unwritable(points: Array) -> Array:
    copy = points.copy()
    copy.flags.writeable = False
    return copy


LAYOUTS: dict[str, Callable[[Array], Any]] = {
    "Fortran": np.asfortranarray, "strided": strided, "backwards": backwards, "read-only": unwritable,
    "float32": lambda points: points.astype(np.float32), "lists": Array.tolist, "big endian": lambda p: p.astype(">f8"),
    "unaligned": lambda p: np.frombuffer(b"x" + p.tobytes(), np.uint8)[1:].view(p.dtype).reshape(p.shape),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=1, deadline=None)
@given(points=OBJECTS)
def test_layout_in_memory_changes_no_byte(layout: str, points: Array) -> None:
    points = points.astype(np.float32).astype(np.float64)  # so that float32 holds the same numbers
    laid = LAYOUTS[layout](points)
    kept = np.array(laid)
    assert record(laid) == record(points)
    np.testing.assert_array_equal(laid, kept)
    one, two = (symrefine.align(p, points @ motion(points.shape[1], -1, 3).T) for p in (laid, points))
    np.testing.assert_array_equal(one.matrix, two.matrix)
    np.testing.assert_array_equal(one.translation, two.translation)


@pytest.mark.parametrize("layout", ["Fortran", "strided", "read-only"])
def test_layout_in_memory_changes_no_byte_of_a_surface(layout: str) -> None:
    points = sample(table(), 1500, 0.002, np.random.default_rng(8)).astype(np.float32).astype(np.float64)
    assert record(LAYOUTS[layout](points)) == record(points)


# align: maps compose, have inverses, and know nothing of units, orders, copies and layouts.

CLOUDS = {dim: np.random.default_rng(dim).random((60, dim)) ** np.linspace(1.5, 4.0, dim) for dim in (2, 3, 4)}


def homogeneous(found: Any) -> Array:
    dim = len(found.matrix)
    made = np.eye(dim + 1)
    made[:dim, :dim], made[:dim, dim] = found.matrix, found.translation
    return made


def close(found: Array, expected: Array, size: float, atol: float = 1e-6) -> None:
    unit = np.ones_like(found)
    unit[:-1, -1] = 1.0 / size
    np.testing.assert_allclose(found * unit, expected * unit, atol=atol)


@LAWFUL
@given(dim=st.sampled_from(sorted(CLOUDS)), seed=SEEDS, dets=st.tuples(DETERMINANTS, DETERMINANTS), size=SIZES)
def test_maps_compose_and_have_inverses(dim: int, seed: int, dets: tuple[int, int], size: float) -> None:
    rng = np.random.default_rng(seed)
    first = size * CLOUDS[dim]
    second = first @ motion(dim, dets[0], seed).T + size * rng.normal(size=dim)
    third = (second @ motion(dim, dets[1], seed + 1).T + size * rng.normal(size=dim))[rng.permutation(len(first))]
    ab, bc, ac, ca = (
        homogeneous(symrefine.align(a, b))
        for a, b in ((first, second), (second, third), (first, third), (third, first))
    )
    assert np.linalg.det(ab[:-1, :-1]) == pytest.approx(dets[0], abs=1e-9)
    close(bc @ ab, ac, size)
    close(ca @ ac, np.eye(dim + 1), size)


@LAWFUL
@given(dim=st.sampled_from(sorted(CLOUDS)), seed=SEEDS, det=DETERMINANTS, copies=st.integers(1, 3))
def test_order_and_copies_change_no_map(dim: int, seed: int, det: int, copies: int) -> None:
    rng = np.random.default_rng(seed)
    source = CLOUDS[dim]
    matrix, shift = motion(dim, det, seed), rng.normal(size=dim)
    target = np.tile(source, (copies, 1))[rng.permutation(copies * len(source))] @ matrix.T + shift
    expected = np.eye(dim + 1)
    expected[:dim, :dim], expected[:dim, dim] = matrix, shift
    close(homogeneous(symrefine.align(source, target)), expected, 1.0)


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS, dets=st.tuples(DETERMINANTS, DETERMINANTS), size=SIZES)
def test_maps_of_independent_samples_compose(seed: int, dets: tuple[int, int], size: float) -> None:
    rng = np.random.default_rng(seed)
    clouds = [size * sample(asymmetric(), 3000, 0.0, rng) for _ in range(3)]
    clouds[1] = clouds[1] @ motion(3, dets[0], seed).T
    clouds[2] = clouds[2] @ motion(3, dets[1], seed).T
    ab, bc, ac, ba = (homogeneous(symrefine.align(clouds[i], clouds[k])) for i, k in ((0, 1), (1, 2), (0, 2), (1, 0)))
    extent = size * asymmetric().diagonal
    close(bc @ ab, ac, extent, 0.02)
    close(ba @ ab, np.eye(4), extent, 0.02)
