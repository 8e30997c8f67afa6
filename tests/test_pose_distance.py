"""Distances of poses modulo a symmetry: the axioms, and BOP's definitions carried out plainly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import symrefine
from experiments.studies.poses import draws
from symrefine.errors import InputError
from symrefine.geometry import random_orthogonal, rotation
from symrefine.groups import point_group
from symrefine.poses.symmetry import homogeneous

SEEDS = st.integers(0, 2**32 - 1)
FINITE = ["C1", "C2", "C5", "D3", "D6", "T", "O", "I"]
ROUND = ["Cinf", "Dinf"]
FEW = settings(max_examples=5, deadline=None)
CAMERA = np.array([[600.0, 0.5, 320.0], [0.0, 610.0, 240.0], [0.0, 0.0, 1.0]])


class Body:
    """A symmetric body whose vertices have its symmetry exactly, about a centre beside the origin."""

    def __init__(self, name, seed, fold=24):
        self.rng = np.random.default_rng([seed, *name.encode()])
        self.group = point_group(name, random_orthogonal(self.rng))
        self.center = self.rng.uniform(-1.0, 1.0, 3)
        finite = self.group if self.group.is_finite else self.group.sampled(fold)
        seeds = self.rng.uniform(-1.0, 1.0, (6, 3))
        self.points = np.einsum("kij,mj->kmi", finite.operations(), seeds).reshape(-1, 3) + self.center
        self.canonical = symrefine.Canonicalizer(self.group, center=self.center)
        self.sampled = homogeneous(finite.operations(), self.center)

    def poses(self, count, spread=(1.0, 0.3)):
        """Poses [count, 4, 4] in front of the camera, about one another within an angle [rad] and a shift."""
        found = np.tile(np.eye(4), (count, 1, 1))
        first = Rotation.random(random_state=0)
        vectors = spread[0] * self.rng.uniform(-1.0, 1.0, (count, 3))
        found[:, :3, :3] = (first * Rotation.from_rotvec(vectors)).as_matrix()
        found[:, :3, 3] = spread[1] * self.rng.standard_normal((count, 3)) + [0.0, 0.0, 8.0]
        return found

    def operations(self, count):
        return draws(self.group, self.center, count, self.rng)


def moved(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def pictured(pose, points):
    seen = moved(pose, points) @ CAMERA.T
    return seen[:, :2] / seen[:, 2:]


def plain(estimate, true, operations, points, view=moved):
    """What bop_toolkit computes: min over symmetries of max over vertices of |P x - P' S x|."""
    errors = [np.linalg.norm(view(estimate, points) - view(true @ s, points), axis=1).max() for s in operations]
    return min(errors)


def round_about(body, angle):
    """All operations that turn by an angle about the axis, after a half turn across it for Dinf."""
    x, _, z = body.group.frame
    sides = [np.eye(3), rotation(x, np.pi)] if body.group.name == "Dinf" else [np.eye(3)]
    return homogeneous(np.array([rotation(z, angle) @ side for side in sides]), body.center)


# --- the benchmark's definitions --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FINITE)
@pytest.mark.parametrize("spread", [(3.0, 1.0), (1e-3, 1e-3)])
def test_mssd_and_mspd_are_those_of_bop(name, spread):
    body = Body(name, 0)
    a, b = body.poses(8, spread), body.poses(8, spread) @ body.operations(8)
    cloud = body.rng.uniform(-1.0, 1.0, (40, 3))  # vertices without the symmetry, too
    for points in (body.points, cloud):
        found = symrefine.symmetric_distance(a, b, body.canonical, points=points, intrinsics=CAMERA)
        for k in range(8):
            np.testing.assert_allclose(found.mssd[k], plain(a[k], b[k], body.sampled, points), rtol=1e-9)
            expected = plain(a[k], b[k], body.sampled, points, pictured)
            np.testing.assert_allclose(found.mspd[k], expected, rtol=1e-9)


