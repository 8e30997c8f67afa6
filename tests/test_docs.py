"""The documentation: it builds without a warning, needs no network to be read, and its code runs."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from decimal import Decimal
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import symrefine
from experiments.studies import pages
from symrefine.cli import BAD_INPUT, BROKEN_PIPE, BUG, INTERRUPTED, invoke
from symrefine.cli.parser import parse
from symrefine.cli.several import UNDETERMINED
from symrefine.detection.story import detect
from symrefine.errors import InputError
from symrefine.export.records import detection_record
from symrefine.shape import Shape
from symrefine.study.figures import KINDS
from symrefine.study.schema import Claim, Figure, Study, Table
from symrefine.study.summary import _NUMBERS

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.py"))
BUILDERS = ("mkdocs", "material", "mkdocstrings", "mkdocs_jupyter", "l2m4m")
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg", "NO_MKDOCS_2_WARNING": "1"}


def run(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done


class Fetched(HTMLParser):
    """What a browser fetches to show a page: addresses of scripts, styles, pictures, fonts and frames."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        if tag in {"script", "img", "iframe", "source", "video"}:
            self.addresses.append(named.get("src") or "")
        elif tag == "link" and named.get("rel") != "canonical":
            self.addresses.append(named.get("href") or "")


def fetched(page: str) -> list[str]:
    parser = Fetched()
    parser.feed(page)
    return [address for address in parser.addresses if re.match(r"(https?:)?//", address)]


def test_what_a_page_fetches_is_seen() -> None:
    page = '<script src="//a.b/c.js"></script><img src="x.png"><link rel="stylesheet" href="https://fonts/d">'
    assert fetched(page + '<a href="https://elsewhere">') == ["//a.b/c.js", "https://fonts/d"]


@pytest.mark.slow
@pytest.mark.skipif(any(find_spec(name) is None for name in BUILDERS), reason="the extra docs is not installed")
def test_site_builds_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    done = run("-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site"))
    assert "WARNING" not in done.stdout + done.stderr
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert {"index.html", "robotics.html", "api.html"} <= {page.name for page in pages}
    assert not {page.name: found for page in pages if (found := fetched(page.read_text(encoding="utf-8")))}


