"""Volumes in space: where the header puts them, with the symmetry that was put into them, and no damaged voxel."""

import bz2
import gzip
import io
import logging
import sys
import tracemalloc
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from symrefine.cli import invoke
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.geometry import line_angle_rad
from symrefine.load import load, volume
from symrefine.shape import Shape

# A turn that no axis of the grid knows, with determinant +1.
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
SIZE = 48
AFFINE = np.array([[-2.0, 0, 0, 90], [0, 0, 3, -7], [0, 1.5, 0, 11], [0, 0, 0, 1]])


def blobs(parts: list[tuple[list[float], list[float], float]], size: int = SIZE) -> np.ndarray:
    """Sum of Gaussians, each a centre, its widths and a height, in a cube from -1 to 1 that is turned."""
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1) @ TURN
    values = sum(h * np.exp(-0.5 * (((grid - c) / np.array(s)) ** 2).sum(axis=-1)) for c, s, h in parts)
    return np.asarray(values, dtype=np.float32)


def orbit(turns: list[np.ndarray]) -> list[tuple[list[float], list[float], float]]:
    base = [([0.42, 0.05, 0.12], 0.11, 1.0), ([0.25, 0.22, -0.2], 0.09, 0.8), ([0.2, -0.1, 0.35], 0.1, 0.6)]
    return [(list(turn @ np.array(c)), [w] * 3, h) for turn in turns for c, w, h in base]


def about_z(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])


THIRDS = [about_z(2 * np.pi * k / 3) for k in range(3)]
HALVES = [np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])]
HEAD = [([0, 0, 0], [0.28, 0.36, 0.3], 1.0), ([0, 0.36, -0.05], [0.06, 0.1, 0.08], 0.8),
        ([0, -0.2, 0.15], [0.2, 0.15, 0.2], 0.7)] + [
    part for s in (-1, 1) for part in (([s * 0.3, 0.02, -0.02], [0.05, 0.08, 0.1], 0.8),
                                       ([s * 0.13, 0.3, 0.1], [0.06, 0.05, 0.05], -0.5))
]  # fmt: skip
BALL = blobs([([0.1, 0, 0], [0.3, 0.3, 0.3], 1.0)], 16)


def nii(values: np.ndarray, affine: np.ndarray = AFFINE) -> bytes:
    nibabel = pytest.importorskip("nibabel")
    return nibabel.Nifti1Image(values, affine).to_bytes()


def nrrd(values: np.ndarray, **header: object) -> bytes:
    module = pytest.importorskip("nrrd")
    stream = io.BytesIO()
    module.write(stream, values, {str(k).replace("_", " "): v for k, v in header.items()}, index_order="F")
    return stream.getvalue()


def loaded(folder: Path, data: bytes, name: str, **options: object) -> Shape:
    (folder / name).write_bytes(data)
    return load(folder / name, **options)


