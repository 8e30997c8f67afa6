"""Facets: how a plane part of a mesh was cut into triangles is nothing of the mesh."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from symrefine.fit.facets import Facets
from symrefine.fit.triangles import Triangles
from symrefine.geometry import random_orthogonal, unit

WITHIN = 1e-5
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
ONE_WAY, OTHER_WAY = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 1, 3], [1, 2, 3]])


def told(points, faces, labels=None, within=WITHIN):
    """Of which facet triangles are, and what tells the facets."""
    labels = np.zeros(len(faces), dtype=int) if labels is None else np.asarray(labels)
    facets = Facets.flat(Triangles.of(points, faces, labels), within)
    return facets.of, facets.prints(np.arange(len(points)))


def same(points, first, second, **options):
    """Whether two triangulations make the same facets."""
    own, other = (set(told(points, faces, **options)[1].tolist()) - {0} for faces in (first, second))
    return own == other


@pytest.mark.parametrize("seed", range(3))
def test_a_plane_part_is_one_however_it_is_cut(seed):
    rng = np.random.default_rng(seed)
    points = SQUARE @ random_orthogonal(rng) + rng.standard_normal(3)
    assert len(np.unique(told(points, ONE_WAY)[0])) == 1
    assert same(points, ONE_WAY, OTHER_WAY)
    assert same(points, ONE_WAY, OTHER_WAY[:, ::-1])
    fan = np.concatenate([points, [points.mean(axis=0)]])
    assert len(np.unique(told(fan, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))[0])) == 1


def test_four_corners_in_no_plane_are_cut_one_way_or_the_other():
    bent = SQUARE + [[0, 0, 0.0], [0, 0, 0.0], [0, 0, 1e-3], [0, 0, 0.0]]
    assert len(np.unique(told(bent, ONE_WAY)[0])) == 2
    assert not same(bent, ONE_WAY, OTHER_WAY)
    assert same(bent, ONE_WAY, OTHER_WAY, within=1e-2)


def test_what_lies_on_itself_or_is_another_thing_is_not_one():
    folded = np.array([[0, 1, 2], [0, 1, 3]])  # both on the same side of the edge that they share
    assert len(np.unique(told(SQUARE, folded)[0])) == 2
    assert len(np.unique(told(SQUARE, ONE_WAY, labels=[4, 5])[0])) == 2


def test_a_facet_is_told_by_its_edges_alone():
    """A box without its top has the edges of one without its bottom, and is another one."""
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
    faces = ConvexHull(corners).simplices
    ends = corners[faces][:, :, 2]
    top, bottom = (ends == 3.0).all(axis=1), (ends == 0.0).all(axis=1)
    assert top.sum() == bottom.sum() == 2
    assert len(np.unique(told(corners, faces)[0])) == 6
    assert not same(corners, faces[~top], faces[~bottom])
    order = np.random.default_rng(0).permutation(len(faces))
    assert np.array_equal(told(corners, faces)[1], told(corners, np.roll(faces, 1, axis=1)[order])[1])


def test_what_bends_little_by_little_is_no_facet():
    sphere = unit(np.random.default_rng(1).standard_normal((3000, 3)))
    faces = ConvexHull(sphere).simplices
    facet, _ = told(sphere, faces, within=3e-3)  # next to one another nearly all lie in one plane
    assert len(np.unique(facet)) == len(faces)


def test_a_facet_that_lies_on_itself_is_another_one_than_one_within_the_same_edges():
    """Edges without a sense do not tell how often they go round a place; found by an attack."""
    corners = [[0.47, 0.01], [0.96, 0.58], [0.41, 0.05], [-0.09, 0.1], [0.89, -0.66], [0.89, 0.08], [-0.63, 0.05]]
    points = np.column_stack([corners, np.zeros(7)])
    first = np.array([[0, 4, 6], [0, 4, 5], [0, 1, 6], [0, 3, 5], [1, 3, 5]])
    second = np.array([[0, 4, 5], [0, 1, 5], [0, 4, 6], [0, 3, 6], [1, 3, 6]])
    assert rim(first) == rim(second)
    assert not same(points, first, second)


def rim(faces):
    """Edges of an odd number of triangles."""
    edges = [tuple(sorted((int(f[k - 1]), int(f[k])))) for f in faces for k in range(3)]
    return {edge for edge in edges if edges.count(edge) % 2}


def test_a_triangle_with_one_corner_twice_stands_for_itself():
    """Two of its sides are one edge, so that it is beside nothing but itself; a file may have no other triangle."""
    alone = Triangles.of(np.eye(3)[:2], np.array([[0, 1, 1]]), np.zeros(1, dtype=int))
    assert len(Facets.flat(alone, 1e-9).labels) == 1
