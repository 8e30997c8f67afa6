"""What a mesh proves does not hang on vertices within its faces or on its straight edges, nor on how it was cut."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import symrefine
from symrefine.fit.corners import corners
from symrefine.fit.vertices import ROUNDED, exact_symmetry
from symrefine.geometry import random_orthogonal, rotation, unit
from symrefine.groups import is_subgroup
from symrefine.shape import Shape
from tests.surfaces import distance_to_mesh

BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.7, 0.7) for z in (-0.4, 0.4)])


def hull(points):
    """A convex mesh: points [N, 3] and triangles [F, 3], which lie in one plane where more than three points do."""
    return points, ConvexHull(points).simplices


def prism(sides, height=0.6, *, twist=0.0):
    angles = 2.0 * np.pi * np.arange(sides) / sides
    rings = [
        np.column_stack([np.cos(angles + t), np.sin(angles + t), np.full(sides, z)])
        for t, z in ((0.0, -height), (twist, height))
    ]
    return hull(np.concatenate(rings))


def on_an_edge(points, faces, rng, *, straight=True):
    """One more vertex, on an edge or a diagonal of a plane face, and the triangles there cut in two."""
    face = faces[rng.integers(len(faces))]
    a, b = rng.permutation(face)[:2]
    t = rng.uniform(0.2, 0.8)
    new = (1.0 - t) * points[a] + t * points[b]
    own = ((faces == a) | (faces == b)).sum(axis=1) == 2
    halves = [np.where(faces[own] == end, len(points), faces[own]) for end in (a, b)]
    return np.concatenate([points, [new if straight else 1.01 * new]]), np.concatenate([faces[~own], *halves])


def inside(points, faces, rng, *, raised=0.0):
    """One more vertex within a triangle, which is cut in three, or out of its plane."""
    k = rng.integers(len(faces))
    corners_of = points[faces[k]]
    normal = unit(np.cross(corners_of[1] - corners_of[0], corners_of[2] - corners_of[0]))
    new = rng.dirichlet([2.0, 2.0, 2.0]) @ corners_of + raised * normal
    thirds = [np.where(np.arange(3) == side, len(points), faces[k]) for side in range(3)]
    return np.concatenate([points, [new]]), np.concatenate([np.delete(faces, k, axis=0), thirds])


def cut(mesh, rng, count):
    for _ in range(count):
        mesh = (on_an_edge, inside)[rng.integers(2)](*mesh, rng)
    return mesh


def posed(mesh, rng, scale=1.0, **others):
    points, faces = mesh
    return Shape(scale * (points @ random_orthogonal(rng).T + rng.standard_normal(3)), rng.permutation(faces), **others)


def proven(shape):
    """The name of what is proven, C1 if nothing is."""
    found = exact_symmetry(shape, shape.diagonal)[1]
    return "C1" if found is None else found.group.name


SOLIDS = {
    "D2h": hull(BOX),
    "Oh": hull(unit(BOX * [1.0, 1.0 / 0.7, 1.0 / 0.4])),
    "D5h": prism(5),
    "D6d": prism(6, twist=np.pi / 6),
    "D3": prism(3, twist=0.4),
    "Td": hull(np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])),
}


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(4))
def test_vertices_within_faces_and_on_edges_say_nothing(name, seed):
    rng = np.random.default_rng(seed)
    shape = posed(cut(SOLIDS[name], rng, 1 + 8 * seed), rng, 10.0 ** (2 * seed - 3))
    _, found = exact_symmetry(shape, shape.diagonal)
    assert (found.group.name, found.faces) == (name, True)
    assert found.miss < 1e-13
    few = next(iter(corners(shape, shape.points.mean(axis=0), shape.diagonal, ROUNDED)))
    assert len(few.points) == len(SOLIDS[name][0])


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_vertex_out_of_its_face_or_edge_counts(name, seed):
    rng = np.random.default_rng(seed)
    mesh = cut(SOLIDS[name], rng, 3)
    raised = posed(inside(*mesh, rng, raised=1e-3), rng)
    assert proven(raised) in ("C1", "Cs", "C2", "C3", "C2v")
    assert proven(raised) != name
    keeps(raised)
    off = posed(on_an_edge(*mesh, rng, straight=False), rng)
    assert proven(off) != name
    keeps(off)


@pytest.mark.parametrize("tolerance", [1e-4, 0.02])
def test_a_box_with_one_vertex_more_is_told_at_any_tolerance(tolerance):
    rng = np.random.default_rng(8)
    for more in (on_an_edge, inside):
        found = symrefine.detect(posed(more(*hull(BOX), rng), rng, 30.0), tolerance=tolerance)
        assert (found.point_group, found.exact.faces, found.confidence > 0.95) == ("D2h", True, True)
        assert found.exact.miss < 1e-14


def test_where_labels_meet_in_a_plane_there_is_an_edge():
    """One side of a box of another colour, however it is cut, leaves two mirrors; a part of it what keeps the part."""
    rng = np.random.default_rng(4)
    points, faces = cut(hull(BOX), rng, 20)
    lid = (points[faces][:, :, 2] > 0.4 - 1e-12).all(axis=1)
    assert proven(posed((points, faces), rng)) == "D2h"
    turned = rng.permutation(len(faces))
    assert proven(Shape(points, faces[turned], labels=lid[turned].astype(int))) == "C2v"
    one = np.arange(len(faces)) == np.flatnonzero(lid)[0]
    assert proven(Shape(points, faces, labels=one.astype(int))) == "C1"


def test_an_open_box_keeps_its_opening():
    rng = np.random.default_rng(5)
    points, faces = cut(hull(BOX), rng, 20)
    lid = (points[faces][:, :, 2] > 0.4 - 1e-12).all(axis=1)
    shape = posed((points, faces[~lid]), rng)  # of the lid some vertices may be left, of no face
    assert proven(shape) == "C2v"


def test_a_corner_on_an_edge_of_others_is_sound_and_a_triangle_without_area_is_none():
    """Half a face more to one side of a box, whose corners lie on edges of the box that have no vertex there."""
    points, faces = hull(BOX)
    middle = np.array([[1.0, 0.0, -0.4], [1.0, 0.0, 0.4]])
    assert proven(Shape(np.concatenate([points, middle]), faces)) == "D2h"
    # A tab that stands on a line across a face, from an edge to the other.
    tab = np.concatenate([points, middle, middle + [0.3, 0.0, 0.0]])
    shape = Shape(tab, np.concatenate([faces, [[8, 9, 10], [9, 10, 11]]]))
    assert proven(shape) == "C2v"
    keeps(shape)
    # The gap between an edge with a vertex on one side and none on the other, closed by a triangle without area.
    own = ((faces == 0) | (faces == 1)).sum(axis=1) == 2
    assert own.sum() == 2
    k = np.flatnonzero(own)[0]
    halves = [np.where(faces[k] == end, 8, faces[k]) for end in (0, 1)]
    there = np.concatenate([points, [0.3 * points[0] + 0.7 * points[1]]])
    for more in ([], [[0, 8, 1]]):
        split = np.concatenate([np.delete(faces, k, axis=0), halves, np.array(more, dtype=int).reshape(-1, 3)])
        assert proven(posed((there, split), np.random.default_rng(1))) == "D2h"


def test_a_needle_that_stands_out_counts_however_thin_it_is():
    points, faces = hull(BOX)
    tip = np.concatenate([points, [[1.0, 0.7, 0.9], [1.0, 0.7, 0.6]]])
    shape = Shape(tip, np.concatenate([faces, [[7, 8, 9]]]))
    assert proven(shape) == "C1"


@pytest.mark.slow
def test_a_round_outline_is_not_straight_though_its_steps_nearly_are():
    """Sides that bend by less than rounding each, and by a quarter of a circle together."""
    angles = np.linspace(0.0, 0.5 * np.pi, 400)
    arc = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(400)])
    shape = Shape(np.concatenate([arc, np.zeros((1, 3))]), np.array([[k, k + 1, 400] for k in range(399)]))
    assert proven(shape) == "C2v"
    keeps(shape)
    few = next(iter(corners(shape, np.zeros(3), shape.diagonal, ROUNDED)))
    assert len(few.points) == 401


def test_doubled_faces_are_the_same_surface():
    rng = np.random.default_rng(2)
    points, faces = cut(hull(BOX), rng, 6)
    twice = np.concatenate([faces, faces[[3, 5, 5]][:, ::-1]])
    assert proven(posed((points, twice), rng)) == "D2h"
    labels = np.append(np.zeros(len(faces), dtype=int), [1, 0, 0])
    assert proven(Shape(points, twice, labels=labels)) != "D2h"


def keeps(shape):
    """Every operation that is proven carries the surface onto itself."""
    found = exact_symmetry(shape, shape.diagonal)[1]
    if found is None:
        return
    rng, corners_of = np.random.default_rng(0), shape.points[shape.faces]
    at = np.einsum("kfi,fij->kfj", rng.dirichlet([0.5, 0.5, 0.5], (20, len(corners_of))), corners_of).reshape(-1, 3)
    for g in found.finite.operations():
        moved = (at - found.center) @ g.T + found.center
        assert distance_to_mesh(moved, corners_of).max() < 1e-4 * shape.diagonal


@pytest.mark.parametrize("seed", range(30))
def test_what_is_proven_of_parts_put_together_anyhow_holds(seed):
    """Boxes, prisms and sheets that overlap, touch and share planes, cut anyhow, faces missing, some doubled."""
    rng = np.random.default_rng(seed)
    points, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
    for _ in range(rng.integers(1, 4)):
        own, around = list(SOLIDS.values())[rng.integers(len(SOLIDS))]
        own = own * rng.choice([0.5, 1.0], 3) @ rotation([0.0, 0.0, 1.0], 0.5 * np.pi * rng.integers(4)).T
        own, around = cut((own + 0.5 * rng.integers(-1, 2, 3), around), rng, rng.integers(4))
        around = around[rng.random(len(around)) < rng.choice([1.0, 0.9])]
        faces = np.concatenate([faces, around + len(points)])
        points = np.concatenate([points, own])
    keeps(posed((points, faces), rng, 7.0))


def test_a_cut_box_proves_no_less_than_its_corners_do():
    """The group of a cut solid is that of the solid, to rounding."""
    rng = np.random.default_rng(9)
    for name, solid in SOLIDS.items():
        turn = random_orthogonal(rng)
        points, faces = cut(solid, rng, 12)
        found = exact_symmetry(Shape(points @ turn.T, faces), 2.0)[1]
        whole = exact_symmetry(Shape(solid[0] @ turn.T, solid[1]), 2.0)[1]
        assert is_subgroup(whole.group, found.group, 1e-9), name
        assert found.finite.name == name
