"""Local planes of a cloud, and which of them a mirrored point meets."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symrefine.geometry import Array, read_only
from symrefine.shape import Index

# Up to so many points of a cloud stand for themselves (atoms), not for a surface.
FEW = 250
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
class Planes:
    """Planes that stand for a surface, or points that stand for themselves.

    Attributes:
        points: [M, 3] a point of each plane.
        normals: [M, 3] unit normals, any sign; zero where points stand for themselves.
        thickness: [M] standard deviation of the neighbours across the plane.
        flatness: [M] thickness over the smaller width: 0 for a plane, 1 for a blob.
    """

    points: Array
    normals: Array
    thickness: Array
    flatness: Array

    def __post_init__(self) -> None:
        for name in ("points", "normals", "thickness", "flatness"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def chosen(self, index: Index | NDArray[np.bool_] | slice) -> "Planes":
        """Some of the planes."""
        return Planes(
            points=self.points[index],
            normals=self.normals[index],
            thickness=self.thickness[index],
            flatness=self.flatness[index],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalPlanes(Planes):
    """Points projected on the planes fitted to their neighbours.

    Attributes:
        reach: [M] radius of the disc each local plane stands for: the distance to its fifth neighbour among these M.
        spacing: median distance from a point to the nearest other one of these M.
        redundancy: how many of the local planes each point of the cloud takes part in; >= 1.
        tree: kd-tree over `points`, with the class as a fourth coordinate where there are classes.
        body: what the points are: samples of a surface, atoms that stand for themselves, or samples of a volume.
        labels: [M] class of each point, which only meets points of its own class; None where all are of one.
    """

    reach: Array
    spacing: float
    redundancy: float
    tree: Any
    body: Body = "surface"
    labels: Index | None = None

    def __post_init__(self) -> None:
        Planes.__post_init__(self)
        object.__setattr__(self, "reach", read_only(self.reach))

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

    def shared_by(self, _: int) -> float:
        """How many of the planes each point takes part in, whichever of them are met."""
        return self.redundancy

    def met_by(self, queries: Array) -> tuple[Array, Planes]:
        """Distance [Q] from each query [Q, 3] to the nearest of the planes, and these."""
        distance, near = self.nearest(queries, None)
        return distance, self.chosen(near)


@dataclass(frozen=True, kw_only=True, eq=False)
class Skin:
    """A surface known by points [N, 3] that are too many to fit planes to all of them: planes are fitted where met.

    Attributes:
        points: [N, 3].
        normals: [N, 3] unit normals that are known, any sign, or None.
        neighbours: points to a plane; 1 where points and normals are exact.
        given: kd-tree over `points`, if there is one already.
    """

    points: Array
    normals: Array | None
    neighbours: int
    given: Any = None

    @property
    def isolated(self) -> bool:
        """Whether points meet points."""
        return False

    @cached_property
    def tree(self) -> Any:
        """kd-tree over `points`."""
        return _tree(self.points) if self.given is None else self.given

    @cached_property
    def spacing(self) -> float:
        """Median distance from a point to the nearest other one."""
        some = self.points[:: max(1, len(self.points) // PROBES)]
        return float(np.median(self.tree.query(some, k=[2])[0]))

    def met_by(self, queries: Array) -> tuple[Array, Planes]:
        """Distance [Q] from each query [Q, 3] to the nearest point, and the planes of the points around the queries."""
        distance, near = self.tree.query(queries, k=[*range(1, self.neighbours + 1)])
        return distance[:, 0], self._planes(near)

    def shared_by(self, count: int) -> float:
        """How many of the planes at `count` of the points each point takes part in; at least 1."""
        return max(1.0, self.neighbours * count / len(self.points)) if self.neighbours > 1 else 1.0

    def denoised(self, pick: Index) -> Planes:
        """Some of the points, each moved onto the plane of its neighbours, and these planes."""
        if self.neighbours == 1:
            return self._planes(pick[:, None])
        points = self.points[pick]
        _, near = self.tree.query(points, k=self.neighbours, workers=-1)
        fitted = self._planes(near)
        across = np.einsum("ij,ij->i", fitted.normals, points - fitted.points)
        return replace(fitted, points=points - fitted.normals * across[:, None])

    def _planes(self, near: Index) -> Planes:
        normals = None if self.normals is None else self.normals[near[:, 0]]
        if self.neighbours == 1 and normals is not None:
            none = np.zeros(len(near))
            return Planes(points=self.points[near[:, 0]], normals=normals, thickness=none, flatness=none)
        mean, normals, values = _fit(self.points, near, normals)
        return Planes(points=mean, normals=normals, thickness=np.sqrt(values[:, 0]), flatness=_flatness(values))

    def local_planes(self, pick: Index, labels: Index | None = None) -> LocalPlanes:
        """The planes of some of the points as a surface of their own; `labels` [N] are the classes of all points."""
        from scipy.spatial import cKDTree

        planes = self.denoised(pick)
        distance, _ = cKDTree(planes.points).query(planes.points, k=min(6, len(pick)))
        classes = None if labels is None else labels[pick]
        return LocalPlanes(
            points=planes.points,
            normals=planes.normals,
            thickness=planes.thickness,
            flatness=planes.flatness,
            reach=distance[:, -1],
            spacing=float(np.median(distance[:, 1])),
            redundancy=self.shared_by(len(pick)),
            tree=cKDTree(_with_class(planes.points, classes)),
            labels=classes,
        )


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


def choose_neighbours(
    points: Array, tree: Any, rng: np.random.Generator, *, probes: int = 120, thin: float = 0.0
) -> int:
    """Smallest neighbourhood that looks like a plane, or the one that looks most like it: noise decides, no parameter.

    Flatness is compared with what a blob without any structure shows in a sample of the same size. Noise makes all
    neighbourhoods thick, thin sheets and edges only some: with `thin`, the smallest will do as soon as a quarter of
    them is flatter than that.
    """
    pick = rng.choice(len(points), min(probes, len(points)), replace=False)
    most = min(NEIGHBOURS[-1], len(points) // 8 + 4, len(points))
    ratios: dict[int, float] = {}
    for k in NEIGHBOURS:
        if k > most:
            break
        distance, near = tree.query(points[pick], k=k)
        if float(np.median(distance[:, -1])) >= WIDEST:
            break
        _, _, values = _fit(points, near)
        flatness = _flatness(values)
        ratios[k] = float(np.median(flatness)) / _blob_flatness(k)
        if ratios[k] < FLAT or (len(ratios) == 1 and float(np.quantile(flatness, 0.25)) < thin):
            return k
    least = min(ratios.values(), default=0.0)
    return next((k for k, ratio in ratios.items() if ratio <= 1.02 * least), min(NEIGHBOURS[0], most))


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
    chance = None if weights is None else weights / weights.sum()
    pick = drawn(len(points), count, rng, chance)
    return make_skin(points, rng, normals=normals, exact=exact, tree=tree).local_planes(pick, labels)


def drawn(size: int, count: int, rng: np.random.Generator, chance: Array | None = None) -> Index:
    """Indices, ascending, of `count` points of `size`, or of all; each is drawn with its chance [size]."""
    return np.sort(rng.choice(size, min(count, size), replace=False, p=chance))


def make_skin(
    points: Array,
    rng: np.random.Generator,
    *,
    normals: Array | None = None,
    exact: bool = False,
    thin: float = 0.0,
    tree: Any = None,
) -> Skin:
    """The skin of points [N, 3], with neighbourhoods as large as their noise asks for.

    Arguments as those of `local_planes` and `choose_neighbours`.
    """
    if exact and normals is not None:
        return Skin(points=points, normals=normals, neighbours=1, given=tree)
    tree = _tree(points) if tree is None else tree
    size = choose_neighbours(points, tree, rng, thin=thin)
    return Skin(points=points, normals=normals, neighbours=size, given=tree)


def _tree(points: Array) -> Any:
    from scipy.spatial import cKDTree

    return cKDTree(points, balanced_tree=False, compact_nodes=False)


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
