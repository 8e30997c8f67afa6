"""Poses modulo a symmetry: laws of the group, plain loops as oracles, and sequences that do not flip."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import symrefine
from experiments.studies.poses import GROUPS, draws, motion, track
from symrefine.errors import InputError
from symrefine.export.bop import placed_entry
from symrefine.geometry import frame_with_z, random_orthogonal, rotation
from symrefine.groups import PointGroup, point_group
from symrefine.groups.orthogonal import chord_angles
from symrefine.poses.canonicalizer import Canonicalizer
from symrefine.poses.given import symmetry_of
from symrefine.poses.symmetry import homogeneous

SEEDS = st.integers(0, 2**32 - 1)
FINITE = ["C1", "Cs", "Ci", "C2", "C3", "C5", "C4v", "S6", "C3h", "D2", "D3h", "D6", "C36", "D24", "T", "Td", "O", "Oh"]
FINITE += ["I", "Ih"]
ROUND = ["Cinf", "Cinfv", "Cinfh", "Dinf", "Dinfh"]
SPHERES = ["K", "Kh"]
FEW = settings(max_examples=5, deadline=None)


class Body:
    """A symmetric body: its group in a random place, as a `Canonicalizer` and as plain lists of operations."""

    def __init__(self, name, seed):
        rng = np.random.default_rng([seed, *name.encode()])
        self.group = point_group(name, random_orthogonal(rng))
        self.center = rng.uniform(-3.0, 3.0, 3)
        self.canonical = Canonicalizer(self.group, center=self.center)
        self.rng = rng

    def operations(self, count, improper=False):
        """Some operations [count, 4, 4], of a continuous group any."""
        found = draws(self.group.proper_subgroup(), self.center, count, self.rng)
        if improper:
            operations = (self.group if self.group.is_finite else self.group.sampled(2)).operations()
            found = found @ homogeneous(self.rng.choice(operations, count), self.center)
        return found

    def poses(self, count):
        return poses(self.rng, count)


def poses(rng, count, spread_rad=None):
    """Random poses [count, 4, 4]; rotations about one another within `spread_rad`."""
    found = np.tile(np.eye(4), (count, 1, 1))
    if spread_rad is None:
        turns = Rotation.random(count, random_state=int(rng.integers(2**31)))
    else:
        axes = rng.standard_normal((count, 3))
        axes *= spread_rad * rng.random((count, 1)) / np.linalg.norm(axes, axis=1, keepdims=True)
        turns = Rotation.random(random_state=int(rng.integers(2**31))) * Rotation.from_rotvec(axes)
    found[:, :3, :3] = turns.as_matrix()
    found[:, :3, 3] = rng.uniform(-5.0, 5.0, (count, 3))
    return found


def angles(a, b):
    return chord_angles(a[..., :3, :3], b[..., :3, :3])


def between(a, b, body):
    """The angle from pose a to the nearest equivalent of b, by a loop over all operations."""
    return min(float(angles(a, b @ s)) for s in homogeneous(body.group.proper_subgroup().operations(), body.center))


# --- the nearest equivalent -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FINITE)
def test_the_nearest_equivalent_is_the_best_of_all_operations(name):
    body = Body(name, 0)
    given, reference = body.poses(20), body.poses(20)
    found = body.canonical(given, reference=reference)
    operations = homogeneous(body.group.proper_subgroup().operations(), body.center)
    for pose, wanted, nearest in zip(given, reference, found, strict=True):
        equivalents = pose @ operations
        best = equivalents[np.argmin(angles(equivalents, wanted))]
        np.testing.assert_allclose(nearest, best, atol=1e-12)


@pytest.mark.parametrize("name", [*ROUND, *SPHERES])
def test_about_continuous_axes_nothing_sampled_is_nearer(name):
    body = Body(name, 0)
    given, reference = body.poses(20), body.poses(20)
    found = angles(body.canonical(given, reference=reference), reference)
    sampled = given[:, None] @ body.operations(5000)
    assert (found <= angles(sampled, reference[:, None]).min(axis=1) + 1e-7).all()
    if name in ROUND:
        axes = [p[:, :3, :3] @ body.group.frame[2] for p in (given, reference)]
        apart = np.arccos(np.clip((axes[0] * axes[1]).sum(axis=1), -1.0, 1.0))
        over = body.group.proper_subgroup().name == "Dinf"
        np.testing.assert_allclose(found, np.minimum(apart, np.pi - apart) if over else apart, atol=1e-7)
    else:
        np.testing.assert_allclose(found, 0.0, atol=1e-7)


@pytest.mark.parametrize("name", [*FINITE, *ROUND, *SPHERES])
@given(seed=SEEDS)
@FEW
def test_the_form_is_canonical(name, seed):
    """Equivalent to what was given, the same for all equivalents, and its own canonical form."""
    body = Body(name, seed)
    given_, reference = body.poses(4), body.poses(1)[0]
    found = body.canonical(given_, reference=reference)
    operations = np.linalg.inv(given_) @ found
    assert body.group.proper_subgroup().distance_rad(operations[:, :3, :3]).max() < 1e-9
    center = np.append(body.center, 1.0)
    np.testing.assert_allclose(found @ center, given_ @ center, atol=1e-12)
    np.testing.assert_allclose(operations @ center, np.tile(center, (4, 1)), atol=1e-11)
    again = body.canonical(given_ @ body.operations(4), reference=reference)
    np.testing.assert_allclose(again, found, atol=1e-7)
    np.testing.assert_allclose(body.canonical(found, reference=reference), found, atol=1e-7)


@pytest.mark.parametrize("name", ["C3", "D6", "I", "Cinf", "Dinfh", "K"])
@given(seed=SEEDS)
@FEW
def test_moving_the_camera_moves_the_canonical_pose(name, seed):
    body = Body(name, seed)
    moved, given_, reference = poses(body.rng, 1)[0], body.poses(5), body.poses(1)[0]
    found = body.canonical(given_, reference=reference)
    np.testing.assert_allclose(body.canonical(moved @ given_, reference=moved @ reference), moved @ found, atol=1e-7)


@pytest.mark.parametrize("name", ["C3", "D6", "I", "Cinf", "Dinfh", "K"])
@given(seed=SEEDS)
@FEW
def test_another_frame_of_the_body_changes_only_how_it_is_told(name, seed):
    """With X' = X M the group is M^-1 G M."""
    body = Body(name, seed)
    frame = poses(body.rng, 1)[0]
    group = PointGroup(name=body.group.name, frame=body.group.frame @ frame[:3, :3])
    other = Canonicalizer(group, center=frame[:3, :3].T @ (body.center - frame[:3, 3]))
    given_, reference = body.poses(5), body.poses(1)[0]
    found = body.canonical(given_, reference=reference)
    np.testing.assert_allclose(other(given_ @ frame, reference=reference @ frame), found @ frame, atol=1e-7)


