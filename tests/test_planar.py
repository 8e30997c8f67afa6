"""Symmetry in the plane: groups in any pose, under noise, at every resolution; siblings; doubt; the command line."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from experiments.objects.drawings import CASE_STUDY, DRAWINGS, Drawing
from experiments.objects.pictures import FINISHES, Pose, coverage, fit, picture, random_pose, sibling
from experiments.studies.planar_cases import Case as StudyCase
from experiments.studies.planar_cases import run as run_study
from experiments.studies.planar_images import Case, check, examine, run
from symrefine.cli import invoke
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.export.records import planar_record
from symrefine.geometry import Array
from symrefine.plane import PLANAR_ORDERS, PlanarDetection, detect_planar
from symrefine.plane.outline import smallest_diagonal
from symrefine.plane.raster import raster_of
from symrefine.shape import Shape

QUICK = ("disc on the x axis", "heart", "letter N", "letter R", "star", "pinwheel of 4", "ring")


def turn(angle_rad: float) -> Array:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def polygon(fold: int, count: int, rng: np.random.Generator) -> Array:
    """Random points of the outline of a regular polygon, one corner on the x axis."""
    corners = np.array([[np.cos(a), np.sin(a)] for a in 2 * np.pi * np.arange(fold + 1) / fold])
    side, along = rng.integers(fold, size=count), rng.random(count)[:, None]
    return corners[side] * (1 - along) + corners[side + 1] * along


def angle_off(normal: Array, direction_rad: float) -> float:
    """Angle in degrees between a line given by its normal and a direction."""
    return float(np.degrees(np.arcsin(min(1.0, abs(normal @ [np.cos(direction_rad), np.sin(direction_rad)])))))


# --- pictures ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "finish"), [(n, f) for k, n in enumerate(QUICK) for f in (FINISHES[k % 5], FINISHES[(k + 2) % 5])]
)
def test_groups_and_lines_in_random_poses(name: str, finish: str) -> None:
    row = run(Case(drawing=name, finish=finish, side=160, seed=len(name)))
    assert row["found"] == row["truth"] == DRAWINGS[name].group
    assert row["lines_found"] == len(DRAWINGS[name].line_angles)
    assert row["lines_false"] == 0
    assert row["offset_rel"] is None or row["offset_rel"] < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("finish", FINISHES)
@pytest.mark.parametrize("name", sorted(DRAWINGS))
def test_every_drawing_in_every_finish(name: str, finish: str) -> None:
    # The veins of the leaf are thinner than the grain lets through.
    if (name, finish) != ("leaf", "noisy"):
        assert run(Case(drawing=name, finish=finish, seed=1))["right"]


@pytest.mark.parametrize("side", [64, 400])
@pytest.mark.parametrize("name", ["heart", "letter N", "star"])
def test_resolution(name: str, side: int) -> None:
    assert run(Case(drawing=name, side=side, seed=3))["right"]


@pytest.mark.parametrize("defect", ["bump", "bite"])
@pytest.mark.parametrize(
    "name",
    [
        "rectangle",
        "letter Z",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("heart", "star", "pinwheel of 3", "ring")),
    ],
)
def test_siblings_lose_the_symmetry(name: str, defect: str) -> None:
    row = run(Case(drawing=name, defect=defect, seed=5))
    assert row["truth"] == ("D1" if name == "ring" else "C1")
    assert row["found"] == row["truth"]


def test_a_larger_tolerance_forgives_the_sibling_and_lists_its_miss() -> None:
    case = Case(drawing="star", defect="bump", seed=1)
    strict, lax = run(case), run(Case(drawing="star", defect="bump", seed=1, tolerance=0.08))
    assert strict["found"] == "C1"
    assert strict["near_excess"] is not None
    assert 1.0 < float(strict["near_excess"]) < 5.0
    assert lax["found"] == "D5"


def test_rotated_rasters_are_pixels_too() -> None:
    drawing = DRAWINGS["disc on the x axis"]
    share = coverage(drawing, Pose(radius=50.0, side=128))
    row, column = np.nonzero(share)
    upright = np.column_stack([column, -row]).astype(float)
    points = 0.37 * upright @ turn(0.7).T + [4.0, -9.0]
    raster = raster_of(points, share[row, column])
    assert raster is not None
    assert raster.pitch == pytest.approx(0.37, rel=1e-6)
    found = detect_planar(points, weights=share[row, column])
    assert found.point_group == "D1"
    assert angle_off(found.lines[0].line.normal, 0.7) < 0.2


def test_a_mirrored_picture_has_the_mirrored_answer() -> None:
    rng = np.random.default_rng(8)
    pose = random_pose(rng)
    image = picture(coverage(DRAWINGS["arrow"], pose), "clean", rng)
    straight = examine(DRAWINGS["arrow"], pose, image).detection
    flipped = examine(DRAWINGS["arrow"], pose, image.transpose(Image.Transpose.FLIP_LEFT_RIGHT)).detection
    mirrored = straight.lines[0].line.normal * [-1, 1]
    assert abs(mirrored @ flipped.lines[0].line.normal) == pytest.approx(1.0, abs=1e-6)


def test_weights_count() -> None:
    """A square whose left half is half as dark keeps one line only."""
    share = np.zeros((100, 100))
    share[20:80, 20:80] = 1.0
    row, column = np.nonzero(share)
    points = np.column_stack([column, -row]).astype(float)
    assert detect_planar(points).point_group == "D4"
    found = detect_planar(points, weights=np.where(points[:, 0] < 49.5, 0.5, 1.0))
    assert found.point_group == "D1"
    assert angle_off(found.lines[0].line.normal, 0.0) < 0.1


# --- points -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("fold", [3, 4, 5, 8])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_samples_of_outlines(fold: int, noise: float) -> None:
    rng = np.random.default_rng([fold, int(1000 * noise)])
    angle = rng.uniform(0, 2 * np.pi)
    points = polygon(fold, 1500, rng) + noise * rng.normal(size=(1500, 2))
    found = detect_planar(5.0 * points @ turn(angle).T + [100.0, -3.0])
    assert found.point_group == f"D{fold}"
    np.testing.assert_allclose(found.center, [100.0, -3.0], atol=0.1)
    truth = angle + np.pi * np.arange(fold) / fold
    assert all(min(angle_off(f.line.normal, a) for a in truth) < 1.0 for f in found.lines)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.integers(2, 9), st.booleans(), st.floats(0.0, 6.28), st.floats(-3.0, 3.0), st.integers(0, 10**6))
def test_few_points_stand_for_themselves(fold: int, mirrored: bool, angle: float, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    part = np.array([[1.0, 0.17], [0.55, 0.4 / fold]]) + 0.02 * rng.normal(size=(2, 2))
    if mirrored:
        part = np.concatenate([part, part * [1, -1]])
    points = np.concatenate([part @ turn(2 * np.pi * k / fold).T for k in range(fold)])
    moved = 10.0**size * (points @ turn(angle).T + [0.3, -2.0])
    found = detect_planar(moved, tolerance=0.002)
    assert found.point_group == f"{'D' if mirrored else 'C'}{fold}"
    np.testing.assert_allclose(found.center, 10.0**size * np.array([0.3, -2.0]), atol=1e-4 * 10.0**size)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["gauss", "wide gauss", "disc", "rectangle", "square"], ids=lambda name: name.replace(" ", "-")
)
def test_what_noise_hides_is_not_decided(name: str) -> None:
    rng = np.random.default_rng(7)
    points = {
        "gauss": rng.normal(size=(300, 2)),
        "wide gauss": rng.normal(size=(300, 2)) * [2, 1],
        "disc": turned_disc(300, rng),
        "rectangle": rng.uniform(-1, 1, (300, 2)) * [1, 0.5],
        "square": rng.uniform(-1, 1, (300, 2)),
    }[name]
    found = detect_planar(points)
    assert "more points" in found.undetermined
    assert found.point_group == "undetermined"
    assert found.confidence == 0.0
    assert found.group.name == "C1"
    assert not found.lines
    assert found.rotation is None


def turned_disc(count: int, rng: np.random.Generator) -> Array:
    radius, angle = np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def test_noise_does_not_hide_what_has_no_symmetry() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(0, 1, (2000, 2)) * [1, 1.6]
    points = points[(points[:, 0] < 0.4) | (points[:, 1] < 0.4)]
    found = detect_planar(points)
    assert found.point_group == "C1"
    assert not found.undetermined


def test_areas_of_many_points_are_decided() -> None:
    rng = np.random.default_rng(3)
    found = detect_planar(rng.uniform(-1, 1, (4000, 2)) * [1, 0.5] @ turn(0.4).T)
    assert found.point_group == "D2"
    assert not found.undetermined


def test_too_few_pixels() -> None:
    y, x = np.mgrid[:16, :16] - 7.5
    inside = np.maximum(abs(x), abs(y)) < 4.6
    found = detect_planar(np.column_stack([x[inside], y[inside]]))
    assert found.undetermined.startswith("the pixels could hide anything: what they leave unknown alone needs ")


def test_same_input_same_answer() -> None:
    points = polygon(3, 6000, np.random.default_rng(4)) + 0.01 * np.random.default_rng(5).normal(size=(6000, 2))
    first, second = (planar_record(detect_planar(points), Shape.of(points), options={}) for _ in range(2))
    assert {**first, "timings": 0} == {**second, "timings": 0}


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match="takes 2-D shapes; these points have 3 coordinates"):
        detect_planar(np.random.default_rng(0).normal(size=(30, 3)))
    with pytest.raises(InputError, match="weights belong to the Shape"):
        detect_planar(Shape.of(np.eye(2)), weights=[1.0, 2.0])
    for tolerance in (0.0, 0.3, float("nan")):
        with pytest.raises(InputError, match="expected a fraction of the diagonal"):
            detect_planar(np.eye(2), tolerance=tolerance)
    with pytest.raises(DegenerateShapeError):
        detect_planar(np.ones((50, 2)))


# --- doublets ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("drawing", CASE_STUDY, ids=lambda d: d.name)
@pytest.mark.parametrize("angle_deg", [0.0, 33.0])
def test_the_case_study_of_the_paper(drawing: Drawing, angle_deg: float) -> None:
    row = run_study(StudyCase(object=drawing.name, angle_deg=angle_deg, side=200))
    ratios = [row[f"ratio_{p}_{q}"] for p, q in PLANAR_ORDERS]
    assert row["found"] == drawing.group
    assert row["doublets"] == {"D2": "centre", "D1": "line", "C1": "none"}[drawing.group]
    if drawing.group == "D2":
        assert ratios == [None] * 10
    elif drawing.group == "D1":
        assert min(float(r) for r in ratios if r is not None) > 20.0
        assert row["doublets_deg"] is not None
        assert float(row["doublets_deg"]) < 1.5
    else:
        assert max(float(r) for r in ratios if r is not None) < 10.0


def test_doublets_of_exact_points_lie_on_the_line() -> None:
    rng = np.random.default_rng(1)
    half = rng.normal(size=(20, 2)) + [0.0, 0.5]
    points = np.concatenate([half, half * [1, -1]]) @ turn(1.1).T
    found = detect_planar(points)
    assert found.doublets.kind == "line"
    assert abs(found.doublets.angle_rad - 1.1) < 1e-9
    assert found.doublets.singular_values[1] < 1e-9
    assert all(np.isinf(v.ratio) for v in found.doublets.vectors)
    assert len(found.vectors.vectors) == 56
    np.testing.assert_allclose(smallest_diagonal(points), smallest_diagonal(points @ turn(0.3)), rtol=1e-3)


def test_the_smallest_box_of_a_large_picture_takes_its_corners_alone() -> None:
    rows, columns = np.mgrid[0:700, 0:1400].astype(float)
    pixels = np.column_stack([columns.ravel(), rows.ravel()]) @ turn(0.2).T
    tracemalloc.start()
    assert smallest_diagonal(pixels) == pytest.approx(np.hypot(699, 1399), rel=1e-3)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 20 * pixels.nbytes, "once 200 times as much, and nine seconds"
    line = np.outer(np.arange(9.0), [1.0, 2.0])
    assert smallest_diagonal(line) == pytest.approx(8.0 * np.sqrt(5.0), rel=1e-4)


# --- experiments ------------------------------------------------------------------------------------------------------


def test_impossible_cases() -> None:
    with pytest.raises(InputError, match=r"drawing: value is 'cube', expected one of arrow, "):
        check(Case(drawing="cube"))
    with pytest.raises(InputError, match="defect: value is 'bump', expected 'none': key has no symmetry to lose"):
        check(Case(drawing="key", defect="bump"))
    with pytest.raises(InputError, match="side: value is 4, expected a number from 16 to 2048"):
        check(Case(side=4))


def test_siblings_differ_by_one_detail_far_from_its_images() -> None:
    drawing = DRAWINGS["star"]
    with_bump = sibling(drawing, "bump", 0.06)
    assert with_bump.group == "C1"
    assert sibling(drawing, "none", 0.06) is drawing
    pose = Pose(radius=100.0)
    added = np.count_nonzero(coverage(with_bump, pose) > coverage(drawing, pose) + 0.5)
    assert 100 < added < 600
    reach = np.linalg.norm(fit(drawing.layers).apply(drawing.layers[0][0]), axis=1).max()
    assert reach == pytest.approx(1.0)


# --- command line -----------------------------------------------------------------------------------------------------


@pytest.fixture
def arrow(tmp_path: Path) -> Path:
    path = tmp_path / "arrow.png"
    rng = np.random.default_rng(0)
    picture(coverage(DRAWINGS["arrow"], Pose(angle_rad=0.5, radius=60.0, side=160)), "photo", rng).save(path)
    return path


def test_detect_prints_a_picture(arrow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["detect", str(arrow), "--threshold", "otsu"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{arrow}: D1, one mirror line; tolerance 2 %, confidence 1.00")
    assert "n-tuples lie on one line: a mirror line at most" in shown
    assert "v(p,p')" in shown
    assert "(8, 9)" in shown


def test_detect_writes_json_of_two_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = polygon(5, 1200, np.random.default_rng(0))
    np.savetxt(tmp_path / "a.csv", points, delimiter=",")
    assert invoke(["detect", str(tmp_path / "a.csv"), "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["schema"] == "symrefine.detection2d/1"
    assert record["point_group"] == "D5"
    assert len(record["lines"]) == 5
    assert record["rotation"]["order"] == 5
    assert len(record["ntuples"]["vectors"]) == 10
    assert all(v["ratio"] is None for v in record["ntuples"]["vectors"])
    assert "threshold" not in record["options"]


@pytest.mark.slow
def test_detect_prints_round_and_undetermined(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, 1000)
    np.save(tmp_path / "ring.npy", np.column_stack([np.cos(angle), np.sin(angle)]))
    np.save(tmp_path / "cloud.npy", rng.normal(size=(300, 2)))
    assert invoke(["detect", str(tmp_path / "ring.npy")]) == 0
    assert "O(2), round" in capsys.readouterr().out
    assert invoke(["detect", str(tmp_path / "cloud.npy")]) == 0
    assert "undetermined: " in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--bop", "--recording"])
def test_detect_refuses_what_is_for_space(arrow: Path, option: str, capsys: pytest.CaptureFixture[str]) -> None:
    target = arrow.with_name({"--bop": "b.json", "--recording": "b.rrd"}[option])
    assert invoke(["detect", str(arrow), option, str(target)]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert f"{option} {target}: is for objects in space; {arrow} lies in the plane; use --report" in told.err
    assert not target.exists()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty (0 bytes)"),
        (b"not a picture", "not a PNG image: begins with 'not a pi'"),
        (None, "all 20 x 20 pixels have the same grey value 1: there is no object"),
    ],
)
def test_detect_refuses_bad_pictures(
    tmp_path: Path, content: bytes | None, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.png"
    if content is None:
        Image.new("L", (20, 20), 255).save(path)
    else:
        path.write_bytes(content)
    assert invoke(["detect", str(path), "--json", str(tmp_path / "out.json")]) == 2
    shown = capsys.readouterr()
    assert shown.err.count("\n") == 1
    assert told in shown.err
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize("value", ["0", "1", "128", "nan", "auto"])
def test_thresholds_that_are_none(arrow: Path, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["detect", str(arrow), "--threshold", value]) == 2
    assert "is not" in capsys.readouterr().err


def test_threshold_is_for_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savetxt(tmp_path / "a.csv", np.random.default_rng(0).normal(size=(40, 3)), delimiter=",")
    assert invoke(["detect", str(tmp_path / "a.csv"), "--invert"]) == 2
    assert "threshold and invert apply to pictures and volumes only: .bmp" in capsys.readouterr().err


def test_confidence_of_nothing() -> None:
    found = detect_planar(np.random.default_rng(0).normal(size=(12, 2)))
    assert isinstance(found, PlanarDetection)
    assert found.point_group == "C1"
    assert found.confidence > 0.9


@pytest.mark.parametrize("tone", [0.26, 0.5, 0.74])
def test_the_tone_of_an_area_may_be_any(tone):
    """At the very tone of a flat area grain alone drew an outline, islands at random, and nothing was symmetric."""
    rng = np.random.default_rng(round(100 * tone))
    x, y = (np.mgrid[:160, :160] - 79.7) / 75.0
    radius, wave = np.hypot(x, y), np.cos(6.0 * np.arctan2(y, x) + 0.4)
    inside = [np.clip(75.0 * (r * (1.0 + 0.15 * wave) - radius) + 0.5, 0.0, 1.0) for r in (0.8, 0.35)]
    values = tone * inside[0] + (1.0 - tone) * inside[1]
    grain = np.where(inside[0] > 0.0, values + rng.normal(scale=0.012, size=values.shape), 0.0)
    row, column = np.nonzero(grain > 0.0)
    points = np.column_stack([column, -row]).astype(float)
    found = detect_planar(Shape(points=points, weights=grain[row, column]))
    assert found.point_group == "D6"
    assert found.confidence > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 8, 14])
def test_a_fit_that_ends_beside_a_line_hides_no_better_start(seed):
    """One of twelve marks is larger; where grain puts the doublets' line off, its fit ends beside the mirror."""
    rng = np.random.default_rng(seed)
    angles = np.radians(10.0 + 17.0 * seed) + np.pi / 6.0 * np.arange(12)
    place = (np.mgrid[:300, :300].reshape(2, -1).T - 149.5) / 125.0
    radius = np.hypot(*place.T)
    ink = (radius > 0.93) & (radius < 1.0)
    for k, angle in enumerate(angles):
        along, across = place @ [np.cos(angle), np.sin(angle)], abs(place @ [-np.sin(angle), np.cos(angle)])
        ink |= (along > 0.75 - 0.15 * (k == 0)) & (along < 0.92) & (across < 0.035 + 0.03 * (k == 0))
    grey = np.clip(ink + rng.normal(scale=12.0 / 255.0, size=len(ink)), 0.0, 1.0)
    found = detect_planar(Shape(points=place, weights=grey))
    assert found.point_group == "D1"
    assert angle_off(found.lines[0].line.normal, angles[0]) < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("fold", [37, 40, 60])
