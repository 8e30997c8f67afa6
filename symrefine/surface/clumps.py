"""Small groups of points that have no counterpart: apart from the body, or filling a volume beside it.

What is decided here depends on the surroundings of a point alone, and on how large a part is, so that it breaks no
symmetry: the parts of an object come in pairs, or on its axis.
"""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Mask
from symrefine.samples import GLANCE
from symrefine.shape import Index
from symrefine.surface.misses import RIM, SHARES
from symrefine.surface.neighbourhoods import (
    FLAT,
    NEIGHBOURS,
    VOLUME,
    ball_thickness,
    choose_neighbours,
    connected_parts,
    planes_of,
    thickness_of,
)
from symrefine.surface.surroundings import AROUND, Surroundings
from symrefine.surface.tree import Tree

# A clump holds at most this share of the points, so many that it counts, and has no counterpart: none of half its size.
CLUMP, COUNTERPART = 0.1, 0.5
# Neighbourhoods as thick as this, over that of points at random in a ball, fill a volume if they do at all these sizes
# and at one where noise alone makes no surface look so: details of objects do at some sizes, hollow as they are, wires
# at the smallest. At 0.8 to 0.9 as many of 114 whole objects hold such a part by mistake as by one size alone, and at
# 0.85 most of 60 clumps were found.
FILLED, SIZES = 0.85, (64, 32, 128)
# Neighbourhoods of so small parts of what has no counterpart are asked whether it fills a volume: clumps look at least
# 0.81 times like a ball at all of them, the details of 76 objects at most 0.74, which is the flag of a mailbox at 1 %.
FRACTIONS = (8, 4, 2)
# Neighbourhoods that are asked of all: one of so many at first, as those of neighbours hold almost the same points.
# That leaves nothing of most objects, and of 72 clumps it lost none that all of them find.
SPARSE = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clump:
    """Where a clump is: its middle [3] and inverse square root of its covariance [3, 3]."""

    middle: Array
    whitening: Array

    @classmethod
    def of(cls, points: Array) -> "Clump":
        """That of points [N, 3]; N > 1."""
        variances, axes = np.linalg.eigh(np.cov(points.T))
        least = max(np.finfo(float).eps * variances[-1], np.finfo(float).tiny)
        return cls(middle=points.mean(axis=0), whitening=axes.T / np.sqrt(np.maximum(variances, least))[:, None])

    def covers(self, points: Array) -> Mask:
        """Which of points [N, 3] lie as near as those of its rim."""
        return np.asarray((((points - self.middle) @ self.whitening.T) ** 2).sum(axis=1) < RIM**2)


def clumps(points: Array, around: Surroundings) -> list[Index]:
    """Indices, ascending, of each group of points [N, 3] apart from the body that is small and has no counterpart.

    Points hang together if each is among the nearest of the other, whatever the density: a few between two dense parts
    join nothing. `around` tells of some of the points. A piece of surface is no clump: what a hole cut off the body.
    """
    apart = [m for m in _lone(parts_among(around), CLUMP) if _gap(around, m)] if np.median(around.reach) > 0.0 else []
    return [c for c in _members(points, around, apart) if _is_filled(points[c])]


def clump_among(points: Array, unmet: Mask) -> Index:
    """Indices, ascending, of those `unmet` [N] of points [N, 3] that hang together and fill a volume, if most do.

    None where they are more than a clump may be, or too few to tell. Nothing but they is asked, so that it does not
    matter what they touch.
    """
    found, least = np.flatnonzero(unmet), max(NEIGHBOURS[0] * FRACTIONS[0], SHARES[-1] * len(points))
    if not least <= len(found) <= CLUMP * len(points):
        return found[:0]
    part = parts_among(Surroundings.of(points[found]))
    own = found[part == np.bincount(part).argmax()]
    return own if len(own) >= max(least, 0.5 * len(found)) and _is_filled(points[own]) else found[:0]