def refusal(folder: Path, data: bytes, name: str, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        loaded(folder, data, name, **options)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert "\n" not in message
    return message


def saved_mrc(folder: Path, values: np.ndarray, **header: object) -> bytes:
    mrcfile = pytest.importorskip("mrcfile")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with mrcfile.new(folder / "made.mrc", overwrite=True) as made:
            made.set_data(values)
            made.voxel_size = header.pop("voxel_size", 1.0)
            for name, value in header.items():
                made.header[name] = value
    return (folder / "made.mrc").read_bytes()


# What is written is read.


def test_the_affine_map_places_voxels(tmp_path: Path) -> None:
    values = np.zeros((5, 6, 7), dtype=np.float32)
    values[2, 3, 4], values[1, 1, 1] = 8.0, 2.0
    expected = np.array([[1, 1, 1, 1], [2, 3, 4, 1]]) @ AFFINE[:3].T
    directions = {
        "space": "left-posterior-superior",
        "space_directions": AFFINE[:3, :3].T,
        "space_origin": AFFINE[:3, 3],
    }
    files = {"a.nii": nii(values), "a.nii.gz": gzip.compress(nii(values)), "a.nrrd": nrrd(values, **directions)}
    for name, data in files.items():
        shape = loaded(tmp_path, data, name, measure="solid")
        np.testing.assert_allclose(shape.points, expected, atol=1e-5)
        np.testing.assert_allclose(shape.weights, [0.25, 1.0], atol=1e-6)


def test_nrrd_encodings_and_types(tmp_path: Path) -> None:
    for encoding in ("raw", "gzip", "bzip2"):
        for dtype in (np.uint8, np.int16, ">i2", np.float32, np.float64):
            values = (100 * BALL).astype(dtype)
            shape = loaded(tmp_path, nrrd(values, encoding=encoding, spacings=[1.0, 1, 2]), "a.nrrd", measure="solid")
            again = loaded(tmp_path, nii(values.astype(np.float32), np.diag([1.0, 1, 2, 1])), "a.nii", measure="solid")
            np.testing.assert_allclose(shape.points, again.points, atol=1e-12)
            np.testing.assert_allclose(shape.weights, again.weights)


def test_mrc_axes_cell_and_origin(tmp_path: Path) -> None:
    values = np.zeros((5, 6, 7), dtype=np.float32)  # sections, rows, columns: z y x
    values[2, 3, 4], values[1, 1, 1] = 8.0, 2.0
    shape = loaded(tmp_path, saved_mrc(tmp_path, values, voxel_size=2.5), "a.mrc", measure="solid")
    np.testing.assert_allclose(shape.points, [[2.5, 2.5, 2.5], [10, 7.5, 5]])
    data = saved_mrc(tmp_path, values, voxel_size=2.5, origin=(10.0, 20.0, 30.0), nxstart=3)
    np.testing.assert_allclose(loaded(tmp_path, data, "a.map", measure="solid").points[1], [20, 27.5, 35])
    data = saved_mrc(tmp_path, values, voxel_size=0.0, nxstart=3)
    np.testing.assert_allclose(loaded(tmp_path, data, "a.map", measure="solid").points[1], [7, 3, 2])
    # Columns run along z, rows along x, sections along y; the numbers of samples and the cell follow x, y, z.
    data = saved_mrc(tmp_path, values, mapc=3, mapr=1, maps=2, mx=6, my=5, mz=7, cella=(6.0, 5.0, 7.0), nxstart=5)
    np.testing.assert_allclose(loaded(tmp_path, data, "a.map", measure="solid").points[1], [3, 2, 4 + 5])


def test_the_surface_of_a_ball_under_a_sheared_map(tmp_path: Path) -> None:
    """Points, normals and areas of an ellipsoid, against its formulas."""
    size, radius = 40, 13.0
    middle = np.array([19.63, 19.71, 19.13])  # beside the grid: one that it repeats would meet it in steps
    distance = np.linalg.norm(np.stack(np.indices((size,) * 3), axis=-1) - middle, axis=-1)
    affine = np.eye(4)
    affine[:3, :3] = np.array([[1.0, 0.3, 0], [0, 2.0, 0], [0, -0.4, 0.5]])
    values = np.clip(radius - distance + 3.0, 0.0, 6.0).astype(np.float32)
    shape = loaded(tmp_path, nii(values, affine), "a.nii", threshold=0.5)
    inverse = np.linalg.inv(affine[:3, :3])
    round_again = shape.points @ inverse.T - middle
    np.testing.assert_allclose(np.linalg.norm(round_again, axis=1), radius, atol=0.05)  # linear between voxels
    normals = round_again @ inverse / np.linalg.norm(round_again @ inverse, axis=1)[:, None]
    assert np.abs(np.abs((normals * shape.normals).sum(axis=1)) - 1.0).max() < 1e-3
    assert np.linalg.norm(shape.weights @ shape.points / shape.weights.sum() - middle @ affine[:3, :3].T) < 0.1
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(200000, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    stretch = np.linalg.det(affine[:3, :3]) * np.linalg.norm(sphere @ inverse, axis=1)
    assert shape.weights.sum() == pytest.approx(4 * np.pi * radius**2 * stretch.mean(), rel=0.01)


def test_series_are_chosen_from(tmp_path: Path) -> None:
    series = np.stack([BALL, np.roll(BALL, 3, axis=0)], axis=-1)
    data = nii(series, np.eye(4))
    assert "holds 2 volumes; choose one with frame (--frame), from 0 to 1" in refusal(tmp_path, data, "a.nii")
    first, second = (load(tmp_path / "a.nii", frame=k) for k in (0, 1))
    np.testing.assert_allclose(np.average(second.points - first.points, axis=0), [3, 0, 0], atol=1e-5)
    assert loaded(tmp_path, nii(BALL[..., None]), "a.nii").points.shape == first.points.shape


# Symmetry.


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize(
    ("parts", "group"), [(HEAD, "Cs"), (orbit(THIRDS), "C3"), (orbit(HALVES), "D2")], ids=["head", "C3", "D2"]
)
def test_the_symmetry_of_a_volume(tmp_path: Path, parts: list, group: str, noise: float) -> None:
    values = blobs(parts) + np.float32(noise) * np.random.default_rng(0).normal(size=(SIZE,) * 3).astype(np.float32)
    found = detect(loaded(tmp_path, nii(values, np.diag([0.5, 0.5, 0.5, 1])), "a.nii"))
    assert found.point_group == group
    assert found.confidence > 0.9
    middle = np.full(3, 0.5 * (SIZE - 1) / 2)
    if group == "Cs":
        plane = found.planes[0].plane
        assert line_angle_rad(plane.normal, TURN[:, 0]) < np.radians(1.5 if noise == 0.0 else 3.0)
        assert abs(plane.signed_distance(middle)) < 0.01 * found.diagonal
    elif group == "C3":
        assert line_angle_rad(found.axes[0].axis.direction, TURN[:, 2]) < np.radians(1.5)


def test_voxels_weigh_as_pixels_do(tmp_path: Path) -> None:
    data = nii(BALL, np.eye(4))
    solid = loaded(tmp_path, data, "a.nii", measure="solid")
    np.testing.assert_allclose(
        np.average(solid.points, axis=0, weights=solid.weights),
        (np.array([0.1, 0, 0]) @ TURN.T + 1.0) * 8.0 - 0.5,
        atol=0.1,
    )
    binary = loaded(tmp_path, data, "a.nii", measure="solid", threshold="otsu")
    assert set(binary.weights.tolist()) == {1.0}
    inverted = loaded(tmp_path, data, "a.nii", measure="solid", threshold="otsu", invert=True)
    assert len(binary.points) + len(inverted.points) == BALL.size
    assert "invert leaves a surface as it is; take measure 'solid'" in refusal(tmp_path, data, "a.nii", invert=True)
    assert invoke(["detect", str(tmp_path / "a.nii"), "--threshold", "0.4", "--json", "-"]) == 0


def test_large_volumes_are_averaged_and_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    data = nii(blobs(HEAD), np.diag([1.0, 1, 2, 1]))
    whole, solid = (loaded(tmp_path, data, "a.nii", measure=m) for m in ("surface", "solid"))
    monkeypatch.setattr(volume, "ENOUGH", 1500)
    with caplog.at_level(logging.INFO):
        few, blocks = (load(tmp_path / "a.nii", measure=m) for m in ("surface", "solid"))
    assert all("voxels became one, by their mean" in record.message for record in caplog.records)
    assert len(caplog.records) == 2
    for coarse, fine in ((few, whole), (blocks, solid)):
        assert len(coarse.points) <= 1500 < len(fine.points)
        shift = np.average(coarse.points, axis=0, weights=coarse.weights) - np.average(
            fine.points, axis=0, weights=fine.weights
        )
        assert np.linalg.norm(shift) < (0.01 if coarse is few else 1e-9) * np.linalg.norm(np.ptp(fine.points, axis=0))
    assert blocks.weights.sum() == pytest.approx(solid.weights.sum())
    assert few.weights.sum() == pytest.approx(whole.weights.sum(), rel=0.05)


@pytest.mark.parametrize("measure", ["surface", "solid"])
@pytest.mark.parametrize("most", [pytest.param(10**6, marks=pytest.mark.slow), 700])
def test_slabs_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measure: str, most: int) -> None:
    """Volumes whose longest axis is any of the three, of numbers of any type and order, as one slab and as many.

    To the last bit, but for means over blocks in single precision, which are summed in the order of the memory.
    """
    away = 1e-5 if measure == "surface" and most < 10**6 else 0.0
    body = blobs(HEAD)
    whole = {"a.nii": nii((1000 * body[:37, :, 5:]).astype(np.int16)), "b.nrrd": nrrd(body[:, 3:40, :41].astype(">f8"))}
    whole |= {"c.mrc": saved_mrc(tmp_path, np.ascontiguousarray(body[:29, :31]), mapc=3, mapr=1, maps=2)}
    whole |= {"d.nrrd": nrrd((200 * body[9:, 5:]).clip(0, 255).astype(np.uint8), encoding="gzip")}
    monkeypatch.setattr(volume, "ENOUGH", most)
    options = [{}, {"threshold": 0.4}] + [{"threshold": "otsu"}, {"invert": True}] * (measure == "solid")
    for name, data in whole.items():
        for given in options:
            monkeypatch.setattr(volume, "_SLAB", 2**22)
            one = loaded(tmp_path, data, name, measure=measure, **given)
            monkeypatch.setattr(volume, "_SLAB", 5000)
            many = load(tmp_path / name, measure=measure, **given)
            for attribute in ("points", "weights", "normals")[: 2 + (measure == "surface")]:
                expected = getattr(one, attribute)
                atol = away * np.abs(expected).max()
                np.testing.assert_allclose(getattr(many, attribute), expected, rtol=0.0, atol=atol, err_msg=name)


@pytest.mark.parametrize("measure", ["surface", "solid"])
@pytest.mark.parametrize(
    "name", ["a.nii", "a.nrrd", *(pytest.param(n, marks=pytest.mark.slow) for n in ("a.nii.gz", "a.mrc"))]
)
def test_of_a_volume_little_is_held_beside_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measure: str, name: str
) -> None:
    monkeypatch.setattr(volume, "_SLAB", 2**14)
    monkeypatch.setattr(volume, "ENOUGH", 4000)
    values = np.pad(blobs(HEAD), 40)
    made = {"nii": nii(values), "nrrd": nrrd(values, encoding="raw"), "mrc": saved_mrc(tmp_path, values)}
    data = gzip.compress(made["nii"]) if name.endswith(".gz") else made[name.partition(".")[2]]
    loaded(tmp_path, data, name, measure=measure)  # so that what is imported is not counted
    tracemalloc.start()
    load(tmp_path / name, measure=measure)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1.5 * values.nbytes, most / values.nbytes


