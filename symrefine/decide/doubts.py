"""Points that support no decision, whatever is found of them: all on a line, or a few that set the scale of all."""

import numpy as np

from symrefine.geometry import Array
from symrefine.rounding import SINGLE

# Points so many times as far out as 99 % of all set the scale: 2 % of their diagonal is 10 % of the object.
STRAY = 5.0


def on_a_line(covariance: Array) -> str:
    """Why points of a covariance [n, n] say nothing, or nothing: on a line they look the same from all sides."""
    *_, middle, largest = np.linalg.eigvalsh(covariance)
    if middle > SINGLE**2 * largest:
        return ""
    return "all points lie on a line, which says nothing of the rest"


def set_by_strays(points: Array, *, few: bool) -> str:
    """Why points [N, n] are not measured by their own size, or nothing if they are.

    Of few points, which stand for themselves, one that is as far off as the others are wide is a part, as the tip of a
    pyramid is: it has to be farther by the same factor.
    """
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    most = 2.0 * float(np.sort(away)[-2]) if few else float(np.quantile(away, 0.99))
    strays = int((away > STRAY * most).sum())
    if not strays:
        return ""
    others = "all the others are wide" if few else "99 % of them"
    return (
        f"{strays} of {len(away)} points stand more than {STRAY:g} times as far out as {others}, and set the scale "
        "that misses are measured by; remove them if they are strays"
    )
