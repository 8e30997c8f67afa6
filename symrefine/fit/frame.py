"""A frame polished on the moments alone: Gauss-Newton on SO(3), noise-weighted, before any point is matched."""

import numpy as np

from symrefine.fit.gauss_newton import Linearisation, minimise
from symrefine.geometry import Array
from symrefine.moments.action import FLOOR, Harmonics, flattened, row_variance, turned_by

# Longest step (radians): what the linear model covers.
LONGEST = 0.15


def polish_frame(harmonics: dict[int, Array], frame: Array, fold: int, *, steps: int = 6) -> Array:
    """Turn a C_bv frame until the moments that break the group vanish: Gauss-Newton on SO(3), noise-weighted.

    In the frame, the invariant coefficients are cos(m phi) with b | m; every other one is a residual whose derivative
    under a small rotation is the generator applied to the coefficients. For fold 1 the group is Cs with normal p1.

    Args:
        harmonics: c[p,l,m] with jackknife replicates, about the centre the axis passes through.
        frame: rows (p0, p1, u), determinant +1.
        fold: b.

    Returns: the polished frame, rows (p0, p1, u).
    """
    values, rows = flattened(harmonics)
    action = Harmonics(rows=rows)
    m = np.concatenate([np.arange(-l, l + 1) for l in rows])
    weights = ((m < 0) | (m % fold != 0)) / (row_variance(values[1:], rows) + FLOOR)

    def linearise(turned: Array) -> Linearisation:
        here = action.turned(turned[None], values[:1])[:, 0]
        jacobian = action.tangents(here)[0]
        weighted = jacobian * weights
        return Linearisation(
            cost=float(weights @ here[0] ** 2), gradient=weighted @ here[0], hessian=weighted @ jacobian.T
        )

    found = minimise(
        linearise,
        frame,
        move=lambda f, step: turned_by(f[None], step[None])[0],
        max_steps=steps,
        longest=LONGEST,
    )
    return found.x
