"""What an object stands on: found where it is told that there is one, and no evidence of anything but what it hides."""

import json

import numpy as np
import pytest

from experiments.objects import damage
from experiments.objects.built_symmetry import specimen
from experiments.objects.poses import Pose
from experiments.objects.shapes import box, join, mug, revolve, sample, stool, table
from experiments.studies import damaged
from symrefine.cli import invoke
from symrefine.detection.measure import floor_under, measure
from symrefine.detection.sketch import MANY, sketched
from symrefine.detection.story import detect
from symrefine.detection.verification import verified
from symrefine.errors import InputError
from symrefine.export.bop import diameter
from symrefine.geometry import Isometry, householder
from symrefine.lengths import object_diagonal
from symrefine.load import load
from symrefine.picture.upright import upright
from symrefine.picture.words import NO_FLOOR, scanned
from symrefine.shape import Shape
from symrefine.stream import Stream
from symrefine.surface.floor import Floor, floor_of
from symrefine.surface.openings import Openings
from symrefine.surface.skin import make_skin

BRICK = join([box((0, 0, 0), (1.0, 0.7, 0.5))])


def standing(mesh, seed, size=1.5):
    """The points of an object on a floor, which of them are the floor's, and the pose of both."""
    rng = np.random.default_rng(seed)
    made, pose = damage.ground(mesh, size, rng), Pose.random(rng)
    return pose.of(made.points), made.strays == 1, pose


@pytest.mark.parametrize("places", [300, 2], ids=["a line", "two places"])
def test_points_on_a_line_stand_on_nothing(places):
    """No three of them make a plane; two places, told many times over, are a line as well."""
    points = np.outer(np.arange(600) % places, [1.0, 2.0, 3.0])
    assert floor_of(points) is None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", [lambda: stool(3), mug, lambda: BRICK])
def test_a_floor_is_found_wherever_it_lies(make, seed):
    points, stray, _ = standing(make(), seed)
    found = floor_of(points)
    on = found.covers(points)
    assert on[stray].mean() > 0.99
    # Of the object what lies in it: feet, a bottom.
    others = points[stray]
    middle = others.mean(axis=0)
    off = np.abs((points - middle) @ np.linalg.svd(others - middle, full_matrices=False)[2][2])
    assert (off[on] <= 2.0 * off[stray].max()).all()
    assert ((points[~on] @ found.normal - found.offset) > 0).mean() > 0.99, "the normal points to the object"


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.006, 0.01, 0.03])
@pytest.mark.parametrize("strays", [0.0, 0.02])
def test_neither_noise_nor_strays_hide_a_floor(noise, strays):
    rng = np.random.default_rng(15)
    low, high = np.array([-1.5, -1.5, 0.0]), np.array([1.5, 1.5, 1.5])
    plane = rng.uniform(low, high, (8000, 3)) * [1.0, 1.0, 0.0]
    cloud = np.concatenate([sample(stool(3), 8000, 0.0, rng), plane])
    cloud = cloud + noise * object_diagonal(stool(3)) * rng.normal(size=cloud.shape)
    cloud = np.concatenate([cloud, rng.uniform(low, high, (round(strays * len(cloud)), 3))])
    found = floor_under(Shape(Pose.random(rng).of(cloud)), "floor")
    assert 7900 < len(found.points) < 11000


@pytest.mark.slow
def test_a_wall_that_meets_the_floor_has_no_end_there():
    """A tower on a plinth, off its middle: where the floor cut the plinth was an open rim, beyond which it could be."""
    vertices, faces = revolve([(0, 0.1), (0.5, 0.1), (0.5, 1.5), (0, 1.5)], 64)
    plinth = revolve([(0, 0), (1, 0), (1, 0.1), (0, 0.1)], 64)
    mesh = join([plinth, (vertices + [0.2, 0.0, 0.0], faces)])
    for seed in range(2):
        found = detect(standing(mesh, seed, size=2.0)[0], outliers="floor")
        assert found.point_group == "Cs"
        assert found.at_least, "nobody saw the bottom"


def test_windows_that_reach_into_a_floor_tell_no_drift():
    """Half of what a window near the floor holds was taken away with it, which moves its middle; the rim lies low."""
    points, _, _ = standing(specimen("shape", "wheel5")[0], 18)
    found = detect(points, outliers="floor")
    assert (found.point_group, found.confidence > 0.95) == ("D5h", True)


