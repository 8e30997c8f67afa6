"""What texture says of an operation: how far one must go from where it puts a place to find the colour of that place.

Colours that differ by less than a tolerance are the same, as compression, light and age differ too. So a texture is
judged by lengths, as the shape is, with the same limits: a detail of colour in a small part of the surface is forgiven
as one of shape is, and an edge between two colours may be out of place by as much.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symrefine.geometry import Array, Isometry, ReadOnly
from symrefine.samples import GLANCE
from symrefine.shape import Index
from symrefine.surface.misses import needs
from symrefine.surface.neighbourhoods import NEIGHBOURS
from symrefine.surface.tree import Tree
from symrefine.texture import COLOUR_TOLERANCE, Texture, corner_weights

# Samples next to a place whose triangles it may lie on.
FACES = 3
# Of how many operations the worst is allowed for at a glance: a few samples miss by chance.
CHANCES = 1000
_NO_NOISE = np.array([])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Painted(ReadOnly):
    """Samples of a textured mesh in normalised units.

    Attributes:
        points: [N, 3].
        colours: [N, 3], 0 to 255.
        corners: [T, 3, 3] of the triangles.
        face: [N] triangle of each sample.
        texture: of the triangles.
        diagonal: by which misses are measured, normalised units.
        tree: kd-tree over the points.
    """

    points: Array
    colours: Array
    corners: Array
    face: Index
    texture: Texture
    diagonal: float
    tree: Tree

    @classmethod
    def of(cls, points: Array, face: Index, corners: Array, texture: Texture, diagonal: float) -> "Painted":
        """Samples [N, 3] on triangles [N], with the colours that the texture gives them."""
        return cls(
            points=points,
            colours=texture.colours(face, corner_weights(points, corners[face])),
            corners=corners,
            face=face,
            texture=texture,
            diagonal=diagonal,
            tree=Tree(points),
        )

    def misses(self, motions: Sequence[Isometry], *, sources: int, bound: float) -> list[Array]:
        """How far off the colours of samples are where each of K operations puts them, [M] of the diagonal each.

        Args:
            motions: the operations.
            sources: samples that are moved; fewer where these tell that an operation needs more than `bound`.
            bound: a tolerance.
        """
        seen = [self._misses(m, GLANCE) for m in motions]
        return [
            miss if needs(miss, _NO_NOISE, tests=CHANCES) > bound else self._misses(m, sources)
            for m, miss in zip(motions, seen, strict=True)
        ]

    def _misses(self, motion: Isometry, sources: int) -> Array:
        some = slice(None, None, max(1, len(self.points) // sources))
        return self._off(motion.apply(self.points[some]), self.colours[some])

    def _off(self, places: Array, colours: Array) -> Array:
        off = np.flatnonzero(_differ(self._colours_at(places), colours))
        found = np.zeros(len(places))
        if off.size:
            away, near = self.tree.query(places[off], min(NEIGHBOURS[-1], len(self.points)))
            away = np.where(_differ(self.colours[near], colours[off, None]), away[:, -1:], away)
            found[off] = away.min(axis=1) / self.diagonal
        return found

    def _colours_at(self, places: Array) -> Array:
        """Colours [Q, 3] of the surface next to places [Q, 3]."""
        near = self.face[self.tree.query(places, min(FACES, len(self.points)))[1]].reshape(len(places), -1)
        corners = self.corners[near.ravel()]
        weights = corner_weights(np.repeat(places, near.shape[1], axis=0), corners)
        feet = np.einsum("nk,nkd->nd", weights, corners).reshape(*near.shape, 3)
        best = np.linalg.norm(feet - places[:, None], axis=2).argmin(axis=1)
        chosen = np.arange(len(places)) * near.shape[1] + best
        return self.texture.colours(near.ravel()[chosen], weights[chosen])


def needed(misses: Sequence[Array]) -> Array:
    """The smallest tolerances [K] at which K operations hold that miss the colours so; a mesh has no noise."""
    return np.array([needs(miss, _NO_NOISE, tests=len(misses)) for miss in misses])


def _differ(a: Array, b: Array) -> Any:
    return np.linalg.norm(a - b, axis=-1) > COLOUR_TOLERANCE
