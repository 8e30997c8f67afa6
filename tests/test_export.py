"""Records, BOP entries and files: read back as their consumers read them."""

import json
import math
import os
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from symrefine.detection.result import Alternative, Detection, FoundAxis, FoundPlane
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.export.bop import bop_entry, bop_limits, bop_text, diameter, read_models_info
from symrefine.export.numbers import number
from symrefine.export.records import detection_record
from symrefine.files import check_target, json_text, replacing
from symrefine.geometry import Array, Axis, Plane, random_orthogonal, rotation, toward_positive
from symrefine.groups import PointGroup, point_group
from symrefine.shape import Shape
from symrefine.surface.misses import Deviation
from symrefine.surface.surface import Coverage

ALL = Coverage(supported=1.0, contradicted=0.0, unseen=0.0, told=1.0)
CENTER = np.array([0.3, -1.2, 2.5])
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SIDES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
SIDES += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]


@pytest.fixture(scope="module")
def box() -> tuple[Shape, Detection]:
    shape = Shape(points=CUBE * [3.0, 2.0, 1.0], faces=np.array(SIDES), measure="surface", source="box")
    return shape, detect(shape)


def tilted(seed: int) -> Array:
    return random_orthogonal(np.random.default_rng(seed))


def orbit(group: PointGroup, fold: int = 12) -> Shape:
    """Points that have the group exactly, about CENTER; a continuous group by turns of 2 pi / fold."""
    finite = group if group.is_finite else group.sampled(fold)
    seeds = np.random.default_rng(5).uniform(0.2, 1.0, (4, 3))
    points = np.einsum("kij,mj->kmi", finite.operations(), seeds).reshape(-1, 3)
    return Shape(points=points + CENTER, source="orbit")


def placed(detection: Detection, group: PointGroup, center: Array = CENTER) -> Detection:
    return replace(detection, group=group, point_group=group.name, center=center, undetermined="")


def turned_about(axis: Array, point: Array, angle_rad: float) -> Array:
    motion = np.eye(4)
    motion[:3, :3] = rotation(axis, angle_rad)
    motion[:3, 3] = point - motion[:3, :3] @ point
    return motion


def motions_as_read(entry: dict[str, Any], steps: int) -> list[Array]:
    """All symmetries [4, 4] in the way the readers of BOP expand them: each discrete one before each turn."""
    discrete = [np.eye(4), *(np.reshape(m, (4, 4)) for m in entry.get("symmetries_discrete", []))]
    turns = [
        turned_about(np.array(s["axis"]), np.array(s["offset"]), 2 * math.pi * k / steps)
        for s in entry.get("symmetries_continuous", [])
        for k in range(steps)
    ]
    return [t @ d for d in discrete for t in turns] if turns else discrete


@pytest.mark.parametrize("name", ["C1", "Cs", "Ci", "C2", "C4v", "C3h", "S4", "D2h", "D3d", "D5", "Td", "Oh", "Ih"])
def test_every_discrete_symmetry_maps_the_model_onto_itself(box: tuple[Shape, Detection], name: str) -> None:
    group = point_group(name, tilted(3))
    shape = orbit(group)
    entry = bop_entry(placed(box[1], group), shape, scale=1000.0)
    motions = motions_as_read(json.loads(json_text(entry)), 1)
    assert len(motions) == group.proper_subgroup().order
    assert ("symmetries_discrete" in entry) is (len(motions) > 1)
    assert "symmetries_continuous" not in entry
    points = 1000.0 * shape.points
    for motion in motions:
        assert np.linalg.det(motion[:3, :3]) == pytest.approx(1.0)
        np.testing.assert_array_equal(motion[3], [0, 0, 0, 1])
        images = points @ motion[:3, :3].T + motion[:3, 3]
        assert cKDTree(points).query(images)[0].max() < 1e-9 * entry["diameter"]


@pytest.mark.parametrize(("name", "discrete"), [("Cinfv", 0), ("Dinfh", 1)])
def test_a_surface_of_revolution_has_one_axis(box: tuple[Shape, Detection], name: str, discrete: int) -> None:
    # The flip may be about any perpendicular axis, so the cloud must consist of circles; the reader's steps turn them.
    group = point_group(name, tilted(8))
    steps = 360
    shape = orbit(group, steps)
    entry = bop_entry(placed(box[1], group), shape)
    assert len(entry["symmetries_continuous"]) == 1
    assert len(entry.get("symmetries_discrete", [])) == discrete
    tree, half_step = cKDTree(shape.points), math.sqrt(2.0) * math.pi / steps  # no point is further from the axis
    for motion in motions_as_read(entry, 18):
        images = shape.points @ motion[:3, :3].T + motion[:3, 3]
        assert tree.query(images)[0].max() <= half_step


