"""Colours to classes: those that a person would call the same become one.

A texture is never exact: scans and compression scatter each colour, and one shade runs into the next. So classes are
balls around the densest colours: the densest colour takes all within `NEAR` of it, then the densest of those left, and
so on, until less than `RARE` of the object is left anywhere; then each colour belongs to the nearest of these centres.
Chains of neighbours do not grow into one class, and a few stray pixels make none.
"""

import numpy as np

from symrefine.geometry import Array
from symrefine.load.content import Values
from symrefine.shape import Index

# Distance in the cube of red, green and blue, each from 0 to 255: a quarter of the way from black to a full primary
# colour. It spans scatter of 18 in each channel (99 % come within 3.4 times that), and keeps brown from red.
NEAR = 64.0
# Of the surface, or of the points: fewer make no class of their own, as the tolerance would forgive them anyway.
RARE = 0.01
# Colours are counted in cells of this size.
_CELL = 8.0


def colour_classes(colours: Values, weights: Array) -> Index:
    """Classes [N], counted from 0, the densest first.

    Args:
        colours: [N, 3] finite red, green, blue: from 0 to 255, from 0 to 65535 if any is above 255, or fractions if
            they are floating-point numbers up to 1.
        weights: [N] how much of the object each colour covers, not negative.
    """
    from scipy.spatial import cKDTree

    scaled = _eight_bit(colours)
    # Some weight for all: what covers nothing needs a class too, but makes none.
    share = weights / max(weights.sum(), np.finfo(float).tiny) + 1e-12
    cell = np.unique(np.floor(scaled / _CELL), axis=0, return_inverse=True)[1].reshape(-1)
    mass = np.bincount(cell, share).astype(np.float64)
    means = np.stack([np.bincount(cell, share * channel) for channel in scaled.T], axis=1) / mass[:, None]
    found = cKDTree(_centres(means, mass)).query(scaled)[1]
    return np.asarray(found, dtype=np.int64)


def _centres(colours: Array, mass: Array) -> Array:
    """Centres [K, 3] of the classes."""
    from scipy.sparse import coo_array, eye_array
    from scipy.spatial import cKDTree

    tree = cKDTree(colours)
    one, other = tree.query_pairs(NEAR / 2, output_type="ndarray").T
    near = coo_array((np.ones(len(one)), (one, other)), shape=(len(mass), len(mass))).tocsr()
    near = near + near.T + eye_array(len(mass), format="csr")
    free = mass.copy()
    centres: list[Array] = []
    while not centres or free.sum() > 0.0:
        density = near @ free
        peak = int(np.argmax(density))
        if centres and density[peak] < RARE * mass.sum():
            break
        around = near.indices[near.indptr[peak] : near.indptr[peak + 1]]
        centre = (free[around] @ colours[around]) / density[peak]
        free[tree.query_ball_point(centre, NEAR)] = 0.0
        free[around] = 0.0
        centres.append(centre)
    return np.array(centres)


def _eight_bit(colours: Values) -> Array:
    """Colours on the scale from 0 to 255."""
    values = colours.astype(np.float64)
    top = values.max()
    if colours.dtype.kind == "f" and top <= 1.0:
        return values * 255.0
    return values / 257.0 if top > 255.0 else values
