"""`batch`, `run` and `merge` on many objects: what they take, the same rows whoever does them, attacks."""

import csv
import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from experiments.studies.kills import COMMANDS, EXECUTORS, campaign, lay_out
from symrefine.cli.fleet import memory, shard
from symrefine.cli.sources import manifest, sources
from symrefine.errors import InputError
from symrefine.fleet import limits
from symrefine.fleet.remote import state

Run = Callable[..., tuple[int, str, str]]
ROOT = Path(__file__).resolve().parents[1]
linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are for Linux")
posix = pytest.mark.skipif(os.name != "posix", reason="needs a system with signals")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Ten boxes in `objects`, and a study of ten runs of 0.1 s each."""
    lay_out(tmp_path, 10)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "thirds", raising=False)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    return tmp_path


def rows(path: Path | str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in Path(path).read_text().splitlines()]


def refused(answer: tuple[int, str, str], *words: str) -> None:
    status, _, err = answer
    assert (status, err.count("\n")) == (2, 1), err
    assert all(word in err for word in words), err


# --- what is looked at ------------------------------------------------------------------------------------------------


def names(*paths: str, recursive: bool = False) -> list[str]:
    return [source.name for source in sources(paths, recursive=recursive).ours]


@pytest.mark.slow
def test_files_of_other_kinds_are_told(run: Run, lab: Path) -> None:
    for name in ("a.json", "b.PNG", "readme.md", "LICENSE", ".hidden.txt.bak"):
        (lab / "objects" / name).write_text("{}")
    told = "symrefine: note: 4 files of other kinds not looked at (.json .md .png without suffix)\n"
    for _ in range(2):
        assert run("batch", "objects", "--out", "objects/rows.jsonl")[2] == told
    assert run("batch", "objects", "-q")[2] == run("batch", "objects/box000.xyz")[2] == ""


@pytest.mark.usefixtures("lab")
def test_a_directory_is_walked_once(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    walked, glob = [], Path.glob

    def counted(folder: Path, pattern: str) -> Iterator[Path]:
        walked.append(folder)
        return iter([*glob(folder, pattern)])

    monkeypatch.setattr(Path, "glob", counted)
    assert run("batch", "objects")[0] == 0
    assert walked == [Path("objects")]


def test_directories_files_and_patterns_give_each_object_once(lab: Path) -> None:
    (lab / "more" / "deep").mkdir(parents=True)
    (lab / "more" / "deep" / "a.xyz").write_text("0 0 0\n")
    (lab / "more" / "b.xyz").write_text("0 0 0\n")
    assert names("objects")[:2] == ["box000.xyz", "box001.xyz"]
    assert names("more") == ["b.xyz"]
    assert names("more", recursive=True) == ["b.xyz", "deep/a.xyz"]
    assert names("objects/box00[12].xyz", "more/b.xyz", "more") == [
        "objects/box001.xyz",
        "objects/box002.xyz",
        "more/b.xyz",
    ]
    for path, message in (("nowhere", "no such directory, file or pattern"), ("*.ply", "no file matches")):
        with pytest.raises(InputError, match=message):
            names("more", path)


def test_addresses_are_listed_and_read(run: Run, lab: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    store.store.clear()
    for file in sorted((lab / "objects").iterdir())[:3]:
        store.pipe(f"/models/{file.name}", file.read_bytes())
    store.pipe("/models/deep/.hidden.xyz", b"0 0 0\n")
    store.pipe("/models/deep/cut.ply", b"ply\n")
    assert names("memory://models") == ["box000.xyz", "box001.xyz", "box002.xyz"]
    assert names("memory://models", recursive=True)[-1] == "deep/cut.ply"
    assert names("memory://models/*1.xyz") == ["memory:///models/box001.xyz"]
    assert run("batch", "memory://models", "--out", "far.jsonl")[0] == 0
    assert run("batch", "objects/box000.xyz", "--out", "near.jsonl")[0] == 0
    far, near = rows("far.jsonl")[0], rows("near.jsonl")[0]
    assert far["source"] == "memory:///models/box000.xyz"
    differing = {key for key in far if far[key] != near.get(key)}
    assert differing <= {"file", "source", "state", "timings"}
    assert "3 done before" in run("batch", "memory://models", "--out", "far.jsonl")[1]
    store.pipe("/models/box000.xyz", (lab / "objects" / "box005.xyz").read_bytes())
    assert "2 done before" in run("batch", "memory://models", "--out", "far.jsonl")[1]
    status, _, err = run("batch", "memory://models/deep/cut.ply", "-q")
    assert status == 1
    assert err.startswith("symrefine: memory:///models/deep/cut.ply: the header")
    refused(run("batch", "memory://nothing"), "memory://nothing: there is no such file or folder")
    refused(run("batch", "nosuch://bucket/models"), "nosuch://bucket/models: cannot be read: Protocol not known")


def test_a_file_has_changed_where_its_file_system_takes_all_to_be_static(monkeypatch: pytest.MonkeyPatch) -> None:
    store = pytest.importorskip("fsspec").filesystem("memory")
    monkeypatch.setattr(type(store), "ukey", lambda _, path: f"always {path}")  # as that of HTTP does
    store.pipe("/static/a.xyz", b"0 0 0\n")
    before = state("memory://static/a.xyz")
    assert state("memory://static/a.xyz") == before
    store.pipe("/static/a.xyz", b"0 0 0\n1 0 0\n")
    assert state("memory://static/a.xyz") != before


@pytest.fixture
def served(lab: Path) -> Iterator[str]:
    """The address at which this machine serves the files in `lab`."""
    pytest.importorskip("aiohttp")
    pytest.importorskip("fsspec")

    class Silent(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=str(lab))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_server_is_listed_and_what_changes_there_is_noticed(run: Run, lab: Path, served: str) -> None:
    assert names(f"{served}/objects/")[:2] == ["box000.xyz", "box001.xyz"]
    line = ("batch", f"{served}/objects/box000.xyz", "--out", "far.jsonl")
    assert run(*line)[0] == 0
    assert run("batch", "objects/box000.xyz", "--out", "near.jsonl")[0] == 0
    far, near = rows("far.jsonl")[0], rows("near.jsonl")[0]
    assert {key for key in far if far[key] != near.get(key)} <= {"file", "source", "state", "timings"}
    assert "1 done before" in run(*line)[1]
    (lab / "objects" / "box000.xyz").write_bytes((lab / "objects" / "box005.xyz").read_bytes())
    os.utime(lab / "objects" / "box000.xyz", (0, 10**9))
    assert "done before" not in run(*line)[1]
    refused(run("batch", f"{served}/objects/none.xyz"), f"{served}/objects/none.xyz: there is no such file")


def test_addresses_name_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(InputError, match=r'pip install "symrefine\[remote\]"'):
        names("s3://bucket/models/")


@pytest.mark.slow
def test_local_addresses_reach_other_processes(run: Run, lab: Path) -> None:
    pytest.importorskip("fsspec")
    folder = f"file://{lab}/objects"
    assert run("batch", folder, "--out", "far.jsonl", "--workers", "2")[0] == 0
    assert {row["file"] for row in rows("far.jsonl")} == set(names("objects"))


def test_a_manifest_says_more_of_each(run: Run, lab: Path) -> None:
    (lab / "sets").mkdir()
    table = lab / "sets" / "models.csv"
    table.write_text(
        "\ufeffpath,id,scale,tolerance,viewpoint\n"
        "../objects/box003.xyz,7,1000,0.05,\n\n"
        '"../objects/box001.xyz",12,,,"0,0,9"\n'
    )
    first, second = manifest(table)
    assert (first.name, first.place) == ("../objects/box003.xyz", f"{table}:2")
    assert (first.told, first.options) == ({"id": "7", "scale": 1000.0}, {"tolerance": 0.05})
    assert second.place == f"{table}:4"
    assert second.options == {"viewpoint": (0.0, 0.0, 9.0)}
    line = (
        "batch",
        "--manifest",
        table,
        "--out",
        "m.jsonl",
        "--bop",
        "info.json",
        "--bop-scale",
        "2",
        "--table",
        "m.csv",
    )
    assert run(*line)[0] == 0
    assert "2 done before" in run(*line)[1]
    assert [(row["id"], row.get("scale"), row["bop"]["scale"]) for row in rows("m.jsonl")] == [
        ("7", 1000.0, 1000.0),
        ("12", None, 2.0),
    ]
    assert [row["options"]["tolerance"] for row in rows("m.jsonl")] == [0.05, 0.02]
    assert sorted(json.loads(Path("info.json").read_text())) == ["12", "7"]
    table.write_text(table.read_text().replace("1000", "10"))
    assert "1 done before" in run(*line)[1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":1: there is no column path"),
        ("file\na.xyz\n", ":1: 'file': unknown column; expected path, id, scale"),
        ("path,tolerence\n", ":1: 'tolerence': unknown column; .*did you mean tolerance?"),
        ("path,id,id\n", ":1: id: stands there twice"),
        ("path\n", ": names no objects"),
        ("path,id\na.xyz,1\nb.xyz\n", ":3: has 1 values, expected 2"),
        ("path\nnone.xyz\n", ":2: path: none.xyz: no such file"),
        ("path,id\n,4\n", ":2: path: is empty"),
        ("path\na.xyz\nb.xyz\na.xyz\n", ":4: path: a.xyz stands in line 2, too"),
        ("path,id\na.xyz,1\nb.xyz,1\n", ":3: id: 1 stands in line 2, too"),
        ("path,scale\na.xyz,-1\n", ":2: scale: '-1' is not a number of millimetres from 1e-12"),
        ("path,tolerance\na.xyz,3\n", ":2: tolerance: '3' is not a fraction"),
        ("path,units\na.xyz,mmm\n", ":2: units: 'mmm' is not one of .*did you mean mm?"),
        ("path,measure\na.xyz,solids\n", ":2: measure: 'solids' is not one of surface, solid; did you mean solid?"),
        ("path,frame\na.xyz,-1\n", ":2: frame: '-1' is not an integer from 0"),
        ('path\na.xyz\n"b.xyz" c\n', ":3: is no CSV"),
        ("path\na\x1b[31m.xyz\n", "no such file"),
    ],
)
def test_manifests_that_are_wrong_are_refused_with_their_line(
    tmp_path: Path, run: Run, text: str, message: str
) -> None:
    for name in ("a.xyz", "b.xyz"):
        (tmp_path / name).write_text("0 0 0\n")
    table = tmp_path / "models.csv"
    table.write_text(text)
    with pytest.raises(InputError, match=message):
        manifest(table)
    status, out, err = run("batch", "--manifest", table)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.rstrip("\n").isprintable()


def test_a_manifest_is_not_overwritten(run: Run, lab: Path) -> None:
    table = lab / "models.csv"
    table.write_text(text := "path\nobjects/box001.xyz\n")
    refused(run("batch", "--manifest", table, "--table", table), "--table", "is the same file as the input")
    assert table.read_text() == text


def test_a_table_takes_the_place_of_tables_alone(run: Run, lab: Path) -> None:
    cloud = lab / "cloud.csv"
    cloud.write_text(text := "x,y,z\n1,2,3\n2,3,1\n")
    refused(run("batch", "objects/box001.xyz", "--table", cloud), "cloud.csv: is there already and holds no rows")
    assert cloud.read_text() == text
    for _ in range(2):
        assert run("batch", "objects/box001.xyz", "--table", lab / "rows.csv")[0] == 0


def test_ids_of_bop_are_numbers(run: Run, lab: Path) -> None:
    (lab / "m.csv").write_text("path,id\nobjects/box001.xyz,mug\n")
    refused(run("batch", "--manifest", "m.csv", "--bop", "info.json"), "m.csv:2: --bop takes the number", "'mug' is no")
    refused(run("batch", "objects", "--manifest", "m.csv"), "and not both")


# --- several objects in a file ----------------------------------------------------------------------------------------

WATER = "3\nwater\nO 0 0 0.1173\nH 0 0.7572 -0.4692\nH 0 -0.7572 -0.4692\n"
BENT = WATER.replace("-0.7572 -0.4692", "-0.7572 -0.2692")
WRONG = WATER.replace("H 0 0.7572", "H 0 x")


@pytest.fixture
def trajectory(lab: Path) -> Path:
    """The folder `chem`: a file with one molecule, one with three, and one whose second of two is damaged."""
    folder = lab / "chem"
    folder.mkdir()
    for name, text in {"a": WATER, "b": WATER + BENT + WATER, "c": WATER + WRONG}.items():
        (folder / f"{name}.xyz").write_text(text)
    return folder


@pytest.mark.usefixtures("trajectory")
def test_each_object_of_a_file_has_the_row_that_detect_gives_it(run: Run) -> None:
    status, out, err = run("batch", "chem", "--out", "rows.jsonl")
    assert (status, err) == (1, "")
    assert "3 files, 6 objects, 1 failed" in out
    found = {row["file"]: row for row in rows("rows.jsonl")}
    assert sorted(found) == ["a.xyz", "b.xyz#0", "b.xyz#1", "b.xyz#2", "c.xyz#0", "c.xyz#1"]
    assert [found[f"b.xyz#{k}"]["point_group"] for k in range(3)] == ["C2v", "Cs", "C2v"]
    assert found["c.xyz#1"]["error"].startswith("chem/c.xyz#1: ")
    assert run("detect", "chem/b.xyz", "--json", "b.json")[0] == 0
    for k, record in enumerate(json.loads(Path("b.json").read_text())):
        row = found[f"b.xyz#{k}"]
        assert {key: row[key] for key in record if key != "timings"} == {
            key: record[key] for key in record if key != "timings"
        }


def test_objects_of_a_file_are_found_again_one_by_one(run: Run, trajectory: Path) -> None:
    assert run("batch", "chem/b.xyz", "--out", "rows.jsonl", "--table", "whole.csv")[0] == 0
    journal = Path("rows.jsonl")
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[1:]))
    assert "3 objects, 2 done before" in run("batch", "chem/b.xyz", "--out", "rows.jsonl", "--table", "again.csv")[1]
    assert Path("again.csv").read_bytes() == Path("whole.csv").read_bytes()
    assert run("batch", "chem/b.xyz", "--out", "rows.jsonl", "--frame", "1")[1].count("b.xyz") == 1
    (trajectory / "b.xyz").write_text(WATER + BENT)
    told = run("batch", "chem/b.xyz", "--out", "rows.jsonl")[1]
    assert "2 objects" in told
    assert "done before" not in told


@pytest.mark.slow
def test_who_does_them_changes_no_row_of_several_in_a_file(run: Run, trajectory: Path) -> None:
    run("batch", "chem", "--table", "one.csv")
    run("batch", "chem", "--workers", "2", "--table", "two.csv")
    for number in (1, 2):
        run("batch", "chem", "--shard", f"{number}/2", "--out", f"p{number}.jsonl")
    (trajectory / "models.csv").write_text("path\na.xyz\nb.xyz\nc.xyz\n")
    run("batch", "--manifest", "chem/models.csv", "--table", "manifest.csv")
    assert run("merge", "p1.jsonl", "p2.jsonl", "--out", "all.jsonl", "--table", "merged.csv")[0] == 0
    for name in ("two", "merged", "manifest"):
        assert Path(f"{name}.csv").read_bytes() == Path("one.csv").read_bytes()
    assert "6 done before" in run("batch", "chem", "--out", "all.jsonl")[1]


def test_several_objects_at_an_address_are_fetched_once(
    run: Run, trajectory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    store.store.clear()
    store.pipe("/chem/b.xyz", (trajectory / "b.xyz").read_bytes())
    fetched: list[str] = []
    get = store.get_file
    monkeypatch.setattr(type(store), "get_file", lambda _, path, *rest: (fetched.append(path), get(path, *rest)))
    assert run("batch", "memory://chem", "--out", "far.jsonl")[0] == 0
    assert [row["source"] for row in rows("far.jsonl")] == [f"memory:///chem/b.xyz#{k}" for k in range(3)]
    assert len(fetched) == 2  # to see how many there are, and for all of them
    assert "3 done before" in run("batch", "memory://chem", "--out", "far.jsonl")[1]


def test_an_object_of_bop_is_a_file(run: Run, trajectory: Path) -> None:
    (trajectory / "b.xyz").rename(trajectory / "obj_000001.xyz")
    status, out, _ = run("batch", "chem/obj_000001.xyz", "--bop", "info.json")
    assert status == 1
    assert "holds 3 frames; choose one with frame" in out


# --- files beside a file ----------------------------------------------------------------------------------------------

SQUARE = (
    "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n"
)


def test_what_was_read_beside_a_file_counts_as_its_content(run: Run, lab: Path) -> None:
    from PIL import Image

    (lab / "s.obj").write_text(SQUARE)
    line = ("batch", "s.obj", "--out", "rows.jsonl", "--texture")
    assert run(*line)[0] == 1  # there is no s.mtl yet
    assert rows("rows.jsonl")[0]["beside"] == {"s.mtl": None}
    (lab / "images").mkdir()
    (lab / "s.mtl").write_text("newmtl m\nmap_Kd images/skin.png\n")
    Image.new("RGB", (8, 8), (200, 30, 30)).save(lab / "images" / "skin.png")
    assert run(*line)[0] == 0
    assert sorted(rows("rows.jsonl")[1]["beside"]) == ["images/skin.png", "s.mtl"]
    assert "1 done before" in run(*line)[1]
    halves = Image.new("RGB", (8, 8), (200, 30, 30))
    halves.paste((30, 30, 200), (0, 0, 4, 8))
    halves.save(lab / "images" / "skin.png")
    assert "done before" not in run(*line)[1]
    assert rows("rows.jsonl")[2]["textured"] != rows("rows.jsonl")[1]["textured"]
    assert "1 done before" in run(*line)[1]
    run("batch", "s.obj", "--out", "plain.jsonl")
    assert "beside" not in rows("plain.jsonl")[0]  # what does not count is not read


def test_the_buffers_of_a_gltf_count_as_its_content(run: Run, lab: Path) -> None:
    import trimesh

    def write(extents: Sequence[float]) -> None:
        for name, data in trimesh.Scene(trimesh.creation.box(extents)).export(file_type="gltf").items():
            (lab / name).write_bytes(data)

    write((1, 2, 3))
    line = ("batch", "model.gltf", "--out", "rows.jsonl")
    assert run(*line)[0] == 0
    assert "1 done before" in run(*line)[1]
    write((1, 2, 2))
    assert "done before" not in run(*line)[1]
    assert [row["point_group"] for row in rows("rows.jsonl")] == ["D2h", "D4h"]


# --- who does them ----------------------------------------------------------------------------------------------------


def test_sizes_and_shards_are_read() -> None:
    assert [memory(text) for text in ("2GB", "1.5g", "512 MiB", "100", "3kb")] == [
        2 * 10**9,
        15 * 10**8,
        2**29,
        100,
        3000,
    ]
    assert str(shard("3/16")) == "3/16"
    assert [index for index in range(7) if shard("2/3").takes(index)] == [1, 4]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("batch --manifest m.csv --recursive", "--recursive: is for directories, and a manifest names files"),
        ("batch objects --shard 0/3", "'0/3' is not a shard I/N"),
        ("batch objects --shard 4/3", "'4/3' is not a shard I/N"),
        ("batch objects --memory-limit 0", "'0' is not a size of memory"),
        ("batch objects --memory-limit 2PB", "'2PB' is not a size of memory"),
        pytest.param(
            "batch objects --memory-limit 1KB",
            "a limit of memory of 1,000 bytes is less than the libraries of a task alone take, 0.3 GB; give 0.5GB",
            marks=linux,
        ),
        ("batch objects --time-limit 0", "--time-limit: '0' is not a number above 0"),
        ("batch objects --time-limit 1e300", "a limit of time of 1e+300 s is more than 2,147,483, 24 days"),
        (
            "batch objects --bop b.json --bop-scale 1e308",
            "'1e308' is not a number of millimetres from 1e-12",
        ),
        ("batch objects --table t.xls", "t.xls: expected the name of a table that ends in .csv or .parquet"),
        ("batch objects --table nowhere/t.csv", "there is no directory nowhere"),
        ("batch objects --dask nowhere", "nowhere: is no address of a Dask scheduler"),
        ("batch objects --dask tcp://h:1 --workers 2", "--workers 2: is for this machine"),
        ("run thirds.yaml --dask nowhere", "nowhere: is no address of a Dask scheduler"),
        ("run thirds.yaml --table t.xls", "expected the name of a table"),
        ("merge a.jsonl --out b.jsonl", "a.jsonl: no such file"),
        ("merge objects --out b", "objects/journal.jsonl: no such file"),
        ("merge objects --out b --table t.csv", "is for parts of `batch`"),
        ("merge objects thirds.yaml --out b", "thirds.yaml: is no directory as objects is"),
        ("merge thirds.yaml --out b", "thirds.yaml: is there already and holds no rows of `symrefine batch`"),
        ("merge thirds.yaml --out thirds.py", "thirds.py: is there already"),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(run: Run, lab: Path, line: str, message: str) -> None:
    before = sorted(lab.rglob("*"))
    refused(run(*line.split()), message)
    assert [path for path in sorted(lab.rglob("*")) if "__pycache__" not in path.parts] == before


@pytest.mark.slow
def test_processes_and_shards_give_the_same_table(run: Run, lab: Path) -> None:
    for kind in ("csv", "parquet"):
        assert run("batch", "objects", "--out", "whole.jsonl", "--table", f"whole.{kind}")[0] == 0
    assert run("batch", "objects", "--workers", "2", "--table", "two.parquet")[0] == 0
    for number in (1, 2, 3):
        assert run("batch", "objects", "--shard", f"{number}/3", "--out", f"p{number}.jsonl")[0] == 0
    for path in lab.glob("p?.jsonl"):
        path.chmod(0o444)
    for kind in ("csv", "parquet"):
        (lab / "all.jsonl").unlink(missing_ok=True)
        parts = ("p3.jsonl", "p1.jsonl", "p2.jsonl")
        assert run("merge", *parts, "--out", "all.jsonl", "--table", f"all.{kind}")[0] == 0
        assert (lab / f"all.{kind}").read_bytes() == (lab / f"whole.{kind}").read_bytes()
    assert (lab / "two.parquet").read_bytes() == (lab / "whole.parquet").read_bytes()
    with (lab / "all.csv").open(newline="") as stream:
        assert [row["file"] for row in csv.DictReader(stream)] == names("objects")
    assert "10 done before" in run("batch", "objects", "--out", "all.jsonl")[1]
    refused(run("merge", "p1.jsonl", "p2.jsonl", "--out", "some.jsonl"), "shard 3/3 is not complete: 3 of its 3")
    run("batch", "objects", "--shard", "3/3", "--out", "other.jsonl", "--seed", "1")
    refused(
        run("merge", "p1.jsonl", "p2.jsonl", "other.jsonl", "--out", "some.jsonl"),
        "is part of another fleet: of --seed 1,",
    )
    run("batch", "objects", "--shard", "3/3", "--out", "shape.jsonl", "--measure", "solid")
    differs = "shape.jsonl: is part of another fleet: of --measure solid, and p1.jsonl of --measure none"
    refused(run("merge", "p1.jsonl", "p2.jsonl", "shape.jsonl", "--out", "some.jsonl"), differs)
    refused(run("merge", "whole.jsonl", "--out", "some.jsonl"), "holds rows of no shard")
    refused(run("merge", *parts, "p1.jsonl", "--out", "some.jsonl"), "p1.jsonl: is named 2 times; merge takes each")
    before = (lab / "p1.jsonl").read_bytes()
    refused(run("merge", *parts, "--out", "p1.jsonl"), "p1.jsonl: is there already")
    refused(run("merge", *parts, "--out", "some.csv", "--table", "./some.csv"), "same file as that of --out")
    assert (lab / "p1.jsonl").read_bytes() == before
    assert not (lab / "some.jsonl").exists()


def test_shards_of_a_study_become_one(run: Run, lab: Path) -> None:
    assert run("run", "thirds.yaml", "--table", "whole.parquet")[0] == 0
    for number in (1, 2):
        line = ("run", "thirds.yaml", "--shard", f"{number}/2", "--out", f"part{number}")
        assert "5 runs" in run(*line)[1]
        assert "5 runs, 5 done before" in run(*line)[1]
    refused(run("merge", "part1", "--out", "all"), "shard 2/2 is not complete")
    assert not (lab / "all").exists()
    assert run("merge", "part1", "part2", "--out", "all")[0] == 0
    line = ("run", "thirds.yaml", "--out", "all", "--workers", "2", "--table", "all.parquet")
    assert "10 runs, 10 done before" in run(*line)[1]
    assert (lab / "all.parquet").read_bytes() == (lab / "whole.parquet").read_bytes()
    assert (lab / "all" / "rows.csv").read_bytes() == (lab / "out" / "thirds" / "rows.csv").read_bytes()


@linux
@pytest.mark.usefixtures("lab")
def test_what_meets_a_limit_is_a_row_and_tried_again_under_another(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    line = ("batch", "objects/box000.xyz", "--out", "r.jsonl")
    status, _, _ = run(*line, "--time-limit", "0.001")
    assert (status, rows("r.jsonl")[-1]["error"]) == (
        1,
        "objects/box000.xyz: takes longer than 0.001 s, the limit of time",
    )
    assert "1 done before" in run(*line, "--time-limit", "0.001")[1]
    status, out, _ = run(*line, "--time-limit", "100", "--memory-limit", "2GB")
    assert (status, "done before" in out) == (0, False)
    assert (rows("r.jsonl")[-1]["error"], "lost" in rows("r.jsonl")[-1]) == (None, False)
    assert "1 done before" in run(*line)[1]
    status, _, err = run("run", "thirds.yaml", "--limit", "2", "--time-limit", "0.05", "--table", "t.csv")
    assert status == 1
    assert "a run failed: the run takes longer than 0.05 s" in err
    assert "2 runs, written" in run("run", "thirds.yaml", "--limit", "2")[1]
    monkeypatch.setattr(limits, "LEAST", 1)
    assert "needs more memory than 1 bytes, the limit" in run(*line, "--memory-limit", "1", "--tolerance", "0.03")[1]


@pytest.mark.parametrize(
    "changes",
    [
        {"beside": {"../../../../../../../../../dev/zero": "0"}},
        {"beside": [1]},
        {"lost": [1]},
        {"bop": 7},
        {"bop": {"scale": 1.0, "entry": {"diameter": "far"}}},
        {"timings": None},
        {"timings": {"load_s": "long"}},
        {"planes": 7},
        {"planes": [{"normal": [0, 0, 1]}]},
        {"point_group": None, "undetermined": None},
        {"axes": None},
    ],
)
@pytest.mark.usefixtures("lab")
def test_a_row_that_somebody_changed_is_done_again(run: Run, changes: dict[str, Any]) -> None:
    line = ("batch", "objects/box000.xyz", "--out", "r.jsonl", "--table", "t.csv")
    assert run(*line)[0] == 0
    table, [row] = Path("t.csv").read_bytes(), rows("r.jsonl")
    changed = {key: value for key, value in (row | changes).items() if value is not None or key not in changes}
    Path("r.jsonl").write_text(json.dumps(changed) + "\n")
    status, out, err = run(*line)
    assert (status, err, "done before" in out) == (0, "", False)
    assert Path("t.csv").read_bytes() == table
    assert "1 done before" in run(*line)[1]


@pytest.mark.parametrize("frames", [10**12, -3, "x", [2], True])
@pytest.mark.usefixtures("lab")
def test_a_row_that_tells_of_frames_that_there_are_not_is_no_guide(run: Run, frames: Any) -> None:
    line = ("batch", "objects/box000.xyz", "--out", "r.jsonl")
    run(*line)
    [row] = rows("r.jsonl")
    Path("r.jsonl").write_text(json.dumps(row | {"file": f"{row['file']}#0", "frames": frames}) + "\n")
    assert run(*line)[0] == 0
    assert rows("r.jsonl")[-1]["file"] == row["file"]


@posix
@pytest.mark.usefixtures("lab")
def test_pipes_and_devices_are_no_objects(run: Run) -> None:
    os.mkfifo("pipe.xyz")
    Path("device.xyz").symlink_to("/dev/zero")
    for name in ("pipe.xyz", "device.xyz"):
        refused(run("detect", name), f"{name}: is a pipe or a device; expected a file")
        assert f"failed: {name}: is a pipe or a device" in run("batch", name, "objects/box000.xyz")[1]
    refused(run("batch", "--manifest", "/dev/zero"), "/dev/zero: has more than 67,108,864 bytes, or no end")


@pytest.mark.usefixtures("lab")
def test_merge_writes_both_files_or_none(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in (1, 2):
        assert run("batch", "objects", "--shard", f"{number}/2", "--out", f"part{number}.jsonl")[0] == 0

    def full(_: object, path: Path) -> None:
        path.write_text("half of it")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    line = ("merge", "part1.jsonl", "part2.jsonl", "--out", "all.jsonl", "--table", "all.csv")
    with monkeypatch.context() as patch:
        patch.setattr("symrefine.fleet.table.write_table", full)
        refused(run(*line), "all.csv: cannot be written: No space left on device")
    assert not sorted(Path().glob("*all*"))
    assert run(*line)[0] == 0
    assert len(sorted(Path().glob("*all*"))) == 2


@pytest.mark.skipif(sys.platform != "linux", reason="other systems take names in UTF-8 only")
@pytest.mark.parametrize("kind", [pytest.param("csv", marks=pytest.mark.slow), "parquet"])
@pytest.mark.usefixtures("lab")
def test_names_of_other_bytes_stand_in_tables(run: Run, kind: str) -> None:
    Path("objects/box000.xyz").rename(os.fsdecode(b"objects/box\xff.xyz"))
    status, out, err = run("batch", "objects", "--out", "r.jsonl", "--table", f"t.{kind}")
    assert (status, err) == (0, "")
    assert "box\\udcff.xyz" in out
    assert b"box\\udcff.xyz" in Path(f"t.{kind}").read_bytes()
    assert "10 done before" in run("batch", "objects", "--out", "r.jsonl")[1]


# --- faults -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rows.csv", "tables.md", "timings.csv", "recordings"])
def test_a_study_overwrites_nothing_of_others(run: Run, lab: Path, name: str) -> None:
    (lab / "mine").mkdir()
    (lab / "mine" / name).write_text("my notes\n")
    for more in ([], ["--replace"]):
        refused(run("run", "thirds.yaml", "--out", "mine", *more), f"mine/{name}: is there already and not of a study")
    assert [path.read_text() for path in (lab / "mine").iterdir()] == ["my notes\n"]


def start(line: Sequence[str], **options: Any) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "symrefine", *line]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, **options)


@posix
@pytest.mark.parametrize(
    ("line", "file"),
    [
        pytest.param("batch objects -q --workers 2 --out r.jsonl", "r.jsonl", marks=pytest.mark.slow),
        ("run thirds.yaml -q --out r", "r/journal.jsonl"),
    ],
)
def test_a_disk_that_is_full_in_the_middle_of_a_row_loses_none_before_it(lab: Path, line: str, file: str) -> None:
    """A limit of the size of files stands for the disk: the row that passes it is written in part."""
    whole = start(line.replace("--out r", "--out whole").split())
    assert whole.communicate()[1] == ""
    expected = (lab / file.replace("r", "whole", 1)).read_bytes().splitlines()
    room = sum(map(len, expected[:4])) + 40

    def little_room() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    full = start(line.split(), preexec_fn=little_room)
    err = full.communicate()[1]
    assert (full.returncode, err.count("\n")) == (2, 1)
    assert f"{file}: cannot be written: " in err
    before = (lab / file).read_bytes()
    kept = before[: before.rfind(b"\n") + 1].splitlines()
    assert len(kept) in (3, 4, 5)
    assert before.rpartition(b"\n")[2]  # in the middle of a row
    again = start(line.split())
    assert (again.communicate()[1], again.returncode) == ("", 0)
    after = (lab / file).read_bytes().splitlines()
    assert after[: len(kept)] == kept
    assert len(after) == len({json.loads(row).get("file", json.loads(row).get("index")) for row in after}) == 10


@linux
def test_a_folder_that_cannot_be_written_is_told_in_one_line(run: Run, lab: Path) -> None:
    """/sys takes no files, not even from root."""
    for line in (
        "batch objects --out /sys/r.jsonl",
        "batch objects/box000.xyz --table /sys/t.csv",
        "run thirds.yaml --out /sys/r",
        "run thirds.yaml --out /sys",
    ):
        status, _, err = run(*line.split())
        assert (status, err.count("\n")) == (2, 1)
        assert err.startswith("symrefine: /sys")
    run("batch", "objects", "--shard", "1/1", "--out", lab / "p.jsonl")
    refused(run("merge", "p.jsonl", "--out", "/sys/all.jsonl"), "/sys/all.jsonl: cannot be written")


def half_way(line: str, file: Path) -> subprocess.Popen[str]:
    """A command that is stopped with some of its ten rows written; begun anew if it was through before it could be."""
    for _ in range(10):
        process = start(line.split())
        while process.poll() is None and not (file.exists() and file.read_bytes().count(b"\n")):
            time.sleep(0.001)
        process.send_signal(signal.SIGSTOP)
        if process.poll() is None and file.read_bytes().count(b"\n") < 10:
            break
        process.send_signal(signal.SIGCONT)
        assert process.communicate(timeout=60)[1] == ""
        file.unlink()
    return process


@pytest.mark.slow
@posix
@pytest.mark.parametrize("line", ["batch objects -q --out r.jsonl", "run thirds.yaml -q --out r"])
def test_of_two_writers_at_once_one_is_refused(lab: Path, line: str) -> None:
    file = lab / ("r.jsonl" if line.startswith("batch") else "r/journal.jsonl")
    first, count = half_way(line, file), len(rows(file))
    assert 0 < count < 10
    second = start(line.split())
    err = second.communicate(timeout=60)[1]
    first.send_signal(signal.SIGCONT)
    assert first.communicate(timeout=60)[1] == ""
    assert (first.returncode, second.returncode) == (0, 2)
    assert err.count("\n") == 1
    assert "another" in err
    assert "writing" in err
    assert len(file.read_text().splitlines()) == 10


@pytest.mark.slow
@posix
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("executor", EXECUTORS)
def test_kills_lose_no_row_and_double_none(lab: Path, command: str, executor: str) -> None:
    if "Dask" in executor:
        pytest.importorskip("distributed")
    toll = campaign(lab, command, executor, 2)
    assert toll.kills == 2
    assert toll.finished >= 1
    assert toll.is_clean, toll
