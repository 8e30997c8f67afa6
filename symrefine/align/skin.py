"""A surface known by its points: for any query near it, the plane that the points around the query lie on."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symrefine.geometry import Array, read_only
from symrefine.surface.skin import NEIGHBOURS, LocalPlanes, choose_neighbours, isolated_points, smallest_eigenvectors

# Points that settle how large a neighbourhood is.
PROBES = 80
# Lower quartile of the flatness below which the smallest neighbourhood will do without a look at larger ones: noise
# makes all of them thick (0.17 and more at 0.2 % of the diagonal), thin sheets and edges only some (0.13 at most).
AT_ONCE = 0.15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planes:
    """Planes near some queries.

    Attributes:
        points: [Q, 3] a point of each plane.
        normals: [Q, 3] unit normals, any sign; zero where the points stand for themselves.
        thickness: [Q] standard deviation of the neighbours across the plane.
        flatness: [Q] thickness over the smaller width of the neighbourhood: 0 for a plane, 1 for a blob.
        distance: [Q] from the query to the nearest point.
    """

    points: Array
    normals: Array
    thickness: Array
    flatness: Array
    distance: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skin:
    """Points of one object, in units of its alignment, with the size of the neighbourhoods that make planes of them.

    Attributes:
        points: [N, 3].
        normals: [N, 3] unit normals that are known, any sign, or None.
        neighbours: points to a plane; 1 where points and normals are exact, or where points stand for themselves.
        width: median radius of the neighbourhoods, of two points at least.
        tree: kd-tree over `points`.
        isolated: the points stand for themselves (atoms): there are no planes.
    """

    points: Array
    normals: Array | None
    neighbours: int
    width: float
    tree: Any
    isolated: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    @property
    def is_noisy(self) -> bool:
        """Whether the smallest neighbourhood is not enough, so that more planes mean less noise."""
        return self.neighbours > NEIGHBOURS[0]

    def redundancy(self, count: int) -> float:
        """How many of the planes at `count` of the points each point takes part in; at least 1."""
        return max(1.0, self.neighbours * count / len(self.points))

    def near(self, queries: Array) -> Planes:
        """The plane nearest to each query [Q, 3]."""
        distance, near = self.tree.query(queries, k=[*range(1, self.neighbours + 1)])
        first, mean, known = near[:, 0], self.points[near[:, 0]], self.normals
        if self.neighbours == 1:
            normals, values = np.zeros_like(mean) if known is None else known[first], np.zeros_like(mean)
        else:
            around = self.points[near]
            mean = around.mean(axis=1)
            around = around - mean[:, None]
            covariance = around.transpose(0, 2, 1) @ around / self.neighbours
            values, normals = smallest_eigenvectors(covariance)
            if known is not None:
                normals = known[first]
                values[:, 0] = np.einsum("ni,nij,nj->n", normals, covariance, normals)
        thickness = np.sqrt(values[:, 0])
        return Planes(
            points=mean,
            normals=normals,
            thickness=thickness,
            flatness=thickness / np.sqrt(np.maximum(values[:, 1], 1e-300)),
            distance=distance[:, 0],
        )


def denoised(skin: Skin, count: int, rng: np.random.Generator) -> tuple[Array, Planes]:
    """`count` points of a skin [S, 3], each moved onto the plane of its neighbours, and these planes."""
    pick = np.sort(rng.choice(len(skin.points), min(count, len(skin.points)), replace=False))
    points = skin.points[pick]
    planes = skin.near(points)
    across = np.einsum("ij,ij->i", planes.normals, points - planes.points)
    return points - planes.normals * across[:, None], planes


def patches(skin: Skin, count: int, rng: np.random.Generator) -> LocalPlanes:
    """Local planes at `count` points of a skin, with the discs that they stand for; atoms as they are."""
    from scipy.spatial import cKDTree

    if skin.isolated:
        return isolated_points(skin.points)
    points, planes = denoised(skin, count, rng)
    tree = cKDTree(points)
    distance, _ = tree.query(points, k=min(6, len(points)))
    return LocalPlanes(
        points=points,
        normals=planes.normals,
        thickness=planes.thickness,
        flatness=planes.flatness,
        reach=distance[:, -1],
        spacing=float(np.median(distance[:, 1])),
        redundancy=skin.redundancy(len(points)),
        tree=tree,
    )


def skin(points: Array, normals: Array | None, rng: np.random.Generator, *, exact: bool) -> Skin:
    """The skin that points [N, 3] make: neighbourhoods as large as their noise asks for.

    Args:
        points: about their centre, RMS radius about 1.
        normals: [N, 3] known unit normals, any sign, or None.
        rng: picks the points that settle the size.
        exact: points and normals are free of noise (samples of a mesh).
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    least = 1 if exact else min(NEIGHBOURS[0], len(points))
    smallest = Skin(points=points, normals=normals, neighbours=least, width=_width(points, tree, least), tree=tree)
    if exact or float(np.quantile(smallest.near(_some(points)).flatness, 0.25)) < AT_ONCE:
        return smallest
    size = choose_neighbours(points, tree, rng, probes=PROBES)
    return replace(smallest, neighbours=size, width=_width(points, tree, size))


def _some(points: Array) -> Array:
    return points[:: max(1, len(points) // PROBES)]


def _width(points: Array, tree: Any, neighbours: int) -> float:
    """Median distance to the farthest of the neighbours, or to the nearest other point if there is but one."""
    return float(np.median(tree.query(_some(points), k=[max(neighbours, 2)])[0]))


def skin_of(planes: LocalPlanes) -> Skin:
    """The surface that local planes make, coarse and quick: each stands for its surroundings as it is."""
    return Skin(
        points=planes.points,
        normals=None if planes.isolated else planes.normals,
        neighbours=1,
        width=planes.spacing,
        tree=planes.tree,
        isolated=planes.isolated,
    )


def isolated(points: Array) -> Skin:
    """A small set of points [N, 3] that stand for themselves."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    width = _width(points, tree, 1)
    return Skin(points=points, normals=None, neighbours=1, width=width, tree=tree, isolated=True)
