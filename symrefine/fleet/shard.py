"""A fleet in shards, each done where and when one likes, and the parts made one: all, each once, none foreign."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from hashlib import sha256
from json import dumps
from typing import Any

from symrefine.errors import InputError
from symrefine.fleet.rows import Row, Rows

PART = "part"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shard:
    """The `number`-th of `of` shards, counted from 1: every `of`-th task, so that each gets large and small ones."""

    number: int
    of: int

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def takes(self, index: int) -> bool:
        """Whether a task belongs to it."""
        return index % self.of == self.number - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """All tasks of a fleet: how many, and a digest of what decides their rows, equal wherever a shard is done."""

    tasks: int
    digest: str

    @classmethod
    def of(cls, tasks: int, about: Iterable[Any]) -> "Whole":
        """The fleet of so many tasks that plain data tell about, one after the other."""
        digest = sha256()
        for part in about:
            digest.update(dumps(part, sort_keys=True).encode() + b"\n")
        return cls(tasks=tasks, digest=digest.hexdigest()[:12])

    def mark(self, shard: Shard | None, index: int) -> Row:
        """What a row says of its place; nothing where there are no shards."""
        if shard is None:
            return {}
        return {PART: {"fleet": self.digest, "tasks": self.tasks, "shard": str(shard), "index": index}}

    def has(self, row: Row, shard: Shard | None, index: int) -> bool:
        """Whether a row done before may stand for a task of a shard; where there are no shards, any may."""
        return shard is None or row.get(PART) == self.mark(shard, index)[PART]


def piece(mark: Row, number: int, of: int) -> Row:
    """The mark of one of the rows of a task that has several."""
    return mark | {"piece": number, "pieces": of}


@dataclass(frozen=True, slots=True)
class _Place:
    """What the rows of a task say of it: one for all tasks of a shard that have as many rows."""

    fleet: str
    tasks: int
    shard: str
    pieces: int | None

    @property
    def of(self) -> int:
        return int(self.shard.partition("/")[2])


@dataclass(slots=True)
class _Task:
    """Where the rows of a task stand: the part, and which there by their number: 0 alone, or as many as it says."""

    part: str
    place: _Place
    rows: dict[int, int] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        return len(self.rows) == (self.place.pieces or 1)


def merged(parts: Mapping[str, Sequence[Row]]) -> Rows:
    """The rows of all tasks in their order, without their marks; what was done again in one part counts as it was last.

    Args:
        parts: the rows of each part, by the name of its file; they are asked for twice.

    Raises:
        InputError: a part is no part, or of another fleet; parts overlap, or some tasks are missing.
    """
    tasks: dict[int, _Task] = {}
    first: _Task | None = None
    for name, rows in parts.items():
        for index, task in _latest(name, rows).items():
            first = first or task
            _check_same(first, task, parts)
            other = tasks.setdefault(index, task).part
            if other != name:
                raise InputError(
                    f"{name}: has rows of shard {task.place.shard}, and so has {other}; merge takes each once"
                )
    if first is None:
        raise InputError(f"{next(iter(parts), 'merge')}: holds no rows; there is nothing to merge")
    _check_complete(first.place, {index for index, task in tasks.items() if task.is_complete})
    order = [(task.part, task.rows[number]) for _, task in sorted(tasks.items()) for number in sorted(task.rows)]

    def unmarked(k: int) -> Row:
        part, place = order[k]
        return {key: value for key, value in parts[part][place].items() if key != PART}

    return Rows(len(order), unmarked)


def _latest(name: str, rows: Sequence[Row]) -> dict[int, _Task]:
    """The tasks of a part with their last rows; these all say of how many they are, as the last one does."""
    found: dict[int, _Task] = {}
    known: dict[_Place, _Place] = {}
    for k, row in enumerate(rows):
        mark = row.get(PART)
        if mark is None:
            raise InputError(f"{name}: holds rows of no shard; merge takes what --shard wrote")
        if not _is_whole(mark):
            raise InputError(f"{name}: is damaged: a row says that its place is {mark}")
        place = _Place(mark["fleet"], mark["tasks"], mark["shard"], mark.get("pieces"))
        place = known.setdefault(place, place)
        task = found.setdefault(mark["index"], _Task(name, place))
        if task.place.pieces != place.pieces:
            task.rows.clear()
        task.place = place
        task.rows[mark.get("piece", 0)] = k
    return found


def _check_same(first: _Task, other: _Task, parts: Mapping[str, Sequence[Row]]) -> None:
    """Refuse parts of two fleets, with the option that tells them apart if one does."""
    own, its = first.place, other.place
    if (own.fleet, own.tasks, own.of) == (its.fleet, its.tasks, its.of):
        return
    if own.fleet != its.fleet and (differs := _difference(parts[other.part], parts[first.part])):
        name, value, expected = differs
        raise InputError(
            f"{other.part}: is part of another fleet: of {name} {value}, and {first.part} of {name} {expected}"
        )
    said = [f"{place.fleet} of {place.tasks} tasks in {place.of} shards" for place in (its, own)]
    raise InputError(f"{other.part}: is part of another fleet, {said[0]}; {first.part} is part of {said[1]}")


def _difference(rows: Sequence[Row], others: Sequence[Row]) -> tuple[str, str, str] | None:
    """What was asked for otherwise in all rows of two parts, and both values; None if it is nothing that rows tell.

    A manifest may ask for more than one value in a part.
    """
    said, expected = ([_asked(row) for row in part] for part in (rows, others))
    for name in dict.fromkeys(name for row in (*said, *expected) for name in row):
        values, wanted = ({row.get(name, "none") for row in part} for part in (said, expected))
        if not values & wanted:
            return name, " or ".join(sorted(values)), " or ".join(sorted(wanted))
    return None


def _asked(row: Row) -> dict[str, str]:
    """What decides a row beside its file: options, with the name that the command line has for them, and versions."""
    options = row.get("options")
    told = options.items() if isinstance(options, dict) else ()
    named = {f"--{name.replace('_', '-')}": str(value) for name, value in told if value is not None}
    return named | {name: str(row[name]) for name in ("version", "code", "config") if name in row}


def _check_complete(place: _Place, done: Set[int]) -> None:
    of = place.of
    found = Counter(index % of for index in done)
    for number in range(1, min(of, place.tasks) + 1):
        tasks = len(range(number - 1, place.tasks, of))
        if missing := tasks - found[number - 1]:
            shard = Shard(number=number, of=of)
            raise InputError(
                f"shard {shard} is not complete: {missing} of its {tasks} tasks lack rows in the parts given; "
                f"run it again with --shard {shard}, or name its file"
            )


def _is_whole(mark: Any) -> bool:
    """Whether a mark is one that `Whole.mark` makes."""
    kinds = {"fleet": str, "tasks": int, "shard": str, "index": int}
    if not isinstance(mark, dict):
        return False
    kinds |= {"piece": int, "pieces": int} if "pieces" in mark else {}
    if {name: type(value) for name, value in mark.items()} != kinds or not _is_piece(mark):
        return False
    shard = re.fullmatch(r"([1-9][0-9]{0,5})/([1-9][0-9]{0,5})", mark["shard"])
    if shard is None or not 0 <= mark["index"] < mark["tasks"]:
        return False
    return Shard(number=int(shard[1]), of=int(shard[2])).takes(mark["index"])


def _is_piece(mark: Row) -> bool:
    return 0 <= mark.get("piece", 0) < mark.get("pieces", 1)