@pytest.mark.parametrize("name", ROUND)
@pytest.mark.parametrize("spread", [(3.0, 1.0), pytest.param((0.3, 0.3), marks=pytest.mark.slow), (1e-3, 1e-3)])
def test_about_an_axis_nothing_is_better_and_it_is_reached(name, spread):
    """Below every of BOP's turns, and no lower than a search finds that starts from the best of very many."""
    body = Body(name, 1)
    a, b = body.poses(6, spread), body.poses(6, spread) @ body.operations(6)
    found = symrefine.symmetric_distance(a, b, body.canonical, points=body.points, intrinsics=CAMERA)
    turns = 2.0 * np.pi * np.arange(315) / 315
    for view, values in ((moved, found.mssd), (pictured, found.mspd)):
        for k in range(6):

            def cost(angle, k=k, view=view):
                return plain(a[k], b[k], round_about(body, angle), body.points, view)

            coarse = np.array([cost(t) for t in turns])
            assert values[k] <= coarse.min() * (1.0 + 1e-12)
            step = turns[1]
            ends = [minimize_scalar(cost, bounds=(t - step, t + step), method="bounded", options={"xatol": 1e-11})
                    for t in turns[np.argsort(coarse)[:6]]]  # fmt: skip
            best = min(end.fun for end in ends)
            np.testing.assert_allclose(values[k], best, rtol=1e-5, atol=1e-9)
            assert values[k] <= best * (1.0 + 1e-9)


def test_of_a_sphere_only_the_centre_counts():
    body = Body("K", 2)
    a, b = body.poses(5), body.poses(5)
    found = symrefine.symmetric_distance(a, b, body.canonical, points=body.points, intrinsics=CAMERA)
    np.testing.assert_allclose(found.mssd, found.translation, rtol=1e-9)
    np.testing.assert_allclose(found.angle_rad, 0.0, atol=1e-7)
    assert (found.mspd > 0.0).all()


