"""Point groups: the textbook tables, group laws, and recovery of name and frame from noisy or incomplete elements."""

import math
from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symrefine.cli.rows import turn_rad
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.geometry import frame_with_z, householder, orthogonal_factor, random_orthogonal, rotation, rotoreflection
from symrefine.groups import (
    MAX_FOLD,
    close,
    from_elements,
    identify,
    is_subgroup,
    point_group,
)
from symrefine.groups.closure import may_be_in_one
from symrefine.groups.plane import PointGroup2D

SEEDS = st.integers(0, 2**32 - 1)
FOLDS = range(2, 13)
POLYHEDRAL = ("T", "Td", "Th", "O", "Oh", "I", "Ih")
AXIAL = ("C{n}", "C{n}v", "C{n}h", "S{m}", "D{n}", "D{n}h", "D{n}d")
LARGE = ("C36v", "D24h", "D36d", "S36", "C60")
CONTINUOUS = ("Cinf", "Cinfv", "Cinfh", "Dinf", "Dinfh", "K", "Kh")


def axial(n):
    return [pattern.format(n=n, m=2 * n) for pattern in AXIAL]


SMALL = ["C1", "Cs", "Ci", *(name for n in FOLDS for name in axial(n)), *POLYHEDRAL]
FINITE = [*SMALL, *LARGE]


def rng_of(*key):
    return np.random.default_rng([len(key), *(sum(map(ord, str(k))) for k in key)])


def noisy(operations, angle_rad, rng):
    turns = [rotation(axis, angle_rad) for axis in rng.standard_normal((len(operations), 3))]
    return rng.permutation(operations @ np.array(turns))


def tilted(direction, angle_rad, rng):
    return rng.choice([-1.0, 1.0]) * rotation(np.cross(direction, rng.standard_normal(3)), angle_rad) @ direction


def error_rad(found, true):
    """Largest angle between an operation found and the nearest true one: free of the frame's ambiguity."""
    return float(true.distance_rad(found.operations()).max())


# Names


@pytest.mark.parametrize(
    ("alias", "name"),
    [
        *[("C1h", "Cs"), ("C1v", "Cs"), ("S1", "Cs"), ("S2", "Ci"), ("D1", "C2"), ("D1h", "C2v"), ("D1d", "C2h")],
        *[("S3", "C3h"), ("S5", "C5h"), ("C3i", "S6"), ("C1i", "Ci"), ("C5i", "S10"), ("V", "D2"), ("Vh", "D2h")],
        *[("Vd", "D2d"), ("c4V", "C4v"), (" d24h ", "D24h"), ("ih", "Ih"), ("C∞v", "Cinfv"), ("DINFH", "Dinfh")],
        *[("CS", "Cs"), ("kh", "Kh"), ("C300", "C300"), ("S720", "S720")],
    ],
)
def test_aliases(alias, name):
    assert point_group(alias).name == name


@pytest.mark.parametrize("name", SMALL + list(LARGE) + list(CONTINUOUS))
def test_canonical_names_are_kept(name):
    assert point_group(name).name == name


BAD = [
    "",
    "C",
    "C0",
    "C01",
    "Q4",
    "C4w",
    "D4i",
    "C4i",
    "S4h",
    "Sinf",
    "Dinfd",
    "Cd",
    "C-3",
    "Iv",
    "C٣",
    f"C{MAX_FOLD + 1}",
]


@pytest.mark.parametrize("name", BAD)
def test_bad_names_list_what_is_valid_in_one_line(name):
    with pytest.raises(InputError, match=r"is not a point group; use C1, Cs, .* Kh$") as caught:
        point_group(name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [None, [], ["C4v"], 4])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(InputError, match="is not a point group; use C1"):
        point_group(name)


def test_frame_must_be_of_numbers():
    with pytest.raises(InputError, match="components of the frame of C2 are not numbers"):
        point_group("C2", "z")


@pytest.mark.parametrize("frame", [np.eye(2), -np.eye(3), 2.0 * np.eye(3), np.full((3, 3), np.nan)])
def test_frame_must_be_a_rotation(frame):
    with pytest.raises(InputError, match="rotation matrix"):
        point_group("C2", frame)


def test_groups_of_one_name_in_one_place_are_equal():
    turned = rotation([0, 0, 1], math.pi / 2)
    assert point_group("C4v") == point_group("c4v", np.eye(3))
    assert point_group("C1h", turned) == point_group("Cs", turned.copy())
    assert point_group("C4v") not in (point_group("C4"), point_group("C4v", turned), "C4v", None)
    assert {point_group("C4v"): "found"}[point_group("C4v", np.where(np.eye(3), 1.0, -0.0))] == "found"
    again = point_group("C4v", turned)
    assert is_subgroup(point_group("C4v"), again), "though the operations are the same"
    assert is_subgroup(again, point_group("C4v"))


