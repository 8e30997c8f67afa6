"""The demo finds its four planes, writes what it says it writes, and fails when it finds something else."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.studies import demo
from symrefine.detection.story import detect
from symrefine.groups import point_group
from symrefine.load import load


def run(out: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr("sys.argv", ["demo", "--out", str(out)])
    return demo.main()


def test_demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a" / "b"
    assert run(out, monkeypatch) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "Found C4v: four mirror planes" in printed.out
    written = {"table.ply", "report.json", "picture.png", "recording.rrd", "report.html"}
    assert {p.name for p in out.iterdir()} == written
    assert all(name in printed.out for name in written)
    assert len(json.loads((out / "report.json").read_text(encoding="utf-8"))["planes"]) == 4


def test_demo_fails_when_it_finds_something_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def mistaken(shape: Any) -> Any:
        found = detect(shape)
        return replace(found, planes=found.planes[:2], point_group="C2v", group=point_group("C2v"))

    monkeypatch.setattr(demo, "detect", mistaken)
    assert run(tmp_path, monkeypatch) == 1
    assert "something is wrong" in capsys.readouterr().err


def test_planes_of_the_demo_are_true() -> None:
    """What it compares with is where the planes are: they hold the axis, and the middle of the cloud."""
    points, truth = demo.make(np.random.default_rng(demo.SEED))
    middle = points.mean(axis=0)
    for normal in truth.normals:
        assert abs(normal @ truth.axis) < 1e-12
        assert abs((middle - truth.middle) @ normal) < 0.01 * np.ptp(points, axis=0).max()


def test_ply_keeps_every_bit(tmp_path: Path) -> None:
    points = np.random.default_rng(0).standard_normal((50, 3)) * 1e5
    demo.write_ply(tmp_path / "x.ply", points)
    assert np.array_equal(load(tmp_path / "x.ply").points, points)
