"""Geometric moments of weighted points, of any order in any dimension.

Notation: `m_p = sum_i w_i prod_j x_ij^p_j` (paper, eq. MomentsNDdiscrete); `mu` central; normalised moments have
mass 1 and RMS radius 1, so every quantity made of them is dimensionless and comparable across objects.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations_with_replacement, pairwise, product
from math import comb, factorial, prod

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import DegenerateShapeError
from symrefine.geometry import Array, ReadOnly, rows
from symrefine.moments.quadrature import mesh_nodes, triangle_areas_and_normals
from symrefine.rounding import DOUBLE, SINGLE
from symrefine.shape import Shape

# Points per block: the monomials of a block stay in the L2 cache (method.md, section 1: a factor of ten).
BLOCK = 2048
# Waves, about a radian to a diagonal, that the edges of a solid's surface are tested with.
WAVES = 6
# Parts of the jackknife that tells by how much moments of a sample are off.
PARTS = 16


def exponents_of(dim: int, degree: int) -> list[tuple[int, ...]]:
    """Exponent vectors of dim coordinates and this total degree, x_1 first: 20, 11, 02."""
    return [tuple(map(c.count, range(dim))) for c in combinations_with_replacement(range(dim), degree)]


@lru_cache(maxsize=64)
def exponents(dim: int, order: int) -> NDArray[np.int64]:
    """Exponent vectors [K, dim] of total degree <= `order`, by degree, then x_1 first."""
    array = np.array([e for degree in range(order + 1) for e in exponents_of(dim, degree)], dtype=np.int64)
    array.flags.writeable = False
    return array


def occurrences(exponent: tuple[int, ...]) -> int:
    """How often an entry with these exponents stands in a symmetric tensor."""
    return factorial(sum(exponent)) // prod(factorial(k) for k in exponent)


@lru_cache(maxsize=64)
def tensor_index(dim: int, degree: int, order: int) -> NDArray[np.int64]:
    """Where each entry of the symmetric tensor T_degree [dim]*degree stands among `exponents(dim, order)`."""
    position = {tuple(e): i for i, e in enumerate(exponents(dim, order).tolist())}
    flat = [position[tuple(map(entry.count, range(dim)))] for entry in product(range(dim), repeat=degree)]
    return np.array(flat).reshape((dim,) * degree)


@lru_cache(maxsize=64)
def _split(dim: int, order: int) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Each exponent as a product of one monomial in the leading and one in the trailing coordinates."""
    lead = dim - dim // 2
    position_a = {tuple(e): i for i, e in enumerate(exponents(lead, order).tolist())}
    position_b = {tuple(e): i for i, e in enumerate(exponents(dim - lead, order).tolist())}
    table = exponents(dim, order)
    a = np.array([position_a[tuple(e)] for e in table[:, :lead].tolist()])
    b = np.array([position_b[tuple(e)] for e in table[:, lead:].tolist()])
    return a, b, lead


@lru_cache(maxsize=64)
def _ladder(dim: int, order: int) -> list[tuple[int, slice, slice]]:
    """Runs of monomials that are one coordinate times a run of the degree before: the coordinate, the run, that run.

    Of degree d those with x_1 are x_1 times all of degree d - 1; of the others those with x_2 are x_2 times the last of
    degree d - 1, which are without x_1 themselves; and so on.
    """
    steps = []
    start, before = 1, [0] * dim  # where those of this degree begin; and of the last degree those without x_1 .. x_axis
    for _ in range(order):
        end = start
        firsts = []
        for axis, first in enumerate(before):
            firsts.append(end)
            end += start - first
            steps.append((axis, slice(firsts[-1], end), slice(first, start)))
        start, before = end, firsts
    return steps


def monomials(points: Array, order: int, out: Array | None = None, *, times: float | Array = 1.0) -> Array:
    """All monomials of degree <= `order` at points [N, n], `times` a factor [N], as rows [K, N]: of `out` if given."""
    columns = np.ascontiguousarray(points.T)
    if out is None:
        out = np.empty((len(exponents(points.shape[1], order)), len(points)))
    out[0] = times
    for axis, run, before in _ladder(points.shape[1], order):
        np.multiply(out[before], columns[axis], out=out[run])
    return out


