"""STEP, the solids of CAD, made into triangles by OpenCASCADE (cascadio); lengths are in metres, whatever the file has.

OpenCASCADE says on the terminal which parts of a damaged file it leaves out, goes on, and may never end. So it works in
a process of its own (`apart`), whose every complaint is a refusal.
"""

import re
import tempfile
from importlib.util import find_spec
from pathlib import Path

from symrefine.errors import InputError
from symrefine.load.apart import apart
from symrefine.load.content import Content
from symrefine.load.extras import missing
from symrefine.load.gltf import read_glb
from symrefine.load.text import shorten

# Of the triangles: how far they may lie from the surface, as a share of the length of edges, and turn from one to the
# next; both far below the misses that count as symmetric.
_WITHIN, _TURN_RAD = 1e-3, 0.1
_MAGIC = b"ISO-10303-21;"
_WORK = (
    "import sys, cascadio; "
    f"made = cascadio.load(sys.stdin.buffer.read(), 'step', tol_linear={_WITHIN}, tol_angular={_TURN_RAD}, "
    "tol_relative=True, use_parallel=False); "
    "open(sys.argv[1], 'wb').write(made)"
)
_COMPLAINT = re.compile(r"err|fail|exception|warning", re.IGNORECASE)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def read_step(data: bytes, path: Path) -> Content:
    """Triangles of all solids and surfaces, each in its place.

    Raises:
        InputError: no STEP file, anything in it that OpenCASCADE complains of, or that takes too long; no surface;
            cascadio is not installed.
    """
    if find_spec("cascadio") is None:
        raise missing("cascadio", "cad")
    if not data.lstrip().startswith(_MAGIC):
        raise InputError(f"not a STEP file: begins with {data[:13]!a}; expected {_MAGIC!a}")
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        made = Path(folder, "made.glb")
        done = apart(_WORK, data, str(made), doing="made into triangles")
        _check_silence(done.stdout + b"\n" + done.stderr)
        glb = made.read_bytes() if made.exists() else b""
    if done.returncode != 0 or not glb:
        raise InputError("OpenCASCADE found nothing in it that it could make into triangles; the file may be damaged")
    return read_glb(glb, path)


def _check_silence(said: bytes) -> None:
    lines = _COLOUR.sub("", said.decode("utf-8", errors="replace")).splitlines()
    complaint = next((line for line in lines if _COMPLAINT.search(line)), None)
    if complaint is not None:
        raise InputError(f"damaged, as OpenCASCADE says: {shorten(complaint.strip(' *'), 120)}")
