"""What a shape is told by: its points, of a mesh the corners of its facets, and the facets between them.

A vertex within a plane part of a mesh, or where every edge goes straight on, says how the mesh was cut, and nothing of
the shape.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from symrefine.fit.distinct import Distinct
from symrefine.fit.facets import Facets
from symrefine.fit.triangles import Triangles
from symrefine.geometry import Array
from symrefine.rounding import SINGLE
from symrefine.shape import Index, Shape
from symrefine.surface.ordered import ordered


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corners:
    """Points [N, 3] in units of a diagonal about a centre, labels of those of a cloud, and what lies between them.

    `facets` are ways to tell one and the same mesh, the most forgiving last; none of a cloud. They are put together
    where they are asked for: where points are mapped.
    """

    points: Array
    labels: Index | None
    facets: tuple[Callable[[], Facets], ...]

    def bend_under(self, moved: Sequence[Index]) -> float | None:
        """By how much facets miss one another besides their corners; None if some are mapped onto none.

        Args:
            moved: the images [N] of all points under each of some operations.
        """
        if not self.facets:
            return 0.0
        for put_together in self.facets:
            facets = put_together()
            here = facets.prints(np.arange(len(self.points)))
            if all(np.array_equal(facets.prints(image), here) for image in moved):
                return facets.bend
        return None


def corners(shape: Shape, center: Array, diagonal: float, within: float) -> Iterator[Corners]:
    """The corners of the facets of a mesh, if some of its vertices are none, and then all of its points.

    Args:
        center: [3] where the points told are counted from.
        diagonal: input units.
        within: by what fraction of it points may be off the plane or the line that they are taken to lie in.
    """
    own = Distinct.of(shape, center, diagonal, weld=SINGLE)
    if shape.faces is None:
        yield Corners(points=own.points, labels=own.labels, facets=())
        return
    triangles = Triangles.of(own.points, *_once(own.back[shape.faces], shape.labels))
    thick = triangles.only(~triangles.slivers(SINGLE))
    flat = Facets.flat(thick, within)
    least = flat.straight(own.points, within)
    if 0 < len(ends := least.corners) < len(own.points):
        renumbered = cache(lambda: replace(least, edges=np.searchsorted(ends, least.edges)))
        yield Corners(points=own.points[ends], labels=None, facets=(renumbered,))
    single = cache(lambda: Facets.single(triangles.faces, triangles.labels))
    yield Corners(points=own.points, labels=None, facets=(single, lambda: flat))


def _once(faces: Index, labels: Index | None) -> tuple[Index, Index]:
    """Triangles [F, 3], each once, whichever way round, and their labels [F]: twice the same surface is the surface."""
    kinds = np.zeros(len(faces), dtype=np.int64) if labels is None else labels
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    columns = [low, a + b + c - low - high, high, kinds]
    order, first = ordered(columns[::-1])
    told = order[first]
    return np.column_stack([column[told] for column in columns[:3]]), kinds[told]
