"""How a finite group permutes points: counterparts that agree with one another, so that orbits close exactly."""

from collections.abc import Iterable

import numpy as np

from symrefine.geometry import Array
from symrefine.shape import Index
from symrefine.surface.tree import Tree, with_class


def mean_back(counterparts: Iterable[Array], operations: Array) -> Array:
    """Means [N, 3] over the group of g^-1 c, the counterparts c [N, 3] given for one operation after the other."""
    return np.asarray(sum(c @ g for g, c in zip(operations, counterparts, strict=True)) / len(operations))


def permutations(points: Array, operations: Array, labels: Index | None, reach: float) -> Index | None:
    """Counterparts [K, N] of points [N, 3] that every operation permutes, up to `reach` away; None where one does not.

    Labels [N], small numbers, tell which may be which. Only generators are looked up, the others follow from them.
    """
    tree = Tree(with_class(points, labels))
    images = np.empty((len(operations), len(points)), dtype=np.intp)
    images[0] = np.arange(len(points))
    known, found = [0], []
    for h, table in generators(operations):
        distance, own = tree.nearest(with_class(points @ operations[h].T, labels))
        if distance.max() > reach or not (np.bincount(own, minlength=len(points)) == 1).all():
            return None
        found.append((table, own))
        waiting = list(known)
        while waiting:
            g = waiting.pop()
            for table, own in found:
                product = int(table[g])
                if product not in known:
                    images[product] = images[g][own]
                    known.append(product)
                    waiting.append(product)
    return images


def generators(operations: Array) -> list[tuple[int, Index]]:
    """Few operations that generate all [K, 3, 3], the identity first: each h with the table of g h for every g."""
    tree = Tree(operations.reshape(len(operations), 9))
    known = np.zeros(len(operations), dtype=bool)
    known[0] = True
    found: list[tuple[int, Index]] = []
    for h in range(1, len(operations)):
        if known[h]:
            continue
        found.append((h, tree.nearest((operations @ operations[h]).reshape(-1, 9))[1]))
        count = 0
        while count < known.sum():
            count = int(known.sum())
            for _, table in found:
                known[table[known]] = True
    return found
