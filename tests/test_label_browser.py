"""The page of a review in a browser: groups are chosen by hand, saved as a file, and applied by the command.

Skipped where there is no Chromium.
"""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.objects.shapes import box, join
from symrefine.cli import invoke
from symrefine.shape import Shape
from tests.chromium import BROWSER, DESK, PHONE, Tab

pytestmark = pytest.mark.skipif(not BROWSER, reason="needs Chromium")
SIZES = {2: (1.0, 0.7, 0.4), 5: (1.0, 0.97, 0.4), 7: (1.0, 0.975, 0.96)}


@pytest.fixture(scope="module")
def labels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three boxes, of which two are nearly more than that; the first is settled."""
    folder = tmp_path_factory.mktemp("set")
    (folder / "models").mkdir()
    for number, size in SIZES.items():
        shape: Shape = join([box((0, 0, 0), size)])
        assert shape.faces is not None
        lines = ["v " + " ".join(map(repr, map(float, p * 100.0))) for p in shape.points]
        lines += ["f " + " ".join(map(str, f + 1)) for f in shape.faces]
        (folder / "models" / f"obj_{number:06d}.obj").write_text("\n".join(lines))
    assert invoke(["label", str(folder / "models"), "--out", str(folder / "labels"), "--accept", "0.999", "-q"]) == 0
    return folder / "labels"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    opened = Tab(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


@pytest.fixture
def tab(browser: Tab, tmp_path: Path) -> Tab:
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path / "downloads"))
    return browser


def shown(tab: Tab, labels: Path, folder: Path, size: tuple[int, int] = DESK, theme: str = "light") -> None:
    """The page as a file of its own, with nothing kept of before."""
    tab.open((labels / "review.html").read_text(encoding="utf-8"), folder, size, theme)


def click(tab: Tab, selector: str) -> None:
    """Press and release the mouse on what stands there."""
    found = f"document.querySelector({json.dumps(selector)})"
    tab.ask(f"{found}.scrollIntoView({{ block: 'center' }})")
    tab.settle()
    left, top, right, bottom = tab.box(selector)
    at = ((left + right) / 2, (top + bottom) / 2)
    tab.drag(at, at)


def group(number: int, name: str, labels: Path) -> str:
    """The button of a group."""
    made = (json.loads(line) for line in (labels / "objects.jsonl").read_text().splitlines())
    names = next([c["point_group"] for c in row["choices"]] for row in made if row["object"] == number)
    return f"#object-{number} [data-choice='{names.index(name)}']"


def pressed(tab: Tab) -> list[str]:
    found: list[str] = tab.ask("[...document.querySelectorAll('[aria-pressed=true] b')].map((b) => b.textContent)")
    return found


def typed(tab: Tab, text: str) -> None:
    tab.call("Input.insertText", text=text)
    tab.settle()


def to_tolerance(tab: Tab, number: int, index: int) -> None:
    """Choose in the list of tolerances, which the browser draws outside the page."""
    select = f"document.querySelector('#object-{number} select')"
    tab.ask(f"{select}.selectedIndex = {index}; {select}.dispatchEvent(new Event('change'))")


def forget(tab: Tab) -> None:
    tab.ask("localStorage.clear()")


def downloaded(folder: Path) -> Any:
    path = folder / "downloads" / "decisions.json"
    for _ in range(200):
        if path.is_file() and path.stat().st_size:
            return json.loads(path.read_text(encoding="utf-8"))
        time.sleep(0.05)
    raise AssertionError("nothing was downloaded")


def entries(labels: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((labels / "models_info.json").read_text())
    return found


def test_what_is_chosen_by_hand_is_applied(tab: Tab, labels: Path, tmp_path: Path) -> None:
    before = entries(labels)
    assert sorted(before) == ["2"]
    shown(tab, labels, tmp_path)
    forget(tab)
    assert tab.ask("document.querySelector('h1').textContent").startswith("2 objects to look at")
    picture = tab.ask("document.querySelector('#object-5 img:not([hidden])').dataset.shot")
    click(tab, group(5, "D2h", labels))
    assert pressed(tab) == ["D2h"]
    click(tab, group(5, "D4h", labels))
    assert pressed(tab) == ["D4h"]
    assert "For pose estimators: D4, 8 rotations" in tab.ask("document.querySelector('#object-5 .told').textContent")
    click(tab, "#object-5 .mirrors")
    click(tab, "#object-5 .note")
    typed(tab, "nearly square")
    to_tolerance(tab, 5, 4)
    assert tab.ask("document.getElementById('progress').textContent") == "1 of 2 decided, not saved"
    assert picture is not None
    click(tab, "#save")
    saved = downloaded(tmp_path)
    assert saved["decisions"] == [
        {
            "object": 5,
            "file": "obj_000005.obj",
            "sha256": saved["decisions"][0]["sha256"],
            "point_group": "D4h",
            "tolerance": 0.04,
            "mirrors_only_in_shape": True,
            "note": "nearly square",
        }
    ]
    assert tab.ask("document.getElementById('progress').textContent") == "1 of 2 decided"
    click(tab, "#show")
    assert json.loads(tab.ask("document.getElementById('text').value")) == saved
    path = tmp_path / "downloads" / "decisions.json"
    assert invoke(["label", str(labels.parent / "models"), "--out", str(labels), "--accept", "0.999", "-q"]) == 0
    assert entries(labels) == before
    again = [
        "label",
        str(labels.parent / "models"),
        "--out",
        str(labels),
        "--accept",
        "0.999",
        "--decisions",
        str(path),
    ]
    assert invoke([*again, "-q"]) == 0
    after = entries(labels)
    assert sorted(after) == ["2", "5"]
    assert len(after["5"]["symmetries_discrete"]) == 7
    shown(tab, labels, tmp_path)
    assert tab.ask("document.querySelector('h1').textContent").startswith("1 object to look at")
    assert pressed(tab) == ["D4h"], "what was decided is shown as decided"
    click(tab, group(5, "D4h", labels))
    assert json.loads(tab.ask("document.getElementById('text').value"))["decisions"][0]["point_group"] is None
    forget(tab)
    assert not tab.told


def test_keys_choose_and_a_closed_page_forgets_nothing(tab: Tab, labels: Path, tmp_path: Path) -> None:
    shown(tab, labels, tmp_path)
    forget(tab)
    shown(tab, labels, tmp_path)
    tab.key("j")
    assert tab.ask("document.activeElement.id") == "object-7"
    tab.key("2")
    chosen = tab.ask("document.querySelector('#object-7 [aria-pressed=true]').dataset.choice")
    assert chosen == "1"
    shown(tab, labels, tmp_path)
    assert tab.ask("document.querySelector('#object-7 [aria-pressed=true]').dataset.choice") == chosen
    tab.ask("document.getElementById('object-7').focus()")
    tab.key("2")
    assert tab.ask("document.querySelector('#object-7 [aria-pressed=true]')") is None
    forget(tab)


def test_the_tolerance_tells_other_probabilities(tab: Tab, labels: Path, tmp_path: Path) -> None:
    shown(tab, labels, tmp_path)
    said = "[...document.querySelectorAll('#object-7 .choices span')].map((s) => s.textContent)"
    best = "document.querySelector('#object-7 .answer b').textContent"
    seen = []
    for index in (0, 5):
        to_tolerance(tab, 7, index)
        seen.append((tab.ask(said), tab.ask(best)))
    assert seen[0] != seen[1]
    assert (seen[0][1], seen[1][1]) == ("D2h", "Oh")
    forget(tab)


def test_the_page_fits_a_telephone_in_either_theme(tab: Tab, labels: Path, tmp_path: Path) -> None:
    papers = []
    for theme in ("light", "dark"):
        shown(tab, labels, tmp_path, PHONE, theme)
        tab.ask("document.getElementById('show').click()")
        tab.settle()
        assert tab.ask("[document.documentElement.scrollWidth, innerWidth]") == [PHONE[0], PHONE[0]]
        beyond = (
            "[...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > innerWidth + 1)"
        )
        assert tab.ask(f"{beyond}.map((e) => e.outerHTML.slice(0, 80))") == []
        papers.append(float(np.median(tab.picture()[:300])))
        assert not tab.told
    assert papers[0] > 0.9
    assert papers[1] < 0.2


def test_without_scripts_the_page_reads(tab: Tab, labels: Path, tmp_path: Path) -> None:
    tab.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        tab.open((labels / "review.html").read_text(encoding="utf-8"), tmp_path, scripted=False)
        assert tab.ask("document.querySelectorAll('.object img:not([hidden])').length") == 3
        assert "Choosing needs scripts" in tab.ask("document.body.innerText")
        assert tab.ask("[...document.querySelectorAll('.needs-script')].every((e) => e.hidden)")
    finally:
        tab.call("Emulation.setScriptExecutionDisabled", value=False)
