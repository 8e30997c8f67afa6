"""Recordings: what they hold, that equal input gives equal content, and what opening refuses."""

import os
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from experiments.objects import damage
from experiments.objects.shapes import asymmetric, bottle, sample, stool, table
from symrefine.complete import complete
from symrefine.detection.result import Detection
from symrefine.detection.story import detect
from symrefine.errors import InputError, SymrefineError
from symrefine.geometry import rotation, unit
from symrefine.picture.scene import make_scene
from symrefine.shape import Shape
from symrefine.viewer import open_recording, opening, record, recording, serve_recording

Case = tuple[Detection, Shape, Path]


def recorded(shape: Shape, folder: Path) -> Case:
    detection = detect(shape)
    record(detection, shape, folder / "x.rrd")
    return detection, shape, folder / "x.rrd"


def cloud(mesh: Shape, noise: float = 0.005) -> Shape:
    return Shape(points=sample(mesh, 4000, noise, np.random.default_rng(3)))


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A table, tilted, far from the origin."""
    points = 3.0 * cloud(table()).points @ rotation([1, 2, 0], 0.7).T + np.array([1e6, -2e6, 3e5])
    return recorded(Shape(points=points), tmp_path_factory.mktemp("tilted"))


@pytest.fixture(scope="module")
def shapeless(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return recorded(asymmetric(), tmp_path_factory.mktemp("shapeless"))


def rows(path: Path, entity: str) -> list[dict[str, Any]]:
    """All rows logged to an entity, in order; static ones without an iteration."""
    import rerun.chunk as ck

    found = [
        c.to_record_batch().to_pylist() for c in ck.RrdReader(path).stream().to_chunks() if c.entity_path == entity
    ]
    return sorted((row for chunk in found for row in chunk), key=lambda row: row.get("iteration") or 0)


def entities(path: Path) -> set[str]:
    import rerun.chunk as ck

    return {c.entity_path for c in ck.RrdReader(path).stream().to_chunks()}


def column(row: dict[str, Any], name: str) -> Any:
    return next(value for key, value in row.items() if key.split(":")[-1] == name)


def rerun(*args: str | Path) -> subprocess.CompletedProcess[str]:
    command = [*opening._rerun(), *(str(a) for a in args)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_everything_is_there(tilted: Case) -> None:
    _, _, path = tilted
    expected = {"object", "object/cloud", "object/ntuples", "object/axes/1", "report", "log"}
    expected |= {f"object/planes/{k}" for k in range(1, 5)} | {f"object/refinement/planes/{k}" for k in range(1, 5)}
    expected |= {"object/refinement/pairs", "series/cost", "series/step", "series/inliers", "series/turn_deg"}
    assert {f"/{name}" for name in expected} <= entities(path)


def test_opens_with_a_layout_of_its_own(tilted: Case) -> None:
    import rerun.chunk as ck

    reader = ck.RrdReader(tilted[2])
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    assert [c.name for c in reader.store().schema().index_columns()] == ["iteration", "story"]


def test_every_iteration_has_its_planes_and_pairs(tilted: Case) -> None:
    detection, _, path = tilted
    iterations = list(range(len(detection.history)))
    assert len(iterations) > 1
    assert [row["iteration"] for row in rows(path, "/object/refinement/planes/1")] == iterations
    pairs = rows(path, "/object/refinement/pairs")
    assert [row["iteration"] for row in pairs] == iterations[1:]
    assert all(0 < len(column(row, "strips")) <= 300 for row in pairs)


def test_the_story_ends_with_what_was_found(tilted: Case) -> None:
    detection, _, path = tilted
    last = len(detection.history) + 3
    steps = {"ntuples": 1, "candidates": 2, "refinement/planes/1": 3, "planes/1": last, "axes/1": last}
    assert {name: min(row["story"] for row in rows(path, f"/object/{name}")) for name in steps} == steps
    assert [row["story"] for row in rows(path, "/object/refinement")] == [last]


def test_misses_cool_down(tilted: Case) -> None:
    detection, _, path = tilted
    shown = sorted(rows(path, "/object/refinement/misses"), key=lambda row: row["story"])
    assert len(shown) == len(detection.history)
    heat = [np.mean([colour >> 24 for colour in column(row, "colors")]) for row in shown]
    assert heat[-1] <= heat[0]


def answers(address: str) -> bool:
    host, _, port = address.removeprefix("http://").partition("?")[0].partition(":")
    with socket.socket() as link:
        return link.connect_ex((host, int(port))) == 0


def test_a_recording_is_served_until_it_is_interrupted(
    tilted: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served: list[str] = []
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("CI", "XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)

    def interrupt(address: str) -> None:
        served.append(address)
        with urllib.request.urlopen(address.partition("?")[0], timeout=20) as page:
            assert page.status == 200
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        serve_recording(tilted[2], interrupt)
    assert served[0].startswith("http://127.0.0.1:")
    deadline = time.monotonic() + 20.0
    while answers(served[0]):
        assert time.monotonic() < deadline, "the server outlives the command"
    assert not list(tmp_path.iterdir()), "rerun wrote down that it was used, to tell its makers"
    with pytest.raises(InputError, match="no such file"):
        serve_recording(tilted[2].parent / "none.rrd", interrupt)


def test_pairs_join_points_that_agree(tilted: Case) -> None:
    detection, _, path = tilted
    last = np.array(column(rows(path, "/object/refinement/pairs")[-1], "strips"))
    lengths = np.linalg.norm(last[:, 1] - last[:, 0], axis=1)
    assert np.median(lengths) < 0.03 * detection.diagonal


def test_series_are_those_of_the_history(tilted: Case) -> None:
    detection, _, path = tilted
    for name, values in {
        "cost": [i.cost for i in detection.history],
        "step": [i.step for i in detection.history],
    }.items():
        logged = [row for row in rows(path, f"/series/{name}") if row.get("iteration")]
        assert [column(row, "scalars")[0] for row in logged] == pytest.approx(values[1:])


def test_positions_are_relative_to_the_centre(tilted: Case) -> None:
    """A float32 at 2e6 has steps of 0.25; relative to the centre they are 1e-7."""
    detection, shape, path = tilted
    logged = np.array(column(rows(path, "/object/cloud")[0], "positions"))
    assert np.allclose(logged, shape.points - detection.center, atol=1e-6)
    assert f"centre ({detection.center[0]:.4f}" in column(rows(path, "/report")[0], "text")[0]


def test_planes_lie_where_they_were_found(tilted: Case) -> None:
    detection, _, path = tilted
    for k, found in enumerate(detection.planes, start=1):
        corners = np.array(column(rows(path, f"/object/planes/{k}")[0], "vertex_positions")) + detection.center
        assert np.abs(found.plane.signed_distance(corners)).max() < 1e-6 * detection.diagonal


def test_the_last_iterate_is_what_was_found(tilted: Case) -> None:
    detection, _, path = tilted
    normals = np.array([p.plane.normal for p in detection.planes])
    for k in range(1, 5):
        corners = np.array(column(rows(path, f"/object/refinement/planes/{k}")[-1], "vertex_positions"))
        assert np.abs(corners @ normals.T).max(axis=0).min() < 0.02 * detection.diagonal


def test_same_input_gives_same_content(tilted: Case, tmp_path: Path) -> None:
    detection, shape, path = tilted
    record(detection, shape, tmp_path / "again.rrd")
    assert rerun("rrd", "compare", path, tmp_path / "again.rrd").returncode == 0
    assert rerun("rrd", "verify", path).returncode == 0
    other = Shape(points=shape.points[:-1])
    record(detection, other, tmp_path / "other.rrd")
    assert rerun("rrd", "compare", path, tmp_path / "other.rrd").returncode != 0


@pytest.mark.slow
def test_a_scan_shows_what_was_seen_and_what_is_inferred(tmp_path: Path) -> None:
    made = damage.view(stool(5), unit(np.array([0.5, -0.8, 0.35])), np.random.default_rng(5))
    detection, shape, path = recorded(Shape(points=made.points, viewpoint=made.viewpoint), tmp_path)
    assert detection.at_least
    expected = {f"/object/{name}" for name in ("cloud", "inferred", "cameras", "cameras/free_space", "candidates")}
    assert expected <= entities(path)
    counts = {name: len(column(rows(path, f"/object/{name}")[0], "positions")) for name in ("cloud", "inferred")}
    assert counts["cloud"] <= len(shape.points) - len(detection.outliers)
    assert counts["inferred"] == len(complete(shape, detection).points) - (len(shape.points) - len(detection.outliers))
    (eye,) = column(rows(path, "/object/cameras")[0], "positions")
    np.testing.assert_allclose(eye, made.viewpoint[0] - detection.center, rtol=1e-5)


def test_outliers_are_told_apart(tmp_path: Path) -> None:
    made = damage.outliers(table(), 0.05, np.random.default_rng(6))
    detection, _, path = recorded(Shape(points=made.points), tmp_path)
    shown = {name: len(column(rows(path, f"/object/{name}")[0], "positions")) for name in ("cloud", "outliers")}
    assert shown["outliers"] == len(detection.outliers) > 0
    assert sum(shown.values()) == len(made.points)


def test_no_symmetry_no_iterations(shapeless: Case) -> None:
    detection, _, path = shapeless
    assert detection.point_group == "C1"
    names = entities(path)
    assert {"/object/mesh", "/object/near_misses/1", "/report", "/log"} <= names
    assert not [n for n in names if n.startswith(("/object/planes", "/object/refinement", "/series"))]
    assert "no symmetry" in str(rows(path, "/report"))


def test_revolution(tmp_path: Path) -> None:
    detection, _, path = recorded(cloud(bottle()), tmp_path)
    assert detection.point_group == "Cinfv"
    assert column(rows(path, "/object/axes/1/name")[0], "labels") == ["C∞"]
    assert not [n for n in entities(path) if n.startswith("/object/planes")]


def test_meshes_keep_their_triangles(tmp_path: Path) -> None:
    detection, shape, path = recorded(table(), tmp_path)
    assert shape.faces is not None
    corners = np.array(column(rows(path, "/object/mesh")[0], "vertex_positions"))
    assert np.allclose(corners, (shape.points - detection.center)[shape.faces].reshape(-1, 3), atol=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_objects_of_any_size_fill_the_view(size: float, tmp_path: Path) -> None:
    shape = Shape(points=size * table().points, faces=table().faces, measure="surface")
    detection, _, path = recorded(shape, tmp_path)
    scale = column(rows(path, "/object")[0], "scale")[0][0]
    assert 1.0 <= scale * make_scene(detection, shape).stage.diagonal < 10.0


def test_nothing_is_left_of_a_recording_that_cannot_be_written(shapeless: Case, tmp_path: Path) -> None:
    detection, shape, _ = shapeless
    with pytest.raises(InputError, match="no directory"):
        record(detection, shape, tmp_path / "none" / "x.rrd")
    with pytest.raises(InputError, match="is a directory"):
        record(detection, shape, tmp_path)
    assert not list(tmp_path.iterdir())


def test_rerun_switched_off_is_told(shapeless: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(InputError, match="RERUN"):
        record(*shapeless[:2], tmp_path / "x.rrd")


def test_a_full_disk_is_no_bug_of_ours(shapeless: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError(text)

    monkeypatch.setattr("symrefine.viewer.recording._log", fail)
    text = "Failed to encode LogMsg: Failed to write: No space left on device (os error 28)"
    with pytest.raises(InputError, match=r"x.rrd: cannot be written: No space left on device$"):
        record(*shapeless[:2], tmp_path / "x.rrd")
    text = "something else"
    with pytest.raises(RuntimeError, match="something else"):
        record(*shapeless[:2], tmp_path / "x.rrd")
    assert not list(tmp_path.iterdir())


def test_a_recording_takes_the_place_of_another(shapeless: Case, tmp_path: Path) -> None:
    detection, shape, path = shapeless
    (tmp_path / "x.rrd").write_text("old")
    record(detection, shape, tmp_path / "x.rrd")
    assert rerun("rrd", "compare", path, tmp_path / "x.rrd").returncode == 0
    assert [p.name for p in tmp_path.iterdir()] == ["x.rrd"]


def test_opening_refuses_what_is_no_recording(shapeless: Case, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_recording(tmp_path / "none.rrd")
    (tmp_path / "folder.rrd").mkdir()
    with pytest.raises(InputError, match=r"folder.rrd: is a directory; expected a recording, a file"):
        open_recording(tmp_path / "folder.rrd")
    if os.name == "posix":
        with pytest.raises(InputError, match=r"/dev/null: is a pipe or a device"):
            open_recording("/dev/null")
    (tmp_path / "text.rrd").write_text("hello")
    with pytest.raises(InputError, match="not a recording"):
        open_recording(tmp_path / "text.rrd")
    whole = shapeless[2].read_bytes()
    (tmp_path / "half.rrd").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="damaged"):
        open_recording(tmp_path / "half.rrd")


def test_a_recording_may_have_the_name_of_an_option(
    shapeless: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "-help.rrd").write_bytes(shapeless[2].read_bytes())
    opening.check_recording(Path("-help.rrd"))


def test_opening_tells_why_there_is_no_window(shapeless: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    fails = "import sys; sys.exit('Error: a.rs:7: no display is set.')"
    monkeypatch.setattr(opening, "check_recording", lambda _: None)
    monkeypatch.setattr(opening, "_rerun", lambda: [sys.executable, "-c", fails])
    with pytest.raises(SymrefineError, match="did not start: no display is set;"):
        open_recording(shapeless[2])


def test_opening_leaves_the_viewer_alone(shapeless: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    class Viewer:
        def __init__(self, command: list[str], **options: Any) -> None:
            started.append(command)
            assert options["start_new_session"]

        def wait(self, timeout: float) -> int:
            raise subprocess.TimeoutExpired("rerun", timeout)

    started: list[list[str]] = []
    monkeypatch.setattr(opening, "check_recording", lambda _: None)
    monkeypatch.setattr(subprocess, "Popen", Viewer)
    open_recording(shapeless[2])
    assert started[0][-1] == str(shapeless[2])
    assert "127.0.0.1" in started[0]


SHOWN = """
import symrefine
found = symrefine.detect("box.ply")
found.show()
"""
# What a browser would be sent once it has loaded the viewer: no test has one that runs notebooks.
WAITING = """
from ipywidgets.widgets.widget import _instances
from rerun_notebook import Viewer
viewers = [widget for widget in _instances.values() if isinstance(widget, Viewer)]
parts = [bytes(part) for viewer in viewers for _, buffers in viewer._event_queue for part in buffers or []]
print(len(viewers), {part[:4].decode() for part in parts}, sum(map(len, parts)) > 100_000)
"""


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # those of Jupyter's packages about one another
def test_a_notebook_shows_the_recording_inline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat, client = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("rerun_notebook")
    pytest.importorskip("ipykernel")
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.ply")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
    monkeypatch.delenv("DISPLAY", raising=False)
    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in (SHOWN, WAITING)])
    at = {"metadata": {"path": str(tmp_path)}}
    client.NotebookClient(made, timeout=120, kernel_name="python3", resources=at).execute()
    shown, waiting = ([*cell.outputs] for cell in made.cells)
    assert "application/vnd.jupyter.widget-view+json" in shown[-1].data
    assert "rerun_notebook.Viewer" in shown[-1].data["text/plain"]
    assert waiting[0].text == "1 {'RRF2'} True\n"


def test_a_notebook_without_its_half_of_rerun_says_what_to_install(
    shapeless: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "find_spec", lambda _: None)
    with pytest.raises(SymrefineError, match=r'pip install "symrefine\[notebook\]"'):
        recording.recorded(*shapeless[:2]).embed()
