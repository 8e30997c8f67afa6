"""The house rules that no linter knows."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "symrefine"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# A worker process may end itself when its parent is gone.
WORKERS = {Path("fleet") / "cell.py"}
LONGEST_MODULE = 400
HEAVY = {"casadi", "matplotlib", "open3d", "rerun", "scipy"}  # 0.1 s to 1 s each, and `--help` needs none


def modules(*folders: str) -> list[Path]:
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def first_match(pattern: str, file: str) -> str:
    found = re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    assert found, f"{file}: nothing matches {pattern}"
    return found[1]


def test_version_is_the_same_everywhere() -> None:
    assert first_match(r"^version: *['\"]?([^\s'\"]+)", "CITATION.cff") == PROJECT["version"]
    assert first_match(r"^## \[?([^\s\]]+)", "CHANGELOG.md") == PROJECT["version"]


def test_modules_are_short() -> None:
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in modules("symrefine", "experiments")}
    too_long = {str(path.relative_to(ROOT)): n for path, n in lines.items() if n > LONGEST_MODULE}
    assert not too_long, f"longer than {LONGEST_MODULE} lines: {too_long}"


def speaks_or_exits(node: ast.AST) -> bool:
    """Whether the node prints or ends the process, by any of the usual names."""
    match node:
        case ast.Call(func=ast.Name(id="print" | "exit" | "quit")):
            return True
        case ast.Attribute(value=ast.Name(id="sys"), attr="exit" | "stdout" | "stderr"):
            return True
        case ast.Attribute(value=ast.Name(id="os"), attr="_exit"):
            return True
        case ast.ImportFrom(module="sys", names=names):
            return any(alias.name in {"exit", "stdout", "stderr"} for alias in names)
        case ast.Name(id="SystemExit"):
            return True
    return False


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("print(1)", True),
        ("import sys\nsys.exit(2)", True),
        ("from sys import exit", True),
        ("raise SystemExit(2)", True),
        ("import os\nos._exit(1)", True),
        ("'print(1)'", False),
        ("import sys\nsys.maxsize", False),
        ("exit = 1", False),
    ],
)
def test_speaking_and_exiting_are_recognised(source: str, expected: bool) -> None:
    assert any(speaks_or_exits(node) for node in ast.walk(ast.parse(source))) is expected


def test_only_the_command_line_prints_and_exits() -> None:
    offenders = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in modules("symrefine")
        if path.relative_to(PACKAGE).parts[0] not in {"cli", "cli.py"} and path.relative_to(PACKAGE) not in WORKERS
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if speaks_or_exits(node)
    ]
    assert not offenders


def imported(path: Path) -> set[str]:
    """Names of all modules that a file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_the_product_knows_no_experiments() -> None:
    beside = ("experiments", "benchmarks", "tests")
    offenders = {path.name: name for path in modules("symrefine") for name in imported(path) if name.startswith(beside)}
    assert not offenders


@pytest.mark.parametrize("drawer", ["objects", "ecins", "peers"])
def test_what_is_studied_knows_no_study_and_no_other_drawer(drawer: str) -> None:
    inside = f"experiments.{drawer}."
    others = {
        f"{path.name}: {name}"
        for path in modules(f"experiments/{drawer}")
        for name in imported(path)
        if name.startswith("experiments.") and not f"{name}.".startswith(inside)
    }
    assert not others


def test_every_experiment_lies_in_a_drawer_that_says_what_belongs_there() -> None:
    assert [path.name for path in (ROOT / "experiments").glob("*.py")] == ["__init__.py"]
    drawers = [path for path in (ROOT / "experiments").iterdir() if any(path.glob("*.py"))]
    assert {path.name for path in drawers} == {"objects", "studies", "ecins", "peers"}
    for drawer in drawers:
        assert ast.get_docstring(ast.parse((drawer / "__init__.py").read_text(encoding="utf-8")))


def test_commands_in_texts_name_modules_that_are_there() -> None:
    texts = [*ROOT.glob("*.md"), ROOT / "Makefile", *(ROOT / "docs").glob("*.md"), *(ROOT / "configs").glob("*.yaml")]
    texts += modules("symrefine", "experiments", "benchmarks")
    named = {
        name
        for path in texts
        for name in re.findall(
            r"(?:-m |^experiment: |`)(experiments(?:\.\w+)+)", path.read_text(encoding="utf-8"), re.MULTILINE
        )
    }
    assert len(named) > 10
    assert not {name for name in named if not (ROOT / Path(*name.split("."))).with_suffix(".py").is_file()}


@pytest.mark.skipif(find_spec("symrefine.cli") is None, reason="symrefine.cli is still to come")
def test_help_imports_nothing_heavy() -> None:
    command = [sys.executable, "-X", "importtime", "-m", "symrefine", "--help"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    imported = {name.split(".")[0] for name in re.findall(r"^import time:.*\| +(\S+)$", done.stderr, re.MULTILINE)}
    assert "symrefine" in imported
    assert not imported & HEAVY


def test_lock_pins_every_requirement_and_names_no_place() -> None:
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    pins = [Requirement(line) for line in lines if line and not line.lstrip().startswith("#")]
    locked = {canonicalize_name(pin.name): str(pin.specifier) for pin in pins}
    assert all(re.fullmatch(r"==[^*,]+", version) for version in locked.values())
    assert not any("/" in line for line in lines), "an index, a link or a path of one machine"
    # What `make setup` installs; the other extras are the users' choice.
    for extra in ([], PROJECT["optional-dependencies"]["dev"]):
        for wanted in map(Requirement, [*PROJECT["dependencies"], *extra]):
            version = locked.get(canonicalize_name(wanted.name), "nothing").removeprefix("==")
            assert version in wanted.specifier, f"requirements.lock has {version} for {wanted}: run `make lock`"
