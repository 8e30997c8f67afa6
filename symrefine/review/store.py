"""The folder of the labels of a data set: what was found in each object is kept there, and found again."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import file_digest, sha256
from pathlib import Path
from types import NoneType
from typing import Any, cast

from symrefine.errors import InputError
from symrefine.files import check_target, file_bytes, naming
from symrefine.fleet import journal
from symrefine.fleet.limits import Limits
from symrefine.fleet.tasks import is_final, our_version
from symrefine.load import IMAGES
from symrefine.review.objects import Row, flaw

# Rows that nothing is done twice for, what a person decided, the results, and pictures.
ROWS, DECISIONS, INFO, LABELS, PAGE, PICTURES = (
    "objects.jsonl",
    "decisions.json",
    "models_info.json",
    "labels.json",
    "review.html",
    "pictures",
)
# What every row has.
_KINDS: journal.Kinds = {
    "object": (int,), "file": (str,), "sha256": (str, NoneType), "error": (str, NoneType), "version": (str,),
    "options": (dict,), "answer": (str, NoneType), "confidence": (float, int), "doubt": (str,), "choices": (list,),
}  # fmt: skip


@contextmanager
def opened(out: Path) -> Iterator[journal.Journal]:
    """The rows in the folder, which is made if it is not there; nobody else writes there meanwhile.

    Raises:
        InputError: a file, no parent directory, another writer, or files of those names that are not ours.
    """
    if not out.is_dir():
        if out.exists():
            raise InputError(f"{out}: is a file; expected a folder")
        check_target(out)
        out.mkdir()
    rows, busy = out / ROWS, f"{out}: another `symrefine label` is writing there"
    taken = [name for name in (DECISIONS, INFO, LABELS, PAGE, PICTURES) if (out / name).exists()]
    if taken and not rows.exists():
        raise InputError(f"{out}: has a {taken[0]} that `symrefine label` did not write there; name another folder")
    check_target(rows)
    with journal.opened(rows, _KINDS, "object", busy=busy, rows_of="`symrefine label`", other="another folder") as held:
        if (out / PICTURES).exists() and not (out / PICTURES).is_dir():
            raise InputError(f"{out / PICTURES}: is a file; expected a folder")
        with naming(str(out / PICTURES)):
            (out / PICTURES).mkdir(exist_ok=True)
        check_target(out / PICTURES / ROWS)  # any name will do: it is the folder that pictures are written to
        for name in (DECISIONS, INFO, LABELS, PAGE):
            check_target(out / name)
        yield held


def numbers_before(out: Path) -> dict[str, int]:
    """The numbers that the labels in a folder give to the objects, by the names of their files; none without labels.

    Raises:
        InputError: somebody changed the labels.
    """
    path = out / LABELS
    if not path.is_file():
        return {}
    try:
        told = json.loads(file_bytes(path))
        numbers = {entry["file"]: entry["object"] for entry in (*told["objects"], *told["open"])}
    except (ValueError, RecursionError, LookupError, TypeError):
        numbers = {"": None}
    if not all(isinstance(name, str) and type(number) is int for name, number in numbers.items()):
        raise InputError(f"{path}: is no longer what `symrefine label` wrote; name another folder")
    return numbers


def heads(models: Mapping[int, Path], options: dict[str, Any], scale: float) -> dict[int, Row]:
    """What names objects: number, file and content, the options, the version; nothing is known of them yet.

    Args:
        models: files by number, of one folder.
        options: of the detection. Where textures count, the content is that of the images beside the models too.
        scale: millimetres in one unit of the files.
    """
    looks = _looks(next(iter(models.values())).parent) if is_textured(options) else []
    return {number: _head(number, path, options, scale, looks) for number, path in models.items()}


def is_textured(options: Mapping[str, Any]) -> bool:
    """Whether textures count."""
    return bool(options.get("texture")) or options.get("labels") == "texture"


def _looks(folder: Path) -> list[str]:
    """Digests of all files of a folder that a texture may come from."""
    known = (*IMAGES, ".mtl", ".bin")
    return [_digest(path) for path in sorted(folder.iterdir()) if path.suffix.lower() in known and path.is_file()]


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()


def _head(number: int, path: Path, options: dict[str, Any], scale: float, looks: list[str]) -> Row:
    row: dict[str, Any] = {"object": number, "file": path.name, "sha256": None, "error": None}
    row |= {"version": our_version(), "options": options, "scale": scale}
    row |= {"answer": None, "confidence": 0.0, "doubt": "", "textured": None, "choices": []}
    try:
        own = _digest(path)
        row["sha256"] = sha256("".join([own, *looks]).encode()).hexdigest() if looks else own
    except OSError as error:
        row["error"] = f"{path}: cannot be read: {error.strerror}"
    return cast("Row", row)


def holds(out: Path, row: Row | None, now: Row, limits: Limits) -> bool:
    """Whether a row made before still tells of its object, and its pictures are there.

    Args:
        out: the folder.
        now: what names the object today.
        limits: of today; what was lost under others is done again.

    Raises:
        InputError: it would, but somebody changed it.
    """
    if row is None or now["sha256"] is None or not is_final(cast("dict[str, Any]", row), limits):
        return False
    same = all(row.get(key) == now.get(key) for key in ("file", "sha256", "version", "options", "scale"))
    if not same or not all(_is_there(place_of_picture(out, row, k)) for k in range(len(row["choices"]))):
        return False
    if row["error"] is None and (told := flaw(row)):
        raise InputError(f"{out / ROWS}: is damaged: object {row['object']}: {told}; name another folder")
    return True


def _is_there(picture: Path) -> bool:
    """Whether a picture is there; one that a power cut left empty is not."""
    return picture.is_file() and picture.stat().st_size > 0


def place_of_picture(out: Path, row: Row, k: int) -> Path:
    """Where the picture of a choice is."""
    return out / PICTURES / f"obj_{row['object']:06d}_{k}.webp"
