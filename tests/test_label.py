"""A data set labelled: what is settled and what is open, decisions applied, refused, kept and taken back."""

import json
import math
import re
import shlex
import shutil
import tracemalloc
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from experiments.objects.shapes import box, join, sample
from symrefine.cli import invoke, label
from symrefine.export.bop import bop_entry
from symrefine.front.verbs import detect
from symrefine.geometry import random_orthogonal
from symrefine.load import load
from symrefine.review import cards
from symrefine.review.decisions import decisions_text, read_decisions
from symrefine.shape import Shape

Run = Callable[..., tuple[int, str, str]]
RESULTS = ("decisions.json", "models_info.json", "labels.json", "review.html", "objects.jsonl")


def ply(shape: Shape) -> str:
    assert shape.faces is not None
    head = f"ply\nformat ascii 1.0\nelement vertex {len(shape.points)}\nproperty double x\nproperty double y\n"
    head += f"property double z\nelement face {len(shape.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(repr, map(float, p))) for p in shape.points] + [f"3 {a} {b} {c}" for a, b, c in shape.faces]
    return head + "\n".join(rows) + "\n"


def turned(shape: Shape, seed: int) -> Shape:
    rng = np.random.default_rng(seed)
    return Shape(shape.points @ random_orthogonal(rng).T * 80.0 + rng.normal(size=3) * 100.0, shape.faces)


def square() -> Shape:
    """A box whose sides differ by 3 %: D4h to one who forgives it, else D2h."""
    return turned(join([box((0, 0, 0), (1.0, 0.97, 0.4))]), 1)


def wedge() -> Shape:
    """No symmetry that one could doubt."""
    corners = np.array([[0, 0, 0], [70, 0, 0], [15, 30, 0], [40, -10, 20.0]])
    return Shape(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three objects, and things beside them that are no models."""
    folder = tmp_path_factory.mktemp("data") / "models"
    folder.mkdir()
    made = {1: turned(join([box((0, 0, 0), (1.0, 0.7, 0.4))]), 2), 4: square(), 12: wedge()}
    for number, shape in made.items():
        (folder / f"obj_{number:06d}.ply").write_text(ply(shape))
    (folder / "obj_000004.png").write_text("a texture")
    (folder / "models_info.json").write_text("{}")
    return folder


@pytest.fixture(scope="module")
def first(models: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The labels of a first run, which nobody looked at."""
    out = tmp_path_factory.mktemp("first") / "labels"
    assert invoke(["label", str(models), "--out", str(out), "-q"]) == 0
    return out


@pytest.fixture
def out(first: Path, tmp_path: Path) -> Path:
    """A copy of them."""
    return Path(shutil.copytree(first, tmp_path / "labels"))


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], models: Path, out: Path) -> Run:
    def call(*argv: object, folder: Path = models, to: Path = out) -> tuple[int, str, str]:
        status = invoke(["label", str(folder), "--out", str(to), *map(str, argv)])
        return status, *capsys.readouterr()

    return call


def of(out: Path, name: str) -> Any:
    return json.loads((out / name).read_text(encoding="utf-8"))


def rows(out: Path) -> dict[int, Any]:
    made = (json.loads(line) for line in (out / "objects.jsonl").read_text().splitlines())
    return {row["object"]: row for row in made}


def decided(out: Path, number: int, **changes: Any) -> dict[str, Any]:
    """A decision of an object as the page saves it."""
    row = rows(out)[number]
    decision = {name: row[name] for name in ("object", "file", "sha256")}
    decision |= {
        "point_group": row["answer"],
        "tolerance": row["tolerance"],
        "mirrors_only_in_shape": False,
        "note": "",
    }
    return decision | changes


def saved(path: Path, *decisions: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"schema": "symrefine.decisions/1", "decisions": decisions}))
    return path


def schema(name: str) -> Any:
    return json.loads(files("symrefine").joinpath("schema", f"{name}.schema.json").read_text(encoding="utf-8"))


