"""Packed files: gzip around any format, zip archives; neither may unpack to more than memory holds."""

import io
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from gzip import BadGzipFile, GzipFile
from pathlib import Path

from symrefine.errors import InputError
from symrefine.load.text import shorten

GZIP = ".gz"
# 1 GiB: about 40 million points in double precision. A few kilobytes can unpack to it, and a few more to all of memory.
LARGEST = 2**30
_CHUNK = 2**20


def suffix_of(path: Path) -> str:
    """Suffix that tells the format, in lower case: `.ply` of part.ply and of part.ply.gz."""
    inner = path.with_suffix("") if path.suffix.lower() == GZIP else path
    return inner.suffix.lower()


def stem_of(path: Path) -> str:
    """Name without the suffix of the format and that of gzip: `part` of part.ply.gz."""
    return Path(path.stem).stem if path.suffix.lower() == GZIP else path.stem


def unpacked(data: bytes) -> bytes:
    """What gzip packed, all of its members one after the other.

    Raises:
        InputError: not gzip, cut off, damaged, nothing in it, or more than `LARGEST` bytes.
    """
    whole = bytearray()
    try:
        with GzipFile(fileobj=io.BytesIO(data)) as stream:
            while len(whole) <= LARGEST and (chunk := stream.read(_CHUNK)):
                whole += chunk
    except BadGzipFile as error:
        raise InputError(f"not gzip, or damaged: {shorten(str(error), 80)}") from None
    except EOFError:
        raise InputError(f"the gzip data are cut off after {len(data)} bytes, {len(whole)} unpacked") from None
    except zlib.error as error:
        raise InputError(f"the gzip data are damaged: {shorten(str(error), 80)}") from None
    if len(whole) > LARGEST:
        raise InputError(f"unpacks to more than {LARGEST:,} bytes; thin it out, or unpack it to read it all the same")
    if not whole:
        raise InputError("unpacks to nothing (0 bytes)")
    return bytes(whole)


def archive(data: bytes, kind: str) -> dict[str, bytes]:
    """Members of a zip archive by name, their checksums tested.

    Args:
        kind: what the archive is, for messages.

    Raises:
        InputError: no whole archive, or more than `LARGEST` bytes in it.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as opened:
            sizes = {member.filename: member.file_size for member in opened.infolist()}
            if sum(sizes.values()) <= LARGEST:
                return {name: _member(opened, name, size) for name, size in sizes.items()}
    except Exception as error:  # noqa: BLE001 (zipfile leaks many types on damaged files; nothing else in the block)
        raise InputError(f"not a whole {kind} archive: {shorten(str(error), 80)}") from None
    raise InputError(f"unpacks to {sum(sizes.values()):,} bytes; at most {LARGEST:,}")


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
