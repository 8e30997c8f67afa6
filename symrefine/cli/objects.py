"""The rows of many objects: what `detect` finds in each, or what was wrong with it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from json import dumps, loads
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symrefine.cli.inputs import failure
from symrefine.errors import InputError, SymrefineError, one_line
from symrefine.fleet.crew import HERE, Executor
from symrefine.fleet.journal import Journal, Row
from symrefine.fleet.limits import Limits, Lost
from symrefine.fleet.remote import fetched, is_remote, state
from symrefine.fleet.tasks import finish, is_final, our_version

if TYPE_CHECKING:
    from symrefine.detection.result import Detection
    from symrefine.plane import PlanarDetection
    from symrefine.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """An object whose row is wanted.

    Attributes:
        name: what its row calls it.
        path: of its file, or the address.
        options: of `detect`.
        told: what else its row says of it.
        scale: millimetres in a unit, if its entry of BOP is wanted.
        mark: its place in a fleet of several shards.
    """

    name: str
    path: str
    options: Mapping[str, Any]
    told: Mapping[str, Any] = field(default_factory=dict)
    scale: float | None = None
    mark: Row = field(default_factory=dict)


def detected(
    jobs: Sequence[Job], executor: Executor = HERE, journal: Journal | None = None
) -> Iterator[tuple[Job, Row]]:
    """Each job with its row, in the order in which they are done; a file that cannot be used has a row with its error.

    Args:
        executor: what does them, which changes nothing but the time and the order.
        journal: where each row goes first.
    """
    by_name = {job.name: job for job in jobs}
    for row in finish(executor, examine_file, jobs, lost, journal):
        yield by_name[row["file"]], row


def holds(row: Row | None, job: Job, limits: Limits) -> bool:
    """Whether a row done before still tells of its file, with the entry of BOP if one is wanted and can be had."""
    if row is None:
        return False
    now = loads(dumps(_head(job)))  # as it comes back from the journal, places as lists
    if not is_final(row, limits) or (job.mark and any(row.get(key) != mark for key, mark in job.mark.items())):
        return False
    compared = {*now, "id", "scale"} - {"error", "sha256" if is_remote(job.path) else "state"}
    if now["error"] is not None or any(row.get(key) != now.get(key) for key in compared):
        return False
    return job.scale is None or row["error"] is not None or row.get("bop", {}).get("scale") == job.scale


def examine_file(job: Job) -> Row:
    """The row of one object: its record, or what was wrong with it."""
    from symrefine.cli.detect import examine

    row = _head(job)
    if row["error"] is not None:
        return row
    try:
        with _here(job.path) as path:
            row["sha256"] = row["sha256"] or _digest(path)
            try:
                shape, detection, record = examine(str(path), dict(job.options))
            except SymrefineError as error:
                raise InputError(str(error).replace(str(path), job.path)) from None
            if is_remote(job.path):
                shape, record = replace(shape, source=job.path), record | {"source": job.path}
        return row | record | ({} if job.scale is None else {"bop": _bop(detection, shape, job.scale)})
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 - one file must not end the others
        return row | {"error": failure(job.path, error)}


def lost(job: Job, why: Lost) -> Row:
    """The row of an object that was lost."""
    return _head(job) | {"error": one_line(f"{job.path}: {why.why}")}


def _head(job: Job) -> Row:
    """What names a row: the file, its content, the options, the version; `error` is set if the file cannot be read."""
    row: Row = {"file": job.name, **job.mark, **job.told, "sha256": None, "error": None}
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
        InputError: it cannot be read.
    """
    from hashlib import file_digest

    try:
        with path.open("rb") as stream:
            return file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


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
