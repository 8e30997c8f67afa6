"""Lengths of an object: the diagonal that misses are measured by, and a tolerance in units as a fraction of it."""

import numpy as np

from symrefine.detection.masses import heavy
from symrefine.detection.measure import Outliers, floor_under
from symrefine.detection.sketch import MANY, is_large, sampled, sketched
from symrefine.errors import InputError, about
from symrefine.geometry import LARGEST_TOLERANCE, Array, check_tolerance, tight_diagonal
from symrefine.shape import Shape
from symrefine.stream import Stream
from symrefine.surface.sampling import sampling
from symrefine.units import METRES, OF_FILE, read_length


def relative_tolerance(
    asked: float | str, shape: Shape | Stream, *, units: str | None = None, outliers: Outliers = "auto"
) -> float:
    """A tolerance as the fraction of the diagonal that detections take.

    Args:
        asked: a fraction, which stays what it is, or a length with its unit, such as "0.5mm" or "2u".
        units: what a length of 1 in the shape is, one of `units.METRES`; what the format of its source says if None.
        outliers: whether points that belong to no surface, or to a floor, count for the diagonal, as in `detect`.

    Raises:
        InputError: a unit that is not known, of the tolerance or of the shape; units for a tolerance that has none; a
            tolerance of 0 or less, or beyond a fifth of the diagonal; neither a number nor a length.
    """
    if not isinstance(asked, str):
        check_tolerance(asked)
        if units is not None:
            raise InputError(f"units are {units!r}, for a tolerance with a unit, such as 0.5mm; {asked:g} has none")
        return float(asked)
    if isinstance(shape, Stream):
        shape = sketched(shape).sample if shape.count > MANY else shape.held()
    with about("tolerance"):
        value, unit = read_length(asked)
    length = value if unit == OF_FILE else value * METRES[unit] / METRES[_unit(asked, shape, units)]
    diagonal = object_diagonal(shape, outliers=outliers)
    if length > LARGEST_TOLERANCE * diagonal:
        raise InputError(
            f"{shape.source}: tolerance {asked} is {length / diagonal:.3g} of the diagonal, {diagonal:.4g} in units of "
            f"the file; expected at most {LARGEST_TOLERANCE} of it"
        )
    return length / diagonal


def _unit(asked: str, shape: Shape, units: str | None) -> str:
    """The unit that the points of a shape are in."""
    found = units or shape.unit
    if found is None:
        raise InputError(
            f"{shape.source}: does not say its unit, which tolerance {asked} needs; give it as units (--units), one of "
            f"{' '.join(METRES)}, or the tolerance as 0.5u in units of the file"
        )
    if found not in METRES:
        raise InputError(f"units are {found!r}; expected one of {' '.join(METRES)}")
    return found


def object_diagonal(shape: Shape, *, outliers: Outliers = "auto") -> float:
    """Diagonal of the smallest box around an object, over all orientations, in input units.

    This is that of the points with their noise; a detection tells that of the surface which it judged by, the noise
    taken out: within a percent where there is none, 4 % less where noise is 0.5 % of it, 9 % less at 1 %.

    Raises:
        InputError: points of more than three coordinates.
    """
    if shape.dim > 3:
        raise InputError(
            f"{shape.source}: has {shape.dim} coordinates; give the tolerance as a fraction of the diameter"
        )
    if shape.dim == 2:
        from symrefine.plane.outline import smallest_diagonal

        return smallest_diagonal(heavy(shape).points)
    return tight_diagonal(body(shape, outliers=outliers))


def body(shape: Shape, *, outliers: Outliers = "auto") -> Array:
    """The points [K, 3] of a shape without those that belong to no surface, if outliers are looked for.

    Of very many points a sample stands for all.

    Raises:
        InputError: a floor asked for of what is no cloud of a surface.
    """
    if is_large(shape):
        shape = sampled(shape)
    points = heavy(shape).points
    if (floor := floor_under(shape, outliers)) is not None:
        points = points[~floor.covers(points)]
    if shape.faces is not None or shape.atoms:
        return points
    return points[sampling(points, np.random.default_rng(0), outliers=outliers != "none").kept]
