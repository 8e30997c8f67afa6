"""What a Shape accepts, copies and refuses: every mistake is one line that names what is wrong."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from symrefine.errors import DegenerateShapeError, InputError, SymrefineError
from symrefine.shape import Shape

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
NAN, INF = float("nan"), float("inf")


def replaced(value, at):
    array = POINTS.copy()
    array[at] = value
    return array


BAD = {
    "text": ({"points": [["a", "b"], ["c", "d"]]}, "are not numbers in rows"),
    "ragged": ({"points": [[0, 0, 0], [1, 1]]}, "are not numbers in rows"),
    "flat": ({"points": [1.0, 2.0, 3.0]}, r"shape \(3,\).*\[N, n\]"),
    "scalar": ({"points": 1.0}, r"shape \(\)"),
    "one-dimensional": ({"points": [[1.0], [2.0]]}, r"\(2, 1\).*n >= 2"),
    "three axes": ({"points": np.zeros((2, 3, 4))}, r"\(2, 3, 4\)"),
    "empty": ({"points": np.zeros((0, 3))}, "no points"),
    "nan": ({"points": replaced(NAN, (2, 1))}, "1 of 4 points.*row 2"),
    "infinite": ({"points": replaced(INF, (slice(1, 3), 0))}, "2 of 4 points.*row 1"),
    "weights of another length": ({"weights": [1.0, 2.0]}, r"\(2,\).*\(4,\)"),
    "weights in a column": ({"weights": np.ones((4, 1))}, r"\(4, 1\).*\(4,\)"),
    "negative weight": ({"weights": [1, 1, -1, 1]}, "non-negative"),
    "weights all zero": ({"weights": np.zeros(4)}, "not all zero"),
    "weight nan": ({"weights": [1, 1, NAN, 1]}, "finite"),
    "weight infinite": ({"weights": [1, 1, INF, 1]}, "finite"),
    "normals of another length": ({"normals": np.ones((3, 3))}, r"\(3, 3\).*\(4, 3\)"),
    "normal zero": ({"normals": replaced(0.0, 3) + [[1], [1], [1], [0]]}, r"row 3.*\[0.0, 0.0, 0.0\].*non-zero"),
    "normal nan": ({"normals": np.full((4, 3), NAN)}, "row 0.*finite"),
    "face out of range": ({"faces": [[0, 1, 4]], "measure": "surface"}, "index 4 .*4 vertices"),
    "quads": ({"faces": [[0, 1, 2, 3]], "measure": "surface"}, r"\(1, 4\).*\[F, 3\]"),
    "faces of floats": ({"faces": [[0.0, 1.0, 2.0]], "measure": "surface"}, "float64.*integers"),
    "no faces": ({"faces": np.zeros((0, 3), int), "measure": "surface"}, "F >= 1"),
    "faces in the plane": (
        {"points": POINTS[:, :2], "faces": [[0, 1, 2]], "measure": "surface"},
        "3-space.*2 coordinates",
    ),
    "weights of a mesh": ({"faces": FACES, "weights": np.ones(4)}, "weights is for clouds"),
    "normals of a mesh": ({"faces": FACES, "normals": np.ones((4, 3))}, "normals is for clouds"),
    "mesh measured by its points": ({"faces": FACES, "measure": "points"}, "measure is 'points'.*'surface' or 'solid'"),
    "cloud with a measure": ({"measure": "solid"}, "measure is 'solid'.*a cloud"),
}


@pytest.mark.parametrize(("changes", "message"), BAD.values(), ids=BAD)
def test_bad_input_raises_one_line(changes, message):
    with pytest.raises(InputError, match=message) as caught:
        Shape(**({"points": POINTS, "source": "file.ply"} | changes))
    text = str(caught.value)
    assert text.startswith("file.ply: ")
    assert "\n" not in text
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, SymrefineError)


@pytest.mark.parametrize("points", [np.ones((5, 3)), [[2.0, 3.0]], np.full((2, 4), 1e6)], ids=["same", "one", "far"])
def test_points_that_coincide_are_degenerate(points):
    with pytest.raises(DegenerateShapeError, match="two distinct points") as caught:
        Shape.of(points)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("points", [[[0, 0], [1, 0]], ((0.0, 1, 2), (3, 4, 5)), POINTS.astype(np.float32), POINTS.T])
def test_anything_numpy_reads_as_a_matrix_is_taken(points):
    shape = Shape.of(points)
    np.testing.assert_array_equal(shape.points, np.asarray(points, dtype=np.float64))
    assert shape.points.dtype == np.float64
    assert shape.dim == np.shape(points)[1]
    assert (shape.weights, shape.normals, shape.faces, shape.measure) == (None, None, None, "points")


def test_some_of_the_points_keep_what_is_known_of_each():
    rng = np.random.default_rng(4)
    given = {"weights": rng.random(9), "normals": rng.normal(size=(9, 3)), "labels": np.arange(9)}
    shape = Shape(points=rng.random((9, 3)), viewpoint=np.array([0.0, 0.0, 9.0]), unit="mm", **given)
    some = shape.chosen(np.array([7, 2, 5]))
    for name in ("points", *given, "viewpoint"):
        np.testing.assert_allclose(getattr(some, name), getattr(shape, name)[[7, 2, 5]], atol=1e-15)
    assert (some.unit, some.faces) == ("mm", None)
    assert Shape(points=shape.points).chosen(np.arange(3)).weights is None


def test_diagonal_is_that_of_the_axis_aligned_box():
    assert Shape.of(POINTS + 7.0).diagonal == pytest.approx(np.sqrt(1 + 4 + 9))


def test_normals_become_unit_vectors_and_keep_their_sign():
    given = np.array([[0, 0, -2.0], [3, 0, 0], [1e-12, 0, 0], [1, 1, 1]])
    normals = Shape.of(POINTS, normals=given).normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(normals * np.linalg.norm(given, axis=1)[:, None], given, atol=1e-15)


def test_nothing_is_shared_with_the_caller_and_nothing_can_be_written():
    points, weights, normals, faces = POINTS.copy(), np.ones(4), np.ones((4, 3)), np.array(FACES)
    shape, mesh = Shape(points=points, weights=weights, normals=normals), Shape(points, faces)
    for array in (points, weights, normals, faces):
        array[0] = 3
    np.testing.assert_array_equal(shape.points, POINTS)
    np.testing.assert_array_equal(shape.weights, np.ones(4))
    np.testing.assert_allclose(shape.normals, 1 / np.sqrt(3))
    np.testing.assert_array_equal(mesh.faces, FACES)
    for array in (shape.points, shape.weights, shape.normals, mesh.points, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(FrozenInstanceError):
        shape.measure = "solid"


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.int64])
def test_faces_of_any_integer_type_become_int64(dtype):
    assert Shape(points=POINTS, faces=np.array(FACES, dtype), measure="solid").faces.dtype == np.int64


UNREPORTED = {
    "weights of text": ({"weights": ["a", "b", "c", "d"]}, "weights"),
    "normals of text": ({"normals": [["a"] * 3] * 4}, "normals"),
    "faces ragged": ({"faces": [[0, 1, 2], [0, 1]], "measure": "surface"}, "faces"),
    "negative face index": ({"faces": [[0, 1, -1]], "measure": "surface"}, "index -1"),
    "unknown measure": ({"faces": FACES, "measure": "volume"}, "'volume'"),
    "complex": ({"points": POINTS * 1j}, "points"),
}


@pytest.mark.parametrize(("changes", "message"), UNREPORTED.values(), ids=UNREPORTED)
def test_these_mistakes_raise_one_line_too(changes, message):
    with pytest.raises(InputError, match=message):
        Shape(**({"points": POINTS} | changes))


def test_a_shape_reads_as_points_and_faces():
    mesh = Shape(POINTS, FACES)
    assert mesh.measure == "surface"
    assert Shape(POINTS).measure == "points"
    np.testing.assert_array_equal(mesh.faces, FACES)
