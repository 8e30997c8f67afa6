"""A study from its config to rows, tables, figures and recordings; a killed run goes on where it ended."""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from symrefine.errors import InputError
from symrefine.files import replacing
from symrefine.fleet.crew import HERE, Executor
from symrefine.fleet.journal import Latest
from symrefine.fleet.rows import Rows
from symrefine.fleet.shard import Shard, Whole
from symrefine.fleet.table import write_table
from symrefine.fleet.tasks import finish, is_final
from symrefine.study.claims import Verdict, claims_table, judge, verdict_rows
from symrefine.study.document import Node
from symrefine.study.experiment import Row
from symrefine.study.figures import check_figures, draw
from symrefine.study.journal import Entry, Stamp, opened
from symrefine.study.plan import Plan, select, varying
from symrefine.study.summary import Measure, check_columns
from symrefine.study.tables import check_tables, markdown
from symrefine.study.versions import code_version, library_versions
from symrefine.study.work import attempt, lost, parcel

JOURNAL = "journal.jsonl"
RECORDINGS = "recordings"
_NAMES = ("rows.csv", "timings.csv", "claims.csv", "tables.md", "traces.csv")
# (text, steps in all, steps done before) to a context that gives a function to call after each step.
Progress = Callable[[str, int, int], AbstractContextManager[Callable[[], None]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a study came to, and where it was written.

    Rows of the finished runs are in the order of the sweep, with their timings and without, as in rows.csv, and read
    from the journal when asked for; Markdown is as in tables.md, figures by title. Told is, too, how many of the runs
    had been done before, and how many have an error.
    """

    folder: Path
    rows: Sequence[Row]
    untimed: Sequence[Row]
    verdicts: Sequence[Verdict]
    tables: str
    figures: Mapping[str, Path]
    resumed: int
    failed: int


def run_study(
    plan: Plan,
    folder: Path,
    *,
    executor: Executor = HERE,
    shard: Shard | None = None,
    limit: int | None = None,
    replace: bool = False,
    progress: Progress = lambda *_: nullcontext(lambda: None),
) -> Outcome:
    """Run what is not done yet and write what the config asks for.

    Args:
        folder: to write to; made if it is not there.
        executor: what does the runs, which changes nothing but the time; runs lost to other limits are tried again.
        shard: the runs of this shard only.
        limit: the first so many runs of the sweep only.
        replace: whether rows of another config or code version in the folder are dropped instead of refused.

    Raises:
        InputError: something in the config does not fit, or the folder holds other rows.
    """
    measures = _check(plan)
    code = code_version(plan.experiment.name, plan.experiment.root)
    stamp = Stamp(config=plan.config_hash, code=code, libraries=library_versions())
    _refuse_foreign(plan, folder)
    _make(folder)
    fleet = Whole.of(len(plan.cases), [asdict(stamp)])
    first = range(len(plan.cases) if limit is None else min(limit, len(plan.cases)))
    wanted = [index for index in first if shard is None or shard.takes(index)]
    with opened(folder / JOURNAL, stamp, len(plan.cases), replace=replace) as journal:
        found = journal.latest
        kept = {i for i, row in found.items() if is_final(row, executor.limits) and fleet.has(row, shard, int(i))}
        before = sum(index in kept for index in wanted)
        jobs = [
            parcel(plan.experiment, index, plan.cases[index], asdict(stamp) | fleet.mark(shard, index))
            for index in wanted
            if index not in kept
        ]
        with progress("running", len(wanted), before) as advance:
            for _ in finish(executor, attempt, jobs, lost, journal):
                advance()
        return _write(plan, folder, stamp, found, measures, before, progress)


def _check(plan: Plan) -> list[Measure]:
    """The measures of everything that is made of the rows, after a look at the names in the config."""
    study, experiment = plan.study, plan.experiment
    measures = [*check_tables(study, experiment), *check_figures(study, experiment), *(c.value for c in study.claims)]
    if study.record and experiment.record is None:
        raise study.record[0].error(f"{experiment.name} has no `record`")
    selections = [*study.record, *(table.where for table in study.tables), *(figure.where for figure in study.figures)]
    for where in selections:
        _must_pick(where, plan)
    for claim in study.claims:
        for who in (claim.ours, *claim.peers.values()):
            _must_pick(who, plan, claim.where)
    slugs = [_slug(figure.title) for figure in study.figures]
    for figure, slug in zip(study.figures, slugs, strict=True):
        if not slug or slugs.count(slug) > 1:
            raise figure.node.at("title").error("names the file: expected a title of its own")
    return measures


def _must_pick(where: Node, plan: Plan, *common: Node) -> None:
    """Refuse what picks no run, which is a slip of the pen; the command line may leave runs out on purpose."""
    picks = [select(node, plan.experiment) for node in (where, *common)]
    if not plan.changed and not any(all(pick(asdict(case)) for pick in picks) for case in plan.cases):
        raise where.error("picks no run of the sweep")


def _refuse_foreign(plan: Plan, folder: Path) -> None:
    """Refuse a folder that no study has written to but that has files of the names which this one will write."""
    if (folder / JOURNAL).exists():
        return
    for name in [*_NAMES, *(f"{_slug(figure.title)}.png" for figure in plan.study.figures), RECORDINGS]:
        if (folder / name).exists():
            raise InputError(
                f"{folder / name}: is there already and not of a study, whose journal would be beside it; "
                "name another directory with --out"
            )


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(f"{folder}: cannot be made a directory: a file is in the way") from None


def _write(
    plan: Plan, folder: Path, stamp: Stamp, found: Latest, measures: Sequence[Measure], before: int, progress: Progress
) -> Outcome:
    """Write rows first, then what is made of them."""
    order = sorted(found)
    about = {"config": stamp.config, "code": stamp.code, **stamp.libraries}

    def made(of: Callable[[Row, Entry], Row]) -> Rows:
        """A row of each run, from its case and its entry."""

        def make(k: int) -> Row:
            entry = Entry.of(found[order[k]])
            return of(asdict(plan.cases[entry.index]), entry)

        return Rows(len(order), make)

    rows = made(lambda case, entry: {**case, **about, "error": entry.error, **entry.results})
    full = made(lambda case, entry: {**case, **about, "error": entry.error, **entry.results, **entry.timings})
    _table(folder / "rows.csv", rows)
    _table(folder / "timings.csv", made(lambda case, entry: {**case, **entry.timings}))
    check_columns(measures, full)
    study, experiment = plan.study, plan.experiment
    verdicts = [judge(claim, full, experiment) for claim in study.claims]
    tables = [markdown(table, full, experiment) for table in study.tables]
    if verdicts:
        tables.append(f"## Claims\n\n{claims_table(verdicts)}")
        _table(folder / "claims.csv", verdict_rows(verdicts))
    if tables:
        _text(folder / "tables.md", "\n".join([f"# {study.title or study.experiment}\n", *tables]))
    failed = frozenset(order[k] for k, row in enumerate(rows) if row["error"] is not None)
    chosen = [plan.cases[int(index)] for index in order if index not in failed]
    figures = _figures(plan, folder, full, chosen, progress)
    _record(plan, folder, chosen, progress)
    return Outcome(
        folder=folder,
        rows=full,
        untimed=rows,
        verdicts=verdicts,
        tables="\n".join(tables),
        figures=figures,
        resumed=before,
        failed=len(failed),
    )


def _figures(
    plan: Plan, folder: Path, rows: Sequence[Row], chosen: Sequence[Any], progress: Progress
) -> dict[str, Path]:
    iterations = _trace(plan, chosen, progress)
    if iterations:
        _table(folder / "traces.csv", iterations)
    written = {}
    for figure in plan.study.figures:
        path = folder / f"{_slug(figure.title)}.png"
        source = iterations if figure.kind == "convergence" else rows
        known = {name: None for row in source for name in row}
        needed = {"x": figure.x, "y": figure.y.node.value} if figure.kind == "convergence" and source else {}
        for key, name in needed.items():
            if name not in known:
                raise figure.node.at(key).error(f"no iteration has {name!r}; there are {' '.join(known)}")
        with replacing(path) as draft:
            draw(figure, source, plan.experiment, draft)
        written[figure.title] = path
    return written


def _trace(plan: Plan, chosen: Sequence[Any], progress: Progress) -> list[Row]:
    """A row for each iteration of each run that a figure shows."""
    trace = plan.experiment.trace
    cases = _picked(plan, chosen, [figure.where for figure in plan.study.figures if figure.kind == "convergence"])
    if trace is None or not cases:
        return []
    rows: list[Row] = []
    with progress("following iterations", len(cases), 0) as advance:
        for run, case in enumerate(cases):
            rows += [{"run": run, **asdict(case), "error": None, **step} for step in trace(case)]
            advance()
    return rows


def _picked(plan: Plan, cases: Sequence[Any], wheres: Sequence[Node]) -> list[Any]:
    """The cases that one of the selections picks."""
    picks = [select(where, plan.experiment) for where in wheres]
    return [case for case in cases if any(pick(asdict(case)) for pick in picks)]


def _record(plan: Plan, folder: Path, chosen: Sequence[Any], progress: Progress) -> None:
    record = plan.experiment.record
    cases = _picked(plan, chosen, plan.study.record)
    if record is None or not cases:
        return
    _make(folder / RECORDINGS)
    with progress("recording", len(cases), 0) as advance:
        for case in cases:
            with replacing(folder / RECORDINGS / f"{_name(case, plan.cases)}.rrd") as draft:
                record(case, draft)
            advance()


def _name(case: Any, cases: Sequence[Any]) -> str:
    """The fields in which the cases of the sweep differ, as a file name."""
    return _slug("-".join(str(getattr(case, name)) for name in varying(cases)), keep=".") or "run"


def _slug(text: str, keep: str = "") -> str:
    return re.sub(rf"[^a-z0-9{re.escape(keep)}]+", "-", text.lower()).strip("-")


def _table(path: Path, rows: Sequence[Row]) -> None:
    with replacing(path) as draft:
        write_table(rows, draft)


def _text(path: Path, text: str) -> None:
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="")