def test_what_seems_to_fill_a_volume_has_a_bottom_too():
    """Bars as thick as their noise: without a surface nothing is covered, and D4d falls to C4v, sure."""
    rng, mesh = np.random.default_rng(0), specimen("shape", "crossed4")[0]
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    half = 1.5 * (high - low).max()
    plane = np.column_stack([rng.uniform(-half, half, (27000, 2)), np.full(27000, low[2])])
    plane = plane + [*(0.5 * (low + high)[:2]), 0.0] + 0.01 * mesh.diagonal * rng.normal(size=plane.shape)
    found = detect(np.concatenate([sample(mesh, 9000, 0.01, rng), plane]), outliers="floor")
    assert found.surface.cloud.body == "volume"
    assert found.at_least or found.point_group == "D4d"


def test_a_slanted_cut_through_a_floor_is_none():
    """Of a bowed floor no plane holds more than a cut does, which is filled evenly."""
    rng = np.random.default_rng(16)
    bowed = rng.uniform(-1.5, 1.5, (8000, 3))
    bowed[:, 2] = 0.15 * (bowed[:, :2] ** 2).sum(axis=1) - 0.3
    assert floor_of(np.concatenate([sample(stool(3), 8000, 0.003, rng), bowed])) is None


@pytest.mark.parametrize("make", [lambda: stool(3), mug, table, lambda: BRICK])
def test_the_bottom_of_an_object_is_no_floor(make):
    assert floor_of(sample(make(), 5000, 0.003, np.random.default_rng(1))) is None


def test_what_a_camera_saw_from_below_is_no_floor():
    """The face of a spool that it looks at reaches beyond the rest; of a table it sees what stands on it."""
    points, stray, pose = standing(stool(3), 3)
    up = pose.of(np.eye(3))[2] - pose.of(np.zeros((1, 3)))[0]
    above, below = (points[~stray].mean(axis=0) + side * up for side in (5.0, -5.0))
    assert floor_of(points, np.broadcast_to(above, points.shape)) is not None
    assert floor_of(points, np.broadcast_to(below, points.shape)) is None
    # A view of what stands on it, from beside the table and below, shows nothing of it.
    assert floor_of(points, np.where(stray[:, None], above, below)) is not None
    assert floor_under(Shape(points=points, viewpoint=below), "floor") is None


def test_a_plane_with_something_on_both_sides_is_no_floor():
    points, stray, _ = standing(BRICK, 0)
    middle = points[stray].mean(axis=0)
    assert floor_of(np.concatenate([points, 2.0 * middle - points])) is None


def test_a_floor_without_noise_is_found_where_rounding_leaves_it():
    rng = np.random.default_rng(2)
    plane = np.column_stack([rng.uniform(-2, 2, (4000, 2)), np.zeros(4000)])
    pose = Pose.random(rng)
    cloud = np.concatenate([sample(BRICK, 4000, 0.0, rng) + [0, 0, 0.25], plane])
    for points in (cloud, pose.of(cloud)):
        assert floor_of(points).covers(points)[4000:].all()


def test_a_floor_in_another_frame_holds_the_same_points():
    points, _, _ = standing(stool(3), 3)
    found, center = floor_of(points), points.mean(axis=0)
    other = found.normalised(center, 7.0)
    assert (other.covers((points - center) / 7.0) == found.covers(points)).mean() > 0.9999


@pytest.mark.parametrize(
    ("name", "group"),
    [
        ("stool3", "C3v"),
        pytest.param("bottle", "Cinfv", marks=pytest.mark.slow),
        ("clutter", "C1"),
        pytest.param("bossed_cube", "Oh", marks=pytest.mark.slow),
    ],
)
def test_an_object_has_its_group_on_a_floor_that_is_told(name, group):
    points, stray, _ = standing(specimen("shape", name)[0], 4)
    found = detect(points, outliers="floor")
    assert found.point_group == group
    own, missed = np.zeros(len(points), dtype=bool), stray.copy()
    own[found.outliers] = True
    missed &= ~own
    assert missed.mean() < 0.005
    assert found.outlier_share == pytest.approx(own.mean())
    assert "the floor among them" in scanned(found)
    assert found.floor is not None
    assert not found.no_floor


