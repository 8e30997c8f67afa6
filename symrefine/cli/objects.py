"""The rows of many objects: what `detect` finds in each, or what was wrong with it."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache
from json import dumps, loads
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, cast

from symrefine.cli.inputs import FRAMES, failure, scans, told_as
from symrefine.cli.rows import row_line
from symrefine.clock import Clock
from symrefine.errors import InputError, about, one_line
from symrefine.files import ENDLESS, asked_for, is_regular
from symrefine.fleet.crew import HERE, Executor
from symrefine.fleet.journal import Journal, Kinds, Latest
from symrefine.fleet.limits import Limits, Lost
from symrefine.fleet.remote import beside, fetched, is_remote, state
from symrefine.fleet.rows import Row
from symrefine.fleet.shard import PART, piece
from symrefine.fleet.tasks import finish, is_final, our_version

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.load import Frames
    from symrefine.plane import PlanarDetection
    from symrefine.shape import Shape

# What every row has.
KINDS: Kinds = {"file": (str,), "error": (str, NoneType)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """An object whose row is wanted.

    Attributes:
        name: what its row calls it.
        path: of its file, or the address.
        place: where it was named, for messages.
        options: of `detect`.
        told: what else its row says of it: `id`, `scale`.
        scale: millimetres in a unit, if its entry of BOP is wanted; then a file holds one object.
        mark: its place in a fleet of several shards.
        frame: its number, where its file holds several.
        frames: how many its file is known to hold.
    """

    name: str
    path: str
    place: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    told: Mapping[str, Any] = field(default_factory=dict)
    scale: float | None = None
    mark: Row = field(default_factory=dict)
    frame: int | None = None
    frames: int | None = None

    @property
    def is_file(self) -> bool:
        """Whether each object in its file, however many there are, is wanted; BOP has one for each file."""
        return self.frames is None and self.scale is None and "frame" not in self.options

    @property
    def whole(self) -> str:
        """What the rows call its file."""
        return self.name if self.frame is None else self.name.removesuffix(f"#{self.frame}")

    def apart(self, frames: int) -> "list[Job]":
        """A job for each of the objects in its file, called as `detect` calls them."""
        return [
            replace(
                self,
                name=f"{self.name}#{k}",
                options={**self.options, "frame": k},
                mark={PART: piece(self.mark[PART], k, frames)} if self.mark else {},
                frame=k,
                frames=frames,
            )
            for k in range(frames)
        ]


def known_apart(jobs: Sequence[Job], before: Latest, limits: Limits) -> list[Job]:
    """The jobs, one for each object of a file of which rows done before say how many it holds."""
    frames = {row["file"].rpartition("#")[0]: row["frames"] for row in before.values() if _is_of_several(row)}

    def known(job: Job) -> list[Job]:
        one_each = job.apart(frames[job.name]) if job.name in frames and job.is_file else []
        # If the file has changed since, so may their number have.
        still = any(holds(before.get(one.name), one, limits) for one in one_each)
        return one_each if still and not holds(before.get(job.name), job, limits) else [job]

    return [one for job in jobs for one in known(job)]


def _is_of_several(row: Row) -> bool:
    """Whether a row done before is of one of several objects in a file, of as many as one file may have."""
    return type(frames := row.get("frames")) is int and 1 < frames <= FRAMES


def detected(
    jobs: Sequence[Job],
    executor: Executor = HERE,
    journal: Journal | None = None,
    *,
    expect: Callable[[int], None] = lambda _: None,
) -> Iterator[tuple[Job, Row]]:
    """Each job with its row, in the order in which they are done; a file that cannot be used has a row with its error.

    A file that holds several objects gives a job and a row for each, after all others.

    Args:
        executor: what does them, which changes nothing but the time and the order.
        journal: where each row goes first.
        expect: is told how many more there are where a file turns out to hold several.
    """
    by_name = {job.name: job for job in jobs}
    several: list[Job] = []
    for row in finish(executor, examine_file, jobs, lost):
        job = by_name[row["file"]]
        if job.is_file and "frames" in row:
            several += job.apart(row["frames"])
            expect(row["frames"] - 1)
            continue
        if journal is not None:
            journal.append(row)
        yield job, row
    if several:
        yield from detected(several, executor, journal)


def holds(row: Row | None, job: Job, limits: Limits) -> bool:
    """Whether a row done before still tells of its file, with the entry of BOP if one is wanted and can be had."""
    if row is None or not _is_whole(row):
        return False
    now = loads(dumps(_head(job)))  # as it comes back from the journal, places as lists
    if not is_final(row, limits) or (job.mark and any(row.get(key) != mark for key, mark in job.mark.items())):
        return False
    compared = {*now, "id", "scale"} - {"error", "sha256" if is_remote(job.path) else "state"}
    if now["error"] is not None or any(row.get(key) != now.get(key) for key in compared):
        return False
    if row.get("beside", {}) != _beside(job.path, row.get("beside", {})):
        return False
    return job.scale is None or row["error"] is not None or row.get("bop", {}).get("scale") == job.scale


def _is_whole(row: Row) -> bool:
    """Whether a row done before has what is told of it; one that somebody changed may not."""
    try:
        row_line(row["file"], row)
        known = isinstance(row.get("beside", {}), dict)
        entry = row.get("bop", {}).get("entry", {"diameter": 0.0})
        return known and isinstance(entry["diameter"], float)
    except (AttributeError, KeyError, TypeError, ValueError):
        return False


def examine_file(job: Job) -> Row:
    """The row of one object: its record, or what was wrong with it; of a file that holds several, how many."""
    row = _head(job)
    if row["error"] is not None:
        return row
    names: list[str] = []
    # Of several objects in a file that is read whole there is nothing more to fetch.
    here = nullcontext(Path(job.path)) if job.frames else _here(job.path)
    try:
        with here as file, asked_for() as asked:
            try:
                with told_as(str(file), job.path), told_as(str(file.parent), _folder(job.path)):
                    row |= _found(job, file, row)
            finally:
                names = [os.path.relpath(path, file.parent) for path in asked if path != file]
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        row["error"] = failure(job.name if job.frames else job.path, error)
    return row | {"beside": _beside(job.path, names)} if names else row


def _found(job: Job, file: Path, row: Row) -> Row:
    """What is found in one object, whose row has been begun; of a file that holds several, how many."""
    from symrefine.cli.detect import detected as decided

    clock = Clock()
    with clock("load"):
        row["sha256"], frames = _frames(job, file, row)
        if len(frames) > 1 and job.is_file:
            return {"frames": len(frames)}
        with about(str(file)):
            frames.check(job.frame)
        shape = frames[job.frame or 0]
        shape = replace(shape, source=job.path) if shape.source == str(file) else shape
    found = decided(shape, dict(job.options), job.path)
    told: Row = found.to_dict(load_s=clock.seconds["load"])
    return told if job.scale is None else told | {"bop": _bop(found, found.shape, job.scale)}


def _frames(job: Job, file: Path, row: Row) -> tuple[str, "Frames[Any]"]:
    """What tells the content of a file, and the objects in it."""
    if job.frames is None:
        return row["sha256"] or _digest(file), scans(str(file), dict(job.options), in_chunks=True)
    options = {name: value for name, value in job.options.items() if name != "frame"}
    return _kept(job.path, row.get("state") or row["sha256"], dumps(options))


@lru_cache(maxsize=1)
def _kept(path: str, _: str, options: str) -> tuple[str, "Frames[Shape]"]:
    """What tells the content of a file, and the objects in it; read once for all that a process does of them.

    Args:
        _: what changes when the file does.
        options: of `detect`, as JSON.
    """
    with _here(path) as file:
        frames: Frames[Shape] = scans(str(file), loads(options))

        def named(number: int) -> "Shape":
            with told_as(str(file), path):
                return replace(frames[number], source=f"{path}#{number}")

        return _digest(file), replace(frames, make=named)


def lost(job: Job, why: Lost) -> Row:
    """The row of an object that was lost."""
    return _head(job) | {"error": one_line(f"{job.path}: {why.why}")}


def _head(job: Job) -> Row:
    """What names a row: the file, its content, the options, the version; `error` is set if the file cannot be read."""
    row: Row = {"file": job.name, **job.mark, **job.told, "sha256": None, "error": None}
    row |= {} if job.frames is None else {"frames": job.frames}
    row |= {"version": our_version(), "options": dict(job.options)}
    try:
        if is_remote(job.path):
            row["state"] = state(job.path)
        else:
            row["sha256"] = _digest(Path(job.path))
    except InputError as error:
        row["error"] = one_line(error)
    return row


def _digest(path: Path) -> str:
    """What tells the content of a file.

    Raises:
        InputError: it cannot be read, or is a pipe or a device.
    """
    try:
        seen = path.stat()
        if is_regular(seen):
            return _digest_of(path, (seen.st_ino, seen.st_size, seen.st_mtime_ns))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    raise InputError(f"{path}: {ENDLESS}")


@lru_cache(maxsize=1)
def _digest_of(path: Path, _: tuple[int, ...]) -> str:
    """Of a file in a state, once for all objects in it."""
    from hashlib import file_digest

    with path.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()


def _beside(path: str, names: Iterable[str]) -> dict[str, str | None]:
    """What tells the content of files that a file needs, by their place from its folder; None of one not there."""
    return {name: _digest_or_none(path, name) for name in names}


def _digest_or_none(path: str, name: str) -> str | None:
    try:
        return state(beside(path, name)) if is_remote(path) else _digest(Path(path).parent / name)
    except (InputError, ValueError):  # a name that no system takes
        return None


def _folder(path: str) -> str:
    """The folder of a file, as messages call it."""
    return beside(path, ".") if is_remote(path) else str(Path(path).parent)


def _here(path: str) -> AbstractContextManager[Path]:
    """A file on this machine."""
    return fetched(path) if is_remote(path) else nullcontext(Path(path))


def _bop(found: "Detection | PlanarDetection", shape: "Shape", scale: float) -> Row:
    """The entry of BOP with its scale and what it cannot hold, or why there is none."""
    from symrefine.export.bop import bop_entry, bop_limits

    if shape.dim != 3:
        return {"scale": scale, "note": f"{shape.source}: lies in the plane; BOP is for objects in space"}
    detection = cast("Detection", found)
    try:
        entry = bop_entry(detection, shape, scale=scale)
    except InputError as error:
        return {"scale": scale, "note": str(error)}
    limits = bop_limits(detection)
    return {"scale": scale, "entry": entry, "note": f"{shape.source}: {limits}" if limits else None}
