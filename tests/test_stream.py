"""Clouds in chunks: moments as of all at once, files as `load` reads them, answers as in memory, bounded memory."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import symrefine
from experiments.objects.poses import Pose
from experiments.objects.shapes import SHAPES, sample
from symrefine.clock import watched
from symrefine.detection.sketch import MANY, SAMPLE, sketched
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.lengths import relative_tolerance
from symrefine.load import load, stream, stream_if_large
from symrefine.load.stream import STREAMED
from symrefine.moments.moments import central_moments
from symrefine.moments.running import running_moments
from symrefine.shape import Shape
from symrefine.stream import CHUNK, Stream

SEEDS = st.integers(0, 2**32 - 1)


def cloud(name="table", count=2 * MANY, noise=0.003, seed=0):
    rng = np.random.default_rng(seed)
    return Pose.random(rng).of(sample(SHAPES[name][0](), count, noise, rng))


def chunked(points, weights, size):
    return ((points[i : i + size], weights[i : i + size]) for i in range(0, len(points), size))


@pytest.mark.slow
@settings(max_examples=20, phases=[Phase.explicit, Phase.generate])
@given(SEEDS, st.sampled_from([1, 2, 17, 100, 1000]), st.sampled_from([0.0, 1.0, 1e6]))
def test_moments_of_chunks_are_those_of_all(seed, size, away):
    """Also of a scan that begins in a corner, far from the origin: chunks of single points, of ordered ones, of all."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((600, 3)) * rng.uniform(0.1, 2, 3)
    points = points[np.argsort(points[:, 0])] + away
    weights = rng.random(len(points)) * (rng.random(len(points)) > 0.2)
    found = running_moments(chunked(points, weights, size), 8, parts=16)
    whole = central_moments(points, weights, 8)
    # What rounding of the coordinates themselves leaves, to the eighth power.
    close = {"rtol": 1e-9, "atol": 1e-11 * (1.0 + away) * np.abs(whole.values).max()}
    np.testing.assert_allclose(found.values, whole.values, **close)
    np.testing.assert_allclose(found.center, whole.center, atol=1e-13 * (1.0 + away))
    assert found.scale == pytest.approx(whole.scale, rel=1e-12 * (1.0 + away))


def test_replicates_of_chunks_tell_the_noise_of_moments():
    """Their spread is that of the moments over many samples of one shape, within what 15 degrees of freedom allow."""
    rng = np.random.default_rng(2)
    samples = [rng.standard_normal((4000, 3)) * (1.0, 2.0, 0.5) for _ in range(60)]
    moments = [running_moments(chunked(s, np.ones(len(s)), 700), 4, parts=16) for s in samples]
    spread = np.std([m.values for m in moments], axis=0)
    told = np.mean(
        [np.sqrt(15.0 / 16.0 * ((m.replicates - m.replicates.mean(0)) ** 2).sum(0)) for m in moments], axis=0
    )
    moving = spread > 1e-6
    assert 0.7 < np.median(told[moving] / spread[moving]) < 1.4


def test_points_that_coincide_have_no_moments():
    with pytest.raises(DegenerateShapeError, match="do not spread"):
        running_moments(chunked(np.ones((50, 3)), np.ones(50), 7), 8, parts=4)
    with pytest.raises(DegenerateShapeError, match="do not spread"):
        running_moments(iter(()), 8, parts=4)


def test_a_sample_takes_one_of_every_run_whatever_the_order():
    points = np.arange(3.0 * 7 * SAMPLE).reshape(-1, 3)
    found = sketched(Stream.of(points), seed=3)
    steps = np.diff(found.picked)
    assert len(found.picked) == SAMPLE
    assert steps.min() >= 1
    assert steps.max() <= 13
    np.testing.assert_array_equal(found.sample.points, points[found.picked])
    np.testing.assert_array_equal([found.low, found.high], [points[0], points[-1]])
    assert (sketched(Stream.of(points), seed=3).picked == found.picked).all()
    assert (sketched(Stream.of(points), seed=4).picked != found.picked).any()


def near(found, other, size):
    """Whether two answers agree as two samples of one object do."""
    assert found.point_group == other.point_group
    assert np.linalg.norm(found.center - other.center) < 2e-3 * size
    for plane in found.planes:
        assert max(abs(plane.plane.normal @ p.plane.normal) for p in other.planes) > np.cos(np.radians(0.3))