def test_a_thing_that_stands_clear_of_the_floor_by_the_noise_may_have_more():
    """Half of its bottom is taken for floor, which leaves no border to speak of and moves the middle of the rest."""
    mesh, _ = specimen("shape", "spool")
    made = damage.ground(mesh, 1.1, np.random.default_rng(78))
    lifted = made.points + np.where(made.strays == 0, 0.01 * mesh.diagonal, 0.0)[:, None] * [0.0, 0.0, 1.0]
    found = detect(lifted, outliers="floor")
    assert found.at_least or found.point_group == "Dinfh"


@pytest.mark.parametrize(
    "name", ["chair", *(pytest.param(name, marks=pytest.mark.slow) for name in ("stool3", "clutter", "bossed_cube"))]
)
def test_a_picture_shows_a_thing_as_it_stands(name):
    points, _, pose = standing(specimen("shape", name)[0], 14)
    found = detect(points, outliers="floor")
    assert upright(found, points - found.center)[2] @ pose.turn[:, 2] > 0.999


def test_what_lies_below_a_floor_was_seen_not_to_be_there():
    """A mirror that carries half of a wall below the floor is contradicted by it, and hidden where the floor is."""
    rng = np.random.default_rng(5)
    wall = np.column_stack([rng.uniform(-1, 1, 4000), np.zeros(4000), rng.uniform(0, 1, 4000)])
    cloud = make_skin(wall, rng).local_planes(np.arange(1000))
    none = np.zeros(1000, dtype=bool)
    under = Floor(normal=np.array([0.0, 0.0, 1.0]), offset=0.0, thick=0.01, points=np.empty((0, 3)))
    mirror = Isometry(matrix=householder(np.array([0.0, 0.0, 1.0])), shift=np.array([0.0, 0.0, 0.4]))
    moved = mirror.apply(cloud.points)[None]
    away = moved[..., 2] < -0.05
    opened = Openings(line=none, border=cloud.points[:, 2] < 0.1, evident=True)
    on_floor = Openings(line=none, border=cloud.points[:, 2] < 0.1, evident=True, floor=under)
    assert opened.unseen(cloud, moved, away, 1, 0.02)[away].all(), "an open border hides what lies beyond"
    assert not on_floor.unseen(cloud, moved, away, 1, 0.02)[away].any()
    close = np.abs(moved[..., 2]) < 0.005
    assert on_floor.unseen(cloud, moved, close, 1, 0.02)[close].all()