def test_groups_cannot_be_changed():
    group = point_group("D4h")
    with pytest.raises(AttributeError):
        group.name = "C1"
    with pytest.raises(ValueError, match="read-only"):
        group.frame[0, 0] = 2.0
    group.operations()[:] = 0.0
    np.testing.assert_array_equal(group.operations()[0], np.eye(3))


# Operations and elements against the tables


@pytest.mark.parametrize("n", range(1, 13))
def test_orders_of_axial_groups(n):
    assert [point_group(name).order for name in axial(n)] == [n, 2 * n, 2 * n, 2 * n, 2 * n, 4 * n, 4 * n]


@pytest.mark.parametrize("n", FOLDS)
def test_elements_of_axial_groups(n):
    two_folds = Counter({2: n})
    expected = {
        "C{n}": (0, Counter({n: 1}), {}, False),
        "C{n}v": (n, Counter({n: 1}), {}, False),
        "C{n}h": (1, Counter({n: 1}), {n: 1} if n > 2 else {}, n % 2 == 0),
        "S{m}": (0, Counter({n: 1}), {2 * n: 1}, n % 2 == 1),
        "D{n}": (0, Counter({n: 1}) + two_folds, {}, False),
        "D{n}h": (n + 1, Counter({n: 1}) + two_folds, {n: 1} if n > 2 else {}, n % 2 == 0),
        "D{n}d": (n, Counter({n: 1}) + two_folds, {2 * n: 1}, n % 2 == 1),
    }
    for pattern, counts in expected.items():
        assert summary(point_group(pattern.format(n=n, m=2 * n))) == counts, pattern


@pytest.mark.parametrize(
    ("name", "order", "counts"),
    [
        ("C1", 1, (0, {}, {}, False)),
        ("Cs", 2, (1, {}, {}, False)),
        ("Ci", 2, (0, {}, {}, True)),
        ("T", 12, (0, {3: 4, 2: 3}, {}, False)),
        ("Td", 24, (6, {3: 4, 2: 3}, {4: 3}, False)),
        ("Th", 24, (3, {3: 4, 2: 3}, {6: 4}, True)),
        ("O", 24, (0, {4: 3, 3: 4, 2: 6}, {}, False)),
        ("Oh", 48, (9, {4: 3, 3: 4, 2: 6}, {4: 3, 6: 4}, True)),
        ("I", 60, (0, {5: 6, 3: 10, 2: 15}, {}, False)),
        ("Ih", 120, (15, {5: 6, 3: 10, 2: 15}, {10: 6, 6: 10}, True)),
    ],
)
def test_elements_of_the_other_finite_groups(name, order, counts):
    group = point_group(name)
    assert group.order == order
    assert summary(group) == counts


def summary(group):
    rotations, improper = (Counter(k for _, k in axes) for axes in (group.rotation_axes(), group.improper_axes()))
    return len(group.mirrors()), rotations, improper, group.has_inversion