def raw_moments(points: Array, weights: Array, order: int) -> Array:
    """Raw moments [K] of points [N, n] with weights [N], in the order of `exponents(n, order)`."""
    return raw_moments_of_parts(points, weights, order, [0, len(points)])[0]


def raw_moments_of_parts(points: Array, weights: Array, order: int, ends: Sequence[int]) -> Array:
    """Raw moments [P, K] of points [N, n] part by part: `ends` [P + 1] tells where each begins, and the end."""
    a, b, lead = _split(points.shape[1], order)
    totals = np.zeros((len(ends) - 1, a.max() + 1, b.max() + 1))
    # One place for all blocks: memory that is asked for anew comes page by page, which takes longer than the sums.
    room = [np.empty((min(BLOCK, len(points)), count)) for count in totals.shape[1:]]
    for pieces in _blocks(ends):
        start, end = pieces[0][1].start, pieces[-1][1].stop
        block, (left, right) = points[start:end], (whole[: end - start].reshape(-1, end - start) for whole in room)
        left = monomials(block[:, :lead], order, left, times=weights[start:end])
        right = monomials(block[:, lead:], order, right)
        for part, piece in pieces:
            own = slice(piece.start - start, piece.stop - start)
            totals[part] += left[:, own] @ right[:, own].T
    return totals[:, a, b]


def _blocks(ends: Sequence[int]) -> Iterator[list[tuple[int, slice]]]:
    """Pieces of at most a block of points, each with its part, as many together as a block has room for."""
    block: list[tuple[int, slice]] = []
    for part, (begin, end) in enumerate(pairwise(ends)):
        for start in range(begin, end, BLOCK):
            piece = slice(start, min(start + BLOCK, end))
            if block and piece.stop - block[0][1].start > BLOCK:
                yield block
                block = []
            block.append((part, piece))
    if block:
        yield block


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments(ReadOnly):
    """Central normalised moments, with the frame that undoes the normalisation.

    Attributes:
        values: [K] moments of `(x - center) / scale` with mass 1, in the order of `exponents(dim, order)`.
        replicates: [B, K] the same with one of B random parts left out in turn (delete-a-group jackknife), in the
            frame of the whole; empty [0, K] where the moments are exact.
        center: [n] weighted mean, input units.
        scale: RMS radius about the centre, input units.
    """

    dim: int
    order: int
    values: Array
    replicates: Array
    center: Array
    scale: float

    def normalised(self, points: Array) -> Array:
        """Points [..., n] of the input in the frame of the moments."""
        return (points - self.center) / self.scale

    def restored(self, points: Array) -> Array:
        """The way back."""
        return self.center + self.scale * points

    def tensor(self, degree: int) -> Array:
        """Symmetric moment tensor T_degree, shape [n]*degree."""
        return self.values[tensor_index(self.dim, degree, self.order)]

    @property
    def covariance(self) -> Array:
        """Second central moments [n, n] in normalised units (trace 1)."""
        return self.tensor(2)


