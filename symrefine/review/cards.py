"""The page on which a person labels a data set: a card for each object, its groups as buttons, choices to save.

It is one file that asks nothing of any server: pictures are inside, choices are saved by the browser as a download, or
copied from a field of text. Objects that are open come first, as many as one page takes.
"""

import base64
import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, cast

from symrefine.errors import one_line
from symrefine.picture.words import more_for, percent, sentence, symbol
from symrefine.report.markup import Page, plain, prose
from symrefine.report.page import filled
from symrefine.review.decisions import SCHEMA, Decisions
from symrefine.review.labels import Label, Labels
from symrefine.review.objects import Choice, Row, choice_of
from symrefine.review.store import place_of_picture

# Objects on one page: an evening of looking, and a few megabytes.
MOST = 200
State = Literal["open", "accepted", "decided"]
_TITLES: dict[State, str] = {
    "open": "To look at, the most doubtful first",
    "accepted": "Accepted without a look, the least sure first",
    "decided": "Decided by a person",
}


def page_text(
    folder: str,
    out: Path,
    rows: Mapping[int, Row],
    order: Sequence[int],
    decisions: Decisions,
    labels: Labels,
    again: Sequence[str],
) -> str:
    """The whole page, with the pictures in the folder of the labels inside it; equal input gives equal pages.

    Args:
        folder: where the models are.
        out: where the labels go.
        rows: are asked for one by one, as many as one page takes.
        order: numbers of the objects that something was found in, the most doubtful first.
        again: words of the command that applies what is saved.
    """
    waiting = [number for number in order if number not in labels]
    shown = [*waiting, *(number for number in order if number in labels)][:MOST]
    cards = {number: rows[number] for number in shown}
    states = {number: _state(labels.get(number)) for number in shown}
    decided = {number: asdict(decisions[number]) if number in decisions else None for number in shown}
    used = set(order)
    failed = [number for number in rows if number not in used]
    told = f"{len(waiting)} {'object' if len(waiting) == 1 else 'objects'} to look at"
    seen = [(number, str(row["sha256"]), decided[number]) for number, row in cards.items()]
    sections = [_head(told, folder, again)]
    for state in _TITLES:
        articles = [_card(row, out) for number, row in cards.items() if states[number] == state]
        sections.append(_section(state, articles, len(waiting) - MOST))
    sections.append(_failed([one_line(str(rows[number]["error"])) for number in failed[:MOST]], len(failed) - MOST))
    page = Page(
        title=f"{plain(told)} · {plain(folder)}",
        sections=(*sections, _save()),
        data={
            "schema": SCHEMA,
            "key": sha256(json.dumps(seen).encode()).hexdigest()[:16],
            "objects": [_island(row, states[number], decided[number]) for number, row in cards.items()],
        },
        style="review.css",
        script="review.js",
    )
    return filled(page)


def _state(label: Label | None) -> State:
    if label is None:
        return "open"
    return "decided" if label.by == "person" else "accepted"


def _head(told: str, folder: str, again: Sequence[str]) -> str:
    command = shlex.join(again)
    return (
        f'<header><p class="over">Symmetry of {plain(folder)}</p><h1>{plain(told)}</h1>'
        '<p class="lead">Choose the group that each object is meant to have, save the choices, and apply them with</p>'
        f"<pre>{plain(command)}</pre>"
        '<p class="quiet">Keys: J and K go to the next object and back, 1 to 9 choose a group, again the same key '
        "takes it back, S saves. Percentages are probabilities; a group with more operations forgives more.</p>"
        '<noscript><p class="lead">Choosing needs scripts, which this browser does not run.</p></noscript></header>'
    )


def _failed(failed: Sequence[str], more: int) -> str:
    if not failed:
        return ""
    rows = "".join(f"<li>{plain(text)}</li>" for text in failed)
    left = f'<p class="quiet">{more:,} more stand in labels.json.</p>' * (more > 0)
    return f'<section class="failed"><h2>Could not be used</h2><ul>{rows}</ul>{left}</section>'


def _section(state: State, articles: Sequence[str], more: int) -> str:
    left = f'<p class="quiet">{more:,} more come after these: decide these, then run the command again.</p>'
    shown = "".join(articles) + left * (state == "open" and more > 0)
    return f'<section class="cards"><h2>{plain(_TITLES[state])}</h2>{shown}</section>' if shown else ""


