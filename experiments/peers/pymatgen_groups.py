"""pymatgen's point group of a set of atoms; the package is named in one line where it is not installed."""

from collections.abc import Sequence

import numpy as np

from symrefine.errors import InputError
from symrefine.geometry import Array
from symrefine.groups.names import parse


def point_group_pymatgen(elements: Sequence[str], points: Array, tolerance: float) -> str:
    """Schoenflies symbol, in our spelling, that pymatgen's PointGroupAnalyzer gives to atoms.

    Args:
        elements: [N] chemical symbols; atoms of different elements do not match.
        points: [N, 3] positions.
        tolerance: largest distance at which two atoms match, in the units of the points.

    Raises:
        InputError: pymatgen is not installed, or finds nothing it has a name for.
    """
    try:
        from pymatgen.core import Molecule
        from pymatgen.symmetry.analyzer import PointGroupAnalyzer
    except ModuleNotFoundError as error:
        raise InputError(f"pymatgen is not installed ({error.name} is missing); pip install pymatgen") from None
    molecule = Molecule(list(elements), np.asarray(points, dtype=float))
    return schoenflies(str(PointGroupAnalyzer(molecule, tolerance=tolerance).sch_symbol))


def schoenflies(symbol: str) -> str:
    """pymatgen's symbol in our spelling: its infinity is a star.

    Raises:
        InputError: no point group.
    """
    return parse(symbol.replace("*", "inf")).name
