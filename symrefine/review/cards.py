"""The page of a review from what is kept: those that are open first, as many as one page takes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from symrefine.errors import one_line
from symrefine.picture.words import symbol
from symrefine.report.review import Card, Option, review_page
from symrefine.review.decisions import SCHEMA, Decision, Decisions
from symrefine.review.labels import Label, Labels
from symrefine.review.objects import Row
from symrefine.review.store import place_of_picture

# Objects on one page: an evening of looking, and a few megabytes.
MOST = 200
_OF_CHOICE = ("point_group", "meaning", "rotations", "count", "forgiven", "limits")


def page_text(
    folder: str,
    out: Path,
    rows: Mapping[int, Row],
    order: Sequence[int],
    decisions: Decisions,
    labels: Labels,
    again: Sequence[str],
) -> str:
    """The page, with the pictures in the folder of the labels inside it.

    Args:
        folder: where the models are.
        out: where the labels go.
        rows: are asked for one by one, as many as one page takes.
        order: numbers of the objects that something was found in, the most doubtful first.
        again: words of the command that applies what is saved.
    """
    waiting = [number for number in order if number not in labels]
    shown = [*waiting, *(number for number in order if number in labels)][:MOST]
    cards = [_card(out, rows[number], decisions.get(number), labels.get(number)) for number in shown]
    used = set(order)
    failed = [number for number in rows if number not in used]
    return review_page(
        cards,
        folder=folder,
        again=again,
        more=max(0, len(waiting) - MOST),
        failed=[one_line(str(rows[number]["error"])) for number in failed[:MOST]],
        more_failed=max(0, len(failed) - MOST),
        schema=SCHEMA,
    )


def _card(out: Path, row: Row, decision: Decision | None, label: Label | None) -> Card:
    options = [
        Option(
            **{name: choice[name] for name in _OF_CHOICE},
            picture=place_of_picture(out, row, k).read_bytes(),
        )
        for k, choice in enumerate(cast("list[dict[str, Any]]", row["choices"]))
    ]
    likely = zip(*(choice["probabilities"] for choice in row["choices"]), strict=True)
    return Card(
        number=row["object"],
        file=row["file"],
        sha256=str(row["sha256"]),
        state="open" if label is None else "decided" if label.by == "person" else "accepted",
        answer=row["answer"],
        doubt=row["doubt"] or " ".join(_remarks(row)),
        tolerance=row["tolerance"],
        tolerances=row["tolerances"],
        likely=[None if None in at else cast("list[float]", list(at)) for at in likely],
        options=options,
        decision=None if decision is None else asdict(decision),
    )


def _remarks(row: Row) -> Iterator[str]:
    """What one should know before one decides."""
    if row["at_least"]:
        strewn = row.get("strewn", False)
        yield "Strays that are left near it may hide more." if strewn else "Not all of it was seen: there may be more."
    if row["textured"] not in (None, row["answer"]):
        yield f"With its texture it is {symbol(str(row['textured']))}."