def test_any_number_of_poses_in_any_arrangement():
    body = Body("O", 0)
    given_ = body.poses(24)
    found = body.canonical(given_)
    np.testing.assert_array_equal(body.canonical(given_.reshape(2, 3, 4, 4, 4)), found.reshape(2, 3, 4, 4, 4))
    np.testing.assert_allclose(body.canonical(given_[0]), found[0], atol=1e-14)
    assert body.canonical(np.empty((0, 4, 4))).shape == (0, 4, 4)
    assert body.canonical.sequence(np.empty((0, 4, 4))).shape == (0, 4, 4)
    for read_by in (given_.tolist(), given_.astype(np.float32), np.asfortranarray(given_)):
        np.testing.assert_allclose(body.canonical(read_by), found, atol=1e-5)


def test_batches_change_nothing(monkeypatch):
    body = Body("I", 0)
    given_ = body.poses(50)
    found = body.canonical(given_)
    monkeypatch.setattr("symrefine.geometry._AT_ONCE", 200)
    np.testing.assert_allclose(body.canonical(given_), found, atol=1e-15)


def test_no_fixed_reference_gives_a_continuous_form():
    """A body that turns once round its axis of order 3 jumps three times; the sequence does not."""
    canonical = Canonicalizer("C3")
    turning = np.array(
        [homogeneous(rotation([0, 0, 1], t)[None], np.zeros(3))[0] for t in np.linspace(0, 2 * np.pi, 100)]
    )
    fixed, tracked = canonical(turning), canonical.sequence(turning)
    assert (angles(fixed[1:], fixed[:-1]) > 1.0).sum() == 3
    np.testing.assert_allclose(tracked, turning, atol=1e-13)


