"""Files that fsspec reaches: listed, and brought to this machine one at a time for as long as they are needed."""

import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.files import brought

# What file systems call the things that change with a file.
_CHANGING = ("size", "mtime", "ETag", "etag", "Last-Modified", "LastModified", "last_modified")
_URL = re.compile(r"[a-z][a-z0-9+.-]*://")


def is_remote(path: str) -> bool:
    """Whether a path is an address such as s3://bucket/part.ply."""
    return _URL.match(path) is not None


def listed(url: str, wanted: Callable[[Path], bool], *, recursive: bool) -> dict[str, str]:
    """The addresses that one stands for, in order, by the names that they have in it if it is a folder.

    Args:
        wanted: which files of a folder count; all that match a pattern do.
        recursive: whether those in folders inside of it do.

    Raises:
        InputError: there are none, or the address cannot be reached.
    """
    system, path = _reached(url)
    rest = "".join(url.partition("::")[1:])
    with _told(url):
        if system.isdir(path):
            folder = path.rstrip("/") + "/"
            found = system.find(path, maxdepth=None if recursive else 1)
            inside = sorted(name.removeprefix(folder) for name in found if wanted(Path(name)))
            return {name: _address(system, folder + name, rest) for name in inside if "/." not in f"/{name}"}
        found = system.glob(path) if re.search(r"[*?[]", path) else [path] if system.isfile(path) else []
        files = sorted(_address(system, name, rest) for name in found if system.isfile(name))
    if not files:
        raise InputError(f"{url}: there is no such file or folder, and no file matches it as a pattern")
    return {file: file for file in files}


@contextmanager
def fetched(url: str) -> Iterator[Path]:
    """A copy of a file on this machine, of the same name, as long as this lasts; what it names beside it comes, too.

    Raises:
        InputError: it cannot be had.
    """
    system, path = _reached(url)
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        # In folders as there, for what it names may lie in one above or beside its own.
        copy = Path(folder, *(part for part in path.split("/") if part not in ("", ".", "..")))
        copy.parent.mkdir(parents=True, exist_ok=True)
        with _told(url):
            system.get_file(path, str(copy))

        def bring(file: Path) -> None:
            place = Path(os.path.normpath(file))
            if not place.is_relative_to(folder):
                return
            name = os.path.relpath(place, copy.parent)
            there = _joined(path, name)
            with _told(beside(url, name)):
                if system.isfile(there):
                    place.parent.mkdir(parents=True, exist_ok=True)
                    system.get_file(there, str(place))

        with brought(bring):
            yield copy


def beside(url: str, name: str) -> str:
    """The address of a file by its place from the folder of another; of "." the folder itself."""
    path, *rest = url.partition("::")
    return f"{_joined(path, name)}{''.join(rest)}"


def _joined(path: str, name: str) -> str:
    folder = _above(path)
    for part in Path(name).parts:
        folder = _above(folder) if part == ".." else f"{folder}{part}/"
    return folder.rstrip("/")


def _above(path: str) -> str:
    """The folder of a path, with the slash at its end; empty where it has none."""
    return path[: path.rstrip("/").rfind("/") + 1]


def state(url: str) -> str:
    """What changes when the file at an address does, such as its size, time or tag.

    Raises:
        InputError: it cannot be had.
    """
    system, path = _reached(url)
    with _told(url):
        about = system.info(path)
        # That of HTTP takes files to be static, and is the address alone.
        told = [system.ukey(path), *(about[name] for name in _CHANGING if name in about)]
        return sha256(" ".join(map(str, told)).encode()).hexdigest()


def _reached(url: str) -> tuple[Any, str]:
    """The file system of an address and the path in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise InputError(f'{url}: addresses need fsspec: pip install "symrefine[remote]"') from None
    with _told(url):
        system, path = url_to_fs(url)
        return system, str(path)


def _address(system: Any, path: str, rest: str) -> str:
    return f"{system.unstrip_protocol(path)}{rest}"


@contextmanager
def _told(url: str) -> Iterator[None]:
    """Say which address cannot be reached: each kind of file system has errors of its own, a missing library is one."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{url}: cannot be read: {error or type(error).__name__}") from error
