"""Sound files of every format that is read, small and the same every time, for `experiments.studies.fuzz` to damage."""

import io
import json
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from experiments.objects.cylinder_step import STEP
from symrefine.export.models import model_bytes
from symrefine.geometry import Array
from symrefine.load.objects import shape_of

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.5)])
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
FACES = np.array([three for a, b, c, d in SIDES for three in ((a, b, c), (a, c, d))])
_SECOND = "2026-01-01T00:00:00"


def _models(suffix: str) -> list[bytes]:
    """As this package writes them: a mesh, where the format has faces, and a cloud."""
    mesh, cloud = shape_of((CORNERS, FACES)), shape_of(CORNERS)
    both = [cloud] if suffix in (".xyz", ".npy") else [mesh, cloud]
    return [model_bytes(suffix, shape) for shape in both]


def _ply() -> list[bytes]:
    text = "ply\nformat ascii 1.0\nelement vertex 8\n" + "".join(f"property double {axis}\n" for axis in "xyz")
    text += "element face 7\nproperty list uchar int vertex_indices\nend_header\n" + _rows(CORNERS)
    text += "".join(f"4 {' '.join(map(str, side))}\n" for side in SIDES) + "3 0 1 2\n"
    return [*_models(".ply"), text.encode()]


def _rows(table: Array, between: str = " ") -> str:
    return "".join(between.join(map(repr, row)) + "\n" for row in np.asarray(table).tolist())


def _tables(suffix: str) -> list[bytes]:
    bare = _rows(CORNERS, "," if suffix == ".csv" else " ")
    between = "; " if suffix == ".csv" else "\t"
    titled = between.join(("x", "y", "z", "label")) + "\n"
    titled += "".join(between.join([*map(repr, row), "a b"]) + "\n" for row in CORNERS.tolist())
    return [bare.encode(), titled.encode(), ("x,y\n" + _rows(CORNERS[:, :2], ",")).encode()]


def _pcd() -> list[bytes]:
    def written(kind: str, body: bytes) -> bytes:
        head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 8\nHEIGHT 1\nPOINTS 8\n"
        return f"{head}DATA {kind}\n".encode() + body

    columns = CORNERS.T.astype("<f4").tobytes()
    # LZF of nothing but literals, 32 at a time.
    packed = b"".join(bytes([31]) + columns[k : k + 32] for k in range(0, len(columns), 32))
    sizes = np.array([len(packed), len(columns)], dtype="<u4").tobytes()
    return [
        written("ascii", _rows(CORNERS).encode()),
        written("binary", CORNERS.astype("<f4").tobytes()),
        written("binary_compressed", sizes + packed),
    ]


def _trimesh(kind: str) -> list[bytes]:
    import trimesh

    mesh = trimesh.Trimesh(CORNERS, FACES, process=False)
    made = mesh.export(file_type=kind)
    return [made if isinstance(made, bytes) else made.encode()]


def _gltf() -> list[bytes]:
    import base64

    points, corners = CORNERS.astype("<f4").tobytes(), FACES.astype("<u4").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(points + corners).decode()
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 2, 3], "children": [1]}, {"mesh": 0, "scale": [1, -1, 2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "byteOffset": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "byteOffset": 0, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 144},
        ],
        "buffers": [{"byteLength": 240, "uri": uri}],
    }  # fmt: skip
    return [json.dumps(tree, indent=1).encode()]


def _3mf() -> list[bytes]:
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in CORNERS.tolist())
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in FACES.tolist())
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    turned = '<component objectid="1" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/>'
    model = (
        f'<?xml version="1.0"?><model xmlns="{space}" unit="millimeter"><resources><object id="1">{mesh}</object>'
        f'<object id="2"><components>{turned}</components></object></resources>'
        '<build><item objectid="1"/><item objectid="2"/></build></model>'
    )
    relations = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/a.model"/></Relationships>'
    )
    return [zipped({"_rels/.rels": relations.encode(), "3D/a.model": model.encode()})]


def zipped(members: dict[str, bytes]) -> bytes:
    """A zip archive, the same every time."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, compress_type=zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def _dae() -> list[bytes]:
    text = f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>{_SECOND}</created><modified>{_SECOND}</modified></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="s"><float_array id="a" count="24">{" ".join(f"{v:g}" for v in CORNERS.ravel())}</float_array>
   <technique_common><accessor source="#a" count="8" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
  <triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>{" ".join(map(str, FACES.ravel()))}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="x"><node id="n"><matrix>1 0 0 5 0 0 -1 0 0 1 0 0 0 0 0 1</matrix>
  <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#x"/></scene>
</COLLADA>"""
    return [text.encode()]


def _las(*, packed: bool) -> list[bytes]:
    import laspy

    made = []
    for version, kind in (("1.2", 3), ("1.4", 6)):
        header = laspy.LasHeader(point_format=kind, version=version)
        header.scales = [1e-3] * 3
        header.creation_date = None
        cloud = laspy.LasData(header)
        cloud.xyz = CORNERS
        stream = io.BytesIO()
        cloud.write(stream, do_compress=packed, laz_backend=laspy.LazBackend.Lazrs if packed else None)
        made.append(stream.getvalue())
    return made