@pytest.mark.parametrize(
    ("name", "noise"),
    [
        ("table", 0.0),
        *(pytest.param(*k, marks=pytest.mark.slow) for k in (("stool5", 0.005), ("mug", 0.002), ("asymmetric", 0.0))),
    ],
)
def test_answers_of_chunks_are_those_in_memory(name, noise):
    points = cloud(name, 3 * MANY, noise)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    parts = Stream(count=len(points), read=lambda: iter(np.array_split(points, 41)))
    streamed, held = symrefine.detect(parts), symrefine.detect(points)
    alone = symrefine.detect(points[np.random.default_rng(1).choice(len(points), MANY, replace=False)])
    near(streamed, alone, size)
    near(held, alone, size)
    assert (streamed.sample.of, held.sample.of, alone.sample) == (len(points), len(points), None)
    again, records = symrefine.detect(Stream.of(points, source="stream")), []
    for record in (streamed.to_dict(), again.to_dict()):
        del record["timings"]
        records.append(record)
    assert records[0] == records[1]  # whatever the length of the chunks


@pytest.mark.slow
def test_up_to_a_hundred_thousand_points_all_are_looked_at():
    assert symrefine.detect(cloud(count=MANY)).sample is None
    assert symrefine.detect(Stream.of(cloud(count=MANY))).shape.points.shape == (MANY, 3)


@pytest.mark.slow
def test_strays_and_clumps_are_found_among_all_points():
    rng = np.random.default_rng(4)
    body = cloud(count=3 * MANY, noise=0.002)
    size = np.ptp(body, axis=0).max()
    strays = body.mean(axis=0) + size * unit_vectors(rng, 600) * rng.uniform(1.0, 2.0, (600, 1))
    clump = body.mean(axis=0) + [1.5 * size, 0.0, 0.0] + 0.03 * size * rng.standard_normal((9000, 3))
    points = np.concatenate([body, strays, clump])
    order = rng.permutation(len(points))
    found = symrefine.detect(points[order])
    truth = np.flatnonzero(order >= len(body))
    assert found.point_group == "C4v"
    assert np.isin(truth, found.outliers).mean() > 0.98
    assert np.isin(found.outliers, truth).mean() > 0.98
    assert found.outlier_share == pytest.approx(len(truth) / len(points), rel=0.02)
    streamed = symrefine.detect(Stream.of(points[order]))
    assert streamed.point_group == "C4v"
    assert streamed.outlier_share == pytest.approx(len(truth) / len(points), rel=0.1)
    left_out = streamed.shape.points[streamed.outliers]
    assert (left_out[:, None] == points[len(body) :]).all(axis=2).any(axis=1).mean() > 0.98


def unit_vectors(rng, count):
    vectors = rng.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.slow
def test_a_stray_that_no_sample_sees_does_not_decide():
    """One point of 300,000 at fifty diagonals would be all that moments of order 8 tell."""
    points = cloud(count=3 * MANY)
    far = points.mean(axis=0) + 50.0 * np.ptp(points, axis=0)
    with_stray = np.insert(points, 123_457, far, axis=0)
    found = symrefine.detect(with_stray)
    assert found.point_group == "C4v"
    assert 123_457 in found.outliers
    assert symrefine.detect(Stream.of(with_stray)).point_group == "C4v"


def test_weights_normals_and_labels_come_along():
    points = cloud(count=2 * MANY, noise=0.0)
    upper = points @ np.linalg.eigh(np.cov(points.T))[1][:, 0]
    labels = (upper > np.median(upper)).astype(int)
    found = symrefine.detect(Shape(points, labels=labels, weights=np.full(len(points), 2.0)))
    assert found.surface.cloud.labels is not None
    assert len(found.surface.cloud.points) == len(found.surface.cloud.labels)
    with pytest.raises(InputError, match="knows of no labels"):
        symrefine.detect(Shape(points, labels=labels), verify="all")


@pytest.mark.slow
def test_all_points_say_what_the_sample_cannot():
    """Of a table over which 20 points hang, on one side."""
    points = cloud(count=2 * MANY, noise=0.0)
    clean = symrefine.detect(points, verify="all")
    assert clean.verified.points == len(points)
    assert clean.verified.beyond == 0
    over = clean.axes[0].axis.direction + 0.3 * clean.planes[0].plane.normal
    bump = clean.center + 0.8 * clean.diagonal * over
    bumpy = np.concatenate([points, bump + 1e-3 * np.random.default_rng(0).standard_normal((20, 3))])
    found = symrefine.detect(bumpy, verify="all", outliers="none")
    assert found.point_group == clean.point_group
    assert 10 <= found.verified.beyond <= 20
    assert found.verified.residual.max > 0.9 * 5.55 * found.tolerance > clean.verified.residual.max
    assert found.to_dict()["verified"]["beyond"] == found.verified.beyond
    streamed = symrefine.detect(Stream.of(bumpy), verify="all", outliers="none")
    assert streamed.verified.points == len(bumpy)


