"""What rounding leaves of numbers: the two measures by which things of size one count as nothing, or as the same."""

# Coordinates in single precision, or written with six digits, directions and angles made of them.
SINGLE = 1e-6
# Sums, products and small systems of equations in double precision: some thousand roundings.
DOUBLE = 1e-12


def twelve_digits(value: float, scale: float) -> float:
    """A number as it is told: to twelve digits, beyond which processors differ, and 0 if it is nothing beside `scale`.

    NaN and infinity stay what they are.
    """
    return 0.0 if abs(value) <= DOUBLE * scale else float(f"{value:.12g}")
