"""How large the neighbourhoods of a cloud are, and the planes that fit them."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from symrefine.geometry import Array, Mask, rows
from symrefine.groups.standard import GOLDEN
from symrefine.rounding import SINGLE
from symrefine.samples import GLANCE, LOOK
from symrefine.shape import Index
from symrefine.surface.tree import Tree

# Neighbourhood sizes tried, smallest first: large enough that noise does not decide the normal, no larger.
NEIGHBOURS = (12, 24, 48, 96, 192)
# Neighbourhoods wider than this (RMS radii) blur the shape itself, whatever the noise.
WIDEST = 0.2
# Thickness over width, or over length, below which neighbourhoods count as planes; where noise may make them thick,
# over that of a blob.
FLAT = 0.3
# Width over length below which neighbourhoods are of wires.
WIRE = 0.2
# Median flatness of neighbourhoods up to WIDEST_BLOB wide (RMS radii), over that of a blob, from which on points fill a
# volume; the median thickness of large parts of a clump, over that of a ball.
VOLUME = 0.8
WIDEST_BLOB = 0.5
# Cells that larger neighbourhoods are put together from: with half as many, the rims alone add a tenth to the noise.
CELLS = NEIGHBOURS[2]


def smallest_eigenvectors(covariance: Array) -> tuple[Array, Array]:
    """Eigenvalues [N, d] ascending, and the eigenvector [N, d] of the smallest, of covariance matrices [N, d, d].

    In space in closed form (Smith, 1961), seven times as fast as `eigh`: values are the projections of an equilateral
    triangle onto a line, right to what rounds the largest; the vector lies across the rows of what is left without its
    value. Where the smallest two values are the same no two of the rows tell it, and `eigh` does.
    """
    if covariance.shape[1] != 3:
        values, vectors = np.linalg.eigh(covariance)
        return np.clip(values, 0.0, None), vectors[:, :, 0]
    xx, yy, zz, xy, xz, yz = (covariance[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    middle = (xx + yy + zz) / 3.0
    a, b, c = xx - middle, yy - middle, zz - middle
    variance = (a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
    radius = np.sqrt(variance)
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    cosine = determinant / np.maximum(2.0 * variance * radius, 1e-300)
    turned = np.arccos(np.clip(cosine, -1.0, 1.0)) / 3.0
    along, across = radius * np.cos(turned), math.sqrt(0.75) * radius * np.sin(turned)
    values = np.array([middle - along - 2.0 * across, middle - along + 2.0 * across, middle + 2.0 * along])
    a, b, c = xx - values[0], yy - values[0], zz - values[0]
    # What is left is of rank two: its adjugate is v v' but for a factor, and the longest of its rows the surest.
    rest = np.array([yz * xz - xy * c, xy * yz - b * xz, xy * xz - a * yz])
    own = np.array([b * c - yz * yz, a * c - xz * xz, a * b - xy * xy])
    adjugate = np.array([[own[0], rest[0], rest[1]], [rest[0], own[1], rest[2]], [rest[1], rest[2], own[2]]])
    best = np.abs(own).argmax(axis=0)
    vectors = np.take_along_axis(adjugate, best[None, None], axis=0)[0].T
    length = np.linalg.norm(vectors, axis=1)
    double = length <= SINGLE * variance
    vectors /= np.maximum(length, 1e-300)[:, None]
    if double.any():
        vectors[double] = np.linalg.eigh(covariance[double])[1][:, :, 0]
    return np.clip(values.T, 0.0, None), vectors


def sums_of(points: Array) -> Array:
    """What plane fits need of points [N, d]: 1, x and each product of two coordinates, [N, 1 + d + d (d + 1) / 2]."""
    dim, columns = points.shape[1], np.ascontiguousarray(points.T)
    pairs = list(combinations_with_replacement(range(dim), 2))
    sums = np.empty((len(points), 1 + dim + len(pairs)))
    sums[:, 0], sums[:, 1 : 1 + dim] = 1.0, points
    for k, (i, j) in enumerate(pairs, start=1 + dim):
        np.multiply(columns[i], columns[j], out=sums[:, k])
    return sums


def _added(sums: Array, members: Index) -> Array:
    """Rows of sums [N, .] added up over groups of members [M, k].

    Raises:
        IndexError: a member that there is not, such as the neighbour that a tree says is missing.
    """
    if members.size and members.max() >= len(sums):
        raise IndexError(f"member {members.max()} of {len(sums)}")
    total = rows(sums, members[:, 0])
    each = np.empty_like(total)
    for member in members.T[1:]:
        total += np.take(sums, member, axis=0, out=each, mode="clip")  # "raise" would buffer them
    return total


def in_cells(values: Array, points: Array, count: int, rng: np.random.Generator) -> tuple[Tree, Array]:
    """Points [N, d] taken together around `count` of them: a kd-tree over these, and sums [count, k] of values [N, k].

    Of points that are fewer than `count` each is a cell, and the rest are empty.
    """
    cells = Tree(points[rng.permutation(len(points))[:count]])
    own = cells.nearest(points)[1]
    return cells, np.stack([np.bincount(own, weights=column, minlength=count) for column in values.T], axis=1)


def spreads_of(sums: Array) -> tuple[Array, Array]:
    """Means [M, d] and covariances [M, d, d] of neighbourhoods, from their sums [M, 1 + d + d (d + 1) / 2]."""
    dim = (math.isqrt(8 * sums.shape[1] + 1) - 3) // 2
    averages = sums[:, 1:].T / sums[:, 0]
    mean, squares = averages[:dim], averages[dim:]
    covariance = np.empty((dim, dim, len(sums)))
    for k, (i, j) in enumerate(combinations_with_replacement(range(dim), 2)):
        covariance[i, j] = covariance[j, i] = squares[k] - mean[i] * mean[j]
    return np.ascontiguousarray(mean.T), covariance.transpose(2, 0, 1)


def fit_planes(sums: Array, normals: Array | None = None) -> tuple[Array, Array, Array]:
    """Means, normals and variances (across first), all [M, d], of neighbourhoods, from the sums of these.

    With `normals` [M, d] these are taken, and the first variance is that along them.
    """
    mean, covariance = spreads_of(sums)
    values, fitted = smallest_eigenvectors(covariance)
    if normals is None:
        return mean, fitted, values
    across = np.clip(np.einsum("ni,nij,nj->n", normals, covariance, normals), 0.0, None)
    return mean, normals, np.column_stack([across, values[:, 1:]])


def are_wires(variances: Array) -> Mask:
    """Which neighbourhoods are much narrower than long, from their variances [M, 3] (across first)."""
    return np.asarray(variances[:, 1] <= WIRE**2 * variances[:, 2])


def across_wires(sums: Array) -> Array:
    """Unit normals [M, 3] of wires from the sums of neighbourhoods: one of all ways across each, evenly.

    All along a flat curve its narrowest way across is the same, and tells nothing of where in its plane the curve is.
    """
    axes = np.linalg.eigh(spreads_of(sums)[1])[1]
    turns = math.pi * GOLDEN * np.arange(len(sums))[:, None]
    return np.asarray(np.cos(turns) * axes[:, :, 0] + np.sin(turns) * axes[:, :, 1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Neighbourhoods:
    """Neighbourhoods of `size` points each, put together from `count` cells: the points themselves, or groups of them.

    The sums of a large neighbourhood are those of a few cells, so that it costs no more than a small one.

    Attributes:
        tree: kd-tree over the middles of the cells.
        sums: of each cell: number, coordinates and their products; see `sums_of`.
        count: cells to a neighbourhood.
    """

    tree: Tree
    sums: Array
    count: int

    @classmethod
    def of(cls, points: Array, tree: Tree, size: int) -> "Neighbourhoods":
        """Neighbourhoods of about `size` of the points [N, d], of which `tree` is the kd-tree."""
        if size <= CELLS:
            return cls(tree=tree, sums=sums_of(points), count=size)
        count = max(CELLS, len(points) * CELLS // size)
        cells, sums = in_cells(sums_of(points), points, count, np.random.default_rng(0))
        return cls(tree=cells, sums=sums, count=CELLS)

    def around(self, points: Array, near: Index | None = None) -> Array:
        """Sums [M, .] of the neighbourhoods of points [M, d]; `near` [M, .] are the cells near them, if known."""
        near = self.tree.query(points, self.count)[1] if near is None else near[:, : self.count]
        return _added(self.sums, near)


def connected_parts(one: Index, other: Index, count: int) -> Index:
    """Number of the part that each of `count` nodes belongs to, from pairs of linked ones, [E] and [E].

    Every node learns of the first node that links lead to, and from that node what it has learnt meanwhile.
    """
    first = np.arange(count)
    while (apart := first[one] != first[other]).any():
        one, other = one[apart], other[apart]
        a, b = first[one], first[other]
        np.minimum.at(first, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(beyond := first[first], first):
            first = beyond
    return np.asarray((np.cumsum(first == np.arange(count)) - 1)[first])


def renumbered(chosen: Index, count: int) -> tuple[Index, Index]:
    """Which of `count` indices are chosen, ascending, and the place among them of each that is, of any shape.

    As `numpy.unique` tells with the inverse, ten times as fast.
    """
    is_chosen = np.zeros(count, dtype=bool)
    is_chosen[chosen] = True
    return np.flatnonzero(is_chosen), (np.cumsum(is_chosen) - 1)[chosen]


def choose_neighbours(points: Array, tree: Tree, rng: np.random.Generator, *, thin: float = 0.0) -> int:
    """Smallest neighbourhood that looks like a plane, or the one that looks most like it: noise decides, no parameter.

    Flatness is compared with what a blob without any structure shows in a sample of the same size. Noise makes all
    neighbourhoods thick, thin sheets and edges only some: with `thin`, the smallest will do as soon as a quarter of
    them is flatter than that.
    """
    pick = rng.choice(len(points), min(GLANCE, len(points)), replace=False)
    most = min(NEIGHBOURS[-1], len(points) // 8 + 4, len(points))
    ratios: dict[int, float] = {}
    for k in NEIGHBOURS:
        if k > most:
            break
        distance, near = tree.query(points[pick], k)
        if float(np.median(distance[:, -1])) >= WIDEST:
            break
        values = planes_of(points, near)[2]
        flatness = flatness_of(values)
        ratios[k] = float(np.median(flatness)) / _blob_flatness(k)
        if ratios[k] < FLAT or (len(ratios) == 1 and float(np.quantile(flatness, 0.25)) < thin):
            return k
    least = min(ratios.values(), default=0.0)
    return next((k for k, ratio in ratios.items() if ratio <= 1.02 * least), min(NEIGHBOURS[0], most))


def planes_of(points: Array, near: Index) -> tuple[Array, Array, Array]:
    """Means, normals and variances (across first), all [M, 3], of neighbourhoods [M, k] of points [N, 3]."""
    members, own = renumbered(near, len(points)) if near.size < len(points) else (slice(None), near)
    return fit_planes(_added(sums_of(rows(points, members)), own))


def thickness_of(variances: Array) -> Array:
    """Thickness over length [M] of neighbourhoods from their variances [M, 3] in ascending order."""
    return np.sqrt(variances[:, 0] / np.maximum(variances[:, 2], 1e-300))


@lru_cache(maxsize=32)
def ball_thickness(k: int) -> float:
    """Median thickness over length of k points at random in a ball."""
    rng = np.random.default_rng(0)
    ball = rng.standard_normal((400, k, 3))
    ball *= rng.random((400, k, 1)) ** (1.0 / 3.0) / np.linalg.norm(ball, axis=2, keepdims=True)
    values = planes_of(ball.reshape(-1, 3), np.arange(400 * k).reshape(400, k))[2]
    return float(np.median(thickness_of(values)))


def flatness_of(values: Array) -> Array:
    """Thickness over the smaller width [M] from variances [M, 3] in ascending order: 0 for a plane, 1 for a blob."""
    return np.sqrt(values[:, 0] / np.maximum(values[:, 1], 1e-300))


@lru_cache(maxsize=32)
def _blob_flatness(k: int) -> float:
    """Median flatness of k points of an isotropic Gaussian."""
    blob = np.random.default_rng(0).standard_normal((200, k, 3))
    values, _ = smallest_eigenvectors(blob.transpose(0, 2, 1) @ blob / k)
    return max(float(np.median(flatness_of(values))), 1e-12)


def fills_volume(points: Array, tree: Tree) -> bool:
    """Whether points [N, 3] fill a volume: at no width do neighbourhoods look flatter than blobs."""
    pick, size = np.random.default_rng(0).permutation(len(points))[:LOOK], NEIGHBOURS[0]
    most = WIDEST_BLOB * float(np.sqrt(points.var(axis=0).sum()))
    while size <= max(len(points) // 8, NEIGHBOURS[0]):
        distance, near = tree.query(points[pick], size)
        if float(np.median(distance[:, -1])) > most:
            break
        if float(np.median(flatness_of(planes_of(points, near)[2]))) <= VOLUME * _blob_flatness(size):
            return False
        size *= 2
    return True
