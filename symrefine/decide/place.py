"""Whether what was seen of an object tells that a group holds, and that it stands where it was put.

Of what cameras did not see nothing contradicts. A mirror that carries all there is behind it holds as well farther
back, and one through the axis of a round cup that carries its handle there turned about that axis.
"""

import math
from collections.abc import Sequence

import numpy as np

from symrefine.decide.looks import GLANCED, LOOK, few_motions, start_error
from symrefine.fit.freedom import freest
from symrefine.fit.placed import Operations, Placed, joined
from symrefine.fit.refine import Framed
from symrefine.groups import is_subgroup
from symrefine.surface.surface import Surface

# Share of a surface that has to be carried onto itself for anything to be said of an operation.
SUPPORTED = 0.15


def least_elsewhere(surface: Surface, placed: Placed) -> float:
    """What a group needs at least where it is moved as far as starts may be off.

    It says nothing of the object unless something would contradict it elsewhere: moved to either side, in the ways that
    change what it is and that the surface tells least of, until its images lie as far aside as those of a mirror that
    is off so much. Turns go no farther than a quarter of a wedge.
    """
    frame, fold = placed.group.frame, placed.group.symbol.fold
    standard = np.stack([frame @ m.matrix @ frame.T for m in few_motions(placed)])
    state = Framed(standard=standard, frame=frame, center=placed.center)
    wedge = 2.0 * math.pi / (fold if 0 < fold < math.inf else 1)
    moved = []
    for way in freest(surface.cloud, state, stride=surface.stride(LOOK)):
        size = min(2.0 * start_error(surface), 0.25 * wedge / max(float(np.linalg.norm(way[:3])), 1e-300))
        moved += [placed.moved(state.moved(side * size * way)) for side in (-1.0, 1.0)]
    motions = [few_motions(m) for m in moved]
    needs = surface.needs([m for part in motions for m in part], sources=LOOK, tests=GLANCED)
    each = np.split(needs, np.cumsum([len(part) for part in motions])[:-1])
    return float(min(part.max() for part in each))


def is_told(placed: Placed, parts: Sequence[tuple[Operations, float]]) -> bool:
    """Whether elements that enough speaks for generate a group, given the share of a surface that supports each.

    For a continuous axis speaks that nothing contradicts any of its turns.
    """
    evident = [m for m, share in parts if share >= SUPPORTED or math.isinf(m.order)]
    whole = joined([m.alone(placed.center) for m in evident]) if evident else None
    return whole is not None and is_subgroup(placed.group, whole.group)