@pytest.mark.parametrize("name", ["C5", "O", "Cinf"])
@pytest.mark.parametrize("flat", [1, 2, 3, 4])
def test_few_and_flat_vertices(name, flat):
    """A point, a pair, a triangle, a square: hulls without a volume."""
    body = Body(name, 3)
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])[:flat]
    a, b = body.poses(3), body.poses(3)
    operations = body.sampled if body.group.is_finite else np.concatenate(
        [round_about(body, t) for t in np.linspace(0.0, 2.0 * np.pi, 2000)])  # fmt: skip
    found = symrefine.symmetric_distance(a, b, body.canonical, points=points).mssd
    expected = [plain(p, q, operations, points) for p, q in zip(a, b, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-9 if body.group.is_finite else 2e-3)
    assert (found <= np.array(expected) * (1.0 + 1e-9)).all()


def test_batches_and_shapes_change_nothing(monkeypatch):
    for name in ("D3", "Cinf"):
        body = Body(name, 4)
        a, b = body.poses(6), body.poses(6)
        given_ = {"points": body.points, "intrinsics": [600.0, 600.0, 320.0, 240.0]}
        found = symrefine.symmetric_distance(a, b, body.canonical, **given_)
        grid = symrefine.symmetric_distance(a[:, None], b, body.canonical, **given_)
        single = symrefine.symmetric_distance(a[2], b[2], body.canonical, **given_)
        with monkeypatch.context() as patch:
            patch.setattr("symrefine.geometry._AT_ONCE", 500)
            split = symrefine.symmetric_distance(a, b, body.canonical, **given_)
        for key in ("angle_rad", "translation", "mssd", "mspd"):
            values = getattr(found, key)
            np.testing.assert_allclose(getattr(split, key), values, rtol=1e-12)
            np.testing.assert_allclose(np.diagonal(getattr(grid, key)), values, rtol=1e-9)
            assert getattr(single, key).shape == ()
            np.testing.assert_allclose(getattr(single, key), values[2], rtol=1e-9)
            assert f"{getattr(single, key):.3f}" == f"{values[2]:.3f}"


# --- axioms -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*FINITE, *ROUND, "K"])
@given(seed=SEEDS)
@FEW
def test_they_are_metrics_of_what_can_be_told_apart(name, seed):
    """Zero of equivalents, the same both ways, no detour shorter, whichever equivalents stand for the poses."""
    body = Body(name, seed, fold=8)
    p = body.poses(3, (3.0, 1.0))
    scale = {"angle_rad": 1.0, "translation": 1.0, "mssd": 1.0}
    # Vertices of a sphere are never those of a group: only what has their symmetry is told by them.
    points = body.points if body.group.is_finite else None

    def distances(i, j, x=p):
        return symrefine.symmetric_distance(x[i], x[j], body.canonical, points=points)

    other = p @ body.operations(3)
    same = symrefine.symmetric_distance(p, other, body.canonical, points=points)
    for key in scale:
        values = getattr(same, key)
        if values is None:
            continue
        assert values.max() < 1e-6
        ab, ba, bc, ac = (getattr(distances(*pair), key) for pair in ((0, 1), (1, 0), (1, 2), (0, 2)))
        np.testing.assert_allclose(ab, ba, atol=1e-7)
        assert ac <= ab + bc + 1e-7
        np.testing.assert_allclose(getattr(distances(0, 1, other), key), ab, atol=1e-6)


@given(seed=SEEDS)
@FEW
def test_the_angle_is_never_larger_than_what_the_group_allows(seed):
    """Half of the icosahedron's 60 cells: no rotation is farther than 44.48 degrees from all."""
    rng = np.random.default_rng(seed)
    turns = np.tile(np.eye(4), (200, 1, 1))
    turns[:, :3, :3] = Rotation.random(200, random_state=int(rng.integers(2**31))).as_matrix()
    found = symrefine.symmetric_distance(turns, np.eye(4), "I")
    assert np.degrees(found.angle_rad).max() < 44.48


def test_what_differs_tells_zero_from_nothing():
    """A step of a millionth is seen as one, by every measure."""
    body = Body("D6", 5)
    true = body.poses(1)[0]
    turned = true @ homogeneous(rotation(body.rng.standard_normal(3), 1e-6)[None], body.center)[0] @ body.sampled[3]
    found = symrefine.symmetric_distance(turned, true, body.canonical, points=body.points, intrinsics=CAMERA)
    np.testing.assert_allclose(found.angle_rad, 1e-6, rtol=1e-6)
    assert found.translation < 1e-12
    assert 1e-7 < found.mssd < 2e-6


# --- bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points": np.zeros((3, 2))}, r"points has shape \[3, 2\]"),
        ({"points": np.zeros((0, 3))}, "V at least 1"),
        ({"points": np.full((3, 3), np.nan)}, "expected finite vertices"),
        ({"intrinsics": CAMERA}, "needs points"),
        ({"points": np.eye(3), "intrinsics": np.zeros((3, 3))}, "no pinhole camera"),
        ({"points": np.eye(3), "intrinsics": [1.0, 2.0]}, "no pinhole camera"),
        ({"points": np.eye(3), "intrinsics": [-1.0, 2.0, 0.0, 0.0]}, "fx and fy above 0"),
        ({"points": np.eye(3), "intrinsics": CAMERA}, "pose_a puts a vertex behind the camera, at the depth 0"),
    ],
)
def test_bad_input_is_refused_in_a_line(options, message):
    with pytest.raises(InputError, match=message) as caught:
        symrefine.symmetric_distance(np.eye(4), np.eye(4), "C2", **options)
    assert "\n" not in str(caught.value)


def test_poses_that_do_not_fit_are_refused():
    three = np.tile(np.eye(4), (3, 1, 1))
    with pytest.raises(InputError, match="they do not fit"):
        symrefine.symmetric_distance(three, three[:2], "C2")
    with pytest.raises(InputError, match="pose_b has shape"):
        symrefine.symmetric_distance(three, np.eye(3), "C2")
    with pytest.raises(InputError, match="is not a point group"):
        symrefine.symmetric_distance(three, three, "Q")
