"""Small pictures: icons and letters whose edges lie between pixels, as PNG and as JPEG."""

import numpy as np
import pytest

from experiments.objects.drawings import Drawing, ellipse, turned
from experiments.objects.icons import DRAWN_SO, ICONS
from experiments.objects.pictures import coverage, fit, picture, random_pose
from experiments.studies import small_pictures as study
from experiments.studies.small_pictures import Case, answer, examine, loaded
from symrefine.plane.detection import detect_planar

NAMES = ("arrow 0.16 0.75 0.5", "bent arrow", "gear 6", "ratchet 4", "N DejaVu Sans normal", "F DejaVu Serif bold")


@pytest.mark.parametrize("quality", [0, 60])
@pytest.mark.parametrize("icon", NAMES)
def test_icons_of_64_pixels_are_right(icon: str, quality: int) -> None:
    assert answer(Case(icon=icon, side=64, quality=quality)).verdict == "right"


@pytest.mark.slow
@pytest.mark.parametrize("side", [32, 48])
@pytest.mark.parametrize("icon", [*NAMES, "A DejaVu Sans normal", "N DejaVu Serif normal"])
def test_smaller_ones_are_never_sure_and_wrong(icon: str, side: int) -> None:
    for quality in (0, 75):
        assert answer(Case(icon=icon, side=side, quality=quality)).verdict != "sure and wrong"


@pytest.mark.parametrize("quality", [0, 75])
@pytest.mark.parametrize(("disc", "dot"), [(1.0, 0.6), (0.6, 1.0)])
def test_a_dot_of_another_grey_leaves_a_disc_one_mirror(disc: float, dot: float, quality: int) -> None:
    """Four percent of its area, no more cells than a soft edge has."""
    layers = ((ellipse(0.0, 0.0, 1.0), disc), (ellipse(0.6, 0.0, 0.2), dot))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        share = coverage(Drawing(name="dot", layers=layers, group="D1"), random_pose(rng, side=56))
        found = detect_planar(loaded(picture(share, "clean", rng), quality))
        assert found.point_group == "D1" or found.undetermined


def test_what_pixels_hide_is_told() -> None:
    found = examine(Case(icon="star 5", side=32))
    assert found.point_group == "undetermined"
    assert "give more pixels" in found.undetermined
    assert found.lines == ()
    assert found.alternatives[0].point_group.startswith("D")


def test_probabilities_of_all_groups_sum_to_one() -> None:
    found = examine(Case(icon="ratchet 4", side=32))
    told = [found.confidence, *(a.probability for a in found.alternatives)]
    assert sum(told) == pytest.approx(1.0, abs=0.02)
    assert found.confidence == max(told)
    assert all(line.confidence >= found.confidence for line in found.lines)


@pytest.mark.parametrize("icon", [n for n, d in ICONS.items() if " DejaVu " in n and d.group != "C1"])
def test_letters_were_drawn_with_the_symmetry_they_are_listed_with(icon: str) -> None:
    from scipy.spatial import cKDTree

    drawing = ICONS[icon]
    steps = np.linspace(0.0, 1.0, 60, endpoint=False)[None, :, None]
    outlines = [fit(drawing.layers).apply(points)[:, None] for points, _ in drawing.layers]
    dense = np.concatenate([(p * (1 - steps) + np.roll(p, -1, axis=0) * steps).reshape(-1, 2) for p in outlines])
    images = [turned(dense, 2.0 * np.pi / drawing.fold)] if drawing.fold > 1 else []
    images += [turned(turned(dense, -a) * [1, -1], a) for a in drawing.line_angles]
    # The diagonal is twice the reach; the rest is the spacing of the points.
    assert all(cKDTree(dense).query(image)[0].max() < 2.0 * DRAWN_SO + 0.01 for image in images)


def test_command_line(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "plan", lambda *_: iter([Case(icon="plus", side=64)]))
    assert study.main(["--poses", "1"]) == 0
    assert "64 px, PNG" in capsys.readouterr().out