def _card(row: Row, out: Path) -> str:
    name, choices = f"object {row['object']}", row["choices"]
    first = 0 if row["answer"] is None else choice_of(row, row["answer"]) or 0
    pictures = "".join(_picture(row, k, out, shown=k == first) for k in range(len(choices)))
    likely = _likely(row)[row["tolerances"].index(row["tolerance"])]
    buttons = "".join(
        _button(k, choice["point_group"], is_answer=choice["point_group"] == row["answer"], likely=likely)
        for k, choice in enumerate(choices)
    )
    said = row["doubt"] or " ".join(_remarks(row))
    doubt = f'<p class="doubt">{prose(said)}</p>' if said else ""
    steps = "".join(
        f'<option value="{t!r}"{" selected" if t == row["tolerance"] else ""}>{percent(t)}</option>'
        for t in row["tolerances"]
    )
    return (
        f'<article class="object" id="object-{row["object"]}" data-object="{row["object"]}" tabindex="-1" '
        f'aria-label="{plain(name)}"><div class="shots">{pictures}</div><div class="say">'
        f"<h3>Object {row['object']} <span>{plain(row['file'])}</span></h3>{doubt}"
        f'<div class="choices" role="group" aria-label="Group of {plain(name)}">{buttons}</div>'
        '<p class="told" aria-live="polite"></p><div class="more">'
        f'<label>Tolerance <select class="tolerance" disabled>{steps}</select></label>'
        '<label class="tick"><input class="mirrors" type="checkbox" disabled> Mirrors hold for the shape, not for its '
        "texture</label>"
        '<label class="words">Note <input class="note" type="text" maxlength="2000" disabled></label>'
        "</div></div></article>"
    )


def _likely(row: Row) -> list[list[float] | None]:
    """Probability of each choice, at each of the tolerances; None where nothing can be decided."""
    steps = zip(*(choice["probabilities"] for choice in row["choices"]), strict=True)
    return [None if None in step else cast("list[float]", list(step)) for step in steps]


def _remarks(row: Row) -> Iterator[str]:
    """What one should know before one decides."""
    if row["at_least"]:
        yield sentence(more_for(strewn=row.get("strewn", False), sparse=row.get("sparse", False)))
    if row["textured"] not in (None, row["answer"]):
        yield f"With its texture it is {symbol(str(row['textured']))}."


def _picture(row: Row, k: int, out: Path, *, shown: bool) -> str:
    data = base64.b64encode(place_of_picture(out, row, k).read_bytes()).decode("ascii")
    alt = plain(f"{row['file']} with the elements of {row['choices'][k]['point_group']}")
    return (
        f'<img width="440" height="330" src="data:image/webp;base64,{data}" alt="{alt}" data-shot="{k}"'
        f"{'' if shown else ' hidden'}>"
    )


def _button(k: int, point_group: str, *, is_answer: bool, likely: Sequence[float] | None) -> str:
    answer = ' class="answer"' if is_answer else ""
    said = "" if likely is None else probability(likely[k])
    return (
        f'<button type="button" data-choice="{k}" aria-pressed="false" disabled{answer}>'
        f"<b>{plain(point_group.replace('inf', '∞'))}</b> <span>{said}</span></button>"
    )


def probability(value: float) -> str:
    """A probability in percent, never rounded to certainty."""
    if 0.01 <= value < 0.99:
        return f"{100.0 * value:.0f} %"
    if value < 0.01:
        return "< 1 %"
    return "> 99 %" if value < 0.9999 else "> 99.9 %"


def _island(row: Row, state: State, decision: Mapping[str, Any] | None) -> dict[str, Any]:
    """What the script needs of an object."""
    likely = _likely(row)
    return {
        "object": row["object"],
        "file": row["file"],
        "sha256": str(row["sha256"]),
        "state": state,
        "tolerance": row["tolerance"],
        "tolerances": row["tolerances"],
        "likely": [None if at is None else [probability(p) for p in at] for at in likely],
        "best": [None if at is None else max(range(len(at)), key=at.__getitem__) for at in likely],
        "options": [
            {
                "group": choice["point_group"],
                "told": _told(choice),
                "mirrors": choice["rotations"] != choice["point_group"],
            }
            for choice in row["choices"]
        ],
        "decision": decision,
    }


def _told(choice: Choice) -> str:
    """What a group means, what a pose estimator makes of it, and what it forgives."""
    endless = {"K": "all rotations about a point", "Cinf": "turns by any angle"}
    turns = endless.get(choice["rotations"], "turns by any angle, and half turns across")
    if choice["count"] is not None:
        turns = "no rotation" if choice["count"] == 1 else f"{choice['count']} rotations"
    forgives = f" Forgives {percent(choice['forgiven'])} of the diagonal." if choice["forgiven"] else ""
    limits = f" {choice['limits']}." if choice["limits"] else ""
    meaning = choice["meaning"][:1].upper() + choice["meaning"][1:]
    return f"{meaning}. For pose estimators: {choice['rotations'].replace('inf', '∞')}, {turns}.{forgives}{limits}"


def _save() -> str:
    return (
        '<aside class="save needs-script" hidden aria-label="Save"><p id="progress" role="status"></p><p>'
        '<button type="button" id="save" class="main">Save decisions.json</button> '
        '<button type="button" id="show" aria-expanded="false" aria-controls="text">Show as text</button></p>'
        '<textarea id="text" hidden readonly rows="8" spellcheck="false" aria-label="The decisions as text"></textarea>'
        "</aside>"
    )
