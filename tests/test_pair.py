"""What is shown of an alignment: what each place of either object says, the ways between them, picture, page, rrd.

The page is driven in a Chromium where there is one.
"""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import symrefine
from experiments.objects.molecule_sets import molecule
from experiments.objects.shapes import asymmetric, sample, table
from symrefine.align.witnesses import witnesses
from symrefine.cli import invoke
from symrefine.errors import InputError
from symrefine.geometry import Array, Isometry, random_orthogonal
from symrefine.picture.pair import MOST_WAYS, Pair, make_pair
from symrefine.picture.palette import CONTRADICTED, INFERRED, OUTLIER
from symrefine.shape import Shape
from symrefine.viewer.pair import view
from tests.chromium import BROWSER, PHONE, Tab
from tests.test_viewer import column, entities, rerun, rows

TOLERANCE = 0.02
WHOLE = asymmetric()


def turned(det: int = 1, seed: int = 4) -> Isometry:
    rng = np.random.default_rng(seed)
    return Isometry(matrix=random_orthogonal(rng, det=det), shift=WHOLE.diagonal * np.array([3.0, -2.0, 5.0]))


def cut(keep: float = 0.7) -> Array:
    """A cloud of which the part with the highest x is missing."""
    points = sample(WHOLE, 6000, 0.0, np.random.default_rng(2))
    return points[points[:, 0] <= np.quantile(points[:, 0], keep)]


@pytest.fixture(scope="module")
def parted() -> symrefine.Alignment:
    """A cloud onto the mirrored part of it that was seen."""
    cloud = Shape(sample(WHOLE, 6000, 0.0, np.random.default_rng(1)), source="model.ply")
    return symrefine.align(cloud, Shape(turned(-1).apply(cut()), source="scan.ply"))


@pytest.fixture(scope="module")
def symmetric() -> symrefine.Alignment:
    """A mesh with four mirrors onto a cloud of it: eight maps."""
    cloud = sample(table(), 5000, 0.003, np.random.default_rng(3)) @ turned().matrix.T
    return symrefine.align(replace(table(), source="table.ply"), Shape(cloud, source="cloud.ply"))


def scene(found: symrefine.Alignment) -> Pair:
    return make_pair(found, found.source, found.target, TOLERANCE)


# --- what each place says ---------------------------------------------------------------------------------------------


def test_what_was_cut_off_was_not_seen_and_the_rest_meets(parted: symrefine.Alignment) -> None:
    source, target = scene(parted).shares(0)
    assert source.met == pytest.approx(0.7, abs=0.06)
    assert source.unseen == pytest.approx(0.3, abs=0.06)
    assert target.met > 0.95
    assert max(source.contradicted, target.contradicted) < 0.03
    for side in (source, target):
        assert side.met + side.contradicted + side.unseen == pytest.approx(1.0)


def test_a_wrong_map_is_contradicted() -> None:
    motion = turned()
    asked = witnesses(WHOLE, replace(WHOLE, points=motion.apply(WHOLE.points)), tolerance=TOLERANCE)
    center = WHOLE.points.mean(axis=0)
    for misses in asked.misses(-motion.matrix, motion.apply(center) + motion.matrix @ center):
        assert (misses > asked.far).mean() > 0.2
        assert not np.isnan(misses).any(), "nothing can be missing of a closed mesh"


@pytest.mark.parametrize("det", [1, -1])
def test_a_mesh_meets_itself_wherever_it_is(det: int) -> None:
    motion = turned(det)
    moved = replace(WHOLE, points=2.0 * motion.apply(WHOLE.points))
    asked = witnesses(WHOLE, moved, scale=2.0, tolerance=TOLERANCE)
    for misses in asked.misses(motion.matrix, 2.0 * motion.shift):
        assert (misses <= asked.far).mean() > 0.99


def test_the_way_back_is_the_same_seen_from_the_other_side(parted: symrefine.Alignment) -> None:
    back = parted.matrix.T, -parted.matrix.T @ parted.translation
    one = witnesses(parted.source, parted.target, tolerance=TOLERANCE)
    other = witnesses(parted.target, parted.source, tolerance=TOLERANCE)
    there, again = one.misses(parted.matrix, parted.translation), other.misses(*back)[::-1]
    for a, b in zip(there, again, strict=True):
        assert np.isnan(a).mean() == pytest.approx(np.isnan(b).mean(), abs=0.01)
        assert (a <= one.far).mean() == pytest.approx((b <= other.far).mean(), abs=0.01)


