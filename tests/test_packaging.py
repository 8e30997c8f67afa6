"""Wheel and sdist: what is in them, and that the one comes from the other."""

import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.metadata import Metadata

ROOT = Path(__file__).resolve().parents[1]
pytestmark = pytest.mark.slow


def built(source: Path, out: Path, *targets: str) -> list[Path]:
    """What hatchling makes of a tree."""
    chosen = [option for target in targets for option in ("-t", target)]
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(out), *chosen]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return sorted(out.iterdir())


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(ROOT, tmp_path_factory.mktemp("sdist"), "sdist")[0]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(ROOT, tmp_path_factory.mktemp("wheel"), "wheel")[0]


def tracked(folder: str) -> Iterator[str]:
    """Files that belong to the package, as paths from the root."""
    for path in (ROOT / folder).rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            yield path.relative_to(ROOT).as_posix()


def test_wheel_holds_the_package_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        about = next(n for n in names if n.endswith(".dist-info/METADATA")).rpartition("/")[0]
        assert {n for n in names if not n.startswith(about)} == set(tracked("symrefine"))
        assert "symrefine/py.typed" in names
        assert f"{about}/licenses/LICENSE" in names
        assert "symrefine = symrefine.cli:main" in archive.read(f"{about}/entry_points.txt").decode()
        metadata = Metadata.from_email(archive.read(f"{about}/METADATA"), validate=True)
    assert metadata.name == "symrefine"
    assert metadata.description_content_type == "text/markdown"


def test_sdist_holds_what_its_tests_need(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    needed = {name for folder in ("symrefine", "tests", "experiments", "configs", "docs") for name in tracked(folder)}
    assert not needed - names
    assert {"README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "Makefile", "pyproject.toml"} <= names
    assert not {name for name in names if name.startswith((".venv", "out", "dist"))}


def test_sdist_makes_the_same_wheel(sdist: Path, wheel: Path, tmp_path: Path) -> None:
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    again = built(tmp_path / sdist.name.removesuffix(".tar.gz"), tmp_path / "out", "wheel")
    assert [path.read_bytes() for path in again] == [wheel.read_bytes()]


def test_the_container_gets_what_it_copies() -> None:
    steps = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    copied = {source for step in steps if step.startswith("COPY ") for source in step.split()[1:-1]}
    let_in = {line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line[0] == "!"}
    assert copied == let_in
    assert all((ROOT / name).exists() for name in copied)
