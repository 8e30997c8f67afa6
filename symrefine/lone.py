"""A part out of place: what misses under nearly every operation of a group that keeps all the rest.

One leg of eight that stands askew hardly shows under any one operation: it spoils its own image and one other. But its
own points miss under all of them, where those of the seven other legs miss under one.
"""

from collections.abc import Iterable

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.groups import PointGroup
from symrefine.search import Evidence
from symrefine.shape import Index
from symrefine.surface.misses import disc_distances, miss_distances

# Operations asked, sources of each.
ASKED = 12
SOURCES = 2000
# A point is out of place if it misses by so many tolerances under all but this share of the operations ...
ASTRAY = 0.65
EXCUSED = 0.25
# ... and a part is, if it holds this share of the surface, and a quarter of it misses by so many tolerances.
PART = 0.004
FAR = 1.0
# Under noise single points stand astray: so much more of the surface has to, were the floor as high as the tolerance.
CHANCE = 0.012
# Fewer operations than these cannot tell a part from its counterpart.
LEAST = 3


def lone_part(evidence: Evidence, group: PointGroup, center: Array) -> Index:
    """Local planes of a part that is out of place under a finite group about a centre; empty if there is none."""
    nothing = np.zeros(0, dtype=np.int64)
    if not group.is_finite or evidence.judge.cloud.isolated:
        return nothing
    matrices = [m for m in group.operations() if not np.allclose(m, np.eye(3))]
    if len(matrices) < LEAST:
        return nothing
    chosen = matrices[:: -(-len(matrices) // ASKED)]
    stride = evidence.stride(SOURCES)
    judge = evidence.judge
    misses = [miss_distances(judge.cloud, Isometry.about(center, m), stride=stride) for m in chosen]
    usual = np.quantile(np.stack(misses) / judge.diagonal, EXCUSED, axis=0)
    astray = np.flatnonzero(usual > np.hypot(ASTRAY * judge.tolerance, judge.floor.p97))
    chance = CHANCE * judge.floor.p97 / judge.tolerance
    if len(astray) <= (PART + chance) * len(usual) or np.quantile(usual[astray], 0.75) < FAR * judge.tolerance:
        return nothing
    return astray * stride


def keeps(evidence: Evidence, motions: Iterable[Isometry], part: Index) -> bool:
    """Whether operations leave most of a part, if there is one, where the surface is."""
    if not len(part):
        return True
    judge = evidence.judge
    cloud = judge.cloud
    misses = [disc_distances(cloud, m.apply(cloud.points[part]), cloud.classes(part)) for m in motions]
    allowed = np.hypot(ASTRAY * judge.tolerance, judge.floor.p97) * judge.diagonal
    return all(float(np.median(miss)) <= allowed for miss in misses)