@pytest.mark.parametrize("name", FINITE)
def test_operations_form_a_group_of_distinct_orthogonal_matrices(name):
    group = point_group(name, random_orthogonal(rng_of(name)))
    operations = group.operations()
    det = np.linalg.det(operations)
    np.testing.assert_allclose(
        operations @ operations.transpose(0, 2, 1), np.tile(np.eye(3), (len(det), 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(operations[0], np.eye(3), atol=1e-14)
    assert np.count_nonzero(det > 0) == (group.order if group.is_chiral else group.order / 2)
    assert np.all(np.diff(det) < 1e-12)  # rotations come first
    products = (operations[:, None] @ operations[None]).reshape(-1, 9)
    index = np.argmax(products @ operations.reshape(-1, 9).T, axis=1)
    np.testing.assert_allclose(products, operations.reshape(-1, 9)[index], atol=1e-13)
    table = np.sort(index.reshape(len(det), -1), axis=1)  # a Latin square: every product once, hence inverses too
    np.testing.assert_array_equal(table, np.tile(np.arange(len(det)), (len(det), 1)))


@pytest.mark.parametrize("name", FINITE)
def test_elements_are_operations_and_their_order_is_the_highest(name):
    group = point_group(name, random_orthogonal(rng_of(name, 1)))
    listed = [householder(n) for n in group.mirrors()]
    listed += [rotation(u, 2.0 * np.pi / k) for u, k in group.rotation_axes()]
    listed += [rotoreflection(u, 2.0 * np.pi / k) for u, k in group.improper_axes()]
    listed += [-np.eye(3)] if group.has_inversion else []
    if listed:
        assert group.distance_rad(listed).max() < 1e-12
    finer = [rotation(u, 2.0 * np.pi / (p * k)) for u, k in group.rotation_axes() for p in (2, 3, 5)]
    if finer:
        assert group.distance_rad(finer).min() > 1e-3
    assert (group.distance_rad([-np.eye(3)])[0] < 1e-12) == group.has_inversion


@pytest.mark.parametrize("name", FINITE)
def test_the_mirrors_that_stand_alone_are_those_that_commute_with_every_operation(name):
    group = point_group(name, random_orthogonal(rng_of(name, 2)))
    lone = group.lone_mirrors()
    for normal in group.mirrors():
        mirror, every = householder(normal), group.operations()
        commutes = np.abs(every @ mirror - mirror @ every).max() < 1e-12
        assert commutes == bool((np.abs(lone @ normal) > 1.0 - 1e-12).any())


@pytest.mark.parametrize(("name", "count"), [("Cinfv", 0), ("Cinfh", 1), ("Dinfh", 1), ("Kh", 0), ("K", 0)])
def test_of_what_is_round_only_a_mirror_across_stands_alone(name, count):
    group = point_group(name, random_orthogonal(rng_of(name, 3)))
    assert len(group.lone_mirrors()) == count
    np.testing.assert_allclose(np.abs(group.lone_mirrors() @ group.frame[2]), np.ones(count), atol=1e-12)


@pytest.mark.parametrize("name", FINITE)
def test_elements_account_for_every_operation(name):
    group = point_group(name)
    turns = 1 + sum(k - 1 for _, k in group.rotation_axes())
    assert turns == group.proper_subgroup().order
    mirrors, inversion = len(group.mirrors()), int(group.has_inversion)
    on_axis = {tuple(np.round(u, 6)): k for u, k in group.rotation_axes()}
    rest = 0
    for u, k in group.improper_axes():  # of the n improper operations about an n-fold axis, some are listed elsewhere
        n = on_axis[tuple(np.round(u, 6))]
        has_mirror = k == n
        has_inversion = (n % 2 == 0) if has_mirror else (n % 2 == 1)
        rest += n - has_mirror - has_inversion
    assert turns + mirrors + inversion + rest == group.order


def test_frame_places_the_group():
    axis = np.array([1.0, 2.0, -0.5])
    group = point_group("C5v", frame_with_z(axis))
    direction, order = group.rotation_axes()[0]
    assert order == 5
    np.testing.assert_allclose(np.abs(direction @ axis), np.linalg.norm(axis), rtol=1e-14)
    np.testing.assert_allclose(group.mirrors() @ axis, 0.0, atol=1e-14)


def test_standard_cube_and_icosahedron():
    np.testing.assert_array_equal(np.unique(point_group("Oh").operations()), [-1.0, 0.0, 1.0])
    assert {tuple(np.abs(u)) for u, k in point_group("Td").improper_axes()} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    vertices = point_group("Ih").equivalent([0.0, 1.0, golden])
    assert len(vertices) == 12
    five_folds = np.array([u for u, k in point_group("I").rotation_axes() if k == 5])
    np.testing.assert_allclose(np.abs(vertices @ five_folds.T).max(axis=1), 1.0, atol=1e-14)
    assert point_group("I").distance_rad([rotation(u, np.pi) for u in np.eye(3)]).max() < 1e-14


@pytest.mark.parametrize(
    ("name", "direction", "size"),
    [
        *[
            ("Oh", (1, 0, 0), 6),
            ("Oh", (1, 1, 0), 12),
            ("Oh", (1, 1, 1), 8),
            ("Oh", (1, 2, 4), 48),
            ("Ih", (1, 0, 0), 30),
        ],
        *[
            ("Ih", (1, 1, 1), 20),
            ("Ih", (1, 2, 4), 120),
            ("Td", (1, 1, 1), 4),
            ("D24h", (1, 0, 0), 24),
            ("C1", (1, 2, 3), 1),
        ],
    ],
)
def test_orbits(name, direction, size):
    group = point_group(name)
    orbit = group.equivalent(direction)
    assert len(orbit) == size
    assert len(group.equivalent(orbit[:3])) == size


# Subgroups and continuous groups


@pytest.mark.parametrize(
    ("a", "b"),
    [
        *[("T", "O"), ("O", "Oh"), ("T", "Th"), ("Td", "Oh"), ("Th", "Oh"), ("T", "I"), ("Th", "Ih"), ("D2d", "Td")],
        *[("C4v", "D4h"), ("D4", "D4d"), ("S8", "D4d"), ("C3h", "D3h"), ("D3h", "D6h"), ("C1", "Ci"), ("D2", "I")],
        *[
            ("C7v", "Cinfv"),
            ("Cinf", "Cinfv"),
            ("Cinfv", "Dinfh"),
            ("Cinfh", "Dinfh"),
            ("Dinf", "Dinfh"),
            ("D7d", "Dinfh"),
        ],
        *[("Dinfh", "Kh"), ("K", "Kh"), ("I", "K"), ("Dinf", "K"), ("D5", "Dinf"), ("C5h", "Cinfh"), ("S10", "Cinfh")],
    ],
)
def test_subgroup_relations_hold_one_way_only(a, b):
    frame = random_orthogonal(rng_of(a, b))
    smaller, larger = point_group(a, frame), point_group(b, frame)
    assert is_subgroup(smaller, larger)
    assert is_subgroup(smaller, smaller)
    assert not is_subgroup(larger, smaller)


@pytest.mark.parametrize(
    ("a", "b"), [("O", "Ih"), ("C4v", "Cinfh"), ("D3", "Cinfv"), ("Cinfv", "C7v"), ("Td", "K"), ("S8", "D4h")]
)
def test_groups_that_are_not_subgroups(a, b):
    assert not is_subgroup(point_group(a), point_group(b))


@pytest.mark.parametrize("tolerance_rad", [1e-9, 1e-6, 0.05])
def test_a_subgroup_is_one_by_the_distances_of_its_operations(tolerance_rad):
    names = ("C1", "Ci", "Cs", "C3", "C4v", "S4", "D2", "D3h", "Td", "Oh", "I", *CONTINUOUS)
    rng = rng_of("distances", tolerance_rad)
    for a, b in product(names, names):
        frame = random_orthogonal(rng)
        larger = point_group(b, frame)
        for factor in (0.0, 0.4, 3.0):
            tilt = rotation(rng.standard_normal(3), factor * tolerance_rad)
            smaller = point_group(a, tilt @ frame)
            away = larger.distance_rad(smaller.sampled(7).operations()).max()
            within = smaller.order <= larger.order and away <= tolerance_rad
            assert is_subgroup(smaller, larger, tolerance_rad) == within, (a, b, factor)


@pytest.mark.parametrize(("stretched", "is_one"), [(1.4e-6, True), (1.6e-6, False), (-1.6e-6, False)])
def test_a_frame_is_one_if_no_component_is_off_by_more_than_single_precision(stretched, is_one):
    """The largest component here is 2/3."""
    frame = (1.0 + stretched) / 3.0 * np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]])
    if is_one:
        assert np.abs(point_group("C2", frame).frame - frame).max() < 1e-6
    else:
        with pytest.raises(InputError, match="rotation matrix"):
            point_group("C2", frame)


