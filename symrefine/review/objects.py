"""What is kept of each object of a data set: the groups to choose from, each with what BOP says of it."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NotRequired, TypedDict

from symrefine.detection.result import Detection
from symrefine.detection.story import chosen
from symrefine.export.bop import Entry, bop_entry, bop_limits
from symrefine.export.numbers import number
from symrefine.shape import Shape

# Pixels of a picture: sharp at the width that a card has on a page, and ten kilobytes or so.
PICTURE = (440, 330)
# Of WebP, from 0 to 100: thin lines of planes stay clean.
_QUALITY = 82


class Choice(TypedDict):
    """A group that an object may have.

    `rotations` is its proper part, the symmetry that a pose estimator knows, with `count` of them; `probabilities` one
    for each of the tolerances, None where nothing could be decided; `entry` that of `models_info.json`; `limits` what
    such an entry cannot hold.
    """

    point_group: str
    meaning: str
    rotations: str
    count: int | None
    forgiven: float
    probabilities: list[float | None]
    entry: Entry
    limits: str


class Row(TypedDict):
    """What is kept of an object: what names it, and either `error` or all the rest.

    Attributes:
        object: its number.
        answer: the group that was found, None where nothing was decided for the reason in `doubt`.
        at_least: whether there may be more than was seen.
        strewn: whether that is for strays that are left.
        sparse: whether that is for points being so few.
        textured: the group of the shape with its texture, where one was read beside the shape.
        tolerances: at which the groups are told how likely they are.
        choices: groups each inside the next, C1 first.
    """

    object: int
    file: str
    sha256: str | None
    error: str | None
    version: str
    options: dict[str, Any]
    scale: float
    answer: str | None
    confidence: float
    doubt: str
    at_least: bool
    strewn: NotRequired[bool]
    sparse: NotRequired[bool]
    textured: str | None
    tolerance: float
    tolerances: list[float]
    choices: list[Choice]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examined:
    """What was found in an object, as fields of its row, and a picture of each choice, WebP."""

    told: dict[str, Any]
    pictures: tuple[bytes, ...]


def examined(found: Detection, shape: Shape, *, scale: float) -> Examined:
    """What is kept of an object in which something was found.

    Args:
        scale: millimetres in one unit of the shape.
    """
    steps = sorted({found.tolerance, *(step.tolerance for step in found.staircase)})
    likely = [None if found.examined.doubt(t) else [c.probability for c in found.choices(t)] for t in steps]
    instead = [chosen(found, choice.point_group) for choice in found.choices()]
    choices = [
        _choice(other, shape, scale, forgiven.forgiven) | {"probabilities": [row and number(row[k]) for row in likely]}
        for k, (other, forgiven) in enumerate(zip(instead, found.choices(), strict=True))
    ]
    told = {
        "answer": None if found.undetermined else found.point_group,
        "confidence": number(found.confidence),
        "doubt": found.undetermined,
        "at_least": bool(found.at_least),
        "strewn": bool(found.strewn),
        "sparse": bool(found.sparse),
        "textured": None if found.textured is None else found.textured.point_group,
        "tolerance": number(found.tolerance),
        "tolerances": [number(t) for t in steps],
        "choices": choices,
    }
    return Examined(told=told, pictures=tuple(_picture(other, shape) for other in instead))


def _choice(found: Detection, shape: Shape, scale: float, forgiven: float) -> dict[str, Any]:
    from symrefine.picture.words import meaning

    proper = found.group.proper_subgroup()
    return {
        "point_group": found.point_group,
        "meaning": meaning(found.group),
        "rotations": proper.name,
        "count": int(proper.order) if proper.is_finite else None,
        "forgiven": number(forgiven),
        "entry": bop_entry(found, shape, scale=scale),
        "limits": bop_limits(found),
    }


def _picture(found: Detection, shape: Shape) -> bytes:
    from io import BytesIO

    from PIL import Image

    from symrefine.picture.draw import picture_png

    width, height = PICTURE
    painted = Image.open(BytesIO(picture_png(found, shape, width=width, height=height, title=False))).convert("RGB")
    packed = BytesIO()
    painted.save(packed, format="WEBP", quality=_QUALITY, method=6)
    return packed.getvalue()


def flaw(row: Mapping[str, Any]) -> str:
    """What of a row without error is not as `examined` tells it, as of one that somebody changed; empty if all is."""
    try:
        json.dumps(row, allow_nan=False)
    except ValueError:
        return "a number of it is not finite"
    steps, choices = row.get("tolerances"), row["choices"]
    if not (isinstance(steps, list) and all(map(_is_real, steps)) and row.get("tolerance") in steps):
        return "its tolerances are no numbers, or do not have the one that was asked for"
    for k, choice in enumerate(choices):
        wrong = [key for key, fits in _OF_CHOICE.items() if not (isinstance(choice, dict) and fits(choice.get(key)))]
        if wrong or len(choice["probabilities"]) != len(steps):
            return f"choices[{k}].{wrong[0] if wrong else 'probabilities'} is not what it is of such a row"
    if row["answer"] not in (None, *(choice["point_group"] for choice in choices)) or not choices:
        return f"its answer is none of its {len(choices)} choices"
    return "" if 0.0 <= row["confidence"] <= 1.0 else "its confidence is no probability"


def _is_real(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


# What each key of a choice must be.
_OF_CHOICE: dict[str, Callable[[Any], bool]] = {
    "point_group": lambda v: isinstance(v, str),
    "meaning": lambda v: isinstance(v, str),
    "rotations": lambda v: isinstance(v, str),
    "count": lambda v: v is None or isinstance(v, int),
    "forgiven": _is_real,
    "probabilities": lambda v: isinstance(v, list) and all(p is None or _is_real(p) for p in v),
    "entry": lambda v: isinstance(v, dict) and _is_real(v.get("diameter")),
    "limits": lambda v: isinstance(v, str),
}


def choice_of(row: Row, point_group: str) -> int | None:
    """Which of its choices has that name, if the object has it."""
    return next((k for k, choice in enumerate(row["choices"]) if choice["point_group"] == point_group), None)


def doubtful_first(rows: Mapping[int, Row]) -> list[int]:
    """Numbers of the objects that something was found in, the most doubtful first.

    Args:
        rows: are asked for once, one after the other.
    """
    told = [(row["confidence"], number) for number, row in rows.items() if row["error"] is None]
    return [number for _, number in sorted(told)]