def test_intensities_that_single_precision_cannot_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(volume, "_SLAB", 300)
    wide = BALL.copy()
    wide[0, 0, 0], wide[1, 1, 1] = -3e38, 3e38
    assert "intensities run from -3e+38 to 3e+38, farther than single precision goes" in refusal(
        tmp_path, nii(wide), "a.nii"
    )
    wide = BALL.astype(np.float64)
    wide[9, 2, 15], wide[9, 3, 0], wide[11, 0, 0] = 1e300, np.nan, -np.inf
    told = refusal(tmp_path, nrrd(wide), "a.nrrd")
    assert "voxel [9, 2, 15] is inf (3 such of 4096); intensities must be finite" in told


# Damage.


def files(folder: Path) -> dict[str, bytes]:
    return {"a.nii": nii(BALL), "a.mrc": saved_mrc(folder, BALL), "a.nrrd": nrrd(BALL, encoding="raw"),
            "b.nrrd": nrrd(BALL, encoding="gzip")}  # fmt: skip


@pytest.mark.parametrize("name", ["a.nii", "a.mrc", "a.nrrd", "b.nrrd"])
def test_volumes_are_refused_wherever_they_are_cut(tmp_path: Path, name: str) -> None:
    data = files(tmp_path)[name]
    for size in range(1, len(data), 61):
        refusal(tmp_path, data[:size], name)
    refusal(tmp_path, data[:-1], name)
    refusal(tmp_path, data + b"x", name)


