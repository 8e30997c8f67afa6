"""Files to read: patterns that no shell expanded, what comes on stdin, the objects in them, what is wrong with one."""

import shutil
import sys
import tempfile
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrefine.clock import Clock
from symrefine.errors import InputError, SymrefineError, about, meant, one_line

if TYPE_CHECKING:
    from symrefine.load import Frames
    from symrefine.shape import Shape
    from symrefine.stream import Stream

# What is written for the path of a file that comes on stdin, and what it is called afterwards.
STDIN, NAME = "-", "stdin"
# Options that say what of a file is read, and how.
_READING = tuple("intrinsics depth_scale mask viewpoint isolated measure labels weights frame texture".split())
# The labels that are no field of a file, but the colours of its images.
TEXTURE = "texture"
# Objects of one file that are taken at once: their records, of some ten kilobytes each, are kept for one array.
FRAMES = 10_000


def expanded(names: Sequence[str]) -> list[str]:
    """The files that names and patterns (`*`, `?`, `[ab]`, `**`) stand for, in order; a file of that name comes first.

    Raises:
        InputError: a pattern that no file matches.
    """
    found: list[str] = []
    for name in names:
        if not has_magic(name) or Path(name).exists():
            found.append(name)
            continue
        files = sorted(match for match in glob(name, recursive=True) if Path(match).is_file())  # noqa: PTH207
        if not files:
            raise InputError(f"{name}: no file matches this pattern")
        found += files
    return found


def one_file(name: str) -> str:
    """The one file that a name or a pattern stands for, as a type of an argument.

    Raises:
        ArgumentTypeError: a pattern that no file matches, or several.
    """
    try:
        files = expanded([name])
    except InputError as error:
        raise ArgumentTypeError(str(error)) from None
    if len(files) > 1:
        raise ArgumentTypeError(f"{name}: {len(files)} files match this pattern; name one of them")
    return files[0]


@contextmanager
def readable(name: str, suffix: str | None) -> Iterator[str]:
    """A path to read what a name stands for: itself, or a file that holds what comes on stdin, as long as this lasts.

    Args:
        suffix: the format of stdin, as a file would have it, with or without its dot.

    Raises:
        InputError: stdin without a format, a format without stdin, or one that is not known; a directory; a suffix
            that is close to a known one; whatever is wrong with what came on stdin, under that name.
    """
    if name != STDIN:
        if suffix is not None:
            raise InputError(f"--format {suffix}: is for PATH -, which reads stdin; {name} has its suffix")
        _check_named(Path(name))
        yield name
        return
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        file = Path(folder, NAME).with_suffix(_known_suffix(suffix))
        with file.open("wb") as copy:
            shutil.copyfileobj(sys.stdin.buffer, copy)
        with told_as(str(file), NAME):
            yield str(file)


@contextmanager
def told_as(file: str, name: str) -> Iterator[None]:
    """Tell what is wrong with a file under another name."""
    try:
        yield
    except SymrefineError as error:
        raise type(error)(str(error).replace(file, name)) from None


def loaded(name: str, suffix: str | None, read: Callable[[str], "Shape"]) -> "Shape":
    """The shape in what a name stands for, as `readable` says, read by a function of a path."""
    with readable(name, suffix) as file, Clock()("load"):
        shape = read(file)
    return shape if file == name else replace(shape, source=NAME)


@dataclass(frozen=True, slots=True, kw_only=True)
class Object:
    """One of the objects in the files that were named.

    Attributes:
        file: that it is in, to read.
        name: what it is called.
        found: its shape, or why there is none.
        frame: its number, where its file holds several.
        frames: how many its file holds.
        load_s: seconds that reading took.
    """

    file: str
    name: str
    found: "Shape | Stream | Exception"
    frame: int | None = None
    frames: int = 1
    load_s: float = 0.0

    @property
    def shape(self) -> "Shape | Stream":
        """Its shape.

        Raises:
            Exception: that reading ended with.
        """
        if isinstance(self.found, Exception):
            raise self.found
        return self.found


def objects(names: Sequence[str], suffix: str | None, read: Callable[[str], Any]) -> Iterator[Object]:
    """Every object in the files that names stand for, each read as it is asked for, by a function of a path.

    What cannot be read does not end the others. The file of stdin is there until the next object is asked for.
    """
    for name in names:
        try:
            with readable(name, suffix) as file:
                yield from _objects_in(file, name if file == name else NAME, read)
        except Exception as error:  # noqa: BLE001 - one file must not end the others
            yield Object(file=name, name=name, found=error)


def _objects_in(file: str, called: str, read: Callable[[str], Any]) -> Iterator[Object]:
    """Every object in one file, which people call something else if it holds what came on stdin."""
    frames: Any = None
    number = 0
    while frames is None or number < len(frames):
        clock = Clock()
        with clock("load"):
            frames = frames or read(file)
            several = len(frames) > 1
            found = _made(frames, number, file, called)
        yield Object(
            file=file,
            name=f"{called}#{number}" if several else called,
            found=found,
            frame=number if several else None,
            frames=len(frames),
            load_s=clock.seconds["load"],
        )
        number += 1


