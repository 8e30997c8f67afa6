"""What was not seen of a surface: missing parts are no evidence against a symmetry.

A patch of the image that meets no surface begins somewhere. Where it begins at an open border nobody looked beyond, and
it is unseen; where it begins in the middle of a surface, the surface says that there is nothing: it contradicts. Where
cameras are known, they say it better: a patch in space that they saw to be free contradicts, any other is unseen. A
clump of strays hides what it covers, and its own rim is not told from the surface.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symrefine.geometry import Array, Isometry, Mask, images, rows, unit
from symrefine.rounding import DOUBLE
from symrefine.shape import Index
from symrefine.surface.cameras import Camera
from symrefine.surface.clumps import Clump
from symrefine.surface.floor import Floor
from symrefine.surface.misses import SHARES
from symrefine.surface.neighbourhoods import (
    WIDEST,
    Neighbourhoods,
    are_wires,
    connected_parts,
    fit_planes,
    planes_of,
    renumbered,
    smallest_eigenvectors,
    spreads_of,
)
from symrefine.surface.skin import AROUND, LocalPlanes
from symrefine.surface.tree import Tree

# Neighbours that tell a border, and how far off the point their middle lies there, in standard deviations along the
# surface: 1.6 for half a disc as for half a tube, 0.5 where the border is half a radius away, 0 for a whole disc, by
# chance 0.18. Of closed objects 0.1 % of the local planes lie farther aside than the first and stand side by side; what
# is beside such a border belongs to it from the second on.
NEIGHBOURS, FAR_ASIDE, ASIDE = 32, 0.7, 0.5
# Where normals turn, a surface bends away and does not end: their mean square along a direction, so many times, counts
# as spread there, by the size of the neighbourhood. Of 1, 2 and 4 this one finds most of the borders of 14 damaged
# objects where as few others pass for one.
BENDS = 2.0
# A surface counts as open from this share of local planes far aside on, for each RMS radius that neighbourhoods are
# wide: what lies that near a border is as much more as they are wider. Of 21 closed objects of 20,000 points all stay
# below 0.016; where 5 % of the surface are missing, 22 of 24 are above 0.022.
OPEN = 0.02
# So much of it leaves no doubt: five times as much. Where noise makes one of its walls, the rim of a mug reaches 0.08.
EVIDENT = 0.1
# Correlation of how far off the common sheet neighbours lie with how far in: 0.6 where two sheets meet, 0 at a border.
PARTED = 0.3
# A patch is unseen if one in so many of the places where it begins is at a border: of true ones more than half are.
MOST = 3
# Operations, but for the identity, from which on most take a place where the object ends to others where it does: if it
# lies on a mirror two take it to what adjoins such a place. No more of them keep a place at a hole that lies on one.
TELLING = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Openings:
    """The open borders of a surface, the cameras that saw it, and what hides parts of it.

    Attributes:
        line: [M] which local planes make one up.
        border: [M] which lie at one.
        evident: whether they are too long to be a whim of the sample.
        ends: [M] which of these may lie at the end of a thin part; None if none do.
        doubted: whether nothing is hidden beyond what may be such an end.
        cameras: what saw it, in the frame of the surface; none if nothing is known of them.
        clumps: what hides parts of it, in the frame of the surface.
        floor: what it stands on, likewise, if that was set apart: it hides the bottom, and bars all below.
        links: by stride, pairs [2, E] of every so many-th local planes that are neighbours, both ways.
    """

    line: Mask
    border: Mask
    evident: bool
    ends: Mask | None = None
    doubted: bool = False
    cameras: tuple[Camera, ...] = ()
    clumps: tuple[Clump, ...] = ()
    floor: Floor | None = None
    links: dict[int, Index] = field(default_factory=dict)

    @property
    def covering(self) -> tuple[Clump | Floor, ...]:
        """What hides parts of it."""
        return self.clumps if self.floor is None else (*self.clumps, self.floor)

    @property
    def hide_much(self) -> bool:
        """Whether they are too long to be a whim of the sample; nobody saw the bottom of what stands on a floor."""
        return self.evident or self.floor is not None

    @property
    def closed(self) -> "Openings | None":
        """What is left of it where the surface counts as closed: what hides it; None if nothing does."""
        if not self.covering:
            return None
        if not (self.cameras or self.line.any()):
            return self
        none = np.zeros_like(self.line)
        return replace(self, line=none, border=none, evident=False, ends=None, cameras=())

    def linked(self, cloud: LocalPlanes, stride: int) -> Index:
        """Pairs [2, E] of every `stride`-th local planes that are neighbours, both ways, by the first of each."""
        if stride not in self.links:
            points = cloud.points[::stride]
            _, near = Tree(points).query(points, AROUND, skip=1)
            pairs = np.stack([np.repeat(np.arange(len(points)), AROUND), near.ravel()])
            both = np.concatenate([pairs, pairs[::-1]], axis=1)
            self.links[stride] = both[:, np.argsort(both[0], kind="stable")]
        return self.links[stride]

    def unseen(
        self,
        cloud: LocalPlanes,
        moved: Array,
        away: Mask,
        stride: int,
        margin: float,
        *,
        met: "tuple[LocalPlanes, Openings] | None" = None,
        most: int = MOST,
        turned: Array | None = None,
        group: Sequence[Isometry] = (),
    ) -> Mask:
        """Which [K, N] of every `stride`-th local planes, moved by K operations, lie where nobody looked.

        Args:
            cloud: the surface.
            moved: [K, N, 3] where operations take them.
            away: [K, N] those that meet no surface.
            stride: of the local planes.
            margin: by how much space has to be free.
            met: the surface that they were to meet and its openings, where that is another one.
            most: a patch is unseen if one in so many of the places where it begins is at a border.
            turned: [K, N, 3] their normals there, out of the body: what turns its back to all cameras they could not
                see, though it meets the other side of a wall.
            group: operations of the group that all K belong to, if they do: an object that has it ends where most of
                these carry a border onto a border.
        """
        there_cloud, there_openings = (cloud, self) if met is None else met
        covered = np.zeros_like(away)
        if self.covering or there_openings.covering:
            still = np.broadcast_to(cloud.points[::stride], moved.shape)
            covered[away] = _covered(self.covering, still[away]) | _covered(there_openings.covering, moved[away])
        floor = there_openings.floor
        barred = np.zeros_like(away) if floor is None else floor.bars(moved, margin)
        covered &= ~barred
        away = away & ~covered
        one, other = self.linked(cloud, stride)
        if there_openings.cameras:
            found = away.copy()
            for camera in there_openings.cameras:
                found[found] = ~camera.sees_through(moved[found], margin)
            # What meets the surface next to it already reaches beyond what was seen.
            beyond = np.zeros_like(found)
            which, pair = np.nonzero(found.take(one, axis=1))
            beyond[which, other[pair]] = True
            if turned is not None:
                beyond |= ~there_cloud.faced(moved, turned)
            return covered | ((found | (beyond & ~away)) & ~barred)
        leave, enters = away.take(one, axis=1), ~away.take(other, axis=1)
        which, pair = np.nonzero(leave & enters)
        if not which.size:
            return covered
        # The images of all operations side by side: those of one hang together with none of another.
        count, whole = away.shape[1], away.size
        begin, rim_of = which * count + one[pair], which * count + other[pair]
        inside, within = np.nonzero(leave & ~enters)
        patch = connected_parts(inside * count + one[within], inside * count + other[within], whole)
        rim, back = renumbered(rim_of, whole)
        classes = cloud.classes(slice(None, None, stride))
        _, target = there_cloud.nearest(moved.reshape(-1, 3)[rim], None if classes is None else classes[rim % count])
        there, here = there_openings.border[target][back], self.border[::stride][other[pair]]
        own = patch[begin]
        at_border = there & ~here
        # A border that is carried onto a border says nothing: there the object may end on both sides.
        both = np.bincount(own, there & here, whole)
        every = np.bincount(own, minlength=whole)
        begins = np.bincount(own, at_border, whole)
        free = (most * begins >= every - both) & (every > 0)
        if there_openings.doubted and there_openings.ends is not None:
            sure = at_border & ~there_openings.ends[target][back]
            # What ends before the others of its kind is where these go on to their ends, and not in the middle of them.
            first = renumbered(begin[at_border], whole)[0]
            tips = np.bincount(patch[(away & self.border[::stride]).ravel()], minlength=whole)
            free &= (most * np.bincount(own, sure, whole) >= begins) | (
                most * tips < np.bincount(patch[first], minlength=whole)
            )
        if len(group) >= TELLING and there.any():
            # What says nothing is asked where nothing else of a patch is at a border.
            asked = at_border | (there & (begins[own] == 0))
            onto, met_by = self.kept(cloud, target[back[asked]], group)
            kept = np.bincount(own[asked], onto / np.maximum(met_by, 1.0 / len(group)), whole)
            ends = (kept > 0.0) & (kept >= 0.5 * np.bincount(own[asked], minlength=whole))
            # A sliver counts for nothing in either way.
            free &= ~(ends & (np.bincount(patch[away.ravel()], minlength=whole) >= SHARES[-1] * count))
        found = away & free[patch].reshape(away.shape)
        # What lies next to such a patch already reaches beyond the border.
        found.reshape(-1)[rim_of[free[own] & at_border]] = True
        return covered | (found & ~barred)

    def kept(self, cloud: LocalPlanes, at: Index, group: Sequence[Isometry]) -> tuple[Array, Array]:
        """Shares of the operations of a group that carry the border next to local planes [N] onto one, or anything.

        Where a surface goes on unseen few keep it, as they take its border where nothing is missing; where the object
        ends most do, all but those that take it to where something adjoins. What they take to where nothing was seen,
        near a border as that may lie, tells nothing of that.
        """
        line = np.flatnonzero(self.line)
        which, back = np.unique(line[Tree(cloud.points[line]).nearest(cloud.points[at])[1]], return_inverse=True)
        classes = cloud.classes(which)
        classes = None if classes is None else np.tile(classes, len(group))
        away, near = cloud.nearest(images(group, cloud.points[which]), classes)
        met = away < cloud.beside
        kept, every = ((met & some).reshape(len(group), -1).mean(axis=0)[back] for some in (self.border[near], met))
        return kept, every


def agreed(places: Array, unseen: Mask) -> Mask:
    """Whether nobody looked at places [N, 3] that operations carry parts of a surface to, by what is said around each.

    Whether somebody did is a matter of the place. Of a border not all may be told, so that a patch of one operation is
    denied what those of others that come to lie there are granted.
    """
    if unseen.all() or not unseen.any() or len(places) <= AROUND:
        return unseen
    near = Tree(places).query(places, AROUND + 1)[1]
    return np.asarray(unseen[near].mean(axis=1) > 0.5)


def openings(
    cloud: LocalPlanes,
    points: Array,
    tree: Tree,
    cameras: tuple[Camera, ...] = (),
    near: Index | None = None,
    *,
    clumps: tuple[Clump, ...] = (),
    floor: Floor | None = None,
    strays: bool = False,
    least: float = OPEN,
    blurred: bool = False,
) -> Openings | None:
    """What is open of a surface, or hidden; None if it is closed, or known too coarsely to tell.

    Args:
        cloud: its local planes.
        points: [N, 3] all that is known of it.
        tree: kd-tree over them.
        cameras: what saw it, where that is known.
        near: [M, NEIGHBOURS] of the points near each local plane, if they are known already.
        clumps: what hides parts of it.
        floor: what it stands on, if that was set apart.
        strays: whether there were any: then what is lonely may be one more, which has all that is near to one side,
            and no end of the surface.
        least: share of the local planes that have to lie far aside, for each RMS radius that neighbourhoods are wide.
        blurred: whether noise alone needs all that is allowed: then nobody sees where it is open, only that, if so.
    """
    none = np.zeros(len(cloud.points), dtype=bool)
    closed = Openings(line=none, border=none, evident=bool(cameras), cameras=cameras, clumps=clumps, floor=floor)
    if cameras:
        return closed
    if len(points) < NEIGHBOURS:
        return None
    aside, width = _aside(cloud, points, tree, near)
    if floor is not None:
        aside[floor.meets(cloud.points, cloud.beside)] = 0.0
    far = _lines(cloud, (aside > FAR_ASIDE) & ~(cloud.lonely & strays))
    far[far] = ~_folded(cloud.points[far], points, tree, None if near is None else near[far])
    is_open = width <= WIDEST and far.mean() >= least * width and _is_long(cloud.points[far], width)
    evident = bool(is_open and far.mean() > EVIDENT * width)
    if blurred or not is_open:
        return replace(closed, evident=evident) if closed.covering or evident else None
    line = (aside > ASIDE) & _beside(cloud, far)
    border = _beside(cloud, line)
    far[far] = ~_thin(cloud.points[far], points, tree)
    ends = border & ~_beside(cloud, line & _beside(cloud, far)) if far.any() else border
    return replace(closed, line=line, border=border, evident=evident, ends=ends if ends.any() else None)


def _covered(covering: tuple[Clump | Floor, ...], points: Array) -> Mask:
    """Which of points [N, 3] lie where something hides them."""
    return np.any([np.zeros(len(points), dtype=bool), *(thing.covers(points) for thing in covering)], axis=0)


def _beside(cloud: LocalPlanes, some: Mask) -> Mask:
    """Which local planes [M] lie within twice the usual reach of some of them."""
    return np.asarray(Tree(cloud.points[some]).nearest(cloud.points)[0] < cloud.beside)


def _aside(cloud: LocalPlanes, points: Array, tree: Tree, near: Index | None) -> tuple[Array, float]:
    """How far off each local plane [M] the middle of what is around lies, in standard deviations along the surface.

    Nothing in wires. And how wide neighbourhoods are.
    """
    mean, spread = spreads_of(Neighbourhoods.of(points, tree, NEIGHBOURS).around(cloud.points, near))
    variances, _ = smallest_eigenvectors(spread)
    # The normals of as wide a neighbourhood.
    count = min(max(AROUND, round(NEIGHBOURS * len(cloud.points) / len(points))), len(cloud.points))
    normals = rows(cloud.normals, cloud.around(cloud.points, cloud.labels, count)[1])
    # A wire ends anyway.
    aside = np.where(are_wires(variances), 0.0, _off(mean - cloud.points, spread, normals))
    return aside, float(np.median(np.sqrt(variances.sum(axis=1))))


def _off(aside: Array, spread: Array, normals: Array) -> Array:
    """How far off middles lie that are aside [M, 3], in standard deviations along the surface.

    By the covariances [M, 3, 3] of what they are the middles of, and its normals [M, k, 3].
    """
    size = np.trace(spread, axis1=1, axis2=2)[:, None, None]
    bends = BENDS / normals.shape[1] * size * (normals.transpose(0, 2, 1) @ normals)
    along = np.linalg.solve(spread + DOUBLE * np.eye(3) + bends, aside[:, :, None])[:, :, 0]
    return np.sqrt(np.clip(np.einsum("ni,ni->n", aside, along), 0.0, None))


def _thin(at: Array, points: Array, tree: Tree) -> Mask:
    """Which of some places [M, 3] at a border lie at none among half as many neighbours.

    Where a surface ends it does at any scale; where a thin part does, only at those that are wider than it is thick. At
    the corners of its end normals turn, by fits as narrow.
    """
    count = NEIGHBOURS // 2
    near, neighbourhoods = tree.query(at, count)[1], Neighbourhoods.of(points, tree, count)
    mean, spread = spreads_of(neighbourhoods.around(at, near))
    those, own = renumbered(near, len(points))
    normals = fit_planes(neighbourhoods.around(points[those]))[1][own]
    # By chance so few lie aside themselves.
    return _together(at, _off(mean - at, spread, normals), count) <= FAR_ASIDE


def _together(at: Array, values: Array, count: int) -> Array:
    """Means [M] of values [M] at so many places that stand together, as at one edge, around each of places [M, 3]."""
    return np.asarray(values[Tree(at).query(at, min(count, len(at)))[1]].mean(axis=1))


def _folded(at: Array, points: Array, tree: Tree, near: Index | None) -> Mask:
    """Which of some places [M, 3] lie at a sharp edge, where two sheets meet, and not where one ends or two do.

    From an edge on sheets part: how far neighbours lie off the one that fits them best grows with how far in they lie.
    Where a surface ends they scatter, or two walls run side by side, as far in as at the end. By chance 32 neighbours
    show a correlation of 0.18, so those of several places at the same edge are taken together.
    """
    if len(at) <= AROUND:
        return np.zeros(len(at), dtype=bool)
    near = tree.query(at, NEIGHBOURS)[1] if near is None else near
    middle, across, _ = planes_of(points, near)
    aside = middle - at
    inwards = unit(aside - across * np.einsum("ni,ni->n", aside, across)[:, None])
    offset = rows(points, near) - middle[:, None]
    height, depth, along = (np.einsum("nki,ni->nk", offset, v) for v in (across, inwards, np.cross(across, inwards)))
    sheet, _ = np.linalg.qr(np.stack([np.ones_like(depth), depth, along, depth**2, depth * along, along**2], axis=2))
    off = np.abs(height - np.einsum("nkp,np->nk", sheet, np.einsum("nkp,nk->np", sheet, height)))
    off, depth = (v - v.mean(axis=1, keepdims=True) for v in (off, depth))
    size = np.linalg.norm(off, axis=1) * np.linalg.norm(depth, axis=1)
    parted = np.einsum("nk,nk->n", off, depth) / np.maximum(size, DOUBLE)
    return _together(at, parted, AROUND + 1) > PARTED


def _is_long(points: Array, width: float) -> bool:
    """Whether some of points [N, 3] stand in a row that is longer than neighbourhoods are wide (RMS radii).

    At the corner of a box all that is near lies to one side, too, but so it does nowhere beside the corner. Points hang
    together whose neighbourhoods overlap, discs of the square root of two RMS radii.
    """
    if not len(points):
        return False
    part = in_a_row(points, 2.0 * math.sqrt(2.0) * width)
    middles = np.stack([np.bincount(part, column) for column in points.T], axis=1) / np.bincount(part)[:, None]
    return bool(np.linalg.norm(points - middles[part], axis=1).max() > width)


def in_a_row(points: Array, within: float) -> Index:
    """Number of the row that each of points [N, 3] belongs to: neighbours nearer than `within` hang together."""
    away, near = Tree(points).query(points, min(AROUND, len(points)))
    linked = away < within
    return connected_parts(np.nonzero(linked)[0], near[linked], len(points))


def _lines(cloud: LocalPlanes, chosen: Mask) -> Mask:
    """Which of some local planes stand side by side, as those of a border do: two others within twice their reach."""
    found = np.zeros_like(chosen)
    if chosen.sum() > 2:
        points = cloud.points[chosen]
        found[chosen] = Tree(points).query(points, 1, skip=2)[0][:, 0] < 2.0 * cloud.reach[chosen]
    return found
