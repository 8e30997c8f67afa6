"""The plane that an object stands on: a table, the ground.

It is no part of the object, but nothing in a cloud says so: a vase on a square slab has the slab's symmetry if they
were made as one, and its own if they were not. So it is looked for only where somebody says that there is one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from symrefine.geometry import Array, Mask, tight_diagonal
from symrefine.surface.clumps import RIM
from symrefine.surface.misses import SHARES, TOLERANCE
from symrefine.surface.neighbourhoods import ROUNDING

# Planes that are tried, and points that they are tried on: of floors that hold a tenth of all, one in 150 is missed.
TRIALS, SOME = 5000, 1000
# Fits of a plane to the points that lie on the one before: the first starts off by as much as it may be thick.
FITS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Floor:
    """A plane with everything else on one side.

    Attributes:
        normal: [3] towards what stands on it.
        offset: of it: normal.x = offset.
        thick: how far off it points of it may lie.
    """

    normal: Array
    offset: float
    thick: float

    def normalised(self, center: Array, scale: float) -> "Floor":
        """The same in the frame of `(points - center) / scale`."""
        offset = float(self.offset - self.normal @ center) / scale
        return Floor(normal=self.normal, offset=offset, thick=self.thick / scale)

    def covers(self, points: Array) -> Mask:
        """Which of points [..., 3] lie in it: they are its own, and of what stands on it nobody could see them."""
        return np.asarray(np.abs(points @ self.normal - self.offset) <= self.thick)

    def above(self, points: Array) -> Array:
        """How far above it points [..., 3] lie."""
        return np.asarray(points @ self.normal - self.offset - self.thick)

    def bars(self, points: Array, margin: float) -> Mask:
        """Which of points [..., 3] lie below it by more than a margin, where nothing of what stands on it is."""
        return np.asarray(points @ self.normal < self.offset - self.thick - margin)


def floor_of(points: Array) -> Floor | None:
    """The plane that all other points [N, 3] stand on; None if there is no such plane.

    Of planes through three points each (RANSAC: Fischler and Bolles, 1981) the one that holds most points of those that
    have all others to one side, but for as many as details may be. It has to reach beyond what stands on it, as the
    flat bottom of an object does not.
    """
    rng = np.random.default_rng(0)
    # Where it is thicker, planes of the object may lie in it.
    thick = 0.5 * TOLERANCE * tight_diagonal(points)
    some = points[rng.permutation(len(points))[:SOME]]
    corners = some[rng.integers(len(some), size=(TRIALS, 3))]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    across, places = across[lengths > 0.0] / lengths[lengths > 0.0, None], corners[lengths > 0.0, 0]
    heights = across @ some.T - np.einsum("ti,ti->t", across, places)[:, None]
    held = np.where(_has_sides(heights, thick), (np.abs(heights) <= thick).mean(axis=1), 0.0)
    for best in np.argsort(-held, kind="stable")[: np.count_nonzero(held > SHARES[0])]:
        if (found := _about(points, places[best], across[best], thick)) is not None:
            return found
    return None


def _about(points: Array, place: Array, normal: Array, thick: float) -> Floor | None:
    """The floor that lies about a plane, at most so thick, if one does."""
    offset = (points - place) @ normal
    within = thick
    for _ in range(FITS):
        on = np.abs(offset) <= within
        middle = points[on].mean(axis=0)
        normal = np.linalg.eigh(np.cov(points[on].T))[1][:, 0]
        offset = (points - middle) @ normal
        # Two thirds of what has noise lie within one standard deviation.
        noise = float(np.quantile(np.abs(offset[on]), 2.0 / 3.0))
        within = min(max(RIM * noise, ROUNDING * thick), thick)
    on = np.abs(offset) <= within
    if not (_has_sides(offset[None], thick)[0] and _reaches_beyond(points, on, normal)):
        return None
    normal = normal if np.median(offset[~on]) > 0.0 else -normal
    return Floor(normal=normal, offset=float(middle @ normal), thick=within)


def _has_sides(offsets: Array, thick: float) -> Mask:
    """Whether what lies off a plane lies to one side of it [T], by signed distances from it [T, N]."""
    above, below = (offsets > thick).sum(axis=1), (offsets < -thick).sum(axis=1)
    return np.asarray(np.minimum(above, below) <= SHARES[0] * (above + below))


def _reaches_beyond(points: Array, on: Mask, normal: Array) -> bool:
    """Whether more of a plane than a detail lies beside what stands on it, seen along its normal."""
    flat = points @ np.linalg.svd(normal[None])[2][1:].T
    try:
        hull = ConvexHull(flat[~on])
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        return False
    sides = flat[on] @ hull.equations[:, :2].T + hull.equations[:, 2]
    return bool((sides > 0.0).any(axis=1).mean() > SHARES[0])
