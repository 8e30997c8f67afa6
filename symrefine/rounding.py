"""What rounding leaves of numbers of size one: the two measures by which things count as nothing, or as the same."""

# Coordinates in single precision, or written with six digits, directions and angles made of them.
SINGLE = 1e-6
# Sums, products and small systems of equations in double precision: some thousand roundings.
DOUBLE = 1e-12
