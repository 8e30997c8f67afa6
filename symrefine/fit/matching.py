"""Which local planes a moved one meets, and what each pair is worth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Isometry, Mask, dots, rows
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes

# Robust scale over the median absolute residual (three standard deviations), and its bound from below in spacings.
ROBUST = 4.4
SCALE_FLOOR = 0.1
# Cosine of the largest angle between the normals of a pair.
AGREE = np.sqrt(0.5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """Correspondences under one operation: indices of sources and targets among the local planes, and their weights."""

    sources: Index
    targets: Index
    weights: Array


def match(cloud: LocalPlanes, motions: Sequence[Isometry], uncertainty: float, *, stride: int = 1) -> tuple[Pairs, ...]:
    """Pair every `stride`-th local plane, moved by each of K operations, with the nearest one, and weight the pairs.

    Pairs are dropped when the moved normal disagrees by more than 45 degrees, when the point hardly moves, so that it
    would meet itself, when it turns its back to all that saw the surface, or when they are farther apart than a few
    spacings and what the present uncertainty can move a point by. Weights: flatness times Geman-McClure, whose scale
    starts at the uncertainty (early on the informative pairs are those that disagree: handles, spouts, legs) and falls
    to a robust scale of the residuals, bounded from below: with exact data it would collapse (method.md, section 4).

    Args:
        uncertainty: how far the motions may still move a point, RMS radii.
    """
    source = np.arange(0, len(cloud.points), stride)
    points, classes = cloud.points[source], cloud.classes(source)
    turns, shifts = np.stack([m.matrix.T for m in motions]), np.stack([m.shift for m in motions])[:, None]
    moved = points @ turns + shifts
    every = None if classes is None else np.tile(classes, len(motions))
    distance, target = cloud.nearest(
        moved.reshape(-1, points.shape[1]), every, bound=reach_of(cloud.spacing, uncertainty)
    )
    distance, target = distance.reshape(moved.shape[:2]), target.reshape(moved.shape[:2])
    keep = np.isfinite(distance)
    if cloud.isolated:
        error, flat = distance, np.ones_like(distance)
    else:
        travel = moved - points
        keep &= dots(travel, travel) > cloud.spacing**2
        target = np.where(keep, target, 0)
        normals = rows(cloud.normals, target)
        turned = cloud.normals[source] @ turns
        keep &= facing(turned, normals)
        if cloud.eyes is not None:
            keep &= cloud.faced(moved, turned)
        error = dots(moved - rows(cloud.points, target), normals)
        flat = worth(cloud.flatness[source], cloud.flatness[target])

    def weighted(off: Array, kept: Mask) -> Array:
        return geman_mcclure(off[kept] ** 2, robust_scale(off[kept], cloud.spacing, uncertainty))

    return tuple(
        Pairs(sources=source[k], targets=t[k], weights=f[k] * weighted(e, k))
        for k, t, f, e in zip(keep, target, flat, error, strict=True)
    )


def reach_of(spacing: float, uncertainty: float) -> float:
    """How far apart a pair may be."""
    return 3.0 * (spacing + uncertainty)


def facing(moved: Array, normals: Array) -> Mask:
    """Which moved normals [..., n] agree with others, whatever their signs."""
    return np.asarray(np.abs(dots(moved, normals)) > AGREE)


def worth(source: Array, target: Array) -> Array:
    """What pairs [..., N] of planes count for, from the flatness of both."""
    return np.asarray(np.exp(-(source**2) - target**2))


def robust_scale(error: Array, spacing: float, uncertainty: float) -> float:
    """Scale of the Geman-McClure weights from residuals [N], bounded from below."""
    half = error.size // 2
    middle = float(np.partition(np.abs(error), half)[half]) if error.size else 0.0
    return max(ROBUST * middle, SCALE_FLOOR * spacing, uncertainty)


def geman_mcclure(error2: Array, scale: float) -> Array:
    """Weights [N] from squared residuals [N]: those with which least squares minimises `sum s^2 e^2 / (s^2 + e^2)`."""
    return np.asarray((scale**2 / (scale**2 + error2)) ** 2)


def pair_equations(cloud: LocalPlanes, pairs: Pairs) -> tuple[Array, Array, Array, Array]:
    """Sources, targets and directions [E, n] and weights [E] of the equations `(T x - y).n = 0` that the pairs make.

    One for each pair of local planes, along the target's normal; one along each axis for each pair of isolated points.
    """
    sources, targets = cloud.points[pairs.sources], cloud.points[pairs.targets]
    if not cloud.isolated:
        return sources, targets, cloud.normals[pairs.targets], pairs.weights
    return (*each_coordinate(sources, targets), np.repeat(pairs.weights, sources.shape[1]))


def each_coordinate(sources: Array, targets: Array) -> tuple[Array, Array, Array]:
    """Sources, targets and directions [nP, n] of the equations that pairs of points [P, n] make, n for each."""
    dim = sources.shape[1]
    return np.repeat(sources, dim, axis=0), np.repeat(targets, dim, axis=0), np.tile(np.eye(dim), (len(sources), 1))
