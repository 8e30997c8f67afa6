"""Chemical elements as pictures need them: covalent radii, colours, symbols, by the labels that `.xyz` files give."""

from symrefine.picture.palette import Colour

# Covalent radii in picometres, hydrogen to curium (Cordero and others, Dalton Trans. 2008, 2832; low spin).
_RADII = (
    31, 28, 128, 96, 84, 76, 71, 66, 57, 58, 166, 141, 121, 111, 107, 105, 102, 106, 203, 176, 170, 160, 153, 139, 139,
    132, 126, 124, 132, 122, 122, 120, 119, 120, 120, 116, 220, 195, 190, 175, 164, 154, 147, 146, 142, 139, 145, 144,
    142, 139, 139, 138, 139, 140, 244, 215, 207, 204, 203, 201, 199, 198, 198, 196, 194, 192, 192, 189, 190, 187, 187,
    175, 170, 162, 151, 144, 141, 136, 136, 132, 145, 146, 148, 140, 150, 150, 260, 221, 215, 206, 200, 196, 190, 187,
    180, 169,
)  # fmt: skip
# The elements of most molecules in the colours that chemists know (Corey, Pauling, Koltun), on white and on black.
_COLOURS: dict[int, Colour] = {
    1: (224, 228, 234), 5: (232, 160, 150), 6: (96, 102, 114), 7: (58, 92, 224), 8: (220, 40, 40), 9: (120, 200, 80),
    14: (214, 186, 140), 15: (240, 140, 30), 16: (228, 196, 40), 17: (40, 180, 60), 35: (150, 50, 40),
    53: (130, 40, 150),
}  # fmt: skip
METAL: Colour = (150, 140, 190)
# Labels of deuterium and tritium.
_HEAVY = {-2: 1, -3: 1}


def is_element(label: int) -> bool:
    """Whether a label can stand for an element: an atomic number whose radius is known, or heavy hydrogen."""
    return 1 <= label <= len(_RADII) or label in _HEAVY


def radius(label: int) -> float:
    """Covalent radius in angstroms."""
    return _RADII[_HEAVY.get(label, label) - 1] / 100.0


def colour(label: int) -> Colour:
    """The colour that chemists give an element; one for all metals."""
    return _COLOURS.get(_HEAVY.get(label, label), METAL)
