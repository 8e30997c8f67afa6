"""Where a surface is open, so that what lies beyond was not seen: missing surface is no evidence against a symmetry.

A patch of the image that meets no surface begins somewhere. Where it begins at an open border nobody looked beyond, and
it is unseen; where it begins in the middle of a surface, the surface says that there is nothing: it contradicts.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array
from symrefine.surface.neighbourhoods import Neighbourhoods, fit_planes, kd_tree
from symrefine.surface.skin import LocalPlanes

Mask = NDArray[np.bool_]
# Neighbours that tell a border: the middle of half a disc lies 0.75 of its width off the point, that of a whole disc 0,
# with a standard deviation of 0.12 for so many; edges of solids reach 0.4.
NEIGHBOURS, ASIDE = 32, 0.55
# Neighbourhoods so many times as thick as most are folded, and those so much narrower than long are wires.
FOLDED, WIRE = 2.0, 0.2
# Share of the local planes at a border from which on a surface counts as open: on 76 closed objects it stays below
# 0.11 %, a hole of 5 % has 0.2 % and more.
OPEN = 0.0012
# Neighbours by which the patches of an image hang together.
LINKS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Openings:
    """The open borders of a surface.

    Attributes:
        border: [M] which local planes lie at one.
        links: by stride, which of every so many-th local planes are neighbours, a sparse matrix.
    """

    border: Mask
    links: dict[int, Any] = field(default_factory=dict)

    def linked(self, cloud: LocalPlanes, stride: int) -> Any:
        """Which of every `stride`-th local planes are neighbours, symmetric."""
        if stride not in self.links:
            from scipy.sparse import csr_array

            points = cloud.points[::stride]
            _, near = kd_tree(points).query(points, k=[*range(2, LINKS + 2)])
            ends = np.arange(0, near.size + 1, LINKS)
            links = csr_array((np.ones(near.size), near.ravel(), ends), shape=(len(points), len(points)))
            self.links[stride] = links + links.T
        return self.links[stride]

    def unseen(self, cloud: LocalPlanes, moved: Array, away: Mask, stride: int) -> Mask:
        """Which of every `stride`-th local planes, moved to [N, 3], lie where nobody looked.

        Args:
            cloud: the surface.
            moved: where an operation takes them.
            away: [N] those that meet no surface.
            stride: of the local planes.
        """
        from scipy.sparse.csgraph import connected_components

        found = np.zeros(len(moved), dtype=bool)
        off = np.flatnonzero(away)
        if not off.size:
            return found
        links = self.linked(cloud, stride)
        count, patch = connected_components(links[off][:, off], directed=False)
        begins = links[off][:, np.flatnonzero(~away)].tocoo()
        met = np.flatnonzero(~away)[begins.col]
        which, back = np.unique(met, return_inverse=True)
        open_there = self.border[cloud.tree.query(moved[which])[1]] if which.size else np.zeros(0, dtype=bool)
        own = patch[begins.row]
        at_border = np.bincount(own, open_there[back], count)
        in_all = np.bincount(own, minlength=count)
        free = at_border > 0.5 * in_all
        found[off[free[patch]]] = True
        # What lies next to such a patch already reaches beyond the border.
        found[met[free[own] & open_there[back]]] = True
        return found


def openings(cloud: LocalPlanes, points: Array, tree: Any, neighbours: int) -> Openings | None:
    """The open borders of a surface of which points [N, 3] with their kd-tree are known; None if it is closed.

    Args:
        neighbours: of the local planes, more where there is noise.
    """
    around = Neighbourhoods.of(points, tree, max(NEIGHBOURS, neighbours)).around(cloud.points)
    mean, normals, variances = fit_planes(around)
    aside = mean - cloud.points
    aside -= np.einsum("ni,ni->n", aside, normals)[:, None] * normals
    width = np.sqrt(variances[:, 1] + variances[:, 2])
    thick = np.sqrt(variances[:, 0])
    sheet = (thick < FOLDED * np.median(thick)) & (variances[:, 1] > WIRE**2 * variances[:, 2])
    border = sheet & (np.linalg.norm(aside, axis=1) > ASIDE * width)
    if border.mean() < OPEN:
        return None
    # A border is a line: its points stand side by side, and what is within two spacings of it is at it.
    line = cloud.points[border]
    beside = kd_tree(line).query(line, k=[3])[0][:, 0] < 2.0 * width[border]
    if beside.sum() < OPEN * len(border):
        return None
    near = kd_tree(line[beside]).query(cloud.points)[0] < 2.0 * np.median(cloud.reach)
    return Openings(border=near)
