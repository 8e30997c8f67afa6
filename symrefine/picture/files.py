"""Files that are whole or absent."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from symrefine.errors import InputError


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to; what was written there takes the place of `path` at the end, or vanishes after an error.

    Devices and pipes (`/dev/stdout`) have nothing to replace: they are written to directly.

    Raises:
        InputError: the file cannot be written.
    """
    place = path.resolve()
    draft = place.with_name(f".{place.stem}.{secrets.token_hex(4)}{place.suffix}")
    if place.is_dir():
        raise InputError(f"{path}: is a directory; expected a file to write")
    if not place.parent.is_dir():
        raise InputError(f"{path}: cannot be written: there is no directory {path.parent}")
    if place.exists() and not place.is_file():
        yield place
        return
    try:
        yield draft
        draft.replace(place)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        draft.unlink(missing_ok=True)
