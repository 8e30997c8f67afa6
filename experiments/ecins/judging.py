"""How the baseline judges its planes: score, filter, merge."""

from dataclasses import dataclass

import numpy as np

from experiments.ecins.clouds import Clouds
from experiments.ecins.fitting import centroid_shift, reflected_cosine
from experiments.ecins.settings import Settings
from symrefine.geometry import Plane, line_angle_rad


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Agreement of reflected normals: summed over pairs, as a share of all queries and of the pairs."""

    cloud: float
    correspondence: float
    pairs: int


def score(clouds: Clouds, plane: Plane, settings: Settings) -> Score:
    """How well the reflected queries lie on the cloud with their normals; 1 is best."""
    reach = settings.score_reach * settings.query_voxel_rel
    distance, target = clouds.tree.query(
        plane.reflect(clouds.queries), distance_upper_bound=np.nextafter(reach, np.inf)
    )
    source = np.flatnonzero(np.isfinite(distance))
    cosine = reflected_cosine(clouds, plane, source, target[source])
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    angle = np.where(angle > settings.flipped_deg, 180.0 - angle, angle)
    bad = np.clip((angle - settings.good_deg) / (settings.bad_deg - settings.good_deg), 0.0, 1.0)
    total = float((1.0 - bad).sum())
    return Score(
        cloud=total / len(clouds.queries), correspondence=total / len(source) if source.size else 0.0, pairs=len(source)
    )


def representatives(planes: list[Plane], settings: Settings) -> list[int]:
    """Index of the first member of each group of planes that are all close to one another, larger groups first.

    The largest clique goes first, with it its members, and so on with the rest. The first member stands for the clique
    whatever the scores, as in the original.
    """
    limit = np.radians(settings.merge_deg)
    close = {
        i: {
            j
            for j, b in enumerate(planes)
            if j != i and line_angle_rad(a.normal, b.normal) < limit and centroid_shift(a, b) < settings.merge_rel
        }
        for i, a in enumerate(planes)
    }
    chosen = []
    while close:
        clique = _largest_clique(close)
        chosen.append(min(clique))
        close = {i: others - clique for i, others in close.items() if i not in clique}
    return chosen


def _largest_clique(graph: dict[int, set[int]]) -> set[int]:
    """The largest clique of a graph, of several the one that comes first."""
    best = min(_maximal_cliques(graph, set(), set(graph), set()), key=lambda clique: (-len(clique), sorted(clique)))
    return best


def _maximal_cliques(graph: dict[int, set[int]], clique: set[int], open_: set[int], closed: set[int]) -> list[set[int]]:
    """Bron and Kerbosch (1973), with a pivot."""
    if not open_ and not closed:
        return [clique]
    pivot = max(sorted(open_ | closed), key=lambda i: len(graph[i] & open_))
    found = []
    for i in sorted(open_ - graph[pivot]):
        found += _maximal_cliques(graph, clique | {i}, open_ & graph[i], closed & graph[i])
        open_, closed = open_ - {i}, closed | {i}
    return found