@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-9, 5e-7])
def test_a_frame_is_the_nearest_rotation(off):
    rng = rng_of("nearest", off)
    frame = random_orthogonal(rng) + off * rng.uniform(-1.0, 1.0, (3, 3))
    kept = point_group("C3v", frame).frame
    assert np.abs(kept - orthogonal_factor(frame)).max() < 1e-14  # what a singular value decomposition is off by itself
    assert np.abs(kept @ kept.T - np.eye(3)).max() < 1e-15


def test_subgroups_within_a_tolerance():
    tilt = rotation([1.0, 0.0, 0.0], 0.01)
    for name in ("C4", "Cinf"):
        tilted_group = point_group(name, tilt)
        assert not is_subgroup(tilted_group, point_group("Cinfv"), 0.01)
        assert is_subgroup(tilted_group, point_group("Cinfv"), 0.021)  # a half turn moves twice as far as its axis


@pytest.mark.parametrize("name", SMALL)
def test_proper_subgroup_holds_the_rotations(name):
    group = point_group(name, random_orthogonal(rng_of(name, 3)))
    proper = group.proper_subgroup()
    rotations = group.operations()[np.linalg.det(group.operations()) > 0]
    assert proper.order == len(rotations)
    assert proper.distance_rad(rotations).max() < 1e-12
    assert proper.is_chiral


def test_continuous_groups():
    z = frame_with_z([0.0, 1.0, 2.0])
    for name in CONTINUOUS:
        group = point_group(name, z)
        assert group.order == math.inf
        assert not group.is_finite
        with pytest.raises(InputError, match="infinitely many operations"):
            group.operations()
        assert group.sampled(9).is_finite
        assert is_subgroup(group.sampled(9), group)
        assert len(group.continuous_axes()) == (3 if name[0] == "K" else 1)
    assert summary(point_group("Dinfh")) == (2, {math.inf: 1, 2: 1}, {math.inf: 1}, True)
    assert [point_group(n).proper_subgroup().name for n in CONTINUOUS] == [
        "Cinf",
        "Cinf",
        "Cinf",
        "Dinf",
        "Dinf",
        "K",
        "K",
    ]
    complete = [point_group(n).for_point_set().name for n in CONTINUOUS]
    assert complete == ["Cinfv", "Cinfv", "Dinfh", "Dinfh", "Dinfh", "Kh", "Kh"]
    assert point_group("C3").for_point_set().name == "C3"