@pytest.mark.parametrize(
    "name", ["a.nii", "a.nrrd", *(pytest.param(n, marks=pytest.mark.slow) for n in ("a.mrc", "b.nrrd"))]
)
def test_damage_never_shows_as_a_foreign_error(tmp_path: Path, name: str) -> None:
    data = files(tmp_path)[name]
    rng = np.random.default_rng(1)
    for _ in range(300):
        broken = bytearray(data)
        broken[rng.integers(400 if rng.random() < 0.8 else len(data))] = rng.integers(256)
        with suppress(InputError):
            loaded(tmp_path, bytes(broken), name)


def test_what_is_no_volume(tmp_path: Path) -> None:
    bad = BALL.copy()
    bad[1, 2, 3] = np.nan
    assert "voxel [1, 2, 3] is nan (1 such of 4096)" in refusal(tmp_path, nii(bad), "a.nii")
    assert "all 4096 voxels have the same intensity 0" in refusal(tmp_path, nii(0 * BALL), "a.nii")
    assert "has 16 x 16 x 1 voxels; expected a grid of three axes" in refusal(tmp_path, nii(BALL[:, :, :1]), "a.nii")
    flat = bytearray(nii(BALL))
    flat[296:312] = bytes(16)  # srow_y
    assert "expected three that span space" in refusal(tmp_path, bytes(flat), "a.nii")
    assert "values of type complex64" in refusal(tmp_path, nii(BALL.astype(np.complex64)), "a.nii")
    assert "angles of the cell are [90.0, 90.0, 120.0]" in refusal(
        tmp_path, saved_mrc(tmp_path, BALL, cellb=(90.0, 90.0, 120.0)), "a.mrc"
    )
    assert "holds 16 pictures, no volume" in refusal(tmp_path, saved_mrc(tmp_path, BALL, ispg=0, mz=1), "a.mrc")
    assert "MAPC MAPR MAPS are [1, 1, 2]" in refusal(tmp_path, saved_mrc(tmp_path, BALL, mapr=1, maps=2), "a.mrc")
    text = nrrd(BALL, encoding="raw")
    assert "has 'data file': expected header and data" in refusal(
        tmp_path, text.replace(b"encoding", b"data file: x.raw\nencoding"), "a.nrrd"
    )
    assert "encoding is 'hex'; expected raw, gzip or bzip2" in refusal(
        tmp_path, text.replace(b": raw", b": hex"), "a.nrrd"
    )
    assert "labels and weights apply to meshes, clouds and molecules only" in refusal(
        tmp_path, nii(BALL), "a.nii", labels="x"
    )


