"""What a person decided of objects, as the page of a review saves it: read strictly, never repaired."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError, printable
from symrefine.files import file_bytes, json_text
from symrefine.rounding import LARGEST_TOLERANCE

SCHEMA = "symrefine.decisions/1"
# A decision takes some 300 bytes: so much holds those of a hundred thousand objects. JSON of so many bytes, which in
# Python is 25 times as large at worst (empty lists), stays below a gigabyte.
LARGEST = 32 * 2**20
# Characters of a note: a paragraph.
LONGEST_NOTE = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What a person decided of an object.

    Attributes:
        object: its number.
        file: what it was read from.
        sha256: of what that held when the person looked.
        point_group: one of its choices; None takes an earlier decision back.
        tolerance: at which the person looked.
        mirrors_only_in_shape: whether its texture breaks the mirrors that its shape has.
        note: in the person's words.
    """

    object: int
    file: str
    sha256: str
    point_group: str | None
    tolerance: float
    mirrors_only_in_shape: bool = False
    note: str = ""


Decisions = dict[int, Decision]


def _is_number(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 10**9


def _is_tolerance(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value <= LARGEST_TOLERANCE


def _is_hash(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 64 and set(value) <= set("0123456789abcdef")


# What each field must be, and how that is said.
_FIELDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "object": (_is_number, "the number of an object, from 0"),
    "file": (lambda v: isinstance(v, str) and bool(v), "the name of its file"),
    "sha256": (_is_hash, "the SHA-256 of its file, 64 digits from 0 to f"),
    "point_group": (lambda v: v is None or (isinstance(v, str) and bool(v)), "a symbol such as C4v, or null"),
    "tolerance": (_is_tolerance, f"a fraction of the diagonal in (0, {LARGEST_TOLERANCE}]"),
    "mirrors_only_in_shape": (lambda v: isinstance(v, bool), "true or false"),
    "note": (lambda v: isinstance(v, str) and len(v) <= LONGEST_NOTE, f"a text of up to {LONGEST_NOTE} characters"),
}
_OPTIONAL = ("mirrors_only_in_shape", "note")


def read_decisions(path: Path) -> Decisions:
    """The decisions in a file, by the number of their object.

    Raises:
        InputError: not such a file, a key that is missing, unknown or twice there, or a value of another kind, with
            its key path and what would be right.
    """
    try:
        return _decisions(_document(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _document(path: Path) -> Any:
    if path.is_file() and path.stat().st_size > LARGEST:
        raise InputError(f"has {path.stat().st_size:,} bytes; decisions have {LARGEST:,} at most")
    try:
        text = file_bytes(path).decode("utf-8")
        return json.loads(text, object_pairs_hook=_distinct, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"is not JSON: {error}; expected what the page of a review saves") from None


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for key, value in pairs:
        if key in made:
            raise InputError(f"{_shown(key)}: stands there twice; expected each key once")
        made[key] = value
    return made


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def _decisions(data: Any) -> Decisions:
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        found = _shown(data.get("schema")) if isinstance(data, dict) else type(data).__name__
        raise InputError(f"schema: is {found}; expected an object with schema {SCHEMA!r}")
    _check_keys(data, ("schema", "decisions"), (), "")
    if not isinstance(data["decisions"], list):
        raise InputError(f"decisions: is {_shown(data['decisions'])}; expected a list")
    made: Decisions = {}
    for k, entry in enumerate(data["decisions"]):
        decision = _decision(entry, f"decisions[{k}]")
        if decision.object in made:
            raise InputError(f"decisions[{k}].object: is {decision.object}, decided before; expected each object once")
        made[decision.object] = decision
    return made


def _decision(entry: Any, place: str) -> Decision:
    if not isinstance(entry, dict):
        raise InputError(f"{place}: is {_shown(entry)}; expected an object with the keys {', '.join(_FIELDS)}")
    _check_keys(entry, tuple(_FIELDS), _OPTIONAL, f"{place}.")
    for key, value in entry.items():
        fits, right = _FIELDS[key]
        if not fits(value):
            raise InputError(f"{place}.{key}: is {_shown(value)}; expected {right}")
    return Decision(**entry)


def _check_keys(entry: Mapping[str, Any], known: tuple[str, ...], optional: tuple[str, ...], place: str) -> None:
    for key in entry:
        if key not in known:
            raise InputError(f"{place}{printable(key)[:60]}: is unknown; expected {', '.join(known)}")
    for key in known:
        if key not in entry and key not in optional:
            raise InputError(f"{place}{key}: is missing; expected {_FIELDS[key][1] if key in _FIELDS else 'a list'}")


def _shown(value: Any) -> str:
    """A value on one line, cut where it is long."""
    text = json.dumps(value) if not isinstance(value, float) or math.isfinite(value) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def decisions_text(decisions: Decisions) -> str:
    """The file that holds decisions, in the order of their objects."""
    return json_text({"schema": SCHEMA, "decisions": [asdict(decisions[number]) for number in sorted(decisions)]})
