"""What can go wrong, as types: the shell turns each into one line and exit status 2."""


class SymrefineError(Exception):
    """Base of every error the package raises on purpose; its text is one clear line."""


class InputError(SymrefineError, ValueError):
    """The caller's data or options cannot be used: says what, where, and what would be right."""


class DegenerateShapeError(SymrefineError, ValueError):
    """The data are valid but do not determine the quantity asked for."""
