"""Mirrors and revolutions that pairs of local planes vote for: no centroid, so that missing parts bias nothing.

A mirror that carries one local plane onto another has its normal along their difference and passes half way between
them; what decides is whether it turns the one normal into the other (Mitra, Guibas, Pauly, 2006, in small). The axis of
a revolution meets all normals, which is linear in its Pluecker coordinates (Pottmann, Randrup, 1998).
"""

import numpy as np

from symrefine.geometry import Array, rows
from symrefine.propose.maps import pair_slopes
from symrefine.rounding import DOUBLE
from symrefine.shape import Index

# Local planes whose pairs vote, the largest angle between the normals of a pair, and the candidates that are told: of 9
# planes of a cube one view shows 7, and the last of them is the 50th.
VOTERS, AGREE_RAD, TOLD = 1000, np.radians(8.0), 60
# Cells of votes: along an edge of the cube that directions are binned on, and of feet for each RMS radius.
DIRECTIONS, FEET = 24, 10


def mirror_votes(
    points: Array, normals: Array, rng: np.random.Generator, *, told: int = TOLD, outwards: bool = False
) -> Array:
    """Planes that many pairs of local planes [N, 3] are mirror images in, most votes first: normals and feet [2, V, 3].

    A foot is the point of a plane nearest to the origin, normalised units.

    Pairs within one flat part agree under any mirror across it and say nothing: a pair counts by how much its normals
    turn. Where all are known to point `outwards` a mirror keeps their signs, too.
    """
    some = rng.permutation(len(points))[:VOTERS]
    x, n = points[some], normals[some]
    i, j = _mirrored(x, n, outwards=outwards)
    # Of what is flat any two agree, and few tell as much: as many votes for each candidate as there are voters.
    every = max(1, len(i) // (VOTERS * TOLD))
    i, j = i[::every], j[::every]
    across = unit_rows(rows(x, j) - rows(x, i))
    middle = np.einsum("ki,ki->k", across, rows(x, i) + rows(x, j))
    return _densest(across, 0.5 * middle[:, None] * across, np.abs(np.einsum("ki,ki->k", across, rows(n, i))), told)


def _mirrored(points: Array, normals: Array, *, outwards: bool) -> tuple[Index, Index]:
    """Pairs of local planes [N, 3], not next to one another, the normals of which the mirror between them exchanges.

    It takes n_i to n_i - 2 (u.n_i) u, of which the part along n_j is m_ij - 2 (u.n_i) (u.n_j): products of matrices, in
    single precision, which is finer than any normal.
    """
    x, n = (v.astype(np.float32) for v in (points - points.mean(axis=0), normals))
    distance, _, slopes = pair_slopes(x, n)
    far = np.triu(distance > 1.0 / FEET, 1)
    turned = n @ n.T + 2.0 * slopes * slopes.T
    i, j = np.nonzero(far & ((turned if outwards else np.abs(turned)) > np.cos(AGREE_RAD)))
    return i, j


def unit_rows(vectors: Array) -> Array:
    """Vectors [N, 3] at length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])


def _densest(directions: Array, feet: Array, worth: Array, told: int) -> Array:
    """The densest spots of votes for planes [2, V, 3]: unit vectors [K, 3] without a sign, with their feet [K, 3]."""
    some = worth > 0.0
    directions, feet, worth = rows(directions, some), rows(feet, some), worth[some]
    if not some.any():
        return np.zeros((2, 0, 3))
    cells, volume = _cells(directions, feet)
    owner = cells @ [1, 7, 7 * 64, 7 * 64**2, 7 * 64**3, 7 * 64**4]
    order = np.argsort(owner, kind="stable")
    starts = np.flatnonzero(np.diff(owner[order], prepend=-1))
    fullest = np.argsort(-np.add.reduceat((worth / volume)[order], starts))[: 8 * told]
    middles = (m[fullest] for m in _middles(rows(directions, order), rows(feet, order), worth[order], starts))
    known, count = np.zeros((2, told, 3)), 0

    def is_known(direction: Array, foot: Array) -> bool:
        along = np.abs(known[0, :count] @ direction) > np.cos(AGREE_RAD)
        return bool((along & (((known[1, :count] - foot) ** 2).sum(axis=1) < FEET**-2.0)).any())

    for direction, foot in zip(*middles, strict=True):
        if is_known(direction, foot):
            continue
        # One sweep over all is quicker than a tree of directions and feet would be made.
        along = np.flatnonzero(np.abs(directions @ direction) > np.cos(AGREE_RAD))
        votes = along[((rows(feet, along) - foot) ** 2).sum(axis=1) < FEET**-2.0]
        if not votes.size:
            continue
        here = [m[0] for m in _middles(rows(directions, votes), rows(feet, votes), worth[votes], np.zeros(1, int))]
        if not is_known(*here):
            known[:, count] = here
            count += 1
        if count == told:
            break
    return known[:, :count]


def _middles(directions: Array, feet: Array, worth: Array, starts: Index) -> tuple[Array, Array]:
    """Mean unit vectors [C, 3], without a sign, and feet [C, 3] of groups of votes [K], each from `starts` [C] on."""
    counts = np.diff(starts, append=len(worth))
    first = np.repeat(rows(directions, starts), counts, axis=0)
    signed = np.where(np.einsum("ki,ki->k", directions, first) < 0.0, -worth, worth)
    sums = np.add.reduceat(np.column_stack([signed[:, None] * directions, worth[:, None] * feet, worth]), starts)
    return unit_rows(sums[:, :3]), sums[:, 3:6] / sums[:, 6:]


def _cells(directions: Array, feet: Array) -> tuple[Index, Array]:
    """Cells of votes as integers [K, 6], and the solid angle of each, in those at the middle of a face of the cube."""
    row = np.arange(len(directions))
    axis = np.abs(directions).argmax(axis=1)
    major = directions[row, axis]
    grid = np.round(0.5 * DIRECTIONS * np.stack([directions[row, (axis + k) % 3] / major for k in (1, 2)]))
    cells = np.stack([axis, *(grid + 32), *(np.clip(np.round(FEET * feet.T), -32, 31) + 32)], axis=1).astype(np.int64)
    return cells, (1.0 + ((2.0 * grid / DIRECTIONS) ** 2).sum(axis=0)) ** -1.5


def revolution(points: Array, normals: Array) -> tuple[Array, Array]:
    """Direction [3] and a point [3] of the line that the normals [N, 3] of a surface at points [N, 3] come closest to.

    A normal n at x meets the line (u, v = p x u) if `(x cross n).u + n.v = 0`: least squares over all u of length 1
    (that all normals lie across one direction says nothing of a line), then again without the half that misses most.
    """
    rows = np.column_stack([np.cross(points, normals), normals])
    kept = rows
    for _ in range(3):
        matrix = kept.T @ kept
        aside = -np.linalg.pinv(matrix[3:, 3:], rcond=DOUBLE, hermitian=True) @ matrix[3:, :3]
        u = np.linalg.eigh(matrix[:3, :3] + matrix[:3, 3:] @ aside)[1][:, 0]
        off = np.abs(rows @ np.concatenate([u, aside @ u]))
        kept = rows[off <= np.median(off)]
    return u, np.cross(u, aside @ u)


def meeting(points: Array, normals: Array) -> Array:
    """The point [3] that the normals [N, 3] of a surface at points [N, 3] come closest to, as those of a sphere do.

    Least squares of distances, then again without the half that is farthest off.
    """
    across = np.eye(3) - normals[:, :, None] * normals[:, None]
    kept = np.ones(len(points), dtype=bool)
    for _ in range(3):
        matrix = across[kept].sum(axis=0)
        middle = np.linalg.pinv(matrix, rcond=DOUBLE, hermitian=True) @ np.einsum(
            "nij,nj->i", across[kept], points[kept]
        )
        off = np.einsum("nij,nj->ni", across, points - middle)
        squares = np.einsum("ni,ni->n", off, off)
        kept = squares <= np.median(squares)
    return np.asarray(middle)
