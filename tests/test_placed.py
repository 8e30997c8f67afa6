"""The elements of a group and the operations fitted in their stead; the centre that several placed groups share."""

import math

import numpy as np
import pytest

from symrefine.fit.placed import (
    FITTED,
    Operations,
    Placed,
    common_center,
    elements,
    fitted_matrices,
    wide_angle_rad,
)
from symrefine.fit.residual import SIZE, frame_model
from symrefine.geometry import frame_with_z, householder, line_angle_rad, random_orthogonal, rotation
from symrefine.groups import close, from_elements, point_group

FINITE = (
    "Cs Ci C2 C3 C4 C5 C7 C12 C19 C2v C3v C4v C6v C13v C2h C3h C4h C7h S4 S6 S8 D2 D3 D4 D5 D12 D2h D3h D4h D5h D12h "
    "D2d D3d D4d D5d T Td Th O Oh I Ih"
).split()
ENDLESS = ("Cinfv", "Dinfh", "Kh")


def posed(name, seed=0):
    return point_group(name, random_orthogonal(np.random.default_rng(seed)))


def matrices_of(group):
    return [m for part in elements(group) for m in part.matrices]


def order_of(matrix):
    """The smallest power of a turn that is the identity."""
    power, order = matrix, 1
    while not np.allclose(power, np.eye(3), atol=1e-9):
        power, order = power @ matrix, order + 1
    return order


# Elements


