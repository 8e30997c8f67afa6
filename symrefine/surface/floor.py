"""The plane that an object stands on: a table, the ground.

It is no part of the object, but nothing in a cloud says so: a vase on a square slab has the slab's symmetry if they
were made as one, and its own if they were not. So it is looked for only where somebody says that there is one.
"""

from dataclasses import dataclass, field

import numpy as np

from symrefine.geometry import Array, Mask, frame_with_z, tight_diagonal
from symrefine.rounding import SINGLE
from symrefine.samples import LOOK
from symrefine.surface.misses import RIM, SHARES
from symrefine.surface.tree import Tree

# Planes that are tried, and points that they are tried on: of floors that hold a tenth of all, one in 150 is missed.
TRIALS = 5000
# Fits of a plane to the points that lie on the one before: the first starts off by as much as it may be thick.
FITS = 5
# How far off its points may lie, of the diagonal: for noise of 0.3 % to 1.25 %.
THICK = (0.0125, 0.025, 0.05)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Floor:
    """A plane with everything else on one side.

    Attributes:
        normal: [3] towards what stands on it.
        offset: of it: normal.x = offset.
        thick: how far off it points of it may lie.
        points: [K, 3] that were seen of it.
    """

    normal: Array
    offset: float
    thick: float
    points: Array = field(repr=False)

    def normalised(self, center: Array, scale: float) -> "Floor":
        """The same in the frame of `(points - center) / scale`."""
        offset = float(self.offset - self.normal @ center) / scale
        points = (self.points - center) / scale
        return Floor(normal=self.normal, offset=offset, thick=self.thick / scale, points=points)

    def covers(self, points: Array) -> Mask:
        """Which of points [..., 3] lie in it: they are its own, and of what stands on it nobody could see them."""
        return np.asarray(np.abs(points @ self.normal - self.offset) <= self.thick)

    def above(self, points: Array) -> Array:
        """How far above it points [..., 3] lie."""
        return np.asarray(points @ self.normal - self.offset - self.thick)

    def meets(self, points: Array, reach: float) -> Mask:
        """Which of points [N, 3] lie so near above it, where it was seen: there a surface goes on, and has no end."""
        found = self.above(points) < reach
        found[found] = np.isfinite(Tree(self.flat(self.points)).nearest(self.flat(points[found]), bound=reach)[0])
        return found

    def flat(self, points: Array) -> Array:
        """Points [N, 3] seen along its normal [N, 2]."""
        return np.asarray(points @ frame_with_z(self.normal)[:2].T)

    def bars(self, points: Array, margin: float) -> Mask:
        """Which of points [..., 3] lie below it by more than a margin, where nothing of what stands on it is."""
        return np.asarray(points @ self.normal < self.offset - self.thick - margin)


def floor_of(points: Array, seen_from: Array | None = None) -> Floor | None:
    """The plane that all other points [N, 3] stand on; None if there is no such plane.

    A camera (places [N, 3]) that saw some of it does not stand below it: then it is the face of something.

    Of planes through three points each (RANSAC: Fischler and Bolles, 1981) the one that holds most points of those that
    have all others to one side, but for as many as details may be. It has to reach beyond what stands on it, as the
    flat bottom of an object does not.
    """
    rng = np.random.default_rng(0)
    some = points[rng.permutation(len(points))[:LOOK]]
    corners = some[rng.integers(len(some), size=(TRIALS, 3))]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    across, places = across[lengths > 0.0] / lengths[lengths > 0.0, None], corners[lengths > 0.0, 0]
    heights = across @ some.T - np.einsum("ti,ti->t", across, places)[:, None]
    # The thicker it is the more of the object lies in it.
    for thick in tight_diagonal(points) * np.array(THICK):
        on = np.abs(heights) <= thick
        held = np.where(_has_sides(heights, thick), on.mean(axis=1), 0.0)
        while held.max(initial=0.0) > SHARES[0]:  # points on a line make no plane
            best = int(held.argmax())
            found = _about(some, places[best], across[best], thick)
            found = found and _about(points, found.offset * found.normal, found.normal, thick)
            if found is not None and _seen_from_above(points, found, seen_from) and _reaches_beyond(points, found):
                return found
            held[on[:, on[best]].mean(axis=1) > 0.5] = 0.0  # what holds most of the same ends the same
    return None


def _about(points: Array, place: Array, normal: Array, thick: float) -> Floor | None:
    """The plane that lies about another one, at most so thick, if what lies off it lies to one side."""
    offset, within = (points - place) @ normal, thick
    for _ in range(FITS):
        on = np.abs(offset) <= min(within, thick)
        middle = points[on].mean(axis=0)
        normal = np.linalg.eigh(np.cov(points[on].T))[1][:, 0]
        offset = (points - middle) @ normal
        if np.count_nonzero(offset > thick) < np.count_nonzero(offset < -thick):
            normal, offset = -normal, -offset
        # Below it there is nothing else. Two thirds of what has noise lie within one standard deviation; a cut through
        # a body is filled evenly.
        below = np.maximum(-offset[on], 0.0)
        within = max(RIM * float(np.quantile(below[below > 0.0], 2.0 / 3.0)) if below.any() else 0.0, SINGLE * thick)
    if within > thick or not _has_sides(offset[None], thick)[0]:
        return None
    on = np.abs(offset) <= within
    return Floor(normal=normal, offset=float(middle @ normal), thick=within, points=points[on])


def _has_sides(offsets: Array, thick: float) -> Mask:
    """Whether what lies off a plane lies to one side of it [T], by signed distances from it [T, N]."""
    above, below = (offsets > thick).sum(axis=1), (offsets < -thick).sum(axis=1)
    return np.asarray(np.minimum(above, below) <= SHARES[0] * (above + below))


def _seen_from_above(points: Array, found: Floor, seen_from: Array | None) -> bool:
    """Whether no more of a floor than a detail was seen from below, where that is known."""
    if seen_from is None:
        return True
    return bool(found.bars(seen_from[found.covers(points)], 0.0).mean() <= SHARES[0])


def _reaches_beyond(points: Array, found: Floor) -> bool:
    """Whether more of a floor than a detail lies beside what stands on it, seen along its normal; that is no detail."""
    from scipy.spatial import ConvexHull, QhullError

    # What noise leaves of the floor itself lies no farther above it than once more its thickness.
    others = points[found.above(points) > found.thick]
    if len(others) <= SHARES[0] * len(points):
        return False
    try:
        hull = ConvexHull(found.flat(others))
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        return False
    sides = found.flat(found.points) @ hull.equations[:, :2].T + hull.equations[:, 2]
    return bool((sides > 0.0).any(axis=1).mean() > SHARES[0])
