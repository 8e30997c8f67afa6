"""Mirrors, turns and revolutions that pairs of local planes vote for: no centroid, so that missing parts bias nothing.

A mirror that carries one local plane onto another has its normal along their difference and passes half way between
them; what decides is whether it turns the one normal into the other. Turns take two pairs (Mitra, Guibas, Pauly, 2006,
in small). The axis of a revolution meets all normals, which is linear in its Pluecker coordinates (Pottmann, Randrup,
1998).
"""

import numpy as np

from symrefine.geometry import Array, unit
from symrefine.shape import Index

# Local planes whose pairs vote, the largest angle between the normals of a pair, and the candidates that are told.
VOTERS, AGREE_RAD, TOLD = 1000, np.radians(8.0), 24
# Cells of votes: along an edge of the cube that directions are binned on, and of offsets for each RMS radius.
DIRECTIONS, OFFSETS = 24, 10


def mirror_votes(points: Array, normals: Array, rng: np.random.Generator) -> list[tuple[Array, float]]:
    """Normals [3] and offsets of planes that many pairs of local planes [N, 3] are mirror images in, most votes first.

    Everything in normalised units. Pairs within one flat part agree under any mirror across it and say nothing: a pair
    counts by how much its normals turn.
    """
    some = rng.permutation(len(points))[:VOTERS]
    x, n = points[some], normals[some]
    i, j = np.triu_indices(len(some), 1)
    across = x[j] - x[i]
    length = np.linalg.norm(across, axis=1)
    across /= np.maximum(length, 1e-300)[:, None]
    along = np.einsum("ki,ki->k", across, n[i])
    image = n[i] - 2.0 * along[:, None] * across
    agree = (np.abs(np.einsum("ki,ki->k", image, n[j])) > np.cos(AGREE_RAD)) & (length > 1.0 / OFFSETS)
    i, j, m, worth = i[agree], j[agree], across[agree], np.abs(along[agree])
    return _densest(m, 0.5 * np.einsum("ki,ki->k", m, x[i] + x[j]), worth)


def _densest(directions: Array, offsets: Array, worth: Array) -> list[tuple[Array, float]]:
    """The densest spots of votes: unit vectors [K, 3] without a sign, with offsets [K]."""
    turned = np.where(directions[np.arange(len(directions)), np.abs(directions).argmax(axis=1)] < 0.0, -1.0, 1.0)
    directions, offsets = turned[:, None] * directions, turned * offsets
    cells, volume = _cells(directions, offsets)
    _, owner = np.unique(cells, axis=0, return_inverse=True)
    votes = np.bincount(owner.ravel(), worth / volume)
    found: list[tuple[Array, float]] = []
    for cell in np.argsort(-votes):
        inside = owner.ravel() == cell
        m, d = _middle(directions[inside], offsets[inside], worth[inside])
        for _ in range(2):
            cosine = directions @ m
            near = (np.abs(cosine) > np.cos(AGREE_RAD)) & (np.abs(np.sign(cosine) * offsets - d) < 1.0 / OFFSETS)
            m, d = _middle(np.sign(cosine[near])[:, None] * directions[near], np.sign(cosine[near]) * offsets[near], worth[near])
        if all(abs(m @ u) < np.cos(AGREE_RAD) or abs(np.sign(m @ u) * d - o) > 1.0 / OFFSETS for u, o in found):
            found.append((m, d))
        if len(found) == TOLD:
            break
    return found


def _cells(directions: Array, offsets: Array) -> tuple[Index, Array]:
    """Cells of votes as integers [K, 4], and the solid angle of each, in those at the middle of a face of the cube."""
    axis = np.abs(directions).argmax(axis=1)
    major = directions[np.arange(len(directions)), axis]
    u = np.stack([directions[np.arange(len(directions)), (axis + k) % 3] / major for k in (1, 2)])
    grid = np.round(0.5 * DIRECTIONS * u)
    cells = np.stack([axis, *grid, np.round(OFFSETS * offsets)], axis=1).astype(np.int64)
    return cells, (1.0 + (2.0 * grid / DIRECTIONS) ** 2).sum(axis=0) ** -1.5


def _middle(directions: Array, offsets: Array, worth: Array) -> tuple[Array, float]:
    return unit(worth @ directions), float(np.average(offsets, weights=worth))


def revolution(points: Array, normals: Array) -> tuple[Array, Array]:
    """Direction [3] and a point [3] of the line that the normals [N, 3] of a surface at points [N, 3] come closest to.

    A normal n at x meets the line (u, v = p x u) if `(x cross n).u + n.v = 0`; the smallest singular vector, then again
    without the half that misses most.
    """
    rows = np.column_stack([np.cross(points, normals), normals])
    kept = rows
    for _ in range(3):
        line = np.linalg.eigh(kept.T @ kept)[1][:, 0]
        off = np.abs(rows @ line)
        kept = rows[off <= np.median(off)]
    u, v = line[:3], line[3:]
    return unit(u), np.cross(u, v) / max(float(u @ u), 1e-300)
