"""Chemical .xyz: the number of atoms, a remark, then an element and three coordinates for each atom.

Three variants are read as well: several frames one after the other; extended .xyz, whose remark
says `Properties=species:S:1:pos:R:3...` what the columns are (its `Lattice` repeats nothing: the atoms that are written
are the object); and lines of atoms with no number in front of them.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.errors import InputError
from symrefine.load.content import Content, Values
from symrefine.load.elements import HEAVIEST, atomic_number
from symrefine.load.frames import Frames
from symrefine.load.text import NATURAL, Line, count, is_number, numbered_lines, parse_table, shorten

_LAYOUT = "an element and x y z, as 'O 0.0 0.0 0.1'"
_PROPERTIES = re.compile(r"(?:^|\s)properties\s*=\s*(\"[^\"]*\"|'[^']*'|\S+)", re.IGNORECASE)
_WORD = re.compile(r"[A-Za-z]{1,3}")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Column:
    """One column or more of the lines of atoms: a name, where it begins, and how many columns it has."""

    name: str
    is_text: bool
    start: int
    width: int


# Of plain .xyz; atoms may be named by their numbers.
_PLAIN = [_Column(name="species", is_text=True, start=0, width=1), _Column(name="pos", is_text=False, start=1, width=3)]


def is_molecule(lines: list[Line]) -> bool:
    """Whether a text begins as chemical .xyz does: with one whole number, where points have three numbers or six."""
    return bool(lines) and NATURAL.fullmatch(lines[0][1]) is not None


def is_bare_molecule(lines: list[Line]) -> bool:
    """Whether a text begins with an atom: a word of letters and three numbers."""
    words = lines[0][1].split() if lines else []
    return len(words) == 4 and _WORD.fullmatch(words[0]) is not None and all(map(is_number, words[1:]))


def read_molecule(data: bytes) -> Frames[Content]:
    """Atoms of each frame; elements are labels: atomic numbers, and -2 and -3 for D and T.

    Raises:
        InputError: other numbers of atoms than the file says; of a frame, when it is asked for: unknown elements,
            columns that nothing explains.
    """
    lines = numbered_lines(data)
    if lines[0][0] != 1:
        raise InputError(f"line {lines[0][0]}: {lines[0][1]}; the number of atoms must be line 1, a remark line 2")
    frames = _frames(dict(lines), lines[-1][0])

    def made(k: int) -> Content:
        remark, atoms = frames[k]
        return _atoms(atoms, _columns(remark))

    return Frames("frames", len(frames), made)


def read_bare_molecule(lines: Sequence[Line]) -> Content:
    """Atoms that no number of theirs stands in front of."""
    return _atoms(lines, _PLAIN)


def _frames(lines: dict[int, str], last: int) -> list[tuple[Line, list[Line]]]:
    """Remark and atoms of each frame of a file of `last` lines; empty lines may part the frames."""
    frames = []
    head = 1
    while head <= last:
        if not NATURAL.fullmatch(lines[head]):
            raise InputError(f"line {head}: {shorten(lines[head])}; expected the number of atoms, alone")
        size = int(lines[head])
        atoms = range(head + 2, head + 2 + size)
        missing = next((line for line in atoms if line not in lines), None)
        if missing is not None and missing < last:
            raise InputError(f"line {missing} is empty; expected {_LAYOUT}")
        if missing is not None:
            there = max(last - head - 1, 0)
            raise InputError(f"line {head} declares {count(size, 'atom')}; {there} follow from line {head + 2} on")
        frames.append(((head + 1, lines.get(head + 1, "")), [(line, lines[line]) for line in atoms]))
        behind = next((line for line in range(head + 2 + size, last + 1) if line in lines), last + 1)
        if behind <= last and not NATURAL.fullmatch(lines[behind]):
            raise InputError(
                f"line {behind}: {shorten(lines[behind])} behind the {count(size, 'atom')} that line {head} declares; "
                "expected nothing behind them, or another frame, which begins with its number of atoms"
            )
        head = behind
    return frames


def _columns(remark: Line) -> list[_Column]:
    """What the columns are, as the remark of extended .xyz says; the plain ones if it says nothing."""
    number, text = remark
    match = _PROPERTIES.search(text)
    if match is None:
        return _PLAIN
    words = match[1].strip("\"'").split(":")
    triples = list(zip(words[::3], words[1::3], words[2::3], strict=False))
    columns: list[_Column] = []
    for name, kind, width in triples:
        start = columns[-1].start + columns[-1].width if columns else 0
        if kind not in ("S", "R", "I", "L") or not NATURAL.fullmatch(width) or int(width) > _WIDEST:
            break
        columns.append(_Column(name=name.lower(), is_text=kind in "SL", start=start, width=int(width)))
    shapes = {column.name: column.width for column in columns}
    if len(columns) * 3 != len(words) or len(shapes) != len(columns) or shapes.get("pos") != 3:
        raise InputError(f"line {number}: Properties={shorten(match[1])}; expected as species:S:1:pos:R:3")
    if 1 not in (shapes.get("species"), shapes.get("z")):
        raise InputError(f"line {number}: Properties={shorten(match[1])}; expected species:S:1 (or Z:I:1) among them")
    return columns


# Columns of one property; what is wider is no property of an atom, but damage.
_WIDEST = 1000


def _atoms(lines: Sequence[Line], columns: Sequence[_Column]) -> Content:
    width = columns[-1].start + columns[-1].width
    layout = _LAYOUT if columns == _PLAIN else f"{count(width, 'column')}: {' '.join(c.name for c in columns)}"
    for number, text in lines:
        if len(words := text.split()) != width:
            raise InputError(f"line {number} has {count(len(words), 'column')}; expected {layout}")
    texts = {k for column in columns if column.is_text for k in range(column.start, column.start + column.width)}
    # A number in place of a text keeps the columns of messages right.
    rows = [(n, " ".join("0" if k in texts else word for k, word in enumerate(text.split()))) for n, text in lines]
    table = parse_table(rows, columns=(width,), layout=layout)
    places = {column.name: column for column in columns}
    species = places.get("species") or places["z"]
    elements = np.array([_element(line, species.start) for line in lines], dtype=np.int64)
    start = places["pos"].start
    fields: dict[str, Values] = {
        c.name: np.array([text.split()[c.start] for _, text in lines]) if c.is_text else table[:, c.start]
        for c in columns
        if c.width == 1 and c is not species
    }
    return Content(
        points=table[:, start : start + 3],
        labels=elements,
        point_fields=fields | {"element": elements},
        point_lines=[number for number, _ in lines],
    )


def _element(line: Line, column: int) -> int:
    number, text = line
    word = text.split()[column]
    whole = int(word) if NATURAL.fullmatch(word) else 0
    known = whole if 1 <= whole <= HEAVIEST else atomic_number(word)
    if known is not None:
        return known
    raise InputError(
        f"line {number}: {shorten(word)} is no element; expected a symbol (H, He, ... Og, D, T) or an atomic "
        f"number from 1 to {HEAVIEST}"
    )