@given(seed=SEEDS)
@settings(max_examples=30, deadline=None)
def test_distance_to_a_continuous_group_is_the_least_over_its_samples(seed):
    rng = np.random.default_rng(seed)
    operations = np.array([random_orthogonal(rng, det=det) for det in (1, -1, 1, -1)])
    for name in CONTINUOUS[:5]:
        group = point_group(name, random_orthogonal(rng))
        sampled = group.sampled(MAX_FOLD).distance_rad(operations)
        exact = group.distance_rad(operations)
        assert np.all(exact <= sampled + 1e-9)
        assert np.all(sampled <= exact + 0.6 * 2.0 * np.pi / MAX_FOLD)


@pytest.mark.parametrize("name", ["C1", "S4", "D3d", "Oh", "I", *CONTINUOUS])
@given(seed=SEEDS)
@settings(max_examples=5, deadline=None)
def test_the_nearest_operation_belongs_to_the_group_and_none_is_nearer(name, seed):
    rng = np.random.default_rng(seed)
    group = point_group(name, random_orthogonal(rng))
    matrices = np.array([random_orthogonal(rng, det=det) for det in (1, -1, 1, -1, 1, -1)])
    found = group.nearest(matrices)
    assert group.distance_rad(found).max() < 1e-9
    away = np.linalg.norm(found - matrices, axis=(1, 2))
    others = np.linalg.norm(group.sampled(12).operations()[:, None] - matrices, axis=(2, 3))
    assert np.all(away <= others + 1e-12)
    np.testing.assert_allclose(group.nearest(found), found, atol=1e-9)


# From noisy operations to the group


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([*SMALL, *CONTINUOUS]), SEEDS)
def test_what_brings_a_direction_to_its_image_is_among_the_operations_that_are_told(name, seed):
    rng = np.random.default_rng(seed)
    group = point_group(name, random_orthogonal(rng, 3, 1))
    operation = rng.choice(group.operations() if group.is_finite else group.sampled(17).operations())
    direction = rng.standard_normal(3) / 3.0
    found = group.bringing(direction, operation @ direction)
    assert group.distance_rad(found).max() < 1e-7
    images = found @ direction
    away = np.minimum(*(np.linalg.norm(images - sign * operation @ direction, axis=1) for sign in (1.0, -1.0)))
    assert away.min() < 1e-9


@pytest.mark.parametrize("noise_rad", [0.0, 1e-7, math.radians(0.5)])
@pytest.mark.parametrize("name", FINITE)
def test_identify_recovers_name_and_frame(name, noise_rad):
    rng = rng_of(name, noise_rad)
    group = point_group(name, random_orthogonal(rng))
    found = identify(noisy(group.operations(), noise_rad, rng))
    assert found.name == name
    assert error_rad(found, group) <= noise_rad + 1e-14  # the joint fit is no worse than any single operation


@pytest.mark.parametrize("name", ["Oh", "I", "Ih", "D12h", "D36d"])
def test_the_joint_fit_averages_the_noise_of_single_operations(name):
    rng = rng_of(name)
    group = point_group(name, random_orthogonal(rng))
    errors = [error_rad(identify(noisy(group.operations(), 0.01, rng)), group) for _ in range(5)]
    assert np.median(errors) < 3.0 * 0.01 / math.sqrt(group.order)


@pytest.mark.parametrize("name", ["C4v", "S6", "D3h", "Td", "Th", "I"])
def test_names_do_not_depend_on_handedness(name):
    mirror = random_orthogonal(rng_of(name), det=-1)
    operations = mirror @ point_group(name).operations() @ mirror.T
    found = identify(operations)
    assert found.name == name
    assert found.distance_rad(operations).max() < 1e-13


def test_identify_refuses_what_is_no_group():
    with pytest.raises(InputError, match="match 3 of the 4"):
        identify([np.eye(3), rotation([0, 0, 1], 1.5), rotation([0, 0, 1], 3.0), rotation([0, 0, 1], 3.1)])
    with pytest.raises(InputError, match="cannot form a group"):
        identify(point_group("D4h").operations()[:-1])
    with pytest.raises(InputError, match=r"\[k, 3, 3\]"):
        identify(np.eye(3))
    with pytest.raises(InputError, match="orthogonal"):
        identify([np.diag([1.0, 1.0, 3.0])])


def random_generators(items, size_of, target, rng):
    """Items in random order, kept while they enlarge the group, until it has the order `target`."""
    chosen, size = [], 1
    for i in rng.permutation(len(items)):
        larger = size_of([*chosen, items[i]])
        if larger > size:
            chosen, size = [*chosen, items[i]], larger
        if size == target:
            break
    assert size == target
    return chosen