def central_moments(points: Array, weights: Array, order: int, *, parts: int = 0) -> Moments:
    """Normalised central moments to `order`, with `parts` jackknife replicates for their sampling noise.

    Args:
        points: [N, n]; the magnitude of the coordinates does not matter (the mean is removed first).
        weights: [N], sum not zero.
        order: highest total degree.
        parts: number of interleaved parts to leave out in turn; 0 for exact nodes.

    Raises:
        DegenerateShapeError: the points do not spread about their mean, or one has all the weight.
    """
    # By a power of two, which changes no digit: products of large weights and large squares would overflow.
    weights = np.ldexp(weights, -int(np.frexp(weights.max())[1]))
    shift = points[len(points) // 2]
    local, mass = points - shift, weights.sum()
    mean = weights @ local / mass
    local -= mean
    scale = float(np.sqrt(weights @ np.einsum("ij,ij->i", local, local) / mass))
    if not scale > 0:
        raise DegenerateShapeError(
            "the points do not spread about their mean; a shape needs at least two distinct points"
        )
    if mass - weights.max() < DOUBLE * mass:
        raise DegenerateShapeError(
            f"point {weights.argmax()} weighs more than {1.0 / DOUBLE:g} times as much as all others together; a shape "
            "needs at least two points that count"
        )
    local /= scale
    w = weights / mass
    replicates: Array = np.empty((0, len(exponents(points.shape[1], order))))
    if parts:
        values, replicates = _jackknife(local, w, order, parts)
    else:
        values = raw_moments(local, w, order)
    return Moments(
        dim=points.shape[1], order=order, values=values, replicates=replicates, center=shift + mean, scale=scale
    )


def deviations(replicates: Array) -> Array:
    """Jackknife replicates [B, ...] less their mean, scaled so that their squares add up to variances.

    Delete-a-group jackknife (Kott 2001) of B parts; B - 1 degrees of freedom, none of them where B = 0.
    """
    parts = len(replicates)
    return np.asarray(np.sqrt((parts - 1) / parts) * (replicates - replicates.mean(axis=0))) if parts else replicates


def shape_moments(shape: Shape, order: int, *, parts: int = 0) -> Moments:
    """Normalised central moments of a shape: exact for a mesh, with `parts` jackknife replicates for a cloud.

    Raises:
        DegenerateShapeError: no area, no volume, or no spread.
    """
    if shape.faces is None:
        return central_moments(shape.points, shape.masses, order, parts=parts)
    nodes, weights = mesh_nodes(shape, order)
    if shape.measure == "solid":
        return _solid_moments(nodes, weights, shape, order)
    inner = central_moments(nodes, weights, order)
    return replace(inner, center=inner.center + shape.points[0])


def _solid_moments(nodes: Array, weights: Array, shape: Shape, order: int) -> Moments:
    degree = exponents(3, order).sum(axis=1)
    raw = raw_moments(nodes, weights, order) / (degree + 3)
    if not abs(raw[0]) > 1e-12 * shape.diagonal**3:
        raise DegenerateShapeError(f"{shape.source}: the mesh encloses no volume; use the surface measure")
    if not _closed(shape):
        raise DegenerateShapeError(
            f"{shape.source}: the mesh is not a closed, consistently oriented surface, so it has no solid; "
            "use the surface measure"
        )
    values = recentred(raw / raw[0], 3, order)
    spread = values[tensor_index(3, 2, order)].trace()
    if not spread > 0:
        raise DegenerateShapeError(f"{shape.source}: the mesh overlaps itself; use the surface measure")
    scale = float(np.sqrt(spread))
    return Moments(
        dim=3,
        order=order,
        values=values / scale**degree,
        replicates=np.empty((0, len(values))),
        center=shape.points[0] + raw[1:4] / raw[0],
        scale=scale,
    )


def _closed(shape: Shape) -> bool:
    """Whether the surface is closed and consistently oriented: whether its directed edges cancel.

    They do if `int G.dl` over all of them vanishes for every field G (Stokes). A few plane waves of random direction
    see whatever is left, and unlike a count of edges let pass what meets along an edge without sharing its vertices.
    By Stokes `|int G.dl| <= |k| |G| A` where a surface of area A is missing, and twice that where it is turned round.
    """
    assert shape.faces is not None
    areas, _ = triangle_areas_and_normals(shape.points, shape.faces)
    corners = (shape.points - shape.points[0])[shape.faces] / shape.diagonal
    edges, middles = np.roll(corners, -1, axis=1) - corners, 0.5 * (np.roll(corners, -1, axis=1) + corners)
    waves, fields = np.random.default_rng(0).standard_normal((2, WAVES, 3))
    along = edges @ fields.T * np.sinc(edges @ waves.T / (2.0 * np.pi))
    left = np.abs(np.einsum("fek,fek->k", along, np.exp(1j * (middles @ waves.T))))
    most = np.linalg.norm(waves, axis=1) * np.linalg.norm(fields, axis=1) * areas.sum() / shape.diagonal**2
    # Triangles that meet without sharing vertices leave what single precision does.
    return bool(np.all(left <= SINGLE * most))


def _jackknife(points: Array, weights: Array, order: int, parts: int) -> tuple[Array, Array]:
    """Moments of the whole, and of the whole without each of `parts` interleaved parts, about each one's own mean.

    Interleaving after a fixed shuffle keeps the parts alike even where the file orders its points.
    """
    deal, ends = dealt(len(points), parts)
    sums = raw_moments_of_parts(rows(points, deal), weights[deal], order, ends)
    total = sums.sum(axis=0)
    rest = total - sums
    return total, recentred(rest / rest[:, :1], points.shape[1], order)


@lru_cache(maxsize=2)
def dealt(count: int, parts: int) -> tuple[NDArray[np.int64], list[int]]:
    """Indices of the points of one part after the other, dealt in turn after a fixed shuffle, and where each ends."""
    turn = np.random.default_rng(0).permutation(count) % parts
    return np.argsort(turn, kind="stable"), [0, *np.cumsum(np.bincount(turn, minlength=parts)).tolist()]


@lru_cache(maxsize=16)
def _binomials(dim: int, order: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """Terms of `prod (x_j - t_j)^p_j` for all p: where those of each p start, and for each term the row of the factor
    kept, the row of the power of t, and the signed coefficient.
    """
    table = [tuple(e) for e in exponents(dim, order).tolist()]
    position = {e: i for i, e in enumerate(table)}
    starts = np.cumsum([0, *(prod(v + 1 for v in e) for e in table[:-1])])
    terms = [
        (position[k], position[rest], (-1.0) ** sum(rest) * prod(map(comb, e, k)))
        for e in table
        for k in product(*(range(v + 1) for v in e))
        for rest in [tuple(a - b for a, b in zip(e, k, strict=True))]
    ]
    kept, shifts, coefficients = map(np.array, zip(*terms, strict=True))
    return starts, kept, shifts, coefficients


def recentred(values: Array, dim: int, order: int) -> Array:
    """Moments [..., K] of unit mass, each set about its own mean instead of the origin."""
    return shifted(values, values[..., 1 : dim + 1], order)


def shifted(values: Array, origin: Array, order: int) -> Array:
    """Moments [..., K] set about another origin [..., n]."""
    starts, kept, shifts, coefficients = _binomials(origin.shape[-1], order)
    powers = monomials(origin.reshape(-1, origin.shape[-1]), order).T.reshape(values.shape)
    return np.asarray(np.add.reduceat(coefficients * values[..., kept] * powers[..., shifts], starts, axis=-1))


def transformed(moments: Moments, matrix: Array) -> Moments:
    """Moments of the points after x -> matrix x about the centre, in the same units; replicates are left behind."""
    values = turned_values(moments.values[None], matrix[None], moments.order)[0, 0]
    return replace(moments, values=values, replicates=np.empty((0, values.size)))


def turned_values(values: Array, matrices: Array, order: int) -> Array:
    """Moments [K, P, C] of P sets of moments [P, C] to `order` after x -> R x, for K matrices R [K, n, n]."""
    dim, to_last = matrices.shape[1], matrices.transpose(0, 2, 1)[:, None]
    out = np.empty((len(matrices), *values.shape))
    for degree in range(order + 1):
        index = tensor_index(dim, degree, order)
        tensor = values[None][..., index.ravel()]
        for _ in range(degree):
            # Contract the leading index and append the new one: after `degree` rounds every index has had its turn.
            tensor = tensor.reshape(*tensor.shape[:2], dim, dim ** (degree - 1)).swapaxes(2, 3) @ to_last
            tensor = tensor.reshape(*tensor.shape[:2], dim**degree)
        out[..., index.ravel()] = tensor
    return out