def _e57() -> list[bytes]:
    import uuid

    import pye57

    columns = {f"cartesian{axis}": CORNERS[:, k] for k, axis in enumerate("XYZ")}
    with tempfile.TemporaryDirectory() as folder, mock.patch("uuid.uuid4", return_value=uuid.UUID(int=1)):
        file = Path(folder, "a.e57")
        writer = pye57.E57(str(file), mode="w")
        writer.write_scan_raw(columns, name="a", rotation=np.array([1.0, 0, 0, 0]), translation=np.ones(3))
        writer.close()
        return [file.read_bytes()]


def _atoms(kind: str) -> list[bytes]:
    import ase.io

    water = ase.Atoms("OHH", [[0, 0, 0.12], [0, 0.76, -0.48], [0, -0.76, -0.48]], cell=[9, 9, 9])
    stream: Any = io.BytesIO() if kind == "cif" else io.StringIO()
    ase.io.write(stream, water, format={"pdb": "proteindatabank", "xyz": "extxyz"}.get(kind, kind))
    made = stream.getvalue()
    return [made if isinstance(made, bytes) else made.encode()]


def _molfile() -> list[bytes]:
    atoms = [(0.0, 0.0, 0.0, "O"), (0.76, 0.59, 0.0, "H"), (-0.76, 0.59, 0.0, "H")]
    lines = [f"{x:10.4f}{y:10.4f}{z:10.4f} {symbol:<3} 0  0" for x, y, z, symbol in atoms]
    head = ["water", "  made", "", "  3  2  0  0  0  0            999 V2000"]
    old = "\n".join([*head, *lines, "  1  2  1  0", "  1  3  1  0", "M  END", "$$$$", ""])
    rows = [f"M  V30 {k} {symbol} {x} {y} {z} 0" for k, (x, y, z, symbol) in enumerate(atoms, start=1)]
    new = ["water", "  made", "", "  0  0  0     0  0            999 V3000", "M  V30 BEGIN CTAB"]
    new += ["M  V30 COUNTS 3 0 0 0 0", "M  V30 BEGIN ATOM", *rows, "M  V30 END ATOM", "M  V30 END CTAB", "M  END", ""]
    return [old.encode(), "\n".join(new).encode()]


def _grid() -> Array:
    axis = np.linspace(-1.0, 1.0, 8)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.exp(-3.0 * (x**2 + 2.0 * y**2 + z**2)).astype(np.float32)


def _nii() -> list[bytes]:
    import nibabel

    return [nibabel.Nifti1Image(_grid(), np.diag([1.0, 2.0, 3.0, 1.0])).to_bytes()]


def _nrrd() -> list[bytes]:
    import nrrd

    made = []
    for encoding in ("raw", "gzip", "bzip2"):
        stream = io.BytesIO()
        nrrd.write(stream, _grid(), {"encoding": encoding, "space directions": np.eye(3).tolist()}, index_order="F")
        data = stream.getvalue()
        dated = [line for line in data.split(b"\n\n")[0].split(b"\n") if line.startswith(b"# ") or b"Generated" in line]
        for line in dated:
            data = data.replace(line + b"\n", b"", 1)
        if encoding == "gzip":  # its header holds the second
            head, _, body = data.partition(b"\n\n")
            data = head + b"\n\n" + body[:4] + bytes(4) + body[8:]
        made.append(data)
    return made


def _mrc() -> list[bytes]:
    import mrcfile

    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = Path(folder, "a.mrc")
        with mrcfile.new(file) as made:
            made.set_data(_grid())
        data = file.read_bytes()
    return [data[:224] + bytes(800) + data[1024:]]  # without labels, which hold the second


def _picture(kind: str) -> list[bytes]:
    from PIL import Image

    pixels = np.zeros((12, 16, 3), dtype=np.uint8)
    pixels[3:9, 4:12] = [200, 30, 90]
    made = []
    for mode in ("RGB", "L"):
        stream = io.BytesIO()
        Image.fromarray(pixels).convert(mode).save(stream, kind)
        made.append(stream.getvalue())
    return made


_SOURCES: dict[str, Callable[[], list[bytes]]] = {
    ".3mf": _3mf, ".bmp": lambda: _picture("BMP"), ".cif": lambda: _atoms("cif"), ".csv": lambda: _tables(".csv"),
    ".dae": _dae, ".e57": _e57, ".glb": lambda: _trimesh("glb"), ".gltf": _gltf, ".jpeg": lambda: _picture("JPEG"),
    ".jpg": lambda: _picture("JPEG"), ".las": lambda: _las(packed=False), ".laz": lambda: _las(packed=True),
    ".map": _mrc, ".mol": _molfile, ".mrc": _mrc, ".nii": _nii, ".npy": lambda: _models(".npy"),
    ".npz": lambda: _models(".npz"), ".nrrd": _nrrd, ".obj": lambda: _models(".obj"), ".off": lambda: _models(".off"),
    ".pcd": _pcd, ".pdb": lambda: _atoms("pdb"), ".ply": _ply, ".png": lambda: _picture("PNG"), ".sdf": _molfile,
    ".step": lambda: [STEP.encode()], ".stl": lambda: [*_trimesh("stl"), *_trimesh("stl_ascii")],
    ".stp": lambda: [STEP.encode()],
    ".txt": lambda: _tables(".txt"), ".xyz": lambda: [*_models(".xyz"), *_atoms("xyz")],
}  # fmt: skip


@cache
def seeds(suffix: str) -> tuple[bytes, ...]:
    """Sound files of a suffix, as `load` takes them."""
    return tuple(_SOURCES[suffix]())


SUFFIXES = tuple(_SOURCES)