# --- sequences --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GROUPS)
def test_a_thousand_frames_do_not_flip(name):
    """Of noisy poses, each in a random equivalent, the sequence is the motion before they were drawn."""
    found = track(name, frames=1000, step_rad=0.1, noise_rad=0.03, seed=1)
    assert min(found.mixed_flips, found.fixed_flips) > 10  # there is something to be undone
    assert found.flips == 0
    assert found.step_deg <= found.seen_deg + 1e-6
    assert math.isnan(found.off_deg) or found.off_deg < 1e-9


@pytest.mark.parametrize("name", ["C3", "D6", "I", "Cinf", "Dinf", "K"])
def test_a_sequence_is_a_loop_over_its_frames(name):
    """In parts, frame by frame or at once, also where the body turns too far for its group."""
    body = Body(name, 2)
    given_ = body.poses(40)
    found = body.canonical.sequence(given_)
    last = np.eye(4)
    for pose, expected in zip(given_, found, strict=True):
        last = body.canonical(pose, reference=last)
        np.testing.assert_allclose(last, expected, atol=1e-6)
    rest = body.canonical.sequence(given_[25:], reference=found[24])
    np.testing.assert_allclose(rest, found[25:], atol=1e-6)
    several = np.stack([given_, given_[::-1]], axis=1)
    np.testing.assert_allclose(body.canonical.sequence(several)[:, 0], found, atol=1e-6)


def test_a_long_sequence_stays_on_its_orbit():
    """Products of fifty thousand operations are not rounded off: each pose is an equivalent of what was given."""
    body = Body("Dinf", 3)
    given_ = np.tile(motion(body.rng, 100, 0.05), (500, 1, 1))
    found = body.canonical.sequence(given_)
    turns = given_[:, :3, :3].swapaxes(-1, -2) @ found[:, :3, :3]
    assert body.group.distance_rad(turns).max() < 1e-12


def test_nothing_turns_about_its_own_axis():
    """A lathed body that spins is seen to stand still."""
    canonical = Canonicalizer("Cinfv")
    spinning = np.array([homogeneous(rotation([0, 0, 1], t)[None], np.zeros(3))[0] for t in np.linspace(0, 9, 100)])
    np.testing.assert_allclose(canonical.sequence(spinning), np.tile(np.eye(4), (100, 1, 1)), atol=1e-14)


# --- determinants -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Cs", "Ci", "C4v", "S6", "D3h", "Td", "Oh", "Ih", "Cinfv", "Cinfh", "Dinfh", "Kh"])
def test_an_improper_pose_of_an_achiral_body_becomes_a_rigid_motion(name):
    body = Body(name, 0)
    rigid, reference = body.poses(30), body.poses(1)[0]
    mixed = rigid @ body.operations(30, improper=True)
    assert (np.linalg.det(mixed) < 0.0).any()
    found = body.canonical(mixed, reference=reference)
    assert (np.linalg.det(found) > 0.0).all()
    np.testing.assert_allclose(found, body.canonical(rigid, reference=reference), atol=1e-7)


@pytest.mark.parametrize("name", ["C1", "C3", "D6", "I", "Cinf", "K"])
def test_an_improper_pose_of_a_chiral_body_is_refused(name):
    canonical, given_ = Canonicalizer(name), np.tile(np.eye(4), (3, 1, 1))
    given_[1, 0, 0] = -1.0
    with pytest.raises(InputError, match=r"poses\[1\] has determinant -1"):
        canonical(given_)