def test_axes_are_as_the_strict_readers_want_them(box: tuple[Shape, Detection]) -> None:
    """MegaPose asserts offset 0 and components of the axis that sum to 1."""
    noise = rotation([1.0, 2.0, 0.0], 4e-4)
    for row in range(3):
        frame = np.roll(np.eye(3), row, axis=0) @ noise
        group = point_group("Dinfh", frame)
        shape = Shape(points=CUBE)
        entry = bop_entry(placed(box[1], group, np.array([3e-4, -3e-4, 2e-4])), shape)
        (axis,) = entry["symmetries_continuous"]
        assert sum(axis["axis"]) == 1.0
        assert axis["offset"] == [0.0, 0.0, 0.0]
        (flip,) = entry["symmetries_discrete"]
        assert set(flip) == {-1.0, 0.0, 1.0}


def test_what_is_clearly_tilted_stays_so(box: tuple[Shape, Detection]) -> None:
    group = point_group("Cinfv", rotation([1.0, 0.0, 0.0], 5e-3))
    (axis,) = bop_entry(placed(box[1], group), Shape(points=CUBE))["symmetries_continuous"]
    np.testing.assert_allclose(axis["axis"], group.frame[2], atol=1e-15)
    assert np.dot(axis["axis"], axis["offset"]) == pytest.approx(0.0, abs=1e-12)


def test_only_the_axis_of_a_prism_is_put_on_the_axes_of_the_file(box: tuple[Shape, Detection]) -> None:
    group = point_group("D6h", rotation([0.0, 0.0, 1.0], 0.2) @ rotation([1.0, 0.0, 0.0], 5e-4))
    motions = motions_as_read(bop_entry(placed(box[1], group), Shape(points=CUBE)), 1)
    assert sorted(m[2, 2] for m in motions) == [-1.0] * 6 + [1.0] * 6
    assert all(m[0, 2] == m[2, 0] == 0.0 for m in motions)


def test_a_sphere_has_three_axes_and_says_that_more_are_meant(box: tuple[Shape, Detection]) -> None:
    sphere = placed(box[1], point_group("Kh"))
    entry = bop_entry(sphere, Shape(points=CUBE + CENTER))
    assert [s["axis"] for s in entry["symmetries_continuous"]] == np.eye(3).tolist()
    assert "sphere" in bop_limits(sphere)
    assert bop_limits(box[1]) == ""


def test_size_is_in_millimetres(box: tuple[Shape, Detection]) -> None:
    entry = bop_entry(box[1], box[0], scale=1000.0)
    assert entry["diameter"] == pytest.approx(2000.0 * math.sqrt(14.0), rel=1e-14)
    assert [entry[f"min_{k}"] for k in "xyz"] == [-3000.0, -2000.0, -1000.0]
    assert [entry[f"size_{k}"] for k in "xyz"] == [6000.0, 4000.0, 2000.0]
    with pytest.raises(InputError, match="scale"):
        bop_entry(box[1], box[0], scale=0.0)


def test_the_undecided_is_not_exported_as_asymmetric(box: tuple[Shape, Detection]) -> None:
    with pytest.raises(InputError, match="too few points"):
        bop_entry(replace(box[1], undetermined="too few points"), box[0])


def test_diameter_is_exact() -> None:
    rng = np.random.default_rng(1)
    cloud = rng.standard_normal((1500, 3)) * [1.0, 2.0, 5.0] + 100.0
    flat = cloud @ np.diag([1.0, 1.0, 0.0]) @ tilted(1)
    line = np.outer(rng.uniform(size=50), [1.0, 2.0, 3.0]) + 7.0
    ball = cloud / np.linalg.norm(cloud - cloud.mean(axis=0), axis=1, keepdims=True)
    for points in (cloud, flat, line, ball, CUBE, CUBE[:2], CUBE[:3]):
        expected = max(np.linalg.norm(points - p, axis=1).max() for p in points)
        assert diameter(points) == pytest.approx(expected, rel=1e-13)


def test_entries_of_other_objects_stay(tmp_path: Path) -> None:
    path = tmp_path / "models_info.json"
    path.write_text(bop_text(path, {3: {"diameter": 3.0}}))
    path.write_text(json.dumps(json.loads(path.read_text()) | {"12": {"diameter": 0.1, "align_axes": [1]}}))
    path.write_text(bop_text(path, {1: {"diameter": 1.0}, 3: {"diameter": 4.0}}))
    assert list(read_models_info(path).items()) == [
        ("3", {"diameter": 4.0}),
        ("12", {"diameter": 0.1, "align_axes": [1]}),
        ("1", {"diameter": 1.0}),
    ]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("content", ["", "ply\n", "[1, 2]", '{"1": 2}', '{"1": {"diameter": NaN}}', "[" * 100_000])
def test_what_is_no_models_info_is_left_alone(tmp_path: Path, content: str) -> None:
    path = tmp_path / "models_info.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"models_info\.json: is there already"):
        bop_text(path, {1: {"diameter": 1.0}})
    assert path.read_text() == content


# --- records ----------------------------------------------------------------------------------------------------------


