"""How sure detection in the plane is: the experiment that holds its confidence against the truth."""

from pathlib import Path

import numpy as np
import pytest

from experiments.objects.drawings import DRAWINGS
from experiments.objects.pictures import fit
from experiments.studies import planar_reliability as study
from experiments.studies.answers import fitted
from experiments.studies.planar_reliability import Case


def test_both_halves_have_drawings_of_all_kinds() -> None:
    for half in (True, False):
        groups = {d.group for name, d in DRAWINGS.items() if fitted(name) is half}
        assert {"D1", "C2", "C4" if half else "C3"} <= groups


@pytest.mark.slow
@pytest.mark.parametrize("name", ["heart", "letter Z", "octagon", "letter A", "pinwheel of 3"])
@pytest.mark.parametrize("moved_rel", [0.01, 0.05])
def test_a_part_that_is_moved_shows_and_has_no_images_where_it_was(name: str, moved_rel: float) -> None:
    drawing = DRAWINGS[name]
    reach = fit(drawing.layers).reach
    for seed in range(12 if name == "octagon" else 4):
        found = study.broken(drawing, moved_rel, np.random.default_rng(seed))
        assert found.group == "C1"
        # With the same corners: more of them are drawn a little differently.
        same = study._pushed(drawing, np.zeros(2), np.zeros(2), 0.24 * reach)
        changed = np.abs(study._framed(found, reach) - study._framed(same, reach))
        # The width of a piece of edge times how far it is moved, in pixels: half of it, or some of a layer.
        assert changed.sum() > (0.5 if len(drawing.layers) == 1 else 0.2) * 24.0 * 200.0 * moved_rel
        if len(drawing.layers) == 1:
            row, column = np.nonzero(changed > 0.5)
            middle = 0.5 * (len(changed) - 1)
            pixels = np.array([column.mean() - middle, middle - row.mean()])
            assert study._nearest_image(drawing, pixels / study.FRAMED * reach) > 0.12 * reach


def test_the_hole_of_a_ring_moved_leaves_the_line_along_it() -> None:
    found = study.broken(DRAWINGS["ring"], 0.03, np.random.default_rng(0))
    assert found.group == "D1"
    way = found.layers[1][0].mean(axis=0)
    assert np.arctan2(way[1], way[0]) == pytest.approx(found.angle_rad)


def test_elements_of_a_drawing_are_right_and_those_lost_are_not() -> None:
    whole = study.elements(Case(drawing="heart", side=128))
    assert [(r.kind, r.right) for r in whole] == [("line", True)]
    lost = study.elements(Case(drawing="heart", moved_rel=0.01, side=128, seed=3))
    assert not any(r.right for r in lost)
    star = study.elements(Case(drawing="star", side=128))
    assert sum(r.right for r in star) == 6
    row = star[0].judged()
    assert (row.look, row.right) == (star[0].case, True)
    assert row.confidence == star[0].confidence > 0.9


def test_a_third_of_all_looks_is_broken() -> None:
    looks = list(study.plan(quick=False, seed=0))
    symmetric = [c for c in looks if DRAWINGS[c.drawing].group != "C1"]
    assert np.mean([c.moved_rel > 0.0 for c in symmetric]) == pytest.approx(1 / 3)
    assert not any(c.moved_rel for c in looks if DRAWINGS[c.drawing].group == "C1")
    assert len(set(looks)) == len(looks)


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert study.main(["--figure", str(tmp_path / "missing" / "plot.png")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    few = [Case(drawing=n, moved_rel=m, side=128, seed=7) for n in ("heart", "star") for m in (0.0, 0.03)]
    monkeypatch.setattr(study, "plan", lambda **_: iter(few))
    assert study.main(["--quick", "--figure", str(tmp_path / "plot.png")]) == 0
    told = capsys.readouterr().out
    assert "4 looks at 2 drawings" in told
    assert "moved by 3%" in told
    assert (tmp_path / "plot.png").stat().st_size > 1000