def test_what_is_no_cloud_is_not_verified():
    with pytest.raises(InputError, match="is for clouds"):
        symrefine.detect((np.eye(3), [[0, 1, 2]]), verify="all")
    with pytest.raises(InputError, match="expected 'sample' or 'all'"):
        symrefine.detect(np.eye(3), verify="some")


def test_points_gone_through_are_told():
    told = []
    with watched(lambda *_: None, counting=lambda done, of: told.append((done, of))):
        symrefine.detect(Stream.of(cloud(count=2 * MANY)))
    *passes, (done, of) = told
    assert passes == [(min(done, 2 * MANY), 2 * MANY) for done in range(CHUNK, 2 * MANY + CHUNK, CHUNK)]
    assert done == of < MANY, "the moments of the sample"


@pytest.mark.parametrize(
    ("chunks", "said"),
    [
        ([np.zeros((3, 2))], r"a chunk has shape \(3, 2\)"),
        ([np.full((3, 3), "a")], "expected"),
        ([np.eye(3), np.array([[0.0, np.nan, 1.0]])], r"point 3 is \[0.0, nan, 1.0\]"),
        ([np.eye(3), np.array([[0.0, 1e61, 1.0]])], r"point 3 is .*; coordinates must be finite and at most 1e\+60"),
        ([np.eye(3)], "4 points were announced; 3 are there"),
        ([np.eye(3), np.eye(3)], "4 points were announced; 6 are there"),
    ],
)
def test_chunks_of_another_form_are_refused(chunks, said):
    with pytest.raises(InputError, match=said):
        list(Stream(count=4, read=lambda: iter(chunks)))


@pytest.mark.parametrize("count", [4.0, "4"])
def test_counts_that_are_none_are_refused(count):
    with pytest.raises(InputError, match=r"count is .*4.*; expected how many points there are"):
        Stream(count=count, read=lambda: iter([np.eye(3)]))


def test_points_that_come_one_by_one_are_taken_together():
    points = np.arange(3.0 * (CHUNK + 5)).reshape(-1, 3)
    found = [*Stream(count=len(points), read=lambda: (p[None] for p in points))]
    assert [len(chunk) for chunk in found] == [CHUNK, 5]
    assert np.array_equal(np.concatenate(found), points)


def test_a_stream_that_does_not_spread_is_told_by_name():
    with pytest.raises(DegenerateShapeError, match=r"^scan\.npy: the points do not spread"):
        symrefine.detect(Stream.of(np.ones((CHUNK, 3)), source="scan.npy"))


def test_arrays_of_another_form_are_refused():
    for array in (np.zeros((5, 2)), np.zeros(5), np.zeros((5, 3), dtype=complex)):
        with pytest.raises(InputError, match="expected numbers"):
            Stream.of(array)
    with pytest.raises(InputError, match="at least two"):
        Stream.of(np.zeros((1, 3)))


