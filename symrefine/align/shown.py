"""What one of two objects shows of its surface, where they may share a part only: local planes, and where it ends."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symrefine.align.pair import THIN, Side, sampled
from symrefine.detection.measure import SAMPLES
from symrefine.geometry import Array, Mask
from symrefine.propose.maps import PLANES
from symrefine.shape import Index
from symrefine.surface.cameras import cameras
from symrefine.surface.misses import disc_distances
from symrefine.surface.neighbourhoods import fills_volume
from symrefine.surface.openings import NEIGHBOURS, Openings, openings
from symrefine.surface.skin import LocalPlanes, Patches, Skin, drawn, make_skin
from symrefine.surface.tree import Tree, with_class

# A side with so many times the surface gets as many more local planes, up to a number.
COARSER, MOST_PLANES = 1.5, 6000
# One in so many local planes is moved by the polish.
MOVED = 2
# A patch is unseen if one in so many of the places where it begins is at a border. Of true maps at least one in four
# is: the two are cut by different planes, and each border is known by a few local planes only.
MOST = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """What one side shows of its surface, about the centre of its moments, in units of the target.

    Attributes:
        skin: its points without strays.
        weights: [N] by which local planes are drawn, so that they are even; None where the points are.
        cloud: local planes.
        near: [M, NEIGHBOURS] of the points near each of them, if they are known.
        views: [N, 3] where the points were seen from, if that is known.
        closed: whether nothing can be missing, as of a mesh.
    """

    skin: Skin
    weights: Array | None
    cloud: LocalPlanes
    near: Index | None
    views: Array | None
    closed: bool
    rng: np.random.Generator

    @classmethod
    def of(cls, side: Side, unit: float, seed: int, planes: int = PLANES) -> "Shown | None":
        """What so many local planes of a mesh or cloud show.

        None if its points fill a volume, or many share each place and none is near.
        """
        rng = np.random.default_rng(seed)
        shape, weights, solid = side.shape, None, False
        if side.is_mesh:
            shape = sampled(shape, SAMPLES, rng)
        else:
            seen = side.sampling
            shape, weights, solid = shape.chosen(seen.even), seen.shares, seen.solid
        local, normals, views = (shape.points - side.moments.center) / unit, shape.normals, shape.viewpoint
        skin = make_skin(local, rng, normals=normals, labels=shape.labels, thin=THIN)
        if solid and normals is None and fills_volume(local, skin.tree):
            return None
        cloud, near = _planes(skin, drawn(len(local), planes, rng, weights))
        if cloud.spacing == 0.0:
            return None
        views = None if views is None else (views - side.moments.center) / unit
        return cls(skin=skin, weights=weights, cloud=cloud, near=near, views=views, closed=side.is_mesh, rng=rng)

    def as_fine_as(self, spacing: float) -> "Shown":
        """The same with as many local planes as it takes to lie about so near to one another."""
        finer = (self.cloud.spacing / spacing) ** 2
        if finer < COARSER:
            return self
        count = min(round(finer * len(self.cloud.points)), MOST_PLANES)
        pick = drawn(len(self.skin.points), count, self.rng, self.weights)
        cloud, near = _planes(self.skin, pick)
        return replace(self, cloud=cloud, near=near)

    def scaled(self, factor: float) -> "Shown":
        """The same about the same centre, so many times as large."""
        skin = replace(self.skin, points=factor * self.skin.points, given=None)
        views = None if self.views is None else factor * self.views
        points = factor * self.cloud.points
        cloud = replace(
            self.cloud,
            points=points,
            thickness=factor * self.cloud.thickness,
            reach=factor * self.cloud.reach,
            spacing=factor * self.cloud.spacing,
            tree=Tree(with_class(points, self.cloud.labels)),
            eyes=None if self.cloud.eyes is None else factor * self.cloud.eyes,
        )
        return replace(self, skin=skin, cloud=cloud, views=views)

    @cached_property
    def moving(self) -> Patches:
        """Local planes that stand for all in the polish; of other points than those that judge, more maps come true."""
        pick = drawn(len(self.skin.points), len(self.cloud.points) // MOVED, self.rng, self.weights)
        return self.skin.patches(pick)

    @cached_property
    def openings(self) -> Openings:
        """Where the surface ends without a reason, and what saw it."""
        none = np.zeros(len(self.cloud.points), dtype=bool)
        eyes = () if self.views is None else cameras(self.skin.points, self.views)
        given = (self.cloud, self.skin.points, self.skin.tree, eyes, self.near)
        open_ = None if self.closed else openings(*given, least=0.0)
        return open_ or Openings(line=none, border=none, evident=False)

    def unseen(self, other: "Shown", moved: Array, away: Mask, margin: float) -> Mask:
        """Which of the local planes [M], moved to [M, 3] of the other side, lie where nobody looked; see `Openings`."""
        met = (other.cloud, other.openings)
        return self.openings.unseen(self.cloud, moved[None], away[None], 1, margin, met=met, most=MOST)[0]

    @cached_property
    def noise(self) -> Array:
        """Distances [M] of the local planes to the discs of all others: what sampling alone misses by."""
        return disc_distances(self.cloud, self.cloud.points, self.cloud.labels, skip_self=True)


def _planes(skin: Skin, pick: Index) -> tuple[LocalPlanes, Index | None]:
    """The local planes of some points, and what is near these: their borders are told from the same points."""
    near = skin.near(pick, NEIGHBOURS, scattered=True) if len(skin.points) >= NEIGHBOURS else None
    return skin.local_planes(pick, near=near), near
