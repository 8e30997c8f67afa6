"""The paper's experiments in one go: `python -m experiments.studies.reproduce [--full]`, which is `make reproduce`.

Runs the quick version of every study named in configs/reproduce.yaml and writes out/reproduce/report.md: for each claim
the paper's figure, ours and those of others side by side, and the misses by name. The main claims also become the table
docs/reproduce_table.md, with a picture beside it, and go into the README between its two markers.
"""

import argparse
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from experiments.studies.pages import put, write
from symrefine.errors import InputError, SymrefineError

if TYPE_CHECKING:
    from symrefine.study.claims import Verdict
    from symrefine.study.runner import Outcome

HOME = Path(__file__).parents[2]
CONFIG = HOME / "configs" / "reproduce.yaml"
# Of the table in the README.
MARK = "reproduce"


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of one of the studies."""

    config: str
    figure: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The studies, in the order of the report, and the README's picture.

    `fetched` are those of them that need the meshes that `experiments.objects.models` fetches.
    """

    configs: list[str]
    picture: Picture
    fetched: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One study: what came of it, or why it was left out or could not be run."""

    name: str
    title: str
    seconds: float
    outcome: "Outcome | None"
    error: str = ""
    left_out: str = ""


def main(argv: Sequence[str] | None = None) -> int:
    """Run all parts, write the report and the README's table; 1 if a part could not be run, misses or not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=CONFIG, help="which studies (default: configs/reproduce.yaml)")
    parser.add_argument("--out", type=Path, default=Path("out/reproduce"), help="directory to write to")
    parser.add_argument("--full", action="store_true", help="all runs of every study instead of the quick version")
    parser.add_argument("--workers", type=int, default=2, help="runs done at the same time (default: 2)")
    parser.add_argument("--docs", type=Path, default=HOME, help="where README.md and docs/ are (default: here)")
    options = parser.parse_args(argv)
    from symrefine.fleet.limits import one_thread_each

    one_thread_each()  # before anything heavy is imported
    from symrefine.study.document import read_document
    from symrefine.study.typed import typed

    config: Config = typed(read_document(options.config), Config)
    without = missing_models()
    parts = []
    for name in config.configs:
        path = options.config.parent / name
        if without and name in config.fetched:
            part = Part(name=name, title=path.stem, seconds=0.0, outcome=None, left_out=without)
        else:
            part = run_part(path, options.out, full=options.full, workers=options.workers)
        print(_line(part), flush=True)
        parts.append(part)
    write(options.out / "report.md", report(parts, full=options.full))
    write_docs(parts, config.picture, options.docs)
    missed = sum(verdict.met is False for verdict in _verdicts(parts))
    print(f"{sum(p.seconds for p in parts):.0f} s, {missed} misses; written to {options.out / 'report.md'}")
    return int(any(part.error for part in parts))


def missing_models() -> str:
    """Bring the real meshes into the cache if they are not there; why they could not be brought, else nothing."""
    from experiments.objects.models import cache_folder, download_package, fetch

    try:
        fetch(cache_folder(), download_package)
    except InputError as error:
        return f"no real meshes: {error}"
    return ""


def run_part(path: Path, out: Path, *, full: bool, workers: int) -> Part:
    """Run one study; rows of another version of the code are done again."""
    from symrefine.cli.signs import progress
    from symrefine.fleet.crew import on_this_machine
    from symrefine.study.plan import make_plan
    from symrefine.study.runner import run_study

    start = perf_counter()
    try:
        plan = make_plan(path, quick=not full)
        outcome = run_study(plan, out / path.stem, executor=on_this_machine(workers), replace=True, progress=progress)
    except (SymrefineError, OSError) as error:
        return Part(
            name=path.name,
            title=path.stem,
            seconds=perf_counter() - start,
            outcome=None,
            error=" ".join(str(error).split()),
        )
    return Part(name=path.name, title=plan.study.title or path.stem, seconds=perf_counter() - start, outcome=outcome)


def _line(part: Part) -> str:
    if part.outcome is None:
        return f"{part.title}: {_why(part)}"
    missed = sum(v.met is False for v in part.outcome.verdicts)
    failed = f", {part.outcome.failed} failed" if part.outcome.failed else ""
    return (
        f"{part.title}: {len(part.outcome.rows)} runs{failed} in {part.seconds:.0f} s, "
        f"{len(part.outcome.verdicts)} claims, {missed} missed"
    )


def _why(part: Part) -> str:
    """Why a study has no outcome."""
    return f"left out: {part.left_out}" if part.left_out else f"could not be run: {part.error}"


