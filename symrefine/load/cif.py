"""Crystallographic information files, .cif: macromolecules (mmCIF) and crystals without symmetry, in Angstrom.

gemmi reads the syntax, which it does strictly; numbers and elements are judged here. The atoms that are written are the
object. A crystal whose file tells only atoms that symmetry does not repeat is refused: half a molecule has another
symmetry than the whole.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from symrefine.errors import InputError
from symrefine.load.content import Content, Values
from symrefine.load.elements import atoms, element
from symrefine.load.extras import library, reading
from symrefine.load.frames import Frames
from symrefine.load.pdb import check_single
from symrefine.load.text import is_number, shorten

# Columns of atoms, those behind `?` only where a file has them.
_MACRO = ("Cartn_x", "Cartn_y", "Cartn_z", "type_symbol", "?pdbx_PDB_model_num", "?label_alt_id", "?occupancy",
          "?auth_asym_id", "?label_comp_id", "?label_atom_id", "?auth_seq_id")  # fmt: skip
_CARTESIAN = ("Cartn_x", "Cartn_y", "Cartn_z", "label", "?type_symbol", "?disorder_group", "?occupancy")
_FRACTIONAL = ("fract_x", "fract_y", "fract_z", "label", "?type_symbol", "?disorder_group", "?occupancy")
_CELL = ("length_a", "length_b", "length_c", "angle_alpha", "angle_beta", "angle_gamma")
_OPERATIONS = ("_symmetry_equiv_pos_as_xyz", "_space_group_symop_operation_xyz", "_space_group_symop.operation_xyz")
_GROUPS = ("_symmetry_space_group_name_H-M", "_space_group_name_H-M_alt", "_space_group_name_Hall",
           "_symmetry_space_group_name_Hall")  # fmt: skip

# Columns of the atoms of one block or model, by name, each with all entries as they are written.
_Table = dict[str, list[str]]


def read_cif(data: bytes, named: Collection[str]) -> Frames[Content]:
    """Atoms of each model of each block, counted through; elements are labels.

    Args:
        named: fields that the caller asks for; with `occupancy` an atom may have several places.

    Raises:
        InputError: damaged, crystals with symmetry, gemmi is not installed; of a model, when it is asked for: unknown
            coordinates or elements, atoms with alternative places.
    """
    gemmi = library("gemmi", "chem")
    with reading("CIF file"):
        document = gemmi.cif.read_string(data.decode("utf-8", errors="replace"))
    models = [model for block in document for model in _models(block, gemmi)]
    if not models:
        raise InputError("holds no coordinates of atoms (_atom_site)")
    return Frames("models", len(models), lambda k: _content(*models[k], named))


def _models(block: Any, gemmi: Any) -> Iterator[tuple[Any, _Table]]:
    """The cell (None for coordinates in Angstrom) and the atoms of each model of a block."""
    if table := _table(block, "_atom_site.", _MACRO):
        numbers = table.get("pdbx_PDB_model_num", [""] * len(table["Cartn_x"]))
        for model in dict.fromkeys(numbers):
            rows = [k for k, number in enumerate(numbers) if number == model]
            yield None, {name: [column[k] for k in rows] for name, column in table.items()}
    elif table := _table(block, "_atom_site_", _FRACTIONAL):
        _check_whole(block)
        yield _cell(block, gemmi), table
    elif table := _table(block, "_atom_site_", _CARTESIAN):
        _check_whole(block)
        yield None, table


def _table(block: Any, prefix: str, tags: Sequence[str]) -> _Table:
    """Columns of a table of a block, empty if it is not there."""
    found = block.find(prefix, list(tags))
    names = [tag.lstrip("?") for tag in tags]
    columns = {name: k for k, name in enumerate(names) if found.width() and found.has_column(k)}
    return {name: [_string(row[k]) for row in found] for name, k in columns.items()} if len(found) else {}


def _string(word: str) -> str:
    """An entry without the quotes around it."""
    return word[1:-1] if len(word) > 1 and word[0] == word[-1] and word[0] in "'\"" else word


def _check_whole(block: Any) -> None:
    """Refuse a crystal whose symmetry makes more atoms of those that are written."""
    operations = max(len(block.find_loop(tag)) for tag in _OPERATIONS)
    groups = [_string(value) for tag in _GROUPS if (value := block.find_value(tag)) not in (None, "?", ".")]
    if operations > 1 or any(group.replace(" ", "").lower() != "p1" for group in groups):
        told = shorten(groups[0]) if groups else f"{operations} operations"
        raise InputError(
            f"block {shorten(block.name)}: a crystal of space group {told}, of which only the atoms that symmetry does "
            "not repeat are written; save the whole molecule as .xyz, or the whole cell in P1"
        )


def _cell(block: Any, gemmi: Any) -> Any:
    words = [block.find_value(f"_cell_{name}") or "" for name in _CELL]
    values = [gemmi.cif.as_number(word) for word in words]
    if not all(0.0 < value < limit for value, limit in zip(values, 3 * (np.inf,) + 3 * (180.0,), strict=True)):
        raise InputError(
            f"block {shorten(block.name)}: cell {shorten(' '.join(words), 80)}; expected three lengths and three angles"
        )
    try:
        cell = gemmi.UnitCell(*values)
    except RuntimeError:  # an angle that is 0 or 180 degrees to rounding
        cell = None
    if cell is None or not 0.0 < cell.volume < np.inf:
        raise InputError(f"block {shorten(block.name)}: cell {shorten(' '.join(words), 80)} has no volume")
    return cell


def _content(cell: Any, table: _Table, named: Collection[str]) -> Content:
    size = len(next(iter(table.values())))
    labels = table.get("label_atom_id") or table.get("label") or [""] * size
    names = [f"atom {k + 1} ({shorten(label)})" for k, label in enumerate(labels)]
    axes = [name for name in table if name.startswith(("Cartn_", "fract_"))]
    points = np.array([[_number(table[axis][k], axis, names[k]) for axis in axes] for k in range(size)])
    if cell is not None:
        with np.errstate(all="ignore"):  # points that are not finite are refused by name later
            points = points @ np.array(cell.orth.mat.tolist()).T
    symbols = table.get("type_symbol") or labels
    elements = [_element(symbol, name) for symbol, name in zip(symbols, names, strict=True)]
    if "occupancy" not in named:
        _check_single(table, names)
    return atoms(points, elements, fields=_fields(table, names))


def _check_single(table: _Table, names: Sequence[str]) -> None:
    """Refuse atoms in several places: of crystals, disorder in two groups or more, whose atoms have their own names."""
    if "label_alt_id" in table:
        tags = ("auth_asym_id", "auth_seq_id", "label_comp_id", "label_atom_id")
        owners = list(zip(*(table[tag] for tag in tags if tag in table), strict=True))
        check_single(owners, table["label_alt_id"], names)
    groups = sorted({group for group in table.get("disorder_group", ()) if group not in (".", "?")})
    if len(groups) > 1:
        raise InputError(
            f"atoms are in several places, disorder groups {shorten(' '.join(groups))}; keep one of them, or take the "
            "occupancy as weights"
        )


def _fields(table: _Table, names: Sequence[str]) -> dict[str, Values]:
    texts = {"chain": "auth_asym_id", "residue": "label_comp_id", "name": "label_atom_id"}
    fields: dict[str, Values] = {name: np.array(table[tag]) for name, tag in texts.items() if tag in table}
    if "occupancy" in table:
        shares = ["1" if word in ("?", ".") else word for word in table["occupancy"]]
        fields["occupancy"] = np.array(
            [_number(word, "occupancy", name) for word, name in zip(shares, names, strict=True)]
        )
    return fields


def _number(word: str, what: str, name: str) -> float:
    """A number as it is written; the uncertainty of its last digits, as in 1.234(5), says nothing of its value."""
    bare, bracket, rest = word.partition("(")
    if not is_number(bare) or (bracket and not (rest.endswith(")") and rest[:-1].isdigit())):
        raise InputError(f"{name}: {what} is {shorten(word)}; expected a number")
    return float(bare)


def _element(symbol: str, name: str) -> int:
    """Element of a symbol with a charge or a number behind it, as in Fe3+ or C12."""
    letters = "".join(ch if ch.isalpha() else " " for ch in symbol).split(" ")[0]
    return element(letters, name)
