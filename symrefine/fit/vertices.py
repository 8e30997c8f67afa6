"""Vertices that a group maps onto vertices: they know its place to rounding, where samples know it to 1e-4.

Exact or not is a matter of vertices, not of samples: all of them are asked, and, of a mesh, whether its faces are
mapped onto faces as well. What is a vertex only of how faces were cut is asked where the others tell nothing. The same
fit places the group for reports, exports and the nearest symmetric shape.
"""

from dataclasses import dataclass, replace

import numpy as np

from symrefine.errors import InputError
from symrefine.fit.action import generators, mean_back, permutations
from symrefine.fit.anchors import LARGEST, permuting_groups, stays
from symrefine.fit.corners import Corners, corners
from symrefine.fit.finite import finite_group
from symrefine.fit.placed import Placed, common_center
from symrefine.fit.refine import MAX_OUTER
from symrefine.geometry import Array, orthogonal_factor, tight_diagonal
from symrefine.groups import PointGroup
from symrefine.groups.identify import identify
from symrefine.rounding import DOUBLE
from symrefine.samples import GLANCE
from symrefine.shape import Index, Shape
from symrefine.surface.tree import Tree

# An exact shape misses the place that detection found by no more than this.
NEAR = 2e-3
# A shape is exact where no vertex misses its counterpart by more than what rounding to five digits leaves.
ROUNDED = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnVertices:
    """Where the points of a shape put its group, which maps them onto one another.

    Attributes:
        group: where it stands.
        center: [3] the point that its operations leave in place, input units.
        finite: the operations that map the points: all of the group, or the fold that a continuous one has in them.
        miss: the largest distance of an image to its counterpart, or between faces of the same edges that are not quite
            plane, as a fraction of the diagonal.
        faces: whether faces are mapped onto faces, with their labels, triangles in one plane as one; true where there
            are none.
    """

    group: PointGroup
    center: Array
    finite: PointGroup
    miss: float
    faces: bool

    @property
    def proves(self) -> bool:
        """Whether the shape itself has a symmetry, and not only what is sampled of it."""
        return self.faces and self.group.name != "C1"

    def beside(self, point: Array) -> "OnVertices":
        """The same about the point nearest to another one [3] that the group leaves in place."""
        moved = common_center([Placed(group=self.group, center=self.center - point)])
        return replace(self, center=point + moved)

    def rounded(self, group: PointGroup) -> "OnVertices | None":
        """A continuous group where the fold of it stands that was found; None if that leaves its centre free."""
        if self.group.symbol.fold <= 2 or self.group.is_polar != group.is_polar:
            return None
        return replace(self, group=PointGroup(name=group.name, frame=self.group.frame))


def exact_symmetry(shape: Shape, diagonal: float) -> tuple[OnVertices | None, OnVertices | None]:
    """The group that maps points of a shape, corners of a mesh, onto one another to rounding, and what of it is proven.

    Nothing else has to be known of the shape but its diagonal, input units. The first is None if it cannot be told so
    (see `permuting_groups`), and of a cloud that shows at once to have none (see `stays`). The second is that part of
    it which maps the faces, too: of an open box, that has all the mirrors of a box in its corners, the two that keep
    the opening. None if nothing of it does.
    """
    origin, best = shape.points.mean(axis=0), list[OnVertices | None]()
    if shape.faces is None and stays((shape.points - origin) / diagonal, ROUNDED):
        return None, None
    for own in corners(shape, origin, diagonal, ROUNDED):
        exact = _exact(own, origin, diagonal)
        if (proof := _proven(own, exact, origin, diagonal)) is not None:
            return exact, proof
        best.append(exact)
    return max(best, key=lambda known: 1.0 if known is None else known.finite.order), None


def _exact(own: Corners, origin: Array, diagonal: float) -> OnVertices | None:
    """The group that maps corners onto one another, in units of the diagonal about the origin."""
    middle = own.points.mean(axis=0)
    # What some of the points seem to have a few others may break: then all are asked.
    for group in permuting_groups(own.points - middle, own.labels, ROUNDED):
        if group is None:
            continue
        if group.name == "C1":
            return OnVertices(group=group, center=origin, finite=group, miss=0.0, faces=True)
        if found := _on(own, group, Placed(group=group, center=middle), origin, ROUNDED, diagonal):
            return found
    return None


