"""Where an object ends: an open border that a group carries onto itself is its own, and no hole in it."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from symrefine.decide.hypotheses import Hypothesis, judged, seen_to_end
from symrefine.decide.looks import few_motions
from symrefine.geometry import Array, Isometry, Mask
from symrefine.samples import GLANCE, LOOK
from symrefine.shape import Index
from symrefine.surface.misses import SURE
from symrefine.surface.openings import MOST, TELLING, in_a_row
from symrefine.surface.surface import Surface
from symrefine.surface.tree import Tree

# Share of its open borders, of those that it carries to where anything was seen, that a group carries onto open borders
# where the object ends there: most. Flat plates 1, mugs 0.6 and more; holes and cuts on one side of a mirror up to 0.5.
KEPT = 0.5
# Mirrors or axes of a group from which on a hole often lies on one of them by chance, and its border is kept by that.
PLACES = 3


def ends_there(surface: Surface, found: Hypothesis, borders: Mask | None = None) -> bool:
    """Whether a group carries the open borders onto themselves, as what a sensor leaves out has no symmetry.

    What it carries to where nothing was seen tells nothing of that. Asked of all, or of the local planes [M] of some.
    """
    if surface.openings is None or surface.viewed or not surface.openings.line.any():
        return False
    line, cloud = surface.openings.line if borders is None else borders, surface.cloud
    classes, shares = cloud.classes(np.flatnonzero(line)), []
    for motion in _motions(found):
        away, near = cloud.nearest(motion.apply(cloud.points[line]), classes)
        met = away < cloud.beside
        shares.append(float(surface.openings.border[near][met].sum() / max(met.sum(), 1)))
    return bool(shares) and float(np.median(shares)) > KEPT


def thin_ends(surface: Surface) -> bool:
    """Whether most of its open borders may just be where thin parts end.

    A group keeps a cut across its axis as it keeps a rim; that of a thin part it keeps has nothing beyond.
    """
    openings = surface.openings
    return openings is not None and openings.ends is not None and bool(openings.ends[openings.line].mean() > KEPT)


def is_denied(surface: Surface) -> bool:
    """Whether narrow neighbourhoods deny the open borders, and wide ones tell them no longer than chance may."""
    return surface.openings is not None and not surface.openings.evident and thin_ends(surface)


def ends_too(surface: Surface, found: Hypothesis, hidden: Sequence[tuple[Isometry, Mask]], limit: float) -> bool:
    """Whether an object ends at its open borders if it has a group that what lies beyond them was to hide.

    What is `hidden_by` the group may not go on from there. And a handle at a rim breaks what the rest keeps: it comes
    to lie where the rim ends, which all other operations carry onto the rim. Few operations do not tell by themselves
    where it ends, but by how much of the border they keep, and of that which it lies at: a cup has a rim, wherever its
    hole is.
    """
    if surface.viewed:
        return False  # what cameras see to be free says it
    if not _goes_on(surface, hidden):
        return True
    if len(found.placed.motions()) >= TELLING:
        return seen_to_end(surface, found) > limit
    return ends_there(surface, found) and ends_there(surface, found, _borders_of(surface, hidden))


def hides_surely(surface: Surface, found: Hypothesis, limit: float) -> bool:
    """Whether a group that asks for what nobody saw asks for nothing beyond where thin parts may just end.

    They have borders all along, to neighbourhoods as wide as they are thick; what ends before the others of its kind
    does so at a border, too, which narrower ones deny. Where a group keeps most borders the object ends there: if
    narrower ones do not tell that, neither do they tell any other end.
    """
    openings = surface.openings
    if openings is None or surface.viewed or openings.ends is None:
        return True
    kept = _kept(surface, found)
    if kept.mean() > KEPT and openings.ends[openings.line][kept].mean() <= KEPT:
        return False
    return judged(replace(surface, openings=replace(openings, doubted=True)), found.placed).need <= limit


def ends_elsewhere(surface: Surface, found: Hypothesis) -> bool:
    """Whether a group keeps most borders, as ends that they are, so that one more may be a hole or such an end.

    What ends early is where others of its kind go on to their own ends. In the middle of a wall, where what is hidden
    holds hardly any border of the surface itself, nothing ends.
    """
    openings = surface.openings
    if openings is None or surface.viewed or not openings.line.any() or _kept(surface, found).mean() <= KEPT:
        return False
    tips = [float(openings.border[some].mean()) for _, some in hidden_by(surface, found) if some.any()]
    return bool(tips) and MOST * float(np.median(tips)) >= 1.0


def _kept(surface: Surface, found: Hypothesis) -> Mask:
    """Which of the local planes that make up the open borders most operations of a group carry onto one."""
    assert surface.openings is not None
    line = np.flatnonzero(surface.openings.line)
    return np.asarray(surface.openings.kept(surface.cloud, line, found.placed.motions())[0] > KEPT)


def hidden_by(surface: Surface, found: Hypothesis) -> list[tuple[Isometry, Mask]]:
    """A few operations of a group, and which local planes [M] each carries to where nobody looked."""
    motions = few_motions(found.placed)
    unseen = np.isnan(surface.seen(surface.misses(motions), motions, together=True))
    return list(zip(motions, unseen, strict=True))


def hides_there(surface: Surface, hidden: Sequence[tuple[Isometry, Mask]]) -> bool:
    """Whether something that nobody saw, as it is `hidden_by` a group, lies in one of `MOST` places at open borders.

    As a patch is unseen only where it begins at a border, a border that hides nothing may be a whim of the sample.
    """
    if surface.openings is None:
        return False
    cloud, line = surface.cloud, surface.openings.line
    shares = [
        float(np.mean(Tree(motion.apply(cloud.points[some])).nearest(cloud.points[line])[0] < cloud.beside))
        for motion, some in hidden
    ]
    return MOST * float(np.median(shares)) >= 1.0


def _borders_of(surface: Surface, hidden: Sequence[tuple[Isometry, Mask]]) -> Mask:
    """Which local planes [M] make up the open borders that something lies at that is `hidden_by` a group."""
    assert surface.openings is not None
    cloud, line = surface.cloud, surface.openings.line
    row = np.full(len(line), -1)
    row[line] = in_a_row(cloud.points[line], cloud.beside)
    return np.isin(row, np.concatenate([row[border] for _, _, border in _at_borders(surface, hidden)]))


def _at_borders(surface: Surface, hidden: Sequence[tuple[Isometry, Mask]]) -> Iterator[tuple[Isometry, Index, Index]]:
    """Of each operation, which local planes of those `hidden_by` it come to lie at open borders, and at which there."""
    assert surface.openings is not None
    cloud, line = surface.cloud, np.flatnonzero(surface.openings.line)
    borders = Tree(cloud.points[line])
    for motion, some in hidden:
        own = np.flatnonzero(some)
        away, near = borders.nearest(motion.apply(cloud.points[own]))
        beside = away < cloud.beside
        yield motion, own[beside], line[near[beside]]


def _goes_on(surface: Surface, hidden: Sequence[tuple[Isometry, Mask]]) -> bool:
    """Whether what is `hidden_by` a group goes on from the borders there, or lies to them by chance.

    What a sensor leaves out ends anywhere in a surface. A box without a lid ends where the lid would stand across the
    walls all along: such an object just is so. Normals that have nothing to do with one another have a mean squared
    cosine of 1/3, of standard deviation sqrt(4/45).
    """
    if surface.openings is None:
        return True
    normals, along = surface.cloud.normals, []
    for motion, own, border in _at_borders(surface, hidden):
        if own.size:
            cosines = np.einsum("ni,ni->n", motion.turn(normals[own]), normals[border])
            along.append(float(np.mean(cosines**2) + SURE * math.sqrt(4.0 / 45.0 / len(cosines))))
    return not along or float(np.median(along)) >= 1.0 / 3.0


def _motions(found: Hypothesis) -> list[Isometry]:
    return [m for e in found.elements for m in e.motions]


def often_kept(surface: Surface, found: Hypothesis, share: float) -> bool:
    """Whether a group keeps the border of a hole of such a share of the surface in one place of so many or more.

    So does the mirror that lies in a plate, wherever the hole is: what it says of one border is chance.
    """
    every = surface.cloud.points
    some = every[:: -(-len(every) // LOOK)]
    places, width = some[:: -(-len(some) // GLANCE)], surface.cloud.beside

    def away(points: Array) -> Array:
        """Distances [P, N] of points [N, 3] from the places."""
        return np.asarray(np.linalg.norm(points - places[:, None], axis=2))

    radii = np.quantile(away(some), share, axis=1, keepdims=True)
    border = np.abs(away(some) - radii) < width
    count = np.maximum(border.sum(axis=1), 1)
    kept = [(border & (np.abs(away(m.apply(some)) - radii) < width)).sum(axis=1) / count for m in _motions(found)]
    return bool(kept) and PLACES * float((np.median(kept, axis=0) > KEPT).mean()) > 1.0


def often_left(seen: Hypothesis, found: Hypothesis) -> bool:
    """Whether a group has `PLACES` mirrors or axes or more through which a hole leaves the symmetry that is seen.

    A hole is round, so that what is left keeps its middle: one mirror, or the turns and mirrors about an axis; of what
    is round, any mirror. Of a ball it leaves an axis wherever it is, which a bowl has as well: nothing tells which of
    the two it is.
    """
    if seen.group.name == "Cs":
        return not found.group.is_finite or len(found.group.mirrors()) >= PLACES
    if not (1 < seen.group.symbol.fold < math.inf and seen.group.is_polar and found.group.is_finite):
        return False
    return sum(order % seen.group.symbol.fold == 0 for _, order in found.group.rotation_axes()) >= PLACES
