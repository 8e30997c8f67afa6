"""Which local planes a moved one meets, and what each pair is worth."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, Isometry
from symrefine.shape import Index
from symrefine.surface.skin import LocalPlanes

# Flatness at which a local plane counts for little in a residual.
WORTH = 1.0
# Robust scale over the median absolute residual (three standard deviations), and its bound from below in spacings.
ROBUST = 4.4
SCALE_FLOOR = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """Correspondences under one operation: indices of sources and targets among the local planes, and their weights."""

    sources: Index
    targets: Index
    weights: Array


def match(
    cloud: LocalPlanes, motion: Isometry, uncertainty: float, *, stride: int = 1, robust: float = ROBUST
) -> Pairs:
    """Pair every `stride`-th local plane, moved, with the nearest one; weight by how much the pair is worth.

    Pairs are dropped when the moved normal disagrees by more than 45 degrees, when the point hardly moves, so that it
    would meet itself, or when they are farther apart than a few spacings and what the present uncertainty can move a
    point by. Weights: flatness times Geman-McClure, whose scale starts at the uncertainty (early on the informative
    pairs are those that disagree: handles, spouts, legs) and falls to a robust scale of the residuals, bounded from
    below: with exact data it would collapse (method.md, section 4).

    Args:
        uncertainty: how far the motion may still move a point, RMS radii.
        robust: that scale over the median absolute residual.
    """
    source = np.arange(0, len(cloud.points), stride)
    moved = motion.apply(cloud.points[source])
    reach = 3.0 * (cloud.spacing + uncertainty)
    distance, target = cloud.nearest(moved, cloud.classes(source), distance_upper_bound=reach)
    floor = max(SCALE_FLOOR * cloud.spacing, uncertainty)
    keep = np.isfinite(distance)
    if not cloud.isolated:
        travel = np.linalg.norm(moved - cloud.points[source], axis=1)
        keep &= travel > cloud.spacing
    source, target, moved = source[keep], target[keep], moved[keep]
    if cloud.isolated:
        return Pairs(sources=source, targets=target, weights=_robust(distance[keep], floor, robust))
    turned = motion.turn(cloud.normals[source])
    agree = np.abs(np.einsum("ij,ij->i", turned, cloud.normals[target])) > np.sqrt(0.5)
    source, target, moved = source[agree], target[agree], moved[agree]
    error = np.einsum("ij,ij->i", moved - cloud.points[target], cloud.normals[target])
    flat = np.exp(-((cloud.flatness[source] / WORTH) ** 2) - (cloud.flatness[target] / WORTH) ** 2)
    return Pairs(sources=source, targets=target, weights=flat * _robust(error, floor, robust))


def _robust(error: Array, floor: float, robust: float) -> Array:
    """Geman-McClure weights [N] at a scale from the residuals [N], not below `floor`."""
    if error.size == 0:
        return np.empty(0)
    scale2 = max(robust * float(np.median(np.abs(error))), floor) ** 2
    return (scale2 / (scale2 + error**2)) ** 2


def pair_equations(cloud: LocalPlanes, pairs: Pairs) -> tuple[Array, Array, Array, Array]:
    """Sources, targets and directions [E, n] and weights [E] of the equations `(T x - y).n = 0` that the pairs make.

    One for each pair of local planes, along the target's normal; one along each axis for each pair of isolated points.
    """
    sources, targets = cloud.points[pairs.sources], cloud.points[pairs.targets]
    if not cloud.isolated:
        return sources, targets, cloud.normals[pairs.targets], pairs.weights
    dim = sources.shape[1]
    directions = np.tile(np.eye(dim), (len(sources), 1))
    return np.repeat(sources, dim, axis=0), np.repeat(targets, dim, axis=0), directions, np.repeat(pairs.weights, dim)
