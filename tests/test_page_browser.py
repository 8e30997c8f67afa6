"""The page in a browser: it turns, it shows what is chosen, it fits a telephone, it follows the theme.

Skipped where there is no Chromium.
"""

import itertools
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.objects.molecule_sets import molecule
from experiments.objects.shapes import mug, sample, table
from symrefine.detection.story import LADDER, detect
from symrefine.geometry import Array
from symrefine.ndim import detect_nd
from symrefine.plane import detect_planar
from symrefine.report.page import html_page
from symrefine.shape import Shape
from tests.chromium import BROWSER, PHONE, Tab

pytestmark = pytest.mark.skipif(not BROWSER, reason="needs Chromium")


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    opened = Tab(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


def _mug() -> str:
    shape = replace(mug(), source="mug.ply")
    return html_page(detect(shape, ladder=LADDER), shape)


def _cloud() -> str:
    shape = Shape(points=sample(table(), 3000, 0.005, np.random.default_rng(3)), source="a" * 120 + ".ply")
    return html_page(detect(shape, ladder=LADDER), shape)


def _molecule() -> str:
    made = molecule("ferrocene, staggered")
    shape = Shape(points=made.positions, labels=np.array(made.numbers), source="ferrocene.xyz")
    return html_page(detect(shape, ladder=LADDER), shape)


def _drawing() -> str:
    corners = Shape.of([[1.0, 0.2], [0.3, 0.9], [-1.0, 0.2], [-0.3, 0.9], [0.0, -1.0]])
    return html_page(detect_planar(corners), corners)


def _beyond() -> str:
    rows = np.random.default_rng(1).normal(size=(12, 8))
    shape = Shape.of(np.concatenate([rows, rows * [-1, 1, 1, 1, 1, 1, 1, 1]]))
    return html_page(detect_nd(shape), shape)


PAGES: dict[str, Callable[[], str]] = {
    "mug": _mug, "cloud": _cloud, "molecule": _molecule, "drawing": _drawing, "beyond": _beyond,
}  # fmt: skip


@pytest.fixture(scope="module")
def page() -> str:
    return _mug()


def changed(one: Array, other: Array, box: tuple[int, int, int, int]) -> float:
    """Share of the pixels of a box that differ, but for the ring that shows where the keys go."""
    left, top, right, bottom = box
    return float((np.abs(one - other)[top + 8 : bottom - 8, left + 8 : right - 8].max(axis=2) > 0.05).mean())


def pressed(tab: Tab) -> list[int]:
    """The elements that are chosen in the list."""
    found: list[int] = tab.ask("[...document.querySelectorAll('[aria-pressed=true]')].map((b) => +b.dataset.choose)")
    return found


def test_the_model_turns(tab: Tab, page: str, tmp_path: Path) -> None:
    tab.open(page, tmp_path)
    assert tab.ask("document.getElementById('viewer').dataset.state") == "live"
    box = tab.box("#model")
    pictures = [tab.picture()]
    tab.drag((box[0] + 20, box[1] + 20), (box[0] + 220, box[1] + 60))
    pictures.append(tab.picture())
    tab.key("ArrowLeft")
    pictures.append(tab.picture())
    tab.key("+")
    pictures.append(tab.picture())
    assert all(changed(a, b, box) > 0.02 for a, b in itertools.pairwise(pictures))
    assert not pressed(tab)
    tab.ask("document.getElementById('reset').click()")
    tab.settle()
    assert changed(tab.picture(), pictures[0], box) < 0.02
    assert not tab.told


def test_what_is_chosen_is_shown(tab: Tab, page: str, tmp_path: Path) -> None:
    tab.open(page, tmp_path)
    box, before = tab.box("#model"), tab.picture()
    tab.ask("document.querySelector('[data-choose]').click()")
    tab.settle()
    assert pressed(tab) == [0]
    assert tab.ask("document.getElementById('chosen').textContent") == "Mirror plane 1"
    tab.ask("((m) => { m.value = 0.5; m.dispatchEvent(new Event('input')); })(document.getElementById('morph'))")
    tab.settle()
    assert changed(tab.picture(), before, box) > 0.01
    left, top, right, bottom = box
    assert tab.picture()[top:bottom, left:right].max(axis=2).min() > 0.1, "what is flat half-way is lit"
    tab.key("Escape")
    assert not pressed(tab)
    assert tab.ask("document.getElementById('card').hidden")
    assert changed(tab.picture(), before, box) < 0.01
    assert not tab.told


def test_a_click_in_the_scene_chooses(tab: Tab, page: str, tmp_path: Path) -> None:
    tab.open(page, tmp_path)
    left, top, right, bottom = tab.box("#model")
    for share in np.linspace(0.1, 0.9, 17):
        at = (left + float(share) * (right - left), 0.5 * (top + bottom))
        tab.drag(at, at)
        if pressed(tab):
            break
    assert pressed(tab) == [0]
    tab.drag((left + 8, top + 8), (left + 8, top + 8))
    assert not pressed(tab)


def test_matrices_are_copied(tab: Tab, page: str, tmp_path: Path) -> None:
    tab.open(page, tmp_path)
    tab.ask("navigator.clipboard.writeText = (text) => { window.copied = text; return Promise.resolve(); }")
    tab.ask("document.querySelector('[data-copy]').click()")
    matrix = np.array(json.loads(tab.ask("window.copied")))
    assert matrix.shape == (4, 4)
    assert np.allclose(matrix @ matrix, np.eye(4), atol=1e-9)
    assert tab.ask("document.getElementById('said').textContent") == "Matrix copied"


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in ("cloud", "molecule") else n for n in PAGES]
)
def test_nothing_overflows_a_telephone_in_either_theme(name: str, tab: Tab, tmp_path: Path) -> None:
    made, papers = PAGES[name](), []
    for theme in ("light", "dark"):
        tab.open(made, tmp_path, PHONE, theme)
        tab.ask("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        tab.ask("document.querySelector('[data-choose]')?.click()")
        tab.settle()
        assert tab.ask("[document.documentElement.scrollWidth, innerWidth]") == [PHONE[0], PHONE[0]]
        beyond = (
            "[...document.querySelectorAll('body *')].filter((e) => !e.closest('.wide, svg, .unseen, #labels') "
            "&& e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.tagName + '.' + e.className)"
        )
        assert tab.ask(beyond) == []
        tables = "document.querySelectorAll('.wide:has(.decision), .group .wide')"
        cut = f"[...{tables}].filter((e) => e.scrollWidth > e.clientWidth).length"
        assert tab.ask(cut) == 0, "the figures of elements, and what else it may be"
        papers.append(tab.picture()[-1, -1].mean())
        assert not tab.told
    assert papers[0] > 0.9
    assert papers[1] < 0.2


def test_without_webgl_the_picture_stays(page: str, tmp_path: Path) -> None:
    tab = Tab(tmp_path / "profile", "--disable-3d-apis")
    try:
        tab.open(page, tmp_path)
        assert tab.ask("document.getElementById('viewer').dataset.state") == "still"
        left, _, right, _ = tab.box(".still")
        assert right - left > 300
        assert tab.ask("document.getElementById('model').hidden")
    finally:
        tab.close()


def test_without_scripts_the_page_reads(tab: Tab, page: str, tmp_path: Path) -> None:
    tab.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        tab.open(page, tmp_path, scripted=False)
        left, _, right, _ = tab.box(".still")
        assert right - left > 300
        assert tab.ask("[...document.querySelectorAll('.needs-script')].every((e) => e.hidden)")
    finally:
        tab.call("Emulation.setScriptExecutionDisabled", value=False)
