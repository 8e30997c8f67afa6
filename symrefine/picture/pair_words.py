"""What an alignment comes to, in words a person reads."""

import math

from symrefine.align.alignment import OPEN, Alignment
from symrefine.picture.pair import Pair, Way
from symrefine.picture.words import percent, sentence


def answer(found: Alignment, pair: Pair) -> tuple[str, str]:
    """The answer in a word or two, and what goes with it; of what is none nothing that sounds like one."""
    if found.is_misfit:
        return "No fit", ""
    if found.status.startswith(OPEN):
        return "Not determined", ""
    return named(pair.ways[0])


def named(way: Way) -> tuple[str, str]:
    """What a map is, and by how much it turns."""
    by = f"{math.degrees(abs(way.angle_rad)):.2f}°" if way.turns else ""
    if way.determinant > 0:
        return ("Rotation", f"by {by}") if by else ("Shift", "")
    return "Mirror image", f"turned by {by}" if by else ""


def summary(found: Alignment, pair: Pair) -> str:
    """How well the answer holds, or why there is none, as sentences."""
    if found.is_misfit or found.status.startswith(OPEN):
        return sentence(found.status)
    source, target = found.overlap
    others = "" if pair.equivalents == 1 else f" It is one of {pair.equivalents} maps that do equally well."
    if len(found.coset.free):
        others = f" Determined {found.observable}."
    return (
        f"{percent(source)} of the source meet {percent(target)} of the target, RMS distance "
        f"{percent(found.rms)} of the diagonal; confidence {found.confidence:.3f}, of the determinant "
        f"{found.determinant_confidence:.3f}.{others}"
    )


def headline(found: Alignment, pair: Pair) -> str:
    """All of it in one line."""
    title, beside = answer(found, pair)
    if not beside and (found.is_misfit or found.status.startswith(OPEN)):
        return f"{title}: {found.status}"
    return f"{title}: {f'{beside}, ' if beside else ''}confidence {found.confidence:.2f}"