@pytest.mark.parametrize("fold", range(2, 61))
def test_the_wide_turn_of_an_axis_goes_far_for_whatever_has_but_a_part_of_its_folds(fold):
    """By 137 degrees a 50-fold axis turns what has a five-fold one by 7 only, as its smallest turn does."""
    steps = wide_angle_rad(fold) * fold / (2.0 * math.pi)
    assert math.gcd(round(steps), fold) == 1
    assert steps == pytest.approx(round(steps))
    for less in (p for p in range(1, fold) if fold % p == 0):
        part = steps * less / fold % 1.0
        # Of six steps only the first and the last come to all of them.
        assert min(part, 1.0 - part) > (0.13 if fold // less > 6 else 0.16)


@pytest.mark.parametrize("name", [*FINITE, *ENDLESS])
def test_every_matrix_of_an_element_is_an_operation(name):
    group = posed(name)
    matrices = np.stack(matrices_of(group))
    np.testing.assert_allclose(
        matrices @ matrices.transpose(0, 2, 1), np.broadcast_to(np.eye(3), matrices.shape), atol=1e-12
    )
    assert group.distance_rad(matrices).max() < 1e-7


@pytest.mark.parametrize("name", FINITE)
def test_the_elements_generate_the_group(name):
    group = posed(name, 1)
    matrices = matrices_of(group)
    closure = close(matrices, 1e-6, orders=[order_of(m) if np.linalg.det(m) > 0 else 0 for m in matrices])
    assert closure.group.name == name


@pytest.mark.parametrize("name", ENDLESS)
def test_the_elements_generate_the_continuous_group(name):
    parts = elements(posed(name, 2))
    found = from_elements(
        mirrors=[p.direction for p in parts if p.kind == "plane"],
        axes=[(p.direction, p.order) for p in parts if p.kind == "axis"],
        inversion=any(p.kind == "inversion" for p in parts),
    )
    assert found.for_point_set().name == name


@pytest.mark.parametrize("name", FINITE)
def test_there_is_one_of_every_element_of_the_group(name):
    group = posed(name, 3)
    kinds = [p.kind for p in elements(group)]
    assert kinds.count("plane") == len(group.mirrors())
    assert kinds.count("axis") == len(group.rotation_axes())
    assert kinds.count("improper") == len(group.improper_axes())
    assert kinds.count("inversion") == group.has_inversion


@pytest.mark.parametrize("name", FINITE)
def test_an_element_is_what_it_says(name):
    for part in elements(posed(name, 4)):
        for matrix in part.matrices:
            det = np.linalg.det(matrix)
            assert det == pytest.approx(1.0 if part.kind == "axis" else -1.0)
            along = {"plane": -1.0, "axis": 1.0, "improper": -1.0, "inversion": -1.0}[part.kind]
            np.testing.assert_allclose(matrix @ part.direction, along * part.direction, atol=1e-12)
        if part.kind in ("axis", "improper"):
            # A rotoreflection of odd order comes back after twice as many turns only.
            wide, twice = order_of(part.matrices[0]), 2 if part.kind == "improper" and part.order % 2 else 1
            assert wide == twice * part.order
        if part.kind == "axis":
            assert order_of(part.matrices[-1]) == part.order


@pytest.mark.parametrize("order", [3, 5, 7, 12, 19, 60, 128])
def test_of_an_axis_one_turn_moves_far_and_one_as_little_as_any(order):
    (part,) = elements(point_group(f"C{order}"))
    angles = [math.acos(np.clip((np.trace(m) - 1.0) / 2.0, -1.0, 1.0)) for m in part.matrices]
    assert angles[-1] == pytest.approx(2.0 * math.pi / order)
    assert angles[0] > math.pi / 2


@pytest.mark.parametrize("name", ENDLESS)
@pytest.mark.parametrize("order", range(2, 36))
def test_turns_of_a_continuous_axis_are_those_of_no_finite_one(name, order):
    """No fold below 36 has all of them: they stand for no finite group."""
    axes = [p for p in elements(point_group(name)) if p.kind == "axis"]
    assert len(axes) == (3 if name == "Kh" else 1)
    cyclic = point_group(f"C{order}")
    (along_z,) = [p for p in axes if abs(p.direction[2]) > 0.9]
    assert math.isinf(along_z.order)
    # As far off as a surface with teeth would tell: a twentieth of a tooth.
    assert cyclic.distance_rad(np.stack(along_z.matrices)).max() > 0.05 * 2 * math.pi / order


def test_motions_leave_the_centre_in_place():
    rng = np.random.default_rng(5)
    center = rng.standard_normal(3)
    for part in elements(posed("D3d", 5)):
        for motion, matrix in zip(part.motions(center), part.matrices, strict=True):
            np.testing.assert_allclose(motion.apply(center[None])[0], center, atol=1e-12)
            np.testing.assert_array_equal(motion.matrix, matrix)


# The operations that are fitted


def free_motions(name):
    """Motions of the frame that no operation of the group sees: glides and turns that commute with all of it."""
    if name in ("Cs", "Ci"):
        return 3  # two glides in the plane and a turn about its normal; all turns
    # Mirrors at five phases stand for all through an axis: fitted, a turn of them together is seen.
    family = point_group(name).symbol.family
    return {"C": 2, "Cv": 1, "Ch": 1, "S": 1}.get(family, 0)


def seen(standard, frame, center):
    """Orthonormal motions [6, q] of a frame that change any of the operations [k, 3, 3]."""
    every = frame_model(np.stack([np.eye(SIZE)] * len(standard)), standard, frame, center, np.zeros(6)).hessian
    values, vectors = np.linalg.eigh(every)
    return vectors[:, values > 1e-9 * values[-1]]


@pytest.mark.parametrize("name", [*FINITE, *ENDLESS])
def test_what_is_fitted_sees_every_motion_that_the_group_sees(name):
    placed = Placed(group=posed(name, 6), center=np.array([0.3, -0.2, 0.5]))
    state = placed.framed()
    assert seen(state.standard, state.frame, state.center).shape[1] == 6 - free_motions(name)


@pytest.mark.parametrize("name", FINITE)
def test_what_is_fitted_sees_no_less_than_all_operations_together(name):
    group = point_group(name)
    everything = seen(group.operations()[1:], np.eye(3), np.zeros(3))
    state = Placed(group=group, center=np.zeros(3)).framed()
    fitted = seen(state.standard, np.eye(3), np.zeros(3))
    assert everything.shape[1] == 6 - free_motions(name)
    np.testing.assert_allclose(fitted @ fitted.T, everything @ everything.T, atol=1e-6)


@pytest.mark.parametrize("name", [*FINITE, *ENDLESS])
def test_what_is_fitted_are_operations_where_the_group_stands(name):
    placed = Placed(group=posed(name, 7), center=np.array([0.1, 0.2, -0.4]))
    state = placed.framed()
    matrices = np.stack([m.matrix for m in state.motions])
    assert placed.group.distance_rad(matrices).max() < 1e-7
    for motion in state.motions:
        np.testing.assert_allclose(motion.apply(placed.center[None])[0], placed.center, atol=1e-12)
    again = placed.moved(state)
    assert again.group.name == name
    np.testing.assert_allclose(again.group.frame, placed.group.frame, atol=1e-12)
    np.testing.assert_array_equal(again.center, placed.center)


@pytest.mark.parametrize("name", ["D60h", "C128", "Ih", "D90d", "Oh"])
def test_however_large_the_group_few_operations_are_fitted(name):
    assert 1 <= len(fitted_matrices(point_group(name))) <= 3 * FITTED


# The centre


X, Y, Z = np.eye(3)


def glided(placed, rng):
    """A point that is as good a centre: anywhere on the plane or axis."""
    name, frame = placed.group.name, placed.group.frame
    free = frame[:2] if name == "Cs" else frame[2:] if placed.group.symbol.family in ("C", "Cv") else frame[:0]
    return Placed(group=placed.group, center=placed.center + rng.standard_normal(len(free)) @ free)


@pytest.mark.parametrize(
    "groups",
    [
        [("C3", Z), ("Cs", Z)],
        [("C3", Z), ("Cs", X + Z)],
        [("C5", Z), ("C2", X)],
        [("C3", X + Y + Z), ("C3", X - Y - Z)],
        [("Cs", X), ("Cs", Y), ("Cs", Z)],
        [("Cs", X + Y), ("Cs", Y + Z), ("Cs", Z + X)],
        [("C4v", Z), ("C2", X)],
        [("C7", Z), ("Ci", Z)],
        [("Cs", X), ("S4", Z)],
    ],
    ids=lambda groups: "+".join(name for name, _ in groups),
)
def test_the_common_centre_is_the_point_on_all_planes_and_axes(groups):
    rng = np.random.default_rng(8)
    for _ in range(5):
        center, turn = rng.standard_normal(3), random_orthogonal(rng)
        placed = [Placed(group=point_group(n, frame_with_z(turn @ u)), center=center) for n, u in groups]
        np.testing.assert_allclose(common_center([glided(p, rng) for p in placed]), center, atol=1e-9)


@pytest.mark.parametrize("name", ["Cs", "C3", "C4v"])
def test_where_the_centre_may_glide_it_is_next_to_the_centroid(name):
    rng = np.random.default_rng(9)
    placed = Placed(group=posed(name, rng), center=rng.standard_normal(3))
    found, z = common_center([placed]), placed.group.frame[2]
    along = (placed.center @ z) * z
    np.testing.assert_allclose(found, along if name == "Cs" else placed.center - along, atol=1e-9)


def test_planes_that_are_known_to_a_degree_leave_their_common_line_by_nothing():
    """Mirrors through one axis with normals a little off say nothing of the place along it."""
    rng = np.random.default_rng(10)
    parts = []
    for k in range(5):
        normal = rotation([0, 0, 1], k * np.pi / 5) @ [1.0, 0, 0] + 0.01 * rng.standard_normal(3)
        group = from_elements(mirrors=[normal])
        parts.append(Placed(group=group, center=np.array([0.2, -0.1, 0.0])))
    found = common_center(parts)
    np.testing.assert_allclose(found, [0.2, -0.1, 0.0], atol=0.02)


def test_of_nothing_the_centre_is_the_centroid():
    np.testing.assert_array_equal(common_center([]), np.zeros(3))
    np.testing.assert_array_equal(common_center([Placed(group=point_group("C1"), center=np.ones(3))]), np.zeros(3))


def test_a_centre_is_private():
    given = np.ones(3)
    placed = Placed(group=point_group("Cs"), center=given)
    given[0] = 5.0
    assert placed.center[0] == 1.0
    assert not placed.center.flags.writeable
    part = Operations(kind="plane", direction=np.eye(3)[2], order=1.0, matrices=(householder([0, 0, 1]),))
    assert line_angle_rad(part.motions(given)[0].matrix @ [0, 0, 1], [0, 0, 1]) < 1e-12
