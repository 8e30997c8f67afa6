"""The mean of poses modulo a symmetry: equivalents nearest to the mean, the mean of those, and again.

Both steps lower `sum_i w_i |R - R_i S_i|^2`, over the operations S_i first and then over R, so the alternation ends,
for a finite group after finitely many steps. Where it ends may depend on where it began: it begins at several poses.
"""

import math
from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, ReadOnly, frame_with_z, orthogonal_factor, unit
from symrefine.groups.orthogonal import chord_angles, half_turns
from symrefine.poses.symmetry import Symmetry
from symrefine.rounding import DOUBLE, SINGLE

# Poses that the alternation starts from. Of poses that lie together any one leads to their mean.
_STARTS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanPose(ReadOnly):
    """The mean of poses modulo a symmetry.

    Attributes:
        pose: [4, 4] the mean.
        nearest: [N, 4, 4] of each pose the equivalent nearest to it.
        angles_rad: [N] by how much each of those is turned from the mean.
        ambiguous: why another mean may be as good; empty where all poses lie so close together that there is but one.
    """

    pose: Array
    nearest: Array
    angles_rad: Array
    ambiguous: str


def mean_pose(symmetry: Symmetry, poses: Array, weights: Array) -> MeanPose:
    """The mean of poses [N, 4, 4] with weights [N] of sum 1."""
    best = _around(symmetry, poses, weights, _settled(symmetry, poses, weights, poses[0]))
    if not best.ambiguous:
        return best
    others = np.unique(np.linspace(0, len(poses) - 1, min(_STARTS, len(poses))).astype(int))[1:]
    for start in poses[others]:
        rival = _around(symmetry, poses, weights, _settled(symmetry, poses, weights, start))
        if _cost(rival, weights) < _cost(best, weights) - DOUBLE:
            best = rival
    return best


def _around(symmetry: Symmetry, poses: Array, weights: Array, rotation: Array) -> MeanPose:
    """The mean with a rotation [3, 3]."""
    nearest = symmetry.toward(poses, rotation)
    angles = chord_angles(nearest[:, :3, :3], rotation)
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = weights @ symmetry.places(poses) - rotation @ symmetry.center
    return MeanPose(pose=pose, nearest=nearest, angles_rad=angles, ambiguous=_doubt(symmetry, float(angles.max())))


def _settled(symmetry: Symmetry, poses: Array, weights: Array, start: Array) -> Array:
    """The rotation [3, 3] at which the alternation ends that starts at a pose [4, 4]."""
    rotation, least = start[:3, :3], math.inf
    while True:
        before, nearest = rotation, symmetry.toward(poses, rotation)[:, :3, :3]
        # Neither half of a step makes poses farther from their mean, so that no choice of operations comes back.
        apart = float(weights @ np.square(nearest - before).sum(axis=(1, 2)))
        rotation = _mean_of(symmetry, nearest, weights, before)
        if apart >= least or chord_angles(rotation, before) < DOUBLE:
            return rotation
        least = apart


def _mean_of(symmetry: Symmetry, rotations: Array, weights: Array, before: Array) -> Array:
    """The rotation [3, 3] nearest to some [N, 3, 3]; of several the one turned least from `before`."""
    mean = np.einsum("n,nij->ij", weights, rotations)
    if symmetry.group.is_finite:
        return orthogonal_factor(mean, proper=True)
    if symmetry.group.symbol.family == "K":
        return before
    axis = symmetry.group.frame[2]
    return orthogonal_factor(_least_turn(unit(before @ axis), mean @ axis) @ before, proper=True)


def _least_turn(a: Array, b: Array) -> Array:
    """The smallest rotation [3, 3] that turns the unit vector a into the direction of b; none where b vanishes."""
    length = float(np.linalg.norm(b))
    if length < DOUBLE:
        return np.eye(3)
    # Two half turns, about a and about the direction halfway, are one turn by twice the angle between those.
    halfway = a + b / length
    size = float(np.linalg.norm(halfway))
    first, second = half_turns(np.stack([a, halfway / size if size > DOUBLE else frame_with_z(a)[0]]))
    return np.asarray(second @ first)


def _cost(mean: MeanPose, weights: Array) -> float:
    """The weighted sum of squared chords, in units of 8: `|R - R'|^2 = 8 sin^2(angle / 2)`."""
    return float(weights @ np.sin(0.5 * mean.angles_rad) ** 2)


def _doubt(symmetry: Symmetry, farthest_rad: float) -> str:
    """Why a mean from which no pose is farther may not be the only one.

    Within a quarter of the smallest turn of the group, any two of the equivalents chosen are nearer to one another than
    to any other equivalent, and within a right angle the mean of rotations is unique.
    """
    sure = 0.25 * symmetry.smallest_turn_rad
    if farthest_rad < sure - SINGLE:
        return ""
    return (
        f"a pose is {np.degrees(farthest_rad):.3g} degrees from the mean; from {np.degrees(sure):.3g} on, a quarter of "
        f"the smallest turn of {symmetry.group.name}, another choice of equivalents may have a mean as good"
    )