@given(name=st.sampled_from(POLYHEDRAL), seed=SEEDS, degrees=st.sampled_from([0.0, 1e-5, 2.0]))
@settings(max_examples=40, deadline=None)
def test_close_finds_polyhedral_groups_from_noisy_generators(name, seed, degrees):
    rng = np.random.default_rng(seed)
    group = point_group(name, random_orthogonal(rng))
    exact = random_generators(group.operations()[1:], lambda g: close(g, 1e-6).group.order, group.order, rng)
    closure = close(noisy(np.array(exact), math.radians(degrees), rng), math.radians(max(1.5 * degrees, 1e-5)))
    assert closure.finite
    assert closure.group.name == name
    assert closure.error_rad <= math.radians(1.5 * degrees) + 1e-12
    assert closure.group.order == group.order


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("noise_rad", [0.0, 1e-7, math.radians(0.5)])
def test_close_keeps_a_group_that_is_closed_already(name, noise_rad):
    rng = rng_of(name, noise_rad)
    group = point_group(name, random_orthogonal(rng))
    closure = close(noisy(group.operations(), noise_rad, rng), 2.0 * noise_rad + 1e-9)
    assert closure.group.name == name
    assert error_rad(closure.group, group) <= noise_rad + 1e-12
    assert closure.message.startswith(f"{name} contains every generator")


@pytest.mark.parametrize("name", ["D24h", "C36v", "S36", "C60v"])
def test_close_finds_many_fold_groups_from_exact_generators(name):
    group = point_group(name, random_orthogonal(rng_of(name)))
    elements = [rotoreflection(u, 2.0 * np.pi / k) for u, k in group.improper_axes()]
    elements += [rotation(group.frame[2], 2.0 * np.pi / group.symbol.fold), *map(householder, group.mirrors()[:1])]
    closure = close(elements, math.radians(0.5))
    assert closure.group.name == name
    assert error_rad(closure.group, group) < 1e-12


def test_close_knows_when_there_is_no_finite_group():
    rng = np.random.default_rng(1)
    for _ in range(20):
        generators = [random_orthogonal(rng, det=det) for det in (1, -1)]
        closure = close(generators, math.radians(1.0))
        assert not closure.finite
        assert closure.error_rad == math.inf
        assert closure.group.name == "C1"
        assert closure.message.startswith("no finite group contains every generator within 1 degrees: ")
    near_miss = close([rotation([0, 0, 1], np.pi / 2), rotation([1, 1, 1.3], 2 * np.pi / 3)], math.radians(1.0))
    assert "the closest, O, is" in near_miss.message
    assert not close([rotation([0, 0, 1], 1.0)], 1e-6).finite  # 1 radian divides no whole turn
    assert close([rotation([0, 0, 1], 2 * np.pi / 350)], 1e-6, orders=[350]).group.name == "C350"


def test_two_noisy_copies_of_one_axis_do_not_define_a_normal():
    tilt = rotation([0.3, 1.0, 0.0], math.radians(2.0))
    assert from_elements(mirrors=[[0, 0, 1]], axes=[(tilt[2], 2)], inversion=True).name == "C2h"
    assert from_elements(mirrors=[[0, 0, 1], tilt[2]]).name == "Cs"
    assert from_elements(mirrors=[[0, 0, 1], tilt[2]], tolerance_rad=1e-3).name == "C90v"


def test_close_refuses_unusable_input():
    for arguments, text in [
        (([np.eye(3)], 0.0), "tolerance_rad"),
        (([np.eye(3)], 1.0), "tolerance_rad"),
        ((np.zeros((0, 3, 3)), 0.01), "one generator at least"),
    ]:
        with pytest.raises(InputError, match=text):
            close(*arguments)
    with pytest.raises(InputError, match="2 orders for 1"):
        close([np.eye(3)], 0.01, orders=[1, 2])


# From elements to the group


def elements_of(group):
    elements = [("mirrors", n, 1) for n in group.mirrors()] + [("axes", u, k) for u, k in group.rotation_axes()]
    elements += [("improper", u, k) for u, k in group.improper_axes()]
    return elements + ([("inversion", group.frame[2], 2)] if group.has_inversion else [])


def group_of(elements, noise_rad, rng, tolerance_rad):
    found = {
        kind: [(tilted(u, noise_rad, rng), k) for what, u, k in elements if what == kind]
        for kind in ("mirrors", "axes", "improper")
    }
    found["mirrors"] = [normal for normal, _ in found["mirrors"]]
    inversion = any(kind == "inversion" for kind, _, _ in elements)
    return from_elements(**found, inversion=inversion, tolerance_rad=tolerance_rad)


# Two elements at an angle of pi / N tell N apart from its neighbours only while N^2 times their error is well below pi.
DISTINGUISHABLE = [
    "C1",
    "Cs",
    "Ci",
    *(n for k in range(2, 7) for n in axial(k) if n not in ("D5d", "D6d")),
    *POLYHEDRAL,
]


@given(name=st.sampled_from(DISTINGUISHABLE), seed=SEEDS, degrees=st.sampled_from([0.0, 1e-5, 0.5]))
@settings(max_examples=100, deadline=None)
def test_from_elements_closes_random_generators(name, seed, degrees):
    rng = np.random.default_rng(seed)
    group, noise = point_group(name, random_orthogonal(rng)), math.radians(degrees)
    size_of = lambda chosen: group_of(chosen, 0.0, rng, 1e-6).order  # noqa: E731
    chosen = random_generators(elements_of(group), size_of, group.order, rng)
    found = group_of(chosen, noise, rng, max(2.0 * noise, 1e-6))
    assert found.name == name