def _made(frames: Any, number: int, file: str, called: str) -> "Shape | Stream | Exception":
    """One of the shapes in a file, under the name that people call that, or why there is none."""
    try:
        with told_as(file, called):
            shape = frames[number]
        return shape if called == file else replace(shape, source=shape.source.replace(file, called))
    except Exception as error:  # noqa: BLE001 - one object must not end the others
        return error


def scans(path: str, options: dict[str, Any], *, in_chunks: bool = False, **picture: Any) -> "Frames[Any]":
    """The objects in a file as `detection_options` say, and `picture`: all, or the one that they choose.

    With `in_chunks` a cloud that is too large to hold is a stream, if nothing but its coordinates is asked for.
    """
    from symrefine.load import Frames, load, load_frames, stream_if_large

    said = {name: given for name in _READING if (given := options.get(name)) is not None}
    if said.get("labels") == TEXTURE:
        said = {name: given for name, given in said.items() if name != "labels"} | {"texture": True}
    if in_chunks and not said and not any(picture.values()) and (large := stream_if_large(path)) is not None:
        return Frames("clouds", 1, lambda _: large)
    depth = {name: said.pop(name) for name in ("depth_scale", "mask") if name in said}
    if "intrinsics" in said:
        camera = said.pop("intrinsics")
        idle = [name for name, given in (said | picture).items() if given not in (None, False)]
        if idle:
            raise InputError(f"{path}: is read as a depth image, so {_option(idle[0])} does not apply; leave it out")
        from symrefine.load.depth import load_depth

        return Frames("images", 1, lambda _: load_depth(path, camera, **depth))
    if depth:
        raise InputError(f"{path}: {_option(next(iter(depth)))} goes with --intrinsics, which make it a depth image")
    told: dict[str, Any] = {name: said.pop(name) for name in ("viewpoint", "isolated") if name in said}
    if "frame" in said:
        return Frames("objects", 1, lambda _: _told(load(path, **said, **picture), told))
    found = load_frames(path, **said, **picture)
    if len(found) > FRAMES:
        raise InputError(f"{path}: holds {len(found)} {found.what}, more than {FRAMES}; choose one with --frame")
    return Frames(found.what, len(found), lambda k: _told(found[k], told))


def read_scan(path: str, options: dict[str, Any]) -> Any:
    """The one shape in a file as `detection_options` say; with a camera, what that saw; see `scans`."""
    frames = scans(path, options)
    with about(path):
        frames.check(None)
    return frames[0]


def _told(shape: "Shape", told: dict[str, Any]) -> "Shape":
    """A shape with what was told of its points besides: where the camera stood, whether they stand for themselves."""
    if "viewpoint" in told and (shape.dim != 3 or shape.faces is not None):
        raise InputError(f"{shape.source}: --viewpoint is for clouds in space, leave it out")
    if "isolated" in told and shape.faces is not None:
        raise InputError(f"{shape.source}: --isolated is for points, this is a mesh; leave it out")
    return replace(shape, **told) if told else shape


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def failure(path: str, error: Exception) -> str:
    """What was wrong with one of many files, for which the others need not end."""
    if isinstance(error, SymrefineError | OSError):
        return one_line(error)
    if isinstance(error, MemoryError):
        return f"{path}: out of memory"
    return one_line(f"{path}: internal error: {type(error).__name__}: {error}")


def _known_suffix(name: str | None) -> str:
    """The suffix of a format."""
    known = _suffixes()
    if name is None:
        raise InputError(f"-: reads stdin, which has no suffix; say what it holds: --format {_bare(known)}")
    suffix = f".{name.lower().removeprefix('.')}"
    if suffix.removesuffix(".gz") not in known:
        close = meant(suffix[1:], (k[1:] for k in known))
        raise InputError(f"--format {name}: is not known; expected one of {_bare(known)}{close}")
    return suffix


def _check_named(path: Path) -> None:
    """Refuse slips of the pen with what may have been meant; whatever else is wrong the readers tell."""
    if path.is_dir():
        raise InputError(f"{path}: is a directory; expected a file (`symrefine batch {path}` takes all that are in it)")
    from symrefine.load import suffix_of

    known, suffix = _suffixes(), suffix_of(path)
    if suffix not in known and path.is_file() and (close := meant(suffix, known)):
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; known are {' '.join(known)}{close}")


def _suffixes() -> list[str]:
    from symrefine.load import SUFFIXES

    return sorted(SUFFIXES)


def _bare(suffixes: Sequence[str]) -> str:
    return " ".join(suffix[1:] for suffix in suffixes)