def test_every_command_has_its_help_on_the_page_of_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(["--help"])
    listed = re.findall(r"^ {4}(\w+)", capsys.readouterr().out.partition("COMMAND\n")[2], re.MULTILINE)
    told = re.findall(r"^\[\[help (\w+)\]\]$", (DOCS / "commands.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(told) > 5
    assert set(told) == set(listed)


def test_every_exit_status_has_its_place_in_the_help_and_on_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(["--help"])
    closing = capsys.readouterr().out.partition("Exit status:")[2]
    told = re.findall(r"^\| (\d+) \|", (DOCS / "commands.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert [int(status) for status in told] == [0, 1, BAD_INPUT, UNDETERMINED, BUG, INTERRUPTED, BROKEN_PIPE]
    assert all(re.search(rf"\b{status}\b", closing) for status in told)


def test_every_public_name_is_explained() -> None:
    explained = re.findall(
        r"^::: symrefine\.(?:\w+\.)*(\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert set(symrefine.__all__) - set(explained) == {"__version__"}


def test_the_page_of_experiments_tells_every_key_and_its_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (DOCS / "experiments.md").read_text(encoding="utf-8")
    keys = {field.name for kind in (Study, Table, Figure, Claim) for field in fields(kind)} - {"node"}
    told = set(re.findall(r"`(\w+)`", page))
    assert {*keys, *KINDS, *_NUMBERS} <= told
    for language, name in (("python", "turned_boxes.py"), ("yaml", "boxes.yaml")):
        text = page.partition(f"```{language}\n")[2].partition("```")[0]
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    assert invoke(["run", "boxes.yaml", "--quick"]) == 0
    assert (tmp_path / "out/boxes/tables.md").read_text().count("1 of 1") == 2
    assert (tmp_path / "out/boxes/confidence-over-noise.png").is_file()


def used_modules(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield f"{node.module}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_use_the_front_page_alone(path: Path) -> None:
    ours = {name for name in used_modules(path) if name.partition(".")[0] in {"symrefine", "experiments", "tests"}}
    assert ours == {"symrefine"}


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path) -> None:
    run(str(path), cwd=tmp_path)


def python_blocks(page: str) -> str:
    """All Python of a page, as one program."""
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL))


def alike(shown: str, said: str) -> bool:
    """The same words and layout; decimals to one in their last digit, which an answer's own rounding can move."""
    decimal = r"[ -]\d+\.\d+"
    old, new = ([Decimal(number.strip()) for number in re.findall(decimal, text)] for text in (shown, said))
    same = re.sub(decimal, "#", shown) == re.sub(decimal, "#", said)
    return same and all(abs(a - b) <= Decimal(1).scaleb(a.as_tuple().exponent) for a, b in zip(old, new, strict=True))


@pytest.mark.slow
def test_the_first_page_does_what_it_says(tmp_path: Path) -> None:
    """Its Python runs, its commands say what is printed there: the group, the confidence, the rows of figures."""
    page = (DOCS / "index.md").read_text(encoding="utf-8")
    (tmp_path / "page.py").write_text(python_blocks(page), encoding="utf-8")
    run("page.py", cwd=tmp_path)
    shown = re.search(r"^\$ symrefine detect stool.csv\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert shown
    said = run("-m", "symrefine", "detect", "stool.csv", cwd=tmp_path).stdout
    timeless = [re.sub(r", [\d.]+ s$", "", text.strip(), flags=re.MULTILINE) for text in (shown[1], said)]
    assert alike(*timeless), said
    assert not alike(timeless[0], timeless[1].replace("C3v", "C3"))
    assert not alike("offset -0.5001  0.00015", "offset -0.5003  0.00015")


def test_the_page_on_poses_does_what_it_says() -> None:
    program = python_blocks((DOCS / "poses.md").read_text(encoding="utf-8"))
    assert "symrefine.Canonicalizer" in program
    exec(program, {})


@pytest.mark.slow
def test_the_page_on_alignment_does_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    exec(python_blocks((DOCS / "alignment.md").read_text(encoding="utf-8")), {})
    assert (tmp_path / "map.html").is_file()


def names(record: object) -> Iterator[str]:
    """Names of all fields of a report, those inside others too, but of `options` and `timings`, which vary."""
    if isinstance(record, dict):
        for name, value in record.items():
            yield name
            yield from () if name in {"options", "timings"} else names(value)
    elif isinstance(record, list):
        for value in record:
            yield from names(value)


def test_the_page_on_reports_tells_every_field() -> None:
    """Of octahedra with one atom of another kind: as they are, with planes and an axis; and bent, with near misses."""
    found: set[str] = set()
    for stretch in (1.0, 1.08):
        points = np.vstack([np.diag([stretch, 1.0, 1.0]), -np.eye(3)])
        shape = Shape(points=points, labels=[1, 1, 1, 1, 1, 2])
        found |= set(names(detection_record(detect(shape, ladder=(0.01, 0.04)), shape, options={})))
    page = (DOCS / "report.md").read_text(encoding="utf-8").partition("## The JSON")[2]
    told = set(re.findall(r"`(\w+)", page))
    assert {"improper", "offset", "excess", "forgiven", "staircase", "coverage", "sigma"} <= found
    assert found - told == set()


def answers(page: str) -> list[str]:
    """What a page says that the commands on it answer: a file and its group each."""
    return re.findall(r"^(\S+: (?:at least )?\w+), ", page, re.MULTILINE)


@pytest.mark.slow
def test_the_gallery_says_what_its_commands_say(tmp_path: Path) -> None:
    run("-m", "experiments.studies.docs_gallery", "--out", str(tmp_path))
    told, said = ((folder / "gallery.md").read_text(encoding="utf-8") for folder in (DOCS, tmp_path))
    assert len(answers(told)) > 8
    assert answers(told) == answers(said)
    shown = {path.name for path in (tmp_path / "figures").iterdir()}
    assert shown == {path.name for path in (DOCS / "figures").glob("gallery_*")}
    assert all(f"figures/{name}" in told for name in shown)


@pytest.mark.slow
def test_figures_of_the_documentation_are_drawn(tmp_path: Path) -> None:
    run("-m", "experiments.studies.docs_figures", "--out", str(tmp_path))
    drawn = {path.name for path in tmp_path.iterdir()}
    pages = "".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.md"))
    assert drawn == {path.name for path in (DOCS / "figures").iterdir() if not path.name.startswith("gallery_")}
    assert all(f"figures/{name}" in pages for name in drawn)


def test_contributing_names_the_rooms_that_the_contract_has_floor_by_floor() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(c["layers"] for c in contracts["contracts"] if c["id"] == "house")
    floors = [set(re.findall(r"\w+", layer)) for layer in layers if layer != "__main__"]
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("| one thought each |")[2]
    told = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", page.partition("\n\n")[0], re.MULTILINE)
    assert [set(re.findall(r"\w+", rooms)) for rooms in told] == floors


@pytest.mark.slow
def test_the_page_of_fleets_does_what_it_says(tmp_path: Path) -> None:
    """Its Python runs, in processes of its own."""
    box = "".join(f"{x} {y} {z}\n" for x in (-1, 1) for y in (-2, 2) for z in (-3, 3))
    head = "".join(f"property float {name}\n" for name in "xyz")
    (tmp_path / "mug.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 8\n{head}end_header\n{box}")
    (tmp_path / "page.py").write_text(python_blocks((DOCS / "fleets.md").read_text(encoding="utf-8")), encoding="utf-8")
    assert run("page.py", cwd=tmp_path).stdout == "mug D2h\n"


@pytest.mark.parametrize(
    ("page", "name"),
    [("robustness.md", "fuzz"), ("fleets.md", "kills"), ("fleets.md", "cluster"), ("fleets.md", "memory")],
)
def test_tables_of_campaigns_are_put_there_by_commands(page: str, name: str, tmp_path: Path) -> None:
    copy = tmp_path / page
    copy.write_bytes((DOCS / page).read_bytes())
    pages.put(copy, name, "| a |\n")
    before, after = copy.read_text(encoding="utf-8").split("| a |")
    assert before.endswith(f"<!-- {name}:begin -->\n")
    assert after.startswith(f"\n<!-- {name}:end -->\n")
    with pytest.raises(InputError, match="expected the markers"):
        pages.check(copy, "nothing")


@pytest.mark.slow
def test_a_campaign_of_few_cases_writes_its_table(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("x\n<!-- fuzz:begin -->\n<!-- fuzz:end -->\ny\n", encoding="utf-8")
    asked = ("--cases", "20", "--only", ".xyz", "--jobs", "1", "--page", str(page))
    said = run("-m", "experiments.studies.fuzz", *asked)
    shown = page.read_text(encoding="utf-8")
    assert "| .xyz | 20 |" in shown
    assert shown.split("<!-- fuzz:begin -->\n")[1].split("\n<!--")[0] in said.stdout
