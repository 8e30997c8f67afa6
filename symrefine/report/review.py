"""The page on which a person labels a data set: a card for each object, its groups as buttons, choices to save.

It is one file that asks nothing of any server: pictures are inside, choices are saved by the browser as a download, or
copied from a field of text.
"""

import base64
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Literal

from symrefine.picture.words import percent
from symrefine.report.markup import Page, plain, prose
from symrefine.report.page import filled

State = Literal["open", "accepted", "decided"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """A group to choose: what it means, its rotations and how many (None: endless), what it forgives, a picture."""

    point_group: str
    meaning: str
    rotations: str
    count: int | None
    forgiven: float
    limits: str
    picture: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """An object to look at.

    Attributes:
        answer: the group that was found, None where nothing was decided.
        doubt: why nothing was, or what else one should know; empty where there is nothing to say.
        likely: probability of each option at each of the tolerances; None where nothing can be decided.
        decision: what a person decided before, as the page saves it.
    """

    number: int
    file: str
    sha256: str
    state: State
    answer: str | None
    doubt: str
    tolerance: float
    tolerances: Sequence[float]
    likely: Sequence[Sequence[float] | None]
    options: Sequence[Option]
    decision: Mapping[str, Any] | None = None


_TITLES: dict[State, str] = {
    "open": "To look at, the most doubtful first",
    "accepted": "Accepted without a look, the least sure first",
    "decided": "Decided by a person",
}


def review_page(
    cards: Sequence[Card],
    *,
    folder: str,
    again: Sequence[str],
    more: int,
    failed: Sequence[str],
    more_failed: int,
    schema: str,
) -> str:
    """The whole page; equal input gives equal pages.

    Args:
        cards: the most doubtful first.
        folder: where the models are.
        again: words of the command that applies what is saved.
        more: objects that are to be looked at after these.
        failed: what was wrong with files that could not be used.
        more_failed: such files beside those.
        schema: of the file that the page saves.
    """
    waiting = sum(card.state == "open" for card in cards) + more
    told = f"{waiting} {'object' if waiting == 1 else 'objects'} to look at"
    seen = [(card.number, card.sha256, card.decision) for card in cards]
    key = sha256(json.dumps(seen).encode()).hexdigest()[:16]
    parts = [_head(told, folder, again)]
    parts += [_section(state, [card for card in cards if card.state == state], more) for state in _TITLES]
    page = Page(
        title=f"{plain(told)} · {plain(folder)}",
        sections=(*parts, _failed(failed, more_failed), _save()),
        data={"schema": schema, "key": key, "objects": [_island(card) for card in cards]},
        style="review.css",
        script="review.js",
    )
    return filled(page)


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


def _section(state: State, cards: Sequence[Card], more: int) -> str:
    left = f'<p class="quiet">{more:,} more come after these: decide these, then run the command again.</p>'
    shown = "".join(_card(card) for card in cards) + left * (state == "open" and more > 0)
    return f'<section class="cards"><h2>{plain(_TITLES[state])}</h2>{shown}</section>' if shown else ""


def _card(card: Card) -> str:
    name = f"object {card.number}"
    first = next((k for k, option in enumerate(card.options) if option.point_group == card.answer), 0)
    pictures = "".join(_picture(card, k, k == first) for k in range(len(card.options)))
    buttons = "".join(_button(card, k) for k in range(len(card.options)))
    doubt = f'<p class="doubt">{prose(card.doubt)}</p>' if card.doubt else ""
    steps = "".join(
        f'<option value="{t!r}"{" selected" if t == card.tolerance else ""}>{percent(t)}</option>'
        for t in card.tolerances
    )
    return (
        f'<article class="object" id="object-{card.number}" data-object="{card.number}" tabindex="-1" '
        f'aria-label="{plain(name)}"><div class="shots">{pictures}</div><div class="say">'
        f"<h3>Object {card.number} <span>{plain(card.file)}</span></h3>{doubt}"
        f'<div class="choices" role="group" aria-label="Group of {plain(name)}">{buttons}</div>'
        '<p class="told" aria-live="polite"></p><div class="more">'
        f'<label>Tolerance <select class="tolerance" disabled>{steps}</select></label>'
        '<label class="tick"><input class="mirrors" type="checkbox" disabled> Mirrors hold for the shape, not for its '
        "texture</label>"
        '<label class="words">Note <input class="note" type="text" maxlength="2000" disabled></label>'
        "</div></div></article>"
    )


def _picture(card: Card, k: int, shown: bool) -> str:
    option = card.options[k]
    data = base64.b64encode(option.picture).decode("ascii")
    alt = plain(f"{card.file} with the elements of {option.point_group}")
    return (
        f'<img width="440" height="330" src="data:image/webp;base64,{data}" alt="{alt}" data-shot="{k}"'
        f"{'' if shown else ' hidden'}>"
    )


def _button(card: Card, k: int) -> str:
    option = card.options[k]
    answer = ' class="answer"' if option.point_group == card.answer else ""
    likely = card.likely[list(card.tolerances).index(card.tolerance)]
    said = "" if likely is None else probability(likely[k])
    return (
        f'<button type="button" data-choice="{k}" aria-pressed="false" disabled{answer}>'
        f"<b>{plain(option.point_group.replace('inf', '∞'))}</b> <span>{said}</span></button>"
    )


def probability(value: float) -> str:
    """A probability in percent, never rounded to certainty."""
    if 0.01 <= value < 0.99:
        return f"{100.0 * value:.0f} %"
    if value < 0.01:
        return "< 1 %"
    return "> 99 %" if value < 0.9999 else "> 99.9 %"


def _island(card: Card) -> dict[str, Any]:
    """What the script needs of an object."""
    options = [
        {
            "group": option.point_group,
            "told": _told(option),
            "mirrors": option.rotations != option.point_group,
        }
        for option in card.options
    ]
    likely = [None if row is None else [probability(p) for p in row] for row in card.likely]
    best = [None if row is None else max(range(len(row)), key=row.__getitem__) for row in card.likely]
    return {
        "object": card.number,
        "file": card.file,
        "sha256": card.sha256,
        "state": card.state,
        "tolerance": card.tolerance,
        "tolerances": list(card.tolerances),
        "likely": likely,
        "best": best,
        "options": options,
        "decision": card.decision,
    }


def _told(option: Option) -> str:
    """What a group means, what a pose estimator makes of it, and what it forgives."""
    endless = {"K": "all rotations about a point", "Cinf": "turns by any angle"}
    turns = endless.get(option.rotations, "turns by any angle, and half turns across")
    if option.count is not None:
        turns = "no rotation" if option.count == 1 else f"{option.count} rotations"
    forgives = f" Forgives {percent(option.forgiven)} of the diagonal." if option.forgiven else ""
    limits = f" {option.limits}." if option.limits else ""
    meaning = option.meaning[:1].upper() + option.meaning[1:]
    return f"{meaning}. For pose estimators: {option.rotations.replace('inf', '∞')}, {turns}.{forgives}{limits}"


def _save() -> str:
    return (
        '<aside class="save needs-script" hidden aria-label="Save"><p id="progress" role="status"></p><p>'
        '<button type="button" id="save" class="main">Save decisions.json</button> '
        '<button type="button" id="show" aria-expanded="false" aria-controls="text">Show as text</button></p>'
        '<textarea id="text" hidden readonly rows="8" spellcheck="false" aria-label="The decisions as text"></textarea>'
        "</aside>"
    )