def _proven(own: Corners, exact: OnVertices | None, origin: Array, diagonal: float) -> OnVertices | None:
    """What of it maps the facets between the corners, too."""
    if exact is None or exact.faces or exact.group.name == "C1":
        return exact if exact is not None and exact.proves else None
    place = Placed(group=exact.group, center=(exact.center - origin) / diagonal)
    operations = place.group.operations()
    images = permutations(own.points - place.center, operations, own.labels, NEAR)
    if images is None or not own.facets:
        return None
    facets = own.facets[-1]()
    if len(operations) * len(facets.edges) > 3 * LARGEST:
        return None
    here = facets.prints(images[0])
    kept = [np.array_equal(facets.prints(image), here) for image in images]
    try:
        group = identify(operations[kept])
    except InputError:  # of what lies within rounding of being mapped
        return None
    if group.name == "C1":
        return None
    found = _on(own, group, replace(place, group=group), origin, ROUNDED, diagonal)
    return found if found is not None and found.proves else None


def on_vertices(
    shape: Shape, group: PointGroup, center: Array, *, within: float = ROUNDED, diagonal: float = 0.0
) -> OnVertices | None:
    """Where the points of a shape, the corners of a mesh, put its group, if it maps them onto one another.

    Args:
        shape: in 3-space.
        group: as found in the shape; its place may be off by some thousandths of the diagonal.
        center: [3] as found, input units.
        within: by what fraction of the diagonal an image may miss its counterpart.
        diagonal: input units; that of the smallest box around the points if 0.

    Returns:
        None where some points have no counterpart, for C1, for all of space (K, Kh), and where there are too many
        points for so many operations.
    """
    if group.name == "C1" or group.symbol.family in ("K", "Kh"):
        return None
    diagonal, found = diagonal or tight_diagonal(shape.points), None
    for own in corners(shape, center, diagonal, ROUNDED):
        place = Placed(group=finite_group(group, own.points), center=np.zeros(3))
        glanced = _glanced(own, place, within) if place.group.order * len(own.points) <= LARGEST else None
        placed = None if glanced is None else _on(own, group, glanced, center, within, diagonal)
        if placed is not None and placed.faces:
            return placed
        found = placed or found
    return found


def _on(
    own: Corners, group: PointGroup, near: Placed, center: Array, within: float, diagonal: float
) -> OnVertices | None:
    """Where corners about a centre put a group of which the finite part that maps them stands nearby."""
    images = permutations(own.points - near.center, near.group.operations(), own.labels, NEAR)
    if images is None:
        return None
    place = settled(own.points, images, near)
    operations, local = place.group.operations(), own.points - place.center
    off = (local @ g.T - local[image] for g, image in zip(operations, images, strict=True))
    miss = max(float(np.linalg.norm(apart, axis=1).max()) for apart in off)
    if miss > within:
        return None
    bend = own.bend_under([images[h] for h, _ in generators(operations)])
    return OnVertices(
        group=PointGroup(name=group.name, frame=place.group.frame),
        center=center + diagonal * place.center,
        finite=place.group,
        miss=miss if bend is None else max(miss, 2.0 * bend),  # two faces may be out of one plane on both its sides
        faces=bend is not None,
    )


def settled(points: Array, images: Index, place: Placed) -> Placed:
    """The place that moves points [N, 3] least, given the counterparts [K, N] of each under each operation."""
    last = np.inf
    for _ in range(MAX_OUTER):
        local = points - place.center
        wanted = place.center + mean_back((local[image] for image in images), place.group.operations())
        nearer, step = towards(place, points, wanted)
        if last <= step < DOUBLE:
            break
        place, last = nearer, step
    return place


def towards(place: Placed, points: Array, wanted: Array) -> tuple[Placed, float]:
    """The place to which the best rigid motion from `points` to `wanted` [N, 3] belongs, and how far it turns."""
    a, b = points.mean(axis=0), wanted.mean(axis=0)
    turn = orthogonal_factor((wanted - b).T @ (points - a), proper=True)
    center = a + turn.T @ (place.center - b)
    step = float(np.abs(turn - np.eye(3)).max() + np.abs(center - place.center).max())
    return Placed(group=PointGroup(name=place.group.name, frame=place.group.frame @ turn), center=center), step


def _glanced(own: Corners, place: Placed, within: float) -> Placed | None:
    """The place that some of the points know already, if they have counterparts; several rounds, as none is matched."""
    some = own.points[:: max(1, len(own.points) // GLANCE)]
    if len(some) == len(own.points):
        return place
    tree = Tree(own.points)
    for _ in range(MAX_OUTER):
        operations, local = place.group.operations(), some - place.center
        found = [tree.nearest(local @ g.T + place.center) for g in operations]
        miss = max(float(distance.max()) for distance, _ in found)
        if miss > NEAR:
            return None
        if miss <= within:
            return place
        back = [(own.points[near] - place.center) @ g for (_, near), g in zip(found, operations, strict=True)]
        place, _ = towards(place, some, place.center + np.mean(back, axis=0))
    # Noise of the vertices themselves is for all of them to judge.
    return place if miss <= 2.0 * within else None
