"""Hyperplanes of symmetry in any dimension, and the rank of the n-tuples."""

import json
from pathlib import Path

import numpy as np
import pytest

from symrefine.cli import invoke
from symrefine.errors import DegenerateShapeError, InputError
from symrefine.geometry import Array
from symrefine.subspace import detect_nd

DIMENSIONS = [4, 5, 6]


def pose(dim: int, rng: np.random.Generator) -> Array:
    return np.linalg.qr(rng.normal(size=(dim, dim)))[0]


def mirrored(dim: int, count: int, rng: np.random.Generator) -> Array:
    """Points with their images in the first coordinate."""
    half = rng.normal(size=(count // 2, dim))
    return np.concatenate([half, half * np.where(np.arange(dim) == 0, -1.0, 1.0)])


def blobs(dim: int, count: int, rng: np.random.Generator, *, mirror: bool) -> Array:
    """Samples of a few round clouds, or of these and their images in the first coordinate."""
    centers, sizes = rng.normal(size=(dim + 2, dim)), rng.uniform(0.1, 0.3, dim + 2)
    which = rng.integers(dim + 2, size=count)
    points = centers[which] + sizes[which][:, None] * rng.normal(size=(count, dim))
    if mirror:
        points[rng.random(count) < 0.5, 0] *= -1
    return points


def off_deg(normal: Array, truth: Array) -> float:
    return float(np.degrees(np.arccos(min(1.0, abs(normal @ truth)))))


@pytest.mark.parametrize("dim", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_exact_points_with_a_hyperplane(dim: int, scale: float) -> None:
    rng = np.random.default_rng([dim, int(scale)])
    turn, shift = pose(dim, rng), rng.normal(size=dim)
    found = detect_nd(scale * (mirrored(dim, 60, rng) @ turn.T + shift))
    assert len(found.hyperplanes) == 1
    plane = found.hyperplanes[0].plane
    assert off_deg(plane.normal, turn[:, 0]) < 1e-2
    assert plane.offset == pytest.approx(scale * float(plane.normal @ shift), abs=1e-4 * scale)
    assert found.hyperplanes[0].miss < 1e-3


@pytest.mark.parametrize("dim", DIMENSIONS)
@pytest.mark.parametrize("seed", range(3))
def test_exact_points_without_symmetry(dim: int, seed: int) -> None:
    found = detect_nd(np.random.default_rng([dim, seed]).normal(size=(60, dim)))
    assert found.hyperplanes == ()
    assert not found.undetermined
    assert min(h.miss for h in found.rejected) > 0.02


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_rank_at_a_fine_tolerance(dim: int) -> None:
    rng = np.random.default_rng(dim)
    assert detect_nd(mirrored(dim, 60, rng), tolerance=1e-5).fixed.rank == dim - 1
    assert detect_nd(rng.normal(size=(60, dim)), tolerance=1e-5).fixed.rank == dim


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_one_point_out_of_place_breaks_it(dim: int) -> None:
    rng = np.random.default_rng(dim)
    points = mirrored(dim, 60, rng)
    points[3] += 0.2 * pose(dim, rng)[0] * np.linalg.norm(points, axis=1).max()
    assert detect_nd(points).hyperplanes == ()
    assert len(detect_nd(points, tolerance=0.2).hyperplanes) >= 1


def test_several_hyperplanes() -> None:
    """The corners of a box in 4-space have one across each edge."""
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 4), axis=-1).reshape(-1, 4)
    turn = pose(4, np.random.default_rng(0))
    found = detect_nd(signs * [1.0, 1.4, 1.9, 2.5] @ turn.T)
    assert len(found.hyperplanes) == 4
    assert found.fixed.rank == 0
    assert all(min(off_deg(h.plane.normal, t) for t in turn.T) < 0.01 for h in found.hyperplanes)


@pytest.mark.parametrize("dim", [4, 5])
def test_samples(dim: int) -> None:
    rng = np.random.default_rng([dim, 9])
    turn = pose(dim, rng)
    found = detect_nd(blobs(dim, 60_000, rng, mirror=True) @ turn.T + 5.0)
    assert len(found.hyperplanes) == 1
    assert not found.undetermined
    assert off_deg(found.hyperplanes[0].plane.normal, turn[:, 0]) < 1.0
    without = detect_nd(blobs(dim, 60_000, rng, mirror=False) @ turn.T)
    assert without.hyperplanes == ()
    assert not without.undetermined


def test_few_samples_are_not_decided() -> None:
    found = detect_nd(blobs(4, 400, np.random.default_rng(1), mirror=True))
    assert found.hyperplanes == ()
    assert "give more points" in found.undetermined


def test_what_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="9 coordinates; detect_nd takes points of 2 to 8 coordinates"):
        detect_nd(rng.normal(size=(40, 9)))
    with pytest.raises(InputError, match=r"tolerance is 0\.5"):
        detect_nd(rng.normal(size=(40, 4)), tolerance=0.5)
    with pytest.raises(DegenerateShapeError):
        detect_nd(np.ones((40, 4)))


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(3)
    turn = pose(4, rng)
    path = tmp_path / "x.npy"
    np.save(path, mirrored(4, 60, rng) @ turn.T)
    assert invoke(["detect", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f"{path}: 1 hyperplane of symmetry in 4 dimensions" in shown
    assert invoke(["detect", str(path), "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["schema"] == "symrefine.detection_nd/1"
    assert record["ntuples"]["rank"] <= 3
    assert off_deg(np.array(record["hyperplanes"][0]["normal"]), turn[:, 0]) < 1e-2
    assert invoke(["detect", str(path), "--bop", str(tmp_path / "b.json")]) == 2
    assert f"is for objects in space; {path} has 4 coordinates, use --json" in capsys.readouterr().err
    np.save(path, rng.normal(size=(40, 9)))
    assert invoke(["detect", str(path)]) == 2
    assert "9 coordinates; detect_nd takes points of 2 to 8 coordinates" in capsys.readouterr().err