# D36d has a mirror every 2.5 degrees from a two-fold axis: 1 degree of noise on both can swap them.
@given(name=st.sampled_from([n for n in FINITE if n != "D36d"]), seed=SEEDS, degrees=st.sampled_from([0.0, 1e-5, 1.0]))
@settings(max_examples=60, deadline=None)
def test_from_elements_of_the_full_list(name, seed, degrees):
    rng = np.random.default_rng(seed)
    group, noise = point_group(name, random_orthogonal(rng)), math.radians(degrees)
    found = group_of(elements_of(group), noise, rng, 2.0 * noise + 1e-6)
    assert found.name == name
    for kind, direction, _ in elements_of(found):
        if kind != "inversion":
            true = np.array([u for what, u, _ in elements_of(group) if what == kind])
            nearest = true[np.argmax(np.abs(true @ direction))]
            assert np.linalg.norm(np.cross(nearest, direction)) <= 1.5 * noise + 1e-12


@pytest.mark.parametrize(
    ("elements", "name"),
    [
        ({}, "C1"),
        ({"inversion": True}, "Ci"),
        ({"mirrors": [[1, 0, 0], [1, 1, 0]]}, "C4v"),
        ({"mirrors": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "D2h"),
        ({"mirrors": [[0, 0, 1]], "axes": [([0, 0, 1], 3)]}, "C3h"),
        ({"mirrors": [[0, 0, 1]], "inversion": True}, "C2h"),
        ({"axes": [([0, 0, 1], 2), ([1, 1, 1], 3)]}, "T"),
        ({"axes": [([0, 0, 1], 4), ([1, 1, 1], 3)]}, "O"),
        ({"axes": [([0, 0, 1], 2), ([0, 1, 1.618033989], 5)]}, "I"),
        ({"axes": [([0, 0, 1], 4), ([0, 0, 1], 3)]}, "C12"),
        ({"improper": [([0, 0, 1], 8)]}, "S8"),
        ({"improper": [([0, 0, 1], 4)], "mirrors": [[1, 0, 0]]}, "D2d"),
        ({"improper": [([0, 0, 1], 4), ([1, 0, 0], 4)]}, "Td"),
        ({"improper": [([0, 0, 1], 10)], "mirrors": [[1, 0, 0]]}, "D5d"),
        ({"axes": [([0, 0, 1], 36)], "mirrors": [[1, 0, 0]]}, "C36v"),
        ({"axes": [([0, 0, 1], 24), ([1, 0, 0], 2)], "inversion": True}, "D24h"),
    ],
)
def test_from_elements_examples(elements, name):
    assert from_elements(**elements).name == name


@pytest.mark.parametrize(
    ("elements", "name"),
    [
        ({}, "Cinf"),
        ({"mirrors": [[1, 0, 0]]}, "Cinfv"),
        ({"mirrors": [[0, 0, 1]]}, "Cinfh"),
        ({"inversion": True}, "Cinfh"),
        ({"improper": [([0, 0, 1], "inf")]}, "Cinfh"),
        ({"axes": [([1, 0, 0], 2)]}, "Dinf"),
        ({"axes": [([0, 0, 1], 5)]}, "Cinf"),
        ({"mirrors": [[1, 0, 0], [0, 0, 1]]}, "Dinfh"),
        ({"mirrors": [[1, 0, 0]], "axes": [([0, 1, 0], 2)]}, "Dinfh"),
        ({"axes": [([0, 1, 1], "inf")]}, "Kh"),
    ],
)
def test_from_elements_with_a_continuous_axis(elements, name):
    rng, axes = rng_of(name), [([0.0, 0.0, 1.0], "inf"), *elements.get("axes", [])]
    turn, noise = random_orthogonal(rng), math.radians(0.5)
    moved = {
        "mirrors": [tilted(turn @ n, noise, rng) for n in elements.get("mirrors", [])],
        "axes": [(tilted(turn @ u, noise, rng), k) for u, k in axes],
        "improper": [(tilted(turn @ u, noise, rng), k) for u, k in elements.get("improper", [])],
        "inversion": elements.get("inversion", False),
    }
    found = from_elements(**moved)
    assert found.name == name
    if name != "Kh":
        assert np.linalg.norm(np.cross(found.frame[2], turn[:, 2])) <= noise + 1e-12


@pytest.mark.parametrize(
    ("elements", "text"),
    [
        ({"axes": [([0, 0, 1], "inf")], "mirrors": [[0, 1, 1]]}, "one axis of revolution .* the mirror along"),
        ({"axes": [([0, 0, 1], 5), ([1, 0, 1], 4)]}, "no finite group"),
        ({"axes": [([0, 0, 1], 7), ([1, 0, 0], 3)]}, "no finite group"),
    ],
)
def test_inconsistent_elements_are_named(elements, text):
    with pytest.raises(DegenerateShapeError, match=text) as caught:
        from_elements(**elements)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "elements",
    [
        {"mirrors": [[0, 0, 0]]},
        {"axes": [([0, 0, 1], 0)]},
        {"axes": [([0, 0, 1], 2.5)]},
        {"axes": [([0, np.nan, 1], 2)]},
        {"axes": [([0, 0, 1], 2)], "tolerance_rad": 1.0},
    ],
)
def test_malformed_elements(elements):
    with pytest.raises(InputError):
        from_elements(**elements)


