"""Schoenflies symbols: one canonical spelling for every point group of 3-space, and its aliases."""

import math
import re
from dataclasses import dataclass
from functools import lru_cache

from symrefine.errors import InputError

# The largest fold that a group may have: beyond it nobody tells a polygon from round.
MAX_FOLD = 360
# Folds of groups that operations are closed to, unless more are asked for, and that azimuths tell, a fundamental and
# its octave: so many turns as half of it stand for a continuous axis.
CLOSED_FOLD = 128
TURNS = CLOSED_FOLD // 2
_AXIAL = {"C", "Cv", "Ch", "S", "D", "Dh", "Dd"}
_CONTINUOUS = {"C", "Cv", "Ch", "D", "Dh"}
_FIXED = ("T", "Td", "Th", "O", "Oh", "I", "Ih", "K", "Kh")
_ALIASES = {
    "cs": "c1h", "ci": "s2", "c1v": "c1h", "d1": "c2", "d1h": "c2v", "d1d": "c2h",
    "v": "d2", "vh": "d2h", "vd": "d2d",  # Klein's Vierergruppe
}  # fmt: skip
_SPECIAL: dict[tuple[str, float], str] = {("Ch", 1): "Cs", ("S", 1): "Ci"}
_PATTERN = re.compile(r"([cds])([1-9][0-9]{0,5}|inf|∞)([vhdi]?)")


def far_steps(fold: int) -> list[int]:
    """How many turns by 2 pi / fold go far, farthest first, and over and over come to all of them; 1 of few."""
    return [m for m in range(fold // 2, fold // 4, -1) if math.gcd(m, fold) == 1] or [1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Symbol:
    """A point group up to its placement.

    `family` is the symbol without its number: C, Cv, Ch, S, D, Dh, Dd (axial) or T ... Kh. `fold` is the n of
    Cn, Cnv, Cnh, S2n, Dn, Dnh, Dnd (an int or `math.inf`), and 0 for T ... Kh, which have no principal axis.
    Cs is (Ch, 1) and Ci is (S, 1).
    """

    family: str
    fold: float

    @property
    def name(self) -> str:
        """The canonical Schoenflies symbol."""
        if self.fold == 0:
            return self.family
        number = "inf" if math.isinf(self.fold) else str(int(self.fold) * (2 if self.family == "S" else 1))
        return _SPECIAL.get((self.family, self.fold), self.family[0] + number + self.family[1:])


@lru_cache(maxsize=1024)
def parse(name: str) -> Symbol:
    """The group a Schoenflies symbol names; letter case is free and `∞` stands for `inf`.

    Aliases: C1h = C1v = S1 = Cs, S2 = Ci, Sn = Cnh and Cni = S2n for odd n, D1 = C2, D1h = C2v, D1d = C2h, V = D2.

    Raises:  InputError: no such group, or n above `MAX_FOLD`.
    """
    text = str(name).strip().lower()
    if text.capitalize() in _FIXED:
        return Symbol(family=text.capitalize(), fold=0)
    family, fold = _axial(_ALIASES.get(text, text))
    if family not in (_CONTINUOUS if math.isinf(fold) else _AXIAL) or MAX_FOLD < fold < math.inf:
        raise InputError(
            f"{name!r} is not a point group; use C1, Cs, Ci, Cn, Cnv, Cnh, S2n, Dn, Dnh, Dnd (n <= {MAX_FOLD}), "
            "Cinf, Cinfv, Cinfh, Dinf, Dinfh, T, Td, Th, O, Oh, I, Ih, K or Kh"
        )
    return Symbol(family=family, fold=fold)


def _axial(text: str) -> tuple[str, float]:
    """Family and fold of a symbol with a number; the family is "" for nonsense."""
    match = _PATTERN.fullmatch(text)
    if not match:
        return "", 0
    letter, number, suffix = match.groups()
    fold = math.inf if number in ("inf", "∞") else int(number)
    if letter == "s":  # S_k generates C_kh for odd k, and the group S_2n of k = 2n elements for even k
        if suffix or math.isinf(fold):
            return "", 0
        return ("Ch", fold) if fold % 2 else ("S", fold // 2)
    if suffix == "i":  # Cni is Cn with an inversion: S2n for odd n, and no name of its own for even n
        return ("S", fold) if letter == "c" and fold % 2 == 1 else ("", fold)
    return letter.upper() + suffix, fold