# --- what says the symmetry -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FINITE)
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_lists_of_operations_give_the_same_poses(name, noise):
    body = Body(name, 4)
    others = homogeneous(body.group.operations()[1:], body.center)
    others = others @ homogeneous(Rotation.from_rotvec(noise * np.ones((len(others), 3))).as_matrix(), body.center)
    listed = body.rng.permutation(np.concatenate([np.eye(4)[None], others]))
    given_ = body.poses(10)
    expected = body.canonical(given_)
    for operations in (listed, others if len(others) else listed):
        np.testing.assert_allclose(Canonicalizer(operations)(given_), expected, atol=1e-12 + 100.0 * noise)
    about = Canonicalizer(listed[:, :3, :3], center=body.center)
    np.testing.assert_allclose(about(given_), expected, atol=1e-12 + 100.0 * noise)


@pytest.mark.parametrize("name", [*FINITE, *ROUND, *SPHERES])
def test_entries_of_bop_are_read_as_they_are_written(name):
    body = Body(name, 5)
    cloud = body.rng.uniform(-1.0, 1.0, (20, 3)) + body.center
    entry = json.loads(json.dumps(placed_entry(body.group, 100.0 * body.center, 100.0 * cloud)))
    found = symmetry_of(entry)
    expected = symmetry_of(body.group, 100.0 * body.center)
    proper = body.group.proper_subgroup()
    assert found.group.name == proper.name
    assert proper.distance_rad(found.group.sampled(7).operations()).max() < 2e-3  # snapped to the axes of the file
    reach = found.center - expected.center
    along = body.group.frame[2] if name[0] in "CS" else np.zeros(3)
    assert np.linalg.norm(reach - (reach @ along) * along) < 1.0 or proper.name == "C1"
    six_digits = json.loads(json.dumps(entry), parse_float=lambda text: float(f"{float(text):.6g}"))
    assert symmetry_of(six_digits).group.name == proper.name


