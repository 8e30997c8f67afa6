"""The page in a browser: it turns, it shows what is chosen, it fits a telephone, it follows the theme.

Chromium is driven through its own protocol over a pipe, with real input events. Skipped where there is no Chromium.
"""

import base64
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from experiments.objects.molecule_sets import molecule
from experiments.objects.shapes import mug, sample, table
from symrefine.detection.story import LADDER, detect
from symrefine.geometry import Array
from symrefine.ndim import detect_nd
from symrefine.plane import detect_planar
from symrefine.report.page import html_page
from symrefine.shape import Shape

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), "")
pytestmark = pytest.mark.skipif(not BROWSER, reason="needs Chromium")
# WebGL without a graphics card.
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
# Chromium reads commands from descriptor 3 and writes answers to 4.
AS_3_AND_4 = """
import fcntl, os, sys
pipes = [fcntl.fcntl(int(number), fcntl.F_DUPFD, 10) for number in sys.argv[1:3]]
for pipe, number in zip(pipes, (3, 4)):
    os.dup2(pipe, number)
os.execv(sys.argv[3], sys.argv[3:])
"""
PHONE, DESK = (390, 844), (1300, 900)


class Tab:
    """A tab of a Chromium of its own."""

    def __init__(self, folder: Path, *options: str) -> None:
        (read, self._out), (self._in, write) = os.pipe(), os.pipe()
        command = [BROWSER, "--headless", "--no-sandbox", *SOFTWARE, *options, f"--user-data-dir={folder}"]
        command.append("--remote-debugging-pipe")
        start = [sys.executable, "-c", AS_3_AND_4, str(read), str(write), *command, "about:blank"]
        self._browser = subprocess.Popen(
            start, pass_fds=(read, write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(read)
        os.close(write)
        self._numbers, self._rest, self._session = itertools.count(1), b"", ""
        self.told: list[str] = []
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> Any:
        """The answer to a command; complaints of the page are kept meanwhile."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            self._note(answer)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            chunk = os.read(self._in, 1 << 20)
            assert chunk, "Chromium ended"
            self._rest += chunk
        message, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(message)
        return found

    def _note(self, event: dict[str, Any]) -> None:
        kind, params = event["method"], event.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.told.append(str(params["exceptionDetails"]))
        if kind == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.told.append(str(params["entry"]))
        if kind == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.told.append(str(params["args"]))
        if kind == "Network.requestWillBeSent" and not params["request"]["url"].startswith(("file:", "data:")):
            self.told.append(params["request"]["url"])

    def open(
        self, page: str, folder: Path, size: tuple[int, int] = DESK, theme: str = "light", *, scripted: bool = True
    ) -> None:
        """Show a page, its scripts run."""
        width, height = size
        self.told.clear()
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=size == PHONE
        )
        features = [
            {"name": "prefers-color-scheme", "value": theme},
            {"name": "prefers-reduced-motion", "value": "reduce"},
        ]
        self.call("Emulation.setEmulatedMedia", features=features)
        (folder / "page.html").write_text(page, encoding="utf-8")
        self.call("Page.navigate", url=(folder / "page.html").as_uri())
        while self.ask("document.readyState") != "complete":
            pass
        if scripted:
            self.settle()

    def ask(self, script: str) -> Any:
        """The value of an expression in the page, once it is there."""
        done = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def settle(self) -> None:
        """Until what was asked for is drawn."""
        frames = "requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(go)))"
        self.ask(f"new Promise((go) => {frames})")

    def picture(self) -> Array:
        """What is seen, [H, W, 3]."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(imread(BytesIO(data)), dtype=float)[:, :, :3]

    def box(self, selector: str) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of an element."""
        script = f"(({{left, top, right, bottom}}) => [left, top, right, bottom])(\
            document.querySelector({json.dumps(selector)}).getBoundingClientRect())"
        left, top, right, bottom = (round(v) for v in self.ask(script))
        return left, top, right, bottom

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press, move, release; a click where both are the same."""
        mouse = {"button": "left", "clickCount": 1, "pointerType": "mouse"}
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], buttons=1, **mouse)
        for share in (0.3, 0.6, 1.0) if end != start else ():
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, buttons=1, **mouse)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], buttons=0, **mouse)
        self.settle()

    def key(self, name: str) -> None:
        """Press a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name)
        self.settle()

    def close(self) -> None:
        """End the browser."""
        self._browser.terminate()
        self._browser.wait(timeout=20)
        os.close(self._in)
        os.close(self._out)


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
        cut = "[...document.querySelectorAll('.group .wide')].filter((e) => e.scrollWidth > e.clientWidth).length"
        assert tab.ask(cut) == 0, "the figures of elements"
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
