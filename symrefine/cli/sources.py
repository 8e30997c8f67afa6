"""Many objects: files, patterns, directories, addresses, or a manifest that says more of each."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symrefine.cli import values
from symrefine.cli.inputs import expanded
from symrefine.cli.objects import Job
from symrefine.errors import InputError, meant
from symrefine.fleet.remote import is_remote, listed
from symrefine.units import METRES


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """The objects that paths stand for, each once, in order, and the files of directories that are of other kinds."""

    ours: Sequence[Job]
    others: Sequence[Path] = ()

    def passed_over(self, besides: Iterable[str | None]) -> str:
        """How many files are not looked at, and of which kinds; empty if there are none.

        Args:
            besides: files that are no matter: what is to be written.
        """
        known = {Path(name).resolve() for name in besides if name is not None}
        left = {path for path in self.others if path.resolve() not in known}
        kinds = " ".join(sorted({path.suffix.lower() or "without suffix" for path in left}))
        return f"{len(left):,} file{'s' * (len(left) != 1)} of other kinds not looked at ({kinds})" if left else ""


def sources(paths: Sequence[str], *, recursive: bool) -> Sources:
    """The objects that paths stand for; in a lone directory they are called as they are there.

    Raises:
        InputError: one that stands for nothing.
    """
    found: dict[str, Job] = {}
    others: list[Path] = []
    for path in paths:
        if is_remote(path):
            files = listed(path, _is_ours, recursive=recursive)
        else:
            files, left = _local(path, recursive)
            others += left
        if not files:
            from symrefine.load import READERS

            raise InputError(f"{path}: no mesh and no cloud in it; known are {' '.join(READERS)}, and .gz of each")
        for inside, file in files.items():
            found.setdefault(file, Job(name=inside if len(paths) == 1 else file, path=file, place=file))
    return Sources(ours=list(found.values()), others=others)


def _local(path: str, recursive: bool) -> tuple[dict[str, str], list[Path]]:
    """The files that a path stands for, in order, by the names that they have in a directory, and others in that."""
    folder = Path(path)
    if not folder.is_dir():
        files = expanded([path])
        if missing := [name for name in files if not Path(name).exists()]:
            raise InputError(f"{missing[0]}: no such directory, file or pattern")
        return {name: name for name in files}, []
    inside = sorted(_files_in(folder, recursive), key=Path.as_posix)
    ours = {name.as_posix(): str(folder / name) for name in inside if _is_ours(name)}
    return ours, [folder / name for name in inside if not _is_ours(name)]


def _files_in(folder: Path, recursive: bool) -> Iterator[Path]:
    """The files in a directory that are not hidden, relative to it."""
    found = folder.rglob("*") if recursive else folder.glob("*")
    names = (p.relative_to(folder) for p in found if p.is_file())
    return (name for name in names if not any(part.startswith(".") for part in name.parts))


def _is_ours(path: Path) -> bool:
    from symrefine.load import READERS, suffix_of

    return suffix_of(path) in READERS


def _one_of(*known: str) -> Callable[[str], str]:
    def choose(text: str) -> str:
        if text not in known:
            raise ValueError(f"{text!r} is not one of {', '.join(known)}{meant(text, known)}")
        return text

    return choose


# Columns of a manifest, and what reads them: what is told of an object, and the options of `detect` by their names.
_TOLD: Mapping[str, Callable[[str], Any]] = {"id": str, "scale": values.millimetres}
_OPTIONS: Mapping[str, Callable[[str], Any]] = {
    "tolerance": values.tolerance,
    "units": _one_of(*METRES),
    "measure": _one_of("surface", "solid"),
    "seed": values.natural,
    "frame": values.natural,
    "outliers": _one_of("auto", "floor", "none"),
    "viewpoint": values.place,
    "labels": str,
    "weights": str,
    "isolated": lambda text: _one_of("yes", "no")(text) == "yes",
}


# Bytes of a manifest: half a million lines, ten times what the largest data sets have.
_LARGEST = 64 * 2**20


def manifest(path: Path) -> list[Job]:
    """The objects of a manifest: CSV with a column `path`, relative to it, and any of `id`, `scale` and the options.

    Raises:
        InputError: with the line and the column.
    """
    found: list[Job] = []
    seen: dict[str, dict[str, int]] = {"path": {}, "id": {}}
    for line, row in _lines(path):
        place = f"{path}:{line}"
        for column, known in seen.items():
            if row[column] and (first := known.setdefault(row[column], line)) != line:
                raise InputError(f"{place}: {column}: {row[column]} stands in line {first}, too")
        file = row["path"] if is_remote(row["path"]) else str(path.parent / row["path"])
        if not row["path"] or not (is_remote(file) or Path(file).is_file()):
            raise InputError(
                f"{place}: path: {row['path'] or 'is empty'}: no such file; expected one relative to {path.parent}"
            )
        told, options = (
            {name: _value(place, name, row[name], read) for name, read in kind.items() if row.get(name)}
            for kind in (_TOLD, _OPTIONS)
        )
        found.append(Job(name=row["path"], path=file, place=place, told=told, options=options))
    if not found:
        raise InputError(f"{path}: names no objects; expected a line for each below the titles")
    return found


def _lines(path: Path) -> Iterator[tuple[int, Mapping[str, str]]]:
    """The lines of a manifest with their number, as text by column; a column that is not there is empty."""
    try:
        with path.open("rb") as stream:
            data = stream.read(_LARGEST + 1)
        text = data.decode("utf-8-sig") if len(data) <= _LARGEST else ""
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or 'no text in UTF-8'}") from None
    if len(data) > _LARGEST:
        raise InputError(f"{path}: has more than {_LARGEST:,} bytes, or no end; split it into several manifests")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        titles = [title.strip() for title in next(reader, [])]
        _check_titles(path, titles)
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(titles):
                raise InputError(
                    f"{path}:{reader.line_num}: has {len(cells)} values, expected {len(titles)} as the titles"
                )
            yield reader.line_num, {"id": ""} | dict(zip(titles, (cell.strip() for cell in cells), strict=True))
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: is no CSV: {error}") from None


def _check_titles(path: Path, titles: Sequence[str]) -> None:
    known = ["path", *_TOLD, *_OPTIONS]
    for title in titles:
        if title not in known:
            raise InputError(f"{path}:1: {title!a}: unknown column; expected {', '.join(known)}{meant(title, known)}")
        if titles.count(title) > 1:
            raise InputError(f"{path}:1: {title}: stands there twice")
    if "path" not in titles:
        raise InputError(f"{path}:1: there is no column path; expected {', '.join(known)}")


def _value(place: str, column: str, text: str, read: Callable[[str], Any]) -> Any:
    from argparse import ArgumentTypeError

    try:
        return read(text)
    except (ArgumentTypeError, ValueError) as error:
        raise InputError(f"{place}: {column}: {error}") from None
