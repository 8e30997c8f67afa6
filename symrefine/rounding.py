"""By how much things differ that count as the same: what rounding leaves of numbers of size one, what is forgiven.

And by how much what moments tell may be off.
"""

# Coordinates in single precision, or written with six digits, directions and angles made of them.
SINGLE = 1e-6
# Sums, products and small systems of equations in double precision: some thousand roundings.
DOUBLE = 1e-12
# How far the moments may put a start wrong (radians, RMS radii; 0.04 was the most of 698 true ones): directions nearer
# than this to an earlier one are the same start, elements are one; what puts them off by more has to be made up for.
START_ERROR = 0.05
# The tolerance unless another is asked for, and the largest, as fractions of the diagonal: beyond a fifth everything is
# symmetric.
TOLERANCE, LARGEST_TOLERANCE = 0.02, 0.2


def twelve_digits(value: float, scale: float) -> float:
    """A number as it is told: to twelve digits, beyond which processors differ, and 0 if it is nothing beside `scale`.

    NaN and infinity stay what they are.
    """
    return 0.0 if abs(value) <= DOUBLE * scale else float(f"{value:.12g}")