@pytest.mark.slow
def test_large_clouds_are_sampled_without_their_floor():
    points, stray, _ = standing(stool(3), 6, size=3.0)
    many = np.concatenate([points] * (1 + MANY // len(points)))
    many = many + 1e-3 * object_diagonal(Shape(points)) * np.random.default_rng(6).normal(size=many.shape)
    assert len(many) > MANY
    found = detect(many, outliers="floor")
    assert found.point_group == "C3v"
    assert (np.isin(np.arange(len(many)), found.outliers) == np.tile(stray, len(many) // len(stray))).mean() > 0.98
    sketch = sketched(Stream.of(many))
    streamed = detect(sketch, outliers="floor")
    assert streamed.point_group == "C3v"
    assert len(streamed.outliers) / len(sketch.picked) == pytest.approx(stray.mean(), abs=0.02)
    told = verified(streamed, Stream.of(many)).verified
    assert told.points == pytest.approx((~stray).mean() * len(many), rel=0.05), "a floor is not moved with the object"


def test_where_there_is_no_floor_that_is_said():
    points = sample(stool(3), 5000, 0.003, np.random.default_rng(7))
    found = detect(points, outliers="floor")
    assert found.point_group == "C3v"
    assert found.no_floor
    assert NO_FLOOR[1:] in scanned(found)
    assert not detect(points).no_floor


@pytest.mark.parametrize("shape", [stool(3), Shape(np.random.default_rng(8).normal(size=(40, 3)))])
def test_only_clouds_stand_on_floors(shape):
    with pytest.raises(InputError, match="outliers is 'floor', for a cloud"):
        detect(shape, outliers="floor")
    with pytest.raises(InputError, match="outliers is 'floor', for a cloud"):
        object_diagonal(shape, outliers="floor")


def test_hardly_anything_on_a_floor_is_no_object():
    rng = np.random.default_rng(9)
    plane = np.column_stack([rng.uniform(-2, 2, (4000, 2)), np.zeros(4000)])
    on = sample(BRICK, 100, 0.0, rng) + [0, 0, 0.3]
    assert detect(np.concatenate([plane, on]), outliers="floor").no_floor


def test_points_of_no_weight_make_no_floor():
    rng = np.random.default_rng(10)
    plane = np.column_stack([rng.uniform(-2, 2, (4000, 2)), np.full(4000, -0.25)])
    points = np.concatenate([sample(BRICK, 4000, 0.003, rng), plane])
    weights = np.repeat([1.0, 0.0], 4000)
    found = detect(Shape.of(points, weights=weights), outliers="floor")
    assert found.point_group == "D2h"
    assert found.no_floor


def test_a_length_is_a_share_of_the_object_without_its_floor():
    points, stray, _ = standing(stool(3), 11)
    assert object_diagonal(Shape(points), outliers="floor") == pytest.approx(
        object_diagonal(Shape(points[~stray])), rel=0.02
    )


@pytest.mark.slow
def test_one_view_of_a_thing_on_a_table_shows_its_group():
    rows = [damaged.run(c) for c in damaged.cases(("tabletop",), ("bottle", "chair", "propeller3"), 12)]
    assert all(row.right for row in rows)
    assert sum(row.found for row in rows) >= 0.7 * sum(row.shown for row in rows)


def test_weights_that_make_up_for_density_decide_whatever_the_largest_is():
    """Of a few hundred points of one view the largest stands for as much as one of 190, which said that few decide."""
    (case,) = [c for c in damaged.cases(("tabletop",), ("bottle",), 1402) if c.strength == 1]
    made, _ = damaged.damaged(case)
    found = measure(Shape(points=made.points[made.strays == 0], viewpoint=made.viewpoint[made.strays == 0]))
    assert found.is_thinned
    assert found.shape.weights.sum() / found.shape.weights.max() < 250
    assert found.flaw == ""


@pytest.mark.slow
def test_what_is_written_of_an_object_is_without_its_floor(tmp_path, capsys):
    points, stray, _ = standing(stool(3), 17, size=2.0)
    np.savetxt(tmp_path / "on.xyz", points)
    size = diameter(points[~stray])
    file = ["detect", str(tmp_path / "on.xyz"), "--outliers", "floor", "--bop", str(tmp_path / "models_info.json")]
    assert invoke([*file, "--bop-scale", "1"]) == 0
    assert json.loads((tmp_path / "models_info.json").read_text())["1"]["diameter"] == pytest.approx(size, rel=0.03)
    out = str(tmp_path / "own.ply")
    export = ["export", str(tmp_path / "on.xyz"), "--outliers", "floor", "--to", "canonical", "--out", out]
    assert invoke(export) == 0
    assert diameter(load(out).points) == pytest.approx(size, rel=0.03)
    capsys.readouterr()


@pytest.mark.slow
def test_the_command_tells_the_floor(tmp_path, capsys):
    points, _, _ = standing(stool(3), 13)
    np.savetxt(tmp_path / "on.xyz", points)
    np.savetxt(tmp_path / "off.xyz", sample(stool(3), 5000, 0.003, np.random.default_rng(13)))
    assert invoke(["detect", str(tmp_path / "on.xyz"), "--outliers", "floor"]) == 0
    assert "taken as outliers, the floor among them" in capsys.readouterr().out
    assert invoke(["detect", str(tmp_path / "on.xyz"), "--outliers", "floor", "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)["outliers"]["floor"]
    height = points @ told["normal"] - told["offset"]
    assert np.median(height) > 0
    assert (height > 0).mean() > 0.6
    assert invoke(["detect", str(tmp_path / "off.xyz"), "--outliers", "floor"]) == 0
    assert NO_FLOOR in capsys.readouterr().out
    assert invoke(["detect", str(tmp_path / "on.xyz"), "--json", "-"]) == 0
    assert "if that is a floor, not a face of it, try --outliers floor" in capsys.readouterr().err
    assert invoke(["detect", str(tmp_path / "off.xyz")]) == 0
    assert "floor" not in capsys.readouterr().err
    assert invoke(["detect", str(tmp_path / "on.xyz"), str(tmp_path / "off.xyz"), "--outliers", "floor"]) == 0
    assert f"no floor was found in 1 of 2: {tmp_path / 'off.xyz'}" in capsys.readouterr().err
    assert invoke(["info", str(tmp_path / "on.xyz")]) == 0
    assert "say --outliers floor" in capsys.readouterr().out
    assert invoke(["info", str(tmp_path / "off.xyz"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["cloud"]["floor"] == 0
