"""Scans of surveyors: places, poses and fields as they were written, and no point of a damaged file."""

import gzip
import io
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from symrefine.errors import InputError
from symrefine.load import load
from symrefine.shape import Shape

RNG = np.random.default_rng(0)
POINTS = np.round(RNG.random((80, 3)) * [10, 10, 2], 3)
CLASSES = RNG.integers(0, 5, 80)
COLOURS = RNG.integers(0, 65535, (80, 3))
OFFSET = np.array([1e6, 5e6, 100.0])


def las(packed: bool, version: str = "1.2", fmt: int = 3) -> bytes:
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=fmt, version=version)
    header.offsets, header.scales = OFFSET, [1e-3] * 3
    cloud = laspy.LasData(header)
    cloud.xyz = POINTS + OFFSET
    cloud.classification = CLASSES
    cloud.red, cloud.green, cloud.blue = COLOURS.T
    stream = io.BytesIO()
    cloud.write(stream, do_compress=packed)
    return stream.getvalue()


def e57(path: Path, *poses: tuple[float, ...], colour: bool = False) -> bytes:
    pye57 = pytest.importorskip("pye57")
    columns = {f"cartesian{axis}": POINTS[:, k] for k, axis in enumerate("XYZ")}
    columns |= {"intensity": CLASSES.astype(np.float64)}
    if colour:
        columns |= {f"color{name}": np.full(80, 9, dtype=np.uint8) for name in ("Red", "Green", "Blue")}
    writer = pye57.E57(str(path), mode="w")
    for number, (w, z, *place) in enumerate(poses):
        writer.write_scan_raw(columns, name=f"{number}", rotation=np.array([w, 0, 0, z]), translation=np.array(place))
    writer.close()
    return path.read_bytes()


def loaded(folder: Path, data: bytes, name: str, **options: object) -> Shape:
    (folder / name).write_bytes(data)
    return load(folder / name, **options)


def refusal(folder: Path, data: bytes, name: str) -> str:
    with pytest.raises(InputError) as caught:
        loaded(folder, data, name)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert "\n" not in message
    return message


@pytest.mark.parametrize(("version", "fmt"), [("1.2", 3), ("1.4", 7)])
@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_las(tmp_path: Path, name: str, version: str, fmt: int) -> None:
    shape = loaded(tmp_path, las(name == "a.laz", version, fmt), name, labels="classification")
    np.testing.assert_allclose(shape.points, POINTS + OFFSET, rtol=0, atol=1e-8)
    assert np.array_equal(shape.labels, CLASSES)
    assert np.array_equal(load(tmp_path / name, weights="classification").weights, CLASSES)
    assert len(np.unique(load(tmp_path / name, labels="color").labels)) > 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_las_is_refused_wherever_it_is_cut(tmp_path: Path, name: str) -> None:
    data = las(name == "a.laz")
    for size in range(1, len(data), 7 if name == "a.las" else len(data) // 12):  # a process for each of the latter
        refusal(tmp_path, data[:size], name)


def test_las_whose_header_lies(tmp_path: Path) -> None:
    data = las(packed=False)
    for points in (79, 81, 0):
        changed = data[:107] + points.to_bytes(4, "little") + data[111:]
        assert f"the header declares {points} points of 34 bytes, {34 * points} in all; 2720 are there" in refusal(
            tmp_path, changed, "a.las"
        )
    for packed in (False, True):
        data = las(packed)
        changed = data[:107] + (2**31).to_bytes(4, "little") + data[111:]
        told = "bytes once they are read; at most 8,388,608 of a file of" if packed else "2720 are there"
        assert told in refusal(tmp_path, changed, "a.laz")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_damaged_las_never_shows_as_a_foreign_error(tmp_path: Path, name: str) -> None:
    data = las(name == "a.laz")
    rng = np.random.default_rng(1)
    for _ in range(300 if name == "a.las" else 15):
        broken = bytearray(data)
        broken[rng.integers(len(data))] = rng.integers(256)
        with suppress(InputError):
            loaded(tmp_path, bytes(broken), name)


def test_e57_poses_and_viewpoints(tmp_path: Path) -> None:
    half = (0.0, 1.0)  # half a turn about z
    data = e57(tmp_path / "a.e57", (1.0, 0.0, 0.0, 0.0, 0.0), (*half, 1.0, 2.0, 3.0), colour=True)
    for name in ("b.e57", "b.e57.gz"):
        shape = loaded(tmp_path, gzip.compress(data) if name.endswith("gz") else data, name, weights="intensity")
        # pye57 writes coordinates in single precision.
        expected = np.concatenate([POINTS, POINTS * [-1, -1, 1] + [1, 2, 3]])
        np.testing.assert_allclose(shape.points, expected, rtol=0, atol=1e-6)
        assert np.array_equal(shape.viewpoint, np.repeat([[0.0, 0, 0], [1, 2, 3]], 80, axis=0))
        assert np.array_equal(shape.weights, np.tile(CLASSES, 2))
    assert loaded(tmp_path, data, "b.e57", labels="color").labels.tolist() == [0] * 160


def test_an_e57_whose_pose_tells_nothing(tmp_path: Path) -> None:
    assert loaded(tmp_path, e57(tmp_path / "a.e57", (1.0, 0.0, 0.0, 0.0, 0.0)), "b.e57").viewpoint is None


def test_e57_is_refused_whatever_byte_is_wrong(tmp_path: Path) -> None:
    data = e57(tmp_path / "a.e57", (1.0, 0.0, 0.0, 0.0, 0.0))
    rng = np.random.default_rng(2)
    for _ in range(60):
        broken = bytearray(data)
        broken[rng.integers(len(data))] ^= 0x55
        assert "not a whole E57 file: " in refusal(tmp_path, bytes(broken), "a.e57")
    for size in (1, 10, 48, 1000, len(data) - 1):
        refusal(tmp_path, data[:size], "a.e57")
