"""Chemical elements as labels: atomic numbers, and -2 and -3 for D and T.

Heavy hydrogen is told apart, as it is where vibrations or spins matter: D is no H.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.load.content import Content, Values
from symrefine.load.text import shorten

_SYMBOLS = (
    "H He Li Be B C N O F Ne Na Mg Al Si P S Cl Ar K Ca Sc Ti V Cr Mn Fe Co Ni Cu Zn Ga Ge As Se Br Kr Rb Sr Y Zr Nb "
    "Mo Tc Ru Rh Pd Ag Cd In Sn Sb Te I Xe Cs Ba La Ce Pr Nd Pm Sm Eu Gd Tb Dy Ho Er Tm Yb Lu Hf Ta W Re Os Ir Pt Au "
    "Hg Tl Pb Bi Po At Rn Fr Ra Ac Th Pa U Np Pu Am Cm Bk Cf Es Fm Md No Lr Rf Db Sg Bh Hs Mt Ds Rg Cn Nh Fl Mc Lv Ts "
    "Og"
).split()
_NUMBERS = {symbol: number for number, symbol in enumerate(_SYMBOLS, start=1)} | {"D": -2, "T": -3}
HEAVIEST = len(_SYMBOLS)


def atomic_number(symbol: str) -> int | None:
    """Label of an element by its symbol in letters of any case; None if there is no such element."""
    return _NUMBERS.get(symbol.capitalize())


def symbol(label: int) -> str:
    """The symbol of an element, from its label."""
    return _SYMBOLS[label - 1] if label > 0 else {-2: "D", -3: "T"}[label]


def element(symbol: str, place: str) -> int:
    """Label of an element by its symbol.

    Args:
        place: where it stands, for messages.

    Raises:
        InputError: no such element.
    """
    number = atomic_number(symbol)
    if number is None:
        raise InputError(f"{place}: {shorten(symbol)} is no element; expected a symbol (H, He, ... Og, D, T)")
    return number


def atoms(
    points: ArrayLike,
    elements: Sequence[int],
    *,
    lines: Sequence[int] | None = None,
    fields: Mapping[str, Values] = MappingProxyType({}),
) -> Content:
    """Atoms [N, 3] with their elements as labels, and what else is known of each of them."""
    labels = np.array(elements, dtype=np.int64)
    return Content(
        points=np.array(points, dtype=np.float64).reshape(-1, 3),
        labels=labels,
        point_fields={**fields, "element": labels},
        point_lines=lines,
    )