def ply_bytes(points, kind="<f4", extra=True):
    """A binary cloud, with a colour between the coordinates if `extra`."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[kind[0]]
    type_ = {"f4": "float", "f8": "double"}[kind[1:]]
    fields = [("x", kind), ("red", "u1"), ("y", kind), ("z", kind)] if extra else [(c, kind) for c in "xyz"]
    rows = np.zeros(len(points), dtype=fields)
    for column, c in zip(points.T, "xyz", strict=True):
        rows[c] = column
    properties = "".join(f"property {'uchar' if n == 'red' else type_} {n}\n" for n, _ in fields)
    header = f"ply\nformat {name} 1.0\nelement vertex {len(points)}\n{properties}element face 0\n"
    return (header + "property list uchar int vertex_indices\nend_header\n").encode() + rows.tobytes()


def las_file(path, points):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-4), points.min(axis=0)
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(path)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """One cloud of several chunks in every format, as `load` reads it too."""
    folder = tmp_path_factory.mktemp("clouds")
    points = cloud(count=2 * CHUNK + 1000) + 1000.0
    np.save(folder / "c.npy", points)
    np.save(folder / "single.npy", points.astype(np.float32))
    np.save(folder / "fortran.npy", np.asfortranarray(points))
    np.save(folder / "whole.npy", np.rint(1000 * points).astype(np.int32))
    (folder / "little.ply").write_bytes(ply_bytes(points))
    (folder / "big.ply").write_bytes(ply_bytes(points, ">f8", extra=False))
    las_file(folder / "c.las", points)
    las_file(folder / "c.laz", points)
    return folder


NAMES = ("c.npy", "single.npy", "fortran.npy", "whole.npy", "little.ply", "big.ply", "c.las", "c.laz")


@pytest.mark.parametrize("name", NAMES)
def test_files_in_chunks_are_what_load_reads(files, name):
    found = stream(files / name)
    chunks = list(found)
    assert len(chunks) >= 3
    np.testing.assert_array_equal(np.concatenate(chunks), load(files / name).points)
    np.testing.assert_array_equal(np.concatenate(list(found)), np.concatenate(chunks))


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("c.laz", "fortran.npy")])
@pytest.mark.parametrize("change", [-7, 7])
def test_files_that_are_cut_off_or_too_long_are_refused_before_they_are_read(files, tmp_path, name, change):
    data = (files / name).read_bytes()
    damaged = tmp_path / name
    damaged.write_bytes(data[:change] if change < 0 else data + bytes(40))
    with pytest.raises(InputError, match=str(damaged)):
        stream(damaged)


def test_a_packed_scan_that_is_cut_off_is_refused_while_it_is_read(files, tmp_path):
    damaged = tmp_path / "c.laz"
    damaged.write_bytes((files / "c.laz").read_bytes()[:-20000])
    with pytest.raises(InputError, match=str(damaged)):
        list(stream(damaged))


def test_what_is_no_cloud_in_chunks_is_refused(files, tmp_path):
    (tmp_path / "mesh.ply").write_text("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n")
    np.save(tmp_path / "plane.npy", np.zeros((9, 2)))
    (tmp_path / "c.obj").write_text("v 0 0 0\n")
    for name in ("mesh.ply", "plane.npy", "c.obj"):
        with pytest.raises(InputError, match="cannot be read in chunks"):
            stream(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        stream(tmp_path / "none.npy")
    (tmp_path / "huge.npy").write_bytes((files / "c.npy").read_bytes()[:-8] + np.float64(1e70).tobytes())
    with pytest.raises(InputError, match=r"huge.npy: point \d+ is .*1e\+70\]; coordinates must be finite and at most"):
        list(stream(tmp_path / "huge.npy"))


def test_only_large_files_are_read_in_chunks_unasked(files, tmp_path):
    assert stream_if_large(files / "c.npy") is None
    assert stream_if_large(tmp_path / "none.npy") is None
    large = np.lib.format.open_memmap(tmp_path / "l.npy", mode="w+", dtype=np.int8, shape=(STREAMED + 1, 3))
    assert large.nbytes < 2**22
    large[1::2] = 1
    large.flush()
    assert stream_if_large(tmp_path / "l.npy") is None  # fewer bytes than so many points have in any scan
    np.save(tmp_path / "l.npy", large.astype(np.float32))
    found = stream_if_large(tmp_path / "l.npy")
    assert found is not None
    assert found.count == STREAMED + 1


@pytest.fixture(scope="module")
def million(tmp_path_factory):
    path = tmp_path_factory.mktemp("large") / "table.npy"
    np.save(path, cloud(count=2 * STREAMED, noise=0.003).astype(np.float32))
    return path


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="there is no /proc to ask for memory")
def test_the_command_reads_large_files_in_chunks(million):
    """In less memory than the points alone would take as a `Shape`, above what the command takes anyway."""
    program = (
        "import atexit, sys; from symrefine.cli import main; status = open('/proc/self/status')\n"
        "atexit.register(lambda: print(*[s for s in status if 'VmHWM' in s], file=sys.stderr)); sys.exit(main())"
    )
    command = [sys.executable, "-c", program, "detect", str(million), "-v", "--json", "-"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    record = json.loads(done.stdout)
    assert record["point_group"] == "C4v"
    assert record["sample"] == {"points": SAMPLE, "of": 2 * STREAMED}
    assert re.search(r"pass [\d.]+ s, 2,000,000 points, [\d,]+ points/s", done.stderr)
    assert int(done.stderr.split("VmHWM:")[1].split()[0]) < 300 * 1024


def test_a_tolerance_in_units_is_told_by_the_sample(million):
    told = relative_tolerance("0.01u", stream(million))
    assert told == pytest.approx(relative_tolerance("0.01u", load(million)), rel=0.03)