def test_headers_cannot_ask_for_memory(tmp_path: Path) -> None:
    data = bytearray(nii(BALL))
    data[42:48] = np.array([30000] * 3, dtype="<i2").tobytes()
    assert "108000000000000 bytes; 16384 follow it" in refusal(tmp_path, bytes(data), "a.nii")
    data = bytearray(saved_mrc(tmp_path, BALL))
    data[:12] = np.array([2**20] * 3, dtype="<i4").tobytes()
    assert "has 1048576 x 1048576 x 1048576 voxels, which 17408 bytes cannot hold" in refusal(
        tmp_path, bytes(data), "a.mrc"
    )
    for encoding, packed in (("gzip", gzip.compress(bytes(10**7))), ("bzip2", bz2.compress(bytes(10**7)))):
        head = nrrd(BALL, encoding=encoding).partition(b"\n\n")[0]
        assert "16 x 16 x 16 values of float32, 16384 bytes; " in refusal(tmp_path, head + b"\n\n" + packed, "a.nrrd")
        big = head.replace(b"sizes: 16 16 16", b"sizes: 9999 9999 9999")
        assert "at most 134,217,728 in all" in refusal(tmp_path, big + b"\n\n" + packed, "a.nrrd")


@pytest.mark.parametrize(("name", "package"), [("a.nii", "nibabel"), ("a.map", "mrcfile"), ("a.nrrd", "nrrd")])
def test_missing_libraries_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, "mrcfile.mrcinterpreter", raising=False)
    assert "is not installed: pip install 'symrefine[volumes]'" in refusal(tmp_path, b"x" * 2000, name)
