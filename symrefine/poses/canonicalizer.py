"""Poses that do not flip: of all poses in which a symmetric body looks the same, one, and always the fitting one.

The nearest one turns least. With the previous frame as the reference no step of the result is longer than that of
the true motion: the true motion, turned by the operation that was chosen last, is among what is chosen from. And
as long as the body turns by less than half of the smallest turn of its group from frame to frame, the same operation
stays the nearest, so that the result is the true motion in one of its equivalents.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symrefine.errors import InputError
from symrefine.geometry import Array, numbers
from symrefine.poses.given import Group, symmetry_of
from symrefine.poses.mean import MeanPose, mean_pose
from symrefine.poses.symmetry import Symmetry


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Canonicalizer:
    """Of all equivalent poses of a symmetric body the one nearest to a reference, or to the frame before.

    A pose X [4, 4] takes the body to where it stands, `x -> R x + t`; its equivalents are X S for the rotations S of
    the group. Nearest is the one with the smallest angle of rotation: all of them put the centre of the operations in
    the same place. Turns about continuous axes are found in closed form.

    A pose of determinant -1, as `symrefine.align` may find it, becomes an equivalent of determinant +1 where the body
    has a mirror or another operation of determinant -1. No other use is made of those: no rigid motion does the same.

    Attributes:
        symmetry: what is known of the body.
    """

    symmetry: Symmetry

    def __init__(self, group: Group, *, center: ArrayLike | None = None) -> None:
        """Read the symmetry of a body.

        Args:
            group: a Schoenflies symbol, for the standard placement; a `PointGroup`, which has a frame; what
                `symrefine.detect` found in space; all operations [N, 3, 3] or [N, 4, 4] of the body, the identity
                among them or not; or the entry of one object in a `models_info.json` of BOP (millimetres).
            center: [3] the point that symbol, `PointGroup` or [N, 3, 3] leave in place, in the coordinates of the body
                and the unit of the poses; the origin if None.

        Raises:
            InputError: nothing of the kind; operations that are no group or do not meet; nothing decided; a centre for
                what has one.
        """
        object.__setattr__(self, "symmetry", symmetry_of(group, center))

    def __call__(self, poses: ArrayLike, *, reference: ArrayLike | None = None) -> Array:
        """The equivalents [..., 4, 4] of poses [..., 4, 4] that are nearest to a reference.

        With a fixed reference the result is the same for all equivalent poses: a canonical form. It cannot be
        continuous: where two equivalents are equally near, a body that moves through jumps from one to the other.
        Sequences are free of that: give the result of the frame before, or take `sequence`.

        Args:
            poses: [..., 4, 4].
            reference: [4, 4], or [..., 4, 4] with one for each; only its rotation matters. The identity if None.

        Raises:
            InputError: what is no pose, or of determinant -1 without an equivalent of +1; shapes that do not fit.
        """
        given = self.symmetry.rigid(poses, "poses")
        return self.symmetry.toward(given, self._rotations(reference, given.shape))

    def sequence(self, poses: ArrayLike, *, reference: ArrayLike | None = None) -> Array:
        """The equivalents [T, ..., 4, 4] of poses [T, ..., 4, 4], each nearest to that of the frame before.

        No step is longer than that of the body. About a continuous axis nothing turns that need not.

        Args:
            poses: [T, ..., 4, 4] at T times, of one body or of several.
            reference: what the first frame is to be near to: the last result, where a sequence comes in parts.

        Raises:
            InputError: what `__call__` refuses; a single pose.
        """
        given = self.symmetry.rigid(poses, "poses")
        if given.ndim < 3:
            raise InputError(f"poses has shape {list(given.shape)}; expected a sequence [T, ..., 4, 4]")
        turns = given[..., :3, :3].swapaxes(-1, -2)
        # With C_t = R_t S_t, nearest to C_(t-1) is S_t = D_t S_(t-1), where D_t is nearest to R_t' R_(t-1): what is
        # turned by an operation has its nearest operation turned by the same. So all D_t are found at once.
        before = np.concatenate([self._rotations(reference, given.shape[1:])[None], given[:-1, ..., :3, :3]])
        chosen = self.symmetry.nearest(turns @ before[: len(given)])
        # What products of many steps have rounded off is put right.
        return self.symmetry.turned(given, self.symmetry.nearest(_running_products(chosen)))

    def mean(self, poses: ArrayLike, *, weights: ArrayLike | None = None) -> MeanPose:
        """The pose [4, 4] nearest to many [N, 4, 4], of each the equivalent that is nearest to it.

        It minimises the sum of the squared chords `|R - R_i S_i|` over R and all choices of S_i, and has its centre
        in the mean of their centres. About a continuous axis it is the mean of the directions of the axis that counts;
        how far the body is turned about it is taken from one of the poses.

        Args:
            poses: [N, 4, 4].
            weights: [N] positive; all the same if None.

        Raises:
            InputError: what is no pose, or no poses; weights that are not positive, or of another number.
        """
        given = self.symmetry.rigid(poses, "poses")
        if given.ndim != 3 or len(given) == 0:
            raise InputError(f"poses has shape {list(given.shape)}; expected [N, 4, 4], N at least 1")
        counts = np.ones(len(given)) if weights is None else numbers(weights, "weights")
        if counts.shape != (len(given),) or not (np.isfinite(counts).all() and counts.min() > 0.0):
            raise InputError(f"weights has shape {list(counts.shape)}; expected {len(given)} positive finite numbers")
        return mean_pose(self.symmetry, given, counts / counts.sum())

    def _rotations(self, reference: ArrayLike | None, shape: tuple[int, ...]) -> Array:
        """The rotations [..., 3, 3] that poses of a shape [..., 4, 4] are to be near to."""
        wanted = np.eye(4) if reference is None else self.symmetry.rigid(reference, "reference")
        try:
            return np.broadcast_to(wanted, shape)[..., :3, :3]
        except ValueError:
            raise InputError(
                f"reference has shape {list(wanted.shape)}; expected [4, 4] or that of the poses, {list(shape)}"
            ) from None

    def __repr__(self) -> str:
        return f"Canonicalizer({self.symmetry.group.name} about {self.symmetry.center.round(6).tolist()})"


def _running_products(factors: Array) -> Array:
    """Products [T, ..., 3, 3] of each factor with all before it, the later ones to the left."""
    products = factors.copy()
    reach = 1
    while reach < len(products):  # each holds those of the last `reach` frames
        products[reach:] = products[reach:] @ products[:-reach]
        reach *= 2
    return products
