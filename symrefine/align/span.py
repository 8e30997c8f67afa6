"""Maps between two objects elsewhere than in 3-space: plain moments, starts from the n-tuples and the principal axes.

The moments are compared in the principal axes of the target, where the widths of the object say how large each moment
of a degree is, so that thin axes are not drowned. Turns that the moments do not determine leave a subspace free.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from symrefine.align.moment_fit import (
    LONGEST,
    Fits,
    MomentPair,
    as_good,
    best_fits,
    covariance,
    exact,
    misfit,
    planes,
    skew,
)
from symrefine.align.procrustes import Procrustes, procrustes
from symrefine.geometry import Array
from symrefine.moments.harmonics import FLOOR
from symrefine.moments.moments import Moments, deviations, exponents, occurrences, turned_values
from symrefine.ntuples.contract import NTuples
from symrefine.rounding import DOUBLE
from symrefine.shape import Index

# A turn is not determined if its information is mostly noise: where the moments of the two, with their independent
# errors, share less than this part of it.
SHARED = 0.75


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Monomials:
    """Moments of `exponents(dim, order)`: `d m_p = -p_i m_(p - e_i + e_j) + p_j m_(p - e_j + e_i)` (method.md, 2)."""

    dim: int
    order: int

    def turned(self, matrices: Array, values: Array) -> Array:
        return turned_values(values, matrices, self.order)

    def tangents(self, values: Array) -> Array:
        table = _neighbours(self.dim, self.order)
        turned = [pj * values[:, to_i] - pi * values[:, to_j] for pi, to_j, pj, to_i in table]
        return np.array(turned).reshape(len(table), *values.shape).transpose(1, 0, 2)


@lru_cache(maxsize=16)
def _neighbours(dim: int, order: int) -> list[tuple[Index, Index, Index, Index]]:
    """For each plane: p_i, the place of p - e_i + e_j, p_j, the place of p - e_j + e_i; for every p in turn."""
    table = exponents(dim, order)
    place = {tuple(p): k for k, p in enumerate(table.tolist())}

    def moved(down: int, up: int) -> Index:
        step = np.eye(dim, dtype=np.int64)[up] - np.eye(dim, dtype=np.int64)[down]
        return np.array([place.get(tuple(p), 0) for p in (table + step).tolist()])

    return [(table[:, i], moved(i, j), table[:, j], moved(j, i)) for i, j in planes(dim)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpanFit:
    """Every matrix that explains a pair as well as the best.

    Attributes:
        matrices: [k, n, n], rotations first.
        free: orthonormal directions [j, n] of the target within which any rotation is as good; j = 0 or j >= 2.
        exact: whether the moments agree to rounding.
        sigma_rad: standard deviation of the rotation, all planes together; `inf` if some are undetermined.
        misfit: cost per moment; far above 1 if the moments differ by more than sampling explains.
    """

    matrices: Array
    free: Array
    exact: bool
    sigma_rad: float
    misfit: float


def span_fit(source: Moments, target: Moments, tuples: tuple[NTuples, NTuples], *, reflections: bool = True) -> SpanFit:
    """All maps that explain the moments of a pair.

    Args:
        source: normalised moments with their replicates.
        target: the same of the other object, to the same order.
        tuples: n-tuples of both.
        reflections: whether determinant -1 is an answer.
    """
    source_axes, axes = (np.linalg.eigh(m.covariance)[1] for m in (source, target))
    pair = monomial_pair(source, target)
    starts = np.stack(_starts(procrustes(*tuples), source_axes, axes))
    fits = best_fits(pair, starts[(np.linalg.det(axes @ starts) > 0.0) | reflections])
    same = exact(pair, fits)
    good = same if len(same.costs) else fits[as_good(pair, fits)]
    free = _free(pair, good, exact=bool(len(same.costs))) @ axes.T
    matrices = sorted(axes @ good.matrices, key=lambda m: -np.sign(np.linalg.det(m)))
    return SpanFit(
        matrices=np.stack(_one_for_each_part(matrices, free)),
        free=free,
        exact=bool(len(same.costs)),
        sigma_rad=np.inf if len(free) else float(np.sqrt(np.trace(covariance(pair, good)))),
        misfit=misfit(pair, fits),
    )


def monomial_pair(source: Moments, target: Moments) -> MomentPair:
    """Moments of the source in its own axes and of the target in its principal axes, widest last."""
    axes = np.linalg.eigh(target.covariance)[1]
    dim, order = source.dim, source.order
    action, table = Monomials(dim=dim, order=order), exponents(dim, order)
    a, b = (np.concatenate([m.values[None], m.replicates]) for m in (source, target))
    b = action.turned(axes.T[None], b)[0]
    widths = [np.linalg.eigvalsh(m.covariance) for m in (source, target)]
    size = np.prod(np.maximum(0.5 * (widths[0] + widths[1]), DOUBLE) ** table, axis=1)
    own = action.turned(np.linalg.eigh(source.covariance)[1].T[None], a)[0]
    noise = _relative_variance(own[1:], size, dim, order) + _relative_variance(b[1:], size, dim, order)
    # Each moment counts as often as it stands in its tensor, and all of them as many as they are.
    often = np.where(table.sum(axis=1) > 1, _multiplicity(dim, order), 0.0)
    weights = often / (often[often > 0.0].mean() * size * (noise + FLOOR))
    return MomentPair(source=a, target=b, weights=weights, action=action)


@lru_cache(maxsize=16)
def _multiplicity(dim: int, order: int) -> Array:
    """How often each moment stands in its symmetric tensor."""
    return np.array([float(occurrences(tuple(p))) for p in exponents(dim, order).tolist()])


def _relative_variance(replicates: Array, size: Array, dim: int, order: int) -> Array:
    """Jackknife variance [K] of moments over their size squared, averaged over each degree; zero where exact."""
    relative = (deviations(replicates) ** 2).sum(axis=0) / size
    degree, multiplicity = exponents(dim, order).sum(axis=1), _multiplicity(dim, order)
    means = [np.average(relative[degree == d], weights=multiplicity[degree == d]) for d in range(order + 1)]
    return np.array(means)[degree]


def _starts(closed: Procrustes, a: Array, b: Array) -> list[Array]:
    """Procrustes with both determinants; principal axes [n, n], signed as the tuples have it or any way; turns."""
    correlation = closed.target_directions.T * closed.singular_values @ closed.target_directions @ closed.matrix
    agreement = np.einsum("ik,ij,jk->k", b, correlation, a)
    signs = [(np.sign(v),) if abs(v) > closed.significance**2 else (1.0, -1.0) for v in agreement]
    starts = [b.T @ closed.matrix, b.T @ closed.flipped, *(np.diag(s) @ a.T for s in product(*signs))]
    if len(a) == 2:
        angles = np.arange(0.0, 2.0 * np.pi, LONGEST)
        turns = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]).transpose(2, 0, 1)
        starts += [*turns, *(turns @ np.diag([1.0, -1.0]))]
    return starts


def _free(pair: MomentPair, fits: Fits, *, exact: bool) -> Array:
    """Orthonormal directions [j, n] of the pair's axes that undetermined turns of the best fit move."""
    dim = fits.matrices.shape[1]
    if not fits.hessians.size:
        return np.zeros((0, dim))
    values, vectors = np.linalg.eigh(fits.hessians[0])
    sigma = np.sqrt(max(1.0, misfit(pair, fits)) / np.maximum(values, 1e-300))
    tangents = pair.action.tangents(np.concatenate([pair.moved(fits.matrices[:1]), pair.target[:1]]))
    here, there = np.sqrt(pair.weights) * tangents
    shared = np.einsum("aq,ak,bk,bq->q", vectors, here, there, vectors, optimize=True) / np.maximum(values, 1e-300)
    lost = values < 1e-12 * values[-1] if exact else (sigma > LONGEST) | (shared < SHARED)
    if not lost.any():
        return np.zeros((0, dim))
    u, s, _ = np.linalg.svd(np.concatenate(list(skew(vectors[:, lost].T, dim)), axis=1))
    return np.asarray(u[:, : int((s > 0.3 * s[0]).sum())].T)


def _one_for_each_part(matrices: Sequence[Array], free: Array) -> list[Array]:
    """Matrices that differ by more than a map within the free directions, one of either determinant."""
    across = np.eye(free.shape[1]) - free.T @ free
    kept: list[Array] = []
    for m in matrices:
        same = [np.linalg.norm(across @ (m - k)) < LONGEST and np.linalg.det(m) * np.linalg.det(k) > 0.0 for k in kept]
        if not any(same):
            kept.append(m)
    return kept