def test_a_record_says_what_was_found(box: tuple[Shape, Detection]) -> None:
    shape, detection = box
    record = detection_record(detection, shape, options={"seed": 0}, load_s=0.5)
    assert json.loads(json_text(record)) == record
    assert record["schema"] == "symrefine.detection/1"
    assert (record["point_group"], record["inversion"], record["undetermined"]) == ("D2h", True, None)
    assert record["source"] == "box"
    assert next(iter(record["timings"])) == "load"
    assert list(record)[-1] == "timings"
    other = Alternative(point_group="D4h", probability=0.25, forgiven=0.03)
    doubtful = detection_record(replace(detection, confidence=0.75, alternatives=(other,)), shape, options={})
    assert doubtful["confidence"] == 0.75
    assert doubtful["alternatives"] == [{"point_group": "D4h", "probability": 0.25, "forgiven": 0.03}]
    assert sorted(np.argmax(p["normal"]) for p in record["planes"]) == [0, 1, 2]
    assert [a["order"] for a in record["axes"]] == [2, 2, 2]
    assert 0.0 < record["inversion_confidence"] <= 1.0
    nothing = replace(detection, inversion=False, inversion_residual=None, inversion_confidence=None)
    told = detection_record(nothing, shape, options={})
    assert (told["inversion"], told["inversion_residual"], told["inversion_confidence"]) == (False, None, None)
    for element in [*record["planes"], *record["axes"], {"residual": record["inversion_residual"]}]:
        assert list(element["residual"]) == ["mean", "p95", "p99", "max"]
        assert element["residual"]["mean"] <= element["residual"]["max"]


def test_planes_and_axes_keep_their_place_when_their_sign_is_chosen(box: tuple[Shape, Detection]) -> None:
    miss = Deviation(**{field.name: 0.0 for field in fields(Deviation)})
    plane = Plane(normal=np.array([1e-9, -0.6, 0.8]), offset=2.0)
    axis = Axis(point=CENTER, direction=np.array([0.0, 0.0, -1.0]))
    changed = replace(
        box[1],
        planes=(
            FoundPlane(plane=plane, residual=miss, confidence=1.0, sigma_rad=math.nan, sigma=math.nan, coverage=ALL),
        ),
        axes=(
            FoundAxis(
                axis=axis,
                order=math.inf,
                improper=False,
                residual=miss,
                confidence=0.5,
                sigma_rad=0.1,
                sigma=0.2,
                coverage=ALL,
            ),
        ),
    )
    record = detection_record(changed, box[0], options={})
    np.testing.assert_allclose(record["planes"][0]["normal"], [-1e-9, 0.6, -0.8], atol=1e-12)
    assert record["planes"][0]["offset"] == -2.0
    assert record["axes"][0]["direction"] == [0.0, 0.0, 1.0]
    assert record["axes"][0]["order"] == "inf"


@pytest.mark.parametrize(
    ("value", "expected"),
    [(1 / 3, 0.333333333333), (-0.0, 0.0), (1e-13, 0.0), (math.inf, "inf"), (-math.inf, "-inf"), (math.nan, None)],
)
def test_numbers_are_what_json_knows(value: float, expected: object) -> None:
    assert number(value, 1.0) == expected
    assert str(number(value, 1.0)) == str(expected)


def test_the_sign_does_not_hang_on_noise() -> None:
    assert toward_positive(np.array([1e-3, -1.0, 0.0])) == toward_positive(np.array([-1e-3, -1.0, 0.0])) == -1.0


def test_json_is_strict() -> None:
    with pytest.raises(ValueError, match="JSON"):
        json_text({"a": math.nan})
    assert json_text({"a": [{"b": 1}, {"b": 2}], "ü": []}) == (
        '{\n  "a": [\n    {"b": 1},\n    {"b": 2}\n  ],\n  "\\u00fc": []\n}\n'
    )


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_file_is_whole_or_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    path.chmod(0o640)

    def write_half() -> None:
        with replacing(path) as draft:
            draft.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_text() == "old"
    with replacing(path) as draft:
        assert draft.suffix == ".json"
        draft.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "there" / "file")
    with replacing(link) as draft:
        draft.write_text("x")
    assert link.is_symlink()
    assert (tmp_path / "there" / "file").read_text() == "x"


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no /dev/null")
def test_a_device_is_written_to_and_not_replaced() -> None:
    check_target(Path("/dev/null"))
    with replacing(Path("/dev/null")) as draft:
        draft.write_text("x")
    assert Path("/dev/null").is_char_device()


def test_targets_are_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a directory"):
        check_target(tmp_path)
    with pytest.raises(InputError, match="there is no directory"):
        check_target(tmp_path / "a" / "b.json")
    check_target(tmp_path / "b.json")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_targets_without_permission_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("")
    (tmp_path / "a.json").chmod(0o444)
    with pytest.raises(InputError, match="write-protected"):
        check_target(tmp_path / "a.json")
    tmp_path.chmod(0o555)
    with pytest.raises(InputError, match="no permission"):
        check_target(tmp_path / "b.json")
    tmp_path.chmod(0o755)
