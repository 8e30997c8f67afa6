"""Depth images: pixels to points and back, masks, refusals, and what one view of an object tells."""

import json

import numpy as np
import pytest
from PIL import Image

import symrefine
from experiments.objects.shapes import stool
from symrefine.cli import invoke
from symrefine.errors import InputError
from symrefine.geometry import unit
from symrefine.load.depth import load_depth
from symrefine.load.open3d import open3d

INTRINSICS = (300.0, 310.0, 119.5, 89.5)
OPTION = ",".join(map(str, INTRINSICS))


def depth_of(mesh, direction, size=(240, 180)):
    """Depths [H, W] of a mesh from a camera in a direction that looks at its middle; 0 beside it."""
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.points.astype(np.float32), np.asarray(mesh.faces, dtype=np.uint32))
    fx, fy, cx, cy = INTRINSICS
    z = -unit(np.asarray(direction, dtype=float))
    x = unit(np.cross(z, [0.0, 0.0, 1.0]))
    y = np.cross(z, x)
    eye = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0)) - 1.7 * mesh.diagonal * z
    column, row = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    rays = ((column - cx) / fx)[..., None] * x + ((row - cy) / fy)[..., None] * y + z
    cast = np.concatenate([np.broadcast_to(eye, rays.shape), rays], axis=-1).astype(np.float32)
    found = scene.cast_rays(o3d.core.Tensor(cast))["t_hit"].numpy().astype(float)
    return np.where(np.isfinite(found), found, 0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A depth image of a stool in three forms, and its mask."""
    out = tmp_path_factory.mktemp("depth")
    depth = depth_of(stool(5), (0.5, -0.8, 0.35))
    np.save(out / "depth.npy", depth)
    Image.fromarray((1000.0 * depth).round().astype(np.uint16)).save(out / "depth.png")
    Image.fromarray((255 * (depth > 0)).astype(np.uint8)).save(out / "mask.png")
    floor = np.where(depth > 0, depth, 9.0)
    Image.fromarray((1000.0 * floor).round().astype(np.uint16)).save(out / "room.png")
    return out


def test_points_lie_on_the_rays_of_their_pixels(folder):
    depth = np.load(folder / "depth.npy")
    shape = load_depth(folder / "depth.npy", INTRINSICS)
    fx, fy, cx, cy = INTRINSICS
    x, y, z = shape.points.T
    row, column = np.nonzero(depth)
    np.testing.assert_allclose(np.stack([fx * x / z + cx, fy * y / z + cy]), np.stack([column, row]), atol=1e-9)
    np.testing.assert_array_equal(z, depth[row, column])
    assert not shape.viewpoint.any()


def test_units_and_masks(folder):
    metres = load_depth(folder / "depth.png", INTRINSICS)
    millimetres = load_depth(folder / "depth.png", INTRINSICS, depth_scale=1.0)
    np.testing.assert_allclose(millimetres.points, 1000.0 * metres.points)
    room = load_depth(folder / "room.png", INTRINSICS, mask=folder / "mask.png")
    np.testing.assert_array_equal(room.points, metres.points)
    assert len(load_depth(folder / "room.png", INTRINSICS).points) == 240 * 180


def test_pixels_that_measured_nothing_are_no_points(tmp_path):
    depth = np.ones((6, 8))
    depth[0, 0], depth[1, 1], depth[2, 2] = 0.0, np.nan, np.inf
    np.save(tmp_path / "holes.npy", depth)
    assert len(load_depth(tmp_path / "holes.npy", INTRINSICS).points) == 45


@pytest.mark.slow
def test_one_view_of_a_stool_tells_its_group_as_at_least(folder, tmp_path):
    out = tmp_path / "found.json"
    arguments = ["detect", str(folder / "room.png"), "--intrinsics", OPTION, "--mask", str(folder / "mask.png")]
    assert invoke([*arguments, "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert (found["point_group"], found["at_least"]) == ("C5v", True)
    assert found["options"]["intrinsics"] == list(INTRINSICS)
    up = load_depth(folder / "depth.npy", INTRINSICS).points
    assert abs(found["center"][2] - up[:, 2].mean()) < 0.2


@pytest.mark.slow
def test_it_completes_what_it_saw(folder, tmp_path):
    out = tmp_path / "full.npz"
    assert invoke(["complete", str(folder / "depth.png"), "--intrinsics", OPTION, "-o", str(out)]) == 0
    made = np.load(out)
    assert made["inferred"].sum() > 500


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{}/depth.png", "--mask", "{}/mask.png"], "--mask goes with --intrinsics"),
        (["{}/depth.png", "--depth-scale", "1"], "--depth-scale goes with --intrinsics"),
        (["{}/depth.png", "--intrinsics", "1,2,3"], "is not FX,FY,CX,CY in pixels"),
        (["{}/depth.png", "--intrinsics", "0,2,3,4"], "is not FX,FY,CX,CY in pixels"),
        (["{}/depth.png", "--intrinsics", OPTION, "--viewpoint", "0,0,1"], "--viewpoint does not apply"),
        (["{}/depth.png", "--intrinsics", OPTION, "--threshold", "0.5"], "--threshold does not apply"),
        (["{}/depth.jpg", "--intrinsics", OPTION], "expected .npy or .png"),
        (["{}/none.png", "--intrinsics", OPTION], "no such file"),
        (["{}/depth.png", "--intrinsics", OPTION, "--mask", "{}/depth.npy"], "unknown suffix '.npy' of a mask"),
    ],
)
def test_refusals_say_what_is_right(folder, capsys, arguments, said):
    assert invoke(["detect", *(a.format(folder) for a in arguments)]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.ones((4, 4, 3)), r"float64 of shape \(4, 4, 3\); a depth image has real numbers \[H, W\]"),
        (np.ones((4, 4), dtype=bool), "holds bool"),
        (np.array([[1.0, -2.0], [1.0, 1.0]]), "row 0, column 1: depth -2.0; expected 0"),
        (np.zeros((4, 4)), "no pixel has a depth"),
    ],
)
def test_arrays_that_are_no_depths(tmp_path, array, said):
    np.save(tmp_path / "depth.npy", array)
    with pytest.raises(InputError, match=said):
        load_depth(tmp_path / "depth.npy", INTRINSICS)


def test_pictures_that_are_no_depths_or_masks(folder, tmp_path):
    Image.new("RGB", (4, 4)).save(tmp_path / "colour.png")
    with pytest.raises(InputError, match="one channel"):
        load_depth(tmp_path / "colour.png", INTRINSICS)
    with pytest.raises(InputError, match="has 4 x 4 pixels, the depth image 240 x 180"):
        load_depth(folder / "depth.png", INTRINSICS, mask=tmp_path / "colour.png")
    Image.new("L", (240, 180), 200).save(tmp_path / "grey.png")
    with pytest.raises(InputError, match="has pixels of 8 bits, as pictures do"):
        load_depth(tmp_path / "grey.png", INTRINSICS)
    assert load_depth(tmp_path / "grey.png", INTRINSICS, depth_scale=0.01).points[0, 2] == pytest.approx(2.0)
    Image.new("L", (240, 180)).save(tmp_path / "black.png")
    with pytest.raises(InputError, match=r"no pixel in .*black\.png has a depth"):
        load_depth(folder / "depth.png", INTRINSICS, mask=tmp_path / "black.png")
    with pytest.raises(InputError, match="depth_scale is 0"):
        symrefine.load_depth(folder / "depth.png", INTRINSICS, depth_scale=0.0)
    with pytest.raises(InputError, match="intrinsics are"):
        symrefine.load_depth(folder / "depth.png", (1.0, 2.0))


@pytest.mark.slow
def test_a_picture_of_16_bits_may_be_a_depth_image(folder, capsys):
    assert invoke(["detect", str(folder / "depth.png")]) == 0
    told = "depth.png: 16 bits: if this is a depth image, give --intrinsics"
    assert told in capsys.readouterr().err
    assert invoke(["detect", str(folder / "depth.png"), "--intrinsics", OPTION]) == 0
    assert invoke(["detect", str(folder / "mask.png")]) == 0
    assert "16 bits" not in capsys.readouterr().err
