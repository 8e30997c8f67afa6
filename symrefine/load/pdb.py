"""Protein Data Bank files, .pdb: atoms of one model or of several, in Angstrom.

The atoms that are written are the object: neither the copies of a biological assembly nor those of a crystal are made.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np

from symrefine.errors import InputError
from symrefine.load.content import Content, Values
from symrefine.load.elements import atomic_number, atoms, element
from symrefine.load.frames import Frames
from symrefine.load.text import Line, all_lines, is_number, shorten

_ATOMS = ("ATOM", "HETATM")
# Coordinates as the format writes them, so that a line in which columns have moved is not taken for another place.
_DECIMAL = re.compile(r" *-?[0-9]+\.[0-9]{3}")
_COORDINATES = {"x": slice(30, 38), "y": slice(38, 46), "z": slice(46, 54)}


def read_pdb(data: bytes, named: Collection[str]) -> Frames[Content]:
    """Atoms of each model; elements are labels, and chain, residue, name and occupancy can be.

    Args:
        named: fields that the caller asks for; with `occupancy` an atom may have several places.

    Raises:
        InputError: models that do not end; of a model, when it is asked for: columns without numbers or elements,
            atoms with alternative places.
    """
    models = _models(list(all_lines(data)))
    return Frames("models", len(models), lambda k: _model(models[k], named))


def _model(lines: Sequence[Line], named: Collection[str]) -> Content:
    """Atoms of one model."""
    places = [[_number(line, name) for name in _COORDINATES] for line in lines]
    elements = [_element(line) for line in lines]
    columns = {"chain": slice(21, 22), "residue": slice(17, 20), "name": slice(12, 16)}
    fields: dict[str, Values] = {
        name: np.array([text[place].strip() for _, text in lines], dtype=np.str_) for name, place in columns.items()
    }
    shares = [text[54:60] for _, text in lines]
    if all(map(is_number, shares)):
        fields["occupancy"] = np.array(shares, dtype=np.float64)
    if "occupancy" not in named:
        check_single([(text[12:16], text[17:27]) for _, text in lines], [text[16:17] for _, text in lines],
                     [f"line {number}" for number, _ in lines])  # fmt: skip
    return atoms(places, elements, lines=[number for number, _ in lines], fields=fields)


def check_single(owners: Sequence[object], places: Sequence[str], names: Sequence[str]) -> None:
    """Refuse atoms that are in several places, a share of the time in each.

    Args:
        owners: what tells one atom from others.
        places: name of the place; blank, or as CIF has it `.` or `?`, where there is one only.
        names: each atom, for messages.
    """
    alternatives = [k for k, place in enumerate(places) if place.strip() not in ("", ".", "?")]
    seen = Counter(owners[k] for k in alternatives)
    twice = next((k for k in alternatives if seen[owners[k]] > 1), None)
    if twice is not None:
        raise InputError(
            f"{names[twice]}: an atom has alternative places, here {shorten(places[twice])}; keep one of them, or take "
            "the occupancy as weights"
        )


def _models(lines: list[Line]) -> list[list[Line]]:
    """Lines of the atoms of each model; of the whole file, if it tells none apart."""
    models: list[list[Line]] = []
    loose: list[Line] = []
    begun: int | None = None
    for number, text in lines:
        record = text[:6].rstrip()
        if record == "MODEL":
            if begun is not None:
                raise InputError(f"line {number}: MODEL, but the model that begins in line {begun} has no ENDMDL")
            begun = number
            models.append([])
        elif record == "ENDMDL":
            begun = None
        elif record in _ATOMS:
            (loose if begun is None else models[-1]).append((number, text))
    if begun is not None:
        raise InputError(f"cut off: the model that begins in line {begun} has no ENDMDL")
    if models and loose:
        raise InputError(f"line {loose[0][0]}: an atom outside of the models")
    if not models and not loose:
        raise InputError("no line ATOM or HETATM; not a PDB file, or one without coordinates")
    return models or [loose]


def _number(line: Line, name: str) -> float:
    number, text = line
    place = _COORDINATES[name]
    if not _DECIMAL.fullmatch(text[place]):
        raise InputError(
            f"line {number}: {name} is {shorten(text[place])} in columns {place.start + 1} to {place.stop}; "
            "expected a number with three decimals"
        )
    return float(text[place])


def _element(line: Line) -> int:
    """The element of columns 77 and 78, or where these are blank of 13 and 14, in which it ends the same way."""
    number, text = line
    symbol = text[76:78].strip()
    if symbol:
        return element(symbol, f"line {number}, columns 77 and 78")
    name = text[12:16]
    known = atomic_number(name[:2].strip())
    # Four letters begin in column 13 whatever the element: HG11 may be mercury or a hydrogen.
    if known is None or (name[0] != " " and len(name.strip()) == 4):
        raise InputError(
            f"line {number}: columns 77 and 78 name no element, and the atom {shorten(name.strip())} tells none for "
            "certain; write the elements into these columns"
        )
    return known