def test_points_that_stand_for_themselves_are_asked_one_by_one() -> None:
    points = np.random.default_rng(0).normal(size=(30, 3))
    moved = points.copy()
    moved[7] += 10.0
    asked = witnesses(Shape(points), Shape(moved), tolerance=TOLERANCE)
    there, back = asked.misses(np.eye(3), np.zeros(3))
    assert np.flatnonzero(there > asked.far).tolist() == np.flatnonzero(back > asked.far).tolist() == [7]
    away, owner = asked.nearest(0, points[[3, 12]] + 1e-6)
    assert owner.tolist() == [3, 12]
    assert away.max() < 1e-5


# --- the ways ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_few_points_onto_a_surface_are_shown_although_no_border_is_told_of_so_few(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    target = rng.normal(size=(5000, 3))
    target *= np.array([1.0, 1.0, 2.0]) / np.linalg.norm(target, axis=1)[:, None]
    symrefine.align(rng.normal(size=(9, 3)), target).save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("case", ["parted", "symmetric"])
def test_every_way_leads_from_beside_to_where_the_map_takes_it(case: str, request: pytest.FixtureRequest) -> None:
    found = request.getfixturevalue(case)
    pair, beside = scene(found), np.array([7.0, 8.0, 9.0])
    local = pair.source.outline
    for way, matrix, shift in zip(pair.ways, found.coset.matrices, found.coset.translations, strict=True):
        assert way.determinant == np.sign(np.linalg.det(matrix))
        start, end = way.part(0.0, beside), way.part(1.0, beside)
        np.testing.assert_allclose(start[0], np.eye(3), atol=1e-12)
        np.testing.assert_array_equal(start[1], beside)
        np.testing.assert_allclose(end[0], matrix, atol=1e-9)
        given = pair.source.given(local)
        expected = given @ matrix.T + shift
        np.testing.assert_allclose(pair.target.given(local @ end[0].T + end[1]), expected, atol=1e-9)
        whole = np.column_stack([given, np.ones(len(given))]) @ way.transform.T
        np.testing.assert_allclose(whole[:, :3], expected, atol=1e-9)


def test_what_stands_beside_does_not_overlap(parted: symrefine.Alignment) -> None:
    pair = scene(parted)
    for direction in (*np.eye(3), *-np.eye(3)):
        moved = pair.source.outline + pair.beside(direction)
        assert (moved @ direction).min() > (pair.target.outline @ direction).max()


def test_sizes_that_differ_are_shown_as_one() -> None:
    points = sample(WHOLE, 4000, 0.0, np.random.default_rng(6))
    found = symrefine.align(1e-3 * points[::2], turned().apply(points[1::2]), scale=True)
    pair = scene(found)
    assert found.scale == pytest.approx(1e3, rel=0.02)
    assert min(shares.met for shares in pair.shares(0)) > 0.9
    reach = [float(np.ptp(side.outline, axis=0).max()) for side in pair.sides]
    assert reach[0] == pytest.approx(reach[1], rel=0.5)
    for side in pair.sides:
        assert (pair.misses(side.index, side.shape.points)[0] < 0.0).mean() < 0.01, "no strays"


def test_strays_are_out_of_the_picture() -> None:
    rng = np.random.default_rng(7)
    points, box = sample(WHOLE, 5000, 0.0, rng), 4.0 * WHOLE.diagonal * (rng.random((300, 3)) - 0.5)
    pair = scene(symrefine.align(np.concatenate([points[::2], box]), points[1::2]))
    body = np.linalg.norm(pair.target.outline, axis=1).max()
    assert np.quantile(np.linalg.norm(pair.source.outline, axis=1), 0.99) < 1.5 * body
    assert (pair.misses(0, pair.source.shape.points)[0] < 0.0)[-300:].mean() > 0.8


def test_of_very_many_maps_some_are_shown() -> None:
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    pair = scene(symrefine.align(cube, cube))
    assert (pair.equivalents, len(pair.ways)) == (48, MOST_WAYS)


# --- the picture ------------------------------------------------------------------------------------------------------


def has(picture: Array, colour: tuple[int, int, int]) -> float:
    """Share of the pixels that are of about this hue."""
    direction = np.array(colour, dtype=float)
    cosine = picture @ direction / np.maximum(np.linalg.norm(picture, axis=2) * np.linalg.norm(direction), 1e-9)
    return float((cosine > 0.995).mean())


def test_the_picture_shows_before_and_after(parted: symrefine.Alignment, tmp_path: Path) -> None:
    parted.save(tmp_path / "a.png")
    picture = np.asarray(imread(BytesIO((tmp_path / "a.png").read_bytes())), dtype=float)[76:-104, :, :3]
    before, after = picture[:, :600], picture[:, 600:]
    assert picture.shape == (720, 1200, 3)
    assert has(before, INFERRED) == 0.0
    assert has(after, INFERRED) > 0.02
    assert has(after, CONTRADICTED) < 0.01
    assert (before.min(axis=2) < 0.9).mean() > 0.1


