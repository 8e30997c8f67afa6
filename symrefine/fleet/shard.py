"""A fleet in shards, each done where and when one likes, and the parts made one: all, each once, none foreign."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from hashlib import sha256
from json import dumps
from typing import Any

from symrefine.errors import InputError
from symrefine.fleet.journal import Row

PART = "part"
# The rows of a task by their numbers: 0 alone, or as many as it says.
Pieces = dict[int, Row]


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
    def of(cls, tasks: int, about: Any) -> "Whole":
        """The fleet of so many tasks that plain data tell about."""
        return cls(tasks=tasks, digest=sha256(dumps(about, sort_keys=True).encode()).hexdigest()[:12])

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


def merged(parts: Mapping[str, Sequence[Row]]) -> list[Row]:
    """The rows of all tasks in their order, without their marks; what was done again in one part counts as it was last.

    Args:
        parts: the rows of each part, by the name of its file.

    Raises:
        InputError: a part is no part, or of another fleet; parts overlap, or some tasks are missing.
    """
    places: dict[int, tuple[str, Pieces]] = {}
    first: tuple[str, Row] | None = None
    for name, rows in parts.items():
        for index, pieces in _latest(name, rows).items():
            mark = next(iter(pieces.values()))[PART]
            first = first or (name, mark)
            _check_same(first, (name, mark))
            other, _ = places.setdefault(index, (name, pieces))
            if other != name:
                raise InputError(
                    f"{name}: has rows of shard {mark['shard']}, and so has {other}; merge takes each once"
                )
    if first is None:
        raise InputError(f"{next(iter(parts), 'merge')}: holds no rows; there is nothing to merge")
    _check_complete(first[1], {index for index, (_, pieces) in places.items() if _is_complete(pieces)})
    whole = (pieces[number] for _, (_, pieces) in sorted(places.items()) for number in sorted(pieces))
    return [{key: value for key, value in row.items() if key != PART} for row in whole]


def _latest(name: str, rows: Sequence[Row]) -> dict[int, Pieces]:
    """The rows of each task of a part; they all say of how many they are, as the last one does."""
    found: dict[int, Pieces] = {}
    for row in rows:
        mark = row.get(PART)
        if mark is None:
            raise InputError(f"{name}: holds rows of no shard; merge takes what --shard wrote")
        if not _is_whole(mark):
            raise InputError(f"{name}: is damaged: a row says that its place is {mark}")
        pieces = found.setdefault(mark["index"], {})
        if any(other[PART].get("pieces") != mark.get("pieces") for other in pieces.values()):
            pieces.clear()
        pieces[mark.get("piece", 0)] = row
    return found


def _is_complete(pieces: Pieces) -> bool:
    return len(pieces) == next(iter(pieces.values()))[PART].get("pieces", 1)


def _check_same(first: tuple[str, Row], other: tuple[str, Row]) -> None:
    (name, mark), (foreign, its) = first, other
    if any(mark[key] != its[key] for key in ("fleet", "tasks")) or _of(mark) != _of(its):
        said = [f"{m['fleet']} of {m['tasks']} tasks in {_of(m)} shards" for m in (its, mark)]
        raise InputError(f"{foreign}: is part of another fleet, {said[0]}; {name} is part of {said[1]}")


def _check_complete(mark: Row, done: Set[int]) -> None:
    of = _of(mark)
    found = Counter(index % of for index in done)
    for number in range(1, of + 1):
        tasks = len(range(number - 1, mark["tasks"], of))
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
    shard = re.fullmatch(r"([1-9][0-9]*)/([1-9][0-9]*)", mark["shard"])
    if shard is None or not 0 <= mark["index"] < mark["tasks"]:
        return False
    return Shard(number=int(shard[1]), of=int(shard[2])).takes(mark["index"])


def _is_piece(mark: Row) -> bool:
    return 0 <= mark.get("piece", 0) < mark.get("pieces", 1)


def _of(mark: Row) -> int:
    return int(mark["shard"].partition("/")[2])
