"""COLLADA: a scene is one object in its frame; what its readers would leave out is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from symrefine.errors import InputError
from symrefine.load import load

pytest.importorskip("collada")
CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TRIANGLES = [corners for a, b, c, d in SIDES for corners in ((a, b, c), (a, c, d))]
MATRIX = "1 0 0 5 0 0 -1 0 0 1 0 0 0 0 0 1"


def words(values: np.ndarray | list[list[int]]) -> str:
    return " ".join(f"{value:g}" for value in np.ravel(values))


TRIANGULAR = (
    f'<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{words(TRIANGLES)}</p></triangles>'
)
POLYGONAL = (
    '<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/>'
    f"<vcount>4 4 4 4 4 4</vcount><p>{words(SIDES)}</p></polylist>"
)


def written(faces: str = TRIANGULAR, matrix: str = MATRIX, points: str = words(CORNERS), count: int = 24) -> str:
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="s"><float_array id="a" count="{count}">{points}</float_array>
   <technique_common><accessor source="#a" count="8" stride="3">
    <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
   </accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
  {faces}
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="x"><node id="n"><matrix>{matrix}</matrix>
  <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#x"/></scene>
</COLLADA>"""


def saved(folder: Path, text: str) -> Path:
    path = folder / "box.dae"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("faces", [TRIANGULAR, POLYGONAL], ids=["triangles", "polygons"])
def test_a_box_stands_where_its_node_puts_it(tmp_path: Path, faces: str) -> None:
    shape = load(saved(tmp_path, written(faces)))
    place = np.array(MATRIX.split(), dtype=float).reshape(4, 4)
    expected = CORNERS @ place[:3, :3].T + place[:3, 3]
    np.testing.assert_allclose(sorted(shape.points.tolist()), sorted(expected.tolist()), atol=1e-6)
    assert shape.faces is not None
    assert len(shape.faces) == 12


BROKEN = {
    "no XML": ("<COLLADA", "not valid XML"),
    "another XML": ("<svg/>", "begins with <'?svg'?>; expected <COLLADA>"),
    "a number that is none": (written(points=words(CORNERS).replace("2", "2x", 1)), "float_array '?a'?: holds '2x'"),
    "too few numbers": (written(count=25), "declares '25' numbers, 24 follow"),
    "a corner that is none": (written(TRIANGULAR.replace("<p>0", "<p>zero")), "<p> holds 'zero'"),
    "a corner out of range": (written(TRIANGULAR.replace("<p>0", "<p>9")), "COLLADA cannot be read"),
    "lines": (written(TRIANGULAR.replace("triangles", "lines")), "holds <lines>, which is not read"),
    "points that are not finite": (
        written(points=words(CORNERS).replace("2", "nan", 1)),
        "holds 'nan'; expected finite",
    ),
    "a place that is none": (written(matrix=MATRIX.replace("5", "five")), "<matrix>: holds 'five'"),
    "half a place": (written(matrix="1 0 0"), "<matrix>: declares '16' numbers, 3 follow"),
    "no triangles": (written(""), "no points|cannot be read"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_what_would_be_left_out_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = saved(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
