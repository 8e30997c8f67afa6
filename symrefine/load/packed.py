"""Packed files: gzip around any format, zip archives; neither may unpack to more than memory holds."""

import io
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from gzip import BadGzipFile, GzipFile
from pathlib import Path

from symrefine.errors import InputError
from symrefine.load.extras import reading
from symrefine.load.text import shorten

GZIP = ".gz"
# Coordinates pack to a half or a third, text of regular parts to a tenth; a megabyte of nothing to a kilobyte. So a
# file may unpack to RATIO times its own size, a small one to ROOM bytes, and no line of it can take less than a byte.
# Only grids may be as empty as they like, to LARGEST bytes: the mask of an organ is nothing but its border.
ROOM, RATIO, LARGEST = 2**23, 32, 2**30
_CHUNK = 2**20


def suffix_of(path: Path) -> str:
    """Suffix that tells the format, in lower case: `.ply` of part.ply and of part.ply.gz."""
    inner = path.with_suffix("") if path.suffix.lower() == GZIP else path
    return inner.suffix.lower()


def stem_of(path: Path) -> str:
    """Name without the suffix of the format and that of gzip: `part` of part.ply.gz."""
    return Path(path.stem).stem if path.suffix.lower() == GZIP else path.stem


def allowance(size: int) -> int:
    """Bytes that a packed file of so many may unpack to, numbers counted as the eight bytes that they will take."""
    return min(max(ROOM, RATIO * size), LARGEST)


def unpacked(data: bytes, most: int | None = None) -> bytes:
    """What gzip packed, all of its members one after the other.

    Args:
        most: bytes it may unpack to; by its own size, as `allowance` says, if None.

    Raises:
        InputError: not gzip, cut off, damaged, nothing in it, or more in it than it may hold.
    """
    limit = allowance(len(data)) if most is None else most
    made = io.BytesIO()  # gives away what it holds, where an array of bytes would be copied
    try:
        with GzipFile(fileobj=io.BytesIO(data)) as stream:
            while made.tell() <= limit and (chunk := stream.read(_CHUNK)):
                made.write(chunk)
    except BadGzipFile as error:
        raise InputError(f"not gzip, or damaged: {shorten(str(error), 80)}") from None
    except EOFError:
        raise InputError(f"the gzip data are cut off after {len(data)} bytes, {made.tell()} unpacked") from None
    except zlib.error as error:
        raise InputError(f"the gzip data are damaged: {shorten(str(error), 80)}") from None
    whole = made.getvalue()
    crowded = most is None and whole.count(b"\n") > max(ROOM // 2, len(data))
    if len(whole) > limit or crowded:
        what = f"{max(ROOM // 2, len(data)):,} lines" if crowded else f"{limit:,} bytes"
        raise InputError(
            f"{len(data):,} bytes unpack to more than {what}; thin it out, or unpack it to read it all the same"
        )
    if not whole:
        raise InputError("unpacks to nothing (0 bytes)")
    return whole


def archive(data: bytes, kind: str, check: Callable[[Collection[str]], object] | None = None) -> dict[str, bytes]:
    """Members of a zip archive by name, their checksums tested.

    Args:
        kind: what the archive is, for messages.
        check: refuses names, before anything is unpacked.

    Raises:
        InputError: no whole archive, or more in it than it may hold.
    """
    with reading(f"{kind} archive"), zipfile.ZipFile(io.BytesIO(data)) as opened:
        sizes = {member.filename: member.file_size for member in opened.infolist()}
        if check is not None:
            check(sizes)
        if (size := sum(sizes.values())) > (most := allowance(len(data))):
            raise InputError(f"{len(data):,} bytes unpack to {size:,}, at most {most:,}; save it unpacked")
        return {name: _member(opened, name, size) for name, size in sizes.items()}


def _member(opened: zipfile.ZipFile, name: str, size: int) -> bytes:
    with opened.open(name) as stream:
        content = stream.read(size)  # without a size, it unpacks what there is before it looks at the size
    if len(content) != size:
        raise EOFError(f"{name} has {len(content)} bytes of {size}")
    return content


@contextmanager
def on_disk(data: bytes, path: Path) -> Iterator[Path]:
    """A file that holds `data`, for programs that read files only: `path` itself, unless that is packed."""
    if path.suffix.lower() != GZIP:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="symrefine-") as folder:
        place = Path(folder, "unpacked").with_suffix(suffix_of(path))
        place.write_bytes(data)
        yield place
