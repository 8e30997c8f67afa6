"""HTML from plain text and numbers: escaped, and with nothing in it that acts on a reader's screen."""

import json
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symrefine.geometry import Isometry
from symrefine.rounding import twelve_digits

# What shows nothing of its own but acts on text: control and format characters (those that turn the direction of
# writing among them), halves of pairs, private ones, separators of lines and paragraphs.
_ACTING = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What fills the template.

    Attributes:
        title: of the window, as HTML.
        sections: from top to bottom, as HTML; empty ones are left out.
        data: what the script draws from.
        turns: whether there is a model to turn.
        style: a sheet beside that of all pages, from `assets`; empty if there is none.
        script: that acts on the page, from `assets`.
    """

    title: str
    sections: tuple[str, ...]
    data: Mapping[str, Any] = field(default_factory=dict)
    turns: bool = False
    style: str = ""
    script: str = "page.js"


def plain(text: str) -> str:
    """Text with every character that acts instead of showing written as its number, and escaped for HTML."""
    return escape("".join(_written(c) if unicodedata.category(c) in _ACTING else c for c in text))


def _written(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def island(data: Mapping[str, Any]) -> str:
    """JSON that can stand in a script element, whatever texts it holds: no `<`, no `&`, ASCII alone."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def rounded(values: ArrayLike, scale: float = 1.0) -> Any:
    """Numbers as nested lists, as in the JSON report: to twelve digits, 0 where they are nothing beside `scale`."""
    return np.vectorize(twelve_digits, otypes=[float])(values, scale).tolist()


def homogeneous_rows(motion: Isometry, scale: float) -> Any:
    """The homogeneous matrix of a motion as nested lists; a shift is 0 where it is nothing beside `scale`."""
    rows = [[*rounded(m), rounded(s, scale)] for m, s in zip(motion.matrix, motion.shift, strict=True)]
    return [*rows, [0.0] * len(rows) + [1.0]]


def prose(text: str) -> str:
    """Plain text in which no line ends between a number and its percent sign."""
    return plain(text).replace(" %", "\N{NO-BREAK SPACE}%")


def schoenflies(name: str) -> str:
    """A Schoenflies symbol as it is printed, as HTML: what follows its first letter stands below the line."""
    letter, below = name[:1], name[1:].replace("inf", "∞")
    # O(2) and SO(2) of the plane are no such symbols.
    return f"{plain(letter)}<sub>{plain(below)}</sub>" if below and "(" not in name else plain(name)


def section(title: str, told: str, body: str) -> str:
    """A headline, a paragraph of plain text, and HTML."""
    return f"<section><h2>{plain(title)}</h2><p>{prose(told)}</p>{body}</section>"


def table(heads: Iterable[str], rows: Sequence[Sequence[str]], *, caption: str) -> str:
    """A table in a box of its own that scrolls; heads are plain text, cells are HTML."""
    head = "".join(f'<th scope="col">{plain(h)}</th>' for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    named = f'<caption class="unseen">{plain(caption)}</caption>'
    inner = f"<table>{named}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide" tabindex="0" role="region" aria-label="{plain(caption)}">{inner}</div>'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Names with values, side by side."""
    items = "".join(f"<div><dt>{plain(name)}</dt><dd>{prose(value)}</dd></div>" for name, value in pairs)
    return f"<dl>{items}</dl>"


def head(about: str, title: str, beside: str, summary: str, *, group: str = "") -> str:
    """What the page is about, the answer in large letters, what it means, and one sentence.

    The answer is `title`, and the symbol of a `group`, if it is one.
    """
    answer = " ".join(filter(None, (plain(title), schoenflies(group))))
    return (
        f'<header><p class="over">{plain(about)}</p>'
        f"<h1>{answer} <span>{plain(beside)}</span></h1>"
        f'<p class="lead">{prose(summary)}</p></header>'
    )


def copy_button(index: int, name: str) -> str:
    """A button that copies the matrix of an element; hidden until the script that does it runs."""
    label = plain(f"Copy the matrix of {name} as JSON")
    return (
        f'<button type="button" class="copy needs-script" hidden data-copy="{index}" aria-label="{label}">copy</button>'
    )


def code(text: str) -> str:
    """Plain text as code."""
    return f"<code>{plain(text)}</code>"
