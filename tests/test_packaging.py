"""Wheel and sdist: what is in them, and that the one comes from the other."""

import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.metadata import Metadata

ROOT = Path(__file__).resolve().parents[1]
NO_ADDRESS = 'repository = ""\n'
ADDRESS = "https://git.example.org/group/symrefine"
README_POINTS_TO = re.findall(r"\]\(([^()#\s]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
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


@pytest.fixture(scope="module")
def public(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout that has a public address."""
    root = tmp_path_factory.mktemp("public")
    with tarfile.open(sdist) as archive:
        archive.extractall(root, filter="data")
    tree = root / sdist.name.removesuffix(".tar.gz")
    (tree / "PKG-INFO").unlink()
    project = tree / "pyproject.toml"
    text = project.read_text(encoding="utf-8")
    assert text.count(NO_ADDRESS) == 1
    project.write_text(text.replace(NO_ADDRESS, f'repository = "{ADDRESS}/"\n'), encoding="utf-8")
    return tree


def described(paths: list[Path], *options: str) -> tuple[int, list[str]]:
    """Status of the check that `make wheel` asks, and its lines."""
    command = [sys.executable, ROOT / ".ci" / "description.py", *options, *paths]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stderr.splitlines()


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


def test_an_index_gets_no_picture_and_no_link_that_leads_nowhere(wheel: Path, sdist: Path) -> None:
    assert described([wheel, sdist]) == (0, [])
    status, lines = described([wheel], "--repository", ADDRESS)
    assert status == 1
    assert lines[0] == f"error: {wheel.name}: the pictures of README are missing"
    assert len(lines) == 5  # and four addresses


def test_with_an_address_pictures_and_links_are_found_at_the_tag(public: Path, tmp_path: Path) -> None:
    paths = built(public, tmp_path, "wheel", "sdist")
    assert described(paths, "--repository", ADDRESS) == (0, [])
    with zipfile.ZipFile(next(path for path in paths if path.suffix == ".whl")) as archive:
        about = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = Metadata.from_email(archive.read(about), validate=True)
    at = f"v{metadata.version}"
    assert metadata.project_urls == {
        "Homepage": ADDRESS,
        "Documentation": f"{ADDRESS}/blob/{at}/docs/index.md",
        "Changelog": f"{ADDRESS}/blob/{at}/CHANGELOG.md",
        "Issues": f"{ADDRESS}/issues",
    }
    assert metadata.description is not None
    assert f"]({ADDRESS}/raw/{at}/docs/table.png)" in metadata.description
    assert f"[CONTRIBUTING.md]({ADDRESS}/blob/{at}/CONTRIBUTING.md)" in metadata.description
    for path in README_POINTS_TO:
        assert f"/{at}/{path})" in metadata.description
        assert (ROOT / path).is_file()


def test_an_sdist_that_has_an_address_keeps_it(public: Path, tmp_path: Path) -> None:
    wheel = built(public, tmp_path / "wheel", "wheel")[0]
    (source,) = built(public, tmp_path / "sdist", "sdist")
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    again = built(tmp_path / source.name.removesuffix(".tar.gz"), tmp_path / "again", "wheel")
    assert [path.read_bytes() for path in again] == [wheel.read_bytes()]


def test_a_link_that_leads_nowhere_fails_the_check(public: Path, tmp_path: Path) -> None:
    tree = shutil.copytree(public, tmp_path / "tree")
    with (tree / "README.md").open("a", encoding="utf-8") as readme:
        readme.write('\n<img src="docs/table.png">\n\n[gone](#no-such-heading), [a file][1]\n\n[1]: docs/index.md\n')
    paths = built(tree, tmp_path / "out", "wheel")
    assert described(paths) == (
        1,
        [
            f"error: {paths[0].name}: a relative picture or link is left: docs/table.png",
            f"error: {paths[0].name}: no heading for the link to #no-such-heading",
            f"error: {paths[0].name}: a relative picture or link is left: docs/index.md",
        ],
    )


def test_code_in_readme_is_no_link(public: Path, tmp_path: Path) -> None:
    tree = shutil.copytree(public, tmp_path / "tree")
    code = "`x[0](y)` and\n\n```python\nx[i](y)  # [a](b.md)\n```\n"
    with (tree / "README.md").open("a", encoding="utf-8") as readme:
        readme.write(f"\n{code}")
    with zipfile.ZipFile(built(tree, tmp_path / "out", "wheel")[0]) as archive:
        about = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        assert archive.read(about).decode().endswith(code)


@pytest.mark.parametrize("address", ["github.com/me/symrefine", "https://github.com", "ftp://host/path"])
def test_an_address_that_is_none_is_refused(public: Path, tmp_path: Path, address: str) -> None:
    tree = shutil.copytree(public, tmp_path / "tree")
    project = tree / "pyproject.toml"
    project.write_text(project.read_text(encoding="utf-8").replace(f"{ADDRESS}/", address), encoding="utf-8")
    command = [sys.executable, "-m", "hatchling", "metadata"]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode
    assert f"repository is '{address}'; expected https://HOST/PATH" in done.stderr


def test_the_container_gets_what_it_copies() -> None:
    steps = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    copied = {source for step in steps if step.startswith("COPY ") for source in step.split()[1:-1]}
    let_in = {line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line[0] == "!"}
    assert copied == let_in
    assert all((ROOT / name).exists() for name in copied)
