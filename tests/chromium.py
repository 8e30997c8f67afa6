"""A Chromium to look at pages with, driven through its own protocol over a pipe, with real input events."""

import base64
import itertools
import json
import os
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.image import imread

from symrefine.geometry import Array

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), "")
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
        number = self._send(method, **params)
        while True:
            answer = self._message()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            self._note(answer)

    def _send(self, method: str, **params: Any) -> int:
        """Send a command; the number that its answer will have."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        return number

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            chunk = os.read(self._in, 1 << 20)
            assert chunk, "Chromium ended"
            self._rest += chunk
        message, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(message)
        return found

    def _note(self, event: dict[str, Any]) -> None:
        kind, params = event.get("method"), event.get("params", {})
        if kind == "Page.javascriptDialogOpening":  # whether to leave a page that is not saved
            self._send("Page.handleJavaScriptDialog", accept=True)
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
