"""The scale between two surfaces that share a part only, which no moments tell: voted for.

The source is tried at many sizes. At each, local planes that look alike propose maps, as they do where the size is
known; those under which most of both sides meets are polished with the scale as one more unknown, and what both sides
say of them at that scale decides. Small sources meet large targets anywhere, so that one side alone tells nothing.
"""

from dataclasses import dataclass, replace

import numpy as np

from symrefine.align.judge import Judge
from symrefine.align.pair import Evidence
from symrefine.align.polish import Similarity, polish
from symrefine.align.shown import Shown
from symrefine.decide.maps import said_by_both
from symrefine.geometry import tight_diagonal
from symrefine.propose.maps import WITHIN
from symrefine.samples import FOLLOWED

# Sizes of the source that are tried, over that at which both spread alike: what is missing of a half changes its spread
# by less than 2. From one to the next no point of a part that both share moves by more than matches may be apart.
WIDEST, STEP = 2.0, 1.12


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """By what the source is multiplied, in units of the input, and the standard deviation of that, relative to it."""

    factor: float
    sigma: float


def size_of_parts(evidence: Evidence) -> Size | None:
    """At which size of the source it shares most with the target; None where nothing suggests that it shares any."""
    sizes = [side.moments.scale for side in (evidence.source, evidence.target)]
    own, target = (
        Shown.of(side, unit, evidence.seed)
        for side, unit in zip((evidence.source, evidence.target), sizes, strict=True)
    )
    if own is None or target is None:
        return None
    target_size = tight_diagonal(target.cloud.points)

    def judge(factor: float) -> Judge:
        source = own.scaled(factor)
        diagonal = min(tight_diagonal(source.cloud.points), target_size)
        return Judge(source=source, target=target, diagonal=diagonal, tolerance=evidence.tolerance)

    steps = round(np.log(WIDEST) / np.log(STEP))
    tried: list[tuple[float, Judge, Similarity]] = []
    for factor in STEP ** np.arange(-steps, steps + 1.0):
        here = judge(float(factor))
        tried += [(here.shared(start), here, start) for start in here.promising()]
    best, size = -np.inf, None
    for _, here, start in sorted(tried, key=lambda t: -t[0])[:FOLLOWED]:
        error, known = WITHIN * here.diagonal, np.zeros((6, 6))
        done = polish(here.source.moving, target.cloud, start, error=error, known=known, scale=True)
        factor = done.motion.scale * here.source.cloud.spacing / own.cloud.spacing
        if not WIDEST**-1 / STEP < factor < WIDEST * STEP:
            continue
        met = judge(factor).polished(replace(done.motion, scale=1.0))
        if (said := said_by_both(met.sides)) > best:
            blurred = 0.5 * float(np.median(target.cloud.thickness))
            best = said
            size = Size(factor=factor * sizes[1] / sizes[0], sigma=float(np.hypot(done.scale_sigma, blurred)))
    return size
