"""The distinct points of a shape: those that files write again for every face are one."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from symrefine.geometry import Array
from symrefine.groups.standard import GOLDEN
from symrefine.shape import Index, Shape
from symrefine.surface.tree import pairs_within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Distinct:
    """The distinct points (and labels) of a shape, in units of a diagonal about a centre.

    `rows` [M] are those of the distinct points in the shape, `back` [N] tells which of them each point is.
    """

    points: Array
    rows: Index
    back: Index
    labels: Index | None

    @classmethod
    def of(cls, shape: Shape, center: Array, diagonal: float, *, weld: float = 0.0) -> "Distinct":
        """The labels of a cloud tell points apart, those of a mesh are of its faces.

        Points in one cell of a grid of `weld` are one, if that is not 0, and so are cells whose first points are no
        farther apart: whatever the grid, some of those that touch lie on two sides of its walls.
        """
        local = (shape.points - center) / diagonal
        labels = shape.labels if shape.faces is None else None
        # Round numbers, of which designs are full, lie nowhere near the walls of this grid.
        place = np.floor(local / weld + GOLDEN) if weld else local
        key = place if labels is None else np.column_stack([place, labels])
        order = np.lexsort(key.T[::-1])
        first = np.append(True, (np.diff(key[order], axis=0) != 0.0).any(axis=1))
        rows: Index = order[first]
        back: Index = np.empty(len(key), dtype=np.intp)
        back[order] = np.cumsum(first) - 1
        if weld:
            one, other = pairs_within(local[rows], weld).T
            alike = np.ones(len(one), dtype=bool) if labels is None else labels[rows[one]] == labels[rows[other]]
            if alike.any():
                part = connected(len(rows), one[alike], other[alike])
                rows, back = rows[np.unique(part, return_index=True)[1]], part[back]
        return cls(points=local[rows], rows=rows, back=back, labels=None if labels is None else labels[rows])


def connected(count: int, one: Index, other: Index) -> Index:
    """Which connected part each of so many things is of, where pairs are connected; numbered as they come."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    return cast(Index, connected_components(graph, directed=False)[1].astype(np.intp))
