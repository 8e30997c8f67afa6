"""Any format inside gzip: what was packed is read, and neither a cut nor a bomb gets further than one line."""

import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from symrefine.cli import invoke
from symrefine.errors import InputError
from symrefine.load import load, packed

PLY = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
PLY += b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


def npz(**arrays: object) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def picture() -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.pad(np.full((3, 5), 255, dtype=np.uint8), 2)).save(stream, "PNG")
    return stream.getvalue()


FILES = {
    "a.ply": PLY, "a.xyz": b"0 0 0\n1 0 0\n0 1 0\n", "a.csv": b"x,y\n0,0\n1,0\n0,1\n",
    "a.npz": npz(points=np.eye(3)), "a.png": picture(),
}  # fmt: skip


def refusal(path: Path, data: bytes) -> str:
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


@pytest.mark.parametrize("name", FILES)
def test_a_packed_file_is_the_file(tmp_path: Path, name: str) -> None:
    bare, tight = tmp_path / name, tmp_path / f"{name.upper()}.GZ"
    bare.write_bytes(FILES[name])
    half = len(FILES[name]) // 2
    tight.write_bytes(gzip.compress(FILES[name][:half]) + gzip.compress(FILES[name][half:]))  # two members, as pigz
    expected, shape = load(bare), load(tight)
    assert np.array_equal(shape.points, expected.points)
    assert shape.measure == expected.measure
    assert shape.source == str(tight)


def test_a_packed_cloud_that_another_program_unpacks_from_a_file(tmp_path: Path) -> None:
    o3d = pytest.importorskip("symrefine.load.open3d").open3d()
    points = np.random.default_rng(0).random((50, 3)).astype(np.float32).astype(np.float64)
    bare, tight = tmp_path / "a.pcd", tmp_path / "a.pcd.gz"
    o3d.io.write_point_cloud(bare, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)), compressed=True)
    tight.write_bytes(gzip.compress(bare.read_bytes()))
    bare.unlink()
    assert np.array_equal(load(tight).points, points)


def test_gzip_is_refused_wherever_it_is_cut(tmp_path: Path) -> None:
    data = gzip.compress(PLY)
    for size in range(1, len(data)):
        refusal(tmp_path / "a.ply.gz", data[:size])
    assert "the gzip data are cut off after 60 bytes, " in refusal(tmp_path / "a.ply.gz", data[:60])


def test_gzip_is_refused_wherever_it_is_damaged(tmp_path: Path) -> None:
    data = gzip.compress(PLY, mtime=0)
    for place in range(10, len(data)):  # before, there are times and names
        refusal(tmp_path / "a.ply.gz", data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty (0 bytes)"),
        (PLY, "not gzip, or damaged: \"Not a gzipped file (b'pl')\""),
        (gzip.compress(PLY) + b"ply", "not gzip, or damaged"),
        (gzip.compress(b""), "unpacks to nothing (0 bytes)"),
        (gzip.compress(PLY[:-3]), "line 13: '3 0 1'; expected a row of element 'face'"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, data: bytes, message: str) -> None:
    assert message in refusal(tmp_path / "a.ply.gz", data)


def test_bombs_are_given_up_early(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed, "ROOM", 10**6)
    bomb = gzip.compress(bytes(3 * 10**6))
    assert len(bomb) < 10**4
    assert "bytes unpack to more than 1,000,000 bytes" in refusal(tmp_path / "a.ply.gz", bomb)
    assert "bytes unpack to more than 500,000 lines" in refusal(tmp_path / "a.xyz.gz", gzip.compress(b"\n" * 600000))
    assert "bytes unpack to 3,000," in refusal(tmp_path / "a.npz", npz(points=np.zeros((125000, 3))))
    assert "as double, where 1,000,000 are" in refusal(tmp_path / "a.npz", npz(points=np.zeros((125000, 3), np.uint8)))
    # An archive that hides its size: more follows than it says.
    honest = npz(points=np.zeros((125000, 3)))
    sizes = [m.file_size for m in zipfile.ZipFile(io.BytesIO(honest)).infolist()]
    lying = honest.replace(sizes[0].to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    assert "not a whole .npz archive" in refusal(tmp_path / "b.npz", lying)


def test_suffixes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a.tar.gz", "a.gz"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"unknown suffix '\.tar'; known are "):
        load(tmp_path / "a.tar.gz")
    with pytest.raises(InputError, match="unknown suffix ''; known are "):
        load(tmp_path / "a.gz")
    assert (packed.stem_of(Path("a/obj_000001.ply.gz")), packed.stem_of(Path("b.c.ply"))) == ("obj_000001", "b.c")
    (tmp_path / "obj_000001.ply.gz").write_bytes(gzip.compress(PLY))
    assert invoke(["batch", str(tmp_path), "--bop", str(tmp_path / "models_info.json")]) == 0
    assert "obj_000001.ply.gz" in capsys.readouterr().out
    assert '"1"' in (tmp_path / "models_info.json").read_text()
