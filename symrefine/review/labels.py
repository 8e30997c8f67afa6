"""What follows from what was found and what a person decided: the labels of a data set, and what is still open."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from symrefine.files import json_pieces
from symrefine.review.decisions import Decision, Decisions
from symrefine.review.objects import Row, choice_of

SCHEMA = "symrefine.labels/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """The symmetry of an object, and who says so: a person, or a confidence that is high enough.

    Attributes:
        choice: which of those of its row.
        diameter: of the object, millimetres.
    """

    choice: int
    diameter: float
    by: Literal["person", "confidence"]
    decision: Decision | None = None


Labels = dict[int, Label]


def trouble(decision: Decision, rows: Mapping[int, Row]) -> str:
    """The field of a decision that does not fit what is there, and what would; empty where it fits.

    Of rows without choices, of objects that are still to be examined, it is checked that they are the same.
    """
    row = rows.get(decision.object)
    if row is None:
        return f"object: is {decision.object}, which is not there; expected one of {_some(rows)}"
    if row["sha256"] != decision.sha256:
        return (
            f"sha256: is not that of {row['file']}, which has changed since it was looked at; decide it again on the "
            "new page"
        )
    names = [choice["point_group"] for choice in row["choices"]]
    if names and decision.point_group is not None and decision.point_group not in names:
        return f"point_group: is {decision.point_group!r}; expected one of {', '.join(names)}"
    return ""


def _some(rows: Mapping[int, Row]) -> str:
    numbers = sorted(rows)
    return ", ".join(map(str, numbers)) if len(numbers) <= 12 else f"{len(numbers)} from {numbers[0]} to {numbers[-1]}"


def merged(before: Decisions, given: Decisions) -> Decisions:
    """Decisions of before with others put in their place; what is taken back is gone."""
    return {number: d for number, d in (before | given).items() if d.point_group is not None}


def labelled(rows: Mapping[int, Row], decisions: Decisions, accept: float | None) -> Labels:
    """The objects whose symmetry is settled; a person has the last word.

    Args:
        rows: are asked for once, one after the other.
        accept: confidence from which an object needs no look; None if all do.
    """
    labels: Labels = {}
    for number in sorted(rows):
        row, decision = rows[number], decisions.get(number)
        said = row["answer"] if decision is None else decision.point_group
        sure = decision is not None or (accept is not None and row["confidence"] >= accept)
        if sure and said is not None and (choice := choice_of(row, said)) is not None:
            labels[number] = Label(
                choice=choice,
                diameter=row["choices"][choice]["entry"]["diameter"],
                by="confidence" if decision is None else "person",
                decision=decision,
            )
    return labels


def info_json(rows: Mapping[int, Row], labels: Labels) -> Iterator[str]:
    """`models_info.json` of BOP, piece by piece: of objects that are settled, and of no other.

    An entry without symmetries would say that an object has none; without an entry a program stops there.
    """
    return json_pieces((str(k), rows[k]["choices"][label.choice]["entry"]) for k, label in labels.items())


def labels_json(rows: Mapping[int, Row], labels: Labels, accept: float | None) -> Iterator[str]:
    """`labels.json`, piece by piece: each label with who says so, and what is still open with the reason."""
    entries = {
        "schema": SCHEMA,
        "version": next((row["version"] for row in rows.values()), None),
        "accept": accept,
        "objects": (_told(number, rows[number], label) for number, label in labels.items()),
        "open": (_open(number, rows[number], accept) for number in rows if number not in labels),
    }
    return json_pieces(entries.items())


def _told(number: int, row: Row, label: Label) -> dict[str, Any]:
    choice, decision = row["choices"][label.choice], label.decision
    return {
        "object": number,
        "file": row["file"],
        "sha256": row["sha256"],
        "point_group": choice["point_group"],
        "rotations": choice["rotations"],
        "mirrors_only_in_shape": bool(decision and decision.mirrors_only_in_shape),
        "by": label.by,
        "confidence": row["confidence"] if choice["point_group"] == row["answer"] else None,
        "found": row["answer"],
        "tolerance": decision.tolerance if decision else row["tolerance"],
        "note": decision.note if decision else "",
    }


def _open(number: int, row: Row, accept: float | None) -> dict[str, Any]:
    return {"object": number, "file": row["file"], "point_group": row["answer"], "why": why_open(row, accept)}


def why_open(row: Row, accept: float | None) -> str:
    """Why an object has no label."""
    if row["error"] is not None:
        return row["error"]
    if row["doubt"]:
        return row["doubt"]
    asked = "nobody looked at it" if accept is None else f"below {accept:g}, and nobody looked at it"
    return f"confidence {row['confidence']:.6g}: {asked}"
