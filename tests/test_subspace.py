"""Hyperplanes of symmetry in any dimension, and the rank of the n-tuples."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from symrefine.cli import invoke
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.geometry import Array
from symrefine.moments.moments import shape_moments
from symrefine.ndim import detect_nd
from symrefine.ndim import sampled as samples
from symrefine.ndim.matched import Points
from symrefine.ndim.roots import MOST, closed_under_reflection, reflection_group_order
from symrefine.shape import Shape

DIMENSIONS = [4, 5, 6]


def pose(dim: int, rng: np.random.Generator) -> Array:
    return np.linalg.qr(rng.normal(size=(dim, dim)))[0]


def mirrored(dim: int, count: int, rng: np.random.Generator) -> Array:
    """Points with their images in the first coordinate."""
    half = rng.normal(size=(count // 2, dim))
    return np.concatenate([half, half * np.where(np.arange(dim) == 0, -1.0, 1.0)])


def blobs(dim: int, count: int, rng: np.random.Generator, *, mirror: bool) -> Array:
    """Samples of a few round clouds, or of these and their images in the first coordinate."""
    centers, sizes = rng.normal(size=(dim + 2, dim)), rng.uniform(0.1, 0.3, dim + 2)
    which = rng.integers(dim + 2, size=count)
    points = centers[which] + sizes[which][:, None] * rng.normal(size=(count, dim))
    if mirror:
        points[rng.random(count) < 0.5, 0] *= -1
    return points


def off_deg(normal: Array, truth: Array) -> float:
    return float(np.degrees(np.arccos(min(1.0, abs(normal @ truth)))))


@pytest.mark.parametrize("dim", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_exact_points_with_a_hyperplane(dim: int, scale: float) -> None:
    rng = np.random.default_rng([dim, int(scale)])
    turn, shift = pose(dim, rng), rng.normal(size=dim)
    found = detect_nd(scale * (mirrored(dim, 60, rng) @ turn.T + shift))
    assert len(found.hyperplanes) == 1
    plane = found.hyperplanes[0].plane
    assert off_deg(plane.normal, turn[:, 0]) < 1e-2
    assert plane.offset == pytest.approx(scale * float(plane.normal @ shift), abs=1e-4 * scale)
    assert found.hyperplanes[0].miss < 1e-3


@pytest.mark.parametrize("dim", DIMENSIONS)
@pytest.mark.parametrize("seed", range(3))
def test_exact_points_without_symmetry(dim: int, seed: int) -> None:
    found = detect_nd(np.random.default_rng([dim, seed]).normal(size=(60, dim)))
    assert found.hyperplanes == ()
    assert not found.undetermined
    assert min(h.miss for h in found.rejected) > 0.02


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_rank_at_a_fine_tolerance(dim: int) -> None:
    rng = np.random.default_rng(dim)
    assert detect_nd(mirrored(dim, 60, rng), tolerance=1e-5).fixed.rank == dim - 1
    assert detect_nd(rng.normal(size=(60, dim)), tolerance=1e-5).fixed.rank == dim


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_one_point_out_of_place_breaks_it(dim: int) -> None:
    rng = np.random.default_rng(dim)
    points = mirrored(dim, 60, rng)
    points[3] += 0.2 * pose(dim, rng)[0] * np.linalg.norm(points, axis=1).max()
    assert detect_nd(points).hyperplanes == ()
    assert len(detect_nd(points, tolerance=0.2).hyperplanes) >= 1


def test_several_hyperplanes() -> None:
    """The corners of a box in 4-space have one across each edge."""
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 4), axis=-1).reshape(-1, 4)
    turn = pose(4, np.random.default_rng(0))
    found = detect_nd(signs * [1.0, 1.4, 1.9, 2.5] @ turn.T)
    assert len(found.hyperplanes) == 4
    assert found.fixed.rank == 0
    assert all(min(off_deg(h.plane.normal, t) for t in turn.T) < 0.01 for h in found.hyperplanes)


@pytest.mark.parametrize("dim", [4, 5])
def test_samples(dim: int) -> None:
    rng = np.random.default_rng([dim, 9])
    turn = pose(dim, rng)
    found = detect_nd(blobs(dim, 60_000, rng, mirror=True) @ turn.T + 5.0)
    assert len(found.hyperplanes) == 1
    assert not found.undetermined
    assert off_deg(found.hyperplanes[0].plane.normal, turn[:, 0]) < 1.0
    without = detect_nd(blobs(dim, 60_000, rng, mirror=False) @ turn.T)
    assert without.hyperplanes == ()
    assert not without.undetermined


def test_few_samples_are_not_decided() -> None:
    found = detect_nd(blobs(4, 400, np.random.default_rng(1), mirror=True))
    assert found.hyperplanes == ()
    assert "give more points" in found.undetermined


def test_what_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="9 coordinates; expected points of 2 to 8 coordinates"):
        detect_nd(rng.normal(size=(40, 9)))
    with pytest.raises(InputError, match=r"tolerance is 0\.5"):
        detect_nd(rng.normal(size=(40, 4)), tolerance=0.5)
    with pytest.raises(DegenerateShapeError):
        detect_nd(np.ones((40, 4)))


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(3)
    turn = pose(4, rng)
    path = tmp_path / "x.npy"
    np.save(path, mirrored(4, 60, rng) @ turn.T)
    assert invoke(["detect", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f"{path}: 1 hyperplane of symmetry in 4 dimensions" in shown
    assert "its reflection generates a group of order 2" in shown
    assert "there may be more" not in shown
    assert invoke(["detect", str(path), "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["schema"] == "symrefine.detection_nd/1"
    assert record["ntuples"]["rank"] <= 3
    assert record["reflection_group_order"] == 2
    assert record["incomplete"] is None
    assert off_deg(np.array(record["hyperplanes"][0]["normal"]), turn[:, 0]) < 1e-2
    assert invoke(["detect", str(path), "--bop", str(tmp_path / "b.json")]) == 2
    assert f"is for objects in space; {path} has 4 coordinates; use --report" in capsys.readouterr().err
    np.save(path, rng.normal(size=(40, 9)))
    assert invoke(["detect", str(path)]) == 2
    assert "9 coordinates; expected points of 2 to 8 coordinates" in capsys.readouterr().err


# --- reflection groups ------------------------------------------------------------------------------------------------


def cube(dim: int) -> Array:
    return np.array(list(itertools.product([-1.0, 1.0], repeat=dim)))


def simplex(dim: int) -> Array:
    corners = np.eye(dim + 1) - 1.0 / (dim + 1)
    return corners @ np.linalg.svd(corners)[2][:dim].T


def polygon(corners: int) -> Array:
    angles = 2 * np.pi * np.arange(corners) / corners
    return np.column_stack([np.cos(angles), np.sin(angles)])


def product(a: Array, b: Array) -> Array:
    return np.array([np.concatenate([x, y]) for x in a for y in b])


def roots_of_d(dim: int) -> Array:
    """+-e_i +-e_j: of D4, the corners of the 24-cell."""
    return np.array([p for p in itertools.product([-1.0, 0.0, 1.0], repeat=dim) if np.abs(p).sum() == 2.0])


def roots_of_e8() -> Array:
    halves = 0.5 * cube(8)
    return np.concatenate([roots_of_d(8), halves[(halves < 0).sum(axis=1) % 2 == 0]])


# Points, the number of their hyperplanes and the order of the group (Humphreys, section 2.11).
POLYTOPES = {
    "4-simplex": (simplex(4), 10, 120),
    "tesseract": (cube(4), 16, 384),
    "16-cell": (np.concatenate([np.eye(4), -np.eye(4)]), 16, 384),
    "24-cell": (roots_of_d(4), 24, 1152),
    "5-cube": (cube(5), 25, 3840),
    "6-simplex": (simplex(6), 21, 5040),
    "8-cross": (np.concatenate([np.eye(8), -np.eye(8)]), 64, 10321920),
    "square x triangle": (product(polygon(4), 1.3 * polygon(3)), 7, 48),
    "pentagon x hexagon": (product(polygon(5), polygon(6)), 11, 120),
    "triangle x triangle": (product(polygon(3), polygon(3)), 6, 36),
}


def placed(points: Array, rng: np.random.Generator) -> Array:
    """In a random pose of any determinant, at another scale and place."""
    dim = points.shape[1]
    return 10.0 ** rng.uniform(-2, 2) * (points @ pose(dim, rng).T + 3.0 * rng.normal(size=dim))


def shaken(points: Array, rel: float, rng: np.random.Generator) -> Array:
    """Moved at random by up to a fraction of the diameter."""
    steps = rng.normal(size=points.shape)
    reach = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    return points + 2.0 * rel * reach * steps / np.linalg.norm(steps, axis=1).max()


@pytest.mark.parametrize("rel", [0.0, 0.006])
@pytest.mark.parametrize("name", POLYTOPES)
def test_all_hyperplanes_of_a_polytope_and_the_order_of_its_group(name: str, rel: float) -> None:
    points, count, order = POLYTOPES[name]
    rng = np.random.default_rng(len(name))
    found = detect_nd(placed(shaken(points, rel, rng), rng))
    assert len(found.hyperplanes) == count
    assert found.reflection_group_order == order
    assert found.incomplete == ""
    assert max(h.miss for h in found.hyperplanes) <= 0.02


@pytest.mark.slow
def test_the_largest_group_of_eight_dimensions() -> None:
    found = detect_nd(placed(roots_of_e8(), np.random.default_rng(0)))
    assert len(found.hyperplanes) == 120
    assert found.reflection_group_order == 696729600


def test_a_corner_out_of_place_leaves_what_it_allows() -> None:
    points = cube(4)
    points[-1] += 0.3
    found = detect_nd(placed(points, np.random.default_rng(1)))
    assert len(found.hyperplanes) == 6
    assert found.reflection_group_order == 24
    points[-1] += [0.2, -0.5, 0.4, 0.8]
    assert detect_nd(points).hyperplanes == ()
    assert detect_nd(points).reflection_group_order == 1


def test_masses_break_it() -> None:
    """Two opposite corners that weigh more leave the centre where it is, and the six mirrors through them."""
    masses = np.ones(16)
    assert len(detect_nd(Shape.of(cube(4), weights=masses)).hyperplanes) == 16
    masses[[0, 15]] = 2.0
    assert len(detect_nd(Shape.of(cube(4), weights=masses)).hyperplanes) == 6


def test_a_normal_a_little_off_is_put_right() -> None:
    rng = np.random.default_rng(8)
    points = mirrored(4, 30, rng)
    cloud = Points(points=points, masses=np.ones(30), diameter=6.0)
    off = np.array([np.cos(0.03), np.sin(0.03), 0.0, 0.0])
    assert cloud.miss(off) > 1e-3
    assert cloud.miss(cloud.refined(off)) < 1e-12


def test_points_in_a_plane_of_four_dimensions_leave_hyperplanes_free() -> None:
    found = detect_nd(placed(np.pad(polygon(4), ((0, 0), (0, 2))), np.random.default_rng(2)))
    assert len(found.hyperplanes) == 4
    assert found.reflection_group_order is None
    assert "the points span 2 dimensions less than the space" in found.incomplete
    flat = detect_nd(placed(np.pad(polygon(4), ((0, 0), (0, 1))), np.random.default_rng(2)))
    assert len(flat.hyperplanes) == 5
    assert flat.reflection_group_order == 16
    assert flat.incomplete == ""


def faces_of_a_cube(dim: int, count: int, rng: np.random.Generator) -> Array:
    points = rng.uniform(-1.0, 1.0, (count, dim))
    points[np.arange(count), rng.integers(dim, size=count)] = rng.choice([-1.0, 1.0], count)
    return points


def faces_of_a_simplex(dim: int, count: int, rng: np.random.Generator) -> Array:
    shares = np.insert(rng.dirichlet(np.ones(dim), count), 0, 0.0, axis=1)
    return rng.permuted(shares, axis=1) @ simplex(dim)


def outline(corners: int, count: int, rng: np.random.Generator) -> Array:
    ends, first, along = polygon(corners), rng.integers(corners, size=count), rng.random(count)[:, None]
    return ends[first] * (1 - along) + ends[(first + 1) % corners] * along


SAMPLES = {
    "tesseract": (lambda n, rng: faces_of_a_cube(4, n, rng), 16, 384),
    "4-simplex": (lambda n, rng: faces_of_a_simplex(4, n, rng), 10, 120),
    "5-cube": (lambda n, rng: faces_of_a_cube(5, n, rng), 25, 3840),
    "square x triangle": (lambda n, rng: np.hstack([outline(4, n, rng), 1.3 * outline(3, n, rng)]), 7, 48),
    # Moments of orders 2 to 4 take these for round.
    "24 blobs": (lambda n, rng: roots_of_d(4)[rng.integers(24, size=n)] + 0.07 * rng.normal(size=(n, 4)), 24, 1152),
    "pentagon x triangle": (lambda n, rng: np.hstack([outline(5, n, rng), outline(3, n, rng)]), 8, 60),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_all_hyperplanes_of_samples_with_noise(name: str) -> None:
    draw, count, order = SAMPLES[name]
    rng = np.random.default_rng(len(name))
    points = draw(120_000, rng)
    found = detect_nd(placed(points + 0.01 * rng.normal(size=points.shape), rng))
    assert not found.undetermined
    assert len(found.hyperplanes) == count
    assert found.reflection_group_order == order
    assert "second moments coincide" in found.incomplete


def test_samples_of_a_box_are_all_there_is() -> None:
    rng = np.random.default_rng(4)
    found = detect_nd(placed(rng.uniform(-1.0, 1.0, (60_000, 4)) * [1.0, 1.4, 2.0, 2.6], rng))
    assert len(found.hyperplanes) == 4
    assert found.reflection_group_order == 16
    assert found.incomplete == ""


@pytest.mark.parametrize("dim", [4, 5])
def test_samples_whose_second_moments_coincide_without_symmetry(dim: int) -> None:
    rng = np.random.default_rng(dim)
    points = blobs(dim, 40_000, rng, mirror=False)
    points -= points.mean(axis=0)
    found = detect_nd(points @ np.linalg.cholesky(np.linalg.inv(np.cov(points.T))))
    assert not found.undetermined
    assert found.hyperplanes == ()
    assert "second moments coincide" in found.incomplete


@pytest.mark.slow
def test_round_samples_list_none_of_their_hyperplanes() -> None:
    rng = np.random.default_rng(5)
    ball = rng.normal(size=(120_000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    found = detect_nd(placed(np.column_stack([ball, rng.uniform(-2.0, 2.0, 120_000)]), rng))
    assert len(found.hyperplanes) == 1
    assert found.reflection_group_order is None
    assert "a hyperplane can turn and still hold, with normals in 3 dimensions" in found.incomplete
    assert detect_nd(rng.normal(size=(2000, 4))).hyperplanes == ()


@pytest.mark.slow
def test_what_noise_may_turn_is_not_listed_in_one_place() -> None:
    """At this noise moments of order 6 see the hexagon in some of its lines only: all of these are listed, or none."""
    rng = np.random.default_rng(18)
    points = np.hstack([outline(5, 120_000, rng), outline(6, 120_000, rng)])
    found = detect_nd(placed(points + 0.01 * rng.normal(size=points.shape), rng))
    turns = "can turn and still hold, with normals in 2 dimensions" in found.incomplete
    assert len(found.hyperplanes) == (5 if turns else 11)


def test_what_others_imply_is_held_against_the_samples() -> None:
    """A cube and a blob near its diagonal: two hyperplanes that noise lets pass imply one that it does not."""
    rng = np.random.default_rng(3)
    box, blob = rng.uniform(-1.0, 1.0, (35_000, 4)), rng.uniform(-0.3, 0.3, (5000, 4)) + rng.uniform(0.6, 1.0, 4)
    found = detect_nd(np.concatenate([box, blob]))
    assert all(h.asymmetry <= np.hypot(0.002, 3.0 * h.noise) for h in found.hyperplanes)
    assert found.reflection_group_order is None
    assert "take one another to others that do not hold" in found.incomplete


# --- parts of it ------------------------------------------------------------------------------------------------------


def test_the_gradient_of_the_odd_energy_is_that_of_differences() -> None:
    rng = np.random.default_rng(6)
    points = mirrored(4, 200, rng) @ pose(4, rng).T
    moments = shape_moments(Shape.of(points), 6)
    for orders in (samples.LOW, samples.HIGH):
        tensors = samples.block(moments, orders).whole
        normal, step = pose(4, rng)[0], 1e-6
        tangent = np.linalg.svd(normal[None])[2][1]
        ends = [samples.odd(tensors, np.cos(s) * normal + np.sin(s) * tangent)[0] for s in (step, -step)]
        energy, slope = samples.odd(tensors, normal)
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slope @ tangent, rel=1e-5)
        flip = np.eye(4) - 2 * np.outer(normal, normal)
        image = [t - _turned(t, flip) for t in tensors]
        assert energy == pytest.approx(0.25 * sum(float((t**2).sum()) for t in image))


def _turned(tensor: Array, matrix: Array) -> Array:
    for _ in range(tensor.ndim):
        tensor = np.tensordot(tensor, matrix, (0, 1))
    return tensor


def test_neighbours_contradict_what_moments_let_pass() -> None:
    """Moments to order 4 take 24 blobs for round; the points do not."""
    rng = np.random.default_rng(7)
    points = roots_of_d(4)[rng.integers(24, size=20_000)] + 0.05 * rng.normal(size=(20_000, 4))
    ask = samples.Neighbours(points, 2.9, rng)
    assert not ask.contradict(np.array([1.0, 1.0, 0.0, 0.0]) / np.sqrt(2.0), 0.02)
    assert ask.contradict(np.array([1.0, 0.4, 0.0, 0.0]) / np.sqrt(1.16), 0.02)


def simple_roots(name: str) -> list[Array]:
    kind, rank = name[0], int(name[1:])
    eye = np.eye(rank + 1)
    chain = [(eye[k] - eye[k + 1]) / np.sqrt(2.0) for k in range(rank)]
    last = {"A": chain[-1], "B": eye[rank - 1], "D": (eye[rank - 2] + eye[rank - 1]) / np.sqrt(2.0)}[kind]
    return [*chain[:-1], last]


@pytest.mark.parametrize(("name", "count"), [("A7", 28), ("B3", 9), ("B6", 36), ("D5", 20), ("D8", 56)])
def test_simple_roots_close_and_are_counted(name: str, count: int) -> None:
    normals, closed = closed_under_reflection(simple_roots(name), lambda n: n, 1e-6)
    assert closed
    assert len(normals) == count
    kind, rank = name[0], int(name[1:])
    factor = {"A": rank + 1, "B": 2**rank, "D": 2 ** (rank - 1)}[kind]
    assert reflection_group_order(normals) == factor * math.factorial(rank)


def test_what_does_not_close_is_said() -> None:
    angle = 1.0  # No rational part of a turn: without end.
    pair = [np.array([1.0, 0.0]), np.array([np.cos(angle), np.sin(angle)])]
    normals, closed = closed_under_reflection(pair, lambda n: n, 1e-3)
    assert not closed
    assert len(normals) == MOST
    assert closed_under_reflection(pair, lambda _: None, 1e-3) == (pair, False)
    assert reflection_group_order(pair) is None
    assert reflection_group_order([]) == 1
