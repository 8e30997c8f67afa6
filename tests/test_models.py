"""Fetched models: what is pinned comes whole into the cache; anything else is refused in one line."""

import hashlib
import io
import tarfile
import threading
import zipfile
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
import pytest

from experiments.objects import models
from experiments.objects.legacy_vtk import vtk_to_off
from experiments.objects.models import PYVISTA, VEDO, Model, Package
from symrefine import load
from symrefine.errors import InputError

PLY = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
VTK = b"""# vtk DataFile Version 4.2
vtk output
ASCII
DATASET POLYDATA
POINTS 4 float
0 0 0 1 0 0 1.5 1.25e0 0
0 1 0

POLYGONS 2 9
3 0 1 2
4 0 1 2 3

CELL_DATA 2
NORMALS Normals float
0 0 1 0 0 1
"""


def tarred(entries: dict[str, bytes], links: dict[str, str] | None = None) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        for name, data in entries.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
        for name, target in (links or {}).items():
            entry = tarfile.TarInfo(name)
            entry.type, entry.linkname = tarfile.SYMTYPE, target
            archive.addfile(entry)
    return stream.getvalue()


def zipped(entries: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return stream.getvalue()


def pinned(package: Package, data: bytes) -> Package:
    return replace(package, sha256=hashlib.sha256(data).hexdigest())


@pytest.fixture
def offer(monkeypatch, tmp_path):
    """Two small packages in place of the real ones, and what would be downloaded for each."""
    cup, plate = VEDO.folder + "cup.ply", VEDO.folder + "plate.vtk"
    tar = tarred({"../../escaped.ply": PLY, "/tmp/absolute.ply": PLY, cup: PLY, plate: VTK, "vedo/setup.py": b"1/0"})
    wheel = zipped({"../escaped.ply": PLY, PYVISTA.folder + "wing.ply": PLY})
    vedo, pyvista = pinned(VEDO, tar), pinned(PYVISTA, wheel)
    registry = {
        "cup": Model(package=vedo, member="cup.ply", group="Cs"),
        "plate": Model(package=vedo, member="plate.vtk", group="C1"),
        "wing": Model(package=pyvista, member="wing.ply", group="Cs"),
    }
    monkeypatch.setattr(models, "MODELS", registry)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return {vedo: tar, pyvista: wheel}


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_only_the_named_files_come_and_only_once(offer, tmp_path):
    asked = []

    def download(package):
        asked.append(package.name)
        return offer[package]

    folder = models.cache_folder()
    assert folder == tmp_path / "cache" / "symrefine" / "models"
    assert models.fetch(folder, download) == ["cup", "plate", "wing"]
    assert files(tmp_path) == sorted(
        f"cache/symrefine/models/{name}"
        for name in ("vedo-2020.3.3/cup.ply", "vedo-2020.3.3/plate.off", "pyvista-0.49.1/wing.ply")
    )
    assert models.available() == ["cup", "plate", "wing"]
    assert models.fetch(folder, download) == []
    assert asked == ["vedo", "pyvista"]
    (folder / "vedo-2020.3.3/cup.ply").unlink()
    assert models.fetch(folder, download) == ["cup"]
    np.testing.assert_array_equal(models.load_model("cup").points, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert len(models.load_model("plate").faces) == 3


def test_another_archive_than_the_pinned_one_leaves_nothing(offer, tmp_path):
    with pytest.raises(InputError, match=r"vedo-2020.3.3.tar.gz: SHA-256 is [0-9a-f]{64}; expected [0-9a-f]{64}"):
        models.fetch(models.cache_folder(), lambda package: offer[package] + b"\0")
    assert files(tmp_path) == []


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (tarred({VEDO.folder + "other.ply": PLY}), "holds no file cup.ply in vedo-2020.3.3/vedo/examples/data/"),
        (tarred({}, {VEDO.folder + "cup.ply": "/etc/hostname"}), "holds no file cup.ply"),
        (tarred({VEDO.folder + "cup.ply": PLY * 50})[:-200], "not a whole archive"),
        (b"<html>", "not a whole archive"),
    ],
)
def test_archives_that_do_not_hold_the_file(data, message):
    with pytest.raises(InputError, match=message) as caught:
        models.unpack(data, VEDO, ["cup.ply"])
    assert "\n" not in str(caught.value)


def test_broken_wheel():
    with pytest.raises(InputError, match="not a whole archive"):
        models.unpack(b"PK", PYVISTA, ["nut.ply"])


