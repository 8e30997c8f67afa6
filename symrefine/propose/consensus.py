"""Rigid maps of either determinant that many matches of local planes agree upon: no centroid, no sign of a normal.

Two local planes keep, wherever they are carried, the distance d of their points and the angles between the line from
one to the other (direction u) and their normals m and n. All of it is polynomial in what no sign of a normal changes:

    (u.m)^2   (u.n)^2   (m.n)^2   (u.m)(u.n)(m.n)   and the handedness   (u.m)(u.n) det(u, m, n)

A rotation keeps the last one, a reflection reverses it, so one pair of matches already says which it is. Two matches
are compatible under a determinant if they keep all six. Those of a true map are compatible with one another, so that a
pair of them has many compatible matches in common (SC2-PCR; Chen, Sun, Yang, Tao, 2022).
"""

from dataclasses import dataclass

import numpy as np

from symrefine.fit.matching import AGREE
from symrefine.geometry import Array, Mask, orthogonal_factor

Single = np.ndarray[tuple[int, ...], np.dtype[np.float32]]

# By how much the invariants of compatible pairs may differ: normals of 15 degrees off move them by so much.
INVARIANT = 0.3
# Maps that are grown from the best matches for each determinant, how many are told, and rounds that each takes.
SEEDS, TOLD, ROUNDS = 20, 8, 3
# Share of the most that a match has in common with a seed, from which on it belongs to it.
COMMON = 0.3
# Cosine of the largest angle between normals that agree, and of the angle between matrices that are one map.
SAME = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """Local planes of the source, points [N, 3] and unit normals [N, 3] of any sign, and those that look like them."""

    source: Array
    source_normals: Array
    target: Array
    target_normals: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """A map `target ~ matrix @ source + shift`, and how many matches agree with it."""

    matrix: Array
    shift: Array
    support: int


def consensus(matches: Matches, within: float) -> list[Proposal]:
    """The maps of either determinant that most matches agree with to a distance, best first; three fix a map."""
    if len(matches.source) < 3:
        return []
    here = pair_invariants(matches.source, matches.source_normals)
    there = pair_invariants(matches.target, matches.target_normals)
    allowed = np.abs(here[0] - there[0]) < within
    allowed &= here[0] > 2.0 * within
    for a, b in zip(here[1:-1], there[1:-1], strict=True):
        allowed &= np.abs(a - b) < INVARIANT
    found: list[Proposal] = []
    for det in (1, -1):
        agree = (allowed & (np.abs(here[-1] - det * there[-1]) < 0.5 * INVARIANT)).astype(np.float32)
        found += _grown(matches, agree * (agree @ agree), within, det)
    return sorted(found, key=lambda p: -p.support)


def pair_invariants(points: Array, normals: Array) -> tuple[Single, ...]:
    """Distances [N, N] of all pairs of local planes, and what of their angles no sign of a normal changes.

    The last one is the handedness, which a reflection reverses. All are products of matrices, in single precision:
    they are compared with limits of a few hundredths.
    """
    x, n = (v.astype(np.float32) for v in (points - points.mean(axis=0), normals))
    distance, shrink, first = pair_slopes(x, n)
    second = -first.T
    # (x_j - x_i) . (n_i cross n_j)
    leaves = np.cross(x, n)
    volume = -(n @ leaves.T + leaves @ n.T) * shrink
    between, leaning = n @ n.T, first * second
    return distance, first**2, second**2, between**2, leaning * between, leaning * volume


def pair_slopes(x: Single, n: Single) -> tuple[Single, Single, Single]:
    """Distances of all pairs of local planes, one over these, and (x_j - x_i).n_i over them, [N, N] each.

    `x` and `n` [N, 3] are their points and normals. Of a local plane with itself all three are nothing.
    """
    squares = (x**2).sum(axis=1)
    distance = np.sqrt(np.maximum(squares[:, None] + squares - 2.0 * (x @ x.T), 0.0))
    np.fill_diagonal(distance, 0.0)
    shrink = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance > 0.0)
    high = n @ x.T
    return distance, shrink, (high - np.diag(high)[:, None]) * shrink


def _grown(matches: Matches, common: Array, within: float, det: int) -> list[Proposal]:
    """Maps of one determinant, each from a match and those that have most in common [N, N] with it."""
    score, left = common.sum(axis=1), SEEDS
    found: list[Proposal] = []
    while left and score.any():
        # Many at once, which takes no longer; those that turn out to agree with one before are no seeds of their own.
        seeds = np.argsort(-score, kind="stable")[: min(SEEDS, np.count_nonzero(score))]
        rows = common[seeds]
        inside = rows >= COMMON * rows.max(axis=1, keepdims=True)
        inside[np.arange(len(seeds)), seeds] = True
        for seed, matrix, shift, agreeing in zip(seeds, *_settled(matches, inside, within, det), strict=True):
            if not left:
                break
            if score[seed] == 0.0:
                continue
            score[agreeing], score[seed], left = 0.0, 0.0, left - 1
            map_ = Proposal(matrix=matrix, shift=shift, support=int(agreeing.sum()))
            if map_.support > 2 and not any(_same(map_, p, within) for p in found):
                found.append(map_)
    return sorted(found, key=lambda p: -p.support)[:TOLD]


def _settled(matches: Matches, inside: Mask, within: float, det: int) -> tuple[Array, Array, Mask]:
    """Maps of some matches each [K, N], fitted again to those that agree with them: matrices, shifts, and these."""
    inside = inside.copy()
    matrices, shifts = _fitted(matches, inside, det)
    moving = np.arange(len(inside))
    for _ in range(ROUNDS):
        turns = matrices[moving].transpose(0, 2, 1)
        off = matches.source @ turns + shifts[moving, None] - matches.target
        facing = np.abs(np.einsum("kij,ij->ki", matches.source_normals @ turns, matches.target_normals))
        agree = (np.einsum("kij,kij->ki", off, off) < within**2) & (facing > AGREE)
        changed = (np.count_nonzero(agree, axis=1) > 2) & (agree != inside[moving]).any(axis=1)
        inside[moving], moving = agree, moving[changed]
        if not moving.size:
            break
        matrices[moving], shifts[moving] = _fitted(matches, inside[moving], det)
    return matrices, shifts, inside


def _fitted(matches: Matches, some: Mask, det: int) -> tuple[Array, Array]:
    """Least squares over some matches [K, N] each: matrices [K, 3, 3] of a determinant, and shifts [K, 3]."""
    share = some / np.maximum(np.count_nonzero(some, axis=1), 1)[:, None]
    a_mean, b_mean = share @ matches.source, share @ matches.target
    products = (matches.target[:, :, None] * matches.source[:, None]).reshape(-1, 9)
    spread = (share @ products).reshape(-1, 3, 3) - b_mean[:, :, None] * a_mean[:, None]
    matrices = det * orthogonal_factor(det * spread, proper=True)
    return matrices, b_mean - (matrices @ a_mean[:, :, None])[:, :, 0]


def _same(map_: Proposal, known: Proposal, within: float) -> bool:
    """Whether a map is a known one."""
    turned = (np.trace(map_.matrix @ known.matrix.T) - 1.0) / 2.0
    return bool(turned > SAME and np.linalg.norm(map_.shift - known.shift) < 2.0 * within)