def test_folds_of_many_points_are_no_divisors(fold):
    angles = 2.0 * np.pi * np.arange(fold) / fold + 0.3
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    found = detect_planar(Shape(points=np.concatenate([ring, 0.5 * ring])), tolerance=0.005)
    assert (found.point_group, found.confidence > 0.95) == (f"D{fold}", True)


@pytest.mark.slow
@pytest.mark.parametrize("grain", [0.0, 0.03])
def test_what_stands_out_from_a_faint_object_counts(grain):
    """Black hands on a grey clock face cover less than a twentieth of it; grain alone stands out as well."""
    y, x = np.mgrid[-1.2:1.2:240j, -1.2:1.2:240j]
    face = np.where(np.hypot(x, y) < 1.0, 0.35, 0.0)
    spot = np.hypot(x - 0.5, y - 0.2) < 0.12
    noise = grain * np.random.default_rng(5).standard_normal(face.shape) * (face > 0)
    for tones, group in ((face, "O(2)"), (np.where(spot, 1.0, face), "D1")):
        weights = np.maximum(tones + noise, 0.0).ravel()
        found = detect_planar(Shape(points=np.column_stack([x.ravel(), y.ravel()]), weights=weights))
        assert found.point_group == group


@pytest.mark.parametrize("heavier", [1.02, 1.2, 2.0])
def test_few_points_of_other_mass_are_other_things(heavier):
    angles = 2.0 * np.pi * np.arange(6) / 6 + 0.3
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    for masses, group in (([heavier, 1, 1, 1, 1, 1], "D1"), ([1, heavier] * 3, "D3"), ([1, 1.001] * 3, "D6")):
        assert detect_planar(Shape(points=ring, weights=np.array(masses, dtype=float))).point_group == group