@pytest.mark.parametrize("name", [*FINITE, "Cinf", "Cinfv", "Cinfh", "Dinf", "Dinfh", "Kh"])
def test_the_listed_elements_give_the_group_back(name):
    group = point_group(name, random_orthogonal(rng_of(name, 4)))
    found = group_of(elements_of(group), 0.0, rng_of(name), 1e-6)
    assert found.name == name
    assert is_subgroup(found, group, 1e-9)


# The plane


@pytest.mark.parametrize("n", range(1, 13))
def test_groups_of_the_plane(n):
    for name, order in ((f"C{n}", n), (f"D{n}", 2 * n)):
        group = PointGroup2D(name=name, angle_rad=0.3)
        operations = group.operations()
        assert len(operations) == group.order == order
        products = (operations[:, None] @ operations[None]).reshape(-1, 4)
        index = np.argmax(products @ operations.reshape(-1, 4).T, axis=1)
        np.testing.assert_allclose(products, operations.reshape(-1, 4)[index], atol=1e-14)
        assert np.count_nonzero(np.linalg.det(operations) < 0) == len(group.mirrors())
        for normal in group.mirrors():
            assert np.abs(operations - householder(normal)).max(axis=(1, 2)).min() < 1e-14
    np.testing.assert_allclose(
        PointGroup2D(name="D1", angle_rad=0.3).operations()[1] @ [np.cos(0.3), np.sin(0.3)], [np.cos(0.3), np.sin(0.3)]
    )


def test_continuous_and_bad_groups_of_the_plane():
    assert PointGroup2D(name="O(2)").order == PointGroup2D(name="SO(2)").order == math.inf
    assert len(PointGroup2D(name="O(2)").mirrors()) == 1
    with pytest.raises(InputError, match="infinitely many"):
        PointGroup2D(name="O(2)").operations()
    for name in ("C0", "S4", "C4v", "c4", f"D{MAX_FOLD + 1}"):
        with pytest.raises(InputError, match="no point group of the plane"):
            PointGroup2D(name=name)


@pytest.mark.parametrize("det", [1, -1])
def test_the_turn_of_a_map_is_the_angle_it_was_made_with(det: int) -> None:
    axis, angle = [1.0, 2.0, -1.0], 0.7
    made = rotation(axis, angle) if det > 0 else rotoreflection(axis, angle)
    assert turn_rad(made) == pytest.approx(angle)
    assert turn_rad(det * np.eye(1)) == turn_rad(np.diag([1.0, 1.0, det])) == 0.0
    assert turn_rad(np.diag([-1.0, -1.0, 1.0, det])) == pytest.approx(np.pi)


@pytest.mark.parametrize(
    "one",
    [
        *("Cs", "C3", "C2v", "D3", "S4", "T"),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("C2", "C5", "C7", "C3h", "S10", "D5")),
    ],
)
def test_groups_that_generate_a_finite_one_may_be_in_one(one):
    """Wherever they stand; of turns about crossing axes those that generate none may not."""
    rng = np.random.default_rng(len(one) + ord(one[-1]))
    crossed = [math.degrees(math.acos(c)) for c in (1 / math.sqrt(3), math.sqrt(2 / 3), 1 / 3, math.sqrt(5) / 3)]
    crossed += [63.4349488, 37.3773681, 31.7174744, *range(0, 91, 15), 7.0]
    for other, degrees in product(["Cs", "Ci", "C2", "C3", "C4", "C5", "C6", "C4v", "D3", "C3h", "S6"], crossed):
        known = point_group(one, random_orthogonal(rng, det=1))
        turn = rotation(known.frame[0], math.radians(degrees)) @ known.frame.T @ rotation([0, 0, 1], rng.uniform(0, 6))
        placed = point_group(other, turn.T)
        finite = close(np.concatenate([known.operations(), placed.operations()]), 1e-3).finite
        may = may_be_in_one(known, placed, 1e-4)
        assert may >= finite
        if one in ("C2", "C3", "C5", "C7") and other[1:].isdigit() and other[0] == "C" and degrees == 7.0:
            assert may == (max(known.symbol.fold, placed.symbol.fold) <= 2)
