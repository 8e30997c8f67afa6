"""Local planes of a cloud, and which of them a mirrored point meets."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from symrefine.geometry import Array, read_only
from symrefine.shape import Index

# Neighbourhood sizes tried, smallest first: large enough that noise does not decide the normal, no larger.
NEIGHBOURS = (12, 24, 48, 96, 192)
# Neighbourhoods wider than this (RMS radii) blur the shape itself, whatever the noise.
WIDEST = 0.2
# Thickness over width below which a neighbourhood counts as a plane.
FLAT = 0.3
# Median flatness of neighbourhoods up to WIDEST_BLOB wide, over that of a blob, from which on points fill a volume.
VOLUME = 0.8
# Probes at first, and the doubt that they leave.
PROBES = 60
UNCERTAIN = 0.08
WIDEST_BLOB = 0.5
# Classes stand so far apart along a fourth coordinate (RMS radii) that no query finds a point of another class first.
APART = 1e3


Body = Literal["surface", "atoms", "volume"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalPlanes:
    """Points projected on the planes fitted to their neighbours.

    Attributes:
        points: [M, 3] projected points.
        normals: [M, 3] unit normals, any sign.
        thickness: [M] standard deviation of the neighbours across the plane.
        flatness: [M] thickness over the smaller width: 0 for a plane, 1 for a blob.
        reach: [M] radius of the disc each local plane stands for: the distance to its fifth neighbour among these M.
        spacing: median distance from a point to the nearest other one of these M.
        redundancy: how many of the local planes each point of the cloud takes part in; >= 1.
        tree: kd-tree over `points`, with the class as a fourth coordinate where there are classes.
        body: what the points are: samples of a surface, atoms that stand for themselves, or samples of a volume.
        labels: [M] class of each point, which only meets points of its own class; None where all are of one.
    """

    points: Array
    normals: Array
    thickness: Array
    flatness: Array
    reach: Array
    spacing: float
    redundancy: float
    tree: Any
    body: Body = "surface"
    labels: Index | None = None

    def __post_init__(self) -> None:
        for name in ("points", "normals", "thickness", "flatness", "reach"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def isolated(self) -> bool:
        """Whether points meet points: there are no normals and no discs."""
        return self.body != "surface"

    def classes(self, chosen: Index | slice) -> Index | None:
        """Classes of some of the points."""
        return None if self.labels is None else self.labels[chosen]

    def nearest(self, queries: Array, classes: Index | None, **options: Any) -> tuple[Array, Index]:
        """Distances and indices of the points nearest to queries [Q, 3] of the given classes [Q], as the tree says."""
        return self.tree.query(_with_class(queries, classes), **options)


def _with_class(points: Array, classes: Index | None) -> Array:
    return points if classes is None else np.column_stack([points, APART * classes])


def smallest_eigenvectors(covariance: Array) -> tuple[Array, Array]:
    """Eigenvalues [N, 3] ascending, and the eigenvector [N, 3] of the smallest, of symmetric matrices [N, 3, 3]."""
    values, vectors = np.linalg.eigh(covariance)
    return np.clip(values, 0.0, None), vectors[:, :, 0]


def _fit(points: Array, neighbours: Index, normals: Array | None = None) -> tuple[Array, Array, Array]:
    """Means [M, 3], normals [M, 3] and variances [M, 3] (across first) of neighbourhoods [M, k]."""
    near = points[neighbours]
    mean = near.mean(axis=1)
    spread = near - mean[:, None]
    covariance = spread.transpose(0, 2, 1) @ spread / near.shape[1]
    values, fitted = smallest_eigenvectors(covariance)
    if normals is None:
        return mean, fitted, values
    across = np.clip(np.einsum("ni,nij,nj->n", normals, covariance, normals), 0.0, None)
    return mean, normals, np.column_stack([across, values[:, 1:]])


def choose_neighbours(points: Array, tree: Any, rng: np.random.Generator, *, probes: int = 120) -> int:
    """Smallest neighbourhood that looks like a plane, or the one that looks most like it: noise decides, no parameter.

    Flatness is compared with what a blob without any structure shows in a sample of the same size.
    """
    pick = rng.choice(len(points), min(probes, len(points)), replace=False)
    distance, near = tree.query(points[pick], k=min(NEIGHBOURS[-1], len(points) // 8 + 4, len(points)))
    widths = np.median(distance, axis=0)
    sizes = [k for k in NEIGHBOURS if k <= near.shape[1] and widths[k - 1] < WIDEST] or [
        min(NEIGHBOURS[0], near.shape[1])
    ]
    ratios = []
    for k in sizes:
        _, _, values = _fit(points, near[:, :k])
        ratios.append(float(np.median(_flatness(values))) / _blob_flatness(k))
        if ratios[-1] < FLAT:
            return k
    return next(k for k, ratio in zip(sizes, ratios, strict=True) if ratio <= 1.02 * min(ratios))


def _flatness(values: Array) -> Array:
    return np.sqrt(values[:, 0] / np.maximum(values[:, 1], 1e-300))


@lru_cache(maxsize=32)
def _blob_flatness(k: int) -> float:
    """Median flatness of k points of an isotropic Gaussian."""
    blob = np.random.default_rng(0).standard_normal((200, k, 3))
    values, _ = smallest_eigenvectors(blob.transpose(0, 2, 1) @ blob / k)
    return max(float(np.median(_flatness(values))), 1e-12)


def fills_volume(points: Array, tree: Any, rng: np.random.Generator) -> bool:
    """Whether points [N, 3] (RMS radius 1) fill a volume: at no width do neighbourhoods look flatter than a blob."""
    order = rng.permutation(len(points))
    first = _flattest(points, tree, order[:PROBES])
    if abs(first - VOLUME) > UNCERTAIN:
        return first > VOLUME
    return _flattest(points, tree, order[: 5 * PROBES]) > VOLUME


def _flattest(points: Array, tree: Any, pick: Index) -> float:
    """Smallest median flatness of neighbourhoods of some points, over that of a blob, at any size and width."""
    size, flattest = NEIGHBOURS[0], np.inf
    while size <= max(len(points) // 8, NEIGHBOURS[0]):
        distance, near = tree.query(points[pick], k=size)
        if float(np.median(distance[:, -1])) > WIDEST_BLOB:
            break
        _, _, values = _fit(points, near)
        flattest = min(flattest, float(np.median(_flatness(values))) / _blob_flatness(size))
        if flattest < VOLUME - UNCERTAIN:
            break
        size *= 2
    return flattest


def local_planes(
    points: Array,
    count: int,
    rng: np.random.Generator,
    *,
    normals: Array | None = None,
    labels: Index | None = None,
    weights: Array | None = None,
    exact: bool = False,
    tree: Any = None,
) -> LocalPlanes:
    """Local planes at `count` of the points [N, 3], from neighbourhoods among all of them.

    Args:
        normals: [N, 3] unit normals to use instead of fitted ones, any sign.
        labels: [N] classes; they do not matter to the fits.
        weights: [N] positive; a point is chosen in proportion to its own, so that an uneven density evens out.
        exact: points and normals are free of noise (samples of a mesh) and are taken as they are.
        tree: kd-tree over `points`, if there is one already.
    """
    from scipy.spatial import cKDTree

    chance = None if weights is None else weights / weights.sum()
    pick = np.sort(rng.choice(len(points), min(count, len(points)), replace=False, p=chance))
    chosen, redundancy = points[pick], 1.0
    thickness: Array = np.zeros(len(pick))
    flatness: Array = np.zeros(len(pick))
    if normals is not None and exact:
        n = normals[pick]
    else:
        tree = cKDTree(points, balanced_tree=False, compact_nodes=False) if tree is None else tree
        k = choose_neighbours(points, tree, rng)
        redundancy = max(1.0, k * len(pick) / len(points))
        _, near = tree.query(chosen, k=k, workers=-1)
        mean, n, values = _fit(points, near, None if normals is None else normals[pick])
        chosen = chosen - n * np.einsum("ij,ij->i", n, chosen - mean)[:, None]
        thickness, flatness = np.sqrt(values[:, 0]), _flatness(values)
    distance, _ = cKDTree(chosen).query(chosen, k=min(6, len(chosen)))
    classes = None if labels is None else labels[pick]
    return LocalPlanes(
        points=chosen,
        normals=n,
        thickness=thickness,
        flatness=flatness,
        reach=distance[:, -1],
        spacing=float(np.median(distance[:, 1])),
        redundancy=redundancy,
        tree=cKDTree(_with_class(chosen, classes)),
        labels=classes,
    )


def isolated_points(points: Array, labels: Index | None = None, *, body: Body = "atoms") -> LocalPlanes:
    """Points [M, 3] that meet points: few that stand for themselves ("atoms"), or samples of a "volume"."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=2)
    none = np.zeros(len(points))
    return LocalPlanes(
        points=points,
        normals=np.zeros_like(points),
        thickness=none,
        flatness=none,
        reach=none,
        spacing=float(np.median(distance[:, 1])),
        redundancy=1.0,
        tree=cKDTree(_with_class(points, labels)),
        body=body,
        labels=labels,
    )