def _verdicts(parts: Sequence[Part]) -> list["Verdict"]:
    return [verdict for part in parts if part.outcome is not None for verdict in part.outcome.verdicts]


def report(parts: Sequence[Part], *, full: bool) -> str:
    """The report in Markdown: the main claims, the misses, then every study with all its claims, tables, figures."""
    version = "the full version" if full else "the quick version (fewer seeds; `--full` runs everything)"
    chapters = [
        "# The paper's experiments, reproduced",
        f"Written by `make reproduce` with {version}. Every figure comes from the rows.csv beside each study.",
        f"## Main figures\n\n{main_table(_verdicts(parts))}",
        f"## Misses\n\n{misses(parts)}",
        *(_chapter(part) for part in parts),
    ]
    return "\n\n".join(chapter.rstrip("\n") for chapter in chapters) + "\n"


def main_table(verdicts: Sequence["Verdict"]) -> str:
    """The claims that the configs call main, and others that ours misses: the paper's figure, ours, those of others."""
    from symrefine.study.summary import EMPTY, short
    from symrefine.study.tables import grid

    lines = []
    for verdict in verdicts:
        claim = verdict.claim
        if not (claim.main or verdict.met is False) or not verdict.ours.values:
            continue
        unit = f" {claim.unit}" if claim.unit else ""
        others = [f"{name} {p.text}{unit if p.text != EMPTY else ''}" for name, p in verdict.peers.items()]
        paper = claim.paper if isinstance(claim.paper, str) else short(claim.paper) + unit
        missed = f"<br>missed: {verdict.expected} expected" if verdict.met is False else ""
        lines.append([claim.claim, paper, f"**{verdict.ours.text}{unit}**{missed}", "<br>".join(others)])
    return grid(["", "paper", "symrefine", "others, same data, same judge"], lines)


def misses(parts: Sequence[Part]) -> str:
    """A line for each claim that is not met, each study that has no outcome, and each with runs that failed."""
    lines = []
    for part in parts:
        if part.outcome is None:
            lines.append(f"- **{part.title}** {_why(part)}")
            continue
        lines += [f"- **{part.title}**: {_miss(v)}" for v in part.outcome.verdicts if v.met is False]
        errors = sorted({str(row["error"]) for row in part.outcome.rows if row["error"] is not None})
        lines += [f"- **{part.title}**: {part.outcome.failed} runs failed, such as: {e}" for e in errors[:1]]
    return "\n".join(lines) or "None."


def _miss(verdict: "Verdict") -> str:
    claim = verdict.claim
    unit = f" {claim.unit}" if claim.unit else ""
    note = f" ({claim.note})" if claim.note else ""
    return f"{claim.claim}: ours {verdict.ours.text}{unit}, expected {verdict.expected}; paper: {claim.paper}{note}"


def _chapter(part: Part) -> str:
    if part.outcome is None:
        return f"## {part.title}\n\nThis study was {_why(part)}"
    folder = part.outcome.folder.name
    notes = [f"- {v.claim.claim}: {v.claim.note}" for v in part.outcome.verdicts if v.claim.note]
    figures = [f"![{title}]({folder}/{path.name})" for title, path in part.outcome.figures.items()]
    source = f"configs/{part.name}, [rows]({folder}/rows.csv), [timings]({folder}/timings.csv), {part.seconds:.0f} s."
    # Its tables are a level deeper here than in its own tables.md.
    pieces = [f"## {part.title}", source, part.outcome.tables.replace("## ", "### "), "\n".join(notes), *figures]
    return "\n\n".join(piece.rstrip("\n") for piece in pieces if piece)


def write_docs(parts: Sequence[Part], picture: Picture, home: Path) -> None:
    """The README's table and picture, in docs/ and in the README itself."""
    table = main_table(_verdicts(parts))
    folder = home / "docs"
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "reproduce_table.md", table)
    shown = ""
    for part in parts:
        if part.outcome is not None and part.name == picture.config and picture.figure in part.outcome.figures:
            shutil.copyfile(part.outcome.figures[picture.figure], folder / "reproduce.png")
            shown = f"\n![{picture.figure}](docs/reproduce.png)\n"
    readme = home / "README.md"
    if not readme.is_file() or f"{MARK}:begin" not in readme.read_text(encoding="utf-8"):
        print(f"{readme}: has no marker {MARK}; the table is in {folder / 'reproduce_table.md'} only", file=sys.stderr)
        return
    put(readme, MARK, table + shown)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except SymrefineError as error:
        sys.exit(f"reproduce: {error}")
    except KeyboardInterrupt:
        sys.exit("reproduce: interrupted; finished runs are kept, run it again")
