"""Closure of operations that share one line: counted in whole steps about it, so no error can build up.

Such an operation is (e, f, j): it multiplies z by e = +-1 and, in the plane across, it rotates (f = +1) or reflects
(f = -1) by j steps of 2 pi / N. Products are (e e', f f', j + f j'): exact integers once N and the phase are known.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, frame_with_z, rotation
from symrefine.groups.names import CLOSED_FOLD, MAX_FOLD
from symrefine.groups.orthogonal import Index, about_z, angles_about_z, axes_and_angles, determinants, nearest_in_span

# N^2 times the error of angles up to which a fold is taken as exact: at random it is of the order of N.
_EXACT = 1e-3
# Folds that would fit as well by accident, from which on none is believed.
_ACCIDENTS = 2.0
Step = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planar:
    """What operations do to a common axis, `ends` e [k], and across it: `dets` f [k] and `angles_rad` [k].

    An in-plane reflection of angle psi keeps the direction psi / 2.
    """

    ends: Index
    dets: Index
    angles_rad: Array


def common_axes(operations: Array) -> list[tuple[Array, float]]:
    """Lines that operations [k, 3, 3] may share, and the largest angle by which one of them moves each.

    First the best of their own axes; then the best normal to two of them, which is right if all axes lie across the
    common one, but meaningless for two noisy copies of one axis.
    """
    axes, angles = axes_and_angles(operations)
    crosses = np.cross(axes[np.argmax(angles)], axes)
    sizes = np.linalg.norm(crosses, axis=1, keepdims=True)
    normals = (crosses / np.maximum(sizes, 0.01))[sizes[:, 0] > 0.01]
    return [_kept_best(operations, candidates) for candidates in (axes, normals) if len(candidates)]


def _kept_best(operations: Array, candidates: Array) -> tuple[Array, float]:
    """The candidate direction [c, 3] that operations keep best, refined by least squares, and how far they move it."""
    cosines = np.sum(candidates @ operations * candidates, axis=2).T
    best = int(np.argmax(np.abs(cosines).min(axis=1)))
    moved = operations - np.where(cosines[best] < 0.0, -1.0, 1.0)[:, None, None] * np.eye(3)
    values, vectors = np.linalg.eigh(np.einsum("kij,kil->jl", moved, moved))
    direction = nearest_in_span(vectors[:, values < values[0] + 1e-9], candidates[best])
    sines = np.linalg.norm(np.cross(operations @ direction, direction), axis=1)
    return direction, float(np.arcsin(np.minimum(sines, 1.0)).max())


def planar_parts(operations: Array, frame: Array) -> Planar:
    """Decompose operations [k, 3, 3] that nearly keep the z axis of `frame`."""
    turned = frame @ operations @ frame.T
    ends = np.where(turned[:, 2, 2] < 0.0, -1, 1)
    dets = np.rint(determinants(turned)).astype(np.intp) * ends
    return Planar(ends=ends, dets=dets, angles_rad=angles_about_z(turned, dets))


def fit_lattice(parts: Planar, tolerance_rad: float, multiple_of: int) -> tuple[int, float] | None:
    """Fold N, a multiple of `multiple_of`, and phase of the angles the operations point to; None if there are none.

    They are j 2 pi / N for rotations, the phase + j 2 pi / N for in-plane reflections.

    A fold that fits far better than chance (N^2 times the error) is taken as exact, the smallest first. Otherwise the
    errors are weighed as Gaussian, sigma = tolerance / 2, against the N places each angle might have had, among the
    folds of which fewer than `_ACCIDENTS` would fit as well by accident.
    """
    turns = _distinct(parts.angles_rad[parts.dets > 0], tolerance_rad, drop_zero=True)
    flips = _distinct(parts.angles_rad[parts.dets < 0], tolerance_rad)
    folds = multiple_of * np.arange(1, max(CLOSED_FOLD // multiple_of, 1) + 1)
    phases = np.angle(np.exp(1j * np.outer(folds, flips)).sum(axis=1)) / folds
    angles = np.concatenate([np.tile(turns, (len(folds), 1)), flips - phases[:, None]], axis=1)
    errors = np.angle(np.exp(1j * folds[:, None] * angles)) / folds[:, None]
    best = _likeliest(folds, errors, len(turns) + max(len(flips) - 1, 0), tolerance_rad)
    return None if best is None else (int(folds[best]), float(phases[best]))


def _likeliest(folds: Index, errors: Array, count: int, tolerance_rad: float) -> int | None:
    """Row of `errors` [n, m] to trust, `count` of the m angles being informative."""
    worst, squares = np.abs(errors).max(axis=1, initial=0.0), np.sum(errors**2, axis=1)
    within = worst <= tolerance_rad
    exact = within & (folds**2 * worst <= _EXACT)
    if exact.any():
        return int(np.argmax(exact))
    rms = np.sqrt(3.0 * squares / max(count, 1)) / np.pi  # times N: 1 for angles at random
    within &= folds / folds[0] * (folds * rms) ** count <= _ACCIDENTS
    cost = (count + 1) * np.log(folds) + 2.0 * squares / tolerance_rad**2
    return int(np.argmin(np.where(within, cost, np.inf))) if within.any() else None


def _distinct(angles: Array, tolerance_rad: float, drop_zero: bool = False) -> Array:
    """One angle for every run of angles on the circle closer than the tolerance; without the run at zero on demand."""
    ordered = np.sort(np.mod(angles + tolerance_rad, 2.0 * np.pi)) - tolerance_rad
    if drop_zero:
        ordered = ordered[ordered > tolerance_rad]
    runs = np.split(ordered, np.flatnonzero(np.diff(ordered) > tolerance_rad) + 1)
    return np.array([run.mean() for run in runs if run.size])


def closed_operations(parts: Planar, fold: int, phase_rad: float, frame: Array) -> Array:
    """All operations [m, 3, 3], exact, that the operations in `parts` generate on the lattice of `fit_lattice`."""
    offsets = np.where(parts.dets < 0, parts.angles_rad - phase_rad, parts.angles_rad)
    steps = np.rint(offsets * fold / (2.0 * np.pi)).astype(int) % fold
    generators = set(zip(parts.ends.tolist(), parts.dets.tolist(), steps.tolist(), strict=True))
    e, f, j = np.array(sorted(_close_steps(generators, fold))).T
    exact = about_z(e, f, 2.0 * np.pi * j / fold)
    phased = rotation([0.0, 0.0, 1.0], -0.5 * phase_rad) @ frame
    return np.asarray(phased.T @ exact @ phased)


def _close_steps(generators: set[Step], fold: int) -> set[Step]:
    """The group generated: every new element times every generator until nothing new appears."""
    group: set[Step] = {(1, 1, 0)}
    fresh = group
    while fresh:
        fresh = {(e * g, f * h, (j + f * k) % fold) for e, f, j in fresh for g, h, k in generators} - group
        group = group | fresh
    return group


def axial_operations(operations: Array, tolerance_rad: float, orders: Index) -> Iterator[Array]:
    """Exact closures [m, 3, 3] of noisy operations [k, 3, 3] about each line they may share; nothing if none closes.

    Args:
        operations: generators.
        tolerance_rad: largest error of one of them, as an angle of rotation.
        orders: [k] the exact order of each, 0 where unknown.
    """
    for direction, moved in common_axes(operations):
        frame = frame_with_z(direction)
        parts = planar_parts(operations, frame)
        known = (parts.dets > 0) & (orders > 0)
        multiple = int(np.lcm.reduce(orders[known], initial=1))
        if moved > 3.0 * tolerance_rad or multiple > MAX_FOLD:
            continue
        unknown = Planar(ends=parts.ends[~known], dets=parts.dets[~known], angles_rad=parts.angles_rad[~known])
        lattice = fit_lattice(unknown, tolerance_rad, multiple)
        if lattice is not None:
            yield closed_operations(parts, *lattice, frame)
