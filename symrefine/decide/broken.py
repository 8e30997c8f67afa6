"""What stays of a group where something that no camera saw may break it."""

from dataclasses import replace

from symrefine.decide.hypotheses import Hypothesis, single
from symrefine.decide.place import is_told
from symrefine.fit.placed import joined
from symrefine.surface.surface import Surface


def unbroken(surface: Surface, found: Hypothesis) -> Hypothesis | None:
    """What stays of a group where something that no camera saw breaks a mirror that is no image of others.

    Of a mirror across an axis of order 3 or more that leaves what keeps the direction of the axis; of several mirrors
    that are all such, the one of which cameras saw most. Otherwise None, as of Cs and C2h, and where too little was
    seen to tell what is left.
    """
    group, lone = found.group, found.group.lone_mirrors() if surface.viewed else ()
    mirrors = [e for e in found.elements if e.operations.kind == "plane"]
    if len(lone) == 1 and group.symbol.fold > 2:
        axis = group.frame[2]
        kept = tuple(e for e in found.elements if all(axis @ m @ axis > 0.0 for m in e.operations.matrices))
        placed = joined([e.operations.alone(e.center) for e in kept]) if kept else None
        if placed is None or not is_told(placed, [(e.operations, e.coverage.supported) for e in kept]):
            return None
        return Hypothesis(placed=placed, elements=kept, need=max(e.need for e in kept))
    if 1 < len(mirrors) == len(lone):
        first, *others = sorted((single(e) for e in mirrors), key=lambda h: -h.supported)
        return replace(first, rivals=tuple(h.placed for h in others))
    return None
