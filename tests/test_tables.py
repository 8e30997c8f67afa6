"""Tables of text: semicolons, tabs, decimal commas and index columns; what could mean two things is refused."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from symrefine.errors import InputError
from symrefine.load import load

POINTS = np.array([[0.5, 1.25, -3.0], [1e-7, 2.0, 1e20], [-0.125, 7.0, 0.1]])


def written(points: np.ndarray, delimiter: str, *, comma: bool = False, title: list[str] | None = None) -> str:
    """A table by the csv module, as other programs would write it."""
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=delimiter)
    if title is not None:
        writer.writerow(title)
    index = [[k] for k in range(len(points))] if title is not None and len(title) > points.shape[1] else [[]] * 99
    for number, row in zip(index, points.tolist(), strict=False):
        writer.writerow([*number, *(repr(value).replace(".", ",") if comma else repr(value) for value in row)])
    return stream.getvalue()


def loaded(folder: Path, text: str, name: str = "a.csv", **options: str):
    (folder / name).write_text(text, newline="")
    return load(folder / name, **options)


@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a.CSV"])
@pytest.mark.parametrize("title", [None, ["x", "y", "z"], ["", "x", "y", "z"], ["ID", "X", "Y", "Z"],
                                   ["index", "x", "y", "z"], ["Unnamed: 0", "x", "y", "z"]], ids=str)  # fmt: skip
@pytest.mark.parametrize(("delimiter", "comma"), [(",", False), (";", False), (";", True), ("\t", False)])
def test_what_is_written_is_read(tmp_path: Path, name: str, title: list[str] | None, delimiter: str, comma: bool):
    text = written(POINTS, delimiter, comma=comma, title=title)
    assert np.array_equal(loaded(tmp_path, text, name).points, POINTS)


@given(
    points=arrays(np.float64, st.tuples(st.integers(2, 9), st.integers(2, 4)), elements=st.floats(-1e60, 1e60),
                  unique=True),
    comma=st.booleans(),
)  # fmt: skip
def test_decimal_commas_lose_no_digit(tmp_path_factory: pytest.TempPathFactory, points: np.ndarray, comma: bool):
    assume(np.ptp(points, axis=0).max() > 1e-50)  # what is smaller is refused for its unit
    folder = tmp_path_factory.getbasetemp()
    assert np.array_equal(loaded(folder, written(points, ";", comma=comma)).points, points)


def test_white_space_stays_white_space(tmp_path: Path):
    for text in ("0 0\t 0\n1 2\t3\n", "  0\t0 0\n\t1 2 3\n", "\t0\t0\t0\n\t1\t2\t3\n", "0\t0\t0\t\n1\t2\t3\n"):
        assert loaded(tmp_path, text, "a.txt").points.tolist() == [[0, 0, 0], [1, 2, 3]]
    assert loaded(tmp_path, "0,\t0,\t0\n1,\t2,\t3\n").points.tolist() == [[0, 0, 0], [1, 2, 3]]


def test_normals_labels_and_weights_between_semicolons(tmp_path: Path):
    text = "id;x;y;z;nx;ny;nz;part;mass\np1;0,5;0;0;0;0;1;a, b;1,5\np2;1,5;0;0;0;0;1;c;2,5\n"
    shape = loaded(tmp_path, text, labels="part", weights="mass")
    assert shape.points.tolist() == [[0.5, 0, 0], [1.5, 0, 0]]
    assert shape.normals.tolist() == [[0, 0, 1]] * 2
    assert (shape.labels.tolist(), shape.weights.tolist()) == ([0, 1], [1.5, 2.5])
    # The index can be asked for as any column can.
    assert loaded(tmp_path, "id,x,y\n7,0,0\n9,1,1\n", weights="id").weights.tolist() == [7, 9]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,5;2,5\n1.5;2\n", "line 1 has commas in decimals, line 2 points; expected one of them"),
        ("1.000,5;2\n3;4\n", "line 1 has commas in decimals, line 1 points; expected one of them, and no separators"),
        ("1,000,5;2\n3;4\n", "line 1, column 1: '1.000.5' is not a number"),
        ("1;2\n3;;4\n", "line 2, column 2: '' is not a number"),
        ("1;2\n3;4;5\n", "line 2 has 3 columns, the lines above have 2"),
        ("1;2\n3,4\n", "line 2 has 1 column, the lines above have 2"),
        ("x;y\n1;2;3\n", "line 2 has 3 columns; expected 2 columns as in the first line"),
        ("x\ty\tz\n1\t2\t3\n1\t\t3\n", "line 3, column 2: '' is not a number"),
        ("\tx\ty\n0\t1\t2\n\t1\t2\n", "line 3, column 1: is empty"),
        ("1,5\t2,5\n1,5\t3\n", "line 1: '1,5\\t2,5' has tabs and commas; expected one of them between columns"),
        ("x,y,id\n1,2,3\n", "line 1: columns 'x,y,id'; expected x,y or x,y,z"),
        ("id,index,x,y\n1,1,2,3\n", "line 1: columns 'index,x,y'; expected x,y or x,y,z"),
        ("id;x\n1;2\n", "line 1: columns 'x'; expected x,y or x,y,z"),
        ("id,x,y\n1,2\n", "line 2 has 2 columns; expected 3 columns as in the first line"),
        ("id,x,y\n1,2,nan\n4,5,6\n", "point 0 (line 2) is [2.0, nan]"),
    ],
)
def test_what_could_mean_two_things_is_refused(tmp_path: Path, text: str, message: str):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
