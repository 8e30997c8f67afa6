"""Orthogonal Procrustes over corresponding n-tuples: the map between two objects in closed form, in any dimension.

Minimises `sum_i w_i |t_i - R s_i|^2` over all R of O(n) (Schoenemann 1966; Tahri, sec. "Reflection transformation and
symmetry"): with U S V' the singular value decomposition of `M = sum_i w_i t_i s_i'`, the minimiser is R = U V'
of either determinant. No point correspondences enter; the n-tuples are the correspondences.
"""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, ReadOnly
from symrefine.ntuples.contract import NTuples
from symrefine.ntuples.rank import FLOOR

# Singular values of M beyond what independent noise would give, over its standard deviation, count as determined: the
# tuples share few moments, and at three a propeller of 10,000 points is taken as fixed 34 degrees off.
SIGNIFICANT = 5.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Procrustes(ReadOnly):
    """The orthogonal map that n-tuples determine, and how far they do.

    Attributes:
        matrix: [n, n] minimiser over O(n), determinant +1 or -1 as it comes out.
        flipped: [n, n] the minimiser of the other determinant.
        singular_values: [n] of M; a turn by an angle a in the plane of directions i and j costs
            `2 (s_i + s_j) (1 - cos a)` in units of the noise variance, the other determinant `4 s_n`.
        target_directions: [n, n] the columns of U as rows: where in the target each singular value stands.
        significance: singular value that noise alone does not reach; its square where all tuples are off by as much.
    """

    matrix: Array
    flipped: Array
    singular_values: Array
    target_directions: Array
    significance: float

    @property
    def rank(self) -> int:
        """How many directions the tuples determine beyond their noise; n - 1 fix all but the determinant."""
        return int((self.singular_values > self.significance).sum())

    @property
    def free(self) -> Array:
        """Orthonormal directions [n - rank, n] of the target within which any orthogonal map is as good."""
        return np.asarray(self.target_directions[self.rank :])


def procrustes(source: NTuples, target: NTuples) -> Procrustes:
    """Orthogonal map with `target ~ R source`, weighted by the sampling noise of both sides."""
    weights = 1.0 / (source.noise**2 + target.noise**2 + FLOOR**2)
    u, s, vt = np.linalg.svd((target.vectors * weights[:, None]).T @ source.vectors)
    mirror = np.diag([*np.ones(len(s) - 1), -1.0])
    return Procrustes(
        matrix=u @ vt,
        flipped=u @ mirror @ vt,
        singular_values=s,
        target_directions=u.T,
        significance=float(SIGNIFICANT * np.sqrt(len(weights))),
    )
