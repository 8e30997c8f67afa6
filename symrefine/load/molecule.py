"""Chemical .xyz: the number of atoms, a remark, then an element and three coordinates for each atom."""

import numpy as np

from symrefine.errors import InputError
from symrefine.load.content import Content
from symrefine.load.text import NATURAL, Line, numbered_lines, parse_table, shorten

_SYMBOLS = (
    "H He Li Be B C N O F Ne Na Mg Al Si P S Cl Ar K Ca Sc Ti V Cr Mn Fe Co Ni Cu Zn Ga Ge As Se Br Kr Rb Sr Y Zr Nb "
    "Mo Tc Ru Rh Pd Ag Cd In Sn Sb Te I Xe Cs Ba La Ce Pr Nd Pm Sm Eu Gd Tb Dy Ho Er Tm Yb Lu Hf Ta W Re Os Ir Pt Au "
    "Hg Tl Pb Bi Po At Rn Fr Ra Ac Th Pa U Np Pu Am Cm Bk Cf Es Fm Md No Lr Rf Db Sg Bh Hs Mt Ds Rg Cn Nh Fl Mc Lv Ts "
    "Og"
).split()
# Heavy hydrogen is told apart, as it is where vibrations or spins matter: D is no H.
_NUMBERS = {symbol: number for number, symbol in enumerate(_SYMBOLS, start=1)} | {"D": -2, "T": -3}
_LAYOUT = "an element and x y z, as 'O 0.0 0.0 0.1'"


def is_molecule(lines: list[Line]) -> bool:
    """Whether a text begins as chemical .xyz does: with one whole number, where points have three numbers or six."""
    return bool(lines) and NATURAL.fullmatch(lines[0][1]) is not None


def read_molecule(data: bytes) -> Content:
    """Atoms; elements are labels: atomic numbers, and -2 and -3 for D and T.

    Raises:
        InputError: another number of atoms than line 1 says, unknown elements, anything behind the coordinates.
    """
    lines = numbered_lines(data)
    number, text = lines[0]
    if number != 1:
        raise InputError(f"line {number}: {text}; the number of atoms must be line 1, a remark line 2")
    count, atoms = int(text), [line for line in lines if line[0] > 2]
    for expected, (found, _) in enumerate(atoms[:count], start=3):
        if found != expected:
            raise InputError(f"line {expected} is empty; expected {_LAYOUT}")
    if len(atoms) < count:
        raise InputError(f"line 1 declares {count} atoms; {len(atoms)} follow from line 3 on")
    if len(atoms) > count:
        raise InputError(
            f"line {atoms[count][0]}: {shorten(atoms[count][1])} behind the {count} atoms that line 1 "
            "declares; expected one molecule and nothing behind it"
        )
    elements = np.array([_element(line) for line in atoms], dtype=np.int64)
    # A number in place of the element keeps the columns of messages right.
    rows = [(number, " ".join(["0", *text.split()[1:]])) for number, text in atoms]
    table = parse_table(rows, columns=(4,), layout=_LAYOUT)
    return Content(
        points=table[:, 1:],
        labels=elements,
        point_fields={"element": elements},
        point_lines=[number for number, _ in atoms],
    )


def _element(line: Line) -> int:
    number, text = line
    word = text.split()[0]
    whole = int(word) if NATURAL.fullmatch(word) else 0
    known = whole if 1 <= whole <= len(_SYMBOLS) else _NUMBERS.get(word.capitalize())
    if known is not None:
        return known
    raise InputError(
        f"line {number}: {shorten(word)} is no element; expected a symbol (H, He, ... Og, D, T) or an atomic "
        f"number from 1 to {len(_SYMBOLS)}"
    )