def test_nothing_is_settled_without_a_look(first: Path) -> None:
    assert of(first, "models_info.json") == {}
    labels = of(first, "labels.json")
    assert labels["objects"] == []
    assert [entry["object"] for entry in labels["open"]] == [1, 4, 12]
    assert "obj_000004.ply" in (first / "review.html").read_text(encoding="utf-8")


def test_what_is_sure_enough_is_settled(run: Run, out: Path, models: Path) -> None:
    sure = sorted(row["confidence"] for row in rows(out).values())
    status, said, _ = run("--accept", sure[1])
    assert status == 0
    assert "3 objects: 2 settled (2 by confidence, 0 by a person), 1 to look at" in said
    info = of(out, "models_info.json")
    assert sorted(info) == ["1", "12"]
    shape = load(models / "obj_000001.ply")
    assert info["1"] == bop_entry(detect(shape), shape)
    assert "symmetries_discrete" not in info["12"]
    for name in ("labels", "decisions"):
        jsonschema.validate(of(out, f"{name}.json"), schema(name))
    # What applies the decisions asks for the same.
    command = shlex.split(re.findall(r"<pre>(.*)</pre>", (out / "review.html").read_text())[0])
    assert command[:2] == ["symrefine", "label"]
    assert command[-4:] == ["--accept", str(sure[1]), "--decisions", "decisions.json"]


