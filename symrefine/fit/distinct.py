"""The distinct points of a shape: those that files write again for every face are one."""

from dataclasses import dataclass

import numpy as np

from symrefine.geometry import Array, unit
from symrefine.groups.standard import GOLDEN
from symrefine.shape import Index, Shape
from symrefine.surface.neighbourhoods import connected_parts
from symrefine.surface.ordered import ordered
from symrefine.surface.tree import pairs_within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Distinct:
    """The distinct points (and labels) of a shape, in units of a diagonal about a centre.

    `rows` [M] are those of the distinct points in the shape, `back` [N] tells which of them each point is. Labels are
    numbered from 0.
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
        labels = None
        if shape.labels is not None and shape.faces is None:
            labels = np.unique(shape.labels, return_inverse=True)[1]
        # Round numbers, of which designs are full, lie nowhere near the walls of this grid.
        place = np.floor(local / weld + GOLDEN) if weld else local
        order, first = ordered([*place.T] if labels is None else [*place.T, labels])
        rows: Index = order[first]
        back: Index = np.empty(len(order), dtype=np.intp)
        back[order] = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(order))))
        if weld:
            one, other = _touching(local[rows], weld).T
            alike = np.ones(len(one), dtype=bool) if labels is None else labels[rows[one]] == labels[rows[other]]
            if alike.any():
                part = connected_parts(one[alike], other[alike], len(rows))
                rows, back = rows[np.unique(part, return_index=True)[1]], part[back]
        return cls(points=local[rows], rows=rows, back=back, labels=None if labels is None else labels[rows])


def _touching(points: Array, radius: float) -> Index:
    """All pairs [P, 2] of points [N, 3] that are no farther apart than a radius, where few are.

    They stand as near along any line. Along one in which no lattice has two points at one place few others do, so that
    a tree, which takes ten times as long, is asked only where many do.
    """
    along = points @ unit(np.sqrt([1.0, 2.0, 3.0]))
    order = np.argsort(along)
    along, columns = along[order], np.take(points.T, order, axis=1)
    here, found = np.arange(len(points)), [np.empty((0, 2), dtype=np.intp)]
    for step in range(1, len(points).bit_length() + 1):
        here = here[: np.searchsorted(here, len(points) - step)]
        here = here[along[here + step] - along[here] <= radius]
        if not len(here):
            return np.concatenate(found)
        apart = np.take(columns, here, axis=1) - np.take(columns, here + step, axis=1)
        near = here[np.sqrt((apart**2).sum(axis=0)) <= radius]
        found.append(np.column_stack([order[near], order[near + step]]))
    return pairs_within(points, radius)
