"""Opening recordings in the viewer."""

import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from symrefine.errors import InputError, SymrefineError
from symrefine.files import ENDLESS

# Seconds within which a viewer that cannot open a window gives up.
PATIENCE = 2.0


def open_recording(path: Path | str) -> None:
    """Open a recording in a viewer of its own, and return.

    Raises:
        InputError: no such file, or not a recording.
        SymrefineError: the viewer does not start, for want of a display for example.
    """
    check_recording(Path(path))
    with tempfile.TemporaryFile() as said:  # not a pipe: the viewer outlives this process and goes on talking
        viewer = subprocess.Popen(
            [*_rerun(), "--new", "--bind", "127.0.0.1", _named(path)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=said,
            start_new_session=True,
            env=_silent(),
        )
        try:
            status = viewer.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            return
        said.seek(0)
        reason = _reason(said.read().decode(errors="replace"))
    if status != 0:
        raise SymrefineError(f"the viewer did not start: {reason}; `symrefine view {path} --web` shows it in a browser")


def serve_recording(path: Path | str, tell: Callable[[str], None]) -> None:
    """Serve a recording to browsers of this machine until it is interrupted; needs no display.

    Args:
        path: the recording.
        tell: called with the address once it is there.

    Raises:
        InputError: no such file, or not a recording.
        SymrefineError: the server does not start.
    """
    check_recording(Path(path))
    ports = ["--port", "auto", "--web-viewer-port", "0"]
    command = [*_rerun(), "--serve-web", "--bind", "127.0.0.1", *ports, _named(path)]
    said: list[str] = []
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
        env=_silent(),
    ) as server:
        assert server.stdout is not None
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that the server ends with this, too
        try:
            for line in server.stdout:
                said.append(re.sub(r"\x1b\[[0-9;]*m", "", line))
                if address := re.search(r"connect at (http://\S+)", said[-1]):
                    tell(address[1])
        finally:
            signal.signal(signal.SIGTERM, before)
            _end(server)
    raise SymrefineError(f"the server ended: {_reason(''.join(said))}")


def _end(server: "subprocess.Popen[str]") -> None:
    """End a server with the process that it started, which would outlive it."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGTERM)
    else:
        server.terminate()


def check_recording(path: Path) -> None:
    """Refuse what is not a whole recording.

    Raises:
        InputError: no such file, a directory, not a recording, or one that ends too soon.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a directory; expected a recording, a file")
    if not path.exists():
        raise InputError(f"{path}: no such file; `symrefine detect FILE --recording {path}` writes one")
    if not path.is_file():
        raise InputError(f"{path}: {ENDLESS}")
    with path.open("rb") as file:
        if file.read(3) != b"RRF":
            raise InputError(f"{path}: not a recording of rerun; `symrefine detect FILE --recording X.rrd` writes one")
    verify = [*_rerun(), "rrd", "verify", _named(path)]
    done = subprocess.run(verify, capture_output=True, text=True, check=False, env=_silent())
    if done.returncode != 0:
        raise InputError(f"{path}: the recording is damaged: {_reason(done.stderr)}")


def _named(path: Path | str) -> str:
    """A path as an argument of a program, which would take a name that begins with a dash for an option."""
    return str(Path(path).absolute())


def _rerun() -> list[str]:
    """The command `rerun` of this interpreter; `-m rerun_cli` would lose its exit status."""
    return [sys.executable, "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())"]


def _silent() -> dict[str, str]:
    """The environment of a viewer that tells its makers nothing of how it is used, as it does on machines that test."""
    return {"CI": "1", **os.environ}


def _reason(errors: str) -> str:
    """The last line that says something, without the place in the viewer's source."""
    lines = [line.strip() for line in errors.splitlines() if line.strip()]
    return re.sub(r"^(Error: )?(.*\.rs:\d+: )?|\.$", "", lines[-1]) if lines else "it gave no reason"
