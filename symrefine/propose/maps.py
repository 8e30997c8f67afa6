"""Maps of one surface onto itself, or onto another, that local planes which look alike agree upon.

Neither centroid nor moments are asked, nor signs of normals, so that missing parts bias nothing; either determinant is
as likely. What a surface is carried onto itself by is a symmetry of what was seen: a mirror, a turn, the inversion, a
rotoreflection.

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
from symrefine.geometry import Array, Isometry, Mask, orthogonal_factor
from symrefine.propose.signatures import own_matches, signatures
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes, Planes

Single = np.ndarray[tuple[int, ...], np.dtype[np.float32]]

# How far around themselves local planes look and how near matches come, in diagonals; local planes of either side, and
# matches that are asked. Of 480 pairs that share 50 or 40 % 431 are right and 18 wrong ones sure; with 1,200 planes 418
# and 27, with 500 matches 409 and 20.
AROUND, WITHIN, PLANES, MATCHES = 0.1, 0.04, 1500, 400
# By how much the invariants of compatible pairs may differ: normals of 15 degrees off move them by so much.
INVARIANT = 0.3
# Maps that are grown from the best matches for each determinant, how many are told, and rounds that each takes.
SEEDS, TOLD, ROUNDS = 20, 8, 3
# Share of the most that a match has in common with a seed, from which on it belongs to it.
COMMON = 0.3
# Cosine of the largest angle between matrices that are one map.
SAME = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal(Isometry):
    """A map of sources to targets, and how many matches agree with it."""

    support: int


def maps_onto_itself(cloud: LocalPlanes, diagonal: float, rng: np.random.Generator) -> list[Proposal]:
    """Maps of either determinant of a surface onto itself, but for the identity and what is next to it, best first."""
    some = np.sort(rng.permutation(len(cloud.points))[:PLANES])
    chosen = cloud.chosen(some)
    looks = signatures(chosen, AROUND * diagonal)
    matches = own_matches(looks, chosen.points, 2.0 * WITHIN * diagonal, cloud.classes(some))
    return agreed(chosen, chosen, matches, diagonal)


def agreed(source: Planes, target: Planes, matches: tuple[Index, Index], diagonal: float) -> list[Proposal]:
    """The maps that the first of some matches agree upon, indices of the planes of either side."""
    i, j = (m[:MATCHES] for m in matches)
    return consensus(source.chosen(i), target.chosen(j), WITHIN * diagonal)


def consensus(source: Planes, target: Planes, within: float) -> list[Proposal]:
    """The maps of either determinant that most matches agree with to a distance, best first; three fix a map.

    Row by row planes of the source are matched with those of the target.
    """
    if len(source.points) < 3:
        return []
    here = pair_invariants(source.points, source.normals)
    there = pair_invariants(target.points, target.normals)
    allowed = np.abs(here[0] - there[0]) < within
    allowed &= here[0] > 2.0 * within
    for a, b in zip(here[1:-1], there[1:-1], strict=True):
        allowed &= np.abs(a - b) < INVARIANT
    found: list[Proposal] = []
    for det in (1, -1):
        agree = (allowed & (np.abs(here[-1] - det * there[-1]) < 0.5 * INVARIANT)).astype(np.float32)
        found += _grown(source, target, agree * (agree @ agree), within, det)
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


def _grown(source: Planes, target: Planes, common: Array, within: float, det: int) -> list[Proposal]:
    """Maps of one determinant, each from a match and those that have most in common [N, N] with it."""
    score, left = common.sum(axis=1), SEEDS
    found: list[Proposal] = []
    while left and score.any():
        # Many at once, which takes no longer; those that turn out to agree with one before are no seeds of their own.
        seeds = np.argsort(-score, kind="stable")[: min(SEEDS, np.count_nonzero(score))]
        rows = common[seeds]
        inside = rows >= COMMON * rows.max(axis=1, keepdims=True)
        inside[np.arange(len(seeds)), seeds] = True
        for seed, matrix, shift, agreeing in zip(seeds, *_settled(source, target, inside, within, det), strict=True):
            if not left:
                break
            if score[seed] == 0.0:
                continue
            score[agreeing], score[seed], left = 0.0, 0.0, left - 1
            map_ = Proposal(matrix=matrix, shift=shift, support=int(agreeing.sum()))
            if map_.support > 2 and not any(_same(map_, p, within) for p in found):
                found.append(map_)
    return sorted(found, key=lambda p: -p.support)[:TOLD]


def _settled(source: Planes, target: Planes, inside: Mask, within: float, det: int) -> tuple[Array, Array, Mask]:
    """Maps of some matches each [K, N], fitted again to those that agree with them: matrices, shifts, and these."""
    inside = inside.copy()
    matrices, shifts = _fitted(source, target, inside, det)
    moving = np.arange(len(inside))
    for _ in range(ROUNDS):
        turns = matrices[moving].transpose(0, 2, 1)
        off = source.points @ turns + shifts[moving, None] - target.points
        facing = np.abs(np.einsum("kij,ij->ki", source.normals @ turns, target.normals))
        agree = (np.einsum("kij,kij->ki", off, off) < within**2) & (facing > AGREE)
        changed = (np.count_nonzero(agree, axis=1) > 2) & (agree != inside[moving]).any(axis=1)
        inside[moving], moving = agree, moving[changed]
        if not moving.size:
            break
        matrices[moving], shifts[moving] = _fitted(source, target, inside[moving], det)
    return matrices, shifts, inside


def _fitted(source: Planes, target: Planes, some: Mask, det: int) -> tuple[Array, Array]:
    """Least squares over some matches [K, N] each: matrices [K, 3, 3] of a determinant, and shifts [K, 3]."""
    share = some / np.maximum(np.count_nonzero(some, axis=1), 1)[:, None]
    a_mean, b_mean = share @ source.points, share @ target.points
    products = (target.points[:, :, None] * source.points[:, None]).reshape(-1, 9)
    spread = (share @ products).reshape(-1, 3, 3) - b_mean[:, :, None] * a_mean[:, None]
    matrices = det * orthogonal_factor(det * spread, proper=True)
    return matrices, b_mean - (matrices @ a_mean[:, :, None])[:, :, 0]


def _same(map_: Proposal, known: Proposal, within: float) -> bool:
    """Whether a map is a known one."""
    turned = (np.trace(map_.matrix @ known.matrix.T) - 1.0) / 2.0
    return bool(turned > SAME and np.linalg.norm(map_.shift - known.shift) < 2.0 * within)
