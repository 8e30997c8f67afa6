"""MDL molfiles, .mol, and lists of them, .sdf, in both versions (V2000, V3000); lengths are in Angstrom as a rule.

Only the atoms are read: their places and symbols. Isotopes that a list `M  ISO` names are no elements of their own.
"""

from collections.abc import Sequence

from symrefine.errors import InputError
from symrefine.load.content import Content
from symrefine.load.elements import atoms, element
from symrefine.load.frames import Frames
from symrefine.load.text import NATURAL, Line, all_lines, count, is_number, shorten

_END_OF_RECORD = "$$$$"
_HEADER = 4
_V30 = "M  V30 "


def read_molfile(data: bytes) -> Frames[Content]:
    """Atoms of each record.

    Raises:
        InputError: of a record, when it is asked for: cut off, other numbers of atoms or bonds than declared, columns
            without numbers, no elements; a drawing in two dimensions.
    """
    records = _records(list(all_lines(data)))
    return Frames("molecules", len(records), lambda k: _molecule(records[k]))


def _molecule(lines: list[Line]) -> Content:
    """Atoms of one record."""
    if len(lines) < _HEADER:
        raise InputError(f"cut off after line {lines[-1][0]}; expected three lines of a header and one of counts")
    if not any(text == "M  END" for _, text in lines):
        raise InputError(f"cut off: the molecule that begins in line {lines[0][0]} has no line 'M  END'")
    number, counts = lines[_HEADER - 1]
    version = counts[33:].strip()
    if version not in ("V2000", "V3000"):
        raise InputError(f"line {number}: version {shorten(version)}; expected V2000 or V3000 from column 34 on")
    rows = _rows_v2000(lines) if version == "V2000" else _rows_v3000(lines)
    places = [[_coordinate(words[k], line, k) for k in range(1, 4)] for line, words in rows]
    if lines[1][1][20:22] == "2D" and not any(z for _, _, z in places):
        raise InputError(
            f"line {lines[1][0]}: is marked 2D and has no heights: a drawing, whose lengths and angles mean nothing; "
            "save the molecule with its coordinates in space"
        )
    elements = [element(words[0], f"line {line}") for line, words in rows]
    return atoms(places, elements, lines=[line for line, _ in rows])


# One atom: its line, then its symbol, x, y and z as they are written.
_Row = tuple[int, Sequence[str]]


def _records(lines: list[Line]) -> list[list[Line]]:
    """Lines of each record of a file; nothing but empty lines may follow the last."""
    records: list[list[Line]] = [[]]
    for line in lines:
        if line[1] == _END_OF_RECORD:
            records.append([])
        else:
            records[-1].append(line)
    if len(records) > 1 and not any(text for _, text in records[-1]):
        records.pop()
    return records


def _rows_v2000(lines: list[Line]) -> list[_Row]:
    number, counts = lines[_HEADER - 1]
    sizes = [counts[k : k + 3].strip() for k in (0, 3)]
    if not all(NATURAL.fullmatch(size) for size in sizes):
        raise InputError(f"line {number}: {shorten(counts)}; expected the numbers of atoms and bonds in columns 1 to 6")
    size, bonds = map(int, sizes)
    body = lines[_HEADER:]
    end = next(k for k, (_, text) in enumerate(body) if text.startswith("M  "))
    others = [k for k, (_, text) in enumerate(body[:end]) if text[:3] in ("A  ", "V  ", "G  ", "S  ")]
    there = min([end, *others])
    if there != size + bonds:
        raise InputError(
            f"line {number} declares {count(size, 'atom')} and {count(bonds, 'bond')}; "
            f"{count(there, 'line')} of them follow"
        )
    for line, text in body[size : size + bonds]:
        ends = [text[k : k + 3].strip() for k in (0, 3)]
        if not all(NATURAL.fullmatch(word) and 1 <= int(word) <= size for word in ends):
            raise InputError(f"line {line}: {shorten(text)}; expected a bond of two of the atoms 1 to {size}")
    return [(line, (text[31:34].strip(), text[:10], text[10:20], text[20:30])) for line, text in body[:size]]


def _rows_v3000(lines: list[Line]) -> list[_Row]:
    rows = [(line, text[len(_V30) :]) for line, text in lines if text.startswith(_V30)]
    heads = [(line, text.split()) for line, text in rows if text.startswith("COUNTS ")]
    if len(heads) != 1 or len(heads[0][1]) < 3 or not NATURAL.fullmatch(heads[0][1][1]):
        raise InputError(f"line {lines[_HEADER - 1][0]}: V3000 needs one line 'M  V30 COUNTS' with a number of atoms")
    begin, end = ([k for k, (_, text) in enumerate(rows) if text == f"{word} ATOM"] for word in ("BEGIN", "END"))
    if len(begin) != 1 or len(end) != 1 or begin[0] > end[0]:
        raise InputError(f"line {heads[0][0]}: expected one block of atoms, from 'BEGIN ATOM' to 'END ATOM', behind it")
    found = [(line, text.split()) for line, text in rows[begin[0] + 1 : end[0]]]
    size = int(heads[0][1][1])
    if len(found) != size:
        raise InputError(f"line {heads[0][0]} declares {count(size, 'atom')}; {len(found)} follow")
    for line, words in found:
        if len(words) < 6 or not NATURAL.fullmatch(words[0]) or words[-1] == "-":
            raise InputError(f"line {line}: expected a number, a symbol, x y z and a map number, all in one line")
    return [(line, words[1:5]) for line, words in found]


def _coordinate(word: str, line: int, axis: int) -> float:
    if not is_number(word):
        raise InputError(f"line {line}: {'xyz'[axis - 1]} is {shorten(word)}, which is not a number")
    return float(word)