def _is_filled(points: Array) -> bool:
    """Whether points [N, 3] fill a volume, as neighbourhoods say that are large parts of it."""
    tree, queries = Tree(points), points[:: max(1, len(points) // GLANCE)]
    sizes = (max(len(points) // k, NEIGHBOURS[0]) for k in FRACTIONS)
    filled = all(np.median(_blobness(points, tree, queries, size)) > VOLUME for size in sizes)
    return filled and _spreads_in_space(points, tree)


def _spreads_in_space(points: Array, tree: Tree) -> bool:
    """Whether neighbours of points [N, 3] become more with the cube of the distance, and not with its square.

    Fins side by side look as thick as a ball to neighbourhoods that reach from one to the next, and the first few
    neighbours still lie on one of them. Of points strewn in d dimensions the fourth neighbour is farther than the first
    by (1 + 1/2 + 1/3) / d in the mean of logarithms (Levina, Bickel, 2004). Noise as wide as points are apart makes
    three dimensions of two.
    """
    away = tree.query(points, 4, skip=1)[0]
    nearest, fourth = away[away[:, 0] > 0.0][:, [0, 3]].T
    surface, volume = (11.0 / 6.0 / d for d in (2.0, 3.0))
    return not nearest.size or float(np.log(fourth / nearest).mean()) < 0.5 * (surface + volume)


def parts_among(around: Surroundings) -> Index:
    """Number of the part that each of some points belongs to: they hang together if each is near the other."""
    count = len(around.points)
    one, other = np.repeat(np.arange(count), AROUND), around.near.ravel()
    # A pair that is told twice is told from either side.
    told = np.sort(np.minimum(one, other) * count + np.maximum(one, other))
    mutual = told[1:][told[1:] == told[:-1]]
    return connected_parts(mutual // count, mutual % count, count)


def filled(points: Array, around: Surroundings, rng: np.random.Generator) -> list[Index]:
    """Indices, ascending, of each small group of points [N, 3] with no counterpart that fills a volume by the body.

    Neighbourhoods there look like points at random in a ball: among some of the points, and among all at any size, up
    to one so large that noise does not make the surface look so too. `around` tells of some of the points.
    """
    thick = around.thickness / ball_thickness(AROUND)
    within, least = thick[around.near].mean(axis=1) > FILLED, SHARES[-1] * len(thick)
    if within.sum() <= least:
        return []
    tree = Tree(points)
    noisy = 2 * choose_neighbours(points, tree, rng, thin=FLAT)
    # Fewer tell nothing of neighbourhoods so large, or are no counterpart of any part that counts.
    enough = max(2 * noisy * len(thick) / len(points), COUNTERPART * least)
    for step in (SPARSE, 1):
        part = _parts_of(within, around, enough)
        # The first turns down most at little cost; the one that noise asks for costs most where it is asked of all.
        for size in (SIZES[0], noisy, *SIZES[1:]):
            if (part >= 0).sum() <= least:
                return []
            part = _parts_of(_filled_at(size, part >= 0, points, tree, around, step), around, enough)
        within &= _beside(_beside(part >= 0, around), around)
    # One that fills a volume may hold more than one of surface, as long as the rest is no counterpart of it.
    most = COUNTERPART / (1.0 + COUNTERPART)
    grown = (_grown(m, around) for m in _lone(part, most))
    found = _members(points, around, [m for m in grown if m.mean() <= most])
    return [c for c in found if _spreads_in_space(points[c], tree)]


def _parts_of(within: Mask, around: Surroundings, enough: float) -> Index:
    """Number of the part that each point belongs to among those `within`; -1 of the others, and of parts too small."""
    one, other = np.repeat(np.arange(len(within)), AROUND), around.near.ravel()
    inside = within[one] & within[other]
    part = np.where(within, connected_parts(one[inside], other[inside], len(within)), -1)
    return np.where(np.bincount(part + 1)[part + 1] < enough, -1, part)


def _beside(some: Mask, around: Surroundings) -> Mask:
    """Some points with the neighbours of each."""
    found = some.copy()
    found[around.near[some]] = True
    return found


def _filled_at(size: int, within: Mask, points: Array, tree: Tree, around: Surroundings, step: int) -> Mask:
    """Those `within` around which neighbourhoods of another size fill a volume too, by one of `step` near each."""
    near = around.near[within]
    # Small neighbourhoods of neighbours have less in common.
    step = max(min(step, size * len(within) // (SPARSE * len(points))), 1)
    asked = np.zeros(len(within), dtype=bool)
    asked[near] = near % step == 0
    asked[near[~asked[near].any(axis=1), 0]] = True
    thick = np.zeros(len(within))
    thick[asked] = _blobness(points, tree, around.points[asked], size)
    found = within.copy()
    found[within] = thick[near].sum(axis=1) > FILLED * asked[near].sum(axis=1)
    return found


def _blobness(points: Array, tree: Tree, queries: Array, size: int) -> Array:
    """Thickness [Q] of so many points [N, 3] around queries [Q, 3], or all, over that of random ones in a ball."""
    size = min(size, len(points))
    return thickness_of(planes_of(points, tree.query(queries, size)[1])[2]) / ball_thickness(size)


def _lone(part: Index, most: float) -> list[Mask]:
    """Parts that none other is about as large as, and that count, given the number of each point's part; -1 is no part.

    None holds more than a share `most` of the points.
    """
    sizes = np.bincount(part + 1)[1:]
    small = np.flatnonzero((sizes <= most * len(part)) & (sizes > SHARES[-1] * len(part)))
    own = sizes[small, None]
    alike = (sizes >= COUNTERPART * own) & (sizes <= own / COUNTERPART)
    return [part == k for k in small[alike.sum(axis=1) == 1]]


def _gap(around: Surroundings, some: Mask) -> bool:
    """Whether nine in ten of some points stand farther from all others than from their own neighbours."""
    between = Tree(around.points[~some]).nearest(around.points[some])[0]
    return bool(np.quantile(between, 0.1) > np.median(around.reach[some]))


def _grown(some: Mask, around: Surroundings) -> Mask:
    """Some points with those that most neighbours of are among them: a core with its rim."""
    while (more := some | (some[around.near].mean(axis=1) > 0.5)).sum() > some.sum():
        some = more
    return some


def _members(points: Array, around: Surroundings, groups: list[Mask]) -> list[Index]:
    """Indices of all points [N, 3] that belong to each of some groups, as the nearest of some points do."""
    if not groups:
        return []
    nearest = around.tree.nearest(points)[1]
    return [np.flatnonzero(m[nearest]) for m in groups]