# --- in Python --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_alignment_speaks_as_a_detection_does(parted: symrefine.Alignment, tmp_path: Path) -> None:
    html = parted._repr_html_()
    assert "model.ply onto scan.ply" in html
    assert html.count("<tr>") == 3
    assert "data:image/png;base64," in html
    assert parted.plot().images
    assert symrefine.report(parted, tmp_path / "a.html") is parted
    assert (tmp_path / "a.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    with pytest.raises(InputError, match=r"expected a name that ends in .json, .png, .html, .rrd"):
        parted.save(tmp_path / "a.txt")


def test_of_many_dimensions_there_is_no_picture(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(400, 4)) * [1.0, 2.0, 3.0, 4.0]
    found = symrefine.align(points, points)
    assert "<img" not in found._repr_html_()
    assert set(found.kinds()) == {".json"}
    for call in (lambda: found.save(tmp_path / "a.png"), found.plot, found.show):
        with pytest.raises(InputError):
            call()
    assert not list(tmp_path.iterdir())


# --- the page ---------------------------------------------------------------------------------------------------------


def page(found: symrefine.Alignment, folder: Path) -> str:
    found.save(folder / "page.html")
    return (folder / "page.html").read_text(encoding="utf-8")


def island(text: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    return json.loads(found[1])


@pytest.fixture(scope="module")
def made(symmetric: symrefine.Alignment, tmp_path_factory: pytest.TempPathFactory) -> str:
    return page(symmetric, tmp_path_factory.mktemp("page"))


@pytest.mark.slow
def test_the_page_holds_every_map(symmetric: symrefine.Alignment, made: str, tmp_path: Path) -> None:
    text = made
    data = island(text)
    assert len(text) < 3_000_000
    assert "8 maps that do equally well" in text
    np.testing.assert_allclose([e["matrix"] for e in data["elements"]], symmetric.equivalent_transforms, atol=1e-9)
    assert [e["kind"] for e in data["elements"]] == ["axis"] * 4 + ["improper"] * 4
    assert text == page(symmetric, tmp_path), "equal input, equal page"
    assert "symrefine align table.ply cloud.ply --tolerance 0.02" in text


@pytest.mark.slow
def test_a_misfit_is_no_answer(tmp_path: Path) -> None:
    found = symrefine.align(WHOLE, table())
    text = page(found, tmp_path)
    assert "<h1>No fit" in text
    assert "equally well" not in text
    assert "and no answer" in text


def test_names_cannot_write_html(tmp_path: Path) -> None:
    evil = "<script>alert(1)</script>.ply"
    points = np.random.default_rng(0).normal(size=(12, 3))
    text = page(symrefine.align(Shape(points, source=evil), Shape(points, source=evil)), tmp_path)
    assert "<script>alert" not in text


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    if not BROWSER:
        pytest.skip("needs Chromium")
    opened = Tab(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


def chosen(tab: Tab) -> int:
    found: int = tab.ask("+document.querySelector('.maps [aria-pressed=true]').dataset.choose")
    return found


def test_before_and_after_are_one_click_apart(tab: Tab, made: str, tmp_path: Path) -> None:
    tab.open(made, tmp_path)
    assert tab.ask("document.getElementById('viewer').dataset.state") == "live"
    tab.settle()
    after = tab.picture()
    tab.ask("document.querySelector('[data-share=\"0\"]').click()")
    tab.settle()
    before, (left, top, right, bottom) = tab.picture(), tab.box("#model")
    assert (np.abs(after - before)[top:bottom, left:right].max(axis=2) > 0.05).mean() > 0.1
    assert tab.ask("document.getElementById('morph').value") == "0"
    tab.ask("document.querySelector('[data-share=\"1\"]').click()")
    tab.settle()
    assert (np.abs(after - tab.picture())[top:bottom, left:right].max(axis=2) > 0.05).mean() < 0.02
    assert not tab.told


def test_an_equivalent_map_is_chosen_and_copied(
    tab: Tab, symmetric: symrefine.Alignment, made: str, tmp_path: Path
) -> None:
    tab.open(made, tmp_path)
    assert chosen(tab) == 0
    tab.ask("document.querySelector('[data-choose=\"5\"]').click()")
    tab.settle()
    assert chosen(tab) == 5
    assert tab.ask("document.getElementById('chosen').textContent").startswith("6: Mirror image")
    tab.key("Escape")
    assert chosen(tab) == 5, "one is always chosen"
    tab.ask("navigator.clipboard.writeText = (text) => { window.copied = text; return Promise.resolve(); }")
    tab.ask("document.getElementById('copy').click()")
    np.testing.assert_allclose(json.loads(tab.ask("window.copied")), symmetric.equivalent_transforms[5], atol=1e-9)
    assert not tab.told


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_page_fits_a_telephone(tab: Tab, made: str, tmp_path: Path, theme: str) -> None:
    tab.open(made, tmp_path, PHONE, theme)
    assert tab.ask("[document.documentElement.scrollWidth, innerWidth]") == [PHONE[0], PHONE[0]]
    cut_off = "[...document.querySelectorAll('.list .wide')].filter((e) => e.scrollWidth > e.clientWidth).length"
    assert tab.ask(cut_off) == 0
    assert (tab.picture()[-1, -1].mean() > 0.9) == (theme == "light")


# --- the recording ----------------------------------------------------------------------------------------------------


def test_the_recording_goes_from_before_to_every_map(symmetric: symrefine.Alignment, tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    symmetric.save(path)
    assert {"/object/source/points", "/object/target/points", "/report", "/log"} <= entities(path)
    assert {f"/series/{side}/{name}" for side in ("source", "target") for name in ("met", "unseen")} <= entities(path)
    moves = sorted(rows(path, "/object/source"), key=lambda row: row["story"])
    matrices = [np.array(column(row, "mat3x3")).reshape(3, 3).T for row in moves]
    np.testing.assert_allclose(matrices[0], np.eye(3), atol=1e-6)
    np.testing.assert_allclose(matrices[-8:], symmetric.equivalents, atol=1e-6)
    judged = [row["story"] for row in rows(path, "/series/source/met") if "story" in row]
    assert judged == [row["story"] for row in moves[-8:]], "every map is judged, the way to it is not"


def test_both_objects_are_in_view_before_and_after(parted: symrefine.Alignment) -> None:
    pair = scene(parted)
    camera, beside = view(pair)
    for matrix, shift in (pair.ways[0].part(share, beside) for share in (0.0, 1.0)):
        xy, depth = camera.project(pair.stage(matrix, shift).stage.points, 1100, 1000)
        assert depth.min() > 0.0
        assert (xy > 0.0).all()
        assert (xy < [1100.0, 1000.0]).all()


def test_equal_input_gives_an_equal_recording(parted: symrefine.Alignment, tmp_path: Path) -> None:
    for name in ("a.rrd", "b.rrd"):
        parted.save(tmp_path / name)
    done = rerun("rrd", "compare", tmp_path / "a.rrd", tmp_path / "b.rrd")
    assert done.returncode == 0, done.stderr


# --- elsewhere --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_drawings_and_molecules_are_shown_too(tmp_path: Path) -> None:
    flat = np.array([[1.0, 0.2], [0.3, 0.9], [-1.0, 0.2], [-0.3, 1.9], [0.0, -1.0]])
    made = molecule("ferrocene, staggered")
    atoms = Shape(points=made.positions, labels=np.array(made.numbers), elements=True)
    for given, other in ((flat, flat @ [[0.0, 1.0], [1.0, 0.0]]), (atoms, atoms)):
        found = symrefine.align(given, other)
        for suffix in (".png", ".html", ".rrd"):
            found.save(tmp_path / f"a{suffix}")
        one, two = scene(found).shares(0)
        assert one.met == two.met == 1.0
        picture = np.asarray(imread(BytesIO((tmp_path / "a.png").read_bytes())), dtype=float)[76:-104, :, :3]
        assert has(picture, CONTRADICTED) + has(picture, OUTLIER) < 1e-3


@pytest.mark.slow
def test_the_command_writes_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = sample(WHOLE, 2500, 0.0, np.random.default_rng(5))
    np.savetxt(tmp_path / "a.xyz", points[::2])
    np.savetxt(tmp_path / "b.xyz", turned().apply(points[1::2]))
    written = {"--report": "a.html", "--recording": "a.rrd", "--picture": "a.png", "--json": "a.json"}
    options = [str(word) for option, name in written.items() for word in (option, tmp_path / name)]
    assert invoke(["align", str(tmp_path / "a.xyz"), str(tmp_path / "b.xyz"), *options]) == 0
    assert all(f"wrote {tmp_path / name}" in capsys.readouterr().out for name in list(written.values())[:1])
    assert {path.name for path in tmp_path.iterdir()} == {"a.xyz", "b.xyz", *written.values()}