def test_a_folder_that_cannot_be_written(offer, tmp_path):
    (tmp_path / "cache").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        models.fetch(models.cache_folder(), lambda package: offer[package])


@pytest.mark.usefixtures("offer")
def test_names_that_are_wrong_or_not_fetched():
    with pytest.raises(InputError, match=r"model 'cap' is not known; expected one of \['cup', 'plate', 'wing'\]"):
        models.load_model("cap")
    with pytest.raises(InputError, match="the model cup is not in the cache; fetch them with: python -m"):
        models.load_model("cup")


def test_legacy_vtk_keeps_numbers_and_polygons(tmp_path):
    path = tmp_path / "plate.off"
    path.write_bytes(vtk_to_off(VTK, "plate.vtk"))
    shape = load(path)
    np.testing.assert_array_equal(shape.points, [[0, 0, 0], [1, 0, 0], [1.5, 1.25, 0], [0, 1, 0]])
    assert len(shape.faces) == 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ASCII", b"BINARY", "expected '# vtk DataFile', ASCII"),
        (b"POLYDATA", b"UNSTRUCTURED_GRID", "DATASET POLYDATA"),
        (b"0 1 0\n\n", b"0 1\n\n", "not as many coordinates"),
        (b"POINTS 4", b"POINTS 5", "not as many coordinates"),
        (b"POLYGONS 2 9", b"POLYGONS 3 9", "not as many coordinates and polygons"),
        (b"POLYGONS 2 9", b"LINES 2 9", "expected numbers after POINTS and POLYGONS"),
        (b"4 0 1 2 3", b"4 0 1 2", "expected numbers"),
        (b"4 0 1 2 3", b"0 0 1 2 3", "expected numbers"),
        (b"1.25e0", b"nothing", "expected numbers"),
    ],
)
def test_legacy_vtk_refuses_what_it_does_not_know(old, new, message):
    assert old in VTK
    with pytest.raises(InputError, match=message):
        vtk_to_off(VTK.replace(old, new), "plate.vtk")


@pytest.fixture
def index(offer):
    """A package index on this machine that serves the small packages."""
    bodies = {f"/files/{package.file}": data for package, data in offer.items()}
    for package in offer:
        link = f'<a href="../../files/{package.file}#sha256=0">{package.file}</a>'
        bodies[f"/simple/{package.name}/"] = f"<html><body>{link}</body></html>".encode()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path in bodies else 404)
            self.end_headers()
            self.wfile.write(bodies.get(self.path, b""))

        def log_message(self, *args):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/simple", bodies
        server.shutdown()


def test_fetch_from_an_index(index, monkeypatch, capsys):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setenv("PIP_INDEX_URL", index[0])
    assert models.main(["fetch"]) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("3 models brought, 0 were there: ")
    assert models.main(["list"]) == 0
    assert "not fetched" not in capsys.readouterr().out


def test_an_index_without_the_version(index, monkeypatch, capsys):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setenv("PIP_INDEX_URL", index[0])
    index[1]["/simple/vedo/"] = b'<a href="vedo-1.tar.gz">vedo-1.tar.gz</a>'
    assert models.main(["fetch"]) == 2
    assert capsys.readouterr().err == "error: 127.0.0.1: the package index lists no vedo-2020.3.3.tar.gz\n"


@pytest.mark.usefixtures("offer")
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("http://127.0.0.1:9/simple", "127.0.0.1: cannot fetch vedo-2020.3.3.tar.gz: "),
        ("file:///opt/simple", "expected an http(s) address without a password"),
        ("https://somebody:secret@host/simple", "pip's index-url at host: expected an http(s) address without"),
    ],
)
def test_without_network_one_line_and_status_2(monkeypatch, capsys, tmp_path, address, message):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setenv("PIP_INDEX_URL", address)
    assert models.main(["fetch"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert "secret" not in printed.err
    assert files(tmp_path) == []


def test_the_registry_states_its_truth():
    for name, model in models.MODELS.items():
        mirrors = {"Cs": 1, "C3v": 3}.get(model.group, 0)
        assert len(model.normals) == mirrors, name
        assert (model.axis is not None) == (model.group in ("C3v", "Cinfv")), name
        np.testing.assert_allclose(np.linalg.norm(np.reshape(model.normals, (-1, 3)), axis=1), 1.0, atol=1e-3)
