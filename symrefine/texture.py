"""Texture: the colour of every place on a triangle mesh, from images that texture coordinates point into.

Colours also become classes: those that a person would call the same become one.

A texture is never exact: scans and compression scatter each colour, and one shade runs into the next. So classes are
balls around the densest colours: the densest colour takes all within the tolerance of it, then the densest of those
left, and so on, until less than `RARE` of the object is left anywhere; then each colour belongs to the nearest of these
centres. Chains of neighbours do not grow into one class, and a few stray pixels make none.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrefine.errors import InputError
from symrefine.geometry import Array

Pixels = NDArray[np.uint8]
# Distance in the cube of red, green and blue, each from 0 to 255, up to which colours are the same: a quarter of the
# way from black to a full primary colour. It spans scatter of 18 in each channel (99 % come within 3.4 times that), and
# keeps brown from red.
COLOUR_TOLERANCE = 64.0
# Of the surface, or of the points: fewer make no class of their own, as the tolerance would forgive them anyway.
RARE = 0.01
# Colours are counted in cells of this size.
_CELL = 8.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Texture:
    """What colours the triangles of a mesh.

    Attributes:
        images: [H, W, 3] red, green, blue from 0 to 255 each.
        uv: [T, 3, 2] of the corners of the triangles, u to the right and v upwards over the image, which fills the unit
            square and repeats beyond it.
        image: [T] which image a triangle shows; -1 where it is of one colour.
        plain: [T, 3] that colour, 0 to 255.

    Raises:
        InputError: shapes that do not fit, coordinates that are not finite, no such image.
    """

    images: tuple[Pixels, ...]
    uv: Array
    image: NDArray[np.integer[Any]]
    plain: Array

    def __post_init__(self) -> None:
        count = len(self.image)
        if self.uv.shape != (count, 3, 2) or self.plain.shape != (count, 3):
            raise InputError(
                f"texture: uv {self.uv.shape} and plain {self.plain.shape} of {count} triangles; expected "
                f"({count}, 3, 2) and ({count}, 3)"
            )
        if count and not -1 <= int(self.image.min()) <= int(self.image.max()) < len(self.images):
            raise InputError(f"texture: image {int(self.image.max())}; there are {len(self.images)}")
        if not np.isfinite(self.uv[self.image >= 0]).all():
            raise InputError("texture: coordinates are not finite")

    def colours(self, triangle: NDArray[np.integer[Any]], weights: Array) -> Array:
        """Colours [N, 3], 0 to 255, of places on triangles [N] given by the weights [N, 3] of their corners."""
        found = self.plain[triangle].astype(np.float64)
        shown = self.image[triangle]
        u, v = np.einsum("nk,nkd->nd", weights, np.where((shown >= 0)[:, None, None], self.uv[triangle], 0.0)).T
        for number, pixels in enumerate(self.images):
            here = np.flatnonzero(shown == number)
            height, width = pixels.shape[:2]
            column = np.minimum((np.mod(u[here], 1.0) * width).astype(np.int64), width - 1)
            row = np.minimum((np.mod(1.0 - v[here], 1.0) * height).astype(np.int64), height - 1)
            found[here] = pixels[row, column]
        return found

    def chosen(self, triangles: NDArray[Any]) -> "Texture":
        """The texture of some of the triangles."""
        return Texture(
            images=self.images, uv=self.uv[triangles], image=self.image[triangles], plain=self.plain[triangles]
        )


def corner_weights(places: Array, corners: Array) -> Array:
    """Weights [N, 3] of the corners [N, 3, 3] of triangles at the points of these that are next to places [N, 3].

    Of the plane of a triangle, the nearest weights inside it: where a place lies beside it, next to its border.
    """
    a, b, c = (corners[:, k] for k in range(3))
    edges = np.stack([b - a, c - a], axis=2)
    gram = np.einsum("nik,nil->nkl", edges, edges)
    # Slivers have no second direction of their own: the smallest that is above rounding keeps them solvable.
    gram[:, [0, 1], [0, 1]] += 1e-14 * np.trace(gram, axis1=1, axis2=2)[:, None] + np.finfo(float).tiny
    right = np.einsum("nik,ni->nk", edges, places - a)
    inner = np.linalg.solve(gram, right[..., None])[..., 0]
    weights = np.clip(np.column_stack([1.0 - inner.sum(axis=1), inner]), 0.0, None)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def colour_classes(colours: NDArray[Any], weights: Array) -> NDArray[np.int64]:
    """Classes [N], counted from 0, the densest first.

    Args:
        colours: [N, 3] finite red, green, blue: from 0 to 255, from 0 to 65535 if any is above 255, or fractions if
            they are floating-point numbers up to 1.
        weights: [N] how much of the object each colour covers, not negative.
    """
    from scipy.spatial import cKDTree

    scaled = eight_bit(colours)
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
    one, other = tree.query_pairs(COLOUR_TOLERANCE / 2, output_type="ndarray").T
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
        free[tree.query_ball_point(centre, COLOUR_TOLERANCE)] = 0.0
        free[around] = 0.0
        centres.append(centre)
    return np.array(centres)


def eight_bit(colours: NDArray[Any]) -> Array:
    """Colours on the scale from 0 to 255."""
    values = colours.astype(np.float64)
    top = values.max()
    if colours.dtype.kind == "f" and top <= 1.0:
        return values * 255.0
    return values / 257.0 if top > 255.0 else values