def test_what_was_detected_is_taken_as_exactly_as_the_shape_has_it():
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
    found = symrefine.detect(box)
    canonical = symrefine.Canonicalizer(found)
    np.testing.assert_allclose(canonical.symmetry.center, [0.5, 1.0, 1.5], atol=1e-12)
    turned_over = np.diag([1.0, -1.0, -1.0, 1.0])
    turned_over[:3, 3] = [0.0, 2.0, 3.0]
    np.testing.assert_allclose(canonical(turned_over), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(symrefine.Canonicalizer(found.operations())(turned_over), np.eye(4), atol=1e-12)


def test_the_centre_is_the_point_nearest_to_the_origin():
    direction = np.array([1.0, 2.0, 2.0]) / 3.0
    for name in ("C5", "Cinf", "Cinfv"):
        canonical = Canonicalizer(point_group(name, frame_with_z(direction)), center=[0.0, 0.0, 3.0])
        np.testing.assert_allclose(canonical.symmetry.center, np.array([0.0, 0.0, 3.0]) - 2.0 * direction, atol=1e-14)
    np.testing.assert_allclose(Canonicalizer("D2", center=[1.0, 2.0, 3.0]).symmetry.center, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(Canonicalizer("Cs", center=[1.0, 2.0, 3.0]).symmetry.center, 0.0)


HALF = np.diag([-1.0, -1.0, 1.0, 1.0])
ELSEWHERE = HALF + np.array([0, 0, 0, 1.0]) * np.array([[4.0], [0.0], [0.0], [0.0]])
LINE = {"axis": [0, 0, 1], "offset": [0, 0, 0]}


@pytest.mark.parametrize(
    ("group", "message"),
    [
        ("Q7", "is not a point group"),
        (7, r"^group is of type int; expected a Schoenflies symbol, "),
        (None, "^group is of type NoneType"),
        (np.eye(4), r"^group has shape \[4, 4\]"),
        (np.empty((0, 3, 3)), r"^group has shape \[0, 3, 3\]"),
        (2.0 * np.eye(3)[None], r"^group\[0\] is not orthogonal: R'R misses 1 by 3; poses have no scale$"),
        (np.full((2, 4, 4), np.nan), r"^group\[0\] is not finite$"),
        ([rotation([0, 0, 1], t) for t in (0.0, 0.5 * np.pi, np.pi)], "are no group: those of the likeliest one, C3"),
        ([HALF, HALF @ np.diag([-1, 1, -1, 1]), ELSEWHERE @ np.diag([1, -1, -1, 1])], "moves the point"),
        ({"1": {}, "2": {}}, "has the keys '1, 2'; expected the entry of one object"),
        ({"symmetries_discrete": [[1, 2, 3]]}, "expected lists of 16 numbers"),
        ({"symmetries_discrete": [np.diag([1.0, 1.0, -1.0, 1.0]).ravel()]}, "determinant -1; expected rigid motions"),
        ({"symmetries_continuous": [{"axis": [0, 0, 1]}]}, "each with axis and offset"),
        ({"symmetries_continuous": [LINE, {"axis": [0, 0, 1], "offset": [0, 1, 0]}]}, "do not meet"),
        ({"symmetries_continuous": [LINE, {"axis": [1, 0, 0], "offset": [0, 0, 0]}],
          "symmetries_discrete": [ELSEWHERE.ravel()]}, "moves the point"),
        ({"symmetries_continuous": None}, "is None; expected a list of axes"),
        ({"symmetries_continuous": [LINE | {"offset": [0, np.nan, 0]}]}, "expected three finite numbers"),
        ({"symmetries_discrete": None}, "are not numbers"),
        ({"diameter": "long"}, "diameter are not numbers"),
        ({"diameter": -1.0}, "diameter is -1.0; expected a length"),
        ({"symmetries_continuous": [{"axis": [0, 0, 0], "offset": [0, 0, 0]}]}, "finite and not zero"),
        ({"symmetries_continuous": [LINE, {"axis": [1, 0, 0], "offset": [0, 1, 0]}]}, "do not meet"),
        ({"symmetries_continuous": [LINE], "symmetries_discrete": [np.eye(4)[[1, 2, 0, 3]].ravel()]},
         "tilts the axis of revolution by 90 degrees"),
        ({"symmetries_continuous": [LINE], "symmetries_discrete": [ELSEWHERE.ravel()]}, "moves the point"),
    ],
)  # fmt: skip
def test_what_says_no_symmetry_is_refused_in_a_line(group, message):
    with pytest.raises(InputError, match=message) as caught:
        Canonicalizer(group)
    assert "\n" not in str(caught.value)


def test_a_group_that_has_a_centre_takes_no_other():
    for group in (np.eye(4)[None], {"diameter": 1.0}):
        with pytest.raises(InputError, match="this group has its own"):
            Canonicalizer(group, center=[1.0, 2.0, 3.0])
    for center in ([1.0, 2.0], [np.nan, 0.0, 0.0]):
        with pytest.raises(InputError, match="expected three finite numbers"):
            Canonicalizer("C2", center=center)


@pytest.mark.parametrize(
    ("poses_", "message"),
    [
        (np.eye(3), r"poses has shape \[3, 3\]; expected \[..., 4, 4\]"),
        (np.eye(4) * 1j, "values of poses are not numbers in rows of one length: they are complex"),
        (np.ma.masked_invalid(np.eye(4)), "masked array"),
        ("x", "values of poses are not numbers"),
        ([[np.eye(4), np.full((4, 4), np.inf)]], r"poses\[0, 1\] is not finite"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "poses is not orthogonal"),
        (np.ones((4, 4)), "poses does not end with the row 0, 0, 0, 1"),
    ],
)
def test_what_is_no_pose_is_refused_in_a_line(poses_, message):
    for verb in (Canonicalizer("C2"), Canonicalizer("C2").sequence, Canonicalizer("C2").mean):
        with pytest.raises(InputError, match=message):
            verb(poses_)


def test_shapes_that_do_not_fit_are_refused():
    canonical, three = Canonicalizer("C2"), np.tile(np.eye(4), (3, 1, 1))
    with pytest.raises(InputError, match=r"reference has shape \[2, 4, 4\]"):
        canonical(three, reference=three[:2])
    with pytest.raises(InputError, match="expected a sequence"):
        canonical.sequence(np.eye(4))
    with pytest.raises(InputError, match="N at least 1"):
        canonical.mean(three[:0])
    for weights in ([1.0, 2.0], [1.0, 0.0, 1.0], [1.0, np.nan, 1.0]):
        with pytest.raises(InputError, match="expected 3 positive finite numbers"):
            canonical.mean(three, weights=weights)


# --- means ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*FINITE, *ROUND, *SPHERES])
@given(seed=SEEDS)
@FEW
def test_the_mean_does_not_ask_which_equivalents_it_is_given(name, seed):
    """It is that of the poses before they were mixed up, and symmetric distances from it are true ones."""
    body = Body(name, seed)
    smallest = body.canonical.symmetry.smallest_turn_rad
    close = poses(body.rng, 12, 0.1 * smallest)
    weights = body.rng.uniform(0.5, 2.0, 12)
    found = body.canonical.mean(close @ body.operations(12), weights=weights)
    assert found.ambiguous == ""
    center = np.append(body.canonical.symmetry.center, 1.0)
    np.testing.assert_allclose(found.pose @ center, np.average(close @ center, axis=0, weights=weights), atol=1e-12)
    if body.group.is_finite:
        expected = Rotation.from_matrix(close[:, :3, :3]).mean(weights=weights).as_matrix()
        found_turn = body.canonical(found.pose, reference=homogeneous(expected[None], np.zeros(3))[0])[:3, :3]
        np.testing.assert_allclose(found_turn, expected, atol=1e-9)
    elif name in ROUND:
        mean = np.average(close[:, :3, :3] @ body.group.frame[2], axis=0, weights=weights)
        along = found.pose[:3, :3] @ body.group.frame[2]
        np.testing.assert_allclose(abs(along @ mean), np.linalg.norm(mean), atol=1e-9)
    np.testing.assert_allclose(found.angles_rad, angles(found.nearest, found.pose), atol=1e-9)


@pytest.mark.parametrize("name", ["C2", "C5", "D4", "T", "Cinf", "Dinf"])
def test_no_pose_near_the_mean_costs_less(name):
    body = Body(name, 6)
    given_ = poses(body.rng, 9, 0.4) @ body.operations(9)

    def cost(pose):
        nearest = body.canonical(given_, reference=pose)
        return float(((nearest[:, :3, :3] - pose[:3, :3]) ** 2).sum())

    found = body.canonical.mean(given_).pose
    for axis in body.rng.standard_normal((20, 3)):
        assert cost(found) <= cost(found @ homogeneous(rotation(axis, 1e-3)[None], np.zeros(3))[0]) + 1e-12


def test_an_ambiguous_mean_says_so():
    """Of two poses half a smallest turn apart there are two means; of poses all over the place, who knows."""
    eighth = np.stack([np.eye(4), homogeneous(rotation([0, 0, 1], 0.25 * np.pi)[None], np.zeros(3))[0]])
    assert "a quarter of the smallest turn of C4" in Canonicalizer("C4").mean(eighth).ambiguous
    assert Canonicalizer("C2").mean(eighth).ambiguous == ""
    over = np.stack([np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])])
    assert Canonicalizer("Cinf").mean(over).ambiguous
    assert Canonicalizer("Dinf").mean(over).ambiguous == ""
    body = Body("O", 7)
    assert body.canonical.mean(body.poses(30)).ambiguous


def test_an_outlier_in_front_does_not_lead_astray():
    body = Body("D2", 8)
    close = poses(body.rng, 30, 0.1)
    stray = close[:1] @ homogeneous(rotation([1.0, 1.0, 1.0], 1.0)[None], body.center)
    found = body.canonical.mean(np.concatenate([stray, close]) @ body.operations(31))
    assert np.median(found.angles_rad) < 0.15
    assert math.isclose(found.angles_rad.argmax(), 0)


def test_results_cannot_be_written_to():
    found = Canonicalizer("C2").mean(np.eye(4)[None])
    with pytest.raises(ValueError, match="read-only"):
        found.pose[0, 0] = 2.0
    with pytest.raises(AttributeError):
        Canonicalizer("C2").symmetry = None