def test_the_command_of_the_page_takes_a_folder_that_begins_with_a_dash(
    models: Path, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(models, tmp_path / "-models")
    monkeypatch.chdir(tmp_path)
    assert invoke(["label", "-q", "--out", str(out), "--", "-models"]) == 0
    command = shlex.split(re.findall(r"<pre>(.*)</pre>", (out / "review.html").read_text())[0])
    assert command[-4:] == ["--decisions", "decisions.json", "--", "-models"]


@pytest.mark.slow
def test_equal_runs_give_equal_bytes_and_nothing_is_detected_twice(
    run: Run, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("--accept", 0.5, to=tmp_path / "other")[0] == 0
    monkeypatch.setattr(label, "examine_model", lambda _: pytest.fail("was detected before"))
    assert run("--accept", 0.5)[0] == 0
    for name in RESULTS:
        one, other = ((folder / name).read_bytes() for folder in (out, tmp_path / "other"))
        assert one.replace(bytes(out), b"OUT") == other.replace(bytes(tmp_path / "other"), b"OUT"), name


@pytest.mark.parametrize("group", ["C1", "D2h", "D4h"])
def test_what_a_person_chooses_has_its_rotations(run: Run, out: Path, tmp_path: Path, group: str, models: Path) -> None:
    """Each choice of the box that is almost square: a closed group that takes it onto itself as well as it can."""
    decisions = saved(tmp_path / "decisions.json", decided(out, 4, point_group=group, note="seen by hand"))
    status, said, _ = run("--decisions", decisions)
    assert status == 0
    assert "1 settled (0 by confidence, 1 by a person), 2 to look at" in said
    row = rows(out)[4]
    lines = said.splitlines()
    assert f"{group:<13}decided  obj_000004.ply  (found {row['answer']} {row['confidence']:.3f})" in lines
    assert any(line.split()[2] == "obj_000012.ply" for line in lines), "of the others what was found stands there"
    entry = of(out, "models_info.json")["4"]
    motions = np.array([np.eye(4).ravel(), *entry.get("symmetries_discrete", [])]).reshape(-1, 4, 4)
    assert len(motions) == {"C1": 1, "D2h": 4, "D4h": 8}[group]
    products = (motions[:, None] @ motions[None]).reshape(-1, 16)
    away = np.abs(products[:, None] - motions.reshape(1, -1, 16)).max(axis=2).min(axis=1)
    assert away.max() < 1e-3 * entry["diameter"]
    points = load(models / "obj_000004.ply").points
    for motion in motions:
        moved = points @ motion[:3, :3].T + motion[:3, 3]
        miss = np.linalg.norm(moved[:, None] - points[None], axis=2).min(axis=1).max()
        assert miss < (0.05 if group == "D4h" else 1e-6) * entry["diameter"]
    (told,) = of(out, "labels.json")["objects"]
    assert (told["point_group"], told["by"], told["note"]) == (group, "person", "seen by hand")


def test_decisions_are_kept_put_anew_and_taken_back(run: Run, out: Path, tmp_path: Path) -> None:
    path = tmp_path / "decisions.json"
    run("--decisions", saved(path, decided(out, 4, point_group="D4h", mirrors_only_in_shape=True), decided(out, 1)))
    assert sorted(of(out, "models_info.json")) == ["1", "4"]
    assert [o["mirrors_only_in_shape"] for o in of(out, "labels.json")["objects"]] == [False, True]
    run()
    assert sorted(of(out, "models_info.json")) == ["1", "4"], "kept without being given again"
    run("--decisions", saved(path, decided(out, 4, point_group="D2h"), decided(out, 1, point_group=None)))
    assert [(o["object"], o["point_group"]) for o in of(out, "labels.json")["objects"]] == [(4, "D2h")]
    run("--decisions", out / "decisions.json")
    assert sorted(of(out, "models_info.json")) == ["4"]


def test_what_the_page_saves_is_what_is_read(out: Path, tmp_path: Path) -> None:
    path = saved(tmp_path / "decisions.json", decided(out, 12), decided(out, 4, note="é <b>\u202e"))
    jsonschema.validate(json.loads(path.read_text()), schema("decisions"))
    read = read_decisions(path)
    (tmp_path / "again.json").write_text(decisions_text(read))
    assert read_decisions(tmp_path / "again.json") == read
    jsonschema.validate(json.loads(decisions_text(read)), schema("decisions"))


def test_an_object_that_changed_is_open_again(run: Run, models: Path, out: Path, tmp_path: Path) -> None:
    run("--decisions", saved(tmp_path / "decisions.json", decided(out, 4), decided(out, 1)))
    folder = Path(shutil.copytree(models, tmp_path / "models"))
    (folder / "obj_000004.ply").write_text(ply(turned(square(), 5)))
    before = {name: (out / name).read_bytes() for name in RESULTS}
    status, _, said = run("--decisions", tmp_path / "decisions.json", folder=folder)
    assert status == 2
    assert "decisions[0].sha256: is not that of obj_000004.ply, which has changed" in said
    assert {name: (out / name).read_bytes() for name in RESULTS} == before
    status, _, said = run(folder=folder)
    assert status == 0
    assert "object 4 is open again" in said
    assert sorted(of(out, "models_info.json")) == ["1"]
    assert [d["object"] for d in of(out, "decisions.json")["decisions"]] == [1]


BAD = {
    "no such file": (None, "no such file"),
    "not JSON": ("{", "is not JSON"),
    "NaN": ('{"schema": NaN}', "NaN is no number of JSON"),
    "deep": ("[" * 100_000, "is not JSON"),
    "a list": ("[]", "schema: is list; expected an object"),
    "another schema": ({"schema": "symrefine.labels/1", "decisions": []}, "schema: is \"symrefine.labels/1\""),
    "no decisions": ({"schema": "symrefine.decisions/1"}, "decisions: is missing"),
    "twice": ('{"schema": "symrefine.decisions/1", "schema": ""}', "stands there twice"),
    "unknown key": ({"extra": 1}, "extra: is unknown; expected schema, decisions"),
    "unknown field": ({"groups": 1}, "decisions[0].groups: is unknown"),
    "missing": ({"sha256": ...}, "decisions[0].sha256: is missing; expected the SHA-256"),
    "id": ({"object": 7}, "decisions[0].object: is 7, which is not there; expected one of 1, 4, 12"),
    "no id": ({"object": True}, "decisions[0].object: is true; expected the number of an object"),
    "group": ({"point_group": "C7"}, "decisions[0].point_group: is 'C7'; expected one of C1, D2h, D4h"),
    "hash": ({"sha256": "0" * 63}, "decisions[0].sha256: is"),
    "stale": ({"sha256": "0" * 64}, "decisions[0].sha256: is not that of obj_000004.ply"),
    "tolerance": ({"tolerance": 0.5}, "decisions[0].tolerance: is 0.5; expected a fraction of the diagonal"),
    "tick": ({"mirrors_only_in_shape": "yes"}, 'mirrors_only_in_shape: is "yes"; expected true or false'),
    "note": ({"note": "x" * 3000}, "decisions[0].note: is"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_decisions_are_refused_in_one_line(run: Run, out: Path, tmp_path: Path, case: str) -> None:
    wrong, said = BAD[case]
    path = tmp_path / "given.json"
    if isinstance(wrong, str):
        path.write_text(wrong)
    elif wrong is not None and ("schema" in wrong or "extra" in wrong):
        path.write_text(
            json.dumps({"schema": "symrefine.decisions/1", "decisions": []} | wrong if "extra" in wrong else wrong)
        )
    elif wrong is not None:
        decision = {name: value for name, value in (decided(out, 4) | wrong).items() if value is not ...}
        saved(path, decision)
    before = {name: (out / name).read_bytes() for name in RESULTS}
    status, _, error = run("--decisions", path)
    assert (status, error.count("\n")) == (2, 1), error
    assert error.startswith(f"symrefine: {path}: ")
    assert said in error
    assert {name: (out / name).read_bytes() for name in RESULTS} == before


def test_one_object_is_decided_once(run: Run, out: Path, tmp_path: Path) -> None:
    path = saved(tmp_path / "given.json", decided(out, 4), decided(out, 4))
    assert "decisions[1].object: is 4, decided before" in run("--decisions", path)[2]


@pytest.mark.parametrize("name", ["models_info.json", "review.html", "objects.jsonl"])
def test_what_others_wrote_is_not_overwritten(run: Run, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "theirs"
    folder.mkdir()
    (folder / name).write_text("theirs")
    status, _, said = run(to=folder)
    assert (status, said.count("\n")) == (2, 1)
    assert [path.read_text() for path in folder.iterdir()] == ["theirs"]


def test_what_cannot_be_used_is_told_and_does_not_end_the_others(run: Run, models: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(models, tmp_path / "models"))
    for number in (4, 12):
        (folder / f"obj_{number:06d}.ply").unlink()
    (folder / "obj_000002.ply").write_text("ply\n")
    (folder / "obj_000003.xyz").write_text("\n".join("0.0 1.0" for _ in range(3)))
    status, said, _ = run("--accept", 0.5, folder=folder, to=tmp_path / "new")
    assert status == 1
    assert "1 settled" in said
    assert "2 failed" in said
    assert [entry["object"] for entry in of(tmp_path / "new", "labels.json")["open"]] == [2, 3]
    assert "Could not be used" in (tmp_path / "new" / "review.html").read_text()


def test_two_models_of_one_object_are_refused(run: Run, models: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(models, tmp_path / "models"))
    shutil.copy(folder / "obj_000004.ply", folder / "obj_4.ply")
    assert "is object 4, and so is" in run(folder=folder, to=tmp_path / "new")[2]
    assert not (tmp_path / "new").exists()
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "no mesh and no cloud in it" in run(folder=empty)[2]


@pytest.mark.slow
def test_models_of_other_names_are_numbered_and_keep_their_numbers(run: Run, models: Path, tmp_path: Path) -> None:
    folder, to = tmp_path / "models", tmp_path / "new"
    folder.mkdir()
    for name, number in {"crate": 1, "wedge": 12}.items():
        shutil.copy(models / f"obj_{number:06d}.ply", folder / f"{name}.ply")
    status, _, said = run("--accept", 0.5, folder=folder, to=to)
    assert status == 0
    assert "no name tells a number" in said
    numbers = {entry["file"]: entry["object"] for entry in of(to, "labels.json")["objects"]}
    assert numbers == {"crate.ply": 1, "wedge.ply": 2}
    choice = saved(tmp_path / "choice.json", decided(to, 2, note="seen"))
    assert run("--decisions", choice, folder=folder, to=to)[0] == 0
    shutil.copy(models / "obj_000004.ply", folder / "ashtray.ply")  # before all others by its name
    before = rows(to)
    assert run("--accept", 0.01, folder=folder, to=to)[0] == 0
    told = {entry["file"]: entry for entry in of(to, "labels.json")["objects"]}
    assert {name: entry["object"] for name, entry in told.items()} == numbers | {"ashtray.ply": 3}
    assert (told["wedge.ply"]["by"], told["wedge.ply"]["note"]) == ("person", "seen")
    assert rows(to) == before | {3: rows(to)[3]}, "nothing is done again"
    (folder / "obj_000007.ply").write_bytes((folder / "crate.ply").read_bytes())
    assert run("--accept", 0.5, folder=folder, to=tmp_path / "named")[0] == 0
    assert list(of(tmp_path / "named", "models_info.json")) == ["7"], "a name that tells a number counts alone"


def test_numbers_that_somebody_changed_are_refused(run: Run, models: Path, tmp_path: Path) -> None:
    folder, to = tmp_path / "models", tmp_path / "new"
    folder.mkdir()
    shutil.copy(models / "obj_000001.ply", folder / "crate.ply")
    assert run(folder=folder, to=to)[0] == 0
    for damage in ("", "[]", '{"objects": [{"file": "crate.ply", "object": "1"}], "open": []}', '{"objects": 1}'):
        (to / "labels.json").write_text(damage)
        before = {path: path.read_bytes() for path in to.rglob("*") if path.is_file()}
        status, said, error = run(folder=folder, to=to)
        assert (status, said) == (2, "")
        assert "labels.json: is no longer what `symrefine label` wrote" in error
        assert before == {path: path.read_bytes() for path in to.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_workers_and_a_cluster_write_the_same_labels(models: Path, first: Path, tmp_path: Path) -> None:
    for name, options in {"two": ["--workers", "2"], "cluster": ["--dask", "local", "--workers", "2"]}.items():
        assert invoke(["label", str(models), "--out", str(tmp_path / name), *options, "-q"]) == 0
        assert rows(tmp_path / name) == rows(first)
        for result in ("models_info.json", "labels.json"):
            assert (tmp_path / name / result).read_bytes() == (first / result).read_bytes()
        assert {p.name: p.read_bytes() for p in (tmp_path / name / "pictures").iterdir()} == {
            p.name: p.read_bytes() for p in (first / "pictures").iterdir()
        }


@pytest.mark.slow
def test_an_object_beyond_its_limit_is_open_with_the_reason_and_done_again_without(run: Run, tmp_path: Path) -> None:
    to = tmp_path / "new"
    status, said, _ = run("--time-limit", 0.001, to=to)
    assert status == 1
    assert "3 failed" in said
    assert all("0.001 s, the limit of time" in entry["why"] for entry in of(to, "labels.json")["open"])
    lines = (to / "objects.jsonl").read_text()
    assert run("--time-limit", 0.001, to=to)[0] == 1
    assert (to / "objects.jsonl").read_text() == lines, "lost under the same limit, it is not tried again"
    assert run(to=to)[0] == 0


def test_a_person_decides_where_noise_hides_the_answer(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    points = sample(join([box((0, 0, 0), (1.0, 0.7, 0.4))]), 1500, 0.02, np.random.default_rng(0))
    np.savetxt(folder / "obj_000001.xyz", points)
    to = tmp_path / "new"
    assert "undetermined" in run("--tolerance", 0.01, "--accept", 0.01, folder=folder, to=to)[1]
    assert of(to, "models_info.json") == {}
    groups = [choice["point_group"] for choice in rows(to)[1]["choices"]]
    path = saved(tmp_path / "decisions.json", decided(to, 1, point_group=groups[-1]))
    run("--tolerance", 0.01, "--decisions", path, folder=folder, to=to)
    entry = of(to, "models_info.json")["1"]
    assert math.isfinite(entry["diameter"])
    assert of(to, "labels.json")["objects"][0]["found"] is None


@pytest.mark.parametrize("changes", [{"choices": 7}, {"file": 1}, {"confidence": None}])
def test_rows_that_somebody_changed_are_told(run: Run, out: Path, changes: dict[str, Any]) -> None:
    row = next(iter(rows(out).values()))
    (out / "objects.jsonl").write_text(json.dumps(row | changes) + "\n")
    status, _, err = run()
    assert (status, err.count("\n")) == (2, 1)
    assert f"objects.jsonl: is damaged: a row has a {next(iter(changes))} that is" in err


DAMAGED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "no dictionary": (lambda row: row.update(choices=[7]), "choices[0].point_group is not what it is of such a row"),
    "nan": (lambda row: row.update(confidence=math.nan), "a number of it is not finite"),
    "deep": (lambda row: row["choices"][0]["entry"].update(diameter=math.inf), "a number of it is not finite"),
    "no tolerances": (lambda row: row.pop("tolerances"), "its tolerances are no numbers"),
    "tolerance": (lambda row: row.update(tolerance=0.3), "its tolerances are no numbers, or do not have the one"),
    "answer": (lambda row: row.update(answer="C\x1b[31m7"), "its answer is none of its"),
    "none": (lambda row: row.update(choices=[]), "its answer is none of its 0 choices"),
    "likely": (lambda row: row["choices"][0].update(probabilities=[]), "choices[0].probabilities is not"),
    "size": (lambda row: row["choices"][0].update(entry={"diameter": "x"}), "choices[0].entry is not"),
    "sure": (lambda row: row.update(confidence=7), "its confidence is no probability"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_rows_that_hold_what_no_row_holds_are_told(run: Run, out: Path, case: str) -> None:
    change, said = DAMAGED[case]
    made = rows(out)
    change(made[4])
    (out / "objects.jsonl").write_text("".join(json.dumps(row) + "\n" for row in made.values()))
    before = {name: (out / name).read_bytes() for name in RESULTS}
    status, _, err = run("--accept", 0.5)
    assert (status, err.count("\n")) == (2, 1), err
    assert f"objects.jsonl: is damaged: object 4: {said}" in err
    assert {name: (out / name).read_bytes() for name in RESULTS} == before


def test_what_cannot_be_written_is_told_before_any_work(run: Run, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(label, "examine_model", lambda _: pytest.fail("has begun"))
    (out / "objects.jsonl").write_text("")
    (out / "labels.json").unlink()
    (out / "labels.json").mkdir()
    status, _, err = run()
    assert (status, err) == (2, f"symrefine: {out / 'labels.json'}: is a directory; expected a file to write\n")
    shutil.rmtree(out / "labels.json")
    shutil.rmtree(out / "pictures")
    (out / "pictures").write_text("")
    status, _, err = run()
    assert (status, err) == (2, f"symrefine: {out / 'pictures'}: is a file; expected a folder\n")
    (out / "pictures").unlink()
    monkeypatch.setattr("symrefine.files.os.access", lambda path, _: path.name != "pictures")
    status, _, err = run()
    assert (status, err.count("\n")) == (2, 1)
    assert f"cannot be written: no permission in the directory {out / 'pictures'}" in err


def test_a_picture_that_is_empty_is_made_again(run: Run, out: Path, first: Path) -> None:
    name = "pictures/obj_000001_0.webp"
    (out / name).write_bytes(b"")
    assert run()[0] == 0
    assert (out / name).read_bytes() == (first / name).read_bytes()


@pytest.mark.slow
def test_of_a_file_of_several_objects_one_is_chosen(run: Run, models: Path, tmp_path: Path) -> None:
    """A label is of one object; what is chosen counts for files that hold several, and not for the others."""
    folder, to = tmp_path / "models", tmp_path / "new"
    folder.mkdir()
    shutil.copy(models / "obj_000004.ply", folder)
    water, bent = ([[0.76, 0.59, 0], [-x, 0.59, 0]] for x in (0.76, 0.6))
    frames = [f"3\n\nO 0 0 0\nH {a[0]} {a[1]} 0\nH {b[0]} {b[1]} 0\n" for a, b in (water, bent)]
    (folder / "obj_000001.xyz").write_text("".join(frames))
    status, told, _ = run(folder=folder, to=to)
    assert status == 1
    wrong = "holds 2 frames, and a label is of one object: choose with --frame, from 0 to 1, which counts for all"
    assert f"obj_000001.xyz: {wrong}" in told
    assert "2 objects: 0 settled (0 by confidence, 0 by a person), 1 to look at, 1 failed" in told
    for frame, group in ((0, "C2v"), (1, "Cs")):
        assert run("--frame", frame, folder=folder, to=to)[0] == 0
        assert rows(to)[1]["answer"] == group
        assert rows(to)[4]["error"] is None
    assert "frame is 2; the file has 2 frames, from 0 to 1" in run("--frame", 2, folder=folder, to=to)[1]


@pytest.mark.slow
def test_a_run_that_was_killed_goes_on(run: Run, out: Path, first: Path) -> None:
    """Half of a row, and a picture that is not there: those two are done again, and all is as it was."""
    lines = (out / "objects.jsonl").read_bytes()
    (out / "objects.jsonl").write_bytes(lines[: lines.rfind(b"\n", 0, -1) + 100])
    next((out / "pictures").glob("obj_000001_*.webp")).unlink()
    for name in ("models_info.json", "labels.json", "review.html"):
        (out / name).unlink()
    status, _, said = run()
    assert status == 0
    assert "the last row is incomplete" in said
    for name in ("models_info.json", "labels.json"):
        assert (out / name).read_bytes() == (first / name).read_bytes()
    assert rows(out) == rows(first)
    assert {p.name: p.read_bytes() for p in (out / "pictures").iterdir()} == {
        p.name: p.read_bytes() for p in (first / "pictures").iterdir()
    }


def test_a_page_has_room_for_so_many(run: Run, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cards, "MOST", 1)
    assert run()[0] == 0
    page = (out / "review.html").read_text(encoding="utf-8")
    assert page.count("<article") == 1
    assert "2 more come after these" in page
    assert "3 objects to look at" in page


@pytest.mark.slow
def test_rows_are_not_held(run: Run, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of 30 MB in all, of which half is settled, take a tenth of that."""
    monkeypatch.setattr(cards, "MOST", 3)
    folder, to, row = tmp_path / "models", tmp_path / "many", rows(out)[12]
    first = folder / row["file"]
    folder.mkdir()
    first.write_text(ply(wedge()))
    shutil.copytree(out, to)
    made = []
    for number in range(100, 400):
        (folder / f"obj_{number:06d}.ply").hardlink_to(first)
        for k in range(len(row["choices"])):
            shutil.copy(to / "pictures" / f"obj_000012_{k}.webp", to / "pictures" / f"obj_{number:06d}_{k}.webp")
        made.append(row | {"object": number, "file": f"obj_{number:06d}.ply", "confidence": number % 2 / 2})
        made[-1]["choices"] = [choice | {"limits": "x" * 30_000} for choice in row["choices"]]
    first.unlink()
    (to / "objects.jsonl").write_text("".join(json.dumps(row) + "\n" for row in made))
    size = (to / "objects.jsonl").stat().st_size
    tracemalloc.start()
    status, _, _ = run("--accept", 0.5, "-q", folder=folder, to=to)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert status == 0
    assert len(of(to, "models_info.json")) == len(of(to, "labels.json")["open"]) == 150
    assert most < size / 10, (most, size)


def test_of_very_many_failures_some_stand_on_the_page(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cards, "MOST", 2)
    folder = tmp_path / "models"
    folder.mkdir()
    for number in range(5):
        (folder / f"obj_{number:06d}.ply").write_text("ply\n")
    assert run(folder=folder, to=tmp_path / "new")[0] == 1
    page = (tmp_path / "new" / "review.html").read_text(encoding="utf-8")
    assert page.count("<li>") == 2
    assert "3 more stand in labels.json" in page
    assert len(of(tmp_path / "new", "labels.json")["open"]) == 5


def test_names_and_notes_do_not_act_on_the_page(run: Run, out: Path, tmp_path: Path) -> None:
    note = "</script><script>alert(1)</script>\u202e"
    run("--decisions", saved(tmp_path / "decisions.json", decided(out, 4, note=note)))
    page = (out / "review.html").read_text(encoding="utf-8")
    assert "alert(1)" in page
    assert "<script>alert" not in page
    assert "\u202e" not in page
