"""What each part of a shape weighs in its moments: points, areas, and classes that must match."""

from dataclasses import replace

import numpy as np

from symrefine.geometry import Array
from symrefine.moments.moments import Moments, shape_moments
from symrefine.moments.quadrature import mesh_nodes
from symrefine.shape import Index, Shape, kinds_of_mass

# Order of the moments.
ORDER = 8


def heavy(shape: Shape) -> Shape:
    """The points that weigh anything."""
    return shape if shape.weights is None else shape.chosen(np.flatnonzero(shape.weights > 0.0))


def classes_of(shape: Shape) -> Index | None:
    """Classes 0, 1, ... of the points (faces, for a mesh) that must match: labels, and masses where points are few."""
    kinds = [] if shape.labels is None else [shape.labels]
    if shape.atoms and shape.weights is not None:
        kinds.append(kinds_of_mass(shape.weights))
    if not kinds:
        return None
    classes = np.unique(np.stack(kinds), axis=1, return_inverse=True)[1].reshape(-1)
    return classes if classes.any() else None


def masses(shape: Shape) -> Array:
    """Masses [N] of the points of a cloud, where each class has a density of its own."""
    classes = classes_of(shape)
    return shape.masses if classes is None else shape.masses * density_of(classes)


def density_of(classes: Index) -> Array:
    """Densities of classes [N]: multiples of the golden ratio modulo 1 keep any number of them apart."""
    return np.asarray(0.5 + np.modf(0.6180339887498949 * (classes + 1))[0])


def class_moments(
    shape: Shape, classes: Index | None, parts: int, order: int = ORDER, density: Array | None = None
) -> Moments:
    """Moments of the shape in which each class has a density of its own, so that they know one class from another.

    With `density` [F] each face of a mesh has one, too.
    """
    if classes is None and density is None:
        return shape_moments(shape, order, parts=parts)
    each = np.ones(1) if classes is None else density_of(classes)
    if shape.faces is None:
        return shape_moments(replace(shape, weights=shape.masses * each), order, parts=parts)
    each = each if density is None else each * density
    nodes, weights = mesh_nodes(replace(shape, measure="surface"), order)
    heavier = weights * np.repeat(each, len(weights) // len(each))
    return shape_moments(Shape(points=shape.points[0] + nodes, weights=heavier), order)
